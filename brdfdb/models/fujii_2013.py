"""Fujii 2013: the qualitative Oren-Nayar model without its dark ring, normalised by a mixing ratio."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from brdfdb._numba import elementwise, kernel
from brdfdb.geometry import Directions, checked_angles, checked_vectors, finished
from brdfdb.parameters import Floats, ModelSpec, Parameter, white

RHO = Parameter("rho", "ρ", "1", 0.0, 1.0, "albedo of the unnormalised lobe")
SIGMA = Parameter("sigma", "σ'", "1", 0.0, 1.0, "ratio of the non-diffuse to the diffuse term; 0 is Lambert")


@kernel
def _fujii(cos_i: float, sin_i: float, cos_r: float, sin_r: float, cos_dphi: float, rho: float, sigma: float) -> float:
    # s = <l,v> - <n,l> <n,v>
    s = sin_i * sin_r * cos_dphi
    t = max(cos_i, cos_r) if s > 0.0 else 1.0
    A = 1.0 / (np.pi + (np.pi / 2.0 - 2.0 / 3.0) * sigma)
    B = sigma * A
    f_r = rho * (A + B * s / t)
    return 0.0 if f_r < 0.0 else f_r  # rounding, at sigma = 1 and grazing


_evaluate = elementwise(_fujii)


def oren_nayar_fujii(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    rho: ArrayLike,
    sigma: ArrayLike,
) -> Floats:
    """BRDF of Fujii's form of the qualitative Oren-Nayar model, rho (A + B s / t).

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi].
    rho : array_like [1]
        Scale, in [0, 1].
    sigma : array_like [1]
        B / A, in [0, 1]: a mixing ratio, not the deviation of a slope. 0 is Lambert.

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
    The article's proposed normalisation, A = 1 / (pi + (pi/2 - 2/3) sigma), under which light at grazing is reflected
    to the share rho, and all other light to less. s is sin(theta_i) sin(theta_r) cos(phi_r - phi_i), t the larger
    cosine where s is positive and 1 elsewhere: unlike eq. 30 of Oren and Nayar, the model stays rough in the mirror
    half plane. Towards exact backscatter at grazing it grows as 1 / cos; at 90 degrees it is the finite value at the
    float64 nearest pi/2.

    References
    ----------
    fujii2013

    Examples
    --------
    >>> round(float(oren_nayar_fujii(0.3, 0.0, 0.4, 0.0, rho=0.9, sigma=0.5)), 4)
    0.2655
    """
    return _f_r(checked_angles(theta_i, phi_i, theta_r, phi_r), rho, sigma)


def oren_nayar_fujii_vectors(wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike) -> Floats:
    """`oren_nayar_fujii` for unit vectors `wi` of the light and `wr` of the viewer, each of shape (..., 3)."""
    return _f_r(checked_vectors(wi, wr), rho, sigma)


def _f_r(directions: Directions, rho: ArrayLike, sigma: ArrayLike) -> Floats:
    pair = directions.cos_i, directions.sin_i, directions.cos_r, directions.sin_r, directions.cos_dphi
    return finished(_evaluate(*pair, RHO.check(rho), SIGMA.check(sigma)), directions)


SPEC = ModelSpec(
    name="oren_nayar_fujii",
    version=1,
    title="Oren-Nayar, Fujii's form",
    equation="proposed formula",
    reference="fujii2013",
    parameters=(RHO, SIGMA),
    evaluate=oren_nayar_fujii,
    vectors=oren_nayar_fujii_vectors,
    grazing_pole=True,
    lossless=white,
)
