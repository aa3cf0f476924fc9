"""ASTM E1392: f_r at pairs of directions as rows of text, in the dialect of Cornell's measurements.

A row holds the polar angles and azimuths of light and viewer, in radians, and f_r in 1/sr at each wavelength. The rows
form a grid whose nodes are chosen for the tolerance. libbsdf interpolates linearly over each angle.

A file can hold anisotropic tables and all wavelengths, but not the specular part.
"""

from __future__ import annotations

import functools
import itertools
import math
import os
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError
from brdfdb.formats._angles import Spherical
from brdfdb.formats._angular_grid import SIZE, AngularGrid, Sink, chosen
from brdfdb.formats._input import lines_of
from brdfdb.formats._interface import TOLERANCE
from brdfdb.formats._nodes import samples_at_angles, without_holes
from brdfdb.formats._record import lines, of_lines, record, specular_remark
from brdfdb.formats._written import Written, whole
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.formats._readings import FileTable
    from brdfdb.formats._stated_error import FileError
    from brdfdb.measurements.samples import Samples
    from brdfdb.tables.table import Table

suffix = ".astm"
media_type = "text/plain"
summary = "ASTM E1392 in Cornell's dialect: rows of angles and f_r at all wavelengths"
tools = "libbsdf, ALTA"
kinds = ()
options = (
    TOLERANCE,
    SIZE,
)

_TITLE = b"ASTM E1392\n"
_ANGLES = ("theta_i", "phi_i", "theta_s", "phi_s")
_LONGEST_HEADER = 1000  # lines


def write(
    table: Table,
    path: str | os.PathLike[str],
    *,
    tolerance: float = 0.02,
    size: float = 16.0,
    verdict: str | None = None,
) -> Written:
    """Write a table as an ASTM E1392 file with the record in its header.

    After libbsdf's ``AstmReader.cpp``: polar angles and azimuths [rad] of light and viewer, then the channels. The rows
    form a grid, because libbsdf interpolates linearly over each angle and fills what is missing with the nearest row.
    Isotropic tables have the viewers of one side, from 0 to pi, and those at 2 pi, which libbsdf would look for.
    """
    from brdfdb.formats._stated_error import Comparison

    comparison = Comparison(table)
    remarks = specular_remark(table)
    names = comparison.channels.names if table.wavelength_nm is not None else ("BRDF",)

    def write_all(sink: Sink, grid: AngularGrid, error: FileError) -> None:
        document = record(table, error, verdict, remarks=remarks, tolerance=tolerance)
        sink.write(_TITLE + "".join(f"COMMENT {line}\n" for line in lines(document)).encode())
        _write_rows(sink, grid, names)

    system = Spherical(table.anisotropic, mirrored=not table.anisotropic)
    grid, error = chosen(comparison, [system], tolerance, size, write_all, as_text=True)
    with whole(path) as (file,), file.open("wb") as stream:
        write_all(stream, grid, error)
    return Written((path_of(path),), error, tolerance, remarks)


def recognises(head: bytes) -> bool:
    """Return True for the first bytes of an ASTM E1392 file in Cornell's dialect."""
    return head.startswith(_TITLE) or b"\nVARS theta_i,phi_i,theta_s,phi_s," in b"\n" + head


def read(path: str | os.PathLike[str]) -> FileTable | Samples:
    """Return f_r of an ASTM E1392 file as libbsdf sees it if its rows are a grid, else its rows.

    f_r is nan next to negative numbers, which libbsdf takes for 0.
    """
    from brdfdb.formats._readings import FileTable

    path = path_of(path)
    comments, names, rows = _parsed(path)
    document = of_lines(comments)
    at = _wavelengths(names)
    if at is None and len(names) == 1:
        names = ("grey",)
    name = str(document.get("name") or path.stem)
    nodes = tuple(np.unique(column) for column in rows[:, :4].T)
    count = math.prod(axis.size for axis in nodes)
    listed = functools.partial(samples_at_angles, rows[:, :4], rows[:, 4:], name, names, at, document)
    if count != len(rows) or (nodes[1].size == 1 and nodes[1][0] != 0.0) or np.any(np.isnan(rows[:, 4:])):
        return listed()
    order = np.lexsort(rows[:, 3::-1].T)
    shape = (*(axis.size for axis in nodes), len(names))
    values = without_holes(rows[order, 4:]).reshape(shape).astype(np.float32)
    anisotropic = nodes[1].size > 1
    one_side = not anisotropic and not np.any((nodes[3] > np.pi + 1e-6) & (nodes[3] < 2.0 * np.pi - 1e-6))
    if not anisotropic:
        nodes = (nodes[0], *nodes[2:])
        values = values[:, 0]
    if one_side:
        nodes, values = (*nodes[:2], nodes[2][nodes[2] < 4.0]), values[:, :, nodes[2] < 4.0]
    grid = AngularGrid(Spherical(anisotropic, one_side), nodes, values)
    return FileTable(name, names, at, grid.evaluate, document, listed, listed=True)


def _write_rows(stream: Sink, grid: AngularGrid, names: tuple[str, ...]) -> None:
    """Write the number of rows, the names of the columns, and the rows."""
    nodes = list(grid.nodes)
    values = grid.values
    if len(nodes) == 3:
        nodes = [nodes[0], np.zeros(1), nodes[1], np.append(nodes[2], 2.0 * np.pi)]
        values = np.concatenate([values, values[:, :, :1]], axis=2)[:, np.newaxis]
    stream.write(f"NUM_POINTS {values[..., 0].size}\nVARS {','.join((*_ANGLES, *names))}\n".encode())
    # libbsdf compares angles as 32 bit floats: nine digits are the same one, 2 pi among them
    texts = [[f"{angle:.9g}" for angle in axis] for axis in nodes]
    numbers = ",%.5g" * values.shape[-1] + "\n"
    for number_i, theta_i in enumerate(texts[0]):
        for number, phi_i in enumerate(texts[1]):
            rows = [f"{theta_i},{phi_i},{theta_s},{phi_s}{numbers}" for theta_s in texts[2] for phi_s in texts[3]]
            stream.write(("".join(rows) % tuple(values[number_i, number].reshape(-1).tolist())).encode())


def _parsed(path: Path) -> tuple[list[str], tuple[str, ...], NDArray[np.float64]]:
    """Return comments, the names of the channels, and the rows."""
    comments: list[str] = []
    columns: tuple[str, ...] = ()
    texts = (line for _, line in lines_of(path))
    for line in itertools.islice(texts, _LONGEST_HEADER):
        word, _, rest = line.strip().partition(" ")
        if word == "VARS":
            columns = tuple(text.strip() for text in rest.split(","))
            break
        comments.append(rest)
    if columns[:4] != _ANGLES or len(columns) < 5:
        raise FileFormatError(f"{path}: it has no line VARS {','.join(_ANGLES)} that ends with names of channels")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # an empty file
            rows = np.loadtxt(texts, delimiter=",", ndmin=2)
    except FileFormatError:
        raise
    except (ValueError, UserWarning) as error:
        raise FileFormatError(
            f"{path}: a row does not have {len(columns)} numbers, or there are no rows ({error})"
        ) from None
    if rows.shape[1] != len(columns) or not np.all(np.isfinite(rows)):
        raise FileFormatError(f"{path}: a row does not have {len(columns)} finite numbers")
    rows[:, :4] = np.where(rows[:, :4] < 0.0, rows[:, :4] + 2.0 * np.pi, rows[:, :4])
    return comments, columns[4:], rows


def _wavelengths(names: tuple[str, ...]) -> NDArray[np.float64] | None:
    """Return the wavelengths [nm] of channels such as 550nm; None if a channel is not a wavelength."""
    try:
        return np.array([float(name.removesuffix("nm")) for name in names]) if names[0].endswith("nm") else None
    except ValueError:
        return None
