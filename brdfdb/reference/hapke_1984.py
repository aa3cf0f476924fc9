"""Hapke 1984 at 40 digits: a layer of grains with hot spot and roughness, and the H function of Hapke 2002."""

from brdfdb.reference import Number, mp


def hapke(
    theta_i: Number,
    theta_r: Number,
    delta_phi: Number,
    w: Number,
    b: Number,
    c: Number,
    b_0: Number,
    h: Number,
    theta_bar: Number,
) -> Number:
    """Return f_r [1/sr] for angles [rad], parameters of the grains and the hot spot [1], and a mean slope [rad]."""
    i, e = mp.mpf(theta_i), mp.mpf(theta_r)
    w, b, c, b_0, h, slope = (mp.mpf(x) for x in (w, b, c, b_0, h, theta_bar))
    psi = mp.fmod(abs(mp.mpf(delta_phi)), 2 * mp.pi)
    psi = 2 * mp.pi - psi if psi > mp.pi else psi
    cos_g = mp.cos(i) * mp.cos(e) + mp.sin(i) * mp.sin(e) * mp.cos(psi)
    g = mp.acos(max(-mp.one, min(mp.one, cos_g)))  # by rounding it may be beyond
    mu_0e, mu_e, S = rough(i, e, psi, slope)
    P = (1 - c) * (1 - b**2) / (1 + 2 * b * cos_g + b**2) ** mp.mpf("1.5")
    P += c * (1 - b**2) / (1 - 2 * b * cos_g + b**2) ** mp.mpf("1.5")
    hot = b_0 / (1 + mp.tan(g / 2) / h)
    r = w / (4 * mp.pi) * mu_0e / (mu_0e + mu_e) * (P * (1 + hot) + multiple(w, mu_0e) * multiple(w, mu_e) - 1) * S
    return r / mp.cos(i)


def multiple(w: Number, x: Number) -> Number:
    """Return H [1] of Hapke 2002."""
    gamma = mp.sqrt(1 - w)
    r_0 = (1 - gamma) / (1 + gamma)
    return 1 / (1 - w * x * (r_0 + (1 - 2 * r_0 * x) / 2 * mp.log((1 + x) / x)))


def rough(i: Number, e: Number, psi: Number, slope: Number) -> tuple[Number, Number, Number]:
    """Return the effective cosines of light and viewer [1], and the shadowing S [1]."""
    tan, chi = mp.tan(slope), 1 / mp.sqrt(1 + mp.pi * mp.tan(slope) ** 2)

    def e_1(y: Number) -> Number:
        return mp.exp(-2 / mp.pi * mp.cot(slope) * mp.cot(y)) if slope > 0 and y > 0 else mp.zero

    def e_2(y: Number) -> Number:
        return mp.exp(-((mp.cot(slope) * mp.cot(y)) ** 2) / mp.pi) if slope > 0 and y > 0 else mp.zero

    def eta(y: Number) -> Number:
        return chi * (mp.cos(y) + mp.sin(y) * tan * e_2(y) / (2 - e_1(y)))

    half = mp.sin(psi / 2) ** 2
    f = mp.exp(-2 * mp.tan(psi / 2)) if psi < mp.pi else mp.zero
    mu_0, mu = mp.cos(i), mp.cos(e)
    if i <= e:
        below = 2 - e_1(e) - psi / mp.pi * e_1(i)
        mu_0e = chi * (mu_0 + mp.sin(i) * tan * (mp.cos(psi) * e_2(e) + half * e_2(i)) / below)
        mu_e = chi * (mu + mp.sin(e) * tan * (e_2(e) - half * e_2(i)) / below)
        S = mu_e / eta(e) * mu_0 / eta(i) * chi / (1 - f + f * chi * mu_0 / eta(i))
    else:
        below = 2 - e_1(i) - psi / mp.pi * e_1(e)
        mu_0e = chi * (mu_0 + mp.sin(i) * tan * (e_2(i) - half * e_2(e)) / below)
        mu_e = chi * (mu + mp.sin(e) * tan * (mp.cos(psi) * e_2(i) + half * e_2(e)) / below)
        S = mu_e / eta(e) * mu_0 / eta(i) * chi / (1 - f + f * chi * mu / eta(e))
    return mu_0e, mu_e, S
