"""Measured tables in scenes: rendered, and chosen for, whatever their channels and symmetries."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import brdfdb
from brdfdb.measurements import MeasuredSource
from brdfdb.parameters import Floats
from brdfdb.store.publication import publish
from brdfdb.tables.table import TableSource
from tests.pipelines.command import Captured, refused, run

SPECTRUM_NM = np.array([450.0, 550.0, 650.0])
SCENE = """
store = "store"
wavelengths_nm = [400, 420, 440, 460, 480, 500, 520, 540, 560, 580, 600, 620, 640, 660, 680]
lights = [{{ direction = [-0.5, -1, 1] }}]
camera = {{ position = [0, -5, 0.7], target = [0, 0, 0.5], height = 1.2 }}
{first}
[[objects]]
name = "ball"
material = "store:{name}"
shape = {{ kind = "sphere", radius = 0.5, position = [0, 0, 0.5] }}
"""


def _one_way(wi: Floats, wr: Floats) -> Floats:
    return 0.1 + 0.1 * wi[:, 2:] + 0.0 * wr[:, 2:]


def _turned(wi: Floats, wr: Floats) -> Floats:
    return 0.1 + 0.05 * (wi[:, :1] - wr[:, :1]) ** 2


def _colours(wi: Floats, wr: Floats) -> Floats:
    return np.asarray(_one_way(wi, wr) * [1.0, 0.5, 0.2])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with a table that is not reciprocal, one of an anisotropic surface, and others with colours."""
    directory = tmp_path_factory.mktemp("scenes")
    nanometres = ("450nm", "550nm", "650nm")
    for name, f_r, channels, at in (
        ("grey", _one_way, ("grey",), None),
        ("turned", _turned, ("grey",), None),
        ("rgb", _colours, ("R", "G", "B"), None),
        ("spectral", _colours, nanometres, SPECTRUM_NM),
    ):
        source = MeasuredSource.of_function(f_r, channels, at, name=name, title=name, provenance="made up")
        publish(directory / "store", source, tolerance=0.1)
    return directory


def _scene(folder: Path, name: str, first: str = "") -> Path:
    path = folder / f"{name}.toml"
    path.write_text(SCENE.format(name=name, first=first))
    return path


@pytest.mark.parametrize("name", ["grey", "turned", "rgb", "spectral"])
def test_measured_tables_are_rendered_and_chosen_for(folder: Path, name: str) -> None:
    scene = _scene(folder, name, "hold_ends = true")
    assert run("render", scene, "--width", 12, "--out", folder / name) == 0
    assert (folder / name / f"{name}.png").stat().st_size > 0
    assert run("choose", scene, "--width", 8, "--out", folder / name) == 0
    (material,) = json.loads((folder / name / "choice.json").read_text())["materials"]
    assert material["material"] == f"store:{name}"
    assert material["whole"]["counted"] <= 1.0


def test_remedy_for_wavelengths_beyond_the_data_is_said(folder: Path, capsys: Captured) -> None:
    sentence = refused(capsys, "render", _scene(folder, "spectral"), "--width", 12, "--out", folder / "no")
    assert "400 is outside [450, 650] nm of store:spectral; set hold_ends = true" in sentence
    assert "range within it" not in sentence  # no scene has less than 420 to 680 nm
    sentence = refused(capsys, "render", _scene(folder, "rgb"), "--width", 12, "--out", folder / "no")
    assert "give the scene a range within it, or set hold_ends = true" in sentence


def test_ends_that_are_held_are_those_of_the_table(folder: Path) -> None:
    table = brdfdb.open(folder / "store")["spectral"]
    source = TableSource(table, np.array([400.0, 500.0, 700.0]))
    angles = (0.4, 0.0, 0.6, 2.0)
    at = source.lookup(*angles, wavelength_nm=[400.0, 500.0, 700.0])
    np.testing.assert_array_equal(at, table.lookup(*angles, wavelength_nm=[450.0, 500.0, 650.0]))


def test_a_table_that_is_not_reciprocal_is_no_reciprocal_source(folder: Path) -> None:
    table = brdfdb.open(folder / "store")["grey"]
    assert not TableSource(table).reciprocal
