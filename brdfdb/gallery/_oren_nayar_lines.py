"""Viewers along a line across the hemisphere, in degrees: the axis of most figures of Oren and Nayar 1994."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from brdfdb.figure import Curve, Panel, Role, Statement, curve_of, listed
from brdfdb.gauss import gauss_rule
from brdfdb.geometry import radians
from brdfdb.models import oren_nayar_single_slope_parts
from brdfdb.models.oren_nayar_1994 import Parts
from brdfdb.parameters import Floats

PAPER = "orennayar1994"
THETA_R = np.arange(-90.0, 91.0)  # angles of viewers [degree], positive on the side of the light

# Our readings of words of the paper, mostly as a share of the mean
SMALL = 0.1  # "near", "nearly" and "slight"
VERY_ACCURATE = 0.05  # "very accurate"
ROUNDING = 1e-15  # "exactly", in float64

RHO = 0.9  # albedo of Figs 8 to 13
GRAZING_LIGHT = 75.0  # theta_i [degree] of Figs 8, 9 and 13
RADIANCE = "radiance L_r, of E_0 = 1"

Result = TypeVar("Result")

_NODES = 12  # Gauss-Legendre nodes of a piece: the integral has an error of 2e-10
_REACH = 6.0  # largest slope over sigma; steeper facets have 1.5e-8 of the weight


def rough(sigma_deg: float) -> dict[str, float]:
    """Return the parameters of a surface with the albedo RHO and slopes of sigma_deg [degree]."""
    return {"rho": RHO, "sigma": float(radians(sigma_deg))}


def to_radiance(theta_i_deg: float) -> float:
    """Return the factor [1] from f_r to the drawn radiance: the irradiance of light from theta_i for E_0 = 1."""
    return float(np.cos(radians(theta_i_deg)))


def across(model: Callable[..., Result], theta_i_deg: float, delta_phi_deg: float = 0.0, **parameters: float) -> Result:
    """Return the result of a model of angles for viewers at THETA_R, [1/sr] in the type of the model.

    `delta_phi_deg` is phi_r - phi_i of viewers with positive THETA_R; it is half a turn more for the others.
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


def line_panel(curves: list[Curve], title: str = "", y_label: str = RADIANCE) -> Panel:
    """Return a panel of curves over THETA_R."""
    return Panel(title=title, x_label="θ_r [degree], above 0 on the side of the light", y_label=y_label, curves=curves)


def very_accurate(off: list[float], lights_deg: list[float], where: str) -> Statement:
    return Statement(
        says="in all cases, the functional approximation proves to be very accurate",
        where=where,
        seen=f"It is {listed(off, '.1%')} of the mean off the paper's own evaluation, root mean square, for θ_i of "
        f"{listed(lights_deg, '.0f')}° (very accurate: {VERY_ACCURATE:.0%}).",
        threshold_from="our reading: very accurate is within 5 % of the mean, root mean square",
        holds=max(off) < VERY_ACCURATE,
    )


def evaluated_parts(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    rho: float,
    sigma: float,
) -> Parts:
    """Return the direct and the interreflected part [1/sr] of eq. 25, from the closed forms of one slope.

    This is the evaluation that Oren and Nayar drew. Section 4.3 evaluates eq. 25 with eq. 24 for direct light, and with
    eq. 49 of appendix B.2 for the second bounce. The weight of eq. 26 is normalised over the slope. The integral is
    split at the slopes where shadowing, masking, or both begin (eqs 39 and 43), because the closed forms start as
    square roots there.
    """
    theta_i, phi_i, theta_r, phi_r = np.broadcast_arrays(theta_i, phi_i, theta_r, phi_r)
    cot_i, cot_r = 1.0 / np.tan(np.maximum(theta_i, 1e-9)), 1.0 / np.tan(np.maximum(theta_r, 1e-9))
    last = min(_REACH * sigma, np.pi / 2.0)
    starts = [np.zeros(cot_i.shape), *(np.arctan(cot) for cot in (cot_i, cot_r, np.hypot(cot_i, cot_r)))]
    edges = np.sort(np.minimum([*starts, np.full(cot_i.shape, last)], last), axis=0)
    x, w = gauss_rule(_NODES)
    u = (x + 1.0) / 2.0
    w = w / 2.0
    direct = bounce = total = np.zeros(cot_i.shape)
    for low, high in pairwise(edges):
        theta_a = low[..., None] + (high - low)[..., None] * u**2
        # Eq. (26) with the sine of eq. (25)
        weight = w * 2.0 * u * (high - low)[..., None] * np.exp(-0.5 * (theta_a / sigma) ** 2) * np.sin(theta_a)
        angles = (angle[..., None] for angle in (theta_i, phi_i, theta_r, phi_r))
        one = oren_nayar_single_slope_parts(*angles, rho=rho, theta_a=theta_a)
        direct = direct + np.sum(weight * one.direct, axis=-1)
        bounce = bounce + np.sum(weight * one.interreflected, axis=-1)
        total = total + np.sum(weight, axis=-1)
    return Parts(direct / total, bounce / total)


def evaluated(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, rho: float, sigma: float
) -> Floats:
    """Return f_r [1/sr] of the paper's own evaluation; the arguments are those of `evaluated_parts`."""
    parts = evaluated_parts(theta_i, phi_i, theta_r, phi_r, rho=rho, sigma=sigma)
    return parts.direct + parts.interreflected
