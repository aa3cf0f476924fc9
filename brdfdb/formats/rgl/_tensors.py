"""Tensor files: named arrays in one file, the container of RGL's measured materials."""

from __future__ import annotations

import math
import mmap
import os
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError
from brdfdb.place import path_of

MAGIC = b"tensor_file\0"
_VERSION = bytes((1, 0))
_ALIGNMENT = 8  # bytes
_MOST_FIELDS, _MOST_AXES, _MOST_NAME = 256, 16, 256  # more of them is a damaged header
# Types of elements by their number in the file
_LETTERS = ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f2", "f4", "f8")
_TYPES = {number: np.dtype(f"<{letters}") for number, letters in enumerate(_LETTERS, 1)}
_NUMBERS = {dtype: number for number, dtype in _TYPES.items()}


def write_tensors(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write arrays as a tensor file; OSError if it cannot be written."""
    header = MAGIC + _VERSION + struct.pack("<I", len(arrays))
    size = len(header) + sum(len(name.encode()) + 13 + 8 * array.ndim for name, array in arrays.items())
    blocks = []
    offset = size
    for name, array in arrays.items():
        block = array.tobytes()
        offset += -offset % _ALIGNMENT
        header += struct.pack("<H", len(name.encode())) + name.encode()
        header += struct.pack(f"<HBQ{array.ndim}Q", array.ndim, _NUMBERS[array.dtype], offset, *array.shape)
        blocks.append((offset, block))
        offset += len(block)
    with path.open("wb") as file:
        file.write(header)
        for offset, block in blocks:
            file.write(bytes(offset - file.tell()))
            file.write(block)


def read_tensors(path: str | os.PathLike[str]) -> dict[str, NDArray[Any]]:
    """Return the arrays of a tensor file by name; FileFormatError if it is not a tensor file or is damaged."""
    with path_of(path).open("rb") as file:
        if not file.read(1):
            raise FileFormatError(f"{path}: it is not a tensor file")
        content = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)  # files of Mueller matrices have a gigabyte
    header = _Header(path, content)
    if header.take(len(MAGIC)) != MAGIC:
        raise FileFormatError(f"{path}: it is not a tensor file")
    if header.take(2) != _VERSION:
        raise FileFormatError(f"{path}: its version is {content[12]}.{content[13]}; allowed is 1.0")
    (count,) = header.unpack("<I")
    if count > _MOST_FIELDS:
        raise FileFormatError(f"{path}: damaged: {count} fields")
    fields = [header.field() for _ in range(count)]
    arrays = dict(fields)
    if len(arrays) < len(fields):
        raise FileFormatError(
            f"{path}: damaged: of its fields {', '.join(name for name, _ in fields)} one stands twice"
        )
    return arrays


class _Header:
    """Reader of the header of a tensor file that never reads beyond its end."""

    def __init__(self, path: str | os.PathLike[str], content: mmap.mmap) -> None:
        self._path = path
        self._content = content
        self._at = 0

    def take(self, count: int) -> bytes:
        """Return the next bytes."""
        part = self._content[self._at : self._at + count]
        if len(part) < count:
            raise FileFormatError(f"{self._path}: damaged: it ends within its header")
        self._at += count
        return part

    def unpack(self, layout: str) -> tuple[int, ...]:
        """Return the next numbers."""
        return struct.unpack(layout, self.take(struct.calcsize(layout)))

    def field(self) -> tuple[str, NDArray[Any]]:
        """Return the next field: its name and its array."""
        (length,) = self.unpack("<H")
        if length > _MOST_NAME:
            raise FileFormatError(f"{self._path}: damaged: the name of a field has {length} bytes")
        name = self.take(length).decode("utf-8", "replace")
        axes, number, offset = self.unpack("<HBQ")
        if axes > _MOST_AXES or number not in _TYPES:
            raise FileFormatError(
                f"{self._path}: damaged: field {name!r} has {axes} axes and elements of type {number}"
            )
        shape = self.unpack(f"<{axes}Q")
        dtype = _TYPES[number]
        size = math.prod(shape)  # of Python's integers, which do not overflow
        if offset + size * dtype.itemsize > len(self._content):
            raise FileFormatError(f"{self._path}: damaged: field {name!r} of shape {shape} lies beyond its end")
        if not size and any(shape[1:]):  # NumPy has no arrays of such shapes; texts may be empty
            raise FileFormatError(f"{self._path}: damaged: field {name!r} of shape {shape} is empty")
        values = np.frombuffer(self._content, dtype, size, offset) if size else np.empty(0, dtype)
        return name, values.reshape(shape) if size else values
