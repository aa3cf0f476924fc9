"""SSDD: any table on a grid that is chosen for it, with the specular part in a block of its own (libbsdf).

The lists of angles are those of half and difference vectors, of the viewer about the specular direction, or of light
and viewer. The ones that need the fewest nodes are taken. libbsdf interpolates f_r, in 1/sr, in straight lines over
each angle.

Anisotropic tables, all wavelengths and the specular part fit.
"""

from __future__ import annotations

import functools
import os
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError
from brdfdb.formats import _ssdd_file
from brdfdb.formats._angles import HalfDifference, Specular, Spherical, System
from brdfdb.formats._angular_grid import SIZE, AngularGrid, Sink, chosen, mirrored, reciprocal
from brdfdb.formats._interface import TOLERANCE, Option
from brdfdb.formats._nodes import samples_of_grid, without_holes
from brdfdb.formats._record import lines, of_lines, record
from brdfdb.formats._written import Written, whole
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.formats._readings import FileTable
    from brdfdb.formats._stated_error import Comparison, FileError
    from brdfdb.tables.table import Table

suffix = ".ssdd"
media_type = "application/octet-stream"
summary = "SSDD 0.3: tables with all wavelengths and the specular part"
tools = "BSDF Processor, libbsdf"
kinds = ()
options = (
    TOLERANCE,
    Option("data", "binary", "form of the values", choices=("binary", "ascii")),
    SIZE,
)

_NAMES = {
    HalfDifference: "half_difference_coordinate_system",
    Specular: "specular_coordinate_system",
    Spherical: "spherical_coordinate_system",
}
_COLOURS = {"monochrome": ("grey",), "rgb": ("R", "G", "B"), "xyz": ("X", "Y", "Z")}


def write(
    table: Table,
    path: str | os.PathLike[str],
    *,
    tolerance: float = 0.02,
    data: str = "binary",
    size: float = 16.0,
    verdict: str | None = None,
) -> Written:
    """Write a table as an SSDD file: whole, or not at all. The record is in its comments.

    Parameters
    ----------
    table : Table
        Any.
    path : path
        The file; one that is there is replaced.
    tolerance : float [1]
        Largest p99.
    data : str
        "binary" or "ascii".
    size : float [MB]
        Largest file.
    verdict : str, optional
        Verdict of the audit of this revision.

    Raises
    ------
    ParameterError
        If no file of this table is so small.
    WriteError
        If the file cannot be written.

    Notes
    -----
    After the specification of the format, version 0.3, and libbsdf's ``SsddReader.cpp``. libbsdf interpolates linearly
    over each angle (``LinearInterpolator.cpp``). The angles are those of half and difference vectors, of the viewer
    about the specular direction, or of light and viewer: the ones that need the fewest nodes.
    """
    from brdfdb.formats._stated_error import Comparison

    comparison = Comparison(table)
    software = f"brdfdb-{version('brdfdb')}"

    def write_all(sink: Sink, grid: AngularGrid, error: FileError) -> None:
        document = record(table, error, verdict, tolerance=tolerance)
        sink.write(_ssdd_file.header(software, lines(document)))
        sink.write(_ssdd_file.block(_entries(table, grid), _four(grid), data == "binary"))
        if table.specular is not None:
            sink.write(_specular(table, data == "binary"))

    grid, error = chosen(table, comparison, _systems(table, comparison), tolerance, size, write_all)
    with whole(path) as (file,), file.open("wb") as stream:
        write_all(stream, grid, error)
    return Written((path_of(path),), error, tolerance)


def recognises(head: bytes) -> bool:
    """Return True for the first bytes of an SSDD file."""
    return head.startswith(b"VERSION ") or (head.startswith(b"#") and b"\nVERSION " in head)


def read(path: str | os.PathLike[str]) -> FileTable:
    """Return f_r of an SSDD file as libbsdf sees it.

    The record has a specular part that the file holds as "specular_reflectance", with its angles as
    "specular_theta_i_deg".

    Raises
    ------
    FileFormatError
        If the file is not an SSDD file with a BRDF, is damaged, or has angles with offsets or distorted ones.
    OSError
        If it cannot be read.
    """
    from brdfdb.formats._readings import FileTable

    path = path_of(path)
    comments, blocks = _ssdd_file.parsed(path)
    by_type = {block.entries["DATA_TYPE"]: block for block in blocks}
    if "brdf" not in by_type:
        raise FileFormatError(f"{path}: not an SSDD file with a block of DATA_TYPE brdf")
    block = by_type["brdf"]
    grid = _grid(path, block)
    document = of_lines(comments)
    if "specular_reflectance" in by_type:
        dirac = by_type["specular_reflectance"]
        document["specular_theta_i_deg"] = dirac.angles[0].tolist()
        document["specular_reflectance"] = dirac.values[:, 0, 0, 0].tolist()
    at = block.wavelength_nm
    names = _COLOURS[block.entries["COLOR_MODEL"]] if at is None else tuple(f"{value:g}nm" for value in at)
    name = str(document.get("name") or block.entries.get("NAME") or path.stem)
    angles = [np.deg2rad(axis) for axis in block.angles]
    nodes = functools.partial(samples_of_grid, grid.system, angles, block.values, name, names, at, document)
    return FileTable(name, names, at, grid.evaluate, document, nodes, listed=True)


def _systems(table: Table, comparison: Comparison) -> list[System]:
    """Return the systems of angles that a table may be written in, with the symmetries that it has."""
    anisotropic = table.anisotropic
    both_sides = not anisotropic or mirrored(table, comparison)
    systems: list[System] = [HalfDifference(anisotropic, both_sides, reciprocal(table, comparison))]
    if not anisotropic:
        systems += [Specular(anisotropic, mirrored=True), Spherical(anisotropic, mirrored=True)]
    return systems


def _entries(table: Table, grid: AngularGrid) -> dict[str, str]:
    """Return the entries of the block of f_r, in the order of the format."""
    system = grid.system
    reductions = [
        *(["bilateral_symmetry"] if getattr(system, "mirrored", False) else []),
        *(["reciprocity"] if getattr(system, "reciprocal", False) else []),
    ]
    names = _ssdd_file.LISTS if len(grid.nodes) == 4 else (_ssdd_file.LISTS[0], *_ssdd_file.LISTS[2:])
    return {
        "DATA_TYPE": "brdf",
        **_colour(table),
        "PARAM_TYPE": _NAMES[type(system)],
        "REDUCTION_TYPE": " ".join(reductions),
        **{name: _listed(np.rad2deg(axis)) for name, axis in zip(names, grid.nodes, strict=True)},
        "NAME": table.name,
        "SOURCE_TYPE": "measured" if table.metadata.measured else "generated",
    }


def _colour(table: Table) -> dict[str, str]:
    at = table.wavelength_nm
    return {"COLOR_MODEL": "monochrome"} if at is None else {"COLOR_MODEL": "spectrum", "WAVELENGTH_LIST": _listed(at)}


def _listed(numbers: NDArray[np.float64]) -> str:
    return " ".join(f"{number:.10g}" for number in numbers)


def _four(grid: AngularGrid) -> NDArray[np.float32]:
    """Return the values of a grid over four angles."""
    return grid.values if len(grid.nodes) == 4 else grid.values[:, np.newaxis]


def _specular(table: Table, binary: bool) -> bytes:
    """Return the block of the specular part."""
    assert table.specular is not None
    at_deg = table.axes_deg["theta_i"] if table.specular_theta_deg is None else table.specular_theta_deg
    entries = {
        "DATA_TYPE": "specular_reflectance",
        **_colour(table),
        "PARAM0_LIST": _listed(at_deg),
        "SOURCE_TYPE": "measured" if table.metadata.measured else "generated",
    }
    return _ssdd_file.block(entries, table.specular.reshape(at_deg.size, 1, 1, 1, -1), binary)


def _grid(path: Path, block: _ssdd_file.Block) -> AngularGrid:
    """Return the grid of a block."""
    reductions = block.entries.get("REDUCTION_TYPE", "").split()
    anisotropic, both_sides = block.angles[1].size > 1, "bilateral_symmetry" in reductions
    kind = block.entries.get("PARAM_TYPE")
    systems: dict[str, System] = {
        _NAMES[HalfDifference]: HalfDifference(anisotropic, both_sides, "reciprocity" in reductions),
        _NAMES[Specular]: Specular(anisotropic, both_sides),
        _NAMES[Spherical]: Spherical(anisotropic, both_sides),
    }
    if kind not in systems or "PARAM4_LIST" in block.entries:
        raise FileFormatError(f"{path}: PARAM_TYPE is {kind}; {', '.join(systems)} are read, without PARAM4_LIST")
    nodes = tuple(np.deg2rad(axis) for axis in block.angles)
    values = without_holes(block.values)
    if not anisotropic:
        nodes, values = (nodes[0], *nodes[2:]), values[:, 0]
    return AngularGrid(systems[kind], nodes, values)
