"""Portsmouth, Kutz and Hill 2025 at 40 digits: the energy-preserving Oren-Nayar model (EON), with exact albedos."""

from brdfdb.reference import Number, exact, mp
from brdfdb.reference.fujii_2013 import fujii


@exact
def energy_preserving(
    theta_i: Number, theta_r: Number, delta_phi: Number, rho: Number, roughness: Number
) -> tuple[Number, Number]:
    """Return single and multiple scattering part of f_r [1/sr], whose sum is EON; `rho` and `roughness` in [0, 1].

    The single scattering is Fujii's lobe (there called FON). What it loses at rho = 1 comes back in the multiple
    scattering, tinted by rho: with rho = 1 the albedo is 1 for every direction and roughness.
    """
    single = fujii(theta_i, theta_r, delta_phi, rho, roughness)
    if roughness == 0:
        return single, mp.zero  # nothing is lost, and the multiple scattering is 0/0
    albedo_i, albedo_r = fujii_albedo(theta_i, roughness), fujii_albedo(theta_r, roughness)
    mean = fujii_mean_albedo(roughness)
    rho_ms = rho**2 * mean / (1 - rho * (1 - mean))
    multiple = rho_ms / mp.pi * (1 - albedo_i) * (1 - albedo_r) / (1 - mean)
    return single, multiple


@exact
def fujii_albedo(theta: Number, roughness: Number) -> Number:
    """Return the directional albedo [1] of Fujii's lobe at rho = 1, for light or viewer at `theta` [rad]."""
    sin, cos = mp.sin(theta), mp.cos(theta)
    # tan(theta) (1 - sin(theta)^3), with 1 - sin = cos^2 / (1 + sin): finite at grazing
    tangent_term = sin * cos * (1 + sin + sin**2) / (1 + sin)
    g = sin * (theta - sin * cos) + mp.mpf(2) / 3 * (tangent_term - sin)
    return _amplitude(roughness) * (1 + roughness * g / mp.pi)


@exact
def fujii_mean_albedo(roughness: Number) -> Number:
    """Return the mean of `fujii_albedo` [1] over all directions, weighted by the cosine."""
    return _amplitude(roughness) * (1 + (mp.mpf(2) / 3 - 28 / (15 * mp.pi)) * roughness)


def _amplitude(roughness: Number) -> Number:
    """Return A_F [1]."""
    return 1 / (1 + (mp.mpf(1) / 2 - 2 / (3 * mp.pi)) * roughness)
