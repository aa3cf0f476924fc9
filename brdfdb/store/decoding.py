"""Decoding of a revision: its arrays as a table, and its metadata without its arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from brdfdb.errors import (
    ParameterError,
    StoreError,
)
from brdfdb.store.chunks import Group, read_group
from brdfdb.store.files import Entry
from brdfdb.store.paths import METADATA
from brdfdb.store.sealed_json import read_json

if TYPE_CHECKING:
    from brdfdb.tables.metadata import TableMetadata
    from brdfdb.tables.table import Table


def decode(name: str, path: Path, files: Mapping[str, Entry], digest: str) -> Table:
    """Return the table of a revision; StoreError if it is damaged, or no table that this program can look up."""
    try:
        arrays, dims, attrs = read_group(path, files) or _read_by_zarr(path, files)
    except StoreError:
        raise
    except Exception as error:  # codecs raise many kinds; each means that the bytes are damaged
        raise StoreError(f"{name} {path.name} is damaged: its values cannot be decoded") from error
    try:
        return replace(table_of(name, path.name, arrays, dims, attrs), digest=digest)
    except ValueError as error:  # written by another program
        raise StoreError(f"{name} {path.name} cannot be looked up: {error}") from error


def _read_by_zarr(path: Path, files: Mapping[str, Entry]) -> Group:
    """Return the arrays of a revision that another program wrote, in any encoding that zarr reads."""
    import numpy as np
    import zarr

    from brdfdb.store.zarr_store import Whole

    group = zarr.open_group(Whole(path, files), mode="r")
    stored = dict(group.arrays())
    dims = {key: array.metadata.dimension_names or () for key, array in stored.items()}  # type: ignore[union-attr]
    return Group({key: np.asarray(array[...]) for key, array in stored.items()}, dims, dict(group.attrs))


def table_of(
    name: str,
    revision: str,
    arrays: Mapping[str, NDArray[Any]],
    dims: Mapping[str, tuple[Any, ...]],
    attrs: Mapping[str, Any],
) -> Table:
    """Return the table of arrays, by name with their dimensions; ParameterError if they are none to look up."""
    from brdfdb.tables.table import table_from

    table = table_from(name, revision, arrays, attrs)
    variable, axes = "brdf" if "brdf" in arrays else "parts", table.grid.names
    if dims[variable][: len(axes)] != axes:
        raise ParameterError(variable, f"its dimensions {dims[variable]} must begin with {axes}")
    return table


def read_metadata(group: Path) -> TableMetadata:
    """Return the metadata in the directory of a revision, whose files were checked against its manifest."""
    from brdfdb.tables.metadata import TableMetadata

    return TableMetadata.read(read_json(group / METADATA).get("attributes", {}))
