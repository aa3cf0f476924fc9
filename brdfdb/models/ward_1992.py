"""Ward 1992: the elliptical Gaussian model fitted to measured anisotropic surfaces."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from brdfdb._numba import elementwise, kernel
from brdfdb.geometry import checked_angles, finished
from brdfdb.parameters import Floats, ModelSpec, Parameter

RHO_D = Parameter("rho_d", "ρ_d", "1", 0.0, 1.0, "diffuse reflectance")
RHO_S = Parameter("rho_s", "ρ_s", "1", 0.0, 1.0, "specular reflectance; the tables of the paper call it ρ_r")
ALPHA_X = Parameter("alpha_x", "α_x", "1", 1e-6, 2.0, "standard deviation of the slope along x")
ALPHA_Y = Parameter("alpha_y", "α_y", "1", 1e-6, 2.0, "standard deviation of the slope along y")


@kernel
def _elliptical(
    x_i: float,
    y_i: float,
    cos_i: float,
    x_r: float,
    y_r: float,
    cos_r: float,
    rho_d: float,
    rho_s: float,
    alpha_x: float,
    alpha_y: float,
) -> float:
    # The half vector, not normalised: its length drops out of tan(delta)
    h_x = x_r + x_i
    h_y = y_r + y_i
    h_z = cos_r + cos_i
    # tan^2(delta) (cos^2(phi) / alpha_x^2 + sin^2(phi) / alpha_y^2)
    exponent = ((h_x / alpha_x) ** 2 + (h_y / alpha_y) ** 2) / (h_z * h_z)
    # Eq. (5a)
    lobe = math.exp(-exponent) / (4.0 * np.pi * alpha_x * alpha_y) / math.sqrt(cos_i * cos_r)
    return rho_d / np.pi + rho_s * lobe


_evaluate = elementwise(_elliptical)


def ward(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    rho_d: ArrayLike,
    rho_s: ArrayLike,
    alpha_x: ArrayLike,
    alpha_y: ArrayLike,
) -> Floats:
    """BRDF of the elliptical Gaussian model; isotropic (eq. 4) where alpha_x equals alpha_y.

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi]; phi from x.
    rho_d, rho_s : array_like [1]
        Diffuse and specular reflectance, each in [0, 1].
    alpha_x, alpha_y : array_like [1]
        Standard deviations of the surface slope along x and y, in [1e-6, 2]; the paper holds the model good to 0.2.

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
    Eq. (5a). The lobe grows as 1 / sqrt(cos) towards grazing; at 90 degrees it is the finite value at the float64
    nearest pi/2. The normalisation 1 / (4 pi alpha_x alpha_y) holds near normal incidence only: the albedo of the
    lobe is about cos(theta_i) for small alpha.

    References
    ----------
    ward1992

    Examples
    --------
    >>> round(float(ward(0.3, 0.0, 0.3, np.pi, rho_d=0.1, rho_s=0.33, alpha_x=0.05, alpha_y=0.16)), 4)
    3.4679
    """
    angles = checked_angles(theta_i, phi_i, theta_r, phi_r)
    sin_i, sin_r = np.sin(angles.theta_i), np.sin(angles.theta_r)
    values = _evaluate(
        sin_i * np.cos(angles.phi_i),
        sin_i * np.sin(angles.phi_i),
        np.cos(angles.theta_i),
        sin_r * np.cos(angles.phi_r),
        sin_r * np.sin(angles.phi_r),
        np.cos(angles.theta_r),
        RHO_D.check(rho_d),
        RHO_S.check(rho_s),
        ALPHA_X.check(alpha_x),
        ALPHA_Y.check(alpha_y),
    )
    return finished(values, angles)


SPEC = ModelSpec(
    name="ward",
    version=1,
    title="Ward, elliptical Gaussian",
    equation="eq. 5a",
    reference="ward1992",
    parameters=(RHO_D, RHO_S, ALPHA_X, ALPHA_Y),
    evaluate=ward,
    grazing_pole=True,
    lobe_axes=("alpha_x", "alpha_y"),
)
