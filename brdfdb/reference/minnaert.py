"""Minnaert's BRDF at 40 digits, as Oren and Nayar 1994 print it in section 2."""

from brdfdb.reference import Number, exact, mp


@exact
def minnaert(theta_i: Number, theta_r: Number, k: Number, rho: Number = 1) -> Number:
    """Return f_r [1/sr] for polar angles [rad], darkening exponent `k` [1] and scale `rho` [1].

    The paper has no `rho`; 1 is its equation. For k < 1 the value grows without bound as either angle reaches pi/2.
    """
    cos_i = mp.cos(mp.mpf(theta_i))
    cos_r = mp.cos(mp.mpf(theta_r))
    # Section 2, unnumbered: f_r = (k + 1)/(2 pi) (cos theta_i cos theta_r)^(k - 1)
    return mp.mpf(rho) * (k + 1) / (2 * mp.pi) * (cos_i * cos_r) ** (k - 1)
