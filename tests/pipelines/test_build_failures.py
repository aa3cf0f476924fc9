"""Builds that fail, are broken off, or meet a second build: what each says and leaves behind."""

from __future__ import annotations

import errno
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import brdfdb
from brdfdb.errors import ParameterError, StoreError
from brdfdb.materials import Material
from brdfdb.store import files, lock
from brdfdb.store.lock import Lock
from brdfdb.tables import layout as layouts
from brdfdb.tables import tabulation
from brdfdb.tables.layout import Layout
from brdfdb_pipelines.build import build
from brdfdb_pipelines.build_survey import check_values
from brdfdb_pipelines.recipe_file import Job, Recipe, load
from brdfdb_pipelines.recipe_grids import RecipeError
from tests.pipelines.a_build import OneByOne, failing, staged, states
from tests.pipelines.command import Captured, refused, run

WAIT_S = 300.0  # for what takes a second or two where the machine has nothing else to do

# What cannot be built


def test_a_recipe_that_cannot_be_built_is_refused_before_anything_is_written(recipe: Path, tmp_path: Path) -> None:
    content = load(recipe).model_dump()
    content["grids"]["isotropic"]["theta_i_deg"] = [0.0, 90.0]
    with pytest.raises(RecipeError, match=r"^foam on grids\.isotropic: "):
        build(Recipe.model_validate(content), tmp_path / "store", OneByOne())
    assert not (tmp_path / "store").exists()


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


def test_a_system_without_file_locks_is_told_in_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lock, "fcntl", None)
    with pytest.raises(StoreError, match="this system has no file locks; use Linux or macOS"), Lock(tmp_path, "foam"):
        pass


def test_a_block_that_does_not_fit_into_the_memory_is_refused(recipe: Path, tmp_path: Path, capsys: Captured) -> None:
    command = ("build", recipe, "--store", tmp_path / "store", "--memory")
    said = refused(capsys, *command, "1MB")
    assert said.startswith("memory: a block of ")
    assert " 1 MB " in said
    assert not (tmp_path / "store").exists()
    assert run(*command, "0.1GB") == 0


def test_one_table_that_fails_takes_no_other_with_it(
    recipe: Path, tmp_path: Path, names: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    failing(monkeypatch, "foam", ZeroDivisionError("a bug"))
    events: list[dict[str, Any]] = []
    with pytest.raises(ZeroDivisionError, match="a bug"):
        build(load(recipe), tmp_path, OneByOne(), events.append)
    assert {event["material"]: event["error"] for event in events if event["event"] == "failed"} == {"foam": "a bug"}
    store = brdfdb.open(tmp_path)
    assert list(store) == sorted(set(names) - {"foam"})
    for name in store:
        store.verify(name)
    assert staged(tmp_path) == ["foam"]
    monkeypatch.undo()
    assert states(build(load(recipe), tmp_path, OneByOne()))["foam"] == ("published", "r000001", "new")
    assert staged(tmp_path) == []


@pytest.mark.parametrize(
    ("error", "code", "sentence"),
    [
        (
            KeyboardInterrupt(),
            130,
            "brdfdb: interrupted; published tables, complete blocks and realisations are preserved",
        ),
        (MemoryError("Unable to allocate 3.64 TiB"), 2, "brdfdb: Unable to allocate 3.64 TiB"),
        (StoreError("cannot write foam: No space left"), 2, "brdfdb: cannot write foam: No space left"),
    ],
)
def test_a_build_that_is_broken_off_says_so_and_the_old_revision_is_served(
    error: BaseException,
    code: int,
    sentence: str,
    changed_recipe: Path,
    store_copy: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: Captured,
) -> None:
    command = ["build", str(changed_recipe), "--store", str(store_copy), "--jobs", "1"]
    failing(monkeypatch, "foam", error)
    assert run(*command) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines()[-1].startswith(sentence)
    if code == 130:
        assert err.splitlines()[-1].endswith("to resume: brdfdb " + " ".join(command))
    assert "Traceback" not in err
    store = brdfdb.open(store_copy)
    store.verify("foam")
    assert store["foam"].revision == "r000001"
    monkeypatch.undo()
    assert run(*command) == 0
    assert store["foam"].revision == "r000002"
    assert staged(store_copy) == []


def test_a_full_disk_is_one_sentence_and_what_was_written_is_kept(
    recipe: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    root, written = tmp_path / "store", 0
    monkeypatch.setattr(layouts, "_BLOCK_VALUES", 50)
    write = files.write_file

    def fill(path: Path, data: bytes, temporary: Path, **options: bool) -> Any:
        nonlocal written
        written += len(data)
        if written > 30_000:
            raise OSError(errno.ENOSPC, "No space left on device", str(path))
        return write(path, data, temporary, **options)

    with monkeypatch.context() as patch:
        for user in ("staging.write_file", "files.write_file"):
            patch.setattr(f"brdfdb.store.{user}", fill)
        said = refused(capsys, "build", recipe, "--store", root, "--jobs", 1)
    assert said.startswith("cannot write ")
    assert said.endswith(f" to the store at {root}: No space left on device")
    markers = len(list((root / ".staging").rglob("blocks/*.json")))
    assert markers > 5
    events: list[dict[str, Any]] = []
    build(load(recipe), root, OneByOne(), events.append)
    assert sum(event.get("kept", False) for event in events) == markers
    assert staged(root) == []


# Two builds at once


def test_a_second_build_of_a_material_waits_and_then_has_nothing_to_do(
    recipe: Path, tmp_path: Path, names: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    began, go, computed = threading.Event(), threading.Event(), []
    block = tabulation.block

    def slow(layout: Layout, rows: slice) -> Any:
        computed.append(layout.source.name)
        if layout.source.name == "foam":
            began.set()
            assert go.wait(WAIT_S)
        return block(layout, rows)

    monkeypatch.setattr(tabulation, "block", slow)
    with ThreadPoolExecutor(2) as executor, ThreadPoolExecutor(1) as other:
        first = other.submit(build, load(recipe), tmp_path, executor)
        assert began.wait(WAIT_S)
        events: list[dict[str, Any]] = []

        def report(event: dict[str, Any]) -> None:
            events.append(event)
            if event == {"event": "waiting", "material": "foam"}:
                go.set()

        second = build(load(recipe), tmp_path, executor, report)
        assert {state for state, _, _ in states(first.result(WAIT_S)).values()} <= {"published", "unchanged"}
    assert sorted(computed) == sorted(names)
    assert states(second)["foam"] == ("unchanged", "r000001", "")
    assert [event["material"] for event in events if event["event"] == "waiting"].count("foam") == 1
    assert staged(tmp_path) == []


def test_a_build_waits_for_whoever_holds_the_lock(changed_recipe: Path, store_copy: Path, capsys: Captured) -> None:
    with ThreadPoolExecutor(1) as executor, Lock(store_copy, "foam"):
        done = executor.submit(build, load(changed_recipe), store_copy, OneByOne())
        deadline = time.monotonic() + WAIT_S
        while brdfdb.open(store_copy).head("blue-plastic") != "r000002":
            assert time.monotonic() < deadline
            time.sleep(0.01)
        assert not done.done()
        assert run("gc", "--keep", 1, "--store", store_copy) == 0
        assert "foam was skipped" in capsys.readouterr().out
    assert states(done.result(WAIT_S))["foam"] == ("published", "r000002", "grid changed")
