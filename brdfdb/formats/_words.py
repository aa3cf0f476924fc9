"""Texts of words and numbers that do not depend on lines: read in order, with the line for errors."""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError
from brdfdb.formats._text_file import lines_of


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
        self.line, self.comments = 0, list[str]()
        self._path, self._words = path, self._read()

    def __iter__(self) -> Iterator[str]:
        return self._words

    def next(self, field: str) -> str:
        """Return the next word, which is the value of a field; FileFormatError at the end of the text."""
        word = next(self._words, None)
        if word is None:
            raise self.error(field, "the text ends before its value")
        return word

    def count(self, field: str) -> int:
        """Return the number that the next word is, of things that the text lists."""
        word = self.next(field)
        if not word.isdecimal() or int(word) > self._path.stat().st_size:
            raise self.error(field, f"{word[:40]!r} is no number of values that the file has room for")
        return int(word)

    def numbers(self, count: int, field: str) -> NDArray[np.float64]:
        """Return the next numbers, finite ones; FileFormatError if one is missing, or is none."""
        if count > self._path.stat().st_size:
            raise self.error(field, f"its {count} numbers are more than the file has")
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
            raise self.error(field, f"the text ends after {len(numbers)} of its {count} numbers")
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
