"""Manifests: the files of each revision of a material, with sizes and digests."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from pathlib import Path
from types import NoneType
from typing import TYPE_CHECKING, Any, NotRequired, TypedDict, cast

from brdfdb.errors import (
    StoreError,
)
from brdfdb.store.files import Entry, sha256_of
from brdfdb.store.paths import METADATA, manifest_path, number_of
from brdfdb.store.sealed_json import bytes_of, check_fields, unsealed

if TYPE_CHECKING:
    from brdfdb.tables.metadata import TableMetadata


class Summary(TypedDict):
    """The facts that a list of materials or of revisions shows, so that it need not open the tables."""

    title: str
    model: str
    model_version: int
    request_sha256: str
    error_p99: float | None
    created: str
    bytes: int
    wavelength_range_nm: NotRequired[list[float]]  # these are missing from manifests of before version 4 of tables
    formula_error: NotRequired[dict[str, Any] | None]
    largest_albedo: NotRequired[dict[str, Any] | None]
    measured: NotRequired[bool]


class Manifest(TypedDict):
    """The files of a revision, by their path inside it; nothing else belongs there."""

    material: str
    revision: str
    summary: Summary
    files: dict[str, Entry]


SUMMARY_FIELDS: dict[str, Any] = {
    "title": str,
    "model": str,
    "model_version": int,
    "request_sha256": str,
    "error_p99": (float, int, NoneType),
    "created": str,
    "bytes": int,
}
# Facts that older manifests do not have
_LATER: dict[str, Any] = {
    "wavelength_range_nm": list,
    "formula_error": (dict, NoneType),
    "largest_albedo": (dict, NoneType),
    "measured": bool,
}


def summary_fields(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return the types of the fields of a summary: those that every one has, and those later ones that this one has."""
    return SUMMARY_FIELDS | {key: kind for key, kind in _LATER.items() if key in content}


def summary_of(metadata: TableMetadata, stored: int, created: str) -> Summary:
    """Return the facts of a table that lists show, of its metadata, its size [byte] and the date of its publication."""
    largest = metadata.largest_albedo
    return {
        "title": metadata.title or "",
        "model": metadata.model or "",
        "model_version": metadata.model_version or 0,
        "request_sha256": metadata.request_sha256 or "",
        "error_p99": None if metadata.error is None else metadata.error.overall.p99,
        "created": created,
        "bytes": stored,
        "wavelength_range_nm": metadata.wavelength_range_nm,
        "formula_error": None if metadata.formula_error is None else metadata.formula_error.in_lists(),
        "largest_albedo": None if largest is None else largest.model_dump(mode="json"),
        "measured": metadata.measured is not None,
    }


def whole_revisions(material: Path) -> list[Path]:
    """Return the revisions of a material that have a directory and a manifest, oldest first."""
    try:
        numbered = sorted((number_of(name), name) for name in os.listdir(material))
    except (FileNotFoundError, NotADirectoryError):
        return []
    paths = (material / name for number, name in numbered if number)
    return [path for path in paths if path.is_dir() and manifest_path(path).is_file()]


def read_manifest(group: Path, digest: str | None) -> tuple[Manifest, str]:
    """Return the manifest of a revision, and the sha256 of its file.

    Parameters
    ----------
    group : Path
        Directory of the revision.
    digest : str or None
        sha256 of the manifest, where a pointer or a snapshot knows it.

    Raises
    ------
    StoreError
        If it is missing, changed, that of another revision, or another one than the one with that digest.
    """
    where, path = f"{group.parent.name} {group.name}", manifest_path(group)
    data = bytes_of(path, where)
    manifest = unsealed(data, where, path.name)
    actual = hashlib.sha256(data).hexdigest()
    if digest not in (None, actual):
        raise StoreError(f"{where} is damaged: {path.name} is not the one whose digest was recorded")
    check_fields(manifest, {"material": str, "revision": str, "summary": dict, "files": dict}, where, path.name)
    if (manifest["material"], manifest["revision"]) != (group.parent.name, group.name):
        raise StoreError(f"{where} is damaged: {path.name} is that of {manifest['material']} {manifest['revision']}")
    check_fields(manifest["summary"], summary_fields(manifest["summary"]), where, path.name)
    for entry in manifest["files"].values():
        check_fields(entry, {"size": int, "sha256": str}, where, path.name)
    return cast(Manifest, manifest), actual


def check_manifest(group: Path, digest: str | None, *, contents: bool) -> Manifest:
    """Check the files of a revision against its manifest: that they are there and their sizes.

    Also their contents, where no checksum of a chunk tells: of the metadata, and with `contents` of every file, and
    what the manifest says of the table.

    Parameters
    ----------
    group, digest
        As in `read_manifest`.
    contents : bool
        Read every file.

    Raises
    ------
    StoreError
        Naming the first file that differs.
    """
    where, directory = f"{group.parent.name} {group.name}", str(group)
    manifest, _ = read_manifest(group, digest)
    for name, entry in manifest["files"].items():
        file = f"{directory}/{name}"
        try:
            size = os.stat(file).st_size
            if size != entry["size"]:
                raise StoreError(f"{where} is damaged: {name} has {size} bytes, not {entry['size']}")
            if (contents or name.endswith(METADATA)) and sha256_of(file) != entry["sha256"]:
                raise StoreError(f"{where} is damaged: the content of {name} changed")
        except FileNotFoundError:
            raise StoreError(f"{where} is damaged: {name} is missing") from None
        except OSError as error:
            raise StoreError(f"{where} is damaged: {name} cannot be read: {error.strerror}") from None
    if contents:
        _check_summary(group, manifest)
    return manifest


def _check_summary(group: Path, manifest: Manifest) -> None:
    """Raise StoreError unless a manifest says of a table what the table says; older ones may say less."""
    from brdfdb.store.decoding import read_metadata  # it loads numpy, which a list does not need

    summary = manifest["summary"]
    stored = sum(entry["size"] for entry in manifest["files"].values())
    for key, value in summary_of(read_metadata(group), stored, summary["created"]).items():
        if key in summary and not _agrees(stated := cast(Mapping[str, Any], summary)[key], value):
            raise StoreError(
                f"{group.parent.name} {group.name} is damaged: {manifest_path(group).name} says {key} {stated!r}, "
                f"where the table has {value!r}"
            )


def _agrees(stated: Any, value: Any) -> bool:
    """Return True if every part of a statement is that of a value."""
    if isinstance(stated, dict) and isinstance(value, dict):
        return all(_agrees(part, value.get(key)) for key, part in stated.items())
    return bool(stated == value)
