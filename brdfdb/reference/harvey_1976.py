"""Harvey 1976 at 40 digits: scatter around the mirror direction."""

from brdfdb.reference import Number, mp


def distance(theta_i: Number, theta_r: Number, delta_phi: Number) -> Number:
    """Return abs(beta - beta_0) [1], the distance of the projected viewer from the projected mirror direction."""
    t_i, t_r, phi = mp.mpf(theta_i), mp.mpf(theta_r), mp.mpf(delta_phi)
    # The light has the azimuth 0, the mirror direction pi
    beta = mp.sin(t_r) * mp.cos(phi), mp.sin(t_r) * mp.sin(phi)
    beta_0 = -mp.sin(t_i), mp.zero
    return mp.hypot(beta[0] - beta_0[0], beta[1] - beta_0[1])


def harvey_shack(
    theta_i: Number, theta_r: Number, delta_phi: Number, b_0: Number, knee: Number, slope: Number
) -> Number:
    """Return f_r [1/sr] for angles [rad], the peak `b_0` [1/sr], L [1] and s [1]."""
    x = distance(theta_i, theta_r, delta_phi)
    return mp.mpf(b_0) * (1 + (x / mp.mpf(knee)) ** 2) ** (mp.mpf(slope) / 2)
