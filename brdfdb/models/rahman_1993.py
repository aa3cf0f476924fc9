"""Rahman, Pinty and Verstraete 1993: the RPV model of land surfaces, seen from satellites."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from brdfdb._elementary import cosine, exp, log
from brdfdb._numba import kernel, loop
from brdfdb.geometry import Directions
from brdfdb.models._rows import Out, RowLoops
from brdfdb.models.declaration import DeclaredModel
from brdfdb.parameters import Floats, Parameter

RHO_0 = Parameter("rho_0", "ρ_0", "1", 0.0, 1.0, "level of the reflectance", reflectance=True)
K = Parameter("k", "k", "1", 0.0, 2.0, "1 is flat; below 1 f_r rises towards the horizon, above 1 it falls")
ASYMMETRY = Parameter(
    "asymmetry", "Θ", "1", -0.99, 0.99, "asymmetry of Henyey and Greenstein's function; below 0 light goes back"
)
RHO_C = Parameter("rho_c", "ρ_c", "1", 0.0, 1.0, "hot spot: 1 is none; the paper takes rho_0", reflectance=True)

Rows = NDArray[np.float64]

_LARGEST = 1e38  # largest f_r [1/sr] at the pole: float32 holds it, and only two directions at grazing reach it


@kernel
def _constants(rho_0: float, k: float, asymmetry: float, rho_c: float) -> tuple[float, float, float, float, float]:
    """Return the factor of all terms, k - 1, (1 - abs(asymmetry))^2, the asymmetry, and 2 - rho_c."""
    size = abs(asymmetry)
    return rho_0 / np.pi * (1.0 - size) * (1.0 + size), k - 1.0, (1.0 - size) ** 2, asymmetry, 2.0 - rho_c


@kernel
def _f_r(
    i: tuple[float, float, float],
    r: tuple[float, float, float],
    constants: tuple[float, float, float, float, float],
) -> float:
    """Return f_r [1/sr] for two unit vectors."""
    scale, power, least, asymmetry, hot = constants
    d_x, d_y, d_z = i[0] - r[0], i[1] - r[1], i[2] - r[2]
    s_x, s_y, s_z = i[0] + r[0], i[1] + r[1], i[2] + r[2]
    # F: 1 + Theta^2 + 2 Theta cos(g), where 2 cos(g) is s.s - 2 or 2 - d.d. Neither sum cancels
    square = d_x * d_x + d_y * d_y + d_z * d_z if asymmetry < 0.0 else s_x * s_x + s_y * s_y + s_z * s_z
    q = least + abs(asymmetry) * square
    # G: the distance of tan(theta) (cos(phi), sin(phi)) of light and viewer is N / (cos_i cos_r). The products of the
    # cross product d x s keep their digits at the hot spot, and change nothing but their sign if i and r are exchanged
    n_x, n_y = d_x * s_z - d_z * s_x, d_y * s_z - d_z * s_y
    N, product = 0.5 * math.sqrt(n_x * n_x + n_y * n_y), i[2] * r[2]
    # M: (cos_i cos_r (cos_i + cos_r))^(k - 1)
    M = exp(power * log(product * s_z))
    # R: 1 + (1 - rho_c) / (1 + G)
    value = scale * M * (product * hot + N) / ((product + N) * (q * math.sqrt(q)))
    return _LARGEST if value > _LARGEST else value


@loop
def _angle_rows(cos_phi: Rows, sin_phi: Rows, scalars: Rows, f_r: Rows) -> None:
    for row in range(f_r.shape[0]):
        s, f = scalars[:, row], f_r[row]
        i, sin_r, cos_r = (s[0], s[1], s[2]), s[3], s[4]
        constants = _constants(s[5], s[6], s[7], s[8])
        c_phi, s_phi = cos_phi[min(row, cos_phi.shape[0] - 1)], sin_phi[min(row, sin_phi.shape[0] - 1)]
        for j in range(f.shape[0]):
            f[j] = _f_r(i, (sin_r * c_phi[j], sin_r * s_phi[j], cos_r), constants)


@loop
def _vector_rows(w_i: Floats, w_r: Floats, scalars: Rows, f_r: Floats) -> None:
    for row in range(f_r.shape[0]):
        s, f = scalars[row], f_r[row]
        constants = _constants(s[0], s[1], s[2], s[3])
        v, w = w_i[min(row, w_i.shape[0] - 1)].reshape(-1), w_r[min(row, w_r.shape[0] - 1)].reshape(-1)
        for j in range(f.shape[0]):
            x_i, y_i, z_i = np.float64(v[3 * j]), np.float64(v[3 * j + 1]), np.float64(v[3 * j + 2])
            x_r, y_r, z_r = np.float64(w[3 * j]), np.float64(w[3 * j + 1]), np.float64(w[3 * j + 2])
            value = _f_r((x_i, y_i, cosine(z_i)), (x_r, y_r, cosine(z_r)), constants)
            f[j] = value * (0.0 if z_i < 0.0 or z_r < 0.0 else 1.0)  # nan stays nan


_LOOPS = RowLoops(_angle_rows, _vector_rows)


@DeclaredModel(
    title="Rahman-Pinty-Verstraete (RPV)",
    equation="rho_0 M F H / pi",
    references="rahman1993, widlowski2006 (rho_c)",
    parameters=(RHO_0, K, ASYMMETRY, RHO_C),
    degree=2,
    grazing_pole=True,
    grazing_power=lambda given: max(1.0 - given["k"], 0.0) if np.any(given["rho_0"]) else 0.0,
    # With asymmetry 0 and rho_c 1 the albedo for k = 0 is 2 rho_0 ln(1 + 1 / cos) / cos: 1089 rho_0 at 89.5 degrees
    excess="Rahman, Pinty and Verstraete 1993: a fit to measured reflectances, not normalised, so rho_0 is no albedo. "
    "For k below 1 it has a pole at grazing: for rho_0 = 1, k = 0.8, asymmetry = 0 and rho_c = 1 the albedo is 1.01 at "
    "normal incidence, 1.25 at 60 degrees and 3.21 at 89.5. The hot spot and the phase function change it further",
)
def rpv(directions: Directions, out: Out, *parameters: Floats) -> Floats:
    """Return the BRDF [1/sr] of the RPV model: a bowl or a bell, a phase function, and a hot spot.

    f_r = rho_0 / pi M F H with Minnaert's M = (cos_i cos_r (cos_i + cos_r))^(k - 1), F = (1 - Theta^2) /
    (1 + Theta^2 + 2 Theta cos g)^1.5 for the angle g between light and viewer, and H = 1 + (1 - rho_c) / (1 + G), where
    G^2 = tan_i^2 + tan_r^2 - 2 tan_i tan_r cos(delta_phi). The paper and most programs give the reflectance factor,
    which is pi f_r. For k below 1, f_r rises towards the horizon, a bowl, without bound; for k above 1 it falls, a
    bell. It stops at 1e38, and at 90 degrees it is the value at the float64 nearest pi/2.

    rho_0 is no albedo. For an asymmetry below 0, more light goes back towards its source. The paper has rho_0 in the
    place of rho_c, and so have fits with three parameters; fits with four have a number of its own. With rho_c = 1
    there is no hot spot; 0 doubles f_r towards the light.

    >>> round(float(rpv(0.5, 0.0, 0.5, 0.0, rho_0=0.06, k=0.7, asymmetry=-0.2, rho_c=0.06)), 5)
    0.06347
    """
    return _LOOPS.evaluated(directions, out, parameters)
