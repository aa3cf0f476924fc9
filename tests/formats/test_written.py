"""Files of an export are all there, whole, or none is; what cannot be written is said in a sentence."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from brdfdb.errors import WriteError
from brdfdb.formats._stated_error import FileError
from brdfdb.formats._written import Written, whole

NEAR = FileError(p99=0.01, p99_hemisphere=0.01, p99_lobe=0.005, l1=0.002, largest=0.5)


def fill_the_disk(half: Path) -> None:
    half.write_text("new")
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "half")


def test_all_files_appear_together_and_a_failure_leaves_the_old_ones(tmp_path: Path) -> None:
    paths = tmp_path / "a.binary", tmp_path / "a.binary.json"
    paths[0].write_text("old")
    with pytest.raises(WriteError, match=r"cannot write .*a\.binary: No space left on device"), whole(*paths) as halves:
        fill_the_disk(halves[0])
    assert list(tmp_path.iterdir()) == [paths[0]]
    with whole(*paths) as halves:
        for half in halves:
            half.write_text("new")
        assert paths[0].read_text() == "old"
        assert not paths[1].exists()
    assert [path.read_text() for path in paths] == ["new", "new"]
    assert sorted(tmp_path.iterdir()) == sorted(paths)


def test_a_bug_leaves_no_half_file_and_stays_a_bug(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), whole(tmp_path / "a") as (half,):
        half.write_text(f"{1 / 0}")
    assert list(tmp_path.iterdir()) == []


def test_a_directory_is_replaced_by_a_directory_only(tmp_path: Path) -> None:
    path = tmp_path / "a.zarr"
    for content in ("old", "new"):
        with whole(path) as (half,):
            half.mkdir()
            (half / "zarr.json").write_text(content)
    assert (path / "zarr.json").read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]
    for name, words in (("b.bsdf", "it is a directory"), ("c.zarr", "it is a directory, but not a zarr group")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "thesis.txt").write_text("of somebody")
        with pytest.raises(WriteError, match=f"{name}: {words}"), whole(tmp_path / name):
            pytest.fail("it is refused before anything is computed")
        assert (tmp_path / name / "thesis.txt").exists()


def test_a_directory_that_cannot_be_replaced_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.zarr"
    path.mkdir()
    (path / "zarr.json").write_text("old")
    replace = os.replace

    def full(source: Path, target: Path) -> None:
        if Path(target) == path and (Path(source) / "zarr.json").read_text() == "new":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        replace(source, target)

    monkeypatch.setattr(os, "replace", full)
    (tmp_path / "new").mkdir()
    (tmp_path / "new" / "zarr.json").write_text("new")
    with pytest.raises(WriteError, match="No space left"), whole(path) as (half,):
        (tmp_path / "new").rename(half)
    assert list(tmp_path.iterdir()) == [path]
    assert (path / "zarr.json").read_text() == "old"


@pytest.mark.parametrize("name", ["notes.txt", "theta_i/notes.txt", "theta_i/c/a"])
def test_a_group_with_files_of_somebody_is_not_replaced(tmp_path: Path, name: str) -> None:
    path = tmp_path / "a.zarr"
    (path / "theta_i" / "c" / "0").mkdir(parents=True)
    for file in ("zarr.json", "theta_i/zarr.json", "theta_i/c/0/1", name):
        (path / file).write_text("old")
    with pytest.raises(WriteError, match=f"it contains {Path(name).name}, which is not part"), whole(path):
        pytest.fail("it is refused before anything is computed")
    (path / name).unlink()
    with whole(path) as (half,):
        half.mkdir()
    assert list(path.iterdir()) == []


@pytest.mark.parametrize("place", ["nowhere/a.bsdf", "file/a.bsdf"])
def test_a_place_that_is_none_is_named(tmp_path: Path, place: str) -> None:
    (tmp_path / "file").write_text("a file where a directory must be")
    with pytest.raises(WriteError, match=r"cannot write .*a\.bsdf: N"), whole(tmp_path / place) as (half,):
        half.write_text("new")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_size_and_nearness_of_what_was_written(tmp_path: Path) -> None:
    (tmp_path / "a.zarr" / "c").mkdir(parents=True)
    (tmp_path / "a.zarr" / "c" / "0").write_bytes(b"12345")
    (tmp_path / "a.json").write_bytes(b"12")
    paths = tmp_path / "a.zarr", tmp_path / "a.json"
    assert Written(paths).nbytes == 7
    assert Written(paths).within
    assert Written(paths, NEAR, 0.02).within
    assert not Written(paths, NEAR, 0.009).within
