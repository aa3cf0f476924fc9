"""Lambert 1760: the ideal diffuser."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brdfdb._numba import loop
from brdfdb.geometry import Directions, Vectors, finished
from brdfdb.models._rows import Out, by_rows_of_vectors
from brdfdb.models.declaration import DeclaredModel
from brdfdb.parameters import Floats, Parameter, SurfaceRelation, white

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


@DeclaredModel(
    title="Lambert",
    equation="rho / pi",
    references="lambert1760",
    parameters=(RHO,),
    degree=1,
    grazing_power=0.0,
    lossless=white,
    highest_rung="the definition of an ideal diffuser",
    surfaces=(SurfaceRelation(facets="diffuse", bounces="all", by_rho=True),),
)
def lambert(directions: Directions, out: Out, rho: Floats) -> Floats:
    """Return the BRDF [1/sr] of an ideal diffuser, rho / pi, the same in every direction.

    >>> round(float(lambert(0.3, 0.0, 0.4, 0.0, rho=1.0)), 6)
    0.31831
    """
    if isinstance(directions, Vectors):
        return by_rows_of_vectors(_vector_rows, directions, (rho,), out)
    return finished(rho / np.pi, directions)
