"""He, Torrance, Sillion and Greenberg 1991: physical optics of Gaussian rough surfaces, and Mueller matrices.

`brdfdb.tables.stokes` states the convention: directions, Stokes vectors, and the basis (s, p) of the mean surface.
Beyond it:

* For the azimuth phi, s = (-sin phi, cos phi, 0), which at the pole w = z is its limit along that azimuth.
  p_i = -(cos theta cos phi, cos theta sin phi, -sin theta) for the light, and p_r is the same vector of theta_r, phi_r
  with a plus sign. The bases of the paper (eqs 14, 35) are these, but its s_r and p_r have the opposite sign. No
  Mueller matrix depends on that sign.
* The index is n + ik. Complex amplitudes are those of the electric field.
* Jones matrices act on columns from the left. Index 0 is s and 1 is p.
* Reciprocity, when light and viewer are exchanged: J' = Z J^T Z with Z = diag(1, -1), and M' = D M^T D with
  D = diag(1, 1, -1, 1). The sign comes from p = s x k: the same wave travelling back has the opposite p.
"""

from __future__ import annotations

import functools
import math
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
from brdfdb.models._rows import Out, by_rows, by_rows_of_vectors
from brdfdb.models.declaration import DeclaredModel, Slopes, of_directions
from brdfdb.parameters import (
    MUCH,
    OPAQUE,
    STANDINGS,
    WAVELENGTH_NM,
    Arguments,
    Diagnostic,
    Draw,
    Floats,
    FormKind,
    HeightRelation,
    K,
    ModelForm,
    N,
    Parameter,
    Polarised,
    Standing,
    StatedLimit,
    SurfaceAssumption,
    bytes_of,
    standing,
)

SIGMA_0_UM = Parameter("sigma_0_um", "σ_0", "µm", 0.0, 1e4, "rms roughness; 0 is a mirror")
TAU_UM = Parameter("tau_um", "τ", "µm", 1e-6, 1e6, "autocorrelation length")
A = Parameter("a", "a", "1", 0.0, 1.0, "albedo of the uniform diffuse part", default=0.0, reflectance=True)

_STEEPEST = 1e-3  # least cosine of `lobe`
_ALPHA_RANGE = (1e-6, 2.0)  # of `lobe` [1]

# Reach of the coarser sums of eq. 78 that charts show, as a share of the distance from the peak. The number of terms
# goes with the square of the share
_REACHES = (0.7, 0.5, 0.4, 0.3)
_TERMS = 10  # number of terms that programs customarily take

_NO_FRESNEL = np.zeros(())  # refractive index that stands for |F|^2 = 1

Complexes = NDArray[np.complexfloating[Any, Any]]


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


def surface_of(wavelength_nm: Floats, sigma_0_um: Floats, tau_um: Floats, n: Floats, k: Floats) -> Surface:
    """Return the surface and its light from checked parameters."""
    return Surface(wavelength_nm / 1000.0, sigma_0_um, tau_um, n, k)


def checked_surface(
    wavelength_nm: ArrayLike, sigma_0_um: ArrayLike, tau_um: ArrayLike, n: ArrayLike, k: ArrayLike
) -> Surface:
    """Return the surface and its light; ParameterError if a value is outside its range."""
    return surface_of(
        WAVELENGTH_NM.check(wavelength_nm),
        SIGMA_0_UM.check(sigma_0_um),
        TAU_UM.check(tau_um),
        N.check(n),
        K.check(k),
    )


# Limits that the paper states

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
    first_surface: Standing = "inside" if a > 0.0 else gentle if k >= OPAQUE else "outside"
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
            standing=min(rough, gentle, key=STANDINGS.index),
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


# Lobe, lossless surface, and the forms that charts compare


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
        he_torrance.vectors,
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


# Specular part


@of_directions(
    parameters=(WAVELENGTH_NM, SIGMA_0_UM, TAU_UM, N, K),
    references="he1991",
    returns="""\
array [1]
    rho_s, in [0, 1], in the broadcast shape of all arguments; 0 below the horizon, nan where theta_i is nan.""",
)
def he_torrance_specular(light: Directions, *surface: Floats) -> Floats:
    """Return the specular reflectance [1], the share of the light that leaves in the exact mirror direction.

    Eq. (73): |F|^2 e^-g S at theta_r = theta_i.

    >>> mirror = dict(wavelength_nm=550.0, sigma_0_um=0.0, tau_um=2.0, n=1.5, k=0.0)
    >>> round(float(he_torrance_specular(0.0, **mirror)), 4)
    0.04
    """
    return finished(rho_s(light, surface_of(*surface)), light)


def rho_s(directions: Directions, surface: Surface) -> Floats:
    """Return the specular reflectance [1], eq. 73, for the direction of the light."""
    wave, _, slope = surface.features
    return by_rows(specular_rows, (), (directions.sin_i, directions.cos_i, wave, slope, surface.n, surface.k))


# Mueller matrices


@of_directions(
    parameters=(N, K),
    references="he1991 (eqs 41-46, 59-65)",
    returns="""\
complex array [1]
    In the broadcast shape of all arguments and (2, 2): [row of the reflected, column of the incident field], in the
    order s, p. It is 0 below the horizon and nan where an angle is nan. The sum of abs(J)^2 / 2 is the |F|^2 of
    eq. 75. In the mirror direction J is -diag(F_s, F_p), because reflection reverses both s and p.""",
)
def he_torrance_jones(directions: Directions, n: Floats, k: Floats) -> Complexes:
    """Return the Jones matrix [1] of the facet that mirrors light to viewer, between s and p of the mean surface.

    Eqs (61)-(64) over |k_r x k_i|^2, which is 0 / 0 at backscatter. A and B are the angles of the great circle from
    light to viewer with the meridians through w_i and w_r. The s and p of the facet are those of the surface turned by
    -A and pi - B. J is (F_s + F_p) / 2 times a rotation by A - B, plus (F_s - F_p) / 2 times a reflection by A + B.

    The formulas of Gauss and Delambre give both angles without a quotient by |k_r x k_i|. A - B has no limit where
    light and viewer coincide, but F_s + F_p is 0 there. A + B has none where they are opposite at grazing, but
    F_s - F_p is 0 there. So J is continuous everywhere except at the poles, where s and p themselves turn with phi.

    Departures from the paper: M_ps of eq. (64) is -(F_s .. - F_p ..), with the sign that M_sp of eq. (62) has. As
    printed, a perfect mirror would reflect light polarised at 45 degrees with a factor between 0 and 2. Intensities
    of incident s, p and unpolarised light are the same either way. The first matrix of eq. (46) is T_in of eq. (39).
    The n of eqs (85) and (86) is the z axis, not the local normal of that name in Table 1.

    >>> abs(he_torrance_jones(0.0, 0.0, 0.0, 0.0, n=1.5, k=0.0)).round(3).tolist()
    [[0.2, 0.0], [0.0, 0.2]]
    """
    J = np.stack(_jones(directions, n, k), axis=-1)
    parts = J.view(np.float64).reshape(*J.shape[:-1], 2, 2, 2)
    done: Floats = np.ascontiguousarray(finished(parts, directions, trailing=3))
    result: Complexes = done.view(np.result_type(done.dtype, np.complex64))[..., 0]
    return result


@of_directions(
    parameters=(WAVELENGTH_NM, SIGMA_0_UM, TAU_UM, N, K, A),
    references="he1991",
    returns="""\
array [1/sr]
    In the broadcast shape of all arguments and (4, 4). The matrix gives the Stokes vector of the reflected radiance
    from that of the irradiance, in the convention of `brdfdb.tables.stokes`. It is 0 below the horizon and nan
    where an angle is nan. Element [0, 0] is `he_torrance`.""",
)
def he_torrance_mueller(directions: Directions, *parameters: Floats) -> Floats:
    """Return the Mueller BRDF [1/sr] of a Gaussian rough surface: directional and uniform diffuse part.

    Eqs (7), (59), (60) and (68): the directional diffuse part divided by |F|^2, times the Mueller matrix of
    `he_torrance_jones`. The uniform diffuse part, eq. 72, is taken as an ideal depolariser. The paper treats light
    from below the surface or from several reflections as uniform, and does not mention its polarisation.

    >>> surface = dict(wavelength_nm=500.0, sigma_0_um=0.18, tau_um=3.0, n=1.5, k=0.0)
    >>> M = he_torrance_mueller(0.98, 0.0, 0.98, np.pi, **surface)
    >>> round(float(M[0, 1] / M[0, 0]), 2)  # s alone is reflected near Brewster's angle
    1.0
    """
    *of_surface, albedo = parameters
    surface = surface_of(*of_surface)
    # Eqs (7), (59), (60), (68)
    M = _mueller(*_jones(directions, surface.n, surface.k))
    with np.errstate(all="ignore"):
        of_a_mirror = directional_diffuse(directions, surface)
    f_r = of_a_mirror[..., None, None] * M
    # Eq. (72)
    depolariser = np.zeros((4, 4))
    depolariser[0, 0] = 1.0 / np.pi
    return finished(f_r + np.asarray(albedo)[..., None, None] * depolariser, directions, trailing=2)


@of_directions(
    parameters=(WAVELENGTH_NM, SIGMA_0_UM, TAU_UM, N, K),
    references="he1991",
    returns="""\
array [1]
    In the broadcast shape of all arguments and (4, 4), from the s and p of the light to those of the mirror
    direction, at the azimuth phi_i + pi. Element [0, 0] is `he_torrance_specular`. The matrix is 0 below the
    horizon and nan where theta_i is nan.""",
)
def he_torrance_specular_mueller(light: Directions, *parameters: Floats) -> Floats:
    """Return the Mueller matrix [1] of the specular part, which leaves in the exact mirror direction.

    Eq. (73) with F_s and F_p in place of |F|^2. Roughness and shadowing are the same for all polarisations.

    >>> mirror = dict(wavelength_nm=550.0, sigma_0_um=0.0, tau_um=2.0, n=1.5, k=0.0)
    >>> he_torrance_specular_mueller(0.0, **mirror).diagonal().round(3).tolist()
    [0.04, 0.04, -0.04, -0.04]
    """
    surface = surface_of(*parameters)
    relative = _normalised_facet(light, surface.n, surface.k)
    return finished(rho_s(light, surface)[..., None, None] * relative, light, trailing=2)


@array_function
def he_torrance_facet_mueller(theta_d: ArrayLike, *, n: ArrayLike, k: ArrayLike) -> Floats:
    """Return the Mueller matrix [1] of the facet over its first element, between s and p of the plane of the light.

    Parameters
    ----------
    theta_d : array_like [rad]
        Angle of incidence on the facet, half the angle between light and viewer, in [0, pi/2].
    n, k : array_like [1]
        Complex refractive index n + ik, as in `he_torrance_jones`.

    Returns
    -------
    array [1]
        In the broadcast shape of all arguments and (4, 4). Three of its elements are independent: [0, 1] = [1, 0],
        [2, 2] = [3, 3] and [2, 3] = -[3, 2]; [0, 0] and [1, 1] are 1, all others 0. The matrix is 0 where nothing is
        reflected, and beyond pi/2.

    Raises
    ------
    ParameterError
        If theta_d, n or k is outside of its range.

    References
    ----------
    he1991 (eqs 59-65)

    Examples
    --------
    >>> round(float(he_torrance_facet_mueller(0.9828, n=1.5, k=0.0)[0, 1]), 3)  # Brewster's angle
    1.0
    """
    directions = checked_angles(theta_d, 0.0, 0.0, 0.0)
    return _normalised_facet(directions, N.check(n), K.check(k))


def _normalised_facet(directions: Directions, n: Floats, k: Floats) -> Floats:
    half_sum, half_difference = fresnel.half_sum_and_difference(directions.cos_i, n, k)
    F_s, F_p = half_sum + half_difference, half_sum - half_difference
    M = _mueller(F_s, np.zeros_like(F_s), np.zeros_like(F_s), F_p)
    reflectance = M[..., :1, :1]
    relative = np.divide(M, reflectance, out=np.zeros_like(M), where=reflectance > 0.0)
    return finished(relative, directions, trailing=2)


def _jones(directions: Directions, n: Floats, k: Floats) -> tuple[Complexes, Complexes, Complexes, Complexes]:
    """Return J_ss, J_sp, J_ps and J_pp [1] in the broadcast shape, by the notes of `he_torrance_jones`."""
    sin_i, cos_i, sin_r, cos_r = directions.sin_i, directions.cos_i, directions.sin_r, directions.cos_r
    sin_dphi, cos2_half, sin2_half = _azimuth(directions)
    # cos^2 and sin^2 of (theta_i - theta_r) / 2 and of (theta_i + theta_r) / 2, without differences that cancel
    cos2_minus = 0.5 * (1.0 + cos_i * cos_r + sin_i * sin_r)
    cos2_plus = (cos_i + cos_r) ** 2 / (4.0 * cos2_minus)
    sin2_minus = 0.25 * ((sin_i - sin_r) ** 2 + (cos_i - cos_r) ** 2)
    sin2_plus = 0.25 * ((sin_i + sin_r) ** 2 + (cos_i - cos_r) ** 2)
    # Gauss and Delambre give cos and sin of pi - (A + B). The denominator is cos^2 of the bisecting angle, never 0
    denominator = cos2_minus * cos2_half + cos2_plus * sin2_half
    cos_sum = (cos2_minus * cos2_half - cos2_plus * sin2_half) / denominator
    sin_sum = 0.5 * (cos_i + cos_r) * sin_dphi / denominator
    # They give those of A - B over sin^2 of the bisecting angle, which is 0 / 0 at backscatter, where F_s + F_p = 0
    denominator = sin2_plus * sin2_half + sin2_minus * cos2_half
    apart = denominator > 0.0
    safe = np.where(apart, denominator, 1.0)
    cos_difference = np.where(apart, (sin2_plus * sin2_half - sin2_minus * cos2_half) / safe, 1.0)
    sin_difference = 0.5 * (cos_i - cos_r) * sin_dphi / safe
    # Eqs (61)-(64) over |k_r x k_i|^2
    with np.errstate(all="ignore"):  # with vectors, the branch that is not taken divides by zero
        cos_half = cos_bisecting(directions)
    half_sum, half_difference = fresnel.half_sum_and_difference(cos_half, n, k)
    J_ss = half_difference * cos_sum - half_sum * cos_difference
    J_sp = half_difference * sin_sum + half_sum * sin_difference
    J_ps = half_difference * sin_sum - half_sum * sin_difference
    J_pp = -half_difference * cos_sum - half_sum * cos_difference
    return J_ss, J_sp, J_ps, J_pp


def _azimuth(directions: Directions) -> tuple[Floats, Floats, Floats]:
    """Return sin(delta_phi), cos^2 and sin^2 [1] of delta_phi / 2. For unit vectors the azimuth of a pole is 0."""
    if isinstance(directions, Vectors):
        cos_phi_i, sin_phi_i = unit_azimuth(directions.x_i, directions.y_i, directions.sin_i)
        cos_phi_r, sin_phi_r = unit_azimuth(directions.x_r, directions.y_r, directions.sin_r)
        sin_dphi = cos_phi_i * sin_phi_r - sin_phi_i * cos_phi_r
        cos_dphi = cos_phi_i * cos_phi_r + sin_phi_i * sin_phi_r
        cos2_half = np.where(cos_dphi < 0.0, sin_dphi**2 / (2.0 * (1.0 + np.abs(cos_dphi))), 0.5 * (1.0 + cos_dphi))
    else:
        sin_dphi, cos2_half = directions.sin_dphi, 0.5 * directions.one_plus_cos_dphi
    # The smaller of cos^2 and sin^2, below 1/2, has all its digits
    sin2_half = np.where(cos2_half > 0.5, sin_dphi**2 / (4.0 * np.maximum(cos2_half, 0.5)), 1.0 - cos2_half)
    return sin_dphi, cos2_half, sin2_half


def unit_azimuth(x: Floats, y: Floats, sin_theta: Floats) -> tuple[Floats, Floats]:
    """Return cos(phi) and sin(phi) [1] of unit vectors; phi is 0 at the pole."""
    away = sin_theta != 0.0  # True for nan too
    lift = np.where(sin_theta < 1e-290, 2.0**600, 1.0)  # subnormal numbers carry too few digits
    x, y = lift * x, lift * y
    safe = np.where(away, np.hypot(x, y), 1.0)
    return np.where(away, x / safe, 1.0), y / safe


def _mueller(J_ss: Complexes, J_sp: Complexes, J_ps: Complexes, J_pp: Complexes) -> NDArray[np.float64]:
    """Return the Mueller matrix (..., 4, 4) [1] of a Jones matrix."""
    ss, sp, ps, pp = (z.real**2 + z.imag**2 for z in (J_ss, J_sp, J_ps, J_pp))
    rows_s, rows_p = J_ss * J_sp.conj(), J_ps * J_pp.conj()
    columns_s, columns_p = J_ss * J_ps.conj(), J_sp * J_pp.conj()
    direct, crossed = J_ss * J_pp.conj(), J_sp * J_ps.conj()
    elements = [
        [0.5 * (ss + sp + ps + pp), 0.5 * (ss - sp + ps - pp), (rows_s + rows_p).real, -(rows_s + rows_p).imag],
        [0.5 * (ss + sp - ps - pp), 0.5 * (ss - sp - ps + pp), (rows_s - rows_p).real, -(rows_s - rows_p).imag],
        [(columns_s + columns_p).real, (columns_s - columns_p).real, (direct + crossed).real, (crossed - direct).imag],
        [(columns_s + columns_p).imag, (columns_s - columns_p).imag, (direct + crossed).imag, (direct - crossed).real],
    ]
    return np.stack([np.stack(np.broadcast_arrays(*row), axis=-1) for row in elements], axis=-2)


def _scalars_of_gradient(*parameters: Floats) -> tuple[Floats, ...]:
    *of_surface, albedo = parameters
    surface = surface_of(*of_surface)
    return (*surface.features, surface.n, surface.k, albedo / np.pi, surface.sigma_0, surface.tau)


# The model


@DeclaredModel(
    version=2,
    title="He-Torrance, unpolarised",
    equation="eqs 71-84",
    references="he1991, smith1967, loader2000, corless1996",
    parameters=(SIGMA_0_UM, TAU_UM, A),
    light=(WAVELENGTH_NM, N, K),
    grazing_power=0.0,
    specular=he_torrance_specular,
    specular_parameters=("wavelength_nm", "sigma_0_um", "tau_um", "n", "k"),
    uniform="a",
    lobe=lobe,
    lossless=lossless,
    forms=forms,
    highest_rung="the whole sum of eq. 78",
    diagnostic=G_ALONG_NORMAL,
    limits=limits,
    uniform_bound_cosine=lowest_cosine,
    polarised=Polarised(mueller=he_torrance_mueller.vectors, facet=he_torrance_facet_mueller),
    slopes=Slopes(gradient_rows, ("sigma_0_um", "tau_um", "n", "k", "a"), _scalars_of_gradient),
    draw=Draw(
        (("sigma_0_um", 0.01, 5.0), ("tau_um", 0.1, 50.0), ("a", 0.0, 0.3)),
        lambda given: given["sigma_0_um"] <= given["tau_um"],
        "sigma_0_um <= tau_um: the paper holds for slopes below 1",
    ),
    heights=HeightRelation(
        lambda surface: {"sigma_0_um": surface.sigma_0_um, "tau_um": surface.tau_um},
        "rms height, and length where the correlation is 1 / e",
        (
            SurfaceAssumption("Gaussian heights", "The heights are Gaussian.", "He et al. 1991, eq. 47"),
            SurfaceAssumption(
                "Gaussian correlation", "The correlation of the heights is Gaussian.", "He et al. 1991, eq. 48"
            ),
        ),
    ),
)
def he_torrance(
    directions: Directions,
    out: Out,
    wavelength_nm: Floats,
    sigma_0_um: Floats,
    tau_um: Floats,
    n: Floats,
    k: Floats,
    a: Floats,
) -> Floats:
    """Return the BRDF [1/sr] of a Gaussian rough surface: the directional diffuse and the uniform diffuse part.

    The third part, specular, is a Dirac delta in direction: `he_torrance_specular` gives its reflectance.

    Eq. (71) with (75)-(84), and (72). In order: `shadowing` of `_he_torrance_kernels` is S_1 / cos of eqs 23-25 per
    direction, `variance` eqs 80-83, `fresnel.unpolarised` eq. 75 at the bisecting angle, `diffraction_series` the
    sum of eq. 78. v_z^2 is moved from G into the sum, because g / v_z^2 is finite.

    Departures from the paper: (72) reads a / pi. Smith's Lambda in (25) has its Gaussian. v_xy in (78) carries the wave
    number, v in (76) does not. The dot products of (76) cancel exactly, so that G = (|v|^2 / v_z)^2. (75) has moduli.
    (57) and (58) have lambda^2 in place of (2 pi lambda)^2, and (66) has S, as (6) and (7) need. (81) is solved by
    Lambert's W.

    The model is valid for gentle slopes (sigma_0 / tau well below 1) or for (v_z sigma)^2 well above 1.

    >>> surface = dict(sigma_0_um=0.18, tau_um=3.0, n=0.769, k=6.08)
    >>> round(float(he_torrance(0.5, 0.0, 0.6, 3.0, wavelength_nm=500.0, **surface)), 3)
    5.388
    """
    return _f_r(directions, surface_of(wavelength_nm, sigma_0_um, tau_um, n, k), a, out)


def _f_r(directions: Directions, surface: Surface, a: Floats, out: Out = None) -> Floats:
    return evaluated(directions, (*surface.features, surface.n, surface.k, a / np.pi), out=out)


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


def evaluated(
    directions: Directions, surface: Sequence[Floats], series: int = WHOLE, reach: float = 1.0, out: Out = None
) -> Floats:
    """Return f_r [1/sr] of eqs 71 and 72, with the sum of eq. 78 that `series` selects.

    The values of `series` are those of `_he_torrance_kernels`. `reach`, in (0, 1], is that of `log_series`: below 1 the
    sum is coarser. `surface` holds `Surface.features`, n, k and the uniform part [1/sr], which broadcast with the
    directions.
    """
    if isinstance(directions, Vectors):

        def rows(w_i: Floats, w_r: Floats, scalars: NDArray[np.float64], values: Floats) -> None:
            vector_rows(w_i, w_r, series, reach, scalars, values)

        return by_rows_of_vectors(rows, directions, surface, out)
    shape = np.broadcast_shapes(*(np.shape(feature) for feature in (*directions.given, *surface)))
    pair = directions.sin_i, directions.cos_i, directions.sin_r, directions.cos_r
    by_azimuth = all(np.ndim(feature) == 0 or np.shape(feature)[-1] == 1 for feature in (*pair, *surface))
    if series == WHOLE and reach == 1.0 and shape and shape[-1] > 1 and by_azimuth:
        terms = TERMS_OF_FLOAT32 if directions.dtype == np.float32 else TERMS
        table = series_table(terms) if shape[-1] >= WORTH_THE_TABLE else np.empty((1, 1, 1, terms))

        def tabulated_rows(columns: NDArray[np.float64], scalars: NDArray[np.float64], values: Floats) -> None:
            angle_rows(columns, table, scalars, values)

        return finished(
            by_rows(tabulated_rows, (directions.one_plus_cos_dphi,), (*pair, *surface), directions.dtype, out),
            directions,
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
