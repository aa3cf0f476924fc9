"""The directional albedo by quadrature: closed forms, bounds, and an error estimate that does not lie."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from brdfdb import models
from brdfdb.integrals.quadrature import directional_albedo, spectral_albedo
from brdfdb.models import MODELS
from tests.models.draws import middle

HALF_PI = np.pi / 2
THETA_DEG = (0.0, 1e-6, 30.0, 60.0, 85.0, 89.9)
COPPER = {"wavelength_nm": 500.0, "n": 1.1, "k": 2.6}
WARDS = ("ward", "ward_half_vector", "ward_duer", "ward_bounded")

# Parameters of every model in the middle of things; a model without a line here is integrated at its own middle
PARAMETERS: dict[str, list[dict[str, float]]] = {
    "oren_nayar": [{"rho": 0.9, "sigma": 0.5}],
    "he_torrance": [COPPER | {"sigma_0_um": 0.1, "tau_um": 3.0}, COPPER | {"sigma_0_um": 20.0, "tau_um": 400.0}],
} | {name: [{"rho_d": 0.2, "rho_s": 0.5, "alpha_x": 0.03, "alpha_y": 0.3}] for name in WARDS}

EXACT = 3e-16  # of Lambert, worst measured: 2.2e-16
TOLERANCE = 1e-8  # as asked for; worst measured: 2.8e-9 of Minnaert, 4.2e-10 of the diffuse part of Ward's models


def parameters_of(name: str) -> list[dict[str, float]]:
    if name in PARAMETERS:
        return PARAMETERS[name]
    spec = MODELS[name]
    return [middle(spec) | (COPPER if spec.spectral else {})]


CASES = [pytest.param(name, each, id=f"{name}-{i}") for name in MODELS for i, each in enumerate(parameters_of(name))]


def test_of_the_ideal_diffuser_it_is_rho() -> None:
    albedo, error = directional_albedo("lambert", np.deg2rad(THETA_DEG), rho=0.7)
    np.testing.assert_allclose(albedo, 0.7, rtol=0.0, atol=EXACT)
    assert (error < 1e-11).all()


@pytest.mark.parametrize("k", [0.0, 0.1, 0.5, 0.9, 1.0])
def test_minnaert_has_its_closed_form(k: float) -> None:
    theta_i = np.deg2rad(THETA_DEG)
    albedo, error = directional_albedo("minnaert", theta_i, k=k, rho=0.4)
    assert (error <= TOLERANCE).all()
    np.testing.assert_allclose(albedo, 0.4 * np.cos(theta_i) ** (k - 1.0), atol=TOLERANCE, rtol=1e-14)


@pytest.mark.parametrize("alpha", [(1e-6, 1e-6), (0.01, 0.01), (0.01, 0.5), (2.0, 2.0)])
@pytest.mark.parametrize("model", WARDS)
def test_coordinates_that_follow_a_lobe_do_not_lose_the_diffuse_part(model: str, alpha: tuple[float, float]) -> None:
    surface = {"rho_d": 0.5, "rho_s": 0.0, "alpha_x": alpha[0], "alpha_y": alpha[1]}
    albedo, error = directional_albedo(model, np.deg2rad(THETA_DEG), 0.4, **surface)
    assert (error <= TOLERANCE).all()
    np.testing.assert_allclose(albedo, 0.5, atol=TOLERANCE)


def test_wards_lobe_at_normal_incidence_has_a_closed_form() -> None:
    # eq. (5a) at theta_i = 0, with u = tan^2(delta): integral of exp(-u / a^2) (1 - u) / (sqrt(..) (1 + u)^2) / a^2
    u, weight = np.polynomial.legendre.leggauss(400)
    u, weight = 0.5 * (u + 1.0), 0.5 * weight
    for alpha in (0.1, 0.5, 2.0):
        root = np.sqrt((1.0 - u) / (1.0 + u))  # of cos theta_r
        # h.i = cos(delta), d omega_r = 4 cos^4(delta) d(slopes)
        expected = np.sum(weight * np.exp(-u / alpha**2) * root * (1.0 + u) ** -2) / alpha**2
        albedo, _ = directional_albedo("ward", 0.0, rho_d=0.0, rho_s=1.0, alpha_x=alpha, alpha_y=alpha)
        assert albedo == pytest.approx(expected, abs=1e-6)  # of the closed form's own quadrature: the root ends at 1


def test_a_mirror_has_the_reflectance_of_fresnels_equations() -> None:
    theta_i = np.deg2rad([0.0, 30.0, 60.0, 80.0, 89.9])
    n, cos_i = 1.5 + 2.6j, np.cos(theta_i)
    q = np.sqrt(n**2 - np.sin(theta_i) ** 2)
    s, p = (cos_i - q) / (cos_i + q), (n**2 * cos_i - q) / (n**2 * cos_i + q)
    mirror = {"wavelength_nm": 500.0, "sigma_0_um": 0.0, "tau_um": 1.0, "n": 1.5, "k": 2.6}
    albedo, _ = directional_albedo("he_torrance", theta_i, specular=True, **mirror)
    np.testing.assert_allclose(albedo, (np.abs(s) ** 2 + np.abs(p) ** 2) / 2.0, atol=TOLERANCE)


@pytest.mark.parametrize(("theta_deg", "phi_deg"), [(0.0, 0.0), (20.0, 0.0), (30.0, 40.0)])
def test_wards_lobe_reflects_the_mean_of_the_weights_of_its_samples(theta_deg: float, phi_deg: float) -> None:
    # Eq. (7) with r^2 = -log(u1): the weight is rho_s (h.i) cos^3(delta) sqrt(cos theta_r / cos theta_i)
    x, weight = np.polynomial.legendre.leggauss(200)
    r, angle = 4.5 * (x[:, np.newaxis] + 1.0), np.pi * x
    slopes = r * 0.06 * np.cos(angle), r * 0.04 * np.sin(angle)
    cos_h = 1.0 / np.sqrt(1.0 + slopes[0] ** 2 + slopes[1] ** 2)
    theta_i, phi_i = np.deg2rad([theta_deg, phi_deg])
    towards = np.sin(theta_i) * (slopes[0] * np.cos(phi_i) + slopes[1] * np.sin(phi_i)) + np.cos(theta_i)
    cos_r = np.maximum(2.0 * towards * cos_h**2 - np.cos(theta_i), 0.0)
    mean = towards * cos_h**4 * np.sqrt(cos_r / np.cos(theta_i)) * 2.0 * r * np.exp(-(r**2)) / 2.0
    expected = 4.5 * weight @ mean @ weight
    lobe = {"rho_d": 0.0, "rho_s": 1.0, "alpha_x": 0.06, "alpha_y": 0.04}
    assert directional_albedo("ward", theta_i, phi_i, **lobe).albedo == pytest.approx(expected, abs=TOLERANCE)


def test_several_sets_of_parameters_share_panels_and_keep_their_albedos() -> None:
    rough = COPPER | {"sigma_0_um": 0.2, "tau_um": 2.0, "a": 0.1, "k": np.array([2.0, 3.0, 4.0])}
    together = spectral_albedo(MODELS["he_torrance"], 1.2, 0.0, rough, tolerance=1e-7, mirrored=True)
    each = directional_albedo("he_torrance", 1.2, tolerance=1e-7, **rough)
    assert together.albedo.shape == (3,)
    assert together.error <= 1e-7
    assert np.ptp(each.albedo) > 0.1
    np.testing.assert_allclose(together.albedo, each.albedo, atol=2e-7)
    grey = spectral_albedo(MODELS["lambert"], 1.2, 0.0, {"rho": 0.3}, tolerance=1e-9)
    assert grey.albedo == pytest.approx([0.3], abs=1e-9)


@pytest.mark.parametrize("alpha", [(0.01, 0.01), (0.1, 0.1), (0.6, 0.6), (2.0, 2.0), (0.01, 2.0), (2.0, 0.3)])
def test_the_bounded_ward_model_is_bounded(alpha: tuple[float, float]) -> None:
    theta_i = np.deg2rad([0.0, 30.0, 60.0, 80.0, 87.0, 89.0, 89.9, 89.999, 90.0])
    surface = {"rho_d": 0.0, "rho_s": 1.0, "alpha_x": alpha[0], "alpha_y": alpha[1]}
    albedo, error = directional_albedo("ward_bounded", theta_i, 0.3, tolerance=1e-7, **surface)
    assert (albedo - error <= 1.0).all()
    assert albedo[-1] == pytest.approx(1.0, abs=1e-6)  # all of it at 90 degrees


def test_the_excess_of_duers_normalisation() -> None:
    surface = {"rho_d": 0.0, "rho_s": 1.0, "alpha_x": 0.1, "alpha_y": 0.1}
    assert directional_albedo("ward_duer", np.deg2rad(89.5), **surface).albedo == pytest.approx(3.65, abs=5e-3)
    # as the models say of themselves, at 89.5 degrees; up to the last angle no more than 1
    for name, largest, alphas, up_to_deg in (
        ("ward", 1.073, (1.067, 0.001), 89.0),
        ("ward_half_vector", 2.07, (1.067, 0.001), 87.5),
        ("ward_duer", 13.4, (0.866, 0.001), 78.0),
    ):
        rough = {"rho_d": 0.0, "rho_s": 1.0, "alpha_x": alphas[0], "alpha_y": alphas[1]}
        assert f"{largest:g}" in MODELS[name].excess
        worst = directional_albedo(name, np.deg2rad(89.5), tolerance=1e-5, **rough).albedo
        assert worst == pytest.approx(largest, rel=3e-3)
        assert directional_albedo(name, np.deg2rad(up_to_deg), tolerance=1e-5, **rough).albedo < 1.0


def test_wards_lobe_is_the_cosine_and_duers_is_not() -> None:
    theta_i = np.deg2rad([0.0, 30.0, 60.0])
    narrow = {"rho_d": 0.0, "rho_s": 1.0, "alpha_x": 0.01, "alpha_y": 0.01}
    for name in ("ward", "ward_half_vector"):
        np.testing.assert_allclose(directional_albedo(name, theta_i, **narrow).albedo, np.cos(theta_i), rtol=1e-3)
    for name in ("ward_duer", "ward_bounded"):
        np.testing.assert_allclose(directional_albedo(name, theta_i, **narrow).albedo, 1.0, rtol=1e-3)


@pytest.mark.parametrize("model", WARDS)
def test_converges_for_a_narrow_lobe_at_grazing(model: str) -> None:
    narrow = {"rho_d": 0.0, "rho_s": 1.0, "alpha_x": 0.01, "alpha_y": 0.01}
    theta_i = np.deg2rad(89.9)
    fine, coarse = (directional_albedo(model, theta_i, 0.7, tolerance=t, **narrow) for t in (1e-11, 1e-6))
    assert fine.error <= 1e-11
    assert coarse.error <= 1e-6
    assert abs(coarse.albedo - fine.albedo) <= coarse.error


@pytest.mark.parametrize(("model", "parameters"), CASES)
def test_the_error_of_every_model_is_no_more_than_it_says(model: str, parameters: dict[str, float]) -> None:
    theta_i = np.deg2rad([0.0, 40.0, 89.0])
    fine = directional_albedo(model, theta_i, 0.2, tolerance=1e-7, **parameters)
    for tolerance in (1e-3, 1e-5):
        albedo, error = directional_albedo(model, theta_i, 0.2, tolerance=tolerance, **parameters)
        assert (error <= tolerance).all()
        assert (np.abs(albedo - fine.albedo) <= error + fine.error).all()


def test_agrees_with_a_plain_rule_over_the_hemisphere() -> None:
    x, weight = np.polynomial.legendre.leggauss(300)
    theta, phi = (x + 1.0) * (HALF_PI / 2.0), (x + 1.0) * np.pi
    wide = {"rho_d": 0.1, "rho_s": 0.5, "alpha_x": 0.4, "alpha_y": 0.6}
    values = models.ward_bounded(1.0, 0.3, theta[:, None], phi, **wide)
    plain = (weight * (HALF_PI / 2.0) * np.sin(theta) * np.cos(theta)) @ values @ (weight * np.pi)
    assert directional_albedo("ward_bounded", 1.0, 0.3, **wide).albedo == pytest.approx(plain, abs=1e-8)


def test_the_dirac_part_is_added_when_asked_for() -> None:
    mirror = COPPER | {"sigma_0_um": 0.02, "tau_um": 1.0}
    theta_i = np.array([0.0, 1.0])
    diffuse = directional_albedo("he_torrance", theta_i, **mirror)
    total = directional_albedo("he_torrance", theta_i, specular=True, **mirror)
    np.testing.assert_array_equal(total.albedo, diffuse.albedo + models.he_torrance_specular(theta_i, **mirror))
    assert directional_albedo("lambert", 1.0, rho=0.5, specular=True) == directional_albedo("lambert", 1.0, rho=0.5)


def test_broadcasts_and_lets_nan_through() -> None:
    theta_i, k = np.array([[0.0], [1.0], [np.nan], [2.0]]), np.array([0.4, 0.8])
    albedo, error = directional_albedo("minnaert", theta_i, k=k)
    assert albedo.shape == error.shape == (4, 2)
    assert np.isnan(albedo[2]).all()
    assert np.isnan(error[2]).all()
    assert (albedo[3] == 0.0).all()  # below the horizon
    assert albedo[1, 1] == directional_albedo("minnaert", 1.0, k=0.8).albedo
    assert isinstance(directional_albedo("minnaert", 1.0, k=0.8).albedo, np.float64)
    assert directional_albedo(MODELS["lambert"], [], rho=0.5).albedo.shape == (0,)


def test_gives_up_with_an_error_that_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("brdfdb.integrals.quadrature.MOST_PANELS", 500)
    # noise has no integral that panels could agree on
    rng = np.random.default_rng(1)

    def noise(wi: Any, wr: Any, *, rho: Any) -> Any:
        return rho * rng.uniform(size=np.broadcast_shapes(np.shape(wi), np.shape(wr))[:-1])

    spec = replace(MODELS["lambert"], vectors=noise)
    albedo, error = directional_albedo(spec, 0.5, rho=1.0, tolerance=1e-8)
    assert error > 1e-6
    assert np.isfinite(albedo)


def test_refuses_what_the_model_refuses_and_tolerances_that_float64_does_not_reach() -> None:
    for tolerance in (0.0, -1.0, 1e-14, 2.0, np.nan):
        with pytest.raises(ValueError, match=r"^tolerance: .* is outside \[1e-13, 1\]$"):
            directional_albedo("lambert", 0.5, rho=0.5, tolerance=tolerance)
        with pytest.raises(ValueError, match=r"^tolerance: .* is outside \[1e-13, 1\]$"):
            spectral_albedo(MODELS["lambert"], 1.2, 0.0, {"rho": 0.3}, tolerance=tolerance)
    for parameter, model, theta_i, rho in (("rho", "lambert", 0.5, 2.0), ("theta_i", "lambert", 4.0, 0.5)):
        with pytest.raises(ValueError, match=f"^{parameter}: "):
            directional_albedo(model, theta_i, rho=rho)
    with pytest.raises(ValueError, match=r"^model: 'phong' is not one of lambert, "):
        directional_albedo("phong", 0.5, rho=0.5)
