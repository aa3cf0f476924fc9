"""A model of somebody else's package: Rahman, Pinty and Verstraete 1993, J. Geophys. Res. 98(D11), 20791."""

import numpy as np
from numpy.typing import ArrayLike

from brdfdb.geometry import Directions, checked_angles, checked_vectors, finished
from brdfdb.parameters import Floats, ModelSpec, Parameter

RHO_0 = Parameter("rho_0", "ρ_0", "1", 0.0, 1.0, "level of the reflectance")
K = Parameter("k", "k", "1", 0.0, 2.0, "1 is flat, below 1 a bowl, above 1 a bell")
ASYMMETRY = Parameter("Theta", "Θ", "1", -0.95, 0.95, "asymmetry of Henyey and Greenstein; below 0 scatters back")
RHO_C = Parameter("rho_c", "ρ_c", "1", 0.0, 1.0, "of the hot spot, which is absent at 1", default=1.0)


def f_r(w: Directions, rho_0: ArrayLike, k: ArrayLike, Theta: ArrayLike, rho_c: ArrayLike) -> Floats:
    """Return BRF / pi [1/sr]; g is the angle between light and viewer."""
    T, k_1 = ASYMMETRY.check(Theta), K.check(k) - 1.0
    cos_g = w.cos_i * w.cos_r + w.sin_i * w.sin_r * w.cos_dphi
    F = (1.0 - T**2) / (1.0 + T**2 + 2.0 * T * cos_g) ** 1.5
    tan_i, tan_r = w.sin_i / w.cos_i, w.sin_r / w.cos_r
    cos = w.cos_dphi
    less = w.sin_dphi**2 / (1.0 + np.abs(cos)) + np.abs(cos) - cos  # 1 - cos, with its digits at the hot spot
    G = np.sqrt((tan_i - tan_r) ** 2 + 2.0 * tan_i * tan_r * less)
    M = (w.cos_i * w.cos_r * (w.cos_i + w.cos_r)) ** k_1
    return finished(RHO_0.check(rho_0) / np.pi * M * F * (1.0 + (1.0 - RHO_C.check(rho_c)) / (1.0 + G)), w)


def rpv(
    theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *,
    rho_0: ArrayLike, k: ArrayLike, Theta: ArrayLike, rho_c: ArrayLike = 1.0,
) -> Floats:  # fmt: skip
    """Return f_r [1/sr] at angles [rad]."""
    return f_r(checked_angles(theta_i, phi_i, theta_r, phi_r), rho_0, k, Theta, rho_c)


def rpv_vectors(
    wi: ArrayLike, wr: ArrayLike, *, rho_0: ArrayLike, k: ArrayLike, Theta: ArrayLike, rho_c: ArrayLike = 1.0
) -> Floats:
    """Return f_r [1/sr] at unit vectors (..., 3)."""
    return f_r(checked_vectors(wi, wr), rho_0, k, Theta, rho_c)


SPEC = ModelSpec(
    name="rpv",
    version=1,
    title="Rahman-Pinty-Verstraete",
    equation="eqs 2-5",
    reference="rahman1993",
    parameters=(RHO_0, K, ASYMMETRY, RHO_C),
    evaluate=rpv,
    vectors=rpv_vectors,
    grazing_pole=True,
    excess="Rahman et al. 1993: a fit to measured reflectances, not normalised; for k below 1 it has a pole at grazing",
)
