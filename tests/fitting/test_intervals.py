"""Intervals where noise is not independent and in proportion to f_r, and proposals of nuisance numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binom

from brdfdb.errors import ParameterError
from brdfdb.fitting.estimates import estimates_of
from brdfdb.fitting.fit import fit, fits
from brdfdb.fitting.judgement import FALSE_POSITIVES, correlation_test, groups_of, judged, nuisance_test, with_nuisance
from brdfdb.fitting.nuisance import NUISANCE, Nuisance, kinds_of
from brdfdb.fitting.residuals import Residual, noise_floor
from brdfdb.fitting.search import refitted
from brdfdb.fitting.uncertainty import spread_of
from brdfdb.geometry import unit_vector
from brdfdb.measurements import Instrument, Samples
from brdfdb.measurements.aperture import InstrumentView
from brdfdb.measurements.conventions import NODES
from brdfdb.models import MODELS

Array = NDArray[np.float64]

TRUTH = {"rho_d": 0.2, "rho_s": 0.1, "alpha_x": 0.15, "alpha_y": 0.15}
NOISE = 0.03
LIGHTS = [10.0, 25.0, 40.0, 50.0, 65.0]


def directions() -> tuple[Array, Array, Array, Array]:
    """Return directions of five lights, one after the other."""
    axes = np.meshgrid(LIGHTS, np.arange(0.0, 76.0, 5.0), [0.0, 60.0, 120.0, 170.0, 180.0, 190.0, 300.0], indexing="ij")
    theta_i, theta_r, turn = np.deg2rad([axis.ravel() for axis in axes])
    return theta_i, np.zeros_like(theta_i), theta_r, turn


def clean(tilt_x_deg: float = 0.0) -> Array:
    """Return f_r (N,) of a surface whose normal is tilted about the x axis."""
    theta_i, phi_i, theta_r, phi_r = directions()
    wi, wr = unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r)
    c, s = np.cos(np.deg2rad(tilt_x_deg)), np.sin(np.deg2rad(tilt_x_deg))
    matrix = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    return np.asarray(MODELS["ward"].vectors(wi @ matrix.T, wr @ matrix.T, **TRUTH))


def noisy(values: Array, seed: int) -> Array:
    return values * (1.0 + NOISE * np.random.default_rng(seed).standard_normal(values.shape))


def samples(values: Array) -> Samples:
    return Samples("made", *directions(), ("grey",), None, values[:, np.newaxis])


def values_of(made: Samples, *nuisance: str) -> dict[str, float]:
    fitted = fit(made, "ward", nuisance=nuisance)  # type: ignore[arg-type]
    return fitted.nuisance.values(fitted.point.nuisance)


def test_a_tilt_is_proposed_and_found() -> None:
    made = samples(noisy(clean(0.5), 1))
    document, _ = fits(made, ["ward"])
    assert document.fits[0].proposed == ["tilt"]
    (sentence,) = (one for one in document.fits[0].remarks if "--nuisance tilt" in one)
    assert "the pattern of a tilt of the sample" in sentence
    followed, _ = fits(made, ["ward"], nuisance=["tilt"])
    best = followed.fits[0]
    assert followed.nuisance == ["tilt"]
    assert best.proposed == []
    x, y = best.nuisance
    assert (x.name, x.unit, y.name) == ("tilt about x", "degree", "tilt about y")
    assert x.low < 0.5 < x.high
    assert y.low < 0.0 < y.high
    assert x.high - x.low < 0.2
    for plain, one in zip(document.fits[0].estimates, best.estimates, strict=True):
        assert one.low < TRUTH[one.name] < one.high
        assert plain.low <= one.low < one.high <= plain.high  # until the tilt is fitted


def test_a_drift_is_proposed_where_the_order_is_kept() -> None:
    course = 1.0 - 0.08 * np.linspace(0.0, 1.0, clean().size)
    made = samples(noisy(clean() * course, 2))
    document, _ = fits(made, ["ward"])
    assert document.fits[0].proposed == ["drift"]
    assert any(
        "If the rows are in the order of measurement, --nuisance drift" in one for one in document.fits[0].remarks
    )
    assert values_of(made, "drift")["drift"] == pytest.approx(-0.08, abs=0.015)
    grid = replace(made, record={NODES: True})
    assert "drift" not in fits(grid, ["ward"])[0].fits[0].proposed
    with pytest.raises(ParameterError, match="in no order of measurement; leave drift out"):
        fit(grid, "ward", nuisance=["drift"])


def test_the_interval_of_a_drift_reaches_from_the_first_calibration_to_the_last() -> None:
    """Who calibrates at the end measures rho_d / (1 - 0.08) of who calibrates at the beginning."""
    course = 1.0 - 0.08 * np.linspace(0.0, 1.0, clean().size)
    document, _ = fits(samples(noisy(clean() * course, 3)), ["ward"], nuisance=["drift"])
    (diffuse,) = (one for one in document.fits[0].estimates if one.name == "rho_d")
    assert diffuse.low < 0.2 * (1.0 - 0.08)
    assert diffuse.high > 0.2


def test_a_dark_level_is_proposed_and_found() -> None:
    level = 0.002
    made = samples(noisy(clean(), 4) + level / np.cos(directions()[2]))
    document, _ = fits(made, ["ward"])
    assert document.fits[0].proposed == ["dark"]
    followed, _ = fits(made, ["ward"], nuisance=["dark"])
    (dark,) = followed.fits[0].nuisance
    assert dark.unit == "1/sr"
    assert dark.low < level < dark.high
    assert dark.high - dark.low < level


def test_independent_noise_shows_nuisance_numbers_as_seldom_as_stated() -> None:
    """So are correlated residuals, in one of ten files."""
    seen = correlated = 0
    for seed in range(14):
        fitted = fit(samples(noisy(clean(), 100 + seed)), "ward")
        seen += sum(nuisance_test(fitted, kind).independent < FALSE_POSITIVES for kind in NUISANCE)
        correlated += correlation_test(fitted).correlated
    assert seen <= binom.ppf(0.995, 42, FALSE_POSITIVES)
    assert correlated <= binom.ppf(0.995, 14, 0.1)


def test_gains_of_incidences_widen_intervals_and_are_no_drift() -> None:
    lights = np.repeat(np.arange(len(LIGHTS)), clean().size // len(LIGHTS))
    inside, blamed, ratio = 0, 0, []
    for seed in range(10):
        gain = 1.0 + 0.03 * np.random.default_rng(200 + seed).standard_normal(len(LIGHTS))
        fitted = fit(samples(noisy(clean() * gain[lights], 300 + seed)), "ward")
        judgement = judged(fitted)
        for wide, one in zip(judgement.estimates, estimates_of(fitted, profiles=False), strict=True):
            inside += wide.low < TRUTH[wide.name] < wide.high
            ratio.append((wide.high - wide.low) / (one.high - one.low))
        assert "incidences left out in turn" in judgement.sentences[0]
        assert {one.method for one in judgement.estimates} & {"incidences", "several fits"}
        blamed += any("The model does not describe" in one for one in judgement.sentences)
    assert inside >= binom.ppf(0.005, 30, 0.9)
    assert np.median(ratio) > 3.0
    assert blamed <= binom.ppf(0.995, 10, 0.05)


def test_the_linear_jackknife_is_that_of_fits_without_each_incidence() -> None:
    gain = 1.0 + 0.03 * np.random.default_rng(5).standard_normal(len(LIGHTS))
    made = samples(noisy(clean() * np.repeat(gain, clean().size // len(LIGHTS)), 6))
    fitted = fit(made, "ward", residual="log")
    groups = groups_of(fitted)
    assert np.unique(groups).size == len(LIGHTS)
    spread = spread_of(fitted.problem, fitted.point, groups)
    found = []
    for group in range(len(LIGHTS)):
        part = refitted(replace(fitted, samples=made.selected(groups != group), hidden=fitted.hidden[groups != group]),
                        Residual(made.selected(groups != group), "log"))  # fmt: skip
        found.append([part.point.x[0], *part.point.values[:, 0]])
    moved = np.array(found) - [fitted.point.x[0], *fitted.point.values[:, 0]]
    expected = 0.8 * np.sum(moved**2, axis=0)  # (K - 1) / K
    assert [spread.resampled[0, 0], *spread.coefficients[:, 0]] == pytest.approx(expected, rel=0.15)


def test_random_signs_tell_the_residuals_of_a_wrong_model_from_noise() -> None:
    wrong = correlation_test(fit(samples(noisy(clean(), 7)), "lambert"))
    assert wrong.by_neighbour < 0.01


def test_a_floor_of_the_noise_is_found_and_negative_values_count() -> None:
    proportional, additive = 0.02, 0.012
    rng = np.random.default_rng(8)
    f_r = clean()
    values = f_r + np.hypot(proportional * f_r, additive) * rng.standard_normal(f_r.size)
    values[3] = 5.0  # one wrong value changes little
    found = noise_floor(samples(values), f_r[:, np.newaxis], (values > 0.0)[:, np.newaxis])
    assert found is not None
    assert 0.4 < found.level * proportional / additive < 2.5
    none = noise_floor(samples(noisy(f_r, 9)), f_r[:, np.newaxis], np.ones((f_r.size, 1), dtype=bool))
    assert none is None
    dim = 0.05 * f_r
    dark = dim + additive * rng.standard_normal(f_r.size)
    document, _ = fits(samples(dark), ["ward"])
    assert np.sum(dark <= 0.0) > 20
    best = document.fits[0]
    assert best.noise_floor is not None
    truth = {"rho_d": 0.01, "rho_s": 0.005, "alpha_x": 0.15}
    assert all(one.low < truth[one.name] < one.high for one in best.estimates)


def test_a_log_residual_of_mean_free_noise_has_no_bias() -> None:
    """The mean of ln(1 + e) is -s^2 / 2: 0.5 % for 10 % of noise, where the standard error is 0.3 %."""
    scores = []
    for seed in range(6):
        values = clean() * (1.0 + 0.1 * np.random.default_rng(400 + seed).standard_normal(clean().size))
        of_kinds = []
        for kind in ("noise", "log"):
            fitted = fit(samples(values), "ward", residual=kind)  # type: ignore[arg-type]
            of_kinds.append(fitted.point.values[0, 0] / TRUTH["rho_d"] - 1.0)
        scores.append(of_kinds)
    unbiased, biased = np.mean(scores, axis=0)
    assert abs(unbiased) < 0.003
    assert unbiased - biased == pytest.approx(0.005, rel=0.2)


def test_a_tail_that_no_model_follows_does_not_decide_the_fit() -> None:
    """A lobe that ends at its steepest facets, as those of height maps do."""
    theta_i, phi_i, theta_r, phi_r = directions()
    wi, wr = unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r)
    half = wi + wr
    slope = np.hypot(half[:, 0], half[:, 1]) / half[:, 2]
    lobe = MODELS["ward"].vectors(wi, wr, **(TRUTH | {"rho_d": 0.0}))
    values = noisy(np.where(slope < 0.35, lobe, 1e-11), 10)
    alphas = {}
    for kind in ("noise", "log"):
        (best,) = fits(samples(values), ["ward"], residual=kind)[0].fits  # type: ignore[arg-type]
        alphas[kind] = best.estimates[0]
    assert alphas["noise"].value == pytest.approx(0.15, rel=0.03)
    assert abs(alphas["log"].value - 0.15) > 0.02  # this one doubts itself
    assert alphas["log"].low < 0.15 < alphas["log"].high


def test_intervals_of_a_wrong_model_reach_over_other_residuals() -> None:
    theta_i, phi_i, theta_r, phi_r = directions()
    wi, wr = unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r)
    given = {"rho_d": 0.02, "f_0": 0.05, "alpha_x": 0.3, "alpha_y": 0.3}
    values = noisy(MODELS["ggx_schlick"].vectors(wi, wr, **given), 11)
    wide = fits(samples(values), ["ward"], residual="log")[0].fits[0]
    assert any(one.startswith("The model does not describe the samples") for one in wide.remarks)
    other = fits(samples(values), ["ward"], residual="cosine", profiles=False)[0].fits[0]
    for one, there in zip(wide.estimates, other.estimates, strict=True):
        assert one.low <= there.value <= one.high


def test_unknown_nuisance_numbers_are_refused() -> None:
    assert kinds_of(["dark", "tilt", "dark"]) == ("tilt", "dark")
    with pytest.raises(ParameterError, match="'lamp' is not one of tilt, drift, dark"):
        kinds_of(["lamp"])


def test_nuisance_numbers_disturb_readings_as_they_say() -> None:
    made = samples(clean())
    nuisance = Nuisance.of(made, NUISANCE)
    u = np.full(len(nuisance), 0.5)
    view = InstrumentView(made.w_i, made.w_r)
    assert np.all(nuisance.gain(u, view) == 1.0)
    assert np.all(nuisance.offset(u) == 0.0)
    names = [one.name for one in nuisance.numbers]
    u[names.index("tilt about x")] += 0.5 * 0.5 / 5.0  # half a degree
    tilted = nuisance.view(view, u)
    f_r = MODELS["ward"].vectors(tilted.w_i, tilted.w_r, **TRUTH)
    assert f_r == pytest.approx(clean(0.5), rel=1e-12)


def test_two_apertures_of_a_narrow_lobe_widen_its_intervals() -> None:
    narrow = replace(samples(clean()), instrument=Instrument(source_solid_angle_sr=2e-2, receiver_solid_angle_sr=2e-2))
    fitted = fit(narrow, "ward")
    judgement = judged(fitted)
    assert any("one disk stands for the apertures of light and receiver" in one for one in judgement.sentences)
    variance = 0.25 * fitted.view.half_angle**2
    (alpha,) = (one for one in judgement.estimates if one.name == "alpha_x")
    reach = alpha.value * 0.5 * (variance / (2.0 * alpha.value**2)) ** 2
    assert alpha.high - alpha.value >= 0.99 * reach


def test_a_gain_that_rises_towards_grazing_is_not_called_a_dark_level() -> None:
    """No kind is the true one: intervals are not worse where the wrong one is fitted."""
    gain = 1.0 + 0.08 * (1.0 - np.cos(directions()[2]))
    for seed in range(2):
        fitted = fit(samples(noisy(clean() * gain, 500 + seed)), "ward")
        plain = judged(fitted)
        assert plain.proposed == []
        assert any(one.startswith("A gain that changes with theta_r explains") for one in plain.sentences)
        wrong = judged(with_nuisance(fitted, ["dark"]))
        for before, after in zip(plain.estimates, wrong.estimates, strict=True):
            assert after.low <= TRUTH[before.name] <= after.high
            assert before.low <= TRUTH[before.name] <= before.high


def test_a_level_that_is_the_same_everywhere_is_said_not_to_be_told_from_a_uniform_f_r() -> None:
    fitted = fit(samples(noisy(clean(), 12) + 0.02), "ward")
    said = "such as stray light, cannot be told from rho_d"
    assert any(f"{said}: intervals do not reach over it" in one for one in judged(fitted).sentences)
    asked = judged(with_nuisance(fitted, ["dark"]))
    assert any(f"{said}, and no other dark level is seen" in one for one in asked.sentences)
    (diffuse,) = (one for one in asked.estimates if one.name == "rho_d")
    assert (diffuse.low, diffuse.high) == (0.0, 1.0)
    (width,) = (one for one in asked.estimates if one.name == "alpha_x")
    assert width.low < 0.15 < width.high < 0.16
