"""The evaluation that Oren and Nayar 1994 drew: eqs 24 and 49 for one slope in all azimuths, integrated by eq. 25."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from brdfdb.integrals.quadrature import gauss_rule
from brdfdb.models import oren_nayar_single_slope_parts
from brdfdb.models.oren_nayar_1994 import Parts
from brdfdb.parameters import Floats

_NODES = 12  # Gauss-Legendre nodes of a piece: the integral has an error of 2e-10
_REACH = 6.0  # largest slope over sigma; steeper facets have 1.5e-8 of the weight


def evaluated_parts(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    rho: float,
    sigma: float,
) -> Parts:
    """Return the direct and the interreflected part [1/sr] of eq. 25 over the closed forms of one slope.

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light and viewer; theta in [0, pi/2).
    rho : float [1]
        Albedo of a facet, in [0, 1].
    sigma : float [rad]
        Standard deviation of the slope angle, in (0, pi/2].

    Returns
    -------
    Parts [1/sr]
        Arrays of the broadcast shape of the directions.

    Notes
    -----
    Section 4.3 evaluates eq. 25 with eq. 24 for direct light. For the second bounce it uses eq. 49 of appendix B.2.
    The weight of eq. 26 is normalised over the slope. The integral is split at the slopes where shadowing, masking, or
    both begin (eqs 39 and 43), because the closed forms start as square roots there.

    References
    ----------
    orennayar1994
    """
    theta_i, phi_i, theta_r, phi_r = np.broadcast_arrays(theta_i, phi_i, theta_r, phi_r)
    cot_i, cot_r = 1.0 / np.tan(np.maximum(theta_i, 1e-9)), 1.0 / np.tan(np.maximum(theta_r, 1e-9))
    last = min(_REACH * sigma, np.pi / 2.0)
    starts = [np.zeros(cot_i.shape), *(np.arctan(cot) for cot in (cot_i, cot_r, np.hypot(cot_i, cot_r)))]
    edges = np.sort(np.minimum([*starts, np.full(cot_i.shape, last)], last), axis=0)
    x, w = gauss_rule(_NODES)
    u, w = (x + 1.0) / 2.0, w / 2.0
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
