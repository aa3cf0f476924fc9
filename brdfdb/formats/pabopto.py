"""pab-opto: rows of a goniophotometer as text, one file for each direction of the light.

The header names the direction of the light and whether rows hold the BSDF, in 1/sr, or the DSF, which includes the
cosine of the viewer. Light and viewer on the back, with polar angles above 90 degrees, are turned to the front.
"""

from __future__ import annotations

import os
from array import array
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from brdfdb.errors import FileFormatError
from brdfdb.formats._channels import LUMINOUS, XYZ
from brdfdb.formats._input import lines_of
from brdfdb.formats._nodes import samples_at_angles, without_fill_values
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.measurements.samples import Samples

suffix = ".dat"
_QUANTITIES = ("dsf", "bsdf", "brdf", "btdf")
_GRAZING = 1e-6  # cosine of the viewer below which f_r cannot be made of the DSF


def recognises(head: bytes) -> bool:
    """Return True for the first bytes of a text with the format in a line of its header."""
    return any(line.startswith(b"#format: theta phi ") for line in head.split(b"\n"))


def read(path: str | os.PathLike[str]) -> Samples:
    """Return the samples of a file of pab-opto.

    The lines of the header are those that ``pabopto2bsdf`` of Radiance knows. The side of the light is the front.
    """
    path = path_of(path)
    header: dict[str, str] = {}
    numbers = array("d")
    count = 0
    for line_number, line in lines_of(path):
        if line.startswith("#"):
            name, _, text = line[1:].strip().partition(" ")
            header.setdefault(name.rstrip(":"), text.strip())
            continue
        fields = line.split()
        count = count or (5 if header.get("colorimetry", "").lower() == "cie-xyz" else 3)
        if not fields:
            continue
        if len(fields) != count:
            raise FileFormatError(
                f"{path}: line {line_number} has {len(fields)} fields; expected are {count}: theta, phi and values"
            )
        for field in fields:
            try:
                numbers.append(float(field))
            except ValueError:
                numbers.append(np.nan)
            if not np.isfinite(numbers[-1]):
                raise FileFormatError(f"{path}: line {line_number}: {field[:40]!r} is not a finite number")
    if not numbers:
        raise FileFormatError(f"{path}: it has no rows")
    rows = np.frombuffer(numbers, dtype=np.float64).reshape(-1, count)
    quantity = header.get("format", "").split()[-1].lower() if header.get("format") else ""
    if quantity not in _QUANTITIES:
        raise FileFormatError(f"{path}: field #format: {quantity!r} is not one of {', '.join(_QUANTITIES)}")
    light = _light(path, header)
    angles = np.concatenate([np.broadcast_to(light, (len(rows), 2)), rows[:, :2]], axis=1)
    back = light[0] > 90.0
    if back:
        angles = np.array([180.0, 360.0, 180.0, 360.0]) - angles
    values = without_fill_values(rows[:, 2:].copy())
    if quantity == "dsf":
        cosine = np.abs(np.cos(np.deg2rad(angles[:, 2:3])))
        values = np.where(cosine > _GRAZING, values / np.maximum(cosine, _GRAZING), np.nan)
    record = {**header, "quantity": "f_r_cos" if quantity == "dsf" else "f_r", "side": "back" if back else "front"}
    name = header.get("sample_name", "").strip('"') or path.stem
    return samples_at_angles(np.deg2rad(angles), values, name, XYZ if count == 5 else LUMINOUS, None, record)


def _light(path: Path, header: dict[str, str]) -> tuple[float, float]:
    """Return polar angle and azimuth [degree] of the light."""
    words = [header.get("intheta", ""), header.get("inphi", "")]
    if "incident_angle" in header:
        words = [*header["incident_angle"].split(), "", ""][:2]
    try:
        theta, phi = (float(word) for word in words)
    except ValueError:
        theta = phi = np.nan
    if not (0.0 <= theta <= 180.0 and np.isfinite(phi)):
        raise FileFormatError(f"{path}: field #incident_angle, or #intheta and #inphi: {words} are not two angles")
    return theta, phi
