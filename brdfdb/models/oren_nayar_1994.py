"""Oren and Nayar 1994: rough surfaces of Lambertian facets, in the paper's two approximations."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from brdfdb.arrays import array_function
from brdfdb.geometry import Directions, checked_angles, checked_vectors, finished
from brdfdb.models._oren_nayar_kernels import (
    functional_angle_rows,
    functional_gradient_rows,
    functional_vector_rows,
    qualitative_angle_rows,
    qualitative_gradient_rows,
    qualitative_vector_rows,
    rest_of_angle,
)
from brdfdb.models._rows import by_rows, by_rows_of_vectors
from brdfdb.models.large_calls import for_large_calls
from brdfdb.parameters import Floats, Gradient, Parameter

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


@for_large_calls
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
    parameters = RHO.check(rho), SIGMA.check(sigma), INTERREFLECTION.check(interreflection)
    if angles.lights_scattered:
        return finished(by_rows_of_vectors(functional_vector_rows, angles.vectors, parameters), angles)
    polar = angles.theta_i, angles.sin_i, angles.cos_i, angles.theta_r, angles.sin_r, angles.cos_r
    cos_dphi = angles.cos_dphi
    one_less_cos = angles.sin_dphi**2 / (1.0 + np.abs(cos_dphi))  # 1 - |cos|, which tan_mean magnifies near grazing
    columns, scalars = (cos_dphi, one_less_cos), (*polar, *parameters)
    return finished(by_rows(functional_angle_rows, columns, scalars, angles.dtype), angles)


@for_large_calls
def oren_nayar_vectors(
    wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike, interreflection: ArrayLike = True
) -> Floats:
    """Return `oren_nayar` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
    parameters = RHO.check(rho), SIGMA.check(sigma), INTERREFLECTION.check(interreflection)
    return by_rows_of_vectors(functional_vector_rows, checked_vectors(wi, wr), parameters)


@array_function
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


@array_function
def oren_nayar_parts_vectors(wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike) -> Parts:
    """Return `oren_nayar_parts` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
    vectors = checked_vectors(wi, wr)
    parameters = {"rho": RHO.check(rho), "sigma": SIGMA.check(sigma)}
    direct, total = (oren_nayar_vectors(wi, wr, **parameters, interreflection=bounce) for bounce in (False, True))
    return _apart(vectors, direct, total, **parameters)


def _apart(directions: Directions, direct: Floats, total: Floats, rho: Floats, sigma: Floats) -> Parts:
    variance, cos_dphi = sigma**2, directions.cos_dphi
    # 1 - cos(dphi) x^2 with x = 2 beta / pi, without a difference where both are near 1
    rest = rest_of_angle(np.minimum(directions.sin_i, directions.sin_r), np.maximum(directions.cos_i, directions.cos_r))
    less = rest * (2.0 / np.pi) * (2.0 - rest * (2.0 / np.pi))  # 1 - x^2
    near_1 = directions.sin_dphi**2 / (1.0 + np.abs(cos_dphi)) + cos_dphi * less
    bracket = np.where(cos_dphi > 0.0, near_1, 1.0 - cos_dphi * (1.0 - less))
    # Eq. (28)
    bounce = 0.17 * rho**2 / np.pi * variance / (variance + 0.13) * bracket
    return Parts(finished(direct, directions), finished(np.where(direct > 0.0, bounce, total), directions))


@for_large_calls
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
    parameters = RHO.check(rho), SIGMA.check(sigma), OFFSET.check(offset)
    if angles.lights_scattered:
        return finished(by_rows_of_vectors(qualitative_vector_rows, angles.vectors, parameters), angles)
    pair = np.maximum(angles.sin_i, angles.sin_r), np.minimum(np.tan(angles.theta_i), np.tan(angles.theta_r))
    scalars = (*pair, *parameters)
    return finished(by_rows(qualitative_angle_rows, (angles.cos_dphi,), scalars, angles.dtype), angles)


@for_large_calls
def oren_nayar_qualitative_vectors(
    wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike, offset: ArrayLike = 0.33
) -> Floats:
    """Return `oren_nayar_qualitative` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
    parameters = RHO.check(rho), SIGMA.check(sigma), OFFSET.check(offset)
    return by_rows_of_vectors(qualitative_vector_rows, checked_vectors(wi, wr), parameters)


@array_function
def oren_nayar_gradient(
    wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike, interreflection: ArrayLike = True
) -> Gradient:
    """Return the gradient of `oren_nayar_vectors`; 0 where the fit falls below 0."""
    parameters = RHO.check(rho), SIGMA.check(sigma), INTERREFLECTION.check(interreflection)
    values = by_rows_of_vectors(functional_gradient_rows, checked_vectors(wi, wr), parameters, (3,))
    return Gradient(values[0], {RHO.name: values[1], SIGMA.name: values[2]})


@array_function
def oren_nayar_qualitative_gradient(
    wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike, offset: ArrayLike = 0.33
) -> Gradient:
    """Return the gradient of `oren_nayar_qualitative_vectors`."""
    parameters = RHO.check(rho), SIGMA.check(sigma), OFFSET.check(offset)
    values = by_rows_of_vectors(qualitative_gradient_rows, checked_vectors(wi, wr), parameters, (4,))
    return Gradient(values[0], {RHO.name: values[1], SIGMA.name: values[2], OFFSET.name: values[3]})
