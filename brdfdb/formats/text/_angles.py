"""Angles of texts: their units, the relative azimuth, and letters that a file has exchanged."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError
from brdfdb.formats._record import note
from brdfdb.formats.text._columns import ANGLE_UNITS, ANGLES, AZIMUTHS, TextLayout, angle_unit, plain_name
from brdfdb.formats.text._rows import line_of_row

Array = NDArray[np.float64]

_WORDS = {"deg": "degrees", "rad": "radians", "mrad": "milliradians"}
_OF_ANGLES = re.compile(r"\bangles?\b[^.;\d]{0,40}\b(deg(?:rees?)?|(?:milli)?radians?|m?rad)\b", re.IGNORECASE)
_SHOWN = 200  # characters of a title that a sentence repeats
_FLAT = 1e-6  # sine of an angle to the plane of incidence that is rounding
_UPRIGHT = np.radians(90.0 + 1e-6)


def angles_of_rows(
    path: Path, rows: Array, roles: Mapping[str, list[int]], layout: TextLayout, unit: str, record: dict[str, Any]
) -> Array:
    """Return theta_i, phi_i, theta_r, phi_r [rad] of rows, shape (N, 4)."""
    from brdfdb.measurements.samples import RELATIVE

    given = {name: rows[:, roles[name][0]] for name in ANGLES if name in roles}
    for name, column in given.items():
        if np.any(np.isnan(column)):
            number = line_of_row(path, layout, int(np.argmax(np.isnan(column))))
            raise FileFormatError(f"{path}: line {number}, field {layout.names[roles[name][0]]}: an angle is missing")
    units = _units(path, given, roles, layout, unit, record)
    if "delta_phi" in given and plain_name(layout.names[roles["delta_phi"][0]]) in AZIMUTHS:
        note(
            record,
            f"The column {layout.names[roles['delta_phi'][0]]} was taken as the azimuth from the light to the viewer.",
        )
    record["angles"] = " and ".join(_WORDS[unit] for unit in sorted(set(units.values())))
    given = {name: column * ANGLE_UNITS[units[name]] for name, column in given.items()}
    if not {"phi_r", "delta_phi"} & set(given):
        given["delta_phi"] = _in_plane(path, given, layout, record)
    relative = "phi_i" not in given
    if relative:
        given["phi_i"] = np.zeros(len(rows))
    _exchange(given, record)
    swept = bool(np.any(given["theta_i"] < 0.0)) and np.ptp(given["phi_i"]) == 0.0
    for side in ("i", "r"):
        theta, phi = given[f"theta_{side}"], f"phi_{side}" if f"phi_{side}" in given else "delta_phi"
        given[phi] = np.where(theta < 0.0, given[phi] + np.pi, given[phi])
        if side == "i" and "delta_phi" in given:  # the viewer turns with the light
            given["delta_phi"] = np.where(theta < 0.0, given["delta_phi"] - np.pi, given["delta_phi"])
        given[f"theta_{side}"] = np.abs(theta)
        if np.any(np.abs(theta) > np.pi * (1.0 + 1e-9)):
            row = int(np.argmax(np.abs(theta)))
            shown = np.rad2deg(np.abs(theta[row]))
            line = line_of_row(path, layout, row)
            raise FileFormatError(f"{path}: line {line}: theta_{side} of {shown:g} degrees is not a polar angle")
    phi_i = given["phi_i"]
    phi_r = given["phi_r"] if "phi_r" in given else phi_i + given["delta_phi"]
    flat = np.abs(np.sin(phi_r - phi_i)) * np.sin(given["theta_r"]) < _FLAT
    if relative or (swept and flat.all()):  # signed angles in one plane: the surface has not turned
        record["azimuths"] = RELATIVE
        phi_i, phi_r = np.zeros(len(rows)), phi_r - phi_i
    return np.stack([given["theta_i"], phi_i, given["theta_r"], phi_r], axis=1)


def _in_plane(path: Path, given: Mapping[str, Array], layout: TextLayout, record: dict[str, Any]) -> Array:
    """Return the azimuth [rad] of positive theta_r in a text without azimuths, where the sign of theta_r has the side.

    If lights have signs, too, both angles are places along one arc. Else positive theta_r is the mirror side.
    """
    if not np.any(given["theta_r"] < 0.0):
        where = f"{path}: line {layout.line}"
        text = "no column is the azimuth of the viewer, and no negative theta_r tells its side"
        raise FileFormatError(f"{where}: {text}; name a column: --column delta_phi=NAME")
    along = bool(np.any(given["theta_i"] < 0.0))
    of_signs = (
        "of the sign of theta_i are on the side of the light" if along else "at positive theta_r are on the mirror side"
    )
    text = f"No column is an azimuth: viewers were taken to be in the plane of incidence, and those {of_signs}."
    note(record, f"{text} --azimuth forward exchanges the sides.")
    return np.full(len(given["theta_r"]), 0.0 if along else np.pi)


def _units(
    path: Path,
    given: Mapping[str, Array],
    roles: Mapping[str, list[int]],
    layout: TextLayout,
    unit: str,
    record: dict[str, Any],
) -> dict[str, str]:
    """Return the unit of each angle: that of the user, or of its name, or of other names, or of a title on angles."""
    if unit != "auto":
        return dict.fromkeys(given, unit)
    units = {}
    for name in given:
        column = layout.described[roles[name][0]]
        units[name] = angle_unit(column)
        if units[name] not in ("", *ANGLE_UNITS):
            where = f"{path}: line {layout.line}, field {column}"
            raise FileFormatError(
                f"{where}: the unit {units[name]!r} is not a unit of angles; allowed are deg, rad and mrad"
            )
    named = sorted(set(units.values()) - {""})
    unnamed = {name: column for name, column in given.items() if not units[name]}
    titles = [line for line in layout.titles if _OF_ANGLES.search(line)]
    stated = {angle_unit(f"[{match[1]}]") for line in titles for match in _OF_ANGLES.finditer(line)}
    if unnamed and not named and len(stated) == 1:
        unit = stated.pop()
        note(record, f"Angles were taken as {_WORDS[unit]}: a title says {titles[0].strip()[:_SHOWN]!r}.")
        return dict.fromkeys(given, unit)
    other = named[0] if len(named) == 1 else "deg"  # of columns whose names give none
    # Angles without a unit may be radians if they are in the range of radians and not all 0
    largest = {name: float(np.abs(column).max(initial=0.0)) for name, column in unnamed.items()}
    bounds = {name: (0.5 if name.startswith("theta") else 2.0) * np.pi + 1e-3 for name in unnamed}
    may_be_radians = all(largest[name] <= bounds[name] for name in unnamed) and any(largest.values())
    if other == "deg" and unnamed and may_be_radians:
        if named:
            columns = [layout.names[roles[name][0]] for name in unnamed]
            subject = f"The column {columns[0]} was"
            verb = "it gives"
            if len(columns) > 1:
                subject = f"The columns {' and '.join(columns)} were"
                verb = "they give"
            text = f"{subject} taken as degrees, as other columns are, but {verb} no unit and may be radians"
            note(record, f"{text}: names such as {plain_name(columns[0])}_rad say so.")
        else:
            text = "no polar angle exceeds pi/2 and no azimuth 2 pi, so they may be radians: --angles rad reads them so"
            note(record, f"Angles were taken as degrees, but no name gives a unit, {text}.")
    return {name: own or other for name, own in units.items()}


def _exchange(given: dict[str, Array], record: dict[str, Any]) -> None:
    """Exchange theta and phi where theta of most rows cannot be the polar angle, and phi of all can."""
    if not {"phi_i", "phi_r"} <= set(given) or np.all(np.abs(given["theta_i"]) <= _UPRIGHT):
        return
    beyond = np.maximum(np.abs(given["theta_i"]), np.abs(given["theta_r"])) > _UPRIGHT
    if 2 * np.count_nonzero(beyond) <= beyond.size:  # some rows of transmitted light
        return
    if max(np.abs(given["phi_i"]).max(), np.abs(given["phi_r"]).max()) <= _UPRIGHT:
        for side in ("i", "r"):
            theta, phi = f"theta_{side}", f"phi_{side}"
            given[theta], given[phi] = given[phi], given[theta]
        record["exchanged"] = "theta exceeds 90 degrees and phi does not: phi was read as the polar angle"
