"""Conversions between models: ``python tests/benchmarks/conversion.py``, one minute.

A surface of each of four models is converted to the others: the errors of the closest parameters, and those of the same
width with the same reflectance, as programs copy them. Then brass as GGX against an exhaustive search, at other
directions. Exits with 1 if the search is more than 1 % above the least.
"""

from __future__ import annotations

import itertools
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb import models, roughness
from brdfdb.conversion.convert import compare, convert
from brdfdb.fitting.variables import index_of, spread
from brdfdb.geometry import unit_vector
from brdfdb.integrals.sampling import directions, mixture_density
from brdfdb.lobes import GGX, Lobe
from brdfdb.materials import Material, presets
from brdfdb.refractive_indices import refractive_index
from tests.benchmarks.recording import Column, Run, Table

ALPHA, NM = 0.15, 550.0
COPPER = "main/Cu/Johnson"
TAU_UM = 10.0  # long against the wavelength: the lobe of He and Torrance is that of the slopes
BRASS = {"rho_d": 0.1, "rho_s": 0.33, "alpha_x": 0.05, "alpha_y": 0.16}
PAIRS, QUICK_PAIRS = 40_000, 2_000
GRID, QUICK_GRID = (25, 25, 18, 4), (5, 5, 5, 3)  # alpha_x, alpha_y, reflectance at normal incidence, edge
LEVELS = 4  # grids, each over a cell on either side of the best point of the last
REQUIRED = 1.01
MEASURED = "l1 and p99 of the closest parameters of another model, compared with those of an exhaustive search."

Array = NDArray[np.float64]


def surfaces() -> dict[str, Material]:
    """Return copper with an alpha of 0.15 by four models; Ward takes the reflectance of copper."""
    copper: dict[str, Any] = {"source": "benchmark", "refractive_index": COPPER, "wavelengths_nm": (NM,)}
    alphas = {"alpha_x": ALPHA, "alpha_y": ALPHA}
    heights = {"sigma_0_um": float(roughness.heights_from_alpha(ALPHA, TAU_UM)), "tau_um": TAU_UM}
    n, k = (float(value[0]) for value in refractive_index(COPPER, np.array([NM])))
    normal = ((n - 1.0) ** 2 + k**2) / ((n + 1.0) ** 2 + k**2)
    return {
        "ward": Material(
            name="a-ward",
            title="Ward",
            model="ward",
            parameters={"rho_d": 0.0, "rho_s": normal, **alphas},
            source="benchmark",
        ),
        "beckmann": Material(name="a-beckmann", title="Beckmann", model="beckmann", parameters=alphas, **copper),
        "ggx": Material(name="a-ggx", title="GGX", model="ggx", parameters=alphas, **copper),
        "he_torrance": Material(name="a-he-torrance", title="He", model="he_torrance", parameters=heights, **copper),
    }


def table_of_models(run: Run, *, quick: bool) -> None:
    """Convert each surface to each other model."""
    names = [Column(name=name, width=12) for name in ("from", "to")]
    columns = [Column(name=name) for name in ("l1, same width", "p99, same width", "l1", "p99", "l1, worst view")]
    others = Column(name="its theta_r", unit="degree"), Column(name="parameters", width=40)
    table = run.table("Copper with an alpha of 0.15, from each model to each other", *names, *columns, *others)
    every = surfaces()
    pairs = list(itertools.permutations(every, 2))
    for before, after in pairs[:1] if quick else pairs:
        _row(table, every[before], every[after])


def _row(table: Table, source: Material, copied: Material) -> None:
    made = convert(source, copied.model)
    l1, p99 = compare(source, copied)
    view = made.worst_view
    values = {name: value for name, value in made.parameters.items() if isinstance(value, float)}
    values |= {name: value for name, value in (("n", made.n), ("k", made.k)) if value is not None}
    words = ", ".join(f"{name} {value:.4g}" for name, value in values.items())
    table.add(source.model, copied.model, l1, p99, made.l1, made.p99, view.l1, view.theta_r_deg, words)


def brass_at(count: int) -> tuple[Array, Array, Array, Array]:
    """Return pairs of directions drawn in a lobe and over the hemisphere, with weights, and f_r of Ward's brass."""
    u = spread(count, 4)
    wi = unit_vector(np.arcsin(np.sqrt(u[:, 2])), 2.0 * np.pi * u[:, 3])
    lobe = Lobe(np.asarray(0.7), np.asarray(BRASS["alpha_x"]), np.asarray(BRASS["alpha_y"]), GGX)
    wr = directions(lobe, u[:, 0], u[:, 1], wi)
    weight = np.maximum(wr[:, 2], 0.0) / mixture_density(lobe, wi, wr)
    above = weight > 0.0
    wi, wr, weight = wi[above], wr[above], weight[above]
    return wi, wr, weight, models.ward_vectors(wi, wr, **BRASS)


def exhaustive(pairs: tuple[Array, Array, Array, Array], counts: Sequence[int]) -> tuple[float, tuple[float, ...]]:
    """Return the least distance of Ward's brass from GGX over all points of a grid, then of finer grids around it."""
    axes = [
        np.geomspace(0.02, 0.12, counts[0]),
        np.geomspace(0.06, 0.4, counts[1]),
        np.linspace(0.02, 0.8, counts[2]),
        np.linspace(0.0, 1.0, counts[3]),
    ]
    least, best = np.inf, (0.0,) * 4
    for _ in range(LEVELS):
        for point in itertools.product(*axes):
            value = distance(pairs, point)
            if value < least:
                least, best = value, point
        steps = [float(np.max(np.diff(axis))) for axis in axes]
        axes = [at + step * np.linspace(-1.0, 1.0, 5) for at, step in zip(best, steps, strict=True)]
        axes[3] = np.clip(axes[3], 0.0, 1.0)
    return least, best


def distance(pairs: tuple[Array, Array, Array, Array], point: Sequence[float]) -> float:
    """Return l1 of GGX with alpha_x, alpha_y, a reflectance at normal incidence, and an edge."""
    n, k = index_of(point[2], point[3])
    return left(pairs, {"alpha_x": point[0], "alpha_y": point[1], "n": n, "k": k})


def left(pairs: tuple[Array, Array, Array, Array], surface: dict[str, Any]) -> float:
    """Return l1 of GGX."""
    wi, wr, weight, truth = pairs
    wrong = np.einsum("i,i->", weight, np.abs(models.ggx_vectors(wi, wr, **surface) - truth))
    return float(wrong / np.einsum("i,i->", weight, truth))  # a BLAS would wait for its threads


def main(arguments: Sequence[str] | None = None) -> int:
    """Run both parts."""
    run = Run("conversion", "accuracy", "Conversion from one model to another", MEASURED)
    options = run.parse(run.parser(__doc__), arguments)
    began = time.process_time()
    table_of_models(run, quick=options.quick)
    made = convert(presets()["rolled-brass"], "ggx")
    pairs = brass_at(QUICK_PAIRS if options.quick else PAIRS)
    least, best = exhaustive(pairs, QUICK_GRID if options.quick else GRID)
    ours = left(pairs, {**made.parameters, "n": made.n, "k": made.k})
    grid = run.table(
        "Rolled brass of Ward 1992 as GGX",
        Column(name="search", width=12),
        *(Column(name=name) for name in ("alpha_x", "alpha_y", "n", "k")),
        Column(name="l1 at the same directions", digits=5),
    )
    n, k = index_of(best[2], best[3])
    grid.add("exhaustive", best[0], best[1], n, k, least)
    grid.add("convert", made.parameters["alpha_x"], made.parameters["alpha_y"], made.n, made.k, ours)
    ratio = ours / least
    verdict = "within" if ratio <= REQUIRED else "NOT within"
    run.say(f"The search is {verdict} 1 % of the exhaustive one: {100.0 * (ratio - 1.0):.2f} % above its l1.")
    print(f"{time.process_time() - began:.0f} s")
    run.end()
    return 0 if ratio <= REQUIRED else 1


if __name__ == "__main__":
    sys.exit(main())
