"""The kernels of He et al. 1991: roughness, shadowing, and f_r of rows, of unit vectors and of scattered pairs."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from brdfdb._elementary import BLOCK, cosine, erfcx, exp, log
from brdfdb._numba import elementwise, inner_loop, kernel, loop
from brdfdb.fresnel import reflectance, reflectance_slopes
from brdfdb.models._diffraction_series import (
    G_HIGH,
    G_LOW,
    GROUPS,
    Q_PATCHES,
    ROWS_OF_WORK,
    log_series,
    log_series_of_row,
    nearer_lambert_w,
    roughly_lambert_w,
)
from brdfdb.parameters import Floats

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_X_MAX = 30.0  # largest x; erfc(x) and exp(-x^2) are 0 in float64 well below it
_INVERSE_SQRT_PI = 0.5641895835477563
WORTH_THE_TABLE = 16  # values in a row from which on the table of the series is faster than the sum

# The ways to compute the sum of eq. 78: whole, as its limit for g -> infinity, or as that limit with the next term. A
# positive number stands for as many first terms
WHOLE, LIMIT, CORRECTED_LIMIT = 0, -1, -2


@kernel
def _shadowing_and_hidden(sin_theta: float, cos_theta: float, slope: float) -> tuple[float, float]:
    """Return S_1(theta) / cos theta [1] of eqs 23-25, and K [1] of eqs 82-83, the part of the valleys out of reach.

    slope is sigma_0 / tau. The first result is finite up to and including 90 degrees.
    """
    valley = 2.0 * slope * sin_theta
    x = cos_theta / (valley if valley > 0.0 else 1.0)
    x = _X_MAX if valley == 0.0 or x > _X_MAX else x  # both exponentials are 0 from here on
    gaussian = exp(-x * x)
    erfc = gaussian * erfcx(x)
    Q = 1.0 - 0.5 * erfc
    return Q / (Q * cos_theta + slope * _INVERSE_SQRT_PI * sin_theta * gaussian), sin_theta / cos_theta * erfc


@kernel
def _slopes_of_shadowing(sin_theta: float, cos_theta: float, slope: float) -> tuple[float, float]:
    """Return the derivatives by ln(slope) of ln(S_1) and of K, which `_shadowing_and_hidden` gives."""
    valley = 2.0 * slope * sin_theta
    x = cos_theta / (valley if valley > 0.0 else 1.0)
    x = _X_MAX if valley == 0.0 or x > _X_MAX else x
    gaussian = exp(-x * x)
    Q = 1.0 - 0.5 * gaussian * erfcx(x)
    # dQ / d ln(slope) = -x e^(-x^2) / sqrt(pi). In the denominator Q cos + slope / sqrt(pi) sin e^(-x^2) it cancels
    # against the derivative of the Gaussian
    narrow = slope * _INVERSE_SQRT_PI * sin_theta * gaussian
    by_shadowing = -_INVERSE_SQRT_PI * x * gaussian / Q - narrow / (Q * cos_theta + narrow)
    return by_shadowing, _INVERSE_SQRT_PI * gaussian / slope if gaussian > 0.0 else 0.0


@kernel
def _shadowing_over_cos(sin_theta: float, cos_theta: float, slope: float) -> float:
    return _shadowing_and_hidden(sin_theta, cos_theta, slope)[0]


@kernel
def _hidden_slope(sin_theta: float, cos_theta: float, slope: float) -> float:
    return _shadowing_and_hidden(sin_theta, cos_theta, slope)[1]


@kernel
def _difference_of_sines(sin_i: float, cos_i: float, sin_r: float, cos_r: float) -> float:
    """Return sin(theta_i) - sin(theta_r) [1] without a difference of numbers near 1."""
    sines, cosines = sin_i + sin_r, cos_i + cos_r
    return sin_i - sin_r if sines < cosines else (cos_r - cos_i) * cosines / sines


@kernel
def _height_squared(K: float) -> float:
    """Return z_0^2 / sigma_0^2 = W_0(K^2 / (8 pi)) [1] of eq. 81 for K = K_i + K_r."""
    y = K * K * (0.125 / np.pi)
    series = y * (1.0 - y * (1.0 - y * (1.5 - y * (8.0 / 3.0))))
    large = 1e-4 if y < 1e-4 else y
    log_y = log(large)
    w = nearer_lambert_w(nearer_lambert_w(roughly_lambert_w(large, log_y), log_y), log_y)
    return series if y < 1e-4 else w


@kernel
def _effective_variance(K: float) -> float:
    """Return (sigma / sigma_0)^2 [1] of eq. 80 for K = K_i + K_r."""
    return 1.0 / (1.0 + _height_squared(K))


shadowing = elementwise(_shadowing_over_cos)
hidden = elementwise(_hidden_slope)
variance = elementwise(_effective_variance)
difference_of_sines = elementwise(_difference_of_sines)


@inner_loop
def _roughness(geometry: Array, slope: Array, variance: Array, shadow: Array) -> None:
    """Fill in (sigma / sigma_0)^2 [1] and S / (cos theta_i cos theta_r) [1], which the polar angles and slopes set."""
    sin_i, cos_i, sin_r, cos_r = geometry[0], geometry[1], geometry[2], geometry[3]
    count = shadow.shape[0]
    for j in range(count):
        # Eqs (23)-(25)
        light, K_i = _shadowing_and_hidden(sin_i[j], cos_i[j], slope[j])
        viewer, K_r = _shadowing_and_hidden(sin_r[j], cos_r[j], slope[j])
        shadow[j] = light * viewer
        variance[j] = K_i + K_r
    for j in range(count):
        # Eqs (80)-(83)
        variance[j] = _effective_variance(variance[j])


@inner_loop
def _first_terms(terms: int, g: Array, V: Array, total: Array, power: Array) -> None:
    """Add the first terms of the sum of eq. 78 divided by g. power is overwritten."""
    count = total.shape[0]
    for j in range(count):
        total[j] = 0.0
        power[j] = exp(-g[j])
    for m in range(1, terms + 1):
        inverse, following = 1.0 / m, 1.0 / (m + 1.0)
        for j in range(count):
            total[j] += inverse * power[j] * exp(-V[j] * inverse)
            power[j] *= g[j] * following


@inner_loop
def _limit(corrected: bool, g: Array, V: Array, total: Array) -> None:
    """Fill in the limit of the sum of eq. 78 divided by g for g -> infinity, e^-b / g^2 with b = V / g.

    `corrected` adds the first order in 1/g. The corrected factor is held above 0, since the expansion is meant for
    large g.
    """
    for j in range(total.shape[0]):
        inverse = 1.0 / g[j]
        b = V[j] * inverse
        beyond = 1.0 + (b * (0.5 * b - 2.0) + 1.0) * inverse if corrected else 1.0
        total[j] = exp(-b) * inverse * inverse * (beyond if beyond > 0.0 else 0.0)


@inner_loop
def _evaluate(
    geometry: Array, surface: Array, series: int, reach: float, f_r: Array, work: Array, index: Indices, same: bool
) -> None:
    """Evaluate f_r [1/sr] at no more than BLOCK pairs of directions, with the sum of eq. 78 that `series` selects.

    reach is that of `log_series`, for the whole sum. geometry and surface hold the rows named below. If they have the
    `same` directions and slope as in the last call, work still holds what these alone decide.
    """
    cos_i, cos_r, v_xy2 = geometry[1], geometry[3], geometry[4]
    wave, correlation, n, k, uniform = surface[0], surface[1], surface[3], surface[4], surface[5]
    count = f_r.shape[0]
    variance, shadow, g_over_vz2 = work[0, :count], work[1, :count], work[2, :count]
    g, V = work[3, :count], work[4, :count]
    if not same:
        _roughness(geometry, surface[2], variance, shadow)
    for j in range(count):
        # Eq. (79)
        g_over_vz2[j] = wave[j] * variance[j]
        g[j] = g_over_vz2[j] * (cos_i[j] + cos_r[j]) ** 2
        V[j] = correlation[j] * v_xy2[j]
    # Eq. (78)
    if series == WHOLE:
        log_series(False, g, V, reach, f_r, f_r, f_r, work[5:], index)
        for j in range(count):
            f_r[j] = exp(f_r[j])
    elif series > 0:
        _first_terms(series, g, V, f_r, work[5, :count])
    else:
        _limit(series == CORRECTED_LIMIT, g, V, f_r)
    for j in range(count):
        v2 = v_xy2[j] + (cos_i[j] + cos_r[j]) ** 2
        # Eqs (71) and (76)
        f_r[j] *= correlation[j] * (0.25 / np.pi) * shadow[j] * g_over_vz2[j] * v2 * v2
    if n[0] > 0.0:
        for j in range(count):
            # Eq. (75), at the bisecting angle
            half = 0.5 * math.sqrt(v_xy2[j] + (cos_i[j] + cos_r[j]) ** 2)
            f_r[j] *= reflectance(1.0 if half > 1.0 else half, n[j], k[j])
    for j in range(count):
        # Eq. (72)
        f_r[j] += uniform[j]


@loop
def specular_rows(scalars: Array, rho_s: Array) -> None:
    for row in range(rho_s.shape[0]):
        sin_i, cos_i, wave, slope = scalars[0, row], scalars[1, row], scalars[2, row], scalars[3, row]
        S_over_cos, K_i = _shadowing_and_hidden(sin_i, cos_i, slope)
        # Eq. (79)
        g = 4.0 * cos_i * cos_i * wave * _effective_variance(2.0 * K_i)
        # Eq. (73)
        rho_s[row] = reflectance(cos_i, scalars[4, row], scalars[5, row]) * exp(-g) * (S_over_cos * cos_i) ** 2


@loop
def scattered(features: Array, surface: Array, series: int, reach: float, f_r: Array) -> None:
    """Evaluate f_r [1/sr] of scattered pairs of directions.

    features has the shape (5, N) and the rows of `_evaluate`, surface the shape (6, 1) or (6, N).
    """
    work, index = np.empty((5 + ROWS_OF_WORK, BLOCK)), np.empty((GROUPS, BLOCK), np.int64)
    lanes, geometry, width = np.empty((6, BLOCK)), np.empty((5, BLOCK)), surface.shape[1]
    for start in range(0, f_r.shape[0], BLOCK):
        count = min(BLOCK, f_r.shape[0] - start)
        for column in range(5):
            for j in range(count):
                geometry[column, j] = features[column, start + j]
        for column in range(6):
            for j in range(count):
                lanes[column, j] = surface[column, min(start + j, width - 1)]
        _evaluate(geometry, lanes, series, reach, f_r[start : start + count], work, index, False)


@inner_loop
def _geometry_of(i: Floats, r: Floats, geometry: Array) -> None:
    """Fill in the rows of geometry that `_evaluate` reads, for at most BLOCK pairs of unit vectors in flat arrays."""
    count = i.shape[0] // 3
    for j in range(count):
        geometry[0, j] = math.sqrt(np.float64(i[3 * j]) ** 2 + np.float64(i[3 * j + 1]) ** 2)
        geometry[1, j] = cosine(np.float64(i[3 * j + 2]))
    for j in range(count):
        geometry[2, j] = math.sqrt(np.float64(r[3 * j]) ** 2 + np.float64(r[3 * j + 1]) ** 2)
        geometry[3, j] = cosine(np.float64(r[3 * j + 2]))
    for j in range(count):
        # Eq. (84): k_r - k_i is the sum of our directions
        v_x, v_y = np.float64(i[3 * j]) + r[3 * j], np.float64(i[3 * j + 1]) + r[3 * j + 1]
        geometry[4, j] = v_x * v_x + v_y * v_y


@loop
def vector_rows(w_i: Floats, w_r: Floats, series: int, reach: float, scalars: Array, f_r: Floats) -> None:
    """Evaluate rows of f_r [1/sr] as `scattered` does, for unit vectors and surfaces of shape (rows, 6).

    Rows of one value, each with a surface of its own, are one long row.
    """
    work, index = np.empty((5 + ROWS_OF_WORK, BLOCK)), np.empty((GROUPS, BLOCK), np.int64)
    lanes, values, geometry = np.empty((6, BLOCK)), np.empty(BLOCK), np.empty((5, BLOCK))
    scattered_surfaces = f_r.shape[1] == 1
    rows, length = (1, f_r.shape[0]) if scattered_surfaces else f_r.shape
    flat_i, flat_r, flat_f = w_i.reshape(-1), w_r.reshape(-1), f_r.reshape(-1)
    shared = w_i.shape[0] == w_r.shape[0] == 1  # by all rows
    for start in range(0, length, BLOCK):
        count = min(BLOCK, length - start)
        for row in range(rows):
            if scattered_surfaces:
                own = scalars[start : start + count].reshape(-1)
                for column in range(6):
                    for j in range(count):
                        lanes[column, j] = own[6 * j + column]
            elif rows > 1 or start == 0:
                for column in range(6):
                    for j in range(count):
                        lanes[column, j] = scalars[row, column]
            first_i = 3 * (start + (0 if w_i.shape[0] == 1 else row * length))
            first_r = 3 * (start + (0 if w_r.shape[0] == 1 else row * length))
            i, r = flat_i[first_i : first_i + 3 * count], flat_r[first_r : first_r + 3 * count]
            repeated = shared and row > 0
            if not repeated:
                _geometry_of(i, r, geometry)
            same = repeated and scalars[row, 2] == scalars[row - 1, 2]
            _evaluate(geometry, lanes, series, reach, values[:count], work, index, same)
            f = flat_f[row * length + start : row * length + start + count]
            for j in range(count):
                f[j] = values[j] * (0.0 if i[3 * j + 2] < 0.0 or r[3 * j + 2] < 0.0 else 1.0)  # nan stays nan


@inner_loop
def _gradient(geometry: Array, surface: Array, values: Array, work: Array, index: Indices) -> None:
    """Evaluate the directional diffuse part and its derivatives at no more than BLOCK pairs of directions.

    The rows of values, of shape (5, pairs), are f_r [1/sr] and its derivatives [1/sr] by ln(sigma_0), ln(tau), n and k.
    surface has the rows of `_evaluate` for one surface.
    """
    wave, correlation, slope, n, k = surface[0], surface[1], surface[2], surface[3], surface[4]
    count = values.shape[1]
    g, V, log_sum, by_g, by_V = work[0, :count], work[1, :count], work[2, :count], work[3, :count], work[4, :count]
    factor, by_slope, growth = work[5], work[6], work[7]
    for j in range(count):
        # Eqs (23)-(25), (79)-(83), as in `_roughness`
        sin_i, cos_i, sin_r, cos_r = geometry[0, j], geometry[1, j], geometry[2, j], geometry[3, j]
        light, K_i = _shadowing_and_hidden(sin_i, cos_i, slope)
        viewer, K_r = _shadowing_and_hidden(sin_r, cos_r, slope)
        light_slope, K_i_slope = _slopes_of_shadowing(sin_i, cos_i, slope)
        viewer_slope, K_r_slope = _slopes_of_shadowing(sin_r, cos_r, slope)
        K = K_i + K_r
        height = _height_squared(K)
        variance = 1.0 / (1.0 + height)
        by_slope[j] = light_slope + viewer_slope
        # The derivative of ln(sigma^2 / sigma_0^2) by ln(slope): W' = W / (y (1 + W)) with y = K^2 / (8 pi)
        growth[j] = -2.0 * variance * variance * (height / K) * (K_i_slope + K_r_slope) if K > 0.0 else 0.0
        v_z2 = (cos_i + cos_r) ** 2
        v2 = geometry[4, j] + v_z2
        g[j] = wave * variance * v_z2
        V[j] = correlation * geometry[4, j]
        # Eqs (71) and (76)
        factor[j] = correlation * (0.25 / np.pi) * light * viewer * wave * variance * v2 * v2
    # Eq. (78)
    log_series(True, g, V, 1.0, log_sum, by_g, by_V, work[8:], index)
    for j in range(count):
        half = 0.5 * math.sqrt(geometry[4, j] + (geometry[1, j] + geometry[3, j]) ** 2)
        half = 1.0 if half > 1.0 else half
        # Eq. (75), at the bisecting angle
        F2 = reflectance(half, n, k)
        F2_by_n, F2_by_k = reflectance_slopes(half, n, k)
        of_mirror = factor[j] * exp(log_sum[j])
        f_r = of_mirror * F2
        # slope is sigma_0 / tau, g goes with (sigma_0 / lambda)^2 and the variance, V with tau^2
        common = by_slope[j] + growth[j] * by_g[j]
        values[0, j] = f_r
        values[1, j] = f_r * (common + 2.0 * by_g[j])
        values[2, j] = f_r * (2.0 + 2.0 * by_V[j] - common)
        values[3, j] = of_mirror * F2_by_n
        values[4, j] = of_mirror * F2_by_k


@loop
def gradient_rows(w_i: Floats, w_r: Floats, scalars: Array, values: Floats) -> None:
    """Fill in f_r [1/sr] and its derivatives by sigma_0, tau, n, k and a, values of shape (6, rows, length).

    scalars holds the rows of `scattered` and then sigma_0 and tau.
    """
    work, index = np.empty((8 + ROWS_OF_WORK, BLOCK)), np.empty((GROUPS, BLOCK), np.int64)
    geometry, block = np.empty((5, BLOCK)), np.empty((5, BLOCK))
    for row in range(values.shape[1]):
        s = scalars[row]
        uniform, sigma_0, tau = s[5], s[6], s[7]
        per_sigma_0 = 1.0 / sigma_0 if sigma_0 > 0.0 else 0.0  # f_r goes with its square
        for start in range(0, values.shape[2], BLOCK):
            count = min(BLOCK, values.shape[2] - start)
            i = w_i[min(row, w_i.shape[0] - 1), start : start + count].reshape(-1)
            r = w_r[min(row, w_r.shape[0] - 1), start : start + count].reshape(-1)
            _geometry_of(i, r, geometry)
            _gradient(geometry, s, block[:, :count], work, index)
            of_row = values[:, row, start : start + count]
            for j in range(count):
                above = 0.0 if i[3 * j + 2] < 0.0 or r[3 * j + 2] < 0.0 else 1.0  # nan stays nan
                f_r = block[0, j]
                of_row[0, j] = above * (f_r + uniform)
                of_row[1, j] = above * block[1, j] * per_sigma_0
                of_row[2, j] = above * block[2, j] / tau
                of_row[3, j] = above * block[3, j]
                of_row[4, j] = above * block[4, j]
                of_row[5, j] = above / np.pi + 0.0 * f_r


@loop
def angle_rows(one_plus_cos: Array, table: Array, scalars: Array, f_r: Floats) -> None:
    """Evaluate rows of f_r [1/sr] along the azimuth. A row shares polar angles and surface."""
    length = f_r.shape[1]
    work, index = np.empty((ROWS_OF_WORK, BLOCK)), np.empty((GROUPS, BLOCK), np.int64)
    lanes, variance, shadow = np.empty((10, BLOCK)), np.empty(BLOCK), np.empty(BLOCK)
    g_row, v2, V, log_D = np.empty(BLOCK), np.empty(length), np.empty(length), np.empty(length)
    polynomials = np.empty((Q_PATCHES, table.shape[3]))
    least, most = 0.0, 2.0
    for row in range(f_r.shape[0]):
        if row < one_plus_cos.shape[0]:
            least, most = 2.0, 0.0
            for j in range(length):  # the comparisons skip nan
                turn = one_plus_cos[row, j]
                least, most = turn if turn < least else least, turn if turn > most else most
        lane = row % BLOCK
        if lane == 0:
            rows = min(BLOCK, f_r.shape[0] - row)
            for i in range(rows):
                for column in range(10):
                    lanes[column, i] = scalars[column, row + i]
            _roughness(lanes[:4], lanes[6], variance[:rows], shadow[:rows])
        s, f, turned = scalars[:, row], f_r[row], one_plus_cos[min(row, one_plus_cos.shape[0] - 1)]
        correlation, n, k, uniform = s[5], s[7], s[8], s[9]
        v_z2 = (s[1] + s[3]) ** 2
        g_over_vz2 = s[4] * variance[lane]  # eq. (79)
        g = g_over_vz2 * v_z2
        if g == 0.0:
            for j in range(length):
                f[j] = uniform
            continue
        # Eq. (84): v_xy^2 in the form that keeps its digits near the mirror direction
        difference2, product = _difference_of_sines(s[0], s[1], s[2], s[3]) ** 2, 2.0 * s[0] * s[2]
        for j in range(length):
            v_xy2 = difference2 + product * turned[j]
            v2[j] = v_xy2 + v_z2
            V[j] = correlation * v_xy2
        # Eq. (78)
        if length >= WORTH_THE_TABLE and G_LOW <= g < G_HIGH:
            low, high = correlation * (difference2 + product * least), correlation * (difference2 + product * most)
            log_series_of_row(table, g, V, low, high, log_D, polynomials)
        else:
            for i in range(min(length, BLOCK)):
                g_row[i] = g
            for start in range(0, length, BLOCK):
                stop = min(start + BLOCK, length)
                sums = log_D[start:stop]
                log_series(False, g_row[: stop - start], V[start:stop], 1.0, sums, sums, sums, work, index)
        # Eqs (71) and (76)
        pair = correlation * (0.25 / np.pi) * shadow[lane] * g_over_vz2
        for j in range(length):
            # Eq. (75), at the bisecting angle
            cos = 0.5 * math.sqrt(v2[j])
            F2 = reflectance(1.0 if cos > 1.0 else cos, n, k) if n > 0.0 else 1.0
            # Eq. (72)
            f[j] = uniform + pair * v2[j] * v2[j] * exp(log_D[j]) * F2
