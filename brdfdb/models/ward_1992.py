"""Ward 1992: the elliptical Gaussian model fitted to measured anisotropic surfaces."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb._elementary import BLOCK, by_component, cosine, exp
from brdfdb._numba import kernel
from brdfdb.geometry import checked_angles, checked_vectors, finished
from brdfdb.models._rows import by_rows, by_rows_of_vectors
from brdfdb.parameters import Floats, ModelSpec, Parameter

RHO_D = Parameter("rho_d", "ρ_d", "1", 0.0, 1.0, "diffuse reflectance")
RHO_S = Parameter("rho_s", "ρ_s", "1", 0.0, 1.0, "specular reflectance; the tables of the paper call it ρ_r")
ALPHA_X = Parameter("alpha_x", "α_x", "1", 1e-6, 2.0, "standard deviation of the slope along x")
ALPHA_Y = Parameter("alpha_y", "α_y", "1", 1e-6, 2.0, "standard deviation of the slope along y")


@kernel
def _constants(rho_d: float, rho_s: float, alpha_x: float, alpha_y: float) -> tuple[float, float, float, float]:
    return rho_d / np.pi, rho_s / (4.0 * np.pi * alpha_x * alpha_y), 1.0 / alpha_x, 1.0 / alpha_y


@kernel
def _lobe(h_x: float, h_y: float, h_z2: float, cos_cos: float, u_x: float, u_y: float) -> float:
    """Eq. (5a) times 4 pi alpha_x alpha_y, for u = 1 / alpha and h = d_r + d_i: its length drops out of tan(delta)."""
    root = math.sqrt(cos_cos)
    inverse = 1.0 / (h_z2 * root)  # of both: a division takes as long as half of the rest
    # tan^2(delta) (cos^2(phi) / alpha_x^2 + sin^2(phi) / alpha_y^2)
    exponent = ((h_x * u_x) ** 2 + (h_y * u_y) ** 2) * (inverse * root)
    # Eq. (5a)
    return exp(-exponent) * (inverse * h_z2)


@kernel
def _angle_rows(
    cos_phi: NDArray[np.float64], sin_phi: NDArray[np.float64], scalars: NDArray[np.float64], f_r: NDArray[np.float64]
) -> None:
    for row in range(f_r.shape[0]):
        s, f = scalars[row], f_r[row]
        x_i, y_i, cos_i, sin_r, cos_r = s[0], s[1], s[2], s[3], s[4]
        uniform, peak, u_x, u_y = _constants(s[5], s[6], s[7], s[8])
        c_phi, s_phi = cos_phi[min(row, cos_phi.shape[0] - 1)], sin_phi[min(row, sin_phi.shape[0] - 1)]
        h_z2, cos_cos = (cos_i + cos_r) ** 2, cos_i * cos_r
        for j in range(f.shape[0]):
            f[j] = uniform + peak * _lobe(x_i + sin_r * c_phi[j], y_i + sin_r * s_phi[j], h_z2, cos_cos, u_x, u_y)


@kernel
def _vector_rows(w_i: Floats, w_r: Floats, scalars: NDArray[np.float64], f_r: Floats) -> None:
    i, r = np.empty((3, BLOCK)), np.empty((3, BLOCK))
    for row in range(f_r.shape[0]):
        s, f = scalars[row], f_r[row]
        uniform, peak, u_x, u_y = _constants(s[0], s[1], s[2], s[3])
        lights, viewers = w_i[min(row, w_i.shape[0] - 1)], w_r[min(row, w_r.shape[0] - 1)]
        for start in range(0, f.shape[0], BLOCK):
            count = by_component(lights, start, i)
            by_component(viewers, start, r)
            for j in range(count):
                cos_i, cos_r = cosine(i[2, j]), cosine(r[2, j])
                h_z2 = (cos_i + cos_r) ** 2
                lobe = _lobe(i[0, j] + r[0, j], i[1, j] + r[1, j], h_z2, cos_i * cos_r, u_x, u_y)
                f[start + j] = 0.0 if i[2, j] < 0.0 or r[2, j] < 0.0 else uniform + peak * lobe


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
    light = (angles.x_i, angles.y_i, angles.cos_i)
    parameters = _checked(rho_d, rho_s, alpha_x, alpha_y)
    columns = (np.cos(angles.phi_r), np.sin(angles.phi_r))
    return finished(by_rows(_angle_rows, columns, (*light, angles.sin_r, angles.cos_r, *parameters)), angles)


def ward_vectors(
    wi: ArrayLike, wr: ArrayLike, *, rho_d: ArrayLike, rho_s: ArrayLike, alpha_x: ArrayLike, alpha_y: ArrayLike
) -> Floats:
    """`ward` for unit vectors `wi` of the light and `wr` of the viewer, each of shape (..., 3)."""
    return by_rows_of_vectors(_vector_rows, checked_vectors(wi, wr), _checked(rho_d, rho_s, alpha_x, alpha_y))


def _checked(rho_d: ArrayLike, rho_s: ArrayLike, alpha_x: ArrayLike, alpha_y: ArrayLike) -> tuple[Floats, ...]:
    return RHO_D.check(rho_d), RHO_S.check(rho_s), ALPHA_X.check(alpha_x), ALPHA_Y.check(alpha_y)


SPEC = ModelSpec(
    name="ward",
    version=1,
    title="Ward, elliptical Gaussian",
    equation="eq. 5a",
    reference="ward1992",
    parameters=(RHO_D, RHO_S, ALPHA_X, ALPHA_Y),
    evaluate=ward,
    vectors=ward_vectors,
    grazing_pole=True,
    lobe_axes=("alpha_x", "alpha_y"),
)
