"""Pfisterer 2011 at 40 digits: the ABg model of scatter."""

from brdfdb.reference import Number, mp
from brdfdb.reference.harvey_1976 import distance


def abg(theta_i: Number, theta_r: Number, delta_phi: Number, a: Number, b: Number, g: Number) -> Number:
    """Return f_r [1/sr] for angles [rad], A [1/sr], B [1] and g [1]."""
    return mp.mpf(a) / (mp.mpf(b) + distance(theta_i, theta_r, delta_phi) ** mp.mpf(g))
