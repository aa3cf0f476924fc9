"""Violations planted in stored tables, with manifests that agree: `brdfdb audit` names each, and its exit code is 1."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import xarray as xr

import brdfdb
from brdfdb.audit import sampling
from brdfdb.store.publication import publish_dataset
from brdfdb_pipelines import cli
from tests.audit.model_energies import each_model_once
from tests.pipelines.command import Captured
from tests.pipelines.recipes import anisotropic, isotropic, material

DEFINED = """\
title = "A metal, and a material so dark that half as much light again conserves energy"
materials = ["scene-copper-sphere", "dark"]
wavelengths_nm = [{ start = 400, stop = 700, step = 25 }]
""" + material("dark", "Dark", "oren_nayar", "rho = 0.3", "sigma_deg = 20")
THETA, DELTA_PHI = "[{ start = 0, stop = 85, step = 5 }, 87.5, 89.5]", "[{ start = 0, stop = 180, step = 10 }]"
GRIDS = isotropic(THETA, DELTA_PHI) + isotropic(THETA, DELTA_PHI, kind="spectral") + anisotropic()
RECIPES = {"planned": DEFINED.replace("[define.dark]", "tolerance = 0.02\n[define.dark]"), "plain": DEFINED + GRIDS}

__all__ = ["each_model_once"]
pytestmark = pytest.mark.usefixtures("each_model_once")  # what is planted is in the tables

Change = Callable[[xr.Dataset], xr.Dataset]


@pytest.fixture(autouse=True)
def few_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is planted is in the tables, not in the samplers."""
    monkeypatch.setattr("brdfdb.audit.sampling.SAMPLES", 2000)


@pytest.fixture(scope="module", params=RECIPES)
def sound(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store of sound tables, planned or on plain grids."""
    root = tmp_path_factory.mktemp(request.param)
    recipe = root / "recipe.toml"
    recipe.write_text(RECIPES[request.param], encoding="utf-8")
    assert cli.main(["build", str(recipe), "--store", str(root / "store")]) == 0
    return root / "store"


class Audited(NamedTuple):
    """The exit code and the report of an audit."""

    code: int
    report: dict[str, Any]

    @property
    def entry(self) -> dict[str, Any]:
        """The only material of the report."""
        (entry,) = self.report["materials"]
        assert isinstance(entry, dict)
        return entry


def audited(root: Path, name: str, dataset: xr.Dataset | None = None) -> Audited:
    """Publish a table if one is given, and audit it in this process: what is patched here is patched there."""
    if dataset is not None:
        publish_dataset(root, name, dataset)
    report = root.with_name("report.json")
    code = cli.main(["audit", name, "--all", "--jobs", "1", "--store", str(root), "--report", str(report)])
    return Audited(code, json.loads(report.read_text(encoding="utf-8")))


def table_of(root: Path, name: str) -> xr.Dataset:
    """Return a stored table, to be changed."""
    return xr.open_zarr(brdfdb.open(root).path(name)).load()


def numbers(dataset: xr.Dataset) -> np.ndarray:
    """What is stored of the table, to be changed in place: f_r, logarithms or parts of a spectrum of them."""
    values: np.ndarray = dataset["brdf" if "brdf" in dataset else "parts"].values
    return values


def of_logarithms(dataset: xr.Dataset) -> bool:
    return bool(dataset.attrs["interpolation"]["logarithm"])


def scaled(dataset: xr.Dataset) -> xr.Dataset:
    factor = np.float32(1.5)
    if "spectra" in dataset:  # rows are orthonormal: what they make of one logarithm at all wavelengths
        numbers(dataset)[...] += np.log(factor) * dataset["spectra"].values.sum(axis=1).astype(np.float32)
    elif of_logarithms(dataset):
        numbers(dataset)[...] += np.log(factor)
    else:
        numbers(dataset)[...] *= factor
    dataset.attrs["interpolation"]["offset"] *= 1.5
    return dataset.assign(uniform=factor * dataset["uniform"]) if "uniform" in dataset else dataset


def not_reciprocal(dataset: xr.Dataset) -> xr.Dataset:
    numbers(dataset)[3, 5] *= np.float32(1.01)
    return dataset


def negative(dataset: xr.Dataset) -> xr.Dataset:
    if of_logarithms(dataset):  # no logarithm is that of a negative number, but a part beside them may be one
        return dataset.assign(uniform=-0.2)
    numbers(dataset)[2, 3, 1] = -0.01
    return dataset


def not_a_number(dataset: xr.Dataset) -> xr.Dataset:
    numbers(dataset)[2, 3, 1] = np.nan
    return dataset


def jumping(dataset: xr.Dataset) -> xr.Dataset:
    azimuth = dataset["delta_phi"].values / 60.0  # means nothing of light from the normal, the first row
    numbers(dataset)[0] *= (1.0 + azimuth).reshape(-1, *(1,) * (numbers(dataset).ndim - 3)).astype(np.float32)
    return dataset


@pytest.mark.usefixtures("no_plots")
@pytest.mark.parametrize("name", ["scene-copper-sphere", "dark"])
def test_a_sound_table_is_exit_code_0(name: str, sound: Path) -> None:
    assert audited(sound, name).code == 0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (scaled, "99 of 100 fresh values are within "),
        (not_reciprocal, "not reciprocal"),
        (negative, " values are negative; the smallest f_r is "),
        (not_a_number, " lookups are not finite"),
        (jumping, "the table jumps by "),
    ],
    ids=lambda value: value.__name__ if callable(value) else "",
)
@pytest.mark.parametrize("name", ["scene-copper-sphere", "dark"])
def test_a_planted_violation_is_named_and_is_exit_code_1(
    name: str, change: Change, said: str, sound: Path, tmp_path: Path, request: pytest.FixtureRequest, capsys: Captured
) -> None:
    if name != "dark":  # the page of a spoilt table is drawn once for each change
        request.getfixturevalue("no_plots")
    found = audited(tmp_path / "store", name, change(table_of(sound, name)))
    assert found.code == 1
    lines = capsys.readouterr().out.splitlines()
    assert any(line.startswith(f"{name}: ") and said in line for line in lines)
    assert (found.entry["material"], found.entry["revision"], found.entry["verdict"]) == (name, "r000001", "violates")
    assert cli.main(["verify", "--store", str(tmp_path / "store")]) == 0  # the files are those of the manifest
    if change is scaled and name == "dark":  # caught by its error alone, although it reflects little
        findings = found.entry["findings"]
        assert findings["energy"]["table"]["max_albedo"] < 0.5
        words = [findings["energy"]["table"]["verdict"], findings["reciprocity"]["verdict"]]
        assert [*words, findings["smoothness"]["verdict"]] == ["passes", "passes", "passes"]
        assert findings["table_error"]["verdict"] == "violates"
        assert findings["table_error"]["fresh_p99"] == pytest.approx(0.5, abs=0.05)


@pytest.mark.usefixtures("no_plots")
def test_a_mirror_part_that_is_too_weak_is_named(sound: Path, tmp_path: Path, capsys: Captured) -> None:
    name = "scene-copper-sphere"
    dataset = table_of(sound, name)
    dataset["specular_reflectance"].values[...] *= np.float32(0.98)
    found = audited(tmp_path / "store", name, dataset)
    assert found.code == 1
    assert "; the specular part is off by up to 0.0" in capsys.readouterr().out
    assert found.entry["findings"]["table_error"]["specular"] == pytest.approx(0.02 * 0.2, abs=0.02)


def test_a_table_that_does_not_name_its_source_is_not_judged_and_is_exit_code_1(
    sound: Path, tmp_path: Path, capsys: Captured
) -> None:
    dataset = table_of(sound, "dark")
    dataset.attrs = {key: value for key, value in dataset.attrs.items() if key not in ("source_record", "request")}
    found = audited(tmp_path / "store", "other", dataset)
    assert found.code == 1
    line = "other: its source cannot be evaluated; not judged: nodes, table error, sampling, validity, record\n"
    assert line in (out := capsys.readouterr().out)
    assert "passes 0, known published excess 0, not judged 1, violates 0" in out
    entry = found.entry
    assert (entry["model"], entry["verdict"], entry["findings"]["energy"]["model"]) == ("", "not judged", None)
    assert found.report["not_judged"] == ["other"]
    assert audited(tmp_path / "store", "other", negative(dataset)).code == 1


def test_a_sampler_that_weighs_too_much_is_named(
    sound: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    real = sampling.sample

    def heavier(*arguments: Any, **parameters: Any) -> Any:
        drawn = real(*arguments, **parameters)
        return drawn._replace(weight=1.5 * drawn.weight)

    monkeypatch.setattr(sampling, "sample", heavier)
    assert audited(sound, "dark").code == 1
    said = "dark: samples of the model have a wrong density or a wrong albedo; "
    assert said in capsys.readouterr().out
