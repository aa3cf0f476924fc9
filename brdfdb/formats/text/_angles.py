"""Angles of texts: their units, the azimuths, the specular direction, and letters that a file has exchanged."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.formats.text._columns import (
    ANGLES,
    OTHER_ANGLES,
    angle_unit,
    of_surface,
    plain_name,
    role_of,
)
from brdfdb.formats.text._sheet import TextSheet
from brdfdb.measurements.conventions import ANGLE_UNITS, EXCHANGED, FROM_LIGHT, RELATIVE

Array = NDArray[np.float64]

_WORDS = {"deg": "degrees", "rad": "radians", "mrad": "milliradians"}
_OF_ANGLES = re.compile(
    r"(?:\bangles?\b[^.;\d]{0,40}?|\bunits?(?: of [\w ]{1,20})?\W{1,3})"
    rf"\b(deg(?:rees?)?|(?:milli)?radians?|m?rad|{'|'.join(OTHER_ANGLES)})\b",
    re.IGNORECASE,
)
_FROM_SURFACE = re.compile(
    r"\b(?:angles?|theta\w*)\b[^.;\d]{0,30}\b"
    r"(?:elevations?|altitudes?|(?:from|above|to) the (?:surface|horizon|sample))\b(?![^.;]{0,15}\d)"
    r"|\b(?:angles?|theta\w*)\b[ ,:=]*(?:(?:is|are|as|given|measured|in|of) )*(?:the )?(?:grazing|glancing) angles?\b"
    r"|^\W*(?:angles?|theta\w*)\W+(?:(?:is|are|as|given|measured) )*(?:grazing|glancing)\W*$"
    r"|^\W*(?:all |the )?(?:elevation|altitude) angles?\b(?! *(?:of|up|[<>=:]|\d))"
    r"|^\W*(?:all |the )?(?:grazing|glancing) angles?(?: in degrees)?\W*$",
    re.IGNORECASE,
)
_FROM_NORMAL = re.compile(r"\b(?:no|not|without|normal|zenith|complements?|sites?|90)\b", re.IGNORECASE)
_OF_SURFACE = re.compile(
    r"\b(?:elevations?|altitudes?|(?:grazing|glancing) angles?)\b(?![^.;]{0,20}\d+(?:\.\d+)? ?(?:m|km|ft|feet)\b)",
    re.IGNORECASE,
)
_FROM_SPECULAR = re.compile(
    r"\b(?:angles?|theta\w*|scatter\w*)\b[^.;\d]{0,40}\b(?:relative to|from|off|with respect to|about|rel\.? to) "
    r"(?:the )?specular\b",
    re.IGNORECASE,
)
_LIGHT = r"\b(?:inciden\w+|incoming|light|source|laser|illuminat\w+|beam)\b"
_VIEWER = r"\b(?:detector|receiver|sensor|viewer|camera|scatter\w*|observ\w+|view\w*)\b"
_FROM_LIGHT = re.compile(
    rf"\bangles?\b[^.;]{{0,20}}\bbetween\b[^.;]{{0,30}}(?:{_LIGHT}[^.;]{{0,25}}\band\b[^.;]{{0,25}}{_VIEWER}"
    rf"|{_VIEWER}[^.;]{{0,25}}\band\b[^.;]{{0,25}}{_LIGHT})"
    r"|\bangles?\b[^.;]{0,25}\b(?:from|relative to) the (?:incident|incoming|laser|light) (?:beam|source|ray)\b",
    re.IGNORECASE,
)
_OF_OTHERS = re.compile(r"\b(?:no|not|without|azimuths?|\w*phi(?:_\w+)?|phase|planes?)\b", re.IGNORECASE)
_AZIMUTH = re.compile(r"(?:^|_)(?:d?phi|azi?m?\w*|az)(?:_|$)")
_NO = re.compile(r"\b(?:no|not|without)\b", re.IGNORECASE)
_FLAT = 1e-6  # sine of an angle to the plane of incidence that is rounding
_TILTED_DEG = (15.0, 75.0)  # polar angles of lights that tell the sides apart
_NEAR_DEG = 7.0  # of a direction, within which a lobe is looked for
_CLEAR = 1.25  # of f_r in the one direction to that in another, from which on there is a lobe
_UPRIGHT = np.radians(90.0 + 1e-6)
_TRANSMITTED = 0.25  # share of viewers behind a surface, from which on 90 degrees may be its normal


def angles_of_rows(sheet: TextSheet, angles: str) -> Array:
    """Return theta_i, phi_i, theta_r, phi_r [rad] of rows, shape (N, 4); the user states the words `angles`."""
    record = sheet.record
    count = len(sheet.lines)
    words = angles.split(",") if angles else []
    given = _columns_of_angles(sheet)
    units = _units(sheet, given, next((word for word in words if word in ANGLE_UNITS), ""))
    viewer = next((role for role in ("phi_r", "delta_phi") if role in given and "phi_i" not in given), "")
    if viewer and role_of(name := sheet.name(viewer)) != "delta_phi":
        sheet.note(f"The column {name} was taken as the azimuth from the light to the viewer.")
    record["angles"] = " and ".join(_WORDS[unit] for unit in sorted(set(units.values())))
    given = {name: column * ANGLE_UNITS[units[name]] for name, column in given.items()}
    _from_surface(sheet, given, words)
    _from_specular(sheet, given)
    azimuth = next((given[name] for name in ("phi_r", "delta_phi") if name in given), None)
    if azimuth is None:
        given["delta_phi"] = _in_plane(sheet, given)
    elif "phi_i" not in given and np.ptp(azimuth) == 0.0 and np.ptp(np.sign(given["theta_r"])) == 2.0:
        record["plane"] = "one azimuth"
    rotation = given.pop("rotation", np.zeros(1))
    relative = "phi_i" not in given and np.ptp(rotation) == 0.0
    if "delta_phi" in given and not relative:
        record[FROM_LIGHT] = "light"
    given.setdefault("phi_i", np.zeros(count))
    _exchange(given, record, stated=EXCHANGED in words)
    swept = bool(np.any(given["theta_i"] < 0.0)) and np.ptp(given["phi_i"]) == 0.0
    viewer = "phi_r" if "phi_r" in given else "delta_phi"
    for theta, phi in (("theta_i", "phi_i"), ("theta_r", viewer)):
        turn = np.where(given[theta] < 0.0, np.pi, 0.0)
        given[phi] = given[phi] + turn
        if phi == "phi_i" and viewer == "delta_phi":  # the viewer stays where it is
            given[viewer] = given[viewer] - turn
        given[theta] = np.abs(given[theta])
        if np.any(given[theta] > np.pi * (1.0 + 1e-9)):
            row = int(np.argmax(given[theta]))
            text = f"{theta} of {np.rad2deg(given[theta][row]):g} degrees is not a polar angle{_remedy(given)}"
            raise sheet.error(text, row=row)
    phi_i = given["phi_i"]
    phi_r = given["phi_r"] if "phi_r" in given else phi_i + given["delta_phi"]
    flat = np.abs(np.sin(phi_r - phi_i)) * np.sin(given["theta_r"]) < _FLAT
    if np.ptp(rotation) > 0.0:
        sheet.note("The rotation of the sample was added to the azimuths of light and viewer; their difference stays.")
        phi_i, phi_r = phi_i + rotation, phi_r + rotation
    elif relative or (swept and flat.all()):  # signed angles in one plane: the surface has not turned
        record["azimuths"] = RELATIVE
        phi_i, phi_r = np.zeros(count), phi_r - phi_i
    return np.stack([given["theta_i"], phi_i, given["theta_r"], phi_r], axis=1)


def _columns_of_angles(sheet: TextSheet) -> dict[str, Array]:
    """Return the numbers of columns of angles, by role; cells below that of a light are empty where it is the same."""
    given = {name: sheet.numbers[:, sheet.roles[name][0]] for name in ANGLES if name in sheet.roles}
    light = given.get("theta_i", np.zeros(1))
    if 2 * np.sum(np.isnan(light)) > len(light) and light[0] >= 0.0:
        given["theta_i"] = light[np.maximum.accumulate(np.where(np.isnan(light), 0, np.arange(len(light))))]
        sheet.note(f"Empty cells of {sheet.name('theta_i')} were read as the number above them.")
    for name, column in given.items():
        if np.any(np.isnan(column)):
            raise sheet.error("an angle is missing", sheet.roles[name][0], int(np.argmax(np.isnan(column))))
    return given


def _from_surface(sheet: TextSheet, given: dict[str, Array], words: Sequence[str]) -> None:
    """Make polar angles of those that names or titles say to count from the surface, unless the user says it."""
    if any(word.startswith("elevation") for word in words):
        return
    sides = [name for name in ("theta_i", "theta_r") if name in given]
    of_names = [name for name in sides if of_surface(sheet.name(name))]
    title = "" if words else sheet.layout.title(_FROM_SURFACE, but=_FROM_NORMAL)
    for name in of_names or (sides if title else []):
        given[name] = 0.5 * np.pi - given[name]
    if of_names:
        shown = " and ".join(map(sheet.name, of_names))
        sheet.note(f"Polar angles are 90 degrees minus the numbers of {shown}, which count from the surface.")
    elif title:
        text = f"A title says {title!r}: polar angles are 90 degrees minus the numbers of the file"
        sheet.note(f"Elevation: {text}. --angles deg takes the numbers as polar angles.")
    elif not words and (title := sheet.layout.title(_OF_SURFACE)):
        text = f"A title says {title!r}. If polar angles count from the surface, --angles elevation"
        sheet.note(f"Elevation? {text} reads them so.")


def _from_specular(sheet: TextSheet, given: dict[str, Array]) -> None:
    """Make theta_r of angles in the plane of incidence from the specular direction, where a name or a title says so."""
    has_azimuth = not given.keys().isdisjoint(("phi_r", "delta_phi"))
    title = "" if "from_specular" in given else sheet.layout.title(_FROM_SPECULAR, but=_NO)
    if "from_specular" not in given and (from_light := sheet.layout.title(_FROM_LIGHT, but=_OF_OTHERS)):
        text = f"A title says {from_light!r}, but theta_r was read as the angle from the normal of the sample"
        sheet.note(f"Angles? {text}: if it counts from the light, subtract theta_i.")
    if "from_specular" not in given and (not title or has_azimuth):
        return
    offset = given.pop("theta_r" if title else "from_specular")
    column = sheet.roles["theta_r" if title else "from_specular"][0]
    name = sheet.names[column]
    if "theta_r" in given:
        sheet.record.setdefault("columns_left_out", []).append(name)
        return
    if has_azimuth:
        raise sheet.error(
            "angles from the specular direction are read in the plane of incidence only, and a column is an azimuth; "
            "write theta_r and phi_r from the normal",
            column,
        )
    sign = -1.0 if "aspec" in plain_name(name) else 1.0  # aspecular angles count towards the light
    given["theta_r"] = given["theta_i"] + sign * offset
    given["delta_phi"] = np.full(len(offset), np.pi)
    side = "towards the light" if sign < 0.0 else "away from the normal"
    text = f"{name} counts from the specular direction, positive {side}"
    text += f", as a title says: {title!r}" if title else ""
    sheet.note(f"{text}: theta_r is theta_i {'-' if sign < 0.0 else '+'} the number, in the plane of incidence.")


def _in_plane(sheet: TextSheet, given: Mapping[str, Array]) -> Array:
    """Return the azimuth [rad] of positive theta_r in a text without azimuths, where the sign of theta_r has the side.

    If lights have signs, too, both angles are places along one arc. Else positive theta_r is the mirror side.
    """
    unused = [name for column, name in enumerate(sheet.names) if column not in sheet.used]
    azimuth = next((name for name in unused if _AZIMUTH.search(plain_name(name))), "")
    if azimuth or np.ptp(given.get("phi_i", np.zeros(1))) > 0.0:
        text = "no column is the azimuth of the viewer" + (f", unless {azimuth} is" if azimuth else "")
        raise sheet.error(f"{text}; name a column: --column delta_phi=NAME or phi_r=NAME")
    along = bool(np.any(given["theta_i"] < 0.0))
    one_sided = not along and not np.any(given["theta_r"] < 0.0)
    if one_sided and np.mean(given["theta_r"] > _UPRIGHT) > _TRANSMITTED:
        name = sheet.name("theta_r") if "theta_r" in sheet.roles else "theta_r"
        text = f"{name} reaches {np.rad2deg(given['theta_r'].max()):g} degrees, and none is negative"
        sheet.note(f"Normal? {text}. If 90 degrees is the normal of the sample, subtract 90 from the column.")
    sheet.record["plane"] = "signs" if along else "one side" if one_sided else "mirror side"
    return np.full(len(given["theta_r"]), 0.0 if along else np.pi)


def _units(sheet: TextSheet, given: Mapping[str, Array], unit: str) -> dict[str, str]:
    """Return the unit of each angle: that of the user, or of its name, or of other names, or of a title on angles."""
    if unit:
        return dict.fromkeys(given, unit)
    units = {}
    for name in given:
        column = sheet.roles[name][0]
        units[name] = angle_unit(sheet.described[column])
        if units[name] not in ("", *ANGLE_UNITS):
            text = f"the unit {units[name]!r} is not a unit of angles; allowed are deg, rad and mrad"
            raise sheet.error(text, column)
    of_table = [name for name in given if sheet.layout.heads or sheet.name(name) in sheet.layout.names]
    named = sorted({units[name] for name in of_table} - {""})  # a line such as AOI (rad) = 0.2 has a unit of its own
    unnamed = [name for name in given if not units[name]]
    stated = {angle_unit(f"[{match[1]}]") for line in sheet.layout.titles for match in _OF_ANGLES.finditer(line)}
    if unnamed and not named and len(stated) == 1:
        if (unit := stated.pop()) not in ANGLE_UNITS:
            raise sheet.error(f"a title gives angles the unit {unit!r}; allowed are deg, rad and mrad")
        sheet.note(f"Angles were taken as {_WORDS[unit]}: a title says {sheet.layout.title(_OF_ANGLES)!r}.")
        return dict.fromkeys(given, unit)
    other = named[0] if len(named) == 1 else "deg"  # of columns whose names give none
    # Angles without a unit may be radians if they are in the range of radians and not all 0
    largest = {name: float(np.abs(given[name]).max(initial=0.0)) for name in unnamed}
    most = {name: (0.5 if name.startswith("theta") else 2.0) * np.pi + 1e-3 for name in unnamed}
    may_be_radians = all(largest[name] <= most[name] for name in unnamed) and any(largest.values())
    if other == "deg" and may_be_radians and not named:
        text = "no polar angle exceeds pi/2 and no azimuth 2 pi, so they may be radians: --angles rad reads them so"
        sheet.note(f"Angles were taken as degrees, but no name gives a unit, {text}.")
    elif other == "deg" and may_be_radians:
        for name in map(sheet.name, unnamed):
            text = f"The column {name} was taken as degrees, as others are, but gives no unit and may be radians"
            sheet.note(f"{text}: a name such as {plain_name(name)}_rad says so.")
    return {name: unit or other for name, unit in units.items()}


def _remedy(given: Mapping[str, Array]) -> str:
    """Return how to read a file whose azimuths may be its polar angles; empty if they may not."""
    turns = np.concatenate([given[name] for name in ("phi_i", "phi_r", "delta_phi") if name in given])
    several = np.unique(turns).size > 2 and np.all((turns >= 0.0) & (turns <= _UPRIGHT))
    return "; if theta and phi are exchanged: --angles exchanged" if several else ""


def _exchange(given: dict[str, Array], record: dict[str, Any], *, stated: bool) -> None:
    """Exchange theta and phi if it is stated, or theta of most rows cannot be the polar angle and phi of all can."""
    pairs = {"theta_r": "delta_phi"} if "delta_phi" in given else {"theta_i": "phi_i", "theta_r": "phi_r"}
    if not stated:
        beyond = [np.abs(given[theta]) > _UPRIGHT for theta in ("theta_i", "theta_r")]
        most = 2 * np.count_nonzero(beyond[0] | beyond[1]) > len(beyond[0])  # else some rows are of transmitted light
        upright = all(np.all(np.abs(given[phi]) <= _UPRIGHT) for phi in pairs.values())
        if "delta_phi" in given or not (beyond[0].any() and most and upright):
            return
    for theta, phi in pairs.items():
        given[theta], given[phi] = given[phi], given[theta]
    text = "phi was read as the polar angle"
    reason = "theta exceeds 90 degrees and phi does not"
    record["exchanged"] = f"{text}, as was stated" if stated else f"{reason}: {text}"


def lobe_of(angles: Array, f_r: Array) -> str:
    """Return where the lobe of samples in the plane of incidence lies: mirror, light, normal, or "" if nothing tells.

    `angles` (N, 4) [rad] and `f_r` (N,) are those of samples. A lobe is at the normal if it stays there at all
    incidences of 15 degrees and more, as if angles counted from the specular direction.
    """
    theta_i, theta_r = np.rad2deg(angles[:, [0, 2]]).T
    place = np.where(np.cos(angles[:, 3] - angles[:, 1]) < 0.0, theta_r, -theta_r)  # positive on the mirror side
    lights = np.round(theta_i)
    votes = []
    for light in np.unique(lights[(lights >= _TILTED_DEG[0]) & (lights <= _TILTED_DEG[1]) & np.isfinite(f_r)]):
        rows = (lights == light) & np.isfinite(f_r) & (theta_r < 85.0)
        parts = {"mirror": light, "light": -light, "normal": 0.0}
        peaks = {part: f_r[rows & (np.abs(place - at) <= _NEAR_DEG)].max(initial=0.0) for part, at in parts.items()}
        first, second, _ = sorted(peaks, key=lambda part: float(peaks[part]), reverse=True)
        votes.append(first if peaks[first] > _CLEAR * peaks[second] else "")
    for part in ("mirror", "light", "normal"):
        if votes and 2 * votes.count(part) > len(votes):
            return part
    return ""
