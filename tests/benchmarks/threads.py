"""One large call on one thread and on several: ``python tests/benchmarks/threads.py [--values N] [--threads N]``.

Both write into the same array. They take turns, and a time is the shortest of some calls, by the clock on the wall. The
goal is 1.8 times the rate of one thread on two. Values are compared bit for bit before they are timed.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb.geometry import unit_vector
from brdfdb.models import he_torrance_vectors, ward_vectors
from brdfdb.tables.grids import Grid
from brdfdb.tables.table import Table
from tests.benchmarks.recording import Column, Run

VALUES, QUICK_VALUES = 100_000_000, 20_000
FEWER = 50  # of He-Torrance, whose values take as many times as long
DIFFERENT = 1_000_000  # directions; a longer call repeats them
REPEATS = 5
MEASURED = "Million values a second of one large call on one thread and on several."
WARD = {"rho_d": 0.1, "rho_s": 0.33, "alpha_x": 0.15, "alpha_y": 0.3}
ALUMINUM = {"wavelength_nm": 500.0, "sigma_0_um": 0.25, "tau_um": 2.5, "n": 0.769, "k": 6.08}


def seconds(calls: Sequence[Callable[[], Any]], repeats: int) -> list[float]:
    """Return the shortest time [s] of each call, in turns."""
    times: list[list[float]] = [[] for _ in calls]
    for _ in range(repeats):
        for call, own in zip(calls, times, strict=True):
            start = time.perf_counter()
            call()
            own.append(time.perf_counter() - start)
    return [min(own) for own in times]


def random_table() -> Table:
    """Return a table of random numbers that fits into the second cache."""
    axes = {"theta_i": np.linspace(0, 90, 46), "theta_r": np.linspace(0, 90, 46), "delta_phi": np.linspace(0, 180, 91)}
    values = np.random.default_rng(1992).random((46, 46, 91)).astype(np.float32)
    return Table("random", "", {}, Grid(axes), None, values, None)


def main(arguments: Sequence[str] | None = None) -> int:
    """Time large calls, and print the table."""
    run = Run("threads", "speed", "Large calls on threads", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("--values", type=float, default=VALUES, help="values of a call; 1e8 take 3 GB of memory")
    parser.add_argument("--threads", type=int, default=2)
    options = run.parse(parser, arguments)
    count = QUICK_VALUES if options.quick else int(options.values)
    rng = np.random.default_rng(1992)
    size = (2, min(DIFFERENT, count))
    few = unit_vector(np.arccos(rng.random(size)), rng.uniform(-np.pi, np.pi, size)).astype(np.float32)
    wi, wr = (np.resize(w, (count, 3)) for w in few)
    out = np.empty(count, np.float32)
    printed = run.table(
        f"Calls of {count} float32 values, and of He-Torrance {count // FEWER}",
        Column(name="call", width=36),
        Column(name="1 thread", unit="1e6/s"),
        Column(name=f"{options.threads} threads", unit="1e6/s"),
        Column(name="ratio", digits=2),
    )
    cases: list[tuple[str, Callable[..., Any], int]] = [
        ("Ward, unit vectors", partial(ward_vectors, **WARD), count),
        ("He-Torrance, unit vectors", partial(he_torrance_vectors, **ALUMINUM), count // FEWER),
        ("table, light and viewer, unit vectors", random_table().lookup_vectors, count),
    ]
    for name, call, values in cases:
        own = partial(call, wi[:values], wr[:values], out=out[:values])
        one = own().copy()
        if not np.array_equal(own(threads=options.threads), one):
            raise SystemExit(f"{name}: threads compute other values")
        del one
        alone, together = seconds([own, partial(own, threads=options.threads)], 1 if options.quick else REPEATS)
        printed.add(name, values / alone / 1e6, values / together / 1e6, alone / together)
    run.end()
    return 0


if __name__ == "__main__":
    sys.exit(main())
