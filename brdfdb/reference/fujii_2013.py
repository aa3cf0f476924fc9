"""Fujii 2013 at 40 digits: the proposed form of "A tiny improvement of Oren-Nayar reflectance model"."""

from brdfdb.reference import Number, exact, mp


@exact
def fujii(theta_i: Number, theta_r: Number, delta_phi: Number, rho: Number, sigma: Number) -> Number:
    """Return f_r [1/sr] for the albedo `rho` and roughness `sigma` [1], from 0 (Lambert) to 1; not a slope deviation.

    `sigma` is the ratio of the amplitudes B and A. The article does not number its equations.
    """
    cos_i, cos_r = mp.cos(theta_i), mp.cos(theta_r)
    # s: the cosine between the directions less the product of their cosines to the normal
    s = mp.sin(theta_i) * mp.sin(theta_r) * mp.cos(mp.mpf(delta_phi))
    # t
    t = mp.one if s <= 0 else max(cos_i, cos_r)
    # A and B
    a = 1 / (mp.pi + (mp.pi / 2 - mp.mpf(2) / 3) * sigma)
    b = sigma * a
    return rho * (a + b * s / t)
