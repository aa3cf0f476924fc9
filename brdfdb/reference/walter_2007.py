"""Walter, Marschner, Li and Torrance 2007 at 40 digits: facets with separable shadowing, eqs. (20) to (34).

Angles are radians; alpha_x and alpha_y are widths of slopes [1], which the paper has equal; n + ik is the refractive
index of the facets.
"""

from brdfdb.reference import Number, mp
from brdfdb.reference.he_torrance_1991 import fresnel_unpolarised
from brdfdb.reference.heitz_2014 import beckmann_slopes, facets, ggx_slopes, half_vector, steepness


def ggx_separable(
    theta_i: Number,
    phi_i: Number,
    theta_r: Number,
    phi_r: Number,
    alpha_x: Number,
    alpha_y: Number,
    n: Number,
    k: Number,
) -> Number:
    """Return f_r [1/sr] by Eqs. (20), (23), (33) and (34)."""
    cos_d, theta_h, phi_h = half_vector(theta_i, phi_i, theta_r, phi_r)
    D = ggx_slopes(theta_h, phi_h, alpha_x, alpha_y)
    steep = steepness(theta_i, phi_i, alpha_x, alpha_y), steepness(theta_r, phi_r, alpha_x, alpha_y)
    return facets(fresnel_unpolarised(cos_d, n, k), D, _ggx_g_1(steep[0]) * _ggx_g_1(steep[1]), theta_i, theta_r)


def beckmann_separable(
    theta_i: Number,
    phi_i: Number,
    theta_r: Number,
    phi_r: Number,
    alpha_x: Number,
    alpha_y: Number,
    n: Number,
    k: Number,
) -> Number:
    """Return f_r [1/sr] by Eqs. (20), (23), (25) and (27)."""
    cos_d, theta_h, phi_h = half_vector(theta_i, phi_i, theta_r, phi_r)
    D = beckmann_slopes(theta_h, phi_h, alpha_x, alpha_y)
    steep = steepness(theta_i, phi_i, alpha_x, alpha_y), steepness(theta_r, phi_r, alpha_x, alpha_y)
    G = _beckmann_g_1(steep[0]) * _beckmann_g_1(steep[1])
    return facets(fresnel_unpolarised(cos_d, n, k), D, G, theta_i, theta_r)


def _ggx_g_1(a: Number) -> Number:
    """Return G_1 [1] of Eq. (34) for a = 1 / (alpha tan theta)."""
    return mp.one if a == mp.inf else 2 / (1 + mp.sqrt(1 + 1 / a**2))


def _beckmann_g_1(a: Number) -> Number:
    """Return G_1 [1] of Eq. (27) for a = 1 / (alpha tan theta)."""
    if a >= mp.mpf("1.6"):
        return mp.one
    above = mp.mpf("3.535") * a + mp.mpf("2.181") * a**2
    return above / (1 + mp.mpf("2.276") * a + mp.mpf("2.577") * a**2)
