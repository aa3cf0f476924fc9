"""Text files of others: lines with their numbers, no longer and no more than memory has room for."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from brdfdb.errors import FileFormatError
from brdfdb.formats._input import MOST_TEXT, check_size

_LONGEST = 1 << 20  # characters of a line
_HEAD = 4096
_MARKS = {b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16", b"\xef\xbb\xbf": "utf-8-sig"}


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
        raise FileFormatError(f"{path}: line 1: it is no text: it has a zero byte")
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
                raise FileFormatError(f"{path}: line {number}: it is no text: it has a zero byte")
            if len(line) == _LONGEST:
                raise FileFormatError(f"{path}: line {number} has more than {_LONGEST} characters")
            yield number, line
