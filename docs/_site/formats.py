"""The table of file formats and their options, from the registry."""

from __future__ import annotations

import inspect
from pathlib import Path

from _site.markup import plain, table, write_page
from brdfdb.formats import EXPORTERS, IMPORTERS, FormatOption, options_of


def write(docs: Path, _: Path) -> None:
    """Write ``reference/generated/formats.txt``, which ``reference/formats.md`` includes."""
    rows = [
        (
            f"[`{name}`](#format-{name})",
            f"`{exporter.suffix}`",
            plain(exporter.summary),
            plain(exporter.tools),
            "yes" if name in IMPORTERS else "",
        )
        for name, exporter in EXPORTERS.items()
    ]
    readers = [name for name in IMPORTERS if name not in EXPORTERS]
    read_alone = [(f"`{name}`", f"`{IMPORTERS[name].suffix}`", plain(_summary(name))) for name in readers]
    parts = [
        "These formats are read, and not written.\n",
        table(("format", "files", "holds"), read_alone),
        "These are written.\n",
        table(("format", "files", "holds", "read by", "read again by brdfdb"), rows),
        *map(_section, EXPORTERS),
    ]
    write_page(docs / "reference" / "generated" / "formats.txt", "\n".join(parts))


def _summary(name: str) -> str:
    """Return the first line of the docstring of a format, without the name of the format."""
    return (inspect.getdoc(IMPORTERS[name]) or "").splitlines()[0].partition(": ")[2]


def _section(name: str) -> str:
    exporter = EXPORTERS[name]
    first, _, rest = (inspect.getdoc(exporter) or "").partition("\n\n")
    rows = [
        (f"`--{option.name.replace('_', '-')}`", plain(option.help), _allowed(option), _default(option))
        for option in options_of(exporter).values()
    ]
    options = table(("option", "meaning", "values", "default"), rows) if rows else "It has no options.\n"
    return "\n".join([f"(format-{name})=", f"## {name}\n", f"{plain(first)}\n", f"{_prose(rest)}\n", options])


def _prose(text: str) -> str:
    """Return paragraphs of a docstring as MyST: code in single backquotes."""
    return text.replace("``", "`")


def _allowed(option: FormatOption) -> str:
    if option.choices:
        return ", ".join(f"`{choice}`" for choice in option.choices)
    return "" if isinstance(option.default, bool) else plain(option.allowed)


def _default(option: FormatOption) -> str:
    if option.name == "kind":
        return "a file of each kind"
    return f"`{str(option.default).lower()}`" if option.default != "" else ""
