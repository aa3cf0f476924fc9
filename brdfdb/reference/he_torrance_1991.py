"""He, Torrance, Sillion and Greenberg 1991 at 40 digits: parts, polarisation, limits, finite apertures.

Directions point away from the surface. The k_i of the paper points towards it, so that k_i = -(direction of the light).
Lengths of the surface are micrometres, wavelengths nanometres. Departures from print: Eq. (25) has the Gaussian of
Smith 1967, v in Eq. (78) carries the wave number, Eq. (76) is written without its factor that is exactly 1, the root of
Eq. (81) is taken by Lambert's W, Eq. (72) is a/pi, and M_ps of Eq. (64) has the minus sign that M_sp of Eq. (62) has.
"""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.reference import Number, exact, mp

Array = NDArray[np.float64]


def uniform_diffuse(a: Number) -> Number:
    """Return f_r [1/sr] of the uniform diffuse part, Eq. (72) with the albedo `a` [1] divided by pi."""
    # Eq. (72)
    return mp.mpf(a) / mp.pi


@exact
def directional_diffuse(
    theta_i: Number,
    theta_r: Number,
    delta_phi: Number,
    wavelength_nm: Number,
    sigma_0_um: Number,
    tau_um: Number,
    n: Number,
    k: Number,
) -> Number:
    """Return f_r [1/sr] of the directional diffuse part, Eq. (71), for the refractive index n + i k."""
    # Eq. (75), at the bisecting angle arccos(|v|/2)
    fresnel = fresnel_unpolarised(_cos_bisecting(theta_i, theta_r, delta_phi), n, k)
    # Eq. (71)
    return fresnel * _directional_diffuse_of_a_mirror(theta_i, theta_r, delta_phi, wavelength_nm, sigma_0_um, tau_um)


@exact
def jones(theta_i: Number, theta_r: Number, delta_phi: Number, n: Number, k: Number) -> Any:
    """Return the complex 2x2 matrix [1] of Eqs. (61)-(64) over |k_r x k_i|^2, for the refractive index n + i k.

    The field E_r = J E_i of the reflected wave, in the order (s, p): J[0, 1] is s reflected from p incident, the M_sp
    of the paper. The fields vary as exp(i k.r - i omega t), and F_s and F_p have the signs of `_fresnel`.

    The bases: for a direction w away from the surface, at azimuth phi, s = (-sin phi, cos phi, 0), which is z x w over
    its length and at w = z the limit along that azimuth; p = s x k with the unit vector k of propagation (k_i = -w_i,
    k_r = w_r), so (p, s, k) is right-handed. The light is at azimuth 0, the viewer at delta_phi. The paper's s_i and
    p_i are these; its s_r and p_r are minus these, and its M, divided by |k_r x k_i|^2, is minus the matrix between
    its own bases: between ours it is that matrix itself, once M_ps has its sign.

    Where k_r and k_i are parallel the plane of reflection is any plane through them: exactly backscattered (F_p = -F_s)
    and exactly forward at grazing (F_p = F_s) the result is the same for all of them.
    """
    with mp.workdps(3 * mp.dps):  # next to backscattering the division loses digits
        matrix = _jones(theta_i, theta_r, delta_phi, n, k)
    return matrix * mp.one  # rounded to the 40 digits


def mueller(
    theta_i: Number,
    theta_r: Number,
    delta_phi: Number,
    wavelength_nm: Number,
    sigma_0_um: Number,
    tau_um: Number,
    n: Number,
    k: Number,
) -> Any:
    """Return the 4x4 matrix [1/sr] from incident to reflected Stokes vectors, for the directional diffuse part.

    I = |E_s|^2 + |E_p|^2, Q = |E_s|^2 - |E_p|^2, U + i V = 2 E_s conj(E_p), in the bases and with the time factor of
    `jones`: a wave with V > 0 has positive helicity. The first element is `directional_diffuse`. The matrix does not
    change when s and p of a direction turn their signs together, so it is also that between the paper's bases.
    """
    value = _directional_diffuse_of_a_mirror(theta_i, theta_r, delta_phi, wavelength_nm, sigma_0_um, tau_um)
    field = jones(theta_i, theta_r, delta_phi, n, k)
    # from (E_s conj E_s, E_s conj E_p, E_p conj E_s, E_p conj E_p) to (I, Q, U, V), and back
    stokes = mp.matrix([[1, 0, 0, 1], [1, 0, 0, -1], [0, 1, 1, 0], [0, -mp.j, mp.j, 0]])
    coherency = stokes.transpose_conj() / 2
    kronecker = mp.matrix(4, 4)
    for row in range(4):
        for column in range(4):
            one, other = field[row // 2, column // 2], field[row % 2, column % 2]
            kronecker[row, column] = one * mp.conj(other)
    # Eqs. (7), (59), (60), (68)
    return value * (stokes * kronecker * coherency).apply(mp.re)


@exact
def very_rough(theta_i: Number, theta_r: Number, delta_phi: Number, slope: Number, n: Number, k: Number) -> Number:
    """Return f_r [1/sr] in the limit of wavelength 0: `directional_diffuse` with Beckmann's exp(-V/g) / g for the sum.

    The paper gives it in words (section 4 on sandpaper, and Figure 13 a): the wavelength drops out of V / g and of
    tau^2 / (wavelength^2 g), and only `slope` = sigma_0 / tau [1] is left, in the effective roughness and in S too.
    """
    v_x, v_y, v_z = _wave_vector_change(theta_i, theta_r, delta_phi)
    v_squared = v_x**2 + v_y**2 + v_z**2
    # Eq. (75), at the bisecting angle arccos(|v|/2)
    fresnel = fresnel_unpolarised(mp.sqrt(v_squared) / 2, n, k)
    # Eq. (76)
    geometry = (v_squared / v_z) ** 2
    # Eqs. (23), (77)
    shadow = shadowing(theta_i, slope, 1) * shadowing(theta_r, slope, 1)
    # Eq. (80), over tau
    effective_slope = effective_roughness(theta_i, theta_r, slope, 1)
    # Eqs. (78), (79): V / g, and pi^2 tau^2 / (4 lambda^2 g)
    ratio = (v_x**2 + v_y**2) / (4 * (effective_slope * v_z) ** 2)
    distribution = mp.exp(-ratio) / (4 * effective_slope * v_z) ** 2
    # Eq. (71)
    return fresnel / mp.pi * geometry * shadow * distribution / (mp.cos(theta_i) * mp.cos(theta_r))


def smooth(theta_i: Number, n: Number, k: Number) -> Number:
    """Return the specular reflectance [1] of a smooth surface, the factor |F|^2 of Eq. (10)."""
    # Eq. (10)
    return fresnel_unpolarised(mp.cos(mp.mpf(theta_i)), n, k)


@exact
def specular_reflectance(
    theta_i: Number, wavelength_nm: Number, sigma_0_um: Number, tau_um: Number, n: Number, k: Number
) -> Number:
    """Return the specular reflectance rho_s [1] of Eq. (73), in the mirror direction theta_r = theta_i."""
    wavelength = mp.mpf(wavelength_nm) / 1000
    sigma_0, tau = mp.mpf(sigma_0_um), mp.mpf(tau_um)
    # Eqs. (23), (77)
    shadow = shadowing(theta_i, sigma_0, tau) ** 2
    # Eq. (79)
    g = surface_roughness(theta_i, theta_i, wavelength, sigma_0, tau)
    # Eq. (73)
    return fresnel_unpolarised(mp.cos(theta_i), n, k) * mp.exp(-g) * shadow


def fresnel_unpolarised(cos_theta: Number, n: Number, k: Number) -> Number:
    """Return |F|^2 [1], Eq. (75): the reflectance of a plane interface to n + i k at incidence arccos(`cos_theta`)."""
    f_s, f_p = _fresnel(cos_theta, n, k)
    # Eq. (75)
    return (abs(f_s) ** 2 + abs(f_p) ** 2) / 2


@exact
def shadowing(theta: Number, sigma_0: Number, tau: Number) -> Number:
    """Return S_i or S_r [1] of Eq. (24), the shadowing of one direction; the model takes the product of both, Eq. (23).

    `theta` [rad]; `sigma_0` and `tau` in the same unit of length.
    """
    if theta == 0 or sigma_0 == 0:
        return mp.one  # the argument x of erfc is infinite
    cot = mp.cot(theta)
    x = tau * cot / (2 * sigma_0)
    # Eq. (25) with the Gaussian of Smith 1967
    lambda_cot = (2 / mp.sqrt(mp.pi) * sigma_0 / (tau * cot) * mp.exp(-(x**2)) - mp.erfc(x)) / 2
    # Eq. (24)
    return (1 - mp.erfc(x) / 2) / (lambda_cot + 1)


@exact
def effective_roughness(theta_i: Number, theta_r: Number, sigma_0: Number, tau: Number) -> Number:
    """Return sigma of Eq. (80), the roughness that is lit and seen, in the unit of length of `sigma_0` and `tau`."""
    # Eqs. (82), (83)
    k_i = _shadowed_tangent(theta_i, sigma_0, tau)
    k_r = _shadowed_tangent(theta_r, sigma_0, tau)
    # Eq. (81), solved for (z_0 / sigma_0)^2 by Lambert's W
    z_0_squared = mp.lambertw(2 * ((k_i + k_r) / 4) ** 2 / mp.pi).real
    # Eq. (80)
    return sigma_0 / mp.sqrt(1 + z_0_squared)


def surface_roughness(theta_i: Number, theta_r: Number, wavelength: Number, sigma_0: Number, tau: Number) -> Number:
    """Return g [1] of Eq. (79); `wavelength`, `sigma_0` and `tau` in the same unit of length."""
    sigma = effective_roughness(theta_i, theta_r, sigma_0, tau)
    # Eq. (79)
    return (2 * mp.pi * sigma / mp.mpf(wavelength) * (mp.cos(mp.mpf(theta_i)) + mp.cos(mp.mpf(theta_r)))) ** 2


def lateral_phase(theta_i: Number, theta_r: Number, delta_phi: Number, wavelength: Number, tau: Number) -> Number:
    """Return V = v_xy^2 tau^2 / 4 [1] of Eq. (78), with the wave number in v; both lengths in the same unit."""
    v_x, v_y, _ = _wave_vector_change(mp.mpf(theta_i), mp.mpf(theta_r), mp.mpf(delta_phi))
    # Eq. (20)
    wave_number = 2 * mp.pi / mp.mpf(wavelength)
    # Eq. (78)
    return wave_number**2 * (v_x**2 + v_y**2) * mp.mpf(tau) ** 2 / 4


def series(g: Number, V: Number) -> Number:
    """Return the sum [1] of Eq. (78), g^m e^-g / (m! m) exp(-V/m) over m from 1 on, with V = v_xy^2 tau^2 / 4.

    Terms are added up and down from the largest one until a term is below 1e-50 of the sum. At g = 1e6 these are
    thousands of terms, which take about a second.
    """
    with mp.workdps(mp.dps + 20):  # log(largest term) is a difference of numbers near g ln g
        g, V = mp.mpf(g), mp.mpf(V)
        total, least = mp.zero, mp.mpf("1e-50")
        if g > 0:
            peak = _largest_term(g, V)
            for start, step in ((peak, 1), (peak - 1, -1)):
                for term in _terms(g, V, start, step):
                    total += term
                    if term < total * least:
                        break
    return +total  # rounded to the 40 digits


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
        fine = float(weights_i @ _averaged_diffuse(light[:, None], viewer, *surface) @ weights_r)
        if abs(fine - coarse) <= 1e-12 * fine:
            return fine
        coarse = fine
    raise ArithmeticError(f"no convergence at {axes}, solid angles {solid_angles}: {coarse}")


@exact
def _fresnel(cos_theta: Number, n: Number, k: Number) -> tuple[Number, Number]:
    """Return F_s and F_p [1] of Eq. (44): F_p = -F_s = (index - 1) / (index + 1) at the normal, both -1 at grazing."""
    index = mp.mpc(n, k)
    # Snell's law: index * cos of the (complex) angle of refraction
    refracted = mp.sqrt(index**2 - (1 - cos_theta**2))
    f_s = (cos_theta - refracted) / (cos_theta + refracted)
    f_p = (index**2 * cos_theta - refracted) / (index**2 * cos_theta + refracted)
    return f_s, f_p


def _jones(theta_i: Number, theta_r: Number, delta_phi: Number, n: Number, k: Number) -> Any:
    """Return `jones` at the precision that is set."""
    k_i = (-mp.sin(theta_i), mp.zero, -mp.cos(theta_i))
    k_r = (mp.sin(theta_r) * mp.cos(delta_phi), mp.sin(theta_r) * mp.sin(delta_phi), mp.cos(theta_r))
    f_s, f_p = _fresnel(_cos_bisecting(theta_i, theta_r, delta_phi), n, k)
    # Eqs. (35), (14)
    s_i, s_r = (mp.zero, mp.one, mp.zero), (mp.sin(delta_phi), -mp.cos(delta_phi), mp.zero)
    p_i, p_r = _cross(s_i, k_i), _cross(s_r, k_r)
    across = _cross(k_r, k_i)
    squared = mp.fdot(across, across)
    if squared < mp.mpf(10) ** -mp.dps:
        sign = mp.one if mp.fdot(k_i, k_r) < 0 else -mp.one
        # Eq. (46) with s_i^n = s_r^n = s_i, and p_r^n = -p_i^n (back) or p_i^n (forward)
        return mp.matrix(
            [
                [-f_s * mp.fdot(s_r, s_i), sign * f_p * mp.fdot(s_r, p_i)],
                [-f_s * mp.fdot(p_r, s_i), sign * f_p * mp.fdot(p_r, p_i)],
            ]
        )
    pi_kr, si_kr = mp.fdot(p_i, k_r), mp.fdot(s_i, k_r)
    pr_ki, sr_ki = mp.fdot(p_r, k_i), mp.fdot(s_r, k_i)
    # Eq. (61)
    m_ss = f_s * pi_kr * pr_ki + f_p * si_kr * sr_ki
    # Eq. (62)
    m_sp = -(f_s * si_kr * pr_ki - f_p * pi_kr * sr_ki)
    # Eq. (63)
    m_pp = f_s * si_kr * sr_ki + f_p * pi_kr * pr_ki
    # Eq. (64), with the minus sign
    m_ps = -(f_s * pi_kr * sr_ki - f_p * si_kr * pr_ki)
    return mp.matrix([[m_ss, m_sp], [m_ps, m_pp]]) / squared


@exact
def _directional_diffuse_of_a_mirror(
    theta_i: Number, theta_r: Number, delta_phi: Number, wavelength_nm: Number, sigma_0_um: Number, tau_um: Number
) -> Number:
    """Return eq. (71) [1/sr] with |F|^2 = 1."""
    wavelength = mp.mpf(wavelength_nm) / 1000
    sigma_0, tau = mp.mpf(sigma_0_um), mp.mpf(tau_um)

    v_x, v_y, v_z = _wave_vector_change(theta_i, theta_r, delta_phi)
    # Eq. (76)
    geometry = ((v_x**2 + v_y**2 + v_z**2) / v_z) ** 2
    # Eqs. (23), (77)
    shadow = shadowing(theta_i, sigma_0, tau) * shadowing(theta_r, sigma_0, tau)
    # Eq. (79)
    g = surface_roughness(theta_i, theta_r, wavelength, sigma_0, tau)
    # Eq. (78)
    V = lateral_phase(theta_i, theta_r, delta_phi, wavelength, tau)
    distribution = mp.pi**2 * tau**2 / (4 * wavelength**2) * series(g, V)
    # Eq. (71)
    return geometry / mp.pi * shadow * distribution / (mp.cos(theta_i) * mp.cos(theta_r))


def _terms(g: Number, V: Number, start: int, step: int) -> Iterator[Number]:
    """Yield the terms of Eq. (78) from m = `start`: upwards without an end (step 1) or down to m = 1 (step -1)."""
    m = start
    poisson = mp.exp(m * mp.log(g) - g - mp.loggamma(m + 1))  # g^m e^-g / m!
    while m >= 1:
        # Eq. (78)
        yield poisson / m * mp.exp(-V / m)
        poisson = poisson * g / (m + 1) if step > 0 else poisson * m / g
        m += step


def _largest_term(g: Number, V: Number) -> int:
    """Return the m of the largest term of Eq. (78): the first whose successor is not larger, by bisection.

    The ratio of term m + 1 to term m falls as m grows, so the terms have a single peak.
    """

    def rises(m: int) -> bool:
        return bool(g * m / mp.mpf(m + 1) ** 2 * mp.exp(V / (m * (m + 1))) > 1)

    low, high = 0, 1
    while rises(high):
        low, high = high, 2 * high
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if rises(middle) else (low, middle)
    return high


@exact
def _shadowed_tangent(theta: Number, sigma_0: Number, tau: Number) -> Number:
    """Return K_i or K_r [1] of Eqs. (82), (83)."""
    if theta == 0 or sigma_0 == 0:
        return mp.zero  # the argument of erfc is infinite
    # Eqs. (82), (83)
    return mp.tan(theta) * mp.erfc(tau / (2 * sigma_0) * mp.cot(theta))


def _wave_vector_change(theta_i: Number, theta_r: Number, delta_phi: Number) -> tuple[Number, Number, Number]:
    """Return v = k_r - k_i [1] of Eq. (84) for unit wave vectors, the light at azimuth 0."""
    # Eq. (84)
    v_x = mp.sin(theta_r) * mp.cos(delta_phi) + mp.sin(theta_i)
    v_y = mp.sin(theta_r) * mp.sin(delta_phi)
    v_z = mp.cos(theta_r) + mp.cos(theta_i)
    return v_x, v_y, v_z


def _cos_bisecting(theta_i: Number, theta_r: Number, delta_phi: Number) -> Number:
    """Return |v|/2 [1], the cosine of the bisecting angle."""
    v = _wave_vector_change(theta_i, theta_r, delta_phi)
    return mp.sqrt(mp.fdot(v, v)) / 2


def _cross(a: tuple[Number, Number, Number], b: tuple[Number, Number, Number]) -> tuple[Number, Number, Number]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


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
def _averaged_diffuse(
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
    (shadow_i, hidden_i), (shadow_r, hidden_r) = (
        _shadowing_of_cosine(w[..., 2], sigma_0 / tau) for w in (light, viewer)
    )
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
def _shadowing_of_cosine(z: Array, slope: float) -> tuple[Array, Array]:
    """Return S_i or S_r of Eq. (24) and K_i or K_r of Eqs. (82), (83) in float64, for a direction of that z."""
    tan = np.sqrt(1 - z**2) / z
    x = 1 / (2 * slope * tan)
    erfc = np.vectorize(math.erfc, otypes=[float])(x)
    # Eqs. (25), (24), with the Gaussian of Smith 1967
    lambda_cot = (2 / math.sqrt(math.pi) * slope * tan * np.exp(-(x**2)) - erfc) / 2
    return (1 - erfc / 2) / (lambda_cot + 1), tan * erfc
