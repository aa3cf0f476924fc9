"""Arrays of a revision read without zarr, whose import takes longer than most tables."""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import google_crc32c
import numpy as np
from numcodecs.blosc import Blosc
from numpy.typing import NDArray

from brdfdb.errors import StoreError
from brdfdb.store.files import Entry, regular_bytes
from brdfdb.store.paths import METADATA, manifest_path

_CODECS = ["bytes", "blosc", "crc32c"]  # of all arrays that `brdfdb.store.codec` writes
_TYPES = ("float32", "float64", "bool")
BLOSC = Blosc(cname="zstd", clevel=1, shuffle=Blosc.SHUFFLE)


class Group(NamedTuple):
    """The arrays of a revision, the names of their dimensions, and the attributes of the revision."""

    arrays: dict[str, NDArray[Any]]
    dims: dict[str, tuple[Any, ...]]
    attrs: dict[str, Any]


def check_file(group: Path, key: str, value: bytes | None, files: Mapping[str, Entry], *, whole: bool = True) -> None:
    """Raise StoreError if a file of a revision is missing, or is not the one that its manifest names.

    Parameters
    ----------
    group : Path
        Directory of the revision.
    key : str
        Path of the file in it.
    value : bytes or None
        Its content; None if there is no such file.
    files : mapping
        Size and sha256 of each file of the revision. Files that it does not name are not checked.
    whole : bool
        False if `value` is a part of the file, whose digest is not known.
    """
    if (entry := files.get(key)) is None:
        return
    where = f"{group.parent.name} {group.name}"
    if value is None:
        if not manifest_path(group).is_file():
            raise StoreError(f"{where} was removed while it was read; open the material anew")
        raise StoreError(f"{where} is damaged: {key} is missing")
    if whole and hashlib.sha256(value).hexdigest() != entry["sha256"]:
        raise StoreError(f"{where} is damaged: the content of {key} changed")


def read_group(group: Path, files: Mapping[str, Entry]) -> Group | None:
    """Return the arrays of a revision; None if they are written as `brdfdb.store.codec` does not write them.

    Parameters
    ----------
    group : Path
        Directory of the revision.
    files : mapping
        Size and sha256 of each file of the revision.

    Raises
    ------
    StoreError
        If a file is missing or changed.
    ValueError, KeyError, TypeError, RuntimeError
        If the files do not hold arrays.
    """
    metadata = json.loads(checked_bytes(group, METADATA, files))
    described = (metadata.get("consolidated_metadata") or {}).get("metadata")
    if described is None or not all(_ours(array) for array in described.values()):
        return None
    arrays = {name: _array(group, name, array, files) for name, array in described.items()}
    dims = {name: tuple(array.get("dimension_names") or ()) for name, array in described.items()}
    return Group(arrays, dims, metadata.get("attributes", {}))


def _ours(array: Mapping[str, Any]) -> bool:
    """Return True if the metadata of an array are those that `brdfdb.store.codec` writes."""
    return (
        array.get("node_type") == "array"
        and array["data_type"] in _TYPES
        and [codec["name"] for codec in array["codecs"]] == _CODECS
        and array["codecs"][0].get("configuration", {}).get("endian", "little") == "little"
        and array["chunk_grid"]["name"] == "regular"
        and array["chunk_key_encoding"] == {"name": "default", "configuration": {"separator": "/"}}
        and not array.get("storage_transformers")
    )


def _array(group: Path, name: str, array: Mapping[str, Any], files: Mapping[str, Entry]) -> NDArray[Any]:
    """Return an array [native byte order] from the files of its chunks."""
    checked_bytes(
        group, f"{name}/{METADATA}", files
    )  # nothing reads it here, and it is checked as the rest of the revision
    shape, chunk = array["shape"], array["chunk_grid"]["configuration"]["chunk_shape"]
    dtype = np.dtype(array["data_type"])
    values = np.empty(shape, dtype=dtype)
    for number in itertools.product(*(range(-(-size // step)) for size, step in zip(shape, chunk, strict=True))):
        data = decoded(checked_bytes(group, "/".join([name, "c", *map(str, number)]), files))
        if data is None:
            where = f"{group.parent.name} {group.name}"
            raise StoreError(f"{where} is damaged: its values cannot be decoded")
        place = tuple(slice(n * step, (n + 1) * step) for n, step in zip(number, chunk, strict=True))
        piece = np.frombuffer(data, dtype=dtype.newbyteorder("<")).reshape(chunk)
        values[place] = piece[tuple(slice(size - at.start) for size, at in zip(shape, place, strict=True))]
    return values


def decoded(data: bytes) -> bytes | None:
    """Return the bytes of a chunk from those of its file; None if the checksum at their end is not theirs."""
    if google_crc32c.value(data[:-4]) != int.from_bytes(data[-4:], "little"):
        return None
    values: bytes = BLOSC.decode(data[:-4])
    return values


def checked_bytes(group: Path, key: str, files: Mapping[str, Entry]) -> bytes:
    """Return the content of a file of a revision, checked once it is in memory.

    Parameters
    ----------
    group : Path
        Directory of the revision.
    key : str
        Path of the file in it.
    files : mapping
        Size and sha256 of each file of the revision.

    Raises
    ------
    StoreError
        If the file is missing, cannot be read or changed.
    """
    try:
        value = regular_bytes(group / key)
    except (FileNotFoundError, NotADirectoryError):
        value = None
    except OSError as error:
        where = f"{group.parent.name} {group.name}"
        raise StoreError(f"{where} is damaged: {key} cannot be read: {error.strerror}") from error
    check_file(group, key, value, files)
    if value is None:  # a chunk that no manifest names
        raise StoreError(f"{group.parent.name} {group.name} is damaged: {key} is missing")
    return value
