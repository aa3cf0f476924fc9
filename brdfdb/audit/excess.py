"""Albedos above 1: what of them is known as published, what somebody accepts, and from which angle on they are."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from brdfdb.materials import Material, presets
from brdfdb.materials.provenance import KnownExcess
from brdfdb.tables.grids import Axis

# A sum of float32 values: an ideal diffuser, albedo 1, measures 1 + 1.2e-7
ENERGY_TOLERANCE = 1e-6
DIGITS = 7  # of albedos in a report: what a float32 holds
ANGLE_TOLERANCE_DEG = 1e-3  # of the angle from which on an albedo exceeds 1


def published_excess(material: Material, wavelength_nm: Axis | None) -> KnownExcess | None:
    """Return the excess that is known as published of a material [1, degree], or None.

    It is known of a preset with the very parameters that its paper prints, index of refraction and wavelengths
    included, under whatever name, and of nothing else: neither a model nor a recipe excuses anything. `Material`
    refuses a known excess that rests on an assumption.
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


def limit_of(known: KnownExcess | None, theta_i_deg: Axis) -> Axis:
    """Return what an albedo may be at each angle [degree]: 1, and a known excess from its angle on."""
    one = np.full(theta_i_deg.size, 1.0 + ENERGY_TOLERANCE)
    return one if known is None else np.where(theta_i_deg >= known.from_theta_i_deg, known.max_albedo, one)


def crossing(excess: Callable[[float], float], low: float, high: float) -> float:
    """Return from which angle [degree] on an excess is positive, by bisection to `ANGLE_TOLERANCE_DEG`.

    Parameters
    ----------
    excess : callable
        Albedo less 1, of an angle [degree].
    low, high : float [degree]
        Angles at which it is not positive, and positive.
    """
    while high - low > ANGLE_TOLERANCE_DEG:
        between = (low + high) / 2.0
        low, high = (low, between) if excess(between) > 0.0 else (between, high)
    return round(high, 4)
