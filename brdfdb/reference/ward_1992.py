"""Ward 1992 at 40 digits: the anisotropic Gaussian model, Eq. (5a)."""

from brdfdb.reference import Number, mp


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
    """f_r [1/sr] by Eq. (5a): angles [rad], reflectances rho_d and rho_s [1], slope deviations alpha_x, alpha_y [1]."""
    theta_i, phi_i, theta_r, phi_r = mp.mpf(theta_i), mp.mpf(phi_i), mp.mpf(theta_r), mp.mpf(phi_r)
    rho_d, rho_s, alpha_x, alpha_y = mp.mpf(rho_d), mp.mpf(rho_s), mp.mpf(alpha_x), mp.mpf(alpha_y)

    # Below Eq. (5b): h = d_r + d_i; its length cancels in the ratios that are taken of it
    h_x = mp.sin(theta_r) * mp.cos(phi_r) + mp.sin(theta_i) * mp.cos(phi_i)
    h_y = mp.sin(theta_r) * mp.sin(phi_r) + mp.sin(theta_i) * mp.sin(phi_i)
    h_z = mp.cos(theta_r) + mp.cos(theta_i)
    # Figure 5: delta and phi are the polar angle and the azimuth of h
    tan_delta = mp.sqrt(h_x**2 + h_y**2) / h_z
    phi = mp.atan2(h_y, h_x)
    # Eq. (5a)
    exponent = -(tan_delta**2) * (mp.cos(phi) ** 2 / alpha_x**2 + mp.sin(phi) ** 2 / alpha_y**2)
    lobe = mp.exp(exponent) / (4 * mp.pi * alpha_x * alpha_y)
    return rho_d / mp.pi + rho_s / mp.sqrt(mp.cos(theta_i) * mp.cos(theta_r)) * lobe
