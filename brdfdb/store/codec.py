"""The zarr side of the store: which codecs, and a block as the bytes of its chunk."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import lru_cache

import google_crc32c
import numpy as np
import xarray as xr
import zarr
from numcodecs import Blosc
from numpy.typing import NDArray
from zarr.codecs import BloscCodec, Crc32cCodec
from zarr.core.buffer import Buffer
from zarr.storage import MemoryStore

from brdfdb.errors import StoreError
from brdfdb.tables.layout import Layout
from brdfdb.tables.tabulation import VARIABLES

_CHUNK_VALUES = 1 << 20  # values of a chunk of a dataset that comes as a whole, 4 MB

# crc32c last: without it nearly every flipped bit reads back as a plausible number
COMPRESSORS = (BloscCodec(cname="zstd", clevel=1, shuffle="shuffle"), Crc32cCodec())
_BLOSC = Blosc(cname="zstd", clevel=1, shuffle=Blosc.SHUFFLE)


def chunk_name(layout: Layout, number: int) -> str:
    """The file of a block, inside the group."""
    return "/".join([layout.variable, "c", str(number), *["0"] * (len(layout.shape) - 1)])


def encoded(layout: Layout, number: int, values: NDArray[np.float32]) -> bytes:
    """The bytes of the file that holds a block: those that zarr writes with `COMPRESSORS`, without its event loop.

    Parameters
    ----------
    layout : Layout
        Of the table.
    number : int
        Of the block.
    values : float32 array
        The block, as `tabulate.block` returns it.
    """
    rows = layout.blocks[number]
    if rows.stop - rows.start < layout.block_rows:  # chunks are of one size: the last is filled up
        whole = np.full((layout.block_rows, *layout.shape[1:]), np.nan, dtype=np.float32)
        whole[: len(values)] = values
        values = whole
    data: bytes = _BLOSC.encode(np.ascontiguousarray(values, dtype="<f4"))
    checksum: int = google_crc32c.value(data)
    return data + checksum.to_bytes(4, "little")


def decoded(layout: Layout, number: int, data: bytes) -> NDArray[np.float32]:
    """The block in the bytes of its file: the inverse of `encoded`.

    Raises
    ------
    StoreError
        If the checksum is not that of the bytes.
    """
    if google_crc32c.value(data[:-4]) != int.from_bytes(data[-4:], "little"):
        raise StoreError(f"{layout.source.name}: the checksum of {chunk_name(layout, number)} is wrong")
    rows = layout.blocks[number]
    whole = np.frombuffer(_BLOSC.decode(data[:-4]), dtype="<f4").reshape(layout.block_rows, *layout.shape[1:])
    return whole[: rows.stop - rows.start]


def array_metadata(layout: Layout) -> bytes:
    """The metadata of the array that holds the blocks."""
    rest = tuple(layout.shape[1:])
    attributes = json.dumps(VARIABLES[layout.variable])
    shape, chunks = (layout.shape[0], *rest), (layout.block_rows, *rest)
    return _array_files(tuple(layout.dims), shape, chunks, "<f4", attributes, None)["zarr.json"]


@lru_cache(maxsize=256)
def _array_files(
    dims: tuple[str, ...],
    shape: tuple[int, ...],
    chunks: tuple[int, ...],
    dtype: str,
    attributes: str,
    data: bytes | None,
) -> dict[str, bytes]:
    """The files of an array by their path inside it, kept: tables share coordinates, and zarr takes its time."""
    files: dict[str, Buffer] = {}
    array = zarr.create_array(
        MemoryStore(files),
        shape=shape,
        chunks=chunks,
        dtype=dtype,
        compressors=COMPRESSORS,
        fill_value=np.nan,  # zarr's own 0 reads as a plausible black material
        dimension_names=dims,
        attributes=json.loads(attributes),
        config={"write_empty_chunks": True},
    )
    if data is not None:
        array[...] = np.frombuffer(data, dtype=dtype).reshape(shape)
    return {name: content.to_bytes() for name, content in files.items()}


def frame_files(layout: Layout, frame: xr.Dataset) -> dict[str, bytes]:
    """All files of a revision but the blocks: group and array metadata, coordinates and small variables."""
    return _group_files(frame, {f"{layout.variable}/zarr.json": array_metadata(layout)})


def _chunks(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Whole rows of the first axis, as many as make a chunk of _CHUNK_VALUES."""
    if not shape:
        return ()
    rest = int(np.prod(shape[1:]))
    return (max(1, min(shape[0], _CHUNK_VALUES // max(rest, 1))), *shape[1:])


def dataset_files(dataset: xr.Dataset) -> dict[str, bytes]:
    """All files of a revision that holds a dataset."""
    return _group_files(dataset, {})


def _group_files(dataset: xr.Dataset, others: Mapping[str, bytes]) -> dict[str, bytes]:
    """The files of a group of plain arrays, with the metadata of all of them repeated in those of the group.

    A plain `xarray.open_zarr` looks for them there first. `zarr.consolidate_metadata` warns while it does the same. A
    revision never changes: nothing goes stale.
    """
    files = dict(others)
    for name, variable in dataset.variables.items():
        values = np.asarray(variable.values)
        written = _array_files(
            tuple(map(str, variable.dims)),
            values.shape,
            _chunks(values.shape),
            values.dtype.newbyteorder("<").str,
            json.dumps(variable.attrs),
            values.tobytes(),
        )
        files |= {f"{name}/{file}": data for file, data in written.items()}
    arrays = {name[: -len("/zarr.json")]: json.loads(files[name]) for name in sorted(files) if "/zarr.json" in name}
    metadata = {
        "attributes": dataset.attrs,
        "zarr_format": 3,
        "consolidated_metadata": {"kind": "inline", "must_understand": False, "metadata": arrays},
        "node_type": "group",
    }
    files["zarr.json"] = json.dumps(metadata, indent=1, allow_nan=False).encode()
    return files
