"""Fits against synthetic samples, whose parameters are known, and against the models themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.fitting.estimates import estimates_of
from brdfdb.fitting.fit import ONE_AZIMUTH, fit, fits
from brdfdb.fitting.problem import Problem
from brdfdb.fitting.residuals import Residual
from brdfdb.fitting.surface import NotDescribedError, SearchedSurface, fitted_by_default
from brdfdb.fitting.uncertainty import NORMAL_95, _root
from brdfdb.geometry import unit_vector
from brdfdb.measurements import Instrument, Samples
from brdfdb.measurements.aperture import InstrumentView
from brdfdb.models import MODELS

NOISE = 0.03
ROUNDING = 1e-9  # measured: 4e-13, of the polynomials of all models
GRADIENT = 1e-4  # measured: 8e-6, of differences of the cost with a step of 1e-5

Array = NDArray[np.float64]


def directions(turned: bool = False) -> tuple[Array, Array, Array, Array]:
    """Return directions of four lights, the mirror half plane denser than the rest."""
    lights, azimuths = np.deg2rad([10.0, 30.0, 50.0, 65.0]), np.deg2rad([0.0, 45.0, 90.0] if turned else [0.0])
    viewers, delta = np.deg2rad(np.arange(0.0, 81.0, 5.0)), np.deg2rad([0.0, 60.0, 120.0, 170.0, 175.0, 180.0])
    theta_i, phi_i, theta_r, turn = (
        axis.ravel() for axis in np.meshgrid(lights, azimuths, viewers, delta, indexing="ij")
    )
    return theta_i, phi_i, theta_r, phi_i + turn


def samples(values: Array, at: Array | None = None, turned: bool = False) -> Samples:
    """Return samples of f_r (N, C) at `directions`."""
    channels = ("grey",) if at is None else tuple(f"{nm:g}nm" for nm in at)
    return Samples("synthetic", *directions(turned), channels, at, values)


def truth(model: str, turned: bool = False, **parameters: float) -> Array:
    """Return f_r (N, 1) of a model at `directions`."""
    theta_i, phi_i, theta_r, phi_r = directions(turned)
    wi, wr = unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r)
    return np.asarray(MODELS[model].vectors(wi, wr, **parameters))[:, np.newaxis]


def noisy(values: Array, seed: int = 1) -> Array:
    """Return values with relative noise."""
    return values * (1.0 + NOISE * np.random.default_rng(seed).standard_normal(values.shape))


WARD = {"rho_d": 0.2, "rho_s": 0.1, "alpha_x": 0.15, "alpha_y": 0.15}


@pytest.mark.parametrize("name", fitted_by_default())
def test_polynomial_of_a_surface_is_the_model(name: str) -> None:
    surface = SearchedSurface(name, None, 1, turned=True)
    theta_i, phi_i, theta_r, phi_r = directions()
    wi, wr = unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r)
    rng = np.random.default_rng(3)
    x = rng.uniform(0.3, 0.7, len(surface.shape))
    values = np.array([[rng.uniform(0.1, 0.9) * one.unit] for one in surface.coefficients]).reshape(-1, 1)
    expected = np.zeros(len(wi))
    for number, term in enumerate(surface.terms):
        given, scale = surface.in_channel(x, values, number, 0)
        expected += scale * term.spec.vectors(wi, wr, **given)
    found = surface.f_r(x, values, InstrumentView(wi, wr))[:, 0]
    assert np.max(np.abs(found - expected)) <= ROUNDING * np.max(expected)


@pytest.mark.parametrize("aperture_sr", [None, 0.01])
@pytest.mark.parametrize("name", ["hapke", "lambert + 2 he_torrance", "ward", "ggx_compensated"])
def test_points_that_are_evaluated_together_have_the_values_of_each(name: str, aperture_sr: float | None) -> None:
    made = samples(noisy(truth("ward", **WARD)))
    view = InstrumentView(made.w_i, made.w_r, Instrument(receiver_solid_angle_sr=aperture_sr))
    at = np.array([450.0] if name in ("hapke", "ggx_compensated") else [450.0, 650.0])
    together, alone = (SearchedSurface(name, at, len(at), turned=True, entry="constant/1.5/0.1") for _ in range(2))
    points = np.random.default_rng(5).uniform(0.1, 0.9, (6, len(alone.shape)))
    expected = np.array([alone.basis(x, view) for x in points])
    assert np.max(np.abs(together.bases(points, view) - expected)) <= ROUNDING * np.max(expected)
    several = [alone.widths(x[np.newaxis])[0] for x in points]
    assert together.widths(points) == pytest.approx(np.array(several))


def test_the_neighbours_of_a_point_are_one_call_of_the_model(monkeypatch: pytest.MonkeyPatch) -> None:
    made = samples(noisy(truth("ward", **WARD)))
    surface = SearchedSurface("hapke", None, 1, turned=False)
    problem = Problem(surface, InstrumentView(made.w_i, made.w_r), Residual(made, "log"))
    point = problem.at(np.full(len(problem.free), 0.4))
    spec, calls = surface.terms[0].spec, []

    def counted(*directions: Array, **given: Array) -> Array:
        calls.append(given)
        return spec.vectors(*directions, **given)

    monkeypatch.setattr(surface.terms[0], "spec", replace(spec, vectors=counted))
    assert problem.shape_jacobian(point).shape == (6, len(made), 1)
    assert len(calls) == 1


def test_errors_are_as_large_as_the_standard_errors_say() -> None:
    scores = []
    for seed in range(12):
        fitted = fit(samples(noisy(truth("ward", **WARD), seed)), "ward")
        estimates = estimates_of(fitted, profiles=False)
        assert [one.name for one in estimates] == ["alpha_x", "rho_d", "rho_s"]
        for one in estimates:
            assert one.standard_error is not None
            scores.append((one.value - WARD[one.name]) / one.standard_error)
    assert 0.75 < np.std(scores) < 1.33  # of 36 normal numbers, with 98 %; measured 1.1
    assert np.mean(np.abs(scores) < NORMAL_95) >= 0.85


def test_noise_is_measured_and_the_right_model_wins() -> None:
    document, _ = fits(samples(noisy(truth("ward", **WARD))), ["lambert", "beckmann_schlick", "ward", "ggx_schlick"])
    best = document.fits[0]
    assert best.model == "ward"
    assert best.rms_ln == pytest.approx(NOISE, rel=0.1)
    assert best.held_out is not None
    assert best.held_out.rms == pytest.approx(NOISE, rel=0.1)
    assert abs(best.pattern) < 0.2 < 0.8 < document.fits[-1].pattern
    assert best.material is not None
    assert best.recipe is not None


def test_two_widths_need_azimuths_of_the_light() -> None:
    parameters = WARD | {"alpha_y": 0.3}
    found = fit(samples(noisy(truth("ward", turned=True, **parameters)), turned=True), "ward")
    widths = found.surface.numbers(found.point.x)[0]
    assert widths["alpha_x"] == pytest.approx(0.15, rel=0.02)
    assert widths["alpha_y"] == pytest.approx(0.3, rel=0.02)
    tied = fit(samples(noisy(truth("ward", **WARD))), "ward").surface.numbers(found.point.x[:1])[0]
    assert tied["alpha_x"] == tied["alpha_y"]


@pytest.mark.parametrize("phi_i_deg", [(0.0, 0.0), (20.0, 20.0), (0.0, 180.0), (-90.0, 90.0)])
def test_lights_of_one_plane_cannot_tell_an_anisotropic_surface(phi_i_deg: tuple[float, float]) -> None:
    """Half a turn changes no lobe of two widths, so that light from both sides of a plane is one azimuth."""
    theta_i, _, theta_r, turn = directions()
    phi_i = np.deg2rad(np.resize(phi_i_deg, theta_i.size))
    wi, wr = unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_i + turn)
    values = noisy(MODELS["ward"].vectors(wi, wr, **(WARD | {"alpha_y": 0.3}))[:, np.newaxis])
    made = Samples("brushed", theta_i, phi_i, theta_r, phi_i + turn, ("grey",), None, values)
    document, _ = fits(made, ["ward"], profiles=False)
    assert document.remarks == [ONE_AZIMUTH]
    assert "alpha_y" not in {one.name for one in document.fits[0].estimates}
    turned, _ = fits(samples(noisy(truth("ward", turned=True, **WARD)), turned=True), ["ward"], profiles=False)
    assert turned.remarks == []


def test_an_outlier_of_every_fit_does_not_decide_the_ranking() -> None:
    values = noisy(truth("ward", **WARD))
    values[37] = 5e4
    document, fitted = fits(samples(values), ["lambert", "ggx_schlick", "ward"], profiles=False)
    assert fitted[0].surface.numbers(fitted[0].point.x)[0]["alpha_x"] == pytest.approx(0.15, rel=0.01)
    assert document.outliers[0].value == 5e4
    assert (document.outlier_count, document.shared_outlier_count) == (1, 1)
    assert [one.model for one in document.fits] == ["ward", "ggx_schlick", "lambert"]
    best = document.fits[0]
    assert best.held_out is not None
    assert best.held_out.rms == pytest.approx(NOISE, rel=0.1)
    assert best.rms_ln == pytest.approx(NOISE, rel=0.1)


def test_what_no_fit_has_at_many_samples_counts() -> None:
    values = noisy(truth("lambert", rho=0.5))
    values[::20] *= 100.0
    document, _ = fits(samples(values), ["lambert"], profiles=False)
    assert (document.outlier_count, document.shared_outlier_count) == (21, 0)
    assert document.fits[0].held_out is not None
    assert document.fits[0].held_out.rms > 1.0


def test_holes_and_negatives_are_counted() -> None:
    values = noisy(truth("oren_nayar", rho=0.5, sigma=0.6))
    values[3], values[5], values[7] = np.nan, -0.01, 0.0
    document, _ = fits(samples(values), ["oren_nayar"], profiles=False)
    assert (document.left_out.holes, document.left_out.unusable) == (1, 2)
    weighted, _ = fits(samples(values), ["oren_nayar"], residual="cosine", profiles=False)
    assert (weighted.left_out.holes, weighted.left_out.unusable) == (1, 0)
    assert weighted.samples == document.samples + 2


def with_uncertainty(values: Array, uncertainty: Array) -> Samples:
    return replace(samples(values), uncertainty=uncertainty)


def test_a_stated_uncertainty_that_the_residual_does_not_follow_is_remarked() -> None:
    clean = truth("ward", **(WARD | {"rho_d": 0.02}))
    values = clean + 0.003 * np.random.default_rng(0).standard_normal(clean.shape)
    stated = np.full_like(values, 0.003)
    document, _ = fits(with_uncertainty(values, stated), ["ward"], profiles=False)
    _, sentence = document.remarks
    assert "--residual uncertainty" in sentence
    weighted, _ = fits(with_uncertainty(values, stated), ["ward"], residual="uncertainty", profiles=False)
    assert weighted.remarks == [ONE_AZIMUTH]
    diffuse = next(one for one in weighted.fits[0].estimates if one.name == "rho_d")
    assert diffuse.low < 0.02 < diffuse.high
    even, _ = fits(with_uncertainty(noisy(clean), NOISE * clean), ["ward"], profiles=False)
    assert even.remarks == [ONE_AZIMUTH]
    stated[0] = np.nan
    partly, _ = fits(with_uncertainty(values, stated), ["ward"], profiles=False)
    assert partly.remarks == [ONE_AZIMUTH]


@pytest.mark.parametrize("value", [0.03, 0.0])
def test_one_tiny_uncertainty_does_not_capture_a_fit(value: float) -> None:
    values = truth("ward", **WARD) + 0.003 * np.random.default_rng(0).standard_normal((408, 1))
    stated = np.full_like(values, 0.003)
    values[7], stated[7] = value, 1e-12
    document, fitted = fits(with_uncertainty(values, stated), ["ward"], residual="uncertainty", profiles=False)
    assert fitted[0].point.values[:, 0] == pytest.approx([0.2, 0.1], rel=0.02)
    _, sentence = document.remarks
    assert sentence.startswith("1 uncertainty is below 1 % of the median")


def test_only_uncertainties_that_no_noise_explains_are_raised() -> None:
    values = truth("ward", **(WARD | {"rho_d": 1e-4, "alpha_x": 0.05, "alpha_y": 0.05}))
    assert values.max() > 1e4 * values.min()
    for stated in (np.full_like(values, 1e-3), 0.03 * values, 1e-3 * np.sqrt(values)):
        assert Residual(with_uncertainty(values, stated), "uncertainty").raised == 0


def test_uncertainties_that_are_not_known_are_left_out_and_counted() -> None:
    values = noisy(truth("ward", **WARD))
    stated = NOISE * values
    some = with_uncertainty(values, stated)
    some.uncertainty[5:8] = np.nan  # type: ignore[index]
    document, fitted = fits(some, ["ward"], residual="uncertainty", profiles=False)
    assert (document.left_out.unusable, document.samples) == (3, 405)
    assert fitted[0].point.values[:, 0] == pytest.approx([0.2, 0.1], rel=0.02)
    some.uncertainty[:] = np.nan  # type: ignore[index]
    with pytest.raises(ParameterError, match="no value that the residual uncertainty can use"):
        fit(some, "ward", residual="uncertainty")


def test_many_values_left_out_are_remarked_where_an_uncertainty_is_stated() -> None:
    values = noisy(truth("oren_nayar", rho=0.5, sigma=0.6))
    values[::40] = -0.01
    document, _ = fits(with_uncertainty(values, NOISE * np.abs(values)), ["lambert"], profiles=False)
    _, sentence = document.remarks
    assert sentence.startswith("11 values that are not positive are left out")


@pytest.mark.parametrize("residual", ["log", "relative", "cosine"])
def test_every_residual_finds_the_truth(residual: str) -> None:
    found = fit(samples(noisy(truth("oren_nayar", rho=0.5, sigma=0.6))), "oren_nayar", residual=residual)  # type: ignore[arg-type]
    assert found.point.values[0, 0] == pytest.approx(0.5, rel=0.02)


def test_spectra_share_the_shape() -> None:
    at = np.array([450.0, 550.0, 650.0])
    rho_d, rho_s = [0.1, 0.3, 0.6], [0.1, 0.1, 0.2]
    values = np.concatenate(
        [truth("ward", **(WARD | {"rho_d": d, "rho_s": s})) for d, s in zip(rho_d, rho_s, strict=True)], axis=1
    )
    document, fitted = fits(samples(noisy(values), at), ["ward"])
    assert fitted[0].point.values == pytest.approx(np.array([rho_d, rho_s]), rel=0.03)
    assert len(fitted[0].point.x) == 1
    material = document.fits[0].material
    assert material is not None
    assert material.wavelengths_nm == (450.0, 550.0, 650.0)


def test_spectra_of_a_square_are_solved_for() -> None:
    at, rho = np.array([450.0, 650.0]), [0.3, 0.8]
    values = np.concatenate([truth("oren_nayar", rho=one, sigma=0.6) for one in rho], axis=1)
    found = fit(samples(noisy(values), at), "oren_nayar")
    assert found.point.values[0] == pytest.approx(rho, rel=0.02)


def test_sum_of_two_lobes() -> None:
    none = {"rho_d": 0.0}
    values = truth("lambert", rho=0.1) + truth("ward", **(WARD | none))
    values += truth("ward", **(WARD | none | {"alpha_x": 0.5, "alpha_y": 0.5, "rho_s": 0.2}))
    document, fitted = fits(samples(noisy(values)), ["ward", "lambert + 2 ward"])
    assert document.fits[0].model == "lambert + 2 ward"
    widths = sorted(given["alpha_x"] for given in fitted[0].surface.numbers(fitted[0].point.x)[1:])
    assert widths == pytest.approx([0.15, 0.5], rel=0.05)
    assert document.fits[0].recipe is None


def test_light_from_nothing_is_flagged() -> None:
    bright = WARD | {"rho_d": 0.8, "rho_s": 0.6, "alpha_x": 0.2, "alpha_y": 0.2}
    document, _ = fits(samples(noisy(truth("ward", **bright))), ["ward"], profiles=False)
    assert not document.fits[0].albedo.conserves
    assert any("more than arrives" in sentence for sentence in document.fits[0].remarks)


def test_only_the_ratio_of_two_lengths_is_measured() -> None:
    parameters = {"sigma_0_um": 2.0, "tau_um": 12.0, "a": 0.3, "wavelength_nm": 500.0, "n": 1.7, "k": 0.0}
    values = noisy(truth("he_torrance", **parameters))
    document, fitted = fits(
        samples(values, np.array([500.0])), ["he_torrance"], refractive_index="constant/1.7/0.0", profiles=False
    )
    numbers = fitted[0].surface.numbers(fitted[0].point.x)[0]
    assert numbers["sigma_0_um"] / numbers["tau_um"] == pytest.approx(2.0 / 12.0, rel=0.01)
    (pair,) = document.fits[0].correlations
    assert pair.coefficient > 0.99
    assert "only their ratio is measured" in pair.sentence


@pytest.mark.parametrize("size", [1e30, 1e300])
def test_values_that_no_model_reaches_are_refused(size: float) -> None:
    values = size * noisy(truth("ward", **WARD))
    with pytest.raises(ParameterError, match="no model reaches these values"):
        fits(samples(values), ["lambert", "ward", "ggx_schlick"], profiles=False)


def test_values_that_are_too_small_for_numbers_are_refused() -> None:
    values = truth("ward", **WARD)
    with pytest.raises(ParameterError, match=r"allowed; check their unit$"):
        fit(samples(1e-300 * values), "ward")
    values[0] = 1e-300
    with pytest.raises(ParameterError, match=r"f_r of 1e-300 /sr; 1e-100 /sr and more are allowed"):
        fit(samples(values), "ward", residual="relative")


@pytest.mark.parametrize("model", ["lambert", "ward"])
def test_intervals_of_samples_without_noise_are_narrow_and_hold_the_truth(model: str) -> None:
    document, _ = fits(samples(np.full((len(directions()[0]), 1), 0.1)), [model])
    (rho,) = (one for one in document.fits[0].estimates if one.name in ("rho", "rho_d"))
    assert rho.low <= rho.value <= rho.high
    assert rho.value == pytest.approx(0.1 * np.pi, rel=1e-6)
    assert rho.high - rho.low < 1e-6


def test_a_bright_mirror_lobe_and_faint_values_are_not_refused() -> None:
    values = truth("ward", **(WARD | {"rho_d": 0.0, "rho_s": 1.0, "alpha_x": 0.02, "alpha_y": 0.02}))
    for some in (values, 1e-30 * values):
        document, _ = fits(samples(noisy(some)), ["lambert", "ward"], profiles=False)
        assert len(document.fits) == 2


def test_a_slightly_rough_surface_tells_two_lengths_apart() -> None:
    parameters = {"sigma_0_um": 0.05, "tau_um": 1.5, "a": 0.3, "wavelength_nm": 500.0, "n": 1.7, "k": 0.0}
    document, _ = fits(
        samples(noisy(truth("he_torrance", **parameters)), np.array([500.0])),
        ["he_torrance"],
        refractive_index="constant/1.7/0.0",
        profiles=False,
    )
    (best,) = document.fits
    lengths = {one.name: one.value for one in best.estimates}
    assert lengths["sigma_0_um"] == pytest.approx(0.05, rel=0.05)
    assert lengths["tau_um"] == pytest.approx(1.5, rel=0.05)
    assert best.correlations == []
    assert not any("only" in sentence for sentence in best.remarks)


def test_gradient_of_the_projected_problem() -> None:
    made = samples(noisy(truth("ward", **WARD)))
    problem = Problem(
        SearchedSurface("ward", None, 1, turned=False), InstrumentView(made.w_i, made.w_r), Residual(made, "log")
    )
    problem.scale = 0.1
    x, step = np.array([0.8]), 1e-5
    point = problem.at(x)
    weights = 1.0 / np.sqrt(1.0 + (point.residuals / problem.scale) ** 2)
    gradient = np.sum(problem.shape_jacobian(point)[0] * weights * point.residuals)
    expected = (problem.at(x + step).cost - problem.at(x - step).cost) / (2.0 * step)
    assert gradient == pytest.approx(expected, rel=GRADIENT)


def test_what_cannot_be_fitted_is_refused_in_a_sentence() -> None:
    made = samples(noisy(truth("ward", **WARD)))
    with pytest.raises(ParameterError, match="'wrad' is unknown; closest: ward"):
        fit(made, "wrad")
    with pytest.raises(ParameterError, match="neither a model nor a sum"):
        fit(made, "ward + ")
    with pytest.raises(NotDescribedError, match="one azimuth only"):
        fit(made, "oren_nayar_unidirectional")
    with pytest.raises(ParameterError, match="has no uncertainties"):
        fit(made, "ward", residual="uncertainty")
    spectral = samples(np.repeat(made.values, 2, axis=1), np.array([450.0, 650.0]))
    document, _ = fits(spectral, ["ward", "ggx"], profiles=False)
    assert list(document.skipped) == ["ggx"]


def test_an_end_of_an_interval_is_found_along_a_profile_that_is_flat_at_first() -> None:
    def deviation(u: float) -> float:
        return 0.01 * u + 300.0 * max(u - 0.8, 0.0) ** 2

    end = _root(deviation, 0.0, 0.0, 1.0, deviation(1.0))
    assert deviation(end) == pytest.approx(NORMAL_95, rel=0.01)


def test_a_profile_sets_a_limit_at_an_end_of_a_range() -> None:
    document, _ = fits(samples(noisy(truth("ward", **(WARD | {"rho_d": 0.0})))), ["ward"])
    (uniform,) = (one for one in document.fits[0].estimates if one.name == "rho_d")
    assert uniform.low == 0.0 < uniform.high < 1e-3
