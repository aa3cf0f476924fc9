"""FRED's tabulated scatter: f_r at angles of light and viewer as text.

The layout is that of files that laboratories publish for FRED. Each direction of the light has a block. Its first line
has two angles in degrees, and the lines below it have two angles and f_r in 1/sr for each viewer. The azimuth of a
viewer counts from the half plane of the mirror direction. FRED does not publish how it interpolates. This reader
interpolates linearly over each angle.

The file holds one wavelength (``--wavelength``) of an isotropic table. Anisotropic tables are refused. The specular
part is left out.
"""

from __future__ import annotations

import functools
import json
import math
import os
from array import array
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import CannotHoldError, FileFormatError, counted
from brdfdb.formats._angles import Spherical
from brdfdb.formats._angular_grid import SIZE, AngularGrid, Sink, chosen
from brdfdb.formats._channels import at_wavelength, names_of
from brdfdb.formats._input import lines_of
from brdfdb.formats._interface import TOLERANCE, WAVELENGTH
from brdfdb.formats._nodes import samples_at_angles, without_holes
from brdfdb.formats._record import beside, record, record_beside, specular_remark
from brdfdb.formats._written import Written, whole
from brdfdb.formats.text._rows import check_last_number, doubt_end, has_open_end
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.formats._readings import FileTable
    from brdfdb.formats._stated_error import FileError
    from brdfdb.measurements.samples import Samples
    from brdfdb.tables.table import Table

suffix = ".fred.txt"
media_type = "text/plain"
summary = "tabulated scatter of FRED, for isotropic tables at one wavelength"
tools = "FRED (Photon Engineering)"
kinds = ()
options = (
    TOLERANCE,
    WAVELENGTH,
    SIZE,
)

_TITLE = "type bsdf_data"
_FORMAT = "format angles=deg bsdf=value scale=1"


def write(
    table: Table,
    path: str | os.PathLike[str],
    *,
    tolerance: float = 0.02,
    wavelength: float = 550.0,
    size: float = 16.0,
    verdict: str | None = None,
) -> Written:
    """Write an isotropic table as tabulated scatter of FRED, and its record as JSON next to it.

    Anisotropic tables are refused: what the azimuth of the light counts from is not published.
    """
    from brdfdb.formats._stated_error import Comparison

    if table.anisotropic:
        raise CannotHoldError(
            f"{table.name}: the table is anisotropic, and only isotropic tables are written in this format"
        )
    comparison = Comparison(table, at_wavelength(table, wavelength))
    path = path_of(path)
    remarks = (*specular_remark(table), *comparison.channels.remarks)
    at = comparison.channels.wavelength_nm

    def text_beside(error: FileError, rows: int) -> bytes:
        document = record(table, error, verdict, remarks=remarks, tolerance=tolerance)
        document |= {"wavelength_nm": None if at is None else float(at[0]), "rows": rows}
        return json.dumps(document, indent=1).encode()

    def write_all(sink: Sink, grid: AngularGrid, error: FileError) -> None:
        sink.write(text_beside(error, _write_blocks(sink, grid)))

    system = Spherical(anisotropic=False, mirrored=True)
    grid, error = chosen(comparison, [system], tolerance, size, write_all, as_text=True)
    with whole(path, beside(path)) as (file, there):
        with file.open("wb") as stream:
            rows = _write_blocks(stream, grid)
        there.write_bytes(text_beside(error, rows))
    return Written((path, beside(path)), error, tolerance, remarks)


def recognises(head: bytes) -> bool:
    """Return True for the first bytes of tabulated scatter of FRED."""
    return head.lstrip().lower().startswith(_TITLE.encode())


def read(path: str | os.PathLike[str]) -> FileTable | Samples:
    """Return f_r of tabulated scatter: linear over each angle if all lights have one grid of viewers, else samples."""
    from brdfdb.formats._readings import FileTable

    path = path_of(path)
    rows = _rows(path)
    known = record_beside(path)
    if known.get("rows", len(rows)) != len(rows):
        raise FileFormatError(f"{path}: its record states {known['rows']!r:.20} viewers, but the file has {len(rows)}")
    name = str(known.get("name") or path.name.partition(".")[0])
    nm = known.get("wavelength_nm")
    at = np.array([float(nm)]) if isinstance(nm, int | float) else None
    channels = names_of(at)
    doubt_end(path, rows[:, :2], known)
    grid = _grid(rows)
    angles = np.deg2rad(rows[:, :4])
    angles[:, 3] = np.deg2rad((rows[:, 1] + 180.0 - rows[:, 3]) % 360.0)
    nodes = functools.partial(samples_at_angles, angles, rows[:, 4:], name, channels, at, known)
    return nodes() if grid is None else FileTable(name, channels, at, grid.evaluate, known, nodes, listed=True)


def _write_blocks(stream: Sink, grid: AngularGrid) -> int:
    """Write a block a polar angle of the light, and return the number of viewers in all blocks.

    Viewers are on both sides of the plane of incidence, the normal once.
    """
    theta_i, theta_r, delta_phi = (np.rad2deg(axis) for axis in grid.nodes)
    forward = 180.0 - delta_phi[::-1]
    half = np.arange(forward.size)[::-1]
    other = half[(forward > 0.0) & (forward < 180.0)][::-1]
    azimuths = np.concatenate([forward, 360.0 - forward[(forward > 0.0) & (forward < 180.0)][::-1]])
    columns = np.concatenate([half, other])
    stream.write(f"{_TITLE}\n{_FORMAT}\n".encode())
    count = 0
    for number, angle in enumerate(theta_i):
        stream.write(f"{angle:.9g}\t0\n".encode())
        for row, theta in enumerate(theta_r):
            values = grid.values[number, row, :, 0]
            viewers = [(0.0, columns[0])] if theta == 0.0 else list(zip(azimuths, columns, strict=True))
            count += len(viewers)
            rows = [f"{theta:.9g}\t{phi:.9g}\t{values[column]:.5g}\n" for phi, column in viewers]
            stream.write("".join(rows).encode())
    return count


def _rows(path: Path) -> NDArray[np.float64]:
    """Return rows of theta_i, phi_i, theta_r, phi_r [degree] and f_r [1/sr]."""
    lines = lines_of(path)
    first, second = (next(lines, (0, ""))[1].strip().lower() for _ in range(2))
    if first != _TITLE or "angles=deg" not in second or "bsdf=value" not in second:
        raise FileFormatError(f"{path}: line 1: it does not begin with the lines {_TITLE!r} and {_FORMAT!r}")
    numbers = array("d")
    light: list[float] | None = None
    bare = 0  # line of a light below which no viewer stands yet
    try:
        scale = float(second.partition("scale=")[2].split()[0])
    except (ValueError, IndexError):
        raise FileFormatError(f"{path}: line 2, field scale: it is not a number") from None
    for number, text in lines:
        try:
            line = [float(word) for word in text.split()]
        except ValueError as error:
            raise FileFormatError(f"{path}: line {number} has text that is not a number ({error})") from None
        if not np.all(np.isfinite(line)):
            raise FileFormatError(f"{path}: line {number} has a number that is not finite")
        if len(line) == 2:
            if bare:
                raise FileFormatError(f"{path}: line {bare} is a light without viewers")
            light = line
            bare = number
        elif len(line) == 3 and light is not None:
            numbers.extend([*light, *line[:2], scale * line[2]])
            bare = 0
        elif line:
            count = counted(len(line), "number")
            raise FileFormatError(
                f"{path}: line {number} has {count}; a light has two, and each viewer below it has three"
            )
    if not numbers:
        raise FileFormatError(f"{path}: it has no values")
    if bare:
        raise FileFormatError(f"{path}: line {bare} is a light without viewers: the file was cut")
    if has_open_end(path):
        words = ((number, text.split()) for number, text in lines_of(path) if number > 2)
        check_last_number(path, ((number, fields[2]) for number, fields in words if len(fields) == 3))
    return np.frombuffer(numbers, dtype=np.float64).reshape(-1, 5)


def _grid(rows: NDArray[np.float64]) -> AngularGrid | None:
    """Return the grid of rows; None if the rows form no grid, or the azimuth of the light varies."""
    one_side = rows[(rows[:, 2] == 0.0) | (rows[:, 3] <= 180.0)]
    if np.any(rows[:, 1] != 0.0):
        return None
    above = one_side[one_side[:, 2] > 0.0]
    theta_i, theta_r, forward = (np.unique(column) for column in above[:, [0, 2, 3]].T)
    at_normal = one_side[one_side[:, 2] == 0.0]
    count = math.prod(axis.size for axis in (theta_i, theta_r, forward))
    if len(above) != count or (len(at_normal) and not np.array_equal(np.unique(at_normal[:, 0]), theta_i)):
        return None
    order = np.lexsort(above[:, [3, 2, 0]].T)
    values = above[order, 4].reshape(theta_i.size, theta_r.size, forward.size)
    if len(at_normal):
        if len(at_normal) != theta_i.size:
            return None
        straight = at_normal[np.argsort(at_normal[:, 0]), 4]
        values = np.concatenate([np.broadcast_to(straight[:, None, None], (theta_i.size, 1, forward.size)), values], 1)
        theta_r = np.append(0.0, theta_r)
    nodes = (theta_i, theta_r, 180.0 - forward[::-1])
    system = Spherical(anisotropic=False, mirrored=True)
    kept = without_holes(values[..., ::-1, np.newaxis]).astype(np.float32)
    return AngularGrid(system, tuple(np.deg2rad(axis) for axis in nodes), kept)
