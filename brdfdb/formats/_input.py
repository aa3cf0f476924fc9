"""Files that are read: regular ones of a bounded size."""

from __future__ import annotations

import stat
from pathlib import Path

from brdfdb.errors import FileFormatError

MOST_BYTES = 1 << 31  # size of a file, or of a directory: that of the largest file that an exporter writes
MOST_TEXT = 1 << 30  # size of a file of text [byte]
_MOST_METADATA = 1 << 24  # size of a zarr.json [byte]


def check_file(path: Path) -> None:
    """Raise FileFormatError if a path is no regular file, no directory of a zarr group, or too large to be read.

    Raises
    ------
    OSError
        If there is no such file.
    """
    directory = path.is_dir()
    if directory and not (path / "zarr.json").exists():
        raise FileFormatError(f"{path}: it is a directory that is no zarr group")
    size = 0
    for part in path.rglob("*") if directory else (path,):
        status = part.stat()
        if stat.S_ISDIR(status.st_mode):
            continue
        if not stat.S_ISREG(status.st_mode):
            raise FileFormatError(f"{part}: it is no regular file")
        if directory and part.name == "zarr.json":
            check_size(part, _MOST_METADATA)
        size += status.st_size
        if size > MOST_BYTES:
            raise FileFormatError(f"{path}: it has more than {MOST_BYTES} bytes")


def check_size(path: Path, most: int) -> None:
    """Raise FileFormatError if a file has more than `most` bytes."""
    if path.stat().st_size > most:
        raise FileFormatError(f"{path}: it has more than {most} bytes")
