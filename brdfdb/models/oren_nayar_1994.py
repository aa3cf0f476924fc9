"""Oren and Nayar 1994: rough surfaces of Lambertian facets, in the paper's two approximations."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from brdfdb._numba import elementwise, kernel
from brdfdb.geometry import HALF_PI, Angles, checked_angles, finished
from brdfdb.parameters import Floats, ModelSpec, Parameter

RHO = Parameter("rho", "ρ", "1", 0.0, 1.0, "albedo of a facet")
SIGMA = Parameter("sigma", "σ", "rad", 0.0, np.pi / 2, "standard deviation of the facets' slope angle")
INTERREFLECTION = Parameter("interreflection", "L²", "1", 0.0, 1.0, "add the second bounce of eq. 28", default=True)
OFFSET = Parameter(
    "offset", "", "1", 0.0, 10.0, "constant in A; 0.57 stands in for interreflection (note 7)", default=0.33
)

_HALF_PI_REST = 6.123233995736766e-17  # pi/2 less the float64 nearest to it

# Measured at rho = 1 over sigma: the albedo reaches 1.0499 (sigma of 18 degrees, theta_i of 89.9) and exceeds 1 from 50
# degrees on, the qualitative model 1.015 or, with an offset of 0.57, 1.044
_KNOWN_EXCESS: dict[str, float | str] = {
    "max_albedo": 1.05,
    "from_theta_i_deg": 45.0,
    "citation": "Oren and Nayar 1994, eqs 27, 28 and 30: near grazing and with an albedo near 1 the fit reflects up to "
    "5 % more than it receives, for sigma below 40 degrees",
}


@kernel
def _functional(
    alpha: float,
    beta: float,
    sin_alpha: float,
    versine_alpha: float,
    tan_beta: float,
    tan_mean: float,
    cos_delta_phi: float,
    one_less_cos: float,
    rho: float,
    sigma: float,
    interreflection: float,
) -> float:
    sigma2 = sigma * sigma
    # Eq. (27), coefficients
    C1 = 1.0 - 0.5 * sigma2 / (sigma2 + 0.33)
    C2 = 0.45 * sigma2 / (sigma2 + 0.09) * sin_alpha
    if cos_delta_phi < 0.0:
        # sin(alpha) - (2 beta / pi)^3: both near 1 at the horizon, where tan(beta) magnifies what is left
        x = (HALF_PI - beta + _HALF_PI_REST) * (2.0 / np.pi)
        C2 = 0.45 * sigma2 / (sigma2 + 0.09) * (x * (3.0 - x * (3.0 - x)) - versine_alpha)
    C3 = 0.125 * sigma2 / (sigma2 + 0.09) * (4.0 * alpha * beta / np.pi**2) ** 2
    # Eq. (27)
    direct = C1 + cos_delta_phi * C2 * tan_beta + one_less_cos * C3 * tan_mean
    # Eq. (28)
    bounced = 0.17 * rho * sigma2 / (sigma2 + 0.13) * (1.0 - cos_delta_phi * (2.0 * beta / np.pi) ** 2)
    # Eq. (29)
    f_r = rho / np.pi * (direct + interreflection * bounced)
    return f_r if f_r > 0.0 else 0.0


@kernel
def _qualitative(
    sin_alpha: float, tan_beta: float, cos_delta_phi: float, rho: float, sigma: float, offset: float
) -> float:
    sigma2 = sigma * sigma
    # Eq. (30)
    A = 1.0 - 0.5 * sigma2 / (sigma2 + offset) if sigma2 > 0.0 else 1.0
    B = 0.45 * sigma2 / (sigma2 + 0.09)
    return rho / np.pi * (A + B * max(0.0, cos_delta_phi) * sin_alpha * tan_beta)


_evaluate_functional = elementwise(_functional)
_evaluate_qualitative = elementwise(_qualitative)


def _alpha_beta(angles: Angles) -> tuple[Floats, Floats]:
    """The larger and the smaller of theta_i and theta_r."""
    return np.maximum(angles.theta_i, angles.theta_r), np.minimum(angles.theta_i, angles.theta_r)


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
    """BRDF of an isotropic surface of Lambertian V-cavities with Gaussian slopes, the paper's functional fit.

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi].
    rho : array_like [1]
        Albedo of a facet, in [0, 1].
    sigma : array_like [rad]
        Standard deviation of the slope angle, in [0, pi/2].
    interreflection : bool
        Add the second bounce between facing facets (eq. 28) to the direct part (eq. 27).

    Returns
    -------
    array [1/sr]
        In the broadcast shape of all arguments; 0 below the horizon, nan where an angle is nan.

    Raises
    ------
    ValueError
        If an argument is outside its range.

    Notes
    -----
    Eqs (27) to (29), divided by E_0 cos theta_i. beta is the smaller of the two polar angles, so tan beta grows
    without bound only where both reach 90 degrees; there the value is the one at the float64 nearest pi/2.
    Departures from the paper: the fit falls below 0 for rough dark surfaces at grazing angles in the forward
    direction; there it is 0. Published excess: with rho = 1 the directional albedo reaches 1.04 near grazing for
    sigma between 10 and 30 degrees.

    References
    ----------
    orennayar1994

    Examples
    --------
    >>> round(float(oren_nayar(0.3, 0.0, 0.4, 0.0, rho=0.9, sigma=0.5)), 4)
    0.2639
    """
    angles = checked_angles(theta_i, phi_i, theta_r, phi_r)
    alpha, beta = _alpha_beta(angles)
    delta_phi = angles.phi_r - angles.phi_i
    cos_delta_phi = np.cos(delta_phi)
    sin_alpha, sin_beta = np.sin(alpha), np.sin(beta)
    values = _evaluate_functional(
        alpha,
        beta,
        sin_alpha,
        2.0 * np.sin((HALF_PI - alpha + _HALF_PI_REST) / 2.0) ** 2,
        np.tan(beta),
        (sin_alpha + sin_beta) / (np.cos(alpha) + np.cos(beta)),  # the mean of two angles would round
        cos_delta_phi,
        np.sin(delta_phi) ** 2 / (1.0 + np.abs(cos_delta_phi)),  # 1 - |cos|: tan_mean magnifies it near grazing
        RHO.check(rho),
        SIGMA.check(sigma),
        INTERREFLECTION.check(interreflection),
    )
    return finished(values, angles)


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
    """BRDF of the paper's qualitative model: the functional fit without its third term and without interreflection.

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
    ValueError
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
    alpha, beta = _alpha_beta(angles)
    values = _evaluate_qualitative(
        np.sin(alpha),
        np.tan(beta),
        np.cos(angles.phi_r - angles.phi_i),
        RHO.check(rho),
        SIGMA.check(sigma),
        OFFSET.check(offset),
    )
    return finished(values, angles)


SPEC = ModelSpec(
    name="oren_nayar",
    version=1,
    title="Oren-Nayar, functional approximation",
    equation="eqs 27-29",
    reference="orennayar1994",
    parameters=(RHO, SIGMA, INTERREFLECTION),
    evaluate=oren_nayar,
    grazing_pole=True,
    known_excess=_KNOWN_EXCESS,
)
QUALITATIVE_SPEC = ModelSpec(
    name="oren_nayar_qualitative",
    version=1,
    title="Oren-Nayar, qualitative model",
    equation="eq. 30",
    reference="orennayar1994",
    parameters=(RHO, SIGMA, OFFSET),
    evaluate=oren_nayar_qualitative,
    grazing_pole=True,
    known_excess=_KNOWN_EXCESS,
)
