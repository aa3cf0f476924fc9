"""Files of a store: atomic writing, digests, and JSON that is sealed with the digest of its content."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import stat
import uuid
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypedDict, cast

from brdfdb.errors import StoreError

NON_BLOCKING = getattr(os, "O_NONBLOCK", 0)  # without it the opening of a pipe waits for its writer; Windows has none

_AT_ONCE = 16  # files that are synced at the same time: each waits for the disk
_SEAL = re.compile(rb'\{"sha256": "([0-9a-f]{64})",\n')


class FileEntry(TypedDict):
    """Size [byte] and digest of a file of a revision."""

    size: int
    sha256: str


def regular_bytes(path: str | Path) -> bytes:
    """Return the bytes of a regular file; OSError for any other, as a pipe would wait for its writer for good."""
    with open(os.open(path, os.O_RDONLY | NON_BLOCKING), "rb") as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise OSError(errno.EINVAL, "Not a regular file", str(path))
        return file.read()


def bytes_of(path: Path, where: str) -> bytes:
    """Return the bytes of a regular file; StoreError, which begins with `where`, if it cannot be read."""
    try:
        return regular_bytes(path)
    except FileNotFoundError:
        raise StoreError(f"{where} is damaged: {path.name} is missing") from None
    except OSError as error:
        raise StoreError(f"{where} is damaged: {path.name} cannot be read: {error.strerror}") from error


def sha256_of(path: str | Path) -> str:
    """Return the sha256 of a file, read piece by piece."""
    with open(path, "rb") as handle:
        return hashlib.file_digest(handle, "sha256").hexdigest()


def write_file(path: Path, data: bytes, temporary: Path, *, sync: bool = True) -> FileEntry:
    """Write a file, by way of a directory of the same file system, so that it is complete or does not exist.

    With `sync` False a power cut may damage it, which its readers must notice and can do without.
    """
    half = temporary / f".{path.name}.{uuid.uuid4().hex}"
    try:
        with half.open("wb") as handle:
            handle.write(data)
            if sync:
                handle.flush()
                os.fsync(handle.fileno())
        try:
            os.replace(half, path)
        except FileNotFoundError:
            path.parent.mkdir(parents=True, exist_ok=True)
            os.replace(half, path)
    except BaseException as error:
        half.unlink(missing_ok=True)
        if isinstance(error, OSError):
            error.filename = str(path)  # which the user knows
        raise
    return {"size": len(data), "sha256": hashlib.sha256(data).hexdigest()}


def write_files(directory: Path, contents: Mapping[str, bytes], temporary: Path) -> dict[str, FileEntry]:
    """Write files, by their paths inside a directory, as `write_file` does; a disk syncs many as fast as one."""
    with ThreadPoolExecutor(_AT_ONCE) as pool:
        entries = pool.map(lambda file: write_file(directory / file, contents[file], temporary), contents)
        return dict(zip(contents, entries, strict=True))


def sync_directory(path: Path) -> None:
    """Make new and removed names in a directory outlast a power cut."""
    directory = os.open(path, os.O_RDONLY)
    try:
        os.fsync(directory)
    finally:
        os.close(directory)


# Sealed JSON: the first line is the digest of the other lines


def sealed(content: Mapping[str, Any]) -> bytes:
    """Return a JSON object as bytes whose first line holds the sha256 of all lines below it.

    ``tail -n +2 FILE | sha256sum`` prints the digest that the first line must hold.
    """
    body = json.dumps(content, indent=1).encode()[2:]
    return b'{"sha256": "%s",\n' % hashlib.sha256(body).hexdigest().encode() + body


def unsealed(data: bytes, where: str, file: str) -> dict[str, Any]:
    """Return the content of a sealed JSON object; StoreError, naming `where` and `file`, if any byte of it changed."""
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


def seal_of(path: Path) -> str:
    """Return the digest in the first line of a sealed file; empty if there is none."""
    seal = _SEAL.match(bytes_of(path, path.name))
    return "" if seal is None else seal[1].decode()


def read_sealed(path: Path, where: str) -> dict[str, Any]:
    """Return the content of a sealed file; StoreError if it cannot be read, or as by `unsealed`."""
    return unsealed(bytes_of(path, where), where, path.name)


def write_sealed(path: Path, content: Mapping[str, Any], temporary: Path | None = None) -> None:
    """Write a sealed JSON file as `write_file` does, by default through a temporary file in its directory."""
    write_file(path, sealed(content), temporary or path.parent)


def swap_sealed(path: Path, content: Mapping[str, Any]) -> None:
    """Write a sealed JSON file so that a reader sees the old content or the new, at any moment."""
    write_sealed(path, content)
    sync_directory(path.parent)


def read_json(path: Path) -> dict[str, Any]:
    """Return the JSON object in a file; StoreError, naming the file, if it cannot be read or holds something else."""
    try:
        content = json.loads(path.read_bytes())
    except OSError as error:
        raise StoreError(f"cannot read {path}: {error.strerror or error}") from error
    except ValueError as error:
        raise StoreError(f"cannot read {path}: {error}") from error
    if not isinstance(content, dict):
        raise StoreError(f"cannot read {path}: not a JSON object")
    return content
