"""Minnaert 1941: the lunar-photometry reflectance, as Oren and Nayar (1994, section 1) print it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from brdfdb._numba import elementwise, kernel
from brdfdb.geometry import Directions, checked_angles, checked_vectors, finished
from brdfdb.models.large_calls import for_large_calls
from brdfdb.parameters import Floats, ModelSpec, Parameter, white

K = Parameter("k", "k", "1", 0.0, 1.0, "limb darkening exponent; 1 is Lambert")
RHO = Parameter("rho", "ρ", "1", 0.0, 1.0, "scale; the albedo at k = 1", default=1.0, reflectance=True)


@kernel
def _minnaert(cos_i: float, cos_r: float, k: float, rho: float) -> float:
    return rho * (k + 1.0) / (2.0 * np.pi) * math.pow(cos_i * cos_r, k - 1.0)


_evaluate = elementwise(_minnaert)


@for_large_calls
def minnaert(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    k: ArrayLike,
    rho: ArrayLike = 1.0,
) -> Floats:
    """Return the BRDF [1/sr] of Minnaert's law, rho (k + 1) / (2 pi) (cos theta_i cos theta_r)^(k - 1).

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi].
    k : array_like [1]
        Exponent, in [0, 1].
    rho : array_like [1]
        Scale, in [0, 1].

    Returns
    -------
    array [1/sr]
        In the broadcast shape of all arguments; 0 below the horizon, nan where an angle is nan. For k < 1 the law
        grows without bound towards grazing; at 90 degrees it is the finite value at the float64 nearest pi/2.

    Raises
    ------
    ParameterError
        If an argument is outside its range.

    Notes
    -----
    The directional albedo is rho at k = 1 and rho cos(theta_i)^(k - 1) in general, which exceeds 1 near grazing.

    References
    ----------
    minnaert1941, orennayar1994 (section 1)

    Examples
    --------
    >>> round(float(minnaert(0.3, 0.0, 0.4, 0.0, k=1.0)), 6)
    0.31831
    """
    return _f_r(checked_angles(theta_i, phi_i, theta_r, phi_r), k, rho)


@for_large_calls
def minnaert_vectors(wi: ArrayLike, wr: ArrayLike, *, k: ArrayLike, rho: ArrayLike = 1.0) -> Floats:
    """Return `minnaert` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
    return _f_r(checked_vectors(wi, wr), k, rho)


def _f_r(directions: Directions, k: ArrayLike, rho: ArrayLike) -> Floats:
    return finished(_evaluate(directions.cos_i, directions.cos_r, K.check(k), RHO.check(rho)), directions)


# The albedo for k = 0 and rho = 1 at 89.5 degrees is 1 / cos, 114.6
_EXCESS = (
    "Oren and Nayar 1994, section 1: as printed, Minnaert's law reflects 1 at normal incidence and, for k "
    "below 1, more the further the light is from it, cos(theta_i)^(k - 1), without bound"
)

SPEC = ModelSpec(
    name="minnaert",
    version=1,
    title="Minnaert",
    equation="Oren and Nayar 1994, section 1",
    reference="minnaert1941",
    parameters=(K, RHO),
    evaluate=minnaert,
    vectors=minnaert_vectors,
    degree=1,
    grazing_pole=True,
    grazing_power=lambda arguments: 1.0 - arguments["k"] if np.any(arguments["rho"]) else 0.0,
    excess=_EXCESS,
    lossless=white,
)
