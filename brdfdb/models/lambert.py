"""Lambert 1760: the ideal diffuser."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb._numba import loop
from brdfdb.geometry import checked_angles, checked_vectors, finished
from brdfdb.models._rows import by_rows_of_vectors
from brdfdb.models.large_calls import for_large_calls
from brdfdb.parameters import Floats, ModelSpec, Parameter, white

RHO = Parameter("rho", "ρ", "1", 0.0, 1.0, "albedo", reflectance=True)


@loop
def _vector_rows(w_i: Floats, w_r: Floats, scalars: NDArray[np.float64], f_r: Floats) -> None:
    for row in range(f_r.shape[0]):
        f, value = f_r[row], scalars[row, 0] / np.pi
        i, r = w_i[min(row, w_i.shape[0] - 1)].reshape(-1), w_r[min(row, w_r.shape[0] - 1)].reshape(-1)
        for j in range(f.shape[0]):
            x, y, z = 3 * j, 3 * j + 1, 3 * j + 2
            nothing = 0.0 * (i[x] + i[y] + i[z] + r[x] + r[y] + r[z])  # 0, or nan
            f[j] = nothing + (value if i[z] >= 0.0 and r[z] >= 0.0 else 0.0)


@for_large_calls
def lambert(theta_i: ArrayLike, phi_i: ArrayLike, theta_r: ArrayLike, phi_r: ArrayLike, *, rho: ArrayLike) -> Floats:
    """Return the BRDF [1/sr] of an ideal diffuser, the same in every direction.

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
    ParameterError
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


@for_large_calls
def lambert_vectors(wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike) -> Floats:
    """Return `lambert` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
    return by_rows_of_vectors(_vector_rows, checked_vectors(wi, wr), (RHO.check(rho),))


SPEC = ModelSpec(
    name="lambert",
    highest_rung="the definition of an ideal diffuser",
    version=1,
    title="Lambert",
    equation="rho / pi",
    reference="lambert1760",
    parameters=(RHO,),
    evaluate=lambert,
    vectors=lambert_vectors,
    grazing_power=0.0,
    degree=1,
    lossless=white,
)
