"""Fujii 2013: the qualitative Oren-Nayar model without its dark ring, normalised by a mixing ratio."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb._elementary import cosine
from brdfdb._numba import elementwise, kernel, loop
from brdfdb.geometry import checked_angles, checked_vectors, finished
from brdfdb.models._rows import by_rows_of_vectors
from brdfdb.models.large_calls import for_large_calls
from brdfdb.parameters import Floats, ModelSpec, Parameter, white

RHO = Parameter("rho", "ρ", "1", 0.0, 1.0, "albedo of the unnormalised lobe", reflectance=True)
SIGMA = Parameter("sigma", "σ'", "1", 0.0, 1.0, "ratio of the non-diffuse to the diffuse term; 0 is Lambert")


@kernel
def _fujii(cos_i: float, cos_r: float, s: float, rho: float, sigma: float) -> float:
    """Return f_r [1/sr] for s = <l,v> - <n,l> <n,v>."""
    t = max(cos_i, cos_r) if s > 0.0 else 1.0
    A = 1.0 / (np.pi + (np.pi / 2.0 - 2.0 / 3.0) * sigma)
    B = sigma * A
    f_r = rho * (A + B * s / t)
    return 0.0 if f_r < 0.0 else f_r  # rounding falls below 0 at sigma = 1 and grazing


_evaluate = elementwise(_fujii)


@loop
def _vector_rows(w_i: Floats, w_r: Floats, scalars: NDArray[np.float64], f_r: Floats) -> None:
    for row in range(f_r.shape[0]):
        f, rho, sigma = f_r[row], scalars[row, 0], scalars[row, 1]
        i, r = w_i[min(row, w_i.shape[0] - 1)].reshape(-1), w_r[min(row, w_r.shape[0] - 1)].reshape(-1)
        for j in range(f.shape[0]):
            z_i, z_r = np.float64(i[3 * j + 2]), np.float64(r[3 * j + 2])
            s = np.float64(i[3 * j]) * r[3 * j] + np.float64(i[3 * j + 1]) * r[3 * j + 1]
            value = _fujii(cosine(z_i), cosine(z_r), s, rho, sigma)
            f[j] = value if z_i >= 0.0 and z_r >= 0.0 else 0.0 * (z_i + z_r + s)  # 0, or nan


@for_large_calls
def oren_nayar_fujii(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    rho: ArrayLike,
    sigma: ArrayLike,
) -> Floats:
    """Return the BRDF [1/sr] of Fujii's form of the qualitative Oren-Nayar model, rho (A + B s / t).

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi].
    rho : array_like [1]
        Scale, in [0, 1].
    sigma : array_like [1]
        The mixing ratio B / A, in [0, 1], which is not the deviation of a slope. 0 is Lambert.

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
    The normalisation is the one that the article proposes, A = 1 / (pi + (pi/2 - 2/3) sigma). With it the directional
    albedo is rho at grazing and less elsewhere. s is sin(theta_i) sin(theta_r) cos(phi_r - phi_i), and t is the larger
    cosine where s is positive and 1 elsewhere. Unlike eq. 30 of Oren and Nayar, the model stays rough in the mirror
    half plane. f_r grows as 1 / cos towards exact backscatter at grazing. At 90 degrees it is the finite value at the
    float64 nearest pi/2.

    References
    ----------
    fujii2013

    Examples
    --------
    >>> round(float(oren_nayar_fujii(0.3, 0.0, 0.4, 0.0, rho=0.9, sigma=0.5)), 4)
    0.2655
    """
    angles = checked_angles(theta_i, phi_i, theta_r, phi_r)
    s = angles.sin_i * angles.sin_r * angles.cos_dphi
    return finished(_evaluate(angles.cos_i, angles.cos_r, s, RHO.check(rho), SIGMA.check(sigma)), angles)


@for_large_calls
def oren_nayar_fujii_vectors(wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike) -> Floats:
    """Return `oren_nayar_fujii` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
    parameters = RHO.check(rho), SIGMA.check(sigma)
    return by_rows_of_vectors(_vector_rows, checked_vectors(wi, wr), parameters)


SPEC = ModelSpec(
    name="oren_nayar_fujii",
    version=1,
    title="Oren-Nayar, Fujii's form",
    equation="proposed formula",
    reference="fujii2013",
    parameters=(RHO, SIGMA),
    evaluate=oren_nayar_fujii,
    vectors=oren_nayar_fujii_vectors,
    degree=1,
    grazing_pole=True,
    grazing_power=0.0,
    lossless=white,
)
