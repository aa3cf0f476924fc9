"""Kulla and Conty 2017: GGX facets with a lobe that returns the light they lose, by integrals at 60 digits.

Angles are radians; alpha is the width of slopes [1], the same in all directions; f_0 is the reflectance of a facet at
normal incidence. The directional albedo of the facets is subtracted from 1 as the paper says, so it has many digits.
"""

import functools
import itertools
from collections.abc import Callable
from typing import Any

from mpmath.calculus.quadrature import GaussLegendre

from brdfdb.reference import Number, exact, mp
from brdfdb.reference.heitz_2014 import ggx_schlick

_DIGITS = 60  # C^2 - B^2 has lost 34 of them next to the horizon
_RATIO = (
    3  # of the lengths of neighbouring intervals, which become shorter towards a place where the integrand is steep
)


def ggx_compensated(
    theta_i: Number, phi_i: Number, theta_r: Number, phi_r: Number, f_0: Number, alpha: Number
) -> Number:
    """Return f_r [1/sr] of the facets and of the lobe that makes up for their loss.

    Hill 2018 corrected the reflectance of the lobe: light in it has met two facets at least, so that F_avg is squared.
    """
    single = ggx_schlick(theta_i, phi_i, theta_r, phi_r, 0, f_0, alpha, alpha)
    return single + multiple(theta_i, theta_r, f_0, alpha, bounces=2)


def multiple(theta_i: Number, theta_r: Number, f_0: Number, alpha: Number, bounces: int) -> Number:
    """Return the second lobe [1/sr]; `bounces` of 1 gives it with the reflectance that the first slides print."""
    F_avg = (20 * mp.mpf(f_0) + 1) / 21
    E_avg = mean_albedo(alpha)
    F_ms = F_avg**bounces * E_avg / (1 - F_avg * (1 - E_avg))
    E_i, E_r = albedo(theta_i, alpha), albedo(theta_r, alpha)
    return F_ms * (1 - E_i) * (1 - E_r) / (mp.pi * (1 - E_avg))


def albedo(theta: Number, alpha: Number) -> Number:
    """Return the directional albedo E [1] of GGX facets with F = 1, for light or viewer at `theta`."""
    return _albedo(mp.cos(mp.mpf(theta)), mp.mpf(alpha))


@exact
@functools.cache
def mean_albedo(alpha: Number) -> Number:
    """Return the mean E_avg [1] of `albedo` over all directions, weighted by the cosine."""
    with mp.workdps(_DIGITS):
        # The loss of light, 1 - E, changes with cos / alpha
        points = _graded(mp.zero, mp.one, mp.zero, alpha / 256)
        return 1 - 2 * _integral(lambda cos: (1 - _albedo(cos, alpha)) * cos, points, 3)


@functools.cache
def _albedo(cos_i: Any, alpha: Any) -> Any:
    """Return E [1] as an integral of D G / (4 cos_i) over the cosine of the viewer.

    D is alpha^2 / pi (1 + K / (C + B cos(dphi)))^2; over all azimuths its integral is that of
    1 / (C + B cos) and 1 / (C + B cos)^2.
    """
    with mp.workdps(_DIGITS):
        a2, cos2_i = alpha**2, cos_i**2
        root_i = mp.sqrt(cos2_i + a2 * (1 - cos2_i))

        def integrand(cos_r: Any) -> Any:
            cos2_r = cos_r**2
            h_z2 = (cos_i + cos_r) ** 2
            C, B2 = a2 * h_z2 + 2 - cos2_i - cos2_r, 4 * (1 - cos2_i) * (1 - cos2_r)
            K, S2 = (1 - a2) * h_z2, C**2 - B2
            S = mp.sqrt(S2)
            all_azimuths = 1 + 2 * K / S + K**2 * C / (S * S2)
            # G / (2 cos_i cos_r)
            shadowed = cos_i * mp.sqrt(cos2_r + a2 * (1 - cos2_r)) + cos_r * root_i
            return a2 * all_azimuths * cos_r / shadowed

        # Steep at the horizon, by shadowing, and at the peak at cos_i
        peak = min(cos_i, mp.one)
        horizon = _graded(mp.zero, peak / 2, mp.zero, min(cos_i, alpha) / 2)
        width = max(alpha * mp.sqrt(1 - cos2_i), a2)
        return _integral(integrand, horizon + _graded(peak / 2, mp.one, peak, min(width, peak) / 2)[1:], 4)


def _graded(low: Any, high: Any, place: Any, width: Any) -> list[Any]:
    """Return points from low to high, next to each other about the place and further apart away from it."""
    points, distance = {low, place, high}, width
    while distance < high - low:
        points |= {point for point in (place - distance, place + distance) if low < point < high}
        distance *= _RATIO
    return sorted(points)


def _integral(f: Callable[[Any], Any], points: list[Any], degree: int) -> Any:
    """Return the integral of a function by Gauss's rule, of 3 x 2^(degree - 1) nodes between two points."""
    total = mp.zero
    for low, high in itertools.pairwise(points):
        half, middle = (high - low) / 2, (high + low) / 2
        total += half * sum(weight * f(middle + half * x) for x, weight in _nodes(degree))
    return total


@functools.cache
def _nodes(degree: int) -> tuple[tuple[Any, Any], ...]:
    with mp.workdps(_DIGITS):
        return tuple(GaussLegendre(mp).calc_nodes(degree, mp.prec))
