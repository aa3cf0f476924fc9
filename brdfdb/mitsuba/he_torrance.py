"""He, Torrance, Sillion and Greenberg 1991 in Dr.Jit: the directional diffuse, uniform diffuse and specular part."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.mitsuba._buffers import Buffer, polynomial, whole
from brdfdb.mitsuba._gaussian_lobe import GaussianLobe
from brdfdb.mitsuba._grid import CellPlace
from brdfdb.mitsuba._parameters import PluginParameters, spectrum_of
from brdfdb.mitsuba._surface import DIFFUSE, GLOSSY, SPECULAR, Facet, Formula, Values
from brdfdb.mitsuba._wavelengths import SRGB, channels_nm, projection
from brdfdb.mitsuba.diffuse import one_less_exp
from brdfdb.models import MODELS
from brdfdb.models._diffraction_series import diffraction_series as exact_series
from brdfdb.models._he_torrance_kernels import variance
from brdfdb.parameters import WAVELENGTH_NM, K, N
from brdfdb.spectra import PICTURE_NM, picture_wavelengths

Array = NDArray[np.float64]

_LEAST_COS = 6.1e-17  # cosine of the horizon: the model is finite there
_LEAST = 1e-30
_X_MAX = 9.0  # largest x; erfc(x) and exp(-x^2) are 0 in float32 well below it
_LARGEST = 1e38  # f_r [1/sr] stays below
_STEEPEST = 1e-3  # least cosine in the lobe of samples
_ALPHA_RANGE = (1e-6, 2.0)  # of the lobe of samples
# exp(x^2) erfc(x) times x + 3: Chebyshev's series in (x - 3) / (x + 3), the highest power first
_ERFCX = (
    6.78438519e-05,
    -0.000210922502,
    -0.000507882505,
    0.00297335628,
    -0.00123234629,
    -0.0268017128,
    0.119532295,
    -0.310471714,
    0.590227962,
    -0.883394241,
    1.07400692,
)

# The table of the sum of eq. 78 holds its logarithm, plus t = V / (10 + g), over ln(g) and t / (t + 10). Its error is
# below 1e-6 where the sum is above 1e-26 of its largest value. Below the least g the sum is its first term, e^-V, and
# values that differ are smaller than 1e-8 of it. Above the largest g it is a function of V / g
_LOG_G_LOW = -18.0
_LOG_G_HIGH = 18.0
_OFFSET = 10.0  # of g in t
_SCALE = 10.0  # of t
_FARTHEST = 100.0  # largest t
_G_LOW = math.exp(_LOG_G_LOW)
_G_HIGH = math.exp(_LOG_G_HIGH)
_PATCHES_G = 288
_PATCHES_V = 160
_LOG_K_HIGH = 37.0  # largest ln(1 + K)
_PATCHES_K = 256

_DEGREE = 3  # of patches
_NODES = np.cos(np.pi * (np.arange(_DEGREE + 1) + 0.5) / (_DEGREE + 1))  # Chebyshev's, in [-1, 1]
_TO_POWERS = np.linalg.inv(np.vander((1.0 + _NODES) / 2.0, increasing=True))  # of a variable in [0, 1]


class PatchAxis(NamedTuple):
    """The range of a variable and the number of patches along it."""

    low: float
    high: float
    patches: int

    @property
    def nodes(self) -> Array:
        """The places of interpolation, shape (patches, 4)."""
        size = (self.high - self.low) / self.patches
        return np.asarray(self.low + size * (np.arange(self.patches)[:, np.newaxis] + (1.0 + _NODES) / 2.0))

    def place(self, x: Any) -> CellPlace:
        """Return the patch that holds x; beyond an end, the end."""
        size = (self.high - self.low) / self.patches
        number = whole((x - self.low) * (1.0 / size), self.patches)
        return CellPlace(number, dr.clip((x - (self.low + size * number)) * (1.0 / size), 0.0, 1.0))


class Patches:
    """Cubic polynomials in each variable that interpolate a smooth function patch by patch, and are differentiable."""

    def __init__(self, function: Callable[..., Array], *axes: PatchAxis) -> None:
        self._axes = axes
        if len(axes) == 1:
            powers = function(axes[0].nodes) @ _TO_POWERS.T
        else:
            values = function(*np.broadcast_arrays(axes[0].nodes[:, :, np.newaxis, np.newaxis], axes[1].nodes))
            powers = np.einsum("kx,pxqy,ly->pqkl", _TO_POWERS, values, _TO_POWERS)
        self._rows = Buffer(powers)

    def __call__(self, *variables: Any) -> Any:
        """Return the function at numbers, or arrays of one number a ray."""
        places = [axis.place(x) for axis, x in zip(self._axes, variables, strict=True)]
        size = _DEGREE + 1
        if len(places) == 1:
            return polynomial(self._rows.row(places[0].cell, size), places[0].t)
        row = self._rows.row(places[0].cell * self._axes[1].patches + places[1].cell, size * size)
        return polynomial([polynomial(row[size * k : size * (k + 1)], places[1].t) for k in range(size)], places[0].t)


@functools.cache
def _series_patches() -> Patches:
    def logarithm(log_g: Array, share: Array) -> Array:
        g = np.exp(log_g)
        t = _SCALE * share / (1.0 - share)
        return np.asarray(np.log(exact_series(g, (_OFFSET + g) * t)) + t)

    last = _FARTHEST / (_FARTHEST + _SCALE)
    return Patches(logarithm, PatchAxis(_LOG_G_LOW, _LOG_G_HIGH, _PATCHES_G), PatchAxis(0.0, last, _PATCHES_V))


@functools.cache
def _variance_patches() -> Patches:
    return Patches(lambda log_K: np.asarray(variance(np.expm1(log_K))), PatchAxis(0.0, _LOG_K_HIGH, _PATCHES_K))


def diffraction_series(g: Any, V: Any) -> Any:
    """Return the sum [1] of eq. 78 divided by g, as `brdfdb.models._diffraction_series.diffraction_series` does.

    It reads a table of the sum that `brdfdb.models` computes: its cost is the same for every g and V.
    """
    inside = dr.clip(g, _G_LOW, _G_HIGH)
    beyond = dr.minimum(_G_HIGH / dr.maximum(g, _G_HIGH), 1.0)
    t = dr.minimum(V * beyond / (_OFFSET + inside), _FARTHEST)
    return dr.exp(_series_patches()(dr.log(inside), t / (t + _SCALE)) - t) * dr.square(beyond)


def effective_variance(K: Any) -> Any:
    """Return (sigma / sigma_0)^2 [1] of eqs 80-81 for K = K_i + K_r."""
    return _variance_patches()(dr.log(1.0 + K))


class OpticalSurface(NamedTuple):
    """Factors g / (v_z^2 (sigma / sigma_0)^2) and V / v_xy^2, the ratio sigma_0 / tau, and n and k, all [1]."""

    wave: Any
    correlation: Any
    slope: Any
    n: Any
    k: Any


class Shadowing(NamedTuple):
    """S_1(theta) / cos theta [1] of eqs 23-25, and K [1] of eqs 82-83."""

    over_cos: Any
    K: Any


def shadowing(w: Any, slope: Any) -> Shadowing:
    """Return the shadowing of a direction above the horizon."""
    sin, cos = dr.sqrt(dr.maximum(dr.square(w.x) + dr.square(w.y), _LEAST)), dr.maximum(w.z, _LEAST_COS)
    x = dr.minimum(cos / dr.maximum(2.0 * slope * sin, _LEAST), _X_MAX)
    gaussian = dr.select(x < _X_MAX, dr.exp(-dr.square(x)), 0.0)
    erfc = gaussian * _erfcx(x)
    Q = 1.0 - 0.5 * erfc
    return Shadowing(Q / (Q * cos + slope * dr.inv_sqrt_pi * sin * gaussian), sin / cos * erfc)


def _erfcx(x: Any) -> Any:
    """Return exp(x^2) erfc(x) [1] for x >= 0, within 3e-7 relative."""
    s = (x - 3.0) / (x + 3.0)
    p: Any = _ERFCX[0]
    for coefficient in _ERFCX[1:]:
        p = p * s + coefficient
    return p / (x + 3.0)


class _Interface(NamedTuple):
    """An interface to n + ik at one angle: (n + ik)^2 - 1 = w, and the root q = a + ib of cos^2 + w, a, b >= 0."""

    w_re: Any
    w_im: Any
    e_re: Any
    a: Any
    b: Any


def _interface(cos: Any, n: Any, k: Any) -> _Interface:
    cos2, sin2 = dr.square(cos), (1.0 - cos) * (1.0 + cos)
    e_re = (n - k) * (n + k)
    n_less_1 = n - 1.0
    w_re, w_im = n_less_1 * (n_less_1 + 2.0) - dr.square(k), 2.0 * n * k
    q2_re = dr.select(cos2 < 0.5, cos2 + w_re, e_re - sin2)
    large = dr.sqrt(dr.maximum(0.5 * (_modulus(q2_re, w_im) + dr.abs(q2_re)), _LEAST))
    small = 0.5 * w_im / large
    a, b = dr.select(q2_re >= 0.0, large, small), dr.select(q2_re >= 0.0, small, large)
    return _Interface(w_re, w_im, e_re, a, b)


def reflectance(cos: Any, n: Any, k: Any) -> Any:
    """Return |F|^2 [1] of unpolarised light at an interface to n + ik, as `brdfdb.fresnel.unpolarised`."""
    w_re, w_im, e_re, a, b = _interface(cos, n, k)
    cos2, sin2 = dr.square(cos), (1.0 - cos) * (1.0 + cos)
    w_abs = _modulus(w_re, w_im)
    F_s = w_abs / dr.maximum(dr.square(cos + a) + dr.square(b), _LEAST)
    below = dr.square(e_re * cos + a) + dr.square(w_im * cos + b)
    F_p = w_abs * _modulus(cos2 * e_re - sin2, cos2 * w_im) / dr.maximum(below, _LEAST)
    return dr.minimum(0.5 * (dr.square(F_s) + dr.square(F_p)), 1.0)


def facet(cos: Any, n: Any, k: Any) -> Facet:
    """Return the Mueller matrix of an interface to n + ik, as `brdfdb.models.he_torrance_facet_mueller`.

    F_s + F_p and F_s - F_p are sin^2 and q cos times one number, so that neither is a difference.
    """
    _, _, _, a, b = _interface(cos, n, k)
    sin2 = (1.0 - cos) * (1.0 + cos)
    of_sum, of_difference = dr.square(sin2), (dr.square(a) + dr.square(b)) * dr.square(cos)
    inverse = 1.0 / dr.maximum(of_sum + of_difference, _LEAST)
    crossed = 2.0 * sin2 * cos * inverse
    return Facet(crossed * a, (of_sum - of_difference) * inverse, -crossed * b)


def _modulus(re: Any, im: Any) -> Any:
    return dr.sqrt(dr.maximum(dr.square(re) + dr.square(im), _LEAST))


def directional_diffuse(wi: Any, wo: Any, surface: OpticalSurface) -> Any:
    """Return f_r [1/sr] of eq. 71 for directions above the horizon."""
    light = shadowing(wi, surface.slope)
    viewer = shadowing(wo, surface.slope)
    # Eqs (79)-(83)
    g_over_vz2 = surface.wave * effective_variance(light.K + viewer.K)
    v_z2 = dr.square(dr.maximum(wi.z, _LEAST_COS) + dr.maximum(wo.z, _LEAST_COS))
    # Eq. (84): k_r - k_i is the sum of our directions
    v_xy2 = dr.square(wi.x + wo.x) + dr.square(wi.y + wo.y)
    v2 = v_xy2 + v_z2
    # Eq. (78)
    g, V = g_over_vz2 * v_z2, surface.correlation * v_xy2
    series = mi.UnpolarizedSpectrum([diffraction_series(*pair) for pair in zip(g, V, strict=True)])
    # Eq. (75), at the bisecting angle
    F2 = reflectance(dr.minimum(0.5 * dr.sqrt(v2), 1.0), surface.n, surface.k)
    # Eqs (71) and (76)
    value = (
        series * F2 * g_over_vz2 * (0.25 / dr.pi) * surface.correlation * (v2 * light.over_cos) * (v2 * viewer.over_cos)
    )
    return dr.minimum(value, _LARGEST)


class _WavelengthTriple(NamedTuple):
    """Three wavelengths [nm] of a projection, those of n and k [1] that are spectra, and weights [1] (3, channels)."""

    wavelength_nm: list[float]
    indices: dict[str, list[float]]
    weights: list[list[float]]


class HeTorrance(Formula):
    """The plugin ``brdfdb_he_torrance``. Its parameters are those of the model; n and k are spectra.

    `wavelength_nm` sets one wavelength for all channels. Without it, RGB variants project the spectrum of f_r at
    `PICTURE_NM` on linear sRGB. If `channels` is "wavelengths", or n or k is a colour or a texture, their channels have
    `WAVELENGTHS_NM`, as mono has.
    """

    components = (GLOSSY, DIFFUSE, SPECULAR)

    def __init__(self, props: Any) -> None:
        self._wavelength_nm = props.get("wavelength_nm", 0.0)
        at_nm = None if mi.is_spectral else channels_nm()
        if self._wavelength_nm:
            WAVELENGTH_NM.check(self._wavelength_nm)
            at_nm = (self._wavelength_nm,)
        self._bands = [] if self._wavelength_nm else _bands_of(props)
        self.parameters = PluginParameters(props, MODELS["he_torrance"], (N, K), at_nm)

    def at(self, interaction: Any, active: Any) -> Values:
        """Return the parameters and the surface as the light of each channel sees it."""
        values = self.parameters.at(interaction, active)
        of_rays = mi.is_spectral and not self._wavelength_nm
        wavelengths_nm = interaction.wavelengths if of_rays else self._wavelength_nm or channels_nm()
        values["surface"] = _surface_of(values, mi.UnpolarizedSpectrum(wavelengths_nm))
        return values

    def traverse(self, callback: Any) -> None:
        """Show the parameters to the scene, but for the spectra of a projection, which are constants."""
        self.parameters.traverse(callback, constants=self._bands[0].indices if self._bands else ())

    def _seen(self, values: Values, function: Callable[[OpticalSurface], Any]) -> Any:
        """Return a function of the surface as each channel sees it, projected on sRGB if the channels are colours."""
        if not self._bands:
            return function(values["surface"])
        total: list[Any] = [0.0, 0.0, 0.0]
        for band in self._bands:
            indices = {name: mi.UnpolarizedSpectrum(numbers) for name, numbers in band.indices.items()}
            spectrum = function(_surface_of(values | indices, mi.UnpolarizedSpectrum(band.wavelength_nm)))
            for value, weights in zip(spectrum, band.weights, strict=True):
                total = [number + value * weight for number, weight in zip(total, weights, strict=True)]
        return mi.UnpolarizedSpectrum(total)

    def parts(self, values: Values, wi: Any, wo: Any) -> dict[str, Any]:
        """Return f_r [1/sr] of the directional diffuse and of the uniform diffuse part."""
        glossy = self._seen(values, lambda surface: directional_diffuse(wi, wo, surface))
        return {GLOSSY: glossy, DIFFUSE: values["a"] * dr.inv_pi}

    def facet(self, values: Values, wi: Any, wo: Any) -> Facet:
        """Return the Mueller matrix at the bisecting angle, which for the specular part is that of incidence."""
        surface = values["surface"]
        return facet(dr.minimum(0.5 * dr.norm(wi + wo), 1.0), surface.n, surface.k)

    def specular(self, values: Values, wi: Any) -> Any:
        """Return the specular reflectance [1], eq. 73."""

        def of_surface(surface: OpticalSurface) -> Any:
            light = shadowing(wi, surface.slope)
            g = 4.0 * dr.square(wi.z) * surface.wave * effective_variance(2.0 * light.K)
            return reflectance(wi.z, surface.n, surface.k) * dr.exp(-g) * dr.square(light.over_cos * wi.z)

        return dr.maximum(self._seen(values, of_surface), 0.0)

    def specular_share(self, values: Values, wi: Any) -> Any:
        """Return the share [1] of samples in the mirror direction: that of the light, roughly."""
        specular = dr.mean(self.specular(values, wi))
        return specular / dr.maximum(specular + self._directional_albedo(values, wi) + dr.mean(values["a"]), _LEAST)

    def lobe(self, values: Values, wi: Any) -> GaussianLobe:
        """Return the lobe of `brdfdb.models.he_torrance`, as wide as that of the widest channel."""
        surface = values["surface"]
        v_z = 2.0 * dr.maximum(wi.z, _STEEPEST)
        g = surface.wave * dr.square(v_z)
        alpha = dr.max(dr.sqrt(dr.maximum(g, 1.0) / surface.correlation) / v_z)
        alpha = dr.clip(alpha, *_ALPHA_RANGE)
        directional = self._directional_albedo(values, wi)
        share = 0.9 * directional / dr.maximum(directional + dr.mean(values["a"]), _LEAST)
        return GaussianLobe.of(share, alpha, alpha)

    def _directional_albedo(self, values: Values, wi: Any) -> Any:
        """Return an estimate of the albedo [1] of the directional diffuse part, the mean over the channels."""
        surface = values["surface"]
        cos = dr.maximum(wi.z, _STEEPEST)
        scattered = one_less_exp(4.0 * surface.wave * dr.square(cos))
        return dr.mean(reflectance(cos, surface.n, surface.k) * scattered)


def _surface_of(values: Values, wavelength_nm: Any) -> OpticalSurface:
    wavelength_um = wavelength_nm / 1000.0
    sigma_0, tau = values["sigma_0_um"], values["tau_um"]
    wave, correlation = dr.square(2.0 * dr.pi * sigma_0 / wavelength_um), dr.square(dr.pi * tau / wavelength_um)
    return OpticalSurface(wave, correlation, sigma_0 / tau, values["n"], values["k"])


def _bands_of(props: Any) -> list[_WavelengthTriple]:
    """Return the wavelengths of a projection, three at a time; none if each channel has its own."""
    spectra = {name: spectrum for name in ("n", "k") if (spectrum := spectrum_of(props, name)) is not None}
    ends = [nm[[0, -1]] for nm, _ in spectra.values()] or [PICTURE_NM[[0, -1]]]
    shared: Array | None = np.array([max(low for low, _ in ends), min(high for _, high in ends)])
    for name in ("n", "k"):
        if name in props and not (isinstance(props[name], int | float) or hasattr(props[name], "wavelengths")):
            if props.get("channels", "") == SRGB:
                raise ParameterError(name, f"a colour or a texture has no spectrum, and channels = {SRGB} needs one")
            shared = None
    at_nm = None if shared is None else picture_wavelengths(shared)
    chosen = projection(props, shared if at_nm is None else at_nm)
    if chosen is None:
        return []
    # Wavelengths that fill the last three have no weight
    lacking = -chosen.wavelength_nm.size % 3
    nm = np.append(chosen.wavelength_nm, np.repeat(chosen.wavelength_nm[-1], lacking))
    weights = np.concatenate([chosen.weights, np.zeros((lacking, 3))])
    indices = {name: np.interp(nm, *spectrum) for name, spectrum in spectra.items()}
    return [
        _WavelengthTriple(
            nm[part].tolist(), {name: x[part].tolist() for name, x in indices.items()}, weights[part].tolist()
        )
        for part in (slice(first, first + 3) for first in range(0, nm.size, 3))
    ]
