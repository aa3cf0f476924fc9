"""Limits of validity of He, Torrance, Sillion and Greenberg 1991, in the words of the paper, and the g of eq. 79."""

from __future__ import annotations

import math

import numpy as np

from brdfdb.models._limits import MUCH, ORDER, standing
from brdfdb.parameters import Arguments, Diagnostic, Standing, StatedLimit

_OPAQUE = 1.0 / (4.0 * math.pi)  # least k of a substance that absorbs light within a wavelength
_GENTLE = "Simplifications result by making the local tangent-plane approximation and assuming gentle roughness slopes."
_CHALLENGED = "the large ratio of σ_0/τ challenges the gentle slope assumption of the model"


def _g(arguments: Arguments) -> float:
    """Return g [1] of eq. 79 along the normal, where nothing is hidden and sigma equals sigma_0."""
    return float((4.0 * np.pi * arguments["sigma_0_um"] / (1e-3 * float(arguments["wavelength_nm"]))) ** 2)


G_ALONG_NORMAL = Diagnostic("g", "g along the normal, eq. 79", _g)


def lowest_cosine(arguments: Arguments) -> float:
    """Return the lowest cos theta_i [1] at which the largest reflectance of the surfaces is searched.

    It is a hundredth of sigma_0 / tau, within [1e-9, 1e-3]. At that angle shadowing has removed the specular part.
    """
    slope = np.min(np.asarray(arguments["sigma_0_um"]) / np.asarray(arguments["tau_um"]))
    return float(np.clip(1e-2 * slope, 1e-9, 1e-3))


def limits(arguments: Arguments) -> list[StatedLimit]:
    """Return the limits of validity of He et al. 1991, with the standing of the arguments at their wavelengths."""
    sigma, tau, a = (float(np.min(arguments[name])) for name in ("sigma_0_um", "tau_um", "a"))
    longest = float(np.max(arguments["wavelength_nm"])) / 1000.0
    slope, k = sigma / tau, float(np.min(arguments["k"]))
    # The second derivative along a line of Gaussian heights with eq. 48 has the variance 12 sigma_0^2 / tau^4
    radius = math.inf if sigma == 0.0 else tau * tau / (math.sqrt(12.0) * sigma)
    phase = (4.0 * math.pi * sigma / longest) ** 2
    gentle = standing(slope, 1.0 / MUCH, 1.0)
    rough: Standing = "inside" if phase >= MUCH else "at the edge" if phase > 1.0 else "outside"
    first_surface: Standing = "inside" if a > 0.0 else gentle if k >= _OPAQUE else "outside"
    return [
        StatedLimit(
            quantity="slope sigma_0 / tau",
            value=f"{slope:.3g}",
            valid="up to 0.1, at the edge below 1",
            standing=gentle,
            words=_GENTLE if gentle != "outside" else _CHALLENGED,
            where="He et al. 1991, section " + ("3.1" if gentle != "outside" else "4, of sandpaper"),
        ),
        StatedLimit(
            quantity="very rough, (v_z sigma_0)^2 at normal incidence, or gentle, sigma_0 / tau",
            value=f"{phase:.3g} at {1000.0 * longest:g} nm, or {slope:.3g}",
            valid="at least 10, at the edge above 1; or up to 0.1, at the edge below 1",
            standing=min(rough, gentle, key=ORDER.index),
            words="can be approximately evaluated under either of the following two conditions: [...] "
            "the surface is very rough [...] the surface has gentle slopes",
            where="He et al. 1991, appendix A.4, below eq. 49",
        ),
        StatedLimit(
            quantity="rms radius of curvature / wavelength",
            value="infinite" if sigma == 0.0 else f"{radius / longest:.3g} at {1000.0 * longest:g} nm",
            valid="at least 10, at the edge above 1",
            standing=standing(longest / radius, 1.0 / MUCH, 1.0),
            words="The approximation is valid when the local radius of curvature of the surface is large compared to "
            "the wavelength.",
            where="He et al. 1991, section 2.2",
        ),
        StatedLimit(
            quantity="reflections but the first",
            value=f"a = {a:g}, k = {k:.3g}, sigma_0 / tau = {slope:.3g}",
            valid="a above 0, or k at least 1 / (4 pi) and gentle slopes",
            standing=first_surface,
            words="This contribution is small for metallic (opaque) surfaces with shallow roughness slopes. However, "
            "the contribution can be important for surfaces with large slopes, or for nonmetals",
            where="He et al. 1991, section 3.2.3",
        ),
    ]
