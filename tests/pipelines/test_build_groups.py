"""Groups of small tables: a task and three syncs serve many, and an error of a member costs no other table."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

import brdfdb
from brdfdb.errors import ParameterError, StoreError
from brdfdb.store import files, lock
from brdfdb.store.lock import Lock
from brdfdb.store.records import make_store
from brdfdb.store.revisions import collect
from brdfdb_pipelines import build_group as groups
from brdfdb_pipelines import workers
from brdfdb_pipelines.build import build
from brdfdb_pipelines.build_group import build_group, group_size, survey_group
from brdfdb_pipelines.recipe_file import load
from brdfdb_pipelines.workers import Workers
from tests.pipelines.a_build import OneByOne, failing, staged
from tests.pipelines.recipes import isotropic, material, recipe_file_of

NAMES = [f"grey-{number}" for number in range(40)]
THREE = "".join(
    [
        'materials = ["a", "b", "c"]\n',
        isotropic(),
        *(material(name, name, "lambert", f"rho = {rho}") for name, rho in (("a", 0.25), ("b", 0.5), ("c", 0.75))),
    ]
)


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The recipe of forty tables of eight values."""
    define = [material(name, name, "lambert", f"rho = {number / 40}") for number, name in enumerate(NAMES)]
    return recipe_file_of(tmp_path_factory.mktemp("many"), "".join(['materials = ["grey-*"]\n', isotropic(), *define]))


def test_a_group_lasts_a_second_and_no_worker_waits_for_the_last_one() -> None:
    assert group_size(1.0, 3000, 2, apart=True) == 1  # nothing is known yet
    assert group_size(0.1, 3000, 2, apart=True) == 10
    assert group_size(1e-9, 3000, 2, apart=True) == 32
    assert group_size(1e-9, 3000, 128, apart=False) == 4  # the threads of a process share its open files
    assert group_size(1e-9, 20, 4, apart=True) == 5
    assert group_size(1e-9, 1, 0, apart=True) == 1  # of a cluster that has no workers yet


@pytest.mark.parametrize("syncfs", [True, False])
def test_tasks_and_syncs_are_fewer_than_tables(
    many: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, syncfs: bool
) -> None:
    monkeypatch.setattr(groups, "GROUP_S", 1e6)  # groups are large on a busy machine, too
    if not syncfs:  # each file is synced
        monkeypatch.setattr(files, "_linux", lambda: None)
    syncs: list[int] = []
    sync, at_once = os.fsync, files._sync_file_system
    monkeypatch.setattr(os, "fsync", lambda handle: (syncs.append(handle), sync(handle))[1])
    monkeypatch.setattr(files, "_sync_file_system", lambda handle: (syncs.append(handle), at_once(handle))[1])
    executor = OneByOne()
    events: list[dict[str, Any]] = []
    build(load(many), tmp_path / "store", executor, events.append)
    assert len(executor.submitted) < len(NAMES) / 2
    if files._linux() is not None:
        assert len(syncs) < len(NAMES)
    assert [event["event"] for event in events].count("block") == len(NAMES)
    for name in brdfdb.open(tmp_path / "store"):
        brdfdb.open(tmp_path / "store").verify(name)
    assert staged(tmp_path / "store") == []


def test_a_member_that_fails_takes_no_other_of_its_group_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Unsendable(Exception):  # noqa: N818
        def __reduce__(self) -> Any:
            raise TypeError

    jobs = load(recipe_file_of(tmp_path, THREE)).jobs()
    root = tmp_path / "store"
    make_store(root)
    surveys = survey_group(str(root), jobs).results
    for error, said in ((ParameterError("rho", "is bad"), "rho: is bad"), (Unsendable("a bug"), "Unsendable: a bug")):
        failing(monkeypatch, "b", error)
        with Lock(root, "c"):
            results = build_group(str(root), list(zip(jobs, surveys, strict=True))).results
        assert str(results[1]) == said
        assert results[2].state == "busy"
    assert results[0].state == "current"  # the first of the two attempts built it
    assert list(brdfdb.open(root)) == ["a"]
    monkeypatch.undo()
    built = build(load(tmp_path / "recipe.toml"), root, OneByOne())
    assert [table.state for table in built] == ["unchanged", "published", "published"]
    assert staged(root) == []


# Imports once, then forks a build for each line: a fork is safe while there is one thread
KILLED = """
import os, signal, sys
from pathlib import Path
from brdfdb.store import files, lock
from brdfdb.store.records import make_store
from brdfdb.store.revisions import collect
from brdfdb_pipelines.build_group import build_group, survey_group
from brdfdb_pipelines.recipe_file import load

jobs = load(Path(sys.argv[1])).jobs()
sync = files._sync_file_system

def group(root):
    make_store(root)
    return build_group(str(root), list(zip(jobs, survey_group(str(root), jobs).results)))

def counted(handle):
    global number
    number -= 1
    return sync(handle) if number else os.kill(os.getpid(), signal.SIGKILL)

for line in sys.stdin:
    if (child := os.fork()) == 0:
        root, step = line.rsplit(maxsplit=1)
        number = int(step)
        files._sync_file_system = counted
        group(Path(root))
        os._exit(0)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


def test_a_group_that_is_killed_at_any_sync_is_completed_by_the_next_build(tmp_path: Path) -> None:
    recipe = recipe_file_of(tmp_path, THREE)
    command = [sys.executable, "-c", KILLED, recipe]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        for step in (1, 2, 3):
            root = tmp_path / str(step)
            print(root, step, file=process.stdin, flush=True)
            assert int(process.stdout.readline()) == -signal.SIGKILL
            found = list(brdfdb.open(root))
            assert found == (["a", "b", "c"] if step == 3 else [])  # readers see no table before all are synced
            for name in found:
                brdfdb.open(root).verify(name)
            events: list[dict[str, Any]] = []
            states = {table.state for table in build(load(recipe), root, OneByOne(), events.append)}
            assert states == {1: {"published"}, 2: {"adopted"}, 3: {"unchanged"}}[step]
            assert all(event["kept"] for event in events if event["event"] == "block")
            store = brdfdb.open(root)
            for name, rho in (("a", 0.25), ("b", 0.5), ("c", 0.75)):
                store.verify(name)
                assert store[name].attrs["parameters"]["rho"] == rho
            if step < 3:
                assert staged(root) == []


# Workers that do not see the store, and file systems without locks


def test_a_file_system_without_locks_is_told_before_anything_is_planned(
    many: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def none(*_: Any) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(lock.fcntl, "flock", none)
    executor = OneByOne()
    root = tmp_path / "store"
    said = rf"^cannot write to the store at {root}: its file system has no file locks \(flock: No locks available\); "
    with pytest.raises(StoreError, match=said):
        build(load(many), root, executor)
    assert executor.submitted == []
    assert not root.exists()


def test_a_worker_that_does_not_see_the_store_or_its_locks_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Distributed:
        class Worker:
            address = "tcp://10.0.0.7:4000"

        get_worker = Worker

    monkeypatch.setattr(workers, "import_extra", lambda _: Distributed)
    monkeypatch.setattr(workers.socket, "gethostname", lambda: "node7")
    root = tmp_path / "store"
    token = root / ".staging" / ".build-0" / "lock"
    where = rf"^the worker tcp://10\.0\.0\.7:4000 on the host node7 (sees|does not see) the store at {root}"
    with pytest.raises(StoreError, match=where + ": mount one file system there on all machines$"):
        workers.at_store(str(token), len, "ab")
    make_store(root)
    with Lock(root, ".build-0") as lock:
        assert lock.path == token
        assert workers.at_store(str(token), len, "ab") == 2
    token.parent.mkdir()
    token.touch()
    workers._check_store.cache_clear()
    with pytest.raises(StoreError, match=where + ", but not its locks: mount it with locks that all machines share$"):
        workers.at_store(str(token), len, "ab")


def test_a_build_on_other_machines_has_a_locked_file_in_the_store_and_ends_at_a_worker_without_it(
    many: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = tmp_path / "store"
    executor = OneByOne()
    build(load(many), root, Workers(executor, lambda: 1, apart=True))
    assert {(name, args[1].__name__) for name, args in executor.submitted} == {
        ("at_store", "survey_group"), ("at_store", "build_group")
    }  # fmt: skip
    assert staged(root) == []

    def blind(*_: Any) -> None:
        raise StoreError("the worker does not see the store")

    monkeypatch.setattr(workers, "_check_store", blind)
    with pytest.raises(StoreError, match="the worker does not see"):
        build(load(many), tmp_path / "other", Workers(executor, lambda: 1, apart=True))


def test_collections_leave_builds_at_work_alone_and_remove_what_killed_ones_left(many: Path, tmp_path: Path) -> None:
    root = tmp_path / "store"
    with ThreadPoolExecutor(1) as executor:
        build(load(many), root, executor)
    (root / ".staging" / ".build-killed").mkdir()
    (root / ".staging" / ".build-killed" / "lock").touch()
    with Lock(root, ".build-1") as lock:
        assert collect(root).busy == []
        assert lock.path.is_file()
        assert staged(root) == [".build-1"]
    assert staged(root) == []
