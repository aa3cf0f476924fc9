"""Hapke: published values of another program, the laws of Lommel and Seeliger, and light that is lost or added."""

import numpy as np
import pytest

from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.models import MODELS, hapke

# A basaltic soil of Pommerol et al. 2013, whose c is 0.273 in [-1, 1]
SOIL = {"w": 0.526, "b": 0.187, "c": 1.273 / 2.0, "b_0": 1.0, "h": 0.083, "theta_bar": np.deg2rad(13.3)}
# theta_r, delta_phi [degree] and the reflectance factor pi f_r for theta_i = 30 degrees that eradiate states in the
# tests of its plugin `hapke`, in float32, after a program of Nguyen and Jacquemoud
STATED = [(30.0, 0.0, 0.24746648), (80.0, 0.0, 0.19555340), (89.0, 180.0, 0.15426355)]
FLOAT32 = 5e-7  # worst measured: 4.2e-7
WHITE = {"w": 1.0, "b": 0.0, "c": 0.0}


@pytest.mark.parametrize(("theta_r_deg", "delta_phi_deg", "expected"), STATED)
def test_it_has_the_values_that_another_program_states(
    theta_r_deg: float, delta_phi_deg: float, expected: float
) -> None:
    value = hapke(*np.deg2rad([30.0, 0.0, theta_r_deg, delta_phi_deg]), **SOIL)
    assert np.pi * value == pytest.approx(expected, rel=FLOAT32)


def test_dark_smooth_grains_are_the_law_of_lommel_and_seeliger() -> None:
    w, theta_i, theta_r = 1e-9, 0.4, np.linspace(0.0, 1.5, 20)
    value = hapke(theta_i, 0.0, theta_r, 2.0, w=w, b=0.0, c=0.0)
    np.testing.assert_allclose(value, w / (4.0 * np.pi) / (np.cos(theta_i) + np.cos(theta_r)), rtol=1e-8)


def test_the_hot_spot_has_the_height_and_the_width_that_it_says() -> None:
    dark = {"w": 1e-9, "b": 0.0, "c": 0.0}
    bright = dark | {"b_0": 0.7, "h": 0.05}
    assert hapke(0.4, 0.0, 0.4, 0.0, **bright) == pytest.approx(1.7 * hapke(0.4, 0.0, 0.4, 0.0, **dark), rel=1e-8)
    phase = 2.0 * np.arctan(0.05)
    side = (0.0, 0.0, phase, 0.0)
    assert hapke(*side, **bright) == pytest.approx(1.35 * hapke(*side, **dark), rel=1e-8)


@pytest.mark.parametrize(
    ("grains", "theta_deg", "stated"),
    [
        ({}, 0.0, "0.986"),
        ({"b": 0.95, "c": 1.0}, 0.0, "1.32"),
        ({"b": 0.95, "c": 1.0, "b_0": 1.0, "h": 1.0}, 0.0, "1.77"),
        ({"b_0": 1.0, "h": 1.0}, 89.5, "1.23"),
    ],
)
def test_the_excess_is_what_the_model_says(grains: dict[str, float], theta_deg: float, stated: str) -> None:
    assert stated in MODELS["hapke"].excess
    albedo = directional_albedo("hapke", np.deg2rad(theta_deg), tolerance=1e-5, **WHITE | grains).albedo
    assert albedo == pytest.approx(float(stated), abs=0.005)
    rough = directional_albedo("hapke", np.deg2rad(theta_deg), tolerance=1e-4, **WHITE | grains, theta_bar=0.3).albedo
    assert rough < albedo
