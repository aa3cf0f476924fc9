"""He, Torrance, Sillion and Greenberg 1991 at 40 digits: the BRDF for unpolarised light (Appendix B), in three parts.

Our directions point away from the surface; the paper's k_i travels towards it, so k_i = -(direction of the light).
Lengths of the surface are micrometres, wavelengths nanometres. Departures from print: Eq. (25) has the Gaussian of
Smith 1967, v in Eq. (78) carries the wave number, Eq. (76) is written without its factor that is exactly 1, the root of
Eq. (81) is taken by Lambert's W, and Eq. (72) is a/pi.
"""

from collections.abc import Iterator

from brdfdb.reference import Number, mp


def uniform_diffuse(a: Number) -> Number:
    """f_r [1/sr] of the uniform diffuse part, Eq. (72) with the albedo `a` [1] divided by pi."""
    # Eq. (72)
    return mp.mpf(a) / mp.pi


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
    """f_r [1/sr] of the directional diffuse part, Eq. (71), for the refractive index n + i k."""
    theta_i, theta_r, delta_phi = mp.mpf(theta_i), mp.mpf(theta_r), mp.mpf(delta_phi)
    wavelength = mp.mpf(wavelength_nm) / 1000
    sigma_0, tau = mp.mpf(sigma_0_um), mp.mpf(tau_um)

    v_x, v_y, v_z = _wave_vector_change(theta_i, theta_r, delta_phi)
    v_squared = v_x**2 + v_y**2 + v_z**2
    # Eq. (76)
    geometry = (v_squared / v_z) ** 2
    # Eq. (75), at the bisecting angle arccos(|v|/2)
    fresnel = fresnel_unpolarised(mp.sqrt(v_squared) / 2, n, k)
    # Eqs. (23), (77)
    shadow = shadowing(theta_i, sigma_0, tau) * shadowing(theta_r, sigma_0, tau)
    # Eq. (79)
    g = surface_roughness(theta_i, theta_r, wavelength, sigma_0, tau)
    # Eq. (78)
    V = lateral_phase(theta_i, theta_r, delta_phi, wavelength, tau)
    distribution = mp.pi**2 * tau**2 / (4 * wavelength**2) * series(g, V)
    # Eq. (71)
    return fresnel / mp.pi * geometry * shadow * distribution / (mp.cos(theta_i) * mp.cos(theta_r))


def specular_reflectance(
    theta_i: Number, wavelength_nm: Number, sigma_0_um: Number, tau_um: Number, n: Number, k: Number
) -> Number:
    """The specular reflectivity rho_s [1] of Eq. (73), in the mirror direction theta_r = theta_i."""
    theta_i = mp.mpf(theta_i)
    wavelength = mp.mpf(wavelength_nm) / 1000
    sigma_0, tau = mp.mpf(sigma_0_um), mp.mpf(tau_um)
    # Eqs. (23), (77)
    shadow = shadowing(theta_i, sigma_0, tau) ** 2
    # Eq. (79)
    g = surface_roughness(theta_i, theta_i, wavelength, sigma_0, tau)
    # Eq. (73)
    return fresnel_unpolarised(mp.cos(theta_i), n, k) * mp.exp(-g) * shadow


def fresnel_unpolarised(cos_theta: Number, n: Number, k: Number) -> Number:
    """|F|^2 [1], Eq. (75): the reflectance of a plane interface to n + i k at incidence arccos(`cos_theta`)."""
    cos_theta = mp.mpf(cos_theta)
    index = mp.mpc(n, k)
    # Snell's law: index * cos of the (complex) angle of refraction
    refracted = mp.sqrt(index**2 - (1 - cos_theta**2))
    f_s = (cos_theta - refracted) / (cos_theta + refracted)
    f_p = (index**2 * cos_theta - refracted) / (index**2 * cos_theta + refracted)
    # Eq. (75)
    return (abs(f_s) ** 2 + abs(f_p) ** 2) / 2


def shadowing(theta: Number, sigma_0: Number, tau: Number) -> Number:
    """S_i or S_r [1] of Eq. (24), the shadowing of one direction; the model takes the product of both, Eq. (23).

    `theta` [rad]; `sigma_0` and `tau` in the same unit of length.
    """
    theta, sigma_0, tau = mp.mpf(theta), mp.mpf(sigma_0), mp.mpf(tau)
    if theta == 0 or sigma_0 == 0:
        return mp.one  # the argument x of erfc is infinite
    cot = mp.cot(theta)
    x = tau * cot / (2 * sigma_0)
    # Eq. (25) with the Gaussian of Smith 1967
    lambda_cot = (2 / mp.sqrt(mp.pi) * sigma_0 / (tau * cot) * mp.exp(-(x**2)) - mp.erfc(x)) / 2
    # Eq. (24)
    return (1 - mp.erfc(x) / 2) / (lambda_cot + 1)


def effective_roughness(theta_i: Number, theta_r: Number, sigma_0: Number, tau: Number) -> Number:
    """sigma of Eq. (80), the roughness that is lit and seen, in the unit of length of `sigma_0` and `tau`."""
    sigma_0 = mp.mpf(sigma_0)
    # Eqs. (82), (83)
    k_i = _shadowed_tangent(theta_i, sigma_0, tau)
    k_r = _shadowed_tangent(theta_r, sigma_0, tau)
    # Eq. (81), solved for (z_0 / sigma_0)^2 by Lambert's W
    z_0_squared = mp.lambertw(2 * ((k_i + k_r) / 4) ** 2 / mp.pi).real
    # Eq. (80)
    return sigma_0 / mp.sqrt(1 + z_0_squared)


def surface_roughness(theta_i: Number, theta_r: Number, wavelength: Number, sigma_0: Number, tau: Number) -> Number:
    """g [1] of Eq. (79); `wavelength`, `sigma_0` and `tau` in the same unit of length."""
    sigma = effective_roughness(theta_i, theta_r, sigma_0, tau)
    # Eq. (79)
    return (2 * mp.pi * sigma / mp.mpf(wavelength) * (mp.cos(mp.mpf(theta_i)) + mp.cos(mp.mpf(theta_r)))) ** 2


def lateral_phase(theta_i: Number, theta_r: Number, delta_phi: Number, wavelength: Number, tau: Number) -> Number:
    """V = v_xy^2 tau^2 / 4 [1] of Eq. (78), with the wave number in v; `wavelength` and `tau` in the same unit."""
    v_x, v_y, _ = _wave_vector_change(mp.mpf(theta_i), mp.mpf(theta_r), mp.mpf(delta_phi))
    # Eq. (20)
    wave_number = 2 * mp.pi / mp.mpf(wavelength)
    # Eq. (78)
    return wave_number**2 * (v_x**2 + v_y**2) * mp.mpf(tau) ** 2 / 4


def series(g: Number, V: Number) -> Number:
    """The sum [1] of Eq. (78), g^m e^-g / (m! m) exp(-V/m) over m from 1 on, with V = v_xy^2 tau^2 / 4.

    Term by term, up and down from the largest one until a term is below 1e-50 of the sum: thousands of terms, about a
    second at g = 1e6.
    """
    with mp.workdps(mp.dps + 20):  # log(largest term) is a difference of numbers near g ln g
        g, V = mp.mpf(g), mp.mpf(V)
        total = mp.zero
        if g > 0:
            peak = _largest_term(g, V)
            for start, step in ((peak, 1), (peak - 1, -1)):
                for term in _terms(g, V, start, step):
                    total += term
                    if term < total * mp.mpf("1e-50"):
                        break
    return +total  # rounded to the 40 digits


def _terms(g: Number, V: Number, start: int, step: int) -> Iterator[Number]:
    """The terms of Eq. (78) from m = `start`: upwards without an end (step 1) or downwards to m = 1 (step -1)."""
    m = start
    poisson = mp.exp(m * mp.log(g) - g - mp.loggamma(m + 1))  # g^m e^-g / m!
    while m >= 1:
        # Eq. (78)
        yield poisson / m * mp.exp(-V / m)
        poisson = poisson * g / (m + 1) if step > 0 else poisson * m / g
        m += step


def _largest_term(g: Number, V: Number) -> int:
    """The m of the largest term of Eq. (78): the first whose successor is not larger, by bisection.

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


def _shadowed_tangent(theta: Number, sigma_0: Number, tau: Number) -> Number:
    """K_i or K_r [1] of Eqs. (82), (83)."""
    theta, sigma_0, tau = mp.mpf(theta), mp.mpf(sigma_0), mp.mpf(tau)
    if theta == 0 or sigma_0 == 0:
        return mp.zero  # the argument of erfc is infinite
    # Eqs. (82), (83)
    return mp.tan(theta) * mp.erfc(tau / (2 * sigma_0) * mp.cot(theta))


def _wave_vector_change(theta_i: Number, theta_r: Number, delta_phi: Number) -> tuple[Number, Number, Number]:
    """v = k_r - k_i [1] of Eq. (84) for unit wave vectors, the light at azimuth 0."""
    # Eq. (84)
    v_x = mp.sin(theta_r) * mp.cos(delta_phi) + mp.sin(theta_i)
    v_y = mp.sin(theta_r) * mp.sin(delta_phi)
    v_z = mp.cos(theta_r) + mp.cos(theta_i)
    return v_x, v_y, v_z
