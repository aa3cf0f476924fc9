"""Verification of every byte of a store against the chain of digests; each finding names what repairs it."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from brdfdb.errors import StoreError, UnknownMaterialError
from brdfdb.store.paths import manifest_path, material_path, revision_path, snapshot_path
from brdfdb.store.reader import Pointer, Store
from brdfdb.store.records import (
    WrongSummaryError,
    check_manifest,
    check_summary,
    read_manifest,
    read_metadata,
    read_snapshot,
    snapshot_names,
    whole_revisions,
)
from brdfdb.store.revisions import pinned, strangers

_BUILD = "`brdfdb build` with its recipe repairs it"


@dataclass(frozen=True)
class StoreFinding:
    """Damage of a material, a family or a snapshot, and the command that repairs it; empty for a remark."""

    name: str
    sentence: str
    repair: str

    @property
    def remark(self) -> bool:
        """True if nothing is damaged, and the sentence names missing metadata of a table."""
        return not self.repair

    def __str__(self) -> str:
        return self.sentence if self.remark else f"{self.sentence}; {self.repair}"


class Verified(NamedTuple):
    """The size [byte] of a current revision or of a record, 0 if it is damaged, and the findings on it."""

    bytes: int
    findings: list[StoreFinding]


class WrongTableError(StoreError):
    """A revision whose files match its manifest but are not a table: another program wrote it."""


def material(root: Path, name: str) -> Verified:
    """Check a material with all its revisions; UnknownMaterialError if the store has none of this name.

    In the current revision, sizes and sha256 of the files are compared with the manifest, the manifest and its summary
    with the pointer, and the list of files with the directory. Every chunk is decoded, which checks its crc32c.
    Dimensions, types, shapes and attributes must be those of a table. In the other revisions, manifest, sizes, sha256
    and the list of files are checked. A revision that is superseded and collected meanwhile is not a finding.
    """
    store = Store(root)
    while True:
        try:
            current = store.current(name)
        except StoreError as error:
            return Verified(0, [StoreFinding(name, str(error), _pointer_repair(material_path(store.root, name)))])
        group, digest = current.location
        try:
            size = _check_current(name, current)
            gaps = read_metadata(group).gaps  # a table of another program may lack metadata, and can be looked up still
            findings = [StoreFinding(name, f"{name} {group.name} {gaps}", "")] if gaps else []
        except StoreError as error:
            if not _is_current(store, name, current):
                continue
            size = 0
            findings = [StoreFinding(name, str(error), _repair(group, error))]
            if isinstance(error, WrongSummaryError):
                return Verified(size, findings)
        return Verified(size, findings + _strange(name, group, digest) + _others(store, current))


def _is_current(store: Store, name: str, pointer: Pointer) -> bool:
    """Return False if the current revision was superseded since its pointer was read."""
    with suppress(StoreError, UnknownMaterialError):
        return store.location(name) == pointer.location
    return False


def _repair(group: Path, error: StoreError) -> str:
    """Return the repair of a current revision."""
    if isinstance(error, WrongSummaryError):
        return _pointer_repair(group.parent)
    if isinstance(error, WrongTableError):
        return f"`rm {manifest_path(group)}`, then {_BUILD}"
    return "`brdfdb build` with its recipe makes it anew, then `brdfdb gc --damaged` removes this revision"


def _pointer_repair(material: Path) -> str:
    """Return the repair of a pointer that is missing or damaged: a build, or a rollback to the newest revision."""
    for group in reversed(whole_revisions(material)):
        try:
            check_manifest(group, None, contents=True)
        except StoreError:
            continue
        return f"{_BUILD}, or `brdfdb rollback {material.name} {group.name}`"
    return _BUILD


def _strange(name: str, group: Path, digest: str | None) -> list[StoreFinding]:
    try:
        paths = strangers(group, digest)
    except OSError:  # removed while it was looked through
        return []
    return [
        StoreFinding(
            name, f"{name} {group.name}: {path.relative_to(group)} does not belong there", "`brdfdb gc` removes it"
        )
        for path in paths
    ]


def _others(store: Store, current: Pointer) -> list[StoreFinding]:
    """Check the revisions that are not current."""
    findings: list[StoreFinding] = []
    name = current.head["material"]
    manifests = current.head["manifests"]
    for group in whole_revisions(current.path.parent):
        digest = manifests.get(group.name)
        if group == current.location.group:
            continue
        try:
            check_manifest(group, digest, contents=True)
        except StoreError as error:
            if manifest_path(group).is_file():  # else it was collected meanwhile
                findings.append(
                    StoreFinding(name, f"{error} (not the current revision)", _other_repair(store.root, group))
                )
            continue
        findings += _strange(name, group, digest)
    for revision in manifests:
        group = current.path.with_name(revision)
        if not group.is_dir() and manifest_path(group).is_file():  # a collection removes the manifest first
            sentence = f"{name} {revision} is damaged: its directory is missing (not the current revision)"
            findings.append(StoreFinding(name, sentence, _other_repair(store.root, group)))
    return findings


def _other_repair(root: Path, group: Path) -> str:
    try:
        snapshot = pinned(root).get(group)
    except StoreError:
        snapshot = None  # `snapshots` reports it
    if snapshot is None:
        return "`brdfdb gc --damaged` removes it"
    return f"copy it from an undamaged store, or `brdfdb snapshot --remove {snapshot}` and `brdfdb gc --damaged`"


def family(root: Path, name: str) -> Verified:
    """Check the record of a family."""
    from brdfdb.store.family_records import verify_family  # it imports much to measure families

    try:
        return Verified(verify_family(root, name), [])
    except StoreError as error:
        return Verified(0, [StoreFinding(name, str(error), _BUILD)])


def snapshots(root: Path) -> list[StoreFinding]:
    """Check every snapshot, and the manifests of the revisions that it names; `material` checks their contents."""
    findings = []
    for name in snapshot_names(root):
        remove = f"`brdfdb snapshot --remove {name}`"
        try:
            pins = read_snapshot(root, name)["materials"]
        except StoreError as error:
            if snapshot_path(root, name).is_file():  # else it was removed meanwhile
                again = f"copy it from an undamaged store, or {remove} and name the revisions anew"
                findings.append(StoreFinding(name, str(error), again))
            continue
        for material, pin in pins.items():
            try:
                read_manifest(revision_path(root, material, pin["revision"]), pin["manifest_sha256"])
            except StoreError as error:
                sentence = f"the snapshot {name} is damaged: {error}"
                findings.append(StoreFinding(name, sentence, f"copy the revision from an undamaged store, or {remove}"))
    return findings


def _check_current(name: str, current: Pointer) -> int:
    """Check the current revision of a material; return its size [byte]. StoreError names the first damage."""
    import zarr

    from brdfdb.store.zarr_store import CheckedRevision

    group = current.location.group
    where = f"{name} {group.name}"
    manifest = check_manifest(*current.location, contents=True)
    check_summary(current.head, manifest)
    files = manifest["files"]
    try:
        opened = zarr.open_group(CheckedRevision(group, files), mode="r")
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
