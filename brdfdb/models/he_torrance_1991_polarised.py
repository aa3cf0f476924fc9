"""He et al. 1991, polarised light: Jones matrices of the facet reflection, eqs 59-65, and Mueller matrices.

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

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb import fresnel
from brdfdb.arrays import array_function
from brdfdb.geometry import Directions, Vectors, checked_angles, checked_vectors, finished
from brdfdb.models import he_torrance_1991 as unpolarised
from brdfdb.parameters import Floats

Complexes = NDArray[np.complexfloating[Any, Any]]


@array_function
def he_torrance_jones(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    n: ArrayLike,
    k: ArrayLike,
) -> Complexes:
    """Return the Jones matrix [1] of the facet that mirrors light to viewer, between s and p of the mean surface.

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi].
    n, k : array_like [1]
        Complex refractive index n + ik; n in [1e-3, 100], k in [0, 1e4].

    Returns
    -------
    complex array [1]
        In the broadcast shape of all arguments and (2, 2): [row of the reflected, column of the incident field], in the
        order s, p. It is 0 below the horizon and nan where an angle is nan. The sum of abs(J)^2 / 2 is the |F|^2 of
        eq. 75. In the mirror direction J is -diag(F_s, F_p), because reflection reverses both s and p.

    Raises
    ------
    ParameterError
        If an argument is outside its range.

    Notes
    -----
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

    References
    ----------
    he1991 (eqs 41-46, 59-65)

    Examples
    --------
    >>> abs(he_torrance_jones(0.0, 0.0, 0.0, 0.0, n=1.5, k=0.0)).round(3).tolist()
    [[0.2, 0.0], [0.0, 0.2]]
    """
    directions = checked_angles(theta_i, phi_i, theta_r, phi_r)
    return _finished_jones(directions, unpolarised.N.check(n), unpolarised.K.check(k))


@array_function
def he_torrance_jones_vectors(wi: ArrayLike, wr: ArrayLike, *, n: ArrayLike, k: ArrayLike) -> Complexes:
    """Return `he_torrance_jones` [1] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3).

    At the pole itself s and p are those of phi = 0.
    """
    return _finished_jones(checked_vectors(wi, wr), unpolarised.N.check(n), unpolarised.K.check(k))


@array_function
def he_torrance_mueller(
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
    """Return the Mueller BRDF [1/sr] of a Gaussian rough surface: directional and uniform diffuse part.

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi].
    wavelength_nm, sigma_0_um, tau_um, n, k, a : array_like
        As in `he_torrance`.

    Returns
    -------
    array [1/sr]
        In the broadcast shape of all arguments and (4, 4). The matrix gives the Stokes vector of the reflected radiance
        from that of the irradiance, in the convention of `brdfdb.tables.stokes`. It is 0 below the horizon and nan
        where an angle is nan. Element [0, 0] is `he_torrance`.

    Raises
    ------
    ParameterError
        If an argument is outside its range.

    Notes
    -----
    Eqs (7), (59), (60) and (68): the directional diffuse part divided by |F|^2, times the Mueller matrix of
    `he_torrance_jones`. The uniform diffuse part, eq. 72, is taken as an ideal depolariser. The paper treats light
    from below the surface or from several reflections as uniform, and does not mention its polarisation.

    References
    ----------
    he1991

    Examples
    --------
    >>> surface = dict(wavelength_nm=500.0, sigma_0_um=0.18, tau_um=3.0, n=1.5, k=0.0)
    >>> M = he_torrance_mueller(0.98, 0.0, 0.98, np.pi, **surface)
    >>> round(float(M[0, 1] / M[0, 0]), 2)  # s alone is reflected near Brewster's angle
    1.0
    """
    surface = unpolarised.checked_surface(wavelength_nm, sigma_0_um, tau_um, n, k)
    return _finished_mueller(checked_angles(theta_i, phi_i, theta_r, phi_r), surface, unpolarised.A.check(a))


@array_function
def he_torrance_mueller_vectors(
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
    """Return `he_torrance_mueller` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3).

    At the pole itself s and p are those of phi = 0.
    """
    surface = unpolarised.checked_surface(wavelength_nm, sigma_0_um, tau_um, n, k)
    return _finished_mueller(checked_vectors(wi, wr), surface, unpolarised.A.check(a))


@array_function
def he_torrance_specular_mueller(
    theta_i: ArrayLike,
    *,
    wavelength_nm: ArrayLike,
    sigma_0_um: ArrayLike,
    tau_um: ArrayLike,
    n: ArrayLike,
    k: ArrayLike,
) -> Floats:
    """Return the Mueller matrix [1] of the specular part, which leaves in the exact mirror direction.

    Parameters
    ----------
    theta_i : array_like [rad]
        Angle of incidence, in [0, pi].
    wavelength_nm, sigma_0_um, tau_um, n, k : array_like
        As in `he_torrance`.

    Returns
    -------
    array [1]
        In the broadcast shape of all arguments and (4, 4), from the s and p of the light to those of the mirror
        direction, at the azimuth phi_i + pi. Element [0, 0] is `he_torrance_specular`. The matrix is 0 below the
        horizon and nan where theta_i is nan.

    Raises
    ------
    ParameterError
        If an argument is outside its range.

    Notes
    -----
    Eq. (73) with F_s and F_p in place of |F|^2. Roughness and shadowing are the same for all polarisations.

    References
    ----------
    he1991

    Examples
    --------
    >>> mirror = dict(wavelength_nm=550.0, sigma_0_um=0.0, tau_um=2.0, n=1.5, k=0.0)
    >>> he_torrance_specular_mueller(0.0, **mirror).diagonal().round(3).tolist()
    [0.04, 0.04, -0.04, -0.04]
    """
    surface = unpolarised.checked_surface(wavelength_nm, sigma_0_um, tau_um, n, k)
    return _finished_specular(checked_angles(theta_i, 0.0, 0.0, 0.0), surface)


@array_function
def he_torrance_specular_mueller_vectors(
    wi: ArrayLike, *, wavelength_nm: ArrayLike, sigma_0_um: ArrayLike, tau_um: ArrayLike, n: ArrayLike, k: ArrayLike
) -> Floats:
    """Return `he_torrance_specular_mueller` [1] for unit vectors `wi` (light) of shape (..., 3)."""
    surface = unpolarised.checked_surface(wavelength_nm, sigma_0_um, tau_um, n, k)
    return _finished_specular(checked_vectors(wi, wi), surface)


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
    return _normalised_facet(directions, unpolarised.N.check(n), unpolarised.K.check(k))


def _normalised_facet(directions: Directions, n: Floats, k: Floats) -> Floats:
    half_sum, half_difference = fresnel.half_sum_and_difference(directions.cos_i, n, k)
    F_s, F_p = half_sum + half_difference, half_sum - half_difference
    M = _mueller(F_s, np.zeros_like(F_s), np.zeros_like(F_s), F_p)
    reflectance = M[..., :1, :1]
    relative = np.divide(M, reflectance, out=np.zeros_like(M), where=reflectance > 0.0)
    return finished(relative, directions, trailing=2)


def _finished_specular(directions: Directions, surface: unpolarised.Surface) -> Floats:
    rho_s = unpolarised.rho_s(directions, surface)
    relative = _normalised_facet(directions, surface.n, surface.k)
    return finished(rho_s[..., None, None] * relative, directions, trailing=2)


def _finished_jones(directions: Directions, n: Floats, k: Floats) -> Complexes:
    J = np.stack(_jones(directions, n, k), axis=-1)
    parts = J.view(np.float64).reshape(*J.shape[:-1], 2, 2, 2)
    done: Floats = np.ascontiguousarray(finished(parts, directions, trailing=3))
    result: Complexes = done.view(np.result_type(done.dtype, np.complex64))[..., 0]
    return result


def _finished_mueller(directions: Directions, surface: unpolarised.Surface, albedo: Floats) -> Floats:
    # Eqs (7), (59), (60), (68)
    M = _mueller(*_jones(directions, surface.n, surface.k))
    with np.errstate(all="ignore"):
        of_a_mirror = unpolarised.directional_diffuse(directions, surface)
    f_r = of_a_mirror[..., None, None] * M
    # Eq. (72)
    depolariser = np.zeros((4, 4))
    depolariser[0, 0] = 1.0 / np.pi
    return finished(f_r + np.asarray(albedo)[..., None, None] * depolariser, directions, trailing=2)


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
        cos_bisecting = unpolarised.cos_bisecting(directions)
    half_sum, half_difference = fresnel.half_sum_and_difference(cos_bisecting, n, k)
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
