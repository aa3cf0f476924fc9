"""Verification: damage of every kind is named with what repairs it, and that does so."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import brdfdb
from brdfdb.errors import ParameterError, StoreError
from brdfdb.store import codec, files, publication, snapshots, verification
from brdfdb.store.files import sealed, unsealed
from brdfdb.store.paths import manifest_path
from brdfdb.store.publication import publish_dataset
from brdfdb.store.records import make_store
from brdfdb.store.revisions import adoptable, collect, history, rollback, standing
from brdfdb.tables.layout import digest
from tests.store.a_store import chunk, flip, pointer, requested, rho


def findings(root: Path) -> list[str]:
    return [str(finding) for finding in verification.material(root, "white")[1]]


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A store with three revisions of one material: rho = 0.25, 0.5, 0.75."""
    for quarter in range(1, 4):
        publish_dataset(tmp_path, "white", requested(quarter / 4))
    return tmp_path


def changed(path: Path, **changes: object) -> None:
    """Change a sealed file, and seal it again: what no checksum of the file itself can notice."""
    path.write_bytes(sealed({**unsealed(path.read_bytes(), "", ""), **changes}))


def test_a_sound_store_has_no_findings_and_counts_its_bytes(root: Path) -> None:
    group = brdfdb.open(root).path("white")
    size = sum(path.stat().st_size for path in group.rglob("*") if path.is_file())
    assert verification.material(root, "white") == (size, [])


# What the chain of digests notices


def test_a_pointer_that_says_other_than_its_manifest_is_named_and_repaired(root: Path) -> None:
    changed(pointer(root), title="Black")
    said = "white is damaged: HEAD.json says title 'Black', not 'White'; `brdfdb build` with its recipe repairs it, or"
    assert findings(root) == [f"{said} `brdfdb rollback white r000003`"]
    assert rollback(root, "white", "r000003") == "r000003"
    assert findings(root) == []
    assert brdfdb.open(root).summary("white")["title"] == "White"


def test_a_pointer_that_was_lost_is_missed_and_made_again(root: Path) -> None:
    pointer(root).unlink()
    store = brdfdb.open(root)
    assert ("white" in store, list(store)) == (True, ["white"])
    with pytest.raises(StoreError, match=r"^white is damaged: HEAD\.json is missing$"):
        store["white"]
    said = "white is damaged: HEAD.json is missing; `brdfdb build` with its recipe repairs it, or"
    assert findings(root) == [f"{said} `brdfdb rollback white r000003`"]
    assert rollback(root, "white", "r000003") == ""
    assert (findings(root), rho(root)) == ([], 0.75)
    assert publish_dataset(root, "white", requested(1.0))[0] == "r000004"


def test_a_pointer_that_a_first_publication_is_about_to_write_is_not_missed(tmp_path: Path) -> None:
    publish_dataset(tmp_path, "white", requested(0.25))
    pointer(tmp_path).unlink()
    (tmp_path / ".staging" / "white" / "0123456789abcdef").mkdir(parents=True)  # as if killed before the swap
    store = brdfdb.open(tmp_path)
    assert ("white" in store, list(store)) == (False, [])
    collect(tmp_path)
    assert list(store) == []


def test_an_altered_older_manifest_is_not_believed(root: Path) -> None:
    older = manifest_path(root / "materials" / "white" / "r000001")
    files = unsealed(older.read_bytes(), "", "")["files"]
    newer = unsealed(older.with_name("r000002.MANIFEST.json").read_bytes(), "", "")["files"]
    chunk(root).write_bytes(chunk(root, "r000002").read_bytes())
    changed(older, files={**files, "brdf/c/0/0/0": newer["brdf/c/0/0/0"]})
    said = "white r000001 is damaged: r000001.MANIFEST.json is not the one whose digest was recorded"
    for ask in (
        lambda: rollback(root, "white", "r000001"),
        lambda: history(root, "white"),
        lambda: brdfdb.open(root).table("white", "r000001"),
    ):
        with pytest.raises(StoreError, match=f"^{said}$"):
            ask()
    assert adoptable(root, "white", digest({"rho": 0.25})) is None
    (found,) = findings(root)
    assert found.startswith(f"{said} (")
    assert found.endswith("; `brdfdb gc --damaged` removes it")
    assert "materials/white/r000001" in collect(root, 9, damaged=True).removed
    assert findings(root) == []
    assert [revision.name for revision in history(root, "white")] == ["r000002", "r000003"]


def test_a_damaged_older_revision_is_named_and_collected(root: Path) -> None:
    flip(chunk(root))
    said = "white r000001 is damaged: the content of brdf/c/0/0/0 changed (not the current revision); "
    assert findings(root) == [f"{said}`brdfdb gc --damaged` removes it"]
    assert collect(root, 9).removed == []
    removed = collect(root, 9, damaged=True).removed
    assert removed == ["materials/white/r000001.MANIFEST.json", "materials/white/r000001"]
    assert findings(root) == []


@pytest.mark.parametrize("revision", ["r000001", "r000003"])
def test_a_stranger_is_named_and_collected_and_no_reason_to_build_again(root: Path, revision: str) -> None:
    (root / "materials" / "white" / revision / "brdf" / "stray").write_text("")
    assert findings(root) == [f"white {revision}: brdf/stray does not belong there; `brdfdb gc` removes it"]
    assert standing(root, "white", {"rho": 0.75}).state == "current"
    assert collect(root, 9).removed == [f"materials/white/{revision}/brdf/stray"]
    assert (findings(root), rho(root)) == ([], 0.75)


@pytest.mark.parametrize("damage", [Path.unlink, lambda path: path.write_bytes(path.read_bytes()[:-1])])
def test_the_marker_of_a_store_with_tables_is_written_anew(root: Path, damage: Callable[[Path], object]) -> None:
    marker = root / "brdfdb.json"
    before = marker.read_bytes()
    damage(marker)
    with pytest.raises(StoreError, match=r"brdfdb\.json .*; `brdfdb build( --store .*` makes one|` writes it anew)"):
        brdfdb.open(root)
    make_store(root)
    assert marker.read_bytes() == before
    assert (findings(root), rho(root)) == ([], 0.75)


def test_a_revision_superseded_during_verification_is_no_finding(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    check, waiting = verification.check_manifest, [1.0, 0.125]

    def overtaken(*arguments: object, **keywords: object) -> object:
        if waiting:
            publish_dataset(root, "white", requested(waiting.pop()))
            collect(root, 1)
        return check(*arguments, **keywords)  # type: ignore[arg-type]

    monkeypatch.setattr(verification, "check_manifest", overtaken)
    assert findings(root) == []
    assert not waiting
    assert rho(root) == 1.0


# What the manifest cannot know


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d.rename(brdf="rho"), "is not a table: it has no array brdf or parts"),
        (lambda d: d.drop_vars("theta_r"), "is not a table: it lacks the coordinate theta_r"),
        (lambda d: d.assign(brdf=d["brdf"].astype(np.float64)), "is not a table: brdf is float64, not float32"),
    ],
)
def test_verify_knows_what_a_table_is(
    root: Path, change: Callable[[xr.Dataset], xr.Dataset], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:  # another program does not check
        patch.setattr(publication, "checked_dataset", lambda _, dataset: dataset)
        publish_dataset(root, "white", change(requested(0.5)))
    (found,) = findings(root)
    manifest = manifest_path(root / "materials" / "white" / "r000004")
    assert found == f"white r000004 {said}; `rm {manifest}`, then `brdfdb build` with its recipe repairs it"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d.rename(brdf="rho"), r"brdf: neither it nor parts is among the arrays "),
        (lambda d: d.transpose("theta_r", "theta_i", "delta_phi"), r"brdf: shape .* is not "),
        (lambda d: d.transpose("theta_i", "delta_phi", "theta_r"), r"brdf: its dimensions .* must begin with "),
        (lambda d: d.assign(brdf=d["brdf"].astype(np.int32)), "brdf: its values are int32, not float32"),
    ],
)
def test_a_dataset_that_no_lookup_can_read_is_not_published(
    root: Path, change: Callable[[xr.Dataset], xr.Dataset], said: str
) -> None:
    with pytest.raises(ParameterError, match=f"^{said}"):
        publish_dataset(root, "white", change(requested(0.5)))
    assert brdfdb.open(root).head("white") == "r000003"
    publish_dataset(root, "white", requested(0.5).astype(np.float64))  # these are converted
    assert (findings(root), rho(root)) == ([], 0.5)


def test_verify_remarks_on_what_a_table_does_not_state(root: Path) -> None:
    publish_dataset(root, "white", requested(0.5).drop_attrs(deep=False).assign_attrs(title="White", bits=99))
    size, (remark,) = verification.material(root, "white")
    assert remark.remark
    assert size > 0
    assert str(remark) == (
        "white r000004 does not state its material, table version, model, model version, parameters, source, "
        "conventions, and states its bits wrongly (99 must be at most 23)"
    )
    assert rho(root) == 0.5


def test_verify_decodes_every_chunk(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(codec, "_CHUNK_VALUES", 9)
    whole = files.write_file

    def spoil(path: Path, data: bytes, temporary: Path, **options: bool) -> object:
        if path.match("brdf/c/2/0/0"):  # written wrong, so that manifest and file agree
            data = data[:-1] + bytes([data[-1] ^ 1])
        return whole(path, data, temporary, **options)

    with monkeypatch.context() as patch:
        patch.setattr(files, "write_file", spoil)
        publish_dataset(root, "white", requested(0.5))
    brdfdb.open(root).verify("white")
    (found,) = findings(root)
    assert found.startswith("white r000004 is damaged: chunk 2 of brdf cannot be decoded: ")


def test_a_revision_of_another_material_is_not_adopted(root: Path) -> None:
    publish_dataset(root, "black", requested(0.125))
    black = root / "materials" / "black" / "r000001"
    white = root / "materials" / "white" / "r000009"
    shutil.copytree(black, white)
    shutil.copyfile(manifest_path(black), manifest_path(white))
    pointer(root).unlink()
    (found,) = findings(root)
    assert "`brdfdb rollback white r000003`" in found
    said = r"^white r000009 is damaged: r000009\.MANIFEST\.json is that of black r000001$"
    with pytest.raises(StoreError, match=said):
        rollback(root, "white", "r000009")
    rollback(root, "white", "r000003")
    assert rho(root) == 0.75


def test_a_revision_without_its_directory_is_named_and_stays_while_a_snapshot_names_it(root: Path) -> None:
    rollback(root, "white", "r000001")
    snapshots.create(root, "paper")
    rollback(root, "white", "r000003")
    shutil.rmtree(root / "materials" / "white" / "r000001")
    (found,) = findings(root)
    assert found.startswith("white r000001 is damaged: its directory is missing (not the current revision); copy it")
    collect(root, 1)
    assert manifest_path(root / "materials" / "white" / "r000001").is_file()
    snapshots.remove(root, "paper")
    collect(root, 1)
    assert findings(root) == []


def test_a_pointer_that_is_a_pipe_is_damage_and_does_not_hang(root: Path) -> None:
    pointer(root).unlink()
    os.mkfifo(pointer(root))
    with pytest.raises(StoreError, match=r"^white is damaged: HEAD\.json cannot be read: Not a regular file$"):
        brdfdb.open(root)["white"]
