"""Oren and Nayar 1994 at 40 digits: the functional approximation (Eqs. 27-28) and the qualitative model (Eq. 30).

f_r = L_r / (E_0 cos theta_i), so the factor E_0 cos theta_i of the printed equations is left out. Angles and the slope
deviation sigma are radians, rho is the albedo of a facet.
"""

from brdfdb.reference import Number, mp


def functional(
    theta_i: Number, theta_r: Number, delta_phi: Number, rho: Number, sigma: Number
) -> tuple[Number, Number]:
    """Direct (Eq. 27) and interreflected (Eq. 28) part of f_r [1/sr]; their sum is the model (Eq. 29).

    The direct part turns negative for rough surfaces near grazing in the mirror half plane, and there the sum may too:
    the value stays as the equation gives it.
    """
    theta_i, theta_r = mp.mpf(theta_i), mp.mpf(theta_r)
    rho, sigma = mp.mpf(rho), mp.mpf(sigma)
    cos_phi = mp.cos(mp.mpf(delta_phi))
    alpha = max(theta_i, theta_r)
    beta = min(theta_i, theta_r)

    # Eq. (27), coefficient C_1
    c_1 = 1 - sigma**2 / (sigma**2 + mp.mpf("0.33")) / 2
    # Eq. (27), coefficient C_2
    c_2 = mp.mpf("0.45") * sigma**2 / (sigma**2 + mp.mpf("0.09"))
    if cos_phi >= 0:
        c_2 *= mp.sin(alpha)
    else:
        c_2 *= mp.sin(alpha) - (2 * beta / mp.pi) ** 3
    # Eq. (27), coefficient C_3
    c_3 = mp.mpf("0.125") * sigma**2 / (sigma**2 + mp.mpf("0.09")) * (4 * alpha * beta / mp.pi**2) ** 2
    # Eq. (27)
    bracket = c_1 + cos_phi * c_2 * mp.tan(beta) + (1 - abs(cos_phi)) * c_3 * mp.tan((alpha + beta) / 2)
    direct = rho / mp.pi * bracket

    # Eq. (28)
    bracket = 1 - cos_phi * (2 * beta / mp.pi) ** 2
    interreflected = mp.mpf("0.17") * rho**2 / mp.pi * sigma**2 / (sigma**2 + mp.mpf("0.13")) * bracket
    return direct, interreflected


def qualitative(
    theta_i: Number, theta_r: Number, delta_phi: Number, rho: Number, sigma: Number, offset: Number = "0.33"
) -> Number:
    """f_r [1/sr] by Eq. (30); `offset` [rad^2] is 0.33, or 0.57 (note 7) to stand in for the interreflection.

    A float64 `offset` is taken as it is: pass "0.57" for the exact decimal.
    """
    theta_i, theta_r = mp.mpf(theta_i), mp.mpf(theta_r)
    rho, sigma = mp.mpf(rho), mp.mpf(sigma)
    cos_phi = mp.cos(mp.mpf(delta_phi))
    alpha = max(theta_i, theta_r)
    beta = min(theta_i, theta_r)

    # Eq. (30), coefficient A
    a = 1 - sigma**2 / (sigma**2 + mp.mpf(offset)) / 2
    # Eq. (30), coefficient B
    b = mp.mpf("0.45") * sigma**2 / (sigma**2 + mp.mpf("0.09"))
    # Eq. (30)
    return rho / mp.pi * (a + b * max(mp.zero, cos_phi) * mp.sin(alpha) * mp.tan(beta))
