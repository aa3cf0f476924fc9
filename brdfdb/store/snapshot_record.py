"""Records of snapshots: a revision of each material, and the records of the families."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, TypedDict, cast

from brdfdb.errors import (
    StoreError,
)
from brdfdb.store.paths import NAME, number_of, snapshot_path, snapshots_path
from brdfdb.store.sealed_json import check_fields, read_sealed

SNAPSHOT_FORMAT, SNAPSHOT_VERSION = "brdfdb-snapshot", 1


class Pin(TypedDict):
    """A revision that a snapshot names."""

    revision: str
    manifest_sha256: str


class Snapshot(TypedDict):
    """A whole database under one name: a revision of each material, and the records of the families."""

    format: str
    version: int
    name: str
    materials: dict[str, Pin]
    families: dict[str, dict[str, Any]]


def snapshot_names(root: Path) -> list[str]:
    """Return the names of the snapshots of the store at `root`, sorted."""
    try:
        files = sorted(os.listdir(snapshots_path(root)))
    except FileNotFoundError:
        return []
    except OSError as error:
        raise StoreError(f"cannot read {snapshots_path(root)}: {error.strerror}") from error
    return [name[:-5] for name in files if name.endswith(".json") and NAME.fullmatch(name[:-5])]


def read_snapshot(root: Path, name: str) -> Snapshot:
    """Return a snapshot of the store at `root`.

    Raises
    ------
    StoreError
        If there is none of this name, or it is damaged or of another version.
    """
    where = f"the snapshot {name}"
    if not (NAME.fullmatch(name) and snapshot_path(root, name).is_file()):
        others = ", ".join(snapshot_names(root)) or "none"
        raise StoreError(f"no snapshot {name[:60]!r} in the store at {root}; it has {others}")
    path = snapshot_path(root, name)
    content = read_sealed(path, where)
    if (content.get("format"), content.get("version")) != (SNAPSHOT_FORMAT, SNAPSHOT_VERSION):
        raise StoreError(
            f"{path} says format {content.get('format')} version {content.get('version')}, "
            f"this program reads {SNAPSHOT_FORMAT} version {SNAPSHOT_VERSION}"
        )
    check_fields(content, {"name": str, "materials": dict, "families": dict}, where, path.name)
    if content["name"] != name:
        raise StoreError(f"{where} is damaged: {path.name} is that of {content['name']}")
    for material, pin in content["materials"].items():
        check_fields(pin, {"revision": str, "manifest_sha256": str}, where, path.name)
        if not (NAME.fullmatch(material) and number_of(pin["revision"])):
            raise StoreError(f"{where} is damaged: {path.name} names {material} {pin['revision']}")
    return cast(Snapshot, content)
