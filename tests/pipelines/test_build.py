"""The build job: what is missing is built, what is there is left alone, and what a failure leaves behind."""

from __future__ import annotations

import errno
import json
import re
import shutil
import tempfile
import threading
import time
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import brdfdb
from brdfdb.errors import StoreError
from brdfdb.store import files
from brdfdb.store.lock import Lock
from brdfdb.store.reader import Store
from brdfdb.tables import layout as layouts
from brdfdb.tables import tabulation
from brdfdb.tables.layout import Layout, digest
from brdfdb.tables.xarray_view import plain_attributes
from brdfdb_pipelines import build_resources, cli
from brdfdb_pipelines.build import Built, build
from brdfdb_pipelines.exit_codes import BUG
from brdfdb_pipelines.recipe_file import Job, Recipe, RecipeError, load
from brdfdb_pipelines.workers import Workers

Captured = pytest.CaptureFixture[str]


class OneByOne(Executor):
    """Runs a task when it is submitted, and notes what came."""

    def __init__(self) -> None:
        self.submitted: list[tuple[str, tuple[Any, ...]]] = []

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.submitted.append((fn.__name__, args))
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except BaseException as error:
            future.set_exception(error)
        return future


def chunks(store: Store, name: str) -> dict[str, bytes]:
    group = store.path(name)
    return {str(path.relative_to(group)): path.read_bytes() for path in group.rglob("c/**/*") if path.is_file()}


def failing(monkeypatch: pytest.MonkeyPatch, name: str, error: BaseException) -> None:
    """Let the tabulation of one material fail."""
    block = tabulation.block

    def fail(layout: Layout, rows: slice) -> Any:
        if layout.source.name == name:
            raise error
        return block(layout, rows)

    monkeypatch.setattr(tabulation, "block", fail)


def changed(recipe: Path, to: Path) -> Path:
    """The recipe with another isotropic grid: foam, blue-plastic are new tables, and the others are not."""
    to.write_text(recipe.read_text(encoding="utf-8").replace("step = 15", "step = 30"), encoding="utf-8")
    return to


def states(built: list[Built]) -> dict[str, tuple[str, str, str]]:
    return {b.job.material.name: (b.state, b.revision, b.why) for b in built}


def staged(root: Path) -> list[str]:
    return sorted(path.name for path in (root / ".staging").iterdir())


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
        request = json.loads(json.dumps(job.request))
        with store.dataset(job.material.name) as found:
            error = store[job.material.name].attrs["error"]
            of_build = {"request": request, "request_sha256": digest(request), "error": error}
            expected.attrs = plain_attributes(expected.attrs | of_build)
            xr.testing.assert_identical(found.load(), expected)
        assert store.summary(job.material.name)["request_sha256"] == digest(request)


def test_the_largest_table_comes_first_and_the_number_of_workers_changes_nothing(
    recipe: Path, built: Path, tmp_path: Path, names: list[str]
) -> None:
    executor = OneByOne()
    build(load(recipe), tmp_path, executor)
    sizes = {job.material.name: job.layout().size for job in load(recipe).jobs()}
    blocks = [Path(args[0]).parent.name for task, args in executor.submitted if task == "write_block"]
    assert sorted(blocks) == sorted(names)
    assert [sizes[name] for name in blocks] == sorted(sizes.values(), reverse=True)
    one, other = brdfdb.open(tmp_path), brdfdb.open(built)
    assert all(chunks(one, name) == chunks(other, name) for name in names)


def test_a_layout_is_planned_on_a_worker_and_at_most_once(
    recipe: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan, planned, layout = load(recipe), [], Job.layout
    jobs = plan.jobs()
    monkeypatch.setattr(Recipe, "jobs", lambda _: jobs)
    monkeypatch.setattr(Job, "request", property(lambda job: {"material": job.material.name}))

    def plan_it(job: Job) -> Layout:
        planned.append((job.material.name, threading.current_thread().name))
        return layout(job)

    monkeypatch.setattr(Job, "layout", plan_it)
    failing(monkeypatch, "foam", StoreError("no space"))
    with ThreadPoolExecutor(2, thread_name_prefix="worker") as executor, pytest.raises(StoreError):
        build(plan, tmp_path, executor)
    assert sorted(name for name, _ in planned) == sorted(job.material.name for job in jobs)
    assert all(thread.startswith("worker") for _, thread in planned)
    monkeypatch.undo()
    monkeypatch.setattr(Recipe, "jobs", lambda _: jobs)
    monkeypatch.setattr(Job, "request", property(lambda job: {"material": job.material.name}))
    monkeypatch.setattr(Job, "layout", lambda _: pytest.fail("planned again"))
    assert {state for state, _, _ in states(build(plan, tmp_path, OneByOne())).values()} <= {"published", "unchanged"}


# What is not built again


def test_an_unchanged_recipe_does_nothing(recipe: Path, built: Path, tmp_path: Path, names: list[str]) -> None:
    root = tmp_path / "store"
    shutil.copytree(built, root)
    before = {path: path.stat().st_mtime_ns for path in (root / "materials").rglob("*")}
    executor = OneByOne()
    assert states(build(load(recipe), root, executor)) == dict.fromkeys(names, ("unchanged", "r000001", ""))
    assert [task for task, _ in executor.submitted] == ["survey"] * len(names)
    assert {path: path.stat().st_mtime_ns for path in (root / "materials").rglob("*")} == before
    assert cli.main(["build", str(recipe), "--store", str(root)]) == 0


def test_a_changed_recipe_is_a_new_revision_and_says_why(
    recipe: Path, built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    root = tmp_path / "store"
    shutil.copytree(built, root)
    other = changed(recipe, tmp_path / "other.toml")
    found = states(build(load(other), root, OneByOne()))
    new = ("published", "r000002", "grid changed")
    same = ("unchanged", "r000001", "")
    assert found == {
        "foam": new, "blue-plastic": new, "rolled-brass": same, "scene-copper-sphere": same, "mirror": same
    }  # fmt: skip
    request = Job.request.fget
    monkeypatch.setattr(Job, "request", property(lambda self: {**request(self), "model_version": 7}))
    text = other.read_text(encoding="utf-8").replace("tau_um = 1\n", "tau_um = 2\n")
    other.write_text(text, encoding="utf-8")
    found = states(build(load(other), root, OneByOne()))
    assert found["foam"] == ("published", "r000003", "model version 1 -> 7")
    assert found["mirror"][2].endswith("parameters changed, model version 2 -> 7")
    assert capsys.readouterr().out == ""


def test_what_was_current_before_is_made_current_again_and_not_computed(
    recipe: Path, built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    root = tmp_path / "store"
    shutil.copytree(built, root)
    other = changed(recipe, tmp_path / "other.toml")
    build(load(other), root, OneByOne())
    monkeypatch.setattr(tabulation, "block", lambda *_: pytest.fail("computed again"))
    assert cli.main(["build", str(recipe), "--store", str(root)]) == 0
    out, _ = capsys.readouterr()
    assert "grid changed; r000001 is current again" in out
    assert "3 tables unchanged" in out
    assert brdfdb.open(root).head("foam") == "r000001"
    assert cli.main(["rollback", "foam", "r000002", "--store", str(root)]) == 0
    assert states(build(load(recipe), root, OneByOne()))["foam"] == ("adopted", "r000001", "grid changed")
    assert staged(root) == []


def flip(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0x10
    path.write_bytes(data)


@pytest.mark.parametrize("damage", ["flip", "truncate", "empty", "delete"])
@pytest.mark.parametrize("file", ["brdf/c/0/0/0", "../r000001.MANIFEST.json", "../HEAD.json"])
def test_what_is_damaged_is_named_and_built_again(
    damage: str, file: str, recipe: Path, built: Path, tmp_path: Path, capsys: Captured
) -> None:
    root = tmp_path / "store"
    shutil.copytree(built, root)
    path = root / "materials" / "foam" / "r000001" / file
    before = brdfdb.open(built)["foam"].brdf
    {
        "flip": flip,
        "truncate": lambda path: path.write_bytes(path.read_bytes()[:-1]),
        "empty": lambda path: path.write_bytes(b""),
        "delete": Path.unlink,
    }[damage](path)
    assert cli.main(["verify", "--store", str(root)]) == 2
    out, err = capsys.readouterr()
    assert "5 materials verified, " in out
    assert re.search(r"brdfdb: foam (r000001 )?is damaged: .*; `brdfdb build` with its recipe (repairs|makes) it", err)
    assert Path(file).name in err
    with pytest.raises(StoreError, match=r"^foam (r000001 )?is damaged: "):
        brdfdb.open(root)["foam"]
    found = states(build(load(recipe), root, OneByOne()))
    assert {name: state for name, (state, _, _) in found.items() if name != "foam"} == {
        name: "unchanged" for name in found if name != "foam"
    }
    state, _, why = found["foam"]
    assert state == ("adopted" if file == "../HEAD.json" else "published")
    assert Path(file).name in why
    np.testing.assert_array_equal(brdfdb.open(root)["foam"].brdf, before)
    if cli.main(["verify", "foam", "--store", str(root)]) != 0:  # what was damaged is there, and not current
        assert capsys.readouterr().err.endswith("(not the current revision); `brdfdb gc --damaged` removes it\n")
        assert cli.main(["gc", "--damaged", "--store", str(root)]) == 0
    assert cli.main(["verify", "foam", "--store", str(root)]) == 0


# What cannot be built


def test_a_recipe_that_cannot_be_built_is_refused_before_anything_is_written(recipe: Path, tmp_path: Path) -> None:
    content = load(recipe).model_dump()
    content["grids"]["isotropic"]["theta_i_deg"] = [0.0, 90.0]
    with pytest.raises(RecipeError, match=r"^foam on grids\.isotropic: "):
        build(Recipe.model_validate(content), tmp_path / "store", OneByOne())
    assert not (tmp_path / "store").exists()


def test_a_block_that_does_not_fit_into_the_memory_is_refused(recipe: Path, tmp_path: Path, capsys: Captured) -> None:
    assert cli.main(["build", str(recipe), "--store", str(tmp_path / "store"), "--memory", "1MB"]) == 2
    _, err = capsys.readouterr()
    assert err.splitlines()[-1].startswith("brdfdb: memory: a block of ")
    assert err.splitlines()[-1].endswith(" MB, more than the 1 MB allowed")
    assert not (tmp_path / "store").exists()
    assert cli.main(["build", str(recipe), "--store", str(tmp_path / "store"), "--memory", "0.1GB"]) == 0


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
        (KeyboardInterrupt(), 130, "brdfdb: interrupted; published tables and complete blocks stay"),
        (MemoryError("Unable to allocate 3.64 TiB"), 2, "brdfdb: Unable to allocate 3.64 TiB"),
        (StoreError("cannot write foam: No space left"), 2, "brdfdb: cannot write foam: No space left"),
    ],
)
def test_a_build_that_is_broken_off_says_so_and_the_old_revision_is_served(
    error: BaseException,
    code: int,
    sentence: str,
    recipe: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: Captured,
) -> None:
    command = ["build", str(recipe), "--store", str(tmp_path / "store"), "--jobs", "1"]
    assert cli.main(command) == 0
    capsys.readouterr()
    command[1] = str(changed(recipe, tmp_path / "other.toml"))
    failing(monkeypatch, "foam", error)
    assert cli.main(command) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines()[-1].startswith(sentence)
    if code == 130:
        assert err.splitlines()[-1].endswith("to resume: brdfdb " + " ".join(command))
    assert "Traceback" not in err
    store = brdfdb.open(tmp_path / "store")
    store.verify("foam")
    assert store["foam"].revision == "r000001"
    monkeypatch.undo()
    assert cli.main(command) == 0
    assert store["foam"].revision == "r000002"
    assert staged(tmp_path / "store") == []


def test_a_bug_in_the_program_keeps_its_traceback(
    recipe: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    failing(monkeypatch, "foam", ZeroDivisionError("a bug"))
    assert cli.main(["build", str(recipe), "--store", str(tmp_path / "store"), "--jobs", "1"]) == BUG
    (file,) = tmp_path.glob("brdfdb-*.txt")
    assert capsys.readouterr().err.endswith(f"its traceback is in {file} (ZeroDivisionError: a bug)\n")
    assert file.read_text(encoding="utf-8").endswith("\nZeroDivisionError: a bug\n")


def test_a_full_disk_is_one_sentence_and_what_was_written_is_kept(
    recipe: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    root, written = tmp_path / "store", 0
    monkeypatch.setattr(layouts, "_BLOCK_VALUES", 50)
    write = files.write_file

    def fill(path: Path, data: bytes, temporary: Path) -> Any:
        nonlocal written
        written += len(data)
        if written > 60_000:
            raise OSError(errno.ENOSPC, "No space left on device", str(path))
        return write(path, data, temporary)

    with monkeypatch.context() as patch:
        for user in ("brdfdb.store.staging.write_file", "brdfdb.store.sealed_json.write_file"):
            patch.setattr(user, fill)
        assert cli.main(["build", str(recipe), "--store", str(root), "--jobs", "1"]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("brdfdb: ")) == ("", 1)
    assert err.splitlines()[-1].startswith("brdfdb: cannot write ")
    assert err.splitlines()[-1].endswith(f" to the store at {root}: No space left on device")
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
            assert go.wait(30)
        return block(layout, rows)

    monkeypatch.setattr(tabulation, "block", slow)
    with ThreadPoolExecutor(2) as executor, ThreadPoolExecutor(1) as other:
        first = other.submit(build, load(recipe), tmp_path, executor)
        assert began.wait(30)
        events: list[dict[str, Any]] = []

        def report(event: dict[str, Any]) -> None:
            events.append(event)
            if event == {"event": "waiting", "material": "foam"}:
                go.set()

        second = build(load(recipe), tmp_path, executor, report)
        assert {state for state, _, _ in states(first.result(30)).values()} <= {"published", "unchanged"}
    assert sorted(computed) == sorted(names)
    assert states(second)["foam"] == ("unchanged", "r000001", "")
    assert [event["material"] for event in events if event["event"] == "waiting"].count("foam") == 1
    assert staged(tmp_path) == []


def test_a_build_waits_for_whoever_holds_the_lock(recipe: Path, built: Path, tmp_path: Path, capsys: Captured) -> None:
    root = tmp_path / "store"
    shutil.copytree(built, root)
    other = changed(recipe, tmp_path / "other.toml")
    with ThreadPoolExecutor(1) as executor, Lock(root, "foam"):
        done = executor.submit(build, load(other), root, OneByOne())
        deadline = time.monotonic() + 20
        while brdfdb.open(root).head("blue-plastic") != "r000002":
            assert time.monotonic() < deadline
            time.sleep(0.01)
        assert not done.done()
        assert cli.main(["gc", "--keep", "1", "--store", str(root)]) == 0
        assert "left foam alone: a build is at work on it" in capsys.readouterr().out
    assert states(done.result(30))["foam"] == ("published", "r000002", "grid changed")


# What is told


def test_json_lines_tell_all_and_nothing_else_is_on_stdout(
    recipe: Path, tmp_path: Path, names: list[str], capsys: Captured
) -> None:
    command = ["build", str(recipe), "--store", str(tmp_path / "store"), "--json"]
    assert cli.main(command) == 0
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
    assert cli.main(command) == 0
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
    most_bytes = max(build_resources.task_bytes(job.layout()) for job in load(recipe).jobs())
    with ThreadPoolExecutor(8) as executor:
        build(load(recipe), tmp_path, Workers(executor, lambda: 8), memory=3 * most_bytes + 100_000)
    assert 2 <= most <= 3
