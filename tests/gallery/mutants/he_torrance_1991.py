"""Wrong forms of He et al. 1991, as changes of one plain evaluation of eqs 71 to 84 in NumPy."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from brdfdb import fresnel
from brdfdb.models import he_torrance_1991 as model
from brdfdb.models import he_torrance_1991_limits as limits
from brdfdb.models._diffraction_series import diffraction_series
from brdfdb.models._he_torrance_kernels import hidden, shadowing, variance
from tests.gallery.mutants import added_figures
from tests.gallery.mutants.mutation import Mutant

PREFIX = "he-torrance-1991-"

Function = Callable[..., Any]


def effective(sin_i: Any, cos_i: Any, sin_r: Any, cos_r: Any, slope: Any) -> Any:
    """Return (sigma / sigma_0)^2 [1] of eqs 80 to 83."""
    return variance(hidden(sin_i, cos_i, slope) + hidden(sin_r, cos_r, slope))


@dataclass(frozen=True)
class Form:
    """Eqs 71 to 84 with their parts as fields, so that a mutant changes the value of a field."""

    tau: float = 1.0
    sigma_0: float = 1.0
    uniform: float = 1.0 / np.pi  # f_r over a
    smith: Function = shadowing
    variance: Function = effective
    squared: Function = model.v_squared
    bisecting: Function = model.cos_bisecting
    reflectance: Function = fresnel.unpolarised
    series: Function = diffraction_series
    wave_number: bool = True  # in v_xy of eq. 78
    attenuation: Function = lambda g: np.exp(-g)  # of the specular part
    prefactor: float = 1.0
    viewer: Function = np.ones_like  # a factor of the cosine of the viewer

    def diffuse(self, directions: Any, surface: Any) -> Any:
        """Return the directional diffuse f_r [1/sr], eq. 71, over |F|^2."""
        wave, correlation, slope = surface.features
        wave, correlation, slope = wave * self.sigma_0**2, correlation * self.tau**2, slope * self.sigma_0 / self.tau
        d = directions
        v_xy2, v_z2 = self.squared(d)
        g_over_vz2 = wave * self.variance(d.sin_i, d.cos_i, d.sin_r, d.cos_r, slope)
        V = correlation * v_xy2 * (1.0 if self.wave_number else (surface.wavelength_um / (2.0 * np.pi)) ** 2)
        shadow = self.smith(d.sin_i, d.cos_i, slope) * self.smith(d.sin_r, d.cos_r, slope)
        G = (v_xy2 + v_z2) ** 2
        value = correlation / (4.0 * np.pi) * shadow * g_over_vz2 * G * self.series(g_over_vz2 * v_z2, V)
        return self.prefactor * value * self.viewer(d.cos_r)

    def f_r(self, directions: Any, surface: Any, a: Any, out: Any = None) -> Any:
        """Return f_r [1/sr] without the specular part."""
        F2 = self.reflectance(self.bisecting(directions), surface.n, surface.k)
        uniform = self.uniform * a * self.viewer(directions.cos_r)
        return model.finished(F2 * self.diffuse(directions, surface) + uniform, directions)

    def parts(self, directions: Any, surface: Any, a: Any) -> Any:
        """Return the directional and the uniform diffuse part [1/sr]."""
        directional = self.f_r(directions, surface, 0.0) + np.zeros(np.shape(a))
        uniform = self.uniform * a * self.viewer(directions.cos_r) + np.zeros(np.shape(directional))
        return limits.HeTorranceParts(directional, model.finished(uniform, directions))

    def rho_s(self, directions: Any, surface: Any) -> Any:
        """Return the specular reflectance [1], eq. 73."""
        wave, _, slope = surface.features
        sin, cos, slope = directions.sin_i, directions.cos_i, slope * self.sigma_0 / self.tau
        g = 4.0 * cos**2 * wave * self.sigma_0**2 * self.variance(sin, cos, sin, cos, slope)
        S = (self.smith(sin, cos, slope) * cos) ** 2
        return self.reflectance(cos, surface.n, surface.k) * self.attenuation(g) * S

    def very_rough(self, directions: Any, slope: Any, n: Any, k: Any, a: Any) -> Any:
        """Return f_r [1/sr] in the limit of very rough surfaces."""
        d, slope = directions, slope * self.sigma_0 / self.tau
        v_xy2, v_z2 = self.squared(d)
        tan2, slope2 = v_xy2 / v_z2, slope**2 * self.variance(d.sin_i, d.cos_i, d.sin_r, d.cos_r, slope)
        lobe = np.exp(-tan2 / (4.0 * slope2)) / (16.0 * np.pi * slope2) * (1.0 + tan2) ** 2
        shadow = self.smith(d.sin_i, d.cos_i, slope) * self.smith(d.sin_r, d.cos_r, slope)
        value = self.prefactor * self.reflectance(self.bisecting(d), n, k) * lobe * shadow + self.uniform * a
        return model.finished(value * self.viewer(d.cos_r), d)

    def smooth(self, directions: Any, n: Any, k: Any) -> Any:
        """Return the reflectance [1] of a smooth surface."""
        return model.finished(self.reflectance(directions.cos_i, n, k), directions)

    def functions(self) -> dict[Function, Function]:
        """Return all functions of the model with those of this form."""
        return {
            model._f_r: self.f_r,
            model.directional_diffuse: self.diffuse,
            model.rho_s: self.rho_s,
            limits._parts: self.parts,
            limits._very_rough: self.very_rough,
            limits._smooth: self.smooth,
        }


def without_shadow(sin: Any, cos: Any, slope: Any) -> Any:
    """Return S_1 / cos(theta) [1] with S_1 of 1."""
    return 1.0 / (cos + 0.0 * slope)


def without_gaussian(sin: Any, cos: Any, slope: Any) -> Any:
    """Return S_1 / cos(theta) [1] by eqs 24 and 25 as printed."""
    cot = cos / np.maximum(sin, 1e-30)
    x = np.minimum(cot / np.maximum(2.0 * slope, 1e-30), 30.0)
    erfc = np.vectorize(math.erfc, otypes=[float])(x)
    Lambda = 0.5 * (2.0 / np.sqrt(np.pi) * slope / cot - erfc)
    return (1.0 - 0.5 * erfc) / (Lambda + 1.0) / cos


def no_reduction(sin_i: Any, cos_i: Any, sin_r: Any, cos_r: Any, slope: Any) -> Any:
    """Return (sigma / sigma_0)^2 of 1."""
    return np.ones_like(sin_i * sin_r * slope)


def ten_terms(g: Any, V: Any) -> Any:
    """Return ten terms of the sum of eq. 78 over g [1]."""
    total, factorial = 0.0, 1.0
    for m in range(1, 11):
        factorial *= m
        total = total + g ** (m - 1) * np.exp(-g - V / m) / (factorial * m)
    return total


def beckmann(g: Any, V: Any) -> Any:
    """Return the limit exp(-V / g) / g of the sum over g [1], 0 for smooth surfaces."""
    safe = np.maximum(g, 1e-100)
    return np.where(g > 0.0, np.exp(-np.minimum(V / safe, 700.0)) / safe / safe, 0.0)


def backwards(directions: Any) -> tuple[Any, Any]:
    """Return v_xy^2 and v_z^2 [1] for the paper's azimuth, that of light which travels towards the surface."""
    d = directions
    v_xy2 = d.sin_i**2 + d.sin_r**2 - 2.0 * d.sin_i * d.sin_r * d.cos_dphi
    return np.maximum(v_xy2, 0.0), model.v_squared(d)[1]


def one_cone(first: Any, second: Any, apart: Any) -> Any:
    """Return the solid angle [sr] of the whole receiver with its axis in the cone of light, without an average."""
    return np.where(apart <= first, 2.0 * np.pi * (1.0 - np.cos(second)), 0.0)


def of(name: str, changes: str, because: str, **fields: Any) -> Mutant:
    """Return the mutant with changed fields of `Form`."""
    return Mutant(name, changes, because, Form(**fields).functions())


UNCHANGED = (Mutant("eqs 71 to 84 anew", "nothing", "the twin that the others change", Form().functions()),)

MUTANTS = (
    of("tau times 1.5", "the autocorrelation length is 1.5 times as long",
       "C(r) falls to 1 / e at tau, eq. 48, and to a tenth at 1.5 tau, which others call its length", tau=1.5),
    of("sigma_0 times 0.8", "the rms roughness is 0.8 times as large",
       "the mean of abs(z), R_a of workshops, is 0.8 times the rms roughness", sigma_0=0.8),
    of("a without 1 / pi", "the uniform diffuse part is a", "eqs 8 and 72 are printed like that", uniform=1.0),
    of("v without the wave number", "v_xy of eq. 78 has no 2 pi / lambda", "eq. 84 is printed without it",
       wave_number=False),
    of("no shadowing", "S is 1", "it is 1 at small angles, which are tried first", smith=without_shadow),
    of("Smith's Lambda without its Gaussian", "exp(-x^2) is left out of eq. 25", "eq. 25 is printed like that",
       smith=without_gaussian),
    of("sigma_0 for sigma", "the effective roughness is sigma_0 at every angle", "eqs 80 to 83 need a root search",
       variance=no_reduction),
    of("|F|^2 of 1", "nothing is absorbed", "Fresnel's factor is added later, with the colours",
       reflectance=lambda cos, n, k: np.ones_like(cos * n * k)),
    of("|F|^2 at normal incidence", "|F|^2 does not depend on the angle", "a colour is stored in place of n and k",
       reflectance=lambda cos, n, k: fresnel.unpolarised(np.ones_like(cos), n, k)),
    of("k of 0", "the index is real", "tables list n, and k in another column",
       reflectance=lambda cos, n, k: fresnel.unpolarised(cos, n, 0.0 * k)),
    of("|F|^2 at the angle of incidence", "|F|^2 is not taken at the bisecting angle", "eq. 6 has it so",
       bisecting=lambda d: d.cos_i + 0.0 * d.cos_r),
    of("Beckmann's limit", "exp(-v_xy^2 tau^2 / 4 g) / g stands in place of the sum of eq. 78",
       "the sum has no end", series=beckmann),
    of("ten terms", "the sum of eq. 78 ends at m = 10", "many implementations have a fixed number of terms",
       series=ten_terms),
    of("no e^-g", "the specular part is |F|^2 S", "the lobe is added to a mirror that is already there",
       attenuation=lambda g: np.ones_like(g)),
    of("g of one cosine", "g of the specular part is a quarter", "cos(theta_i) + cos(theta_r) is read as cos(theta_i)",
       attenuation=lambda g: np.exp(-g / 4.0)),
    of("without pi", "the directional diffuse part is pi times as large",
       "it is lost where eqs 71, 76 and 78 are put together", prefactor=np.pi),
    of("light from the other side", "the lobe lies on the side of the light",
       "the paper's phi_i is that of light which travels towards the surface", squared=backwards),
    of("the cosine of the viewer in f_r", "f_r is multiplied by cos(theta_r)",
       "intensity, which a photometer on an arm measures, has this cosine", viewer=lambda cos: cos),
    Mutant("one cone", "the specular peak is not averaged over the receiver",
           "eq. 6 has the solid angle of the light alone", {limits.common_solid_angle: one_cone}),
    *added_figures.HE_TORRANCE,
)  # fmt: skip
