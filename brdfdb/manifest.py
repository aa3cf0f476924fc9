"""What the store keeps beside the numbers: manifests, heads of materials, and how files are written."""

from __future__ import annotations

import hashlib
import json
import os
import uuid
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypedDict


class StoreError(Exception):
    """A store that is missing, damaged, of another version, or cannot be written; str() is one sentence."""


class Entry(TypedDict):
    """A file of a revision."""

    size: int
    sha256: str


class Summary(TypedDict):
    """What a list of materials or of revisions shows, so that it need not open the tables."""

    title: str
    model: str
    model_version: int
    request_sha256: str
    error_p99: float | None
    created: str
    bytes: int


class Manifest(TypedDict):
    """The files of a revision, by their path inside it; nothing else belongs there."""

    summary: Summary
    files: dict[str, Entry]


class Head(Summary):
    """The current revision of a material, the digest of its manifest, and the newest number ever given."""

    revision: str
    manifest_sha256: str
    last: int


def manifest_of(group: Path) -> Path:
    """Where the manifest of a revision lies: beside it, since zarr warns of strangers inside."""
    return group.with_name(f"{group.name}.MANIFEST.json")


def manifest_digest(group: Path) -> str:
    """sha256 of the manifest of a revision; StoreError if it cannot be read."""
    try:
        return sha256_of(manifest_of(group))
    except OSError:
        raise StoreError(f"{group.parent.name} {group.name} is damaged: its manifest cannot be read") from None


def number_of(revision: str) -> int:
    """3 of ``r000003``; 0 of anything else, such as ``r000003.MANIFEST.json``."""
    return int(revision[1:]) if revision[:1] == "r" and revision[1:].isdecimal() else 0


def check_manifest(group: Path, digest: str | None, *, contents: bool) -> Manifest:
    """Check the files of a revision against its manifest: that they are there and their sizes.

    Also their contents, where no checksum of a chunk tells: of the metadata, and with `contents` of every file.

    Parameters
    ----------
    group : Path
        Directory of the revision.
    digest : str or None
        sha256 of the manifest, where it is known: a head knows that of the current revision.
    contents : bool
        Whether to read every file.

    Raises
    ------
    StoreError
        Naming the first file that differs.
    """
    where = f"{group.parent.name} {group.name}"
    path = manifest_of(group)
    try:
        data = path.read_bytes()
    except OSError:
        raise StoreError(f"{where} is damaged: {path.name} is missing") from None
    if digest is not None and hashlib.sha256(data).hexdigest() != digest:
        raise StoreError(f"{where} is damaged: {path.name} is not the one that HEAD.json points to")
    manifest: Manifest = json_object(path, data)  # type: ignore[assignment]  # written by this program
    directory = str(group)
    try:
        files = {name: (entry["size"], entry["sha256"]) for name, entry in manifest["files"].items()}
    except (KeyError, TypeError, AttributeError):
        raise StoreError(f"{where} is damaged: {path.name} does not list the files") from None
    for name, (expected, sha256) in files.items():
        file = f"{directory}/{name}"
        try:
            size = os.stat(file).st_size
            if size != expected:
                raise StoreError(f"{where} is damaged: {name} has {size} bytes, not {expected}")
            if (contents or name.endswith("zarr.json")) and sha256_of(file) != sha256:
                raise StoreError(f"{where} is damaged: the content of {name} changed")
        except FileNotFoundError:
            raise StoreError(f"{where} is damaged: {name} is missing") from None
        except OSError as error:
            raise StoreError(f"{where} is damaged: {name} cannot be read: {error.strerror}") from None
    return manifest


def sha256_of(path: str | Path) -> str:
    """sha256 of a file, read piece by piece."""
    with open(path, "rb") as handle:
        return hashlib.file_digest(handle, "sha256").hexdigest()


def json_object(path: Path, data: bytes) -> dict[str, Any]:
    """The JSON object that a file holds; StoreError, naming the file, if it holds anything else."""
    try:
        content = json.loads(data)
    except ValueError as error:
        raise StoreError(f"cannot read {path}: {error}") from error
    if not isinstance(content, dict):
        raise StoreError(f"cannot read {path}: not a JSON object")
    return content


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object; StoreError, naming the file, if it cannot be read or is none."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise StoreError(f"cannot read {path}: {error.strerror or error}") from error
    return json_object(path, data)


def write_file(path: Path, data: bytes, temporary: Path) -> Entry:
    """Write a file so that it is there whole, synced to disk, or not at all.

    Parameters
    ----------
    path : Path
        The file; its directory is made.
    data : bytes
        All of its content.
    temporary : Path
        A directory of the same file system, where it lies until it is whole.
    """
    half = temporary / f".{path.name}.{uuid.uuid4().hex}"
    try:
        with half.open("wb") as handle:
            handle.write(data)
            handle.flush()
            os.fsync(handle.fileno())
        try:
            os.replace(half, path)
        except FileNotFoundError:
            path.parent.mkdir(parents=True, exist_ok=True)
            os.replace(half, path)
    except BaseException:
        half.unlink(missing_ok=True)
        raise
    return {"size": len(data), "sha256": hashlib.sha256(data).hexdigest()}


def write_json(path: Path, content: Mapping[str, Any], temporary: Path | None = None) -> str:
    """Write a JSON file as `write_file` does, by default by way of its own directory; returns its sha256."""
    return write_file(path, json.dumps(content, indent=1).encode(), temporary or path.parent)["sha256"]


def swap_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write a file so that a reader sees the old content or the new, whatever happens in between."""
    write_json(path, content)
    sync_directory(path.parent)


def sync_directory(path: Path) -> None:
    """Make names that were given or taken in a directory outlast a power cut."""
    directory = os.open(path, os.O_RDONLY)
    try:
        os.fsync(directory)
    finally:
        os.close(directory)
