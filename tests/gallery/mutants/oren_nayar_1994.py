"""Wrong forms of Oren and Nayar 1994: the facets, the fit to them, and the surface above."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from brdfdb.geometry import checked_angles
from brdfdb.models import oren_nayar_1994 as surfaces
from brdfdb.models import oren_nayar_single_slope_parts
from brdfdb.models import torrance_sparrow_1967 as surface_part
from tests.gallery.mutants import added_figures
from tests.gallery.mutants.mutation import Mutant

PREFIX = "oren-nayar-1994-"

Function = Callable[..., Any]
Parts = surfaces.Parts

SLOPES, AZIMUTHS = 96, 96  # nodes of the facets
HORIZON = 6.123233995736766e-17  # cosine of the float64 nearest pi/2

right_facets = surfaces._gaussian
right_lobe = surface_part.facets


@dataclass(frozen=True)
class Facets:
    """Eqs 8 to 26 as a plain sum over facets, with its possible mistakes as fields."""

    shadowing: Function = lambda light, viewer: np.minimum(1.0, np.minimum(light, viewer))  # eq. 11
    weight: Function = lambda theta_a, sigma: np.exp(-(theta_a**2) / (2.0 * sigma**2)) * np.sin(theta_a)
    one_side: bool = False  # only the facet that faces the light, in place of both, eq. 22
    bounce_changes: bool = False  # If false, the second bounce is the model's, which takes a tenth of the time

    def gaussian(self, directions: Any, rho: Any, sigma: Any, only: Any = None) -> Parts:
        """Return direct and twice reflected f_r [1/sr], with the signature of `_gaussian` of the model."""
        d, sigma = directions, float(sigma)
        if sigma == 0.0:
            return right_facets(directions, rho, sigma, only)
        x, w = np.polynomial.legendre.leggauss(SLOPES)
        reach = min(np.pi / 2.0, 6.0 * sigma)
        theta_a, w = 0.5 * reach * (x + 1.0), 0.5 * reach * w
        P = self.weight(theta_a, sigma) * w
        phi_a = 2.0 * np.pi * (np.arange(AZIMUTHS) + 0.5) / AZIMUTHS
        S, C = np.sin(theta_a)[:, None], np.cos(theta_a)[:, None]
        light, viewer = np.broadcast_arrays(d.sin_i / d.cos_i + 0.0 * d.cos_dphi, d.sin_r / d.cos_r)
        azimuth = np.broadcast_to(np.arctan2(d.sin_dphi, d.cos_dphi), light.shape)
        direct, bounced = np.empty(light.shape), np.empty(light.shape)
        for at in np.ndindex(light.shape):
            p, q = S * light[at] * np.cos(phi_a), S * viewer[at] * np.cos(phi_a - azimuth[at])
            direct[at] = P @ self.direct(p, q, C).mean(axis=1)
            bounced[at] = P @ self.bounce(p, q, S, C).mean(axis=1) if self.bounce_changes else 0.0
        bounced = rho**2 / np.pi * bounced / P.sum()
        if not self.bounce_changes:
            bounced = right_facets(directions, rho, sigma, "interreflected").interreflected
        return Parts(rho / np.pi * direct / P.sum(), bounced)

    def direct(self, p: Any, q: Any, C: Any) -> Any:
        """Return eqs 10 and 11 over E_0 cos(theta_i) rho / pi [1]; p and q are those of `_oren_nayar_facets`."""
        s_a, v_a = C + p, C + q
        lit = (s_a > 0.0) & (v_a > 0.0)
        both = np.where(lit, s_a, 1.0), np.where(lit, v_a, 1.0)
        value = np.where(lit, s_a * v_a / C * self.shadowing(2.0 * C / both[0], 2.0 * C / both[1]), 0.0)
        return 2.0 * np.where(p > 0.0, value, 0.0) if self.one_side else value

    def bounce(self, p: Any, q: Any, S: Any, C: Any) -> Any:
        """Return eqs 15 to 20 over E_0 cos(theta_i) rho^2 / pi [1], for light on the adjacent facet."""
        return added_figures.facet(p, q, S, C)

    def functions(self) -> dict[Function, Function]:
        return {right_facets: self.gaussian}


def thetas(directions: Any) -> tuple[Any, Any]:
    """Return theta_i and theta_r [rad]."""
    return np.arctan2(directions.sin_i, directions.cos_i), np.arctan2(directions.sin_r, directions.cos_r)


@dataclass(frozen=True)
class Fit:
    """Eqs 27, 28 and 30, with their possible mistakes as fields."""

    alpha: Function = np.maximum
    beta: Function = np.minimum
    sigma: float = 1.0
    offset: float = 0.33
    cube: float = 1.0  # the part of C_2 that holds away from the light alone
    third: float = 1.0  # C_3
    bounced: float = 1.0
    power: int = 2  # of rho in eq. 28
    sign: float = 1.0  # of cos(phi_r - phi_i)
    irradiance: bool = False  # cos(theta_i) in f_r

    def fit(self, directions: Any, rho: Any, sigma: Any, interreflection: Any) -> Any:
        """Return f_r [1/sr] of eqs 27 and 28."""
        (theta_i, theta_r), s2 = thetas(directions), (np.asarray(sigma) * self.sigma) ** 2
        cos = self.sign * directions.cos_dphi
        alpha, beta = self.alpha(theta_i, theta_r), self.beta(theta_i, theta_r)
        # Eq. (27)
        C_1 = 1.0 - 0.5 * s2 / (s2 + self.offset)
        forward = np.where(cos >= 0.0, 0.0, self.cube * (2.0 * beta / np.pi) ** 3)
        C_2 = 0.45 * s2 / (s2 + 0.09) * (np.sin(alpha) - forward)
        C_3 = self.third * 0.125 * s2 / (s2 + 0.09) * (4.0 * alpha * beta / np.pi**2) ** 2
        direct = C_1 + cos * C_2 * np.tan(beta) + (1.0 - np.abs(cos)) * C_3 * np.tan((alpha + beta) / 2.0)
        # Eq. (28)
        bounce = 0.17 * s2 / (s2 + 0.13) * (1.0 - cos * (2.0 * beta / np.pi) ** 2)
        f_r = rho / np.pi * direct + self.bounced * interreflection * rho**self.power / np.pi * bounce
        return self.finished(np.maximum(f_r, 0.0), directions)

    def qualitative(self, directions: Any, rho: Any, sigma: Any, offset: Any) -> Any:
        """Return f_r [1/sr] of eq. 30."""
        (theta_i, theta_r), s2 = thetas(directions), (np.asarray(sigma) * self.sigma) ** 2
        cos = self.sign * directions.cos_dphi
        alpha, beta = self.alpha(theta_i, theta_r), self.beta(theta_i, theta_r)
        # Eq. (30)
        A = 1.0 - 0.5 * s2 / (s2 + offset)
        B = 0.45 * s2 / (s2 + 0.09)
        f_r = rho / np.pi * (A + B * np.maximum(0.0, cos) * np.sin(alpha) * np.tan(beta))
        return self.finished(f_r, directions)

    def finished(self, f_r: Any, directions: Any) -> Any:
        return surfaces.finished(f_r * (directions.cos_i if self.irradiance else 1.0), directions)

    def functions(self) -> dict[Function, Function]:
        return {
            surfaces._functional: lambda d, out, *parameters: self.fit(d, *parameters),
            surfaces._qualitative: lambda d, out, rho, sigma, offset: self.qualitative(
                d, rho, sigma, np.where(offset == 0.33, self.offset, offset)
            ),
        }


def rougher(factor: float) -> dict[Function, Function]:
    """Return all functions of sigma with a multiple of it."""
    return {
        **Fit(sigma=factor).functions(),
        right_facets: lambda d, rho, sigma, only=None: right_facets(d, rho, factor * np.asarray(sigma), only),
        right_lobe: lambda d, sigma, n, k: right_lobe(d, factor * np.asarray(sigma), n, k),
    }


def turned(directions: Any) -> Any:
    """Return the same directions with the light on the other side."""
    angles = thetas(directions)
    return checked_angles(angles[0], 0.0, angles[1], np.arctan2(directions.sin_dphi, directions.cos_dphi) + np.pi)


def from_behind() -> dict[Function, Function]:
    """Return all functions with the light on the other side."""
    return {
        **Fit(sign=-1.0).functions(),
        right_facets: lambda d, rho, sigma, only=None: right_facets(turned(d), rho, sigma, only),
        right_lobe: lambda d, sigma, n, k: right_lobe(turned(d), sigma, n, k),
    }


def facets_scaled(direct: Function, bounce: Function) -> Function:
    """Return the facets with functions of their two parts."""

    def gaussian(d: Any, rho: Any, sigma: Any, only: Any = None) -> Parts:
        first, second = right_facets(d, rho, sigma, only)
        return Parts(direct(d, first), bounce(d, second))

    return gaussian


def same(_: Any, value: Any) -> Any:
    return value


def nothing(_: Any, value: Any) -> Any:
    return 0.0 * value


def radiance() -> dict[Function, Function]:
    """Return all functions with the cosine of the light in f_r."""
    cosine = lambda d, value: value * d.cos_i  # noqa: E731  # The two arguments are those of `facets_scaled`
    return {
        **Fit(irradiance=True).functions(),
        right_facets: facets_scaled(cosine, cosine),
        right_lobe: lambda d, sigma, n, k: right_lobe(d, sigma, n, k) * d.cos_i,
    }


def flat() -> dict[Function, Function]:
    """Return Lambert's model in place of all functions."""

    def fit(d: Any, rho: Any) -> Any:
        return surfaces.finished(rho / np.pi + 0.0 * d.cos_i * d.cos_r * d.cos_dphi, d)

    return {
        surfaces._functional: lambda d, out, rho, *_: fit(d, rho),
        right_facets: lambda d, rho, sigma, only=None: Parts(fit(d, rho), 0.0 * fit(d, rho)),
    }


def fitted(d: Any, rho: Any, sigma: Any, only: Any = None) -> Parts:
    """Return direct and twice reflected f_r [1/sr] of the fit."""
    fit = Fit()
    direct = fit.fit(d, rho, sigma, False)
    return Parts(direct, fit.fit(d, rho, sigma, True) - direct)


def bounce_by_eq_48(d: Any, rho: Any, sigma: Any, only: Any = None) -> Parts:
    """Return the facets with the second bounce of eq. 49, which is eq. 48 integrated, as in the atlas."""
    (theta_i, theta_r), azimuth = thetas(d), np.arctan2(d.sin_dphi, d.cos_dphi)
    angles = [angle[..., None] for angle in np.broadcast_arrays(theta_i, 0.0, theta_r, azimuth)]
    x, w = np.polynomial.legendre.leggauss(SLOPES)
    theta_a = 0.5 * np.pi * 0.5 * (x + 1.0)
    if float(sigma) == 0.0:
        return right_facets(d, rho, sigma, only)
    P = w * np.exp(-(theta_a**2) / (2.0 * float(sigma) ** 2)) * np.sin(theta_a)
    one = oren_nayar_single_slope_parts(*angles, rho=float(rho), theta_a=theta_a)
    return Parts(right_facets(d, rho, sigma, only).direct, one.interreflected @ P / P.sum())


UNCHANGED = (
    Mutant("facets anew", "nothing", "the sum that the other mutants change", Facets(bounce_changes=True).functions()),
    Mutant("the fit anew", "nothing", "the fit that the other mutants change", Fit().functions()),
)

MUTANTS = (
    Mutant("sigma times 0.8", "the slopes are 0.8 times as steep",
           "the mean of abs(theta_a) is 0.8 times the standard deviation", rougher(0.8)),
    Mutant("the fit for the integral", "eqs 27 and 28 stand in place of the facets",
           "the paper gives both, and the fit is a thousand times as fast", {right_facets: fitted}),
    Mutant("no interreflection", "light that two facets reflect is left out, eqs 18 and 28",
           "the paper itself leaves it out of eq. 30",
           {**Fit(bounced=0.0).functions(), right_facets: facets_scaled(same, nothing)}),
    Mutant("no interreflection in the fit", "eq. 28 is left out", "most renderers have eq. 27 alone",
           Fit(bounced=0.0).functions()),
    Mutant("GAF with Max", "the larger of shadowing and masking counts", "eq. 11 is printed like that",
           Facets(shadowing=lambda light, viewer: np.minimum(1.0, np.maximum(light, viewer))).functions()),
    Mutant("no shadowing and masking", "GAF is 1", "Table 1 begins with that row",
           Facets(shadowing=lambda light, viewer: np.ones_like(light)).functions()),
    Mutant("one facet of a cavity", "the mean of both facets, eq. 22, is that of the facet towards the light",
           "the other one is often dark", Facets(one_side=True).functions()),
    Mutant("eq. 48 for 47", "the interreflection factor is pi (1 - cos theta_a) (1 - m_s) (1 - m_v)",
           "the paper replaces it to have a closed form", {right_facets: bounce_by_eq_48}),
    Mutant("slopes without their sine", "eq. 25 is weighted by P without sin(theta_a)",
           "a Gaussian in one angle is normalised over that angle",
           Facets(weight=lambda slope, sigma: np.exp(-0.5 * (slope / sigma) ** 2), bounce_changes=True).functions()),
    Mutant("Lambert", "f_r is rho / pi", "it is the f_r of a surface without roughness", flat()),
    Mutant("0.57 for 0.33", "the constant of C_1 and A is 0.57", "note 7 offers it for the qualitative model",
           Fit(offset=0.57).functions()),
    Mutant("alpha and beta exchanged", "alpha is the smaller of the two angles",
           "eq. 27 has both, and their names are alike", Fit(alpha=np.minimum, beta=np.maximum).functions()),
    Mutant("C_2 with one branch", "(2 beta / pi)^3 is left out of C_2 away from the light",
           "eq. 30 has one branch", Fit(cube=0.0).functions()),
    Mutant("no C_3", "the third term of eq. 27 is left out", "section 4.4 finds it small", Fit(third=0.0).functions()),
    Mutant("rho for rho^2", "eq. 28 has rho once", "eq. 27 has it once", Fit(power=1).functions()),
    Mutant("light from the other side", "radiance grows away from the light",
           "where directions of light point along it, phi_i is half a turn off", from_behind()),
    Mutant("radiance for f_r", "f_r has cos(theta_i) in it", "the paper's equations are radiances", radiance()),
    Mutant("E_0 of 1", "the surface is pi times stronger", "eq. 31 prints no E_0",
           {right_lobe: lambda d, sigma, n, k: right_lobe(d, sigma, n, k) * np.pi}),
    Mutant("eq. 31 times cos(theta_r)", "1 / cos(theta_r) is left out of the surface",
           "the lobe is often given for intensity, which has this cosine",
           {right_lobe: lambda d, sigma, n, k: right_lobe(d, sigma, n, k) * d.cos_r}),
    *added_figures.OREN_NAYAR,
)  # fmt: skip
