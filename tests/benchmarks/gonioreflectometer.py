"""Ward's method from picture to parameters: ``python tests/benchmarks/gonioreflectometer.py``.

The simulated instrument takes four pictures of each of Ward's materials, with noise, blur and saturation. They are
reduced to samples, and Ward's four parameters are fitted by least squares with rho_d + rho_s at most 1. Lobes that are
hardly wider than a pixel are fitted as the command does, whose intervals reach farther for them. Exits with 1 if fewer
than 90 % of the parameters are within the 95 % interval that the fit states, fewer than 95 % of those of narrow lobes,
or one is more than 1 % off.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb import models
from brdfdb.fitting.fit import fits
from brdfdb.geometry import radians
from brdfdb.materials import Material, presets
from brdfdb.measurements import Samples, joined
from brdfdb.measurements.aperture import averaged
from brdfdb.measurements.gonioreflectometer import Gonioreflectometer, photograph, reduced
from brdfdb_pipelines.commands.photograph import LIGHTS
from tests.benchmarks.recording import Column, Run

Array = NDArray[np.float64]
PARAMETERS = ("rho_d", "rho_s", "alpha_x", "alpha_y")
BEGIN, LOW, HIGH = [0.3, 0.1, 0.1, 0.1], [0.0, 0.0, 0.01, 0.01], [1.0, 1.0, 0.6, 0.6]
INTERVAL = 1.96  # standard errors on each side, for 95 %
REQUIRED, REQUIRED_NARROW, FAR = 0.9, 0.95, 0.01
NARROW = {"rho_d": 0.2, "rho_s": 0.1, "alpha_x": 0.02, "alpha_y": 0.02}  # a lobe whose standard deviation is 3 pixels
NARROW_SEEDS, NARROW_SEED = 8, 440_000
QUICK = ("rolled-brass", "ivory-computer-plastic")
MEASURED = (
    "Ward's parameters from simulated pictures of his instrument, with noise, blur and saturation: their difference "
    "from the true ones, relative and in standard errors of the fit."
)


def photographed(material: Material, seed: int) -> Samples:
    """Return the samples of the pictures of a material."""
    brdf, instrument = material.brdf_at(None), Gonioreflectometer()
    lights = enumerate(radians(np.array(LIGHTS)).tolist())
    return joined([reduced(photograph(brdf, instrument, *light, seed + number)) for number, light in lights])


def fitted(samples: Samples) -> tuple[Array, Array]:
    """Return Ward's four parameters and their standard errors."""
    assert samples.uncertainty is not None
    measured, noise = samples.values[:, 0], samples.uncertainty[:, 0]

    def residuals(x: Array) -> Array:
        given = dict(zip(PARAMETERS, x, strict=True))
        predicted = averaged(lambda wi, wr: models.ward_vectors(wi, wr, **given)[:, np.newaxis], samples.instrument)
        return (predicted(samples.w_i, samples.w_r)[:, 0] - measured) / noise

    best = least_squares(residuals, BEGIN, bounds=(LOW, HIGH), x_scale=0.1)
    return best.x, np.sqrt(np.diag(np.linalg.inv(best.jac.T @ best.jac)))


def narrow(run: Run, seeds: int) -> float:
    """Measure the share of parameters of narrow lobes in the intervals of the command."""
    table = run.table(
        "A lobe of alpha 0.02", "seed", *(Column(name=f"{name} off", unit="%") for name in PARAMETERS), "inside"
    )
    instrument = Gonioreflectometer()
    inside = 0
    for seed in range(seeds):
        pictures = [
            photograph(
                lambda wi, wr: np.asarray(models.ward_vectors(wi, wr, **NARROW))[:, np.newaxis],
                instrument,
                *light,
                NARROW_SEED + 10 * seed + number,
            )
            for number, light in enumerate(radians(np.array(LIGHTS)).tolist())
        ]
        document, _ = fits(joined([reduced(picture) for picture in pictures]), ["ward"], residual="uncertainty")
        found = {one.name: one for one in document.fits[0].estimates}
        hits = sum(found[name].low <= NARROW[name] <= found[name].high for name in PARAMETERS)
        table.add(seed, *(100.0 * abs(found[name].value / NARROW[name] - 1.0) for name in PARAMETERS), hits)
        inside += hits
    share = inside / (seeds * len(PARAMETERS))
    run.say(f"{inside} of {seeds * len(PARAMETERS)} parameters of narrow lobes are within their 95 % interval.")
    return share


def main(arguments: Sequence[str] | None = None) -> int:
    """Photograph, reduce, fit and print all materials."""
    run = Run("gonioreflectometer", "accuracy", "Ward's gonioreflectometer", MEASURED)
    options = run.parse(run.parser(__doc__), arguments)
    names = [
        Column(name=f"{name} {kind}", unit=unit)
        for kind, unit in (("off", "%"), ("in errors", ""))
        for name in PARAMETERS
    ]
    shown = run.table("Parameters", Column(name="material", width=36), "samples", *names, "seconds")
    off, inside = [], []
    for number, (name, material) in enumerate(presets().items()):
        if material.model != "ward" or (options.quick and name not in QUICK):
            continue
        began = time.perf_counter()
        samples = photographed(material, 100 * number)
        best, error = fitted(samples)
        true = np.array([float(material.parameters[key]) for key in PARAMETERS])  # type: ignore[arg-type]
        off.append(np.abs(best / true - 1.0))
        inside.append(np.abs(best - true) / error)
        shown.add(name, len(samples), *(100.0 * off[-1]), *inside[-1], time.perf_counter() - began)
    share, worst = float(np.mean(np.array(inside) < INTERVAL)), float(np.max(off))
    run.say(f"{share:.0%} of {np.size(inside)} parameters are within their 95 % interval; at least 90 % is required.")
    run.say(f"The largest error is {worst:.2%}.")
    of_narrow = narrow(run, 1 if options.quick else NARROW_SEEDS)
    run.end()
    return 0 if share >= REQUIRED and of_narrow >= REQUIRED_NARROW and worst < FAR else 1


if __name__ == "__main__":
    sys.exit(main())
