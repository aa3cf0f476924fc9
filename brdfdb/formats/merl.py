"""MERL: isotropic tables in three colours on the fixed grid of half and difference vectors of Matusik et al. (2003).

The grid has 90 x 90 x 180 bins over the half and difference vectors, finer next to the normal. A number is f_r in 1/sr
times a scale. Some readers look one bin up, and others interpolate linearly (``--samples``). The grid is fixed. Lobes
narrower than a bin are represented coarsely.

The file holds linear sRGB. Anisotropic tables are refused, and the specular part is left out.
"""

from __future__ import annotations

import json
import os
import re
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import CannotHoldError, FileFormatError
from brdfdb.formats._angles import HALF_PI, HalfDifference
from brdfdb.formats._angular_grid import AngularGrid, reciprocal
from brdfdb.formats._channels import RGB, channels_of
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

suffix = ".binary"
media_type = "application/octet-stream"
summary = "isotropic tables as RGB on the fixed MERL grid of 90 x 90 x 180"
tools = "BRDF Explorer, plugins of Mitsuba and others, libbsdf"
kinds = ()
options = (
    FIXED,
    FormatOption(
        "samples",
        "centres",
        "where values lie: at centres of bins, for readers that look one bin up (BRDF Explorer, Mitsuba plugins), or "
        "at their edges, for readers that interpolate (libbsdf)",
        choices=("centres", "edges"),
    ),
)

SHAPE = (90, 90, 180)  # theta_h, theta_d, phi_d
SCALE = np.array([1.0, 1.15, 1.66]) / 1500.0  # f_r [1/sr] of a number in R, G, B
INVALID = -1.0  # readers take a negative number for a direction that was not measured
_HEADER = np.array(SHAPE, "<i4").tobytes()
_SWAPPED = np.array(SHAPE, ">i4").tobytes()
_BYTES = len(_HEADER) + 3 * 8 * SHAPE[0] * SHAPE[1] * SHAPE[2]
_SYSTEM = HalfDifference(anisotropic=False, mirrored=False)
_HOLDS = "f_r [1/sr], the BRDF without the cosine, is number * (1, 1.15, 1.66) / 1500 in R, G, B; numbers lie at the "


def write(
    table: Table,
    path: str | os.PathLike[str],
    *,
    tolerance: float = 0.02,
    samples: str = "centres",
    verdict: str | None = None,
) -> Written:
    """Write an isotropic table as a MERL file, with its record as JSON next to it.

    Bins and scales as in BRDF Explorer (``BRDFMeasuredMERL.cpp``, ``measured.func``), which looks one bin up; libbsdf
    (``MerlBinaryReader.cpp``) takes the numbers for samples at lower edges of bins, interpolates linearly, and takes
    negative ones for 0. So nodes below the horizon have the value at the horizon where a cell beside them reaches above
    it, and are negative elsewhere. Colours below 0, outside of sRGB, are 0. The error is that of readers of the kind.
    """
    from brdfdb.formats._stated_error import Comparison

    if table.anisotropic:
        raise CannotHoldError(f"{table.name}: the table is anisotropic, and MERL files hold only isotropic tables")
    channels = channels_of(table, "rgb")
    valid, angles = _nodes(samples)
    comparison = Comparison(table, channels)
    planes = np.full((3, *SHAPE), INVALID)
    half = reciprocal(comparison)  # then the numbers at phi_d and pi - phi_d are the same
    looked_up = valid & (np.arange(SHAPE[2]) <= SHAPE[2] // 2) if half else valid
    numbers = channels.values(table, *_SYSTEM.directions(angles[looked_up[valid]]))
    planes[:, looked_up] = np.maximum(numbers, 0.0).T / SCALE[:, np.newaxis]
    if half:
        first = 0 if samples == "centres" else 1
        planes[..., SHAPE[2] // 2 :] = planes[..., first : first + SHAPE[2] // 2][..., ::-1]
    error = comparison.error_of(MerlReader(planes, samples))
    remarks = (*channels.remarks, *specular_remark(table))
    holds = _HOLDS + ("centres of bins" if samples == "centres" else "lower edges of bins")
    document = record(table, error, verdict, holds=holds, remarks=remarks, tolerance=tolerance)
    paths = path_of(path), beside(path_of(path))
    with whole(*paths) as (file, beside_it):
        file.write_bytes(_HEADER + planes.astype("<f8").tobytes())
        beside_it.write_text(json.dumps(document | {"samples": samples}, indent=1) + "\n", encoding="utf-8")
    return Written(paths, error, tolerance, remarks)


signs = re.compile(rb"\A(?:[\x01-\xff][\0-\x03]\0\0){3}|\A(?:\0\0[\0-\x03][\x01-\xff]){3}", re.DOTALL)  # three numbers


def recognises(head: bytes) -> bool:
    """Return True for the first bytes of a MERL file, of either byte order."""
    return head.startswith((_HEADER, _SWAPPED))


def read(path: str | os.PathLike[str]) -> FileTable:
    """Return f_r of a MERL file as its readers see it: one bin looked up, or interpolated if its record says edges.

    A negative number, or nan, is a hole: f_r is nan there. Big-endian and interleaved files are recognised, and a note
    of the record says so.
    """
    from brdfdb.formats._readings import FileTable

    path = path_of(path)
    with path.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        head = file.read(len(_HEADER))
    if head not in (_HEADER, _SWAPPED) or size != _BYTES:
        dimensions = np.frombuffer(head.ljust(len(_HEADER), b"\0"), ">i4" if head[:1] == b"\0" else "<i4").tolist()
        text = f"its header states {' x '.join(map(str, dimensions))} bins, and it has {size} bytes"
        text += "; 32-bit floats are not read" if size == len(_HEADER) + (_BYTES - len(_HEADER)) // 2 else ""
        wanted = f"a MERL file of {_BYTES} bytes with the dimensions {SHAPE}"
        raise FileFormatError(f"{path}: it is not {wanted}: {text}")
    content = read_planes(path, len(_HEADER), SHAPE)
    planes = content.numbers
    known = record_beside(path)
    for sentence in content.notes:
        note(known, sentence)
    samples = "edges" if known.get("samples") == "edges" else "centres"
    name = str(known.get("name") or path.stem)

    def rows() -> ListedRows:
        offset = 0.5 if samples == "centres" else 0.0
        at = [np.arange(count) + offset for count in SHAPE]
        axes = [np.deg2rad(axis) for axis in (_degrees_h(at[0]), at[1], at[2])]
        values = np.moveaxis(without_holes(planes), 0, -1) * SCALE
        return rows_of_grid(_SYSTEM, axes, values, name, RGB, None, known)

    return FileTable(name, RGB, None, MerlReader(planes, samples), known, rows)


def _nodes(samples: str) -> tuple[NDArray[np.bool_], Floats]:
    """Return the bins that are read for directions above the horizon, and angles [rad] (N, 3) of their values."""
    offset = 0.5 if samples == "centres" else 0.0
    at = tuple(np.arange(count) + offset for count in SHAPE)
    # the corner closest to the normal, and the azimuth closest to 90 degrees, of all that the number is read for
    reach = 0.0 if samples == "centres" else -1.0
    corner = [np.maximum(np.arange(count) + reach, 0.0) for count in SHAPE[:2]]
    theta_h, theta_d = _degrees_h(corner[0]), corner[1]
    steepest = np.maximum(np.abs(at[2] - 90.0) - (0.5 if samples == "centres" else 1.0), 0.0)
    sine = np.sin(np.deg2rad(steepest))
    tangents = np.tan(np.deg2rad(theta_h))[:, np.newaxis] * np.tan(np.deg2rad(theta_d))
    valid = tangents[..., np.newaxis] * sine < 1.0
    index = np.nonzero(valid)
    angles = np.deg2rad(np.stack([_degrees_h(at[0])[index[0]], at[1][index[1]], at[2][index[2]]], axis=1))
    return valid, angles


def _degrees_h(index: Floats) -> Floats:
    """Return theta_h [degree] of an index: finer close to the normal."""
    return np.asarray(index**2 / SHAPE[0])


class MerlReader:
    """f_r [1/sr], shape (N, 3), at unit vectors (N, 3), of planes of numbers (3, theta_h, theta_d, phi_d)."""

    def __init__(self, planes: Floats, samples: str) -> None:
        f_r = np.moveaxis(without_holes(planes), 0, -1) * SCALE
        self._f_r = f_r
        self._grid: AngularGrid | None = None
        if samples == "edges":
            # libbsdf: the last sample of a theta is repeated at 90 degrees, the first one of phi_d at 180
            whole_turn = np.concatenate([f_r, f_r[:, :, :1]], axis=2)
            values = np.pad(whole_turn, ((0, 1), (0, 1), (0, 0), (0, 0)), mode="edge").astype(np.float32)
            nodes = (_degrees_h(np.arange(91.0)), np.arange(91.0), np.arange(181.0))
            self._grid = AngularGrid(_SYSTEM, tuple(np.deg2rad(axis) for axis in nodes), values)

    def __call__(self, wi: Floats, wr: Floats) -> Floats:
        if self._grid is not None:
            return self._grid.evaluate(wi, wr)
        theta_h, theta_d, phi_d = _SYSTEM.angles(wi, wr).T
        parts = np.sqrt(theta_h / HALF_PI) * SHAPE[0], theta_d / HALF_PI * SHAPE[1], phi_d / np.pi * SHAPE[2]
        index = tuple(np.clip(part.astype(np.intp), 0, count - 1) for part, count in zip(parts, SHAPE, strict=True))
        return np.asarray(self._f_r[index])
