"""Torrance and Sparrow 1967 at 40 digits, in the form of Eq. (31) of Oren and Nayar 1994."""

from brdfdb.reference import Number, exact, mp
from brdfdb.reference.he_torrance_1991 import fresnel_unpolarised


@exact
def torrance_sparrow(
    theta_i: Number, theta_r: Number, delta_phi: Number, sigma: Number, n: Number | None = None, k: Number | None = None
) -> Number:
    """Return f_r [1/sr] by Eq. (31) of Oren and Nayar 1994 over cos theta_i, with E_0 = 1; the lobe is not normalised.

    The facet normal lies along the half vector: theta_a is its polar angle [rad], `sigma` [rad] the deviation of the
    slope angle. F is 1, as that paper has it, or with a refractive index n + i k the reflectance of a plane interface
    for unpolarised light, at half the angle between the directions.
    """
    cos_i, cos_r = mp.cos(theta_i), mp.cos(theta_r)
    h_x = mp.sin(theta_i) + mp.sin(theta_r) * mp.cos(delta_phi)
    h_y = mp.sin(theta_r) * mp.sin(delta_phi)
    h_z = cos_i + cos_r
    length = mp.sqrt(h_x**2 + h_y**2 + h_z**2)
    # <s, a> = <v, a> = |s + v| / 2
    s_a = length / 2
    a_n = h_z / length
    theta_a = mp.atan2(mp.hypot(h_x, h_y), h_z)
    fresnel = mp.one if n is None else fresnel_unpolarised(s_a, n, mp.zero if k is None else k)
    # Eq. (11), corrected
    gaf = min(mp.one, min(2 * cos_i * a_n / s_a, 2 * cos_r * a_n / s_a))
    # Eq. (31)
    radiance = fresnel * gaf / (cos_r * a_n) * mp.exp(-(theta_a**2) / (2 * sigma**2))
    return radiance / cos_i
