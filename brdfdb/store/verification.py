"""Verification of every byte of a store against the chain of digests; each finding names what repairs it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from brdfdb.errors import StoreError, UnknownMaterialError
from brdfdb.store.decoding import read_metadata
from brdfdb.store.files import Entry
from brdfdb.store.manifest import check_manifest, read_manifest, whole_revisions
from brdfdb.store.paths import manifest_path, material_path, revision_path, snapshot_path
from brdfdb.store.pointer import Head, WrongSummaryError, check_summary
from brdfdb.store.reader import Store
from brdfdb.store.revisions import pinned, strangers
from brdfdb.store.snapshot_record import read_snapshot, snapshot_names

_BUILD = "`brdfdb build` with its recipe repairs it"
_BUILD_ANEW = "`brdfdb build` with its recipe makes it anew, then `brdfdb gc --damaged` removes this revision"


@dataclass(frozen=True)
class Finding:
    """Damage of a material, a family or a snapshot, and the command that repairs it; a remark has no such command."""

    name: str
    sentence: str
    repair: str

    @property
    def remark(self) -> bool:
        """True if nothing is damaged: the sentence says what a table does not state of itself."""
        return not self.repair

    def __str__(self) -> str:
        return self.sentence if self.remark else f"{self.sentence}; {self.repair}"


class WrongTableError(StoreError):
    """A revision whose files are those of its manifest, and no table: it was written so."""


def material(root: Path, name: str) -> tuple[int, list[Finding]]:
    """Check all of a material; return the bytes of its current revision, and what is wrong.

    Of the current revision: sizes and sha256 of its files against the manifest, that against the pointer, what both say
    of it, and that nothing else lies there; every chunk is decoded, which checks its crc32c; dimensions, types and
    shapes agree, and the attributes are those of a table. Of the other revisions: manifest, sizes, sha256, strangers.
    A revision that is superseded and collected meanwhile is not a finding.

    Raises
    ------
    UnknownMaterialError
        If the store has no such material.
    """
    store = Store(root)
    while True:
        try:
            group, digest, head = store.current(name)
        except StoreError as error:
            return 0, [Finding(name, str(error), _pointer_repair(material_path(store.root, name)))]
        try:
            size, findings = _current(name, group, digest, head), _remarks(name, group)
        except StoreError as error:
            if _moved(store, name, group, digest):
                continue
            if isinstance(error, WrongSummaryError):
                return 0, [Finding(name, str(error), _pointer_repair(group.parent))]
            repair = (
                f"`rm {manifest_path(group)}`, then {_BUILD}" if isinstance(error, WrongTableError) else _BUILD_ANEW
            )
            size, findings = 0, [Finding(name, str(error), repair)]
        return size, findings + _strange(name, group, digest) + _others(store, group, head)


def _remarks(name: str, group: Path) -> list[Finding]:
    """Return what the metadata of a revision lacks: a table that another program published can be looked up still."""
    gaps = read_metadata(group).gaps
    return [Finding(name, f"{name} {group.name} {gaps}", "")] if gaps else []


def _moved(store: Store, name: str, group: Path, digest: str) -> bool:
    try:
        return store.location(name) != (group, digest)
    except (StoreError, UnknownMaterialError):
        return True


def _pointer_repair(material: Path) -> str:
    """Return the repair of a pointer that is missing or damaged: a build, or a rollback to the newest revision."""
    for group in reversed(whole_revisions(material)):
        try:
            check_manifest(group, None, contents=True)
        except StoreError:
            continue
        return f"{_BUILD}, or `brdfdb rollback {material.name} {group.name}`"
    return _BUILD


def _strange(name: str, group: Path, digest: str | None) -> list[Finding]:
    try:
        paths = strangers(group, digest)
    except OSError:  # removed while it was looked through
        return []
    return [
        Finding(name, f"{name} {group.name}: {path.relative_to(group)} does not belong there", "`brdfdb gc` removes it")
        for path in paths
    ]


def _others(store: Store, current: Path, head: Head) -> list[Finding]:
    """Check the revisions that are not current."""
    findings: list[Finding] = []
    name = current.parent.name
    for group in whole_revisions(current.parent):
        digest = head["manifests"].get(group.name)
        if group == current:
            continue
        try:
            check_manifest(group, digest, contents=True)
        except StoreError as error:
            if manifest_path(group).is_file():  # else it was collected meanwhile
                findings.append(Finding(name, f"{error} (not the current revision)", _other_repair(store.root, group)))
            continue
        findings += _strange(name, group, digest)
    for revision in head["manifests"]:
        group = current.with_name(revision)
        if not group.is_dir() and manifest_path(group).is_file():  # a collection removes the manifest first
            sentence = f"{name} {revision} is damaged: its directory is missing (not the current revision)"
            findings.append(Finding(name, sentence, _other_repair(store.root, group)))
    return findings


def _other_repair(root: Path, group: Path) -> str:
    try:
        snapshot = pinned(root).get(group)
    except StoreError:
        snapshot = None  # is a finding of its own
    if snapshot is None:
        return "`brdfdb gc --damaged` removes it"
    return f"copy it from where it is whole, or `brdfdb snapshot --remove {snapshot}` and `brdfdb gc --damaged`"


def family(root: Path, name: str) -> tuple[int, list[Finding]]:
    """Check the record of a family; return its bytes, and what is wrong."""
    from brdfdb.store.family_records import verify_family  # it measures families, which takes more imports

    try:
        return verify_family(root, name), []
    except StoreError as error:
        return 0, [Finding(name, str(error), _BUILD)]


def snapshots(root: Path) -> list[Finding]:
    """Check every snapshot, and the manifests of the revisions that it names; `material` checks their contents."""
    findings = []
    for name in snapshot_names(root):
        remove = f"`brdfdb snapshot --remove {name}`"
        try:
            pins = read_snapshot(root, name)["materials"]
        except StoreError as error:
            if snapshot_path(root, name).is_file():  # else it was removed meanwhile
                again = f"copy it from where it is whole, or {remove} and name the revisions anew"
                findings.append(Finding(name, str(error), again))
            continue
        for material, pin in pins.items():
            try:
                read_manifest(revision_path(root, material, pin["revision"]), pin["manifest_sha256"])
            except StoreError as error:
                sentence = f"the snapshot {name} is damaged: {error}"
                findings.append(Finding(name, sentence, f"copy the revision from where it is whole, or {remove}"))
    return findings


def _current(name: str, group: Path, digest: str, head: Head) -> int:
    """Check the current revision of a material; return its bytes. StoreError names what is damaged first."""
    import zarr

    from brdfdb.store.zarr_store import Whole

    where = f"{name} {group.name}"
    manifest = check_manifest(group, digest, contents=True)
    check_summary(head, manifest)
    files: dict[str, Entry] = manifest["files"]
    try:
        opened = zarr.open_group(Whole(group, files), mode="r")
        arrays = dict(opened.arrays())
    except StoreError:
        raise
    except Exception as error:
        raise WrongTableError(f"{where} is not a table: its metadata cannot be read: {error}") from error
    if "brdf" not in arrays and "parts" not in arrays:
        raise WrongTableError(f"{where} is not a table: it has no array brdf or parts")
    sizes: dict[str, int] = {}
    for key, array in arrays.items():
        _check_array(where, key, array, sizes)
    for dimension in sizes:
        if dimension not in arrays and dimension not in ("part", "element"):  # these have only an order
            raise WrongTableError(f"{where} is not a table: it lacks the coordinate {dimension}")
    return sum(entry["size"] for entry in files.values())


def _check_array(where: str, key: str, array: Any, sizes: dict[str, int]) -> None:
    """Check type and dimensions of an array, whose sizes are added to `sizes`, and decode every chunk."""
    metadata: Any = array.metadata
    dims = metadata.dimension_names or ()
    if len(dims) != len(array.shape):
        raise WrongTableError(f"{where} is not a table: {key} does not name its dimensions")
    for dimension, size in zip(dims, array.shape, strict=True):
        if sizes.setdefault(dimension, size) != size:
            raise WrongTableError(
                f"{where} is not a table: {key} has {size} values along {dimension}, not {sizes[dimension]}"
            )
    if len(dims) > 1 and key in ("brdf", "parts") and array.dtype != np.float32:
        raise WrongTableError(f"{where} is not a table: {key} is {array.dtype}, not float32")
    step = array.chunks[0] if array.shape else 1
    for number, start in enumerate(range(0, array.shape[0] if array.shape else 1, step)):
        try:
            array[start : start + step] if array.shape else array[...]
        except StoreError:
            raise
        except Exception as error:
            raise WrongTableError(f"{where} is damaged: chunk {number} of {key} cannot be decoded: {error}") from error
