"""He, Torrance, Sillion and Greenberg 1991: physical optics of Gaussian rough surfaces, unpolarised light."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb import fresnel
from brdfdb.arrays import array_function
from brdfdb.geometry import Directions, Vectors, checked_angles, checked_vectors, finished
from brdfdb.lobes import Lobe
from brdfdb.models._diffraction_series import CONSTANTS_BYTES, TERMS, TERMS_OF_FLOAT32, series_table
from brdfdb.models._he_torrance_kernels import (
    CORRECTED_LIMIT,
    LIMIT,
    WHOLE,
    WORTH_THE_TABLE,
    angle_rows,
    difference_of_sines,
    gradient_rows,
    scattered,
    specular_rows,
    vector_rows,
)
from brdfdb.models._rows import by_rows, by_rows_of_vectors
from brdfdb.models.large_calls import for_large_calls
from brdfdb.parameters import LEAST_NM, Arguments, Floats, FormKind, Gradient, ModelForm, Parameter, bytes_of

WAVELENGTH_NM = Parameter("wavelength_nm", "λ", "nm", LEAST_NM, 1e7, "wavelength in vacuum")
SIGMA_0_UM = Parameter("sigma_0_um", "σ_0", "µm", 0.0, 1e4, "rms roughness; 0 is a mirror")
TAU_UM = Parameter("tau_um", "τ", "µm", 1e-6, 1e6, "autocorrelation length")
N = Parameter("n", "n", "1", 1e-3, 100.0, "refractive index")
K = Parameter("k", "k", "1", 0.0, 1e4, "extinction coefficient")
A = Parameter("a", "a", "1", 0.0, 1.0, "albedo of the uniform diffuse part", default=0.0, reflectance=True)

_STEEPEST, _ALPHA_RANGE = 1e-3, (1e-6, 2.0)  # least cosine and range of alpha in `lobe`

# Reach of the coarser sums of eq. 78 that charts show, as a share of the distance from the peak. The number of terms
# goes with the square of the share
_REACHES = (0.7, 0.5, 0.4, 0.3)
_TERMS = 10  # number of terms that programs customarily take

_NO_FRESNEL = np.zeros(())  # refractive index that stands for |F|^2 = 1


class Surface(NamedTuple):
    """The checked parameters that describe the surface and the light, as arrays that broadcast with the angles."""

    wavelength_um: NDArray[np.floating]
    sigma_0: NDArray[np.floating]
    tau: NDArray[np.floating]
    n: NDArray[np.floating]
    k: NDArray[np.floating]

    @property
    def slope(self) -> Floats:
        """The ratio sigma_0 / tau [1]."""
        return self.sigma_0 / self.tau

    @property
    def features(self) -> tuple[Floats, Floats, Floats]:
        """The factors g / (v_z^2 (sigma / sigma_0)^2) and V / v_xy^2, and the ratio sigma_0 / tau, all [1]."""
        correlation = (np.pi * self.tau / self.wavelength_um) ** 2
        return (2.0 * np.pi * self.sigma_0 / self.wavelength_um) ** 2, correlation, self.slope


def checked_surface(
    wavelength_nm: ArrayLike, sigma_0_um: ArrayLike, tau_um: ArrayLike, n: ArrayLike, k: ArrayLike
) -> Surface:
    """Return the surface and its light; ParameterError if a value is outside its range."""
    return Surface(
        WAVELENGTH_NM.check(wavelength_nm) / 1000.0,
        SIGMA_0_UM.check(sigma_0_um),
        TAU_UM.check(tau_um),
        N.check(n),
        K.check(k),
    )


@for_large_calls
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
    """Return the BRDF [1/sr] of a Gaussian rough surface: the directional diffuse and the uniform diffuse part.

    The third part, specular, is a Dirac delta in direction: `he_torrance_specular` gives its reflectance.

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi].
    wavelength_nm : array_like [nm]
        Wavelength in vacuum, in [1, 1e7].
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
    ParameterError
        If an argument is outside its range.

    Notes
    -----
    Eq. (71) with (75)-(84), and (72). In order: `shadowing` of `_he_torrance_kernels` is S_1 / cos of eqs 23-25 per
    direction, `variance` eqs 80-83, `fresnel.unpolarised` eq. 75 at the bisecting angle, `diffraction_series` the
    sum of eq. 78. v_z^2 is moved from G into the sum, because g / v_z^2 is finite.

    Departures from the paper: (72) reads a / pi. Smith's Lambda in (25) has its Gaussian. v_xy in (78) carries the wave
    number, v in (76) does not. The dot products of (76) cancel exactly, so that G = (|v|^2 / v_z)^2. (75) has moduli.
    (57) and (58) have lambda^2 in place of (2 pi lambda)^2, and (66) has S, as (6) and (7) need. (81) is solved by
    Lambert's W.

    The model is valid for gentle slopes (sigma_0 / tau well below 1) or for (v_z sigma)^2 well above 1.

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


@for_large_calls
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
    """Return `he_torrance` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
    surface = checked_surface(wavelength_nm, sigma_0_um, tau_um, n, k)
    return _f_r(checked_vectors(wi, wr), surface, A.check(a))


@array_function
def he_torrance_gradient(
    wi: ArrayLike,
    wr: ArrayLike,
    *,
    wavelength_nm: ArrayLike,
    sigma_0_um: ArrayLike,
    tau_um: ArrayLike,
    n: ArrayLike,
    k: ArrayLike,
    a: ArrayLike = 0.0,
) -> Gradient:
    """Return the gradient of `he_torrance_vectors`, by n and k, too."""
    surface = checked_surface(wavelength_nm, sigma_0_um, tau_um, n, k)
    scalars = (*surface.features, surface.n, surface.k, A.check(a) / np.pi, surface.sigma_0, surface.tau)
    names = (SIGMA_0_UM.name, TAU_UM.name, N.name, K.name, A.name)
    f_r, *derivatives = by_rows_of_vectors(gradient_rows, checked_vectors(wi, wr), scalars, (6,))
    return Gradient(f_r, dict(zip(names, derivatives, strict=True)))


def _f_r(directions: Directions, surface: Surface, albedo: Floats) -> Floats:
    return evaluated(directions, (*surface.features, surface.n, surface.k, albedo / np.pi))


def with_sum(
    wi: ArrayLike,
    wr: ArrayLike,
    *,
    series: int = WHOLE,
    reach: float = 1.0,
    wavelength_nm: ArrayLike,
    sigma_0_um: ArrayLike,
    tau_um: ArrayLike,
    n: ArrayLike,
    k: ArrayLike,
    a: ArrayLike = 0.0,
) -> Floats:
    """Return f_r [1/sr] of `he_torrance_vectors` with another sum in eq. 78; `evaluated` describes the arguments."""
    surface = checked_surface(wavelength_nm, sigma_0_um, tau_um, n, k)
    features = (*surface.features, surface.n, surface.k, A.check(a) / np.pi)
    return evaluated(checked_vectors(wi, wr), features, series, reach)


def directional_diffuse(directions: Directions, surface: Surface) -> Floats:
    """Return f_r / |F|^2 [1/sr] of the directional diffuse part, eq. 71. It is the same in any polarisation."""
    return evaluated(directions, (*surface.features, _NO_FRESNEL, _NO_FRESNEL, _NO_FRESNEL))


def evaluated(directions: Directions, surface: Sequence[Floats], series: int = WHOLE, reach: float = 1.0) -> Floats:
    """Return f_r [1/sr] of eqs 71 and 72, with the sum of eq. 78 that `series` selects.

    The values of `series` are those of `_he_torrance_kernels`. `reach`, in (0, 1], is that of `log_series`: below 1 the
    sum is coarser. `surface` holds `Surface.features`, n, k and the uniform part [1/sr], which broadcast with the
    directions.
    """
    if isinstance(directions, Vectors):

        def rows(w_i: Floats, w_r: Floats, scalars: NDArray[np.float64], values: Floats) -> None:
            vector_rows(w_i, w_r, series, reach, scalars, values)

        return by_rows_of_vectors(rows, directions, surface)
    shape = np.broadcast_shapes(*(np.shape(feature) for feature in (*directions.given, *surface)))
    pair = directions.sin_i, directions.cos_i, directions.sin_r, directions.cos_r
    by_azimuth = all(np.ndim(feature) == 0 or np.shape(feature)[-1] == 1 for feature in (*pair, *surface))
    if series == WHOLE and reach == 1.0 and shape and shape[-1] > 1 and by_azimuth:
        terms = TERMS_OF_FLOAT32 if directions.dtype == np.float32 else TERMS
        table = series_table(terms) if shape[-1] >= WORTH_THE_TABLE else np.empty((1, 1, 1, terms))

        def tabulated_rows(columns: NDArray[np.float64], scalars: NDArray[np.float64], values: Floats) -> None:
            angle_rows(columns, table, scalars, values)

        return finished(
            by_rows(tabulated_rows, (directions.one_plus_cos_dphi,), (*pair, *surface), directions.dtype), directions
        )
    uniform = all(np.size(feature) == 1 for feature in surface)
    v_xy2, _ = v_squared(directions)
    features = np.empty((5, *shape))
    for i, feature in enumerate((*pair, v_xy2)):
        features[i] = feature
    constants = np.empty((6, 1)) if uniform else np.empty((6, *shape))
    for i, feature in enumerate(surface):
        constants[i] = np.reshape(feature, ()) if uniform else feature
    values: NDArray[np.float64] = np.empty(shape)
    if values.size:
        scattered(features.reshape(5, -1), constants.reshape(6, -1), series, reach, values.reshape(-1))
    return finished(values, directions)


def cos_bisecting(directions: Directions) -> Floats:
    """Return the cosine [1] of half the angle between light and viewer, the angle of incidence on their facet."""
    v_xy2, v_z2 = v_squared(directions)
    cos: Floats = np.minimum(0.5 * np.sqrt(v_xy2 + v_z2), 1.0)
    return cos


def v_squared(directions: Directions) -> tuple[Floats, Floats]:
    """Return v_xy^2 and v_z^2 [1] of v = k_r - k_i, eq. 84. v_xy^2 keeps its digits near the mirror direction."""
    v_z = directions.cos_i + directions.cos_r
    across = difference_of_sines(directions.sin_i, directions.cos_i, directions.sin_r, directions.cos_r)
    return across**2 + (2.0 * directions.sin_i * directions.sin_r) * directions.one_plus_cos_dphi, v_z**2


@array_function
def he_torrance_specular(
    theta_i: ArrayLike,
    *,
    wavelength_nm: ArrayLike,
    sigma_0_um: ArrayLike,
    tau_um: ArrayLike,
    n: ArrayLike,
    k: ArrayLike,
) -> Floats:
    """Return the specular reflectance [1], the share of the light that leaves in the exact mirror direction.

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
    ParameterError
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
    return finished(rho_s(angles, checked_surface(wavelength_nm, sigma_0_um, tau_um, n, k)), angles)


@array_function
def he_torrance_specular_vectors(
    wi: ArrayLike, *, wavelength_nm: ArrayLike, sigma_0_um: ArrayLike, tau_um: ArrayLike, n: ArrayLike, k: ArrayLike
) -> Floats:
    """Return `he_torrance_specular` [1] for unit vectors `wi` (light) of shape (..., 3)."""
    vectors = checked_vectors(wi, wi)
    return finished(rho_s(vectors, checked_surface(wavelength_nm, sigma_0_um, tau_um, n, k)), vectors)


def rho_s(directions: Directions, surface: Surface) -> Floats:
    """Return the specular reflectance [1], eq. 73, for the direction of the light."""
    wave, _, slope = surface.features
    return by_rows(specular_rows, (), (directions.sin_i, directions.cos_i, wave, slope, surface.n, surface.k))


def lobe(
    cos_i: ArrayLike,
    *,
    wavelength_nm: ArrayLike,
    sigma_0_um: ArrayLike,
    tau_um: ArrayLike,
    n: ArrayLike,
    k: ArrayLike,
    a: ArrayLike = 0.0,
) -> Lobe:
    """Return the lobe of the directional diffuse part.

    Its width is that of the term of eq. 78 that is largest in the mirror direction. The slope of the half vector is
    v_xy / v_z, and the term m is exp(-(pi tau v_xy / lambda)^2 / m). Terms of larger m are wider, so the share of the
    lobe is only nine tenths of the directional diffuse part.
    """
    surface = checked_surface(wavelength_nm, sigma_0_um, tau_um, n, k)
    v_z = 2.0 * np.maximum(cos_i, _STEEPEST)
    g = (2.0 * np.pi * surface.sigma_0 / surface.wavelength_um * v_z) ** 2
    alpha = np.sqrt(np.maximum(g, 1.0)) * surface.wavelength_um / (np.pi * surface.tau * v_z)
    directional = 0.9 * fresnel.unpolarised(v_z / 2.0, surface.n, surface.k) * -np.expm1(-g)
    total = directional / 0.9 + A.check(a)
    share = np.divide(directional, total, where=total > 0.0, out=np.zeros(np.shape(total)))
    alpha = np.clip(alpha, *_ALPHA_RANGE)
    return Lobe(share, alpha, alpha)


def lossless(_: Mapping[str, Any]) -> dict[str, float]:
    """Return the n and k of a metal that absorbs next to nothing, and an `a` of 0, which leaves single scattering.

    1 - |F|^2 is about 2 (cos + 1 / cos) n / k^2, and nowhere more than n / k. It is 4e-11 at normal incidence and 1e-8
    at 89.9 degrees.
    """
    return {"n": N.low, "k": K.high, "a": 0.0}


def forms(arguments: Arguments) -> Iterator[ModelForm]:
    """Yield the forms of the model that charts compare: eq. 78 with more or fewer terms, and its limits."""
    size = bytes_of(arguments)
    mirror = arguments["sigma_0_um"] == 0.0  # a mirror has no sum to shorten
    yield ModelForm(
        "sum",
        "the sum of eq. 78, whole",
        "exact",
        "models.he_torrance",
        he_torrance_vectors,
        size + (0 if mirror else CONSTANTS_BYTES),
        single=True,
    )
    if mirror:
        return

    def form(key: str, title: str, kind: FormKind, vectors: Callable[..., Floats], more: int = 0) -> ModelForm:
        return ModelForm(key, title, kind, "models.he_torrance_1991.with_sum", vectors, size + more)

    for reach in _REACHES:
        vectors = functools.partial(with_sum, reach=reach)
        percent = round(100.0 * reach**2)
        title = f"the sum of eq. 78, {percent} % of its terms"
        yield form(f"sum-{percent}", title, "quadrature", vectors, CONSTANTS_BYTES)
    yield form("ten-terms", "ten terms of eq. 78", "customary", functools.partial(with_sum, series=_TERMS))
    corrected = functools.partial(with_sum, series=CORRECTED_LIMIT)
    yield form("beckmann-corrected", "Beckmann, first order in 1/g", "approximation", corrected)
    limit = functools.partial(with_sum, series=LIMIT)
    yield form("beckmann", "Beckmann's limit, g to infinity", "customary", limit)
