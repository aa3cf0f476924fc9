"""Microfacet models against Mitsuba's `roughconductor`: ``python tests/benchmarks/mitsuba_microfacet.py``.

Random pairs of directions, float32 as Mitsuba computes: f_r cos theta_r and the densities of samples, drawn from all
facets and, of GGX, from the visible ones. Exits with 1 if anything differs by more than 1e-4 relative. Values below
1e-9 are left out: they are the far tail of a Gaussian, of which the rounding of float32 makes much.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb.geometry import unit_vector
from brdfdb.integrals.sampling import lobe_of, mixture_density
from brdfdb.models import MODELS
from tests.benchmarks.recording import Column, Run

SHAPES = {"ggx": "ggx_separable", "beckmann": "beckmann_separable"}  # of Mitsuba, and our model
ALPHAS = ((0.05, 0.05), (0.1, 0.1), (0.1, 0.25), (0.5, 0.5), (0.6, 0.3))
COPPER = {"n": 0.95, "k": 2.6}  # rounded, near 550 nm
REQUIRED = 1e-4
FLOOR = 1e-9  # [1/sr]
FULL, QUICK = 100_000, 100
MEASURED = (
    "The largest relative difference from Mitsuba of f_r cos theta_r and of the densities of samples, in float32."
)

Array = NDArray[np.float64]


class Difference(NamedTuple):
    """The largest relative differences [1] of values and densities, and the share of values above the floor.

    `density` is that of samples from all facets, `visible` from the visible ones, which only GGX has; nan of Beckmann.
    """

    value: float
    density: float
    visible: float
    compared: float


def directions(rng: np.random.Generator, count: int) -> Array:
    """Return unit vectors of float32, uniform over the hemisphere from 0.6 degrees above the horizon."""
    w = unit_vector(np.arccos(rng.uniform(0.01, 1.0, count)), rng.uniform(-np.pi, np.pi, count))
    return w.astype(np.float32).astype(np.float64)


def conductor(shape: str, alpha_x: float, alpha_y: float, visible: bool) -> Any:
    """Return Mitsuba's rough copper, whose samples are drawn from all facets or from the visible ones."""
    import mitsuba

    mitsuba.set_variant("scalar_rgb")
    alphas, index = {"alpha_u": alpha_x, "alpha_v": alpha_y}, {"eta": COPPER["n"], "k": COPPER["k"]}
    kind = {"type": "roughconductor", "distribution": shape, "sample_visible": visible}
    return mitsuba.load_dict(kind | alphas | index)


def of_mitsuba(
    shape: str, alpha_x: float, alpha_y: float, wi: Array, wr: Array, *, visible: bool
) -> tuple[Array, Array]:
    """Return f_r cos theta_r and the density [1/sr] of samples by Mitsuba, whose scalar variant takes one pair."""
    import mitsuba

    surface = conductor(shape, alpha_x, alpha_y, visible)
    context, interaction = mitsuba.BSDFContext(), mitsuba.SurfaceInteraction3f()
    values, densities = np.empty((2, len(wi)))
    for j, (light, viewer) in enumerate(zip(wi.tolist(), wr.tolist(), strict=True)):
        interaction.wi = mitsuba.Vector3f(*light)
        value, densities[j] = surface.eval_pdf(context, interaction, mitsuba.Vector3f(*viewer))
        values[j] = value[0]
    return values, densities


def difference(shape: str, alpha_x: float, alpha_y: float, count: int) -> Difference:
    """Return the differences of our model from Mitsuba over random pairs of directions."""
    rng = np.random.default_rng(2007)
    wi, wr = directions(rng, count), directions(rng, count)
    spec = MODELS[SHAPES[shape]]
    surface = {"alpha_x": np.float32(alpha_x), "alpha_y": np.float32(alpha_y)}
    surface |= {name: np.float32(value) for name, value in COPPER.items()}
    value = spec.vectors(wi, wr, **surface) * wr[:, 2]
    lobe = lobe_of(spec, wi, surface)._replace(share=np.ones(count))
    theirs, density = of_mitsuba(shape, alpha_x, alpha_y, wi, wr, visible=False)
    of_visible = np.nan
    if lobe.visible:
        _, theirs_visible = of_mitsuba(shape, alpha_x, alpha_y, wi, wr, visible=True)
        of_visible = _largest(theirs_visible, mixture_density(lobe, wi, wr))
    of_all = _largest(density, mixture_density(lobe._replace(visible=False), wi, wr))
    return Difference(_largest(theirs, value), of_all, of_visible, float(np.mean(value > FLOOR)))


def _largest(theirs: Array, ours: Array) -> float:
    above = ours > FLOOR
    return float(np.max(np.abs(theirs - ours)[above] / ours[above], initial=0.0))


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare all shapes and roughnesses, and print a row for each."""
    run = Run("mitsuba_microfacet", "accuracy", "Microfacets against Mitsuba", MEASURED)
    options = run.parse(run.parser(__doc__), arguments)
    count = QUICK if options.quick else FULL
    names = [Column(name=name, width=18) for name in ("model", "alpha_x", "alpha_y")]
    numbers = [
        Column(name=name)
        for name in ("pairs", "value", "density of samples", "density of visible", "share above the floor")
    ]
    table = run.table("Largest relative differences", *names, *numbers)
    began, worst = time.process_time(), 0.0
    for shape, model in SHAPES.items():
        for alphas in ALPHAS:
            each = difference(shape, *alphas, count)
            table.add(model, *alphas, count, *each)
            worst = max(worst, each.value, each.density, np.nan_to_num(each.visible))
    verdict = "within" if worst <= REQUIRED else "NOT within"
    run.say(f"All are {verdict} {REQUIRED:g}: the largest is {worst:.2g}.")
    print(f"{time.process_time() - began:.0f} s")
    run.end()
    return 0 if worst <= REQUIRED else 1


if __name__ == "__main__":
    sys.exit(main())
