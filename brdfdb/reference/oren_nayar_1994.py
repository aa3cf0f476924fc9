"""Oren and Nayar 1994 at 40 digits: V-cavities (Eqs. 8-23), their closed forms (24, 49) and the fits (27-30).

f_r = L_r / (E_0 cos theta_i), so the factor E_0 cos theta_i of the printed equations is left out. Angles and the slope
deviation sigma are radians, rho is the albedo of a facet. Departures from print: the GAF of Eqs. (11), (38) is
Min[1, Max[0, Min[A, B]]]; m_v and m_s of Eqs. (15), (16) are the masked and the shadowed width; the irradiance <a', s>
of Eq. (17) ends at 0; the weight P sin(theta_a) of Eq. (25) is normalised over the slope alone.
"""

import numpy as np
from numpy.typing import NDArray

from brdfdb.reference import Number, exact, mp
from brdfdb.reference.torrance_sparrow_1967 import torrance_sparrow

Array = NDArray[np.float64]


def unidirectional(
    theta_i: Number, phi_i: Number, theta_r: Number, phi_r: Number, rho: Number, theta_a: Number, phi_a: Number
) -> tuple[Number, Number]:
    """Return both parts of f_r [1/sr] of parallel V-cavities, Eq. (22): direct and interreflected.

    The mean of the projected radiances (Eqs. 10-21) of the two facets, at azimuth phi_a and phi_a + pi. A facet that
    faces away from the viewer adds nothing, one that faces away from the light no direct part.
    """
    phi_a = mp.mpf(phi_a)
    with mp.workdps(3 * mp.dps):  # near the horizon the four terms of Eq. (19) cancel
        s = _direction(theta_i, phi_i)
        v = _direction(theta_r, phi_r)
        direct = interreflected = mp.zero
        for turn in (0, mp.pi):
            a = _direction(theta_a, phi_a + turn)
            a_adjacent = _direction(theta_a, phi_a + mp.pi - turn)
            one, two = _projected_radiance(s, v, a, a_adjacent, mp.mpf(rho), mp.mpf(theta_a))
            # Eq. (22)
            direct += one / 2
            interreflected += two / 2
    return +direct, +interreflected


def single_slope(
    theta_i: Number, theta_r: Number, delta_phi: Number, rho: Number, theta_a: Number
) -> tuple[Number, Number]:
    """Return direct (Eq. 24) and interreflected (Eq. 49) part of f_r [1/sr] of facets of one slope, all azimuths alike.

    The paper's closed forms: between the plane of incidence and the one across it weighted by Eq. (44), and with the
    interreflection factor of Eq. (48). `single_slope_integral` has neither approximation.
    """
    with mp.workdps(4 * mp.dps):  # at the horizon the tangents cancel
        direct, interreflected = _single_slope(theta_i, theta_r, delta_phi, rho, theta_a)
    return +direct, +interreflected


@exact
def _single_slope(
    theta_i: Number, theta_r: Number, delta_phi: Number, rho: Number, theta_a: Number
) -> tuple[Number, Number]:
    cos_phi, tan_a = mp.cos(delta_phi), mp.tan(theta_a)
    alpha, beta = max(theta_i, theta_r), min(theta_i, theta_r)
    phi_c_i, phi_c_r = _critical_angle(theta_a, theta_i), _critical_angle(theta_a, theta_r)
    phi_c_alpha, phi_c_beta = _critical_angle(theta_a, alpha), _critical_angle(theta_a, beta)

    # Eq. (45), coefficient A_1
    unshadowed = 1 - (2 * phi_c_alpha + mp.sin(2 * phi_c_alpha)) / mp.pi
    a_1 = tan_a * 2 * mp.sin(phi_c_alpha) / mp.pi + tan_a**2 * mp.tan(alpha) * unshadowed / 2
    # Eq. (45), coefficient A_2
    a_2 = 2 * phi_c_beta / mp.pi - tan_a * mp.tan(beta) * 2 * mp.sin(phi_c_beta) / mp.pi if cos_phi < 0 else mp.zero
    # Eq. (45), coefficient A_3
    a_3 = mp.zero
    if phi_c_i + phi_c_r > mp.pi / 2:
        roots = mp.sqrt((mp.tan(theta_r) * tan_a) ** 2 - 1) + mp.sqrt((mp.tan(theta_i) * tan_a) ** 2 - 1)
        both = tan_a * mp.hypot(mp.tan(theta_i), mp.tan(theta_r))
        a_3 = mp.mpf("0.5") + (roots - both - phi_c_i - phi_c_r) / mp.pi
    # Eq. (45), which is Eq. (24)
    bracket = 1 + cos_phi * (a_1 * mp.tan(beta) + a_2) + (1 - abs(cos_phi)) * a_3
    direct = rho / mp.pi * mp.cos(theta_a) * bracket

    # Eq. (49)
    bracket = 1 - cos_phi * (
        2 * phi_c_beta / mp.pi
        + 2 * tan_a * mp.tan(beta) * (mp.sin(phi_c_alpha) - mp.sin(phi_c_beta)) / mp.pi
        + tan_a**2 * mp.tan(alpha) * mp.tan(beta) * unshadowed / 2
    )
    interreflected = rho**2 / mp.pi * mp.cos(theta_a) * (1 - mp.cos(theta_a)) * bracket
    return direct, interreflected


@exact
def single_slope_integral(
    theta_i: Number, theta_r: Number, delta_phi: Number, rho: Number, theta_a: Number
) -> tuple[Number, Number]:
    """Return direct (Eq. 23) and interreflected (Eq. 46, with the factor of Eq. 47) part of f_r [1/sr], integrated.

    `unidirectional` averaged over the azimuth of the cavities by the tanh-sinh rule, in pieces between the azimuths
    where shadowing or masking begins, ends or takes over from the other. A value takes about a second.
    """

    def both(phi_a: Number) -> Number:
        direct, interreflected = unidirectional(theta_i, 0, theta_r, delta_phi, rho, theta_a, phi_a)
        return mp.mpc(direct, interreflected)  # one pass of the integration for the two

    # the azimuths where tan(theta) cos(phi_a - phi) of the two directions have the same size
    x_r, y_r = mp.tan(theta_r) * mp.cos(delta_phi), mp.tan(theta_r) * mp.sin(delta_phi)
    edges = [mp.atan2(mp.tan(theta_i) - x_r, y_r), mp.atan2(mp.tan(theta_i) + x_r, -y_r)]
    # Table 2
    for theta, phi in ((theta_i, mp.zero), (theta_r, delta_phi)):
        critical = _critical_angle(theta_a, theta)
        edges += [phi - critical, phi + critical]
    # half a turn: a cavity has a facet on either side
    edges = sorted({edge % mp.pi for edge in edges} | {mp.zero, mp.pi})
    # Eqs. (23), (46)
    integral = mp.quad(both, edges) / mp.pi
    return integral.real, integral.imag


def gaussian(theta_i: Number, theta_r: Number, delta_phi: Number, rho: Number, sigma: Number) -> tuple[float, float]:
    """Return direct and interreflected part of f_r [1/sr] for Gaussian slopes, Eqs. (8), (10-20), (26).

    The weight is P sin(theta_a) = exp(-theta_a^2 / (2 sigma^2)) sin(theta_a), normalised to one over theta_a from 0 to
    pi/2, and phi_a is averaged. Float64, not 40 digits: the tanh-sinh rule in both angles, in pieces between the kinks,
    refined until a doubling of the nodes moves neither part by 1e-11 of itself (for sigma below 0.01, by 1e-15 /
    sigma^2, because the interreflection is lost in rounding there). A value takes about half a second.
    """
    theta_i, theta_r, delta_phi = float(theta_i), float(theta_r), float(delta_phi)
    rho, sigma = float(rho), float(sigma)
    if sigma == 0:
        return rho / np.pi, 0.0
    tolerance = max(1e-11, 1e-15 / sigma**2)
    coarse = (np.inf, np.inf)
    for nodes in (33, 65, 129, 257):
        fine = _gaussian(theta_i, theta_r, delta_phi, rho, sigma, nodes)
        if all(abs(b - a) <= tolerance * b + 1e-16 * rho for a, b in zip(coarse, fine, strict=True)):
            return fine
        coarse = fine
    raise ArithmeticError(f"no convergence at {theta_i}, {theta_r}, {delta_phi}, sigma {sigma}: {coarse}")


def body_surface(
    theta_i: Number,
    theta_r: Number,
    delta_phi: Number,
    rho: Number,
    sigma: Number,
    k_b: Number,
    k_s: Number,
    n: Number | None = None,
    k: Number | None = None,
) -> tuple[Number, Number, Number]:
    """Return the terms of f_r [1/sr] by Eq. (32): k_b times Eq. (27), k_b times Eq. (28), k_s times Eq. (31).

    The first and the last are the combination of section 5, which leaves the interreflection out; all three are k_b
    times Eq. (29) plus k_s times Eq. (31). The radiance of Eq. (31) does not contain E_0 cos theta_i: E_0 is 1, and
    cos theta_i is divided out. F is 1 without a refractive index, as the paper has it.
    """
    direct, interreflected = functional(theta_i, theta_r, delta_phi, rho, sigma)
    surface = torrance_sparrow(theta_i, theta_r, delta_phi, sigma, n, k)
    # Eq. (32)
    return mp.mpf(k_b) * direct, mp.mpf(k_b) * interreflected, mp.mpf(k_s) * surface


@exact
def functional(
    theta_i: Number, theta_r: Number, delta_phi: Number, rho: Number, sigma: Number
) -> tuple[Number, Number]:
    """Return direct (Eq. 27) and interreflected (Eq. 28) part of f_r [1/sr]; their sum is the model (Eq. 29).

    The direct part turns negative for rough surfaces near grazing in the mirror half plane, and there the sum may too:
    the value stays as the equation gives it.
    """
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


@exact
def qualitative(
    theta_i: Number, theta_r: Number, delta_phi: Number, rho: Number, sigma: Number, offset: Number = "0.33"
) -> Number:
    """Return f_r [1/sr] by Eq. (30); `offset` [rad^2] is 0.33, or 0.57 (note 7) to stand in for the interreflection.

    A float64 `offset` is taken as it is: pass "0.57" for the exact decimal.
    """
    cos_phi = mp.cos(mp.mpf(delta_phi))
    alpha = max(theta_i, theta_r)
    beta = min(theta_i, theta_r)

    # Eq. (30), coefficient A
    a = 1 - sigma**2 / (sigma**2 + mp.mpf(offset)) / 2
    # Eq. (30), coefficient B
    b = mp.mpf("0.45") * sigma**2 / (sigma**2 + mp.mpf("0.09"))
    # Eq. (30)
    return rho / mp.pi * (a + b * max(mp.zero, cos_phi) * mp.sin(alpha) * mp.tan(beta))


@exact
def _direction(theta: Number, phi: Number) -> tuple[Number, Number, Number]:
    return mp.sin(theta) * mp.cos(phi), mp.sin(theta) * mp.sin(phi), mp.cos(theta)


def _projected_radiance(
    s: tuple[Number, Number, Number],
    v: tuple[Number, Number, Number],
    a: tuple[Number, Number, Number],
    a_adjacent: tuple[Number, Number, Number],
    rho: Number,
    theta_a: Number,
) -> tuple[Number, Number]:
    """Return L^1_rp and L^2_rp of one facet, Eqs. (10)-(20), over E_0 cos theta_i."""

    def d(x: Number, y: Number) -> Number:
        # Eq. (20)
        return mp.sqrt(x**2 + 2 * x * y * mp.cos(2 * theta_a) + y**2)

    a_n, s_n, v_n = a[2], s[2], v[2]
    s_a, v_a = mp.fdot(s, a), mp.fdot(v, a)
    s_adjacent, v_adjacent = mp.fdot(s, a_adjacent), mp.fdot(v, a_adjacent)
    direct = interreflected = mp.zero
    if v_a > 0 and s_a > 0:
        # Eq. (11), corrected
        gaf = min(mp.one, max(mp.zero, min(2 * s_n * a_n / s_a, 2 * v_n * a_n / v_a)))
        # Eq. (10) and Table 1
        direct = rho / mp.pi * s_a * v_a / (a_n * v_n) * gaf / s_n
    if v_a > 0 and s_adjacent > 0:
        # Eq. (15): the width of this facet that is masked
        m_v = max(mp.zero, min(mp.one, -v_adjacent / v_a))
        # Eq. (16): the width of the adjacent facet that is shadowed
        m_s = max(mp.zero, min(mp.one, -s_a / s_adjacent))
        # Eq. (19)
        interreflection_factor = mp.pi / 2 * (d(1, m_v) + d(1, m_s) - d(m_s, m_v) - d(1, 1))
        # Eq. (18)
        interreflected = (rho / mp.pi) ** 2 * s_adjacent * v_a / (a_n * v_n) * interreflection_factor / s_n
    return direct, interreflected


def _critical_angle(theta_a: Number, theta: Number) -> Number:
    """Return phi_c [rad] of Eq. (39)."""
    product = mp.tan(mp.mpf(theta_a)) * mp.tan(mp.mpf(theta))
    # Eq. (39)
    return mp.acos(1 / product) if product > 1 else mp.zero


def _gaussian(
    theta_i: float, theta_r: float, delta_phi: float, rho: float, sigma: float, nodes: int
) -> tuple[float, float]:
    """Return the double integral of Eq. (8) in float64, with as many nodes a piece and an angle."""
    tan_i, tan_r = np.tan(theta_i), np.tan(theta_r)
    # the azimuths where tan(theta) cos(phi_a - phi) of the two directions have the same size
    x_r, y_r = tan_r * np.cos(delta_phi), tan_r * np.sin(delta_phi)
    ties = np.array([np.arctan2(tan_i - x_r, y_r), np.arctan2(tan_i + x_r, -y_r)])
    # shadowing or masking begins, or the order of the azimuths of `_azimuths` changes; the smaller tangent rounds less
    size = np.abs(tan_i * np.cos(ties) if tan_i < tan_r else tan_r * np.cos(ties - delta_phi))
    kinks = [np.pi / 2 - theta_i, np.pi / 2 - theta_r, *np.arctan2(1, size)]
    # the weight is narrow
    widths = [2 * sigma * 2**n for n in range(64) if 2 * sigma * 2**n < np.pi / 2]
    direct = interreflected = total = 0.0
    for theta_a, d_theta in zip(*_pieces(np.unique([0, *kinks, *widths, np.pi / 2]), nodes), strict=True):
        # Eq. (26) and the solid angle of Eq. (8)
        weight = d_theta * np.exp(-(theta_a**2) / (2 * sigma**2)) * np.sin(theta_a)
        phi_a, d_phi = _pieces(_azimuths(theta_a, theta_i, theta_r, delta_phi, ties), nodes)
        one, two = _facets(theta_i, theta_r, delta_phi, rho, theta_a[:, None, None], phi_a)
        # Eqs. (23), (46)
        direct += float(weight @ np.sum(one * d_phi, axis=(1, 2)) / (2 * np.pi))
        interreflected += float(weight @ np.sum(two * d_phi, axis=(1, 2)) / (2 * np.pi))
        total += float(np.sum(weight))
    # Eq. (25), with the weight normalised over the slope
    return direct / total, interreflected / total


def _pieces(edges: Array, nodes: int) -> tuple[Array, Array]:
    """Return nodes and weights of the tanh-sinh rule between neighbours of the last axis of `edges`."""
    t = np.linspace(-3.15, 3.15, nodes)
    u = np.pi / 2 * np.sinh(t)
    x = 1 / (1 + np.exp(-2 * u))
    w = (t[1] - t[0]) * np.pi / 4 * np.cosh(t) / np.cosh(u) ** 2
    width = np.diff(edges)[..., None]
    return edges[..., :-1, None] + width * x, width * w


def _azimuths(theta_a: Array, theta_i: float, theta_r: float, delta_phi: float, ties: Array) -> Array:
    """Return, for each theta_a, the azimuths where shadowing or masking begins, ends or takes over."""
    edges = []
    for theta, phi in ((theta_i, 0.0), (theta_r, delta_phi)):
        # Eq. (39)
        critical = np.arccos(1 / np.maximum(1, np.tan(theta_a) * np.tan(theta)))
        # Table 2
        edges += [phi + critical, phi - critical, phi + np.pi + critical, phi + np.pi - critical]
    edges += [np.full_like(theta_a, tie + turn) for tie in ties for turn in (0, np.pi)]
    once = np.sort(np.mod(np.stack(edges, axis=-1), 2 * np.pi), axis=-1)
    return np.concatenate([once, once[:, :1] + 2 * np.pi], axis=-1)


def _facets(
    theta_i: float, theta_r: float, delta_phi: float, rho: float, theta_a: Array, phi_a: Array
) -> tuple[Array, Array]:
    """Return `_projected_radiance` in float64 on arrays; the terms of Eq. (19) are combined so that none cancels."""
    s_n, v_n, a_n = np.cos(theta_i), np.cos(theta_r), np.cos(theta_a)
    across_i = np.sin(theta_i) * np.sin(theta_a) * np.cos(phi_a)
    across_r = np.sin(theta_r) * np.sin(theta_a) * np.cos(phi_a - delta_phi)
    s_a, s_adjacent = s_n * a_n + across_i, s_n * a_n - across_i
    v_a, v_adjacent = v_n * a_n + across_r, v_n * a_n - across_r
    lit, lit_adjacent, seen = s_a > 0, s_adjacent > 0, v_a > 0
    divisors = np.where(lit, s_a, 1), np.where(lit_adjacent, s_adjacent, 1), np.where(seen, v_a, 1)

    # Eq. (11), corrected
    gaf = np.minimum(1, np.minimum(2 * s_n * a_n / divisors[0], 2 * v_n * a_n / divisors[2]))
    # Eq. (10) and Table 1
    direct = np.where(lit & seen, rho / np.pi * s_a * v_a / (a_n * v_n * s_n) * gaf, 0)

    # Eqs. (15), (16), and what they leave of 1
    m_v, m_s = np.clip(-v_adjacent / divisors[2], 0, 1), np.clip(-s_a / divisors[1], 0, 1)
    seen_part = np.minimum(1, 2 * v_n * a_n / divisors[2])
    lit_part = np.minimum(1, 2 * s_n * a_n / divisors[1])
    # Eq. (20) with x^2 + 2 x y cos(2 theta_a) + y^2 = (x - y)^2 + 4 x y cos(theta_a)^2
    d_11, d_1v = 2 * a_n, np.sqrt(seen_part**2 + 4 * m_v * a_n**2)
    d_1s = np.sqrt(lit_part**2 + 4 * m_s * a_n**2)
    d_sv = np.sqrt((seen_part - lit_part) ** 2 + 4 * m_s * m_v * a_n**2)
    # Eq. (19): d(x, y) - d(x, z) = (y - z) (y + z + 2 x cos(2 theta_a)) / (d(x, y) + d(x, z)), used three times
    cosine = np.cos(2 * theta_a)
    numerator = 2 * lit_part - seen_part + 4 * m_s * a_n**2  # 1 + m_v + 2 m_s cos(2 theta_a)
    along_s = (2 * seen_part - lit_part + 4 * m_v * a_n**2) / (d_1v + d_sv)
    along_1 = (4 * a_n**2 - lit_part) / (d_11 + d_1s)
    bracket = numerator * (along_s + along_1) - 2 * cosine * (d_sv + d_1s)
    factor = np.pi / 2 * seen_part * lit_part * bracket / ((d_sv + d_1s) * (d_1v + d_11))
    # Eq. (18)
    lost = np.where(lit_adjacent & seen, s_adjacent * v_a / (a_n * v_n * s_n), 0)
    return direct, (rho / np.pi) ** 2 * lost * factor
