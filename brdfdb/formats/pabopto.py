"""pab-opto: rows of a goniophotometer as text, a header and its rows for each direction of the light.

A header names the direction of the light and whether rows hold the BSDF, in 1/sr, or the DSF, which includes the
cosine of the viewer. Light and viewer on the back, with polar angles above 90 degrees, are turned to the front.
"""

from __future__ import annotations

import os
import re
from array import array
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import FileFormatError
from brdfdb.formats._channels import LUMINOUS, XYZ
from brdfdb.formats._doubts import check_last_number, doubt_comments, doubt_rows
from brdfdb.formats._input import lines_of, plain_number
from brdfdb.measurements.conventions import ListedRows
from brdfdb.parameters import Floats
from brdfdb.place import path_of

suffix = ".dat"
angle_unit = "stated"
signs = re.compile(rb"^#\s*(?:format|intheta|inphi|incident_angle|upphi|colorimetry)\b", re.MULTILINE | re.IGNORECASE)
_QUANTITIES = ("dsf", "bsdf", "brdf", "btdf")
_GRAZING = 1e-6  # cosine of the viewer below which f_r cannot be made of the DSF
_OF_LIGHT = ("intheta", "inphi", "incident_angle")
_OF_FILE = ("format", "colorimetry", "sample_name", "upphi")  # entries that all lights of a file share
_SPLIT = "write a file for each"


class PabBlock(NamedTuple):
    """Rows below a header: the light [degree], and the numbers of its rows from `start` on."""

    light: tuple[float, float]
    start: int


def recognises(head: bytes) -> bool:
    """Return True for the first bytes of a text with the format in a line of its header."""
    return re.search(rb"^#format:\s+theta\s+phi\s", head, re.MULTILINE) is not None


def read(path: str | os.PathLike[str]) -> ListedRows:
    """Return the rows of a file of pab-opto, which may be several files with a header each, one after the other.

    The lines of the header are those that ``pabopto2bsdf`` of Radiance knows. The side of the light is the front.
    """
    path = path_of(path)
    content = _parsed(path)
    header = content.header
    count = content.rows.shape[1]
    words = header.get("format", "").lower().split()
    if len(words) != 3 or words[:2] != ["theta", "phi"] or words[2] not in _QUANTITIES:
        text = f"{header.get('format', '')!r:.60} is not theta phi and one of {', '.join(_QUANTITIES)}"
        raise FileFormatError(f"{path}: field #format: {text}")
    several = len(content.blocks) > 1
    record: dict[str, Any] = {name: text for name, text in header.items() if not (several and name in _OF_LIGHT)}
    light = np.repeat([block.light for block in content.blocks], content.sizes, axis=0)
    angles = np.concatenate([light, content.rows[:, :2]], axis=1)
    doubt_rows(path, angles, content.rows[:, 2:], record)
    doubt_comments([f"{name} {text}" for name, text in header.items()], record)
    back = light[0, 0] > 90.0
    if np.any((light[:, 0] > 90.0) != back):
        raise FileFormatError(f"{path}: field #intheta: lights are on both sides of the surface; {_SPLIT}")
    if back:
        angles = np.array([180.0, 360.0, 180.0, 360.0]) - angles
    if words[2] == "btdf" and np.any(angles[:, 2] < 90.0):
        text = "BTDF is transmission, but viewers are on the side of the light; write BRDF if these reflect"
        raise FileFormatError(f"{path}: field #format: {text}")
    values = content.rows[:, 2:]
    if words[2] == "dsf":
        cosine = np.abs(np.cos(np.deg2rad(angles[:, 2:3])))
        values = np.where(cosine > _GRAZING, values / np.maximum(cosine, _GRAZING), np.nan)
    quantity = "f_r_cos" if words[2] == "dsf" else "f_r"
    record |= {"quantity": quantity, "side": "back" if back else "front"}
    name = header.get("sample_name", "").strip('"') or path.stem
    channels = XYZ if count == 5 else LUMINOUS
    return ListedRows(np.deg2rad(angles), values, name, channels, None, record, quantity=quantity)


class PabFile(NamedTuple):
    """Content of a file: the entries of its first header, its blocks, and rows (N, 2 + C) of theta, phi and values."""

    header: dict[str, str]
    blocks: list[PabBlock]
    rows: Floats

    @property
    def sizes(self) -> NDArray[np.int64]:
        """Number of rows of each block."""
        return np.diff([*(block.start for block in self.blocks), len(self.rows)])


def _parsed(path: Path) -> PabFile:
    """Return the content of a file; FileFormatError if a row is damaged, or a header differs in more than the light."""
    header: dict[str, str] = {}
    above: dict[str, tuple[int, str]] = {}  # entries with their lines, since the last row
    blocks: list[PabBlock] = []
    numbers = array("d")
    count = 0
    for line_number, line in lines_of(path):
        if line.lstrip().startswith("#"):
            name, text = (*line.lstrip()[1:].strip().split(None, 1), "", "")[:2]
            name = name.partition(":")[0].lower() if name.endswith(":") else name.lower()
            if name in _OF_FILE and header.get(name, text.strip()) != text.strip():
                was = f"{text.strip()!r:.60} differs from {header[name]!r:.60} above"
                raise FileFormatError(f"{path}: line {line_number}, field #{name}: {was}; {_SPLIT}")
            header.setdefault(name, text.strip())
            if name in _OF_LIGHT:
                if name in above:
                    where = f"line {line_number}, field #{name}"
                    raise FileFormatError(
                        f"{path}: {where}: it stands in line {above[name][0]}, too, without rows between"
                    )
                above[name] = line_number, text.strip()
            continue
        fields = line.split()
        if not fields:
            continue
        count = count or (5 if header.get("colorimetry", "").lower() == "cie-xyz" else 3)
        if above or not blocks:
            blocks.append(PabBlock(_light(path, above), len(numbers) // count))
            above = {}
        if len(fields) != count:
            raise FileFormatError(
                f"{path}: line {line_number} has {len(fields)} fields; expected are {count}: theta, phi and values"
            )
        for field in fields:
            try:
                numbers.append(plain_number(field))
            except ValueError:
                numbers.append(np.nan)
            if not np.isfinite(numbers[-1]):
                comma = "; write decimal points" if "," in field else ""
                raise FileFormatError(f"{path}: line {line_number}: {field[:40]!r} is not a finite number{comma}")
        if not 0.0 <= numbers[-count] <= 180.0:
            where = f"line {line_number}, field theta"
            raise FileFormatError(f"{path}: {where}: {fields[0]:.40} is no polar angle; allowed are 0 to 180 degrees")
    if not numbers:
        raise FileFormatError(f"{path}: it has no rows")
    if above:
        number = min(line for line, _ in above.values())
        raise FileFormatError(f"{path}: line {number}: no rows follow this header: the file was cut")
    rows = ((number, line.split()) for number, line in lines_of(path) if not line.lstrip().startswith("#"))
    check_last_number(path, ((number, fields[-1]) for number, fields in rows if fields))
    return PabFile(header, blocks, np.frombuffer(numbers, dtype=np.float64).reshape(-1, count))


def _light(path: Path, header: dict[str, tuple[int, str]]) -> tuple[float, float]:
    """Return polar angle and azimuth [degree] of the light in the entries of a header."""
    given = []
    where = f"{path}: field #incident_angle, or #intheta and #inphi"
    for names in (("intheta", "inphi"), ("incident_angle",)):
        if words := " ".join(header[name][1] for name in names if name in header).split():
            try:
                theta, phi = (plain_number(word) for word in words)
            except ValueError:
                theta = phi = np.nan
            if not (0.0 <= theta <= 180.0 and np.isfinite(phi)):
                raise FileFormatError(f"{where}: {words} are not a polar angle and an azimuth")
            given.append((theta, phi))
    if not given:
        raise FileFormatError(f"{where}: it is missing before the rows")
    if given[0] != given[-1]:
        line = header["incident_angle"][0]
        text = f"{given[-1]} contradicts #intheta and #inphi, {given[0]}"
        raise FileFormatError(f"{path}: line {line}, field #incident_angle: {text}; remove the wrong one")
    return given[0]
