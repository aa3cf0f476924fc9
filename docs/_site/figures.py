"""The pages of the gallery's figures: those of the papers, and those of the atlas, by paper."""

from __future__ import annotations

import ast
import functools
import inspect
import re
import textwrap
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import brdfdb.atlas
import brdfdb.gallery
from _site import audit
from _site.markup import WIDE, Card, cards, code, plain, raw, remove_others, toctree, write_page
from _site.papers import PAPERS, Paper, paper_of, reference
from brdfdb.figure import Figure, Statement

_COLLECTIONS = {
    "gallery": ("Figures", "GALLERY", "The figures of this paper, computed, with its own sentences about them."),
    "atlas": (
        "Where methods fail",
        "ATLAS",
        "Printed, customary and 32-bit forms beside ours, against closed forms and values of many digits.",
    ),
}


def write(docs: Path, store: Path) -> None:
    """Write ``gallery/figures``: a page a figure, and an index for each paper and collection."""
    folder = docs / "gallery" / "figures"
    found = audit.read(store)
    names = []
    for key, figures in (("gallery", found.report.gallery), ("atlas", found.report.atlas)):
        for paper in PAPERS.values():
            listed = [figure for figure in figures if paper_of(figure.paper) is paper]
            if not listed:
                continue
            index = f"{key}-{paper.slug}"
            names += [index, *(figure.key for figure in listed)]
            write_page(folder / f"{index}.md", _index(key, paper, listed, found.plots))
            for figure in listed:
                write_page(folder / f"{figure.key}.md", _page(key, figure, found.plots[figure.key]))
    remove_others(folder, {f"{name}.md" for name in names})
    write_page(docs / "_static" / "figures.css", audit.style())


def _index(key: str, paper: Paper, figures: list[Figure], plots: dict[str, list[audit.Plot]]) -> str:
    """Return the page of a collection of figures of one paper."""
    title, _, sentence = _COLLECTIONS[key]
    shown = [Card(f"{figure.key}.html", figure.title, _held(figure), plots[figure.key][0].svg) for figure in figures]
    parts = [WIDE, f"# {title}: {paper.short}\n", f"{paper.title}. {sentence}\n", cards(shown)]
    return "\n".join([*parts, toctree(figure.key for figure in figures)])


def _held(figure: Figure) -> str:
    held = sum(statement.holds for statement in figure.statements)
    count = len(figure.statements)
    return f"{held} of {count} statements hold" if count > 1 else ("Its statement holds" if held else "Does not hold")


def _page(key: str, figure: Figure, plots: list[audit.Plot]) -> str:
    """Return the page of a figure."""
    _, mapping, _ = _COLLECTIONS[key]
    draw = getattr(getattr(brdfdb, key), mapping)[figure.key]
    module, source = source_of(draw, figure.key)
    script = (
        f"from brdfdb.{key} import {mapping}\n"
        "from brdfdb_pipelines.figure_svg import svg\n\n"
        f'figure = {mapping}["{figure.key}"]()  # panels and statements as data\n'
        f'drawings = [svg(panel, f"panel-{{n}}") for n, panel in enumerate(figure.panels)]  # for a page of yours\n'
    )
    parts = [
        WIDE,
        f"# {plain(figure.title)}\n",
        f"{plain(figure.caption)}\n",
        raw(audit.drawn(plots)),
        "## Statements\n",
        *map(_statement, figure.statements),
        "## Script\n",
        code(script, "python"),
        f"The numbers come from {{py:mod}}`{module.__name__}`.\n" if _public(module) else "",
        f":::{{dropdown}} Source, in `{module.__name__}`",
        code(source, "python"),
        ":::\n",
        "## Paper\n",
        f"{reference(figure.paper)}\n",
    ]
    return "\n".join(parts)


def _statement(statement: Statement) -> str:
    mark = "✓ **Holds.**" if statement.holds else "✕ **Does not hold.**"
    lines = [f"* {mark} {plain(statement.says)} ({plain(statement.where)})\\", f"  *Seen:* {plain(statement.seen)}"]
    if statement.threshold_from:
        lines[-1] += "\\"
        lines.append(f"  *Threshold from* {plain(statement.threshold_from)}")
    return "\n".join(lines) + "\n"


def source_of(draw: Callable[[], Figure], key: str) -> tuple[ModuleType, str]:
    """Return the module of a figure and the source that draws it: a function, or a row of the table `FIGURES`."""
    function: Any = draw.func if isinstance(draw, functools.partial) else draw
    if "<locals>" not in function.__qualname__:
        module = inspect.getmodule(function)
        assert module is not None
        return module, inspect.getsource(function)
    for module in _modules_with_figures():
        if draw in module.FIGURES.values():
            text = Path(str(module.__file__)).read_text(encoding="utf-8")
            calls = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Call) and node.args]
            for call in calls:
                if isinstance(call.args[0], ast.Constant) and call.args[0].value == key:
                    segment = ast.get_source_segment(text, call, padded=True) or ""
                    return module, textwrap.dedent(segment)
    raise LookupError(f"no source draws the figure {key}")


@functools.cache
def _modules_with_figures() -> list[ModuleType]:
    rooms = (brdfdb.gallery, brdfdb.atlas)
    modules = [module for room in rooms for module in vars(room).values() if isinstance(module, ModuleType)]
    return [module for module in modules if hasattr(module, "FIGURES")]


def _public(module: ModuleType) -> bool:
    return not re.search(r"\._", module.__name__)
