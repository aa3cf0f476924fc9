"""Snapshots: one name for a whole database, which a paper can cite and a service can pin.

ROOT/snapshots/NAME.json   a revision of each material with the sha256 of its manifest, and the records of the families

A snapshot never changes, and a collection keeps the revisions that it names. Its digest is the first line of its file.
It depends on nothing but the tables: a snapshot of the same revisions under the same name has the same digest.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from brdfdb.errors import ParameterError, StoreError
from brdfdb.store.family import stale
from brdfdb.store.files import seal_of, sync_path, write_sealed
from brdfdb.store.lock import Lock, writing
from brdfdb.store.paths import NAME, snapshot_path
from brdfdb.store.reader import Store
from brdfdb.store.records import SNAPSHOT_FORMAT, SNAPSHOT_VERSION, Pin, Snapshot, read_snapshot
from brdfdb.store.revisions import SNAPSHOTS


def create(root: Path, name: str, advance: Callable[[], None] = lambda: None) -> str:
    """Name the current revisions of all materials, and the families; return the digest of the snapshot.

    Every file of each material is read; `advance` is called after each. StoreError says that the store has a snapshot
    of this name or no material, that a material is damaged or a family out of date.
    """
    if not NAME.fullmatch(name):
        raise ParameterError(
            "snapshot", f"{name[:60]!r} is not made of lower-case letters, digits and single hyphens", name
        )
    store = Store(root)
    path = snapshot_path(root, name)
    with Lock(root, SNAPSHOTS) as lock:
        if path.exists():
            raise StoreError(f"the store at {root} has a snapshot {name}, which never changes; take another name")
        materials: dict[str, Pin] = {}
        requests: dict[str, str] = {}
        for material in store:
            current = store.current(material)
            store.verify(material)
            materials[material] = {"revision": current.head["revision"], "manifest_sha256": current.location.digest}
            requests[material] = current.head["request_sha256"]
            advance()
        if not materials:
            raise StoreError(f"the store at {root} has no material to name")
        families = {}
        for family in store.families():
            record = store.family(family).record
            for member, request_sha256 in zip(record.members, record.request_sha256, strict=True):
                if requests.get(member) != request_sha256:
                    raise StoreError(stale(family, member))
            families[family] = record.model_dump(mode="json")
        snapshot: Snapshot = {
            "format": SNAPSHOT_FORMAT,
            "version": SNAPSHOT_VERSION,
            "name": name,
            "materials": materials,
            "families": families,
        }
        with writing(root, f"the snapshot {name}"):
            path.parent.mkdir(exist_ok=True)
            write_sealed(path, snapshot, lock.path.parent)
            sync_path(path.parent)
            sync_path(root)
    return seal_of(path)


def remove(root: Path, name: str) -> None:
    """Remove a snapshot, damaged or not; the revisions stay until they are collected. StoreError if there is none."""
    with Lock(root, SNAPSHOTS):
        path = snapshot_path(root, name)
        if not (NAME.fullmatch(name) and path.is_file()):
            read_snapshot(root, name)  # it raises an error that names the others
        with writing(root, f"the snapshot {name}"):
            path.unlink()
            sync_path(path.parent)
