"""The surfaces of Oren and Nayar 1994, facet by facet: unidirectional, of a single slope, of Gaussian slopes."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.geometry import Directions, checked_angles, checked_vectors, finished
from brdfdb.models._oren_nayar_facets import NODES, bounce_of_cavity, direct_of_cavity, gaussian
from brdfdb.models._oren_nayar_single_slope import bounce_of_slope, direct_of_slope, over_slopes
from brdfdb.models.oren_nayar_1994 import RHO, SIGMA, Parts
from brdfdb.parameters import Floats, Parameter

THETA_A = Parameter("theta_a", "θ_a", "rad", 0.0, np.pi / 2, "slope of the facets")
PHI_A = Parameter("phi_a", "φ_a", "rad", 0.0, np.pi, "azimuth of the facets' normals, and half a turn from it")

PartName = Literal["direct", "interreflected"]  # a field of `Parts`


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
    """Return the BRDF [1/sr] of parallel V-cavities of one slope: exact in direct light and the second bounce.

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
    Departures from the paper: GAF = Min[1, Max[0, Min[A, B]]] (eq. 33 of the paper asks for it); the shadowed row of
    Table 1 is over <v,n>, not <s,a>; a facet that faces away from light or viewer adds nothing, but one that faces away
    from the light alone is lit by its neighbour. Eqs (15) and (16) are as printed: m_v and m_s are the widths that are
    masked and shadowed, which the paper's words call visible and illuminated.

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
    """Return `oren_nayar_unidirectional` in its parts, direct light and the second bounce.

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
    """Return the BRDF [1/sr] from radiances over rho E_0 cos(theta_i) / pi, and rho times that."""
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
    """Return the BRDF [1/sr] of V-cavities of one slope in all azimuths alike, the paper's closed forms.

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
    """Return `oren_nayar_single_slope` in its parts, direct light and the second bounce.

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


def single_slope_mean(
    wi: ArrayLike,
    wr: ArrayLike,
    *,
    rho: ArrayLike,
    theta_a: NDArray[np.float64],
    weight: NDArray[np.float64],
    lit: bool = True,
    bounce: bool = True,
) -> Floats:
    """Return the mean f_r [1/sr] of `oren_nayar_single_slope_vectors` over slopes `theta_a` [rad] of these weights.

    Direct light if `lit`, the second bounce if `bounce`. Slopes and weights have the shape (S,), the vectors (N, 3).
    """
    directions, albedo = checked_vectors(wi, wr), RHO.check(rho)
    direct, bounced = over_slopes(*_features(directions), theta_a, weight, lit=lit, bounce=bounce)
    return _total(*_scaled(direct, bounced, albedo, directions))


def _single_slope(directions: Directions, rho: ArrayLike, theta_a: ArrayLike) -> tuple[Floats, Floats, Directions]:
    """Return both parts of the closed forms."""
    albedo, slope = RHO.check(rho), THETA_A.check(theta_a)
    facet = *_features(directions), np.sin(slope), np.cos(slope)
    return _scaled(direct_of_slope(*facet), bounce_of_slope(*facet), albedo, directions)


def _features(directions: Directions) -> tuple[Floats, Floats, Floats, Floats]:
    """Return tan(theta_i), tan(theta_r), cos(phi_r - phi_i) and 1 - abs of that."""
    cos_dphi = directions.cos_dphi
    one_less_cos = directions.sin_dphi**2 / (1.0 + np.abs(cos_dphi))
    return directions.sin_i / directions.cos_i, directions.sin_r / directions.cos_r, cos_dphi, one_less_cos


def oren_nayar_gaussian(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    rho: ArrayLike,
    sigma: ArrayLike,
) -> Floats:
    """Return the BRDF [1/sr] of V-cavities with Gaussian slopes, integrated: the fit `oren_nayar` approximates it.

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
    """Return `oren_nayar_gaussian` in its parts, direct light and the second bounce.

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
    """Return one part of `oren_nayar_gaussian_parts_vectors` [1/sr], without the work of the other."""
    return _part(part, *_gaussian(checked_vectors(wi, wr), rho, sigma, part))


def gaussian_rung(
    wi: ArrayLike, wr: ArrayLike, *, rho: ArrayLike, sigma: ArrayLike, nodes: int, bounce: bool = True
) -> Floats:
    """Return f_r [1/sr] of `oren_nayar_gaussian_vectors` with a coarser quadrature of `nodes` nodes, in [1, 16].

    Without `bounce`, direct light alone.
    """
    only: PartName | None = None if bounce else "direct"
    direct, bounced, directions = _gaussian(checked_vectors(wi, wr), rho, sigma, only, nodes)
    return finished(direct + bounced if bounce else direct, directions)


def _gaussian(
    directions: Directions, rho: ArrayLike, sigma: ArrayLike, only: PartName | None = None, nodes: int = NODES
) -> tuple[Floats, Floats, Directions]:
    """Return both parts, or only one; the other then means nothing."""
    albedo, deviation = RHO.check(rho), SIGMA.check(sigma)
    tangents = directions.sin_i / directions.cos_i, directions.sin_r / directions.cos_r
    features = *tangents, directions.cos_dphi, directions.sin_dphi, deviation
    direct, bounce = gaussian(*features, lit=only != "interreflected", bounce=only != "direct", nodes=nodes)
    return _scaled(direct, bounce, albedo, directions)
