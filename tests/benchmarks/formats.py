"""Every material through every format: ``python tests/benchmarks/formats.py``.

Each preset is tabulated for a p99 of 2 %, written in each format at the same tolerance, and read again. What is read
must be as near to the table as the file states. Exits with 1 if a file is farther away.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

import brdfdb
from brdfdb.errors import CannotHoldError
from brdfdb.store.publication import publish_layout
from brdfdb.tables.planner import plan
from brdfdb.tables.table import Table
from brdfdb_pipelines.recipe_file import load
from tests.benchmarks.recording import Column, Run
from tests.formats.round_trip import ROUND_TRIPPED, round_trip

MEASURED = (
    "Size of the files of a table, the error that they state against it, and the time to write and read them, for "
    "each format and kind of material, at a tolerance of 2 %. The first row is that of the tables, against their "
    "models. Sizes are compared for files within the tolerance of their table, which is within the same tolerance of "
    "its model."
)
OWN = "brdfdb"
ROUNDING = 1.02  # of what is read to what is stated: formats keep float32 or decimals
TOLERANCE = 0.02
QUICK = ("rolled-brass", "scene-object-smooth")  # an anisotropic lobe, and a specular part
QUICK_FORMATS = ("merl", "csv")


class Row(NamedTuple):
    """Result of one table in one format; `far` is a sentence on a file that is not as near as it states, or empty."""

    nbytes: int
    p99: float
    within: bool
    write_s: float
    read_s: float
    far: str = ""


def kind_of(table: Table) -> str:
    """Return the kind of a material in a few words."""
    model = (table.metadata.model or "function").replace("_", " ")
    colour = "grey" if table.wavelength_nm is None else f"{table.wavelength_nm.size} wavelengths"
    shape = ", anisotropic" if table.anisotropic else ""
    mirror = ", with a specular part" if table.specular is not None and table.specular.max() > 0.0 else ""
    return f"{model}, {colour}{shape}{mirror}"


def tables(names: Sequence[str]) -> Iterator[tuple[Table, Row]]:
    """Tabulate the presets for the tolerance, and give each with its size in a store and the error that it states."""
    with tempfile.TemporaryDirectory() as folder:
        for job in load().jobs():
            name = job.material.name
            if names and name not in names:
                continue
            began = time.perf_counter()
            published = publish_layout(folder, name, plan(job.material, job.wavelength_nm, TOLERANCE))
            wrote = time.perf_counter()
            table, p99 = brdfdb.open(folder)[name], published.error.overall.p99
            yield table, Row(published.bytes, p99, p99 <= TOLERANCE, wrote - began, time.perf_counter() - wrote)


def exported(table: Table, file_format: str) -> Row | None:
    """Return the result of one table in one format; None where the format cannot hold it."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            trip = round_trip(table, Path(folder), file_format)
        except CannotHoldError:
            return None
    far = f"{file_format} {table.name}: {trip.measured:.3%} is read, {trip.stated:.3%} is stated"
    near = trip.measured <= ROUNDING * trip.stated
    return Row(trip.nbytes, trip.stated, trip.within, trip.write_s, trip.read_s, "" if near else far)


def main(arguments: Sequence[str] | None = None) -> int:
    """Write, read and compare, and print a row for each format and kind of material."""
    run = Run("formats", "accuracy", "File formats", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("--formats", nargs="*", default=ROUND_TRIPPED, help="formats (default: all that are read)")
    parser.add_argument("names", metavar="NAME", nargs="*", help="of materials, by default all presets")
    options = run.parse(parser, arguments)
    names, formats = options.names, options.formats
    if options.quick:
        names, formats = names or QUICK, QUICK_FORMATS
    rows: dict[tuple[str, str], list[Row | None]] = defaultdict(list)
    for table, own in tables(names):
        print(table.name, flush=True)
        kind = kind_of(table)
        rows[OWN, kind].append(own)
        for file_format in formats:
            rows[file_format, kind].append(exported(table, file_format))
    columns = [Column(name="format", width=12), Column(name="kind of material", width=40)]
    numbers = [Column(name=name, recorded=name != "within 2 %") for name in ("materials", "refused", "within 2 %")]
    sizes = [Column(name="median size", unit="kB"), Column(name="largest size", unit="kB", recorded=False)]
    errors = [Column(name="median p99", unit="%", recorded=False), Column(name="largest p99", unit="%")]
    times = [Column(name=name, unit="s") for name in ("write", "read")]
    shown = run.table("Files by format and kind of material", *columns, *numbers, *sizes, *errors, *times)
    for file_format in (OWN, *formats):
        for (name, kind), some in sorted(rows.items()):
            if name == file_format:
                shown.add(name, kind, *summary(some))
    shown.keep_worst("largest p99", lambda row: row[0])
    compared = run.table(
        "Size of a file over that of the table of the same material",
        Column(name="format", width=12),
        *(Column(name=name) for name in ("materials", "smaller than a table", "smallest", "median", "largest")),
    )
    for file_format in formats:
        compared.add(file_format, *ratios(rows, file_format))
    far = [row.far for some in rows.values() for row in some if row is not None and row.far]
    for sentence in far:
        run.say(sentence)
    run.say("For each format, the page shows the kind of material with the largest p99.")
    run.say(f"{len(formats)} formats; {'NOT every' if far else 'every'} file is as near to its table as it states.")
    run.end()
    return 1 if far else 0


def summary(rows: Sequence[Row | None]) -> list[float | int | None]:
    """Return the numbers of a row of the table: counts, sizes [kB], errors [%] and times [s]."""
    held = [row for row in rows if row is not None]
    counts = [len(rows), len(rows) - len(held), sum(row.within for row in held)]
    if not held:
        return [*counts, *[None] * 6]
    size, p99 = np.array([row.nbytes for row in held]) / 1e3, 100.0 * np.array([row.p99 for row in held])
    times = (float(np.mean([row.write_s for row in held])), float(np.mean([row.read_s for row in held])))
    return [*counts, float(np.median(size)), float(size.max()), float(np.median(p99)), float(p99.max()), *times]


def ratios(rows: Mapping[tuple[str, str], Sequence[Row | None]], file_format: str) -> list[float | int | None]:
    """Return how many files are within 2 %, how many of them are smaller than the table, and their sizes over its."""
    sizes = [
        row.nbytes / own.nbytes
        for (name, kind), some in rows.items()
        if name == file_format
        for row, own in zip(some, rows[OWN, kind], strict=True)
        if row is not None and row.within and own is not None
    ]
    if not sizes:
        return [0, 0, None, None, None]
    return [len(sizes), sum(size < 1.0 for size in sizes), min(sizes), float(np.median(sizes)), max(sizes)]


if __name__ == "__main__":
    sys.exit(main())
