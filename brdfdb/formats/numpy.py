"""NumPy: f_r on a plain grid of angles as an .npz archive of arrays.

The axes are polar angles and azimuths of light and viewer, or angles of the half and difference vectors (``--axes``).
f_r is in 1/sr, without the cosine. Readers interpolate linearly along all axes at once.

A file can hold anisotropic tables, all wavelengths and the specular part. The specular part is a separate array. The
values take 100 MB at most: a table that needs more is written with a larger error.
"""

from __future__ import annotations

import io
import json
import os
import zipfile
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError
from brdfdb.formats._dense_files import OPTIONS, DenseOptions, dense_record, file_table
from brdfdb.formats._record import document_of, specular_remark
from brdfdb.formats._written import Written, whole
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.formats._readings import FileTable
    from brdfdb.measurements.conventions import ListedRows
    from brdfdb.tables.table import Table

suffix = ".npz"
angle_unit = "deg"
media_type = "application/x-npz"
summary = "f_r on a plain grid of angles as NumPy arrays"
tools = "NumPy"
kinds = ()
options = OPTIONS
_MOST_BYTES, _MOST_OTHER = 1 << 29, 1 << 24  # of the values that are read, and of any other array


def write(
    table: Table, path: str | os.PathLike[str], *, verdict: str | None = None, **options: Unpack[DenseOptions]
) -> Written:
    """Write f_r on a plain grid of angles as an .npz archive.

    ``axes`` lists the dimensions of ``brdf`` [1/sr, float32]. Each of them is an array: angles in degrees,
    ``wavelength`` in nm. ``specular_reflectance`` over ``specular_theta_i`` is the specular part. ``record`` is JSON
    text. No array is pickled. The values take 100 MB at most.
    """
    from brdfdb.formats._dense_grid import dense_table

    dense = dense_table(table, **options)
    at = dense.channels.wavelength_nm
    arrays: dict[str, NDArray[Any]] = dict(dense.grid.axes)
    if at is not None:
        arrays["wavelength"] = at
    known = dense_record(table, dense, verdict, specular=True)
    arrays |= {"axes": np.array(list(arrays)), "record": np.array(json.dumps(known, ensure_ascii=False))}
    if specular_remark(table) and table.specular is not None:
        nodes = table.axes_deg["theta_i"] if table.specular_theta_deg is None else table.specular_theta_deg
        arrays |= {"specular_theta_i": nodes, "specular_reflectance": table.specular}
    arrays["brdf"] = dense.values[..., 0] if at is None else dense.values
    with whole(path) as (half,), half.open("wb") as file:
        np.savez(file, allow_pickle=False, **arrays)
    return Written((path_of(path),), dense.error, dense.tolerance)


def recognises(head: bytes) -> bool:
    """Return True for the first bytes of an archive whose first array is an axis of a grid."""
    return head.startswith(b"PK\x03\x04") and head[30:].startswith((b"theta_i.npy", b"theta_h.npy"))


def read(path: str | os.PathLike[str]) -> FileTable | ListedRows:
    """Return f_r of an .npz archive with ``brdf`` and the axes that it lists, interpolated linearly.

    A grid with holes, nan, gives rows. The values take 512 MiB at most.
    """
    path = path_of(path)
    try:
        with zipfile.ZipFile(path) as archive:
            names = [str(name) for name in _array(archive, "axes", _MOST_OTHER)]
            arrays = {name: _array(archive, name, _MOST_OTHER) for name in names}
            has_record = "record.npy" in archive.namelist()
            known = document_of(str(_array(archive, "record", _MOST_OTHER))) if has_record else {}
            values = _array(archive, "brdf", _MOST_BYTES)
    except OSError:
        raise
    except Exception as error:  # zipfile, zlib and the parser of headers raise what they come to
        raise FileFormatError(f"{path}: it is not an archive of NumPy arrays, or is damaged ({error})") from error
    at = arrays.pop("wavelength", None)
    return file_table(path, arrays, values, at, known)


def _array(archive: zipfile.ZipFile, name: str, most: int) -> NDArray[Any]:
    """Return an array of an archive; its header says no more than the archive holds."""
    member = archive.getinfo(f"{name}.npy")
    if member.file_size > most:
        raise ValueError(f"{name} has {member.file_size} bytes")
    content = archive.read(member)
    data = io.BytesIO(content)
    header = np.lib.format.read_magic(data)
    parse = np.lib.format.read_array_header_1_0 if header == (1, 0) else np.lib.format.read_array_header_2_0
    shape, by_columns, dtype = parse(data)
    size = member.file_size - data.tell()
    if dtype.hasobject or int(np.prod(shape, dtype=object)) * dtype.itemsize != size:
        raise ValueError(f"{name} says {dtype} of shape {shape} and has {size} bytes")
    values = np.frombuffer(content, dtype, offset=data.tell()) if size else np.empty(0, dtype)
    return values.reshape(shape, order="F" if by_columns else "C")
