"""Torrance and Sparrow 1967: reflection from mirror-like facets in V-cavities, in the form of Oren and Nayar 1994."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from brdfdb._elementary import arcsin, exp
from brdfdb._numba import elementwise, kernel
from brdfdb.errors import ParameterError
from brdfdb.fresnel import unpolarised
from brdfdb.geometry import Directions
from brdfdb.lobes import Lobe
from brdfdb.models.declaration import DeclaredModel
from brdfdb.parameters import Floats, K, N, Parameter, SurfaceRelation

SIGMA = Parameter("sigma", "σ", "rad", 0.0, np.pi / 2, "standard deviation of the facets' slope angle")

_TINY = 1e-300  # guard against 0 / 0 at sigma = 0


@kernel
def _half(
    cos_i: float, sin_i: float, cos_r: float, sin_r: float, one_plus_cos_dphi: float
) -> tuple[float, float, float]:
    """Return sine and cosine [1] of theta_a, the slope of the half vector, and the cosine of half the angle s to v."""
    h_z = cos_i + cos_r
    # sin_i - sin_r without a difference of numbers near 1
    sum_of_sines = sin_i + sin_r
    across = sin_i - sin_r if sum_of_sines < h_z else (cos_r - cos_i) * h_z / sum_of_sines
    h_xy = math.sqrt(across * across + 2.0 * sin_i * sin_r * one_plus_cos_dphi)
    length = math.sqrt(h_xy * h_xy + h_z * h_z)
    return h_xy / length, h_z / length, min(0.5 * length, 1.0)


@kernel
def _lobe(cos_i: float, sin_i: float, cos_r: float, sin_r: float, one_plus_cos_dphi: float, sigma: float) -> float:
    sin_a, cos_a, s_a = _half(cos_i, sin_i, cos_r, sin_r, one_plus_cos_dphi)
    small = arcsin(min(sin_a, cos_a))
    theta_a = small if sin_a < cos_a else np.pi / 2 - small
    x = 0.0 if theta_a == 0.0 else theta_a / max(sigma, _TINY)  # at sigma = 0 only the mirror direction reflects
    # Eq. (11), with the smaller of the two; <s,a> = <v,a>
    GAF = min(1.0, 2.0 * cos_i * cos_a / s_a, 2.0 * cos_r * cos_a / s_a)
    # Eq. (31), over cos(theta_i)
    return GAF / (cos_r * cos_a) * exp(-0.5 * x * x) / cos_i


@kernel
def _half_angle_cosine(cos_i: float, sin_i: float, cos_r: float, sin_r: float, one_plus_cos_dphi: float) -> float:
    return _half(cos_i, sin_i, cos_r, sin_r, one_plus_cos_dphi)[2]


_evaluate, _cosine = elementwise(_lobe), elementwise(_half_angle_cosine)


def lobe(cos_i: Floats, *, sigma: ArrayLike, **_: ArrayLike) -> Lobe:
    """Return the lobe of this model. Its width follows from sigma, and a fifth of the light lies in wider tails."""
    alpha = np.maximum(np.sqrt(2.0) * np.asarray(sigma, dtype=np.float64), 1e-6)
    return Lobe(np.full(np.broadcast_shapes(np.shape(cos_i), alpha.shape), 0.8), alpha, alpha)


@DeclaredModel(
    title="Torrance-Sparrow",
    equation="Oren and Nayar 1994, eq. 31",
    references="torrancesparrow1967, orennayar1994",
    parameters=(SIGMA,),
    optional=(N, K),
    grazing_pole=True,
    grazing_power=0.0,
    lobe=lobe,
    # The albedo was measured with F = 1 over sigma and theta_i. It reaches 20.14 at a sigma of 90 degrees and a theta_i
    # of 89.99. It exceeds 1 from a sigma of 12 degrees on, near normal incidence too
    excess="Oren and Nayar 1994, eq. 31: the lobe has the height 1 at any sigma and is not normalised; the factor "
    "k_s of eq. 32 is fitted",
    surfaces=(SurfaceRelation(facets="mirror", bounces="one", parameters=("sigma",), bounds=(0.05, 1.5), factor=True),),
)
def torrance_sparrow(directions: Directions, sigma: Floats, n: Floats | None, k: Floats | None) -> Floats:
    """Return the BRDF [1/sr] of mirror-like facets with Gaussian slopes, a lobe of height 1 that is not normalised.

    Without n the Fresnel coefficient is 1, as in section 5 of the paper. With n and without k the facets are
    dielectric, k = 0. Eq. (31) of Oren and Nayar 1994 with E_0 = 1, divided by cos(theta_i); theta_a is the slope of
    the half vector. The paper fits the factor k_s in front of it. The lobe by itself is not normalised: with F = 1 its
    albedo exceeds 1 for sigma above about 12 degrees. In the mirror direction f_r grows as 1 / cos^2 towards grazing.
    At 90 degrees it is the finite value at the float64 nearest pi/2.

    Departures from the paper: GAF = Min[1, Min[A, B]], not Max, as eq. 33 of the paper requires. The paper prints no
    E_0, so the unit of the lobe depends on its weight (see `oren_nayar_body_surface`).

    >>> round(float(torrance_sparrow(0.3, 0.0, 0.4, np.pi, sigma=0.3)), 4)
    1.1222
    >>> round(float(torrance_sparrow(0.3, 0.0, 0.4, np.pi, sigma=0.3, n=1.5)), 4)
    0.0452
    """
    return facets(directions, sigma, n, k)


def facets(directions: Directions, sigma: Floats, n: Floats | None, k: Floats | None) -> Floats:
    """Return f_r [1/sr] of `torrance_sparrow` at checked directions, with any value below the horizon."""
    pair = directions.cos_i, directions.sin_i, directions.cos_r, directions.sin_r, directions.one_plus_cos_dphi
    f_r: Floats = _evaluate(*pair, sigma)
    if n is not None:
        f_r = f_r * unpolarised(_cosine(*pair), n, np.zeros(()) if k is None else k)
    elif k is not None:
        raise ParameterError("k", f"{k} is given without n, the refractive index is n + ik")
    return f_r
