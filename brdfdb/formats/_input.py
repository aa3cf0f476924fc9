"""Files that are read: regular ones of a bounded size, and texts in the encodings of other programs."""

from __future__ import annotations

import codecs
import math
import re
import stat
from array import array
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError

MOST_BYTES = 1 << 31  # size of a file, or of a directory: that of the largest file that an exporter writes
MOST_MAPPED = 1 << 36  # size of a tensor file, such as of Mueller matrices at many wavelengths [byte]
_TENSORS = b"tensor_file\0"
MOST_TEXT = 1 << 30  # size of a file of text [byte]
_MOST_METADATA = 1 << 24  # size of a zarr.json [byte]
_LONGEST = 1 << 20  # characters of a line
HEAD = 4096  # bytes of a file that tell its format
_MARKS = {  # the longer ones first
    b"\xff\xfe\0\0": "utf-32",
    b"\0\0\xfe\xff": "utf-32",
    b"\xff\xfe": "utf-16",
    b"\xfe\xff": "utf-16",
    b"\xef\xbb\xbf": "utf-8-sig",
}
_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x19\x1c-\x1f]")  # bytes that no text has
_LETTERS = frozenset(b"\t\n\r" + bytes(range(32, 127)))
_OTHERS = "cp1252"  # encoding of bytes that are not UTF-8, such as the degree sign of older programs
_PAGE = re.compile(r"\s*<.{0,2000}?(?:!doctype html|<html\b)|\s*<(?:html|head|body)\b", re.IGNORECASE | re.DOTALL)
_FOREIGN = {  # first bytes of files that hold no text
    b"\x1f\x8b": "a gzip archive; unpack it, for example with gunzip",
    b"BZh": "a bzip2 archive; unpack it",
    b"\xfd7zXZ": "an xz archive; unpack it",
    b"\x28\xb5\x2f\xfd": "a zstd archive; unpack it",
    b"7z\xbc\xaf": "a 7z archive; unpack it",
    b"Rar!": "a RAR archive; unpack it",
    b"%PDF": "a PDF; ask for the numbers as text",
    b"{\\rtf": "a document of a word processor; save it as plain text",
    b"\xd0\xcf\x11\xe0": "a workbook or document of an older Office program; save the sheet as CSV",
    b"\x93NUMPY": "an array of NumPy without names of its axes; write a text with names of columns",
    b"MATLAB 5.0 MAT-file": "a MATLAB file; write the numbers as text",
    b"404: Not Found": "the answer of a server, 404, and not the file; check the address, and download the file again",
    b"version https://git-lfs": "a pointer of Git LFS and not the file itself; fetch it with git lfs pull",
}
_FORTRAN = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)[dD][-+]?\d+")
_DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")
_ZIP = b"PK\x03\x04"
_WORKBOOK = (b"[Content_Types].xml", b"xl/", b"_rels/")


def _other_bytes(error: UnicodeError) -> tuple[str, int]:
    """Decode the bytes at which a decoder stopped as those of `_OTHERS`."""
    assert isinstance(error, UnicodeDecodeError)
    return error.object[error.start : error.end].decode(_OTHERS, "replace"), error.end


codecs.register_error("other_bytes", _other_bytes)


def encoding_of(head: bytes) -> str | None:
    """Return the encoding of a text by its first bytes, with or without a byte order mark; None of any other file."""
    for mark, name in _MARKS.items():
        if head.startswith(mark):
            return name
    pairs = head[: len(head) // 2 * 2][:64]
    for name, letters, zeros in (("utf-16-le", pairs[::2], pairs[1::2]), ("utf-16-be", pairs[1::2], pairs[::2])):
        if pairs and not any(zeros) and _LETTERS.issuperset(letters):
            return name
    return None if _CONTROL.search(head) else "utf-8"


def head_of(path: Path) -> bytes:
    """Return the first bytes of a file, those of a text in UTF-8, with LF, and without space before the first line."""
    with path.open("rb") as file:
        head = file.read(4 * HEAD)
    encoding = encoding_of(head[:HEAD])
    if encoding is None:
        return head[:HEAD]
    text = head.decode(encoding, "other_bytes").replace("\r\n", "\n").replace("\r", "\n")
    return text.lstrip().encode()[:HEAD]


def foreign(head: bytes) -> str:
    """Return what a file is that holds no text of numbers, and what to do, by its first bytes; empty of any other."""
    if head.startswith(_ZIP):
        if any(name in head for name in _WORKBOOK):
            return "it is a workbook or document of an Office program; save the sheet as CSV"
        return "it is a zip archive; unpack it"
    if _PAGE.match(head.decode("utf-8", "replace")):
        return "it is a web page (HTML), as a browser saves a link; download the file itself, which is often named raw"
    if head[257:262] == b"ustar":
        return "it is a tar archive; unpack it"
    return next((f"it is {text}" for magic, text in _FOREIGN.items() if head.startswith(magic)), "")


def check_file(path: Path) -> None:
    """Raise FileFormatError if a path is neither a regular file nor a zarr group, or is too large to be read."""
    directory = path.is_dir()
    if directory and not (path / "zarr.json").exists():
        raise FileFormatError(f"{path}: it is a directory, but not a zarr group")
    size = 0
    most = MOST_BYTES
    if not directory and stat.S_ISREG(path.stat().st_mode):
        with path.open("rb") as file:  # readers take pieces of a tensor file
            most = MOST_MAPPED if file.read(len(_TENSORS)) == _TENSORS else MOST_BYTES
    for part in path.rglob("*") if directory else (path,):
        status = part.stat()
        if stat.S_ISDIR(status.st_mode):
            continue
        if not stat.S_ISREG(status.st_mode):
            raise FileFormatError(f"{part}: it is not a regular file")
        if directory and part.name == "zarr.json":
            check_size(part, _MOST_METADATA)
        size += status.st_size
        if size > most:
            raise FileFormatError(f"{path}: it has more than {most} bytes")


def check_size(path: Path, most: int) -> None:
    """Raise FileFormatError if a file has more than `most` bytes."""
    if path.stat().st_size > most:
        raise FileFormatError(f"{path}: it has more than {most} bytes")


def check_text(path: Path, most: int = MOST_TEXT) -> str:
    """Return the encoding of a text.

    FileFormatError if it has more than `most` bytes, is of another kind such as an archive or a web page, or begins
    with bytes that no text has.
    """
    check_size(path, most)
    if kind := foreign(head_of(path)):
        raise FileFormatError(f"{path}: line 1: {kind}")
    with path.open("rb") as file:
        head = file.read(HEAD)
    encoding = encoding_of(head)
    if encoding is None:
        at = _CONTROL.search(head)
        assert at is not None
        line = len(head[: at.start()].splitlines()) or 1
        what = "a zero byte" if at[0] == b"\0" else f"the byte {at[0][0]:#04x}, which no text has"
        raise FileFormatError(f"{path}: line {line}: it is not text: it has {what}")
    return encoding


def opened_text(path: Path, most: int = MOST_TEXT) -> TextIO:
    """Open a text in its encoding; errors are those of `check_text`.

    Byte order marks are left out, and bytes that are not UTF-8 are read as those of Windows.
    """
    return path.open(encoding=check_text(path, most), errors="other_bytes")


def lines_of(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the lines of a text with their numbers, from 1; errors are those of `check_text`, and of long lines."""
    with opened_text(path) as file:
        number = 0
        while line := file.readline(_LONGEST):
            number += 1
            if "\x1a" in line:  # the end of a text in older systems
                line = line.partition("\x1a")[0]
                if not line:
                    return
            if "\0" in line:
                raise FileFormatError(f"{path}: line {number}: it is not text: it has a zero byte")
            if len(line) == _LONGEST:
                raise FileFormatError(f"{path}: line {number} has more than {_LONGEST} characters")
            yield number, line


def plain_number(word: str) -> float:
    """Return the number that a word is; ValueError of other words, and of 1_000, which Python takes for a number."""
    if "_" not in word and word.isascii():
        try:
            return float(word)
        except ValueError:
            if _FORTRAN.fullmatch(word):
                return float(re.sub("[dD]", "e", word))
            if _DECIMAL_COMMA.fullmatch(word):
                raise ValueError(f"{word[:40]!r} has a decimal comma; write decimal points") from None
    raise ValueError(f"could not convert string to float: {word[:40]!r}")


def fault_of_row(line: str, names: Sequence[str]) -> str:
    """Return what is wrong with a row of numbers and commas, behind the number of its line; empty if nothing is."""
    text = line.partition("#")[0].strip()
    fields = [field.strip() for field in text.split(",")] if text else []
    if fields and len(fields) != len(names):
        commas = "; write decimal points" if len(fields) == 2 * len(names) else ""
        return f" has {len(fields)} fields, but there are {len(names)} names of columns{commas}"
    for field, name in zip(fields, names, strict=False):
        try:
            value = float(field)
        except ValueError:
            value = math.inf
        if math.isinf(value) or (value != value and name.startswith(("theta_", "phi_", "delta_"))):
            return f", field {name}: {field[:40]!r} is not a number"
    return ""


class Words:
    """The words of the text `path`, without its comments, which are lines that begin with #."""

    def __init__(self, path: Path) -> None:
        self.line = 0  #: line of the last word
        self.comments = list[str]()  #: comments so far
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

    def expect(self, wanted: str, field: str) -> None:
        """Read the next word; FileFormatError if it is not the one that is wanted."""
        word = next(self._words, None)
        if word is None:
            raise self.error(field, f"the file ends where {wanted} is expected: it was cut")
        if word != wanted:
            raise self.error(field, f"{word[:40]!r} stands where {wanted} is expected")

    def end(self, field: str, wanted: str) -> None:
        """Raise FileFormatError if words follow, such as those of a second file."""
        word = next(self._words, None)
        if word is not None:
            raise self.error(field, f"{word[:40]!r} follows {wanted}; write a file for each measurement")

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
                numbers.append(plain_number(word))
            except ValueError:
                comma = "; write decimal points" if "," in word else ""
                expected = f"{len(numbers)} of {count} numbers stand before it"
                raise self.error(field, f"{word[:40]!r} is not a number, and {expected}{comma}") from None
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
