"""The kernels of the approximations of Oren and Nayar 1994: f_r and its derivatives, of rows and of unit vectors."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from brdfdb._elementary import BLOCK, cosine, twice_arctan
from brdfdb._numba import elementwise, kernel, loop
from brdfdb.geometry import HALF_PI
from brdfdb.parameters import Floats

HALF_PI_REST = 6.123233995736766e-17  # pi/2 less the float64 nearest to it
_NO_AZIMUTH = 1e-300  # product of two sines below which an azimuth is undefined

_Polar = tuple[float, float, float, float, float, float, float]
_Pair = tuple[float, float, float, float, float, float, float, float, float]


@kernel
def _angle(sin_theta: float, cos_theta: float) -> tuple[float, float]:
    """Return a polar angle [rad] and its complement to pi/2 [rad], each with all its digits."""
    steep = sin_theta > cos_theta
    larger = sin_theta if steep else cos_theta
    small = twice_arctan((cos_theta if steep else sin_theta) / (1.0 + larger))
    large = HALF_PI - small + HALF_PI_REST
    theta = large if steep else small
    rest = small if steep else large
    return theta, rest


@kernel
def _rest_of_angle(sin_theta: float, cos_theta: float) -> float:
    return _angle(sin_theta, cos_theta)[1]


rest_of_angle = elementwise(_rest_of_angle)


@kernel
def _roughness(rho: float, sigma: float, interreflection: float) -> tuple[float, float, float]:
    """Return the factors [1] set by the parameters: C_1 and that of C_2 and C_3 (eq. 27), and that of eq. (28)."""
    sigma2 = sigma * sigma
    return (
        1.0 - 0.5 * sigma2 / (sigma2 + 0.33),
        sigma2 / (sigma2 + 0.09),
        interreflection * 0.17 * rho * sigma2 / (sigma2 + 0.13),
    )


@kernel
def _saturation_slope(sigma: float, offset: float) -> float:
    """Return the derivative [1/rad] of sigma^2 / (sigma^2 + offset) by sigma; 0 if both are 0."""
    rest = sigma * sigma + offset
    return 2.0 * sigma / rest * (offset / rest) if rest > 0.0 else 0.0


@kernel
def _functional(
    alpha: float,
    beta: float,
    beta_rest: float,
    sin_alpha: float,
    versine_rest: float,
    tan_beta: float,
    tan_mean: float,
    scale: float,
    C1: float,
    ratio: float,
    bounced: float,
) -> tuple[float, float, float, float]:
    """Return the four coefficients [1/sr] of eq. (29): c_0, c_1 backward, c_1 forward, and c_2.

    f_r is c_0 + c_1 cos(dphi) + c_2 (1 - abs(cos(dphi))). beta_rest is pi/2 - beta, and versine_rest is
    1 - sin(alpha). Both are arguments because their differences would cancel near the horizon. scale is rho / pi, the
    other three are those of `_roughness`, in which the coefficients are linear.
    """
    # Eq. (27), coefficients
    C2_backward = 0.45 * ratio * sin_alpha
    # sin(alpha) - (2 beta / pi)^3, where both are near 1 at the horizon and tan(beta) magnifies their difference
    x = beta_rest * (2.0 / np.pi)
    C2_forward = 0.45 * ratio * (x * (3.0 - x * (3.0 - x)) - versine_rest)
    C3 = 0.125 * ratio * (alpha * beta * (4.0 / np.pi**2)) ** 2
    # Eq. (28)
    bounced_cos = bounced * (beta * (2.0 / np.pi)) ** 2
    # Eqs (27) and (29)
    return (
        scale * (C1 + bounced),
        scale * (C2_backward * tan_beta - bounced_cos),
        scale * (C2_forward * tan_beta - bounced_cos),
        scale * C3 * tan_mean,
    )


@kernel
def _f_r(c_0: float, backward: float, forward: float, c_2: float, cos_dphi: float, one_less_cos: float) -> float:
    f_r = c_0 + (backward if cos_dphi >= 0.0 else forward) * cos_dphi + c_2 * one_less_cos
    return 0.0 if f_r < 0.0 else f_r


@kernel
def _polar(
    theta_i: float,
    rest_i: float,
    sin_i: float,
    cos_i: float,
    theta_r: float,
    rest_r: float,
    sin_r: float,
    cos_r: float,
    lower_light: bool,
) -> _Polar:
    """Return the seven arguments of `_functional` that two polar angles set, with complements, sines and cosines."""
    alpha = theta_i if lower_light else theta_r
    beta = theta_r if lower_light else theta_i
    beta_rest = rest_r if lower_light else rest_i
    sin_alpha = sin_i if lower_light else sin_r
    cos_alpha = cos_i if lower_light else cos_r
    tan_beta = (sin_r if lower_light else sin_i) / (cos_r if lower_light else cos_i)
    versine_rest = cos_alpha * cos_alpha / (1.0 + sin_alpha)
    tan_mean = (sin_i + sin_r) / (cos_i + cos_r)  # of the mean angle, without rounding it
    return alpha, beta, beta_rest, sin_alpha, versine_rest, tan_beta, tan_mean


@loop
def functional_angle_rows(
    cos_dphi: NDArray[np.float64], one_less_cos: NDArray[np.float64], scalars: NDArray[np.float64], f_r: Floats
) -> None:
    """Fill in rows of f_r [1/sr]. The coefficients of a block of rows are computed at once: that loop vectorises."""
    rows = f_r.shape[0]
    work = np.empty((13, BLOCK))  # nine scalars of each row, and the four coefficients
    for start in range(0, rows, BLOCK):
        count = min(BLOCK, rows - start)
        for column in range(9):
            of_rows = scalars[column, start : start + count]
            for j in range(count):
                work[column, j] = of_rows[j]
        for j in range(count):
            theta_i, theta_r = work[0, j], work[3, j]
            rest_i, rest_r = HALF_PI - theta_i + HALF_PI_REST, HALF_PI - theta_r + HALF_PI_REST
            polar = _polar(
                theta_i, rest_i, work[1, j], work[2, j], theta_r, rest_r, work[4, j], work[5, j], theta_i > theta_r
            )
            C1, ratio, bounced = _roughness(work[6, j], work[7, j], work[8, j])
            scale = work[6, j] / np.pi
            work[9, j], work[10, j], work[11, j], work[12, j] = _functional(
                polar[0], polar[1], polar[2], polar[3], polar[4], polar[5], polar[6], scale, C1, ratio, bounced
            )
        for j in range(count):
            row, f = start + j, f_r[start + j]
            shared = min(row, cos_dphi.shape[0] - 1)
            cos, rest = cos_dphi[shared], one_less_cos[shared]
            c_0, backward, forward, c_2 = work[9, j], work[10, j], work[11, j], work[12, j]
            for k in range(f.shape[0]):
                f[k] = _f_r(c_0, backward, forward, c_2, cos[k], rest[k])


@kernel
def _pair(x_i: float, y_i: float, z_i: float, x_r: float, y_r: float, z_r: float) -> _Pair:
    """Return the seven arguments of `_functional` for two unit vectors, cos(dphi) and 1 - abs(cos(dphi)) [1]."""
    x_i, y_i, x_r, y_r = np.float64(x_i), np.float64(y_i), np.float64(x_r), np.float64(y_r)
    sin2_i, sin2_r = x_i * x_i + y_i * y_i, x_r * x_r + y_r * y_r
    cos_i, cos_r = cosine(np.float64(z_i)), cosine(np.float64(z_r))
    sin_i, sin_r = math.sqrt(sin2_i), math.sqrt(sin2_r)
    theta_i, rest_i = _angle(sin_i, cos_i)
    theta_r, rest_r = _angle(sin_r, cos_r)
    polar = _polar(theta_i, rest_i, sin_i, cos_i, theta_r, rest_r, sin_r, cos_r, cos_i < cos_r)
    product = sin_i * sin_r
    inverse = 1.0 / (_NO_AZIMUTH if product < _NO_AZIMUTH else product)
    cos_dphi = (x_i * x_r + y_i * y_r) * inverse
    sin_dphi = (x_i * y_r - y_i * x_r) * inverse
    one_less_cos = sin_dphi * sin_dphi / (1.0 + abs(cos_dphi))
    return *polar, cos_dphi, one_less_cos


@kernel
def _functional_value(pair: _Pair, scale: float, C1: float, ratio: float, bounced: float) -> float:
    """Return f_r [1/sr] of eq. (29) for a `_pair`, negative where the fit falls below 0."""
    c_0, backward, forward, c_2 = _functional(
        pair[0], pair[1], pair[2], pair[3], pair[4], pair[5], pair[6], scale, C1, ratio, bounced
    )
    return c_0 + (backward if pair[7] >= 0.0 else forward) * pair[7] + c_2 * pair[8]


@loop
def functional_vector_rows(w_i: Floats, w_r: Floats, scalars: NDArray[np.float64], f_r: Floats) -> None:
    for row in range(f_r.shape[0]):
        f, scale = f_r[row], scalars[row, 0] / np.pi
        C1, ratio, bounced = _roughness(scalars[row, 0], scalars[row, 1], scalars[row, 2])
        i, r = w_i[min(row, w_i.shape[0] - 1)].reshape(-1), w_r[min(row, w_r.shape[0] - 1)].reshape(-1)
        for j in range(f.shape[0]):
            x, y, z = 3 * j, 3 * j + 1, 3 * j + 2
            value = _functional_value(_pair(i[x], i[y], i[z], r[x], r[y], r[z]), scale, C1, ratio, bounced)
            value = 0.0 if value < 0.0 else value
            f[j] = value * (0.0 if i[z] < 0.0 or r[z] < 0.0 else 1.0)  # nan stays nan


@loop
def functional_gradient_rows(w_i: Floats, w_r: Floats, scalars: NDArray[np.float64], values: Floats) -> None:
    """Fill in f_r [1/sr] and its derivatives by rho and sigma, values of shape (3, rows, length)."""
    for row in range(values.shape[1]):
        f_r, by_rho, by_sigma = values[0, row], values[1, row], values[2, row]
        rho, sigma, interreflection = scalars[row, 0], scalars[row, 1], scalars[row, 2]
        C1, ratio, bounced = _roughness(rho, sigma, interreflection)
        C1_slope, ratio_slope = -0.5 * _saturation_slope(sigma, 0.33), _saturation_slope(sigma, 0.09)
        bounced_slope = interreflection * 0.17 * rho * _saturation_slope(sigma, 0.13)
        i, r = w_i[min(row, w_i.shape[0] - 1)].reshape(-1), w_r[min(row, w_r.shape[0] - 1)].reshape(-1)
        for j in range(f_r.shape[0]):
            x, y, z = 3 * j, 3 * j + 1, 3 * j + 2
            pair = _pair(i[x], i[y], i[z], r[x], r[y], r[z])
            per_rho = _functional_value(pair, 1.0 / np.pi, C1, ratio, bounced)
            # Where the fit falls below 0, f_r is 0 and does not change
            shown = 0.0 if i[z] < 0.0 or r[z] < 0.0 or per_rho < 0.0 else 1.0
            f_r[j] = shown * rho * per_rho
            by_rho[j] = shown * _functional_value(pair, 1.0 / np.pi, C1, ratio, 2.0 * bounced)  # it goes with rho^2
            by_sigma[j] = shown * _functional_value(pair, rho / np.pi, C1_slope, ratio_slope, bounced_slope)


@kernel
def _qualitative(sin_alpha: float, tan_beta: float, rho: float, sigma: float, offset: float) -> tuple[float, float]:
    """Return the coefficients c_0 and c_1 [1/sr] of eq. (30), f_r = c_0 + c_1 max(0, cos(dphi))."""
    sigma2 = sigma * sigma
    # Eq. (30)
    A = 1.0 - 0.5 * sigma2 / (sigma2 + offset) if sigma2 > 0.0 else 1.0
    B = 0.45 * sigma2 / (sigma2 + 0.09)
    return rho / np.pi * A, rho / np.pi * B * sin_alpha * tan_beta


@loop
def qualitative_angle_rows(cos_dphi: NDArray[np.float64], scalars: NDArray[np.float64], f_r: Floats) -> None:
    for row in range(f_r.shape[0]):
        s, f = scalars[:, row], f_r[row]
        c_0, c_1 = _qualitative(s[0], s[1], s[2], s[3], s[4])
        cos = cos_dphi[min(row, cos_dphi.shape[0] - 1)]
        for j in range(f.shape[0]):
            f[j] = c_0 + c_1 * max(0.0, cos[j])


@loop
def qualitative_vector_rows(w_i: Floats, w_r: Floats, scalars: NDArray[np.float64], f_r: Floats) -> None:
    for row in range(f_r.shape[0]):
        f = f_r[row]
        # sin(alpha) tan(beta) cos(dphi) is x_i x_r + y_i y_r over the larger cosine, so no angle is needed
        A, B = _qualitative(1.0, 1.0, scalars[row, 0], scalars[row, 1], scalars[row, 2])
        i, r = w_i[min(row, w_i.shape[0] - 1)].reshape(-1), w_r[min(row, w_r.shape[0] - 1)].reshape(-1)
        for j in range(f.shape[0]):
            z_i, z_r = np.float64(i[3 * j + 2]), np.float64(r[3 * j + 2])
            along = np.float64(i[3 * j]) * r[3 * j] + np.float64(i[3 * j + 1]) * r[3 * j + 1]
            value = A + B * (0.0 if along < 0.0 else along) / cosine(z_i if z_i > z_r else z_r)
            f[j] = value if z_i >= 0.0 and z_r >= 0.0 else 0.0 * (z_i + z_r + along)  # 0, or nan


@loop
def qualitative_gradient_rows(w_i: Floats, w_r: Floats, scalars: NDArray[np.float64], values: Floats) -> None:
    """Fill in f_r [1/sr] and its derivatives by rho, sigma and the offset, values of shape (4, rows, length)."""
    for row in range(values.shape[1]):
        f_r, by_rho, by_sigma, by_offset = values[0, row], values[1, row], values[2, row], values[3, row]
        rho, sigma, offset = scalars[row, 0], scalars[row, 1], scalars[row, 2]
        A, B = _qualitative(1.0, 1.0, 1.0, sigma, offset)
        A_slope, B_slope = -0.5 * _saturation_slope(sigma, offset), 0.45 * _saturation_slope(sigma, 0.09)
        rest = sigma * sigma + offset
        A_by_offset = 0.5 * (sigma / rest) ** 2 if rest > 0.0 else 0.0
        scale = rho / np.pi
        i, r = w_i[min(row, w_i.shape[0] - 1)].reshape(-1), w_r[min(row, w_r.shape[0] - 1)].reshape(-1)
        for j in range(f_r.shape[0]):
            z_i, z_r = np.float64(i[3 * j + 2]), np.float64(r[3 * j + 2])
            along = np.float64(i[3 * j]) * r[3 * j] + np.float64(i[3 * j + 1]) * r[3 * j + 1]
            angular = (0.0 if along < 0.0 else along) / cosine(z_i if z_i > z_r else z_r)
            shown = 1.0 if z_i >= 0.0 and z_r >= 0.0 else 0.0 * (z_i + z_r + along)  # 0, or nan
            f_r[j] = shown * rho * (A + B * angular)
            by_rho[j] = shown * (A + B * angular)
            by_sigma[j] = shown * scale * (A_slope + B_slope * angular)
            by_offset[j] = shown * scale * A_by_offset
