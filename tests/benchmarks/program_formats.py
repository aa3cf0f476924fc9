"""Size, error and time of files for programs of measurement and optical design, over all materials of a store.

Run ``python -m tests.benchmarks.program_formats STORE [FORMAT...]`` in the root of the repository.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

import brdfdb
from brdfdb.errors import CannotHoldError
from brdfdb.formats import EXPORTERS
from brdfdb.tables.table import Table

FORMATS = ("merl", "utia", "ssdd", "zemax", "astm")


class Figures(NamedTuple):
    """What a format makes of one material: size [MB], p99 and l1 [1], seconds of the processor, and if p99 suffices."""

    size: float
    p99: float
    l1: float
    seconds: float
    within: bool


def exported(table: Table, names: Sequence[str] = FORMATS) -> dict[str, Figures]:
    """Return the figures of a table in formats by name; those that cannot hold it are left out."""
    figures = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            started = time.process_time()
            try:
                written = EXPORTERS[name].write(table, Path(folder) / f"table{EXPORTERS[name].suffix}")
            except CannotHoldError:
                continue
            seconds = time.process_time() - started
            assert written.error is not None
            size = written.nbytes / 1e6
            figures[name] = Figures(size, written.error.p99, written.error.l1, seconds, written.within)
    return figures


def main(root: str, *names: str) -> None:
    """Print the figures of each material, and their medians by format, model and symmetry."""
    groups: dict[tuple[str, str], list[Figures]] = defaultdict(list)
    store = brdfdb.open(root)
    for material in store:
        table = store[material]
        kind = f"{table.metadata.model}{' anisotropic' if table.anisotropic else ''}"
        kind += " spectral" if table.wavelength_nm is not None and table.wavelength_nm.size > 1 else ""
        for name, figures in exported(table, names or FORMATS).items():
            groups[name, kind].append(figures)
            print(f"{name:6s} {material:36s} {figures.size:9.3f} MB  p99 {figures.p99:9.4f}  {figures.seconds:6.2f} s")
    print("\nformat, kind, materials, within 2 %, median MB, median p99, largest p99, seconds in all")
    for (name, kind), all_of in sorted(groups.items()):
        size, p99, _, seconds, within = (np.array(column) for column in zip(*all_of, strict=True))
        print(
            f"{name:6s} {kind:26s} {len(all_of):3d} {within.sum():3d} {np.median(size):9.3f} {np.median(p99):9.4f} "
            f"{p99.max():9.4f} {seconds.sum():7.1f}"
        )


if __name__ == "__main__":
    main(*sys.argv[1:])
