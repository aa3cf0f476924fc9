"""ASAM OpenMATERIAL 3D: lookup tables of the BRDF of isotropic materials (.xompt).

A row holds a wavelength in metres, three angles in radians, and f_r in 1/sr. The directions form a grid of light and
viewer. The format does not say how to interpolate. The stated error is that of linear interpolation along all angles at
once.

A file can hold all wavelengths. Grey tables are written at 550 nm. Anisotropic tables are refused, and the specular
part is left out. A file has about 40 MB at most: a table that needs more is written with a larger error.
"""

from __future__ import annotations

import json
import math
import os
import re
import uuid
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import CannotHoldError, FileFormatError
from brdfdb.formats._dense_files import (
    MOST_BYTES,
    RESOLUTION,
    degrees_of,
    dense_record,
    listed_rows,
    parsed,
    reading_of_rows,
    title_of,
)
from brdfdb.formats._interface import TOLERANCE
from brdfdb.formats._nodes import wrong_radians
from brdfdb.formats._record import specular_remark
from brdfdb.formats._written import Written, whole
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.formats._readings import FileTable
    from brdfdb.measurements.conventions import ListedRows
    from brdfdb.tables.table import Table

suffix = ".xompt"
angle_unit = "rad"
keywords = ("angles", "wavelength_unit")
wavelength_unit = "m"
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


signs = re.compile(rb'"lookupTable"|openMaterial3dVersion')


def recognises(head: bytes) -> bool:
    """Return True for the first bytes of a file that names the schema of BRDF tables."""
    return b"material_brdf_schema" in head


def read(path: str | os.PathLike[str], **stated: str) -> FileTable | ListedRows:
    """Return f_r of a lookup table: interpolated linearly if it covers the hemisphere, else its samples."""
    from brdfdb.measurements.instrument import Instrument

    path = path_of(path)
    document = parsed(path)
    brdf, metadata = document.get("brdf"), document.get("metadata")
    brdf = brdf if isinstance(brdf, dict) else {}
    metadata = metadata if isinstance(metadata, dict) else {}
    rows = _rows(path, brdf.get("lookupTable"))
    at, first, counts = np.unique(np.round(rows[:, 0] * 1e9, 6), return_index=True, return_counts=True)
    _check_wavelengths(path, brdf, at)
    if len(set(counts.tolist())) != 1:
        fewest, most = (f"{at[index]:g} nm has {counts[index]} rows" for index in (counts.argmin(), counts.argmax()))
        raise FileFormatError(f"{path}: field brdf.lookupTable: {fewest}, {most}: rows are missing or listed twice")
    if not np.array_equal(first, np.arange(at.size) * (len(rows) // at.size)):
        text = "its rows are not sorted by their wavelength"
        raise FileFormatError(f"{path}: field brdf.lookupTable: {text}; sort them, and then by their angles")
    blocks = rows.reshape(at.size, -1, 5)
    if np.any(differs := np.any(blocks[:, :, 1:4] != blocks[:1, :, 1:4], axis=(0, 2))):
        row = int(np.argmax(differs))
        text = f"row {row + 1} of the wavelengths has different directions; each needs the same ones in the same order"
        raise FileFormatError(f"{path}: field brdf.lookupTable: {text}")
    known = metadata.get("brdfdb")
    known = known if isinstance(known, dict) else {**metadata, "name": metadata.get("name", "")}
    names = ("theta_i", "theta_r", "delta_phi")
    angles = {name: degrees_of(blocks[0, :, 1 + index], "rad") for index, name in enumerate(names)}
    instrument = Instrument(receiver_solid_angle_sr=_solid_angle(brdf))
    provenance = str(metadata.get("sources", ""))
    values = blocks[:, :, 4].T

    def wrong_angle(row: int, column: int) -> str:
        index = (1 + column) // 2
        where = f"{path}: field brdf.lookupTable, row {row + 1}, {names[index]}"
        return f"{where}: {wrong_radians(blocks[0, row, 1 + index], column)}"

    def listed() -> ListedRows:
        of_file: dict[str, Any] = {"instrument": instrument, "provenance": provenance, "wrong_angle": wrong_angle}
        return listed_rows(path, angles, values, at, known, **of_file)

    limits = {"theta_i": (0.0, 180.0), "theta_r": (0.0, 180.0), "delta_phi": (-720.0, 720.0)}
    if any(np.any((angles[name] < low) | (angles[name] > high)) for name, (low, high) in limits.items()):
        return listed()
    angles_of_half, half = _folded(angles, values)
    return reading_of_rows(path, angles_of_half, half, at, known, listed, stated=bool(stated))


def _rows(path: Path, listed: Any) -> NDArray[np.float64]:
    """Return the rows of a lookup table, shape (N, 5); FileFormatError with the first row that is none."""
    field = f"{path}: field brdf.lookupTable"
    if not isinstance(listed, list) or not listed:
        raise FileFormatError(f"{field}: it is missing, or not a list of rows of five numbers")
    try:
        rows = np.array(listed, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        rows = np.empty(0)
    if rows.ndim == 2 and rows.shape[1] == 5 and np.all(np.isfinite(rows)):
        return rows
    for number, row in enumerate(listed, 1):
        numbers = isinstance(row, list) and all(isinstance(v, int | float) and math.isfinite(v) for v in row)
        if not numbers or len(row) != 5:
            text = "is not five finite numbers: wavelength [m], theta_i, theta_r, phi_r [rad], f_r [1/sr]"
            raise FileFormatError(f"{field}: row {number}, {json.dumps(row)[:60]}, {text}")
    raise FileFormatError(f"{field}: it is not a list of rows of five numbers")


def _check_wavelengths(path: Path, brdf: dict[str, Any], at: NDArray[np.float64]) -> None:
    """Raise FileFormatError if the lists of wavelengths [m] of a file are not those of its rows, `at` [nm]."""
    entries = brdf.get("receiverSolidAngles")
    of_entries = [entry.get("wavelength") if isinstance(entry, dict) else None for entry in entries or ()]
    for name, stated in (("wavelengths", brdf.get("wavelengths")), ("receiverSolidAngles", of_entries or None)):
        if stated is None:
            continue
        try:
            listed = np.unique(np.round(np.array(stated, dtype=np.float64).reshape(-1) * 1e9, 6))
        except (ValueError, TypeError, OverflowError):
            listed = np.empty(0)
        if listed.size != at.size or not np.allclose(listed, at, rtol=1e-6, atol=0.0):
            shown = ", ".join(f"{1e-9 * nm:g}" for nm in listed[:3])
            rows = ", ".join(f"{1e-9 * nm:g}" for nm in at[:3])
            text = f"it lists {listed.size} wavelengths from {shown} m, but the rows have {at.size} from {rows} m"
            raise FileFormatError(f"{path}: field brdf.{name}: {text}")


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
