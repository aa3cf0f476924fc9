"""The command `brdfdb sample`: what a training set holds, conditions and ranges, a kill, and what is refused."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
import zarr
from scipy.stats import kstest

from brdfdb.derivatives import gradient
from brdfdb.errors import ParameterError
from brdfdb.models import MODELS
from brdfdb_pipelines import sample
from tests.pipelines.command import Captured, refused, run

SINGLE = 2.0**-23  # relative rounding of float32
SMALL = ("--count", 40, "--directions", 25)


def angles(made: xr.Dataset) -> list[np.ndarray]:
    return [np.deg2rad(made[name].values) for name in ("theta_i", "phi_i", "theta_r", "phi_r")]


@pytest.mark.parametrize("model", ["ward", "oren_nayar", "he_torrance"])
def test_values_and_gradients_are_those_of_the_model(model: str, tmp_path: Path, capsys: Captured) -> None:
    out = tmp_path / "set.zarr"
    assert run("sample", model, *SMALL, "--gradients", "--out", out) == 0
    assert "40 materials" in capsys.readouterr().out
    made = xr.open_zarr(out)
    drawn = [name for name in made.coords if made[name].dims == ("material",)]
    columns = {str(name): made[name].values[:, np.newaxis] for name in drawn}
    degree = {name.removesuffix("_deg"): np.deg2rad(columns.pop(name)) for name in list(columns) if "_deg" in name}
    expected = gradient(model, *angles(made), **columns, **degree)
    np.testing.assert_allclose(made["f_r"], expected.f_r, rtol=SINGLE, atol=1e-30)
    for name, values in expected.derivatives.items():
        written = f"f_r_by_{name}_deg" if name in degree else f"f_r_by_{name}"
        scale = np.pi / 180.0 if name in degree else 1.0
        np.testing.assert_allclose(made[written], scale * values, rtol=SINGLE, atol=1e-30)
    if degree:
        assert made["f_r_by_sigma_deg"].attrs["units"] == "1/sr/degree"
    assert made.attrs["model_version"] == MODELS[model].version
    assert made.attrs["seed"] == 0
    assert set(made.attrs["ranges"]) == set(drawn)


def test_materials_keep_condition_and_ranges_and_directions_are_even(tmp_path: Path) -> None:
    out = tmp_path / "set.zarr"
    given = ("--range", "alpha_x=0.1:0.2", "--range", "rho_d=0:0.7", "--seed", 3)
    assert run("sample", "ward", "--count", 3000, "--directions", 500, *given, "--out", out) == 0
    made = xr.open_zarr(out)
    assert np.all(made["rho_d"] + made["rho_s"] <= 1.0)
    assert np.all(made["alpha_y"] <= made["alpha_x"])
    assert 0.1 <= float(made["alpha_x"].min()) <= float(made["alpha_x"].max()) <= 0.2
    assert made.attrs["ranges"]["alpha_x"] == [0.1, 0.2]
    for name in ("theta_i", "theta_r"):
        cosines = np.sort(np.cos(np.deg2rad(made[name].values)))
        assert np.all(np.floor(cosines * 500) == np.arange(500))  # one in each stratum
    assert kstest(made["phi_i"] / 360.0, "uniform").pvalue > 0.01


def test_the_same_seed_draws_the_same_set(tmp_path: Path) -> None:
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        assert run("sample", "oren_nayar", *SMALL, "--seed", seed, "--out", tmp_path / name) == 0
    a, b, c = (xr.open_zarr(tmp_path / name).load() for name in "abc")
    xr.testing.assert_identical(a, b)
    assert not np.array_equal(a["rho"], c["rho"])


# Writes a set; from the second chunk on each takes a quarter of a second
SLOW = """
import sys, time
from brdfdb_pipelines import cli, sample
values = sample.TrainingSet.values

def slow(made, chunk):
    time.sleep(0.25 * (chunk > 1))
    return values(made, chunk)

sample.TrainingSet.values = slow
sys.exit(cli.main(sys.argv[1:]))
"""


def test_a_killed_set_does_not_look_complete_and_goes_on(tmp_path: Path) -> None:
    whole, out = tmp_path / "whole.zarr", tmp_path / "set.zarr"
    sizes = ("--chunk", "500", "--shard", "500")
    arguments = ("sample", "ward", "--count", "12000", "--directions", "2000", *sizes, "--jobs", "1")
    command = [sys.executable, "-c", SLOW, *arguments, "--out", str(out)]
    partial = tmp_path / "set.zarr.partial"
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    while process.poll() is None and len([*partial.glob("f_r/c/*/0")]) < 2:
        time.sleep(0.001)
    os.kill(process.pid, signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    assert not out.exists()
    with pytest.raises((FileNotFoundError, ValueError)):
        xr.open_zarr(partial, consolidated=False)
    kept = {path: path.stat().st_mtime_ns for path in partial.glob("f_r/c/*/0")}
    assert 2 <= len(kept) < 24
    assert run(*arguments[:-2], "--seed", 1, "--out", out) == 2  # another set
    assert run(*arguments, "--out", out) == 0
    assert not partial.exists()
    assert all((out / path.relative_to(partial)).stat().st_mtime_ns == at for path, at in kept.items())
    assert run(*arguments, "--out", whole) == 0
    xr.testing.assert_identical(xr.open_zarr(out).load(), xr.open_zarr(whole).load())


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("lambert", "--gradients"), "--gradients: lambert has no derivatives; "),
        (("lambrt",), "model: 'lambrt' is not one of "),
        (("ward", "--range", "rho=0:1"), "--range rho: the parameters of ward are rho_d, rho_s, alpha_x, alpha_y"),
        (("ward", "--range", "rho_d=0:2"), "--range rho_d: 0:2 is no range within [0, 1]"),
        (("ward", "--range", "rho_d=0.3:0.1"), "--range rho_d: 0.3:0.1 is no range within [0, 1]"),
        (("ward", "--range", "rho_d=nan:1"), "--range rho_d: nan:1 is no range within [0, 1]"),
        (("ward", "--range", "rho_d=0.3"), "--range rho_d=0.3: "),
        (("ward", "--range", "rho_d=0.9:1", "--range", "rho_s=0.9:1"), "--range: 0 of 4000 materials keep rho_d + "),
        (("ward", "--range", "rho_d=0:1", "--range", "rho_d=0:0.5"), "--range rho_d: "),
        (("ward", "--seed", "-1"), "--seed: -1 "),
        (("ward", "--shard", "100"), "--shard: needs --chunk"),
        (("ward", "--shard", "100", "--chunk", "30"), "--shard: 100 is not a multiple of 30, the materials of a chunk"),
        (("ward", "--test", "1"), "--test: 1 of 40 materials are none or all; give a share such as 0.1"),
        (("ward", "--test", "0.01"), "--test: 0.01 of 40 materials are none or all; "),
        (("ward", "--test", "nan"), "--test: nan of 40 materials "),
        (("ward", "--test", "-0.1"), "--test: -0.1 of 40 materials "),
        (("lambert", "--test", "0.1", "--range", "rho=0.5:0.5"), "--test: the ranges are so narrow that a material "),
    ],
)
def test_what_is_refused(arguments: tuple[str, ...], sentence: str, tmp_path: Path, capsys: Captured) -> None:
    assert refused(capsys, "sample", *arguments, *SMALL, "--out", tmp_path / "set.zarr").startswith(sentence)
    assert [*tmp_path.iterdir()] == []


def test_one_process_writes_a_set(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured) -> None:
    out, shards = tmp_path / "set.zarr", sample._write_shards

    def beside(*made: Any) -> None:
        said = refused(capsys, "sample", "ward", *SMALL, "--seed", 3, "--out", out)
        assert f"another process is writing {out}.partial" in said
        shards(*made)

    monkeypatch.setattr(sample, "_write_shards", beside)
    assert run("sample", "ward", *SMALL, "--out", out) == 0
    assert xr.open_zarr(out).attrs["seed"] == 0
    assert not list(tmp_path.glob("*.partial"))


def test_a_set_that_lacks_only_its_name_is_not_mixed_with_another(tmp_path: Path, capsys: Captured) -> None:
    out = tmp_path / "set.zarr"
    assert run("sample", "ward", *SMALL, "--out", out) == 0
    values = xr.open_zarr(out)["f_r"].values
    partial = out.rename(tmp_path / "set.zarr.partial")
    assert "is part of another set" in refused(capsys, "sample", "ward", *SMALL, "--seed", 3, "--out", out)
    assert run("sample", "ward", *SMALL, "--out", out) == 0
    assert np.array_equal(xr.open_zarr(out)["f_r"].values, values)
    assert not partial.exists()


def test_files_of_others_are_left_alone(tmp_path: Path, capsys: Captured) -> None:
    out, note = tmp_path / "set.zarr", tmp_path / "set.zarr.partial" / "notes.txt"
    note.parent.mkdir()
    note.write_text("mine", encoding="utf-8")
    assert f"{out}.partial contains files" in refused(capsys, "sample", "ward", *SMALL, "--out", out)
    assert [file.name for file in note.parent.iterdir()] == ["notes.txt"]
    out.write_text("mine", encoding="utf-8")
    assert f"{out} exists already" in refused(capsys, "sample", "ward", *SMALL, "--out", out)
    assert out.read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_materials_keep_a_condition_too(count: int, tmp_path: Path) -> None:
    for seed in range(10):
        out = tmp_path / f"{seed}.zarr"
        assert run("sample", "ward", "--count", count, "--directions", 5, "--seed", seed, "--out", out) == 0
        assert xr.open_zarr(out).sizes["material"] == count


def test_memory_is_that_of_a_chunk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sizes = []
    values = sample.TrainingSet.values

    def noted(made: sample.TrainingSet, chunk: int) -> list[np.ndarray]:
        arrays = values(made, chunk)
        sizes.append(arrays[0].size)
        return arrays

    monkeypatch.setattr(sample.TrainingSet, "values", noted)
    sample.run("ward", tmp_path / "set.zarr", count=3000, directions=1000)
    assert max(sizes) <= 2**18
    assert len(sizes) == 12


def test_chunks_lie_in_shards_that_zarr_reads(tmp_path: Path, capsys: Captured) -> None:
    out, usual = tmp_path / "set.zarr", tmp_path / "usual.zarr"
    arguments = ("sample", "ward", "--count", 1000, "--directions", 20, "--gradients")
    assert run(*arguments, "--chunk", 48, "--shard", 144, "--out", out) == 0
    assert "48 materials a chunk, 144 a file" in capsys.readouterr().out
    assert run(*arguments, "--out", usual) == 0
    array = zarr.open_array(out / "f_r")
    assert (array.chunks, array.shards) == ((48, 20), (144, 20))
    assert len([*out.glob("f_r/c/*/0")]) == 7
    xr.testing.assert_identical(xr.open_zarr(out).load(), xr.open_zarr(usual).load())
    data = bytearray((out / "f_r/c/3/0").read_bytes())
    data[1000] ^= 1
    (out / "f_r/c/3/0").write_bytes(data)
    assert np.isfinite(array[:432]).all()
    with pytest.raises(ValueError, match="checksum"):
        array[432:576]


def test_usual_chunks_are_a_megabyte_in_files_of_32(tmp_path: Path) -> None:
    for directions, rows, shards in ((1000, 262, 32), (3, 87_381, 32), (1_000_000, 1, 8)):
        angles = {"theta_i": np.zeros(directions)}
        made = sample.TrainingSet(MODELS["ward"], [], {"rho_d": np.zeros(20_000_000)}, angles, gradients=False)
        assert (made.rows, made.chunks_of_shard) == (rows, shards)
    with pytest.raises(ParameterError, match=r"^--chunk: 300 materials take 1\.2 GB; at most 134 are allowed$"):
        sample.run("ward", tmp_path / "set.zarr", count=300, directions=1_000_000, chunk=300)


def test_no_material_is_in_train_and_test(tmp_path: Path) -> None:
    out, other = tmp_path / "set.zarr", tmp_path / "other.zarr"
    arguments = ("sample", "oren_nayar", "--count", 2000, "--directions", 5)
    assert run(*arguments, "--test", 0.15, "--out", out) == 0
    assert run(*arguments, "--out", other) == 0
    made, whole = xr.open_zarr(out), xr.open_zarr(other)
    assert made.attrs["split"] == {"train": [0, 1700], "test": [1700, 2000]}
    assert "no material is in both" in made.attrs["split_rule"]
    assert "split" not in whole.attrs
    np.testing.assert_array_equal(made["f_r"], whole["f_r"])
    train, test = (made.isel(material=slice(*made.attrs["split"][part])) for part in ("train", "test"))
    for name in ("rho", "sigma_deg"):
        assert not set(train[name].values) & set(test[name].values)
        assert kstest(test[name], train[name]).pvalue > 0.01


@pytest.mark.parametrize("name", ["set.npz", "set.nc", "set.h5"])
def test_names_of_files_are_refused(name: str, tmp_path: Path, capsys: Captured) -> None:
    said = refused(capsys, "sample", "ward", *SMALL, "--out", tmp_path / name)
    assert said.endswith(f"{name} is no name of a training set, a folder that zarr reads; let it end in .zarr")
    assert [*tmp_path.iterdir()] == []
