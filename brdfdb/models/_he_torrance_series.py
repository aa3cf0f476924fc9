"""The sum over m of He et al. 1991, eq. 78, divided by g: stable and of bounded cost for every g and V."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from brdfdb._numba import kernel
from brdfdb.parameters import Floats

_BLOCK = 32  # values of V that share one set of nodes
_LANES = 16  # a block is padded to whole vectors of the processor
_TABLE = 512  # terms whose ln(m! m) is tabulated; also the most nodes of one block
_SUM_BELOW = 40.0  # a peak at smaller m is summed term by term, at larger m by the trapezoid rule
_BECKMANN_ABOVE = 1e12  # from here on the corrected limit of large g is exact to 4e-14 wherever exp(-V / g) is normal
_V_MAX = 1e200  # the sum is 0 long before
# Nodes reach from _LEFT standard deviations of the summand below the peak to _RIGHT above it and _MARGIN more (the
# tail of a Poisson distribution is longer), _STEP apart. Measured against the whole sum over 1e-4 < g < 1e5,
# V < 2e4: within 5e-12.
_LEFT, _RIGHT, _MARGIN, _STEP = 7.0, 7.2, 7.0, 0.7

_LOG2_E = math.log2(math.e)
_LOG_FACTORIAL_TIMES_M = np.array([0.0] + [math.lgamma(m + 1.0) + math.log(m) for m in range(1, _TABLE)])
_ROUND = 6755399441055744.0  # 1.5 * 2**52: adding it leaves the nearest integer in the low bits of the float
_UNDERFLOW = -1022.0


@kernel
def _exp2(x: float) -> float:
    """2**x for x <= 1000, within 1e-13 relative (measured 8e-15 for x > -10); 0 below the normal float64.

    Branch-free, so that loops over it vectorise; those over libm's exp do not.
    """
    shifted = x + _ROUND
    r = x - (shifted - _ROUND)
    # Taylor series, coefficients ln(2)^k / k!: |r| <= 1/2, the first term left out is below 7e-15
    p = 4.44553827187081e-10
    p = p * r + 7.054911620801121e-09
    p = p * r + 1.0178086009239696e-07
    p = p * r + 1.3215486790144305e-06
    p = p * r + 1.5252733804059838e-05
    p = p * r + 0.00015403530393381606
    p = p * r + 0.0013333558146428441
    p = p * r + 0.009618129107628477
    p = p * r + 0.055504108664821576
    p = p * r + 0.2402265069591007
    p = p * r + 0.6931471805599453
    p = p * r + 1.0
    bits = (np.float64(shifted).view(np.int64) + np.int64(1023)) << np.int64(52)
    return p * np.int64(bits).view(np.float64) if x > _UNDERFLOW else 0.0


@kernel
def _stirling_error(m: float) -> float:
    """ln m! minus Stirling's formula for it (Loader 2000), m >= 16."""
    m2 = m * m
    return (1 / 12 - (1 / 360 - (1 / 1260 - (1 / 1680 - 1 / 1188 / m2) / m2) / m2) / m2) / m


@kernel
def _deviance(m: float, g: float) -> float:
    """m ln(m / g) + g - m without its cancellation at m near g (bd0 of Loader 2000)."""
    difference = m - g
    v = difference / (m + g)
    if abs(v) > 0.1:
        return m * math.log(m / g) + g - m
    total = difference * v
    power = 2.0 * m * v
    for j in range(1, 10):  # v^2 <= 0.01: ten terms are exact to rounding
        power *= v * v
        total += power / (2 * j + 1)
    return total


@kernel
def _log_coefficient(m: float, g: float) -> float:
    """ln of g^(m - 1) e^-g / (m! m); m >= 1 need not be whole."""
    if m < 16.0:
        return (m - 1.0) * math.log(g) - g - math.lgamma(m + 1.0) - math.log(m)
    poisson = -_deviance(m, g) - _stirling_error(m) - 0.5 * math.log(2.0 * np.pi * m)
    return poisson - math.log(m) - math.log(g)


@kernel
def _peak(g: float, V: float) -> tuple[float, float]:
    """Where the summand peaks, ln(g / m) + V / m^2 = 0, and its standard deviation there.

    With u = 2 ln(m / g) the condition is u e^u = 2 V / g^2: u = W_0(2 V / g^2), m = g e^(u / 2), and the second
    derivative gives the variance m / (1 + u). Nodes need the peak to a few percent of the deviation, no better.
    """
    y = 2.0 * V / g / g
    if y < 1e-8:
        return g, math.sqrt(g)
    log_y = math.log(2.0 * V) - 2.0 * math.log(g)
    log_1p_y = math.log1p(y) if log_y < 300.0 else log_y
    u = log_1p_y * (1.0 - math.log1p(log_1p_y) / (2.0 + log_1p_y))
    u = u / (1.0 + u) * (1.0 + log_y - math.log(u))
    u = u / (1.0 + u) * (1.0 + log_y - math.log(u))
    m = math.sqrt(2.0 * V / u)  # g e^(u / 2), without its overflow
    return m, math.sqrt(m / (1.0 + u))


@kernel
def _add_terms(
    log_c: NDArray[np.float64],
    first: float,
    step: float,
    count: int,
    V: NDArray[np.float64],
    total: NDArray[np.float64],
) -> None:
    """total = step * sum over m = first, first + step, ... of exp(log_c - V / m), for a block of V at once."""
    for i in range(V.shape[0]):
        total[i] = 0.0
    for j in range(count):
        log2_c = log_c[j] * _LOG2_E
        inverse_m = _LOG2_E / (first + j * step)
        for i in range(V.shape[0]):
            total[i] += _exp2(log2_c - inverse_m * V[i])
    for i in range(V.shape[0]):
        total[i] *= step


@kernel
def _sum_row(g: float, V: NDArray[np.float64], total: NDArray[np.float64], work: NDArray[np.float64]) -> None:
    """The sum for one g and a row of V; `work` is four rows of work space."""
    if g < 1e-290:  # g -> 0 leaves the first term
        total[:] = np.exp(-V)
        return
    if g > _BECKMANN_ABOVE:
        for i in range(V.shape[0]):
            b = min(V[i] / g, 1e3)  # exp(-1e3) is 0, and b^2 stays finite
            total[i] = math.exp(-b) / g / g * (1.0 + (0.5 * b * b - 2.0 * b + 1.0) / g)
        return
    whole, node, V_block, sum_block = work[0], work[1], work[2], work[3]
    log_g = math.log(g)
    tabulated = 1  # whole[m] is valid for 1 <= m < tabulated
    width = _BLOCK
    start = 0
    while start < V.shape[0]:
        stop = min(start + width, V.shape[0])
        V_low, V_high = V[start:stop].min(), V[start:stop].max()
        if not V_high < _V_MAX:  # or nan: only that value is lost, not its block
            if stop - start > 1:
                width = 1
                continue
            total[start] = 0.0 if V_high >= _V_MAX else np.nan
            width = _BLOCK
            start = stop
            continue
        m_low, s_low = _peak(g, V_low)
        m_high, s_high = _peak(g, V_high)
        first = max(1.0, np.floor(m_low - _LEFT * s_low))  # math.floor is an int64, which a large m overflows
        last = np.ceil(m_high + _RIGHT * s_high) + _MARGIN
        term_by_term = m_low < _SUM_BELOW
        step = 1.0 if term_by_term else max(1.0, _STEP * min(s_low, s_high))
        if step > 1e3:  # whole nodes: near m = 1e12 the rounding of others shows in the tenth digit
            step = np.floor(step)
        nodes = (last - first) / step + 1.0
        if (last if term_by_term else nodes) >= _TABLE:  # the peaks of a block lie too far apart for common nodes
            width = 1
            continue
        count = int(nodes)
        width = _BLOCK
        # Whole vectors: a block is padded with copies of its last value, a lone value stays alone
        lanes = 1 if stop - start == 1 else -(-(stop - start) // _LANES) * _LANES
        for i in range(lanes):
            V_block[i] = V[min(start + i, stop - 1)]
        if term_by_term:
            for m in range(tabulated, int(last) + 1):
                whole[m] = (m - 1) * log_g - g - _LOG_FACTORIAL_TIMES_M[m]
            tabulated = max(tabulated, int(last) + 1)
            _add_terms(whole[int(first) :], first, step, count, V_block[:lanes], sum_block[:lanes])
        else:
            for j in range(count):
                node[j] = _log_coefficient(first + j * step, g)
            _add_terms(node, first, step, count, V_block[:lanes], sum_block[:lanes])
        total[start:stop] = sum_block[: stop - start]
        start = stop


@kernel
def _sum_rows(g: NDArray[np.float64], V: NDArray[np.float64], total: NDArray[np.float64]) -> None:
    work = np.empty((4, _TABLE))
    for row in range(g.shape[0]):
        _sum_row(g[row], V[row], total[row], work)


def diffraction_series(g: Floats, V: Floats) -> Floats:
    """Sum over m >= 1 of g^(m - 1) e^-g / (m! m) exp(-V / m): the sum of eq. 78 over g, so that g = 0 has a limit.

    Parameters
    ----------
    g : array [1]
        Roughness function, eq. 79, g >= 0. Work is shared along the last axis where g has length 1 there.
    V : array [1]
        v_xy^2 tau^2 / 4, V >= 0.

    Returns
    -------
    array [1]
        In the broadcast shape; relative error below 1e-11 where the value is a normal float64, 0 where it underflows.

    Notes
    -----
    The weight sits near the m* of `_peak`, not near g when V >> g. Small m* are summed term by term; beyond, the
    summand is smooth over its own width and the trapezoid rule converges exponentially, so the cost does not grow
    with g. Values of V in a row share their nodes in blocks, and the exponentials of a block vectorise.

    References
    ----------
    he1991, loader2000, corless1996
    """
    g_array: NDArray[np.float64] = np.atleast_1d(np.asarray(g, dtype=np.float64))
    V_array: NDArray[np.float64] = np.atleast_1d(np.asarray(V, dtype=np.float64))
    shape = np.broadcast_shapes(g_array.shape, V_array.shape)
    length = max(shape[-1], 1) if g_array.shape[-1] == 1 else 1
    rows: NDArray[np.float64] = np.ascontiguousarray(np.broadcast_to(V_array, shape)).reshape(-1, length)
    row_shape = (*shape[:-1], shape[-1] // length)
    total: NDArray[np.float64] = np.empty_like(rows)
    with np.errstate(all="ignore"):  # uncompiled, NumPy flags the overflow of V / g^2 that `_peak` is made for
        _sum_rows(np.ravel(np.broadcast_to(g_array, row_shape)), rows, total)
    return total.reshape(np.broadcast_shapes(np.shape(g), np.shape(V)))
