"""Reflection of the facets of Oren and Nayar 1994 in a V-cavity (eqs 10-22), and its mean over slopes (eq. 8).

A facet of slope theta_a has, for the light, p = sin(theta_a) tan(theta_i) cos(phi_a - phi_i) and, for the viewer,
q = sin(theta_a) tan(theta_r) cos(phi_a - phi_r). With S = sin(theta_a) and C = cos(theta_a) the scalar products are
<s,a> = cos(theta_i) (C + p) and <v,a> = cos(theta_r) (C + q). The facet on the other side of the cavity has -p and -q.
A facet is partly shadowed where p > C, and partly masked where q > C. All values are radiances divided by
rho E_0 cos(theta_i) / pi, those of the second bounce divided by rho^2 E_0 cos(theta_i) / pi.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from brdfdb._elementary import arcsin, exp, summand_exp
from brdfdb._numba import elementwise, inner_loop, kernel, loop
from brdfdb.gauss import gauss_rule
from brdfdb.models._gaussian_slopes import (
    INTEGRALS,
    OF_C,
    OF_OPEN,
    OF_S,
    OF_SC,
    OF_SLANT,
    OF_SS,
    OF_STEEP,
    RAYS,
    Series,
    integrate,
    series_of,
    sin_cos,
)
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


# Arrays that are overwritten for every value
#   of each ray its two slopes, the smaller first, the two theta_a / sigma where facets begin to be hidden, its weight
#   the integrals up to the first of these, and those up to the second, (INTEGRALS, RAYS)
#   others, (4, RAYS)
Work = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]


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
def _critical(slope: float, sigma: float, x_max: float) -> float:
    """Return theta_a / sigma [1] above which facets are partly hidden, eq. (39) with cot(theta_a) = slope."""
    hypotenuse = 1.0 / math.sqrt(1.0 + slope * slope)
    steep = slope > 1.0
    angle = arcsin(hypotenuse if steep else slope * hypotenuse)
    return min((angle if steep else np.pi / 2 - angle) / sigma, x_max)


@inner_loop
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
            low = t_low * sin_cos(min(from_low, rest + from_high))[0]
            high = max(low, t_high * sin_cos(min(from_high, rest + from_low))[0])
            lows[node], highs[node] = low, high
            first[node], second[node] = _critical(high, sigma, x_max), _critical(low, sigma, x_max)
            weights[node] = w[node] * (reach / panels) * distance * 0.5 * (e_y + 1.0 / e_y)
        count += size
    return count


@inner_loop
def _add_slopes(
    sign: float,
    series: Series,
    nodes: NDArray[np.float64],
    weights: NDArray[np.float64],
    lit: bool,
    bounce: bool,
    count: int,
    work: Work,
) -> tuple[float, float]:
    """Return the weighted direct and twice reflected light [1] of all slopes along the first `count` of the rays.

    The direct light is 0 without `lit`, and the other 0 without `bounce`. A ray holds both facets of every cavity at
    one azimuth. It is cut where one facet begins to be hidden, and again where both are. `sign` is the sign of
    slope_i slope_r: it is positive if the facet that faces the light also faces the viewer.

    In the first piece nothing is hidden. In the second one light or viewer, the one with the larger slope, reaches one
    facet in part and the other not. In the third one, if `sign` is positive, one facet is partly lit and partly seen,
    and the other is dark. These are sums of the integrals of `_gaussian_slopes`. If `sign` is negative, one facet is
    partly lit there, and the other is partly seen: the second bounce has a quadrature, whose nodes crowd as g^2 towards
    the end where R of eq. (19) may be 0. Loops over rays are innermost, so that they vectorise.
    """
    direct = bounced = 0.0
    rays, to_first, to_second, others = work
    sigma, x_max, _, _, _, whole_cos, whole_sin = series
    for start in range(0, count, RAYS):
        size = min(RAYS, count - start)
        low, high = rays[0, start : start + size], rays[1, start : start + size]
        first, second = rays[2, start : start + size], rays[3, start : start + size]
        weight = rays[4, start : start + size]
        integrate(OF_S, INTEGRALS, first, series, others, to_first)
        begin, end = OF_C if sign < 0.0 else OF_SC, OF_STEEP if bounce else OF_SC
        integrate(begin, end, second, series, others, to_second)
        lights, bounces = others[0], others[1]
        for j in range(size):
            lights[j] = bounces[j] = 0.0
        if lit and sign > 0.0:
            for j in range(size):
                of_S = high[j] * (to_first[OF_STEEP, j] + to_first[OF_SS, j]) - to_first[OF_S, j]
                lights[j] = 2.0 * (whole_cos + low[j] * (of_S + whole_sin))
        elif lit:
            for j in range(size):
                of_S = high[j] * (to_first[OF_STEEP, j] + to_first[OF_SS, j]) - to_first[OF_S, j]
                lights[j] = 2.0 * (to_second[OF_C, j] - low[j] * (of_S + to_second[OF_S, j]))
        if bounce:
            for j in range(size):
                p, q = high[j], sign * low[j]
                far = to_second[OF_SC, j] - to_first[OF_SC, j] - q * (to_second[OF_SS, j] - to_first[OF_SS, j])
                near = to_second[OF_OPEN, j] + to_first[OF_OPEN, j]
                near -= q * (to_second[OF_SLANT, j] - to_first[OF_SLANT, j] + 2.0 * p * to_first[OF_STEEP, j])
                bounces[j] = near + far / (p + math.sqrt(p * p + 1.0))
        for j in range(size):
            direct += weight[j] * lights[j]
            bounced += weight[j] * bounces[j]
        if bounce and sign < 0.0:
            hidden = int(np.int64(0))  # as in `_gaussian`
            for j in range(size):
                if second[j] < x_max:
                    low[hidden], high[hidden], second[hidden] = low[j], high[j], second[j]
                    weight[hidden] = 2.0 * weight[j] * (x_max - second[j])
                    hidden += 1
            for j in range(hidden):
                bounces[j] = 0.0
            for node in range(nodes.shape[0]):
                g, w = nodes[node], nodes[node] * weights[node]
                for j in range(hidden):
                    x = second[j] + g * g * (x_max - second[j])
                    S, C = sin_cos(sigma * x)
                    W = summand_exp(-0.5 * x * x) * S
                    bounces[j] += w * W * _bounce_both_hidden(S * high[j], S * low[j], S, C)
            for j in range(hidden):
                bounced += weight[j] * bounces[j]
    return direct, bounced


@inner_loop
def _gaussian(
    t_small: float,
    t_large: float,
    cos_dphi: float,
    sin_dphi: float,
    series: Series,
    x: NDArray[np.float64],
    w: NDArray[np.float64],
    lit: bool,
    bounce: bool,
    work: Work,
) -> tuple[float, float]:
    """Return direct and twice reflected light [1] of eq. (8) with eqs (10) to (20), from the tangents of polar angles.

    `sin_dphi` is not negative. The weight of eq. (26) is not normalised. x and w are the nodes and weights of the
    quadrature.
    """
    if math.isnan(t_small + t_large + cos_dphi + sin_dphi):
        return math.nan, math.nan
    direct = bounced = 0.0
    sigma, x_max, rays = series[0], series[1], work[0]
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
        one, two = _add_slopes(sign, series, x, w, lit, bounce, count, work)
        direct += one
        bounced += two
    return direct, bounced


@loop
def _gaussian_loop(
    features: NDArray[np.float64],
    quadrature: NDArray[np.float64],
    lit: bool,
    bounce: bool,
    direct: NDArray[np.float64],
    bounced: NDArray[np.float64],
) -> None:
    work = np.empty((5, _RAYS)), np.empty((INTEGRALS, RAYS)), np.empty((INTEGRALS, RAYS)), np.empty((4, RAYS))
    series = series_of(1.0, 0.5 * np.pi)
    for j in range(direct.size):
        f = features[:, j]
        sigma = f[4]
        if sigma < _SMOOTH:
            nothing = 0.0 * (f[0] + f[1] + f[2] + f[3])  # 0, or nan if a feature is nan
            direct[j], bounced[j] = 1.0 + nothing, nothing
            continue
        if sigma != series[0]:
            series = series_of(sigma, min(0.5 * np.pi / sigma, _X_MAX))
        one, two = _gaussian(f[0], f[1], f[2], f[3], series, quadrature[0], quadrature[1], lit, bounce, work)
        scale = 0.5 / (np.pi * series[4])
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
        _gaussian_loop(columns, np.stack(gauss_rule(nodes).on(0.0, 1.0)), lit, bounce, direct, bounced)
    return direct, bounced
