"""The sum over m of He et al. 1991, eq. 78, in logarithms. It is stable and of bounded cost for every g and V."""

from __future__ import annotations

import functools
import math

import numpy as np
from numpy.typing import NDArray

from brdfdb._elementary import BLOCK, exp, log, summand_exp
from brdfdb._numba import inner_loop, kernel, loop
from brdfdb.parameters import Floats

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

ROWS_OF_WORK, GROUPS = 15, 5  # rows of the two work arrays of `log_series`, of BLOCK numbers each

# Position of the peak that separates two methods: below, the sum is taken term by term, above, by the trapezoid rule
_SUM_BELOW = 40.0
_TERMS = 96  # largest number of terms, m* + 7.2 sqrt(m*) + 7
_LOG_FACTORIAL_TIMES_M = np.array([0.0] + [math.lgamma(m + 1.0) + math.log(m) for m in range(1, _TERMS)])
CONSTANTS_BYTES = _LOG_FACTORIAL_TIMES_M.nbytes  # size of the constants that `log_series` reads
# Range of g and V. Beyond it the sum equals its limit: the first term, the sum at V = 0, or 0
_G_MIN, _V_MIN, _V_MAX = 1e-290, 1e-300, 1e30
# The trapezoid rule in ln(m). Its nodes are _STEP standard deviations of the summand apart, less where the summand is
# skew, as it is for small m*. They reach _REACH deviations to both sides of the peak, and further into the left tail
_STEP, _STEP_SKEW, _REACH, _LEFT_SKEW = 0.8, 2.0, 7.2, 52.0
_TAYLOR_ABOVE = 1e6  # m* above which the nodes lie so close together that a short series is exact
_SQRT_TWO_PI = 2.5066282746310002


@kernel
def roughly_lambert_w(y: float, log_y: float) -> float:
    """Return W_0(y) [1], the root of w e^w = y, to about a percent, for y > 1e-4 (Iacono and Boyd)."""
    log_1p_y = log_y if log_y > 40.0 else log(1.0 + (0.0 if log_y > 40.0 else y))  # y may be inf where log_y is finite
    return log_1p_y * (1.0 - log(1.0 + log_1p_y) / (2.0 + log_1p_y))


@kernel
def nearer_lambert_w(w: float, log_y: float) -> float:
    """Return W_0(y) [1] after a step of fourth order (Fritsch, Shafer, Crowley).

    The error is 3e-9 after one step, and rounding after two.
    """
    z = log_y - log(w) - w
    v = 1.0 + w
    q = 2.0 * v * (v + z * (2.0 / 3.0))
    return w * (1.0 + z * (q - z) / (v * (q - 2.0 * z)))


@kernel
def _peak(g: float, log_g: float, V: float) -> float:
    """Return u = W_0(2 V / g^2) [1]. The summand peaks at m* = g e^(u / 2), where ln(g / m) + V / m^2 = 0."""
    y = 2.0 * V / g / g
    log_y = log(2.0 * V) - 2.0 * log_g
    log_y = -9.0 if log_y < -9.0 else log_y
    u = nearer_lambert_w(roughly_lambert_w(y, log_y), log_y)
    return y * (1.0 - y * (1.0 - 1.5 * y)) if y < 1e-3 else u


@kernel
def _exponent_at_peak(u: float) -> float:
    """Return e^(u / 2) (1 - u) - 1 [1] with all its digits."""
    # The Taylor series has the coefficients 2^-k / k! - 2^(1 - k) / (k - 1)!
    p = -4.900831249030034e-13
    p = p * u - 1.172278834767984e-11
    p = p * u - 2.5688197074915823e-10
    p = p * u - 5.113174465388007e-09
    p = p * u - 9.149891148589066e-08
    p = p * u - 1.4532180059523809e-06
    p = p * u - 2.0151289682539682e-05
    p = p * u - 0.00023871527777777777
    p = p * u - 0.00234375
    p = p * u - 0.018229166666666664
    p = p * u - 0.10416666666666667
    p = p * u - 0.375
    p = p * u - 0.5
    return p * u if u < 0.25 else exp(0.5 * u) * (1.0 - u) - 1.0


@inner_loop
def log_series(
    slopes: bool,
    g: Array,
    V: Array,
    reach: float,
    log_sum: Array,
    by_g: Array,
    by_V: Array,
    work: Array,
    index: Indices,
) -> None:
    """Fill log_sum with the logarithm of `diffraction_series` for at most BLOCK values of g and V.

    `slopes` is a constant of each caller, so that LLVM drops the rest. With it, by_g and by_V are filled with the
    derivatives by ln(g), increased by 1, and by ln(V): means over the terms, <m> - g, and -V <1/m>. Without it they
    are not used. reach, in (0, 1], is the share of the distance from the peak up to which terms are summed; 1 is the
    model. The steps of the trapezoid rule grow as 1 / reach, so that its number of nodes falls as the square of reach.
    work, of shape (ROWS_OF_WORK, BLOCK), and index, of shape (GROUPS, BLOCK), are overwritten.
    """
    count = log_sum.shape[0]
    log_g, u, m_star = work[0], work[1], work[2]
    for i in range(count):
        g_i = max(g[i], _G_MIN)
        log_g[i] = log(g_i)
        u[i] = _peak(g_i, log_g[i], min(max(V[i], _V_MIN), _V_MAX))
        m_star[i] = g_i * exp(0.5 * u[i])
    # Similar values form a group, because all values of a group take as many terms as the one that needs most
    numbers = np.zeros(GROUPS, np.int64)
    for i in range(count):
        m = m_star[i]  # nan goes to the trapezoid rule
        group = 0 if m < 6.0 else 1 if m < 16.0 else 2 if m < _SUM_BELOW else 4 if m > _TAYLOR_ABOVE else 3
        index[group, numbers[group]] = i
        numbers[group] += 1
    rest = work[3:]
    for group in range(GROUPS):
        members = index[group, : numbers[group]]
        if members.shape[0] == 0:
            continue
        if group < 3:
            _term_by_term(slopes, g, V, log_g, u, m_star, members, reach, log_sum, by_g, by_V, rest)
        else:
            _trapezoid(slopes, g, V, log_g, u, m_star, members, group == 4, reach, log_sum, by_g, by_V, rest)


@kernel
def _term_by_term(
    slopes: bool,
    all_g: Array,
    all_V: Array,
    all_log_g: Array,
    u: Array,
    m_star: Array,
    index: Indices,
    reach: float,
    log_sum: Array,
    by_g: Array,
    by_V: Array,
    work: Array,
) -> None:
    V, log_g, shift, total, sum_m, sum_inverse = work[0], work[1], work[2], work[3], work[4], work[5]
    count = index.shape[0]
    lowest, highest = float(_TERMS), 1.0
    for i in range(count):
        at = index[i]
        m = m_star[at]
        deviation = reach * math.sqrt(m / (1.0 + u[at]))
        lowest, highest = min(lowest, m - 7.0 * deviation), max(highest, m + 7.2 * deviation + 7.0 * reach)
        V[i], log_g[i] = min(all_V[at], _V_MAX), all_log_g[at]
        # The largest term, roughly, is taken out of the exponentials, so that they neither overflow nor underflow
        near = max(1.0, np.floor(m + 0.5))
        shift[i] = (near - 1.0) * log_g[i] - _LOG_FACTORIAL_TIMES_M[int(near)] - V[i] / near
        total[i], sum_m[i], sum_inverse[i] = 0.0, 0.0, 0.0
    for m in range(max(1, int(lowest)), min(int(highest) + 1, _TERMS)):
        constant, inverse, power = _LOG_FACTORIAL_TIMES_M[m], 1.0 / m, m - 1.0
        for i in range(count):
            term = summand_exp(power * log_g[i] - constant - V[i] * inverse - shift[i])
            total[i] += term
            if slopes:
                sum_m[i] += power * term
                sum_inverse[i] += inverse * term
    for i in range(count):
        at = index[i]
        log_sum[at] = log(total[i]) + shift[i] - all_g[at]
        if slopes:
            by_g[at] = 1.0 + (sum_m[i] / total[i] - all_g[at])
            by_V[at] = -V[i] * sum_inverse[i] / total[i]


@kernel
def _add_node(slopes: bool, close: bool, distance: float, count: int, work: Array) -> None:
    """Add a node of the trapezoid rule to the sums in work, whose rows `_trapezoid` names."""
    m_star, a, b, step, m_inverse = work[0], work[1], work[2], work[3], work[4]
    d, inverse, total, sum_bend, sum_inverse = work[7], work[8], work[9], work[10], work[11]
    if close:
        for i in range(count):
            t = distance * step[i]
            bend = -0.5 * t * t * (1 + t * (2 / 3 + t * (1 / 4 + t * (1 / 15 + t * (1 / 72)))))
            term = summand_exp(m_star[i] * bend - d[i] * inverse[i] * (a[i] * d[i] - b[i]) - 0.5 * t)
            total[i] += term
            if slopes:
                sum_inverse[i] += term * inverse[i]
                sum_bend[i] += term * (m_star[i] * bend + a[i] * d[i] * d[i] * inverse[i])
    else:
        for i in range(count):
            t = distance * step[i]
            bend = (d[i] - t) - t * d[i]
            m_i = inverse[i] * m_inverse[i]
            m_i2 = m_i * m_i
            stirling_error = m_i * (1 / 12 - m_i2 * (1 / 360 - m_i2 * (1 / 1260)))
            exponent = m_star[i] * bend - d[i] * inverse[i] * (a[i] * d[i] - b[i])
            term = summand_exp(exponent - 0.5 * t - stirling_error)
            total[i] += term
            if slopes:
                stirling_slope = m_i * (1 / 12 - m_i2 * (1 / 120 - m_i2 * (1 / 252)))
                sum_inverse[i] += term * inverse[i]
                sum_bend[i] += term * (m_star[i] * bend + a[i] * d[i] * d[i] * inverse[i] + stirling_slope)


@kernel
def _trapezoid(
    slopes: bool,
    all_g: Array,
    all_V: Array,
    all_log_g: Array,
    all_u: Array,
    all_m_star: Array,
    index: Indices,
    close: bool,
    reach: float,
    log_sum: Array,
    by_g: Array,
    by_V: Array,
    work: Array,
) -> None:
    """Sum by the trapezoid rule in t, where m = m* e^t.

    By Stirling's formula the summand is m^(-3/2) exp(m* phi(t) - stirling_error(m)) with
    phi(t) = e^t (1 - t) - 1 - u / 2 (e^t + e^-t - 2) - miss (e^-t - 1), where miss = V / m*^2 - u / 2 is the error of
    `_peak`. Nodes are equally far apart in t, so that e^t needs no exponential. d = e^t - 1 keeps its digits next to
    the peak.
    """
    m_star, a, b, step, m_inverse = work[0], work[1], work[2], work[3], work[4]
    ratio, ratio_inverse, d, inverse, total = work[5], work[6], work[7], work[8], work[9]
    sum_bend, sum_inverse = work[10], work[11]
    count = index.shape[0]
    right, left = 0.0, 0.0
    for i in range(count):
        at = index[i]
        m_star[i] = all_m_star[at]
        m_inverse[i] = 1.0 / m_star[i]
        a[i] = 0.5 * m_star[i] * all_u[at]
        b[i] = min(all_V[at], _V_MAX) * m_inverse[i] - a[i]  # m* times miss
        deviations = math.sqrt(m_star[i] * (1.0 + all_u[at]))  # 1 / deviation in t
        h = _STEP / reach - _STEP_SKEW / deviations
        step[i] = h / deviations
        right = max(right, reach * _REACH / h)
        left = max(left, reach * (_REACH + reach * _LEFT_SKEW / deviations) / h)
        total[i], sum_bend[i], sum_inverse[i] = 0.0, 0.0, 0.0
    for side in range(2):
        sign = 1.0 if side == 0 else -1.0
        nodes = int(right if side == 0 else left) + 2
        for i in range(count):
            t = sign * step[i]
            # e^t - 1 by its Taylor series, for abs(t) < 0.12
            p = t * (1 / 720 + t * (1 / 5040 + t * (1 / 40320)))
            ratio[i] = t * (1 + t * (1 / 2 + t * (1 / 6 + t * (1 / 24 + t * (1 / 120 + p)))))
            ratio_inverse[i] = 1.0 / (1.0 + ratio[i])
            d[i] = 0.0
            inverse[i] = 1.0
        for j in range(side, nodes):
            if j > 0:
                for i in range(count):
                    d[i] += ratio[i] * (1.0 + d[i])
                for i in range(count):
                    inverse[i] *= ratio_inverse[i]
            _add_node(slopes, close, sign * j, count, work)
    for i in range(count):
        at = index[i]
        # The exponent at the peak, m* (1 - u / 2 - V / m*^2) - g, without its cancellation
        peak = all_g[at] * _exponent_at_peak(all_u[at]) - b[i]
        if close:
            peak -= m_inverse[i] / 12
        log_sum[at] = peak + log(total[i] * step[i] / (_SQRT_TWO_PI * math.sqrt(m_star[i]))) - all_log_g[at]
        if slopes:
            # The mean of the derivative of the exponent by t is 0. It gives <m - m*> = m* <d> from means that do not
            # cancel, as those of m and m* would
            mean_inverse = sum_inverse[i] / total[i]
            beyond_peak = (sum_bend[i] / total[i] + b[i] * mean_inverse - 0.5) / (1.0 + all_u[at])
            by_g[at] = beyond_peak + all_g[at] * math.expm1(0.5 * all_u[at])
            by_V[at] = -(a[i] + b[i]) * mean_inverse


@loop
def _series(g: Array, V: Array, log_sum: Array) -> None:
    work, index = np.empty((ROWS_OF_WORK, BLOCK)), np.empty((GROUPS, BLOCK), np.int64)
    for start in range(0, log_sum.shape[0], BLOCK):
        stop = min(start + BLOCK, log_sum.shape[0])
        sums = log_sum[start:stop]
        log_series(False, g[start:stop], V[start:stop], 1.0, sums, sums, sums, work, index)


def diffraction_series(g: Floats, V: Floats) -> Floats:
    """Return the sum [1] of eq. 78 divided by g, which is finite at g = 0.

    The sum runs over m >= 1 of g^(m - 1) e^-g / (m! m) exp(-V / m).

    Parameters
    ----------
    g : array [1]
        Roughness function, eq. 79, g >= 0.
    V : array [1]
        v_xy^2 tau^2 / 4, V >= 0.

    Returns
    -------
    array [1]
        In the broadcast shape. The relative error is below 1e-11 where the value is a normal float64. A value that
        underflows is 0.

    Notes
    -----
    The largest terms lie near the m* of `_peak`, and not near g where V >> g. Sums with a small m* are taken term by
    term. For a larger m* the summand is smooth over its own width and the trapezoid rule converges exponentially, so
    the cost does not grow with g. The loop over terms is outermost in each block of values, so that the exponentials
    vectorise.

    References
    ----------
    he1991, loader2000, corless1996
    """
    g_all, V_all = np.broadcast_arrays(np.asarray(g, dtype=np.float64), np.asarray(V, dtype=np.float64))
    total: Array = np.empty(g_all.size)
    _series(np.ravel(g_all), np.ravel(V_all), total)
    return np.exp(total, out=total).reshape(g_all.shape)[()]


# The logarithm of the sum is tabulated in p = ln(g) and q = ln(1 + V / (5 + g)). Each patch holds the Chebyshev series
# in p of polynomials in q. The table serves rows that share g.
G_LOW, G_HIGH = 1e-3, 1e7  # range of g in the table; below, the logarithm bends too sharply and the sum is short anyway
_LOG_G_LOW = math.log(G_LOW)
_Q_HIGH = 8.7  # largest q; beyond, the sum is smaller than a normal float64
_P_SIZE, _Q_SIZE = 0.8, 0.17  # size of a patch
_ROUNDING = 1e-9  # of a patch, more than any rounding: a value does not depend on the others of its row
_P_PATCHES, Q_PATCHES = math.ceil(math.log(G_HIGH / G_LOW) / _P_SIZE), math.ceil(_Q_HIGH / _Q_SIZE)
TERMS, TERMS_OF_FLOAT32 = 16, 8  # terms of the series in p, and in q: whole vectors of the processor


@functools.cache
def series_table(terms: int) -> Array:
    """Return the table [1] of the logarithm of the sum, of shape (patches in p, terms, patches in q, terms).

    It takes at most 3 MB, and 30 ms to make. The error of the logarithm is below 1e-11 with TERMS, and below 2e-6 with
    TERMS_OF_FLOAT32.
    """
    x = np.cos(np.pi * (np.arange(TERMS) + 0.5) / TERMS)
    to_series = np.polynomial.chebyshev.chebvander(x, terms - 1).T * (2.0 / TERMS)
    to_series[0] /= 2.0
    p = _LOG_G_LOW + _P_SIZE * (np.arange(_P_PATCHES)[:, np.newaxis] + (1.0 + x) / 2.0)
    q = _Q_SIZE * (np.arange(Q_PATCHES)[:, np.newaxis] + (1.0 + x) / 2.0)
    g = np.exp(p)[:, :, np.newaxis, np.newaxis]
    V = (5.0 + g) * np.expm1(q)
    values = np.empty(V.size)
    _series(np.ravel(np.broadcast_to(g, V.shape)), np.ravel(V), values)
    series = np.einsum("kx,pxqy,ly->pkql", to_series, values.reshape(V.shape), to_series, optimize=True)
    powers = [np.polynomial.chebyshev.cheb2poly(row) for row in np.eye(terms)]
    return np.ascontiguousarray(series @ np.array([np.pad(row, (0, terms - row.size)) for row in powers]))


@inner_loop
def log_series_of_row(
    table: Array, g: float, V: Array, V_low: float, V_high: float, log_sum: Array, row: Array
) -> None:
    """Fill log_sum from the table, for one g with G_LOW <= g < G_HIGH and for V within [V_low, V_high].

    row, of shape (Q_PATCHES, terms), is overwritten.
    """
    terms = row.shape[1]
    p = (log(g) - _LOG_G_LOW) * (1.0 / _P_SIZE)
    patch = min(max(int(p), 0), _P_PATCHES - 1)
    x = 2.0 * (p - patch) - 1.0
    inverse = 1.0 / (5.0 + g)
    # The ends of the row may round across the edge of a patch
    first = min(max(int(log(1.0 + V_low * inverse) * (1.0 / _Q_SIZE) - _ROUNDING), 0), Q_PATCHES - 1)
    last = min(max(int(log(1.0 + V_high * inverse) * (1.0 / _Q_SIZE) + _ROUNDING), first), Q_PATCHES - 1)
    # The polynomials in q at this g. Those of neighbouring patches lie side by side
    begin, end = first * terms, (last + 1) * terms
    polynomials = row.reshape(-1)[begin:end]
    coefficients = table[patch, 0].reshape(-1)[begin:end]
    for k in range(polynomials.shape[0]):
        polynomials[k] = coefficients[k]
    before, now = 1.0, x
    for degree in range(1, terms):
        coefficients = table[patch, degree].reshape(-1)[begin:end]
        for k in range(polynomials.shape[0]):
            polynomials[k] += now * coefficients[k]
        before, now = now, 2.0 * x * now - before
    for j in range(V.shape[0]):
        log_sum[j] = log(1.0 + V[j] * inverse) * (1.0 / _Q_SIZE)
    for j in range(V.shape[0]):
        q = log_sum[j]
        i = min(max(int(q), first), last)
        y = 2.0 * (q - i) - 1.0
        along = row[i]
        value = along[terms - 1]
        for k in range(terms - 2, -1, -1):
            value = value * y + along[k]
        log_sum[j] = value if q < Q_PATCHES else -np.inf
