"""The chart command, of materials and families: what it writes and prints, its pictures, a sentence for mistakes."""

from __future__ import annotations

import itertools
import json
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from brdfdb.forms import catalogue, timing
from brdfdb.forms import tradeoff as charting
from brdfdb.forms.surface_rays import ChartedSurface, RayCost
from brdfdb.forms.tradeoff import (
    BetweenMembers,
    Chart,
    ChartedSampler,
    ChartPoint,
    Charts,
    Cost,
    FamilyChart,
    FamilyCurve,
    Fronts,
    SamplerWork,
    Saving,
)
from brdfdb.materials import presets
from brdfdb.microgeometry.model_errors import SurfaceError
from brdfdb.store import family_records
from brdfdb_pipelines import chart as chart_job
from brdfdb_pipelines import chart_picture, cli, terminal
from brdfdb_pipelines.recipe_file import load
from tests.json_schema import validate
from tests.pipelines.recipes import material

Captured = pytest.CaptureFixture[str]
SCHEMA = Path(__file__).parent.parent.parent / "schemas" / "chart.schema.json"
PNG = b"\x89PNG\r\n\x1a\n"


def run(*arguments: object) -> int:
    return cli.main(["chart", *map(str, arguments)])


def read(folder: Path, name: str) -> Charts:
    document = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
    validate(document, json.loads(SCHEMA.read_text(encoding="utf-8")))
    return Charts.model_validate(document)


def charted(folder: Path, name: str) -> Chart:
    (one,) = read(folder, name).charts
    return one


def family_charted(folder: Path, name: str) -> FamilyChart:
    (family,) = read(folder, name).families
    return family


def texts(picture: str) -> list[str | None]:
    """Return the texts of an SVG picture."""
    return [element.text for element in ElementTree.fromstring(picture).iter("{http://www.w3.org/2000/svg}text")]


def point(key: str, l1: float, ns: float, **more: Any) -> ChartPoint:
    time = Cost(ns=ns, low=0.9 * ns, high=1.2 * ns, directions=1)
    errors = dict.fromkeys(("forward", "back", "grazing"), l1) | {"l1": l1, "p99": 5.0 * l1}
    errors |= {"p99_low": 4.0 * l1, "p99_high": 6.0 * l1, "mixed": time, "rung": None, "saving": None}
    fixed = {"title": f"the form {key}", "kind": "table", "python": "none", "dtype": "float64", "bytes": 100}
    costs = {"batch": time, "block": time, "single": time}
    return ChartPoint.model_validate({"key": key, **costs, **errors, **fixed, **more})


WORK = SamplerWork(variance=0.25, ns=40.0, low_ms=0.09, ms=0.1, high_ms=0.11)


def made_up(*points: ChartPoint, surface: ChartedSurface | None = None) -> Chart:
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
        ladder=[each.key for each in points if each.kind in ("exact", "quadrature")],
        samplers=[ChartedSampler(key="model", title="the model's lobe", albedo=WORK, sphere=WORK)],
        fronts=Fronts(batch=keys[:2], single=keys[:1], bytes=keys[:1]),
        surface=surface,
    )


INSIDE = SurfaceError("Against rays: 4.0 % in the median.", inside=True, slope=0.42, median=0.04, noise=0.001)
OUTSIDE = SurfaceError("Against rays: outside of the map.", inside=False)
RAYS = RayCost(ns=2.5e5, standard_error=0.012, directions=145)
POINTS = (
    point("exact", 0.0, 1000.0, kind="exact"),
    point("fit", 0.02, 10.0, kind="approximation"),
    point("fit-float32", 0.02, 10.1, kind="approximation", dtype="float32"),
    point("off", 3.0, 900.0, kind="printed", bytes=1000),
)


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few directions, and one round of timing."""
    monkeypatch.setattr(charting, "DIRECTIONS", 100)
    monkeypatch.setattr(charting, "SINGLES", 1)
    monkeypatch.setattr(timing, "ROUNDS", 1)


@pytest.fixture
def no_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw nothing: pictures take more time than the charts of which the test reads the data."""
    monkeypatch.setattr(chart_picture, "svg", lambda _: "")
    monkeypatch.setattr(chart_picture, "png", lambda _: b"")


def test_the_command_writes_the_data_and_a_picture_of_each(tmp_path: Path, capsys: Captured) -> None:
    out = tmp_path / "charts" / "here"
    names = ["rolled-brass", "scene-plastic-cube"]
    assert run(*names, "--out", out, "--tolerance", 0.2, "--store", tmp_path / "none") == 0
    assert {path.name for path in out.iterdir()} == {f"{n}.{end}" for n in names for end in ("json", "svg", "png")}
    charts = [charted(out, name) for name in names]
    assert [each.material for each in charts] == names
    assert "table-20" in {each.key for each in charts[0].points}
    assert charts[1].wavelength_nm == [550.0]
    printed, progress = capsys.readouterr()
    assert all(name in progress for name in names)
    lines = printed.splitlines()
    starred = [line.split()[1] for line in lines[: len(charts[0].points) + 2] if line.startswith("*")]
    assert starred == [each.key for each in charts[0].points if each.key in charts[0].fronts.batch]
    assert printed.count("worth having: ") == 2
    assert lines[-1] == f"{out}: .json, .svg and .png of {', '.join(names)}"
    for name in names:
        assert (out / f"{name}.png").read_bytes().startswith(PNG)
        ElementTree.fromstring((out / f"{name}.svg").read_text(encoding="utf-8"))


def test_the_surface_is_a_row_that_says_that_the_truth_is_off(capsys: Captured) -> None:
    without, chart = made_up(*POINTS), made_up(*POINTS, surface=ChartedSurface(error=INSIDE, cost=RAYS))
    plain, written = (texts(chart_picture.svg(each)) for each in (without, chart))
    assert {"S", "S rays", "rays on a Gaussian surface, slope 0.42", "250k"}.isdisjoint(plain)
    assert {"S", "S rays", "rays on a Gaussian surface, slope 0.42", "250k"} <= {*written}
    sentences = [
        "Against rays: 4.0 % in the median.",
        "This is the error of the truth. The errors of the forms are relative to the truth.",
        "Rays take 250k ns a value for a standard error of 1.2 %.",
    ]
    assert {*sentences} <= {*written}
    assert "truth against rays, median" in written
    chart_job._print(chart)
    out = capsys.readouterr().out
    assert re.search(r"\n *surface +rays on a Gaussian surface, slope 0.42 +truth 4.0 % off +250k *\n", out)
    assert f"  surface: {' '.join(sentences)}\n" in out


def test_a_surface_outside_of_the_map_has_a_sentence_and_no_line(capsys: Captured) -> None:
    chart = made_up(*POINTS, surface=ChartedSurface(error=OUTSIDE, cost=None))
    written = texts(chart_picture.svg(chart))
    assert "Against rays: outside of the map." in written
    assert "truth against rays, median" not in written
    chart_job._print(chart)
    assert "  surface: Against rays: outside of the map.\n" in capsys.readouterr().out


@pytest.mark.usefixtures("quick", "no_pictures")
def test_a_table_of_the_store_is_charted_beside_the_planned_ones(built: Path, tmp_path: Path) -> None:
    assert run("rolled-brass", "mirror", "--store", built, "--tolerance", 0.2, "--out", tmp_path) == 0
    brass, mirror = charted(tmp_path, "rolled-brass"), charted(tmp_path, "mirror")
    stored = {each.key: each for each in brass.points}["table-stored"]
    assert stored.title.startswith("table of the store, ")
    assert stored.l1 > 0.1  # a coarse grid
    assert mirror.model == "he_torrance"  # defined by the store alone
    assert mirror.points[-1].key == "table-stored"


@pytest.mark.usefixtures("quick", "no_pictures")
def test_materials_of_a_recipe_can_be_charted(recipe: Path, tmp_path: Path) -> None:
    none = tmp_path / "none"
    assert run("mirror", "--recipe", recipe, "--tolerance", 0.2, "--out", tmp_path, "--store", none) == 0
    mirror = charted(tmp_path, "mirror")
    assert mirror.wavelength_nm is not None
    assert mirror.wavelength_nm == [400.0 + 20.0 * step for step in range(16)]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["nothing"], r"nothing: no such material or family, neither in the store nor among the presets; .*"),
        (["rolled-brass", "--tolerance", "0.1", "--tolerance", "-1"], r"tolerance: -1 is outside \[0.0001, 0.5\]"),
        (["rolled-brass", "--recipe", "no.toml"], r"no.toml: No such file or directory"),
    ],
)
def test_a_mistake_is_one_sentence_and_writes_nothing(
    arguments: list[str], sentence: str, tmp_path: Path, capsys: Captured
) -> None:
    assert run(*arguments, "--out", tmp_path / "out", "--store", tmp_path / "none") == 2
    printed, err = capsys.readouterr()
    assert printed == ""
    assert re.fullmatch(f"brdfdb: {sentence}\n", err)  # and no bar before it
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("quick", "no_pictures")
def test_another_run_leaves_the_charts_of_others_as_they_were(tmp_path: Path) -> None:
    given = ("--store", tmp_path / "none", "--out", tmp_path, "--tolerance", 0.2)
    assert run("rolled-brass", *given) == 0
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert run("glossy-grey-paper", *given) == 0
    after = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert before.items() <= after.items()
    assert len(after) == 2 * len(before) == 6


def test_a_picture_names_every_point_and_the_front() -> None:
    picture = chart_picture.svg(made_up(*POINTS))
    written = texts(picture)
    assert "Made <up>" in written
    for number, each in enumerate(POINTS, 1):
        assert each.title in written
        assert str(number) in written
    assert "1 the form exact" in written
    assert "2 the form fit" in written
    assert "3 the form fit-float32" not in written  # there is no room: it lies on the second
    assert "4 the form off" in written  # there is
    assert "10 (9-12)" in written
    assert "the model's lobe" in written
    assert written.count("0.1 (0.09-0.11)") == 2  # noise and time of the sampler, for the albedo and for the sphere
    assert picture == chart_picture.svg(made_up(*POINTS))
    assert chart_picture.png(made_up(*POINTS)).startswith(PNG)


def test_a_picture_draws_the_ladder_and_says_what_a_form_saves_over_its_rung() -> None:
    rung = point("exact-4", 0.01, 100.0, kind="quadrature")
    fit = point("fit", 0.02, 10.0, kind="approximation", rung="exact-4", saving=Saving(low=9.0, times=10.4, high=11.0))
    written = texts(chart_picture.svg(made_up(POINTS[0], rung, fit)))
    for text in ("ladder", "quadrature", "10 (exact-4)", "10 % (8-12)"):  # the last: 99th percentile and its interval
        assert text in written
    assert "ladder" not in texts(chart_picture.svg(made_up(POINTS[0])))


def test_errors_and_counts_are_written_for_people() -> None:
    errors = [0.0, 1e-8, 0.000172, 0.0143, 0.237, 0.997, 8.85]
    words = ["0", "≤ 0.0001 %", "0.017 %", "1.4 %", "24 %", "100 %", "885 %"]
    assert [chart_picture.percent(value) for value in errors] == words
    assert [terminal.count(value) for value in (4.26, 999.6, 34800.0, 1.3e6)] == ["4.26", "1k", "34.8k", "1.3M"]


def test_labels_hide_neither_points_nor_each_other_where_there_is_room() -> None:
    frame = (0.0, 0.0, 200.0, 100.0)
    taken = [chart_picture.TextBox(97.0, 47.0, 103.0, 53.0)]
    boxes = []
    for _ in range(4):  # four names for one point
        best = min(
            chart_picture.offsets(30.0),
            key=lambda offset: chart_picture.TextBox.at((100.0, 50.0), offset, 30.0).hidden(taken, frame),
        )
        boxes.append(chart_picture.TextBox.at((100.0, 50.0), best, 30.0))
        assert boxes[-1].hidden(taken, frame) == 0.0
        taken.append(boxes[-1])
    assert len(set(boxes)) == 4


# Families

PARAMETERS = ("rho_d = 0.1", "rho_s = [0.1, 0.3]", "alpha_x = 0.1", "alpha_y = [0.2, 0.3, 0.4]")
BRUSHED = 'materials = ["brushed"]\nwavelengths_nm = [550]\ntolerance = 0.2\n' + material(
    "brushed", "Brushed", "ward", *PARAMETERS, table="sweep"
)


@pytest.fixture(scope="module")
def brushed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the recipe of a family, and the store that was built of it; tests must not change it."""
    root = tmp_path_factory.mktemp("brushed")
    (root / "recipe.toml").write_text(BRUSHED, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(family_records, "POINTS", 16)
        assert cli.main(["build", str(root / "recipe.toml"), "--store", str(root / "store"), "--jobs", "2"]) == 0
    return root


@pytest.mark.usefixtures("quick")
def test_a_family_of_a_recipe_is_charted_as_a_whole(brushed: Path, tmp_path: Path, capsys: Captured) -> None:
    given = ("--recipe", brushed / "recipe.toml", "--store", tmp_path / "none", "--out", tmp_path, "--tolerance", 0.2)
    assert run("brushed", "brushed-003", *given) == 0
    whole, member = family_charted(tmp_path, "brushed"), charted(tmp_path, "brushed-003")
    assert whole.axes == {"rho_s": [0.1, 0.3], "alpha_y": [0.2, 0.3, 0.4]}
    assert whole.members == [f"brushed-{number:03d}" for number in range(1, 7)]
    assert member.material == "brushed-003"  # a member named by itself is a chart of its own
    material = load(brushed / "recipe.toml").jobs()[0].material
    assert {curve.key for curve in whole.curves} == {form.key for form in catalogue.forms(material, None, (0.2,))}
    assert [(p.key, p.l1) for p in member.points] == [(curve.key, curve.l1[2]) for curve in whole.curves]
    assert whole.between is None
    printed, progress = capsys.readouterr()
    assert "brushed " in progress
    assert "Mean error along rho_s" in printed
    assert "Mean error along alpha_y" in printed
    assert "worth having: elliptical Gaussian, eq. 5a" in printed
    assert printed.splitlines()[-1] == f"{tmp_path}: .json, .svg and .png of brushed-003, brushed"
    assert (tmp_path / "brushed.png").read_bytes().startswith(PNG)
    ElementTree.fromstring((tmp_path / "brushed.svg").read_text(encoding="utf-8"))


@pytest.mark.usefixtures("quick", "no_pictures")
@pytest.mark.parametrize("named", ["by its recipe", "by the store"])
def test_a_family_of_the_store_is_charted_with_its_lookups_between_members(
    brushed: Path, tmp_path: Path, named: str, capsys: Captured
) -> None:
    recipe = ["--recipe", brushed / "recipe.toml"] if named == "by its recipe" else []
    assert run("brushed", *recipe, "--store", brushed / "store", "--out", tmp_path, "--tolerance", 0.2) == 0
    whole = family_charted(tmp_path, "brushed")
    record = json.loads((brushed / "store" / "families" / "brushed.json").read_text(encoding="utf-8"))
    assert whole.between is not None
    stated = record["error"]["overall"]
    assert (whole.between.l1, whole.between.p99) == (stated["l1"], stated["p99"])
    assert whole.between.batch.ns > 0.0
    assert whole.members == record["members"]
    assert "as the family states" in capsys.readouterr().out


def time(ns: float) -> Cost:
    return Cost(ns=ns, low=ns, high=ns, directions=1)


def made_up_family(
    between: BetweenMembers | None = None, surface: Sequence[SurfaceError | None] = (), **axes: list[float]
) -> FamilyChart:
    """A truth, and a form that gets better along the family."""
    members = [f"member-{number}" for number in range(math.prod(map(len, axes.values())))]
    fixed = {"python": "none", "dtype": "float64", "bytes": 8, "timed": members[0]}
    better = [0.5 / (number + 1) for number in range(len(members))]
    costs = [{"batch": time(ns), "block": time(ns), "single": time(ns)} for ns in (9.0, 1.0)]
    forms = [{"key": "exact", "title": "the truth", "kind": "exact"}, {"key": "fit", "title": "fit", "kind": "printed"}]
    errors: list[list[float]] = [[0.0] * len(members), better]
    return FamilyChart(
        family="made-up",
        title="Made <up>",
        model="none",
        axes=axes,
        members=members,
        diagnostic=None,
        wavelength_nm=None,
        truth="exact",
        curves=[
            FamilyCurve.model_validate({**form, **fixed, **timing, "l1": l1, "p99": l1})
            for form, timing, l1 in zip(forms, costs, errors, strict=True)
        ],
        between=between,
        fronts=[["exact"]] * (len(members) - 1) + [["exact", "fit"]],
        surface=list(surface),
    )


def test_a_family_shows_where_its_truth_leaves_the_surface(capsys: Captured) -> None:
    family = made_up_family(height=[1.0, 2.0, 4.0, 9.0], surface=[INSIDE, INSIDE, OUTSIDE, None])
    assert "truth against rays, median" in texts(chart_picture.svg(family))
    chart_job._print_family(family)
    (line,) = (line for line in capsys.readouterr().out.splitlines() if line.startswith("surface"))
    assert re.split("  +", line.strip())[1:] == [
        "truth against rays on Gaussian surfaces, median",
        "4 %",
        "4 %",
        "-",
        "-",
    ]
    without = made_up_family(height=[1.0, 2.0, 4.0, 9.0])
    assert "truth against rays, median" not in texts(chart_picture.svg(without))
    chart_job._print_family(without)
    assert "surface" not in capsys.readouterr().out


def test_the_picture_of_a_family_names_every_form_beside_its_curve_and_in_the_table() -> None:
    fixed = {"key": "between", "title": "between members", "kind": "table", "python": "none", "dtype": "float64"}
    between = BetweenMembers.model_validate(
        {**fixed, "bytes": 8, **dict.fromkeys(("batch", "block", "single"), time(5.0)), "l1": 0.1, "p99": 1.0}
    )
    written = texts(chart_picture.svg(made_up_family(between, height=[1.0, 2.0, 4.0, 9.0])))
    for number, name in enumerate(("the truth", "fit", "between members"), 1):
        assert name in written
        assert f"{number} {name}" in written
    assert "height" in written
    assert "1 of 4" in written  # where the fit is worth having


def test_members_are_told_apart_along_each_parameter() -> None:
    whole = made_up_family(height=[1.0, 2.0], width=[3.0, 4.0, 5.0])
    assert chart_picture.along(whole, "height") == [[0, 1, 2], [3, 4, 5]]
    assert chart_picture.along(whole, "width") == [[0, 3], [1, 4], [2, 5]]
    assert chart_picture.middle([0.1, None, 0.3, 0.2]) == 0.2
    assert chart_picture.middle([None]) is None


def test_names_are_moved_apart_and_no_further_than_they_need() -> None:
    assert chart_picture.apart([10.0, 50.0], 9.0, 100.0) == [10.0, 50.0]
    assert chart_picture.apart([10.0, 12.0, 30.0], 9.0, 100.0) == [6.5, 15.5, 30.0]
    assert chart_picture.apart([95.0, 99.0, 120.0], 9.0, 100.0) == [82.0, 91.0, 100.0]


def test_the_recipe_of_copper_goes_from_smooth_to_rough() -> None:
    recipe = load(Path(chart_picture.__file__).parent / "recipes" / "copper-roughness.toml")
    (sweep,) = recipe.sweeps(recipe.jobs())
    g = [(4.0 * math.pi * value / 0.55) ** 2 for value in sweep.axes["sigma_0_um"]]  # eq. 79 along the normal
    assert g[0] < 0.1 < 100.0 < g[-1]
    assert not {*sweep.members, sweep.name} & {*presets()}


def test_cells_of_the_table_of_forms_stand_apart() -> None:
    sheet = chart_picture.Sheet(200.0, "", "")
    errors = ["≤ 0.0001 %", "0.0002 % (0.00019-0.00022)", "≤ 0.0001 %", "≤ 0.0001 %", "≤ 0.0001 %"]
    cells = ["10", "a title", *errors, "16.29 (15.91-16.81)", "46.2k", "9.87k", "314k", "0.53 (he_torrance)", "717 kB"]
    before = len(sheet.canvas.texts)
    sheet.row(chart_picture.COLUMNS, 1, cells, 50.0, fontweight="bold")
    boxes = [text.get_window_extent() for text in sheet.canvas.texts[before:]]
    assert len(boxes) == len(cells)
    assert all(left.x1 < right.x0 for left, right in itertools.pairwise(boxes))
