"""Paths inside a store: one spelling of each, and the names that may stand in them."""

from __future__ import annotations

import re
from pathlib import Path

# Of a material, a family or a snapshot: what does not match is never joined to a path. Files may have names of 255
# characters
NAME = re.compile(r"(?!.{129})[a-z0-9]+(-[a-z0-9]+)*")

HEAD = "HEAD.json"
EDITION = "edition.json"  # the root of an edition
METADATA = "zarr.json"  # of a zarr group or array
_MANIFEST = ".MANIFEST.json"
DIRECTORIES = ("materials", "families", "snapshots", ".staging")  # of a store


def is_edition(place: Path) -> bool:
    """Return True if a directory has an edition."""
    return (place / EDITION).is_file()


def marker_path(root: Path) -> Path:
    """Return the path of the file that makes a directory a store."""
    return root / "brdfdb.json"


def materials_path(root: Path) -> Path:
    """Return the directory of the materials of a store."""
    return root / "materials"


def material_path(root: Path, name: str) -> Path:
    """Return the directory of a material."""
    return root / "materials" / name


def pointer_path(material: Path) -> Path:
    """Return the path of the pointer in the directory of a material."""
    return material / HEAD


def revision_path(root: Path, name: str, revision: str) -> Path:
    """Return the directory of a revision of a material."""
    return root / "materials" / name / revision


def manifest_path(group: Path) -> Path:
    """Return the path of the manifest of a revision, outside its directory, since zarr warns of other files inside."""
    return group.with_name(f"{group.name}{_MANIFEST}")


def revision_of(path: Path) -> Path:
    """Return the directory of the revision that a path is, or is the manifest of."""
    return path.with_name(path.name.removesuffix(_MANIFEST))


def number_of(revision: str) -> int:
    """Return 3 for ``r000003``; 0 for anything else, such as ``r000003.MANIFEST.json``."""
    return int(revision[1:]) if revision[:1] == "r" and revision[1:].isdecimal() else 0


def pinned(revision: str, digest: str) -> str:
    """Return the name of a revision that no other store has: with the first 16 digits of its manifest's sha256."""
    return f"{revision}-{digest[:16]}"


def store_of(group: Path) -> Path | None:
    """Return the root of the store that a directory of a revision lies in; None if it lies in none."""
    materials = group.parent.parent
    return materials.parent if materials.name == "materials" and marker_path(materials.parent).is_file() else None


def store_around(path: Path) -> Path | None:
    """Return the root of the store that a path lies in, at any depth; None if it lies in none, or is the root."""
    return next((folder for folder in path.resolve().parents if marker_path(folder).is_file()), None)


def families_path(root: Path) -> Path:
    """Return the directory of the records of families."""
    return root / "families"


def family_path(root: Path, name: str) -> Path:
    """Return the path of the record of a family."""
    return families_path(root) / f"{name}.json"


def snapshots_path(root: Path) -> Path:
    """Return the directory of the snapshots."""
    return root / "snapshots"


def snapshot_path(root: Path, name: str) -> Path:
    """Return the path of a snapshot."""
    return snapshots_path(root) / f"{name}.json"


def staging_path(root: Path) -> Path:
    """Return the directory of the builds in progress."""
    return root / ".staging"


def staged_path(root: Path, name: str) -> Path:
    """Return the directory of the builds of a material that are in progress."""
    return staging_path(root) / name


def request_path(root: Path, name: str, request_sha256: str) -> Path:
    """Return the directory in which a request is staged."""
    return staged_path(root, name) / request_sha256[:16]


def store_of_staged(request: Path) -> Path:
    """Return the root of the store that a request is staged in: the inverse of `request_path`."""
    return request.parent.parent.parent
