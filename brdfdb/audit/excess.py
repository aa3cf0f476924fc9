"""Albedos above 1: the excess that is known as published, the limits that follow, and the angle where it begins."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from brdfdb.materials import Material, presets
from brdfdb.materials.provenance import KnownExcess
from brdfdb.tables.grids import Axis

# Tolerance of an albedo of 1 [1]. Sums of float32 values round: an ideal diffuser measures 1 + 1.2e-7
ENERGY_TOLERANCE = 1e-6
DIGITS = 7  # significant digits of albedos in a report: as many as a float32 holds
ANGLE_TOLERANCE_DEG = 1e-3  # tolerance of the angle above which an albedo exceeds 1


def published_excess(material: Material, wavelength_nm: Axis | None) -> KnownExcess | None:
    """Return the excess that is known as published of a material [1, degree], or None.

    Only presets have a known excess. A material has it if its parameters, index of refraction and wavelengths are
    those of the preset, under any name. Neither a model nor a recipe excuses an excess. `Material` refuses a known
    excess that rests on an assumption.
    """
    for preset in presets().values():
        known = preset.known_excess
        if known is None:
            continue
        stated = preset.wavelengths_nm
        same = (preset.model, preset.file_parameters(), preset.refractive_index) == (
            *(material.model, material.file_parameters()),
            material.refractive_index,
        )
        if same and (stated is None or np.array_equal(stated, wavelength_nm if wavelength_nm is not None else ())):
            return known
    return None


def cause_of(material: Material, wavelength_nm: Axis | None) -> str:
    """Return why the model of a material can reflect more than arrives, in words; empty if its paper does not say.

    A limit of energy that the parameters do not keep comes first. The general reason of the model follows only if they
    leave another limit, too, or keep all of them.
    """
    spec = material.spec
    stated = [] if spec.limits is None else list(spec.limits(material.arguments(wavelength_nm)))
    outside = [limit for limit in stated if limit.standing == "outside" and limit.of_energy]
    causes = [
        f"a limit is not kept: {limit.quantity} is {limit.value}, valid {limit.valid}; {limit.where}"
        for limit in outside
    ]
    others = any(limit.standing in ("at the edge", "outside") for limit in stated if not limit.of_energy)
    if spec.excess and (others or not outside):
        causes.append(spec.excess)
    return "; ".join(causes)


def limit_of(known: KnownExcess | None, theta_i_deg: Axis) -> Axis:
    """Return the largest allowed albedo [1] at each angle [degree]: 1, or the known excess above its angle."""
    one = np.full(theta_i_deg.size, 1.0 + ENERGY_TOLERANCE)
    return one if known is None else np.where(theta_i_deg >= known.from_theta_i_deg, known.max_albedo, one)


def place(theta_i_deg: float, wavelength_nm: float | None) -> str:
    """Return the angle [degree] of an albedo in words, with its wavelength [nm] unless it is grey."""
    return f"{theta_i_deg:.4g} degrees" + ("" if wavelength_nm is None else f" and {wavelength_nm:g} nm")


def crossing(excess: Callable[[float], float], low: float, high: float) -> float:
    """Return the angle [degree] above which an excess is positive, by bisection to `ANGLE_TOLERANCE_DEG`.

    Parameters
    ----------
    excess : callable
        Albedo minus 1 [1], as a function of an angle [degree].
    low, high : float [degree]
        Angles where the excess is not positive, and where it is positive.
    """
    while high - low > ANGLE_TOLERANCE_DEG:
        between = (low + high) / 2.0
        low, high = (low, between) if excess(between) > 0.0 else (between, high)
    return round(high, 4)
