"""Directions and parameters where the code or the paper changes its formula."""

import numpy as np

from brdfdb.reference import he_torrance_1991, mp
from tests.models.hazard_directions import HALF_PI, PI, Directions


def slope_of_small_z_0() -> float:
    """theta [rad] of light and viewer, where the series of Lambert's W takes over: y = 1e-4, sigma_0 / tau = 1."""
    target = 1 / mp.sqrt(1 + mp.lambertw(mp.mpf("1e-4")).real)
    low, high = mp.mpf("0.1"), mp.mpf("1.5")
    while high - low > mp.mpf("1e-17"):
        middle = (low + high) / 2
        rough = he_torrance_1991.effective_roughness(middle, middle, 1, 1) > target
        low, high = (middle, high) if rough else (low, middle)
    return float(low)


ACROSS, EQUAL = Directions(0.4, 0.0, 0.9, HALF_PI), Directions(0.7, 0.3, 0.7, 1.5)
SMALL_Z_0 = slope_of_small_z_0()

# Where the code or the paper changes its formula: what happens, the function, directions, the angles moved, parameters
BRANCHES = [
    ("azimuth 90", "oren_nayar", ACROSS, (3,), "rho=0.9 sigma=0.5"),
    ("azimuth 90", "oren_nayar_qualitative", ACROSS, (3,), "rho=0.9 sigma=0.5"),
    ("azimuth 90", "oren_nayar_single_slope", ACROSS, (3,), "rho=0.9 theta_a=1.2"),
    ("azimuth 90", "oren_nayar_fujii", ACROSS, (3,), "rho=0.9 sigma=0.5"),
    ("azimuth 90", "oren_nayar_energy_preserving", ACROSS, (3,), "rho=0.9 roughness=0.5"),
    ("equal angles", "oren_nayar", EQUAL, (0,), "rho=0.9 sigma=0.5"),
    ("equal angles", "oren_nayar_qualitative", EQUAL, (0,), "rho=0.9 sigma=0.5"),
    ("equal angles", "oren_nayar_single_slope", EQUAL, (0,), "rho=0.9 theta_a=1.2"),
    ("equal angles", "oren_nayar_unidirectional", EQUAL, (0,), "rho=0.9 theta_a=1.2 phi_a=0.9"),
    ("equal angles", "oren_nayar_fujii", EQUAL, (0,), "rho=0.9 sigma=0.5"),
    ("equal angles", "oren_nayar_energy_preserving", EQUAL, (0,), "rho=0.9 roughness=0.5"),
    ("sine and cosine", "oren_nayar", Directions(PI / 4, 0.3, 0.9, 1.0), (0,), "rho=0.9 sigma=0.5"),
    ("sine and cosine", "oren_nayar_energy_preserving", Directions(PI / 4, 0.3, 0.9, 1.0), (0,), "rho=1 roughness=1"),
    ("hidden", "oren_nayar_single_slope", Directions(HALF_PI - 0.8, 0.0, 0.3, 2.0), (0,), "rho=0.9 theta_a=0.8"),
    ("hidden too", "oren_nayar_single_slope", Directions(HALF_PI - 0.8, 0.0, 1.2, 2.0), (0,), "rho=0.9 theta_a=0.8"),
    (
        "both hidden",
        "oren_nayar_single_slope",
        Directions(float(np.arctan(2.0 / np.tan(1.2))), 0.0, float(np.arctan(2.0 / np.sqrt(3.0) / np.tan(1.2))), 1.0),
        (0,),
        "rho=0.9 theta_a=1.2",
    ),
    (
        "hidden",
        "oren_nayar_unidirectional",
        Directions(HALF_PI - 0.8, 0.4, 0.3, 2.0),
        (0, 1),
        "rho=0.9 theta_a=0.8 phi_a=0.4",
    ),
    (
        "both hidden",
        "oren_nayar_unidirectional",
        Directions(HALF_PI - 0.8, 0.4, 1.2, 0.4 + PI),
        (0, 1, 2),
        "rho=0.9 theta_a=0.8 phi_a=0.4",
    ),
    ("slope of 45", "torrance_sparrow", Directions(PI / 4, 0.0, PI / 4, 0.0), (0, 2, 3), "sigma=0.5"),
    ("incidence of 45", "torrance_sparrow", Directions(PI / 4, 0.0, PI / 4, PI), (0, 2), "sigma=0.5 n=1.5 k=0.1"),
    ("incidence of 45", "he_torrance_smooth", Directions(PI / 4, 0.0, 0.0, 0.0), (0,), "n=1.5 k=0.1"),
    ("total reflection", "he_torrance_smooth", Directions(PI / 6, 0.0, 0.0, 0.0), (0,), "n=0.5 k=0"),
    ("total reflection", "he_torrance_jones", Directions(PI / 6, 0.0, PI / 6, PI), (0, 2), "n=0.5 k=0"),
    (
        "total reflection",
        "he_torrance",
        Directions(PI / 6, 0.0, PI / 6, PI),
        (0, 2),
        "wavelength_nm=500 sigma_0_um=0.1 tau_um=1 n=0.5 k=0",
    ),
    ("phase of 90", "ross_li", Directions(PI / 4, 0.0, PI / 4, PI), (0, 2, 3), "f_iso=0.3 f_vol=0.5 f_geo=0.01"),
    (  # the shadow begins to leave the crown: sin(xi) is half the sum of the cosines
        "overlap ends",
        "ross_li",
        Directions(2.0 * float(np.arctan(0.5)), 0.0, 0.0, 0.0),
        (0, 2),
        "f_iso=0.3 f_vol=0 f_geo=0.1",
    ),
    ("equal angles", "hapke", EQUAL, (0,), "w=0.5 b=0.2 c=0.6 b_0=1 h=0.1 theta_bar=0.3"),
    ("azimuth 90", "hapke", ACROSS, (3,), "w=0.5 b=0.2 c=0.6 b_0=1 h=0.1 theta_bar=0.3"),
    (
        "small z_0",
        "he_torrance",
        Directions(SMALL_Z_0, 0.0, SMALL_Z_0, 2.0),
        (0, 2),
        "wavelength_nm=500 sigma_0_um=0.1 tau_um=0.1 n=1.5 k=0",
    ),
]
