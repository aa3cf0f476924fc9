"""Codecs of the store: a block as the bytes of a zarr chunk, and a table as the files of a zarr group."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import google_crc32c
import numpy as np
import zarr
from numpy.typing import NDArray
from zarr.codecs import BloscCodec, Crc32cCodec
from zarr.core.buffer import Buffer
from zarr.storage import MemoryStore

from brdfdb.errors import StoreError
from brdfdb.store import decoding
from brdfdb.store.paths import METADATA
from brdfdb.tables.layout import Layout
from brdfdb.tables.tabulation import VARIABLES, Frame, StoredArray

if TYPE_CHECKING:
    import xarray as xr

_CHUNK_VALUES = 1 << 20  # values of a chunk of a dataset in memory: 4 MB
_NO_CHUNK = (1 << 64) - 1  # in the index of a shard

# crc32c last: without it nearly every flipped bit reads back as a plausible number
COMPRESSORS = (BloscCodec(cname="zstd", clevel=1, shuffle="shuffle"), Crc32cCodec())


def chunk_name(layout: Layout, number: int) -> str:
    """Return the path of the file of a block, inside the group."""
    return "/".join([layout.variable, "c", str(number), *["0"] * (len(layout.shape) - 1)])


def chunk_bytes(values: NDArray[np.floating[Any]], rows: int) -> bytes:
    """Return the bytes that zarr writes for a chunk of `rows` rows in float32, without its event loop.

    Missing rows are nan, because all chunks have the same size.
    """
    if len(values) < rows:
        filled = np.full((rows, *values.shape[1:]), np.nan, dtype=np.float32)
        filled[: len(values)] = values
        values = filled
    data: bytes = decoding.BLOSC.encode(np.ascontiguousarray(values, dtype="<f4"))
    checksum: int = google_crc32c.value(data)
    return data + checksum.to_bytes(4, "little")


def shard_bytes(chunks: Sequence[bytes], places: int) -> bytes:
    """Return the bytes of a shard with so many places, of which the first are filled by chunks."""
    sizes = np.array([len(chunk) for chunk in chunks], dtype="<u8")
    index = np.full((places, 2), _NO_CHUNK, dtype="<u8")
    index[: len(chunks)] = np.stack([np.cumsum(sizes) - sizes, sizes], axis=1)
    data = index.tobytes()
    checksum: int = google_crc32c.value(data)
    return b"".join([*chunks, data, checksum.to_bytes(4, "little")])


def decoded(layout: Layout, number: int, data: bytes) -> NDArray[np.float32]:
    """Return the block in the bytes of a file, the inverse of `chunk_bytes`; StoreError if their checksum is wrong."""
    content = decoding.decoded(data)
    if content is None:
        raise StoreError(f"{layout.source.name}: the checksum of {chunk_name(layout, number)} is wrong")
    rows = layout.blocks[number]
    block = np.frombuffer(content, dtype="<f4").reshape(layout.block_rows, *layout.shape[1:])
    return block[: rows.stop - rows.start]


def array_metadata(layout: Layout) -> bytes:
    """Return the metadata of the array that holds the blocks."""
    rest = tuple(layout.shape[1:])
    attributes = json.dumps(VARIABLES[layout.variable])
    shape = (layout.shape[0], *rest)
    chunk = (layout.block_rows, *rest)
    return array_files(tuple(layout.dims), shape, chunk, "<f4", attributes, None)[METADATA]


@lru_cache(maxsize=256)
def array_files(
    dims: tuple[str, ...],
    shape: tuple[int, ...],
    chunk: tuple[int, ...],
    dtype: str,
    attributes: str,
    data: bytes | None,
    shard: tuple[int, ...] | None = None,
) -> dict[str, bytes]:
    """Return the files of an array by their path inside it; cached, since tables share coordinates and zarr is slow."""
    files: dict[str, Buffer] = {}
    array = zarr.create_array(
        MemoryStore(files),
        shape=shape,
        chunks=chunk,
        shards=shard,
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


def frame_files(layout: Layout, frame: Frame) -> dict[str, bytes]:
    """Return the files of a revision except the blocks: metadata, coordinates and small variables."""
    others = {f"{layout.variable}/{METADATA}": array_metadata(layout)}
    return group_files({**frame.variables, **frame.coordinates}, frame.attrs, others)


def _chunks(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Return the shape of a chunk: complete rows of the first axis, about _CHUNK_VALUES values."""
    if not shape:
        return ()
    rest = int(np.prod(shape[1:]))
    return (max(1, min(shape[0], _CHUNK_VALUES // max(rest, 1))), *shape[1:])


def dataset_files(dataset: xr.Dataset) -> dict[str, bytes]:
    """Return the files of a revision that holds a dataset."""
    variables = {
        str(name): StoredArray(tuple(map(str, variable.dims)), np.asarray(variable.values), variable.attrs)
        for name, variable in dataset.variables.items()
    }
    return group_files(variables, dataset.attrs, {})


def group_files(
    variables: Mapping[str, StoredArray], attrs: Mapping[str, Any], others: Mapping[str, bytes]
) -> dict[str, bytes]:
    """Return the files of a group of plain arrays; the metadata of the group repeats those of the arrays.

    A plain `xarray.open_zarr` looks for them there first. `zarr.consolidate_metadata` warns while it does the same. A
    revision never changes: nothing goes stale.
    """
    files = dict(others)
    for name, (dims, values, attributes) in variables.items():
        written = array_files(
            dims,
            values.shape,
            _chunks(values.shape),
            values.dtype.newbyteorder("<").str,
            json.dumps(attributes),
            values.tobytes(),
        )
        files |= {f"{name}/{file}": data for file, data in written.items()}
    arrays = {
        name.removesuffix(f"/{METADATA}"): json.loads(files[name])
        for name in sorted(files)
        if name.endswith(f"/{METADATA}")
    }
    metadata = {
        "attributes": attrs,
        "zarr_format": 3,
        "consolidated_metadata": {"kind": "inline", "must_understand": False, "metadata": arrays},
        "node_type": "group",
    }
    files[METADATA] = json.dumps(metadata, allow_nan=False).encode()
    return files
