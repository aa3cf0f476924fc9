"""Hapke 1984: soils and planetary surfaces, with a hot spot and macroscopic roughness."""

from __future__ import annotations

import math
from collections.abc import Mapping
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb._elementary import arcsin, cosine, exp, log
from brdfdb._numba import kernel, loop
from brdfdb.geometry import Directions
from brdfdb.models._rows import Out, RowLoops
from brdfdb.models.declaration import DeclaredModel
from brdfdb.parameters import Floats, Parameter

W = Parameter("w", "w", "1", 0.0, 1.0, "albedo of a grain for single scattering", reflectance=True)
B = Parameter("b", "b", "1", 0.0, 0.95, "asymmetry of both lobes of a grain's phase function")
C = Parameter("c", "c", "1", 0.0, 1.0, "share of the lobe towards the light")
B_0 = Parameter("b_0", "B_0", "1", 0.0, 1.0, "height of the hot spot", default=0.0)
H = Parameter("h", "h", "1", 1e-3, 1.0, "width of the hot spot", default=1.0)
THETA_BAR = Parameter(
    "theta_bar", "θ̄", "rad", 0.0, float(np.pi / 3.0), "mean slope of the surface; 0 is smooth", default=0.0
)

Rows = NDArray[np.float64]
Three = tuple[float, float, float]

_FLAT = 700.0  # x from which on 1 - e**-x is 1 to the last bit
_TINY = 1e-300  # guard against 0 / 0 on a smooth surface and at the normal
_POLE = 1e-150  # length of a horizontal vector below which its square underflows: the azimuth is lost
_LEAST = 1e-150  # the same where the quotient is squared


@kernel
def _one_less_exp(x: float) -> float:
    """Return 1 - e**-x for x >= 0, with all its digits next to 0."""
    u = exp(-(_FLAT if x > _FLAT else x))
    # Kahan: the error of u in the numerator is that of its logarithm
    near = x if u == 1.0 else (1.0 - u) * x / -log(u)
    return 1.0 - u if x > 1.0 else near


@kernel
def _leaning(cos: float, sin: float, tan_slope: float) -> tuple[float, float]:
    """Return 1 - E_1 and 1 - E_2 [1] of a direction: what is missing from its share of slopes that lean away."""
    q = cos / (sin * tan_slope + _LEAST)
    return _one_less_exp(2.0 / np.pi * q), _one_less_exp(q * q / np.pi)


@kernel
def _unscattered(w: float, r_0: float, x: float) -> float:
    """Return 1 - 1 / H(x) [1], Hapke 2002."""
    return w * x * (r_0 + 0.5 * (1.0 - 2.0 * r_0 * x) * (log(1.0 + x) - log(x)))


@kernel
def _rough(near: Three, far: Three, tan_slope: float) -> tuple[float, float, float]:
    """Return the effective cosines of the direction nearer to the normal and of the other, over chi, and S over both.

    Each direction is its cosine and sine; the third numbers are the sine and cosine of half the azimuth between them.
    """
    (cos_n, sin_n, c_h), (cos_f, sin_f, s_h) = near, far
    m1_n, m2_n = _leaning(cos_n, sin_n, tan_slope)
    m1_f, m2_f = _leaning(cos_f, sin_f, tan_slope)
    half = arcsin(c_h if c_h < s_h else s_h)
    turned = 2.0 * half / np.pi if c_h < s_h else 1.0 - 2.0 * half / np.pi  # psi / pi, and the rest of it
    rest = 1.0 - 2.0 * half / np.pi if c_h < s_h else 2.0 * half / np.pi
    s2 = s_h * s_h
    # Eqs. (47), (48), (50), (51); of E_1 and E_2 what is missing to 1, so that nothing cancels at the horizon
    below = m1_f + turned * m1_n + rest
    mu_n = cos_n + sin_n * tan_slope * ((m2_f - m2_n) + s2 * (1.0 - 2.0 * m2_f + m2_n)) / below
    mu_f = cos_f + sin_f * tan_slope * ((m2_n - m2_f) + s2 * (1.0 - m2_n)) / below
    # The same for an azimuth of 0, of each direction alone
    eta_n = cos_n + sin_n * tan_slope * (1.0 - m2_n) / (1.0 + m1_n)
    eta_f = cos_f + sin_f * tan_slope * (1.0 - m2_f) / (1.0 + m1_f)
    # 1 - f: the share of shadows of light and viewer that do not lie on one another
    hidden = _one_less_exp(2.0 * c_h / (s_h + _TINY))
    return mu_n, mu_f, 1.0 / (eta_n * eta_f * (hidden + (1.0 - hidden) * cos_n / eta_n))


@kernel
def _f_r(i: Three, r: Three, sines: tuple[float, float], half: tuple[float, float], p: tuple[float, ...]) -> float:
    """Return f_r [1/sr] for two unit vectors, their sines, and sine and cosine of half the azimuth between them."""
    w, b, c, b_0, h, tan_slope = p
    d2 = (i[0] - r[0]) ** 2 + (i[1] - r[1]) ** 2 + (i[2] - r[2]) ** 2
    s2 = (i[0] + r[0]) ** 2 + (i[1] + r[1]) ** 2 + (i[2] + r[2]) ** 2
    # Two functions of Henyey and Greenstein; 2 cos(g) is s.s - 2 and 2 - d.d
    least = (1.0 - b) * (1.0 - b)
    forth, back = least + b * s2, least + b * d2
    grain = (1.0 - b) * (1.0 + b) * ((1.0 - c) / (forth * math.sqrt(forth)) + c / (back * math.sqrt(back)))
    # B_0 / (1 + tan(g / 2) / h)
    d, s = math.sqrt(d2), math.sqrt(s2)
    hot = b_0 * h * s / (h * s + d)
    light_nearer = i[2] >= r[2]
    near = i[2] if light_nearer else r[2], sines[0] if light_nearer else sines[1], half[0]
    far = r[2] if light_nearer else i[2], sines[1] if light_nearer else sines[0], half[1]
    mu_n, mu_f, shadow = _rough(near, far, tan_slope)
    chi = 1.0 / math.sqrt(1.0 + np.pi * tan_slope * tan_slope)
    gamma = math.sqrt(1.0 - w)
    r_0 = (1.0 - gamma) / (1.0 + gamma)
    y_n, y_f = _unscattered(w, r_0, chi * mu_n), _unscattered(w, r_0, chi * mu_f)
    # H(mu_0) H(mu) - 1, which is small at grazing
    multiple = (y_n + y_f - y_n * y_f) / ((1.0 - y_n) * (1.0 - y_f))
    return w / (4.0 * np.pi) * (mu_n * mu_f * shadow / (mu_n + mu_f)) * (grain * (1.0 + hot) + multiple)


@kernel
def _half_azimuth(c_i: float, s_i: float, c_r: float, s_r: float) -> tuple[float, float]:
    """Return the sine and cosine of half the azimuth between two horizontal unit vectors."""
    return 0.5 * math.sqrt((c_i - c_r) ** 2 + (s_i - s_r) ** 2), 0.5 * math.sqrt((c_i + c_r) ** 2 + (s_i + s_r) ** 2)


@loop
def _angle_rows(cos_phi: Rows, sin_phi: Rows, scalars: Rows, f_r: Rows) -> None:
    for row in range(f_r.shape[0]):
        s, f = scalars[:, row], f_r[row]
        c_i, s_i, sin_i, cos_i, sin_r, cos_r = s[0], s[1], s[2], s[3], s[4], s[5]
        p = s[6], s[7], s[8], s[9], s[10], math.tan(s[11])
        c_phi, s_phi = cos_phi[min(row, cos_phi.shape[0] - 1)], sin_phi[min(row, sin_phi.shape[0] - 1)]
        i = sin_i * c_i, sin_i * s_i, cos_i
        for j in range(f.shape[0]):
            r = sin_r * c_phi[j], sin_r * s_phi[j], cos_r
            f[j] = _f_r(i, r, (sin_i, sin_r), _half_azimuth(c_i, s_i, c_phi[j], s_phi[j]), p)


@kernel
def _horizontal(x: float, y: float) -> Three:
    """Return the length of a horizontal vector and its direction, which is x where there is none."""
    length = math.sqrt(x * x + y * y)
    inverse = 1.0 / (length + _TINY)
    return length, 1.0 if length < _POLE else x * inverse, 0.0 if length < _POLE else y * inverse


@loop
def _vector_rows(w_i: Floats, w_r: Floats, scalars: Rows, f_r: Floats) -> None:
    for row in range(f_r.shape[0]):
        s, f = scalars[row], f_r[row]
        p = s[0], s[1], s[2], s[3], s[4], math.tan(s[5])
        v, w = w_i[min(row, w_i.shape[0] - 1)].reshape(-1), w_r[min(row, w_r.shape[0] - 1)].reshape(-1)
        for j in range(f.shape[0]):
            x_i, y_i, z_i = np.float64(v[3 * j]), np.float64(v[3 * j + 1]), np.float64(v[3 * j + 2])
            x_r, y_r, z_r = np.float64(w[3 * j]), np.float64(w[3 * j + 1]), np.float64(w[3 * j + 2])
            sin_i, c_i, s_i = _horizontal(x_i, y_i)
            sin_r, c_r, s_r = _horizontal(x_r, y_r)
            half = _half_azimuth(c_i, s_i, c_r, s_r)
            value = _f_r((x_i, y_i, cosine(z_i)), (x_r, y_r, cosine(z_r)), (sin_i, sin_r), half, p)
            f[j] = value * (0.0 if z_i < 0.0 or z_r < 0.0 else 1.0)  # nan stays nan


_POLAR = attrgetter("cos_phi_i", "sin_phi_i", "sin_i", "cos_i", "sin_r", "cos_r")
_LOOPS = RowLoops(_angle_rows, _vector_rows, polar=_POLAR)


def lossless(_: Mapping[str, Any]) -> dict[str, float]:
    """Return grains that absorb nothing."""
    return {"w": 1.0}


@DeclaredModel(
    title="Hapke, with roughness",
    equation="eqs 47, 48, 50, 51, with H of Hapke 2002",
    references="hapke1984, hapke1986, hapke2002",
    parameters=(W, B, C, B_0, H, THETA_BAR),
    grazing_pole=True,
    grazing_power=0.0,
    excess="Hapke 1984, 1986, 2002: multiple scattering is that of uniform grains, whatever their phase function, and "
    "the hot spot is added to it. With w = 1 and no roughness the albedo at normal incidence is 0.986 for b = "
    "0, 1.32 for b = 0.95 and c = 1, and 1.77 with b_0 = 1 and h = 1 as well. Uniform grains with that hot spot "
    "reach 1.23 at 89.5 degrees",
    lossless=lossless,
)
def hapke(directions: Directions, out: Out, *parameters: Floats) -> Floats:
    """Return the BRDF [1/sr] of Hapke's model of a layer of grains, with hot spot and macroscopic roughness.

    f_r = w / (4 pi) / mu_0 mu_0e / (mu_0e + mu_e) (P (1 + B) + H(mu_0e) H(mu_e) - 1) S. The effective cosines and S are
    those of Hapke 1984, B is that of Hapke 1986, and H the approximation of Hapke 2002. Of the later additions, the
    coherent hot spot, the filling factor and the scattering of anisotropic grains are left out. Hapke's r is f_r mu_0,
    and the reflectance factor is pi f_r. f_r has a pole where both directions are at grazing: at any azimuth on a
    smooth surface, and back towards the light on a rough one. A rough surface loses the light that meets it twice.

    With b = 0 grains scatter uniformly. Papers with a c in [-1, 1] mean 2 c - 1. h is the tangent of half the phase
    angle at which the hot spot has half its height. The paper derives theta_bar, up to 60 degrees, for small slopes.

    >>> round(float(hapke(0.5, 0.0, 0.5, 0.0, w=0.526, b=0.187, c=0.6365, b_0=1.0, h=0.083, theta_bar=0.232)), 5)
    0.07781
    """
    return _LOOPS.evaluated(directions, out, parameters)
