"""V-grooves of Lambertian facets with all bounces of light, by strips and the strings between their edges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brdfdb.integrals.quadrature import gauss_rule

Array = NDArray[np.float64]

STRIPS = 32  # strips of a facet: more strips change no bounce by 0.2 % of the radiance
AZIMUTHS = 48  # azimuths of the grooves, spread over half a turn
SLOPES = 12  # Gauss-Legendre nodes of the slopes
_REACH = 4.5  # largest slope over sigma; steeper facets have 4e-5 of the weight


def view_factors(theta_a: float, strips: int = STRIPS) -> Array:
    """Return the share of light [1] that a strip of one facet (row) sends to a strip of the other (column).

    Hottel's rule of crossed strings: the share is half of the crossed distances less the straight ones, over the width
    of the strip. Facets have the slope theta_a [rad] and width 1. Strips count from the bottom of the groove.
    """
    edges = np.linspace(0.0, 1.0, strips + 1)
    x, y = edges[:, None], edges[None, :]
    distance = np.sqrt(x * x + 2.0 * x * y * np.cos(2.0 * theta_a) + y * y)
    crossed = distance[:-1, 1:] + distance[1:, :-1] - distance[:-1, :-1] - distance[1:, 1:]
    return np.asarray(0.5 * strips * crossed)


def _met(slope: Array, theta_a: float) -> tuple[Array, Array]:
    """Return <w, a> over cos(theta) [1] of both facets, (..., 2), and the widths [1] that a direction reaches.

    `slope` is tan(theta) cos(phi - phi_a) of the direction. A direction reaches a facet from its upper edge downwards.
    The rest lies behind the upper edge of the other facet.
    """
    facing = np.cos(theta_a) + np.sin(theta_a) * np.stack([slope, -slope], axis=-1)
    width = np.minimum(2.0 * np.cos(theta_a) / np.maximum(facing, 1e-300), 1.0)
    return np.maximum(facing, 0.0), np.where(facing > 0.0, width, 0.0)


def _on_strips(facing: Array, width: Array, strips: int) -> Array:
    """Return <w, a> over cos(theta) [1] on each strip, (..., 2, strips), reduced by the hidden part of the strip."""
    upper = np.linspace(0.0, 1.0, strips + 1)[1:]
    return facing[..., None] * np.clip((upper - 1.0 + width[..., None]) * strips, 0.0, 1.0)


def bounces(
    theta_i: float, theta_r: Array, delta_phi: Array, rho: float, sigma: float, orders: int, strips: int = STRIPS
) -> Array:
    """Return f_r [1/sr] of Gaussian slopes bounce by bounce, shape (orders, viewers).

    Parameters
    ----------
    theta_i : float [rad]
        Polar angle of the light.
    theta_r, delta_phi : array [rad]
        Polar angles of viewers and their azimuths from the light, both of shape (viewers,).
    rho : float [1]
        Albedo of a facet, in [0, 1).
    sigma : float [rad]
        Standard deviation of the slope angle.
    orders : int
        Rows of the result. The last row is the sum of all later bounces.
    strips : int
        Strips of a facet.

    Notes
    -----
    The surface is that of Oren and Nayar 1994 (eqs 8 and 26): long grooves. Each facet is cut into strips, and a strip
    has one radiosity. The view factors of strips are exact. No equation of the paper for interreflection is used.
    """
    azimuth = (np.arange(AZIMUTHS) + 0.5) * np.pi / AZIMUTHS
    slope_i = np.tan(theta_i) * np.cos(azimuth)
    slope_r = np.tan(theta_r)[:, None] * np.cos(azimuth - delta_phi[:, None])
    last = min(_REACH * sigma, np.pi / 2.0)
    nodes, weights = gauss_rule(SLOPES)
    slopes = (nodes + 1.0) / 2.0 * last
    # Eq. (26) with the sine of eq. (8), normalised over the slope
    weights = weights * np.exp(-0.5 * (slopes / sigma) ** 2) * np.sin(slopes)
    total = np.zeros((orders, theta_r.size))
    for theta_a, weight in zip(slopes.tolist(), (weights / weights.sum()).tolist(), strict=True):
        factors = view_factors(theta_a, strips)
        lit, seen = _met(slope_i, theta_a), _met(slope_r, theta_a)
        scale = weight / (2.0 * np.cos(theta_a) * np.pi * AZIMUTHS)
        # Direct light comes from the part of a facet that is both lit and seen
        total[0] += scale * rho * np.sum(lit[0] * seen[0] * np.minimum(lit[1], seen[1]), axis=(1, 2))
        left, viewed = rho * _on_strips(*lit, strips), scale / strips * _on_strips(*seen, strips)
        for order in range(1, orders - 1):
            left = rho * left[:, ::-1] @ factors.T
            total[order] += np.einsum("vafs,afs->v", viewed, left)
        # All later bounces, by the sum and the difference of both facets: (1 - rho F)^-1 and (1 + rho F)^-1
        left = rho * left[:, ::-1] @ factors.T
        sums, differences = (left[:, 0] + left[:, 1]) / 2.0, (left[:, 0] - left[:, 1]) / 2.0
        even = np.linalg.solve(np.eye(strips) - rho * factors, sums.T).T
        odd = np.linalg.solve(np.eye(strips) + rho * factors, differences.T).T
        total[-1] += np.einsum("vafs,afs->v", viewed, np.stack([even + odd, even - odd], axis=1))
    return total
