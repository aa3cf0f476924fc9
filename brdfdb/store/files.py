"""Files of a store: read, hashed, and written so that each is there whole or not at all."""

from __future__ import annotations

import errno
import hashlib
import os
import stat
import uuid
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypedDict

NON_BLOCKING = getattr(os, "O_NONBLOCK", 0)  # without it the opening of a pipe waits for its writer; Windows has none

_AT_ONCE = 16  # files that are synced at once: each waits for the disk


class Entry(TypedDict):
    """A file of a revision."""

    size: int
    sha256: str


def regular_bytes(path: str | Path) -> bytes:
    """Return the bytes of a regular file; OSError if it is none. A pipe would wait for its writer for good."""
    with open(os.open(path, os.O_RDONLY | NON_BLOCKING), "rb") as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise OSError(errno.EINVAL, "Not a regular file", str(path))
        return file.read()


def sha256_of(path: str | Path) -> str:
    """Return the sha256 of a file, read piece by piece."""
    with open(path, "rb") as handle:
        return hashlib.file_digest(handle, "sha256").hexdigest()


def write_file(path: Path, data: bytes, temporary: Path, *, sync: bool = True) -> Entry:
    """Write a file so that it is there whole, synced to disk, or not at all.

    Parameters
    ----------
    path : Path
        The file; its directory is made.
    data : bytes
        All of its content.
    temporary : Path
        A directory of the same file system, where it lies until it is whole.
    sync : bool
        False for a file whose reader notices what a power cut left of it, and can do without.
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
    except BaseException:
        half.unlink(missing_ok=True)
        raise
    return {"size": len(data), "sha256": hashlib.sha256(data).hexdigest()}


def write_files(directory: Path, contents: Mapping[str, bytes], temporary: Path) -> dict[str, Entry]:
    """Write files by their paths inside a directory as `write_file` does: at once, since a disk syncs many as fast."""
    with ThreadPoolExecutor(_AT_ONCE) as pool:
        entries = pool.map(lambda file: write_file(directory / file, contents[file], temporary), contents)
        return dict(zip(contents, entries, strict=True))


def sync_directory(path: Path) -> None:
    """Make names that were given or taken in a directory outlast a power cut."""
    directory = os.open(path, os.O_RDONLY)
    try:
        os.fsync(directory)
    finally:
        os.close(directory)
