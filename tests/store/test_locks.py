"""Locks: one builder at a time, and two processes that write at once lose no revision."""

from __future__ import annotations

import hashlib
import subprocess
import sys
import threading
from pathlib import Path

import pytest
import xarray as xr

import brdfdb
from brdfdb.errors import BusyError
from brdfdb.store import records
from brdfdb.store.lock import Lock
from brdfdb.store.paths import manifest_path
from brdfdb.store.records import check_manifest
from tests.store.a_store import in_threads, staged


def test_a_material_has_one_builder_at_a_time_and_leaves_no_lock_behind(root: Path) -> None:
    with Lock(root, "white") as lock:
        with pytest.raises(BusyError, match=r"^another build is at work on white$"), Lock(root, "white", wait=False):
            pytest.fail("entered")
        with Lock(root, "black", wait=False):
            assert staged(root) == ["black", "black/lock", "white", "white/lock"]
        (lock.path.parent / "key").mkdir()
    assert staged(root) == ["white", "white/key", "white/lock"]
    (root / ".staging" / "white" / "key").rmdir()
    with Lock(root, "white", wait=False):
        pass
    assert staged(root) == []


def test_a_lock_is_never_held_twice(root: Path) -> None:
    inside: list[int] = []

    def work() -> None:
        for _ in range(200):
            with Lock(root, "white"):
                inside.append(1)
                assert len(inside) == 1
                inside.pop()

    assert in_threads(4, work)() == []
    assert staged(root) == []


def test_stores_that_are_made_at_the_same_moment_are_one(tmp_path: Path) -> None:
    for attempt in range(20):
        barrier = threading.Barrier(4)

        def start(root: Path = tmp_path / str(attempt), barrier: threading.Barrier = barrier) -> None:
            barrier.wait()
            for _ in range(3):
                records.make_store(root)

        assert in_threads(4, start)() == []
        assert len(brdfdb.open(tmp_path / str(attempt))) == 0


PUBLISHER = """
import sys, time
from pathlib import Path
import numpy as np
import xarray as xr
from brdfdb.store.publication import publish_dataset

root, me = Path(sys.argv[1]), sys.argv[2]
value = np.full((2, 2, 2), float(me), dtype=np.float32)
axes = {"theta_i": [0.0, 80.0], "theta_r": [0.0, 80.0], "delta_phi": [0.0, 180.0]}
dataset = xr.Dataset({"brdf": (tuple(axes), value)}, axes, {"by": me})
root.with_name(me).touch()
while not (root.with_name("1").exists() and root.with_name("2").exists()):
    time.sleep(0.001)
for _ in range(5):
    print(publish_dataset(root, "white", dataset)[0])
"""


def test_two_processes_write_into_one_new_store_and_none_loses_a_revision(tmp_path: Path) -> None:
    root = tmp_path / "store"
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", PUBLISHER, root, me], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        for me in ("1", "2")
    ]
    outputs = [process.communicate(timeout=300) for process in processes]
    assert [process.returncode for process in processes] == [0, 0], outputs
    published = [(me, name) for me, (out, _) in zip("12", outputs, strict=True) for name in out.split()]
    assert sorted(name for _, name in published) == [f"r{number:06d}" for number in range(1, 11)]
    for me, name in published:
        group = root / "materials" / "white" / name
        data = manifest_path(group).read_bytes()
        check_manifest(group, hashlib.sha256(data).hexdigest(), contents=True)
        with xr.open_zarr(group) as found:
            assert found["brdf"].values.tolist() == [[[float(me)] * 2] * 2] * 2
            assert found.attrs == {"by": me}
    store = brdfdb.open(root)
    store.verify("white")
    assert store.head("white") == "r000010"
    assert staged(root) == []
