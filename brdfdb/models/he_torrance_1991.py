"""He, Torrance, Sillion and Greenberg 1991: physical optics of Gaussian rough surfaces, unpolarised light."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb import fresnel
from brdfdb._numba import elementwise, kernel
from brdfdb.geometry import Directions, checked_angles, checked_vectors, finished
from brdfdb.models._he_torrance_series import diffraction_series
from brdfdb.parameters import Floats, ModelSpec, Parameter

WAVELENGTH_NM = Parameter("wavelength_nm", "λ", "nm", 1e-3, 1e7, "wavelength in vacuum")
SIGMA_0_UM = Parameter("sigma_0_um", "σ_0", "µm", 0.0, 1e4, "rms roughness; 0 is a mirror")
TAU_UM = Parameter("tau_um", "τ", "µm", 1e-6, 1e6, "autocorrelation length")
N = Parameter("n", "n", "1", 1e-3, 100.0, "refractive index")
K = Parameter("k", "k", "1", 0.0, 1e4, "extinction coefficient")
A = Parameter("a", "a", "1", 0.0, 1.0, "albedo of the uniform diffuse part", default=0.0)


@kernel
def _shadowing_over_cos(sin_theta: float, cos_theta: float, slope: float) -> float:
    """S_1(theta) / cos theta of eqs 23-25, with slope = sigma_0 / tau; finite up to and including 90 degrees."""
    x = cos_theta / (2.0 * slope * sin_theta) if slope * sin_theta > 0.0 else math.inf
    Q = 1.0 - 0.5 * math.erfc(x)
    return Q / (Q * cos_theta + slope / math.sqrt(np.pi) * sin_theta * math.exp(-x * x))


@kernel
def _hidden_slope(sin_theta: float, cos_theta: float, slope: float) -> float:
    """K_i or K_r of eqs 82-83: how much of the valleys a direction does not reach."""
    x = cos_theta / (2.0 * slope * sin_theta) if slope * sin_theta > 0.0 else math.inf
    return sin_theta / cos_theta * math.erfc(x)


@kernel
def _effective_variance(K: float) -> float:
    """(sigma / sigma_0)^2 of eqs 80-81 for K = K_i + K_r: z_0^2 / sigma_0^2 = W_0(K^2 / (8 pi))."""
    y = K * K / (8.0 * np.pi)
    if y == 0.0:
        return 1.0
    # W_0 by the logarithmic iteration of Iacono and Boyd, quadratic from this start for every y > 0
    log_1p_y = math.log1p(y)
    w = log_1p_y * (1.0 - math.log1p(log_1p_y) / (2.0 + log_1p_y))
    for _ in range(4):
        w = w / (1.0 + w) * (1.0 + math.log(y / w))
    return 1.0 / (1.0 + w)


_shadowing = elementwise(_shadowing_over_cos)
_hidden = elementwise(_hidden_slope)
_variance = elementwise(_effective_variance)


class Surface(NamedTuple):
    """The checked parameters that describe the surface and the light, as arrays that broadcast with the angles."""

    wavelength_um: NDArray[np.floating]
    sigma_0: NDArray[np.floating]
    tau: NDArray[np.floating]
    n: NDArray[np.floating]
    k: NDArray[np.floating]

    @property
    def slope(self) -> Floats:
        return self.sigma_0 / self.tau


def checked_surface(
    wavelength_nm: ArrayLike, sigma_0_um: ArrayLike, tau_um: ArrayLike, n: ArrayLike, k: ArrayLike
) -> Surface:
    return Surface(
        WAVELENGTH_NM.check(wavelength_nm) / 1000.0,
        SIGMA_0_UM.check(sigma_0_um),
        TAU_UM.check(tau_um),
        N.check(n),
        K.check(k),
    )


def he_torrance(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    wavelength_nm: ArrayLike,
    sigma_0_um: ArrayLike,
    tau_um: ArrayLike,
    n: ArrayLike,
    k: ArrayLike,
    a: ArrayLike = 0.0,
) -> Floats:
    """BRDF of a Gaussian rough surface: the directional diffuse and the uniform diffuse part.

    The third part, specular, is a Dirac delta in direction: `he_torrance_specular` gives its reflectance.

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi].
    wavelength_nm : array_like [nm]
        Wavelength in vacuum, in [1e-3, 1e7].
    sigma_0_um, tau_um : array_like [um]
        rms roughness, in [0, 1e4], and autocorrelation length, in [1e-6, 1e6].
    n, k : array_like [1]
        Complex refractive index n + ik at that wavelength; n in [1e-3, 100], k in [0, 1e4].
    a : array_like [1]
        Albedo of the uniform diffuse part, in [0, 1].

    Returns
    -------
    array [1/sr]
        In the broadcast shape of all arguments; 0 below the horizon, nan where an angle is nan.

    Raises
    ------
    ValueError
        If an argument is outside its range.

    Notes
    -----
    Eq. (71) with (75)-(84), and (72). In order: `_shadowing_over_cos` is S_1 / cos of eqs 23-25 per direction,
    `_effective_variance` eqs 80-83, `fresnel.unpolarised` eq. 75 at the bisecting angle, `diffraction_series` the
    sum of eq. 78. Departures from the paper: (72) reads a / pi; Smith's Lambda in (25) has its Gaussian; v_xy in
    (78) carries the wave number, v in (76) does not; the dot products of (76) cancel exactly, so that
    G = (|v|^2 / v_z)^2; (81) is solved by Lambert's W. v_z^2 is taken from G into the sum: g / v_z^2 is finite.
    Gentle slopes (sigma_0 / tau well below 1) or (v_z sigma)^2 well above 1 are the model's range of validity.

    References
    ----------
    he1991, smith1967, loader2000, corless1996

    Examples
    --------
    >>> surface = dict(sigma_0_um=0.18, tau_um=3.0, n=0.769, k=6.08)
    >>> round(float(he_torrance(0.5, 0.0, 0.6, 3.0, wavelength_nm=500.0, **surface)), 3)
    5.388
    """
    surface = checked_surface(wavelength_nm, sigma_0_um, tau_um, n, k)
    return _f_r(checked_angles(theta_i, phi_i, theta_r, phi_r), surface, A.check(a))


def he_torrance_vectors(
    wi: ArrayLike,
    wr: ArrayLike,
    *,
    wavelength_nm: ArrayLike,
    sigma_0_um: ArrayLike,
    tau_um: ArrayLike,
    n: ArrayLike,
    k: ArrayLike,
    a: ArrayLike = 0.0,
) -> Floats:
    """`he_torrance` for unit vectors `wi` of the light and `wr` of the viewer, each of shape (..., 3)."""
    surface = checked_surface(wavelength_nm, sigma_0_um, tau_um, n, k)
    return _f_r(checked_vectors(wi, wr), surface, A.check(a))


def _f_r(directions: Directions, surface: Surface, albedo: Floats) -> Floats:
    # Eq. (75), at the bisecting angle
    F2 = fresnel.unpolarised(cos_bisecting(directions), surface.n, surface.k)
    # Eqs (71) and (72)
    return finished(F2 * directional_diffuse(directions, surface) + albedo / np.pi, directions)


def cos_bisecting(directions: Directions) -> Floats:
    """Cosine of half the angle between light and viewer: of the incidence on a facet that mirrors one to the other."""
    v_xy2, v_z2 = _v2(directions)
    return np.minimum(0.5 * np.sqrt(v_xy2 + v_z2), 1.0)


def _v2(directions: Directions) -> tuple[Floats, Floats]:
    """v_xy^2 and v_z^2 of eq. 84, k_r - k_i; v_xy^2 in the form that keeps its digits near the mirror direction."""
    sin_i, sin_r = directions.sin_i, directions.sin_r
    v_xy2 = (sin_i - sin_r) ** 2 + (2.0 * sin_i * sin_r) * directions.one_plus_cos_dphi
    return v_xy2, (directions.cos_i + directions.cos_r) ** 2


def directional_diffuse(directions: Directions, surface: Surface) -> Floats:
    """f_r [1/sr] of the directional diffuse part, eq. 71, over |F|^2: what the roughness does, in any polarisation."""
    sin_i, cos_i, sin_r, cos_r = directions.sin_i, directions.cos_i, directions.sin_r, directions.cos_r
    slope = surface.slope
    # Eq. (84)
    v_xy2, v_z2 = _v2(directions)
    # Eqs (23)-(25)
    S_over_cos_cos = _shadowing(sin_i, cos_i, slope) * _shadowing(sin_r, cos_r, slope)
    # Eqs (79)-(83)
    variance = _variance(_hidden(sin_i, cos_i, slope) + _hidden(sin_r, cos_r, slope))
    g_over_vz2 = (2.0 * np.pi * surface.sigma_0 / surface.wavelength_um) ** 2 * variance
    # Eq. (78), with V = (2 pi / lambda)^2 v_xy^2 tau^2 / 4
    correlation = (np.pi * surface.tau / surface.wavelength_um) ** 2
    D_over_g = diffraction_series(g_over_vz2 * v_z2, correlation * v_xy2)
    # Eqs (71) and (76)
    return D_over_g * (v_xy2 + v_z2) ** 2 * (correlation / (4.0 * np.pi) * S_over_cos_cos * g_over_vz2)


def he_torrance_specular(
    theta_i: ArrayLike,
    *,
    wavelength_nm: ArrayLike,
    sigma_0_um: ArrayLike,
    tau_um: ArrayLike,
    n: ArrayLike,
    k: ArrayLike,
) -> Floats:
    """Reflectance of the specular part: the share of the light that leaves in the exact mirror direction.

    Parameters
    ----------
    theta_i : array_like [rad]
        Angle of incidence, in [0, pi].
    wavelength_nm, sigma_0_um, tau_um, n, k : array_like
        As in `he_torrance`.

    Returns
    -------
    array [1]
        rho_s, in [0, 1], in the broadcast shape of all arguments; 0 below the horizon, nan where theta_i is nan.

    Raises
    ------
    ValueError
        If an argument is outside its range.

    Notes
    -----
    Eq. (73): |F|^2 e^-g S at theta_r = theta_i.

    References
    ----------
    he1991

    Examples
    --------
    >>> mirror = dict(wavelength_nm=550.0, sigma_0_um=0.0, tau_um=2.0, n=1.5, k=0.0)
    >>> round(float(he_torrance_specular(0.0, **mirror)), 4)
    0.04
    """
    angles = checked_angles(theta_i, 0.0, 0.0, 0.0)
    surface = checked_surface(wavelength_nm, sigma_0_um, tau_um, n, k)
    sin_i, cos_i = np.sin(angles.theta_i), np.cos(angles.theta_i)
    S = (_shadowing(sin_i, cos_i, surface.slope) * cos_i) ** 2
    variance = _variance(2.0 * _hidden(sin_i, cos_i, surface.slope))
    # Eq. (79)
    g = (4.0 * np.pi * surface.sigma_0 / surface.wavelength_um * cos_i) ** 2 * variance
    # Eq. (73)
    return finished(fresnel.unpolarised(cos_i, surface.n, surface.k) * np.exp(-g) * S, angles)


SPEC = ModelSpec(
    name="he_torrance",
    version=1,
    title="He-Torrance, unpolarised",
    equation="eqs 71-84",
    reference="he1991",
    parameters=(SIGMA_0_UM, TAU_UM, A),
    evaluate=he_torrance,
    vectors=he_torrance_vectors,
    specular=he_torrance_specular,
    specular_parameters=("wavelength_nm", "sigma_0_um", "tau_um", "n", "k"),
    spectral=True,
)
