"""Ward 1992 at 40 digits: the Gaussian models (Eqs. 4, 5a, 5b), and the density of the samples of Eq. (7).

Angles are radians, the reflectances rho_d and rho_s and the slope deviations alpha are numbers [1].
"""

from brdfdb.reference import Number, exact, mp


@exact
def circular(
    theta_i: Number, theta_r: Number, delta_phi: Number, rho_d: Number, rho_s: Number, alpha: Number
) -> Number:
    """Return f_r [1/sr] by Eq. (4), the isotropic model."""
    h_x, h_y, h_z = _half_vector(theta_i, mp.zero, theta_r, delta_phi)
    # Figure 5: delta is the polar angle of h
    tan_delta = mp.hypot(h_x, h_y) / h_z
    # Eq. (4)
    lobe = mp.exp(-(tan_delta**2) / alpha**2) / (4 * mp.pi * alpha**2)
    return rho_d / mp.pi + rho_s / mp.sqrt(mp.cos(theta_i) * mp.cos(theta_r)) * lobe


@exact
def elliptical(
    theta_i: Number,
    phi_i: Number,
    theta_r: Number,
    phi_r: Number,
    rho_d: Number,
    rho_s: Number,
    alpha_x: Number,
    alpha_y: Number,
) -> Number:
    """Return f_r [1/sr] by Eq. (5a)."""
    h_x, h_y, h_z = _half_vector(theta_i, phi_i, theta_r, phi_r)
    # Figure 5: delta and phi are the polar angle and the azimuth of h
    tan_delta = mp.hypot(h_x, h_y) / h_z
    phi = mp.atan2(h_y, h_x)
    # Eq. (5a)
    exponent = -(tan_delta**2) * (mp.cos(phi) ** 2 / alpha_x**2 + mp.sin(phi) ** 2 / alpha_y**2)
    lobe = mp.exp(exponent) / (4 * mp.pi * alpha_x * alpha_y)
    return rho_d / mp.pi + rho_s / mp.sqrt(mp.cos(theta_i) * mp.cos(theta_r)) * lobe


@exact
def half_vector(
    theta_i: Number,
    phi_i: Number,
    theta_r: Number,
    phi_r: Number,
    rho_d: Number,
    rho_s: Number,
    alpha_x: Number,
    alpha_y: Number,
) -> Number:
    """Return f_r [1/sr] by Eq. (5b); "approximation" in the paper, it differs from Eq. (5a) away from the peak."""
    h_x, h_y, h_z = _half_vector(theta_i, phi_i, theta_r, phi_r)
    # Eq. (5b)
    exponent = -2 * ((h_x / alpha_x) ** 2 + (h_y / alpha_y) ** 2) / (1 + h_z)
    lobe = mp.exp(exponent) / (4 * mp.pi * alpha_x * alpha_y)
    return rho_d / mp.pi + rho_s / mp.sqrt(mp.cos(theta_i) * mp.cos(theta_r)) * lobe


@exact
def sampling_pdf(
    theta_i: Number, phi_i: Number, theta_r: Number, phi_r: Number, alpha_x: Number, alpha_y: Number
) -> Number:
    """Return the density [1/sr] over the directions (theta_r, phi_r) of the samples that Eq. (7) makes for a light.

    Eq. (7a) with tan delta on its left, where the paper has delta: the slopes of h have the Gaussian density of Eq.
    (5a) over pi alpha_x alpha_y, 1 / cos^3 delta is the area of slopes in a unit of solid angle of h, and 4 h.i the
    solid angle of omega_r in one of h. Samples may fall below the horizon: over the hemisphere it integrates to less
    than 1.
    """
    h_x, h_y, h_z = _half_vector(theta_i, phi_i, theta_r, phi_r)
    tan_delta = mp.hypot(h_x, h_y) / h_z
    phi = mp.atan2(h_y, h_x)
    h_i = mp.sin(theta_i) * (h_x * mp.cos(phi_i) + h_y * mp.sin(phi_i)) + mp.cos(theta_i) * h_z
    # Eq. (7), corrected
    exponent = -(tan_delta**2) * (mp.cos(phi) ** 2 / alpha_x**2 + mp.sin(phi) ** 2 / alpha_y**2)
    return mp.exp(exponent) / (4 * mp.pi * alpha_x * alpha_y * h_i * h_z**3)


@exact
def _half_vector(theta_i: Number, phi_i: Number, theta_r: Number, phi_r: Number) -> tuple[Number, Number, Number]:
    """Return the unit vector h, below Eq. (5b)."""
    h_x = mp.sin(theta_r) * mp.cos(phi_r) + mp.sin(theta_i) * mp.cos(phi_i)
    h_y = mp.sin(theta_r) * mp.sin(phi_r) + mp.sin(theta_i) * mp.sin(phi_i)
    h_z = mp.cos(theta_r) + mp.cos(theta_i)
    length = mp.sqrt(h_x**2 + h_y**2 + h_z**2)
    return h_x / length, h_y / length, h_z / length
