"""Lookups a second on one core, against scipy: ``python tests/benchmarks/lookup.py [DIRECTIONS]``.

Random directions, float32 tables that fit into the second cache. The goals of the first three lines are 150 million a
second trilinear over light and viewer, 90 million over half and difference vectors from unit vectors, and 40 million
cubic, each 20 times `scipy.interpolate.RegularGridInterpolator` on the same table from the same directions in the same
run, with numpy to bring them to coordinates. Machines are shared and noisy: the fastest of nine calls of the public
methods, in seconds of the processor, with their checks and a new array each. "memory" is
the rate at which float64 directions and values move, as a share of the rate at which one core copies arrays.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import RegularGridInterpolator

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb.geometry import radians, unit_vector
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import PLAIN, Interpolation
from brdfdb.tables.table import Table
from tests.benchmarks.recording import Column, Run, times_of

REPEATS = 9
DIRECTIONS, QUICK_DIRECTIONS = 1_000_000, 2000
STREAMED = 1 << 26  # bytes of an array that no cache holds
MEASURED = "Directions that one core looks up per second in tables in memory, compared with the interpolator of scipy."
Case = tuple[str, Table, Any, str]
RNG = np.random.default_rng(1992)


def table(axes: dict[str, Any], how: Interpolation = PLAIN) -> Table:
    """A table of random numbers: its values make no difference to the time."""
    grid = Grid(axes)
    return Table("random", "", {}, grid, None, RNG.random(grid.shape).astype(np.float32), None, interpolation=how)


def rate(call: Callable[[], Any], count: int, repeats: int = REPEATS) -> float:
    """Millions a second, by the fastest of some calls."""
    return float(count / max(min(times_of(call, repeats)), 1e-9) / 1e6)


def stream() -> float:
    """Return the million bytes a second that one core reads and writes when it copies arrays."""
    source = np.ones(STREAMED // 8)
    target = np.empty_like(source)
    return rate(lambda: np.copyto(target, source), 2 * STREAMED)


def coordinates(made: Table, given: tuple[Any, ...]) -> Any:
    """What scipy is given, of shape (N, axes): directions as numpy brings them onto the grid."""
    if len(given) == 4:
        theta_i, phi_i, theta_r, phi_r = given
        if not made.grid.half_difference:
            return np.stack(
                [theta_i, theta_r, np.abs(np.remainder(phi_r - phi_i + np.pi, 2.0 * np.pi) - np.pi)], axis=-1
            )
        given = unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r)
    wi, wr = given
    h, d = wi + wr, wi - wr
    flat = np.hypot(h[:, 0], h[:, 1])
    length = np.hypot(flat, h[:, 2])
    along = np.sum(d[:, :2] * h[:, :2], axis=-1) * h[:, 2] - d[:, 2] * flat**2
    across = (d[:, 1] * h[:, 0] - d[:, 0] * h[:, 1]) * length
    theta_h, theta_d = np.arctan2(flat, h[:, 2]), np.arctan2(np.sqrt(np.sum(d * d, axis=-1)), length)
    if not made.anisotropic:
        return np.stack([theta_h, theta_d, np.arctan2(np.abs(across), np.abs(along))], axis=-1)
    phi_h = np.arctan2(np.abs(h[:, 1]), np.abs(h[:, 0]))
    return np.stack([theta_h, phi_h, theta_d, np.remainder(np.arctan2(across, along), np.pi)], axis=-1)


def cases(angles: Any, single: Any, vectors: tuple[Any, Any]) -> list[Case]:
    """Return tables with the directions in float64 and float32, and the method of scipy."""
    coarse = {
        "theta_i": np.linspace(0, 90, 46),
        "theta_r": np.linspace(0, 90, 46),
        "delta_phi": np.linspace(0, 180, 91),
    }
    fine = {"theta_i": np.linspace(0, 90, 91), "theta_r": np.linspace(0, 90, 91), "delta_phi": np.linspace(0, 180, 181)}
    uneven = {**fine, "theta_i": np.append(np.arange(90.0), 89.5), "theta_r": np.append(np.arange(90.0), 89.5)}
    half = {
        "theta_h": 90.0 * np.linspace(0.0, 1.0, 46) ** 2,
        "theta_d": np.linspace(0.0, 90.0, 46),
        "phi_d": np.linspace(0.0, 90.0, 31),
    }
    planned = {
        "theta_i": 90.0 * (1.0 - (1.0 - np.linspace(0.0, 1.0, 46)) ** 1.7),
        "theta_r": 90.0 * (1.0 - (1.0 - np.linspace(0.0, 1.0, 46)) ** 1.7),
        "delta_phi": np.linspace(0.0, 180.0, 31),
    }
    brass = {"theta_h": half["theta_h"][::3], "phi_h": np.linspace(0, 90, 8), "theta_d": [0, 90], "phi_d": [0, 180]}
    log_linear, logarithms = Interpolation("linear", True, 1e-4, 0.5), Interpolation("cubic", True, 1e-4, 0.5)
    return [
        ("trilinear, light and viewer, 46 x 46 x 91", table(coarse), (angles, single), "linear"),
        ("linear, half and difference, 46 x 46 x 31", table(half), vectors, "linear"),
        ("cubic, light and viewer, 46 x 46 x 31", table(planned, Interpolation("cubic")), (angles, single), "cubic"),
        ("trilinear, 91 x 91 x 181", table(fine), (angles, single), "linear"),
        ("trilinear, 91 x 91 x 181, uneven theta", table(uneven), (angles, single), "linear"),
        ("log-linear, half and difference", table(half, log_linear), vectors, "linear"),
        ("log-cubic, half and difference", table(half, logarithms), vectors, "cubic"),
        ("log-cubic, half and difference, 4D", table(brass, logarithms), vectors, "linear"),
        ("log-cubic, half and difference, by angles", table(half, logarithms), (angles, single), "cubic"),
    ]  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> int:
    """Time lookups, and print the table."""
    run = Run("lookup", "speed", "Lookups against scipy", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("directions", type=float, nargs="?", default=DIRECTIONS)
    options = run.parse(parser, arguments)
    count = QUICK_DIRECTIONS if options.quick else int(options.directions)
    theta = np.arccos(RNG.random((2, count)))
    phi = RNG.uniform(0.0, 2.0 * np.pi, (2, count))
    angles = (theta[0], phi[0], theta[1], phi[1])
    single = tuple(angle.astype(np.float32) for angle in angles)
    wi, wr = unit_vector(*angles[:2]), unit_vector(*angles[2:])
    vectors = ((wi, wr), (wi.astype(np.float32), wr.astype(np.float32)))
    printed = run.table(
        f"Lookups of {count} directions",
        Column(name="table", width=44),
        *(Column(name=name, unit="1e6/s") for name in ("float64", "float32", "scipy")),
        Column(name="float64 / scipy", digits=2),
        Column(name="memory", unit="%", digits=2),
    )
    copied = stream()
    for name, made, given, method in cases(angles, single, vectors):
        look = made.lookup if len(given[0]) == 4 else made.lookup_vectors
        double, float32 = (rate(lambda look=look, d=d: look(*d), count) for d in given)
        few = tuple(each[: count if method == "linear" else count // 20] for each in given[0])  # its cubic is slow
        nodes = [radians(axis) for axis in made.grid.axes.values()]
        peer = RegularGridInterpolator(
            nodes, made.values.astype(np.float64), method=method, bounds_error=False, fill_value=None
        )
        scipys = rate(lambda peer=peer, made=made, few=few: peer(coordinates(made, few)), len(few[0]), 1)
        moved = sum(array.nbytes for array in given[0]) / count + 8  # bytes a direction
        printed.add(name, double, float32, scipys, double / scipys, 100.0 * double * moved / copied)
    run.end()
    return 0


if __name__ == "__main__":
    sys.exit(main())
