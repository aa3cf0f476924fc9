"""Lobes: the distribution of facet slopes around a mirror direction, for samplers, quadratures and audits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]

_EXPONENT = 700.0  # largest t^2; beyond, the Gaussian counts as 0 and no half vector is drawn
# Plots of a lobe: largest slope in its widths, directions on either side of the mirror direction, last angle [degree]
_OCTAVES = 20.0
_ACROSS = 40
_LAST_DEG = 89.0


@dataclass(frozen=True)
class SlopeDistribution:
    """A distribution of the slopes of half vectors, in widths of the lobe.

    The slopes are s = t (alpha_x cos psi, alpha_y sin psi), with psi uniform in the circle. The distribution is that of
    t alone. Its scale is t = 1: quadratures resolve that scale, and octaves of t beyond it.

    Attributes
    ----------
    name : str
        A word for the distribution.
    radius : callable
        ``radius(u)`` gives the t [1] that a share u of half vectors exceeds, for random numbers u in (0, 1].
    density : callable
        ``density(t2)`` gives the probability density [1] of the square of t at t2 >= 0. Its integral over t2 is 1.
    visible : callable or None
        ``visible(u, angle, w)`` gives normals (..., 3), of any length, of the facets of a surface of width 1 that are
        seen from the unit vectors w (..., 3), for random numbers u in [0, 1] and angles [rad]. Their density is that of
        the facets times their projected area. None: such normals cannot be drawn.
    area : callable or None
        ``area(w_z)`` gives the projected area [1] of these facets, per area of the surface.
    """

    name: str
    radius: Callable[[Array], Array]
    density: Callable[[Array], Array]
    visible: Callable[[Array, Array, Array], Array] | None = None
    area: Callable[[Array], Array] | None = None


def _gaussian_radius(u: Array) -> Array:
    # Ward 1992, eq. (7a), as the tangent of delta
    return np.asarray(np.sqrt(-np.log(u)))


def _gaussian_density(t2: Array) -> Array:
    return np.asarray(np.where(t2 > _EXPONENT, 0.0, np.exp(-t2)))


def _ggx_radius(u: Array) -> Array:
    # Trowbridge and Reitz 1975: as many slopes exceed t as 1 / (1 + t^2)
    return np.asarray(np.sqrt(1.0 / u - 1.0))


def _ggx_density(t2: Array) -> Array:
    return np.asarray((1.0 + t2) ** -2)


def _ggx_visible(u: Array, angle: Array, w: Array) -> Array:
    # Dupuy and Benyoub 2023: mirrors w in the facets of a sphere. All directions above -w_z are equally probable
    w_z = w[..., 2]
    z = (1.0 - u) * (1.0 + w_z) - w_z
    sin = np.sqrt(np.clip(1.0 - z * z, 0.0, 1.0))
    mirrored = np.stack(np.broadcast_arrays(sin * np.cos(angle), sin * np.sin(angle), z), axis=-1)
    return np.asarray(mirrored + w)


def _ggx_area(w_z: Array) -> Array:
    return np.asarray(0.5 * (1.0 + w_z))


GAUSSIAN = SlopeDistribution("Gaussian", _gaussian_radius, _gaussian_density)
GGX = SlopeDistribution("GGX", _ggx_radius, _ggx_density, _ggx_visible, _ggx_area)


class Lobe(NamedTuple):
    """The lobe of a model: a guide for samplers and quadratures, not a part of f_r.

    Attributes
    ----------
    share : array [1]
        Approximate share of the reflected light that lies in the lobe around the mirror direction, in [0, 1]. Samplers
        spread the rest over the whole hemisphere. A model with wider tails than its distribution leaves a tenth or more
        to the rest.
    alpha_x, alpha_y : array [1]
        Widths of the slopes of half vectors along x and y.
    distribution : SlopeDistribution
        Slopes in these widths. A Gaussian has the density exp(-(s_x / alpha_x)^2 - (s_y / alpha_y)^2).
    visible : bool
        True if samplers draw the facets that the direction sees, in proportion to the area that it sees of each. False
        if they draw all facets alike. Quadratures do not read it.
    """

    share: Array
    alpha_x: Array
    alpha_y: Array
    distribution: SlopeDistribution = GAUSSIAN
    visible: bool = False


def narrowest(lobe: Lobe | None) -> Lobe | None:
    """Return a lobe as narrow as that of any wavelength: panels that resolve it resolve the others.

    Wavelengths are the last axis of the arrays of a lobe, where it has any.
    """
    if lobe is None:
        return None
    share, alpha_x, alpha_y = (np.atleast_1d(value) for value in (lobe.share, lobe.alpha_x, lobe.alpha_y))
    return lobe._replace(
        share=np.max(share, axis=-1), alpha_x=np.min(alpha_x, axis=-1), alpha_y=np.min(alpha_y, axis=-1)
    )


def around_mirror(theta_deg: float, lobe: Lobe) -> NDArray[np.float64]:
    """Return angles of viewers [degree] up to 89, which crowd around the mirror direction in proportion to a lobe.

    Light is at `theta_deg`. Angles are positive on the mirror side of the plane of incidence, negative beyond the
    normal. Half vectors have slopes up to 20 widths of the narrower axis of the lobe.
    """
    alpha = float(min(np.min(lobe.alpha_x), np.min(lobe.alpha_y)))
    slopes = alpha * np.sinh(np.linspace(-1.0, 1.0, 2 * _ACROSS + 1) * np.arcsinh(_OCTAVES))
    near = theta_deg + 2.0 * np.degrees(np.arctan(slopes))
    return np.asarray(near[np.abs(near) <= _LAST_DEG])
