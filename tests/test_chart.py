"""Charts: errors, costs and fronts of a material's representations in one document."""

from __future__ import annotations

import numpy as np
import pytest

from brdfdb import chart as charting
from brdfdb import cost
from brdfdb.accuracy import BANDS_DEG, Draw, classes, draw, mean_error
from brdfdb.chart import STEPS, Chart, chart
from brdfdb.geometry import unit_vector
from brdfdb.materials import presets
from brdfdb.representations import representations


@pytest.fixture(scope="module")
def brass() -> Chart:
    return chart(presets()["rolled-brass"], None, (0.1,))


def test_a_chart_has_every_representation_with_the_truth_at_no_error(brass: Chart) -> None:
    forms = representations(presets()["rolled-brass"], None, (0.1,))
    assert [point.key for point in brass.points] == [form.key for form in forms]
    truth = brass.points[0]
    assert brass.truth == truth.key == "elliptical"
    assert (truth.l1, truth.p99, truth.forward, truth.back, truth.grazing) == (0.0,) * 5
    assert all(point.l1 > 0.0 for point in brass.points[1:])


def test_times_are_positive_with_quartiles_about_the_median(brass: Chart) -> None:
    for point in brass.points:
        for each in (point.batch, point.single):
            assert 0.0 < each.low <= each.ns <= each.high
        assert point.single.directions == 1 < point.batch.directions <= cost.BATCH


def test_fronts_begin_with_the_truth_and_get_less_accurate(brass: Chart) -> None:
    points = {point.key: point for point in brass.points}
    for front in (brass.fronts.batch, brass.fronts.single, brass.fronts.bytes):
        assert front[0] == brass.truth
        errors = [points[key].l1 for key in front]
        assert errors == sorted(errors)


def test_nothing_takes_fewer_bytes_than_a_model_and_is_of_use(brass: Chart) -> None:
    assert brass.fronts.bytes == ["elliptical"]
    lambert = next(point for point in brass.points if point.key == "lambert")
    assert lambert.bytes < brass.points[0].bytes  # but further off than black
    assert lambert.l1 > 1.0


def test_models_that_are_meant_to_differ_are_on_no_front(brass: Chart) -> None:
    others = {point.key for point in brass.points if point.kind == "other model"}
    assert others == {"ward-duer", "ward-bounded"}
    assert not others & {*brass.fronts.batch, *brass.fronts.single, *brass.fronts.bytes}


def test_errors_are_the_same_in_every_run(brass: Chart, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cost, "ROUNDS", 1)
    monkeypatch.setattr(charting, "SINGLES", 1)
    again = chart(presets()["rolled-brass"], None, (0.1,))
    timed = {"batch", "single"}
    assert [p.model_dump(exclude=timed) for p in again.points] == [p.model_dump(exclude=timed) for p in brass.points]


def test_more_forms_can_be_charted_and_steps_are_counted() -> None:
    material, ticks = presets()["scene-plastic-cube"], []
    also = [form for form in representations(presets()["rolled-brass"], None, ()) if form.key == "lambert"]
    found = chart(material, np.array([550.0]), (), also=also, tick=lambda: ticks.append(None))
    assert [point.key for point in found.points] == ["sum", "sum-float32", "lambert"]
    assert len(ticks) == STEPS


def test_classes_are_told_by_azimuth_and_grazing() -> None:
    theta_i, theta_r = np.deg2rad([30.0, 30.0, 30.0, 80.0, 10.0]), np.deg2rad([30.0, 30.0, 30.0, 10.0, 74.0])
    wi, wr = unit_vector(theta_i, 0.4), unit_vector(theta_r, 0.4 + np.deg2rad([180.0, 20.0, 90.0, 136.0, 44.0]))
    drawn = Draw(wi, wr, np.zeros(5, dtype=np.int64), np.ones(5), np.zeros(5, dtype=bool))
    found = {name: rows.tolist() for name, rows in classes(drawn).items()}
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
    assert all(rows.sum() > (BANDS_DEG.size - 1) for rows in classes(drawn).values())
