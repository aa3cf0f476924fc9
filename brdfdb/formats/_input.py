"""Files that are read: regular ones of a bounded size."""

from __future__ import annotations

import stat
from array import array
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError

MOST_BYTES = 1 << 31  # size of a file, or of a directory: that of the largest file that an exporter writes
MOST_TEXT = 1 << 30  # size of a file of text [byte]
_MOST_METADATA = 1 << 24  # size of a zarr.json [byte]
_LONGEST = 1 << 20  # characters of a line
_HEAD = 4096
_MARKS = {b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16", b"\xef\xbb\xbf": "utf-8-sig"}


def check_file(path: Path) -> None:
    """Raise FileFormatError if a path is neither a regular file nor a zarr group, or is too large to be read.

    Raises
    ------
    OSError
        If there is no such file.
    """
    directory = path.is_dir()
    if directory and not (path / "zarr.json").exists():
        raise FileFormatError(f"{path}: it is a directory, but not a zarr group")
    size = 0
    for part in path.rglob("*") if directory else (path,):
        status = part.stat()
        if stat.S_ISDIR(status.st_mode):
            continue
        if not stat.S_ISREG(status.st_mode):
            raise FileFormatError(f"{part}: it is not a regular file")
        if directory and part.name == "zarr.json":
            check_size(part, _MOST_METADATA)
        size += status.st_size
        if size > MOST_BYTES:
            raise FileFormatError(f"{path}: it has more than {MOST_BYTES} bytes")


def check_size(path: Path, most: int) -> None:
    """Raise FileFormatError if a file has more than `most` bytes."""
    if path.stat().st_size > most:
        raise FileFormatError(f"{path}: it has more than {most} bytes")


def check_text(path: Path, most: int = MOST_TEXT) -> str:
    """Return the encoding of a text.

    Raises
    ------
    FileFormatError
        If the file has more than `most` bytes, or begins with bytes that no text has.
    """
    check_size(path, most)
    with path.open("rb") as file:
        head = file.read(_HEAD)
    encoding = next((name for mark, name in _MARKS.items() if head.startswith(mark)), "utf-8")
    if encoding != "utf-16" and b"\0" in head:
        raise FileFormatError(f"{path}: line 1: it is not text: it has a zero byte")
    return encoding


def lines_of(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the lines of a text with their numbers, from 1.

    Raises
    ------
    FileFormatError
        As of `check_text`, or if a line is too long.
    """
    encoding = check_text(path)
    with path.open(encoding=encoding, errors="replace") as file:
        number = 0
        while line := file.readline(_LONGEST):
            number += 1
            if "\0" in line:
                raise FileFormatError(f"{path}: line {number}: it is not text: it has a zero byte")
            if len(line) == _LONGEST:
                raise FileFormatError(f"{path}: line {number} has more than {_LONGEST} characters")
            yield number, line


class Words:
    """The words of a text, without its comments.

    Parameters
    ----------
    path : Path
        The file. Lines that begin with # are comments.

    Attributes
    ----------
    line : int
        Line of the last word.
    comments : list of str
        The comments so far.
    """

    def __init__(self, path: Path) -> None:
        self.line = 0
        self.comments = list[str]()
        self._path = path
        self._words = self._read()

    def __iter__(self) -> Iterator[str]:
        return self._words

    def next(self, field: str) -> str:
        """Return the next word, which is the value of a field; FileFormatError at the end of the text."""
        word = next(self._words, None)
        if word is None:
            raise self.error(field, "the file ends before the value of this field")
        return word

    def count(self, field: str) -> int:
        """Return the number that the next word is, of things that the text lists."""
        word = self.next(field)
        if not word.isdecimal() or int(word) > self._path.stat().st_size:
            raise self.error(field, f"{word[:40]!r} is not a number of values that fit into the file")
        return int(word)

    def numbers(self, count: int, field: str) -> NDArray[np.float64]:
        """Return the next finite numbers; FileFormatError if a number is missing or is not finite."""
        if count > self._path.stat().st_size:
            raise self.error(field, f"{count} numbers are more than the file has")
        numbers = array("d")
        for word in self._words:
            try:
                numbers.append(float(word))
            except ValueError:
                raise self.error(field, f"{word[:40]!r} is not a number") from None
            if numbers[-1] - numbers[-1] != 0.0:
                raise self.error(field, f"{word[:40]!r} is not finite")
            if len(numbers) == count:
                break
        if len(numbers) < count:
            raise self.error(field, f"the file ends after {len(numbers)} of {count} numbers")
        return np.frombuffer(numbers, dtype=np.float64) if count else np.empty(0)

    def error(self, field: str, sentence: str) -> FileFormatError:
        """Return the error on a field at the last word."""
        return FileFormatError(f"{self._path}: line {self.line}, field {field}: {sentence}")

    def _read(self) -> Iterator[str]:
        for number, line in lines_of(self._path):
            self.line = number
            if line.lstrip().startswith("#"):
                self.comments.append(line.lstrip()[1:].strip())
            else:
                yield from line.split()
