"""Misprints of Oren and Nayar 1994, each beside the right form."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from brdfdb import models
from brdfdb.gauss import gauss_rule
from brdfdb.geometry import radians, spherical_angles, unit_vector
from brdfdb.misprints._entry import ORENNAYAR, Array, Misprint, at, part


def _cavity(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, theta_a: Any, phi_a: Any) -> tuple[Any, ...]:
    """Return <s,n>, <v,n>, <a,n> and, for both facets of a cavity, <s,a>, <v,a>, <s,a'>, <v,a'>."""
    s, v = unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r)
    a, b = unit_vector(theta_a, phi_a), unit_vector(theta_a, phi_a + np.pi)
    facets = (s @ a, v @ a, s @ b, v @ b), (s @ b, v @ b, s @ a, v @ a)
    return s[..., 2], v[..., 2], a[2], facets


def _direct_with_max(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, *, rho: Any, theta_a: Any, phi_a: Any) -> Any:
    s_n, v_n, a_n, facets = _cavity(theta_i, phi_i, theta_r, phi_r, theta_a, phi_a)
    total = 0.0
    for s_a, v_a, _, _ in facets:
        # Eq. (11) as printed
        GAF = np.minimum(1.0, np.maximum(np.maximum(0.0, 2.0 * s_n * a_n / s_a), 2.0 * v_n * a_n / v_a))
        # Eqs (10) and (22), over E_0 cos(theta_i)
        total += 0.5 * rho / np.pi * s_a * v_a / (a_n * v_n * s_n) * GAF
    return total


def _direct_by_table_1(
    theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, *, rho: Any, theta_a: Any, phi_a: Any
) -> Any:
    s_n, v_n, a_n, facets = _cavity(theta_i, phi_i, theta_r, phi_r, theta_a, phi_a)
    total = np.zeros(np.shape(s_n))
    for s_a, v_a, _, _ in facets:
        shadowed, masked = 2.0 * s_n * a_n / s_a, 2.0 * v_n * a_n / v_a
        # Table 1 as printed, over rho / pi E_0; its last row should have <v,n> where it has <s,a>
        plain, masking, shadowing = s_a * v_a / (a_n * v_n), 2.0 * s_a, 2.0 * s_n * v_a / s_a
        case = np.where(shadowed < np.minimum(masked, 1.0), shadowing, np.where(masked < 1.0, masking, plain))
        # Eq. (22), over E_0 cos(theta_i)
        total = total + 0.5 * np.where((s_a > 0.0) & (v_a > 0.0), rho / np.pi * case / s_n, 0.0)
    return total


def _bounce_of_visible_widths(
    theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, *, rho: Any, theta_a: Any, phi_a: Any
) -> Any:
    def d(x: Any, y: Any) -> Any:
        # Eq. (20)
        return np.sqrt(x**2 + 2.0 * x * y * np.cos(2.0 * theta_a) + y**2)

    s_n, v_n, a_n, facets = _cavity(theta_i, phi_i, theta_r, phi_r, theta_a, phi_a)
    total = np.zeros(np.shape(s_n))
    for s_a, v_a, s_b, v_b in facets:
        # Eqs (15) and (16) as printed: the width visible, the width illuminated, which the rest of w is not
        m_v, m_s = 1.0 - np.clip(-v_b / v_a, 0.0, 1.0), 1.0 - np.clip(-s_a / s_b, 0.0, 1.0)
        # Eqs (18), (19) and (22), over E_0 cos(theta_i)
        IF = np.pi / 2.0 * (d(1.0, m_v) + d(1.0, m_s) - d(m_s, m_v) - d(1.0, 1.0))
        facet = (rho / np.pi) ** 2 * s_b * v_a / (a_n * v_n * s_n) * IF
        total = total + 0.5 * np.where((v_a > 0.0) & (s_b > 0.0), facet, 0.0)
    return total


@cache
def _nodes() -> tuple[Array, Array]:
    x, w = gauss_rule(400)
    return np.asarray(x), np.asarray(w)


def _slopes(sigma: Any) -> tuple[Array, Array]:
    """Return slopes theta_a from 0 to pi/2 and their weights exp(-theta_a^2 / (2 sigma^2)) sin(theta_a), eq. 26."""
    x, w = _nodes()
    theta_a = (x + 1.0) * np.pi / 4.0
    return theta_a, w * np.pi / 4.0 * np.exp(-(theta_a**2) / (2.0 * sigma**2)) * np.sin(theta_a)


def _direct_over_the_hemisphere(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, *, rho: Any, sigma: Any) -> Any:
    theta_a, weight = _slopes(sigma)
    angles = (np.asarray(angle)[..., np.newaxis] for angle in (theta_i, phi_i, theta_r, phi_r))
    one = models.oren_nayar_single_slope_parts(*angles, rho=rho, theta_a=theta_a)
    # Eq. (26) as printed: 1 / c is an integral over the hemisphere
    c = 1.0 / (2.0 * np.pi * weight.sum())
    # Eq. (25) as printed
    return c * (one.direct @ weight)


def _bounce_by_eq_48(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, *, rho: Any, sigma: Any) -> Any:
    theta_a, weight = _slopes(sigma)
    # Eq. (49), which is eq. (48) as printed, averaged over azimuths
    one = models.oren_nayar_single_slope_parts(theta_i, phi_i, theta_r, phi_r, rho=rho, theta_a=theta_a)
    return weight @ one.interreflected / weight.sum()


def _fit(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, *, rho: Any, sigma: Any, tan_beta: Any = None) -> Any:
    alpha, beta, s2 = np.maximum(theta_i, theta_r), np.minimum(theta_i, theta_r), sigma**2
    cos_dphi = np.cos(np.subtract(phi_r, phi_i))
    tan_beta = np.tan(beta) if tan_beta is None else tan_beta
    # Eq. (27) as printed
    C_1 = 1.0 - 0.5 * s2 / (s2 + 0.33)
    C_2 = 0.45 * s2 / (s2 + 0.09) * (np.sin(alpha) - np.where(cos_dphi >= 0.0, 0.0, (2.0 * beta / np.pi) ** 3))
    C_3 = 0.125 * s2 / (s2 + 0.09) * (4.0 * alpha * beta / np.pi**2) ** 2
    rest = (1.0 - np.abs(cos_dphi)) * C_3 * np.tan((alpha + beta) / 2.0)
    direct = rho / np.pi * (C_1 + cos_dphi * C_2 * tan_beta + rest)
    # Eqs (28) and (29) as printed
    return direct + 0.17 * rho**2 / np.pi * s2 / (s2 + 0.13) * (1.0 - cos_dphi * (2.0 * beta / np.pi) ** 2)


def _fit_of_vectors(wi: Any, wr: Any, *, rho: Any, sigma: Any) -> Any:
    (theta_i, phi_i), (theta_r, phi_r) = spherical_angles(wi), spherical_angles(wr)
    cos_beta = np.maximum(np.asarray(wi)[..., 2], np.asarray(wr)[..., 2])
    with np.errstate(all="ignore"):
        tan_beta = np.sqrt(1.0 - cos_beta**2) / cos_beta
        return _fit(theta_i, phi_i, theta_r, phi_r, rho=rho, sigma=sigma, tan_beta=tan_beta)


def _surface_radiance(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, *, sigma: Any) -> Any:
    s, v = unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r)
    a = (s + v) / np.linalg.norm(s + v, axis=-1, keepdims=True)
    s_a, a_n, s_n, v_n = np.sum(s * a, axis=-1), a[..., 2], s[..., 2], v[..., 2]
    GAF = np.minimum(1.0, 2.0 * a_n * np.minimum(s_n, v_n) / s_a)
    # Eq. (31) as printed, F = 1
    return GAF / (v_n * a_n) * np.exp(-(np.arccos(a_n) ** 2) / (2.0 * sigma**2))


_TOWEL: dict[str, Any] = {"rho": 0.75, "sigma": radians(42.0), "interreflection": False}
_K_S = 0.085  # k_s / k_b of the cotton towel, sample E


def _towel_without_e_0(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, *, e_0: Any) -> Any:
    """Return f_r = L_r / (E_0 cos(theta_i)) of sample E, from the radiance of eq. 32 in a light of irradiance E_0."""
    cos_i = np.cos(theta_i)
    body = e_0 * cos_i * models.oren_nayar(theta_i, phi_i, theta_r, phi_r, **_TOWEL)
    # Eq. (32), with eq. (31) as printed
    return (body + _K_S * _surface_radiance(theta_i, phi_i, theta_r, phi_r, sigma=_TOWEL["sigma"])) / (e_0 * cos_i)


def _towel(theta_i: Any, phi_i: Any, theta_r: Any, phi_r: Any, **_: Any) -> Any:
    """Return f_r [1/sr] of sample E with the parameters of its preset, which does not depend on an irradiance."""
    return models.oren_nayar_body_surface(theta_i, phi_i, theta_r, phi_r, **_TOWEL, k_s=_K_S, e_0=np.pi)


# A table, with what belongs together on one line: the formatter would make it twice as long
# fmt: off
ENTRIES: tuple[Misprint, ...] = (
    Misprint("gaf-of-the-larger", ORENNAYAR, "11, 36-38", "printed",
        printed="GAF = Min[1, Max[0, A, B]]",
        right="GAF = Min[1, Max[0, Min[A, B]]], and no direct light from a facet that faces away from light or viewer",
        consequence="slopes of 45 degrees, light and viewer opposite at 80: the direct BRDF is -2.10 rho, not 0",
        as_printed=_direct_with_max, corrected=part(models.oren_nayar_unidirectional_parts, "direct"),
        where=at(80.0, 80.0, 180.0) | {"rho": 1.0, "theta_a": radians(45.0), "phi_a": 0.0}),
    Misprint("shadowed-facet", ORENNAYAR, "Table 1", "printed",
        printed="a shadowed facet has L = rho / pi E_0 2 <s,n> <v,a> / <s,a>",
        right="rho / pi E_0 2 <s,n> <v,a> / <v,n>, as the right-hand side of the row has it",
        consequence="slopes of 45 degrees, light at 75, seen along the normal: 1.15 times the direct light",
        as_printed=_direct_by_table_1, corrected=part(models.oren_nayar_unidirectional_parts, "direct"),
        where=at(75.0, 0.0, 0.0) | {"rho": 1.0, "theta_a": radians(45.0), "phi_a": 0.0}),
    Misprint("visible-and-masked-widths", ORENNAYAR, "15, 16", "words",
        printed="m_v and m_s are called the widths that are visible and illuminated",
        right="they are the widths masked and shadowed: eq. 17 integrates from them to w",
        consequence="lit and seen along the normal, where nothing is hidden, the second bounce is 0, not 0.066",
        as_printed=_bounce_of_visible_widths, corrected=part(models.oren_nayar_unidirectional_parts, "interreflected"),
        where=at(0.0, 0.0, 0.0) | {"rho": 1.0, "theta_a": radians(45.0), "phi_a": 0.0}),
    Misprint("normalised-over-the-hemisphere", ORENNAYAR, "25, 26", "printed",
        printed="P, normalised over the hemisphere, is integrated over the slope alone",
        right="P sin(theta_a) is normalised over the slope: the integral over azimuth is a factor of 2 pi",
        consequence="0.159 of the light is left, 1 / (2 pi): of Lambert's too, at sigma = 0",
        as_printed=_direct_over_the_hemisphere, corrected=part(models.oren_nayar_gaussian_parts, "direct"),
        where=at(30.0, 20.0, 0.0) | {"rho": 0.9, "sigma": 0.3}),
    Misprint("fit-below-zero", ORENNAYAR, "27-29", "printed",
        printed="the sum of three terms, one of which falls with tan(beta) in the forward direction",
        right="0 where the sum is below 0",
        consequence="sigma of 60 degrees, rho of 0.1, opposite at 89 degrees: the BRDF is -0.136 rho / pi",
        as_printed=_fit, corrected=models.oren_nayar,
        where=at(89.0, 89.0, 180.0) | {"rho": 0.1, "sigma": radians(60.0)}),
    Misprint("tangent-at-grazing", ORENNAYAR, "27", "printed",
        printed="C_2 tan(beta), evaluated as it stands",
        right="C_2 tan(beta) with the difference in C_2 taken in pi/2 - beta, the limit from below at 90 degrees",
        consequence="with both directions on the horizon inf backward and nan forward, where the limit is 0.042/sr",
        as_printed=_fit_of_vectors, corrected=models.oren_nayar_vectors,
        where={"wi": [1.0, 0.0, 0.0], "wr": [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], "rho": 0.5, "sigma": 0.5}),
    Misprint("surface-radiance-as-brdf", ORENNAYAR, "31", "customary",
        printed="eq. 31, a radiance, taken for a BRDF",
        right="the same over cos(theta_i), where E_0 is 1",
        consequence="taken for a BRDF it is not reciprocal: 60 and 30 degrees exchanged give 0.577 of each other",
        as_printed=_surface_radiance, corrected=models.torrance_sparrow,
        where=at(60.0, 30.0, 180.0) | {"sigma": radians(20.0)}),
    Misprint("surface-without-e-0", ORENNAYAR, "31, 32", "printed",
        printed="L_r = F GAF / (cos(theta_r) cos(theta_a)) exp(..), without the E_0 that eqs 27 and 28 have",
        right="E_0 in front; the printed k_s / k_b then has the unit of 1 / E_0, which the paper does not give",
        consequence="the towel of Fig. 20 would reflect 1.53 times what it receives at E_0 = 1, and 0.92 at E_0 = pi",
        as_printed=_towel_without_e_0, corrected=_towel,
        where=at(60.0, 70.0, 180.0) | {"e_0": 2.0 * np.pi}),
    Misprint("interreflection-factor", ORENNAYAR, "48", "printed",
        printed="IF = pi (1 - cos(theta_a)) (1 - m_s) (1 - m_v), to make eq. 46 integrable",
        right="eq. 47 itself, integrated numerically",
        consequence="sigma of 30 degrees, light at 75, seen along the normal: 1.26 times the second bounce",
        as_printed=_bounce_by_eq_48, corrected=part(models.oren_nayar_gaussian_parts, "interreflected"),
        where=at(75.0, 0.0, 0.0) | {"rho": 0.9, "sigma": radians(30.0)}),
)
# fmt: on
