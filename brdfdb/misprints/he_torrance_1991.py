"""Misprints of He, Torrance, Sillion and Greenberg 1991, each beside the right form."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np

from brdfdb import fresnel, models
from brdfdb._numba import elementwise, kernel
from brdfdb.geometry import checked_angles, radians, unit_vector
from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.misprints._entry import HE, Misprint, at, dot, polarisation, propagation
from brdfdb.models._diffraction_series import diffraction_series
from brdfdb.models._he_torrance_kernels import hidden, shadowing, variance
from brdfdb.models.he_torrance_1991 import checked_surface, directional_diffuse

TERMS = 10  # customary number of terms of eq. 78 of He et al.
STEPS = 50  # steps of Newton's iteration, far more than it takes to converge

_erfc = np.vectorize(math.erfc, otypes=[np.float64])


def _smith(theta: Any, slope: Any) -> Any:
    return _smith_over_cos(np.cos(theta), slope) * np.cos(theta)


def _smith_over_cos(cos_theta: Any, slope: Any) -> Any:
    """Return S_1 / cos(theta) of eq. 24, as the model computes it."""
    return shadowing(np.sqrt((1.0 - cos_theta) * (1.0 + cos_theta)), cos_theta, slope)


def _smith_without_gaussian(theta: Any, slope: Any) -> Any:
    cot = 1.0 / np.tan(theta)
    # Eq. (25) as printed
    Lambda = 0.5 * (2.0 / np.sqrt(np.pi) * slope / cot - _erfc(cot / (2.0 * slope)))
    # Eq. (24)
    return (1.0 - 0.5 * _erfc(cot / (2.0 * slope))) / (Lambda + 1.0)


def _smith_divided_by_cos(cos_theta: Any, slope: Any) -> Any:
    with np.errstate(all="ignore"):
        cot = np.divide(cos_theta, np.sqrt((1.0 - cos_theta) * (1.0 + cos_theta)))
        x = cot / (2.0 * slope)
        Lambda = 0.5 * (2.0 / np.sqrt(np.pi) * slope / cot * np.exp(-x * x) - _erfc(x))
        # Eqs (24) and (71) as printed: S / cos
        return (1.0 - 0.5 * _erfc(x)) / (Lambda + 1.0) / cos_theta


def _hidden_slope(theta_i: Any, theta_r: Any, slope: Any) -> Any:
    """Return (K_i + K_r) / 4 of eqs 81-83."""
    tangents = np.tan(theta_i), np.tan(theta_r)
    return sum(tan * _erfc(1.0 / (2.0 * slope * np.maximum(tan, 1e-300))) for tan in tangents) / 4.0


def _height_by_newton(theta_i: Any, theta_r: Any, slope: Any) -> Any:
    K = _hidden_slope(theta_i, theta_r, slope)
    z = np.zeros_like(K)
    for _ in range(STEPS):
        # Eq. (81) as printed, z in units of sigma_0, and its derivative
        gaussian = K * np.exp(-0.5 * z * z)
        z = z - (np.sqrt(np.pi / 2.0) * z - gaussian) / (np.sqrt(np.pi / 2.0) + z * gaussian)
    return z


def _effective_variance(theta_i: Any, theta_r: Any, slope: Any) -> Any:
    """Return (sigma / sigma_0)^2 of eq. 80, as the model computes it."""
    return variance(sum(hidden(np.sin(theta), np.cos(theta), slope) for theta in (theta_i, theta_r)))


def _height_by_lambert_w(theta_i: Any, theta_r: Any, slope: Any) -> Any:
    """Return z_0 / sigma_0 of the model, eq. 80 solved for it."""
    return np.sqrt(1.0 / _effective_variance(theta_i, theta_r, slope) - 1.0)


def _rough_mirror(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, **surface: Any) -> Any:
    """Return eq. 71 with abs(F)^2 = 1."""
    directions = checked_angles(theta_i, phi_i, theta_r, phi_r)
    return directional_diffuse(directions, checked_surface(**surface, n=1.0, k=0.0))


def _rough_mirror_by_eq_71(
    theta_i: Any,
    phi_i: Any,
    theta_r: Any,
    phi_r: Any,
    *,
    shadowed: bool,
    wave_number: bool,
    **surface: Any,
) -> Any:
    """Return eq. 71 with abs(F)^2 = 1, with S of eq. 23 and 2 pi / lambda in v_xy of eq. 78 or without."""
    wavelength = surface["wavelength_nm"] / 1000.0
    sigma_0_um = surface["sigma_0_um"]
    tau_um = surface["tau_um"]
    slope = sigma_0_um / tau_um
    k_i, k_r = propagation(theta_i, phi_i, theta_r, phi_r)
    # Eq. (84)
    v = k_r - k_i
    v_xy2, v_z = v[..., 0] ** 2 + v[..., 1] ** 2, v[..., 2]
    # Eqs (79) to (83)
    sigma = sigma_0_um * np.sqrt(_effective_variance(theta_i, theta_r, slope))
    g = (2.0 * np.pi * sigma / wavelength * v_z) ** 2
    # Eq. (78)
    V = v_xy2 * tau_um**2 / 4.0 * ((2.0 * np.pi / wavelength) ** 2 if wave_number else 1.0)
    D = np.pi**2 * tau_um**2 / (4.0 * wavelength**2) * g * diffraction_series(g, V)
    # Eqs (71) and (76)
    over_cosines = 1.0 / (np.cos(theta_i) * np.cos(theta_r))
    if shadowed:
        over_cosines = _smith_over_cos(np.cos(theta_i), slope) * _smith_over_cos(np.cos(theta_r), slope)
    return ((v_xy2 + v_z**2) / v_z) ** 2 / np.pi * over_cosines * D


def _normalised_hemispherical(*, theta_i: Any, theta_r: Any, **rest: Any) -> Any:
    surface = {name: rest[name] for name in (*_FIG_8, *_ALUMINUM)}
    # Eq. (11) as printed: rho_hd, the directional albedo by reciprocity, has no second direction
    over, under = (directional_albedo("he_torrance", theta, **surface).albedo for theta in (theta_r, theta_i))
    return np.divide(over, under)


def _normalised_bidirectional(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, **surface: Any) -> Any:
    specular = models.he_torrance(theta_i, phi_i, theta_i, np.add(phi_i, np.pi), **surface)
    return models.he_torrance(theta_i, phi_i, theta_r, phi_r, **surface) / specular


def _specular_of_a_plate(theta_i: Any, *, n: Any, k: Any, wavelength_nm: Any) -> Any:
    """Return rho_s of a smooth plate by eqs 58, 59, 65 to 67 and 4, for 1 sr: d omega_i cancels."""
    cos_theta = np.cos(theta_i)
    # Eq. (58) as printed, g = 0
    N = (2.0 * np.pi * wavelength_nm) ** 2 / cos_theta
    # Eqs (59) to (65), abs(v)^2 / v_z = 2 cos(theta)
    F = (2.0 * np.pi / wavelength_nm) ** 2 * (2.0 * cos_theta) ** 2 * fresnel.unpolarised(cos_theta, n, k)
    # Eqs (66), (67) and (4), S = 1
    return F * N / (cos_theta * (4.0 * np.pi) ** 2)


def _smooth(theta_i: Any, *, n: Any, k: Any, wavelength_nm: Any) -> Any:
    surface = {"wavelength_nm": wavelength_nm, "sigma_0_um": 0.0, "tau_um": 1.0}
    return models.he_torrance_specular(theta_i, **surface, n=n, k=k)


def _reflectance(cos_theta: Any, *, n: Any, k: Any) -> Any:
    return fresnel.unpolarised(cos_theta, n, k)


def _reflectance_without_moduli(cos_theta: Any, *, n: Any, k: Any) -> Any:
    F_s, F_p = fresnel.amplitudes(cos_theta, n, k)
    # Eq. (75) as printed
    return 0.5 * (F_s**2 + F_p**2)


def _bases(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, *, local: bool = False) -> tuple[Any, ...]:
    """Return v, abs(k_r x k_i)^2, s_i.k_r, p_i.k_r, s_r.k_i and p_r.k_i of eqs 84 to 86; n is z or the local normal."""
    k_i, k_r = propagation(theta_i, phi_i, theta_r, phi_r)
    v = k_r - k_i
    (s_i, p_i), (s_r, p_r) = (polarisation(k, v if local else (0.0, 0.0, 1.0)) for k in (k_i, k_r))
    across = np.cross(k_r, k_i)
    return v, dot(across, across), dot(s_i, k_r), dot(p_i, k_r), dot(s_r, k_i), dot(p_r, k_i)


def _geometry_with_products(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any) -> Any:
    with np.errstate(all="ignore"):
        v, across2, si_kr, pi_kr, sr_ki, pr_ki = _bases(theta_i, phi_i, theta_r, phi_r)
        # Eq. (76) as printed
        products = (sr_ki**2 + pr_ki**2) * (si_kr**2 + pi_kr**2) / across2**2
        return (np.sum(v * v, axis=-1) / v[..., 2]) ** 2 * products


def _geometry(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any) -> Any:
    v = unit_vector(theta_r, phi_r) + unit_vector(theta_i, phi_i)
    return (np.sum(v * v, axis=-1) / v[..., 2]) ** 2


def _jones(
    theta_i: Any,
    phi_i: Any,
    theta_r: Any,
    phi_r: Any,
    *,
    n: Any,
    k: Any,
    sign_of_ps: float = -1.0,
    local: bool = False,
) -> Any:
    """Return M_ss, M_sp; M_ps, M_pp over abs(k_r x k_i)^2, shape (..., 2, 2)."""
    with np.errstate(all="ignore"):
        v, across2, si_kr, pi_kr, sr_ki, pr_ki = _bases(theta_i, phi_i, theta_r, phi_r, local=local)
        F_s, F_p = fresnel.amplitudes(np.linalg.norm(v, axis=-1) / 2.0, n, k)
        # Eqs (61) to (64) as printed, where sign_of_ps is 1
        M_ss = F_s * pi_kr * pr_ki + F_p * si_kr * sr_ki
        M_sp = -(F_s * si_kr * pr_ki - F_p * pi_kr * sr_ki)
        M_ps = sign_of_ps * (F_s * pi_kr * sr_ki - F_p * si_kr * pr_ki)
        M_pp = F_s * si_kr * sr_ki + F_p * pi_kr * pr_ki
        M = np.stack([np.stack([M_ss, M_sp], axis=-1), np.stack([M_ps, M_pp], axis=-1)], axis=-2)
        return M / across2[..., np.newaxis, np.newaxis]


def _jones_of_one_matrix(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, *, n: Any, k: Any) -> Any:
    """Return s_r and p_r of the field of eq. 46, of light in s_i or p_i, shape (..., 2, 2)."""
    k_i, k_r = propagation(theta_i, phi_i, theta_r, phi_r)
    incident, reflected = polarisation(k_i, (0.0, 0.0, 1.0)), polarisation(k_r, (0.0, 0.0, 1.0))
    amplitudes = fresnel.amplitudes(np.linalg.norm(k_r - k_i, axis=-1) / 2.0, n, k)
    # Eq. (46) as printed: s_r^n and p_r^n of eq. 42 in both matrices; eqs (61) to (64) have the opposite sign
    local = list(zip(amplitudes, polarisation(k_r, k_r - k_i), strict=True))
    rows = [[-sum(dot(i, m) * F * dot(m, r) for F, m in local) for i in incident] for r in reflected]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


@kernel
def _sum_of_ten(g: float, V: float) -> float:
    total, term = 0.0, math.exp(-g)
    for m in range(1, TERMS + 1):
        # Eq. (78) as printed, cut off: term is g^m e^-g / m!
        term *= g / m
        total += term / m * math.exp(-V / m)
    return total


_sums_of_ten = elementwise(_sum_of_ten)  # compiled, because charts show its cost, too


def _ten_terms(g: Any, V: Any) -> Any:
    return _sums_of_ten(g, V)


def _all_terms(g: Any, V: Any) -> Any:
    return np.multiply(g, diffraction_series(g, V))


def _beckmann(g: Any, V: Any) -> Any:
    # The limit of eq. (78) for g -> infinity
    return np.exp(-np.divide(V, g)) / g


def _uniform_diffuse(a: Any) -> Any:
    return models.he_torrance(0.0, 0.0, 0.0, 0.0, wavelength_nm=500.0, sigma_0_um=0.0, tau_um=2.0, n=1.0, k=0.0, a=a)


_MIRROR = {"n": 1e-3, "k": 1e4}
_ALUMINUM = {"n": 0.8126, "k": 6.048}  # at 500 nm
_FIG_8 = {"wavelength_nm": 500.0, "sigma_0_um": 0.28, "tau_um": 1.77}

# A table, with what belongs together on one line: the formatter would make it twice as long
# fmt: off
ENTRIES: tuple[Misprint, ...] = (
    Misprint("uniform-diffuse-without-pi", HE, "8, 72", "printed",
        printed="rho_ud = a(lambda)",
        right="rho_ud = a(lambda) / pi",
        consequence="the magnesium oxide of Fig. 9, a = 0.9, would reflect 2.83 times what it receives",
        as_printed=lambda a: a, corrected=_uniform_diffuse,
        where={"a": 0.9}),
    Misprint("hemispherical-for-bidirectional", HE, "11", "words",
        printed="the curves of Figs 7 to 10 are called rho_hd over rho_hd in the specular direction",
        right="rho_bd over rho_bd: hemispherical-directional reflectivity has no direction of incidence",
        consequence="aluminum of Fig. 8, light at 45 degrees, seen back towards the light: 1.00 instead of 4e-4",
        as_printed=_normalised_hemispherical, corrected=_normalised_bidirectional,
        where=at(45.0, 45.0, 0.0) | _FIG_8 | _ALUMINUM),
    Misprint("shadowing-divided-by-cosines", HE, "23, 24, 71", "printed",
        printed="S / (cos(theta_i) cos(theta_r))",
        right="per direction Q / (Q cos(theta) + sigma_0 / (sqrt(pi) tau) sin(theta) exp(-x^2)), Q = 1 - erfc(x) / 2",
        consequence="on the horizon 0 / 0 = nan, where the limit sqrt(pi) tau / (2 sigma_0) is 5.60 for aluminum",
        as_printed=_smith_divided_by_cos, corrected=_smith_over_cos,
        where={"cos_theta": 0.0, "slope": 0.28 / 1.77}),
    Misprint("lambda-without-gaussian", HE, "25", "printed",
        printed="Lambda = 1/2 [2 / sqrt(pi) sigma_0 / (tau cot(theta)) - erfc(x)]",
        right="the first term times exp(-x^2), Smith 1967; x = tau cot(theta) / (2 sigma_0)",
        consequence="sigma_0 / tau of 0.16, at 69.5 degrees: one direction is shadowed to 0.849 of the right S_1",
        as_printed=_smith_without_gaussian, corrected=_smith,
        where={"theta": radians(69.5), "slope": 0.16}),
    Misprint("one-matrix-for-two", HE, "46", "printed",
        printed="the first matrix of E_s has s_r^n and p_r^n, as the second",
        right="T_in of eq. 39, with s_i^n and p_i^n: incident light is decomposed in the plane of incidence",
        consequence="a perfect mirror would reflect nothing of p-polarised light at 45 degrees: 0.00 of it, not 1.00",
        as_printed=_jones_of_one_matrix, corrected=models.he_torrance_jones,
        where=at(50.0, 30.0, 60.0) | _MIRROR),
    Misprint("two-pi-in-the-cone", HE, "57, 58", "printed",
        printed="A sinc^2 sinc^2 becomes (2 pi lambda)^2 Delta / (d omega_i cos(theta_r))",
        right="lambda^2 Delta / (d omega_i cos(theta_r)): the integral of the left side over solid angle",
        consequence="by eqs 65 to 67 and 4 glass would reflect 1.58 of the light along the normal, and not 0.04",
        as_printed=_specular_of_a_plate, corrected=_smooth,
        where={"theta_i": 0.0, "n": 1.5, "k": 0.0, "wavelength_nm": 500.0}),
    Misprint("amplitudes-over-cross-product", HE, "61-64", "printed",
        printed="M / abs(k_r x k_i)^2, by way of eq. 65",
        right="rotation and reflection by the angles between the planes of incidence and of scattering",
        consequence="0 / 0 = nan at backscatter, where the reflectance of n = 1.5 is 0.04 as along the normal",
        as_printed=_jones, corrected=models.he_torrance_jones,
        where=at(40.0, 40.0, 0.0) | {"n": 1.5, "k": 0.0}),
    Misprint("sign-of-m-ps", HE, "64", "printed",
        printed="M_ps = F_s (..) - F_p (..)",
        right="M_ps = -(F_s (..) - F_p (..)), the sign that eq. 62 gives M_sp",
        consequence="a perfect mirror would reflect between 0.007 and 1.993 of the light, by its polarisation",
        as_printed=lambda **arguments: _jones(sign_of_ps=1.0, **arguments), corrected=models.he_torrance_jones,
        where=at(50.0, 30.0, 60.0) | _MIRROR),
    Misprint("intensities-without-shadowing", HE, "66", "printed",
        printed="dI = abs(E_0)^2 / (cos(theta_r) (4 pi)^2) F N, without S",
        right="S of eq. 23 in front, which eqs 26 and 27 have and eqs 6 and 7 need",
        consequence="light at 89.9 degrees: aluminum of Fig. 8, |F| = 1, would reflect 4.5 of it, and not 0.04",
        as_printed=partial(_rough_mirror_by_eq_71, shadowed=False, wave_number=True), corrected=_rough_mirror,
        where=at(89.9, 80.0, 180.0) | _FIG_8),
    Misprint("squares-without-moduli", HE, "75", "printed",
        printed="|F|^2 = (F_s^2 + F_p^2) / 2",
        right="(|F_s|^2 + |F_p|^2) / 2",
        consequence="aluminum at 500 nm, 60 degrees: 0.58 + 0.56i, where the reflectance is 0.904",
        as_printed=_reflectance_without_moduli, corrected=_reflectance,
        where={"cos_theta": 0.5} | _ALUMINUM),
    Misprint("four-dot-products", HE, "76", "printed",
        printed="G = (v.v / v_z)^2 [..] [..] / abs(k_r x k_i)^4",
        right="G = (v.v / v_z)^2: the rest is exactly 1",
        consequence="0 / 0 = nan at backscatter and for light along the normal, where G is 4.00",
        as_printed=_geometry_with_products, corrected=_geometry,
        where=at([40.0, 0.0], [40.0, 0.0], 0.0)),
    Misprint("v-without-wave-number", HE, "76, 78, 84", "printed",
        printed="v_xy of eq. 78 from the unit vectors of eq. 84, a pure number times tau",
        right="v_xy of eq. 78 carries 2 pi / lambda, as v in eq. 20; v of eq. 76 does not",
        consequence="light along the normal: aluminum of Fig. 8 would reflect 8.1 times as much, 8.8 with |F| = 1",
        as_printed=partial(_rough_mirror_by_eq_71, shadowed=True, wave_number=False), corrected=_rough_mirror,
        where=at(0.0, 40.0, 0.0) | _FIG_8),
    Misprint("ten-terms", HE, "78", "customary",
        printed="the sum from m = 1, cut off after a fixed number of terms, with e^-g in each",
        right="terms around the largest one, in logarithms; an integral where there are many",
        consequence="ten terms hold 81 % of the sum at g = 9 and 5 % at g = 18.5; above g = 745 e^-g is 0",
        as_printed=_ten_terms, corrected=_all_terms,
        where={"g": np.array([9.0, 18.5, 800.0]), "V": 0.0}),
    Misprint("beckmanns-limit", HE, "78, large g", "customary",
        printed="e^-b / g, b = V / g",
        right="the sum; to first order e^-b / g [1 + (b^2 / 2 - 2 b + 1) / g]",
        consequence="at g = 18.5 the limit is -6 % off at b = 0 and -47 % at b = 8",
        as_printed=_beckmann, corrected=_all_terms,
        where={"g": 18.5, "V": 18.5 * np.array([0.0, 8.0])}),
    Misprint("root-search", HE, "81", "customary",
        printed="a root search for z_0, here Newton's from z_0 = 0",
        right="z_0^2 / sigma_0^2 = W_0(2 K^2 / pi), K = (K_i + K_r) / 4, by Lambert's W",
        consequence="both at 89 degrees, sigma_0 / tau of 0.16: back at 0 after 50 steps, where z_0 is 2.146 sigma_0",
        as_printed=_height_by_newton, corrected=_height_by_lambert_w,
        where={"theta_i": radians(89.0), "theta_r": radians(89.0), "slope": 0.16}),
    Misprint("local-normal-for-z", HE, "85, 86", "words",
        printed="n is the local surface normal, by Table 1",
        right="n is the z axis, as in eqs 14 and 35: s and p are those of the mean surface",
        consequence="M_sp and M_ps would be 0 everywhere, where a facet of a perfect mirror turns 0.56 of s into p",
        as_printed=partial(_jones, local=True), corrected=models.he_torrance_jones,
        where=at(50.0, 30.0, 60.0) | _MIRROR),
)
# fmt: on
