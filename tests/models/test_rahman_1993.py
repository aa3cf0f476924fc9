"""RPV: values worked out by hand, an albedo in closed form, and the hot spot."""

import numpy as np
import pytest

from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.models import MODELS, rpv

NAMES = ("rho_0", "k", "asymmetry", "rho_c")
# rho_0, k, Theta, rho_c; light and viewer [degree]; pi f_r, worked out by hand:
# 0.1 / sqrt(0.5 * 1.5) * (1 + 1 / (1 + sqrt 3)), and 0.2 * 2 * 0.75 / 0.5^3 * 1.5
HAND = [((0.1, 0.5, 0.0, 0.0), (60.0, 0.0), 0.157735027), ((0.2, 2.0, -0.5, 0.5), (0.0, 0.0), 3.6)]


@pytest.mark.parametrize(("parameters", "theta_deg", "expected"), HAND)
def test_it_has_the_values_that_a_hand_works_out(
    parameters: tuple[float, ...], theta_deg: tuple[float, float], expected: float
) -> None:
    theta_i, theta_r = np.deg2rad(theta_deg)
    named = dict(zip(NAMES, parameters, strict=True))
    assert np.pi * rpv(theta_i, 0.0, theta_r, 0.0, **named) == pytest.approx(expected, rel=1e-8)


def test_the_albedo_of_the_deepest_bowl_has_a_closed_form() -> None:
    # k = 0, Theta = 0, rho_c = 1: 2 / cos_i times the integral of 1 / (cos_i + c) over c from 0 to 1
    theta_deg = np.array([0.0, 30.0, 60.0, 80.0, 89.5])
    cos_i = np.cos(np.deg2rad(theta_deg))
    expected = 2.0 / cos_i * np.log1p(1.0 / cos_i)
    surface = {"rho_0": 1.0, "k": 0.0, "asymmetry": 0.0, "rho_c": 1.0}
    albedo, error = directional_albedo("rpv", np.deg2rad(theta_deg), tolerance=1e-5, **surface)
    np.testing.assert_allclose(albedo, expected, atol=1e-5)
    assert (np.abs(albedo - expected) <= error + 1e-12 * expected).all()
    assert expected[-1] == pytest.approx(1089.0, abs=0.5)  # as the module says
    bowl = surface | {"k": 0.8}
    for angle, words in ((0.0, "1.01 at normal incidence"), (60.0, "1.25 at 60 degrees"), (89.5, "3.21 at 89.5")):
        assert words in MODELS["rpv"].excess
        stated = float(words.split()[0])
        assert directional_albedo("rpv", np.deg2rad(angle), tolerance=1e-4, **bowl).albedo == pytest.approx(
            stated, abs=0.005
        )


def test_light_goes_back_for_a_negative_asymmetry_and_the_hot_spot_is_where_the_light_is() -> None:
    flat = {"rho_0": 0.3, "k": 1.0, "rho_c": 1.0}
    back, mirror = (rpv(0.7, 0.4, 0.7, 0.4 + turn, asymmetry=-0.3, **flat) for turn in (0.0, np.pi))
    assert back > mirror
    assert rpv(0.7, 0.4, 0.7, 0.4, asymmetry=0.0, **flat | {"rho_c": 0.0}) == pytest.approx(0.6 / np.pi, rel=1e-14)
    off = rpv(0.7, 0.4, 0.7, 0.4 + 1e-9 / np.sin(0.7), asymmetry=0.0, **flat | {"rho_c": 0.0})
    # 1 / (1 + G) next to the light, with G = 1e-9 / cos: 1 - cos(1e-9) would be 0
    assert off == pytest.approx(0.3 / np.pi * (2.0 - 1e-9 / np.cos(0.7)), rel=1e-15)
