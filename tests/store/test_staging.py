"""Staging: what a killed or failed write leaves behind, who holds the lock, and that no two writes lose a revision."""

from __future__ import annotations

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from zarr.codecs import BloscCodec, Crc32cCodec

import brdfdb
from brdfdb.errors import ParameterError, StoreError
from brdfdb.store import codec, files, records
from brdfdb.store.files import syncing, unsealed
from brdfdb.store.lock import Lock
from brdfdb.store.publication import Staged, publish_dataset, publish_staged
from brdfdb.store.staging import planned, prepare, write_block, write_frame
from brdfdb.tables import layout as layouts
from brdfdb.tables.error_measurement import measure
from brdfdb.tables.layout import Layout, digest
from brdfdb.tables.xarray_view import plain_attributes
from tests.store.a_store import contents, flip, lambert, layout, rho, staged

REQUEST = {"asked": "for white"}


@pytest.fixture
def four_blocks(monkeypatch: pytest.MonkeyPatch) -> str:
    """The layout of a table of four blocks, rho = 0.75, as JSON."""
    monkeypatch.setattr(layouts, "_BLOCK_VALUES", 9)
    table = layout(0.75)
    assert len(table.blocks) == 4
    return json.dumps(table.document())


def staged_table(root: Path, text: str) -> Path:
    records.make_store(root)
    return prepare(root, "white", REQUEST, text)


def staged_blocks(root: Path, text: str) -> Path:
    where = staged_table(root, text)
    for number in range(4):
        write_block(str(where), text, number)
    return where


def full(*_: Any) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


# Where a store can be made


def test_a_directory_of_something_else_is_not_touched(tmp_path: Path) -> None:
    for name in ("thesis.tex", ".git", "materials", "HEAD.json"):
        (tmp_path / name).write_text("precious")
        with pytest.raises(StoreError, match=f"^{tmp_path} is not empty and not a store"):
            publish_dataset(tmp_path, "white", lambert(0.5))
        assert contents(tmp_path) == {name: b"precious"}
        (tmp_path / name).unlink()


def test_a_name_that_would_not_be_found_again_is_refused(tmp_path: Path) -> None:
    for name in ("White", "white-x1.5", "a/b", "..", "", "white-", "white--2"):
        with pytest.raises(ParameterError, match=r"^name: "):
            publish_dataset(tmp_path / "store", name, lambert(0.5))
    assert not (tmp_path / "store").exists()


def test_an_empty_directory_and_what_a_killed_build_left_behind_become_a_store(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "killed").mkdir()
    (tmp_path / "killed" / ".brdfdb.json.0123456789abcdef").write_text("{")
    for root in (tmp_path / "empty", tmp_path / "killed"):
        assert publish_dataset(root, "white", lambert(0.5))[0] == "r000001"
        assert unsealed((root / "brdfdb.json").read_bytes(), "", "") == {"format": "brdfdb", "version": 2}
    shutil.rmtree(root / "materials")  # killed right after the marker
    assert publish_dataset(root, "white", lambert(0.5))[0] == "r000001"


def test_a_store_that_cannot_be_made_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("precious")
    for where in (tmp_path / "file" / "store", tmp_path / "file"):
        with pytest.raises(StoreError, match=f"^cannot write a store at {where}: "):
            publish_dataset(where, "white", lambert(0.5))
    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", full)
        with pytest.raises(StoreError, match=f"^cannot write a store at {tmp_path / 'new'}: No space left on device$"):
            publish_dataset(tmp_path / "new", "white", lambert(0.5))
    assert contents(tmp_path) == {"file": b"precious"}


# Writes that fail


def no_syncfs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let each file be synced by itself, as where syncfs is missing."""
    monkeypatch.setattr(files, "_linux", lambda: None)


@pytest.mark.parametrize("call", ["replace", "rename", "fsync", "syncfs"])
@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, "No space left on device"), OSError("the disk is gone")])
def test_failed_writes_change_nothing(root: Path, monkeypatch: pytest.MonkeyPatch, call: str, error: OSError) -> None:
    def fail(*_: Any) -> None:
        raise error

    with monkeypatch.context() as patch:
        if call == "syncfs":
            patch.setattr(files, "_sync_file_system", fail)
        else:
            no_syncfs(patch)
            patch.setattr(os, call, fail)
        with pytest.raises(StoreError) as caught:
            publish_dataset(root, "white", lambert(0.75))
    assert str(caught.value) == f"cannot write white to the store at {root}: {error.strerror or error}"
    store = brdfdb.open(root)
    store.verify("white")
    assert (rho(root), store.head("white")) == (0.25, "r000001")
    assert not list(root.rglob(".HEAD*"))
    assert staged(root) == []
    publish_dataset(root, "white", lambert(0.75))
    assert rho(root) == 0.75


@pytest.mark.parametrize("at_once", [True, False])
def test_revisions_are_synced_before_the_pointers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at_once: bool
) -> None:
    """No pointer is swapped before all that it names, and the next sync comes after the last swap."""
    synced: set[tuple[int, int]] = set()  # inode and time of the last change of the content or of the names
    sync, replace = os.fsync, os.replace
    swaps: list[Path] = []
    after: list[Path] = []

    def state(path: Path | int) -> tuple[int, int]:
        return os.stat(path).st_ino, os.stat(path).st_mtime_ns

    def fsync(handle: int) -> None:
        sync(handle)
        synced.add(state(handle))

    def everything(_: int) -> bool:
        after.extend(swaps)
        if at_once:
            synced.update(state(path) for path in (tmp_path, *tmp_path.rglob("*")))
        return at_once

    def swap(source: Any, target: Any) -> None:
        if Path(target).name == "HEAD.json":
            group = Path(target).parent / "r000001"
            manifest = group.with_name("r000001.MANIFEST.json")
            # a swap changes the time of its directory, which has one material
            assert [p for p in (group, *group.rglob("*"), manifest, source) if state(p) not in synced] == []
            assert swaps or state(group.parent) in synced
            swaps.append(group)
        replace(source, target)

    monkeypatch.setattr(os, "fsync", fsync)
    monkeypatch.setattr(files, "_sync_file_system", everything)
    monkeypatch.setattr(os, "replace", swap)
    records.make_store(tmp_path)
    tables = []
    with syncing(tmp_path) as sync_all:
        for name in ("white", "grey"):
            text = json.dumps(layout(0.5).document())
            where = prepare(tmp_path, name, REQUEST, text)
            block = write_block(str(where), text, 0, sync=False)
            written = {block["name"]: block["entry"]} | write_frame(str(where), text, sync=False)
            tables.append(Staged(name, where, written))
        publish_staged(tmp_path, tables, sync_all)
    assert [group.parent.name for group in swaps] == ["white", "grey"]
    assert after == swaps
    for group in swaps:
        brdfdb.open(tmp_path).verify(group.parent.name)


# Imports once, then forks a writer for each line: a fork is safe while there is one thread
KILLED = """
import os, signal, sys
from pathlib import Path
import numpy as np
import xarray as xr
import zarr, zarr.codecs
from brdfdb.store import codec, files, publication, records

def die(*_, **__):
    os.kill(os.getpid(), signal.SIGKILL)

def die_at_sync(number):
    sync = files._sync_file_system
    def counted(handle):
        nonlocal number
        number -= 1
        return sync(handle) if number else die()
    files._sync_file_system = counted

places = {"files": files, "publication": publication, "records": records, "Path": Path}
axes = {"theta_i": [0.0, 90.0], "theta_r": [0.0, 90.0], "delta_phi": [0.0, 180.0]}
values = np.full((2, 2, 2), 9.0, dtype=np.float32)
dataset = xr.Dataset({"brdf": (tuple(axes), values)}, coords=axes)  # the first one imports dask
for line in sys.stdin:
    root, place, step = line.rsplit(maxsplit=2)
    if (child := os.fork()) == 0:
        die_at_sync(int(step)) if place == "sync" else setattr(places[place], step, die)
        publication.publish_dataset(root, "white", dataset)
        os._exit(0)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


@pytest.fixture(scope="module")
def killed() -> Iterator[Callable[[Path, str], int]]:
    """A function that writes a revision in a process that dies at a step, and returns its exit code."""
    command = [sys.executable, "-c", KILLED]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:

        def killed_at(root: Path, step: str) -> int:
            assert process.stdin is not None
            assert process.stdout is not None
            print(root, step, file=process.stdin, flush=True)
            return int(process.stdout.readline())

        yield killed_at


@pytest.mark.parametrize(
    "step", ["files write_file", "publication publish_staged", "publication write_file", "sync 1", "Path rename",
             "publication swap_pointers", "records _head_of", "sync 2", "sync 3"],
)  # fmt: skip
def test_killed_writes_change_nothing(root: Path, step: str, killed: Callable[[Path, str], int]) -> None:
    assert killed(root, step) == -signal.SIGKILL
    store = brdfdb.open(root)
    if step == "sync 3":  # the pointer is swapped; only that it outlasts a power cut is not certain
        assert store.head("white") == "r000002"
        store.verify("white")
        return
    store.verify("white")
    assert (rho(root), store.head("white"), list(store)) == (0.25, "r000001", ["white"])
    before = contents(root / "materials")
    revision, _ = publish_dataset(root, "white", lambert(0.75))
    taken = step in ("Path rename", "publication swap_pointers", "records _head_of", "sync 2")
    assert revision == ("r000003" if taken else "r000002")
    assert staged(root) == []
    changed = dict(before.items() - contents(root / "materials").items())
    assert set(changed) <= {"white/HEAD.json"}
    assert (rho(root), store.head("white")) == (0.75, revision)


# Blocks


def test_a_frame_decodes_each_block_once(tmp_path: Path, four_blocks: str, monkeypatch: pytest.MonkeyPatch) -> None:
    where = staged_blocks(tmp_path, four_blocks)
    numbers, decoded = [], codec.decoded

    def counted(layout: Layout, number: int, data: bytes) -> np.ndarray:
        numbers.append(number)
        return decoded(layout, number, data)

    monkeypatch.setattr(codec, "decoded", counted)
    write_frame(str(where), four_blocks)
    assert numbers == [0, 1, 2, 3]


def test_blocks_and_frame_make_the_table_of_tabulate(tmp_path: Path, four_blocks: str) -> None:
    where = staged_table(tmp_path, four_blocks)
    blocks = [write_block(str(where), four_blocks, number) for number in (2, 0, 3, 1)]
    assert [block["kept"] for block in blocks] == [False] * 4
    assert sorted(block["name"] for block in blocks) == [f"brdf/c/{number}/0/0" for number in range(4)]
    written = {block["name"]: block["entry"] for block in blocks} | write_frame(str(where), four_blocks)
    (where / "table" / "stray").write_text("left by an earlier attempt")
    with Lock(tmp_path, "white"), syncing(tmp_path) as sync:
        ((revision, stored),) = publish_staged(tmp_path, [Staged("white", where, written)], sync)
    store = brdfdb.open(tmp_path)
    store.verify("white")
    assert sorted(contents(store.path("white"))) == sorted(written)
    assert stored == sum(len(data) for data in contents(store.path("white")).values())
    error = store["white"].attrs["error"]
    with store.dataset("white") as found:
        measured = {key: store["white"].attrs[key] for key in ("error", "formula_error", "largest_albedo")}
        expected = lambert(0.75).assign_attrs(request=REQUEST, request_sha256=digest(REQUEST), **measured)
        expected.attrs = plain_attributes(expected.attrs)
        xr.testing.assert_identical(found.load(), expected)
    layout = Layout.from_document(json.loads(four_blocks))
    assert error == measure(layout, lambda rows: lambert(0.75)["brdf"].values[rows]).model_dump(mode="json")
    summary = store.summary("white")
    assert summary["error_p99"] == error["overall"]["p99"]
    assert (summary["wavelength_range_nm"], summary["largest_albedo"]) == ([], measured["largest_albedo"])
    assert measured["largest_albedo"]["albedo"] == 0.75  # of Lambert's law: rho
    rung = measured["formula_error"]["rung"]
    assert summary["formula_error"] == {"against": "highest rung", "rung": rung, "p99": 0.0}
    assert (revision, store["white"].revision, rho(tmp_path)) == ("r000001", "r000001", 0.75)
    assert staged(tmp_path) == []


def test_the_files_of_blocks_are_those_that_zarr_writes(tmp_path: Path, four_blocks: str) -> None:
    where = staged_blocks(tmp_path, four_blocks)
    write_frame(str(where), four_blocks)
    dataset = lambert(0.75).assign_attrs(request=REQUEST, request_sha256=digest(REQUEST))
    compressors = BloscCodec(cname="zstd", clevel=1, shuffle="shuffle"), Crc32cCodec()
    encoding: dict[str, Any] = {
        str(name): {"compressors": compressors, "fill_value": np.nan, "chunks": variable.shape}
        for name, variable in dataset.variables.items()
    }
    encoding["brdf"]["chunks"] = (1, 3, 3)
    dataset.to_zarr(tmp_path / "theirs", zarr_format=3, consolidated=False, encoding=encoding, write_empty_chunks=True)
    ours, theirs = contents(where / "table"), contents(tmp_path / "theirs")
    assert sorted(ours) == sorted(theirs)
    assert all(ours[name] == theirs[name] for name in ours if not name.endswith("zarr.json"))
    for name in ours:
        if name.endswith("/zarr.json"):
            expected = json.loads(theirs[name])
            del expected["attributes"]["_FillValue"]  # xarray repeats the fill value there
            assert json.loads(ours[name]) == expected


def test_a_block_that_is_whole_is_kept_and_any_other_is_written_again(tmp_path: Path, four_blocks: str) -> None:
    where = staged_table(tmp_path, four_blocks)
    first = [write_block(str(where), four_blocks, number) for number in range(4)]
    again = [write_block(str(where), four_blocks, number) for number in range(4)]
    assert [block["kept"] for block in again] == [True] * 4
    assert [block["entry"] for block in again] == [block["entry"] for block in first]
    chunk = where / "table" / first[1]["name"]
    marker = where / "blocks" / "000001.json"
    for damage in (chunk.unlink, lambda: chunk.write_bytes(b""), lambda: chunk.write_bytes(chunk.read_bytes()[:-1]),
                   lambda: flip(chunk), marker.unlink, lambda: marker.write_bytes(b"{}"),
                   lambda: marker.write_bytes(b"")):  # fmt: skip
        damage()
        block = write_block(str(where), four_blocks, 1)
        assert (block["kept"], block["entry"]) == (False, first[1]["entry"])
        assert write_block(str(where), four_blocks, 1)["kept"]
    other = json.loads(four_blocks)
    other["material"]["parameters"]["rho"] = 0.5  # as if planned anew: the block is not of this table
    assert not write_block(str(where), json.dumps(other), 1)["kept"]


def test_a_layout_of_another_version_is_refused(tmp_path: Path, four_blocks: str) -> None:
    where = staged_table(tmp_path, four_blocks)
    other = json.dumps({**json.loads(four_blocks), "model_version": 99})
    with pytest.raises(StoreError, match=r"^white: the table was laid out by another version of this program$"):
        write_block(str(where), other, 0)
    prepare(tmp_path, "white", REQUEST, other)
    assert planned(tmp_path, "white", REQUEST) is None


def test_a_layout_is_kept_for_the_next_build(tmp_path: Path, four_blocks: str) -> None:
    assert planned(tmp_path, "white", REQUEST) is None
    where = staged_table(tmp_path, four_blocks)
    assert planned(tmp_path, "white", REQUEST) == four_blocks
    assert planned(tmp_path, "white", {"asked": "for black"}) is None
    (where / "layout.json").write_bytes(b"{")
    assert planned(tmp_path, "white", REQUEST) is None


def test_failed_blocks_are_one_sentence(tmp_path: Path, four_blocks: str, monkeypatch: pytest.MonkeyPatch) -> None:
    where = staged_table(tmp_path, four_blocks)
    other = staged_blocks(tmp_path / "other", four_blocks)
    no_syncfs(monkeypatch)
    monkeypatch.setattr(os, "fsync", full)
    for root, task in (
        (tmp_path, lambda: write_block(str(where), four_blocks, 0)),
        (tmp_path / "other", lambda: write_frame(str(other), four_blocks)),
    ):
        with pytest.raises(StoreError) as caught:
            task()
        assert str(caught.value) == f"cannot write white to the store at {root}: No space left on device"
    rest = ["", *(f"/{where.name}{end}" for end in ("", "/blocks", "/layout.json", "/request.json"))]
    assert staged(tmp_path) == [f"white{end}" for end in rest]
