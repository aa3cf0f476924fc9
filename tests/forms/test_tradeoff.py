"""Charts: errors, costs and fronts of the forms of a material, or along a family, in one document."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom

from brdfdb.forms import catalogue, timing
from brdfdb.forms import tradeoff as charting
from brdfdb.forms.catalogue import Kind
from brdfdb.forms.tradeoff import STEPS, Chart, FamilyChart, chart, chart_family, ranks
from brdfdb.geometry import unit_vector
from brdfdb.materials import FunctionSource, Material, presets
from brdfdb.store.family import Sweep
from brdfdb.tables.error_measurement import RandomPairs, draw, mean_error
from brdfdb.tables.places import BANDS_DEG


@pytest.fixture(scope="module")
def brass() -> Chart:
    return chart(presets()["rolled-brass"], None, (0.1,))


def test_a_chart_has_every_form_with_the_truth_at_no_error(brass: Chart) -> None:
    forms = catalogue.forms(presets()["rolled-brass"], None, (0.1,))
    assert [point.key for point in brass.points] == [form.key for form in forms]
    truth, *others = brass.points
    assert brass.truth == truth.key == "elliptical"
    assert (truth.l1, truth.p99, truth.forward, truth.back, truth.grazing) == (0.0,) * 5
    for point in others:
        assert point.l1 > 0.0, point.key
        assert point.p99_high is not None, point.key
        assert 0.0 < point.p99_low <= point.p99 <= point.p99_high, point.key


def test_every_form_is_timed_at_three_sizes_of_call_and_with_many_materials_in_turn(brass: Chart) -> None:
    for point in brass.points:
        for each in (point.batch, point.single):
            assert 0.0 < each.low <= each.ns <= each.high
        assert (point.batch.directions, point.block.directions, point.single.directions) == (timing.BATCH, 256, 1)
        assert point.mixed.directions == timing.FEW
        assert point.batch.ns < point.block.ns < point.single.ns
        assert point.batch.ns < point.mixed.ns


def test_fronts_begin_with_the_truth_and_get_less_accurate(brass: Chart) -> None:
    points = {point.key: point for point in brass.points}
    fronts = (brass.fronts.batch, brass.fronts.single, brass.fronts.bytes)
    for front in fronts:
        assert front[0] == brass.truth
        errors = [points[key].l1 for key in front]
        assert errors == sorted(errors)
    # nothing takes fewer bytes than a model and is of use: Lambert's is further off than black
    assert brass.fronts.bytes == ["elliptical"]
    assert points["lambert"].bytes < brass.points[0].bytes
    assert points["lambert"].l1 > 1.0
    # models that are meant to differ are on no front
    others = {point.key for point in brass.points if point.kind == "other model"}
    assert others == {"ward-duer", "ward-bounded"}
    assert others.isdisjoint(itertools.chain(*fronts))


def test_errors_are_the_same_in_every_run(brass: Chart, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(timing, "ROUNDS", 1)
    monkeypatch.setattr(charting, "SINGLES", 1)
    again = chart(presets()["rolled-brass"], None, (0.1,))
    timed = {"batch", "block", "single", "mixed", "rung", "saving"}
    assert [p.model_dump(exclude=timed) for p in again.points] == [p.model_dump(exclude=timed) for p in brass.points]
    noises = [[(s.albedo.variance, s.sphere.variance) for s in each.samplers] for each in (again, brass)]
    assert noises[0] == noises[1]


def test_more_forms_can_be_charted_and_steps_are_counted() -> None:
    material, ticks = presets()["scene-plastic-cube"], []
    also = [form for form in catalogue.forms(presets()["rolled-brass"], None, ()) if form.key == "lambert"]
    found = chart(material, np.array([550.0]), (), also=also, tick=lambda: ticks.append(None))
    assert [point.key for point in found.points] == ["sum", "sum-float32", "lambert"]
    assert len(ticks) == STEPS


def test_the_ladder_leads_from_the_truth_to_its_coarsest_rung() -> None:
    found = chart(presets()["magnesium-oxide-ceramic"], np.array([500.0]), ())
    points = {point.key: point for point in found.points}
    assert found.ladder[0] == found.truth
    assert {*found.ladder} == {key for key, p in points.items() if p.kind in ("exact", "quadrature")} - {"sum-float32"}
    assert [points[key].l1 for key in found.ladder] == sorted(points[key].l1 for key in found.ladder)
    costs = [points[key].batch.ns for key in found.ladder]
    assert costs[0] == max(costs)


KINDS: tuple[Kind, ...] = ("exact", "quadrature", "quadrature", "table")


def test_a_form_is_compared_with_the_cheapest_rung_that_is_as_accurate() -> None:
    rungs = [{"l1": 0.0, "p99": 0.0}, {"l1": 0.01, "p99": 0.1}, {"l1": 0.02, "p99": 0.2}]
    form = {"l1": 0.015, "p99": 0.5}  # the last rung is less accurate in the mean
    forms = catalogue.forms(presets()["rolled-brass"], None, ())[:4]
    forms = [replace(each, kind=kind) for each, kind in zip(forms, KINDS, strict=True)]
    seconds = np.array([[100.0, 50.0, 10.0, 5.0], [200.0, 120.0, 20.0, 10.0], [100.0, 50.0, 10.0, 5.0]])
    found = charting._against(3, [0, 1, 2], [*rungs, form], seconds, forms)
    assert found["rung"] == forms[1].key
    assert found["saving"].model_dump() == {"low": 10.0, "times": 10.0, "high": 11.0}
    assert charting._against(1, [0, 1, 2], [*rungs, form], seconds, forms) == {"rung": None, "saving": None}


@pytest.mark.parametrize("count", [60, 500, 9000])
def test_ranks_enclose_the_quantile_with_the_confidence_of_the_binomial_law(count: int) -> None:
    low, high = ranks(count, 0.99, 0.95)
    below = binom(count, 0.99)  # how many draws are below the quantile; that of rank r is above it if fewer than r are
    assert below.cdf(low - 1) <= 0.025 < below.cdf(low)
    if high <= count:
        assert below.cdf(high - 1) >= 0.975 > below.cdf(high - 2)
    else:
        assert count == 60  # too few to give an upper bound


def test_the_interval_of_p99_holds_it_for_95_of_100_draws_and_is_that_of_the_worst_wavelength() -> None:
    errors = np.random.default_rng(6).exponential(size=(1000, 1))
    assert charting._tail(np.hstack([errors, 3.0 * errors])) == charting._tail(3.0 * errors)
    rng = np.random.default_rng(5)
    inside = 0
    for _ in range(400):
        low, high = charting._tail(rng.exponential(size=(1000, 1)))
        assert high is not None
        inside += low <= np.log(100.0) <= high  # the 99th percentile of the exponential law
    assert inside >= 368  # of a binomial law of 0.95, fewer has a probability of 0.4 %


def test_samplers_of_a_chart_are_those_of_the_model(brass: Chart) -> None:
    samplers = {sampler.key: sampler for sampler in brass.samplers}
    assert set(samplers) == {"model", "cosine", "uniform"}
    own = samplers["model"]
    for other in ("cosine", "uniform"):  # of a lobe that is 0.05 and 0.16 wide
        assert own.albedo.variance < 0.05 * samplers[other].albedo.variance
        assert own.sphere.ms < 0.5 * samplers[other].sphere.ms


def test_classes_are_told_by_azimuth_and_grazing() -> None:
    theta_i, theta_r = np.deg2rad([30.0, 30.0, 30.0, 80.0, 10.0]), np.deg2rad([30.0, 30.0, 30.0, 10.0, 74.0])
    wi, wr = unit_vector(theta_i, 0.4), unit_vector(theta_r, 0.4 + np.deg2rad([180.0, 20.0, 90.0, 136.0, 44.0]))
    drawn = RandomPairs(
        wi, wr, np.zeros(5, dtype=np.int64), np.ones(5), np.zeros(5, dtype=bool), np.ones(5, dtype=bool)
    )
    found = {name: rows.tolist() for name, rows in drawn.classes().items()}
    assert found == {
        "forward": [True, False, False, True, False],
        "back": [False, True, False, False, True],
        "grazing": [False, False, False, True, False],
    }


def test_the_mean_error_is_that_of_the_weighted_light() -> None:
    truth, found = np.array([[1.0, 0.0], [3.0, 0.0]]), np.array([[1.5, 0.0], [2.0, 0.0]])
    np.testing.assert_allclose(mean_error(found, truth, np.array([1.0, 1.0])), [1.5 / 4.0, 0.0])
    np.testing.assert_allclose(mean_error(found, truth, np.array([[1.0, 0.0], [0.0, 2.0]]))[:, 0], [0.5, 1.0 / 3.0])


def test_a_draw_has_viewers_of_every_class() -> None:
    drawn = draw(presets()["wall-plaster"], None, 50, 1)
    assert all(rows.sum() > (BANDS_DEG.size - 1) for rows in drawn.classes().values())


SIGMA_0_UM = (0.03, 0.06, 0.09, 0.12, 0.17, 0.24, 0.6, 1.2)  # at 550 nm g is 0.5 to 750


def copper(sigma_0_um: float) -> Material:
    optical = {"model": "he_torrance", "source": "a sweep", "refractive_index": "main/Cu/Johnson"}
    table = {"title": "Copper", "parameters": {"sigma_0_um": sigma_0_um, "tau_um": 4.0}, **optical}
    return Material.from_table(f"copper-{round(1000.0 * sigma_0_um):04d}", table)


def sweep_of(materials: list[Material]) -> Sweep:
    names = [material.name for material in materials]
    heights = [float(material.parameters["sigma_0_um"]) for material in materials]
    digests = [""] * len(names)
    axes = {"sigma_0_um": heights}
    return Sweep(name="m", title="m", model="he_torrance", axes=axes, members=names, request_sha256=digests)


def chart_quickly(patched: pytest.MonkeyPatch) -> None:
    """Take few directions and one round: enough to tell errors that differ by factors."""
    patched.setattr(charting, "DIRECTIONS", 200)
    patched.setattr(charting, "SINGLES", 1)
    patched.setattr(timing, "ROUNDS", 1)


@pytest.fixture(scope="module")
def coppers() -> FamilyChart:
    materials = [copper(value) for value in SIGMA_0_UM]
    with pytest.MonkeyPatch.context() as patched:
        chart_quickly(patched)
        return chart_family(sweep_of(materials), materials, np.array([550.0]), ())


def test_a_family_has_every_form_with_an_error_at_every_member(coppers: FamilyChart) -> None:
    forms = catalogue.forms(copper(SIGMA_0_UM[0]), np.array([550.0]), ())
    assert [curve.key for curve in coppers.curves] == [form.key for form in forms]
    assert coppers.members == [copper(value).name for value in SIGMA_0_UM]
    for curve in coppers.curves:
        assert len(curve.l1) == len(curve.p99) == len(coppers.fronts) == len(SIGMA_0_UM)
        assert None not in (*curve.l1, *curve.p99)
        assert curve.timed == coppers.members[len(SIGMA_0_UM) // 2]
    assert coppers.curves[0].l1 == [0.0] * len(SIGMA_0_UM)
    assert all(front[0] == coppers.truth == "sum" for front in coppers.fronts)
    assert coppers.between is None
    errors = {curve.key: np.array(curve.l1, dtype=float) for curve in coppers.curves}
    assert np.all(np.diff(errors["ten-terms"]) > 0.0)  # better for small g
    assert np.all(np.diff(errors["beckmann"]) < 0.0)  # better for large g


def test_the_g_of_a_family_is_that_of_eq_79_along_the_normal(coppers: FamilyChart) -> None:
    # Eq. (79) with both cosines 1 and sigma = sigma_0: nothing is hidden along the normal
    expected = [(2.0 * np.pi * value / 0.55 * 2.0) ** 2 for value in SIGMA_0_UM]
    assert coppers.diagnostic is not None
    assert (coppers.diagnostic.symbol, coppers.diagnostic.title) == ("g", "g along the normal, eq. 79")
    np.testing.assert_allclose(coppers.diagnostic.values, expected, rtol=5e-3)  # three digits


def test_a_function_is_charted_by_itself_and_its_tables() -> None:
    def half_lambert(wi: Any, wr: Any, _: Any) -> Any:
        return np.full(len(wi), 0.5 / np.pi) + 0.0 * wr[:, 2]

    source = FunctionSource(brdf=half_lambert, name="half", title="Half of Lambert", provenance="a test")
    found = chart(source, None, (0.1,))
    assert (found.material, found.model, found.parameters) == ("half", "function", {})
    assert [point.key for point in found.points] == ["function", "table-10", "table-even", "table-halves"]
    assert found.truth == "function"
    assert max(point.l1 for point in found.points) < 1e-6
    (own,) = [sampler for sampler in found.samplers if sampler.key == "model"]
    assert own.albedo.variance < 1e-20  # the cosine draws it exactly


def test_errors_of_a_member_are_those_of_its_chart(coppers: FamilyChart, monkeypatch: pytest.MonkeyPatch) -> None:
    chart_quickly(monkeypatch)
    alone = chart(copper(SIGMA_0_UM[2]), np.array([550.0]), ())
    assert [(p.key, p.l1, p.p99) for p in alone.points] == [(c.key, c.l1[2], c.p99[2]) for c in coppers.curves]


def test_a_form_that_some_members_lack_is_timed_where_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    chart_quickly(monkeypatch)
    materials = [copper(0.1), copper(0.0)]  # a mirror has no sum to shorten
    names = [material.name for material in materials]
    ticks: list[None] = []
    found = chart_family(sweep_of(materials), materials, np.array([550.0]), (), tick=lambda: ticks.append(None))
    curves = {curve.key: curve for curve in found.curves}
    assert curves["sum"].timed == names[1]
    assert curves["ten-terms"].timed == names[0]
    assert curves["ten-terms"].l1[1] is None
    assert "ten-terms" not in found.fronts[1]
    assert len(ticks) == len(materials) + timing.ROUNDS + 2 * charting.SINGLES


def test_the_surface_is_that_of_the_exact_form() -> None:
    vase = presets()["clay-vase"]
    exact = charting._truth(vase, catalogue.forms(vase, None, ())[0])
    assert exact is not None
    assert (vase.model, exact.model) == ("oren_nayar", "oren_nayar_gaussian")
    foam = presets()["foam"]  # the exact form of its body is no model of the registry
    assert charting._truth(foam, catalogue.forms(foam, None, ())[0]) is None
