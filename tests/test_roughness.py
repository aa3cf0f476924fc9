"""The translators between kinds of roughness: round trips, refusals, and the lobes of the models they speak of."""

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from brdfdb import models, roughness
from brdfdb.parameters import Parameter

FUNCTIONS = [
    function
    for name, function in vars(roughness).items()
    if inspect.isfunction(function) and function.__module__ == roughness.__name__
]
# there, back, and a range of what both take
PAIRS = [
    (roughness.alpha_from_slope, roughness.slope_from_alpha, 1e3),
    (roughness.alpha_from_angle, roughness.angle_from_alpha, np.pi / 2),
    (roughness.alpha_from_degrees, roughness.degrees_from_alpha, 90.0),
    (roughness.alpha_from_roughness, roughness.roughness_from_alpha, 1.0),
]

Function = Callable[..., Any]

# The lobe of He-Torrance against Ward's, worst measured over 1.5 alpha, at g of 2.5e5: 7.9e-6
WIDTH = 9e-6
# exp(-theta^2 / 2 sigma^2) against Ward's lobe at a sigma of half a degree, worst measured over 3 sigma: 5.5e-5
PEAK = 7e-5


@pytest.mark.parametrize(("there", "back", "high"), PAIRS, ids=lambda f: getattr(f, "__name__", ""))
def test_there_and_back(there: Function, back: Function, high: float) -> None:
    values = np.append(np.geomspace(1e-6, high, 50), 0.0)
    np.testing.assert_allclose(back(there(values)), values, rtol=4e-16)
    np.testing.assert_allclose(there(back(there(values))), there(values), rtol=4e-16)
    assert (np.diff(there(np.sort(values))) > 0.0).all()


def test_heights_there_and_back() -> None:
    sigma_0, tau = np.geomspace(1e-4, 100.0, 20), np.geomspace(1e-2, 1e3, 15)[:, None]
    alpha = roughness.alpha_from_heights(sigma_0, tau)
    assert alpha.shape == (15, 20)
    np.testing.assert_allclose(roughness.heights_from_alpha(alpha, tau), np.broadcast_to(sigma_0, (15, 20)), rtol=4e-16)
    np.testing.assert_allclose(
        roughness.slope_from_alpha(alpha), roughness.slope_from_heights(sigma_0, tau), rtol=4e-16
    )


def test_degrees_are_radians() -> None:
    degrees = np.linspace(0.0, 90.0, 7)
    np.testing.assert_array_equal(
        roughness.alpha_from_degrees(degrees), roughness.alpha_from_angle(np.deg2rad(degrees))
    )


def test_alpha_is_the_rms_slope_and_the_slope_that_along_one_axis() -> None:
    rng = np.random.default_rng(1992)
    sigma = 0.2
    slopes = rng.normal(0.0, sigma, (2, 1_000_000))
    rms = float(np.sqrt(np.mean(np.sum(slopes**2, axis=0))))
    assert rms == pytest.approx(float(roughness.alpha_from_slope(sigma)), rel=3e-3)  # 1 / sqrt(10^6), three times


def test_the_slope_of_a_gaussian_surface_is_the_curvature_of_its_autocorrelation() -> None:
    # one profile with the autocorrelation sigma_0^2 exp(-(x / tau)^2), by its spectrum; slopes by differences
    rng = np.random.default_rng(1991)
    sigma_0, tau, step, count = 0.3, 4.0, 0.05, 2**21
    k = 2.0 * np.pi * np.fft.rfftfreq(count, step)
    spectrum = np.exp(-((k * tau) ** 2) / 8.0)  # the root of the transform of exp(-(x / tau)^2)
    heights = np.fft.irfft(np.fft.rfft(rng.normal(size=count)) * spectrum, count)
    heights *= sigma_0 / heights.std()
    slope = float(np.std(np.diff(heights) / step))
    assert slope == pytest.approx(float(roughness.slope_from_heights(sigma_0, tau)), rel=0.02)  # 1.0e-2 measured


@pytest.mark.parametrize(("sigma_0_um", "tau_um"), [(20.0, 400.0), (40.0, 200.0), (100.0, 1000.0)])
def test_the_lobe_of_a_very_rough_surface_has_the_width_of_wards_alpha(sigma_0_um: float, tau_um: float) -> None:
    surface = {"wavelength_nm": 500.0, "sigma_0_um": sigma_0_um, "tau_um": tau_um, "n": 1.0, "k": 1e4}
    alpha = float(roughness.alpha_from_heights(sigma_0_um, tau_um))
    # back towards the light, the half vector is the direction itself; g falls with v_z^2
    delta = np.arctan(np.linspace(0.0, 1.5, 7) * alpha)
    he_torrance = models.he_torrance(delta, 0.0, delta, 0.0, **surface)
    ward = models.ward(delta, 0.0, delta, 0.0, rho_d=0.0, rho_s=1.0, alpha_x=alpha, alpha_y=alpha)
    # what is left is Gaussian: G / (g cos cos) is in 1 / cos^6, Ward's root in 1 / cos
    he_torrance, ward = he_torrance * np.cos(delta) ** 6, ward * np.cos(delta)
    np.testing.assert_allclose(he_torrance / he_torrance[0], ward / ward[0], rtol=WIDTH)


def test_facets_of_a_small_angle_have_the_lobe_of_their_alpha() -> None:
    sigma = np.deg2rad(0.5)
    alpha = float(roughness.alpha_from_degrees(0.5))
    delta = np.linspace(0.0, 3.0, 13) * sigma
    ward = models.ward(delta, 0.0, delta, 0.0, rho_d=0.0, rho_s=1.0, alpha_x=alpha, alpha_y=alpha) * np.cos(delta)
    np.testing.assert_allclose(ward / ward[0], np.exp(-(delta**2) / (2.0 * sigma**2)), atol=PEAK)


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: f.__name__)
def test_refuses_what_is_no_roughness(function: Function) -> None:
    names = list(inspect.signature(function).parameters)
    known: dict[str, Parameter] = {p.name: p for p in vars(roughness).values() if isinstance(p, Parameter)}
    for name in names:
        for wrong in (-0.1, np.nan, np.inf, known[name].high * 1.5):
            arguments = {each: known[each].low or 0.0 for each in names} | {name: wrong}
            with pytest.raises(ValueError, match=rf"^{name}: .* is outside \["):
                function(**arguments)
