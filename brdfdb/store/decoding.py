"""Decoding of a revision: its arrays as a table.

Arrays that this program wrote are read without zarr, whose import takes longer than most tables.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import google_crc32c
import numpy as np
from numcodecs.blosc import Blosc
from numpy.typing import NDArray

from brdfdb.errors import ParameterError, StoreError
from brdfdb.store.files import FileEntry, regular_bytes
from brdfdb.store.paths import METADATA
from brdfdb.store.records import check_file

if TYPE_CHECKING:
    from zarr.abc.store import Store as ZarrStore

    from brdfdb.tables.table import Table

BLOSC = Blosc(cname="zstd", clevel=1, shuffle=Blosc.SHUFFLE)

_CODECS = ["bytes", "blosc", "crc32c"]  # of all arrays that `brdfdb.store.codec` writes
_TYPES = ("float32", "float64", "bool")


class StoredArrays(NamedTuple):
    """The arrays of a revision, the names of their dimensions, and the attributes of the revision."""

    arrays: dict[str, NDArray[Any]]
    dims: dict[str, tuple[Any, ...]]
    attrs: dict[str, Any]


def decode(name: str, path: Path, files: Mapping[str, FileEntry], digest: str) -> Table:
    """Return the table of a revision in a directory; errors as of `decoded_table`."""

    def as_zarr() -> ZarrStore:
        from brdfdb.store.zarr_store import CheckedRevision

        return CheckedRevision(path, files)

    return decoded_table(name, path.name, digest, partial(checked_bytes, path, files=files), as_zarr)


def decoded_table(
    name: str, revision: str, digest: str, read: Callable[[str], bytes], as_zarr: Callable[[], ZarrStore]
) -> Table:
    """Return the table of a revision; StoreError if it is damaged, or no table that this program can look up.

    `read` returns the content of a file, checked; `as_zarr` the revision as zarr reads it, in any encoding.
    """
    try:
        stored = read_group(read) or read_by_zarr(as_zarr())
    except StoreError:
        raise
    except Exception as error:  # codecs raise many kinds; each means that the bytes are damaged
        raise StoreError(f"{name} {revision} is damaged: its values cannot be decoded") from error
    try:
        return replace(table_of(name, revision, *stored), digest=digest)
    except ValueError as error:  # written by another program
        raise StoreError(f"{name} {revision} cannot be looked up: {error}") from error


def table_of(
    name: str,
    revision: str,
    arrays: Mapping[str, NDArray[Any]],
    dims: Mapping[str, tuple[Any, ...]],
    attrs: Mapping[str, Any],
) -> Table:
    """Return the table of arrays, by name with their dimensions; ParameterError if no lookup could read it."""
    from brdfdb.tables.table import table_from

    table = table_from(name, revision, arrays, attrs)
    variable = "brdf" if "brdf" in arrays else "parts"
    axes = table.grid.names
    if dims[variable][: len(axes)] != axes:
        raise ParameterError(variable, f"its dimensions {dims[variable]} must begin with {axes}")
    return table


def read_group(read: Callable[[str], bytes]) -> StoredArrays | None:
    """Return the arrays of a revision, whose files `read` returns; None if another program encoded them.

    Errors of `read` are passed on; files that hold no arrays raise errors of many kinds.
    """
    metadata = json.loads(read(METADATA))
    described = (metadata.get("consolidated_metadata") or {}).get("metadata")
    if described is None or not all(map(is_ours, described.values())):
        return None
    arrays = {name: _array(read, name, array) for name, array in described.items()}
    dims = {name: tuple(array.get("dimension_names") or ()) for name, array in described.items()}
    return StoredArrays(arrays, dims, metadata.get("attributes", {}))


def read_by_zarr(store: ZarrStore) -> StoredArrays:
    """Return the arrays of a revision that another program wrote, in any encoding that zarr reads."""
    import zarr

    group = zarr.open_group(store, mode="r")
    stored = dict(group.arrays())
    dims = {key: array.metadata.dimension_names or () for key, array in stored.items()}  # type: ignore[union-attr]
    return StoredArrays({key: np.asarray(array[...]) for key, array in stored.items()}, dims, dict(group.attrs))


def is_ours(array: Mapping[str, Any]) -> bool:
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


def _array(read: Callable[[str], bytes], name: str, array: Mapping[str, Any]) -> NDArray[Any]:
    """Return an array [native byte order] from the files of its chunks."""
    read(f"{name}/{METADATA}")  # not used here, but checked as every file of the revision
    shape = array["shape"]
    chunk = array["chunk_grid"]["configuration"]["chunk_shape"]
    dtype = np.dtype(array["data_type"])
    values = np.empty(shape, dtype=dtype)
    for number in itertools.product(*(range(-(-size // step)) for size, step in zip(shape, chunk, strict=True))):
        data = decoded(read("/".join([name, "c", *map(str, number)])))
        if data is None:
            raise ValueError(f"the checksum of a chunk of {name} is wrong")
        place = tuple(slice(n * step, (n + 1) * step) for n, step in zip(number, chunk, strict=True))
        piece = np.frombuffer(data, dtype=dtype.newbyteorder("<")).reshape(chunk)
        values[place] = piece[tuple(slice(size - at.start) for size, at in zip(shape, place, strict=True))]
    return values


def decoded(data: bytes) -> bytes | None:
    """Return the decoded bytes of a chunk; None if the checksum at the end of its file is wrong."""
    if google_crc32c.value(data[:-4]) != int.from_bytes(data[-4:], "little"):
        return None
    values: bytes = BLOSC.decode(data[:-4])
    return values


def checked_bytes(group: Path, key: str, files: Mapping[str, FileEntry]) -> bytes:
    """Return the content of a file of a revision; StoreError if it is missing, cannot be read or changed."""
    where = f"{group.parent.name} {group.name}"
    try:
        value = regular_bytes(group / key)
    except (FileNotFoundError, NotADirectoryError):
        value = None
    except OSError as error:
        raise StoreError(f"{where} is damaged: {key} cannot be read: {error.strerror}") from error
    check_file(group, key, value, files)
    if value is None:  # a chunk that no manifest names
        raise StoreError(f"{where} is damaged: {key} is missing")
    return value
