"""d'Eon and Weidlich 2024 at 40 digits: VMF diffuse as the authors' program evaluates it."""

from brdfdb.reference import Number, mp


def vmf_diffuse(theta_i: Number, theta_r: Number, delta_phi: Number, rho: Number, roughness: Number) -> Number:
    """Return f_r [1/sr] of facets of albedo `rho` [1] at a `roughness` [1] in [0, 1]."""
    c, r = mp.mpf(rho), mp.mpf(roughness)
    if r == 0:
        return c / mp.pi
    m = mp.inf if r == 1 else -mp.log(1 - mp.sqrt(r))
    ui, uo, phi = mp.cos(theta_i), mp.cos(theta_r), mp.mpf(delta_phi)
    sigma_i, sigma_o, sigma_no = cross_section(ui, m), cross_section(uo, m), cross_section(-uo, m)
    sines = mp.sqrt((1 - ui**2) * (1 - uo**2))
    product, squares = ui * uo, ui**2 + uo**2

    def quotient(above: str, below: str) -> Number:
        """Return a rational function of r; `above` and `below` are lists of coefficient:power."""
        return polynomial(above, r) / polynomial(below, r)

    # first scattering
    denominator = uo * sigma_i + ui * sigma_no
    c100 = 1 + quotient("-0.1:1 0.84:4", "1:0 9:3")
    c101 = quotient("0.0173:1 20.4:2 -9.47:3", "1:0 7.46:1")
    c102 = quotient("-0.927:1 2.37:2", "1.24:0 1:2")
    c103 = quotient("-0.11:1 -1.54:2", "1:0 -1.05:1 7.1:2")
    f10 = (c100 + c101 * product + c102 * product**2 + c103 * squares) * sigma_i * sigma_o / denominator
    c110 = quotient("0.54:1 -0.182:3", "1:0 1.32:2")
    c111 = quotient("-0.097:1 0.62:2 -0.375:3", "1:0 0.4:3")
    c112 = polynomial("0.283:0 0.862:1 -0.681:2", r)
    f11 = sines * (c110 + c111 * product) * (sigma_i * sigma_o) ** c112 / denominator
    c120 = quotient("2.25:1 5.1:2", "1:0 9.8:1 32.4:2")
    c121 = quotient("-4.32:1 6:3", "1:0 9.7:1 287:3")
    f12 = (1 - ui**2) * (1 - uo**2) * (c120 + c121 * uo) * (c120 + c121 * ui) / (ui + uo)
    # second scattering
    c200 = quotient("0.00056:1 0.226:2", "1:0 7.07:2")
    c201 = quotient("-0.268:1 4.57:2 -12.04:3", "1:0 36.7:3")
    c202 = quotient("0.418:1 2.52:2 -0.97:3", "1:0 10:2")
    c203 = quotient("0.068:1 -2.25:2 2.65:3", "1:0 21.4:3")
    c204 = quotient("0.05:1 -4.22:3", "1:0 17.6:2 43.1:3")
    f20 = (c200 + c201 * product + c203 * product**2 + c202 * (ui + uo) + c204 * squares) / (ui + uo)
    c210 = quotient("-0.049:1 -0.027:3", "1:0 3.36:2")
    c211 = quotient("2.77:2 -8.332:2.5 6.073:3", "1:0 50:4")
    c212 = quotient("-0.431:2 -0.295:3", "1:0 23.9:3")
    f21 = sines * (c210 + c211 * product + c212 * (ui + uo)) / (ui + uo)
    # third scattering
    c300 = quotient("-0.083:3 0.262:4", "1:0 -1.9:2 38.6:4")
    c301 = quotient("-0.627:2 4.95:2.5 -2.44:3", "1:0 31.5:4")
    c302 = quotient("0.33:2 0.31:2.5 1.4:3", "1:0 20:3")
    c303 = quotient("-0.74:2 1.77:2.5 -4.06:3", "1:0 215:5")
    c304 = quotient("-1.026:3", "1:0 5.81:2 13.2:3")
    f30 = (c300 + c301 * product + c303 * product**2 + c302 * (ui + uo) + c304 * squares) / (ui + uo)
    c310 = quotient("0.028:2 -0.0132:3", "1:0 7.46:2 -3.315:4")
    c311 = quotient("-0.134:2 0.162:2.5 0.302:3", "1:0 57.5:4.5")
    c312 = quotient("-0.119:2 0.5:2.5 -0.207:3", "1:0 18.7:3")
    f31 = sines * (c310 + c311 * product + c312 * (ui + uo)) / (ui + uo)
    orders = (
        c * max(mp.zero, f10 + 2 * f11 * mp.cos(phi) + 2 * f12 * mp.cos(2 * phi))
        + c**2 * max(mp.zero, f20 + 2 * f21 * mp.cos(phi))
        + c**3 * max(mp.zero, f30 + 2 * f31 * mp.cos(phi))
    )
    return orders / mp.pi + later_orders(ui, uo, r, c)


def polynomial(terms: str, r: Number) -> Number:
    """Return the sum of coefficient times r to a power, for terms ``coefficient:power``."""
    pairs = (term.split(":") for term in terms.split())
    return sum(mp.mpf(coefficient) * r ** mp.mpf(power) for coefficient, power in pairs)


def later_orders(ui: Number, uo: Number, r: Number, c: Number) -> Number:
    """Return the fit of the fourth scattering and all later ones [1/sr]."""
    root = mp.sqrt(1 - c)
    scale = 1 - mp.mpf("0.5441615108674713") * root - mp.mpf("0.45302863761693374") * (1 - c)
    scale /= 1 + mp.mpf("1.4293127703064865") * root
    power = mp.atan(polynomial("0.0225272:0 -0.264641:1 1:2", r) * mp.erf(root))
    a = c / (mp.mpf("1.0075") + mp.mpf("1.16942") * root) ** power
    shape = mp.mpf("-0.0578978") / (mp.mpf("0.287663") + ui * uo) + abs(mp.mpf("-0.0898863") + mp.tanh(r))
    return max(mp.zero, mp.mpf("0.384016") * (a - mp.mpf("0.341969")) * a * scale * shape)


def cross_section(u: Number, m: Number) -> Number:
    """Return the projected area [1] of facets of width `m` that face a direction of cosine `u`, per area of facets."""
    if m == mp.inf:
        return mp.mpf(1) / 4
    if m < mp.mpf("0.25"):
        return gaussian_cross_section(u, m)
    with mp.workdps(60):
        coth, u2, m2 = mp.coth(2 / m**2), u**2, m**2
        m4, m8 = m2**2, m2**4
        sigma = (1 - u * (m2 - 2 * coth)) / 4 + 5 * (3 * u2 - 1) * (4 + 3 * m4 - 6 * m2 * coth) / 128
        if m > mp.mpf("0.9"):
            return sigma
        p4 = 3 - 30 * u2 + 35 * u2**2
        p6 = -5 + 105 * u2 - 315 * u2**2 + 231 * u2**3
        p8 = 35 - 1260 * u2 + 6930 * u2**2 - 12012 * u2**3 + 6435 * u2**4
        p10 = -63 + 3465 * u2 - 30030 * u2**2 + 90090 * u2**3 - 109395 * u2**4 + 46189 * u2**5
        p12 = 231 - 18018 * u2 + 225225 * u2**2 - 1021020 * u2**3 + 2078505 * u2**4 - 1939938 * u2**5 + 676039 * u2**6
        sigma -= mp.mpf("0.000732421875") * p4 * (16 + 180 * m4 + 105 * m8 - 10 * m2 * (8 + 21 * m4) * coth)
        sigma += (
            mp.mpf("0.000049591064453125")
            * p6
            * (64 + 105 * m4 * (32 + 180 * m4 + 99 * m8) - 42 * m2 * (16 + 240 * m4 + 495 * m8) * coth)
        )
        # the factor (1 + coth(2 / m^2)) sinh(2 / m^2) exp(-2 / m^2) of the program is 1
        t8 = -256 - 315 * m4 * (128 + 33 * m4 * (80 + 364 * m4 + 195 * m8))
        t8 += 18 * m2 * (256 + 385 * m4 * (32 + 312 * m4 + 585 * m8)) * coth
        t10 = -1024 - 495 * m4 * (768 + 91 * m4 * (448 + 15 * m4 * (448 + 1836 * m4 + 969 * m8)))
        t10 += 110 * m2 * (256 + 117 * m4 * (256 + 21 * m4 * (336 + 85 * m4 * (32 + 57 * m4)))) * coth
        t12 = -4096 - 3003 * m4 * (1024 + 45 * m4 * (2560 + 51 * m4 * (1792 + 285 * m4 * (80 + 308 * m4 + 161 * m8))))
        t12 += (
            78 * m2 * (2048 + 385 * m4 * (1280 + 153 * m4 * (512 + 57 * m4 * (192 + 35 * m4 * (40 + 69 * m4))))) * coth
        )
        sigma += mp.mpf("1.0132789611816406e-6") * p8 * t8
        sigma -= mp.mpf("9.12696123123169e-8") * p10 * t10
        sigma += mp.mpf("4.3655745685100555e-9") * p12 * t12
        return sigma


def gaussian_cross_section(u: Number, m: Number) -> Number:
    """Return the cross section [1] for Gaussian slopes, with the program's expansion for small `m`."""
    expansion = -(m**2) * (u + abs(u)) / 4
    if abs(u) == 1:
        return (u + abs(u)) / 2 + expansion
    sin = mp.sqrt(1 - u**2)
    slopes = mp.exp(-(u**2) / (m**2 * (1 - u**2))) * m * sin / mp.sqrt(mp.pi)
    return (slopes + u * mp.erfc(-u / (m * sin))) / 2 + expansion
