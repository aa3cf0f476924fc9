"""Viewers along a line across the hemisphere, in degrees: the axis of most figures of Oren and Nayar 1994."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from brdfdb.figure import Curve, Role, Statement, curve_of, listed
from brdfdb.geometry import radians
from brdfdb.parameters import Floats

PAPER = "orennayar1994"
THETA_R = np.arange(-90.0, 91.0)  # angles of viewers [degree], positive on the side of the light
THETA_R_LABEL = "θ_r [degree], above 0 on the side of the light"

# Our readings of words of the paper, mostly as a share of the mean
SMALL = 0.1  # "near", "nearly" and "slight"
VERY_ACCURATE = 0.05  # "very accurate"
ROUNDING = 1e-15  # "exactly", in float64

RHO = 0.9  # albedo of Figs 8 to 13
GRAZING_LIGHT = 75.0  # theta_i [degree] of Figs 8, 9 and 13
RADIANCE = "radiance L_r, of E_0 = 1"

Result = TypeVar("Result")


def rough(sigma_deg: float) -> dict[str, float]:
    """Return the parameters of a surface with the albedo RHO and slopes of sigma_deg [degree]."""
    return {"rho": RHO, "sigma": float(radians(sigma_deg))}


def to_radiance(theta_i_deg: float) -> float:
    """Return the factor [1] from f_r to the drawn radiance: the irradiance of light from theta_i for E_0 = 1."""
    return float(np.cos(radians(theta_i_deg)))


def across(model: Callable[..., Result], theta_i_deg: float, delta_phi_deg: float = 0.0, **parameters: float) -> Result:
    """Return the result of a model for viewers at THETA_R.

    Parameters
    ----------
    model : callable
        A function of `brdfdb.models` that takes angles.
    theta_i_deg : float [degree]
        Polar angle of the light, in [0, 90].
    delta_phi_deg : float [degree]
        phi_r - phi_i of viewers with positive THETA_R; it is half a turn more for the others.
    **parameters : float
        Parameters of the model, in its units.

    Returns
    -------
    array [1/sr] of the shape of THETA_R, or the model's own result type of such arrays
    """
    delta_phi = np.where(THETA_R < 0.0, delta_phi_deg + 180.0, delta_phi_deg)
    return model(radians(theta_i_deg), 0.0, radians(np.abs(THETA_R)), radians(delta_phi), **parameters)


def at(values: Floats, theta_r_deg: float) -> float:
    """Return the value at an angle [degree] of THETA_R."""
    return float(values[np.searchsorted(THETA_R, theta_r_deg)])


def between(values: Floats, low_deg: float, high_deg: float) -> Floats:
    """Return the values at the angles of THETA_R from low to high [degree], both included."""
    return values[(low_deg <= THETA_R) & (high_deg >= THETA_R)]


def left_past(values: Floats, theta_deg: float) -> float:
    """Return the growth of values in the first degree past an angle, over that in the last degree before it [1]."""
    before, middle, past = (at(values, theta_deg + step) for step in (-1.0, 0.0, 1.0))
    return (past - middle) / (middle - before)


def variation(values: Floats) -> float:
    """Return the standard deviation over the mean [1]: 0 where brightness does not depend on the viewer."""
    return float(np.std(values) / np.mean(values))


def distance(values: Floats, truth: Floats) -> float:
    """Return the root mean square of the difference over the mean of the truth [1]."""
    return float(np.sqrt(np.mean((values - truth) ** 2)) / np.mean(truth))


def curve(label: str, values: Floats, role: Role = "other") -> Curve:
    """Return the curve of values over THETA_R."""
    return curve_of(label, THETA_R, values, role)


def very_accurate(off: list[float], lights_deg: list[float], where: str) -> Statement:
    """Return the statement on the distances [1] of the functional approximation from the paper's own evaluation."""
    return Statement(
        says="in all cases, the functional approximation proves to be very accurate",
        where=where,
        seen=f"It is {listed(off, '.1%')} of the mean off the paper's own evaluation, root mean square, for θ_i of "
        f"{listed(lights_deg, '.0f')}° (very accurate: {VERY_ACCURATE:.0%}).",
        threshold_from="our reading: very accurate is within 5 % of the mean, root mean square",
        holds=max(off) < VERY_ACCURATE,
    )
