"""Maps of the error of models: fits and statistics of known errors, the shipped file, and a sample of it again."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib import resources
from typing import Any

import numpy as np
import pytest

from brdfdb.microgeometry import error_maps
from brdfdb.microgeometry.error_maps import (
    COMPARISONS,
    LIGHTS_DEG,
    MAPPED,
    RHOS,
    SLOPES,
    STEEPEST_DEG,
    VIEWERS,
    FacetKind,
    Floats,
    SurfaceEstimate,
    Task,
    described,
    estimated,
    fitted,
    lights,
    rows,
    traced,
    viewers,
)
from brdfdb.microgeometry.facets import Facets
from brdfdb.microgeometry.goniometer import bounces
from brdfdb.microgeometry.surfaces import MadeSurface
from brdfdb.models import MODELS

FILE = resources.files("brdfdb.microgeometry").joinpath("model_errors.json")
MOST_BYTES = 70_000
# Seeds of the sample differ from those of the file: both are independent
SEEDS = (1_000_000, 1_000_001)


@pytest.fixture(scope="module")
def document() -> dict[str, Any]:
    found: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8"))
    return found


def test_viewers_have_equal_shares_of_the_projected_solid_angle() -> None:
    seen = viewers("diffuse", 0.3)
    assert seen.shape == (len(LIGHTS_DEG), VIEWERS, 3)
    np.testing.assert_allclose(np.linalg.norm(seen, axis=-1), 1.0)
    assert np.all(seen[..., 2] >= np.cos(np.radians(STEEPEST_DEG)))
    # the mean of sin^2(theta) over a disc of the radius sin(80 degrees) is half the square of the radius
    sine2 = np.sin(np.radians(STEEPEST_DEG)) ** 2
    np.testing.assert_allclose(np.mean(1.0 - seen[0, :, 2] ** 2), sine2 / 2.0, rtol=1e-3)
    # azimuths are even over 0 to 180 degrees: the mean of their cosine is 0, that of x^2 is that of y^2
    assert abs(np.mean(seen[0, :, 0])) < 0.02
    np.testing.assert_allclose(np.mean(seen[0, :, 0] ** 2), np.mean(seen[0, :, 1] ** 2), rtol=0.05)


@pytest.mark.parametrize("slope", [0.1, 0.35])
def test_viewers_of_mirrors_are_in_the_lobe(slope: float) -> None:
    seen = viewers("mirror", slope)
    half = seen + lights()[:, np.newaxis]
    tilt = np.hypot(half[..., 0], half[..., 1]) / half[..., 2]
    # a Gaussian of slopes has fallen to a hundredth at sqrt(2 ln 100) standard deviations
    assert np.max(tilt) <= np.sqrt(2.0 * np.log(100.0)) * slope * 1.001
    assert np.quantile(tilt, 0.9) > 1.5 * slope  # and they fill it
    assert seen.shape == (len(LIGHTS_DEG), VIEWERS, 3)


def estimate_of(model: str, facets: Any, slope: float, scale: Floats, **parameters: float) -> SurfaceEstimate:
    """Return an estimate in which rays are a model times factors (3, 1, 1, L) for one, two and all bounces."""
    wi, wr = lights()[:, np.newaxis], viewers(facets, slope)
    f_r = np.asarray(MODELS[model].vectors(wi, wr, **parameters))[..., np.newaxis] * scale
    return SurfaceEstimate(f_r, 0.01 * f_r)


def test_a_fit_finds_the_parameter_and_the_factor_of_a_surface() -> None:
    # Torrance and Sparrow's lobe: sigma and a free factor
    given = {"sigma": 0.31, "n": 1.0, "k": 1e4}
    estimate = estimate_of("torrance_sparrow", "mirror", 0.35, np.full((3, 1, 1, 3), 0.25), **given)
    fit = fitted(COMPARISONS["torrance_sparrow"], 0.35, estimate)
    assert fit.parameters["sigma"] == pytest.approx(0.31, abs=1e-3)
    assert fit.factor == pytest.approx(0.25, rel=2e-3)
    (row,) = rows(COMPARISONS["torrance_sparrow"], 0.35, estimate, fit)
    assert max(row["worst"]) < 0.02
    # Fujii's form: sigma alone
    estimate = estimate_of("oren_nayar_fujii", "diffuse", 0.5, np.ones((3, 1, 1, 4)), rho=1.0, sigma=0.4)
    assert fitted(COMPARISONS["oren_nayar_fujii"], 0.5, estimate).parameters["sigma"] == pytest.approx(0.4, abs=1e-3)


def test_parameters_that_the_surface_gives_are_not_fitted() -> None:
    estimate = estimate_of("beckmann", "mirror", 0.2, np.ones((3, 1, 1, 3)), alpha_x=0.9, alpha_y=0.9, n=1.0, k=1e4)
    fit = fitted(COMPARISONS["beckmann"], 0.2, estimate)
    assert fit.parameters == pytest.approx({"alpha_x": np.sqrt(2.0) * 0.2, "alpha_y": np.sqrt(2.0) * 0.2})
    estimate = estimate_of("lambert", "diffuse", 0.2, np.ones((3, 1, 1, 4)), rho=1.0)
    assert fitted(COMPARISONS["oren_nayar_gaussian"], 0.2, estimate).parameters == {"sigma": 0.2}


def test_rows_state_the_error_of_the_model_with_its_sign() -> None:
    # the rays are a tenth below the model in one bounce, a fifth in two, and a half in all, whatever the albedo
    comparison = COMPARISONS["oren_nayar interreflection=false"]
    scale = np.reshape([0.9, 0.8, 0.5], (3, 1, 1, 1)) * np.array(RHOS)
    given: dict[str, Any] = {"rho": 1.0, "sigma": 0.35, "interreflection": False}
    estimate = estimate_of("oren_nayar", "diffuse", 0.35, scale, **given)
    fit = fitted(comparison, 0.35, estimate)
    (row,) = rows(comparison, 0.35, estimate, fit)
    assert row["rho"] is None
    for name in ("median", "p95", "worst", "towards_light", "forward"):
        assert row[name] == pytest.approx([1.0 / 0.9 - 1.0] * len(LIGHTS_DEG), abs=0.002), name
    assert row["noise"] == pytest.approx([0.01] * len(LIGHTS_DEG), abs=0.001)
    others = rows(replace(comparison, bounces="all", by_rho=True), 0.35, estimate, fit)
    assert [row["rho"] for row in others] == list(MAPPED)
    for row in others:
        assert row["median"] == pytest.approx([1.0] * len(LIGHTS_DEG), rel=1e-6)


def test_statistics_are_those_of_the_viewers() -> None:
    # errors from 0 to 100 %, a step a viewer
    steps = np.linspace(0.0, 1.0, VIEWERS)[:, np.newaxis]
    estimate = estimate_of("lambert", "diffuse", 0.2, np.ones((3, 1, 1, 4)) * np.array(RHOS), rho=1.0)
    estimate = SurfaceEstimate(estimate.f_r / (1.0 + steps), estimate.error)
    row = rows(COMPARISONS["lambert"], 0.2, estimate, fitted(COMPARISONS["lambert"], 0.2, estimate))[0]
    for name, expected in (("median", 0.5), ("p95", 0.95), ("worst", 1.0)):
        assert row[name] == pytest.approx([expected] * len(LIGHTS_DEG), abs=0.01), name


def test_signed_errors_are_those_of_their_half_planes() -> None:
    # rays with more light where the azimuth is that of the light: x > 0
    estimate = estimate_of("lambert", "diffuse", 0.35, np.ones((3, 1, 1, 4)) * np.array(RHOS), rho=1.0)
    more = 1.0 + 0.5 * (viewers("diffuse", 0.35)[..., 0] > 0.0)
    estimate = SurfaceEstimate(estimate.f_r * more[..., np.newaxis], estimate.error)
    row = rows(COMPARISONS["lambert"], 0.35, estimate, fitted(COMPARISONS["lambert"], 0.35, estimate))[0]
    assert row["towards_light"] == pytest.approx([1.0 / 1.5 - 1.0] * len(LIGHTS_DEG), abs=0.005)
    assert row["forward"] == pytest.approx([0.0] * len(LIGHTS_DEG), abs=1e-9)


def test_standard_errors_are_those_of_means() -> None:
    rng = np.random.default_rng(5)
    estimate = estimated([rng.normal(2.0, 0.4, (3, 6, 20, 4)) for _ in range(25)])
    assert estimate.f_r.shape == (3, 6, 20, 4)
    # 1440 errors of which each is 0.4 / 5 with 14 %
    assert float(np.mean(estimate.error)) == pytest.approx(0.08, rel=0.02)


def test_the_shipped_file_is_complete(document: dict[str, Any]) -> None:
    assert len(FILE.read_bytes()) < MOST_BYTES
    assert document["version"] == error_maps.VERSION
    assert tuple(document["lights_deg"]) == LIGHTS_DEG
    assert set(document["models"]) == set(COMPARISONS)
    made = document["provenance"]
    assert {"brdfdb", "embreex", "realisations", "seeds", "rays", "standard_error"} <= set(made)
    for name, entry in document["models"].items():
        comparison = COMPARISONS[name]
        assert (entry["model"], entry["bounces"]) == (comparison.model, comparison.bounces)
        assert (entry["arguments"], entry["words"]) == (dict(comparison.arguments), described(comparison))
        assert entry.get("only_fit", False) is comparison.only_fit
        rhos = MAPPED if comparison.by_rho else (None,)
        known = [(row["slope"], row["rho"]) for row in entry["rows"] if row["slope"] > 0.0]
        assert known == [(slope, rho) for slope in SLOPES for rho in rhos], name
        for row in entry["rows"]:
            for value in (row["parameters"][parameter] for parameter in comparison.parameters):
                if comparison.per_slope is None:
                    assert value == 0.0 or comparison.bounds[0] <= value <= comparison.bounds[1]
                else:
                    assert value == pytest.approx(comparison.per_slope * row["slope"], rel=5e-4)  # four digits
            for statistic in ("median", "p95", "worst", "towards_light", "forward", "noise"):
                assert len(row[statistic]) == len(LIGHTS_DEG)
            assert all(a <= b <= c for a, b, c in zip(row["median"], row["p95"], row["worst"], strict=True))
            # noise is well below what tells models apart
            assert max(row["noise"]) <= 0.03, (name, row["slope"])


def test_a_task_gives_the_sums_of_one_two_and_all_bounces() -> None:
    surface, seen = MadeSurface("gaussian", 0.5).draw(3), viewers("diffuse", 0.5)[0]
    options: Any = {"rays": 256, "seed": 3, "turned": True, "gaussian_slopes": (0.5, 0.5)}
    alone = bounces(surface, Facets(rho=0.9), lights(), seen, **options)
    sums = traced(Task("diffuse", 0.5, 3), 256)[..., RHOS.index(0.9)]
    np.testing.assert_allclose(sums[0], alone.one[..., 0], rtol=1e-9)
    np.testing.assert_allclose(sums[1], (alone.one + alone.two)[..., 0], rtol=1e-9)
    np.testing.assert_allclose(sums[2], alone.total[..., 0], rtol=1e-9)


@pytest.mark.parametrize(("kind", "telling"), [("diffuse", 8), ("mirror", 2)])
def test_other_surfaces_give_the_errors_of_the_file(kind: FacetKind, telling: int, document: dict[str, Any]) -> None:
    slope = 0.5
    estimate = estimated([traced(Task(kind, slope, seed), 16384) for seed in SEEDS])
    noisier = np.sqrt(1.0 + document["provenance"]["realisations"] / len(SEEDS))  # a difference, than the file
    told = set()  # models whose errors exceed the noise of two surfaces by far
    for name in (name for name, comparison in COMPARISONS.items() if comparison.facets == kind):
        again = rows(COMPARISONS[name], slope, estimate, fitted(COMPARISONS[name], slope, estimate))
        shipped = [row for row in document["models"][name]["rows"] if row["slope"] == slope]
        for new, old in zip(again, shipped, strict=True):
            assert new["rho"] == old["rho"]
            assert new["parameters"] == pytest.approx(old["parameters"], rel=0.05)
            median = np.array(old["median"])
            # Viewers share their surfaces, so that the median of their errors has the noise of one. Both are rounded
            allowed = 3.0 * noisier * np.array(old["noise"]) + np.where(median < 0.1, 0.001, 0.01)
            assert np.all(np.abs(new["median"] - median) <= allowed), (name, old["rho"])
            if np.any(allowed < 0.25 * median):
                told.add(name)
    assert len(told) == telling
