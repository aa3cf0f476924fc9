"""Where builds run: processes and a dask cluster give the tables that threads give, and outlive a worker."""

from __future__ import annotations

import json
import logging
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

import brdfdb
from brdfdb.errors import ParameterError, install_command
from brdfdb_pipelines import build as builds
from brdfdb_pipelines import workers
from brdfdb_pipelines.build import build
from brdfdb_pipelines.recipe_file import load
from brdfdb_pipelines.workers import Workers
from tests.pipelines.a_build import chunks, staged
from tests.pipelines.command import Captured, refused, run
from tests.pipelines.recipes import isotropic

START_S = 300.0  # for what takes a few seconds where the machine has nothing else to do


def test_processes_build_what_threads_build(recipe: Path, built: Path, tmp_path: Path, names: list[str]) -> None:
    assert run("build", recipe, "--store", tmp_path, "--processes", "--jobs", 2) == 0
    assert all(chunks(tmp_path, name) == chunks(built, name) for name in names)
    assert staged(tmp_path) == []


def kill(*_: Any) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_process_that_is_killed_is_one_sentence_and_the_build_resumes(recipe: Path, tmp_path: Path) -> None:
    with workers.processes(1) as at:
        at.executor.submit(kill)
        said = r"^the workers are gone, killed or out of memory; build again to resume$"
        with pytest.raises(workers.WorkersError, match=said):
            build(load(recipe), tmp_path, at)
    with workers.threads(1) as at:
        assert {b.state for b in build(load(recipe), tmp_path, at)} == {"published"}


def test_an_interrupt_kills_processes() -> None:
    futures = []

    def interrupted() -> None:
        with workers.processes(1) as at:
            at.executor.submit(os.getpid).result()
            futures.append(at.executor.submit(time.sleep, START_S))
            raise KeyboardInterrupt

    started = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert time.monotonic() - started < START_S
    assert workers.lost(futures[0].exception(START_S) or OSError())


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_interrupt_does_not_wait_for_estimates_of_rays(jobs: int, tmp_path: Path) -> None:
    recipe = tmp_path / "rough.toml"
    keys = 'surface = "gaussian"\nslope_deg = 20\nrho = 1\nnodes = 128\nrays = 1048576'  # estimates of a minute
    recipe.write_text(f'materials = ["rough"]\ntolerance = 0.1\n[define.rough]\n{keys}\n', encoding="utf-8")
    interrupted: list[float] = []

    def interrupt() -> None:
        interrupted.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    def report(event: dict[str, Any]) -> None:
        if event["event"] == "simulating":
            threading.Timer(2.5, interrupt).start()

    handler = signal.signal(signal.SIGINT, signal.default_int_handler)  # shells in the background ignore it
    try:
        with pytest.raises(KeyboardInterrupt), workers.interruptible(jobs) as at:
            build(load(recipe), tmp_path / "store", at, report)
    finally:
        signal.signal(signal.SIGINT, handler)
    assert time.monotonic() - interrupted[0] < 10.0


ORPHAN = """
import sys, time
from brdfdb_pipelines import workers
if __name__ == "__main__":
    with workers.processes(1) as at:
        print(at.executor.submit(__import__("os").getpid).result(), flush=True)
        at.executor.submit(time.sleep, 600)
        time.sleep(600)
"""


def test_processes_leave_when_their_builder_was_killed(tmp_path: Path) -> None:
    script = tmp_path / "orphan.py"
    script.write_text(ORPHAN)
    with subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True) as builder:
        assert builder.stdout is not None
        worker = int(builder.stdout.readline())
        builder.kill()
    deadline = time.monotonic() + START_S
    while Path(f"/proc/{worker}").exists() and "\nState:\tZ" not in Path(f"/proc/{worker}/status").read_text():
        assert time.monotonic() < deadline
        time.sleep(0.02)


# A dask cluster


def test_a_scheduler_without_a_port_is_one_sentence() -> None:
    with pytest.raises(ParameterError, match=r"^--scheduler: 'nope' "), workers.cluster("nope"):
        pass


def dask(*arguments: object) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "distributed.cli." + str(arguments[0]), *map(str, arguments[1:])]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, text=True)


def address_of(told: Path, deadline: float) -> str:
    """Return the address of a scheduler, which writes it to a file once it listens."""
    while not told.is_file() or not told.read_text():
        assert time.monotonic() < deadline, "no scheduler"
        time.sleep(0.05)
    return str(json.loads(told.read_text())["address"])


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, list[subprocess.Popen[str]]]]:
    """The address of a scheduler on loopback, and its two workers, each with one thread and no nanny."""
    where = tmp_path_factory.mktemp("dask")
    told = where / "scheduler.json"
    scheduler = dask("dask_scheduler", "--host", "127.0.0.1", "--port", 0, "--no-dashboard", "--scheduler-file", told)
    processes = [scheduler]
    try:
        deadline = time.monotonic() + START_S
        address = address_of(told, deadline)
        options = ("--nthreads", 1, "--no-nanny", "--no-dashboard", "--host", "127.0.0.1", "--local-directory", where)
        processes += [dask("dask_worker", address, *options) for _ in range(2)]
        with workers.cluster(address) as at:
            while at.slots() < 2:
                assert time.monotonic() < deadline, "no workers"
                time.sleep(0.2)
        yield address, processes[1:]
    finally:
        for process in processes:
            process.kill()
            process.wait()


def test_a_cluster_builds_what_threads_build_and_a_worker_that_is_killed_does_not_matter(
    cluster: tuple[str, list[subprocess.Popen[str]]],
    recipe: Path,
    built: Path,
    tmp_path: Path,
    names: list[str],
    capsys: Captured,
) -> None:
    address, processes = cluster
    root = tmp_path / "store"
    assert run("build", recipe, "--store", root, "--scheduler", address, "--json") == 0
    assert '"event": "done", "tables": 5, "published": 5' in capsys.readouterr().out
    assert all(chunks(root, name) == chunks(built, name) for name in names)
    large = tmp_path / "large.toml"
    fine = "[{ start = 0, stop = 89, step = 0.25 }]"
    text = 'materials = ["wall-plaster"]\n' + isotropic(fine, "[{ start = 0, stop = 180, step = 1 }]")
    large.write_text(text, encoding="utf-8")
    (job,) = load(large).jobs()
    assert len(job.layout().blocks) > 20
    seen = []

    def report(event: dict[str, Any]) -> None:
        if event["event"] == "block":
            seen.append(event)
            if len(seen) == 3:
                processes[0].kill()

    with workers.cluster(address) as at:
        (done,) = build(load(large), root, at, report)
    assert (done.state, len(seen)) == ("published", len(job.layout().blocks))
    brdfdb.open(root).verify("wall-plaster")
    with ThreadPoolExecutor(2) as executor:
        (other,) = build(load(large), tmp_path / "threads", executor)
    assert chunks(root, "wall-plaster") == chunks(tmp_path / "threads", "wall-plaster")
    assert other.stored_bytes == done.stored_bytes


def test_a_worker_of_a_cluster_that_does_not_see_the_store_is_named(
    cluster: tuple[str, list[subprocess.Popen[str]]],
    recipe: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: Captured,
) -> None:
    monkeypatch.chdir(tmp_path)
    root = "/proc/self/cwd/store"  # of a worker this is another directory
    if not Path(root).parent.is_dir():
        pytest.skip("no /proc here")
    said = refused(capsys, "build", recipe, "--store", root, "--scheduler", cluster[0])
    where = (
        rf"^the worker tcp://127\.0\.0\.1:[0-9]+ on the host {re.escape(socket.gethostname())} does not see the store"
    )
    assert re.match(f"{where} at {root}: mount one file system there on all machines$", said)
    assert staged(tmp_path / "store") == []
    root = "/proc/self/cwd/edition"
    said = refused(capsys, "build", recipe, "--to", root, "--scheduler", cluster[0])
    assert re.match(f"{where.removesuffix(' the store')} {root}: mount one file system there on all machines$", said)
    assert [*(tmp_path / "edition").iterdir()] == []


def test_an_error_of_a_shard_names_the_worker(
    cluster: tuple[str, list[subprocess.Popen[str]]], recipe: Path, tmp_path: Path, capsys: Captured
) -> None:
    place = tmp_path / "edition"
    place.mkdir()
    (place / "groups").write_bytes(b"")
    said = refused(capsys, "build", recipe, "--to", place, "--scheduler", cluster[0])
    assert re.match(rf"the worker tcp://127\.0\.0\.1:[0-9]+ on the host .*: cannot write groups/.* to {place}: ", said)
    assert sorted(path.name for path in place.iterdir()) == ["groups"]


def test_an_interrupt_of_a_request_to_the_scheduler_prints_nothing(
    cluster: tuple[str, list[subprocess.Popen[str]]], caplog: pytest.LogCaptureFixture
) -> None:
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    logger = logging.getLogger("tornado.application")
    logger.addHandler(caplog.handler)
    try:
        with workers.cluster(cluster[0]) as at:
            at.executor._client.loop.add_callback(time.sleep, 1.0)  # type: ignore[attr-defined]
            threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
            with pytest.raises(KeyboardInterrupt):
                at.slots()
            time.sleep(1.5)  # until the loop has met the cancellation
    finally:
        logger.removeHandler(caplog.handler)
        signal.signal(signal.SIGINT, handler)
    assert "NameError" not in caplog.text


def test_a_cluster_simulates_what_threads_simulate(
    cluster: tuple[str, list[subprocess.Popen[str]]], tmp_path: Path, capsys: Captured
) -> None:
    given = ("--surface", "gaussian", "--slope-deg", 20, "--rho", 1, "--nodes", 128, "--rays", 256, "--name", "rough")
    given = (*given, "--standard-error", 0.3, "--tolerance", 0.1)
    assert run("simulate", *given, "--store", tmp_path / "store", "--scheduler", cluster[0]) == 0
    assert run("simulate", *given, "--store", tmp_path / "threads", "--jobs", 1) == 0
    assert chunks(tmp_path / "store", "rough") == chunks(tmp_path / "threads", "rough")
    capsys.readouterr()


def test_a_scheduler_that_is_not_there_is_one_sentence(
    recipe: Path, tmp_path: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workers, "_CONNECT_S", 0.5)
    command = ("build", recipe, "--store", tmp_path / "store", "--scheduler", "tcp://127.0.0.1:9")
    assert refused(capsys, *command) == "no dask scheduler answers at tcp://127.0.0.1:9"
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert refused(capsys, *command) == f"distributed is not installed; it comes with {install_command('dask')}"
    assert not (tmp_path / "store").exists()


def test_a_cluster_without_workers_is_said_and_waited_for(
    recipe: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(builds, "_LOOK_S", 0.05)
    events = []

    def slots() -> int:  # of a cluster whose workers come late
        return int("idle" in events)

    def later() -> None:
        deadline = time.monotonic() + START_S
        while "idle" not in events and time.monotonic() < deadline:
            time.sleep(0.01)

    with ThreadPoolExecutor(1) as executor:
        executor.submit(later)
        built = build(load(recipe), tmp_path, Workers(executor, slots), lambda event: events.append(event["event"]))
    assert events.count("idle") == 1
    assert {one.state for one in built} == {"published"}


def test_a_scheduler_that_dies_is_one_sentence(recipe: Path, tmp_path: Path) -> None:
    told = tmp_path / "scheduler.json"
    scheduler = dask("dask_scheduler", "--host", "127.0.0.1", "--port", 0, "--no-dashboard", "--scheduler-file", told)
    try:
        deadline = time.monotonic() + START_S
        address = address_of(told, deadline)
        # no worker: the build waits until the scheduler goes
        command = [sys.executable, "-m", "brdfdb_pipelines.cli", "build", recipe, "--store", tmp_path / "store"]
        with subprocess.Popen([*command, "--scheduler", address], stderr=subprocess.PIPE, text=True) as builder:
            assert builder.stderr is not None
            lines = [builder.stderr.readline(), builder.stderr.readline()]
            scheduler.kill()
            lines += builder.stderr.read().splitlines()
    finally:
        scheduler.kill()
        scheduler.wait()
    assert builder.returncode == 2
    assert lines[1].startswith("the cluster has no workers")
    # whichever is noticed first: its tasks are lost, or it does not answer
    assert re.fullmatch("brdfdb: the (dask scheduler at .*|workers) (is|are) gone.*; build again to resume", lines[-1])
    assert not [line for line in lines if "Traceback" in line or "distributed" in line]
