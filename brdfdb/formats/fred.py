"""FRED's tabulated scatter: f_r at angles of light and viewer as text.

The layout is that of files that laboratories publish for FRED. Each direction of the light has a block. Its first line
has two angles in degrees, and the lines below it have two angles and f_r in 1/sr for each viewer. Azimuths are those on
the sample, counter-clockwise from above; that of the light is the one into which it travels, so that the mirror
direction has the azimuth of the light. FRED does not publish how it interpolates. This reader interpolates linearly
over each angle.

The file holds one wavelength (``--wavelength``) of an isotropic table. Anisotropic tables are refused. The specular
part is left out.
"""

from __future__ import annotations

import itertools
import json
import math
import os
import re
from array import array
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import CannotHoldError, FileFormatError, counted
from brdfdb.formats._angles import Spherical
from brdfdb.formats._angular_grid import SIZE, AngularGrid, Sink, chosen
from brdfdb.formats._channels import at_wavelength, names_of
from brdfdb.formats._doubts import check_last_number, doubt_comments, doubt_rows
from brdfdb.formats._input import lines_of, plain_number
from brdfdb.formats._interface import TOLERANCE, WAVELENGTH
from brdfdb.formats._nodes import without_holes
from brdfdb.formats._record import beside, note, of_comments, record, record_beside, specular_remark
from brdfdb.formats._written import Written, whole
from brdfdb.measurements.conventions import ANGLE_UNITS, ListedRows
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.formats._readings import FileTable
    from brdfdb.formats._stated_error import FileError
    from brdfdb.tables.table import Table

suffix = ".fred.txt"
angle_unit = "deg"
keywords = ("angles",)
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
signs = re.compile(rb"bsdf_data|^format\b.*\b(?:angles|bsdf|scale)=", re.MULTILINE | re.IGNORECASE)
_UNITS = {"deg": 1.0, "degree": 1.0, "degrees": 1.0, "rad": 180.0 / math.pi, "radians": 180.0 / math.pi}  # in degrees
_FORMAT = "format angles=deg bsdf=value scale=1"
_SPLIT = "write a file for each header"
_COMMENTS = ("#", "!", "//", "%")  # first signs of lines that FRED does not define
_HEADER = 100  # lines in which comments may name the wavelength
_ROUNDING_DEG = 1e-3
_MIRRORED = 1e-4  # relative difference of values on both sides of the plane of incidence that are the same
_LOBE = 0.7  # cosine of an azimuth from that of a lobe
_CONTRAST = 3.0  # of the brightest viewer to the median, in a lobe


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


def read(path: str | os.PathLike[str], *, angles: str = "") -> FileTable | ListedRows:
    """Return f_r of tabulated scatter: linear over each angle if all lights have one grid of viewers, else rows.

    A unit of angles that the user states is not doubted.
    """
    from brdfdb.formats._readings import FileTable

    path = path_of(path)
    content = _rows(path)
    rows = content.rows
    known = record_beside(path)
    if known.get("rows", len(rows)) != len(rows):
        raise FileFormatError(f"{path}: its record states {known['rows']!r:.20} viewers, but the file has {len(rows)}")
    name = str(known.get("name") or path.name.partition(".")[0])
    nm = known.get("wavelength_nm")
    at = np.array([float(nm)]) if isinstance(nm, int | float) else None
    comments = [line for _, line in itertools.islice(lines_of(path), _HEADER) if line.lstrip().startswith(_COMMENTS)]
    doubt_comments(comments, known)
    _, length = of_comments({"comments": "\n".join(comments)})
    if at is None and length is not None:
        at = np.array([length])
        note(known, f"The wavelength {length:g} nm was read from the comments of the file.")
    channels = names_of(at)
    _doubt(path, rows, known)
    polar_deg, turn_deg = (float(np.abs(rows[:, column : column + 3 : 2]).max()) for column in (0, 1))
    in_range = polar_deg <= 0.5 * np.pi + _ROUNDING_DEG and 0.3 < turn_deg <= 2.0 * np.pi + _ROUNDING_DEG
    if content.unit == 1.0 and in_range and not set(angles.split(",")) & set(ANGLE_UNITS):
        text = f"Line {content.line} says angles=deg, but no polar angle exceeds {polar_deg:.3g}"
        note(known, f"Angles? {text}, and no azimuth {turn_deg:.3g}: if they are radians, state --angles rad.")
    listed = ListedRows(
        np.deg2rad(rows[:, :4]),
        rows[:, 4:],
        name,
        channels,
        at,
        {**known, "angles": "radians"} if content.unit != 1.0 else known,
        angle_unit="" if content.unit == 1.0 else "rad",
        scale=content.scale,
        azimuth="forward",
        wrong_angle=lambda row, column: f"{path}: {content.wrong_angle(row, column)}",
    )
    polar = rows[:, [0, 2]]
    grid = _grid(rows) if np.all((polar >= 0.0) & (polar <= 180.0 + _ROUNDING_DEG)) else None
    if grid is None:
        return listed
    return FileTable(name, channels, at, grid.evaluate, known, lambda: listed, listed=True)


def _doubt(path: Path, rows: NDArray[np.float64], known: dict[str, Any]) -> None:
    """Note that a file may have been cut, or that its azimuths may count from the mirror direction."""
    doubt_rows(path, rows[:, :4], rows[:, 4:], known)
    starts = np.flatnonzero(np.any(np.diff(rows[:, :2], axis=0, prepend=np.nan) != 0.0, axis=1))
    ends = np.append(starts, len(rows))[1:]
    turned = np.flatnonzero(rows[starts, 1] % 360.0 != 0.0)
    if not len(turned):
        return
    note(known, "Azimuths are those on the sample: the mirror direction has the azimuth in the line of the light.")
    errors = []  # of the azimuth of the brightest viewer of each light, from the mirror direction by either rule
    for block in turned:
        part = rows[starts[block] : ends[block]]
        brightest = part[np.argmax(np.where(part[:, 2] > 0.0, part[:, 4], -np.inf))]
        errors.append([np.cos(np.deg2rad(brightest[3] - azimuth)) for azimuth in (brightest[1], 0.0)])
    on_sample, of_mirror = np.mean(errors, axis=0)
    if of_mirror > _LOBE > on_sample and part[:, 4].max() > _CONTRAST * np.median(part[:, 4]):
        text = "The lobes are at an azimuth of 0 instead: if azimuths count from the mirror direction, state"
        note(known, f"Azimuths? {text} --azimuth mirror.")


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


class FredRows(NamedTuple):
    """Rows (N, 5) of theta_i, phi_i, theta_r, phi_r [degree] and f_r [1/sr], and the lines of their lights and theirs.

    `unit` [degree] is that of the angles of the file, `scale` that of its values, and `line` states both.
    """

    rows: NDArray[np.float64]
    unit: float
    scale: float
    line: int
    lines: list[tuple[int, int]]

    def wrong_angle(self, row: int, column: int) -> str:
        """Return what is wrong with an angle of a row: theta_i, phi_i, theta_r or phi_r by its column from 0."""
        name, kind, allowed = ("phi", "azimuth", "-720 to 720") if column % 2 else ("theta", "polar angle", "0 to 180")
        text = f"{self.rows[row, column] / self.unit:g} is no {kind} in the unit of line {self.line}"
        return f"line {self.lines[row][column // 2]}, field {name}: {text}; allowed are {allowed} degrees"


def _rows(path: Path) -> FredRows:
    """Return the rows of a file; FileFormatError if a line is damaged, or it was cut or joined."""
    lines = _without_comments(path)
    (_, first), (at, second) = (next(lines, (1, "")) for _ in range(2))
    if " ".join(first.lower().split()) != _TITLE or not second.lower().startswith("format"):
        raise FileFormatError(f"{path}: line 1: it does not begin with the lines {_TITLE!r} and {_FORMAT!r}")
    unit, scale = _format(path, at, second)
    numbers = array("d")
    light: list[float] | None = None
    bare = of_light = 0  # line of a light below which no viewer stands yet, and of the last light
    lines_of_rows: list[tuple[int, int]] = []
    for number, text in lines:
        words = text.split()
        if words[0].lower() in ("type", "format"):
            raise FileFormatError(f"{path}: line {number}: a second header, {text.strip()[:60]!r}; {_SPLIT}")
        try:
            line = [plain_number(word) for word in words]
        except ValueError as error:
            raise FileFormatError(f"{path}: line {number} has text that is not a number ({error})") from None
        if not np.all(np.isfinite(line)):
            raise FileFormatError(f"{path}: line {number} has a number that is not finite")
        angles = [unit * angle for angle in line[:2]]
        if len(line) == 2:
            if bare:
                raise FileFormatError(f"{path}: line {bare} is a light without viewers")
            light = angles
            bare = of_light = number
        elif len(line) == 3 and light is not None:
            numbers.extend([*light, *angles, scale * line[2]])
            lines_of_rows.append((of_light, number))
            bare = 0
        else:
            count = counted(len(line), "number")
            raise FileFormatError(
                f"{path}: line {number} has {count}; a light has two, and each viewer below it has three"
            )
    if not numbers:
        raise FileFormatError(f"{path}: it has no values")
    if bare:
        raise FileFormatError(f"{path}: line {bare} is a light without viewers: the file was cut")
    below = ((number, text.split()) for number, text in _without_comments(path) if number > at)
    check_last_number(path, ((number, fields[2]) for number, fields in below if len(fields) == 3))
    return FredRows(np.frombuffer(numbers, dtype=np.float64).reshape(-1, 5), unit, scale, at, lines_of_rows)


def _without_comments(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the lines of a text with their numbers, without empty lines and comments."""
    return (
        (number, line) for number, line in lines_of(path) if line.strip() and not line.lstrip().startswith(_COMMENTS)
    )


def _format(path: Path, number: int, line: str) -> tuple[float, float]:
    """Return the unit of angles [degree] and the scale of the values in the second line of a file."""
    where = f"{path}: line {number}, field"
    entries = dict(word.lower().partition("=")[::2] for word in re.sub(r"\s*=\s*", "=", line).split()[1:])
    for name, allowed in (("angles", ("deg", "rad")), ("bsdf", ("value",))):
        if entries.get(name) not in (*allowed, *(_UNITS if name == "angles" else ())):
            text = f"{entries[name]!r:.40} is not known" if name in entries else "it is missing"
            raise FileFormatError(f"{where} {name}: {text}; allowed is {name}={' or '.join(allowed)}")
    if unknown := sorted(set(entries) - {"angles", "bsdf", "scale"}):
        raise FileFormatError(f"{where} {unknown[0]:.40}: it is not known; known are angles, bsdf and scale")
    try:
        scale = plain_number(entries["scale"])
    except (ValueError, KeyError):
        raise FileFormatError(f"{where} scale: it is not a number") from None
    if not 0.0 < scale < math.inf:
        raise FileFormatError(f"{where} scale: {scale:g} is not a positive number")
    return _UNITS[entries["angles"]], scale


def _grid(rows: NDArray[np.float64]) -> AngularGrid | None:
    """Return the grid of rows; None if they form no grid, the light turns, or the sides of the plane differ."""
    one_side = rows[(rows[:, 2] == 0.0) | (rows[:, 3] <= 180.0)]
    turn = rows[:, 3] % 360.0
    places = np.column_stack([rows[:, 0], rows[:, 2], np.where(rows[:, 2] > 0.0, np.minimum(turn, 360.0 - turn), 0.0)])
    pairs = np.unique(places, axis=0, return_inverse=True)[1].reshape(-1)
    first = np.zeros(len(rows))
    first[pairs] = rows[:, 4]
    if np.any(rows[:, 1] != 0.0) or not np.allclose(first[pairs], rows[:, 4], rtol=_MIRRORED, atol=0.0):
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
