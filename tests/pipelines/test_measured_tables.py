"""Measured tables: built from recipes, listed, looked up, charted, exported, without the file they are of."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import brdfdb
from brdfdb import formats
from brdfdb.forms.catalogue import forms
from brdfdb.geometry import radians
from brdfdb.materials import presets
from brdfdb.measurements import MeasuredSource
from brdfdb.store.publication import publish
from brdfdb_pipelines.named_source import named_source
from tests.measurements.made_up import scans, scattered
from tests.pipelines.a_measurement import write_csv
from tests.pipelines.command import Captured, refused, run
from tests.pipelines.recipes import recipe_file_of

NAME = "my-clay"
RECIPE = f"""\
materials = ["{NAME}"]
tolerance = 0.1
[define.{NAME}]
samples = "clay.csv"
source = "run 12"
"""
INSIDE_DEG = (30.0, 0.0, 20.0, 120.0)  # lights of the samples: 10 to 60 degrees
OUTSIDE_DEG = (80.0, 0.0, 20.0, 120.0)
CLAY = presets()["clay-vase"].brdf_at(None)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with a measured table, beside the recipe that it is of; the file of samples is gone."""
    directory = tmp_path_factory.mktemp("measured")
    write_csv(directory / "clay.csv", scans(CLAY, np.array([10.0, 35.0, 60.0]), 0.03, step_deg=15.0))
    assert run("build", recipe_file_of(directory, RECIPE), "--store", directory / "store") == 0
    (directory / "clay.csv").rename(directory / "elsewhere.csv")
    return directory


def test_a_table_is_built_anew_for_another_file_or_law(tmp_path: Path, capsys: Captured) -> None:
    command = ("build", recipe_file_of(tmp_path, RECIPE), "--store", tmp_path / "store")
    assert "clay.csv: No such file" in refused(capsys, *command)
    assert not (tmp_path / "store").exists()
    write_csv(tmp_path / "clay.csv", scattered(CLAY, 300, 0.03))
    assert run(*command) == 0
    built = capsys.readouterr().out
    assert f"  {' x '.join(map(str, brdfdb.open(tmp_path / 'store')[NAME].values.shape))}  " in built
    assert f"{NAME}   measured" in built
    assert run(*command) == 0
    assert "1 table unchanged" in capsys.readouterr().out
    recipe_file_of(tmp_path, RECIPE + "conserving = true\nreciprocal = true\n")
    assert run(*command) == 0
    measured = brdfdb.open(tmp_path / "store").metadata(NAME).measured
    assert measured is not None
    assert [change.law for change in measured.changes] == ["reciprocal", "conserving"]
    recipe_file_of(tmp_path, RECIPE)
    write_csv(tmp_path / "clay.csv", scattered(CLAY, 200, 0.03))
    assert run(*command) == 0
    assert brdfdb.open(tmp_path / "store")[NAME].revision == "r000003"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (RECIPE + 'base = "x"', f"define.{NAME}.base"),
        (RECIPE + "reciprocal = 3", f"define.{NAME}.reciprocal"),
        (RECIPE + 'format = "tiff"', "file_format: 'tiff' is not one of"),
        (RECIPE.replace("tolerance = 0.1", "[grids]"), "tolerance: is missing"),
    ],
)
def test_mistakes_are_one_sentence(tmp_path: Path, capsys: Captured, text: str, sentence: str) -> None:
    write_csv(tmp_path / "clay.csv", scattered(CLAY, 300, 0.03))
    assert sentence in refused(capsys, "build", recipe_file_of(tmp_path, text), "--store", tmp_path / "store")


def test_lists_say_measured(folder: Path, capsys: Captured) -> None:
    assert run("list", "--store", folder / "store") == 0
    line = next(line for line in capsys.readouterr().out.splitlines() if line.startswith(NAME))
    assert " measured " in line
    assert "no formula" in line
    assert run("history", NAME, "--store", folder / "store") == 0
    assert " measured " in capsys.readouterr().out
    assert ">measured</td>" in brdfdb.open(folder / "store")._repr_html_()


def test_show_tells_the_samples_and_has_a_dash_where_nothing_was_measured(folder: Path, capsys: Captured) -> None:
    measured = brdfdb.open(folder / "store").metadata(NAME).measured
    assert measured is not None
    assert run("show", NAME, "--store", folder / "store") == 0
    printed = capsys.readouterr().out
    digest = f"file clay.csv, sha256 {measured.file_sha256[:12]}"
    for words in (digest, "run 12", "samples of", "error at samples held out", "noise of the samples", "extrapolated"):
        assert words in printed
    rows = {line[4:26].strip(): line[26:].split() for line in printed.splitlines() if line.startswith("    ")}
    assert rows["one direction grazing"] == rows["both grazing"] == ["-"] * len(rows["both grazing"])
    assert "-" not in rows["99 % of f_r"][:3]


def test_lookups_outside_of_the_samples_are_marked_and_have_no_error(folder: Path, capsys: Captured) -> None:
    table = brdfdb.open(folder / "store")[NAME]
    angles = radians(np.array([INSIDE_DEG, OUTSIDE_DEG, (95.0, 0.0, 20.0, 120.0)])).T
    assert table.extrapolated(*angles).tolist() == [False, True, False]  # below the horizon f_r is known to be 0
    error = table.lookup_with_error(*angles).error
    assert np.isfinite(error).tolist() == [True, False, True]
    for at, words in ((INSIDE_DEG, "+- "), (OUTSIDE_DEG, "extrapolated: ")):
        assert run("lookup", NAME, *at, "--store", folder / "store", "--with-error") == 0
        assert words in capsys.readouterr().out
        assert run("lookup", NAME, *at, "--store", folder / "store", "--with-error", "--json") == 0
        answer = json.loads(capsys.readouterr().out)
        assert (answer["extrapolated"], answer["error"] == [None]) == (at is OUTSIDE_DEG, at is OUTSIDE_DEG)


def test_nodes_outside_of_the_samples_are_marked_in_the_dataset(folder: Path) -> None:
    dataset = brdfdb.open(folder / "store").dataset(NAME)
    marked = dataset["extrapolated"]
    assert marked.dims == dataset["brdf"].dims
    lights = marked.all(["theta_r", "delta_phi"])
    expected = lights["theta_i"] > 61.0  # below 10 degrees they lie between lights from either side
    xr.testing.assert_equal(lights, expected.rename(None))
    assert bool(marked.any()) != bool(marked.all())


def test_tables_of_functions_and_models_are_nowhere_extrapolated(tmp_path: Path) -> None:
    publish(tmp_path, presets()["clay-vase"], tolerance=0.3)
    table = brdfdb.open(tmp_path)["clay-vase"]
    assert not table.extrapolated(*radians(np.array([OUTSIDE_DEG])).T).any()
    assert "extrapolated" not in brdfdb.open(tmp_path).dataset("clay-vase")


def test_record_of_an_exported_file_says_measured(folder: Path) -> None:
    table = brdfdb.open(folder / "store")[NAME]
    path = folder / "clay.json"
    formats.write(table, path, "bird", tolerance=0.3)
    text = path.read_text()
    measured = table.metadata.measured
    assert measured is not None
    assert measured.held_out is not None
    of_extent = "of all pairs of directions were not measured"
    stated = (measured.file_sha256, "clay.csv", "measured: run 12", "the data", str(measured.held_out.p95))
    for words in (*stated, of_extent):
        assert words in text
    assert "computed from parameters" not in text


@pytest.mark.parametrize(
    ("file_format", "wanted"),
    [
        ("bird", '"method": ?"measurement"'),
        ("openmaterial", '"sources": ?"measurement, '),
        ("ssdd", "SOURCE_TYPE measured"),
    ],
)
def test_fields_of_a_format_say_measured_as_the_record_does(folder: Path, file_format: str, wanted: str) -> None:
    path = folder / f"clay.{file_format}"
    formats.write(brdfdb.open(folder / "store")[NAME], path, file_format, tolerance=0.3)
    text = path.read_bytes().decode("utf-8", "replace")
    assert re.search(wanted, text)
    assert not re.search('simulation, |SOURCE_TYPE generated|"method": ?"simulation|"virtual"', text)


def test_export_says_that_some_values_were_not_measured(folder: Path, capsys: Captured) -> None:
    options = ("--store", folder / "store", "--out", folder / "out", "--tolerance", "0.3")
    assert run("export", "csv", NAME, *options) == 0
    assert "of all pairs of directions were not measured: f_r is extrapolated there" in capsys.readouterr().out


def test_source_code_of_a_measured_table_is_refused_in_a_sentence(folder: Path, capsys: Captured) -> None:
    said = refused(capsys, "export", "glsl", NAME, "--store", folder / "store", "--out", folder / "out")
    assert "the table is measured, and source code needs a model" in said


def test_audit_judges_energy_of_the_data_and_pairs_that_were_measured(folder: Path, capsys: Captured) -> None:
    assert run("audit", "--store", folder / "store", "--no-figures", "--report", folder / "audit.json") == 0
    assert "it is measured" in capsys.readouterr().out
    finding = json.loads((folder / "audit.json").read_text())["materials"][0]
    assert finding["as_published"]["text"] == finding["verdict_in_words"] == "passes where measured, 38 %"
    assert finding["conserves_energy"]["word"] == "passes"
    assert finding["conserves_energy"]["text"].startswith("the data do where measured, 38 %: albedo 0.")
    pairs = finding["findings"]["reciprocity"]["table_random"]
    assert pairs["measured"]
    assert 0 < pairs["pairs"] < 0.5 * 36_000  # half of the lights lie outside of the samples


def test_chart_needs_no_file(folder: Path, capsys: Captured) -> None:
    chart = ("chart", NAME, "--tolerance", "0.3", "--store", folder / "store", "--out", folder / "chart")
    assert run(*chart) == 0
    printed = capsys.readouterr().out
    assert "--recipe FILE" in printed
    assert "The data are within " in printed
    assert "clay.csv: No such file" in refused(capsys, *chart, "--recipe", folder / "recipe.toml")


def test_data_of_a_recipe_are_what_its_tables_are_compared_with(folder: Path, tmp_path: Path) -> None:
    recipe_file_of(tmp_path, RECIPE + "conserving = true\n")
    (tmp_path / "clay.csv").write_bytes((folder / "elsewhere.csv").read_bytes())
    source, at = named_source(NAME, folder / "store", tmp_path / "recipe.toml")
    assert isinstance(source, MeasuredSource)
    assert (at, [change.law for change in source.measured.changes]) == (None, ["conserving"])
    data, table, *_ = forms(source, at, (0.3,))
    assert data.title.endswith("the data, interpolated")
    assert table.layout is not None
    assert table.layout.reason.endswith("against the data")


def test_a_conversion_takes_the_table_in_place_of_the_data(folder: Path, capsys: Captured) -> None:
    assert run("convert", NAME, "--to", "oren_nayar", "--store", folder / "store", "--json") == 0
    assert json.loads(capsys.readouterr().out)["l1"] < 0.1
