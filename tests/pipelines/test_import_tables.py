"""`brdfdb import --store`: statements, tables and their audit in one command, and what is refused of it."""

from __future__ import annotations

import json
import re
import tomllib
import zipfile
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import brdfdb
from brdfdb import formats
from brdfdb.geometry import unit_vector
from brdfdb.materials import presets
from brdfdb.measurements import Samples
from brdfdb.store.summary_words import audited_materials
from brdfdb_pipelines import audit, recipe_file
from tests.formats.test_neural import network
from tests.measurements.made_up import scattered
from tests.pipelines.a_measurement import write_csv
from tests.pipelines.command import Captured, refused, run

ONE_JOB = ("--jobs", "1", "--tolerance", "0.2")


@pytest.fixture
def clay() -> Samples:
    return scattered(presets()["clay-vase"].brdf_at(None), 240, 0.03)


def _network(darkest: float, slope: float) -> bytes:
    """Return a network with f_r = (1 + darkest) exp(slope (1 + d_x)) - 1, where d_x changes sign with the exchange."""
    first, second, third = (np.zeros(shape, np.float32) for shape in ((6, 21), (21, 21), (21, 3)))
    first[3, 0], second[0, 0], third[0] = 1.0, 1.0, slope
    bias = np.zeros(21, np.float32)
    bias[0] = 1.0
    weights = {"dense_1": (first, bias), "dense_2": (second, np.zeros(21, np.float32))}
    weights["dense_3"] = third, np.full(3, np.log1p(darkest), np.float32)
    return network(
        {
            f"{layer}/{layer}/{part}:0": values
            for layer, both in weights.items()
            for part, values in zip(("kernel", "bias"), both, strict=True)
        }
    )


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    """Two networks: one that is not reciprocal, and one with an albedo of pi / 2."""
    path = tmp_path / "networks.zip"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("nets/too_bright.h5", _network(0.5, 0.0))
        file.writestr("nets/dark_grey.h5", _network(0.1, 0.05))
        file.writestr("nets/dark_grey.json", b"{}")
    return path


def verdicts(store: Path) -> dict[str, str]:
    return {audited["material"]: audited["verdict"] for audited in audited_materials(store)}


def test_an_albedo_that_the_error_of_the_table_does_not_tell_from_1_is_not_judged(
    tmp_path: Path, capsys: Captured
) -> None:
    white = scattered(lambda wi, _: np.full((len(wi), 1), 0.999 / np.pi), 240, 0.03)
    assert run("import", write_csv(tmp_path / "white.csv", white), "--store", tmp_path / "store", *ONE_JOB) == 0
    printed = capsys.readouterr().out
    (line,) = [line for line in printed.splitlines() if line.startswith("white ")]
    assert re.search(r"(0\.9|1\.0)\d? ± 0\.\d+ at .* passes", line)
    unjudged = "conservation of energy not judged: 1 (white)"
    assert re.search(rf"\n1 table audited: passes where measured, \d\d %; {re.escape(unjudged)}\n$", printed)
    assert run("audit", "white", "--store", tmp_path / "store", "--jobs", 1) == 0
    printed = capsys.readouterr().out
    assert "cannot be judged: albedo " in printed
    assert "passes 1, known published excess 0, violates 0" in printed


def test_an_archive_is_audited_whole_and_audits_of_earlier_imports_stay(
    archive: Path, tmp_path: Path, clay: Samples, capsys: Captured
) -> None:
    store, samples = tmp_path / "store", tmp_path / "clay.nc"
    assert run("import", archive, "--store", store, *ONE_JOB) == 1  # one network reflects more than it receives
    printed = capsys.readouterr().out
    assert f"{archive}: dark_grey; " in printed
    assert f"{archive}: too_bright; " in printed
    assert "albedo above 1: 1 (too-bright)" in printed
    assert "\nall tables keep to the tolerance of 20 % for 95 % of the values\n" in printed
    assert "2 of 2 state no uncertainty and are not judged" in printed
    assert printed.endswith("2 tables audited: passes 1, violates 1\n")
    directions = unit_vector([0.3, 0.5], [0.0, 0.0]), unit_vector([0.9, 0.1], [2.0, 0.5])
    expected = formats.read(archive, member="dark_grey").lookup_vectors(*directions)[:, 1]
    looked_up = brdfdb.open(store)["dark-grey"].lookup_vectors(*directions, 550.0)
    assert np.ravel(looked_up) == pytest.approx(expected, rel=0.02)
    clay.to_xarray().to_netcdf(samples)
    assert run("import", samples, "--store", store, "--name", "clay", *ONE_JOB) == 0
    assert verdicts(store) == {"clay": "passes", "dark-grey": "passes", "too-bright": "violates"}
    capsys.readouterr()
    assert run("import", archive, "--store", store, "--conserving", "--json", *ONE_JOB) == 0
    document = json.loads(capsys.readouterr().out)
    assert verdicts(store) == {"clay": "passes", "dark-grey": "passes", "too-bright": "passes"}
    assert [statement["name"] for statement in document["statements"]] == ["dark_grey", "too_bright"]
    assert document["refused"] == []
    assert document["summary"]["materials"] == document["summary"]["passes"] == 2
    assert document["summary"]["violates"] == document["summary"]["above_1"] == []
    dark, bright = document["tables"]
    assert 0.01 < dark["asymmetry_median"] < 0.1
    assert document["summary"]["asymmetry_median"] == pytest.approx(dark["asymmetry_median"] / 2.0)
    assert bright["asymmetry_median"] == 0.0
    assert bright["albedo"] <= 1.0
    assert bright["uncertainty"] is bright["asymmetric"] is None


def test_a_second_import_into_a_relative_store_keeps_the_audit_of_the_first(
    tmp_path: Path, clay: Samples, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.chdir(tmp_path)
    clay.to_xarray().to_netcdf("clay.nc")
    for name in ("first", "second"):
        assert run("import", "clay.nc", "--store", "store", "--name", name, *ONE_JOB) == 0
    assert run("audit", "second", "--store", "./store") == 0
    capsys.readouterr()
    assert run("list", "--store", "store") == 0
    assert "not audited" not in capsys.readouterr().out
    both = {"first": "passes", "second": "passes"}
    assert verdicts(Path("store")) == both
    # an audit of some materials does not bring back what the audit of all has repeated since
    part = Path("store/audit-part.json")
    former = audit.read_former(part)
    assert former is not None
    wrong = [audited.model_copy(update={"verdict": "violates"}) for audited in former.materials]
    older = {"materials": wrong, "when": former.when - timedelta(hours=1)}
    part.write_bytes(audit.sealed(former.model_copy(update=older)))
    assert run("audit", "--store", "store", "--no-figures") == 0
    assert run("audit", "second", "--store", "store", "--all") == 0
    assert verdicts(Path("store")) == both
    capsys.readouterr()


def test_the_recipe_builds_the_same_tables_and_nothing_anew(
    tmp_path: Path, clay: Samples, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_csv(Path("run12.csv"), clay, "sun,view,turn,number")
    (tmp_path / "recipes").mkdir()
    names = {"theta_i": "sun", "theta_r": "view", "delta_phi": "turn", "values": "number"}
    columns = [f"--column={role}={name}" for role, name in names.items()]
    options = ["--angles", "deg", "--quantity", "reflectance_factor", "--reciprocal", "--name", "clay-12"]
    options += ["--title", 'Clay, "measured"', "--source", "run 12", "--store", "store"]
    options += ["--recipe", "recipes/clay.toml"]
    assert run("import", "run12.csv", *columns, *options, *ONE_JOB) in (0, 1)
    capsys.readouterr()
    recipe = tomllib.loads(Path("recipes/clay.toml").read_text())
    assert recipe["define"]["clay-12"]["samples"] == "../run12.csv"
    assert recipe["define"]["clay-12"]["columns"]["theta_i"] == ["sun"]
    assert run("build", "recipes/clay.toml", "--store", "store") == 0
    assert "1 table unchanged" in capsys.readouterr().out
    metadata = brdfdb.open("store").metadata("clay-12")
    assert metadata.title == 'Clay, "measured"'
    assert metadata.measured is not None
    assert [change.law for change in metadata.measured.changes] == ["reciprocal"]


def test_a_recipe_alone_builds_nothing(tmp_path: Path, clay: Samples, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_csv(Path("clay.csv"), clay)
    assert run("import", "clay.csv", "--recipe", "clay.toml") == 0
    assert [job.name for job in recipe_file.load(Path("clay.toml")).measured_jobs()] == ["clay"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["clay.csv", "clay.toml"]


def test_joined_files_are_one_table(tmp_path: Path, clay: Samples, capsys: Captured) -> None:
    rows = np.arange(len(clay))
    first = write_csv(tmp_path / "first.csv", clay.selected(rows[:100]))
    second = write_csv(tmp_path / "second.csv", clay.selected(rows[100:]))
    assert run("import", first, second, "--join", "--name", "clay", "--store", tmp_path / "store", *ONE_JOB) in (0, 1)
    assert f"{first}, {second}: first and second\n  240 samples" in capsys.readouterr().out
    measured = brdfdb.open(tmp_path / "store").metadata("clay").measured
    assert measured is not None
    assert (measured.samples, measured.file) == (240, "first.csv, second.csv")
    assert len(measured.file_sha256.split(", ")) == 2


def test_joined_files_are_named_by_what_their_names_share(tmp_path: Path, clay: Samples, capsys: Captured) -> None:
    files = [write_csv(tmp_path / name, clay) for name in ("clay_run1.csv", "clay_run2.csv", "loam.csv")]
    recipe = tmp_path / "clay.toml"
    assert run("import", *files[:2], "--join", "--recipe", recipe) == 0
    assert tomllib.loads(recipe.read_text())["materials"] == ["clay-run"]
    said = refused(capsys, "import", *files[1:], "--join", "--recipe", tmp_path / "two.toml")
    assert said.startswith("--name: ")
    assert "loam.csv" in said
    assert not (tmp_path / "two.toml").exists()


def test_azimuth_and_wavelength_are_keys_of_the_recipe(tmp_path: Path, clay: Samples, capsys: Captured) -> None:
    path, recipe = write_csv(tmp_path / "clay.csv", clay), tmp_path / "clay.toml"
    assert run("import", path, "--azimuth", "forward", "--wavelength-nm", "650", "--recipe", recipe) == 0
    printed = capsys.readouterr().out
    assert "Wavelength: 650 nm." in printed
    assert "Azimuths count from the forward direction" in printed
    keys = tomllib.loads(recipe.read_text())["define"]["clay"]
    assert (keys["azimuth"], keys["wavelength_nm"]) == ("forward", 650.0)
    (job,) = recipe_file.load(recipe).measured_jobs()
    assert job.request["wavelength_nm"] == 650.0
    read = job.table.read(job.paths)
    assert read.wavelength_nm == [650.0]
    assert isinstance(read, Samples)
    assert np.cos(read.phi_r - read.phi_i) == pytest.approx(-np.cos(clay.phi_r))


COLOURED = "theta_i,theta_r,delta_phi,550nm\n30,40,50,0.1\n"
ON_AXES = "theta_i,phi_i,theta_r,phi_r,brdf\n30,20,40,50,0.1\n"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (COLOURED, "other has the channels 550nm, and clay has grey"),
        (ON_AXES, "azimuths of clay are relative to the light, and those of other to the surface"),
    ],
)
def test_files_that_do_not_fit_are_not_joined(
    tmp_path: Path, clay: Samples, capsys: Captured, text: str, sentence: str
) -> None:
    other, store = tmp_path / "other.csv", tmp_path / "store"
    other.write_text(text)
    files = (write_csv(tmp_path / "clay.csv", clay), other)
    assert sentence in refused(capsys, "import", *files, "--join", "--name", "clay", "--store", store)
    assert not store.exists()


def _hostile(folder: Path, good: Path) -> list[Path]:
    """Return files that are refused: truncated, empty, not finite, of a wrong count, and a gigabyte of zeros."""
    lines = good.read_text().splitlines()
    texts = {"count": [*lines[:9], "1,2,3", *lines[9:]], "infinite": [*lines, "10,20,30,inf"], "empty": []}
    texts |= {"below": [lines[0], "100,20,30,0.1"], "few": lines[:4], "holes": [lines[0], *["10,20,30,nan"] * 12]}
    contents = {f"{name}.csv": "\n".join(some).encode() for name, some in texts.items()}
    contents["cut.h5"] = network()[:9000]
    contents["nan.h5"] = network({"dense_1/dense_1/bias:0": np.full(21, np.nan)})
    for name, content in contents.items():
        (folder / name).write_bytes(content)
    with (folder / "zeros.csv").open("wb") as file:
        file.truncate(1 << 30)
    return [folder / name for name in (*contents, "zeros.csv", "missing.csv")]


def test_hostile_files_are_a_sentence_each_and_the_others_are_imported(
    tmp_path: Path, clay: Samples, capsys: Captured
) -> None:
    good, store = write_csv(tmp_path / "clay.csv", clay), tmp_path / "store"
    hostile = _hostile(tmp_path, good)
    assert run("import", *hostile, good, "--store", store, *ONE_JOB, "--json") == 2
    captured = capsys.readouterr()
    document = json.loads(captured.out)
    for path in hostile:
        assert sum(path.name in sentence for sentence in document["refused"]) == 1, path
    assert len(document["refused"]) == len(hostile)
    assert "Traceback" not in captured.err
    assert [path.name for path in (store / "materials").iterdir()] == ["clay"]
    assert not [*(store / ".staging").glob("*/*/table")]
    assert document["summary"]["materials"] == 1


def test_a_store_is_not_begun_for_files_that_are_all_refused(tmp_path: Path, clay: Samples, capsys: Captured) -> None:
    few = write_csv(tmp_path / "few.csv", clay.selected(np.arange(4)))
    (tmp_path / "broken.csv").write_text("theta_i,theta_r,delta_phi,brdf\n1,2,3\n")
    assert run("import", tmp_path / "broken.csv", few, "--store", tmp_path / "store", *ONE_JOB) == 2
    assert "few" in capsys.readouterr().err
    assert not (tmp_path / "store").exists()


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--reciprocal"], "--reciprocal: "),
        (["--store", "s", "--tolerance", "2"], "tolerance: 2 "),
        (["--store", "s", "--name", "foam"], "'foam' is the name of a preset"),
        (["--store", "s", "--title", ""], "title: must not be empty"),
        (["--recipe", "recipe.json"], "--recipe: 'recipe.json' does not end in .toml"),
        (["other.csv", "--store", "s", "--name", "x"], "--name: "),
        (["--store", "s", "--name", "Clay 1"], "'Clay 1' is not made of lower-case letters, digits"),
    ],
)
def test_options_that_cannot_be_are_refused_before_anything_is_read(
    tmp_path: Path, clay: Samples, capsys: Captured, monkeypatch: pytest.MonkeyPatch, options: list[str], sentence: str
) -> None:
    monkeypatch.chdir(tmp_path)
    for path in ("clay.csv", "other.csv"):
        write_csv(Path(path), clay)
    assert sentence in refused(capsys, "import", "clay.csv", *options)
    assert not Path("s").exists()


def test_files_of_one_name_are_refused_and_others_imported(
    tmp_path: Path, clay: Samples, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "A").mkdir()
    for path in ("ok.csv", "A/Ok.csv", "other.csv"):
        write_csv(Path(path), clay)
    (tmp_path / "word.csv").write_text("theta_i,theta_r,delta_phi,brdf\n10,20,0,1\n10,20,0,abc\n")
    assert run("import", "ok.csv", "A/Ok.csv", "word.csv", "other.csv", "--recipe", "other.toml") == 2
    captured = capsys.readouterr()
    assert "ok.csv and A/Ok.csv would both be 'ok'" in captured.err
    assert "word.csv: line 3, field brdf: 'abc' is not a number" in " ".join(captured.err.split())
    assert captured.out.startswith("other.csv: ")
    assert 'materials = ["other"]' in (tmp_path / "other.toml").read_text()


def test_requests_of_recipes_without_new_keys_are_those_of_before(tmp_path: Path, clay: Samples) -> None:
    """A table that was built earlier is not built again because a recipe has more keys now."""
    write_csv(tmp_path / "clay.csv", clay)
    path = tmp_path / "recipe.toml"
    path.write_text('materials = ["my-clay"]\ntolerance = 0.05\n[define.my-clay]\nsamples = "clay.csv"\n')
    request: dict[str, Any] = recipe_file.load(path).measured_jobs()[0].request
    of_table = {"format", "member", "title", "source", "reciprocal", "conserving"}
    assert set(request) == of_table | {
        "table_version", "measured_version", "measured_name", "file_sha256", "tolerance",
    }  # fmt: skip
