"""Turquin 2019 at 60 digits: GGX facets, scaled by the light that they lose towards the viewer.

Angles are radians; alpha is the width of slopes [1], f_0 the reflectance of a facet at normal incidence.
"""

from brdfdb.reference import Number, mp
from brdfdb.reference.heitz_2014 import ggx_schlick
from brdfdb.reference.kulla_conty_2017 import albedo


def ggx_scaled(theta_i: Number, phi_i: Number, theta_r: Number, phi_r: Number, f_0: Number, alpha: Number) -> Number:
    """Return f_r [1/sr] of the facets times 1 + f_0 (1 - E) / E, with their albedo E towards the viewer."""
    E = albedo(theta_r, alpha)
    return ggx_schlick(theta_i, phi_i, theta_r, phi_r, 0, f_0, alpha, alpha) * (1 + mp.mpf(f_0) * (1 - E) / E)
