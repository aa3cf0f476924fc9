"""GGX with the light that facets reflect to one another: lost shares, white furnace, reciprocity, twins."""

from typing import Any

import numpy as np
import pytest

from brdfdb import models
from brdfdb.geometry import unit_vector
from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.models import MODELS
from brdfdb.models._ggx_albedo import lost_by_quadrature, lost_share, mean_lost_share, share_of
from brdfdb.reference import heitz_2014, kulla_conty_2017, mp, turquin_2019

ALPHAS = (1e-3, 0.03, 0.3, 1.0)
FURNACE = 1e-10  # Worst measured from 1e-3 to 1: 2e-12, at 90 degrees
SHARE = 1e-12  # Worst measured: 3e-15
ASYMPTOTE = 1e-5  # relative to the limit of narrow lobes, for alpha of 1e-6. Worst measured: 6.7e-6
GRAZING = np.deg2rad([0.0, 50.0, 85.0, 89.9])


def lost(cos: Any, alpha: float) -> Any:
    return lost_share(np.asarray(cos, np.float64), np.asarray(alpha))


def test_lost_share_has_a_closed_form_for_alpha_of_1() -> None:
    cos = np.array([1.0, 0.9, 0.3, 0.01, 1e-9, 6e-17])
    np.testing.assert_allclose(lost(cos, 1.0), cos * np.log1p(1.0 / cos), rtol=SHARE)
    assert mean_lost_share(np.asarray(1.0)) == pytest.approx(4.0 * np.log(2.0) / 3.0 - 1.0 / 3.0, rel=SHARE)


def test_lost_share_of_narrow_lobes_is_their_limit() -> None:
    # The mirror direction is hidden with Lambda = (alpha tan)^2 / 4; the other light goes below the horizon, where D is
    # alpha^2 / pi (1 + cot^2)^2, and its integral is elementary: (1 + tan^2 / 4) alpha^2
    cos, alpha = np.array([1.0, 0.7, 0.5, 0.2]), 1e-6
    np.testing.assert_allclose(lost(cos, alpha), alpha**2 * (1.0 + cos**-2) / 2.0, rtol=ASYMPTOTE)


@pytest.mark.parametrize("alpha", [0.999, 0.3, 1e-2])
def test_lost_share_is_that_of_the_twin(alpha: float) -> None:
    for theta in (0.0, 0.8, 1.5, 1.5707):
        cos = mp.cos(mp.mpf(theta))
        expected = 1 - kulla_conty_2017.albedo(theta, alpha)
        assert abs(float(lost(float(cos), alpha) / expected) - 1.0) < SHARE


def test_twin_is_the_integral_of_the_facets_over_all_viewers() -> None:
    # The twin integrates the azimuth in closed form; mpmath's own rule takes both angles here
    with mp.workdps(15):
        theta_i, alpha = mp.mpf("0.8"), mp.mpf("0.7")

        def reflected(theta_r: Any, phi: Any) -> Any:
            f_r = heitz_2014.ggx_schlick(theta_i, 0, theta_r, phi, 0, 1, alpha, alpha)
            return 2 * f_r * mp.cos(theta_r) * mp.sin(theta_r)

        both = mp.quad(reflected, [0, 0.8, mp.pi / 2], [0, mp.pi], method="gauss-legendre", maxdegree=4)
    assert abs(both - kulla_conty_2017.albedo(theta_i, alpha)) < 1e-9


@pytest.mark.parametrize("alpha", [0.9, 0.07, 1e-4, 1e-6])
def test_series_are_within_rounding_of_the_quadrature(alpha: float) -> None:
    cos = np.concatenate([np.geomspace(1e-9, 1.0, 80), 1.0 - np.geomspace(1e-12, 0.1, 20)])
    np.testing.assert_allclose(lost(cos, alpha), lost_by_quadrature(cos, np.asarray(alpha)), rtol=SHARE)


@pytest.mark.parametrize("alpha", [1e-5, 0.02, 0.6])
def test_mean_is_that_of_a_plain_sum(alpha: float) -> None:
    x, weight = np.polynomial.legendre.leggauss(12)
    edges = np.append(0.0, np.geomspace(alpha / 1e4, 1.0, 60))
    half = np.diff(edges)[:, np.newaxis] / 2.0
    cos = edges[:-1, np.newaxis] + half * (x + 1.0)
    mean = np.sum(2.0 * cos * lost_by_quadrature(cos, np.asarray(alpha)) * half * weight)
    assert mean_lost_share(np.asarray(alpha)) == pytest.approx(mean, rel=SHARE)


@pytest.mark.parametrize("count", [3, 200])
def test_alphas_of_an_array_are_those_of_numbers(count: int) -> None:
    rng = np.random.default_rng(1)
    cos, alpha = rng.random(count), 10.0 ** rng.uniform(-6.0, 0.0, count)
    one_by_one = [lost(c, a) for c, a in zip(cos, alpha, strict=True)]
    np.testing.assert_allclose(lost_share(cos, alpha), one_by_one, rtol=SHARE)
    np.testing.assert_allclose(mean_lost_share(alpha), [share_of(a)[1] for a in alpha], rtol=SHARE)


@pytest.mark.parametrize("alpha", ALPHAS)
def test_white_furnace(alpha: float) -> None:
    albedo, error = directional_albedo("ggx_compensated", GRAZING, f_0=1.0, alpha=alpha, tolerance=1e-9)
    assert np.max(np.abs(albedo - 1.0)) < FURNACE
    assert np.max(error) < 1e-9


@pytest.mark.parametrize("f_0", [0.0, 0.04, 0.6])
def test_a_surface_that_absorbs_reflects_more_than_single_scattering_and_less_than_all(f_0: float) -> None:
    albedo = directional_albedo("ggx_compensated", GRAZING, f_0=f_0, alpha=0.8, tolerance=1e-6).albedo
    surface = {"rho_d": 0.0, "f_0": f_0, "alpha_x": 0.8, "alpha_y": 0.8}
    single = directional_albedo("ggx_schlick", GRAZING, tolerance=1e-6, **surface).albedo
    assert (albedo > single).all()
    assert (albedo < 1.0).all()


def test_second_lobe_is_of_second_order_in_the_reflectance() -> None:
    # Hill 2018: light in it has met two facets. F_avg of f_0 is (20 f_0 + 1) / 21, and 0 for the f_0 of -1 / 20
    mean = float(mean_lost_share(np.asarray(1.0)))
    ratios = []
    for f_0 in (0.0, 0.1):
        surface = {"rho_d": 0.0, "f_0": f_0, "alpha_x": 1.0, "alpha_y": 1.0}
        both = models.ggx_compensated(0.5, 0.0, 0.9, 1.0, f_0=f_0, alpha=1.0)
        F_avg = (20.0 * f_0 + 1.0) / 21.0
        ratios.append((both - models.ggx_schlick(0.5, 0.0, 0.9, 1.0, **surface)) / F_avg**2 * (1.0 - F_avg * mean))
    assert ratios[0] == pytest.approx(ratios[1], rel=1e-9)
    (printed,) = [
        each for each in MODELS["ggx_compensated"].forms({"f_0": 0.5, "alpha": 0.5}) if each.kind == "printed"
    ]
    wi, wr = unit_vector(0.5, 0.0), unit_vector(0.9, 1.0)
    value = printed.vectors(wi, wr, f_0=0.5, alpha=0.5)
    expected = heitz_2014.ggx_schlick(0.5, 0, 0.9, 1, 0, 0.5, 0.5, 0.5)
    expected += kulla_conty_2017.multiple(0.5, 0.9, 0.5, 0.5, bounces=1)
    assert value == pytest.approx(float(expected), rel=1e-12)


def test_scaled_form_is_that_of_its_twin() -> None:
    mirror, grazing = (1.2, 0.7, 1.2, 0.7 + np.pi), (0.4, 0.3, np.pi / 2, 1.0)
    for angles in ((0.5, 0.3, 0.9, 2.0), (0.0, 0.0, 0.0, 0.0), mirror, grazing):
        expected = float(turquin_2019.ggx_scaled(*angles, 0.7, 0.5))
        assert models.ggx_scaled(*angles, f_0=0.7, alpha=0.5) == pytest.approx(expected, rel=1e-10)
        vectors = unit_vector(*angles[:2]), unit_vector(*angles[2:])
        assert models.ggx_scaled_vectors(*vectors, f_0=0.7, alpha=0.5) == pytest.approx(expected, rel=1e-10)


def test_scaled_form_gives_all_light_to_each_viewer_but_is_not_reciprocal() -> None:
    # f_0 = 1: the integral over lights is 1 for each viewer
    x, weight = np.polynomial.legendre.leggauss(200)
    theta, phi = (x + 1.0) * np.pi / 4.0, (x + 1.0) * np.pi / 2.0
    over_theta = weight * np.pi / 4.0 * np.sin(theta) * np.cos(theta)
    lights, viewers = [], []
    for angle in (0.3, 1.2):
        of_lights = models.ggx_scaled(theta[:, None], 0.0, angle, phi, f_0=1.0, alpha=0.8)
        of_viewers = models.ggx_scaled(angle, 0.0, theta[:, None], phi, f_0=1.0, alpha=0.8)
        lights.append(over_theta @ of_lights @ weight * np.pi)
        viewers.append(over_theta @ of_viewers @ weight * np.pi)
    np.testing.assert_allclose(lights, 1.0, atol=1e-6)
    assert abs(viewers[0] - 1.0) > 0.02
    one, other = models.ggx_scaled([0.3, 1.4], 0.0, [1.4, 0.3], np.pi, f_0=1.0, alpha=0.8)
    assert abs(one / other - 1.0) > 0.2
