"""Lucht, Schaaf and Strahler 2000: the Ross-Li kernels of the MODIS albedo product."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from brdfdb._elementary import arcsin, cosine
from brdfdb._numba import kernel, loop
from brdfdb.geometry import Directions
from brdfdb.models._rows import Out, RowLoops
from brdfdb.models.declaration import DeclaredModel
from brdfdb.parameters import Floats, Parameter, grows_with

F_ISO = Parameter("f_iso", "f_iso", "1", 0.0, 1.0, "weight of the uniform kernel", reflectance=True)
F_VOL = Parameter("f_vol", "f_vol", "1", 0.0, 1.0, "weight of the Ross-Thick kernel, leaves", reflectance=True)
F_GEO = Parameter("f_geo", "f_geo", "1", 0.0, 0.5, "weight of the Li-Sparse kernel, shadows", reflectance=True)

Rows = NDArray[np.float64]

_HALF_PI, _QUARTER_PI = 0.5 * np.pi, 0.25 * np.pi
_HEIGHT = 2.0  # h / b, the height of the crowns' centres over their half axis


@kernel
def _f_r(i: tuple[float, float, float], r: tuple[float, float, float], f: tuple[float, float, float]) -> float:
    """Return f_r [1/sr] for two unit vectors and the weights of the uniform, the Ross and the Li kernel."""
    # The sine and cosine of half the phase angle xi keep their digits at the hot spot and opposite to it
    c2 = 0.25 * ((i[0] - r[0]) ** 2 + (i[1] - r[1]) ** 2 + (i[2] - r[2]) ** 2)
    s2 = 0.25 * ((i[0] + r[0]) ** 2 + (i[1] + r[1]) ** 2 + (i[2] + r[2]) ** 2)
    c, s, above = math.sqrt(c2), math.sqrt(s2), i[2] + r[2]
    inverse = 1.0 / (above * i[2] * r[2])
    # Ross: (pi/2 - xi) cos(xi) + sin(xi), where the first product is never negative
    sin_xi, cos_xi = 2.0 * s * c, (s - c) * (s + c)
    phase = (_HALF_PI - 2.0 * arcsin(c if c < s else s)) * abs(cos_xi) + sin_xi
    k_vol = phase * (inverse * i[2] * r[2]) - _QUARTER_PI
    # Li: cos(t) = h/b sqrt(D^2 + (tan tan sin(delta_phi))^2) / (sec + sec), whose root is sin(xi) / (cos cos)
    cos_t = _HEIGHT * sin_xi * (inverse * i[2] * r[2])
    cos_t = 1.0 if cos_t > 1.0 else cos_t
    sin_t = math.sqrt((1.0 - cos_t) * (1.0 + cos_t))
    least = arcsin(cos_t if cos_t < sin_t else sin_t)
    t = _HALF_PI - least if cos_t < sin_t else least
    # O - sec - sec + (1 + cos(xi)) sec sec / 2
    lit = 1.0 - (t - sin_t * cos_t) / np.pi
    k_geo = (s2 - above * lit) * (inverse * above)
    value = (f[0] + f[1] * k_vol + f[2] * k_geo) / np.pi
    return 0.0 if value < 0.0 else value


@loop
def _angle_rows(cos_phi: Rows, sin_phi: Rows, scalars: Rows, f_r: Rows) -> None:
    for row in range(f_r.shape[0]):
        s, values = scalars[:, row], f_r[row]
        i, sin_r, cos_r, f = (s[0], s[1], s[2]), s[3], s[4], (s[5], s[6], s[7])
        c_phi, s_phi = cos_phi[min(row, cos_phi.shape[0] - 1)], sin_phi[min(row, sin_phi.shape[0] - 1)]
        for j in range(values.shape[0]):
            values[j] = _f_r(i, (sin_r * c_phi[j], sin_r * s_phi[j], cos_r), f)


@loop
def _vector_rows(w_i: Floats, w_r: Floats, scalars: Rows, f_r: Floats) -> None:
    for row in range(f_r.shape[0]):
        s, values = scalars[row], f_r[row]
        f = s[0], s[1], s[2]
        v, w = w_i[min(row, w_i.shape[0] - 1)].reshape(-1), w_r[min(row, w_r.shape[0] - 1)].reshape(-1)
        for j in range(values.shape[0]):
            x_i, y_i, z_i = np.float64(v[3 * j]), np.float64(v[3 * j + 1]), np.float64(v[3 * j + 2])
            x_r, y_r, z_r = np.float64(w[3 * j]), np.float64(w[3 * j + 1]), np.float64(w[3 * j + 2])
            value = _f_r((x_i, y_i, cosine(z_i)), (x_r, y_r, cosine(z_r)), f)
            values[j] = value * (0.0 if z_i < 0.0 or z_r < 0.0 else 1.0)  # nan stays nan


_LOOPS = RowLoops(_angle_rows, _vector_rows)


@DeclaredModel(
    title="Ross-Thick, Li-Sparse-Reciprocal (MODIS)",
    equation="(f_iso + f_vol K_vol + f_geo K_geo) / pi",
    references="lucht2000, wanner1995",
    parameters=(F_ISO, F_VOL, F_GEO),
    grazing_pole=True,
    grazing_power=grows_with("f_geo", 1.0),
    excess="Lucht, Schaaf and Strahler 2000: kernels fitted to measured reflectances, not normalised, so f_iso is no "
    "albedo. The weights of measured land reflect less than 1. The Ross kernel adds up to 1.47 f_vol to the albedo at "
    "89.5 degrees, and the Li kernel grows as 1 / cos(theta_i): with f_iso = 1, f_vol = 0 and f_geo = 0.5 the albedo "
    "is 1.88 at 85 degrees and 19.5 at 89.5",
)
def ross_li(directions: Directions, out: Out, *parameters: Floats) -> Floats:
    """Return the BRDF [1/sr] of the Ross-Thick and Li-Sparse-Reciprocal kernels, the model of the MODIS product.

    f_r = (f_iso + f_vol K_vol + f_geo K_geo) / pi, with h/b = 2 and b/r = 1 in K_geo, as the product has them. The
    MODIS product MCD43A1 gives the three weights for each band. K_vol stands for a dense layer of leaves, K_geo for
    crowns and their shadows. The papers and the product give the reflectance factor, which is pi f_r. Both kernels are
    0 where light and viewer are at the normal, and both become negative. The papers let the sum be negative, too. Here
    it is held at 0, which happens where one direction is close to the horizon. The product's polynomials of the albedo
    are integrals of kernels that are not held. K_geo has a pole at grazing. The kernels have no narrower hot spot
    (Maignan 2004).

    >>> round(float(ross_li(0.5, 0.0, 0.3, 0.0, f_iso=0.2097, f_vol=0.0814, f_geo=0.0041)), 5)
    0.06792
    """
    return _LOOPS.evaluated(directions, out, parameters)
