"""The zarr side of the store: which codecs, a block as the bytes of its chunk, and chunks that went missing."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
import zarr
from numpy.typing import NDArray
from zarr.codecs import BloscCodec, Crc32cCodec
from zarr.core.buffer import Buffer
from zarr.core.buffer.cpu import Buffer as Bytes
from zarr.storage import LocalStore, MemoryStore

from brdfdb.layout import Layout
from brdfdb.manifest import StoreError, manifest_of
from brdfdb.tabulate import VARIABLES

_CHUNK_VALUES = 1 << 20  # values of a chunk of a dataset that comes as a whole, 4 MB

# crc32c last: without it nearly every flipped bit reads back as a plausible number
COMPRESSORS = (BloscCodec(cname="zstd", clevel=1, shuffle="shuffle"), Crc32cCodec())


class Whole(LocalStore):
    """A revision as zarr reads it, but that a file of it that goes missing is an error and not nan.

    Parameters
    ----------
    group : Path
        Directory of the revision.
    files : mapping
        By the path of each file that belongs there.
    """

    def __init__(self, group: Path, files: Mapping[str, Any]) -> None:
        super().__init__(group, read_only=True)
        self._files = frozenset(files)

    async def get(self, key: str, *arguments: Any, **keywords: Any) -> Buffer | None:
        """As `LocalStore.get`; StoreError for a file that should be there."""
        value = await super().get(key, *arguments, **keywords)
        if value is None and key in self._files:
            where = f"{self.root.parent.name} {self.root.name}"
            if not manifest_of(self.root).is_file():
                raise StoreError(f"{where} was removed while it was read; open the material anew")
            raise StoreError(f"{where} is damaged: {key} is missing")
        return value


def chunk_name(layout: Layout, number: int) -> str:
    """The file of a block, inside the group."""
    return "/".join([layout.variable, "c", str(number), *["0"] * (len(layout.shape) - 1)])


def encoded(layout: Layout, number: int, values: NDArray[np.float32]) -> bytes:
    """The bytes of the file that holds a block.

    Parameters
    ----------
    layout : Layout
        Of the table.
    number : int
        Of the block.
    values : float32 array
        The block, as `tabulate.block` returns it.
    """
    files: dict[str, Buffer] = {"zarr.json": Bytes.from_bytes(array_metadata(layout))}
    array = zarr.open_array(MemoryStore(files), mode="r+", config={"write_empty_chunks": True})
    array[layout.blocks[number]] = values
    (data,) = (data for name, data in files.items() if name != "zarr.json")
    return data.to_bytes()


def array_metadata(layout: Layout) -> bytes:
    """The metadata of the array that holds the blocks."""
    return _array_metadata(layout.variable, tuple(layout.dims), tuple(layout.shape), layout.block_rows)


@lru_cache(maxsize=256)
def _array_metadata(variable: str, dims: tuple[str, ...], shape: tuple[int, ...], rows: int) -> bytes:
    files: dict[str, Buffer] = {}
    zarr.create_array(
        MemoryStore(files),
        shape=shape,
        chunks=(rows, *shape[1:]),
        dtype=np.float32,
        compressors=COMPRESSORS,
        fill_value=np.nan,  # zarr's own 0 reads as a plausible black material
        dimension_names=dims,
        attributes={**VARIABLES[variable]},
        config={"write_empty_chunks": True},
    )
    return files["zarr.json"].to_bytes()


def frame_files(layout: Layout, frame: xr.Dataset) -> dict[str, bytes]:
    """All files of a revision but the blocks: group and array metadata, coordinates and small variables."""
    return _group_files(frame, {f"{layout.variable}/zarr.json": array_metadata(layout)})


def _chunks(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Whole rows of the first axis, as many as make a chunk of _CHUNK_VALUES."""
    rest = int(np.prod(shape[1:]))
    return (max(1, min(shape[0], _CHUNK_VALUES // max(rest, 1))), *shape[1:])


def dataset_files(dataset: xr.Dataset) -> dict[str, bytes]:
    """All files of a revision that holds a dataset."""
    return _group_files(dataset, {})


def _group_files(dataset: xr.Dataset, others: Mapping[str, bytes]) -> dict[str, bytes]:
    """The files of a group, with the metadata of all arrays repeated in those of the group.

    A plain `xarray.open_zarr` looks for them there first. `zarr.consolidate_metadata` warns while it does the same. A
    revision never changes: nothing goes stale.
    """
    written: dict[str, Buffer] = {}
    encoding: dict[str, Any] = {
        str(name): {"compressors": COMPRESSORS, "fill_value": np.nan, "chunks": _chunks(variable.shape)}
        for name, variable in dataset.variables.items()
    }
    dataset.to_zarr(
        MemoryStore(written), mode="w-", zarr_format=3, consolidated=False, encoding=encoding, write_empty_chunks=True
    )
    files = {name: data.to_bytes() for name, data in written.items()} | dict(others)
    metadata = json.loads(files["zarr.json"])
    arrays = {name[: -len("/zarr.json")]: json.loads(files[name]) for name in sorted(files) if "/zarr.json" in name}
    metadata["consolidated_metadata"] = {"kind": "inline", "must_understand": False, "metadata": arrays}
    files["zarr.json"] = json.dumps(metadata, indent=1).encode()
    return files
