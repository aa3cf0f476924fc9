"""The small files of a store: manifests, pointers, snapshots, each sealed with a digest; ways to write a file."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import stat
import uuid
from collections.abc import Mapping
from pathlib import Path
from types import NoneType
from typing import Any, TypedDict, cast

from brdfdb.errors import StoreError

# Of a material, a family or a snapshot: what does not match is never joined to a path. Files may have names of 255
# characters
NAME = re.compile(r"(?!.{129})[a-z0-9]+(-[a-z0-9]+)*")
SNAPSHOT_FORMAT, SNAPSHOT_VERSION = "brdfdb-snapshot", 1
_SEAL = re.compile(rb'\{"sha256": "([0-9a-f]{64})",\n')


class Entry(TypedDict):
    """A file of a revision."""

    size: int
    sha256: str


class Summary(TypedDict):
    """The facts that a list of materials or of revisions shows, so that it need not open the tables."""

    title: str
    model: str
    model_version: int
    request_sha256: str
    error_p99: float | None
    created: str
    bytes: int


class Manifest(TypedDict):
    """The files of a revision, by their path inside it; nothing else belongs there."""

    material: str
    revision: str
    summary: Summary
    files: dict[str, Entry]


class Head(Summary):
    """The pointer of a material: its current revision, the digests of its manifests, the newest number ever given."""

    material: str
    revision: str
    manifests: dict[str, str]
    last: int


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


_SUMMARY: dict[str, Any] = {
    "title": str,
    "model": str,
    "model_version": int,
    "request_sha256": str,
    "error_p99": (float, int, NoneType),
    "created": str,
    "bytes": int,
}
_HEAD = {**_SUMMARY, "material": str, "revision": str, "manifests": dict, "last": int}


def sealed(content: Mapping[str, Any]) -> bytes:
    """Return a JSON object as bytes whose first line holds the sha256 of all lines below it.

    ``tail -n +2 FILE | sha256sum`` prints the digest that the first line must hold.
    """
    body = json.dumps(content, indent=1).encode()[2:]
    return b'{"sha256": "%s",\n' % hashlib.sha256(body).hexdigest().encode() + body


def unsealed(data: bytes, where: str, file: str) -> dict[str, Any]:
    """Return the content of a sealed JSON object.

    Parameters
    ----------
    data : bytes
        The file, as `sealed` made it.
    where, file : str
        The material, family or snapshot and the name of the file, for the sentence of an error.

    Raises
    ------
    StoreError
        If any byte of it changed.
    """
    seal = _SEAL.match(data)
    if seal is None:
        raise StoreError(f"{where} is damaged: the first line of {file} is not its digest")
    body = data[seal.end() :]
    if hashlib.sha256(body).hexdigest().encode() != seal[1]:
        raise StoreError(f"{where} is damaged: the content of {file} changed")
    try:
        return cast(dict[str, Any], json.loads(b"{" + body))
    except ValueError as error:
        raise StoreError(f"{where} is damaged: {file} is not JSON: {error}") from error


def regular_bytes(path: str | Path) -> bytes:
    """Return the bytes of a regular file; OSError if it is none. A pipe would wait for its writer for good."""
    with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK), "rb") as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise OSError(errno.EINVAL, "Not a regular file", str(path))
        return file.read()


def _bytes_of(path: Path, where: str) -> bytes:
    try:
        return regular_bytes(path)
    except FileNotFoundError:
        raise StoreError(f"{where} is damaged: {path.name} is missing") from None
    except OSError as error:
        raise StoreError(f"{where} is damaged: {path.name} cannot be read: {error.strerror}") from error


def seal_of(path: Path) -> str:
    """Return the digest in the first line of a sealed file; empty if it has none."""
    seal = _SEAL.match(_bytes_of(path, path.name))
    return "" if seal is None else seal[1].decode()


def read_sealed(path: Path, where: str) -> dict[str, Any]:
    """Return the content of a sealed file; errors as by `unsealed`, also if it cannot be read."""
    return unsealed(_bytes_of(path, where), where, path.name)


def _check_fields(content: Any, fields: Mapping[str, Any], where: str, file: str) -> None:
    """Raise StoreError unless `content` has all fields, each of its type."""
    for key, kind in fields.items():
        if not (isinstance(content, dict) and isinstance(content.get(key, ...), kind)):
            raise StoreError(f"{where} is damaged: {file} has no valid {key!r}")


def head_from(path: Path, data: bytes) -> Head:
    """Return the pointer of a material from the bytes of its file; StoreError if it is damaged or of another one."""
    name = path.parent.name
    content = unsealed(data, name, path.name)
    _check_fields(content, _HEAD, name, path.name)
    if content["material"] != name:
        raise StoreError(f"{name} is damaged: {path.name} is that of {content['material']}")
    if not (number_of(content["revision"]) and isinstance(content["manifests"].get(content["revision"]), str)):
        raise StoreError(f"{name} is damaged: {path.name} does not name a revision and its manifest")
    return cast(Head, content)


def read_head(material: Path) -> Head | None:
    """Return the pointer in the directory of a material; None without one; StoreError if it is damaged."""
    path = material / "HEAD.json"
    try:
        return head_from(path, regular_bytes(path))
    except FileNotFoundError:
        return None
    except OSError as error:
        raise StoreError(f"{material.name} is damaged: {path.name} cannot be read: {error.strerror}") from error


def manifest_of(group: Path) -> Path:
    """Return the path of the manifest of a revision: beside it, since zarr warns of strangers inside."""
    return group.with_name(f"{group.name}.MANIFEST.json")


def number_of(revision: str) -> int:
    """Return 3 for ``r000003``; 0 for anything else, such as ``r000003.MANIFEST.json``."""
    return int(revision[1:]) if revision[:1] == "r" and revision[1:].isdecimal() else 0


def whole_revisions(material: Path) -> list[Path]:
    """Return the revisions of a material that have a directory and a manifest, oldest first."""
    try:
        found = sorted((number_of(name), name) for name in os.listdir(material))
    except (FileNotFoundError, NotADirectoryError):
        return []
    paths = (material / name for number, name in found if number)
    return [path for path in paths if path.is_dir() and manifest_of(path).is_file()]


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
    where, path = f"{group.parent.name} {group.name}", manifest_of(group)
    data = _bytes_of(path, where)
    manifest = unsealed(data, where, path.name)
    found = hashlib.sha256(data).hexdigest()
    if digest not in (None, found):
        raise StoreError(f"{where} is damaged: {path.name} is not the one whose digest was recorded")
    _check_fields(manifest, {"material": str, "revision": str, "summary": dict, "files": dict}, where, path.name)
    if (manifest["material"], manifest["revision"]) != (group.parent.name, group.name):
        raise StoreError(f"{where} is damaged: {path.name} is that of {manifest['material']} {manifest['revision']}")
    _check_fields(manifest["summary"], _SUMMARY, where, path.name)
    for entry in manifest["files"].values():
        _check_fields(entry, {"size": int, "sha256": str}, where, path.name)
    return cast(Manifest, manifest), found


def check_manifest(group: Path, digest: str | None, *, contents: bool) -> Manifest:
    """Check the files of a revision against its manifest: that they are there and their sizes.

    Also their contents, where no checksum of a chunk tells: of the metadata, and with `contents` of every file.

    Parameters
    ----------
    group, digest
        As in `read_manifest`.
    contents : bool
        Whether to read every file.

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
            if (contents or name.endswith("zarr.json")) and sha256_of(file) != entry["sha256"]:
                raise StoreError(f"{where} is damaged: the content of {name} changed")
        except FileNotFoundError:
            raise StoreError(f"{where} is damaged: {name} is missing") from None
        except OSError as error:
            raise StoreError(f"{where} is damaged: {name} cannot be read: {error.strerror}") from None
    return manifest


def snapshot_path(root: Path, name: str) -> Path:
    """Return the path of a snapshot in the store at `root`."""
    return root / "snapshots" / f"{name}.json"


def snapshot_names(root: Path) -> list[str]:
    """Return the names of the snapshots of the store at `root`, sorted."""
    try:
        found = sorted(os.listdir(root / "snapshots"))
    except FileNotFoundError:
        return []
    except OSError as error:
        raise StoreError(f"cannot read {root}/snapshots: {error.strerror}") from error
    return [name[:-5] for name in found if name.endswith(".json") and NAME.fullmatch(name[:-5])]


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
    _check_fields(content, {"name": str, "materials": dict, "families": dict}, where, path.name)
    if content["name"] != name:
        raise StoreError(f"{where} is damaged: {path.name} is that of {content['name']}")
    for material, pin in content["materials"].items():
        _check_fields(pin, {"revision": str, "manifest_sha256": str}, where, path.name)
        if not (NAME.fullmatch(material) and number_of(pin["revision"])):
            raise StoreError(f"{where} is damaged: {path.name} names {material} {pin['revision']}")
    return cast(Snapshot, content)


def sha256_of(path: str | Path) -> str:
    """Return the sha256 of a file, read piece by piece."""
    with open(path, "rb") as handle:
        return hashlib.file_digest(handle, "sha256").hexdigest()


def json_object(path: Path, data: bytes) -> dict[str, Any]:
    """Return the JSON object that a file holds; StoreError, naming the file, if it holds anything else."""
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
    """Write a JSON file as `write_file` does, by default by way of its own directory; return its sha256."""
    return write_file(path, json.dumps(content, indent=1).encode(), temporary or path.parent)["sha256"]


def write_sealed(path: Path, content: Mapping[str, Any], temporary: Path | None = None) -> str:
    """Write a sealed JSON file as `write_file` does; return the sha256 of the whole file."""
    return write_file(path, sealed(content), temporary or path.parent)["sha256"]


def swap_sealed(path: Path, content: Mapping[str, Any]) -> None:
    """Write a sealed JSON file so that a reader sees the old content or the new, whatever happens in between."""
    write_sealed(path, content)
    sync_directory(path.parent)


def sync_directory(path: Path) -> None:
    """Make names that were given or taken in a directory outlast a power cut."""
    directory = os.open(path, os.O_RDONLY)
    try:
        os.fsync(directory)
    finally:
        os.close(directory)
