"""Oren and Nayar 1994, eq. 32: their functional fit for the body plus Torrance and Sparrow's lobe for the surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from brdfdb.geometry import Directions, checked_angles, checked_vectors, finished
from brdfdb.lobes import Lobe
from brdfdb.models import torrance_sparrow_1967
from brdfdb.models.large_calls import for_large_calls
from brdfdb.models.oren_nayar_1994 import INTERREFLECTION, oren_nayar, oren_nayar_vectors
from brdfdb.models.torrance_sparrow_1967 import torrance_sparrow, torrance_sparrow_vectors
from brdfdb.parameters import Floats, Parameter

K_B = Parameter("k_b", "k_b", "1", 0.0, 1.0, "weight of the body's reflection", default=1.0, reflectance=True)
K_S = Parameter("k_s", "k_s", "1", 0.0, 1.0, "weight of the surface's reflection, eq. 31 as printed", reflectance=True)
E_0 = Parameter(
    "e_0", "E_0", "1", 1.0, 10.0, "irradiance of a facet facing the light, in the unit of eq. 31", default=1.0
)
WITH_INTERREFLECTION = replace(INTERREFLECTION, default=False)


@for_large_calls
def oren_nayar_body_surface(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    rho: ArrayLike,
    sigma: ArrayLike,
    k_s: ArrayLike,
    k_b: ArrayLike = 1.0,
    e_0: ArrayLike = 1.0,
    interreflection: ArrayLike = False,
    n: ArrayLike | None = None,
    k: ArrayLike | None = None,
) -> Floats:
    """Return the BRDF [1/sr] of a rough body with a glossy surface: k_b `oren_nayar` + k_s / e_0 `torrance_sparrow`.

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi].
    rho : array_like [1]
        Albedo of a facet of the body, in [0, 1].
    sigma : array_like [rad]
        Standard deviation of the slope angle, in [0, pi/2]. Body and surface have the same facets.
    k_b, k_s : array_like [1]
        Weights of body and surface, each in [0, 1]. The paper prints k_s / k_b: 0.019 foam, 0.085 cotton towel, 0.043
        wood shavings.
    e_0 : array_like [1]
        Irradiance E_0 of a facet that faces the light, in the unit of the radiance of eq. 31, in [1, 10].
    interreflection : bool
        True to add the second bounce of the body (eq. 28), which section 5 of the paper leaves out.
    n, k : array_like [1], optional
        Refractive index n + ik of the surface, n in [1e-3, 100] and k in [0, 1e4]. Without n the Fresnel coefficient is
        1, as in the paper.

    Returns
    -------
    array [1/sr]
        In the broadcast shape of all arguments; 0 below the horizon, nan where an angle is nan.

    Raises
    ------
    ParameterError
        If an argument is outside its range, or k is given without n.

    Notes
    -----
    Eq. (32) with eqs (27) and (31), divided by E_0 cos(theta_i). Weights are fitted, not derived: the sum may reflect
    more than it receives (see `torrance_sparrow`).

    Departures from the paper: eq. 27 has the factor E_0, but eq. 31 as printed does not. The printed k_s / k_b
    therefore carries the unit of a radiance over an irradiance, which the paper does not state. With e_0 = 1 eq. 31
    stands as printed. With e_0 = pi radiances are relative to that of a white Lambertian facet that faces the light.

    References
    ----------
    orennayar1994, torrancesparrow1967

    Examples
    --------
    >>> round(float(oren_nayar_body_surface(0.3, 0.0, 0.4, np.pi, rho=0.8, sigma=0.35, k_s=0.019)), 4)
    0.2338
    """
    directions = checked_angles(theta_i, phi_i, theta_r, phi_r)
    angles = directions.given
    body = oren_nayar(*angles, rho=rho, sigma=sigma, interreflection=interreflection)
    return _sum(body, torrance_sparrow(*angles, sigma=sigma, n=n, k=k), k_b, k_s, e_0, directions)


@for_large_calls
def oren_nayar_body_surface_vectors(
    wi: ArrayLike,
    wr: ArrayLike,
    *,
    rho: ArrayLike,
    sigma: ArrayLike,
    k_s: ArrayLike,
    k_b: ArrayLike = 1.0,
    e_0: ArrayLike = 1.0,
    interreflection: ArrayLike = False,
    n: ArrayLike | None = None,
    k: ArrayLike | None = None,
) -> Floats:
    """Return `oren_nayar_body_surface` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
    directions = checked_vectors(wi, wr)
    w_i, w_r = directions.w_i.astype(np.float64), directions.w_r.astype(np.float64)
    body = oren_nayar_vectors(w_i, w_r, rho=rho, sigma=sigma, interreflection=interreflection)
    return _sum(body, torrance_sparrow_vectors(w_i, w_r, sigma=sigma, n=n, k=k), k_b, k_s, e_0, directions)


def _sum(
    body: Floats, surface: Floats, k_b: ArrayLike, k_s: ArrayLike, e_0: ArrayLike, directions: Directions
) -> Floats:
    # Eq. (32), computed in float64
    return finished(K_B.check(k_b) * body + K_S.check(k_s) / E_0.check(e_0) * surface, directions)


def lobe(
    cos_i: Floats,
    *,
    rho: ArrayLike,
    sigma: ArrayLike,
    k_s: ArrayLike,
    k_b: ArrayLike = 1.0,
    e_0: ArrayLike = 1.0,
    **_: ArrayLike,
) -> Lobe:
    """Return the lobe of the surface. Its share follows from the albedos, and its width from sigma."""
    whole = torrance_sparrow_1967.lobe(cos_i, sigma=sigma)
    surface = np.asarray(k_s) / np.asarray(e_0) * 4.0 * np.pi * whole.alpha_x**2  # albedo of a narrow lobe for F = 1
    body = np.asarray(k_b) * np.asarray(rho)
    total = surface + body
    return whole._replace(share=np.divide(surface, total, where=total > 0.0, out=np.zeros(np.shape(total))))
