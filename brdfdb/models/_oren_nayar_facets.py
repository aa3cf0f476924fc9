"""Reflection of the facets of Oren and Nayar 1994 in a V-cavity (eqs 10-22), and its mean over slopes (eq. 8).

A facet of slope theta_a has, for the light, p = sin(theta_a) tan(theta_i) cos(phi_a - phi_i) and, for the viewer,
q = sin(theta_a) tan(theta_r) cos(phi_a - phi_r). With S = sin(theta_a) and C = cos(theta_a) the scalar products are
<s,a> = cos(theta_i) (C + p) and <v,a> = cos(theta_r) (C + q). The facet on the other side of the cavity has -p and -q.
A facet is partly shadowed where p > C, and partly masked where q > C. All values are radiances divided by
rho E_0 cos(theta_i) / pi, those of the second bounce divided by rho^2 E_0 cos(theta_i) / pi.
"""

from __future__ import annotations

import functools
import math

import numpy as np
from numpy.typing import NDArray

from brdfdb._elementary import arcsin, exp, summand_exp
from brdfdb._numba import elementwise, kernel, loop
from brdfdb.models.shared_integrals import shared
from brdfdb.parameters import Floats

_TINY = 1e-300  # guard against 0 / 0 only: the numbers that it is added to or compared with are 0 or above 1e-40
_SMALL = 1e-100  # guard as `_TINY`, of a factor of products that must not underflow
_SMOOTH = 1e-30  # deviation of the slope [rad] below which f_r does not change, not even at 90 degrees
_X_MAX = 6.0  # largest theta_a / sigma; the weight exp(-x^2 / 2) x beyond it is 1.5e-8 of the whole

NODES = 16  # largest number of Gauss-Legendre nodes in a piece of a ray of slopes and in a panel of azimuths
_PANEL = 1.6  # width of a panel, in units of arsinh(azimuth / distance to the nearest singularity)
_PANELS = 24  # largest number of panels in a piece of azimuths: enough for tan(theta) = 1.6e16
_RAYS = 4 * _PANELS * NODES


@functools.cache
def _gauss_legendre(nodes: int) -> NDArray[np.float64]:
    """Return nodes and weights [1] of Gauss-Legendre quadrature on [0, 1], an array of shape (2, nodes)."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    return np.stack([(x + 1.0) / 2.0, w / 2.0])


@kernel
def _direct(p: float, q: float, C: float) -> float:
    """Return the direct light [1] of one facet, eqs (10) and (11)."""
    s_a, v_a = C + p, C + q  # <s,a> / cos(theta_i) and <v,a> / cos(theta_r)
    if s_a <= 0.0 or v_a <= 0.0:
        return 0.0
    # Eq. (11), with the smaller of the two
    GAF = min(1.0, 2.0 * C / s_a, 2.0 * C / v_a)
    # Eq. (10)
    return s_a * v_a / C * GAF


# The next three functions are eqs (18) to (20) with the widths of eqs (15) and (16) inserted. p belongs to the light on
# the adjacent facet and q to the viewer on this one. The equations are symmetric in p and q. Multiplied out, with
# R(q) = sqrt(q^2 + S^2) for d(1, m_v), the four terms of eq. (19) have no differences that cancel, up to 90 degrees.


@kernel
def _bounce_open(p: float, q: float, S: float, C: float) -> float:
    """Return the second bounce [1] where nothing is hidden, with IF = pi (1 - cos(theta_a))."""
    return S * S * (C + p) * (C + q) / (C * (1.0 + C))


@kernel
def _bounce_one_hidden(p: float, q: float, S: float, C: float) -> float:
    """Return the second bounce [1] where one facet is partly hidden, p > C >= q."""
    d = p + math.sqrt(p * p + S * S)
    return S * S * (C + q) * (d + (1.0 + C)) / (d * (1.0 + C))


@kernel
def _bounce_both_hidden(p: float, q: float, S: float, C: float) -> float:
    """Return the second bounce [1] where both facets are partly hidden, p >= q > C."""
    R_p, R_q = math.sqrt(p * p + S * S), math.sqrt(q * q + S * S)
    along, across = p * q - C * C, p - q
    # d(m_s, m_v)
    R = math.sqrt(along * along + S * S * across * across)
    # The bracket of eq. (19) is above / below, with one division for all: a division takes as long as ten products
    one, two, three, four = q + R_q, along + R + _SMALL, (C + p) * R_q + R, p + R_p
    above, below = (2.0 * p + C - q) * one * two - C * ((C + p) * two + across * across * one), one * two * three
    return S * S * (C + q) * (above * four + below) / (below * four)


@kernel
def _bounce(p: float, q: float, S: float, C: float) -> float:
    """Return the second bounce [1] of eq. (18), from the adjacent facet with p to the facet with q."""
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
def _critical(slope: float, sigma: float, x_max: float) -> float:
    """Return theta_a / sigma [1] above which facets are partly hidden, eq. (39) with cot(theta_a) = slope."""
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
    """Add the nodes of one half of a piece of azimuths to `rays`, after the first `count`, and return the new count.

    In a piece, the direction with the tangent `t_low` has the smaller slope abs(tan(theta) cos(phi_a - phi)). That
    slope is 0 where the piece begins. Where the piece ends, at the tie, it equals the other slope. The other slope is 0
    at the azimuth `beyond` after the tie, and `rest` is the azimuth from there to half a turn. Nodes crowd as sinh does
    towards one end of the piece, in proportion to the distance of the nearest singularity of the integrand. That is a
    zero of a slope, blurred by 1 / (sigma tan(theta)).
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
    size = x.shape[0]
    for panel in range(panels):
        lows, highs = rays[0, count : count + size], rays[1, count : count + size]
        first, second = rays[2, count : count + size], rays[3, count : count + size]
        weights = rays[4, count : count + size]
        for node in range(size):
            e_y = exp((panel + x[node]) * (reach / panels))
            step = distance * 0.5 * (e_y - 1.0 / e_y)
            from_low = width - step if at_tie else step
            from_high = beyond + step if at_tie else beyond + (width - step)
            low = t_low * _sin_cos(min(from_low, rest + from_high))[0]
            high = max(low, t_high * _sin_cos(min(from_high, rest + from_low))[0])
            lows[node], highs[node] = low, high
            first[node], second[node] = _critical(high, sigma, x_max), _critical(low, sigma, x_max)
            weights[node] = w[node] * (reach / panels) * distance * 0.5 * (e_y + 1.0 / e_y)
        count += size
    return count


@kernel
def _weight(x: float, S: float) -> float:
    """Return the weight [1] of eq. (26) times the sine of eq. (8), for x = theta_a / sigma, not normalised."""
    return summand_exp(-0.5 * x * x) * S


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
    """Return the weighted direct and twice reflected light [1] of all slopes along the first `count` of `rays`.

    The direct light is 0 without `lit`, and the other 0 without `bounce`. A ray holds both facets of every cavity at
    one azimuth. It is cut where one facet begins to be hidden, and again where both are. `sign` is the sign of
    slope_i slope_r: it is positive if the facet that faces the light also faces the viewer. The loop over rays is
    innermost, so that it vectorises.
    """
    low, high, first, second = rays[0], rays[1], rays[2], rays[3]
    direct, bounced = rays[5], rays[6]
    direct[:count] = 0.0
    bounced[:count] = 0.0
    for node in range(nodes.shape[0]):
        g, w = nodes[node], weights[node]
        # First piece: nothing is hidden, and each facet is lit and seen whole
        for j in range(count):
            x = g * first[j]
            S, C = _sin_cos(sigma * x)
            weight = _weight(x, S) * w * first[j]
            p, q = S * high[j], sign * S * low[j]
            weight *= 2.0 / (C * (1.0 + C))
            if lit:
                direct[j] += weight * (C * C + p * q) * (1.0 + C)
            if bounce:
                bounced[j] += weight * (C * C - p * q) * S * S
        # Second piece: light or viewer, the one with the larger slope, reaches one facet in part and the other not
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
            # Third piece, same side: one facet is partly lit and partly seen, and the other is dark
            for j in range(count):
                x = second[j] + g * (x_max - second[j])
                S, C = _sin_cos(sigma * x)
                weight = _weight(x, S) * w * (x_max - second[j])
                direct[j] += weight * 2.0 * (C + S * low[j])
        if sign < 0.0 and bounce:
            # Third piece, opposite sides: one facet is partly lit, and the other is partly seen. Nodes crowd as g^2
            # towards the end where R of eq. (19) may be 0
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
    """Return 1 / c [1] of eq. (26), integrated over the slope alone."""
    total = 0.0
    for panel in range(2):
        for node in range(nodes.shape[0]):
            x = 0.5 * (panel + nodes[node]) * x_max
            total += 0.5 * x_max * weights[node] * _weight(x, _sin_cos(sigma * x)[0])
    return total


@kernel
def _gaussian(
    t_small: float,
    t_large: float,
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
    """Return direct and twice reflected light [1] of eq. (8) with eqs (10) to (20), from the tangents of polar angles.

    `sin_dphi` is not negative. The weight of eq. (26) is not normalised. x and w are the nodes and weights of the
    quadrature.
    """
    if math.isnan(t_small + t_large + cos_dphi + sin_dphi):
        return math.nan, math.nan
    direct = bounced = 0.0
    # Half a turn of azimuths is enough, since a cavity has two facets. It is split into the azimuths where the two
    # slopes have the same sign and those where they have opposite signs. The slopes are t sin(azimuth from one end) and
    # t sin(azimuth from the other end)
    for sign in (1.0, -1.0):
        cos = -sign * cos_dphi
        span, rest = math.atan2(sin_dphi, cos), math.atan2(sin_dphi, -cos)
        # At the tie t_large sin(azimuth) = t_small sin(span - azimuth)
        near = math.atan2(t_small * sin_dphi, t_large + t_small * cos)
        far = span - near
        count = int(np.int64(0))  # a literal 0 has a type of its own, for which numba would compile callees once more
        for at_tie in (False, True):
            if far > 0.0:
                count = _add_azimuths(t_small, t_large, far, near, rest, at_tie, sigma, x_max, x, w, rays, count)
            if near > 0.0:
                count = _add_azimuths(t_large, t_small, near, far, rest, at_tie, sigma, x_max, x, w, rays, count)
        one, two = _add_slopes(sign, sigma, x_max, x, w, lit, bounce, rays, count)
        direct += one
        bounced += two
    return direct, bounced


@loop
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
            nothing = 0.0 * (f[0] + f[1] + f[2] + f[3])  # 0, or nan if a feature is nan
            direct[j], bounced[j] = 1.0 + nothing, nothing
            continue
        one, two = _gaussian(f[0], f[1], f[2], f[3], sigma, x_max, quadrature[0], quadrature[1], lit, bounce, rays)
        direct[j], bounced[j] = scale * one, scale * two


def gaussian(*features: Floats, lit: bool = True, bounce: bool = True, nodes: int = NODES) -> tuple[Floats, Floats]:
    """Return direct and twice reflected light [1] of facets with Gaussian slopes, in the units of this module.

    Parameters
    ----------
    *features : arrays
        tan(theta_i), tan(theta_r), cosine and sine of the difference of azimuths, and sigma [rad]; they broadcast.
    lit, bounce : bool
        True to compute direct light, and light reflected twice.
    nodes : int
        Number of nodes in each piece of a ray of slopes and in each panel of azimuths, in [1, NODES]. NODES is the
        model; fewer nodes make a coarser and faster integral of the same integrand.

    Returns
    -------
    tuple of array [1]
        Direct and twice reflected light, each in the broadcast shape.
    """
    shape = np.broadcast_shapes(*(np.shape(feature) for feature in features))
    columns = np.empty((len(features), int(np.prod(shape))))
    for column, feature in zip(columns, features, strict=True):
        column[:] = np.broadcast_to(feature, shape).ravel()
    # Light and viewer may be exchanged, and the plane of incidence mirrored: such pairs share the integrals
    columns[:2] = np.minimum(columns[0], columns[1]), np.maximum(columns[0], columns[1])
    np.abs(columns[3], out=columns[3])
    # The albedo of a facet is no feature: materials of one sigma share the integrals
    direct, bounced = shared(
        columns, ("gaussian", lit, bounce, nodes), lambda: _integrated(columns, lit, bounce, nodes)
    )
    return direct.reshape(shape), bounced.reshape(shape)


def _integrated(
    columns: NDArray[np.float64], lit: bool, bounce: bool, nodes: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return both parts [1] of values whose features are columns of an array of shape (5, N)."""
    direct, bounced = np.empty(columns.shape[1]), np.empty(columns.shape[1])
    with np.errstate(all="ignore"):  # as in `elementwise`, nan is passed on
        _gaussian_loop(columns, _gauss_legendre(nodes), _gauss_legendre(NODES), lit, bounce, direct, bounced)
    return direct, bounced
