"""Albedos of every preset by Monte Carlo against the quadrature of the audit: ``python tests/benchmarks/albedo.py``.

Prints a line a material and angle and exits with 1 if the two differ by more than five times their combined error
anywhere. Both leave out the Dirac part, which has a closed form. ``--samples 1e7`` takes about ten times as long as
the default.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from typing import NamedTuple

import numpy as np

from brdfdb.audit.model_energy import TOLERANCE
from brdfdb.geometry import radians, unit_vector
from brdfdb.integrals.quadrature import spectral_albedo
from brdfdb.integrals.sampling import sample
from brdfdb.materials import Material, presets
from brdfdb_pipelines import terminal

THETA_I_DEG = (10.0, 45.0, 75.0, 85.0)
PHI_I_DEG = 30.0  # between the axes of anisotropic lobes
WAVELENGTH_NM = 550.0  # of materials that are not of one wavelength alone
CHUNK = 200_000  # samples at a time
ROUNDING = 1e-13  # of means of many float64
WORTH_A_LOOK, TOO_MUCH = 3.0, 5.0


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


def main() -> int:
    """Measure, print, and say whether all is well."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=float, default=1e6, help="of each material and angle (default: 1e6)")
    parser.add_argument("--seed", type=int, default=1992)
    parser.add_argument("materials", nargs="*", help="names of presets (default: all)")
    options = parser.parse_args()
    chosen = [presets()[name] for name in options.materials or presets()]
    rng, rows, deviations = np.random.default_rng(options.seed), [], []
    start = time.perf_counter()
    with terminal.progress() as bar:
        cases = [(material, theta_i_deg) for material in chosen for theta_i_deg in THETA_I_DEG]
        for material, theta_i_deg in bar.track(cases, description="sampling"):
            theta_i = float(radians(theta_i_deg))
            drawn, integrated = monte_carlo(material, theta_i, int(options.samples), rng), quadrature(material, theta_i)
            combined = math.hypot(drawn.error, integrated.error, ROUNDING)
            difference = drawn.albedo - integrated.albedo
            deviations.append(abs(difference) / combined)
            rows.append(
                (
                    material.name,
                    f"{theta_i_deg:g}",
                    *(f"{value:.7f}" for value in (integrated.albedo, drawn.albedo)),
                    *(f"{value:.1e}" for value in (integrated.error, drawn.error, difference)),
                    f"{deviations[-1]:.2f}",
                )
            )
    columns = ("theta_i", "quadrature", "Monte Carlo", "error", "standard error", "difference", "over both")
    terminal.print_table(
        f"Albedo without the Dirac part, {options.samples:.0e} samples", ("material", *columns), rows, numbers=columns
    )
    above = {limit: sum(each > limit for each in deviations) for limit in (WORTH_A_LOOK, TOO_MUCH)}
    print(f"{len(rows)} albedos in {time.perf_counter() - start:.0f} s; differences over combined errors:")
    print(f"{max(deviations):.2f} at most, " + ", ".join(f"{count} above {limit:g}" for limit, count in above.items()))
    return min(above[TOO_MUCH], 1)


if __name__ == "__main__":
    sys.exit(main())
