"""Snapshots: what one name holds stays, whatever is built, collected or copied later."""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import brdfdb
from brdfdb.errors import StoreError, UnknownFamilyError, UnknownMaterialError, UnknownRevisionError
from brdfdb.store import snapshots, verification
from brdfdb.store.family import Sweep
from brdfdb.store.family_records import write_family
from brdfdb.store.paths import snapshot_path
from brdfdb.store.publication import publish_dataset
from brdfdb.store.revisions import collect
from brdfdb.tables.layout import digest
from brdfdb.tables.tabulation import tabulate
from tests.store.a_store import chunk, layout, rho


def request(rho: float) -> dict[str, Any]:
    return {"material": layout(rho).source.model_dump(mode="json")}  # type: ignore[attr-defined]


def lambert(rho: float) -> xr.Dataset:
    """Return a table with the request of a recipe."""
    return tabulate(layout(rho)).assign_attrs(request=request(rho), request_sha256=digest(request(rho)))


def publish_family(root: Path, *rhos: float) -> None:
    """A family of Lambert's model over rho, each member built anew."""
    members = [f"grey-{number:03d}" for number in range(1, len(rhos) + 1)]
    for name, value in zip(members, rhos, strict=True):
        publish_dataset(root, name, lambert(value))
    digests = [digest(request(value)) for value in rhos]
    axes = {"rho": list(rhos)}
    sweep = Sweep(name="grey", title="Grey", model="lambert", axes=axes, members=members, request_sha256=digests)
    write_family(str(root), sweep)


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A store with two materials, rho = 0.25 and 0.5, and a snapshot `paper` of them."""
    publish_dataset(tmp_path, "white", lambert(0.25))
    publish_dataset(tmp_path, "black", lambert(0.5))
    snapshots.create(tmp_path, "paper")
    return tmp_path


def test_a_snapshot_stays_while_builds_and_collections_go_on(root: Path) -> None:
    for quarter in (2, 3, 4):
        publish_dataset(root, "white", lambert(quarter / 4))
    publish_dataset(root, "grey", lambert(0.5))
    assert collect(root, 1).removed == [
        f"materials/white/r00000{n}{end}" for n in (3, 2) for end in (".MANIFEST.json", "")
    ]
    store = brdfdb.open(root, snapshot="paper")
    assert (list(store), len(store), "white" in store, "grey" in store) == (["black", "white"], 2, True, False)
    assert (rho(root), rho(brdfdb.open(root, snapshot="paper"))) == (1.0, 0.25)
    assert (store.head("white"), store["white"].revision, store.revisions("white")) == (*["r000001"] * 2, ["r000001"])
    assert store.summary("white")["title"] == "White"
    assert float(store.dataset("white")["brdf"][0, 0, 0]) == np.float32(0.25 / np.pi)
    with pytest.raises(UnknownMaterialError):
        store["grey"]
    with pytest.raises(UnknownRevisionError):
        store.table("white", "r000004")
    assert verification.snapshots(root) == []
    snapshots.remove(root, "paper")
    assert "materials/white/r000001" in collect(root, 1).removed


def test_the_digest_is_that_of_the_file_and_of_the_same_revisions_the_same(root: Path) -> None:
    first, _, rest = snapshot_path(root, "paper").read_bytes().partition(b"\n")
    cited = hashlib.sha256(rest).hexdigest()
    assert cited.encode() in first
    snapshots.remove(root, "paper")
    assert snapshots.create(root, "paper") == cited
    publish_dataset(root, "white", lambert(1.0))
    snapshots.remove(root, "paper")
    assert snapshots.create(root, "paper") != cited


def test_a_snapshot_holds_the_families(root: Path) -> None:
    publish_family(root, 0.0, 0.5, 1.0)
    snapshots.create(root, "with-family")
    publish_family(root, 0.0, 0.25, 0.5)
    now, then = brdfdb.open(root).family("grey"), brdfdb.open(root, snapshot="with-family").family("grey")
    assert (now.record.axes["rho"][-1], then.record.axes["rho"][-1]) == (0.5, 1.0)
    assert float(then.lookup(0.1, 0.0, 0.1, 0.0, rho=0.75)) == pytest.approx(0.75 / np.pi, rel=1e-6)
    with pytest.raises(UnknownFamilyError):
        brdfdb.open(root, snapshot="paper").family("grey")
    publish_dataset(root, "grey-002", lambert(0.125))
    with pytest.raises(StoreError, match=r"^the family grey is out of date: grey-002 was rebuilt"):
        snapshots.create(root, "stale")


def test_what_is_refused_is_one_sentence(root: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    with pytest.raises(StoreError, match=rf"^the store at {root} has a snapshot paper, which never changes; "):
        snapshots.create(root, "paper")
    with pytest.raises(ValueError, match=r"^snapshot: 'Paper 1' is not made of lower-case letters"):
        snapshots.create(root, "Paper 1")
    for ask in (snapshots.remove, lambda at, name: brdfdb.open(at, snapshot=name)):
        for name in ("poster", "../paper", ""):
            with pytest.raises(StoreError, match=rf"^no snapshot '{name}' in the store at {root}; it has paper$"):
                ask(root, name)
    with pytest.raises(ValueError, match=r"^snapshot: 'paper' of a service is chosen there"):
        brdfdb.open("http://127.0.0.1:1", snapshot="paper")
    chunk(root).write_bytes(b"")
    with pytest.raises(StoreError, match=r"^white r000001 is damaged: brdf/c/0/0/0 has 0 bytes"):
        snapshots.create(root, "poster")
    assert not snapshot_path(root, "poster").exists()
    empty = tmp_path_factory.mktemp("empty")
    publish_dataset(empty, "white", lambert(0.5))
    shutil.rmtree(empty / "materials" / "white")
    with pytest.raises(StoreError, match=r"has no material to name$"):
        snapshots.create(empty, "paper")


def test_a_damaged_snapshot_is_named_and_nothing_is_collected_until_it_is_removed(root: Path) -> None:
    publish_dataset(root, "white", lambert(1.0))
    path = snapshot_path(root, "paper")
    path.write_bytes(path.read_bytes().replace(b"r000001", b"r000002"))
    said = "the snapshot paper is damaged: the content of paper.json changed"
    with pytest.raises(StoreError, match=f"^{said}$"):
        brdfdb.open(root, snapshot="paper")
    (found,) = verification.snapshots(root)
    assert (found.sentence, "`brdfdb snapshot --remove paper`" in found.repair) == (said, True)
    with pytest.raises(StoreError, match=f"^nothing is collected, since {said}; remove it with `brdfdb snapshot --rem"):
        collect(root, 1)
    snapshots.remove(root, "paper")
    assert verification.snapshots(root) == []
    assert "materials/white/r000001" in collect(root, 1).removed


def test_a_damaged_or_missing_revision_of_a_snapshot_is_named_with_it(root: Path) -> None:
    publish_dataset(root, "white", lambert(1.0))
    group = root / "materials" / "white" / "r000001"
    chunk(root).write_bytes(b"")
    _, (found,) = verification.material(root, "white")
    assert found.repair.endswith("or `brdfdb snapshot --remove paper` and `brdfdb gc --damaged`")
    assert collect(root, 9, damaged=True).removed == []  # a snapshot is not taken apart unasked
    shutil.rmtree(group)
    group.with_name("r000001.MANIFEST.json").unlink()
    (found,) = verification.snapshots(root)
    said = "the snapshot paper is damaged: white r000001 is damaged: r000001.MANIFEST.json is missing"
    assert found.sentence == said


# Copies of a store that is at work


def copied(root: Path, copy: Path, step: int, happens: Callable[[], object]) -> None:
    """Copy a store file by file as `cp -r` does, while something happens to it before the file of a number."""
    numbers = iter(range(10**6))

    def file(source: str, target: str) -> None:
        if next(numbers) == step:
            happens()
        if os.path.exists(source):  # cp warns of files that vanished, and goes on
            shutil.copy2(source, target)

    with suppress(shutil.Error):
        shutil.copytree(root, copy, copy_function=file)


@pytest.mark.parametrize("step", range(0, 40, 5))
def test_a_copy_of_a_store_in_use_is_sound_or_names_the_damage(tmp_path: Path, step: int) -> None:
    root, copy = tmp_path / "store", tmp_path / "copy"
    for quarter in (1, 2, 3):
        publish_dataset(root, "white", lambert(quarter / 4))
        if quarter == 1:
            snapshots.create(root, "paper")

    def happens() -> None:
        publish_dataset(root, "white", lambert(1.0))
        collect(root, 1)

    copied(root, copy, step, happens)
    assert rho(brdfdb.open(copy, snapshot="paper")) == 0.25
    assert verification.snapshots(copy) == []
    found = verification.material(copy, "white")[1]
    try:
        read = rho(copy)
    except StoreError:
        read = None
    assert read in (0.75, 1.0) or found, "what is torn must be named"
    publish_dataset(copy, "white", lambert(1.0))  # as a build does where the current revision is damaged
    collect(copy, 9, damaged=True)
    assert (verification.material(copy, "white")[1], rho(copy)) == ([], 1.0)
