"""UTIA: tables in three colours on the fixed anisotropic grid of the UTIA BRDF database (Filip and Vavra 2014).

The grid has steps of 15 degrees in the polar angles of light and viewer, and of 7.5 degrees in their azimuths. A number
is f_r in 1/sr, or a code of it (``--encoding``). Readers interpolate linearly over the four angles. The grid is fixed.
It is too coarse for glossy surfaces, and the stated error says so.

A file can hold anisotropic tables. Spectral tables become linear sRGB. The specular part is left out.
"""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING

import numpy as np

from brdfdb.errors import FileFormatError
from brdfdb.formats._angles import Spherical
from brdfdb.formats._angular_grid import AngularGrid, filled
from brdfdb.formats._channels import RGB, channels_of
from brdfdb.formats._input import encoding_of
from brdfdb.formats._interface import FIXED, FormatOption
from brdfdb.formats._nodes import rows_of_grid, without_holes
from brdfdb.formats._planes import read_planes
from brdfdb.formats._record import beside, note, record, record_beside, specular_remark
from brdfdb.formats._written import Written, whole
from brdfdb.parameters import Floats
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.formats._readings import FileTable
    from brdfdb.measurements.conventions import ListedRows
    from brdfdb.tables.table import Table

suffix = ".bin"
media_type = "application/octet-stream"
summary = "RGB on the fixed UTIA grid of 15 by 7.5 degrees, also for anisotropic tables"
tools = "readers of UTIA, ALTA"
kinds = ()
options = (
    FIXED,
    FormatOption(
        "encoding",
        "linear",
        "numbers are f_r, as UTIA's own reader and ALTA give them back (linear), or 140 times the sRGB curve of f_r / "
        "100, as dj_brdf decodes them (dj_brdf)",
        choices=("linear", "dj_brdf"),
    ),
)

SHAPE = (6, 48, 6, 48)  # theta_i, phi_i, theta_v, phi_v
STEPS_DEG = (15.0, 7.5, 15.0, 7.5)
_BYTES = 3 * 8 * SHAPE[0] * SHAPE[1] * SHAPE[2] * SHAPE[3]
_SYSTEM = Spherical(anisotropic=True, mirrored=False)
_NODES = tuple(np.deg2rad(step * np.arange(count + count // 48)) for step, count in zip(STEPS_DEG, SHAPE, strict=True))
_LINEAR = "f_r [1/sr], the BRDF without the cosine, linear sRGB, no scale: as UTIA's own reader gives it back"
_DJ = "140 * s, where s is the sRGB curve of f_r [1/sr] / 100: as dj_brdf decodes it"
_LIKELY = (1e-25, 1e5)  # text, read as such numbers, has smaller and larger ones


def write(
    table: Table,
    path: str | os.PathLike[str],
    *,
    tolerance: float = 0.02,
    encoding: str = "linear",
    verdict: str | None = None,
) -> Written:
    """Write a table as a UTIA file, with its record as JSON next to it.

    Three planes (R, G, B) of 64 bit floats: 6 polar angles of the light in steps of 15 degrees, 48 azimuths in steps of
    7.5, then those of the viewer. UTIA's own reader (``TBDRF.cpp`` of J. Filip) interpolates linearly over the four
    angles and continues the last interval of a polar angle to 90 degrees; it neither scales nor decodes. dj_brdf takes
    the same lines, divides by 140 and decodes an sRGB curve.
    """
    from brdfdb.formats._stated_error import Comparison

    channels = channels_of(table, "rgb")
    comparison = Comparison(table, channels)
    grid = filled(comparison, _SYSTEM, _NODES)
    numbers = _encoded(np.maximum(grid.values.astype(np.float64), 0.0), encoding)
    error = comparison.error_of(UtiaReader(numbers, encoding))
    remarks = (*channels.remarks, *specular_remark(table))
    holds = _LINEAR if encoding == "linear" else _DJ
    document = record(table, error, verdict, holds=holds, remarks=remarks, tolerance=tolerance)
    paths = path_of(path), beside(path_of(path))
    with whole(*paths) as (file, beside_it):
        file.write_bytes(np.moveaxis(numbers[:, :-1, :, :-1], -1, 0).astype("<f8").tobytes())
        beside_it.write_text(json.dumps(document | {"encoding": encoding}, indent=1) + "\n", encoding="utf-8")
    return Written(paths, error, tolerance, remarks)


def recognises(head: bytes) -> bool:
    """Return True for the first bytes of a UTIA file, which has no header: all of them are likely values of f_r."""
    return encoding_of(head) is None and (_are_likely(head, "<f8") or _are_likely(head, ">f8"))


def _are_likely(head: bytes, kind: str) -> bool:
    """Return True if all numbers of a type in some bytes are likely values of f_r, or nan."""
    numbers = np.frombuffer(head[: len(head) // 8 * 8], kind)
    if numbers.size < 512:
        return False
    with np.errstate(invalid="ignore"):
        size = np.abs(numbers)
        likely = (size > _LIKELY[0]) & (size < _LIKELY[1])
        return bool(np.any(likely) and np.all(likely | (numbers == 0.0) | np.isnan(numbers)))


def read(path: str | os.PathLike[str]) -> FileTable:
    """Return f_r of a UTIA file as UTIA's own reader sees it, or dj_brdf if its record says so.

    A negative number, or nan, is a hole. Big-endian and interleaved files are recognised, and a note of the record says
    so.
    """
    from brdfdb.formats._readings import FileTable

    path = path_of(path)
    size = path.stat().st_size
    if size != _BYTES:
        text = "; 32-bit floats are not read" if 2 * size == _BYTES else ""
        raise FileFormatError(f"{path}: it has {size} bytes; a UTIA file has {_BYTES}{text}")
    content = read_planes(path, 0, SHAPE)
    planes = content.numbers
    known = record_beside(path)
    for sentence in content.notes:
        note(known, sentence)
    numbers = np.pad(np.moveaxis(planes, 0, -1), [(0, 0), (0, 1), (0, 0), (0, 1), (0, 0)], mode="wrap")
    encoding = "dj_brdf" if known.get("encoding") == "dj_brdf" else "linear"
    name = str(known.get("name") or path.stem)

    def rows() -> ListedRows:
        axes = [np.deg2rad(step * np.arange(count)) for step, count in zip(STEPS_DEG, SHAPE, strict=True)]
        return rows_of_grid(_SYSTEM, axes, _decoded(np.moveaxis(planes, 0, -1), encoding), name, RGB, None, known)

    return FileTable(name, RGB, None, UtiaReader(without_holes(numbers), encoding), known, rows, listed=True)


def _encoded(f_r: Floats, encoding: str) -> Floats:
    """Return the numbers of a file for f_r [1/sr]."""
    if encoding == "linear":
        return f_r
    part = f_r / 100.0
    # dj_brdf decodes numbers up to 0.0375 by the straight part of the curve
    curve = np.where(part > 0.0375 / 12.92, 1.055 * part ** (1.0 / 2.4) - 0.055, 12.92 * part)
    return np.asarray(140.0 * curve)


def _decoded(numbers: Floats, encoding: str) -> Floats:
    """Return f_r [1/sr] of interpolated numbers."""
    if encoding == "linear":
        return numbers
    part = numbers / 140.0
    curve = np.where(part > 0.0375, ((np.maximum(part, 0.0) + 0.055) / 1.055) ** 2.4, part / 12.92)
    return np.asarray(np.maximum(100.0 * curve, 0.0))


class UtiaReader:
    """f_r [1/sr], shape (N, 3), at unit vectors (N, 3), of numbers on the grid with the first azimuths repeated."""

    def __init__(self, numbers: Floats, encoding: str) -> None:
        self._grid = AngularGrid(_SYSTEM, _NODES, numbers.astype(np.float32))
        self._encoding = encoding

    def __call__(self, wi: Floats, wr: Floats) -> Floats:
        return _decoded(self._grid.evaluate(wi, wr), self._encoding)
