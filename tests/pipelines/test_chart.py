"""The chart command: what it writes and prints, its pictures, and one sentence for every mistake."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import jsonschema
import pytest

from brdfdb import cost
from brdfdb.chart import Chart, Charts, Cost, Fronts, Point
from brdfdb_pipelines import cli, scatter

Captured = pytest.CaptureFixture[str]
SCHEMA = Path(__file__).parent.parent.parent / "schemas" / "chart.schema.json"
PNG = b"\x89PNG\r\n\x1a\n"


def run(*arguments: object) -> int:
    return cli.main(["chart", *map(str, arguments)])


def point(key: str, l1: float, ns: float, **more: Any) -> Point:
    time = Cost(ns=ns, low=0.9 * ns, high=1.2 * ns, directions=1)
    errors = dict.fromkeys(("forward", "back", "grazing"), l1) | {"l1": l1, "p99": 5.0 * l1}
    fixed = {"title": f"the form {key}", "kind": "table", "python": "none", "dtype": "float64", "bytes": 100}
    return Point.model_validate({"key": key, "batch": time, "single": time, **errors, **fixed, **more})


def made_up(*points: Point) -> Chart:
    keys = [each.key for each in points]
    return Chart(
        material="made-up",
        title="Made <up>",
        model="none",
        parameters={},
        wavelength_nm=None,
        directions=1,
        truth=keys[0],
        points=list(points),
        fronts=Fronts(batch=keys[:2], single=keys[:1], bytes=keys[:1]),
    )


POINTS = (
    point("exact", 0.0, 1000.0, kind="exact"),
    point("fit", 0.02, 10.0, kind="approximation"),
    point("fit-float32", 0.02, 10.1, kind="approximation", dtype="float32"),
    point("off", 3.0, 900.0, kind="printed", bytes=1000),
)


def test_the_command_writes_the_data_and_a_picture_of_each(tmp_path: Path, capsys: Captured) -> None:
    out = tmp_path / "charts" / "here"
    names = ["rolled-brass", "scene-plastic-cube"]
    assert run(*names, "--out", out, "--tolerance", 0.2, "--store", tmp_path / "none") == 0
    files = {f"{name}.{end}" for name in names for end in ("svg", "png")}
    assert {path.name for path in out.iterdir()} == files | {"chart.json"}
    document = json.loads((out / "chart.json").read_text(encoding="utf-8"))
    jsonschema.validate(document, json.loads(SCHEMA.read_text(encoding="utf-8")))
    charts = Charts.model_validate(document).charts
    assert [each.material for each in charts] == names
    assert "table-20" in {each.key for each in charts[0].points}
    assert charts[1].wavelength_nm == [550.0]
    printed, progress = capsys.readouterr()
    assert all(name in progress for name in names)
    lines = printed.splitlines()
    starred = [line.split()[1] for line in lines[: len(charts[0].points) + 2] if line.startswith("*")]
    assert starred == [each.key for each in charts[0].points if each.key in charts[0].fronts.batch]
    assert printed.count("worth having: ") == 2
    assert lines[-1] == f"{out}: chart.json and the pictures of {', '.join(names)}"
    for name in names:
        assert (out / f"{name}.png").read_bytes().startswith(PNG)
        ElementTree.fromstring((out / f"{name}.svg").read_text(encoding="utf-8"))


def test_a_table_of_the_store_is_charted_beside_the_planned_ones(
    built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cost, "ROUNDS", 1)
    assert run("rolled-brass", "mirror", "--store", built, "--tolerance", 0.2, "--out", tmp_path) == 0
    brass, mirror = Charts.model_validate_json((tmp_path / "chart.json").read_text(encoding="utf-8")).charts
    stored = {each.key: each for each in brass.points}["table-stored"]
    assert stored.title.startswith("table of the store, ")
    assert stored.l1 > 0.1  # a coarse grid
    assert mirror.model == "he_torrance"  # defined by the store alone
    assert mirror.points[-1].key == "table-stored"


def test_materials_of_a_recipe_can_be_charted(recipe: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cost, "ROUNDS", 1)
    none = tmp_path / "none"
    assert run("mirror", "--recipe", recipe, "--tolerance", 0.2, "--out", tmp_path, "--store", none) == 0
    (mirror,) = Charts.model_validate_json((tmp_path / "chart.json").read_text(encoding="utf-8")).charts
    assert mirror.wavelength_nm is not None
    assert mirror.wavelength_nm == [400.0 + 20.0 * step for step in range(16)]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["nothing"], r"nothing: no such material, neither in the store nor among the built-in ones; .*"),
        (["rolled-brass", "--tolerance", "0.7"], r"tolerance: 0.7 is outside \[0.0001, 0.5\]"),
        (["rolled-brass", "--recipe", "no.toml"], r"no.toml: No such file or directory"),
    ],
)
def test_a_mistake_is_one_sentence_and_writes_nothing(
    arguments: list[str], sentence: str, tmp_path: Path, capsys: Captured
) -> None:
    assert run(*arguments, "--out", tmp_path / "out", "--store", tmp_path / "none") == 2
    printed, err = capsys.readouterr()
    assert printed == ""
    assert "Traceback" not in err
    assert re.fullmatch(f"brdfdb: {sentence}", err.splitlines()[-1])
    assert not (tmp_path / "out").exists()


def test_a_picture_names_every_point_and_the_front() -> None:
    text = scatter.svg(made_up(*POINTS))
    root = ElementTree.fromstring(text)
    written = [element.text for element in root.iter("{http://www.w3.org/2000/svg}text")]
    assert "Made <up>" in written
    for number, each in enumerate(POINTS, 1):
        assert each.title in written
        assert str(number) in written
    assert "1 the form exact" in written
    assert "2 the form fit" in written
    assert "3 the form fit-float32" not in written
    assert "10 (9-12)" in written


def test_a_picture_is_the_same_every_time() -> None:
    assert scatter.svg(made_up(*POINTS)) == scatter.svg(made_up(*POINTS))
    assert scatter.png(made_up(*POINTS)) == scatter.png(made_up(*POINTS))
    assert scatter.png(made_up(*POINTS)).startswith(PNG)


def test_one_point_is_a_picture_too() -> None:
    ElementTree.fromstring(scatter.svg(made_up(POINTS[0])))


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (1e-8, "≤ 0.0001 %"), (0.000172, "0.017 %"), (0.0143, "1.4 %"), (0.237, "24 %"), (8.85, "885 %")],
)
def test_errors_are_written_for_people(value: float, text: str) -> None:
    assert scatter.percent(value) == text


@pytest.mark.parametrize(("value", "text"), [(4.26, "4.26"), (999.6, "1k"), (34800.0, "34.8k"), (1.3e6, "1.3M")])
def test_counts_are_written_for_people(value: float, text: str) -> None:
    assert scatter.count(value) == text


def test_labels_hide_neither_points_nor_each_other_where_there_is_room() -> None:
    frame = (0.0, 0.0, 200.0, 100.0)
    taken = [(97.0, 47.0, 103.0, 53.0)]
    boxes = []
    for _ in range(4):  # four names for one point
        best = min(
            scatter.offsets(30.0),
            key=lambda offset: scatter.hidden(scatter.box((100.0, 50.0), offset, 30.0), taken, frame),
        )
        boxes.append(scatter.box((100.0, 50.0), best, 30.0))
        assert scatter.hidden(boxes[-1], taken, frame) == 0.0
        taken.append(boxes[-1])
    assert len(set(boxes)) == 4
