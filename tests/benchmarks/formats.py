"""Every material through every format: ``python tests/benchmarks/formats.py --store brdf-store``.

Each table is written at the default tolerance and read again. What is read must be as near to the table as the file
states. Exits with 1 if a file is farther away.
"""

from __future__ import annotations

import sys
import tempfile
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

import brdfdb
from brdfdb.errors import CannotHoldError
from brdfdb.formats import EXPORTERS
from brdfdb.tables.table import Table
from tests.benchmarks.recording import Column, Run
from tests.formats.round_trip import ROUND_TRIPPED, Trip, round_trip

MEASURED = (
    "Size of the files of a table, the error that they state against it, and the time to write them, for each format "
    "and kind of material, at the default tolerance of 2 %."
)
ROUNDING = 1.02  # of what is read to what is stated: formats keep float32 or decimals
QUICK = 4


def kind_of(table: Table) -> str:
    """Return the kind of a material in a few words."""
    model = (table.metadata.model or "function").replace("_", " ")
    colour = "grey" if table.wavelength_nm is None else f"{table.wavelength_nm.size} wavelengths"
    shape = ", anisotropic" if table.anisotropic else ""
    mirror = ", with a specular part" if table.specular is not None and table.specular.max() > 0.0 else ""
    return f"{model}, {colour}{shape}{mirror}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Write, read and compare, and print a row for each format and kind of material."""
    run = Run("formats", "accuracy", "File formats", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("--store", default="brdf-store", help="a built store (default: %(default)s)")
    parser.add_argument("--formats", nargs="*", default=ROUND_TRIPPED, help="formats (default: all that are read)")
    options = run.parse(parser, arguments)
    store = brdfdb.open(options.store)
    tables = [store[name] for name in list(store)[: QUICK if options.quick else None]]
    shown = run.table(
        "Files by format and kind of material",
        Column(name="format", width=14),
        Column(name="kind of material", width=40),
        Column(name="materials"),
        Column(name="within 2 %"),
        Column(name="median size", unit="kB"),
        Column(name="largest size", unit="kB"),
        Column(name="median p99", unit="%"),
        Column(name="largest p99", unit="%"),
        Column(name="write", unit="s"),
        Column(name="read", unit="s"),
    )
    far: list[str] = []
    for file_format in options.formats:
        trips: dict[str, list[Trip]] = defaultdict(list)
        refused: dict[str, int] = defaultdict(int)
        for table in tables:
            with tempfile.TemporaryDirectory() as folder:
                try:
                    trip = round_trip(table, Path(folder), file_format)
                except CannotHoldError:
                    refused[kind_of(table)] += 1
                    continue
            trips[kind_of(table)].append(trip)
            if trip.measured > ROUNDING * trip.stated:
                far.append(f"{file_format} {table.name}: {trip.measured:.3%} is read, {trip.stated:.3%} is stated")
        for kind, some in sorted(trips.items()):
            size, stated = np.array([trip.nbytes for trip in some]) / 1e3, 100.0 * np.array([t.stated for t in some])
            seconds = [float(np.mean([trip.write_s for trip in some])), float(np.mean([trip.read_s for trip in some]))]
            within = sum(trip.within for trip in some)
            shown.add(
                file_format,
                kind,
                len(some),
                within,
                float(np.median(size)),
                float(size.max()),
                float(np.median(stated)),
                float(stated.max()),
                *seconds,
            )
        for kind, count in sorted(refused.items()):
            shown.add(file_format, kind, f"{count} refused", 0, None, None, None, None, None, None)
    for sentence in far:
        run.say(sentence)
    run.say(f"{len(EXPORTERS)} formats; {'every file is' if not far else 'NOT every file is'} as near as it states.")
    run.end()
    return 1 if far else 0


if __name__ == "__main__":
    sys.exit(main())
