"""The surfaces of Oren and Nayar 1994, facet by facet: unidirectional, of a single slope, of Gaussian slopes."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from brdfdb._elementary import arcsin
from brdfdb._numba import elementwise, kernel
from brdfdb.geometry import Directions, checked_angles, checked_vectors, finished
from brdfdb.models._oren_nayar_facets import bounce_of_cavity, direct_of_cavity, gaussian
from brdfdb.models.oren_nayar_1994 import RHO, SIGMA, Parts
from brdfdb.parameters import Floats, ModelSpec, Parameter, white

THETA_A = Parameter("theta_a", "θ_a", "rad", 0.0, np.pi / 2, "slope of the facets")
PHI_A = Parameter("phi_a", "φ_a", "rad", 0.0, np.pi, "azimuth of the facets' normals, and half a turn from it")

PartName = Literal["direct", "interreflected"]  # a field of `Parts`

_TINY = 1e-300  # guards 0 / 0 and nothing else

# Measured at rho = 1 over theta_a: the albedo reaches 1.0625 (theta_a of 41 degrees, theta_i of 89.999) and exceeds 1
# from 74 degrees on; it is the weights of eq. 44 that do it: the integrals of eqs 23 and 46 stay below 1
_SINGLE_SLOPE_EXCESS = (
    "Oren and Nayar 1994, eqs 44, 45 and 49: near grazing and with an albedo near 1 the closed forms "
    "reflect up to 6 % more than they receive, for slopes below 60 degrees"
)


@kernel
def _hidden(cot: float) -> tuple[float, float]:
    """pi/2 - phi_c and cos(phi_c), for cot = 1 / (tan(theta_a) tan(theta))."""
    # Eq. (39)
    cos = min(cot, 1.0)
    sin = math.sqrt((1.0 - cos) * (1.0 + cos))
    small = arcsin(min(cos, sin))
    return (small if cos < sin else np.pi / 2 - small), cos


@kernel
def _arc_less_chord(rest: float) -> float:
    """(2 x - sin(2 x)) / pi of A_1 and of eq. (49), for x = pi/2 - phi_c."""
    y = 2.0 * rest
    if y > 1.0:
        return (y - math.sin(y)) / np.pi
    u = y * y
    series = 1.0 - u / 110.0 * (1.0 - u / 156.0 * (1.0 - u / 210.0))
    return y * u / 6.0 * (1.0 - u / 20.0 * (1.0 - u / 42.0 * (1.0 - u / 72.0 * series))) / np.pi


@kernel
def _coefficients(tan_i: float, tan_r: float, S: float, C: float) -> tuple[float, float, float]:
    """A_1 tan(beta), A_3, and 1 - Z: Z is what -cos(phi_r - phi_i) multiplies in eq. (49).

    In the mirror half plane Z is A_1 tan(beta) + A_2 of eq. (45), too, and 1 - Z what is left of the direct light: near
    the horizon no difference may make it.
    """
    a, b = S * max(tan_i, tan_r) / C, S * min(tan_i, tan_r) / C  # tan(theta_a) tan(alpha), tan(theta_a) tan(beta)
    rest_a, cos_a = _hidden(1.0 / max(a, _TINY))
    rest_b, cos_b = _hidden(1.0 / max(b, _TINY))
    sin_a, sin_b = math.sqrt((1.0 - cos_a) * (1.0 + cos_a)), math.sqrt((1.0 - cos_b) * (1.0 + cos_b))
    # Eq. (45), A_1 tan(beta)
    both_open = 0.5 * a * b * _arc_less_chord(rest_a)
    A_1 = b * 2.0 * sin_a / np.pi + both_open
    # Eq. (45), A_3, where phi_c^i + phi_c^r > pi/2
    A_3 = 0.0
    if rest_a + rest_b < np.pi / 2:
        roots = math.sqrt((b - 1.0) * (b + 1.0)) - (1.0 + b * b) / (math.sqrt((a - 1.0) * (a + 1.0)) + math.hypot(a, b))
        A_3 = max(0.0, (rest_a + rest_b - np.pi / 2 + roots) / np.pi)
    # Eq. (49)
    sines = (cos_b - cos_a) * (cos_b + cos_a) / (sin_a + sin_b + _TINY)  # sin(phi_c^alpha) - sin(phi_c^beta)
    rest_Z = (rest_b - b * sines) * 2.0 / np.pi - both_open
    return A_1, A_3, rest_Z


@kernel
def _single_slope_direct(tan_i: float, tan_r: float, cos_dphi: float, one_less_cos: float, S: float, C: float) -> float:
    A_1, A_3, rest_Z = _coefficients(tan_i, tan_r, S, C)
    # Eq. (45); one_less_cos is 1 - abs(cos_dphi)
    in_plane = 1.0 + cos_dphi * A_1 if cos_dphi >= 0.0 else one_less_cos - cos_dphi * rest_Z
    return max(0.0, C * (in_plane + one_less_cos * A_3))


@kernel
def _single_slope_bounce(tan_i: float, tan_r: float, cos_dphi: float, one_less_cos: float, S: float, C: float) -> float:
    rest_Z = _coefficients(tan_i, tan_r, S, C)[2]
    # Eq. (49)
    bracket = one_less_cos + cos_dphi * rest_Z if cos_dphi >= 0.0 else 1.0 - cos_dphi * (1.0 - rest_Z)
    return max(0.0, C * S * S / (1.0 + C) * bracket)


_evaluate_direct, _evaluate_bounce = elementwise(_single_slope_direct), elementwise(_single_slope_bounce)


def oren_nayar_unidirectional(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    rho: ArrayLike,
    theta_a: ArrayLike,
    phi_a: ArrayLike,
) -> Floats:
    """BRDF of parallel V-cavities of one slope with Lambertian facets: exact in direct light and the second bounce.

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi]; phi from x.
    rho : array_like [1]
        Albedo of a facet, in [0, 1].
    theta_a : array_like [rad]
        Slope of the facets, in [0, pi/2].
    phi_a : array_like [rad]
        Azimuth of the normals of one half of the facets, in [0, pi]; those of the other half lie half a turn from it.

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
    Eq. (22), the mean over both facets of a cavity of eqs (10) and (11), direct light, and of eqs (15) to (20), light
    from the opposite facet. Anisotropic, and only for phi_a along an axis its own mirror image. Towards exact
    backscatter at grazing it grows as 1 / cos; at 90 degrees it is the finite value at the float64 nearest pi/2.
    Departures from the paper: GAF = Min[1, Max[0, Min[A, B]]] (eq. 33 of the paper asks for it); m_v and m_s of eqs
    (15) and (16) are the widths masked and shadowed; a facet that faces away from light or viewer adds nothing.

    References
    ----------
    orennayar1994

    Examples
    --------
    >>> round(float(oren_nayar_unidirectional(0.9, 0.0, 0.4, 0.0, rho=0.9, theta_a=0.5, phi_a=0.2)), 4)
    0.3133
    """
    return _total(*_unidirectional(checked_angles(theta_i, phi_i, theta_r, phi_r), rho, theta_a, phi_a))


def oren_nayar_unidirectional_vectors(
    wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, theta_a: ArrayLike, phi_a: ArrayLike
) -> Floats:
    """`oren_nayar_unidirectional` for unit vectors `wi` of the light and `wr` of the viewer, each of shape (..., 3)."""
    return _total(*_unidirectional(checked_vectors(wi, wr), rho, theta_a, phi_a))


def oren_nayar_unidirectional_parts(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    rho: ArrayLike,
    theta_a: ArrayLike,
    phi_a: ArrayLike,
) -> Parts:
    """`oren_nayar_unidirectional` in its parts, direct light and the second bounce.

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r, rho, theta_a, phi_a : array_like
        As `oren_nayar_unidirectional` takes them.

    Returns
    -------
    Parts [1/sr]
        The arrays `direct` and `interreflected`, which add up to `oren_nayar_unidirectional`.

    Raises
    ------
    ValueError
        If an argument is outside its range.

    References
    ----------
    orennayar1994

    Examples
    --------
    >>> parts = oren_nayar_unidirectional_parts(0.9, 0.0, 0.9, np.pi, rho=0.9, theta_a=0.7, phi_a=0.0)
    >>> round(float(parts.direct), 4), round(float(parts.interreflected), 4)
    (0.0, 0.0913)
    """
    return _parts(*_unidirectional(checked_angles(theta_i, phi_i, theta_r, phi_r), rho, theta_a, phi_a))


def oren_nayar_unidirectional_parts_vectors(
    wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, theta_a: ArrayLike, phi_a: ArrayLike
) -> Parts:
    """`oren_nayar_unidirectional_parts` for unit vectors `wi` of the light and `wr` of the viewer, each (..., 3)."""
    return _parts(*_unidirectional(checked_vectors(wi, wr), rho, theta_a, phi_a))


def _unidirectional(
    directions: Directions, rho: ArrayLike, theta_a: ArrayLike, phi_a: ArrayLike
) -> tuple[Floats, Floats, Directions]:
    albedo, slope, azimuth = RHO.check(rho), THETA_A.check(theta_a), PHI_A.check(phi_a)
    x_a, y_a = np.cos(azimuth), np.sin(azimuth)
    # tan(theta) cos(phi - phi_a)
    slope_i = (directions.x_i * x_a + directions.y_i * y_a) / directions.cos_i
    slope_r = (directions.x_r * x_a + directions.y_r * y_a) / directions.cos_r
    facet = slope_i, slope_r, np.sin(slope), np.cos(slope)
    return _scaled(direct_of_cavity(*facet), bounce_of_cavity(*facet), albedo, directions)


def _scaled(direct: Floats, bounce: Floats, rho: Floats, directions: Directions) -> tuple[Floats, Floats, Directions]:
    """From radiances over rho E_0 cos(theta_i) / pi, and rho times that, to the BRDF."""
    return rho / np.pi * direct, rho * rho / np.pi * bounce, directions


def _total(direct: Floats, bounce: Floats, directions: Directions) -> Floats:
    # Eq. (21)
    return finished(direct + bounce, directions)


def _parts(direct: Floats, bounce: Floats, directions: Directions) -> Parts:
    return Parts(finished(direct, directions), finished(bounce, directions))


def _part(part: PartName, direct: Floats, bounce: Floats, directions: Directions) -> Floats:
    return finished(direct if part == "direct" else bounce, directions)


def oren_nayar_single_slope(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    rho: ArrayLike,
    theta_a: ArrayLike,
) -> Floats:
    """BRDF of V-cavities of one slope in all azimuths alike, the paper's closed forms.

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi].
    rho : array_like [1]
        Albedo of a facet, in [0, 1].
    theta_a : array_like [rad]
        Slope of the facets, in [0, pi/2].

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
    Eqs (45), which is (24), and (49). Exact for direct light in the plane of incidence and across it; between them
    weighted by eq. (44). The second bounce has the interreflection factor of eq. (48), not (47). Towards exact
    backscatter at grazing it grows as 1 / cos; at 90 degrees it is the finite value at the float64 nearest pi/2.

    References
    ----------
    orennayar1994

    Examples
    --------
    >>> round(float(oren_nayar_single_slope(0.9, 0.0, 0.4, 0.0, rho=0.9, theta_a=0.5)), 4)
    0.2969
    """
    return _total(*_single_slope(checked_angles(theta_i, phi_i, theta_r, phi_r), rho, theta_a))


def oren_nayar_single_slope_vectors(wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, theta_a: ArrayLike) -> Floats:
    """`oren_nayar_single_slope` for unit vectors `wi` of the light and `wr` of the viewer, each of shape (..., 3)."""
    return _total(*_single_slope(checked_vectors(wi, wr), rho, theta_a))


def oren_nayar_single_slope_parts(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    rho: ArrayLike,
    theta_a: ArrayLike,
) -> Parts:
    """`oren_nayar_single_slope` in its parts, direct light and the second bounce.

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r, rho, theta_a : array_like
        As `oren_nayar_single_slope` takes them.

    Returns
    -------
    Parts [1/sr]
        The arrays `direct` and `interreflected`, which add up to `oren_nayar_single_slope`.

    Raises
    ------
    ValueError
        If an argument is outside its range.

    References
    ----------
    orennayar1994

    Examples
    --------
    >>> parts = oren_nayar_single_slope_parts(0.9, 0.0, 0.9, np.pi, rho=0.9, theta_a=0.7)
    >>> round(float(parts.direct), 4), round(float(parts.interreflected), 4)
    (0.0997, 0.0717)
    """
    return _parts(*_single_slope(checked_angles(theta_i, phi_i, theta_r, phi_r), rho, theta_a))


def oren_nayar_single_slope_parts_vectors(wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, theta_a: ArrayLike) -> Parts:
    """`oren_nayar_single_slope_parts` for unit vectors `wi` of the light and `wr` of the viewer, each (..., 3)."""
    return _parts(*_single_slope(checked_vectors(wi, wr), rho, theta_a))


def single_slope_part(wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, theta_a: ArrayLike, part: PartName) -> Floats:
    """One part of `oren_nayar_single_slope_parts_vectors`, without the work of the other."""
    return _part(part, *_single_slope(checked_vectors(wi, wr), rho, theta_a, part))


def _single_slope(
    directions: Directions, rho: ArrayLike, theta_a: ArrayLike, only: PartName | None = None
) -> tuple[Floats, Floats, Directions]:
    """Both parts, or only one, and then 0 for the other."""
    albedo, slope = RHO.check(rho), THETA_A.check(theta_a)
    cos_dphi = directions.cos_dphi
    one_less_cos = directions.sin_dphi**2 / (1.0 + np.abs(cos_dphi))
    tangents = directions.sin_i / directions.cos_i, directions.sin_r / directions.cos_r
    facet = *tangents, cos_dphi, one_less_cos, np.sin(slope), np.cos(slope)
    direct = np.zeros(()) if only == "interreflected" else _evaluate_direct(*facet)
    bounce = np.zeros(()) if only == "direct" else _evaluate_bounce(*facet)
    return _scaled(direct, bounce, albedo, directions)


def oren_nayar_gaussian(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    rho: ArrayLike,
    sigma: ArrayLike,
) -> Floats:
    """BRDF of V-cavities with Gaussian slopes, integrated: what the functional fit `oren_nayar` approximates.

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi].
    rho : array_like [1]
        Albedo of a facet, in [0, 1].
    sigma : array_like [rad]
        Standard deviation of the slope angle, in [0, pi/2].

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
    Eqs (8) and (26) with eqs (10) to (20) for every facet, and eq. (47) as it stands: neither of the approximations
    (44) and (48). The weight is normalised to one over the slope. About 30 us a value. Measured against a
    refined integration, the error stays below 1.1e-6 of the value for any arguments, the horizon included, and below
    3e-8 of it for sigma from 10 to 40 degrees and random directions. Towards exact backscatter at grazing it grows as
    1 / cos; at 90 degrees it is the finite value at the float64 nearest pi/2.
    Departures from the paper: those of `oren_nayar_unidirectional`.

    References
    ----------
    orennayar1994

    Examples
    --------
    >>> round(float(oren_nayar_gaussian(0.3, 0.0, 0.4, 0.0, rho=0.9, sigma=0.5)), 4)
    0.2671
    """
    return _total(*_gaussian(checked_angles(theta_i, phi_i, theta_r, phi_r), rho, sigma))


def oren_nayar_gaussian_vectors(wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike) -> Floats:
    """`oren_nayar_gaussian` for unit vectors `wi` of the light and `wr` of the viewer, each of shape (..., 3)."""
    return _total(*_gaussian(checked_vectors(wi, wr), rho, sigma))


def oren_nayar_gaussian_parts(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    rho: ArrayLike,
    sigma: ArrayLike,
) -> Parts:
    """`oren_nayar_gaussian` in its parts, direct light and the second bounce.

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r, rho, sigma : array_like
        As `oren_nayar_gaussian` takes them.

    Returns
    -------
    Parts [1/sr]
        The arrays `direct` and `interreflected`, which add up to `oren_nayar_gaussian`.

    Raises
    ------
    ValueError
        If an argument is outside its range.

    References
    ----------
    orennayar1994

    Examples
    --------
    >>> parts = oren_nayar_gaussian_parts(0.9, 0.0, 0.9, np.pi, rho=0.9, sigma=0.5)
    >>> round(float(parts.direct), 4), round(float(parts.interreflected), 4)
    (0.1552, 0.0522)
    """
    return _parts(*_gaussian(checked_angles(theta_i, phi_i, theta_r, phi_r), rho, sigma))


def oren_nayar_gaussian_parts_vectors(wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike) -> Parts:
    """`oren_nayar_gaussian_parts` for unit vectors `wi` of the light and `wr` of the viewer, each of shape (..., 3)."""
    return _parts(*_gaussian(checked_vectors(wi, wr), rho, sigma))


def gaussian_part(wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike, part: PartName) -> Floats:
    """One part of `oren_nayar_gaussian_parts_vectors`, without the work of the other."""
    return _part(part, *_gaussian(checked_vectors(wi, wr), rho, sigma, part))


def _gaussian(
    directions: Directions, rho: ArrayLike, sigma: ArrayLike, only: PartName | None = None
) -> tuple[Floats, Floats, Directions]:
    """Both parts, or only one, and then nothing of use for the other."""
    albedo, deviation = RHO.check(rho), SIGMA.check(sigma)
    tangents = directions.sin_i / directions.cos_i, directions.sin_r / directions.cos_r
    features = *tangents, directions.cos_dphi, directions.sin_dphi, deviation
    direct, bounce = gaussian(*features, lit=only != "interreflected", bounce=only != "direct")
    return _scaled(direct, bounce, albedo, directions)


UNIDIRECTIONAL_SPEC = ModelSpec(
    name="oren_nayar_unidirectional",
    version=1,
    title="Oren-Nayar, parallel cavities of one slope",
    equation="eqs 10-22",
    reference="orennayar1994",
    parameters=(RHO, THETA_A, PHI_A),
    evaluate=oren_nayar_unidirectional,
    vectors=oren_nayar_unidirectional_vectors,
    grazing_pole=True,
    anisotropic=lambda parameters: parameters["theta_a"] > 0.0,
    lossless=white,
)
SINGLE_SLOPE_SPEC = ModelSpec(
    name="oren_nayar_single_slope",
    version=1,
    title="Oren-Nayar, one slope in all azimuths",
    equation="eqs 45, 49",
    reference="orennayar1994",
    parameters=(RHO, THETA_A),
    evaluate=oren_nayar_single_slope,
    vectors=oren_nayar_single_slope_vectors,
    grazing_pole=True,
    excess=_SINGLE_SLOPE_EXCESS,
    lossless=white,
)
GAUSSIAN_SPEC = ModelSpec(
    name="oren_nayar_gaussian",
    version=1,
    title="Oren-Nayar, Gaussian slopes, integrated",
    equation="eqs 8, 10-20, 47",
    reference="orennayar1994",
    parameters=(RHO, SIGMA),
    evaluate=oren_nayar_gaussian,
    vectors=oren_nayar_gaussian_vectors,
    grazing_pole=True,
    lossless=white,
)
