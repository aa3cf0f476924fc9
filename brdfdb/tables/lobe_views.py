"""Directions of the views of a lobe: a cut, a hemisphere, half and difference angles; closer around the mirror."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from brdfdb.geometry import directions_from_half_difference, radians

Array = NDArray[np.float64]
View = Literal["cut", "hemisphere", "half-difference"]

_CUT = np.arange(-90.0, 91.0)  # theta_r [degree], negative back towards the light
_OVER = np.linspace(0.0, 90.0, 31)  # theta_r of a hemisphere [degree]
_AROUND = np.linspace(0.0, 360.0, 61)  # delta_phi [degree]
# Angles from the mirror direction [degree]
_NEAR = np.array([-12.0, -8.0, -5.0, -3.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0])
_HALF: Array = np.arange(90, dtype=np.float64) + 0.5  # theta_h and theta_d [degree]
MOST_POINTS = _HALF.size**2  # points of the largest view


def view_directions(
    view: View, theta_i_deg: float, phi_i_deg: float
) -> tuple[dict[str, Array], tuple[Array | float, Array | float, Array | float, Array | float]]:
    """Return the axes of a view [degree], and theta_i, phi_i, theta_r, phi_r of its points [rad].

    Parameters
    ----------
    view : str
        "cut" is the plane of incidence over theta_r, negative back towards the light. "hemisphere" is all viewers over
        theta_r and delta_phi. "half-difference" is theta_h and theta_d with phi_d = 90 degrees.
    theta_i_deg, phi_i_deg : float [degree]
        The light, theta_i in [0, 90]. Of half-difference phi_i is phi_h, and theta_i is not used.

    Returns
    -------
    axes : dict of str to array [degree]
        In the order of the axes of the points.
    angles : tuple of four arrays [rad]
        They broadcast to one point for each combination of the axes.
    """
    light, turned = radians(theta_i_deg), radians(phi_i_deg)
    if view == "half-difference":
        points = directions_from_half_difference(radians(_HALF)[:, np.newaxis], turned, radians(_HALF), radians(90.0))
        return {"theta_h": _HALF, "theta_d": _HALF}, points
    if view == "cut":
        signed = np.unique(np.clip(np.concatenate([_CUT, theta_i_deg + _NEAR]), -90.0, 90.0))
        beyond = turned + np.where(signed > 0.0, np.pi, 0.0)
        return {"theta_r": signed}, (light, turned, radians(np.abs(signed)), beyond)
    theta_r = np.unique(np.clip(np.concatenate([_OVER, theta_i_deg + _NEAR]), 0.0, 90.0))
    spread = _NEAR / max(np.sin(light), 0.1)
    delta_phi = np.unique(np.clip(np.concatenate([_AROUND, 180.0 + spread]), 0.0, 360.0))
    axes = {"theta_r": theta_r, "delta_phi": delta_phi}
    return axes, (light, turned, radians(theta_r)[:, np.newaxis], turned + radians(delta_phi))
