"""The pages of results: a page for each record of a benchmark, and the list of them."""

from __future__ import annotations

import sys
from pathlib import Path

from _site.markup import remove_others, write_page

sys.path.append(str(Path(__file__).parents[2]))

from tests.benchmarks.recording import Machine, Record, Table

_KINDS = {
    "accuracy": ("Accuracy", "What the numbers are worth. These runs do not depend on the machine, times apart."),
    "speed": ("Speed", "Times and rates of one machine, which each page names."),
}
_BUSY = 0.5  # processes of other programs from which on times are longer than they need be


def records(docs: Path) -> list[Record]:
    """Return all records by kind, and by title within a kind."""
    paths = sorted((docs / "results").glob("*.json"))
    order = list(_KINDS)
    every = [Record.model_validate_json(path.read_text(encoding="utf-8")) for path in paths]
    return sorted(every, key=lambda record: (order.index(record.kind), record.title))


def write(docs: Path, _: Path) -> None:
    """Write ``results/generated``: a page for each record, and the list that the index includes."""
    folder = docs / "results" / "generated"
    every = records(docs)
    for record in every:
        write_page(folder / f"{record.name}.md", _page(record))
    write_page(folder / "list.txt", _list(every))
    remove_others(folder, {"list.txt", *(f"{record.name}.md" for record in every)})


def _page(record: Record) -> str:
    lines = [f"# {record.title}", "", record.measured, ""]
    if record.quick:
        lines += _warning("This was a quick run: the smallest one that uses all of the script. Its numbers say little.")
    elif record.kind == "speed" and record.load >= _BUSY:
        busy = f"Other programs kept {record.load:g} processors busy when this run began: times are too long."
        lines += _warning(busy)
    lines += [f"* {_escaped(sentence)}" for sentence in record.sentences]
    for table in record.tables:
        lines += ["", f"## {_escaped(table.title)}", "", ":::{div} record", *_table(table), ":::"]
    lines += ["", "## Run", "", "```sh", record.command, "```", "", *_run(record.machine, record)]
    return "\n".join(lines) + "\n"


def _warning(sentence: str) -> list[str]:
    return [":::{warning}", sentence, ":::", ""]


def _table(table: Table) -> list[str]:
    """Return a table in Markdown; columns of numbers are set right."""
    columns = list(zip(*table.rows, strict=True))
    marks = ["---" if any(isinstance(value, str) for value in values) else "--:" for values in columns]
    cells = [[_escaped(c.cell(v)) for c, v in zip(table.columns, row, strict=True)] for row in table.rows]
    heads = [_escaped(column.heading) for column in table.columns]
    return [f"| {' | '.join(row)} |" for row in (heads, marks, *cells)]


def _run(machine: Machine, record: Record) -> list[str]:
    """Return machine and date of a run as a table."""
    plural = "" if machine.cores == 1 else "s"
    rows = {
        "date": f"{record.date:%Y-%m-%d}",
        "processor": f"{machine.processor}, {machine.cores} core{plural}",
        "memory": f"{machine.memory_gb:g} GB",
        "system": machine.system,
        "programs": f"Python {machine.python}, numpy {machine.numpy}, numba {machine.numba}",
        "load at the start": f"{record.load:g} processes",
    }
    return ["| | |", "|---|---|", *(f"| {name} | {_escaped(value)} |" for name, value in rows.items())]


def _list(every: list[Record]) -> str:
    """Return the list of pages by kind, with their sentences, and the tree of pages."""
    lines: list[str] = []
    for kind, (title, about) in _KINDS.items():
        lines += [f"## {title}", "", about, "", "| results | measured | run |", "|---|---|---|"]
        for record in every:
            if record.kind == kind:
                how = f"{record.date:%Y-%m-%d}" + (", quick" if record.quick else "")
                lines.append(f"| [{record.title}](generated/{record.name}.md) | {_escaped(record.measured)} | {how} |")
        lines.append("")
    names = [f"{record.title} <generated/{record.name}>" for record in every]
    return "\n".join([*lines, "```{toctree}", ":hidden:", "", *names, "```", ""])


def _escaped(text: str) -> str:
    """Return text with the marks of Markdown as they are."""
    for mark in "\\*_|<$":
        text = text.replace(mark, f"\\{mark}")
    return text
