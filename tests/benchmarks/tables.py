"""Every preset at a tolerance: what its table takes, the error it states, one measured afresh, and a uniform grid.

``python tests/benchmarks/tables.py [TOLERANCE] [NAME...]`` prints a line a material and exits with 1 if a promise is
broken: the tolerance is kept at directions that the planner did not see, a stated p99 and a fresh one are within 20 %,
a part takes no more than 2 MB (isotropic) or 40 MB, and lobes of width 0.1 or less take a twentieth of the uniform
grid over theta_i, theta_r and azimuth (phi_i and phi_r for anisotropic surfaces) that is as good.
"""

from __future__ import annotations

import itertools
import math
import sys
import time

import numpy as np
from numpy.typing import NDArray

from brdfdb.materials import Material
from brdfdb.tables import error_measurement, tabulation
from brdfdb.tables.layout import Layout
from brdfdb.tables.planner import plan
from brdfdb_pipelines.recipe_file import load

FRESH, AGREEMENT, TIMES_SMALLER = 20261121, 0.2, 20.0
NARROW = 0.1
DRAWS = 400  # directions of a band, for uniform grids: 8 or 16 evaluations of the model each
Array = NDArray[np.float64]


def main(tolerance: float, names: list[str]) -> int:
    """Print the table; 1 if a promise is broken."""
    broken = 0
    print(f"{'material':<32}{'nodes':>9}{'parts':>6}{'kB':>9}{'stated':>9}{'fresh':>9}{'plan s':>8}  of uniform  grid")
    for job in load().jobs():
        material, wavelength_nm = job.material, job.wavelength_nm
        if names and material.name not in names:
            continue
        start = time.perf_counter()
        layout = plan(material, wavelength_nm, tolerance)
        seconds = time.perf_counter() - start
        values = np.concatenate([tabulation.block(layout, rows) for rows in layout.blocks])
        stated = error_measurement.measure(layout, lambda rows, values=values: values[rows]).overall.p99
        fresh = error_measurement.measure(layout, lambda rows, values=values: values[rows], seed=FRESH).overall.p99
        nodes = math.prod(layout.grid.shape)
        width = lobe_width(material, wavelength_nm)
        ratio = uniform_nodes(layout, fresh) / nodes if width <= NARROW and fresh > 0.0 else math.nan
        kept = (
            fresh <= tolerance
            and abs(stated - fresh) <= AGREEMENT * max(stated, fresh)
            and 4 * nodes <= (40e6 if layout.grid.anisotropic else 2e6)
            and not ratio < TIMES_SMALLER
        )
        broken += not kept
        print(
            f"{material.name:<32}{nodes:9d}{values.size // nodes:6d}{values.nbytes / 1e3:9.1f}{stated:9.4f}{fresh:9.4f}"
            f"{seconds:8.2f}  {'' if math.isnan(ratio) else f'1/{ratio:.3g}':<12}{', '.join(layout.grid.names)}"
            + ("" if kept else "  BROKEN"),
            flush=True,
        )
    print(f"{broken} broken promises")
    return min(broken, 1)


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
    material: Material, wavelength_nm: NDArray[np.float64] | None, drawn: error_measurement.Draw, count: int
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
    sys.exit(main(float(sys.argv[1]) if len(sys.argv) > 1 else 0.01, sys.argv[2:]))
