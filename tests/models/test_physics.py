"""Energy, limits and the published excesses of the models, against closed forms and numbers of the papers."""

import numpy as np
import pytest

from brdfdb import models
from brdfdb.integrals.quadrature import directional_albedo

MIRROR: dict[str, float] = {"n": 1.0, "k": 1e4}  # |F|^2 = 1 - 4e-8 at normal incidence
ENERGY = 2e-6  # worst measured of |F|^2 = 1 within 30 degrees of the normal: 1.5e-6


def he_torrance_albedo(theta_deg: float, **surface: float) -> float:
    """Directional and uniform diffuse albedo plus the specular reflectance."""
    theta_i = np.deg2rad(theta_deg)
    return float(directional_albedo("he_torrance", theta_i, tolerance=1e-7, specular=True, **surface).albedo)


def oren_nayar_albedo(theta_deg: float, sigma_deg: float, *, interreflection: bool = True) -> float:
    """Albedo of the functional form at rho = 1."""
    surface = {"rho": 1.0, "sigma": np.deg2rad(sigma_deg), "interreflection": interreflection}
    return float(directional_albedo("oren_nayar", np.deg2rad(theta_deg), tolerance=1e-6, **surface).albedo)


# Energy: Oren and Nayar 1994, eqs 27 and 28. Roughness [degree], and the albedo at rho = 1 and 89 degrees

every_excess = pytest.mark.parametrize(("sigma_deg", "published"), [(10, 1.031), (20, 1.042), (30, 1.012)])


@every_excess
@pytest.mark.xfail(
    strict=True, reason="Oren and Nayar 1994, eqs 27-28: the fit adds energy near grazing, up to 4 % at rho = 1"
)
def test_albedo_of_oren_nayar_is_at_most_one(sigma_deg: float, published: float) -> None:
    assert published > 1.0
    assert oren_nayar_albedo(89.0, sigma_deg) <= 1.0


@every_excess
def test_excess_of_oren_nayar_has_the_known_size_and_is_not_of_the_direct_part(
    sigma_deg: float, published: float
) -> None:
    assert oren_nayar_albedo(89.0, sigma_deg) == pytest.approx(published, abs=5e-4)
    assert oren_nayar_albedo(89.0, sigma_deg, interreflection=False) < 1.0


@pytest.mark.parametrize("sigma_deg", [40, 60, 90])
def test_oren_nayar_keeps_energy_on_rougher_surfaces(sigma_deg: float) -> None:
    for theta_deg in (0, 30, 60, 80, 89):
        assert oren_nayar_albedo(theta_deg, sigma_deg) < 1.0


# Gentle slopes, sigma_0 / tau of 1/100 and 1/50; g from 0.6 to 2500 at normal incidence
GENTLE = [
    {"sigma_0_um": 0.03, "tau_um": 3.0, "wavelength_nm": 500.0},
    {"sigma_0_um": 0.1, "tau_um": 5.0, "wavelength_nm": 500.0},
    {"sigma_0_um": 0.3, "tau_um": 15.0, "wavelength_nm": 600.0},
    {"sigma_0_um": 2.0, "tau_um": 100.0, "wavelength_nm": 500.0},
]


@pytest.mark.parametrize("surface", GENTLE, ids=str)
def test_he_torrance_reflects_all_light_near_the_normal_and_loses_it_at_grazing(surface: dict[str, float]) -> None:
    for theta_deg in (0.0, 5.0, 15.0, 30.0):
        assert he_torrance_albedo(theta_deg, **surface, **MIRROR) == pytest.approx(1.0, abs=ENERGY)
    # single scattering only: what a facet sends down is lost
    assert he_torrance_albedo(89.9, **surface, **MIRROR) < 0.1


@pytest.mark.xfail(
    strict=True,
    reason="He et al. 1991, eqs 73 and 78: near grazing, with g below 0.2, the diffuse part, whose g grows with "
    "cos theta_r across the lobe, gets more than e^-g takes from the specular part",
)
@pytest.mark.parametrize("surface", GENTLE[:3], ids=str)
def test_he_torrance_total_is_at_most_one(surface: dict[str, float]) -> None:
    assert he_torrance_albedo(85.0, **surface, **MIRROR) <= 1.0


@pytest.mark.parametrize("surface", GENTLE, ids=str)
def test_he_torrance_excess_near_grazing_is_a_few_percent(surface: dict[str, float]) -> None:
    # 1.011 at 87, 1.037 at 85.5, 1.044 at 86.5 degrees; the last surface, with g above 1 up to there, has none
    total = [he_torrance_albedo(theta_deg, **surface, **MIRROR) for theta_deg in (85.0, 85.5, 86.0, 86.5, 87.0)]
    assert max(total) < (1.0 if surface is GENTLE[-1] else 1.05)


def test_he_torrance_reproduces_the_excess_of_magnesium_oxide() -> None:
    # Section 4 and Fig. 9; n of MgO at 500 nm: Stephens and Malitson 1952
    surface = {"wavelength_nm": 500.0, "sigma_0_um": 1.45, "tau_um": 13.2, "n": 1.74555, "k": 0.0, "a": 0.9}
    for theta_deg, total in ((30.0, 0.977), (60.0, 1.016), (85.0, 1.116)):
        assert he_torrance_albedo(theta_deg, **surface) == pytest.approx(total, abs=5e-4)
    assert he_torrance_albedo(53.0, **surface) < 1.0 < he_torrance_albedo(54.0, **surface)


def test_blue_plastic_reflects_what_the_paper_measured() -> None:
    # section 4, Fig. 11: rho_dh = 0.195 with a = 0.15 leaves a first-surface reflectance of 4.5 %: n near 1.54
    light = {"wavelength_nm": 460.0, "sigma_0_um": 0.0, "tau_um": 1.0, "n": 1.54, "k": 0.0}
    assert he_torrance_albedo(0.0, a=0.15, **light) == pytest.approx(0.195, abs=1e-3)


def test_towards_a_smooth_surface_the_diffuse_part_falls_with_the_square_of_sigma_0() -> None:
    theta_i = np.array([0.0, 0.3, 0.7, 1.2, 1.5])
    directions = (theta_i, 0.0, np.array([0.1, 0.3, 0.9, 1.1, 1.4]), np.array([0.0, 2.0, 3.0, 1.0, 3.1]))
    light = {"wavelength_nm": 550.0, "tau_um": 2.0, "n": 0.27, "k": 2.8}
    values = [models.he_torrance(*directions, sigma_0_um=sigma_0, **light) for sigma_0 in (1e-5, 1e-6, 1e-150)]
    assert values[0] == pytest.approx(1e2 * values[1], rel=1e-7)
    assert values[1] == pytest.approx((1e144 * values[2]) * 1e144, rel=1e-7)
    assert (models.he_torrance(*directions, sigma_0_um=0.0, **light) == 0.0).all()
    smooth = models.he_torrance_specular(theta_i, sigma_0_um=0.0, **light)
    assert models.he_torrance_specular(theta_i, sigma_0_um=1e-6, **light) == pytest.approx(smooth, rel=1e-9)
