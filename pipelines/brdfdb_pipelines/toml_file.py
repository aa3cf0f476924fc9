"""TOML files of a user, read within bounds, so that no file makes the program hang or fill the memory."""

from __future__ import annotations

import os
import re
import stat
import tomllib
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from brdfdb.errors import BrdfdbError
from brdfdb.store.files import NON_BLOCKING

MOST_BYTES = 4_000_000  # size of a file [byte]: tomllib reads about a megabyte a second
MOST_KEY_PARTS = 64  # parts of a dotted key; the memory of tomllib grows with their square
_MOST_BITS = 14_000  # bits of an integer: Python prints no more than 4300 digits

_PART = r"""(?:"[^"\n]*"|'[^'\n]*'|[\w-]++)"""
_LONG_KEY = re.compile(rf"(?<![\w-])(?:{_PART}[ \t]*+\.[ \t]*+){{{MOST_KEY_PARTS}}}")


class TomlError(BrdfdbError):
    """A file that is not valid TOML; str() is a phrase without the name of the file."""


def read(source: Path | Traversable) -> dict[str, Any]:
    """Return the unchecked content of a TOML file; TomlError or OSError if it cannot be read."""
    data = _bounded(source) if isinstance(source, Path) else source.read_bytes()
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise TomlError(f"not TOML: {error}") from None
    if _LONG_KEY.search(text):
        raise TomlError(f"a key has more than {MOST_KEY_PARTS} parts between dots")
    try:
        content = tomllib.loads(text)
        _check_integers(content)
    except RecursionError:
        raise TomlError("values are nested too deeply") from None
    except ValueError as error:  # after a semicolon, int() tells programmers how to allow more digits
        raise TomlError(f"not TOML: {str(error).partition(';')[0]}") from None
    return content


def _check_integers(value: Any) -> None:
    """Raise TomlError for an integer that Python does not print: of more than 4300 digits, by default."""
    if isinstance(value, int) and value.bit_length() > _MOST_BITS:
        raise TomlError(f"an integer has more than {_MOST_BITS} bits")
    for item in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        _check_integers(item)


def _bounded(path: Path) -> bytes:
    """Return the bytes of a regular file; pipes and devices are refused, as they may have no end."""
    descriptor = os.open(path, os.O_RDONLY | NON_BLOCKING)
    with open(descriptor, "rb") as file:
        status = os.fstat(descriptor)
        if stat.S_ISDIR(status.st_mode):
            raise IsADirectoryError(21, "Is a directory", str(path))
        if not stat.S_ISREG(status.st_mode):
            raise TomlError("is not a regular file; give the path of a file on a disk")
        content = file.read(MOST_BYTES + 1)
    if len(content) > MOST_BYTES:
        raise TomlError(f"is larger than {MOST_BYTES // 10**6} MB, the limit for a file")
    return content
