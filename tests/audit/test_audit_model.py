"""What an audit says of the model behind a table: its sampler, its jumps, and where its paper says that it is valid."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import mpmath
import numpy as np
import pytest
from scipy import stats

from brdfdb.audit import sampling
from brdfdb.audit.pairs import pairs_of
from brdfdb.audit.sampling import Sampling, sampling_of
from brdfdb.audit.smoothness import MODEL_TOLERANCE, Jump, Smoothness, smoothness_of
from brdfdb.audit.validity import Limit, validity_of
from brdfdb.geometry import unit_vector
from brdfdb.integrals.quadrature import Albedo
from brdfdb.integrals.sampling import lobe_of
from brdfdb.lobes import Lobe
from brdfdb.materials import Material, presets
from brdfdb.models import MODELS
from brdfdb.parameters import Array
from brdfdb.tables import error_measurement
from brdfdb.tables.table import Table
from tests.audit.a_table import ANISOTROPIC, ISOTROPIC, PARAMETERS, WAVELENGTHS, lambert, material, tabulated

WARD = material("ward", {"rho_d": 0.2, "rho_s": 0.3, "alpha_x": 0.05, "alpha_y": 0.15})
# The integral of a Gaussian over its bins, by their nodes: worst measured 2e-13
SHARES = 1e-12


# Samplers


@pytest.mark.parametrize("model", MODELS)
def test_the_sampler_of_every_model_passes(model: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sampling, "SAMPLES", 20_000)
    made_up = material(model, PARAMETERS[model])
    grid = ANISOTROPIC if made_up.anisotropic else ISOTROPIC
    table = lambert(0.5, grid)
    found = sampling_of(replace(table, wavelength_nm=WAVELENGTHS if made_up.spectral else None), made_up)
    assert found.verdict == "passes"
    assert found.theta_i_deg == [10.0, 45.0, 80.0]
    assert found.wavelength_nm == (500.0 if made_up.spectral else None)
    assert all(p is not None and 0.0 < p <= 1.0 for p in found.chi_square_p)


def ward_sampling(monkeypatch: pytest.MonkeyPatch, instead: Callable[..., Any]) -> Sampling:
    monkeypatch.setattr(sampling, "sample", instead)
    return sampling_of(lambert(0.5, ANISOTROPIC), WARD)


def test_samples_of_a_lobe_that_is_a_twentieth_wider_are_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    real = sampling.sample

    def wider(spec: Any, u1: Array, u2: Array, wi: Array, **parameters: Any) -> Any:
        return real(spec, u1, u2, wi, **parameters | {"alpha_x": 1.05 * parameters["alpha_x"]})

    found = ward_sampling(monkeypatch, wider)
    assert found.verdict == "violates"
    assert max(p for p in found.chi_square_p if p is not None) < sampling.LEAST_CHANCE


def test_weights_that_are_a_hundredth_too_large_are_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    real = sampling.sample

    def heavier(*arguments: Any, **parameters: Any) -> Any:
        drawn = real(*arguments, **parameters)
        return drawn._replace(weight=1.01 * drawn.weight)

    found = ward_sampling(monkeypatch, heavier)
    assert found.verdict == "violates"
    assert min(p for p in found.chi_square_p if p is not None) > 1e-3


def test_a_quadrature_that_gives_up_excuses_no_weights(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sampling, "spectral_albedo", lambda *_, **__: Albedo(np.full((3, 1), 0.6), np.ones(3)))
    assert sampling_of(lambert(0.5), material("lambert", {"rho": 0.5})).verdict == "violates"


def test_what_is_said_of_weights_is_said_of_a_lambertian_in_closed_form() -> None:
    found = sampling_of(lambert(0.5), material("lambert", {"rho": 0.5}))
    assert found.largest_weight == found.monte_carlo == found.quadrature == [0.5, 0.5, 0.5]
    assert max(x for x in (*found.weight_spread, *found.monte_carlo_error) if x is not None) < 1e-12


@pytest.mark.parametrize("alpha", [(0.05, 0.15), (1e-4, 1e-4), (2.0, 0.3)])
def test_bins_hold_the_shares_of_a_gaussian_of_slopes(alpha: tuple[float, float]) -> None:
    lobe = Lobe(np.ones(()), np.asarray(alpha[0]), np.asarray(alpha[1]))
    t_edges = sampling._t_edges(lobe)
    shares = sampling._shares(unit_vector(0.8, 0.3), lobe, np.array(alpha), t_edges)
    exact = -np.diff(np.exp(-(t_edges**2))) / (sampling._PSI_EDGES.size - 1)
    np.testing.assert_allclose(shares, np.broadcast_to(exact[:, np.newaxis], shares.shape), atol=SHARES)


@pytest.mark.parametrize("theta", [0.0, 0.8, 1.5])
def test_the_chances_of_honest_samples_are_uniform(theta: float) -> None:
    arguments, wi = WARD.arguments(), unit_vector(theta, 0.3)
    chances = []
    for seed in range(60):
        u1, u2 = np.random.default_rng(seed).random((2, 10_000))
        drawn = sampling.sample(WARD.spec, u1, u2, wi, **arguments)
        chances.append(sampling._chance(drawn.wr, wi, lobe_of(WARD.spec, wi, arguments)))
    assert stats.kstest(chances, "uniform").pvalue > 1e-3


def test_viewers_that_were_drawn_in_the_lobe_are_there() -> None:
    drawn = error_measurement.draw(WARD, None, 500, 7)
    assert np.mean(drawn.in_lobe) == pytest.approx(0.5, abs=0.03)
    h = drawn.wi + drawn.wr
    t = np.hypot(h[:, 0] / 0.05, h[:, 1] / 0.15) / h[:, 2]
    assert np.quantile(t[drawn.in_lobe], 0.99) < 2.0 * np.sqrt(-np.log(1e-3))  # Gaussians of once and twice the width
    assert np.median(t[~drawn.in_lobe]) > 3.0
    assert not error_measurement.draw(material("lambert", {"rho": 0.5}), None, 10, 7).in_lobe.any()


# Jumps

STEP = 1e-6
LIGHT, VIEWER = np.array([1.0, 0.1, 0.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0, 0.1, 0.0])
# What changes its sign at a seam, of the components of light and viewer
SIDES: dict[str, Callable[[Array], Any]] = {
    "viewer 90 degrees from the plane of incidence": lambda w: w[..., 0] * w[..., 3] + w[..., 1] * w[..., 4],
    "theta_i = theta_r": lambda w: w[..., 2] - w[..., 5],
    "light at the normal": lambda w: w @ LIGHT,
    "viewer at the normal": lambda w: w @ VIEWER,
    "mirror direction": lambda w: w @ (LIGHT + VIEWER),
    "back towards the light": lambda w: w @ (LIGHT - VIEWER),
}


def smoothness(table: Table) -> Smoothness:
    return smoothness_of(table, table.source, pairs_of(table, table.source))


def by_seam(jumps: list[Jump]) -> dict[str, Jump]:
    return {jump.seam: jump for jump in jumps}


@pytest.mark.parametrize("seam", SIDES)
def test_a_step_of_the_model_is_caught_at_its_seam(seam: str, monkeypatch: pytest.MonkeyPatch) -> None:
    table = lambert(0.5)

    def stepping(wi: Array, wr: Array, *, rho: float) -> Any:
        both = np.concatenate(np.broadcast_arrays(wi, wr), axis=-1)
        return rho / np.pi * (1.0 + STEP * (SIDES[seam](both) > 0.0))

    monkeypatch.setitem(MODELS, "lambert", replace(MODELS["lambert"], vectors=stepping))
    found = smoothness(table)
    assert found.verdict == "violates"
    assert by_seam(found.model)[seam].largest == pytest.approx(STEP, rel=0.01)
    assert max(jump.largest for jump in found.table) <= MODEL_TOLERANCE


def test_values_that_differ_along_a_row_are_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    table = lambert(0.5)

    def by_rows(theta_i: Array, phi_i: float, theta_r: Array, phi_r: Array, *, rho: float) -> Any:
        along = theta_i.shape != phi_r.shape
        return rho / np.pi * (1.0 + STEP * along) + 0.0 * (theta_i + phi_i + theta_r + phi_r)

    monkeypatch.setitem(MODELS, "lambert", replace(MODELS["lambert"], evaluate=by_rows))
    found = smoothness(table)
    (row,) = [jump for jump in found.model if jump.largest > jump.tolerance]
    assert (row.seam, found.verdict) == ("values in rows and one by one", "violates")
    assert row.largest == pytest.approx(STEP, rel=0.01)


def test_a_steep_lobe_is_no_jump() -> None:
    narrow = material("ward", {"rho_d": 0.0, "rho_s": 0.3, "alpha_x": 0.01, "alpha_y": 0.01})
    found = smoothness(tabulated(narrow, ISOTROPIC))
    assert max(jump.largest for jump in found.model) <= MODEL_TOLERANCE
    assert found.verdict == "passes"


# Validity


def limits(made_up: Material, wavelength_nm: Array | None = None) -> dict[str, Limit]:
    return {limit.quantity.split()[0].rstrip(","): limit for limit in validity_of(made_up, wavelength_nm).limits}


@pytest.mark.parametrize(
    ("name", "standing"),
    [
        ("sandpaper-220-grit", "outside"),  # sigma_0 / tau = 4.4 "challenges the gentle slope assumption"
        ("aluminum-cylinder-12a", "inside"),  # 0.06
        ("aluminum-cylinder-12f", "at the edge"),  # 0.16
        ("latex-semi-gloss-rolled-wood", "at the edge"),  # alpha_y = 0.26
        ("rolled-brass", "inside"),  # 0.16
        ("wall-plaster", "inside"),  # sigma = 30 degrees
        ("cotton-towel", "at the edge"),  # 42 degrees
        ("aluminum-cylinder-13c", "inside"),  # Lambert: no limit
    ],
)
def test_where_the_materials_of_the_papers_stand(name: str, standing: str) -> None:
    assert validity_of(presets()[name], np.array([400.0, 700.0])).verdict == standing


@pytest.mark.parametrize(
    ("name", "limit", "nm", "standing"),
    [
        ("sandpaper-220-grit", "slope", 550.0, "outside"),
        ("sandpaper-220-grit", "very", 550.0, "inside"),  # its integrals need no gentle slopes
        ("sandpaper-220-grit", "reflections", 550.0, "outside"),  # a nonmetal without a uniform part
        ("scene-plastic-table", "reflections", 550.0, "inside"),
        ("aluminum-cylinder-12a", "reflections", 550.0, "inside"),
        ("aluminum-cylinder-12e", "reflections", 550.0, "at the edge"),  # a steep metal without a uniform part
        ("aluminum-cylinder-12a", "rms", 400.0, "inside"),
        ("aluminum-cylinder-12a", "rms", 2000.0, "at the edge"),
    ],
)
def test_where_a_limit_stands(name: str, limit: str, nm: float, standing: str) -> None:
    assert limits(presets()[name], np.array([nm]))[limit].standing == standing


def test_the_radius_of_curvature_is_that_of_the_correlation_of_eq_48() -> None:
    sigma, tau = 0.28, 1.77
    fourth = float(mpmath.diff(lambda r: mpmath.exp(-((r / tau) ** 2)), 0, 4))
    radius = 1.0 / (sigma * math.sqrt(fourth))
    value = limits(presets()["roughened-aluminum-500nm"], np.array([500.0]))["rms"].value
    assert value == f"{radius / 0.5:.3g} at 500 nm"


def test_limits_depend_on_the_longest_wavelength() -> None:
    aluminum = presets()["aluminum-cylinder-12a"]
    assert limits(aluminum, np.array([400.0, 700.0]))["rms"] == limits(aluminum, np.array([700.0]))["rms"]


@pytest.mark.parametrize(
    ("alpha", "rho_s", "standings"),
    [
        (0.2, 0.3, ["inside", "inside"]),
        (0.3, 0.3, ["at the edge", "inside"]),
        (0.4, 0.8, ["outside", "at the edge"]),
        (0.1, 0.9, ["inside", "outside"]),
    ],
)
def test_limits_of_ward(alpha: float, rho_s: float, standings: list[str]) -> None:
    parameters = {"rho_d": 0.2, "rho_s": rho_s, "alpha_x": 0.1, "alpha_y": alpha}
    assert [limit.standing for limit in validity_of(material("ward", parameters), None).limits] == standings


def test_the_gaussian_of_slopes_reaches_beyond_90_degrees() -> None:
    three_deviations = limits(material("oren_nayar", {"rho": 0.5, "sigma_deg": 30}))["share"]
    assert three_deviations.value.startswith(f"{100.0 * 2.0 * stats.norm.sf(3.0):.2g} %")
    assert limits(material("oren_nayar", {"rho": 0.5, "sigma_deg": 60}))["share"].standing == "outside"


def test_what_a_material_does_not_say_is_unknown_and_decides_nothing() -> None:
    found = validity_of(material("oren_nayar_single_slope", PARAMETERS["oren_nayar_single_slope"]), None)
    assert ([limit.standing for limit in found.limits], found.verdict) == (["unknown"], "inside")
