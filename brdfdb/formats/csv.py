"""CSV: f_r on a plain grid of angles, one row for each pair of directions, one column for each wavelength.

The columns are the angles in degrees, then f_r in 1/sr, with five significant digits. Lines that begin with # hold the
record. The axes are polar angles and azimuths of light and viewer, or angles of the half and difference vectors
(``--axes``). The cosine is not included. Readers interpolate linearly along all axes at once.

A file can hold anisotropic tables and all wavelengths, but not the specular part. A file has about 40 MB at most: a
table that needs more is written with a larger error.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError
from brdfdb.formats import text
from brdfdb.formats._dense_files import OPTIONS, DenseOptions, dense_record, reading_of_rows
from brdfdb.formats._input import fault_of_row, lines_of
from brdfdb.formats._nodes import fill_values
from brdfdb.formats._record import lines, of_lines, specular_remark
from brdfdb.formats._written import Written, whole
from brdfdb.measurements.conventions import ListedRows
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.formats._readings import FileTable
    from brdfdb.tables.table import Table

suffix = ".csv"
angle_unit = "deg"
media_type = "text/csv"
summary = "f_r on a plain grid of angles as text"
tools = "every spreadsheet, pandas, R, MATLAB"
kinds = ()
options = OPTIONS
keywords = ("quantity", "angles", "wavelength_unit", "missing")
_DIGITS = 5
_LEAST_NM = 10.0  # of wavelengths in names without a unit
_ANGLE_BYTES, _VALUE_BYTES, _MOST_BYTES = 8, 10, 40_000_000  # of a number in a row, and of a file, about
_ANGLES = ("theta_i", "phi_i", "theta_r", "phi_r", "delta_phi", "theta_h", "phi_h", "theta_d", "phi_d")
_ENOUGH = {"theta_i", "theta_r"}  # angles by which a text of another program is recognised
_COLUMNS = "columns: angles [degree], then f_r [1/sr], one column a wavelength; the last angle changes fastest"


def write(
    table: Table, path: str | os.PathLike[str], *, verdict: str | None = None, **options: Unpack[DenseOptions]
) -> Written:
    """Write f_r on a plain grid of angles as text with commas.

    Lines that begin with # hold the record. The next line names the columns: the angles [degree], then ``brdf`` of a
    grey table, or wavelengths such as ``550nm``. f_r [1/sr] has five significant digits. The file has about 40 MB at
    most.
    """
    from brdfdb.formats._dense_grid import dense_table, rounded

    count = 1 if table.wavelength_nm is None else table.wavelength_nm.size
    row_bytes = _ANGLE_BYTES * (4 if table.anisotropic else 3) + _VALUE_BYTES * count
    most = _MOST_BYTES // row_bytes * count
    dense = dense_table(table, **options, most_values=most, digits=_DIGITS)
    known = dense_record(table, dense, verdict, specular=False)
    names = dense.channels.names if dense.channels.wavelength_nm is not None else ("brdf",)
    header = [*(f"# {line}" for line in (*lines(known), _COLUMNS)), ",".join((*dense.grid.names, *names))]
    columns = [[repr(float(node)) for node in nodes] for nodes in dense.grid.axes.values()]
    width = len(columns[-1])
    rows = dense.values.reshape(-1, width, len(names))
    with whole(path) as (half,), half.open("w", encoding="utf-8", newline="\n") as file:
        file.write("\n".join(header) + "\n")
        for leading, block in zip(itertools.product(*columns[:-1]), rows, strict=True):
            start = ",".join(leading)
            numbers = rounded(block, _DIGITS).tolist()
            file.writelines(
                f"{start},{last},{','.join(map(repr, row))}\n" for last, row in zip(columns[-1], numbers, strict=True)
            )
    return Written((path_of(path),), dense.error, dense.tolerance, specular_remark(table))


def recognises(head: bytes) -> bool:
    """Return True for the first bytes of a text whose columns are angles, then f_r or wavelengths, or that says so."""
    try:
        start = head.decode("utf-8", "ignore")
    except ValueError:
        return False
    first = [line for line in start.splitlines() if not line.startswith("#")][:1]
    names = [name.strip() for name in first[0].split(",")] if first else []
    of_values = tuple(itertools.dropwhile(_ANGLES.__contains__, names))
    alone = len(of_values) == 1 or (bool(of_values) and _wavelengths(of_values) is not None)
    return f"# {_COLUMNS}" in start or (alone and len(of_values) < len(names))


def read(path: str | os.PathLike[str], **stated: Any) -> FileTable | ListedRows:
    """Return f_r of a text, interpolated linearly if its rows are those of a grid; else the samples that it lists.

    A text without the line on columns that `write` puts into the record is read by `brdfdb.formats.text` if its columns
    are angles of light and viewer, with the keywords `stated`.
    """
    path = path_of(path)
    comments: list[str] = []
    numbered = lines_of(path)
    first = 0
    line = ""
    for number, line in numbered:
        if line.strip() and not line.startswith("#"):
            first = number
            break
        comments.append(line[1:].strip())
    names = tuple(name.strip() for name in line.split(","))
    if not line.strip() or line.startswith("#"):
        raise FileFormatError(f"{path}: it has no line with the names of columns")
    if _COLUMNS not in comments and set(names) >= _ENOUGH:
        return text.read(path, **stated)
    numbers = _numbers(path, first, names, numbered)
    angles = tuple(name for name in names if name in _ANGLES)
    if not angles or names[: len(angles)] != angles or len(names) == len(angles):
        raise FileFormatError(f"{path}: the columns {', '.join(names)[:200]} are not angles, then values of f_r")
    known = of_lines(comments)
    at = _wavelengths(names[len(angles) :])
    short = [name for name, nm in zip(names[len(angles) :], () if at is None else at, strict=False) if nm < _LEAST_NM]
    if bare := [name for name in short if not name.endswith("m")]:
        raise FileFormatError(f"{path}: line {first}: {bare[0]} is not a wavelength in nm; write it as 550nm or 0.55um")
    if at is not None and np.unique(at).size != at.size:
        raise FileFormatError(f"{path}: line {first}: a wavelength is listed twice")
    columns = {name: numbers[:, index] for index, name in enumerate(angles)}
    values = numbers[:, len(angles) :]
    if (missing := stated.get("missing")) is not None:
        values = np.where(fill_values(values, known, missing), np.nan, values)
    of_rows = bool(stated.get("angles") or stated.get("wavelength_unit"))
    reading = reading_of_rows(path, columns, values, at, known, stated=of_rows)
    if not of_rows and isinstance(reading, ListedRows) and _COLUMNS in comments and np.all(values >= 0.0):
        raise FileFormatError(f"{path}: rows of the grid are missing")
    return reading


def _numbers(
    path: Path, first: int, names: tuple[str, ...], numbered: Iterator[tuple[int, str]]
) -> NDArray[np.float64]:
    """Return the rows below the names of columns in line `first`, shape (N, columns)."""
    start = next(((number, line) for number, line in numbered if line.strip() and not line.startswith("#")), None)
    if start is None:
        raise FileFormatError(f"{path}: line {first} has the names of columns, but no row follows")
    rows = itertools.chain([start], numbered)
    try:
        numbers = np.loadtxt((line for _, line in rows), delimiter=",", ndmin=2, dtype=np.float64)
    except FileFormatError:
        raise
    except ValueError:
        for number, line in itertools.islice(lines_of(path), first, None):
            if fault := fault_of_row(line, names):
                raise FileFormatError(f"{path}: line {number}{fault}") from None
        raise FileFormatError(f"{path}: it is no table of numbers") from None
    if numbers.shape[1] != len(names):
        raise FileFormatError(
            f"{path}: line {start[0]} has {numbers.shape[1]} fields, but there are {len(names)} names of columns"
        )
    return numbers


def _wavelengths(names: tuple[str, ...]) -> NDArray[np.float64] | None:
    """Return the wavelengths [nm] that names give, 550nm or 0.55um; None if one gives none."""
    try:
        return np.array(
            [1e3 * float(name[:-2]) if name.endswith("um") else float(name.removesuffix("nm")) for name in names]
        )
    except ValueError:
        return None
