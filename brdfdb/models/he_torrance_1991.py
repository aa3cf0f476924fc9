"""He, Torrance, Sillion and Greenberg 1991: physical optics of Gaussian rough surfaces, unpolarised light."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb import fresnel
from brdfdb._elementary import BLOCK, by_component, cosine, erfcx, exp, log
from brdfdb._numba import elementwise, kernel, loop
from brdfdb.fresnel import reflectance
from brdfdb.geometry import Directions, Vectors, checked_angles, checked_vectors, finished
from brdfdb.models._he_torrance_series import ROWS_OF_WORK, log_series, nearer_lambert_w, roughly_lambert_w
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
_WORTH_INTERPOLATING = 48  # values in a row
_NODES = 16  # of a piece of a row
_PIECES = 32
_CONVERGED = 3e-12  # the last coefficients of ln(f_r)
_CHEBYSHEV = np.cos(np.pi * np.outer(np.arange(_NODES), (np.arange(_NODES) + 0.5) / _NODES))  # T_k at the nodes
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
def _evaluate(
    geometry: NDArray[np.float64],
    surface: NDArray[np.float64],
    count: int,
    f_r: NDArray[np.float64],
    work: NDArray[np.float64],
    index: NDArray[np.int64],
) -> None:
    """f_r[:count] of at most BLOCK pairs of directions; geometry and surface hold the rows named below."""
    sin_i, cos_i, sin_r, cos_r, v_xy2 = geometry[0], geometry[1], geometry[2], geometry[3], geometry[4]
    wave, correlation, slope, n, k, uniform = surface[0], surface[1], surface[2], surface[3], surface[4], surface[5]
    g_over_vz2, g, V, shadow = work[0], work[1], work[2], work[3]
    for j in range(count):
        # Eqs (79)-(83)
        K = _hidden_slope(sin_i[j], cos_i[j], slope[j]) + _hidden_slope(sin_r[j], cos_r[j], slope[j])
        g_over_vz2[j] = wave[j] * _effective_variance(K)
    for j in range(count):
        # Eqs (23)-(25)
        light = _shadowing_over_cos(sin_i[j], cos_i[j], slope[j])
        shadow[j] = light * _shadowing_over_cos(sin_r[j], cos_r[j], slope[j])
    for j in range(count):
        g[j] = g_over_vz2[j] * (cos_i[j] + cos_r[j]) ** 2
        V[j] = correlation[j] * v_xy2[j]
    # Eq. (78)
    log_series(g, V, count, f_r, work[4:], index)
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
def _scattered(features: NDArray[np.float64], surface: NDArray[np.float64], f_r: NDArray[np.float64]) -> None:
    """Pairs of directions one by one: features of shape (5, N) as in `_evaluate`, surface (6, 1) or (6, N)."""
    work, index = np.empty((4 + ROWS_OF_WORK, BLOCK)), np.empty((3, BLOCK), np.int64)
    lanes, values = np.empty((6, BLOCK)), np.empty(BLOCK)
    lanes[:] = surface[:, :1]
    for start in range(0, f_r.shape[0], BLOCK):
        count = min(BLOCK, f_r.shape[0] - start)
        if surface.shape[1] > 1:
            lanes[:, :count] = surface[:, start : start + count]
        _evaluate(features[:, start : start + count], lanes, count, values, work, index)
        f_r[start : start + count] = values[:count]


@loop
def _vectors(w_i: Floats, w_r: Floats, surface: NDArray[np.float64], f_r: Floats) -> None:
    """As `_scattered`, of unit vectors of shape (N, 3) and a surface of shape (6, 1)."""
    work, index = np.empty((4 + ROWS_OF_WORK, BLOCK)), np.empty((3, BLOCK), np.int64)
    lanes, values, geometry = np.empty((6, BLOCK)), np.empty(BLOCK), np.empty((5, BLOCK))
    i, r = np.empty((3, BLOCK)), np.empty((3, BLOCK))
    lanes[:] = surface
    for start in range(0, f_r.shape[0], BLOCK):
        count = by_component(w_i, start, i)
        by_component(w_r, start, r)
        for j in range(count):
            geometry[0, j] = math.sqrt(i[0, j] * i[0, j] + i[1, j] * i[1, j])
            geometry[1, j] = cosine(i[2, j])
        for j in range(count):
            geometry[2, j] = math.sqrt(r[0, j] * r[0, j] + r[1, j] * r[1, j])
            geometry[3, j] = cosine(r[2, j])
        for j in range(count):
            # Eq. (84): k_r - k_i is the sum of our directions
            geometry[4, j] = (i[0, j] + r[0, j]) ** 2 + (i[1, j] + r[1, j]) ** 2
        _evaluate(geometry, lanes, count, values, work, index)
        for j in range(count):
            f_r[start + j] = values[j] * (0.0 if i[2, j] < 0.0 or r[2, j] < 0.0 else 1.0)  # nan stays nan


@kernel
def _vectors_of_rows(w_i: Floats, w_r: Floats, scalars: NDArray[np.float64], f_r: Floats) -> None:
    for row in range(f_r.shape[0]):
        surface = scalars[row].reshape(6, 1)
        _vectors(w_i[min(row, w_i.shape[0] - 1)], w_r[min(row, w_r.shape[0] - 1)], surface, f_r[row])


@kernel
def _rows(one_plus_cos: NDArray[np.float64], scalars: NDArray[np.float64], f_r: NDArray[np.float64]) -> None:
    """Rows along the azimuth, which share polar angles and surface: one of eq. 71 after the other."""
    length = f_r.shape[1]
    work, index = np.empty((4 + ROWS_OF_WORK, BLOCK)), np.empty((3, BLOCK), np.int64)
    lanes, geometry = np.empty((6, BLOCK)), np.empty((5, BLOCK))
    v_xy2, along = np.empty(length), np.empty(length)
    for row in range(f_r.shape[0]):
        s, f, turned = scalars[row], f_r[row], one_plus_cos[min(row, one_plus_cos.shape[0] - 1)]
        # Eq. (84): v_xy^2 in the form that keeps its digits near the mirror direction
        difference2, product = (s[0] - s[2]) ** 2, 2.0 * s[0] * s[2]
        for j in range(length):
            v_xy2[j] = difference2 + product * turned[j]
        if length >= _WORTH_INTERPOLATING and _interpolate(v_xy2, s, f, along, geometry[:3], work, index):
            continue
        for each in range(4):
            geometry[each] = s[each]
        for each in range(6):
            lanes[each] = s[4 + each]
        for start in range(0, length, BLOCK):
            count = min(BLOCK, length - start)
            geometry[4, :count] = v_xy2[start : start + count]
            _evaluate(geometry, lanes, count, f[start : start + count], work, index)


@loop
def _interpolate(
    v_xy2: NDArray[np.float64],
    scalars: NDArray[np.float64],
    f_r: NDArray[np.float64],
    t: NDArray[np.float64],
    nodes: NDArray[np.float64],
    work: NDArray[np.float64],
    index: NDArray[np.int64],
) -> bool:
    """A row by interpolation, or False where that would be more work than every value by itself.

    Within a row ln(|F|^2 D) is a smooth function of t = ln(1 + g^2 / 5 + V) or, where g^2 is far above V, of V. It is computed at Chebyshev's nodes of a
    piece of the row, and interpolated if the series has converged; if it has not, the piece is halved.
    """
    sin_i, cos_i, sin_r, cos_r = scalars[0], scalars[1], scalars[2], scalars[3]
    wave, correlation, slope, n, k, uniform = scalars[4], scalars[5], scalars[6], scalars[7], scalars[8], scalars[9]
    variance = _effective_variance(_hidden_slope(sin_i, cos_i, slope) + _hidden_slope(sin_r, cos_r, slope))
    shadow = _shadowing_over_cos(sin_i, cos_i, slope) * _shadowing_over_cos(sin_r, cos_r, slope)
    v_z2 = (cos_i + cos_r) ** 2
    g = wave * variance * v_z2
    pair = correlation * (0.25 / np.pi) * shadow * wave * variance
    if pair == 0.0:
        f_r[:] = uniform
        return True
    # As far as V reaches: a larger offset would cost digits of V, and the logarithm is straight by then
    offset = 1.0 + min(0.2 * g * g, 8.0 * correlation * v_xy2.max())
    for j in range(t.shape[0]):
        t[j] = log(offset + correlation * v_xy2[j])
    low, high = np.empty(_PIECES), np.empty(_PIECES)
    low[0], high[0] = t.min(), t.max()
    waiting, evaluated = 1, 0
    coefficients = np.empty(_NODES)
    while waiting:
        waiting -= 1
        bottom, top = low[waiting], high[waiting]
        middle, half = 0.5 * (bottom + top), 0.5 * (top - bottom)
        evaluated += _NODES
        if 2 * evaluated > t.shape[0]:
            return False
        for i in range(_NODES):
            nodes[0, i] = g
            nodes[1, i] = max(exp(middle + half * _CHEBYSHEV[1, i]) - offset, 0.0)
        log_series(nodes[0], nodes[1], _NODES, nodes[2], work, index)
        if n > 0.0:
            for i in range(_NODES):
                cos = 0.5 * math.sqrt(nodes[1, i] / correlation + v_z2)
                nodes[2, i] += log(reflectance(1.0 if cos > 1.0 else cos, n, k))
        for degree in range(_NODES):
            total = 0.0
            for i in range(_NODES):
                total += nodes[2, i] * _CHEBYSHEV[degree, i]
            coefficients[degree] = total * (1.0 if degree == 0 else 2.0) / _NODES
        tail = max(abs(coefficients[_NODES - 1]), abs(coefficients[_NODES - 2]), abs(coefficients[_NODES - 3]))
        if not tail < _CONVERGED + 4e-16 * abs(coefficients[0]):
            if waiting + 2 > _PIECES:
                return False
            low[waiting], high[waiting] = bottom, middle
            low[waiting + 1], high[waiting + 1] = middle, top
            waiting += 2
            continue
        scale = 1.0 / max(half, 1e-300)
        for j in range(t.shape[0]):
            x = 2.0 * scale * (t[j] - middle)
            above, here = 0.0, 0.0
            for degree in range(_NODES - 1, 0, -1):  # Clenshaw
                above, here = here, coefficients[degree] + x * here - above
            v2 = v_xy2[j] + v_z2
            value = uniform + pair * v2 * v2 * exp(coefficients[0] + 0.5 * x * here - above)
            f_r[j] = value if bottom <= t[j] <= top else f_r[j]
    return True


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
    shape = np.broadcast_shapes(*(np.shape(each) for each in (*directions.given, *surface)))
    uniform = all(np.size(each) == 1 for each in surface)
    if isinstance(directions, Vectors) and uniform:
        return by_rows_of_vectors(_vectors_of_rows, directions, surface)
    pair = directions.sin_i, directions.cos_i, directions.sin_r, directions.cos_r
    if shape and shape[-1] > 1 and all(np.ndim(each) == 0 or np.shape(each)[-1] == 1 for each in (*pair, *surface)):
        return finished(by_rows(_rows, (directions.one_plus_cos_dphi,), (*pair, *surface)), directions)
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
    sin_i, cos_i = np.sin(angles.theta_i), np.cos(angles.theta_i)
    S = (_shadowing(sin_i, cos_i, surface.slope) * cos_i) ** 2
    variance = _variance(2.0 * _hidden(sin_i, cos_i, surface.slope))
    # Eq. (79)
    g = (4.0 * np.pi * surface.sigma_0 / surface.wavelength_um * cos_i) ** 2 * variance
    # Eq. (73)
    return finished(fresnel.unpolarised(cos_i, surface.n, surface.k) * np.exp(-g) * S, angles)


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
    lobe=lobe,
)
