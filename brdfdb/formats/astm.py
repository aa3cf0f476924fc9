"""ASTM E1392: f_r at pairs of directions as rows of text, in the dialect of Cornell's measurements.

A row holds the polar angles and azimuths of light and viewer, in radians, and f_r in 1/sr at each wavelength. The rows
form a grid whose nodes are chosen for the tolerance. libbsdf interpolates linearly over each angle.

A file can hold anisotropic tables and all wavelengths, but not the specular part.
"""

from __future__ import annotations

import itertools
import math
import os
import re
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError
from brdfdb.formats._angles import Spherical
from brdfdb.formats._angular_grid import SIZE, AngularGrid, Sink, chosen
from brdfdb.formats._channels import names_of
from brdfdb.formats._doubts import check_last_number, doubt_comments, doubt_rows
from brdfdb.formats._input import fault_of_row, lines_of
from brdfdb.formats._interface import TOLERANCE
from brdfdb.formats._nodes import fill_values, opposite, without_holes, wrong_radians
from brdfdb.formats._record import lines, note, of_lines, record, specular_remark
from brdfdb.formats._written import Written, whole
from brdfdb.formats.text._columns import role_of, value_name, wavelength_of
from brdfdb.measurements.conventions import LOGARITHMS, QUANTITIES, ListedRows, f_r_of
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.formats._readings import FileTable
    from brdfdb.formats._stated_error import FileError
    from brdfdb.tables.table import Table

suffix = ".astm"
angle_unit = "rad"
keywords = ("quantity",)
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
_VARS = re.compile(rb"^VARS[ \t]+theta_i[ \t]*,", re.MULTILINE | re.IGNORECASE)
signs = re.compile(rb"^(?:NUM_POINTS|VARS)\b|ASTM E1392", re.MULTILINE)
_LONGEST_HEADER = 1000  # lines
_DEGREES = re.compile(r"\bdeg(?:rees?)?\b", re.IGNORECASE)
_SPLIT = "write a file for each header"


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
    return head.startswith(_TITLE) or bool(_VARS.search(head))


def read(path: str | os.PathLike[str], *, quantity: str = "") -> FileTable | ListedRows:
    """Return f_r of an ASTM E1392 file as libbsdf sees it if its rows are a grid, else its rows.

    f_r is nan next to negative numbers, which libbsdf takes for 0. A quantity that the user states is not looked for in
    names.
    """
    from brdfdb.formats._readings import FileTable

    path = path_of(path)
    content = _parsed(path)
    document = of_lines(content.comments)
    names, at = _channels(path, content, document, quantity)
    rows = np.hstack([opposite(content.rows[:, :4]), content.rows[:, 4:]])
    name = str(document.get("name") or path.stem)
    nodes = tuple(np.unique(column) for column in rows[:, :4].T)
    count = math.prod(axis.size for axis in nodes)
    titles = [text for text in content.comments if _DEGREES.search(text) and "program" not in document]
    if titles:
        note(document, f"Degrees? A line says {titles[0].strip()[:80]!r}; angles were read as radians; --angles deg?")
    if "program" not in document:
        doubt_comments(content.comments, document)
    doubt_rows(path, np.rad2deg(rows[:, :4]), rows[:, 4:], document)

    def wrong_angle(row: int, column: int) -> str:
        where = f"{path}: line {_line_of_row(path, content, row)}, field {_ANGLES[column]}"
        return f"{where}: {wrong_radians(rows[row, column], column)}"

    listed = ListedRows(
        content.rows[:, :4],
        rows[:, 4:],
        name,
        names,
        at,
        document,
        quantity=str(document.get("quantity", "f_r")),
        signed=True,
        wrong_angle=wrong_angle,
    )
    irregular = count != len(rows) or (nodes[1].size == 1 and nodes[1][0] != 0.0) or np.any(np.isnan(rows[:, 4:]))
    if irregular or max(nodes[0][-1], nodes[2][-1]) > np.pi or abs(nodes[3]).max() > 4.0 * np.pi:
        return listed
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
    return FileTable(name, names, at, grid.evaluate, document, lambda: listed, listed=True)


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


class AstmRows(NamedTuple):
    """Content of a file: comments, the line of VARS, the names of the channels, and rows (N, 4 + C)."""

    comments: list[str]
    line: int
    names: tuple[str, ...]
    rows: NDArray[np.float64]


def _parsed(path: Path) -> AstmRows:
    """Return the content of a file; FileFormatError if a row is damaged, or the count of rows is not the stated one."""
    comments: list[str] = []
    columns: tuple[str, ...] = ()
    stated: tuple[int, str] | None = None
    numbered = lines_of(path)
    first = 0
    for number, line in itertools.islice(numbered, _LONGEST_HEADER):
        word, rest = (*line.split(None, 1), "", "")[:2]
        if word.upper() == "VARS":
            columns = tuple(text.strip() for text in rest.split(","))
            columns = (*(text.lower() for text in columns[:4]), *columns[4:])
            first = number
            break
        if word.upper() == "NUM_POINTS":
            if stated is not None:
                raise FileFormatError(f"{path}: line {number}, field NUM_POINTS: it is stated twice; {_SPLIT}")
            stated = number, rest.strip()
        comments.append(rest.rstrip("\n"))
    if columns[:4] != _ANGLES or len(columns) < 5 or not all(columns):
        shown = ", ".join(columns)[:200]
        found = f"line {first}, field VARS: its columns are {shown}" if first else "it has no line VARS"
        wanted = f"VARS {','.join(_ANGLES)},550nm"
        raise FileFormatError(f"{path}: {found}; {wanted} with the channels of the file must stand before the rows")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # no rows
            rows = np.loadtxt((line for _, line in numbered), delimiter=",", ndmin=2)
    except FileFormatError:
        raise
    except (ValueError, UserWarning):
        rows = np.empty((0, 0))
    if rows.shape[1] != len(columns) or np.any(np.isinf(rows)) or np.any(np.isnan(rows[:, :4])):
        raise FileFormatError(f"{path}: {_wrong_row(path, first, columns)}")
    check_last_number(path, ((n, line.rpartition(",")[2]) for n, line in lines_of(path) if n > first))
    if stated is not None and (not stated[1].isdecimal() or int(stated[1]) != len(rows)):
        text = f"{stated[1]:.40} rows are stated, but the file has {len(rows)}; it was cut, or joined of several files"
        raise FileFormatError(
            f"{path}: line {stated[0]}, field NUM_POINTS: {text}: get the whole file, or correct the count"
        )
    return AstmRows(comments, first, columns[4:], rows)


def _line_of_row(path: Path, content: AstmRows, row: int) -> int:
    """Return the number of the line that has a row, whose number counts from 0."""
    rows = (number for number, line in lines_of(path) if number > content.line and line.partition("#")[0].strip())
    return next(itertools.islice(rows, row, None))


def _wrong_row(path: Path, first: int, columns: tuple[str, ...]) -> str:
    """Return what is wrong with the first row below line `first` that cannot be read."""
    for number, line in itertools.islice(lines_of(path), first, None):
        if line.split(None, 1)[:1] and line.split()[0].upper() in ("VARS", "NUM_POINTS", "TITLE", "ASTM", "COMMENT"):
            return f"line {number}: a second header, {line.strip()[:40]!r}, stands between the rows; {_SPLIT}"
        if fault := fault_of_row(line, columns):
            return f"line {number}{fault}"
    return f"line {first}: no rows follow the line VARS"


def _channels(
    path: Path, content: AstmRows, document: dict[str, Any], quantity: str
) -> tuple[tuple[str, ...], NDArray[np.float64] | None]:
    """Return names and wavelengths [nm] of the channels, whose columns are sorted and made f_r [1/sr] in place."""
    names = content.names
    where = f"{path}: line {content.line}, field VARS"
    if len(names) == 1 and not role_of(names[0]):
        note(document, f"The name {names[0]!r} of the channel is not known: its numbers were read as f_r.")
    allowed = "wavelengths such as 550nm or 0.55um, R,G,B, X,Y,Z, or BRDF alone"
    for name in names:
        if role_of(name) not in ("values", "") or (len(names) > 1 and role_of(name) == "" and not _of_colours(names)):
            raise FileFormatError(f"{where}: {name!r} is not the name of a channel; allowed are {allowed}")
    if not quantity:
        quantities = {_quantity(where, name, names) for name in names}
        if len(quantities) > 1:
            text = f"{', '.join(names)[:200]} are different quantities; write a file for each"
            raise FileFormatError(f"{where}: {text}")
        document["quantity"] = quantities.pop()
        rows = content.rows
        if document["quantity"] in LOGARITHMS:  # f_r of -999 is 0, which is no hole
            rows[:, 4:][fill_values(rows[:, 4:], document)] = np.nan
        rows[:, 4:] = f_r_of(document["quantity"], rows[:, 4:], rows[:, 0], rows[:, 2])
    lengths = [wavelength_of(name) for name in names]
    if None in lengths:
        if any(length is not None for length in lengths):
            raise FileFormatError(f"{where}: of {', '.join(names)[:200]} some are wavelengths, and others are not")
        return (names if len(names) > 1 else ("grey",)), None
    at = np.array(lengths, dtype=np.float64)
    if np.unique(at).size != at.size:
        raise FileFormatError(f"{where}: a wavelength is listed twice among {', '.join(names)[:200]}; remove a column")
    order = np.argsort(at)
    content.rows[:, 4:] = content.rows[:, 4 + order]
    return names_of(at[order]), at[order]


def _quantity(where: str, name: str, names: tuple[str, ...]) -> str:
    """Return the quantity of a channel by its name: one of `QUANTITIES`; FileFormatError if it is not known."""
    quantity, logarithm, factor, unit, _ = value_name(name, (*_ANGLES, *names))
    if logarithm:
        if logarithm not in LOGARITHMS:
            text = f"the logarithms of {name!r} are not known; name the channel BRDF and state --quantity log10, ln or"
            raise FileFormatError(f"{where}: {text} decibel")
        return logarithm
    quantity = quantity or "f_r"
    if factor == 0.01 and quantity in ("f_r", "reflectance_factor"):
        return "percent" if quantity == "f_r" else "reflectance_factor_percent"
    if unit or factor != 1.0 or quantity not in QUANTITIES:
        text = f"the unit or quantity of the channel {name!r} is not known"
        raise FileFormatError(f"{where}: {text}; name it BRDF and state --quantity, such as f_r_cos")
    return quantity


def _of_colours(names: tuple[str, ...]) -> bool:
    return tuple(name.upper() for name in names) in (("R", "G", "B"), ("X", "Y", "Z"))
