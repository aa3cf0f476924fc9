"""He, Torrance, Sillion and Greenberg 1991: physical optics of Gaussian rough surfaces, unpolarised light."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb import fresnel
from brdfdb._elementary import BLOCK, cosine, erfcx, exp, log
from brdfdb._numba import elementwise, kernel, loop
from brdfdb.fresnel import reflectance
from brdfdb.geometry import Directions, Vectors, checked_angles, checked_vectors, finished
from brdfdb.models._he_torrance_series import (
    G_HIGH,
    G_LOW,
    Q_PATCHES,
    ROWS_OF_WORK,
    TERMS,
    TERMS_OF_FLOAT32,
    log_series,
    log_series_of_row,
    nearer_lambert_w,
    roughly_lambert_w,
    series_table,
)
from brdfdb.models._rows import by_rows, by_rows_of_vectors
from brdfdb.parameters import Floats, Lobe, ModelSpec, Parameter

WAVELENGTH_NM = Parameter("wavelength_nm", "λ", "nm", 1e-3, 1e7, "wavelength in vacuum")
SIGMA_0_UM = Parameter("sigma_0_um", "σ_0", "µm", 0.0, 1e4, "rms roughness; 0 is a mirror")
TAU_UM = Parameter("tau_um", "τ", "µm", 1e-6, 1e6, "autocorrelation length")
N = Parameter("n", "n", "1", 1e-3, 100.0, "refractive index")
K = Parameter("k", "k", "1", 0.0, 1e4, "extinction coefficient")
A = Parameter("a", "a", "1", 0.0, 1.0, "albedo of the uniform diffuse part", default=0.0)

_STEEPEST, _ALPHA_RANGE = 1e-3, (1e-6, 2.0)  # what `lobe` says is held in here


_X_MAX = 30.0  # where erfc(x) and exp(-x^2) have long been 0
_INVERSE_SQRT_PI = 0.5641895835477563
_WORTH_THE_TABLE = 16  # values in a row
_NO_FRESNEL = np.zeros(())  # as refractive index: |F|^2 is left out


@kernel
def _erfc_and_gaussian(sin_theta: float, cos_theta: float, slope: float) -> tuple[float, float]:
    """erfc(x) and exp(-x^2) at x = cot(theta) / (2 slope), with slope = sigma_0 / tau."""
    valley = 2.0 * slope * sin_theta
    x = cos_theta / (valley if valley > 0.0 else 1.0)
    x = _X_MAX if valley == 0.0 or x > _X_MAX else x  # there both are 0
    gaussian = exp(-x * x)
    return gaussian * erfcx(x), gaussian


@kernel
def _shadowing_over_cos(sin_theta: float, cos_theta: float, slope: float) -> float:
    """S_1(theta) / cos theta of eqs 23-25; finite up to and including 90 degrees."""
    erfc, gaussian = _erfc_and_gaussian(sin_theta, cos_theta, slope)
    Q = 1.0 - 0.5 * erfc
    return Q / (Q * cos_theta + slope * _INVERSE_SQRT_PI * sin_theta * gaussian)


@kernel
def _hidden_slope(sin_theta: float, cos_theta: float, slope: float) -> float:
    """K_i or K_r of eqs 82-83: how much of the valleys a direction does not reach."""
    erfc, _ = _erfc_and_gaussian(sin_theta, cos_theta, slope)
    return sin_theta / cos_theta * erfc


@kernel
def _effective_variance(K: float) -> float:
    """(sigma / sigma_0)^2 of eqs 80-81 for K = K_i + K_r: z_0^2 / sigma_0^2 = W_0(K^2 / (8 pi))."""
    y = K * K * (0.125 / np.pi)
    series = y * (1.0 - y * (1.0 - y * (1.5 - y * (8.0 / 3.0))))
    large = 1e-4 if y < 1e-4 else y
    log_y = log(large)
    w = nearer_lambert_w(nearer_lambert_w(roughly_lambert_w(large, log_y), log_y), log_y)
    return 1.0 / (1.0 + (series if y < 1e-4 else w))


_shadowing = elementwise(_shadowing_over_cos)
_hidden = elementwise(_hidden_slope)
_variance = elementwise(_effective_variance)


@loop
def _roughness(
    geometry: NDArray[np.float64],
    surface: NDArray[np.float64],
    g_over_vz2: NDArray[np.float64],
    shadow: NDArray[np.float64],
) -> None:
    """g / v_z^2, and S / (cos theta_i cos theta_r): what eq. 71 needs of a pair of polar angles."""
    sin_i, cos_i, sin_r, cos_r = geometry[0], geometry[1], geometry[2], geometry[3]
    wave, slope = surface[0], surface[2]
    count = shadow.shape[0]
    for j in range(count):
        # Eqs (79)-(83)
        K = _hidden_slope(sin_i[j], cos_i[j], slope[j]) + _hidden_slope(sin_r[j], cos_r[j], slope[j])
        g_over_vz2[j] = wave[j] * _effective_variance(K)
    for j in range(count):
        # Eqs (23)-(25)
        light = _shadowing_over_cos(sin_i[j], cos_i[j], slope[j])
        shadow[j] = light * _shadowing_over_cos(sin_r[j], cos_r[j], slope[j])


@loop
def _evaluate(
    geometry: NDArray[np.float64],
    surface: NDArray[np.float64],
    f_r: NDArray[np.float64],
    work: NDArray[np.float64],
    index: NDArray[np.int64],
) -> None:
    """f_r of at most BLOCK pairs of directions; geometry and surface hold the rows named below."""
    cos_i, cos_r, v_xy2 = geometry[1], geometry[3], geometry[4]
    correlation, n, k, uniform = surface[1], surface[3], surface[4], surface[5]
    count = f_r.shape[0]
    g_over_vz2, g, V, shadow = work[0, :count], work[1, :count], work[2, :count], work[3, :count]
    _roughness(geometry, surface, g_over_vz2, shadow)
    for j in range(count):
        g[j] = g_over_vz2[j] * (cos_i[j] + cos_r[j]) ** 2
        V[j] = correlation[j] * v_xy2[j]
    # Eq. (78)
    log_series(g, V, f_r, work[4:], index)
    for j in range(count):
        v2 = v_xy2[j] + (cos_i[j] + cos_r[j]) ** 2
        # Eqs (71) and (76)
        pair = correlation[j] * (0.25 / np.pi) * shadow[j] * g_over_vz2[j] * v2 * v2
        f_r[j] = pair * exp(f_r[j])
    if n[0] > 0.0:
        for j in range(count):
            # Eq. (75), at the bisecting angle
            half = 0.5 * math.sqrt(v_xy2[j] + (cos_i[j] + cos_r[j]) ** 2)
            f_r[j] *= reflectance(1.0 if half > 1.0 else half, n[j], k[j])
    for j in range(count):
        # Eq. (72)
        f_r[j] += uniform[j]


@kernel
def _specular(scalars: NDArray[np.float64], rho_s: NDArray[np.float64]) -> None:
    for row in range(rho_s.shape[0]):
        sin_i, cos_i, wave, slope = scalars[row, 0], scalars[row, 1], scalars[row, 2], scalars[row, 3]
        S = (_shadowing_over_cos(sin_i, cos_i, slope) * cos_i) ** 2
        # Eq. (79)
        g = 4.0 * cos_i * cos_i * wave * _effective_variance(2.0 * _hidden_slope(sin_i, cos_i, slope))
        # Eq. (73)
        rho_s[row] = reflectance(cos_i, scalars[row, 4], scalars[row, 5]) * exp(-g) * S


@kernel
def _scattered(features: NDArray[np.float64], surface: NDArray[np.float64], f_r: NDArray[np.float64]) -> None:
    """Pairs of directions one by one: features of shape (5, N) as in `_evaluate`, surface (6, 1) or (6, N)."""
    work, index = np.empty((4 + ROWS_OF_WORK, BLOCK)), np.empty((3, BLOCK), np.int64)
    lanes, geometry, width = np.empty((6, BLOCK)), np.empty((5, BLOCK)), surface.shape[1]
    for start in range(0, f_r.shape[0], BLOCK):
        count = min(BLOCK, f_r.shape[0] - start)
        for each in range(5):
            for j in range(count):
                geometry[each, j] = features[each, start + j]
        for each in range(6):
            for j in range(count):
                lanes[each, j] = surface[each, min(start + j, width - 1)]
        _evaluate(geometry, lanes, f_r[start : start + count], work, index)


@loop
def _vectors(w_i: Floats, w_r: Floats, surface: NDArray[np.float64], f_r: Floats) -> None:
    """As `_scattered`, of unit vectors of shape (N, 3) and a surface of shape (6, 1)."""
    work, index = np.empty((4 + ROWS_OF_WORK, BLOCK)), np.empty((3, BLOCK), np.int64)
    lanes, values, geometry = np.empty((6, BLOCK)), np.empty(BLOCK), np.empty((5, BLOCK))
    for each in range(6):
        for j in range(BLOCK):
            lanes[each, j] = surface[each, 0]
    for start in range(0, f_r.shape[0], BLOCK):
        count = min(BLOCK, f_r.shape[0] - start)
        i, r = w_i[start : start + count].reshape(-1), w_r[start : start + count].reshape(-1)
        f = f_r[start : start + count]
        for j in range(count):
            geometry[0, j] = math.sqrt(np.float64(i[3 * j]) ** 2 + np.float64(i[3 * j + 1]) ** 2)
            geometry[1, j] = cosine(np.float64(i[3 * j + 2]))
        for j in range(count):
            geometry[2, j] = math.sqrt(np.float64(r[3 * j]) ** 2 + np.float64(r[3 * j + 1]) ** 2)
            geometry[3, j] = cosine(np.float64(r[3 * j + 2]))
        for j in range(count):
            # Eq. (84): k_r - k_i is the sum of our directions
            v_x, v_y = np.float64(i[3 * j]) + r[3 * j], np.float64(i[3 * j + 1]) + r[3 * j + 1]
            geometry[4, j] = v_x * v_x + v_y * v_y
        _evaluate(geometry, lanes, values[:count], work, index)
        for j in range(count):
            f[j] = values[j] * (0.0 if i[3 * j + 2] < 0.0 or r[3 * j + 2] < 0.0 else 1.0)  # nan stays nan


@kernel
def _vectors_of_rows(w_i: Floats, w_r: Floats, scalars: NDArray[np.float64], f_r: Floats) -> None:
    for row in range(f_r.shape[0]):
        surface = scalars[row].reshape(6, 1)
        _vectors(w_i[min(row, w_i.shape[0] - 1)], w_r[min(row, w_r.shape[0] - 1)], surface, f_r[row])


@kernel
def _rows(
    one_plus_cos: NDArray[np.float64],
    table: NDArray[np.float64],
    scalars: NDArray[np.float64],
    f_r: Floats,
) -> None:
    """Rows along the azimuth, which share polar angles and surface: what eq. 71 needs of these is computed once."""
    length = f_r.shape[1]
    work, index = np.empty((ROWS_OF_WORK, BLOCK)), np.empty((3, BLOCK), np.int64)
    lanes, g_over_vz2, shadow = np.empty((10, BLOCK)), np.empty(BLOCK), np.empty(BLOCK)
    g_row, v2, V, log_D = np.empty(BLOCK), np.empty(length), np.empty(length), np.empty(length)
    polynomials = np.empty((Q_PATCHES, table.shape[3]))
    least, most = 0.0, 2.0
    for row in range(f_r.shape[0]):
        if row < one_plus_cos.shape[0]:
            least, most = 2.0, 0.0
            for j in range(length):  # past nan
                turn = one_plus_cos[row, j]
                least, most = turn if turn < least else least, turn if turn > most else most
        lane = row % BLOCK
        if lane == 0:
            rows = min(BLOCK, f_r.shape[0] - row)
            for i in range(rows):
                for each in range(10):
                    lanes[each, i] = scalars[row + i, each]
            _roughness(lanes[:4], lanes[4:], g_over_vz2[:rows], shadow[:rows])
        s, f, turned = scalars[row], f_r[row], one_plus_cos[min(row, one_plus_cos.shape[0] - 1)]
        correlation, n, k, uniform = s[5], s[7], s[8], s[9]
        v_z2 = (s[1] + s[3]) ** 2
        g = g_over_vz2[lane] * v_z2
        if g == 0.0:
            for j in range(length):
                f[j] = uniform
            continue
        # Eq. (84): v_xy^2 in the form that keeps its digits near the mirror direction
        difference2, product = (s[0] - s[2]) ** 2, 2.0 * s[0] * s[2]
        for j in range(length):
            v_xy2 = difference2 + product * turned[j]
            v2[j] = v_xy2 + v_z2
            V[j] = correlation * v_xy2
        # Eq. (78)
        if length >= _WORTH_THE_TABLE and G_LOW <= g < G_HIGH:
            low, high = correlation * (difference2 + product * least), correlation * (difference2 + product * most)
            log_series_of_row(table, g, V, low, high, log_D, polynomials)
        else:
            for i in range(min(length, BLOCK)):
                g_row[i] = g
            for start in range(0, length, BLOCK):
                stop = min(start + BLOCK, length)
                log_series(g_row[: stop - start], V[start:stop], log_D[start:stop], work, index)
        # Eqs (71) and (76)
        pair = correlation * (0.25 / np.pi) * shadow[lane] * g_over_vz2[lane]
        for j in range(length):
            # Eq. (75), at the bisecting angle
            cos = 0.5 * math.sqrt(v2[j])
            F2 = reflectance(1.0 if cos > 1.0 else cos, n, k) if n > 0.0 else 1.0
            # Eq. (72)
            f[j] = uniform + pair * v2[j] * v2[j] * exp(log_D[j]) * F2


class Surface(NamedTuple):
    """The checked parameters that describe the surface and the light, as arrays that broadcast with the angles."""

    wavelength_um: NDArray[np.floating]
    sigma_0: NDArray[np.floating]
    tau: NDArray[np.floating]
    n: NDArray[np.floating]
    k: NDArray[np.floating]

    @property
    def slope(self) -> Floats:
        """sigma_0 / tau."""
        return self.sigma_0 / self.tau

    @property
    def features(self) -> tuple[Floats, Floats, Floats]:
        """Of g over v_z^2 and (sigma / sigma_0)^2, of V over v_xy^2, and sigma_0 / tau."""
        correlation = (np.pi * self.tau / self.wavelength_um) ** 2
        return (2.0 * np.pi * self.sigma_0 / self.wavelength_um) ** 2, correlation, self.slope


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
    return _evaluated(directions, (*surface.features, surface.n, surface.k, albedo / np.pi))


def directional_diffuse(directions: Directions, surface: Surface) -> Floats:
    """f_r [1/sr] of the directional diffuse part, eq. 71, over |F|^2: what the roughness does, in any polarisation."""
    return _evaluated(directions, (*surface.features, _NO_FRESNEL, _NO_FRESNEL, _NO_FRESNEL))


def _evaluated(directions: Directions, surface: Sequence[Floats]) -> Floats:
    uniform = all(np.size(each) == 1 for each in surface)
    if isinstance(directions, Vectors) and uniform:
        return by_rows_of_vectors(_vectors_of_rows, directions, surface)
    shape = np.broadcast_shapes(*(np.shape(each) for each in (*directions.given, *surface)))
    pair = directions.sin_i, directions.cos_i, directions.sin_r, directions.cos_r
    if shape and shape[-1] > 1 and all(np.ndim(each) == 0 or np.shape(each)[-1] == 1 for each in (*pair, *surface)):
        terms = TERMS_OF_FLOAT32 if directions.dtype == np.float32 else TERMS
        table = series_table(terms) if shape[-1] >= _WORTH_THE_TABLE else np.empty((1, 1, 1, terms))

        def tabulated_rows(columns: NDArray[np.float64], scalars: NDArray[np.float64], values: Floats) -> None:
            _rows(columns, table, scalars, values)

        return finished(
            by_rows(tabulated_rows, (directions.one_plus_cos_dphi,), (*pair, *surface), directions.dtype), directions
        )
    v_xy2, _ = _v2(directions)
    features = np.empty((5, *shape))
    for i, each in enumerate((*pair, v_xy2)):
        features[i] = each
    constants = np.empty((6, 1)) if uniform else np.empty((6, *shape))
    for i, each in enumerate(surface):
        constants[i] = np.reshape(each, ()) if uniform else each
    values: NDArray[np.float64] = np.empty(shape)
    if values.size:
        _scattered(features.reshape(5, -1), constants.reshape(6, -1), values.reshape(-1))
    return finished(values, directions)


def cos_bisecting(directions: Directions) -> Floats:
    """Cosine of half the angle between light and viewer: of the incidence on a facet that mirrors one to the other."""
    v_xy2, v_z2 = _v2(directions)
    cos: Floats = np.minimum(0.5 * np.sqrt(v_xy2 + v_z2), 1.0)
    return cos


def _v2(directions: Directions) -> tuple[Floats, Floats]:
    """v_xy^2 and v_z^2 of eq. 84, k_r - k_i; v_xy^2 in the form that keeps its digits near the mirror direction."""
    sin_i, sin_r = directions.sin_i, directions.sin_r
    v_xy2 = (sin_i - sin_r) ** 2 + (2.0 * sin_i * sin_r) * directions.one_plus_cos_dphi
    return v_xy2, (directions.cos_i + directions.cos_r) ** 2


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
    wave, _, slope = surface.features
    return finished(by_rows(_specular, (), (angles.sin_i, angles.cos_i, wave, slope, surface.n, surface.k)), angles)


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
    """Where the directional diffuse part is: the width of the term of eq. 78 that is largest in the mirror direction.

    The slope of the half vector is v_xy / v_z, and the term m is exp(-(pi tau v_xy / lambda)^2 / m). Terms of larger m
    are wider: a tenth of the directional diffuse part is left to be found anywhere.
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


SPEC = ModelSpec(
    name="he_torrance",
    version=2,
    title="He-Torrance, unpolarised",
    equation="eqs 71-84",
    reference="he1991",
    parameters=(SIGMA_0_UM, TAU_UM, A),
    evaluate=he_torrance,
    vectors=he_torrance_vectors,
    specular=he_torrance_specular,
    specular_parameters=("wavelength_nm", "sigma_0_um", "tau_um", "n", "k"),
    spectral=True,
    lobe=lobe,
)
