"""Every preset at a tolerance: the size of its table, the error it states, one measured afresh, and a uniform grid.

``python tests/benchmarks/tables.py`` prints a line for each material and exits with 1 if a promise is broken. The
tolerance is kept at directions that the planner did not see. A stated p99 and a fresh one are within 20 %. A part takes
no more than 2 MB (isotropic) or 40 MB. Lobes of width 0.1 or less take a twentieth of the uniform grid over theta_i,
theta_r and azimuth (phi_i and phi_r for anisotropic surfaces) that is as good.
"""

from __future__ import annotations

import itertools
import math
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb.materials import Material
from brdfdb.store.publication import publish_layout
from brdfdb.tables import error_measurement, tabulation
from brdfdb.tables.layout import Layout
from brdfdb.tables.planner import plan
from brdfdb_pipelines.recipe_file import load
from tests.benchmarks.recording import Column, Run

FRESH, AGREEMENT, TIMES_SMALLER = 20261121, 0.2, 20.0
NARROW = 0.1
DRAWS = 400  # directions of a band, for uniform grids: 8 or 16 evaluations of the model each
QUICK = ("lightly-brushed-aluminum", "scene-plastic-cube")  # a narrow lobe, and none; each is planned in half a second
MEASURED = (
    "The tables that the planner makes of the presets for a tolerance: their size, the 99th percentile of the error "
    "that they state, the same at other directions, and the size of a uniform grid that is as good."
)
Array = NDArray[np.float64]
SIZES = ("numbers", "numbers stored", "all stored")


def main(arguments: Sequence[str] | None = None) -> int:
    """Plan and measure the tables, and return 1 if a promise is broken."""
    run = Run("tables", "accuracy", "Tables for a tolerance", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("--tolerance", type=float, default=0.01, help="of the 99th percentile (default: %(default)s)")
    parser.add_argument("names", metavar="NAME", nargs="*", help="of materials, by default all presets")
    options = run.parse(parser, arguments)
    names = options.names or (QUICK if options.quick else ())
    table = run.table(
        f"Tables for a tolerance of {100 * options.tolerance:g} %",
        Column(name="material", width=32),
        "nodes",
        Column(name="parts", recorded=False),
        *(Column(name=name, unit="kB", recorded=name == "all stored") for name in SIZES),
        *(Column(name=name, unit="%") for name in ("stated p99", "fresh p99")),
        Column(name="planning", unit="s"),
        Column(name="nodes of a uniform grid / nodes", digits=2),
        Column(name="grid", width=34, recorded=False),
        Column(name="promises", recorded=False),
    )
    broken = 0
    for job in load().jobs():
        if names and job.material.name not in names:
            continue
        start = time.perf_counter()
        layout = plan(job.material, job.wavelength_nm, options.tolerance)
        seconds = time.perf_counter() - start
        values = np.concatenate([tabulation.block(layout, rows) for rows in layout.blocks])
        stated = error_measurement.measure(layout, lambda rows, values=values: values[rows]).overall.p99
        fresh = error_measurement.measure(layout, lambda rows, values=values: values[rows], seed=FRESH).overall.p99
        nodes = math.prod(layout.grid.shape)
        narrow = lobe_width(job.material, job.wavelength_nm) <= NARROW and fresh > 0.0
        ratio = uniform_nodes(layout, fresh) / nodes if narrow else None
        kept = (
            fresh <= options.tolerance
            and abs(stated - fresh) <= AGREEMENT * max(stated, fresh)
            and 4 * nodes <= (40e6 if layout.grid.anisotropic else 2e6)
            and (ratio is None or ratio >= TIMES_SMALLER)
        )
        broken += not kept
        sizes = (values.nbytes / 1e3, *stored_kilobytes(layout))
        parts, errors = values.size // nodes, (100.0 * stated, 100.0 * fresh)
        grid = ", ".join(layout.grid.names)
        table.add(job.material.name, nodes, parts, *sizes, *errors, seconds, ratio, grid, "kept" if kept else "BROKEN")
    total = sum(float(row[5] or 0.0) for row in table.rows)
    run.say(f"{len(table.rows)} tables, {total / 1e3:.3g} MB stored in all, {broken} broken promises.")
    run.end()
    return min(broken, 1)


def stored_kilobytes(layout: Layout) -> tuple[float, float]:
    """Return the size [kB] of the compressed numbers of a table, and of all of its files in a store."""
    with tempfile.TemporaryDirectory() as root:
        published = publish_layout(root, layout.source.name, layout)
        revision = Path(root, "materials", layout.source.name, published.revision)
        chunks = sum(path.stat().st_size for path in (revision / layout.variable / "c").rglob("*") if path.is_file())
        return chunks / 1e3, published.bytes / 1e3


def lobe_width(material: Material, wavelength_nm: NDArray[np.float64] | None) -> float:
    """The smallest width of the lobe at normal incidence, in slopes; infinite without a lobe."""
    if material.spec.lobe is None:
        return math.inf
    lobe = material.spec.lobe(1.0, **material.arguments(wavelength_nm))
    return math.inf if np.max(lobe.share) == 0.0 else float(np.min([lobe.alpha_x, lobe.alpha_y]))


def uniform_nodes(layout: Layout, error: float) -> int:
    """Nodes of the uniform grid whose multilinear interpolation has the same 99th percentile of the error."""
    wavelength_nm = None if layout.wavelength_nm is None else layout.wavelength_nm[[0, layout.wavelength_nm.size // 2]]
    drawn = error_measurement.draw(layout.source, wavelength_nm, DRAWS, FRESH)
    truth = error_measurement.model_values(layout.source, wavelength_nm, drawn.wi, drawn.wr)
    floor = error_measurement.floor_of(truth, drawn)
    count = 8
    while True:
        found = uniform_lookup(layout.source, wavelength_nm, drawn, count)
        if (
            np.percentile(error_measurement.relative(found, truth, floor)[drawn.above], 99, axis=0).max() <= error
            or count > 3000
        ):
            turns = 4 * count - 3 if layout.grid.anisotropic else 2 * count - 1
            return count * count * turns * (turns if layout.grid.anisotropic else 1)
        count = math.ceil(1.15 * count)


def uniform_lookup(
    material: Material, wavelength_nm: NDArray[np.float64] | None, drawn: error_measurement.RandomPairs, count: int
) -> Array:
    """Multilinear interpolation on `count` nodes a quarter turn, without the table: the model at the nodes around."""
    theta = [np.arccos(np.clip(w[:, 2], -1.0, 1.0)) for w in (drawn.wi, drawn.wr)]
    phi = [np.arctan2(w[:, 1], w[:, 0]) for w in (drawn.wi, drawn.wr)]
    if not material.anisotropic:
        phi = [np.zeros_like(phi[0]), np.abs(np.remainder(phi[1] - phi[0] + np.pi, 2.0 * np.pi) - np.pi)]
    step, last = np.pi / 2.0 / (count - 1), np.deg2rad(89.5)
    spectrum = [material.arguments()] if wavelength_nm is None else [material.arguments(w) for w in wavelength_nm]
    coordinates = [theta[0], phi[0], theta[1], phi[1]]
    cells = [np.floor(x / step) for x in coordinates]
    shares = [x / step - cell for x, cell in zip(coordinates, cells, strict=True)]
    total = np.zeros((len(theta[0]), len(spectrum)))
    for corner in itertools.product((0, 1), repeat=4):
        if corner[1] == 1 and not material.anisotropic:
            continue
        at = [(cell + up) * step for cell, up in zip(cells, corner, strict=True)]
        at[0], at[2] = np.minimum(at[0], last), np.minimum(at[2], last)
        weight = np.prod([s if up else 1.0 - s for s, up in zip(shares, corner, strict=True)], axis=0)
        for w, arguments in enumerate(spectrum):
            total[:, w] += weight * material.spec.evaluate(*at, **arguments)
    return total


if __name__ == "__main__":
    sys.exit(main())
