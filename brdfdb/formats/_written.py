"""Writing of files: an export writes all its files completely, or none."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import uuid
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from brdfdb.errors import WriteError
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.formats._stated_error import FileError

_OF_ZARR = re.compile(r"(?:.+/)?(?:zarr\.json|c(?:/[0-9]+)*)")  # files of a zarr 3 group: metadata and chunks


@dataclass(frozen=True)
class Written:
    """The files of one table in another format, and what they state."""

    paths: tuple[Path, ...]  #: The file itself, then the files next to it. A format may write a directory.
    #: error of the values in the file against those of the table; None of pictures and source code
    error: FileError | None = None
    tolerance: float | None = None  #: largest p99 that was asked for; None where nothing was, [1]
    remarks: tuple[str, ...] = field(default=())  #: sentences on what the format cannot hold of this table

    @property
    def within(self) -> bool:
        """Return True if the file is as near to the table as was asked for."""
        return self.error is None or self.tolerance is None or self.error.p99 <= self.tolerance

    @property
    def nbytes(self) -> int:
        """Size [byte] of all files."""
        return sum(_size(path) for path in self.paths)


def _size(path: Path) -> int:
    return sum(_size(part) for part in path.iterdir()) if path.is_dir() else path.stat().st_size


@contextlib.contextmanager
def whole(*paths: str | os.PathLike[str]) -> Iterator[tuple[Path, ...]]:
    """Give temporary paths to write, and rename them to `paths` when all are written; else none is left behind.

    Parameters
    ----------
    paths : path
        Files, or directories, of one export; those that are there are replaced at the end.

    Raises
    ------
    WriteError
        If one of them cannot be written: the directory is missing or a file, the disk is full, the name is that of a
        directory. A zarr group, a directory, is replaced by another one only, and not if it holds other files.
    """
    final = tuple(path_of(path) for path in paths)
    mark = uuid.uuid4().hex
    halves = tuple(path.with_name(f".{mark}{path.suffix}") for path in final)
    try:
        for path in final:
            if path.is_dir() and path.suffix != ".zarr":
                raise WriteError(f"cannot write {path}: it is a directory")
            if path.is_dir():
                _check_zarr_group(path)
        yield halves
        for path, half in zip(final, halves, strict=True):
            if half.is_dir() and path.exists():
                _exchange(half, path)
            else:
                os.replace(half, path)
    except OSError as error:
        if isinstance(error, WriteError):
            raise
        raise WriteError(f"cannot write {final[0]}: {error.strerror or error}") from error
    finally:
        for half in halves:
            with contextlib.suppress(OSError):  # also where its directory is a file
                _remove(half)


def _check_zarr_group(path: Path) -> None:
    """Raise WriteError if a directory is not a zarr group, or contains files that are not part of it."""
    if not (path / "zarr.json").exists():
        raise WriteError(f"cannot write {path}: it is a directory, but not a zarr group")
    for part in path.rglob("*"):
        of_group = part.is_dir() or _OF_ZARR.fullmatch(part.relative_to(path).as_posix())
        if part.is_symlink() or not of_group:
            raise WriteError(f"cannot write {path}: it contains {part.name}, which is not part of a zarr group")


def _exchange(half: Path, path: Path) -> None:
    """Replace a directory by another one; after a failure the old directory is unchanged."""
    aside = half.with_name(f"{half.name}.old")
    os.replace(path, aside)
    try:
        os.replace(half, path)
    except BaseException:
        os.replace(aside, path)
        raise
    with contextlib.suppress(OSError):  # the new one is in its place
        _remove(aside)


def _remove(path: Path) -> None:
    """Remove a file or a directory; one that is not there is no error."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
