"""Files of a store: atomic writing, digests, and JSON that is sealed with the digest of its content."""

from __future__ import annotations

import ctypes
import errno
import functools
import hashlib
import json
import os
import platform
import re
import stat
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypedDict, cast

from brdfdb.errors import StoreError

NON_BLOCKING = getattr(os, "O_NONBLOCK", 0)  # without it the opening of a pipe waits for its writer; Windows has none

_AT_ONCE = 16  # files that are synced at the same time: each waits for the disk
# File systems, by the type that statfs gives, whose syncfs waits until files and directories are on the disk. That of
# others, such as FUSE, may return at once
_SYNCED_AT_ONCE = {
    0xEF53: "ext4",
    0x58465342: "xfs",
    0x9123683E: "btrfs",
    0xF2F52010: "f2fs",
    0x2FC12FC1: "zfs",
    0x6969: "nfs",
    0x794C7630: "overlayfs",
    0x01021994: "tmpfs",
}
_SEAL = re.compile(rb'\{"sha256": "([0-9a-f]{64})",\n')


Sync = Callable[[Iterable[Path]], None]  # makes files and directories outlast a power cut


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


def write_files(
    directory: Path, contents: Mapping[str, bytes], temporary: Path, *, sync: bool = True
) -> dict[str, FileEntry]:
    """Write files, by their paths inside a directory, as `write_file` does."""
    with syncing(temporary) as sync_all:
        entries = {name: write_file(directory / name, data, temporary, sync=False) for name, data in contents.items()}
        if sync:
            sync_all(directory / name for name in contents)
    return entries


@contextmanager
def syncing(directory: Path) -> Iterator[Sync]:
    """Provide a function that makes files and directories outlast a power cut, all of the file system of `directory`.

    One call syncs the file system, where that is known to wait for the disk and to report what could not be written
    since this context began; else it syncs each path.
    """
    handle = os.open(directory, os.O_RDONLY)

    def sync(paths: Iterable[Path]) -> None:
        if not _sync_file_system(handle):
            with ThreadPoolExecutor(_AT_ONCE) as pool:  # a disk syncs many as fast as one
                list(pool.map(sync_path, dict.fromkeys(paths)))

    try:
        yield sync
    finally:
        os.close(handle)


@functools.cache
def _linux() -> ctypes.CDLL | None:
    """Return the C library of a Linux whose syncfs reports errors, as since version 5.8; None of other systems."""
    version = re.match(r"(\d+)\.(\d+)", platform.release())
    if platform.system() != "Linux" or version is None or tuple(map(int, version.groups())) < (5, 8):
        return None
    return ctypes.CDLL(None, use_errno=True)


def _sync_file_system(handle: int) -> bool:
    """Sync the file system of an open directory; return False where that is not known to be enough."""
    library = _linux()
    status = (ctypes.c_long * 32)()  # its first number is the type of the file system
    if library is None or library.fstatfs(handle, status) != 0 or status[0] not in _SYNCED_AT_ONCE:
        return False
    if library.syncfs(handle) != 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return True


def sync_path(path: Path) -> None:
    """Make the content of a file, or new and removed names in a directory, outlast a power cut."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


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
    sync_path(path.parent)


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
