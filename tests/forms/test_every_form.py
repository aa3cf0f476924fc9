"""Every model has forms, a chart and a choice: a table that cannot be made is left out and named."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from brdfdb.forms import catalogue, sampler_efficiency, timing, tradeoff
from brdfdb.forms.tradeoff import Chart
from brdfdb.models import MODELS
from brdfdb.scenes.choice import Price, SceneChoice
from brdfdb.scenes.offered_forms import OfferedForm
from brdfdb.tables import planner
from brdfdb_pipelines import chart, chart_picture, choose, cli
from tests.benchmarks.every_form import NM, SETS, draws, missing, scene

TOLERANCES = (0.1,)
FEW_VALUES = 60  # of a planned table, so that many tables are refused at once


@pytest.fixture(autouse=True)
def _small_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    """Plan small tables, time nothing, and look at few places: what is offered depends on none of it."""

    def no_times(forms: list[catalogue.Form], *_: object, rounds: int = 3, **__: object) -> list[timing.Times]:
        return [timing.Times(np.full(rounds, 1.0 + number), 1) for number, _ in enumerate(forms)]

    def no_prices(forms: list[OfferedForm], *_: object) -> list[Price]:
        return [Price(1.0, np.ones(1)) for _ in forms]

    monkeypatch.setattr(planner, "MOST_VALUES", FEW_VALUES)
    monkeypatch.setattr(timing, "times", no_times)
    monkeypatch.setattr(timing, "mixed_times", no_times)
    monkeypatch.setattr(sampler_efficiency, "works", partial(sampler_efficiency.works, rounds=1, samples=64))
    monkeypatch.setattr(tradeoff, "DIRECTIONS", 20)
    monkeypatch.setattr(choose, "_prices", no_prices)
    monkeypatch.setattr(choose, "EDGES", 20)


@pytest.mark.judge
@pytest.mark.parametrize("model", MODELS)
def test_every_model_has_forms_a_chart_and_a_choice(
    model: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(choose, "_draw", lambda *_: None)
    for number, material in enumerate(draws(model, 1 if MODELS[model].slow else SETS)):
        at = np.array(NM[:1]) if material.spectral else None
        drawn = tradeoff.chart(material, at, TOLERANCES)
        keys = [point.key for point in drawn.points]
        assert missing(TOLERANCES, keys, [one.key for one in drawn.left_out]) == []
        assert drawn.truth == keys[0]
        assert drawn.points[0].l1 == 0.0
        if number > 0:  # a choice takes 2 s: the benchmark `every_form` makes one for each
            continue
        choice = choose.run(scene(material, tmp_path), tmp_path / "out", width=6, tolerances=TOLERANCES)
        (one,) = choice.materials
        assert one.truth.key == drawn.truth
        assert one.whole.counted <= choice.tolerance.value
        if not material.spectral:  # the scene has more wavelengths than the chart
            assert one.left_out == drawn.left_out


def test_a_table_that_is_too_large_is_left_out_of_a_choice_and_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(planner, "MOST_VALUES", 1)
    path = scene(draws("ward_bounded", 1)[0], tmp_path)
    assert cli.main(["choose", path, "--width", "8", "--out", str(tmp_path / "out")]) == 0
    written = SceneChoice.model_validate(json.loads((tmp_path / "out" / "choice.json").read_text(encoding="utf-8")))
    (one,) = written.materials
    assert [each.key for each in one.left_out] == ["table-10", "table-1", "table-0-05"]
    assert one.left_out[2].reason == "tolerance: 0.0005 takes more than 1 values of drawn; choose a larger one"
    assert f"left out: {one.left_out[2].title}: {one.left_out[2].reason}" in capsys.readouterr().out.replace("\n", " ")


def test_a_table_that_is_too_large_is_left_out_of_a_chart_and_named(capsys: pytest.CaptureFixture[str]) -> None:
    drawn: Chart = tradeoff.chart(draws("abg", 2)[1], None, (0.2, 1e-4))
    assert [each.key for each in drawn.left_out] == ["table-0-01"]
    assert drawn.left_out[0].reason.startswith("tolerance: 0.0001 takes more than 60 values of drawn")
    assert "cannot be made" in chart_picture.svg(drawn)
    chart._print(drawn)
    assert f"left out: {drawn.left_out[0].title}" in capsys.readouterr().out


def test_a_wrong_tolerance_is_still_refused() -> None:
    for wrong in (0.0, 0.7, float("nan")):
        with pytest.raises(ValueError, match=r"^tolerance: \S+ is outside \[0.0001, 0.5\]$"):
            catalogue.forms(draws("lambert", 1)[0], None, (0.1, wrong))
