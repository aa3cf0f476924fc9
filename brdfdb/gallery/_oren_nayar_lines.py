"""Viewers along a line across the hemisphere, in degrees: what most figures of Oren and Nayar 1994 are drawn over."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from brdfdb.figure import Curve, Role, curve_of
from brdfdb.geometry import radians
from brdfdb.parameters import Floats

PAPER = "orennayar1994"
THETA_R = np.arange(-90.0, 91.0)  # degree; above 0 on the side of the light
THETA_R_LABEL = "θ_r [degree], above 0 on the side of the light"

SMALL = 0.1  # what the paper's "near", "nearly" and "slight" are taken for, mostly as a share of the mean
VERY_ACCURATE = 0.05  # and its "very accurate"
ROUNDING = 1e-15  # "exactly", in float64

RHO = 0.9  # the albedo of Figs 8 to 13
GRAZING_LIGHT = 75.0  # degree: theta_i of Figs 8, 9 and 13
RADIANCE = "radiance L_r, of E_0 = 1"

Result = TypeVar("Result")


def rough(sigma_deg: float) -> dict[str, float]:
    """Return the parameters of a surface of RHO with slopes of sigma_deg [degree]."""
    return {"rho": RHO, "sigma": float(radians(sigma_deg))}


def to_radiance(theta_i_deg: float) -> float:
    """Return the irradiance [1] of light from theta_i, for E_0 = 1: the factor from f_r to the radiance drawn."""
    return float(np.cos(radians(theta_i_deg)))


def across(model: Callable[..., Result], theta_i_deg: float, delta_phi_deg: float = 0.0, **parameters: float) -> Result:
    """What a model of angles returns for viewers at THETA_R.

    Parameters
    ----------
    model : callable
        A function of `brdfdb.models` that takes angles.
    theta_i_deg : float [degree]
        Polar angle of the light, in [0, 90].
    delta_phi_deg : float [degree]
        phi_r - phi_i of the viewers with THETA_R above 0; the others are half a turn from them.
    **parameters : float
        Parameters of the model, in its units.

    Returns
    -------
    array [1/sr] of the shape of THETA_R, or whatever the model makes of such arrays.
    """
    delta_phi = np.where(THETA_R < 0.0, delta_phi_deg + 180.0, delta_phi_deg)
    return model(radians(theta_i_deg), 0.0, radians(np.abs(THETA_R)), radians(delta_phi), **parameters)


def at(values: Floats, theta_r_deg: float) -> float:
    """The one of values over THETA_R at that angle [degree]."""
    return float(values[np.searchsorted(THETA_R, theta_r_deg)])


def between(values: Floats, low_deg: float, high_deg: float) -> Floats:
    """Those of values over THETA_R from low to high [degree], both included."""
    return values[(low_deg <= THETA_R) & (high_deg >= THETA_R)]


def left_past(values: Floats, theta_deg: float) -> float:
    """What values over THETA_R grow by with the first degree past an angle, over what the last one before it gave."""
    before, there, past = (at(values, theta_deg + step) for step in (-1.0, 0.0, 1.0))
    return (past - there) / (there - before)


def variation(values: Floats) -> float:
    """The standard deviation over the mean: 0 where brightness does not depend on the viewer."""
    return float(np.std(values) / np.mean(values))


def distance(values: Floats, truth: Floats) -> float:
    """The root of the mean square of the difference over the mean of the truth."""
    return float(np.sqrt(np.mean((values - truth) ** 2)) / np.mean(truth))


def curve(label: str, values: Floats, role: Role = "other") -> Curve:
    """Values over THETA_R, to be drawn."""
    return curve_of(label, THETA_R, values, role)
