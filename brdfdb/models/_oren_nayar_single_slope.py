"""The closed forms of Oren and Nayar 1994, appendix B.2: facets of one slope in all azimuths, and means over slopes.

All values are radiances divided by rho E_0 cos(theta_i) / pi, those of the second bounce divided by
rho^2 E_0 cos(theta_i) / pi.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from brdfdb._elementary import BLOCK, arcsin, sine
from brdfdb._numba import elementwise, kernel, loop
from brdfdb.parameters import Floats

_TINY = 1e-300  # guard against 0 / 0 only


@kernel
def _hidden(cot: float) -> tuple[float, float]:
    """Return pi/2 - phi_c [rad] and cos(phi_c) [1], for cot = 1 / (tan(theta_a) tan(theta))."""
    # Eq. (39)
    cos = min(cot, 1.0)
    sin = math.sqrt((1.0 - cos) * (1.0 + cos))
    small = arcsin(min(cos, sin))
    return (small if cos < sin else np.pi / 2 - small), cos


@kernel
def _arc_less_chord(rest: float) -> float:
    """Return (2 x - sin(2 x)) / pi [1] of A_1 and of eq. (49), for x = pi/2 - phi_c."""
    y = 2.0 * rest
    u = y * y
    series = 1.0 - u / 110.0 * (1.0 - u / 156.0 * (1.0 - u / 210.0))
    small = y * u / 6.0 * (1.0 - u / 20.0 * (1.0 - u / 42.0 * (1.0 - u / 72.0 * series)))
    return (y - sine(y) if y > 1.0 else small) / np.pi


@kernel
def _coefficients(tan_i: float, tan_r: float, S: float, C: float) -> tuple[float, float, float]:
    """Return A_1 tan(beta), A_3 and 1 - Z [1], where Z is the factor of -cos(phi_r - phi_i) in eq. (49).

    In the mirror half plane Z is also A_1 tan(beta) + A_2 of eq. (45), and 1 - Z is the share of the direct light that
    remains. It is computed without the difference, which would cancel near the horizon.
    """
    a, b = S * max(tan_i, tan_r) / C, S * min(tan_i, tan_r) / C  # tan(theta_a) tan(alpha), tan(theta_a) tan(beta)
    rest_a, cos_a = _hidden(1.0 / max(a, _TINY))
    rest_b, cos_b = _hidden(1.0 / max(b, _TINY))
    sin_a, sin_b = math.sqrt((1.0 - cos_a) * (1.0 + cos_a)), math.sqrt((1.0 - cos_b) * (1.0 + cos_b))
    # Eq. (45), A_1 tan(beta)
    both_open = 0.5 * a * b * _arc_less_chord(rest_a)
    A_1 = b * 2.0 * sin_a / np.pi + both_open
    # Eq. (45), A_3, for phi_c^i + phi_c^r > pi/2, so that b > 1. Elsewhere the numbers under the roots are held at 0
    open_b, open_a = max((b - 1.0) * (b + 1.0), 0.0), max((a - 1.0) * (a + 1.0), 0.0)
    roots = math.sqrt(open_b) - (1.0 + b * b) / (math.sqrt(open_a) + math.sqrt(a * a + b * b) + _TINY)
    overlap = rest_a + rest_b - np.pi / 2
    A_3 = max(0.0, (overlap + roots) / np.pi) if rest_a + rest_b < np.pi / 2 else 0.0
    # Eq. (49)
    sines = (cos_b - cos_a) * (cos_b + cos_a) / (sin_a + sin_b + _TINY)  # sin(phi_c^alpha) - sin(phi_c^beta)
    rest_Z = (rest_b - b * sines) * 2.0 / np.pi - both_open
    return A_1, A_3, rest_Z


@kernel
def _direct(cos_dphi: float, one_less_cos: float, C: float, A_1: float, A_3: float, rest_Z: float) -> float:
    """Return direct light [1] by eq. (45), from `_coefficients`; one_less_cos is 1 - abs(cos_dphi)."""
    in_plane = 1.0 + cos_dphi * A_1 if cos_dphi >= 0.0 else one_less_cos - cos_dphi * rest_Z
    return max(0.0, C * (in_plane + one_less_cos * A_3))


@kernel
def _bounce(cos_dphi: float, one_less_cos: float, S: float, C: float, rest_Z: float) -> float:
    """Return the second bounce [1] by eq. (49), from `_coefficients`."""
    bracket = one_less_cos + cos_dphi * rest_Z if cos_dphi >= 0.0 else 1.0 - cos_dphi * (1.0 - rest_Z)
    return max(0.0, C * S * S / (1.0 + C) * bracket)


@kernel
def _direct_of_slope(tan_i: float, tan_r: float, cos_dphi: float, one_less_cos: float, S: float, C: float) -> float:
    A_1, A_3, rest_Z = _coefficients(tan_i, tan_r, S, C)
    return _direct(cos_dphi, one_less_cos, C, A_1, A_3, rest_Z)


@kernel
def _bounce_of_slope(tan_i: float, tan_r: float, cos_dphi: float, one_less_cos: float, S: float, C: float) -> float:
    return _bounce(cos_dphi, one_less_cos, S, C, _coefficients(tan_i, tan_r, S, C)[2])


direct_of_slope, bounce_of_slope = elementwise(_direct_of_slope), elementwise(_bounce_of_slope)


@loop
def _over_slopes(
    features: NDArray[np.float64],
    slopes: NDArray[np.float64],
    lit: bool,
    bounce: bool,
    direct: NDArray[np.float64],
    bounced: NDArray[np.float64],
) -> None:
    """Add weighted values over slopes. `slopes`, of shape (3, S), holds the sine, cosine and weight of each slope.

    The inner loop runs over a block of directions at one slope, so that it vectorises.
    """
    for start in range(0, direct.shape[0], BLOCK):
        stop = min(start + BLOCK, direct.shape[0])
        tan_i, tan_r = features[0, start:stop], features[1, start:stop]
        cos_dphi, one_less_cos = features[2, start:stop], features[3, start:stop]
        one, two = direct[start:stop], bounced[start:stop]
        for j in range(one.shape[0]):
            one[j] = 0.0
            two[j] = 0.0
        for slope in range(slopes.shape[1]):
            S, C, weight = slopes[0, slope], slopes[1, slope], slopes[2, slope]
            lit_weight, bounce_weight = weight if lit else 0.0, weight if bounce else 0.0
            for j in range(one.shape[0]):
                A_1, A_3, rest_Z = _coefficients(tan_i[j], tan_r[j], S, C)
                one[j] += lit_weight * _direct(cos_dphi[j], one_less_cos[j], C, A_1, A_3, rest_Z)
                two[j] += bounce_weight * _bounce(cos_dphi[j], one_less_cos[j], S, C, rest_Z)


def over_slopes(
    tan_i: Floats,
    tan_r: Floats,
    cos_dphi: Floats,
    one_less_cos: Floats,
    theta_a: NDArray[np.float64],
    weight: NDArray[np.float64],
    *,
    lit: bool,
    bounce: bool,
) -> tuple[Floats, Floats]:
    """Return the weighted sums [1] of direct light and of the second bounce over slopes `theta_a` [rad].

    The direct light is 0 without `lit`, and the second bounce 0 without `bounce`. Directions are given by
    tan(theta_i), tan(theta_r), cos(phi_r - phi_i) and 1 - abs(cos(phi_r - phi_i)), each of shape (N,).
    """
    features = np.stack([tan_i, tan_r, cos_dphi, one_less_cos]).astype(np.float64, copy=False)
    direct, bounced = np.empty(features.shape[1]), np.empty(features.shape[1])
    with np.errstate(all="ignore"):  # as in `elementwise`, nan is passed on
        _over_slopes(features, np.stack([np.sin(theta_a), np.cos(theta_a), weight]), lit, bounce, direct, bounced)
    return direct, bounced
