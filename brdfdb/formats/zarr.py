"""zarr 3: f_r on a plain grid of angles, a directory that xarray and zarr open.

The axes are polar angles and azimuths of light and viewer, or angles of the half and difference vectors (``--axes``).
f_r is in 1/sr, without the cosine. Readers interpolate linearly along all axes at once.

A file can hold anisotropic tables, all wavelengths and the specular part. The specular part is a separate array. The
values take 100 MB at most, before compression: a table that needs more is written with a larger error.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Unpack

from brdfdb.errors import FileFormatError
from brdfdb.formats._dense_files import OPTIONS, DenseOptions, check_sizes, dataset, read_dataset
from brdfdb.formats._written import Written, whole
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.formats._readings import FileTable
    from brdfdb.measurements.conventions import ListedRows
    from brdfdb.measurements.samples import Samples
    from brdfdb.tables.table import Table

suffix = ".zarr"
angle_unit = "stated"
media_type = "application/zip"  # of the directory over HTTP
summary = "f_r on a plain grid of angles as zarr 3"
tools = "xarray, zarr"
kinds = ()
options = OPTIONS


def write(
    table: Table, path: str | os.PathLike[str], *, verdict: str | None = None, **options: Unpack[DenseOptions]
) -> Written:
    """Write f_r on a plain grid of angles as a zarr 3 group, which is a directory.

    Arrays and attributes are those of the netCDF files. The values take 100 MB at most, before compression.
    """
    from brdfdb.formats._dense_grid import dense_table

    dense = dense_table(table, **options)
    with whole(path) as (half,):
        dataset(table, dense, verdict).to_zarr(half, mode="w", zarr_format=3, consolidated=False)
    return Written((path_of(path),), dense.error, dense.tolerance)


def recognises(head: bytes) -> bool:
    """Return True for the first bytes of ``zarr.json`` of a group with an angular grid."""
    return b'"zarr_format"' in head and b'"group"' in head


def read(path: str | os.PathLike[str]) -> FileTable | ListedRows | Samples:
    """Return f_r of a zarr group with ``brdf`` over angles [degree], interpolated linearly; or samples."""
    import xarray as xr
    import zarr

    path = path_of(path)
    try:
        group = zarr.open_group(os.fspath(path), mode="r", zarr_format=3)
        check_sizes(path, {name: array.shape for name, array in group.arrays()})  # xarray reads axes at once
        with xr.open_zarr(os.fspath(path), chunks=None, consolidated=False) as opened:
            return read_dataset(path, opened)
    except FileFormatError:
        raise
    except Exception as error:  # codecs and parsers raise what they come to
        if not path.exists():
            raise FileNotFoundError(f"no directory {path}") from None
        raise FileFormatError(f"{path}: it is not a zarr group, or is damaged ({error})") from error
