"""Turquin 2019: GGX facets, scaled by the light that they lose to one another towards the viewer."""

from __future__ import annotations

from numpy.typing import ArrayLike

from brdfdb.geometry import checked_angles, checked_vectors, finished
from brdfdb.models import _microfacets
from brdfdb.models._ggx_albedo import lost_share
from brdfdb.models._microfacets import CORRELATED, F_0, SCHLICK, by_checked_angles, by_vectors, painted
from brdfdb.models.large_calls import for_large_calls_of_one
from brdfdb.parameters import Floats, Parameter

ALPHA = Parameter("alpha", "α", "1", 1e-6, 1.0, "width of the facets' slopes")

_GGX = (_microfacets.GGX, CORRELATED, SCHLICK)


@for_large_calls_of_one("alpha")
def ggx_scaled(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, f_0: ArrayLike, alpha: ArrayLike
) -> Floats:
    """Return the function [1/sr] of Turquin 2019: GGX facets, brighter by what they lose towards the viewer.

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi].
    f_0 : array_like [1]
        Reflectance of a facet at normal incidence, in [0, 1].
    alpha : array_like [1]
        Width of the slopes in all directions, in [1e-6, 1].

    Returns
    -------
    array [1/sr]
        In the broadcast shape of all arguments; 0 below the horizon, nan where an angle is nan.

    Raises
    ------
    ParameterError
        If an argument is outside its range.

    Notes
    -----
    `ggx_schlick` without a uniform part, times 1 + f_0 (1 - E) / E, with the albedo E of the facets towards the viewer
    at F = 1. It is not reciprocal, so it is no model of the registry: tables use reciprocity as a symmetry. With
    f_0 = 1 the integral over lights is 1 for every viewer, as a renderer needs that knows the viewer first. The
    integral over viewers, which is the albedo for a light, is not 1. `ggx_compensated` is the reciprocal form.

    References
    ----------
    turquin2019, heitz2014, schlick1994

    Examples
    --------
    >>> import numpy as np
    >>> towards = ggx_scaled([0.3, 1.4], 0.0, [1.4, 0.3], np.pi, f_0=0.9, alpha=0.5)
    >>> [round(float(f_r), 4) for f_r in towards]
    [0.3175, 0.3692]
    """
    checked = checked_angles(theta_i, phi_i, theta_r, phi_r)
    f_0, alpha = F_0.check(f_0), ALPHA.check(alpha)
    single = by_checked_angles(_GGX, checked, painted(0.0, f_0, alpha, alpha))
    return finished(single * _scale(checked.cos_r, f_0, alpha), checked)


@for_large_calls_of_one("alpha")
def ggx_scaled_vectors(wi: ArrayLike, wr: ArrayLike, *, f_0: ArrayLike, alpha: ArrayLike) -> Floats:
    """Return `ggx_scaled` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
    checked = checked_vectors(wi, wr)
    f_0, alpha = F_0.check(f_0), ALPHA.check(alpha)
    return finished(
        by_vectors(_GGX, wi, wr, painted(0.0, f_0, alpha, alpha)) * _scale(checked.cos_r, f_0, alpha), checked
    )


def _scale(cos_r: Floats, f_0: Floats, alpha: Floats) -> Floats:
    lost = lost_share(cos_r, alpha)
    return 1.0 + f_0 * lost / (1.0 - lost)
