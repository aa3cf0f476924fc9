"""netCDF: f_r on a plain grid of angles, which xarray and every other reader of netCDF opens.

The axes are polar angles and azimuths of light and viewer, or angles of the half and difference vectors (``--axes``).
f_r is in 1/sr, without the cosine. Readers interpolate linearly along all axes at once.

A file can hold anisotropic tables, all wavelengths and the specular part. The specular part is a separate variable. The
values take 100 MB at most: a table that needs more is written with a larger error.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Unpack

from brdfdb.errors import import_extra
from brdfdb.formats._dense_files import OPTIONS, DenseOptions, dataset, opened_netcdf, read_dataset
from brdfdb.formats._written import Written, whole
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.formats._readings import FileTable
    from brdfdb.measurements.conventions import ListedRows
    from brdfdb.measurements.samples import Samples
    from brdfdb.tables.table import Table

suffix = ".nc"
angle_unit = "stated"
media_type = "application/netcdf"
summary = "f_r on a plain grid of angles as netCDF"
tools = "xarray, MATLAB, Panoply, every program with netCDF"
kinds = ()
options = OPTIONS
_MAGIC = (b"CDF\x01", b"CDF\x02")


def write(
    table: Table, path: str | os.PathLike[str], *, verdict: str | None = None, **options: Unpack[DenseOptions]
) -> Written:
    """Write f_r on a plain grid of angles as netCDF 3 (64-bit offset).

    ``brdf`` [1/sr] is float32 over the angles [degree] and, last, the wavelengths [nm]. ``specular_reflectance`` is the
    specular part. Units and names follow the CF conventions, attributes for discovery those of ACDD. The record is in
    the attributes. The values take 100 MB at most.

    Raises
    ------
    MissingExtraError
        If SciPy, which writes netCDF, is not installed.
    """
    from brdfdb.formats._dense_grid import dense_table

    import_extra("scipy.io")
    dense = dense_table(table, **options)
    with whole(path) as (half,):
        dataset(table, dense, verdict).to_netcdf(half, engine="scipy", format="NETCDF3_64BIT")
    return Written((path_of(path),), dense.error, dense.tolerance)


def recognises(head: bytes) -> bool:
    """Return True for the first bytes of a netCDF 3 file with a dimension of a grid, or one of samples."""
    return head.startswith(_MAGIC) and any(name in head for name in (b"theta_r", b"theta_h", b"\0\0\0\x06sample"))


def read(path: str | os.PathLike[str]) -> FileTable | ListedRows | Samples:
    """Return f_r of a netCDF file with ``brdf`` over angles [degree], interpolated linearly; or samples."""
    path = path_of(path)
    with opened_netcdf(path) as opened:
        return read_dataset(path, opened)


def write_samples(samples: Samples, path: str | os.PathLike[str]) -> None:
    """Write samples as netCDF, which `read` gives back; errors are those of `write`."""
    import_extra("scipy.io")
    with whole(path) as (half,):
        samples.to_xarray().to_netcdf(half, engine="scipy", format="NETCDF3_64BIT")
