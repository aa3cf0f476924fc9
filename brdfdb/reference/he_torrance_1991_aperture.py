"""Finite apertures of He, Torrance, Sillion and Greenberg 1991: circular cones of light and of the receiver."""

import math

import numpy as np
from numpy.typing import NDArray

from brdfdb.reference import Number, mp
from brdfdb.reference.he_torrance_1991 import specular_reflectance

Array = NDArray[np.float64]


def aperture_specular(
    theta_i: Number,
    theta_r: Number,
    delta_phi: Number,
    incident_solid_angle_sr: Number,
    received_solid_angle_sr: Number,
    wavelength_nm: Number,
    sigma_0_um: Number,
    tau_um: Number,
    n: Number,
    k: Number,
) -> Number:
    """Return f_r [1/sr] of the specular part, Eq. (70), for a circular cone of light and one of the receiver.

    The mirror image of the cone of light has the radiance rho_s L, and nothing else has any; the receiver takes the
    mean over its own solid angle, and the irradiance is L cos(theta_i) times the solid angle of light. The angles are
    those of the axes. A solid angle is pi sin^2 of half the angle of its cone, with which the integral over all axes of
    the receiver is rho_s; the area of the cone on the unit sphere is larger, by 1 part in 4000 at pi/1024.
    """
    with mp.workdps(2 * mp.dps):  # small cones lose digits
        theta_i, theta_r, delta_phi = mp.mpf(theta_i), mp.mpf(theta_r), mp.mpf(delta_phi)
        incident, received = mp.mpf(incident_solid_angle_sr), mp.mpf(received_solid_angle_sr)
        image = mp.sin(theta_i), mp.zero, mp.cos(theta_i)
        viewer = -mp.sin(theta_r) * mp.cos(delta_phi), mp.sin(theta_r) * mp.sin(delta_phi), mp.cos(theta_r)
        apart = mp.acos(min(mp.fdot(image, viewer), mp.one))
        area = _common_area(mp.asin(mp.sqrt(incident / mp.pi)), mp.asin(mp.sqrt(received / mp.pi)), apart)
        rho_s = specular_reflectance(theta_i, wavelength_nm, sigma_0_um, tau_um, n, k)
        # Eq. (70), with the share of the received cone for its Delta
        value = rho_s / (mp.cos(theta_i) * incident) * area / received
    return +value  # rounded to the 40 digits


def aperture_diffuse(
    theta_i: Number,
    theta_r: Number,
    delta_phi: Number,
    incident_solid_angle_sr: Number,
    received_solid_angle_sr: Number,
    wavelength_nm: Number,
    sigma_0_um: Number,
    tau_um: Number,
    n: Number,
    k: Number,
) -> float:
    """Return f_r [1/sr] of the directional diffuse part, Eq. (71), averaged over two circular cones by solid angle.

    The cones are those of `aperture_specular` and lie above the horizon. Float64, not 40 digits: Gauss and Legendre in
    the angle from the axis, equal steps around it, refined until a doubling of the nodes moves the mean by less than
    1e-12 of itself. From a tenth of a second to ten.
    """
    axes = (float(theta_i), 0.0), (float(theta_r), float(delta_phi))
    solid_angles = float(incident_solid_angle_sr), float(received_solid_angle_sr)
    surface = tuple(map(float, (wavelength_nm, sigma_0_um, tau_um, n, k)))
    coarse = math.inf
    for nodes in (2, 4, 8, 16):
        (light, weights_i), (viewer, weights_r) = (
            _cone(*axis, solid_angle, nodes) for axis, solid_angle in zip(axes, solid_angles, strict=True)
        )
        fine = float(weights_i @ _directional_diffuse(light[:, None], viewer, *surface) @ weights_r)
        if abs(fine - coarse) <= 1e-12 * fine:
            return fine
        coarse = fine
    raise ArithmeticError(f"no convergence at {axes}, solid angles {solid_angles}: {coarse}")


def _common_area(first: Number, second: Number, apart: Number) -> Number:
    """Return the area [sr] common to two circles of radii `first` and `second` [rad], centres `apart` [rad]."""
    if apart >= first + second:
        return mp.zero
    if apart <= abs(first - second):
        return 2 * mp.pi * (1 - mp.cos(min(first, second)))
    cos_1, sin_1, cos_2, sin_2 = mp.cos(first), mp.sin(first), mp.cos(second), mp.sin(second)
    cos_apart, sin_apart = mp.cos(apart), mp.sin(apart)
    # spherical law of cosines: the angles of the triangle of both centres and a point where the circles cross
    at_first = mp.acos((cos_2 - cos_apart * cos_1) / (sin_apart * sin_1))
    at_second = mp.acos((cos_1 - cos_apart * cos_2) / (sin_apart * sin_2))
    crossing = mp.acos((cos_apart - cos_1 * cos_2) / (sin_1 * sin_2))
    # Gauss and Bonnet on the lens: two arcs of the geodesic curvature cot(radius), two corners of pi - crossing
    return 2 * (mp.pi - crossing - at_first * cos_1 - at_second * cos_2)


def _cone(theta: float, phi: float, solid_angle: float, nodes: int) -> tuple[Array, Array]:
    """Return unit vectors in a cone, of shape (2 nodes^2, 3), and their weights, which add up to 1."""
    half = math.asin(math.sqrt(solid_angle / math.pi))
    x, weight = np.polynomial.legendre.leggauss(nodes)
    off, turn = np.meshgrid(half * (1 + x) / 2, np.pi * np.arange(2 * nodes) / nodes, indexing="ij")
    # around z, then turned by theta about y and by phi about z
    a, b, c = np.sin(off) * np.cos(turn), np.sin(off) * np.sin(turn), np.cos(off)
    a, c = math.cos(theta) * a + math.sin(theta) * c, math.cos(theta) * c - math.sin(theta) * a
    a, b = math.cos(phi) * a - math.sin(phi) * b, math.sin(phi) * a + math.cos(phi) * b
    weights = np.sin(off) * weight[:, None]
    return np.stack([a, b, c], axis=-1).reshape(-1, 3), weights.ravel() / weights.sum()


@np.errstate(divide="ignore")  # ln(g) without roughness
def _directional_diffuse(
    light: Array, viewer: Array, wavelength_nm: float, sigma_0: float, tau: float, n: float, k: float
) -> Array:
    """Return `directional_diffuse` in float64 on arrays of unit vectors, with wave vectors in 1/um."""
    wavelength = wavelength_nm / 1000
    # Eq. (84)
    v_x, v_y, v_z = np.moveaxis(light + viewer, -1, 0)
    v_xy2 = v_x**2 + v_y**2
    # Eqs. (44), (75), at the bisecting angle arccos(|v|/2)
    cos, index = np.sqrt(v_xy2 + v_z**2) / 2, complex(n, k)
    refracted = np.sqrt(index**2 - 1 + cos**2)
    f_s, f_p = (cos - refracted) / (cos + refracted), (index**2 * cos - refracted) / (index**2 * cos + refracted)
    fresnel = (abs(f_s) ** 2 + abs(f_p) ** 2) / 2
    # Eq. (76)
    geometry = ((v_xy2 + v_z**2) / v_z) ** 2
    (shadow_i, hidden_i), (shadow_r, hidden_r) = (_shadowing(w[..., 2], sigma_0 / tau) for w in (light, viewer))
    # Eqs. (80), (81): z_0 / sigma_0 by bisection
    right = math.sqrt(2 / math.pi) / 4 * (hidden_i + hidden_r)
    low, high = np.zeros_like(right), right
    for _ in range(60):
        middle = (low + high) / 2
        above = middle > right * np.exp(-(middle**2) / 2)
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    # Eq. (79)
    g = (2 * math.pi * sigma_0 / wavelength * v_z) ** 2 / (1 + low**2)
    # Eq. (78), with the wave number in v
    V = (math.pi * tau / wavelength) ** 2 * v_xy2
    total, log_term, m = np.zeros_like(V), -g, 0
    while m < np.max(g) or np.max(np.exp(log_term)) > 1e-20 * np.min(total):
        m += 1
        log_term = log_term + np.log(g / m)
        total += np.exp(log_term - V / m) / m
    distribution = (math.pi * tau / (2 * wavelength)) ** 2 * total
    # Eqs. (71), (23)
    cosines = light[..., 2] * viewer[..., 2]
    value: Array = fresnel / math.pi * geometry * shadow_i * shadow_r * distribution / cosines
    return value


@np.errstate(divide="ignore")  # x along the normal
def _shadowing(z: Array, slope: float) -> tuple[Array, Array]:
    """Return S_i or S_r of Eq. (24) and K_i or K_r of Eqs. (82), (83) in float64, for a direction of that z."""
    tan = np.sqrt(1 - z**2) / z
    x = 1 / (2 * slope * tan)
    erfc = np.vectorize(math.erfc, otypes=[float])(x)
    # Eqs. (25), (24), with the Gaussian of Smith 1967
    lambda_cot = (2 / math.sqrt(math.pi) * slope * tan * np.exp(-(x**2)) - erfc) / 2
    return (1 - erfc / 2) / (lambda_cot + 1), tan * erfc
