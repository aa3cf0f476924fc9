"""BiRD: the universal BRDF format 1.0 of the project BiRD, JSON with one entry for each direction and wavelength.

The lists hold the polar angles and azimuths of light and viewer, in degrees, f_r in 1/sr and the wavelengths in nm. The
directions form a grid. The format does not say how to interpolate. The stated error is that of linear interpolation
along all angles at once.

A file can hold anisotropic tables and all wavelengths, but not the specular part. A file has about 40 MB at most: a
table that needs more is written with a larger error.
"""

from __future__ import annotations

import functools
import json
import os
import re
import uuid
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError
from brdfdb.formats._dense_files import (
    MOST_BYTES,
    RESOLUTION,
    column,
    degrees_of,
    dense_record,
    listed_rows,
    parsed,
    reading_of_rows,
    title_of,
)
from brdfdb.formats._doubts import doubt_comments
from brdfdb.formats._interface import TOLERANCE
from brdfdb.formats._record import specular_remark
from brdfdb.formats._written import Written, whole
from brdfdb.measurements.conventions import NM_PER
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.formats._readings import FileTable
    from brdfdb.measurements.conventions import ListedRows
    from brdfdb.tables.table import Table

suffix = ".json"
angle_unit = "stated"
keywords = ("angles", "wavelength_unit")
media_type = "application/json"
summary = "universal BRDF JSON of the project BiRD"
tools = "BiRD view and other programs of the universal BRDF format"
kinds = ()
options = (TOLERANCE, RESOLUTION)
SCHEMA = "https://raw.githubusercontent.com/BiRD-project/BiRD_view/master/BRDF_JSON_schema/brdf_json_schema_v1.0.json"
_LAST_DEG = 89.99  # polar angles stay below 90
_DIGITS, _ENTRY_BYTES = 5, 45  # of a number, and of the numbers of one entry
_ANGLES = ("theta_i", "phi_i", "theta_r", "phi_r")
_MICRONS = ("um", "µm", "μm")
_UNITS = {
    "angle": ("deg", "degree", "degrees", "°", "rad", ""),
    "BRDF": ("1/sr", "sr-1", "sr^-1", ""),
    "wavelength": ("nm", *_MICRONS, "m", ""),
}
_NOT_STATED = "not stated"
_TYPE = re.compile(rb'"type"\s*:\s*"BRDF"')
signs = re.compile(rb'"(?:BRDF|theta_i)"\s*:\s*\{')
_RIGHT_ANGLE = 1.58  # polar angles without a unit, none of which is larger, may be radians


def write(
    table: Table,
    path: str | os.PathLike[str],
    *,
    tolerance: float = 0.02,
    resolution: float = 0.0,
    verdict: str | None = None,
) -> Written:
    """Write f_r on a grid of light and viewer as universal BRDF JSON.

    The lists theta_i, phi_i, theta_r, phi_r [degree], BRDF [1/sr] and, of spectral tables, wavelength_i [nm] have one
    entry for each direction and wavelength; the wavelength changes fastest. Isotropic tables have phi_i = 0 and phi_r
    up to 180: the other half is its mirror image. The record is the section adhoc_section. The file has about 40 MB at
    most.
    """
    from brdfdb.formats._dense_grid import dense_table, rounded

    dense = dense_table(
        table,
        tolerance,
        axes="light_viewer",
        resolution=resolution,
        most_values=MOST_BYTES // _ENTRY_BYTES,
        digits=_DIGITS,
        last_deg=_LAST_DEG,
    )
    known = dense_record(table, dense, verdict, specular=False)
    nodes = list(dense.grid.axes.values())
    values = dense.values
    for axis, name in enumerate(dense.grid.names):  # 360 degrees are 0 again, and not allowed
        if nodes[axis][-1] == 360.0 and name.startswith("phi"):
            nodes[axis], values = nodes[axis][:-1], np.delete(values, -1, axis)
    if not table.anisotropic:
        nodes.insert(1, np.zeros(1))
    at = dense.channels.wavelength_nm
    spectral = [] if at is None else [at]
    columns = [grid.reshape(-1) for grid in np.meshgrid(*nodes, *spectral, indexing="ij")]
    data = {name: {"unit": "deg", "values": angle.tolist()} for name, angle in zip(_ANGLES, columns, strict=False)}
    data["BRDF"] = {"unit": "1/sr", "values": rounded(values.reshape(-1), _DIGITS).tolist()}
    if at is not None:
        data["wavelength_i"] = {"unit": "nm", "values": columns[-1].tolist()}
    document = {"metadata": _metadata(table, known), "data": data}
    with whole(path) as (half,):
        half.write_text(json.dumps(document, ensure_ascii=False, separators=(",", ":")), encoding="utf-8")
    return Written((path_of(path),), dense.error, dense.tolerance, specular_remark(table))


def recognises(head: bytes) -> bool:
    """Return True for the first bytes of a file that names the schema, or the section ``metadata`` and its type."""
    return head.startswith(b"{") and (b"brdf_json_schema" in head or bool(_TYPE.search(head)))


def read(path: str | os.PathLike[str], **stated: str) -> FileTable | ListedRows:
    """Return f_r of a universal BRDF file: interpolated linearly on a grid of light and viewer, else its samples."""
    path = path_of(path)
    document = parsed(path)
    data = document.get("data")
    metadata = document.get("metadata")
    data = data if isinstance(data, dict) else {}
    metadata = metadata if isinstance(metadata, dict) else {}
    if metadata.get("type", "BRDF") != "BRDF":
        raise FileFormatError(f"{path}: field metadata.type: {metadata['type']!r:.40} is not read; allowed is BRDF")
    comments = [text for name in ("description", "method") if isinstance(text := metadata.get(name), str)]
    for name in ("polarization_i", "polarization_r"):
        entry = data.get(name)
        given = entry.get("values") if isinstance(entry, dict) else None
        states = {json.dumps(state) for state in (given if isinstance(given, list) else [given]) if state is not None}
        if len(states) > 1:
            text = f"rows have the states {', '.join(sorted(states))[:80]}; write a file for each"
            raise FileFormatError(f"{path}: field data.{name}: {text}")
        comments += [f"{name}: {state.strip(chr(34))}" for state in states]
    lists = _lists(path, data)
    known = metadata.get("adhoc_section", {})
    known = {**known} if isinstance(known, dict) else {}
    doubt_comments([part for text in comments for part in re.split(r"[;\n]", text)], known)
    values = lists.pop("BRDF")[:, np.newaxis]
    at = lists.pop("wavelength_i", None)
    uncertainty = lists["uBRDF"][:, np.newaxis] if "uBRDF" in lists else None
    lists.pop("uBRDF", None)
    if at is not None:
        nodes = np.unique(at)
        if len(values) % nodes.size or not np.array_equal(at, np.tile(nodes, len(values) // nodes.size)):
            text = "the directions do not all have the same wavelengths in the same order"
            raise FileFormatError(f"{path}: field data.wavelength_i: {text}")
        values = values.reshape(-1, nodes.size)
        at = nodes
        uncertainty = None if uncertainty is None else uncertainty.reshape(values.shape)
        lists = {name: angle[:: nodes.size] for name, angle in lists.items()}
    listed = functools.partial(listed_rows, path, lists, values, at, known, uncertainty=uncertainty)
    if not np.any(lists["phi_i"]) and np.max(lists["phi_r"]) <= 180.0:
        lists = {"theta_i": lists["theta_i"], "theta_r": lists["theta_r"], "delta_phi": lists["phi_r"]}
    else:
        lists, values = _closed(lists, values)
    return reading_of_rows(path, lists, values, at, known, listed, stated=bool(stated))


def _lists(path: Path, data: dict[str, Any]) -> dict[str, NDArray[np.float64]]:
    """Return the lists of a file: angles [degree], f_r with its uncertainty [1/sr] and wavelengths [nm]."""
    lists: dict[str, NDArray[np.float64]] = {}
    for name in (*_ANGLES, "BRDF", "uBRDF", "wavelength_i", "wavelength_r"):
        entry = data.get(name)
        if isinstance(entry, dict):
            numbers = column(path, name, entry.get("values"), holes=name == "BRDF")
            unit = str(entry.get("unit", ""))
            units = _UNITS["angle" if name in _ANGLES else "BRDF" if name == "uBRDF" else name.partition("_")[0]]
            if unit not in units:
                allowed = ", ".join(word for word in units if word)
                raise FileFormatError(f"{path}: field data.{name}: it has the unit {unit!r:.40}; allowed are {allowed}")
            lists[name] = (
                degrees_of(numbers, unit)
                if name in _ANGLES
                else np.round(numbers * NM_PER[unit], 9)
                if name.startswith("wavelength")
                else numbers
            )
        elif name in (*_ANGLES, "BRDF"):
            raise FileFormatError(f"{path}: field data.{name}: it is missing, or no object with a unit and values")
    for name in ("theta_i", "theta_r"):
        if not str(data[name].get("unit", "")) and lists["theta_i"].max() < _RIGHT_ANGLE > lists["theta_r"].max():
            text = "it has no unit, and no polar angle is above 1.6; state the unit deg or rad"
            raise FileFormatError(f"{path}: field data.{name}: {text}")
    if len({values.size for values in lists.values()}) != 1:
        sizes = ", ".join(f"{name} {values.size}" for name, values in lists.items())
        raise FileFormatError(f"{path}: field data: the lists differ in length: {sizes}")
    if "wavelength_r" in lists and not np.array_equal(
        lists["wavelength_r"], lists.get("wavelength_i", lists["wavelength_r"])
    ):
        raise FileFormatError(
            f"{path}: field data.wavelength_r: it differs from wavelength_i: fluorescence is not read"
        )
    if "wavelength_r" in lists:
        lists.setdefault("wavelength_i", lists["wavelength_r"])
        del lists["wavelength_r"]
    return lists


def _closed(
    lists: dict[str, NDArray[np.float64]], values: NDArray[np.float64]
) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.float64]]:
    """Return the rows of a grid with those at 360 degrees, which a file leaves out; other rows as they are."""
    nodes = [np.unique(lists[name]) for name in _ANGLES]
    shape = tuple(axis.size for axis in nodes)
    if np.prod(shape, dtype=object) != len(values) or nodes[3][0] != 0.0:
        return lists, values
    dense = values.reshape(*shape, -1)
    for axis in (1, 3):
        if nodes[axis].size > 1 and 180.0 < nodes[axis][-1] < 360.0:
            nodes[axis] = np.append(nodes[axis], 360.0)
            dense = np.concatenate([dense, np.take(dense, [0], axis)], axis)
    expected = [grid.reshape(-1) for grid in np.meshgrid(*nodes, indexing="ij")]
    return dict(zip(_ANGLES, expected, strict=True)), dense.reshape(-1, values.shape[1])


def _metadata(table: Table, known: dict[str, Any]) -> dict[str, Any]:
    """Return the section ``metadata`` of a file; what a table does not have is said to be not stated."""
    place = dict.fromkeys(("country", "city", "street", "building_nr", "postal_code"), _NOT_STATED)
    parameters = [
        {"name": name, "description": f"parameter {name} of the model", "value": value, "unit": ""}
        for name, value in known["parameters"].items()
        if isinstance(value, int | float) and not isinstance(value, bool)
    ]
    model = {"name": str(known["model"]), "description": known["source"] or _NOT_STATED, "parameters": parameters}
    return {
        "schema": SCHEMA,
        "id": f"urn:uuid:{uuid.uuid5(uuid.NAMESPACE_URL, f'{table.name}/{table.revision}/{table.digest}')}",
        "type": "BRDF",
        "timestamp": datetime.now(UTC).isoformat(timespec="seconds"),
        "provenance": {
            "organization": _NOT_STATED,
            "location": place,
            "email": "not@stated.invalid",
            "contact_person": _NOT_STATED,
            "comments": known["source"],
        },
        "license": {"type": "other", "rights_holder": _NOT_STATED, "proprietary": known["licence"]},
        "description": title_of(known),
        "method": "measurement" if known["measured"] else "simulation",
        "instrumentation": "NA",
        "software": {"name": "brdfdb", "version": known["program"].removeprefix("brdfdb "), "simulation_model": model},
        "sample": {
            "name": table.name,
            "type": "physical" if known["measured"] else "virtual",
            "shape": "plane",
            "dimensions": {},
            "zero_azimuth_location": "x axis of the surface",
            "properties_symmetry": "none stated" if table.anisotropic else "isotropic",
        },
        "environment": "NA",
        "adhoc_section": known,
    }
