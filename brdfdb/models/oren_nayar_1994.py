"""Oren and Nayar 1994: rough surfaces of Lambertian facets, in the paper's two approximations."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb._elementary import arcsin, cosine
from brdfdb._numba import elementwise, kernel
from brdfdb.geometry import HALF_PI, Directions, checked_angles, checked_vectors, finished
from brdfdb.models._rows import by_rows, by_rows_of_vectors
from brdfdb.parameters import Floats, Parameter

RHO = Parameter("rho", "ρ", "1", 0.0, 1.0, "albedo of a facet", reflectance=True)
SIGMA = Parameter("sigma", "σ", "rad", 0.0, np.pi / 2, "standard deviation of the facets' slope angle")
INTERREFLECTION = Parameter("interreflection", "L²", "1", 0.0, 1.0, "add the second bounce of eq. 28", default=True)
OFFSET = Parameter(
    "offset", "", "1", 0.0, 10.0, "constant in A; 0.57 stands in for interreflection (note 7)", default=0.33
)


class Parts(NamedTuple):
    """The two parts of the BRDF [1/sr] of Lambertian facets: light reflected once, and light reflected twice."""

    direct: Floats
    interreflected: Floats


_HALF_PI_REST = 6.123233995736766e-17  # pi/2 less the float64 nearest to it
_NO_AZIMUTH = 1e-300  # product of two sines below which an azimuth is undefined


@kernel
def _angle(sin_theta: float, cos_theta: float) -> tuple[float, float]:
    """Return a polar angle [rad] and its complement to pi/2 [rad], each with all its digits."""
    steep = sin_theta > cos_theta
    small = arcsin(cos_theta if steep else sin_theta)
    large = HALF_PI - small + _HALF_PI_REST
    theta = large if steep else small
    rest = small if steep else large
    return theta, rest


@kernel
def _rest_of_angle(sin_theta: float, cos_theta: float) -> float:
    return _angle(sin_theta, cos_theta)[1]


_rest = elementwise(_rest_of_angle)


@kernel
def _functional(
    alpha: float,
    beta: float,
    beta_rest: float,
    sin_alpha: float,
    versine_rest: float,
    tan_beta: float,
    tan_mean: float,
    rho: float,
    sigma: float,
    interreflection: float,
) -> tuple[float, float, float, float]:
    """Return the four coefficients [1/sr] of eq. (29): c_0, c_1 backward, c_1 forward, and c_2.

    f_r is c_0 + c_1 cos(dphi) + c_2 (1 - abs(cos(dphi))). beta_rest is pi/2 - beta, and versine_rest is
    1 - sin(alpha). Both are arguments because their differences would cancel near the horizon.
    """
    sigma2 = sigma * sigma
    # Eq. (27), coefficients
    C1 = 1.0 - 0.5 * sigma2 / (sigma2 + 0.33)
    ratio = sigma2 / (sigma2 + 0.09)
    C2_backward = 0.45 * ratio * sin_alpha
    # sin(alpha) - (2 beta / pi)^3, where both are near 1 at the horizon and tan(beta) magnifies their difference
    x = beta_rest * (2.0 / np.pi)
    C2_forward = 0.45 * ratio * (x * (3.0 - x * (3.0 - x)) - versine_rest)
    C3 = 0.125 * ratio * (alpha * beta * (4.0 / np.pi**2)) ** 2
    # Eq. (28)
    bounced = interreflection * 0.17 * rho * sigma2 / (sigma2 + 0.13)
    bounced_cos = bounced * (beta * (2.0 / np.pi)) ** 2
    # Eqs (27) and (29)
    scale = rho / np.pi
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
def _functional_angle_rows(
    cos_dphi: NDArray[np.float64],
    one_less_cos: NDArray[np.float64],
    scalars: NDArray[np.float64],
    f_r: NDArray[np.float64],
) -> None:
    for row in range(f_r.shape[0]):
        s, f = scalars[row], f_r[row]
        c_0, backward, forward, c_2 = _functional(s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7], s[8], s[9])
        shared = min(row, cos_dphi.shape[0] - 1)
        cos, rest = cos_dphi[shared], one_less_cos[shared]
        for j in range(f.shape[0]):
            f[j] = _f_r(c_0, backward, forward, c_2, cos[j], rest[j])


@kernel
def _functional_vector_rows(w_i: Floats, w_r: Floats, scalars: NDArray[np.float64], f_r: Floats) -> None:
    for row in range(f_r.shape[0]):
        f = f_r[row]
        rho, sigma, interreflection = scalars[row, 0], scalars[row, 1], scalars[row, 2]
        i, r = w_i[min(row, w_i.shape[0] - 1)].reshape(-1), w_r[min(row, w_r.shape[0] - 1)].reshape(-1)
        for j in range(f.shape[0]):
            x, y, z = 3 * j, 3 * j + 1, 3 * j + 2
            f[j] = _functional_of_vectors(i[x], i[y], i[z], r[x], r[y], r[z], rho, sigma, interreflection)


@kernel
def _functional_of_vectors(
    x_i: float,
    y_i: float,
    z_i: float,
    x_r: float,
    y_r: float,
    z_r: float,
    rho: float,
    sigma: float,
    interreflection: float,
) -> float:
    x_i, y_i, x_r, y_r = np.float64(x_i), np.float64(y_i), np.float64(x_r), np.float64(y_r)
    z_i, z_r = np.float64(z_i), np.float64(z_r)
    sin2_i, sin2_r = x_i * x_i + y_i * y_i, x_r * x_r + y_r * y_r
    cos_i, cos_r = cosine(z_i), cosine(z_r)
    sin_i, sin_r = math.sqrt(sin2_i), math.sqrt(sin2_r)
    theta_i, rest_i = _angle(sin_i, cos_i)
    theta_r, rest_r = _angle(sin_r, cos_r)
    lower_light = cos_i < cos_r
    alpha = theta_i if lower_light else theta_r
    beta = theta_r if lower_light else theta_i
    beta_rest = rest_r if lower_light else rest_i
    sin_alpha = sin_i if lower_light else sin_r
    cos_alpha = cos_i if lower_light else cos_r
    tan_beta = (sin_r if lower_light else sin_i) / (cos_r if lower_light else cos_i)
    versine_rest = cos_alpha * cos_alpha / (1.0 + sin_alpha)
    tan_mean = (sin_i + sin_r) / (cos_i + cos_r)
    c_0, backward, forward, c_2 = _functional(
        alpha, beta, beta_rest, sin_alpha, versine_rest, tan_beta, tan_mean, rho, sigma, interreflection
    )
    product = sin_i * sin_r
    inverse = 1.0 / (_NO_AZIMUTH if product < _NO_AZIMUTH else product)
    cos_dphi = (x_i * x_r + y_i * y_r) * inverse
    sin_dphi = (x_i * y_r - y_i * x_r) * inverse
    f_r = _f_r(c_0, backward, forward, c_2, cos_dphi, sin_dphi * sin_dphi / (1.0 + abs(cos_dphi)))
    return f_r * (0.0 if z_i < 0.0 or z_r < 0.0 else 1.0)  # nan stays nan


@kernel
def _qualitative(sin_alpha: float, tan_beta: float, rho: float, sigma: float, offset: float) -> tuple[float, float]:
    """Return the coefficients c_0 and c_1 [1/sr] of eq. (30), f_r = c_0 + c_1 max(0, cos(dphi))."""
    sigma2 = sigma * sigma
    # Eq. (30)
    A = 1.0 - 0.5 * sigma2 / (sigma2 + offset) if sigma2 > 0.0 else 1.0
    B = 0.45 * sigma2 / (sigma2 + 0.09)
    return rho / np.pi * A, rho / np.pi * B * sin_alpha * tan_beta


@kernel
def _qualitative_angle_rows(
    cos_dphi: NDArray[np.float64], scalars: NDArray[np.float64], f_r: NDArray[np.float64]
) -> None:
    for row in range(f_r.shape[0]):
        s, f = scalars[row], f_r[row]
        c_0, c_1 = _qualitative(s[0], s[1], s[2], s[3], s[4])
        cos = cos_dphi[min(row, cos_dphi.shape[0] - 1)]
        for j in range(f.shape[0]):
            f[j] = c_0 + c_1 * max(0.0, cos[j])


@kernel
def _qualitative_vector_rows(w_i: Floats, w_r: Floats, scalars: NDArray[np.float64], f_r: Floats) -> None:
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


def oren_nayar(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    rho: ArrayLike,
    sigma: ArrayLike,
    interreflection: ArrayLike = True,
) -> Floats:
    """Return the BRDF [1/sr] of Lambertian V-cavities with Gaussian slopes, by the functional fit of the paper.

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi].
    rho : array_like [1]
        Albedo of a facet, in [0, 1].
    sigma : array_like [rad]
        Standard deviation of the slope angle, in [0, pi/2].
    interreflection : bool
        True to add the second bounce between facing facets (eq. 28) to the direct part (eq. 27).

    Returns
    -------
    array [1/sr]
        In the broadcast shape of all arguments; 0 below the horizon, nan where an angle is nan.

    Raises
    ------
    ParameterError
        If an argument is outside its range.

    Notes
    -----
    Eqs (27) to (29), divided by E_0 cos theta_i. beta is the smaller of the two polar angles, so tan beta grows
    without bound only where both reach 90 degrees. There the value is the one at the float64 nearest pi/2.

    Departures from the paper: f_r is 0 where the fit falls below 0, which happens for rough dark surfaces at grazing
    angles in the forward direction. Published excess: with rho = 1 the directional albedo reaches 1.05 near grazing,
    for sigma below 40 degrees.

    References
    ----------
    orennayar1994

    Examples
    --------
    >>> round(float(oren_nayar(0.3, 0.0, 0.4, 0.0, rho=0.9, sigma=0.5)), 4)
    0.2639
    """
    angles = checked_angles(theta_i, phi_i, theta_r, phi_r)
    alpha, beta = np.maximum(angles.theta_i, angles.theta_r), np.minimum(angles.theta_i, angles.theta_r)
    sin_alpha = np.maximum(angles.sin_i, angles.sin_r)
    pair = (
        alpha,
        beta,
        HALF_PI - beta + _HALF_PI_REST,
        sin_alpha,
        2.0 * np.sin((HALF_PI - alpha + _HALF_PI_REST) / 2.0) ** 2,
        np.tan(beta),
        (angles.sin_i + angles.sin_r) / (angles.cos_i + angles.cos_r),  # tangent of the mean angle, without rounding it
    )
    cos_dphi = angles.cos_dphi
    one_less_cos = angles.sin_dphi**2 / (1.0 + np.abs(cos_dphi))  # 1 - |cos|, which tan_mean magnifies near grazing
    parameters = RHO.check(rho), SIGMA.check(sigma), INTERREFLECTION.check(interreflection)
    return finished(by_rows(_functional_angle_rows, (cos_dphi, one_less_cos), (*pair, *parameters)), angles)


def oren_nayar_vectors(
    wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike, interreflection: ArrayLike = True
) -> Floats:
    """Return `oren_nayar` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
    parameters = RHO.check(rho), SIGMA.check(sigma), INTERREFLECTION.check(interreflection)
    return by_rows_of_vectors(_functional_vector_rows, checked_vectors(wi, wr), parameters)


def oren_nayar_parts(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    rho: ArrayLike,
    sigma: ArrayLike,
) -> Parts:
    """Return the parts [1/sr] of `oren_nayar`: direct light (eq. 27) and the second bounce (eq. 28).

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r, rho, sigma : array_like
        As `oren_nayar` takes them.

    Returns
    -------
    Parts [1/sr]
        The arrays `direct` and `interreflected`, which add up to `oren_nayar`. Where eq. (27) falls below 0, the direct
        part is 0 and the sum of both equations, if positive, is the other part.

    Raises
    ------
    ParameterError
        If an argument is outside its range.

    References
    ----------
    orennayar1994

    Examples
    --------
    >>> parts = oren_nayar_parts(0.3, 0.0, 0.4, 0.0, rho=0.9, sigma=0.5)
    >>> round(float(parts.direct), 4), round(float(parts.interreflected), 4)
    (0.2362, 0.0278)
    """
    angles = checked_angles(theta_i, phi_i, theta_r, phi_r)
    parameters = {"rho": RHO.check(rho), "sigma": SIGMA.check(sigma)}
    direct, total = (oren_nayar(*angles.given, **parameters, interreflection=bounce) for bounce in (False, True))
    return _apart(angles, direct, total, **parameters)


def oren_nayar_parts_vectors(wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike) -> Parts:
    """Return `oren_nayar_parts` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
    vectors = checked_vectors(wi, wr)
    parameters = {"rho": RHO.check(rho), "sigma": SIGMA.check(sigma)}
    direct, total = (oren_nayar_vectors(wi, wr, **parameters, interreflection=bounce) for bounce in (False, True))
    return _apart(vectors, direct, total, **parameters)


def _apart(directions: Directions, direct: Floats, total: Floats, rho: Floats, sigma: Floats) -> Parts:
    variance, cos_dphi = sigma**2, directions.cos_dphi
    # 1 - cos(dphi) x^2 with x = 2 beta / pi, without a difference where both are near 1
    rest = _rest(np.minimum(directions.sin_i, directions.sin_r), np.maximum(directions.cos_i, directions.cos_r))
    less = rest * (2.0 / np.pi) * (2.0 - rest * (2.0 / np.pi))  # 1 - x^2
    near_1 = directions.sin_dphi**2 / (1.0 + np.abs(cos_dphi)) + cos_dphi * less
    bracket = np.where(cos_dphi > 0.0, near_1, 1.0 - cos_dphi * (1.0 - less))
    # Eq. (28)
    bounce = 0.17 * rho**2 / np.pi * variance / (variance + 0.13) * bracket
    return Parts(finished(direct, directions), finished(np.where(direct > 0.0, bounce, total), directions))


def oren_nayar_qualitative(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    rho: ArrayLike,
    sigma: ArrayLike,
    offset: ArrayLike = 0.33,
) -> Floats:
    """Return the BRDF [1/sr] of the qualitative model: the fit without its third term and without interreflection.

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi].
    rho : array_like [1]
        Albedo of a facet, in [0, 1].
    sigma : array_like [rad]
        Standard deviation of the slope angle, in [0, pi/2].
    offset : array_like [1]
        Constant in A, in [0, 10]: 0.33 as printed, 0.57 to stand in for the missing interreflection (note 7).

    Returns
    -------
    array [1/sr]
        In the broadcast shape of all arguments; 0 below the horizon, nan where an angle is nan.

    Raises
    ------
    ParameterError
        If an argument is outside its range.

    Notes
    -----
    Eq. (30), divided by E_0 cos theta_i.

    References
    ----------
    orennayar1994

    Examples
    --------
    >>> round(float(oren_nayar_qualitative(0.3, 0.0, 0.4, 0.0, rho=0.9, sigma=0.5)), 4)
    0.2362
    """
    angles = checked_angles(theta_i, phi_i, theta_r, phi_r)
    pair = np.maximum(angles.sin_i, angles.sin_r), np.tan(np.minimum(angles.theta_i, angles.theta_r))
    parameters = RHO.check(rho), SIGMA.check(sigma), OFFSET.check(offset)
    return finished(by_rows(_qualitative_angle_rows, (angles.cos_dphi,), (*pair, *parameters)), angles)


def oren_nayar_qualitative_vectors(
    wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike, offset: ArrayLike = 0.33
) -> Floats:
    """Return `oren_nayar_qualitative` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
    parameters = RHO.check(rho), SIGMA.check(sigma), OFFSET.check(offset)
    return by_rows_of_vectors(_qualitative_vector_rows, checked_vectors(wi, wr), parameters)
