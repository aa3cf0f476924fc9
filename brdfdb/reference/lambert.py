"""Lambert's constant BRDF at 40 digits."""

from brdfdb.reference import Number, mp


def lambert(rho: Number) -> Number:
    """Return f_r [1/sr] of an ideal diffuse surface with albedo `rho` [1]."""
    return mp.mpf(rho) / mp.pi
