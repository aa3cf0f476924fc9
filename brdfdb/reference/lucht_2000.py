"""Lucht, Schaaf and Strahler 2000 at 40 digits: the kernels of the MODIS product, with h/b = 2 and b/r = 1."""

from brdfdb.reference import Number, mp


def kernels(theta_i: Number, theta_r: Number, delta_phi: Number) -> tuple[Number, Number]:
    """Return the Ross-Thick and the Li-Sparse-Reciprocal kernel [1] for angles [rad]."""
    with mp.workdps(2 * mp.dps):  # next to the horizon the squares cancel
        t_i, t_r, phi = mp.mpf(theta_i), mp.mpf(theta_r), mp.mpf(delta_phi)
        cos_xi = mp.cos(t_i) * mp.cos(t_r) + mp.sin(t_i) * mp.sin(t_r) * mp.cos(phi)
        cos_xi = max(-mp.one, min(mp.one, cos_xi))  # by rounding it may be beyond
        xi = mp.acos(cos_xi)
        k_vol = ((mp.pi / 2 - xi) * cos_xi + mp.sin(xi)) / (mp.cos(t_i) + mp.cos(t_r)) - mp.pi / 4
        sec, tan = mp.sec(t_i) + mp.sec(t_r), mp.tan(t_i) * mp.tan(t_r)
        D2 = mp.tan(t_i) ** 2 + mp.tan(t_r) ** 2 - 2 * tan * mp.cos(phi)
        cos_t = 2 * mp.sqrt(max(D2 + (tan * mp.sin(phi)) ** 2, mp.zero)) / sec
        t = mp.acos(min(mp.one, cos_t))
        O = (t - mp.sin(t) * mp.cos(t)) * sec / mp.pi  # noqa: E741  # as the papers write it
        k_geo = O - sec + (1 + cos_xi) * mp.sec(t_i) * mp.sec(t_r) / 2
        return k_vol, k_geo


def ross_li(theta_i: Number, theta_r: Number, delta_phi: Number, f_iso: Number, f_vol: Number, f_geo: Number) -> Number:
    """Return f_r [1/sr] for angles [rad] and weights of the kernels [1]; it may be negative."""
    k_vol, k_geo = kernels(theta_i, theta_r, delta_phi)
    return (mp.mpf(f_iso) + mp.mpf(f_vol) * k_vol + mp.mpf(f_geo) * k_geo) / mp.pi
