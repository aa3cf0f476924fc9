"""Measured tables from recipes: built once, shown, exported, audited, and refused in one sentence."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import brdfdb
from brdfdb.geometry import degrees
from brdfdb.materials import presets
from brdfdb.measurements import Samples
from tests.measurements.made_up import scattered
from tests.pipelines.command import Captured, run


def _csv(path: Path, samples: Samples) -> None:
    columns = [degrees(a) for a in (samples.theta_i, samples.theta_r, samples.phi_r)] + [samples.values[:, 0]]
    rows = "\n".join(",".join(f"{x:.9g}" for x in row) for row in np.stack(columns, axis=1))
    path.write_text(f"theta_i,theta_r,delta_phi,brdf\n{rows}\n")


def _recipe(folder: Path, more: str = "", tolerance: str = "tolerance = 0.2") -> Path:
    path = folder / "recipe.toml"
    path.write_text(
        f'materials = ["my-*"]\n{tolerance}\n[define.my-clay]\nsamples = "clay.csv"\ntitle = "Clay"\n'
        f'source = "run 12"\n{more}\n'
    )
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    _csv(tmp_path / "clay.csv", scattered(presets()["clay-vase"].brdf_at(None), 300, 0.03))
    return tmp_path


def test_measured_material_is_built_once_shown_audited_and_exported(folder: Path, capsys: Captured) -> None:
    store = folder / "store"
    assert run("build", _recipe(folder), "--store", store) == 0
    built = capsys.readouterr().out
    values = math.prod(brdfdb.open(store)["my-clay"].values.shape)
    assert f"1 table, {values} values" in built
    assert "my-clay   measured" in built
    assert run("build", _recipe(folder), "--store", store) == 0
    assert "1 table unchanged" in capsys.readouterr().out
    assert run("show", "my-clay", "--store", store) == 0
    shown = capsys.readouterr().out
    for words in ("run 12", "300 samples of", "error at samples held out", "noise of the samples", "extrapolated"):
        assert words in shown
    measured = brdfdb.open(store).metadata("my-clay").measured
    assert measured is not None
    assert (measured.file, len(measured.file_sha256)) == ("clay.csv", 64)
    assert run("audit", "--store", store, "--no-figures", "--report", folder / "a.json") == 0
    assert "it is measured" in capsys.readouterr().out
    assert run("export", "csv", "my-clay", "--store", store, "--out", folder / "out", "--tolerance", "0.3") == 0


def test_changed_file_and_changed_law_are_built_anew(folder: Path) -> None:
    store = folder / "store"
    assert run("build", _recipe(folder), "--store", store) == 0
    assert run("build", _recipe(folder, "conserving = true\nreciprocal = true"), "--store", store) == 0
    measured = brdfdb.open(store).metadata("my-clay").measured
    assert measured is not None
    assert [change.law for change in measured.changes] == ["reciprocal", "conserving"]
    _csv(folder / "clay.csv", scattered(presets()["clay-vase"].brdf_at(None), 200, 0.03))
    assert run("build", _recipe(folder), "--store", store) == 0
    assert brdfdb.open(store)["my-clay"].revision == "r000003"


@pytest.mark.parametrize(
    ("more", "tolerance", "sentence"),
    [
        ('base = "x"', "tolerance = 0.05", "define.my-clay.base"),
        ("reciprocal = 3", "tolerance = 0.05", "define.my-clay.reciprocal"),
        ('format = "tiff"', "tolerance = 0.05", "file_format: 'tiff' is not one of"),
        ("", "[grids]", "tolerance: is missing"),
    ],
)
def test_mistakes_are_one_sentence(folder: Path, capsys: Captured, more: str, tolerance: str, sentence: str) -> None:
    assert run("build", _recipe(folder, more, tolerance), "--store", folder / "store") == 2
    assert sentence in capsys.readouterr().err


def test_missing_file_is_named_before_anything_is_built(tmp_path: Path, capsys: Captured) -> None:
    assert run("build", _recipe(tmp_path), "--store", tmp_path / "store") == 2
    assert "clay.csv: No such file" in capsys.readouterr().err
    assert not (tmp_path / "store").exists()
