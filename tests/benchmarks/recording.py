"""Arguments, printed tables and records of the benchmarks: what every script of this folder shares.

A script makes a `Run`, adds ``--quick`` and ``--record`` to its arguments by it, fills tables that are printed row by
row, and ends it. With ``--record`` the tables are written to docs/results/NAME.json, from which the site makes a page:
all of them but for columns that are only printed, and of a long table the worst row of each group.
"""

from __future__ import annotations

import argparse
import os
import platform
import shlex
import sys
import time
from collections.abc import Callable, Hashable, Sequence
from datetime import UTC, date, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

FOLDER = Path(__file__).parents[2] / "docs" / "results"
STORED_DIGITS = 8  # significant digits of a float in a record
LARGE, SMALL = 1e6, 1e-3  # magnitudes that are printed with an exponent

Value = str | int | FiniteFloat | None


class _Record(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Column(_Record):
    """A column of a table: its name, the unit of its numbers, and the digits that are shown of them."""

    name: str
    unit: str = ""
    digits: int = 3
    width: int = Field(default=8, exclude=True)  # least characters, where it is printed
    recorded: bool = Field(default=True, exclude=True)  # False: printed alone

    @property
    def heading(self) -> str:
        """Name and unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def cell(self, value: Value) -> str:
        """Return a value as text; a missing one is a dash."""
        if value is None:
            return "-"
        if isinstance(value, str | int):
            return str(value)
        if value != 0.0 and not SMALL <= abs(value) < LARGE:
            return f"{value:.{self.digits - 1}e}"
        return str(np.format_float_positional(value, self.digits, fractional=False, trim="-"))


class Table(_Record):
    """A table of a record."""

    title: str
    columns: list[Column]
    rows: list[list[Value]] = []

    def begin(self) -> None:
        """Print title and headings."""
        print(f"\n{self.title}\n{self._line([column.heading for column in self.columns])}", flush=True)

    def add(self, *values: Any) -> None:
        """Add a row, and print it. Values that are not finite are missing ones."""
        row = [_plain(value) for value in values]
        cells = [column.cell(value) for column, value in zip(self.columns, row, strict=True)]
        self.rows.append(row)
        print(self._line(cells), flush=True)

    def keep_worst(self, name: str, group: Callable[[list[Value]], Hashable], *, smallest: bool = False) -> None:
        """Keep of each group of rows the one with the largest number, or the smallest, in a column."""
        (at,) = [number for number, column in enumerate(self.columns) if column.name == name]
        sign = -1.0 if smallest else 1.0
        worst: dict[Hashable, list[Value]] = {}
        for row in sorted(self.rows, key=lambda row: -np.inf if row[at] is None else sign * float(row[at] or 0.0)):
            worst[group(row)] = row
        self.rows = [row for row in self.rows if any(row is kept for kept in worst.values())]

    def recorded(self) -> Table:
        """Return the table without the columns that are only printed."""
        kept = [number for number, column in enumerate(self.columns) if column.recorded]
        rows = [[row[number] for number in kept] for row in self.rows]
        return Table(title=self.title, columns=[self.columns[number] for number in kept], rows=rows)

    def _line(self, cells: Sequence[str]) -> str:
        widths = [max(column.width, len(column.heading)) for column in self.columns]
        first, *others = [(cell, width) for cell, width in zip(cells, widths, strict=True)]
        return "  ".join([f"{first[0]:<{first[1]}}", *(f"{cell:>{width}}" for cell, width in others)])


class Machine(_Record):
    """The machine and the programs of a run."""

    processor: str
    cores: int = Field(ge=1)
    memory_gb: float = Field(gt=0.0)
    system: str
    python: str
    numpy: str
    numba: str


class Record(_Record):
    """The record of a run of a benchmark."""

    name: str
    kind: Literal["accuracy", "speed"]
    title: str
    measured: str  # what was measured, in a sentence
    command: str
    date: date
    quick: bool
    load: float  # processes that other programs kept running when it began
    machine: Machine
    tables: list[Table]
    sentences: list[str]


def machine() -> Machine:
    """Return what is known of this machine, without its name."""
    processor = platform.processor() or platform.machine()
    if (cpuinfo := Path("/proc/cpuinfo")).exists():
        names = [line.split(":", 1)[1] for line in cpuinfo.read_text().splitlines() if line.startswith("model name")]
        processor = names[0].strip() if names else processor
    pages = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return Machine(
        processor=processor,
        cores=len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1,
        memory_gb=round(pages / 1e9, 1),
        system=f"{platform.system()} {platform.machine()}",
        python=platform.python_version(),
        numpy=version("numpy"),
        numba=version("numba"),
    )


class Run:
    """A run of a benchmark: its arguments, its tables, and its record.

    Parameters
    ----------
    name : str
        Name of the script and of the record.
    kind : {"accuracy", "speed"}
        Speeds need an idle machine.
    title : str
        Title of the page.
    measured : str
        What is measured, in one sentence.
    """

    def __init__(self, name: str, kind: Literal["accuracy", "speed"], title: str, measured: str) -> None:
        self.name, self.kind, self.title, self.measured = name, kind, title, measured
        self.tables: list[Table] = []
        self.sentences: list[str] = []
        self.load = os.getloadavg()[0]

    def parser(self, description: str | None) -> argparse.ArgumentParser:
        """Return a parser with the arguments that all benchmarks have."""
        parser = argparse.ArgumentParser(
            prog=f"{self.name}.py", description=description, formatter_class=argparse.RawDescriptionHelpFormatter
        )
        parser.add_argument("--quick", action="store_true", help="the smallest run that uses all of the script")
        parser.add_argument("--record", action="store_true", help=f"write docs/results/{self.name}.json")
        return parser

    def parse(self, parser: argparse.ArgumentParser, arguments: Sequence[str] | None) -> argparse.Namespace:
        """Parse arguments, by default those of the command line, and keep them for the record."""
        self.arguments = list(sys.argv[1:] if arguments is None else arguments)
        self.options = parser.parse_args(self.arguments)
        return self.options

    def table(self, title: str, *columns: Column | str) -> Table:
        """Begin a table; a column that is a string is its name alone."""
        table = Table(title=title, columns=[Column(name=c) if isinstance(c, str) else c for c in columns])
        self.tables.append(table)
        table.begin()
        return table

    def say(self, sentence: str) -> None:
        """Print a sentence, and keep it."""
        self.sentences.append(sentence)
        print(sentence, flush=True)

    def end(self) -> None:
        """Write the record, if that is wanted."""
        if not self.options.record:
            return
        # directories of this machine are nobody's business: their last name says enough
        words = [Path(word).name if Path(word).is_absolute() else word for word in self.arguments]
        record = Record(
            name=self.name,
            kind=self.kind,
            title=self.title,
            measured=self.measured,
            command=shlex.join(["python", f"tests/benchmarks/{self.name}.py", *words]),
            date=datetime.now(UTC).date(),
            quick=self.options.quick,
            load=round(self.load, 1),
            machine=machine(),
            tables=[table.recorded() for table in self.tables],
            sentences=self.sentences,
        )
        FOLDER.mkdir(parents=True, exist_ok=True)
        path = FOLDER / f"{self.name}.json"
        path.write_text(record.model_dump_json(indent=1, exclude_defaults=True) + "\n", encoding="utf-8")
        print(f"written: {path.name}")


def times_of(call: Callable[[], object], repeats: int, clock: Callable[[], float] = time.process_time) -> list[float]:
    """Return the seconds of calls after a first call, which compiles."""
    call()
    seconds = []
    for _ in range(repeats):
        begin = clock()
        call()
        seconds.append(clock() - begin)
    return seconds


def model_of(row: list[Value]) -> Value:
    """Return the model of the preset that the first cell of a row names, or the cell."""
    from brdfdb.materials import presets

    material = presets().get(str(row[0]))
    return row[0] if material is None else material.model


def _plain(value: Any) -> Value:
    """Return a number as a Python number of a few digits; None for one that is not finite."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return float(f"{value:.{STORED_DIGITS}g}") if np.isfinite(value) else None
    return value if value is None or isinstance(value, str | int) else str(value)
