"""What the facets of Oren and Nayar 1994 reflect, one V-cavity at a time (eqs 10-22), and its mean over slopes (eq. 8).

A facet of slope theta_a is met by the light at p = sin(theta_a) tan(theta_i) cos(phi_a - phi_i), by the viewer at q =
sin(theta_a) tan(theta_r) cos(phi_a - phi_r): with S = sin(theta_a) and C = cos(theta_a) that is <s,a> = cos(theta_i)
(C + p) and <v,a> = cos(theta_r) (C + q), and the facet on the other side of the cavity has -p and -q. A facet is partly
shadowed where p > C, partly masked where q > C. All values are radiances over rho E_0 cos(theta_i) / pi, those of the
second bounce over rho^2 E_0 cos(theta_i) / pi.
"""

from __future__ import annotations

import functools
import math

import numpy as np
from numpy.typing import NDArray

from brdfdb._elementary import arcsin, exp
from brdfdb._numba import elementwise, kernel
from brdfdb.parameters import Floats

_TINY = 1e-300  # guards 0 / 0 and nothing else: what it is added to or compared with is 0 or above 1e-40
_SMOOTH = 1e-30  # [rad] smaller deviations of the slope change nothing, at 90 degrees either
_X_MAX = 6.0  # theta_a / sigma: of the weight exp(-x^2 / 2) x, beyond is 1.5e-8

NODES = 16  # of Gauss-Legendre quadrature, for pieces of a ray of slopes and for panels of azimuths; at most
_PANEL = 1.6  # in units of arsinh(azimuth / distance to the nearest singularity)
_PANELS = 24  # of a piece of azimuths: enough for tan(theta) = 1.6e16
_RAYS = 4 * _PANELS * NODES


@functools.cache
def _gauss_legendre(nodes: int) -> NDArray[np.float64]:
    """Return nodes and weights [1] of Gauss-Legendre quadrature on [0, 1], shape (2, nodes)."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    return np.stack([(x + 1.0) / 2.0, w / 2.0])


@kernel
def _direct(p: float, q: float, C: float) -> float:
    """Return eqs (10) and (11): one facet by direct light."""
    s_a, v_a = C + p, C + q  # over cos(theta_i), cos(theta_r)
    if s_a <= 0.0 or v_a <= 0.0:
        return 0.0
    # Eq. (11), with the smaller of the two
    GAF = min(1.0, 2.0 * C / s_a, 2.0 * C / v_a)
    # Eq. (10)
    return s_a * v_a / C * GAF


# Eqs (18) to (20) with the widths of eqs (15) and (16) inserted, for the light on the adjacent facet, p for it, and
# the viewer on this one, q: they are symmetric in p and q. Multiplied out, with R(q) = sqrt(q^2 + S^2) for d(1, m_v),
# the four terms of eq. (19) are free of differences that cancel, up to 90 degrees.


@kernel
def _bounce_open(p: float, q: float, S: float, C: float) -> float:
    """Return the second bounce where nothing is hidden: IF = pi (1 - cos(theta_a))."""
    return S * S * (C + p) * (C + q) / (C * (1.0 + C))


@kernel
def _bounce_one_hidden(p: float, q: float, S: float, C: float) -> float:
    """Return the second bounce where one facet is partly hidden, p > C >= q."""
    return S * S * (C + q) * (1.0 / (p + math.sqrt(p * p + S * S)) + 1.0 / (1.0 + C))


@kernel
def _bounce_both_hidden(p: float, q: float, S: float, C: float) -> float:
    """Return the second bounce where both facets are partly hidden, p >= q > C."""
    R_p, R_q = math.sqrt(p * p + S * S), math.sqrt(q * q + S * S)
    along, across = p * q - C * C, p - q
    # d(m_s, m_v)
    R = math.sqrt(along * along + S * S * across * across)
    bracket = 2.0 * p + C - q - C * (C + p) / (q + R_q) - C * across * across / (along + R + _TINY)
    return S * S * (C + q) * (bracket / ((C + p) * R_q + R) + 1.0 / (p + R_p))


@kernel
def _bounce(p: float, q: float, S: float, C: float) -> float:
    """Return eq. (18): light that met the adjacent facet at p, from the facet that meets the viewer at q."""
    low, high = min(p, q), max(p, q)
    if low <= -C:
        return 0.0
    if high <= C:
        return _bounce_open(high, low, S, C)
    if low <= C:
        return _bounce_one_hidden(high, low, S, C)
    return _bounce_both_hidden(high, low, S, C)


@kernel
def _direct_of_cavity(slope_i: float, slope_r: float, S: float, C: float) -> float:
    p, q = S * slope_i, S * slope_r
    # Eq. (22)
    return 0.5 * (_direct(p, q, C) + _direct(-p, -q, C))


@kernel
def _bounce_of_cavity(slope_i: float, slope_r: float, S: float, C: float) -> float:
    p, q = S * slope_i, S * slope_r
    # Eq. (22)
    return 0.5 * (_bounce(-p, q, S, C) + _bounce(p, -q, S, C))


direct_of_cavity = elementwise(_direct_of_cavity)
bounce_of_cavity = elementwise(_bounce_of_cavity)


@kernel
def _sin_cos(x: float) -> tuple[float, float]:
    """Return sine and cosine on [0, pi/2], within 3e-16 absolute, the sine also relative: series, no branches."""
    u = x * x
    s = u / 51090942171709440000.0 - 1.0 / 121645100408832000.0
    s = s * u + 1.0 / 355687428096000.0
    s = s * u - 1.0 / 1307674368000.0
    s = s * u + 1.0 / 6227020800.0
    s = s * u - 1.0 / 39916800.0
    s = s * u + 1.0 / 362880.0
    s = s * u - 1.0 / 5040.0
    s = s * u + 1.0 / 120.0
    s = s * u - 1.0 / 6.0
    c = 1.0 / 2432902008176640000.0 - u / 1124000727777607680000.0
    c = c * u - 1.0 / 6402373705728000.0
    c = c * u + 1.0 / 20922789888000.0
    c = c * u - 1.0 / 87178291200.0
    c = c * u + 1.0 / 479001600.0
    c = c * u - 1.0 / 3628800.0
    c = c * u + 1.0 / 40320.0
    c = c * u - 1.0 / 720.0
    c = c * u + 1.0 / 24.0
    c = c * u - 0.5
    cos = c * u + 1.0
    return x + x * u * s, _TINY if cos < _TINY else cos


@kernel
def _critical(slope: float, sigma: float, x_max: float) -> float:
    """Return the slope over sigma from which facets are partly hidden, eq. (39): cot(theta_a) = slope."""
    hypotenuse = 1.0 / math.sqrt(1.0 + slope * slope)
    steep = slope > 1.0
    angle = arcsin(hypotenuse if steep else slope * hypotenuse)
    return min((angle if steep else np.pi / 2 - angle) / sigma, x_max)


@kernel
def _add_azimuths(
    t_low: float,
    t_high: float,
    width: float,
    beyond: float,
    rest: float,
    at_tie: bool,
    sigma: float,
    x_max: float,
    x: NDArray[np.float64],
    w: NDArray[np.float64],
    rays: NDArray[np.float64],
    count: int,
) -> int:
    """Add the nodes of one half of a piece of azimuths to `rays`, after the first `count`; return the new count.

    Across a piece, the direction of tangent `t_low` has the smaller slope abs(tan(theta) cos(phi_a - phi)): 0 where the
    piece begins, as large as the other one where it ends, at the tie. `beyond` the tie the other slope is 0 in turn,
    and `rest` is what is left from there to half a turn. Nodes crowd, as sinh does, towards the end that is looked at,
    as closely as the nearest singularity of the integrand lies: a zero of a slope, blurred by 1 / (sigma tan(theta)).
    """
    low_zero, high_zero = (width, beyond) if at_tie else (0.0, width + beyond)
    blur = 1.0 / min(sigma, 1.0)
    distance = min(
        math.hypot(min(low_zero, rest + high_zero), blur / max(t_low, _TINY)),
        math.hypot(min(high_zero, rest + low_zero), blur / max(t_high, _TINY)),
        width,
    )
    reach = math.asinh(0.5 * width / distance)
    panels = min(1 + int(reach / _PANEL), _PANELS)
    for panel in range(panels):
        for node in range(x.shape[0]):
            e_y = exp((panel + x[node]) * (reach / panels))
            step = distance * 0.5 * (e_y - 1.0 / e_y)
            from_low = width - step if at_tie else step
            from_high = beyond + step if at_tie else beyond + (width - step)
            low = t_low * _sin_cos(min(from_low, rest + from_high))[0]
            high = max(low, t_high * _sin_cos(min(from_high, rest + from_low))[0])
            rays[0, count], rays[1, count] = low, high
            rays[2, count], rays[3, count] = _critical(high, sigma, x_max), _critical(low, sigma, x_max)
            rays[4, count] = w[node] * (reach / panels) * distance * 0.5 * (e_y + 1.0 / e_y)
            count += 1
    return count


@kernel
def _weight(x: float, S: float) -> float:
    """Return eq. (26) with the sine of eq. (8), for x = theta_a / sigma; not normalised."""
    return exp(-0.5 * x * x) * S


@kernel
def _add_slopes(
    sign: float,
    sigma: float,
    x_max: float,
    nodes: NDArray[np.float64],
    weights: NDArray[np.float64],
    lit: bool,
    bounce: bool,
    rays: NDArray[np.float64],
    count: int,
) -> tuple[float, float]:
    """Return light of all slopes along the first `count` of `rays`, weighted: direct if `lit`, reflected twice if
    `bounce`; 0 of what is not asked for.

    A ray holds both facets of every cavity at one azimuth, and is cut where one of them, then both begin to be hidden.
    `sign` is that of slope_i slope_r: whether the facet that faces the light faces the viewer, too. All rays take a
    step together, so that the loops vectorise.
    """
    low, high, first, second = rays[0], rays[1], rays[2], rays[3]
    direct, bounced = rays[5], rays[6]
    direct[:count] = 0.0
    bounced[:count] = 0.0
    for node in range(nodes.shape[0]):
        g, w = nodes[node], weights[node]
        # nothing hidden: both facets are lit and seen whole, or face away
        for j in range(count):
            x = g * first[j]
            S, C = _sin_cos(sigma * x)
            weight = _weight(x, S) * w * first[j]
            p, q = S * high[j], sign * S * low[j]
            if lit:
                direct[j] += weight * 2.0 * (C + p * q / C)
            if bounce:
                bounced[j] += weight * (_bounce_open(-p, q, S, C) + _bounce_open(p, -q, S, C))
        # one hidden: of the two facets one is half lit and the other half seen, or one both
        for j in range(count):
            x = first[j] + g * (second[j] - first[j])
            S, C = _sin_cos(sigma * x)
            weight = _weight(x, S) * w * (second[j] - first[j])
            p, q = S * high[j], sign * S * low[j]
            if lit:
                direct[j] += weight * 2.0 * (C + q)
            if bounce:
                bounced[j] += weight * _bounce_one_hidden(p, -q, S, C)
        if sign > 0.0 and lit:
            # one facet half lit and half seen, the other in the dark
            for j in range(count):
                x = second[j] + g * (x_max - second[j])
                S, C = _sin_cos(sigma * x)
                weight = _weight(x, S) * w * (x_max - second[j])
                direct[j] += weight * 2.0 * (C + S * low[j])
        if sign < 0.0 and bounce:
            # one facet half lit, the other half seen; nodes crowd as g^2 to the end where R of eq. (19) may be 0
            for j in range(count):
                x = second[j] + g * g * (x_max - second[j])
                S, C = _sin_cos(sigma * x)
                weight = _weight(x, S) * 2.0 * g * w * (x_max - second[j])
                bounced[j] += weight * _bounce_both_hidden(S * high[j], S * low[j], S, C)
    direct_sum = bounced_sum = 0.0
    for j in range(count):
        direct_sum += rays[4, j] * direct[j]
        bounced_sum += rays[4, j] * bounced[j]
    return direct_sum, bounced_sum


@kernel
def _normalisation(sigma: float, x_max: float, nodes: NDArray[np.float64], weights: NDArray[np.float64]) -> float:
    """Return 1 / c of eq. (26), over slope alone."""
    total = 0.0
    for panel in range(2):
        for node in range(nodes.shape[0]):
            x = 0.5 * (panel + nodes[node]) * x_max
            total += 0.5 * x_max * weights[node] * _weight(x, _sin_cos(sigma * x)[0])
    return total


@kernel
def _gaussian(
    t_i: float,
    t_r: float,
    cos_dphi: float,
    sin_dphi: float,
    sigma: float,
    x_max: float,
    x: NDArray[np.float64],
    w: NDArray[np.float64],
    lit: bool,
    bounce: bool,
    rays: NDArray[np.float64],
) -> tuple[float, float]:
    """Return eq. (8) with eqs (10) to (20) for the tangents of the polar angles: direct and twice reflected light.

    The weight of eq. (26) is not normalised. x and w are the nodes and weights of the quadrature.
    """
    if math.isnan(t_i + t_r + cos_dphi + sin_dphi):
        return math.nan, math.nan
    t_small, t_large, sin_dphi = min(t_i, t_r), max(t_i, t_r), abs(sin_dphi)
    direct = bounced = 0.0
    # half a turn of azimuths, which a cavity's other facet completes: where the two slopes have the same sign, and the
    # opposite one; in each the slopes are t sin(azimuth from one end) and t sin(azimuth from the other)
    for sign in (1.0, -1.0):
        cos = -sign * cos_dphi
        span, rest = math.atan2(sin_dphi, cos), math.atan2(sin_dphi, -cos)
        # the tie: t_large sin(azimuth) = t_small sin(span - azimuth)
        near = math.atan2(t_small * sin_dphi, t_large + t_small * cos)
        far = span - near
        count = int(np.int64(0))  # of the literal 0 all that takes it would be compiled once more
        for at_tie in (False, True):
            if far > 0.0:
                count = _add_azimuths(t_small, t_large, far, near, rest, at_tie, sigma, x_max, x, w, rays, count)
            if near > 0.0:
                count = _add_azimuths(t_large, t_small, near, far, rest, at_tie, sigma, x_max, x, w, rays, count)
        one, two = _add_slopes(sign, sigma, x_max, x, w, lit, bounce, rays, count)
        direct += one
        bounced += two
    return direct, bounced


@kernel
def _gaussian_loop(
    features: NDArray[np.float64],
    quadrature: NDArray[np.float64],
    finest: NDArray[np.float64],
    lit: bool,
    bounce: bool,
    direct: NDArray[np.float64],
    bounced: NDArray[np.float64],
) -> None:
    rays = np.empty((7, _RAYS))
    last = x_max = scale = math.nan
    for j in range(direct.size):
        f = features[:, j]
        sigma = f[4]
        if sigma != last:
            x_max = min(0.5 * np.pi / sigma, _X_MAX)
            scale = 0.5 / (np.pi * _normalisation(sigma, x_max, finest[0], finest[1]))
            last = sigma
        if sigma < _SMOOTH:
            nothing = 0.0 * (f[0] + f[1] + f[2] + f[3])  # nan goes through
            direct[j], bounced[j] = 1.0 + nothing, nothing
            continue
        one, two = _gaussian(f[0], f[1], f[2], f[3], sigma, x_max, quadrature[0], quadrature[1], lit, bounce, rays)
        direct[j], bounced[j] = scale * one, scale * two


def gaussian(*features: Floats, lit: bool = True, bounce: bool = True, nodes: int = NODES) -> tuple[Floats, Floats]:
    """Return direct and twice reflected light [1] of facets with Gaussian slopes, as radiances over those of the head.

    Parameters
    ----------
    *features : arrays
        tan(theta_i), tan(theta_r), cosine and sine of the difference of azimuths, and sigma [rad]; they broadcast.
    lit, bounce : bool
        Whether direct light, and light reflected twice, is computed.
    nodes : int
        Of the quadrature in each piece of a ray of slopes and each panel of azimuths, in [1, NODES]. NODES is the
        model; fewer make a coarser and faster integral of the same integrand.
    """
    shape = np.broadcast_shapes(*(np.shape(feature) for feature in features))
    columns = np.empty((len(features), int(np.prod(shape))))
    for column, feature in zip(columns, features, strict=True):
        column[:] = np.broadcast_to(feature, shape).ravel()
    direct, bounced = np.empty(columns.shape[1]), np.empty(columns.shape[1])
    with np.errstate(all="ignore"):  # as `elementwise`: nan goes through
        _gaussian_loop(columns, _gauss_legendre(nodes), _gauss_legendre(NODES), lit, bounce, direct, bounced)
    return direct.reshape(shape), bounced.reshape(shape)
