"""Memory and disk that a build expects to take: more than it does take, and refused where there is less."""

from __future__ import annotations

import json
import os
import tracemalloc
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import brdfdb
from brdfdb.materials import presets
from brdfdb.store import records, staging
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Interpolation, Layout
from brdfdb_pipelines import build_survey
from brdfdb_pipelines.commands import _arguments
from tests.pipelines.command import Captured, refused, run

LOG = Interpolation("cubic", True, 1e-4)
WAVELENGTHS = np.linspace(400.0, 700.0, 31)


def layout(name: str, half: bool, how: Interpolation, nodes: int, rows: int) -> Layout:
    """A table whose rows hold many directions."""
    material = presets()[name]
    first, second, third = ("theta_h", "theta_d", "phi_d") if half else ("theta_i", "theta_r", "delta_phi")
    axes = {first: np.linspace(0, 80, rows), second: np.linspace(0, 80, nodes)}
    axes[third] = np.linspace(0, 90 if half else 180, nodes)
    return Layout(material, Grid(axes), WAVELENGTHS if material.spectral else None, interpolation=how)


@pytest.mark.parametrize(
    "table",
    [
        pytest.param(layout("foam", False, Interpolation(), 600, 5), id="grey"),
        pytest.param(layout("foam", True, LOG, 600, 5), id="half vectors"),
        pytest.param(layout("scene-copper-sphere", False, Interpolation(), 100, 5), id="spectral"),
        pytest.param(layout("scene-copper-sphere", True, LOG, 100, 20), id="spectral half vectors"),
    ],
)
def test_a_task_takes_at_most_the_memory_that_is_expected_and_not_a_tenth_of_it(table: Layout, tmp_path: Path) -> None:
    records.make_store(tmp_path / "store")
    text = json.dumps(table.document())
    directory = str(staging.prepare(tmp_path / "store", table.source.name, {"asked": "by a test"}, text))
    staging.write_block(directory, text, 0)  # the first time kernels are compiled
    for path in Path(directory, "blocks").iterdir():
        path.unlink()
    peaks = []
    tracemalloc.start()
    for number in range(len(table.blocks)):
        tracemalloc.reset_peak()
        staging.write_block(directory, text, number)
        peaks.append(tracemalloc.get_traced_memory()[1])
    tracemalloc.reset_peak()
    staging.write_frame(directory, text)
    peaks.append(tracemalloc.get_traced_memory()[1])
    tracemalloc.stop()
    assert 0.1 * build_survey.memory_of_task(table) <= max(peaks) <= build_survey.memory_of_task(table)


def test_a_disk_that_is_too_small_is_one_sentence_before_anything_is_written(
    recipe: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.setattr(build_survey.shutil, "disk_usage", lambda _: SimpleNamespace(free=10_000))
    root = tmp_path / "store"
    said = refused(capsys, "build", recipe, "--store", root)
    assert said.startswith("disk: the tables take up to ")
    assert said.endswith(f" kB, and {root} has 10 kB free")
    assert not root.exists()


@pytest.mark.parametrize(("free", "staged"), [(100, []), (10_000, ["rolled-brass"])])
def test_a_disk_too_small_for_planned_tables_leaves_nothing(
    free: int, staged: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    planned = tmp_path / "planned.toml"
    planned.write_text('materials = ["foam", "rolled-brass"]\ntolerance = 0.01\n', encoding="utf-8")
    monkeypatch.setattr(build_survey.shutil, "disk_usage", lambda _: SimpleNamespace(free=free))
    names: list[str] = []

    def write_block(directory: str, *given: Any, **options: bool) -> staging.Block:
        names.append(Path(directory).parent.name)
        return staging.write_block(directory, *given, **options)

    monkeypatch.setattr(build_survey, "write_block", write_block)
    root = tmp_path / "store"
    assert refused(capsys, "build", planned, "--store", root, "--jobs", 1).startswith("disk: the tables take up to ")
    assert not root.exists()
    assert names == staged


def test_an_unchanged_recipe_needs_no_free_disk(
    recipe: Path, store_copy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(build_survey.shutil, "disk_usage", lambda _: SimpleNamespace(free=0))
    assert run("build", recipe, "--store", store_copy) == 0
    assert brdfdb.open(store_copy).head("foam") == "r000001"


def test_systems_that_do_not_tell_processors_or_memory_have_defaults(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.delattr(os, "sysconf")
    assert _arguments.processors() == os.cpu_count()
    assert build_survey.machine_memory() is None
