"""Heitz 2014 at 40 digits: facets with the slopes of GGX or Beckmann, shadowing correlated in height.

Angles are radians; alpha_x and alpha_y are widths of slopes [1], n + ik is the refractive index of the facets.
"""

from brdfdb.reference import Number, exact, mp
from brdfdb.reference.he_torrance_1991 import fresnel_unpolarised


def ggx(
    theta_i: Number,
    phi_i: Number,
    theta_r: Number,
    phi_r: Number,
    alpha_x: Number,
    alpha_y: Number,
    n: Number,
    k: Number,
) -> Number:
    """Return f_r [1/sr] of GGX facets with the reflectance of unpolarised light."""
    cos_d, theta_h, phi_h = half_vector(theta_i, phi_i, theta_r, phi_r)
    G = _correlated(ggx_lambda, theta_i, phi_i, theta_r, phi_r, alpha_x, alpha_y)
    return facets(fresnel_unpolarised(cos_d, n, k), ggx_slopes(theta_h, phi_h, alpha_x, alpha_y), G, theta_i, theta_r)


def ggx_schlick(
    theta_i: Number,
    phi_i: Number,
    theta_r: Number,
    phi_r: Number,
    rho_d: Number,
    f_0: Number,
    alpha_x: Number,
    alpha_y: Number,
) -> Number:
    """Return f_r [1/sr] of GGX facets with Schlick's reflectance, and rho_d / pi."""
    cos_d, theta_h, phi_h = half_vector(theta_i, phi_i, theta_r, phi_r)
    G = _correlated(ggx_lambda, theta_i, phi_i, theta_r, phi_r, alpha_x, alpha_y)
    D = ggx_slopes(theta_h, phi_h, alpha_x, alpha_y)
    return mp.mpf(rho_d) / mp.pi + facets(schlick(cos_d, f_0), D, G, theta_i, theta_r)


def beckmann(
    theta_i: Number,
    phi_i: Number,
    theta_r: Number,
    phi_r: Number,
    alpha_x: Number,
    alpha_y: Number,
    n: Number,
    k: Number,
) -> Number:
    """Return f_r [1/sr] of Gaussian facets with the reflectance of unpolarised light."""
    cos_d, theta_h, phi_h = half_vector(theta_i, phi_i, theta_r, phi_r)
    G = _correlated(_beckmann_lambda, theta_i, phi_i, theta_r, phi_r, alpha_x, alpha_y)
    D = beckmann_slopes(theta_h, phi_h, alpha_x, alpha_y)
    return facets(fresnel_unpolarised(cos_d, n, k), D, G, theta_i, theta_r)


def beckmann_schlick(
    theta_i: Number,
    phi_i: Number,
    theta_r: Number,
    phi_r: Number,
    rho_d: Number,
    f_0: Number,
    alpha_x: Number,
    alpha_y: Number,
) -> Number:
    """Return f_r [1/sr] of Gaussian facets with Schlick's reflectance, and rho_d / pi."""
    cos_d, theta_h, phi_h = half_vector(theta_i, phi_i, theta_r, phi_r)
    G = _correlated(_beckmann_lambda, theta_i, phi_i, theta_r, phi_r, alpha_x, alpha_y)
    D = beckmann_slopes(theta_h, phi_h, alpha_x, alpha_y)
    return mp.mpf(rho_d) / mp.pi + facets(schlick(cos_d, f_0), D, G, theta_i, theta_r)


def facets(F: Number, D: Number, G: Number, theta_i: Number, theta_r: Number) -> Number:
    """Return F D G / (4 cos theta_i cos theta_r) [1/sr]."""
    return F * D * G / (4 * mp.cos(mp.mpf(theta_i)) * mp.cos(mp.mpf(theta_r)))


def schlick(cos_d: Number, f_0: Number) -> Number:
    """Return the reflectance [1] f_0 + (1 - f_0) (1 - cos)^5 of Schlick 1994."""
    return mp.mpf(f_0) + (1 - mp.mpf(f_0)) * (1 - cos_d) ** 5


def ggx_slopes(theta_h: Number, phi_h: Number, alpha_x: Number, alpha_y: Number) -> Number:
    """Return D [1/sr] of GGX, eq. (33) of Walter 2007 for two alphas."""
    stretched = (mp.cos(phi_h) / mp.mpf(alpha_x)) ** 2 + (mp.sin(phi_h) / mp.mpf(alpha_y)) ** 2
    inside = 1 + mp.tan(theta_h) ** 2 * stretched
    return 1 / (mp.pi * mp.mpf(alpha_x) * mp.mpf(alpha_y) * mp.cos(theta_h) ** 4 * inside**2)


def beckmann_slopes(theta_h: Number, phi_h: Number, alpha_x: Number, alpha_y: Number) -> Number:
    """Return D [1/sr] of Beckmann, eq. (25) of Walter 2007 for two alphas."""
    stretched = (mp.cos(phi_h) / mp.mpf(alpha_x)) ** 2 + (mp.sin(phi_h) / mp.mpf(alpha_y)) ** 2
    lobe = mp.exp(-(mp.tan(theta_h) ** 2) * stretched)
    return lobe / (mp.pi * mp.mpf(alpha_x) * mp.mpf(alpha_y) * mp.cos(theta_h) ** 4)


def ggx_lambda(a: Number) -> Number:
    """Return Smith's Lambda [1] of GGX for a = 1 / (alpha tan theta)."""
    return (mp.sqrt(1 + 1 / a**2) - 1) / 2


def _beckmann_lambda(a: Number) -> Number:
    """Return Smith's Lambda [1] of Beckmann for a = 1 / (alpha tan theta)."""
    # (erf(a) - 1) / 2 without its cancellation
    return mp.exp(-(a**2)) / (2 * a * mp.sqrt(mp.pi)) - mp.erfc(a) / 2


def steepness(theta: Number, phi: Number, alpha_x: Number, alpha_y: Number) -> Number:
    """Return a = 1 / (alpha tan theta) [1] with the alpha towards the azimuth; infinite along the normal."""
    alpha = mp.sqrt((mp.cos(mp.mpf(phi)) * mp.mpf(alpha_x)) ** 2 + (mp.sin(mp.mpf(phi)) * mp.mpf(alpha_y)) ** 2)
    tan = mp.tan(mp.mpf(theta))
    return mp.inf if tan == 0 else 1 / (alpha * tan)


def _correlated(
    of_a: Number, theta_i: Number, phi_i: Number, theta_r: Number, phi_r: Number, alpha_x: Number, alpha_y: Number
) -> Number:
    """Return the shadowing [1] of eq. (99), 1 / (1 + Lambda of the light + Lambda of the viewer)."""
    steep = steepness(theta_i, phi_i, alpha_x, alpha_y), steepness(theta_r, phi_r, alpha_x, alpha_y)
    return 1 / (1 + sum(mp.zero if a == mp.inf else of_a(a) for a in steep))


@exact
def half_vector(theta_i: Number, phi_i: Number, theta_r: Number, phi_r: Number) -> tuple[Number, Number, Number]:
    """Return the cosine [1] of the angle on the facet, and theta and phi [rad] of the half vector."""
    h_x = mp.sin(theta_r) * mp.cos(phi_r) + mp.sin(theta_i) * mp.cos(phi_i)
    h_y = mp.sin(theta_r) * mp.sin(phi_r) + mp.sin(theta_i) * mp.sin(phi_i)
    h_z = mp.cos(theta_r) + mp.cos(theta_i)
    across = mp.hypot(h_x, h_y)
    return mp.sqrt(across**2 + h_z**2) / 2, mp.atan2(across, h_z), mp.atan2(h_y, h_x)
