"""The build job: what is missing is built, what is there is left alone, and what a failure leaves behind."""

from __future__ import annotations

import json
import re
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray

import brdfdb
from brdfdb import _numba
from brdfdb.errors import StoreError
from brdfdb.materials import Material
from brdfdb.tables import _kernels, tabulation
from brdfdb.tables import layout as layouts
from brdfdb.tables.layout import Layout, digest
from brdfdb.tables.xarray_view import plain_attributes
from brdfdb_pipelines import build as builds
from brdfdb_pipelines import build_survey, workers
from brdfdb_pipelines.build import build
from brdfdb_pipelines.recipe_file import Job, load
from brdfdb_pipelines.workers import Workers
from tests.pipelines.a_build import OneByOne, chunks, failing, staged, states
from tests.pipelines.command import Captured, run
from tests.pipelines.recipes import recipe_file_of

# What is built


def test_what_was_built_is_told_in_the_order_of_the_recipe(recipe: Path, tmp_path: Path, names: list[str]) -> None:
    events: list[dict[str, Any]] = []
    plan = load(recipe)
    with ThreadPoolExecutor(3) as executor:
        built = build(plan, tmp_path, Workers(executor, lambda: 3), events.append)
    assert [b.job.material.name for b in built] == names
    assert states(built) == dict.fromkeys(names, ("published", "r000001", "new"))
    blocks = [event for event in events if event["event"] == "block"]
    total = sum(job.layout().size for job in plan.jobs())
    assert (blocks[-1]["values_done"], blocks[-1]["values_total"]) == (total, total)
    store = brdfdb.open(tmp_path)
    assert list(store) == sorted(names)
    for b in built:
        files = [path for path in store.path(b.job.material.name).rglob("*") if path.is_file()]
        assert b.stored_bytes == sum(path.stat().st_size for path in files)
        store.verify(b.job.material.name)
    assert staged(tmp_path) == []


def test_tables_are_those_of_tabulate_with_the_request_beside_them(recipe: Path, built: Path) -> None:
    store = brdfdb.open(built)
    for job in load(recipe).jobs():
        expected = tabulation.tabulate(job.layout())
        whole = json.loads(json.dumps(job.request))
        request = {key: value for key, value in whole.items() if key not in ("material", "model_version")}
        assert store.metadata(job.material.name).whole_request == whole
        assert Material.model_validate(whole["material"]) == job.material
        with store.dataset(job.material.name) as found:
            attrs = store[job.material.name].attrs
            measured = {key: attrs[key] for key in ("error", "formula_error", "largest_albedo")}
            of_build = {"request": request, "request_sha256": digest(whole), **measured}
            expected.attrs = plain_attributes(expected.attrs | of_build)
            xr.testing.assert_identical(found.load(), expected)
        assert store.summary(job.material.name)["request_sha256"] == digest(whole)


WARD = """
[define.{name}]
title = "A test"
model = "ward"
source = "a test"
[define.{name}.parameters]
rho_d = {rho_d}
rho_s = {rho_s}
alpha_x = 0.1
alpha_y = {alpha_y}
"""


def test_a_build_names_a_material_that_reflects_more_than_it_receives(tmp_path: Path, capsys: Captured) -> None:
    path = tmp_path / "recipe.toml"
    define = [WARD.format(name=name, rho_d=0.6, rho_s=rho_s, alpha_y=0.1) for name, rho_s in (("a", 0.2), ("b", 0.6))]
    path.write_text('materials = ["a", "b", "blue-plastic"]\ntolerance = 0.1\n' + "".join(define))
    assert run("build", path, "--store", tmp_path / "store", "--jobs", 1) == 0
    (said,) = [line for line in capsys.readouterr().out.splitlines() if "reflects more" in line]
    assert said.startswith("b reflects more light than it receives: albedo of the model 1.")


OF_A_WAVELENGTH = 100  # bytes that a wavelength adds to a mixture; measured: 80


@pytest.mark.parametrize("alpha_y", [0.1, 0.15])
def test_a_colour_takes_less_than_twice_the_bytes_of_grey_and_some_for_added_wavelengths(
    tmp_path: Path, alpha_y: float
) -> None:
    path = tmp_path / "recipe.toml"
    parameters = {
        "grey": ("0.2", "0.05"),
        "srgb": ('{ srgb = "#6b2424" }', '{ srgb = "#20201a" }'),
        "patches": ('{ measured = "BabelColor Average/orange" }', '{ measured = "BabelColor Average/cyan" }'),
    }
    path.write_text(
        f"materials = {list(parameters)}\ntolerance = 0.01\n"
        "wavelengths_nm = [{ start = 380, stop = 730, step = 8.75 }]\n"
        + "".join(WARD.format(name=name, rho_d=d, rho_s=s, alpha_y=alpha_y) for name, (d, s) in parameters.items())
    )
    with ThreadPoolExecutor(1) as executor:
        built = build(load(path), tmp_path / "store", Workers(executor, lambda: 1), lambda _: None)
    stored = {b.job.material.name: b.stored_bytes for b in built}
    assert built[1].job.wavelength_nm is not None
    assert built[1].job.wavelength_nm.size == 41
    for table in built[1:]:
        assert 0 < (added := table.wavelengths - 41) < 41
        assert stored[table.job.name] < 2 * stored["grey"] + OF_A_WAVELENGTH * added


def test_the_largest_table_comes_first_and_the_number_of_workers_changes_nothing(
    recipe: Path, built: Path, tmp_path: Path, names: list[str]
) -> None:
    executor = OneByOne()
    build(load(recipe), tmp_path, executor)
    sizes = {job.material.name: job.layout().size for job in load(recipe).jobs()}
    groups = [args[1] for task, args in executor.submitted if task == "build_group"]
    blocks = [job.name for group in groups for job, _ in group]
    assert sorted(blocks) == sorted(names)
    assert [sizes[name] for name in blocks] == sorted(sizes.values(), reverse=True)
    assert all(chunks(tmp_path, name) == chunks(built, name) for name in names)


def test_a_layout_is_planned_on_a_worker_and_at_most_once(
    recipe: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan, planned, plan_of = load(recipe), [], Job.planned
    jobs = plan.jobs()

    def plan_it(job: Job) -> tuple[Layout, NDArray[np.float32] | None]:
        planned.append((job.material.name, threading.current_thread().name))
        return plan_of(job)

    monkeypatch.setattr(Job, "planned", plan_it)
    failing(monkeypatch, "foam", StoreError("no space"))
    with ThreadPoolExecutor(2, thread_name_prefix="worker") as executor, pytest.raises(StoreError):
        build(plan, tmp_path, executor)
    assert sorted(name for name, _ in planned) == sorted(job.material.name for job in jobs)
    assert all(thread.startswith("worker") for _, thread in planned)
    monkeypatch.undo()
    monkeypatch.setattr(Job, "planned", lambda _: pytest.fail("planned again"))
    assert {state for state, _, _ in states(build(plan, tmp_path, OneByOne())).values()} <= {"published", "unchanged"}


def test_kernels_compile_in_processes_before_the_first_build_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recipe = load(recipe_file_of(tmp_path, 'materials = ["foam", "rolled-brass"]\ntolerance = 0.1\n'))
    events: list[dict[str, Any]] = []
    monkeypatch.setattr(workers, "processes", lambda count, **_: workers.threads(count))
    monkeypatch.setattr(builds, "is_cached", lambda _: False)
    builds.compile_kernels(recipe, tmp_path, 2, events.append)
    assert [event["event"] for event in events] == ["compiling", *["compiled"] * 3]
    assert events[0]["kernels"] == 3
    events.clear()
    monkeypatch.setattr(builds, "is_cached", lambda _: True)
    builds.compile_kernels(recipe, tmp_path, 2, events.append)
    assert events == []
    assert _numba.INTERPRETED or _numba.is_cached(_kernels.by_vectors)


# What is not built again


def test_an_unchanged_recipe_does_nothing(recipe: Path, store_copy: Path, names: list[str]) -> None:
    before = {path: path.stat().st_mtime_ns for path in (store_copy / "materials").rglob("*")}
    executor = OneByOne()
    assert states(build(load(recipe), store_copy, executor)) == dict.fromkeys(names, ("unchanged", "r000001", ""))
    assert {task for task, _ in executor.submitted} == {"survey_group"}
    assert len(executor.submitted) <= len(names)
    assert {path: path.stat().st_mtime_ns for path in (store_copy / "materials").rglob("*")} == before


def test_a_changed_recipe_is_a_new_revision_and_says_why(
    changed_recipe: Path, store_copy: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    found = states(build(load(changed_recipe), store_copy, OneByOne()))
    new = ("published", "r000002", "grid changed")
    same = ("unchanged", "r000001", "")
    assert found == {
        "foam": new, "blue-plastic": new, "rolled-brass": same, "scene-copper-sphere": same, "mirror": same
    }  # fmt: skip
    request = Job.request.fget
    monkeypatch.setattr(Job, "request", property(lambda self: {**request(self), "model_version": 7}))
    text = changed_recipe.read_text(encoding="utf-8").replace("tau_um = 1\n", "tau_um = 2\n")
    changed_recipe.write_text(text, encoding="utf-8")
    found = states(build(load(changed_recipe), store_copy, OneByOne()))
    assert found["foam"] == ("published", "r000003", "model version 1 -> 7")
    assert found["mirror"][2].endswith("parameters changed, model version 2 -> 7")
    assert capsys.readouterr().out == ""


def test_what_was_current_before_is_made_current_again_and_not_computed(
    recipe: Path, changed_recipe: Path, store_copy: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    root = store_copy
    build(load(changed_recipe), root, OneByOne())
    monkeypatch.setattr(tabulation, "block", lambda *_: pytest.fail("computed again"))
    assert run("build", recipe, "--store", root) == 0
    out, _ = capsys.readouterr()
    assert "grid changed; r000001 is current again" in out
    assert "3 tables unchanged" in out
    assert brdfdb.open(root).head("foam") == "r000001"
    assert run("rollback", "foam", "r000002", "--store", root) == 0
    assert states(build(load(recipe), root, OneByOne()))["foam"] == ("adopted", "r000001", "grid changed")
    assert staged(root) == []


def flip(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0x10
    path.write_bytes(data)


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-1])


def empty(path: Path) -> None:
    path.write_bytes(b"")


@pytest.mark.parametrize("damage", [flip, truncate, empty, Path.unlink])
@pytest.mark.parametrize("file", ["brdf/c/0/0/0", "../r000001.MANIFEST.json", "../HEAD.json"])
def test_what_is_damaged_is_named_and_built_again(
    damage: Callable[[Path], None], file: str, recipe: Path, built: Path, store_copy: Path, capsys: Captured
) -> None:
    root, before = store_copy, brdfdb.open(built)["foam"].brdf
    damage(root / "materials" / "foam" / "r000001" / file)
    assert run("verify", "--store", root) == 2
    out, err = capsys.readouterr()
    assert "5 materials verified, " in out
    assert re.search(r"brdfdb: foam (r000001 )?is damaged: .*; `brdfdb build` with its recipe (repairs|makes) it", err)
    assert Path(file).name in err
    with pytest.raises(StoreError, match=r"^foam (r000001 )?is damaged: "):
        brdfdb.open(root)["foam"]
    found = states(build(load(recipe), root, OneByOne()))
    state, _, why = found.pop("foam")
    assert {state for state, _, _ in found.values()} == {"unchanged"}
    assert state == ("adopted" if file == "../HEAD.json" else "published")
    assert Path(file).name in why
    np.testing.assert_array_equal(brdfdb.open(root)["foam"].brdf, before)
    if run("verify", "foam", "--store", root) != 0:  # the damaged revision is there, and not current
        assert capsys.readouterr().err.endswith("(not the current revision); `brdfdb gc --damaged` removes it\n")
        assert run("gc", "--damaged", "--store", root) == 0
    assert run("verify", "foam", "--store", root) == 0


# What is told


def test_json_lines_tell_all_and_nothing_else_is_on_stdout(
    recipe: Path, tmp_path: Path, names: list[str], capsys: Captured
) -> None:
    command = ("build", recipe, "--store", tmp_path / "store", "--json")
    assert run(*command) == 0
    out, err = capsys.readouterr()
    assert err == ""
    events = [json.loads(line) for line in out.splitlines()]
    assert events[0] == {"event": "start", "tables": 5, "store": str(tmp_path / "store")}
    assert sorted(event["material"] for event in events if event["event"] == "published") == sorted(names)
    for event in events:
        if event["event"] == "block":
            assert set(event) == {
                *("event", "material", "block", "blocks", "kept"),
                *("values_done", "values_total", "values_per_s", "seconds_left"),
            }
    assert events[-1]["event"] == "done"
    assert (events[-1]["published"], events[-1]["unchanged"], events[-1]["tables"]) == (5, 0, 5)
    assert run(*command) == 0
    events = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert {event["event"] for event in events} == {"start", "surveyed", "unchanged", "planned", "done"}


def test_memory_bounds_the_tasks_in_flight(recipe: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(layouts, "_BLOCK_VALUES", 50)
    most, now, guard = 0, 0, threading.Lock()
    block = tabulation.block

    def counted(layout: Layout, rows: slice) -> Any:
        nonlocal most, now
        with guard:
            now += 1
            most = max(most, now)
        time.sleep(0.001)
        values = block(layout, rows)
        with guard:
            now -= 1
        return values

    monkeypatch.setattr(tabulation, "block", counted)
    most_bytes = max(build_survey.memory_of_task(job.layout()) for job in load(recipe).jobs())
    with ThreadPoolExecutor(8) as executor:
        build(load(recipe), tmp_path, Workers(executor, lambda: 8), memory=3 * most_bytes + 100_000)
    assert 2 <= most <= 3
