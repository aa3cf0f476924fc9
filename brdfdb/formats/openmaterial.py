"""ASAM OpenMATERIAL 3D: lookup tables of the BRDF of isotropic materials (.xompt).

A row holds a wavelength in metres, three angles in radians, and f_r in 1/sr. The directions form a grid of light and
viewer. The format does not say how to interpolate. The stated error is that of linear interpolation along all angles at
once.

A file can hold all wavelengths. Grey tables are written at 550 nm. Anisotropic tables are refused, and the specular
part is left out. A file has about 40 MB at most: a table that needs more is written with a larger error.
"""

from __future__ import annotations

import functools
import json
import math
import os
import re
import uuid
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import CannotHoldError, FileFormatError
from brdfdb.formats._dense_files import (
    MOST_BYTES,
    RESOLUTION,
    degrees_of,
    dense_record,
    parsed,
    reading_of_rows,
    samples_of_rows,
    title_of,
)
from brdfdb.formats._interface import TOLERANCE
from brdfdb.formats._record import specular_remark
from brdfdb.formats._written import Written, whole
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.formats._readings import FileTable
    from brdfdb.measurements.samples import Samples
    from brdfdb.tables.table import Table

suffix = ".xompt"
media_type = "application/json"
summary = "BRDF lookup tables of ASAM OpenMATERIAL 3D"
tools = "simulators of ASAM OpenMATERIAL 3D"
kinds = ()
options = (TOLERANCE, RESOLUTION)
VERSION = "1.0.0"
SCHEMA = (
    f"https://raw.githubusercontent.com/asam-ev/OpenMATERIAL-3D/refs/tags/v{VERSION}/schemas/material_brdf_schema.json"
)
GREY_NM = 550.0  # at which grey tables are written: the format has no rows without a wavelength
_DIGITS = 5
_ROW_BYTES = 48
_DECIMALS = 6  # of angles [rad], as the largest ones of the schema have: 1.570796 and 6.283185
_LARGEST = {"polar": 1.570796, "azimuth": 6.283185}
_SAME = 1e-4  # relative difference of values at an azimuth and its mirror image that count as the same


def write(
    table: Table,
    path: str | os.PathLike[str],
    *,
    tolerance: float = 0.02,
    resolution: float = 0.0,
    verdict: str | None = None,
) -> Written:
    """Write f_r as a lookup table of OpenMATERIAL 3D 1.0.

    Rows are wavelength [m], theta_i, theta_r and phi_r [rad], and f_r [1/sr], sorted. phi_r counts from the light: 0
    looks back towards it. Both halves of the azimuth are written. The record is ``metadata.brdfdb``; the schema demands
    positive values, reciprocity and energy conservation, on which its verdict of the audit speaks. The file has about
    40 MB at most.
    """
    from brdfdb.formats._dense_grid import dense_table, rounded

    if table.anisotropic:
        raise CannotHoldError(
            f"{table.name}: the table is anisotropic, and OpenMATERIAL 3D holds only isotropic tables"
        )
    most = MOST_BYTES // (2 * _ROW_BYTES)
    dense = dense_table(table, tolerance, axes="light_viewer", resolution=resolution, most_values=most, digits=_DIGITS)
    at = dense.channels.wavelength_nm
    remarks = specular_remark(table)
    if at is None:
        remarks = (*remarks, f"grey: the same at all wavelengths, written at {GREY_NM:g} nm")
    known = dense_record(table, dense, verdict, specular=False) | {"remarks": list(remarks)}
    half_turn = dense.grid.axes["delta_phi"]
    full_turn = np.append(half_turn, 360.0 - half_turn[-2::-1])
    values = np.concatenate([dense.values, dense.values[:, :, -2::-1]], axis=2)
    metres = [float(f"{value:.9g}e-9") for value in ([GREY_NM] if at is None else at)]
    polar = [_radians(dense.grid.axes[name], "polar") for name in ("theta_i", "theta_r")]
    azimuths = [f"{azimuth!r}," for azimuth in _radians(full_turn, "azimuth")]
    head = json.dumps({"$schema": SCHEMA, "metadata": _metadata(table, known)}, ensure_ascii=False, indent=1)
    with whole(path) as (half,), half.open("w", encoding="utf-8", newline="\n") as file:
        file.write(head.removesuffix("}").rstrip())
        file.write(f',\n "brdf": {{"wavelengths": {json.dumps(metres)}, "lookupTable": [')
        separator = "\n"
        for number, metre in enumerate(metres):
            for i, theta_i in enumerate(polar[0]):
                texts = rounded(values[i, :, :, number], _DIGITS).tolist()
                for theta_r, row in zip(polar[1], texts, strict=True):
                    start = f"[{metre!r},{theta_i!r},{theta_r!r},"
                    file.write(separator + ",\n".join(f"{start}{a}{f!r}]" for a, f in zip(azimuths, row, strict=True)))
                    separator = ",\n"
        file.write("]}}\n")
    return Written((path_of(path),), dense.error, dense.tolerance, remarks)


def recognises(head: bytes) -> bool:
    """Return True for the first bytes of a file that names the schema of BRDF tables."""
    return b"material_brdf_schema" in head


def read(path: str | os.PathLike[str]) -> FileTable | Samples:
    """Return f_r of a lookup table: interpolated linearly if it covers the hemisphere, else its samples."""
    from brdfdb.measurements.samples import Instrument

    path = path_of(path)
    document = parsed(path)
    brdf, metadata = document.get("brdf"), document.get("metadata")
    metadata = metadata if isinstance(metadata, dict) else {}
    try:
        rows = np.array(brdf["lookupTable"] if isinstance(brdf, dict) else None, dtype=np.float64)
    except (KeyError, ValueError, TypeError, OverflowError):
        rows = np.empty(0)
    if rows.ndim != 2 or rows.shape[1] != 5 or not len(rows) or not np.all(np.isfinite(rows)):
        raise FileFormatError(f"{path}: brdf.lookupTable is not a list of rows of five numbers")
    at, first = np.unique(np.round(rows[:, 0] * 1e9, 6), return_index=True)
    if len(rows) % at.size or not np.array_equal(first, np.arange(at.size) * (len(rows) // at.size)):
        raise FileFormatError(f"{path}: the rows are not sorted, or the wavelengths have different numbers of rows")
    blocks = rows.reshape(at.size, -1, 5)
    if not np.array_equal(np.broadcast_to(blocks[0, :, 1:4], blocks[:, :, 1:4].shape), blocks[:, :, 1:4]):
        raise FileFormatError(f"{path}: the wavelengths have different directions")
    names = ("theta_i", "theta_r", "delta_phi")
    angles = {name: degrees_of(blocks[0, :, 1 + index], "rad") for index, name in enumerate(names)}
    known = metadata.get("brdfdb")
    known = known if isinstance(known, dict) else {**metadata, "name": metadata.get("name", "")}
    nodes = functools.partial(
        samples_of_rows,
        path,
        angles,
        blocks[:, :, 4].T,
        at,
        known,
        instrument=Instrument(receiver_solid_angle_sr=_solid_angle(brdf)),
        provenance=str(metadata.get("sources", "")),
    )
    angles, values = _folded(angles, blocks[:, :, 4].T)
    return reading_of_rows(path, angles, values, at, known, nodes)


def _solid_angle(brdf: Any) -> float | None:
    """Return the solid angle [sr] of the receiver; None if it is not known, or not the same at all wavelengths."""
    entries = brdf.get("receiverSolidAngles") if isinstance(brdf, dict) else None
    entries = entries if isinstance(entries, list) else []
    angles = {entry.get("solidAngle") for entry in entries if isinstance(entry, dict)}
    angle = angles.pop() if len(angles) == 1 else None
    return float(angle) if isinstance(angle, int | float) and 0.0 < angle < math.inf else None


def _folded(
    angles: dict[str, NDArray[np.float64]], values: NDArray[np.float64]
) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.float64]]:
    """Return the half of the rows with azimuths up to 180 degrees, if the other half is its mirror image."""
    turn = np.unique(angles["delta_phi"])
    mirrored = np.round(360.0 - turn[::-1], 4)
    if turn[-1] != 360.0 or len(values) % turn.size or not np.allclose(turn, mirrored, atol=1.01e-4):
        return angles, values
    grid = values.reshape(-1, turn.size, values.shape[1])
    azimuths = angles["delta_phi"].reshape(-1, turn.size)
    if not np.all(azimuths == turn) or not np.allclose(grid, grid[:, ::-1], rtol=_SAME, atol=0.0):
        return angles, values
    half = turn.size // 2 + 1
    kept = {name: angle.reshape(-1, turn.size)[:, :half].reshape(-1) for name, angle in angles.items()}
    return kept, grid[:, :half].reshape(-1, values.shape[1])


def _radians(angles_deg: NDArray[np.float64], kind: str) -> list[float]:
    return [float(angle) for angle in np.minimum(np.round(np.deg2rad(angles_deg), _DECIMALS), _LARGEST[kind])]


def _metadata(table: Table, known: dict[str, Any]) -> dict[str, Any]:
    """Return the section ``metadata`` of a file."""
    number = re.search(r"\d+", table.revision)
    return {
        "name": known["title"] or table.name,
        "description": title_of(known),
        "uuid": str(uuid.uuid5(uuid.NAMESPACE_URL, f"brdfdb/{table.name}")),  # the same in all versions
        "materialVersion": f"{int(number.group()) if number else 0}.0.0",
        "openMaterial3dVersion": VERSION,
        "copyrights": ["not stated"],
        "license": known["licence"],
        "authors": [known["program"]],
        "sources": f"{'measurement' if known['measured'] else 'simulation'}, {known['source'] or 'source not stated'}",
        "brdfdb": known,
    }
