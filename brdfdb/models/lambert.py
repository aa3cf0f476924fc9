"""Lambert 1760: the ideal diffuser."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from brdfdb.geometry import checked_angles, checked_vectors, finished
from brdfdb.parameters import Floats, ModelSpec, Parameter, white

RHO = Parameter("rho", "ρ", "1", 0.0, 1.0, "albedo")


def lambert(theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, rho: ArrayLike) -> Floats:
    """BRDF of an ideal diffuser, the same in every direction.

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi].
    rho : array_like [1]
        Albedo, in [0, 1].

    Returns
    -------
    array [1/sr]
        rho / pi, in the broadcast shape of all arguments; 0 below the horizon, nan where an angle is nan.

    Raises
    ------
    ValueError
        If an argument is outside its range.

    References
    ----------
    lambert1760

    Examples
    --------
    >>> round(float(lambert(0.3, 0.0, 0.4, 0.0, rho=1.0)), 6)
    0.31831
    """
    angles = checked_angles(theta_i, phi_i, theta_r, phi_r)
    return finished(RHO.check(rho) / np.pi, angles)


def lambert_vectors(wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike) -> Floats:
    """`lambert` for unit vectors `wi` of the light and `wr` of the viewer, each of shape (..., 3)."""
    return finished(RHO.check(rho) / np.pi, checked_vectors(wi, wr))


SPEC = ModelSpec(
    name="lambert",
    version=1,
    title="Lambert",
    equation="rho / pi",
    reference="lambert1760",
    parameters=(RHO,),
    evaluate=lambert,
    vectors=lambert_vectors,
    lossless=white,
)
