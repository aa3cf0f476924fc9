"""Revisions: history, rollback, verification, and a collection that takes nothing that anybody needs."""

from __future__ import annotations

import json
import shutil
import threading
from pathlib import Path

import numpy as np
import pytest

import brdfdb
from brdfdb.errors import StoreError, UnknownMaterialError
from brdfdb.store.lock import Lock
from brdfdb.store.paths import manifest_path
from brdfdb.store.publication import publish_dataset
from brdfdb.store.revisions import collect, difference, history, rollback, standing
from brdfdb.tables.layout import digest
from tests.store.a_store import chunk, in_threads, pointer, requested, rho


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A store with four revisions of one material: rho = 0.25, 0.5, 0.75, 1."""
    for quarter in range(1, 5):
        publish_dataset(tmp_path, "white", requested(quarter / 4))
    return tmp_path


def names(root: Path) -> list[str]:
    return sorted(path.name for path in (root / "materials" / "white").iterdir())


def kept(*numbers: int) -> list[str]:
    return sorted(["HEAD.json", *(f"r{n:06d}{end}" for n in numbers for end in ("", ".MANIFEST.json"))])


def test_history_tells_every_revision_and_which_is_current(root: Path) -> None:
    found = history(root, "white")
    assert [(revision.name, revision.current) for revision in found] == [
        ("r000001", False), ("r000002", False), ("r000003", False), ("r000004", True)
    ]  # fmt: skip
    for quarter, revision in enumerate(found, 1):
        assert revision.summary["request_sha256"] == digest({"rho": quarter / 4})
        assert (revision.summary["model"], revision.summary["model_version"]) == ("lambert", 1)
        group = root / "materials" / "white" / revision.name
        assert revision.summary["bytes"] == sum(path.stat().st_size for path in group.rglob("*") if path.is_file())


def test_rollback_goes_back_and_forth_and_numbers_go_on(root: Path) -> None:
    assert rollback(root, "white", "r000002") == "r000004"
    assert rho(root) == 0.5
    assert rollback(root, "white", "r000003") == "r000002"
    assert rho(root) == 0.75
    brdfdb.open(root).verify("white")
    assert publish_dataset(root, "white", requested(0.125))[0] == "r000005"


def test_rollback_refuses_what_is_not_there_or_damaged(root: Path) -> None:
    for revision in ("r000009", "", "../white/r000001", "HEAD.json"):
        with pytest.raises(StoreError, match=r"^white has no revision .*; it has r000001, r000002, r000003, r000004$"):
            rollback(root, "white", revision)
    chunk(root, "r000002").write_bytes(b"")
    with pytest.raises(StoreError, match=r"^white r000002 is damaged: brdf/c/0/0/0 has 0 bytes"):
        rollback(root, "white", "r000002")
    with pytest.raises(UnknownMaterialError):
        rollback(root, "black", "r000001")
    assert rho(root) == 1.0


def test_how_a_material_stands_to_a_request(root: Path) -> None:
    stands = standing(root, "white", {"rho": 1.0})
    assert (stands.state, stands.revision) == ("current", "r000004")
    stands = standing(root, "white", {"rho": 0.5})
    assert (stands.state, stands.revision, stands.why) == ("adoptable", "r000002", "rho changed")
    stands = standing(root, "white", {"rho": 0.5, "grid": []})
    assert (stands.state, stands.why) == ("missing", "grid changed, rho changed")
    assert standing(root, "black", {"rho": 0.5}).why == "new"
    pointer(root).unlink()
    stands = standing(root, "white", {"rho": 1.0})
    why = "white is damaged: HEAD.json is missing"
    assert (stands.state, stands.revision, stands.why) == ("adoptable", "r000004", why)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ({"model_version": 2, "grid": 1}, {"model_version": 3, "grid": 1}, "model version 2 -> 3"),
        ({"grid": {"a": [1.0]}}, {"grid": {"a": [2.0]}}, "grid changed"),
        ({"material": {"parameters": 1, "source": "x"}}, {"material": {"parameters": 2, "source": "x"}},
         "parameters changed"),
        ({}, {"grid": 1}, "the current table does not record its request"),
    ],
)  # fmt: skip
def test_a_difference_is_a_phrase(old: dict[str, object], new: dict[str, object], said: str) -> None:
    assert difference(old, new) == said


# Collection


@pytest.mark.parametrize(("keep", "left"), [(1, (4,)), (2, (3, 4)), (3, (2, 3, 4)), (9, (1, 2, 3, 4))])
def test_collection_keeps_the_current_revision_and_the_newest(root: Path, keep: int, left: tuple[int, ...]) -> None:
    before = sum(path.stat().st_size for path in root.rglob("*") if path.is_file())
    collected = collect(root, keep)
    assert names(root) == kept(*left)
    after = sum(path.stat().st_size for path in root.rglob("*") if path.is_file())
    assert collected.freed == before - after
    assert rho(root) == 1.0


def test_collection_after_a_rollback_keeps_the_current_revision_and_numbers_are_not_given_again(root: Path) -> None:
    rollback(root, "white", "r000001")
    collect(root, 2)
    assert names(root) == kept(1, 4)
    collect(root, 1)
    assert names(root) == kept(1)
    assert publish_dataset(root, "white", requested(0.5))[0] == "r000005"
    with pytest.raises(ValueError, match=r"^keep: 0 is not at least 1"):
        collect(root, 0)


def test_collection_takes_what_crashes_left_behind_and_nothing_of_a_build_at_work(root: Path) -> None:
    material = root / "materials" / "white"
    shutil.copytree(material / "r000004", material / "r000005")  # no manifest
    shutil.copyfile(manifest_path(material / "r000004"), manifest_path(material / "r000006"))  # no directory
    (material / ".HEAD.json.0123").write_text("{")
    (root / ".brdfdb.json.0123").write_text("{")
    for name in ("white", "black"):
        (root / ".staging" / name / "key" / "blocks").mkdir(parents=True)
    (root / "materials" / "empty").mkdir()
    with Lock(root, "white"):
        assert collect(root, 9).busy == ["white"]
        assert sorted(path.name for path in (root / ".staging").iterdir()) == ["white"]
        assert (material / "r000005").is_dir()
    assert collect(root, 9).busy == []
    assert names(root) == kept(1, 2, 3, 4)
    assert sorted(path.name for path in root.iterdir()) == [".staging", "brdfdb.json", "materials"]
    assert not list((root / ".staging").iterdir())
    assert [path.name for path in (root / "materials").iterdir()] == ["white"]


def test_collection_leaves_alone_what_no_pointer_tells_about(root: Path) -> None:
    pointer(root).unlink()
    for content in (None, "{", json.dumps({"revision": "r000002"})):
        if content is not None:
            pointer(root).write_text(content)
        collect(root, 1)
        assert [n for n in names(root) if n != "HEAD.json"] == [n for n in kept(1, 2, 3, 4) if n != "HEAD.json"]


def test_a_revision_that_is_removed_while_it_is_read_is_never_read_as_data(root: Path) -> None:
    store = brdfdb.open(root)
    with store.dataset("white") as lazy:
        publish_dataset(root, "white", requested(0.5))
        collect(root, 1)
        with pytest.raises(StoreError, match=r"^white r000004 was removed while it was read; open the material again$"):
            lazy["brdf"].load()


def test_readers_of_a_material_that_is_published_and_collected_all_the_time_see_whole_tables(root: Path) -> None:
    over = threading.Event()
    reads = [0]

    def read() -> None:
        while not over.is_set():
            table = brdfdb.open(root)["white"]
            assert np.all(table.brdf == table.brdf[0, 0, 0])
            assert float(np.round(table.brdf[0, 0, 0] * np.pi, 6)) == table.attrs["parameters"]["rho"]
            reads[0] += 1

    errors = in_threads(2, read)
    for number in range(40):
        publish_dataset(root, "white", requested(number % 8 / 8))
        collect(root, 1)
    over.set()
    assert errors() == []
    assert reads[0] > 5
