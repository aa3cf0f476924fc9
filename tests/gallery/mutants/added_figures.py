"""Wrong forms that only the added figures show: closed forms, single cavities, strips, Jones matrices, samplers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from brdfdb import fresnel
from brdfdb.gallery import _he_torrance_cuts as cuts
from brdfdb.gallery import oren_nayar_1994_bounces as grooves
from brdfdb.geometry import unit_vector
from brdfdb.integrals import sampling
from brdfdb.measurements import gonioreflectometer
from brdfdb.models import he_torrance_1991 as he_torrance
from brdfdb.models import oren_nayar_1994 as surfaces
from brdfdb.models import ward_vectors
from tests.gallery.mutants.mutation import Mutant

Function = Callable[..., Any]


# Oren and Nayar


def closed(
    sign: float = 1.0, shadows: bool = True, power: float = 1.0, bounced: float = 1.0
) -> dict[Function, Function]:
    """Return eqs 45 and 49 with the mistakes that may be in them."""

    def single_slope(d: Any, rho: Any, theta_a: Any) -> Any:
        tan_a, cos = np.tan(theta_a), sign * d.cos_dphi
        tan_i, tan_r = d.sin_i / d.cos_i, d.sin_r / d.cos_r
        a, b = np.maximum(tan_i, tan_r) * tan_a, np.minimum(tan_i, tan_r) * tan_a
        # Eq. (39)
        critical_a, critical_b = (np.arccos(1.0 / np.maximum(tangent, 1.0)) * shadows for tangent in (a, b))
        both_open = 0.5 * a * b * (1.0 - (2.0 * critical_a + np.sin(2.0 * critical_a)) / np.pi)
        # Eq. (45)
        A_1 = b * 2.0 * np.sin(critical_a) / np.pi + both_open
        A_2 = np.where(cos < 0.0, 2.0 / np.pi * (critical_b - b * np.sin(critical_b)), 0.0)
        roots = np.sqrt(np.maximum(a**2 - 1.0, 0.0)) + np.sqrt(np.maximum(b**2 - 1.0, 0.0)) - np.hypot(a, b)
        overlap = critical_a + critical_b > np.pi / 2.0
        A_3 = np.where(overlap, 0.5 + (roots - critical_a - critical_b) / np.pi, 0.0)
        weight = np.abs(cos) ** power
        direct = np.cos(theta_a) * (1.0 + np.sign(cos) * weight * (A_1 + A_2) + (1.0 - weight) * A_3)
        # Eq. (49)
        Z = 2.0 / np.pi * (critical_b + b * (np.sin(critical_a) - np.sin(critical_b))) + both_open
        bounce = bounced * np.cos(theta_a) * (1.0 - np.cos(theta_a)) * (1.0 - cos * Z)
        return surfaces.Parts(rho / np.pi * direct, rho**2 / np.pi * bounce)

    return {surfaces._single_slope: single_slope}


def facet(p: Any, q: Any, S: Any, C: Any, *, hidden: bool = True) -> Any:
    """Return the second bounce of one facet, eqs 15 to 20; `hidden` tells whether m_v and m_s are the hidden widths.

    p and q are the slopes of light and viewer across the facet, times S.
    """
    seen, lit = C + q, C - p
    shown = (seen > 0.0) & (lit > 0.0)
    m_v = np.clip(-(C - q) / np.where(shown, seen, 1.0), 0.0, 1.0)
    m_s = np.clip(-(C + p) / np.where(shown, lit, 1.0), 0.0, 1.0)
    if not hidden:
        m_v, m_s = 1.0 - m_v, 1.0 - m_s

    def d(x: Any, y: Any) -> Any:
        return np.sqrt(np.maximum(x * x + 2.0 * x * y * (C * C - S * S) + y * y, 0.0))

    factor = 0.5 * (d(1.0, m_v) + d(1.0, m_s) - d(m_s, m_v) - d(1.0, 1.0))
    return np.where(shown, lit * seen / C * factor, 0.0)


def cavity(hidden: bool) -> Function:
    """Return the function of the second bounce of both facets of a cavity."""
    return lambda i, r, S, C: 0.5 * sum(facet(side * S * i, side * S * r, S, C, hidden=hidden) for side in (1.0, -1.0))


def direct_unshadowed(i: Any, r: Any, S: Any, C: Any) -> Any:
    """Return the direct light of a cavity without shadowing and masking."""
    sides = (np.maximum(C + sign * S * i, 0.0) * np.maximum(C + sign * S * r, 0.0) / C for sign in (1.0, -1.0))
    return 0.5 * sum(sides)


right_factors, right_met = grooves.view_factors, grooves._met

OREN_NAYAR = (
    Mutant("light from the other side of closed forms", "cos(phi_r - phi_i) of eqs 45 and 49 has the other sign",
              "azimuths of light that travels towards the surface are half a turn off", closed(sign=-1.0)),
    Mutant("no eq. 49", "the closed forms have direct light alone", "eq. 49 stands at the end of the appendix",
              closed(bounced=0.0)),
    Mutant("critical angles of 0", "eq. 39 is 0: nothing is hidden", "both branches of eq. 39 begin there",
              closed(shadows=False)),
    Mutant("cos^2 in eq. 44", "planes are weighted by cos^2 and sin^2", "vectors are split like that",
              closed(power=2.0)),
    Mutant("widths of the words", "m_v and m_s are the widths visible and lit", "the words before eq. 15 say so",
              {surfaces.bounce_of_cavity: cavity(hidden=False)}),
    Mutant("no GAF in cavities", "a facet is lit and seen whole or not at all", "Table 1 begins with that row",
              {surfaces.direct_of_cavity: direct_unshadowed}),
    Mutant("strings without a half", "view factors are twice as large", "Hottel's rule has a half to forget",
              {grooves.view_factors: lambda *arguments: 2.0 * right_factors(*arguments)}),
    Mutant("strips without shadows", "light and viewer reach whole facets", "the first bounce is right without them",
              {grooves._met: lambda slope, theta_a: (right_met(slope, theta_a)[0],
                                                     np.where(right_met(slope, theta_a)[0] > 0.0, 1.0, 0.0))}),
)  # fmt: skip


# He et al.

right_jones, right_amplitudes = he_torrance._jones, fresnel.half_sum_and_difference


def printed_minus(*arguments: Any) -> tuple[Any, ...]:
    """Return the Jones matrix with the sign of M_ps as printed."""
    ss, sp, ps, pp = right_jones(*arguments)
    return ss, sp, -ps, pp


def not_turned(directions: Any, n: Any, k: Any) -> tuple[Any, ...]:
    """Return the Jones matrix of the facet without a turn of s and p."""
    half_sum, half_difference = right_amplitudes(he_torrance.cos_bisecting(directions), n, k)
    nothing = np.zeros_like(half_sum)
    return -(half_sum + half_difference), nothing, nothing, -(half_sum - half_difference)


def exchanged(cos: Any, n: Any, k: Any) -> tuple[Any, Any]:
    """Return half of the sum and of the difference of F_s and F_p, exchanged."""
    half_sum, half_difference = right_amplitudes(cos, n, k)
    return half_sum, -half_difference


right_specular, right_reflected = cuts.specular, cuts.reflected


def altered(**changes: float) -> dict[Function, Function]:
    """Return specular reflectance and albedo of another surface; a change is a factor, or the value of `a`."""

    def changed(surface: Any) -> Any:
        return {key: changes.get(key, 1.0) * value if key != "a" else changes.get(key, value)
                for key, value in surface.items()}  # fmt: skip

    return {
        right_specular: lambda surface, theta: right_specular(changed(surface), theta),
        right_reflected: lambda surface, theta, **options: right_reflected(changed(surface), theta, **options),
    }


HE_TORRANCE = (
    Mutant("mirrors without e^-g", "the specular part is |F|^2 S",
              "the lobe is added to a mirror that is already there",
              {right_specular: lambda surface, theta: right_specular({**surface, "wavelength_nm": 1e7}, theta)}),
    Mutant("reflectances with 1.5 tau", "the autocorrelation length is 1.5 times as long",
              "tau is read as the distance at which C(r) has fallen to a tenth", altered(tau_um=1.5)),
    Mutant("0.8 sigma_0 of reflectances", "the rms roughness is 0.8 times as large", "R_a of workshops is 0.8 of it",
              altered(sigma_0_um=0.8)),
    Mutant("a of 1", "all light that enters the surface returns", "no publication gives a", altered(a=1.0)),
    Mutant("M_ps without its minus", "eq. 64 as it is printed", "eq. 62 alone has the minus",
              {he_torrance._jones: printed_minus}),
    Mutant("s and p not turned", "the facet's s and p are taken for those of the mean surface",
              "they are the same in the plane of incidence", {he_torrance._jones: not_turned}),
    Mutant("F_s and F_p exchanged", "each polarisation has the amplitude of the other",
              "books differ in the meaning of parallel", {right_amplitudes: exchanged}),
    Mutant("amplitudes of a real index", "k is left out of F_s and F_p", "tables list n, and k in another column",
              {right_amplitudes: lambda cos, n, k: right_amplitudes(cos, n, 0.0 * k)}),
)  # fmt: skip


# Ward

right_density, right_sample = sampling.mixture_density, sampling.sample


def without_arctan(u1: Any, angle: Any, i: Any, lobe: Any) -> Any:
    """Return the directions of eq. 7a as printed: the root is delta, not its tangent."""
    phi = np.arctan2(lobe.alpha_y * np.sin(angle), lobe.alpha_x * np.cos(angle))
    delta = np.sqrt(-np.log(u1) / ((np.cos(phi) / lobe.alpha_x) ** 2 + (np.sin(phi) / lobe.alpha_y) ** 2))
    h = unit_vector(delta, phi)
    return 2.0 * np.sum(h * i, axis=-1, keepdims=True) * h - i


def of_half_vector(lobe: Any, i: Any, r: Any) -> Any:
    """Return the density of half vectors, without 1 / (4 h.i), in place of that of directions."""
    h = i + r
    h_i = np.linalg.norm(h, axis=-1) / 2.0
    return right_density(lobe, i, r) * 4.0 * h_i


def by_cosine(_: Any, u1: Any, u2: Any, wi: Any, **surface: Any) -> Any:
    """Return samples that follow the cosine of the viewer."""
    wr = unit_vector(np.arcsin(np.sqrt(u1)), 2.0 * np.pi * u2)
    f_r = ward_vectors(wi, wr, **surface)
    return sampling.Sample(wr, wr[..., 2] / np.pi, np.pi * f_r)


def mapped(shift: float) -> Function:
    """Return eq. 3 with another distance of target and camera in place of 2 D."""

    def eq_3(theta_c: Any, phi_c: Any, D: Any) -> Any:
        sine = np.sin(phi_c) * np.sin(theta_c)
        r_c = D * sine + np.sqrt(D**2 * sine**2 + 1.0 - D**2)
        x, y, z = r_c * np.cos(phi_c) * np.sin(theta_c), r_c * sine - shift * D, r_c * np.cos(theta_c)
        return unit_vector(np.arctan2(np.hypot(x, y), z), np.arctan2(y, x))

    return eq_3


def one_alpha(wi: Any, wr: Any, *, alpha_x: Any, alpha_y: Any, **rest: Any) -> Any:
    """Return f_r of eq. 4 with the geometric mean of both alphas."""
    alpha = np.sqrt(alpha_x * alpha_y)
    return ward_vectors(wi, wr, alpha_x=alpha, alpha_y=alpha, **rest)


def other_side(wi: Any, wr: Any, **surface: Any) -> Any:
    """Return f_r for light from the other side."""
    return ward_vectors(np.asarray(wi) * [-1.0, -1.0, 1.0], wr, **surface)


WARD = (
    Mutant("one alpha of lids and rays", "eq. 4 with sqrt(alpha_x alpha_y)",
              "an engine without tangents has no x axis",
              {ward_vectors: one_alpha}),
    Mutant("light from the other side of lids and spheres", "the lobe lies on the side of the light",
              "the paper's d_i may be read as the direction in which light travels", {ward_vectors: other_side}),
    Mutant("density of the half vector", "the density lacks 1 / (4 h.i)", "eq. 7 draws half vectors",
              {right_density: of_half_vector}),
    Mutant("samples along the normal", "half vectors are those of a light along the normal",
              "eq. 7 does not name the light",
              {sampling.mirrored_in_lobe: lambda u1, angle, i, lobe: without_arctan(
                  u1, angle, np.broadcast_to([0.0, 0.0, 1.0], np.shape(i)), lobe)}),
    Mutant("drawn by the cosine", "directions follow the cosine and not the lobe", "it is Lambert's sampler",
              {right_sample: by_cosine}),
    Mutant("D for 2 D", "D is taken for the distance of target and camera", "Fig. 3 draws one D",
              {gonioreflectometer.eq_3: mapped(1.0)}),
    Mutant("angles of the camera", "eq. 3 is left out", "the two are close where D is small",
              {gonioreflectometer.eq_3: lambda theta_c, phi_c, _: unit_vector(theta_c, phi_c)}),
)  # fmt: skip
