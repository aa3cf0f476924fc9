"""Rahman, Pinty and Verstraete 1993 at 40 digits: the reflectance factor of their equations over pi."""

from brdfdb.reference import Number, exact, mp


@exact
def rpv(
    theta_i: Number, theta_r: Number, delta_phi: Number, rho_0: Number, k: Number, asymmetry: Number, rho_c: Number
) -> Number:
    """Return f_r [1/sr] for angles [rad], the parameters [1] of the paper, and `rho_c` [1] of the hot spot.

    The paper has `rho_0` in place of `rho_c`.
    """
    t_i, t_r, phi = mp.mpf(theta_i), mp.mpf(theta_r), mp.mpf(delta_phi)
    # Minnaert's function in its later, reciprocal form
    M = (mp.cos(t_i) * mp.cos(t_r)) ** (k - 1) * (mp.cos(t_i) + mp.cos(t_r)) ** (k - 1)
    # Henyey and Greenstein's function of the phase angle g
    cos_g = mp.cos(t_i) * mp.cos(t_r) + mp.sin(t_i) * mp.sin(t_r) * mp.cos(phi)
    F = (1 - asymmetry**2) / (1 + asymmetry**2 + 2 * asymmetry * cos_g) ** mp.mpf("1.5")
    # The hot spot
    with mp.workdps(2 * mp.dps):  # next to the horizon the squares cancel
        G2 = mp.tan(t_i) ** 2 + mp.tan(t_r) ** 2 - 2 * mp.tan(t_i) * mp.tan(t_r) * mp.cos(phi)
        G = mp.sqrt(max(G2, mp.zero))  # by rounding it may be below 0
    return rho_0 * M * F * (1 + (1 - rho_c) / (1 + G)) / mp.pi
