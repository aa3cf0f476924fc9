"""Fujii 2013: the qualitative Oren-Nayar model without its dark ring, normalised by a mixing ratio."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brdfdb._elementary import cosine
from brdfdb._numba import elementwise, kernel, loop
from brdfdb.geometry import Directions, Vectors, finished
from brdfdb.models._rows import Out, by_rows_of_vectors
from brdfdb.models.declaration import DeclaredModel
from brdfdb.parameters import Floats, Parameter, SurfaceRelation, white

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


@DeclaredModel(
    title="Oren-Nayar, Fujii's form",
    equation="proposed formula",
    references="fujii2013",
    parameters=(RHO, SIGMA),
    degree=1,
    grazing_pole=True,
    grazing_power=0.0,
    lossless=white,
    surfaces=(SurfaceRelation(facets="diffuse", bounces="one", parameters=("sigma",)),),
)
def oren_nayar_fujii(directions: Directions, out: Out, rho: Floats, sigma: Floats) -> Floats:
    """Return the BRDF [1/sr] of Fujii's form of the qualitative Oren-Nayar model, rho (A + B s / t).

    sigma is the mixing ratio B / A, which is not the deviation of a slope. The normalisation is the one that the
    article proposes, A = 1 / (pi + (pi/2 - 2/3) sigma). With it the directional albedo is rho at grazing and less
    elsewhere. s is sin(theta_i) sin(theta_r) cos(phi_r - phi_i), and t is the larger cosine where s is positive and 1
    elsewhere. Unlike eq. 30 of Oren and Nayar, the model stays rough in the mirror half plane. f_r grows as 1 / cos
    towards exact backscatter at grazing. At 90 degrees it is the finite value at the float64 nearest pi/2.

    >>> round(float(oren_nayar_fujii(0.3, 0.0, 0.4, 0.0, rho=0.9, sigma=0.5)), 4)
    0.2655
    """
    if isinstance(directions, Vectors):
        return by_rows_of_vectors(_vector_rows, directions, (rho, sigma), out)
    s = directions.sin_i * directions.sin_r * directions.cos_dphi
    return finished(_evaluate(directions.cos_i, directions.cos_r, s, rho, sigma), directions)
