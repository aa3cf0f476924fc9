"""Integrals over Gaussian slopes, eq. (26) of Oren and Nayar 1994, as functions of their upper end.

The slope is theta_a = sigma x. All integrands have the weight W = exp(-x^2 / 2) S, with S = sin(theta_a) and
C = cos(theta_a). Along a ray of slopes, the light of facets of which at most one is partly hidden is a sum of such
integrals, with factors that depend on the ray alone: no quadrature is left. Each integral is x^n times a Chebyshev
series in x^2. So its relative error stays small towards x = 0, where grazing light ends.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from brdfdb._elementary import cos, exp, log, sine
from brdfdb._numba import inner_loop, kernel
from brdfdb.gauss import gauss_rule

INTEGRALS = 7
# Of the integrands W times C, S, S C, S^2, S^2 C / (1 + C), S^3 / (1 + C) and S^4 / (C (1 + C))
OF_C, OF_S, OF_SC, OF_SS, OF_OPEN, OF_SLANT, OF_STEEP = range(INTEGRALS)
RAYS = 128  # of slopes that are integrated at once: their recurrences stay in the first cache

_POWERS = (2, 3, 3, 4, 4, 5, 6)  # of x, in front of each series
_TERMS = 34  # of a series, at most: for x up to 6 they leave 1e-12
_FLAT = 0.03  # 1 - C below which `_steepest` is a series: 1e-15 of it is left out
_SMALL = 1e-18  # factor of `_steepest` below which it is left out
_TINY = 1e-300  # guard against 0 / 0 and log(0): the smallest cosine
_GAUSS_LEGENDRE = np.stack(gauss_rule(8).on(0.0, 1.0))  # between two nodes


# The integrals of one deviation of slopes. A tuple of Python: numba stores the types of arguments, and a class of ours
# in them could not be read after a change of its name.
#   sigma [rad], and the largest x
#   the coefficients of Chebyshev's polynomials, (INTEGRALS, terms)
#   the factor of the part of `OF_STEEP` that has no series
#   the integrals of W, W C and W S up to the largest x
Series = tuple[float, float, NDArray[np.float64], float, float, float, float]


@kernel
def sin_cos(x: float) -> tuple[float, float]:
    """Return sine and cosine [1] on [0, pi/2] by series without branches.

    The absolute error is at most 3e-16, and so is the relative error of the sine.
    """
    half = 0.5 * x
    u = half * half
    s = u / 355687428096000.0 - 1.0 / 1307674368000.0
    s = s * u + 1.0 / 6227020800.0
    s = s * u - 1.0 / 39916800.0
    s = s * u + 1.0 / 362880.0
    s = s * u - 1.0 / 5040.0
    s = s * u + 1.0 / 120.0
    s = s * u - 1.0 / 6.0
    c = u / 20922789888000.0 - 1.0 / 87178291200.0
    c = c * u + 1.0 / 479001600.0
    c = c * u - 1.0 / 3628800.0
    c = c * u + 1.0 / 40320.0
    c = c * u - 1.0 / 720.0
    c = c * u + 1.0 / 24.0
    c = c * u - 0.5
    # Of the whole angle
    sine = half + half * u * s
    cos = 1.0 - 2.0 * sine * sine
    return 2.0 * sine * (1.0 + c * u), _TINY if cos < _TINY else cos


@kernel
def _steepest(S: float, C: float) -> float:
    """Return the integral [1] of S^5 / (C (1 + C)) over the slope theta_a from 0 to that with sine S and cosine C.

    It is v^3 / 3 - ln(1 - v) - v - v^2 / 2 with v = 1 - C.
    """
    v = S * S / (1.0 + C)
    # Of -ln(1 - v) - v - v^2 / 2, over v^3
    rest = v / 11.0 + 1.0 / 10.0
    rest = rest * v + 1.0 / 9.0
    rest = rest * v + 1.0 / 8.0
    rest = rest * v + 1.0 / 7.0
    rest = rest * v + 1.0 / 6.0
    rest = rest * v + 1.0 / 5.0
    rest = rest * v + 1.0 / 4.0
    rest = rest * v + 1.0 / 3.0
    cube = v * v * v
    whole = -log(C) - v - 0.5 * v * v
    return cube / 3.0 + (cube * rest if v < _FLAT else whole)


@inner_loop
def series_of(sigma: float, x_max: float) -> Series:
    """Return the integrals of one deviation [rad] of slopes, for x up to `x_max`, at most 6 and pi / (2 sigma)."""
    x_end = 0.5 * math.pi / sigma  # where C is 0
    at_end = exp(-0.5 * x_end * x_end)
    terms = min(14 + 2 * int(0.275 * x_max * x_max), _TERMS)
    coefficients, values = np.empty((INTEGRALS, terms)), np.empty((INTEGRALS, terms))
    cosines = np.empty(4 * terms)
    for k in range(4 * terms):
        cosines[k] = cos(0.5 * math.pi * k / terms)
    last = whole = of_C = of_S = of_SC = of_SS = of_open = of_slant = of_steep = 0.0
    for node in range(terms + 1):
        # (x / x_max)^2 is (1 - cos) / 2 of the angles of the nodes
        end = x_max if node == terms else x_max * sine(0.25 * math.pi * (2 * node + 1) / terms)
        for k in range(_GAUSS_LEGENDRE.shape[1]):
            x, w = last + (end - last) * _GAUSS_LEGENDRE[0, k], (end - last) * _GAUSS_LEGENDRE[1, k]
            S, C = sin_cos(sigma * x)
            E = exp(-0.5 * x * x)
            W = w * E * S
            whole += W
            of_C += W * C
            of_S += W * S
            of_SC += W * S * C
            of_SS += W * S * S
            of_open += W * S * S * C / (1.0 + C)
            of_slant += W * S * S * S / (1.0 + C)
            of_steep += w * (E - at_end) * S * S * S * S * S / (C * (1.0 + C))
        last = end
        if node < terms:
            x2 = end * end
            values[OF_C, node] = of_C / x2
            values[OF_S, node] = of_S / (x2 * end)
            values[OF_SC, node] = of_SC / (x2 * end)
            values[OF_SS, node] = of_SS / (x2 * x2)
            values[OF_OPEN, node] = of_open / (x2 * x2)
            values[OF_SLANT, node] = of_slant / (x2 * x2 * end)
            values[OF_STEEP, node] = of_steep / (x2 * x2 * x2)
    for term in range(terms):
        for integral in range(INTEGRALS):
            coefficients[integral, term] = 0.0
        for node in range(terms):
            weight = (2.0 if term else 1.0) / terms * cosines[term * (2 * (terms - node) - 1) % (4 * terms)]
            for integral in range(INTEGRALS):
                coefficients[integral, term] += weight * values[integral, node]
    return sigma, x_max, coefficients, at_end / sigma, whole, of_C, of_S


@inner_loop
def integrate(
    begin: int,
    end: int,
    x: NDArray[np.float64],
    series: Series,
    work: NDArray[np.float64],
    result: NDArray[np.float64],
) -> None:
    """Write integrals `begin` to `end` - 1, from 0 to each of at most RAYS of `x`, into `result` (INTEGRALS, RAYS).

    `work` (4, RAYS) is overwritten.
    """
    sigma, x_max, coefficients, steep = series[0], series[1], series[2], series[3]
    terms = coefficients.shape[1]
    twice, power, new, old = work[0], work[1], work[2], work[3]
    for j in range(x.size):
        twice[j] = 4.0 / (x_max * x_max) * x[j] * x[j] - 2.0
        power[j] = 1.0
    powers = 0
    for integral in range(begin, end):
        for _ in range(powers, _POWERS[integral]):
            for j in range(x.size):
                power[j] *= x[j]
        powers = _POWERS[integral]
        for j in range(x.size):
            new[j], old[j] = coefficients[integral, terms - 1], 0.0
        for back in range(1, terms // 2):  # Clenshaw's recurrence, two terms at a time
            one, two = coefficients[integral, terms - 2 * back], coefficients[integral, terms - 2 * back - 1]
            for j in range(x.size):
                t = twice[j]
                b = t * new[j] - old[j] + one
                old[j], new[j] = b, t * b - new[j] + two
        constant, into = coefficients[integral, 0], result[integral]
        for j in range(x.size):
            into[j] = power[j] * (0.5 * twice[j] * new[j] - old[j] + constant)
    if begin <= OF_STEEP < end and steep > _SMALL:
        into = result[OF_STEEP]
        for j in range(x.size):
            S, C = sin_cos(sigma * x[j])
            into[j] += steep * _steepest(S, C)
