"""Albedos of every preset by Monte Carlo against the quadrature of the audit: ``python tests/benchmarks/albedo.py``.

Prints a line for each material and angle, and exits with 1 if the two differ by more than five times their combined
error anywhere. Both leave out the specular part, which has a closed form. ``--samples 1e7`` takes about ten times as
long as the default.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb.audit.model_energy import TOLERANCE
from brdfdb.geometry import radians, unit_vector
from brdfdb.integrals.quadrature import spectral_albedo
from brdfdb.integrals.sampling import sample
from brdfdb.materials import Material, presets
from tests.benchmarks.recording import Column, Run

THETA_I_DEG = (10.0, 45.0, 75.0, 85.0)
PHI_I_DEG = 30.0  # between the axes of anisotropic lobes
WAVELENGTH_NM = 550.0  # of materials that are not of one wavelength alone
CHUNK = 200_000  # samples at a time
ROUNDING = 1e-13  # of means of many float64
WORTH_A_LOOK, TOO_MUCH = 3.0, 5.0
QUICK, QUICK_SAMPLES = ("magnesium-oxide-ceramic", "rolled-brass"), 2e4
MEASURED = (
    "The directional albedo of each preset, specular part left out, by Monte Carlo and by the audit's quadrature."
)


class Estimate(NamedTuple):
    """An albedo [1] and what it may be off by."""

    albedo: float
    error: float


def monte_carlo(material: Material, theta_i: float, samples: int, rng: np.random.Generator) -> Estimate:
    """The mean of the weights of samples, and its standard error."""
    arguments = arguments_of(material)
    wi = unit_vector(theta_i, radians(PHI_I_DEG))
    count, mean, squares = 0, 0.0, 0.0
    while count < samples:
        some = min(CHUNK, samples - count)
        weight = sample(material.spec, *rng.random((2, some)), wi, **arguments).weight
        step = float(weight.mean()) - mean
        squares += float(weight.var()) * some + step * step * count * some / (count + some)
        mean += step * some / (count + some)
        count += some
    return Estimate(mean, math.sqrt(squares / count / count))


def quadrature(material: Material, theta_i: float) -> Estimate:
    """The albedo as the audit integrates it."""
    albedo, error = spectral_albedo(
        material.spec,
        theta_i,
        float(radians(PHI_I_DEG)),
        arguments_of(material),
        tolerance=TOLERANCE,
        mirrored=not material.anisotropic,
    )
    return Estimate(float(albedo[0]), float(error))


def arguments_of(material: Material) -> dict[str, float]:
    """The parameters of a material at one wavelength."""
    if not material.spectral:
        return material.arguments()
    return material.arguments(material.wavelengths_nm[0] if material.wavelengths_nm else WAVELENGTH_NM)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, and return 1 if a difference is too large."""
    run = Run("albedo", "accuracy", "Albedo by Monte Carlo and by quadrature", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("--samples", type=float, default=1e6, help="of each material and angle (default: 1e6)")
    parser.add_argument("--seed", type=int, default=1992)
    parser.add_argument("materials", nargs="*", help="names of presets (default: all)")
    options = run.parse(parser, arguments)
    samples = QUICK_SAMPLES if options.quick else options.samples
    names = options.materials or (QUICK if options.quick else presets())
    rng, deviations = np.random.default_rng(options.seed), []
    table = run.table(
        f"{samples:.0e} samples for each material and angle",
        Column(name="material", width=32),
        Column(name="theta_i", unit="deg"),
        *(Column(name=name, digits=7, width=10) for name in ("quadrature", "Monte Carlo")),
        *(Column(name=name, digits=2, width=10) for name in ("its error", "standard error", "difference")),
        Column(name="difference / errors"),
    )
    for material in (presets()[name] for name in names):
        for theta_i_deg in THETA_I_DEG:
            theta_i = float(radians(theta_i_deg))
            drawn, integrated = monte_carlo(material, theta_i, int(samples), rng), quadrature(material, theta_i)
            combined = math.hypot(drawn.error, integrated.error, ROUNDING)
            difference = drawn.albedo - integrated.albedo
            deviations.append(abs(difference) / combined)
            values = (integrated.albedo, drawn.albedo, integrated.error, drawn.error, difference, deviations[-1])
            table.add(material.name, theta_i_deg, *values)
    above = {limit: sum(each > limit for each in deviations) for limit in (WORTH_A_LOOK, TOO_MUCH)}
    run.say(
        f"Of {len(deviations)} differences the largest is {max(deviations):.2f} times the combined error; "
        + ", ".join(f"{count} are above {limit:g}" for limit, count in above.items())
        + "."
    )
    run.end()
    return min(above[TOO_MUCH], 1)


if __name__ == "__main__":
    sys.exit(main())
