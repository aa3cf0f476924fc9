"""Tests of what trips a newcomer: cut names, missing hints, bad values of models, systems other than Linux."""

from __future__ import annotations

import importlib
import os
import re
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from brdfdb import _numba
from brdfdb.errors import ParameterError, StoreError
from brdfdb.materials import Material
from brdfdb.models import MODELS
from brdfdb.store import lock
from brdfdb.tables import _kernels
from brdfdb_pipelines import build, build_survey, recipe_file, terminal, workers
from brdfdb_pipelines.build_progress import Event
from brdfdb_pipelines.build_survey import check_values
from brdfdb_pipelines.commands import _arguments
from brdfdb_pipelines.recipe_file import Job
from tests.pipelines.command import Captured

COLUMNS = ("material", "title", "model", "error (p99)")
ROWS = [("latex-semi-gloss-brushed-sheetrock", "Semi-gloss Latex paint, brushed on sheetrock", "ward", "< 0.001 %")]


@pytest.mark.parametrize("width", [40, 60, 80, 120])
def test_a_table_never_cuts_a_name_or_a_number(width: int, monkeypatch: pytest.MonkeyPatch, capsys: Captured) -> None:
    monkeypatch.setattr(terminal, "Console", partial(Console, force_terminal=True, width=width, no_color=True))
    terminal.print_table("1 material", COLUMNS, ROWS, numbers=("error (p99)",))
    out = capsys.readouterr().out
    assert "latex-semi-gloss-brushed-sheetrock" in out
    assert "< 0.001 %" in out
    assert "error (p99)" in out


@pytest.mark.parametrize(("width", "left_out"), [(200, []), (85, ["revision"]), (62, ["revision", "title"])])
def test_a_narrow_terminal_leaves_columns_out_and_names_them(
    width: int, left_out: list[str], monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.setattr(terminal, "Console", partial(Console, force_terminal=True, width=width, no_color=True))
    columns, rows = (*COLUMNS, "revision"), [(*ROWS[0], "r000001-and-so-on")]
    terminal.print_table("1 material", columns, rows, numbers=("error (p99)",), less=("revision", "title"))
    lines = re.sub(r"\x1b\[[0-9]*m", "", capsys.readouterr().out).splitlines()
    assert max(map(len, lines)) <= width
    assert lines[-1].startswith("columns left out ") == bool(left_out)
    assert [column for column in ("revision", "title") if column not in lines[1]] == left_out
    assert lines[-1].endswith(", ".join(left_out))


def test_a_scheduler_without_a_port_is_one_sentence() -> None:
    with (
        pytest.raises(ParameterError, match=r"^--scheduler: 'nope' "),
        workers.cluster("nope"),
    ):
        pass


@pytest.mark.parametrize("bad", [np.nan, np.inf, -0.1])
def test_values_that_no_brdf_has_are_refused_with_model_and_parameters(
    bad: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    fields = {"title": "White", "model": "lambert", "source": "me", "parameters": {"rho": 0.5}}
    job = Job(Material.from_table("white", fields), None, None, 0.1)
    check_values(job)
    monkeypatch.setattr(Material, "lookup_vectors", lambda _, wi, *__: np.where(wi[:, 2] < 0.9, bad, 0.1))
    with pytest.raises(ParameterError) as caught:
        check_values(job)
    said = f"white: its model lambert with rho = 0.5 gives {bad:.3g} /sr at theta_i 30, theta_r 0, phi_r 0 degrees"
    assert str(caught.value) == f"{said}; f_r must be finite and not negative"


@pytest.fixture
def without_fcntl(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "fcntl", None)
        assert importlib.import_module(lock.__name__) is lock
        patch.setattr(lock, "fcntl", None)
        yield


@pytest.mark.usefixtures("without_fcntl")
def test_a_system_without_file_locks_is_told_in_one_sentence(tmp_path: Path) -> None:
    with (
        pytest.raises(StoreError, match="this system has no file locks; use Linux or macOS"),
        lock.Lock(tmp_path, "foam"),
    ):
        pass


def test_systems_that_do_not_tell_processors_or_memory_have_defaults(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.delattr(os, "sysconf")
    assert _arguments.processors() == os.cpu_count()
    assert build_survey.machine_memory() is None


def test_kernels_compile_in_processes_before_the_first_build_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "recipe.toml"
    path.write_text('materials = ["foam", "rolled-brass"]\ntolerance = 0.1\n', encoding="utf-8")
    recipe, events = recipe_file.load(path), list[Event]()
    pool = workers.Workers(ThreadPoolExecutor(1), lambda: 1)
    monkeypatch.setattr(workers, "processes", lambda _, **__: _Opened(pool))
    monkeypatch.setattr(build, "is_cached", lambda _: False)
    build.compile_kernels(recipe, tmp_path, 2, events.append)
    assert [event["event"] for event in events] == ["compiling", *["compiled"] * 3]
    assert events[0]["kernels"] == 3
    events.clear()
    monkeypatch.setattr(build, "is_cached", lambda _: True)
    build.compile_kernels(recipe, tmp_path, 2, events.append)
    assert events == []
    assert _numba.INTERPRETED or _numba.is_cached(_kernels.by_vectors)
    assert {"lambert", "ward"} <= {*MODELS}


class _Opened:
    """A context manager around workers."""

    def __init__(self, pool: workers.Workers) -> None:
        self.pool = pool

    def __enter__(self) -> workers.Workers:
        return self.pool

    def __exit__(self, *_: object) -> None:
        self.pool.executor.shutdown()
