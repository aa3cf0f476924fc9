"""SSDD: any table on a grid that is chosen for it, with the specular part in a separate block (libbsdf).

The lists of angles are those of half and difference vectors, of the viewer about the specular direction, or of light
and viewer. The kind of angles that needs the fewest nodes is used. libbsdf interpolates f_r, in 1/sr, in straight lines
over each angle.

A file can hold anisotropic tables, all wavelengths and the specular part.
"""

from __future__ import annotations

import functools
import math
import mmap
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError
from brdfdb.formats._angles import HalfDifference, Specular, Spherical, System
from brdfdb.formats._angular_grid import SIZE, AngularGrid, Sink, chosen, mirrored, reciprocal
from brdfdb.formats._channels import names_of
from brdfdb.formats._doubts import OPEN_END, has_open_end
from brdfdb.formats._input import HEAD, MOST_TEXT, check_size, encoding_of, opened_text, plain_number
from brdfdb.formats._interface import TOLERANCE, FormatOption
from brdfdb.formats._nodes import rows_of_grid, without_holes
from brdfdb.formats._record import lines, note, of_lines, record
from brdfdb.formats._written import Written, whole
from brdfdb.parameters import Floats
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
    FormatOption("data", "binary", "encoding of the values", choices=("binary", "ascii")),
    SIZE,
)

_NAMES = {
    HalfDifference: "half_difference_coordinate_system",
    Specular: "specular_coordinate_system",
    Spherical: "spherical_coordinate_system",
}
_COLOURS = {"monochrome": ("grey",), "rgb": ("R", "G", "B"), "xyz": ("X", "Y", "Z")}
_VERSION = "0.3"
_LISTS = ("PARAM0_LIST", "PARAM1_LIST", "PARAM2_LIST", "PARAM3_LIST")
_RANGES_DEG = ((0.0, 90.0), (-360.0, 360.0), (0.0, 180.0), (-360.0, 360.0))  # of the lists
_ROUNDING_DEG = 1e-3
_TYPES = ("brdf", "btdf", "specular_reflectance", "specular_transmittance")
_CHANNELS = {"monochrome": 1, "rgb": 3, "xyz": 3}
_LONGEST = 1 << 24  # bytes of a line of a header: a list of angles or wavelengths
_ENTRY = re.compile(r"[A-Z][A-Z0-9_]*")
signs = re.compile(rb"^(?:DATA_TYPE|COLOR_MODEL|PARAM_TYPE|PARAM[0-4]_LIST)\b", re.MULTILINE)
_NUMBER = re.compile(rb"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_SPACES = b" \t\n\v\f\r"


def write(
    table: Table,
    path: str | os.PathLike[str],
    *,
    tolerance: float = 0.02,
    data: str = "binary",
    size: float = 16.0,
    verdict: str | None = None,
) -> Written:
    """Write a table as an SSDD file with the record in its comments.

    After the specification of the format, version 0.3, and libbsdf's ``SsddReader.cpp``. libbsdf interpolates linearly
    over each angle (``LinearInterpolator.cpp``). The angles are those of half and difference vectors, of the viewer
    about the specular direction, or of light and viewer: the ones that need the fewest nodes.
    """
    from brdfdb.formats._stated_error import Comparison

    comparison = Comparison(table)
    software = f"brdfdb-{version('brdfdb')}"

    def write_all(sink: Sink, grid: AngularGrid, error: FileError) -> None:
        document = record(table, error, verdict, tolerance=tolerance)
        values = grid.values if table.anisotropic else grid.values[:, np.newaxis]  # over four angles
        sink.write(encoded_header(software, lines(document)))
        sink.write(encoded_block(_entries(table, grid), values, data == "binary"))
        if table.specular is not None:
            sink.write(_specular(table, data == "binary"))

    grid, error = chosen(comparison, _systems(comparison), tolerance, size, write_all)
    with whole(path) as (file,), file.open("wb") as stream:
        write_all(stream, grid, error)
    return Written((path_of(path),), error, tolerance)


def recognises(head: bytes) -> bool:
    """Return True for the first bytes of an SSDD file."""
    return head.startswith(b"VERSION ") or (head.startswith(b"#") and b"\nVERSION " in head)


def read(path: str | os.PathLike[str]) -> FileTable:
    """Return f_r of an SSDD file as libbsdf sees it; angles with offsets and distorted ones are refused.

    The record has a specular part that the file holds as "specular_reflectance", with its angles as
    "specular_theta_i_deg".
    """
    from brdfdb.formats._readings import FileTable

    path = path_of(path)
    comments, blocks = parsed(path)
    by_type = {block.entries["DATA_TYPE"]: block for block in blocks}
    if len(by_type) < len(blocks):
        types = ", ".join(block.entries["DATA_TYPE"] for block in blocks)
        raise FileFormatError(f"{path}: field DATA_TYPE: {types}: a type stands twice; write a file for each")
    if "brdf" not in by_type:
        raise FileFormatError(f"{path}: field DATA_TYPE: it is not an SSDD file with a block of DATA_TYPE brdf")
    block = by_type["brdf"]
    grid = _grid(path, block)
    document = of_lines(comments)
    if blocks[-1].entries["DATA"] == "ascii" and has_open_end(path):
        note(document, OPEN_END)
    if "specular_reflectance" in by_type:
        dirac = by_type["specular_reflectance"]
        document["specular_theta_i_deg"] = dirac.angles[0].tolist()
        document["specular_reflectance"] = dirac.values[:, 0, 0, 0].tolist()
    at = block.wavelength_nm
    names = _COLOURS[block.entries["COLOR_MODEL"]] if at is None else names_of(at)
    name = str(document.get("name") or block.entries.get("NAME") or path.stem)
    angles = [np.deg2rad(axis) for axis in block.angles]
    rows = functools.partial(rows_of_grid, grid.system, angles, block.values, name, names, at, document)
    return FileTable(name, names, at, grid.evaluate, document, rows, listed=True)


def _systems(comparison: Comparison) -> list[System]:
    """Return the systems of angles that a table may be written in, with the symmetries that it has."""
    anisotropic = comparison.table.anisotropic
    both_sides = not anisotropic or mirrored(comparison)
    systems: list[System] = [HalfDifference(anisotropic, both_sides, reciprocal(comparison))]
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
    names = _LISTS if len(grid.nodes) == 4 else (_LISTS[0], *_LISTS[2:])
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
    return encoded_block(entries, table.specular.reshape(at_deg.size, 1, 1, 1, -1), binary)


def _grid(path: Path, block: SsddBlock) -> AngularGrid:
    """Return the grid of a block."""
    reductions = block.entries.get("REDUCTION_TYPE", "").split()
    anisotropic = block.angles[1].size > 1
    both_sides = "bilateral_symmetry" in reductions
    kind = block.entries.get("PARAM_TYPE")
    systems: dict[str, System] = {
        _NAMES[HalfDifference]: HalfDifference(anisotropic, both_sides, "reciprocity" in reductions),
        _NAMES[Specular]: Specular(anisotropic, both_sides),
        _NAMES[Spherical]: Spherical(anisotropic, both_sides),
    }
    if kind not in systems or "PARAM4_LIST" in block.entries:
        raise FileFormatError(
            f"{path}: field PARAM_TYPE: it is {kind}; {', '.join(systems)} are read, and no PARAM4_LIST"
        )
    nodes = tuple(np.deg2rad(axis) for axis in block.angles)
    values = without_holes(block.values)
    if not anisotropic:
        nodes = (nodes[0], *nodes[2:])
        values = values[:, 0]
    return AngularGrid(systems[kind], nodes, values)


@dataclass(frozen=True, eq=False)
class SsddBlock:
    """A block of data."""

    entries: Mapping[str, str]  #: the entries before the values, by name
    #: the lists of angles that are there, from PARAM0_LIST on; (0,) for one that is left out, [degree]
    angles: tuple[NDArray[np.float64], ...]
    values: NDArray[np.float32]  #: values over the lists, and last the channels, (n0, n1, ..., C)
    #: wavelengths of the channels; None if the channels are not wavelengths, (C,) [nm]
    wavelength_nm: NDArray[np.float64] | None


def encoded_header(software: str, comments: Sequence[str]) -> bytes:
    """Return the beginning of a file, with comments."""
    return "\n".join([f"VERSION {_VERSION}", *(f"# {line}" for line in comments), f"SOFTWARE {software}", ""]).encode()


def encoded_block(entries: Mapping[str, str], values: Floats, binary: bool) -> bytes:
    """Return a block of entries, in their order, and values (n0, n1, ..., C), whose first index runs fastest.

    libbsdf looks for comments after each line, and so at the beginning of binary values too. There a "#" behind bytes
    that are white space would be taken for one: the first value is changed in its last digit then.
    """
    lines = [f"{name} {text}" for name, text in entries.items() if text]
    channels = values.shape[-1]
    rows = np.moveaxis(values, -1, 0).T.reshape(-1, channels).astype("<f4")
    if not binary:
        text = "%.7g" + " %.7g" * (channels - 1)
        data = "\n".join([text] * len(rows)) % tuple(rows.reshape(-1).tolist())
        return "\n".join(["", *lines, "DATA ascii", data, ""]).encode()
    while rows.reshape(-1)[:64].tobytes().lstrip(_SPACES).startswith(b"#"):
        rows[0, 0] = np.nextafter(rows[0, 0], np.float32(np.inf))
    return "\n".join(["", *lines, "DATA binary", ""]).encode() + rows.tobytes() + b"\n"


def parsed(path: Path) -> tuple[list[str], list[SsddBlock]]:
    """Return the comments and the blocks of a file; FileFormatError if it is no SSDD file, or damaged."""
    check_size(path, MOST_TEXT)
    with path.open("rb") as file:
        head = file.read(HEAD)
        if not head:
            return [], []
        data: mmap.mmap | bytes = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    encoding = encoding_of(head)
    if encoding not in (None, "utf-8") or (b"\r" in head and b"\n" not in head):  # then its values are text, too
        with opened_text(path) as text_file:
            data = text_file.read().encode()
    comments: list[str] = []
    blocks: list[SsddBlock] = []
    entries: dict[str, str] = {}
    at = 0
    while at < len(data):
        end = data.find(b"\n", at, at + _LONGEST)
        end = len(data) if end < 0 else end
        if data.find(b"\0", at, min(end, at + _LONGEST)) >= 0:
            raise FileFormatError(f"{path}: byte {at}: a line of its header has a zero byte")
        if end - at > _LONGEST:
            raise FileFormatError(f"{path}: byte {at}: a line of its header has more than {_LONGEST} bytes")
        line = data[at:end].decode("utf-8", "replace").strip()
        at = end + 1
        if line.startswith("#"):
            comments.append(line[1:].strip())
            continue
        name, text = (*line.split(None, 1), "", "")[:2]
        if name == "DATA_TYPE":
            entries = {}
        if name and not _ENTRY.fullmatch(name):
            before = "behind the values that its lists state" if blocks else "in its header"
            raise FileFormatError(f"{path}: byte {at - 1}: {line[:40]!r} is no entry, and stands {before}")
        if name in entries:
            text = f"{entries[name]!r:.40} and {text!r:.40}; write a file for each"
            raise FileFormatError(f"{path}: byte {at - 1}, field {name}: it stands twice: {text}")
        if name:
            entries[name] = text.strip()
        if name == "DATA":
            values, at = _values(path, data, at, entries)
            blocks.append(values)
    return comments, blocks


def _values(path: Path, data: mmap.mmap | bytes, at: int, entries: Mapping[str, str]) -> tuple[SsddBlock, int]:
    """Return the block whose values begin at a byte, and the byte behind it."""
    if entries.get("DATA_TYPE") not in _TYPES or "PARAM0_LIST" not in entries:
        text = f"a block of data has none of {', '.join(_TYPES)}, or no PARAM0_LIST"
        raise FileFormatError(f"{path}: field DATA_TYPE: {text}")
    lists = {name: _numbers(path, name, entries.get(name, "0")) for name in _LISTS}
    model = entries.get("COLOR_MODEL", "")
    if model not in (*_CHANNELS, "spectrum"):
        known = ", ".join((*_CHANNELS, "spectrum"))
        raise FileFormatError(f"{path}: field COLOR_MODEL: {model!r:.40} is not one of {known}")
    nm = _numbers(path, "WAVELENGTH_LIST", entries.get("WAVELENGTH_LIST", "")) if model == "spectrum" else None
    channels = _CHANNELS[model] if nm is None else nm.size
    angles = tuple(lists.values())
    if nm is not None and nm[0] <= 0.0:
        raise FileFormatError(f"{path}: field WAVELENGTH_LIST: {nm[0]:g} is not a wavelength in nm")
    for (name, nodes), (low, high) in zip(lists.items(), _RANGES_DEG, strict=True):
        if not low <= nodes[0] <= nodes[-1] <= high + _ROUNDING_DEG:
            text = f"it is from {nodes[0]:g} to {nodes[-1]:g} degrees; allowed is [{low:g}, {high:g}]"
            raise FileFormatError(f"{path}: field {name}: {text}")
    if entries["DATA"] not in ("binary", "ascii"):
        raise FileFormatError(f"{path}: field DATA: {entries['DATA']!r:.40} is not one of binary and ascii")
    count = channels * math.prod(nodes.size for nodes in angles)
    if entries["DATA"] == "binary":
        end = at + 4 * count
        if end > len(data):
            raise FileFormatError(
                f"{path}: field DATA: it has {len(data) - at} bytes of values; its lists of angles need {4 * count}"
            )
        flat = np.frombuffer(data, "<f4", count, at)
    else:
        end = data.find(b"\nDATA_TYPE", at)
        end = len(data) if end < 0 else end
        lines = (line for line in data[at:end].split(b"\n") if not line.lstrip().startswith(b"#"))
        words = b" ".join(lines).split()
        try:
            if any(b"_" in word for word in words):
                raise ValueError
            flat = np.array(words, np.float32)
        except ValueError:
            wrong = next((word.decode("utf-8", "replace") for word in words if not _NUMBER.fullmatch(word)), "")
            raise FileFormatError(f"{path}: field DATA: {wrong[:40]!r} is not a number") from None
        if flat.size != count:
            text = f"it has {flat.size} values; its lists of angles need {count}: the file was cut, or a list is wrong"
            raise FileFormatError(f"{path}: field DATA: {text}")
    if not np.all(np.isfinite(flat)):
        raise FileFormatError(f"{path}: field DATA: value {int(np.argmin(np.isfinite(flat))) + 1} is not finite")
    shape = tuple(nodes.size for nodes in reversed(angles))
    values = np.moveaxis(flat.reshape(*shape, channels), -1, 0).T
    return SsddBlock(dict(entries), angles, np.ascontiguousarray(values), nm), end


def _numbers(path: Path, name: str, text: str) -> NDArray[np.float64]:
    """Return a list of increasing numbers in an entry of a header."""
    numbers = []
    for word in text.split():
        try:
            numbers.append(plain_number(word))
        except ValueError:
            numbers.append(math.nan)
        if not math.isfinite(numbers[-1]):
            raise FileFormatError(f"{path}: field {name}: {word[:40]!r} is not a finite number")
    if not numbers or np.any(np.diff(numbers) <= 0.0):
        raise FileFormatError(f"{path}: field {name}: its numbers are missing or do not increase")
    return np.array(numbers)
