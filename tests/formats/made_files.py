"""Small files of one made surface in the formats of laboratories, and what they hold at each direction.

Each function gives the text or the bytes of a file with lights at `LIGHTS` and viewers at `POLAR` and `AZIMUTHS`, which
count from the light. f_r is reciprocal, and asymmetric about the plane of incidence: a mirrored azimuth is seen.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from brdfdb.parameters import Floats

LIGHTS = (10.0, 35.0, 60.0)
POLAR = (0.0, 20.0, 40.0, 60.0, 80.0)
AZIMUTHS = tuple(np.arange(0.0, 360.0, 30.0))
DIRECTIONS = ((10.0, 40.0, 90.0), (35.0, 60.0, 180.0), (60.0, 20.0, 330.0))  # at which values are compared
NM = 550.0


def f_r(theta_i: ArrayLike, theta_r: ArrayLike, delta_phi: ArrayLike) -> Floats:
    """Return f_r [1/sr] of the made surface at angles [degree]."""
    light, viewer, turn = (np.deg2rad(angle) for angle in (theta_i, theta_r, delta_phi))
    across = np.sin(light) * np.sin(viewer)
    return np.asarray(0.2 + 0.1 * np.cos(light) * np.cos(viewer) - across * (0.09 * np.cos(turn) - 0.03 * np.sin(turn)))


def rows() -> Iterator[tuple[float, float, float, float]]:
    """Yield theta_i, theta_r, delta_phi [degree] and f_r [1/sr]."""
    for theta_i, theta_r, delta_phi in itertools.product(LIGHTS, POLAR, AZIMUTHS):
        yield theta_i, theta_r, float(delta_phi), float(f_r(theta_i, theta_r, delta_phi))


def sheet(names: str = "theta_i,theta_r,delta_phi,BRDF") -> str:
    """Return a text of columns."""
    return "\n".join([names, *(f"{i:g},{r:g},{turn:g},{value:.6f}" for i, r, turn, value in rows())]) + "\n"


def astm(channel: str = "550nm") -> str:
    """Return an ASTM file."""
    turns = [f"{np.deg2rad(i):.8g},0,{np.deg2rad(r):.8g},{np.deg2rad(turn):.8g},{v:.6f}" for i, r, turn, v in rows()]
    return "\n".join(
        ["TITLE made", f"NUM_POINTS {len(turns)}", f"VARS theta_i,phi_i,theta_s,phi_s,{channel}", *turns, ""]
    )


def fred(azimuth: float = 0.0) -> str:
    """Return a file of FRED whose light travels into an azimuth [degree]."""
    lines = ["type bsdf_data", "format angles=deg bsdf=value scale=1"]
    for theta_i in LIGHTS:
        lines.append(f"{theta_i:g}\t{azimuth:g}")
        for _, theta_r, turn, value in (row for row in rows() if row[0] == theta_i):
            lines.append(f"{theta_r:g}\t{(turn + azimuth + 180.0) % 360.0:g}\t{value:.6f}")
    return "\n".join(lines) + "\n"


def pabopto(quantity: str = "BRDF") -> str:
    """Return a file of pab-opto of several lights."""
    lines = []
    for theta_i in LIGHTS:
        lines += ['#sample_name "made"', f"#format: theta phi {quantity}", f"#intheta {theta_i:g}", "#inphi 20"]
        for _, theta_r, turn, value in (row for row in rows() if row[0] == theta_i):
            number = value * np.cos(np.deg2rad(theta_r)) if quantity == "DSF" else value
            lines.append(f"{theta_r:g} {(turn + 20.0) % 360.0:g} {number:.6f}")
    return "\n".join(lines) + "\n"


def zemax() -> str:
    """Return a file of Zemax: f_r about the specular direction, at directions of its own (`zemax_rows`)."""
    head = ["Source Measured", "Symmetry ASymmetrical", "SpectralContent Monochrome", "ScatterType BRDF"]
    head += ["SampleRotation 1", "0", f"AngleOfIncidence {len(LIGHTS)}", " ".join(f"{i:g}" for i in LIGHTS)]
    head += [f"ScatterAzimuth {len(AZIMUTHS)}", " ".join(f"{turn:g}" for turn in AZIMUTHS)]
    head += [
        f"ScatterRadial {len(RADIAL)}",
        " ".join(f"{radial:g}" for radial in RADIAL),
        "",
        "Monochrome",
        "DataBegin",
    ]
    for theta_i in LIGHTS:
        head.append("TIS 0.5")
        head += [" ".join(f"{value:.6f}" for value in f_r(*of_specular(theta_i, RADIAL, turn))) for turn in AZIMUTHS]
    return "\n".join([*head, "DataEnd", ""])


RADIAL = (0.0, 5.0, 15.0, 25.0)


def of_specular(theta_i: float, radial: ArrayLike, azimuth: float) -> tuple[float, Floats, Floats]:
    """Return theta_i, theta_r and delta_phi [degree] of viewers about the specular direction.

    Radial angles count from there, and azimuths from the side of the normal, counter-clockwise from above.
    """
    angle, turn = np.deg2rad(radial), np.deg2rad(azimuth)
    specular = np.deg2rad(theta_i)
    # the light is at x > 0; towards the normal from the specular direction is the vector (cos, 0, sin) of theta_i
    x = -np.sin(specular) * np.cos(angle) + np.cos(specular) * np.sin(angle) * np.cos(turn)
    z = np.cos(specular) * np.cos(angle) + np.sin(specular) * np.sin(angle) * np.cos(turn)
    y = np.sin(angle) * np.sin(turn)
    return theta_i, np.degrees(np.arccos(np.clip(z, -1.0, 1.0))), np.degrees(np.arctan2(y, x)) % 360.0


def lighttools() -> str:
    """Return a file of LightTools, whose light is at 90 degrees of azimuth."""
    lines = ["Symmetry Asymmetric", "SpectralContent Monochrome", f"ScatterAzimuth {len(AZIMUTHS)}"]
    lines += [" ".join(f"{turn:g}" for turn in AZIMUTHS), f"ScatterRadial {len(POLAR)}"]
    lines += [" ".join(f"{theta:g}" for theta in POLAR), "DataBegin"]
    for theta_i in LIGHTS:
        lines += [f"AOI {theta_i:g}", "POI 0", "Side Front", f"Wavelength {NM:g}", "ScatterType BRDF", "TIS 0.5"]
        for turn in AZIMUTHS:
            lines.append(" ".join(f"{value:.6f}" for value in f_r(theta_i, POLAR, turn - 90.0)))
    return "\n".join([*lines, "DataEnd", ""])


def ssdd() -> str:
    """Return an SSDD file of text, with viewers from 0 to 330 degrees."""
    lists = (LIGHTS, (0.0,), POLAR, AZIMUTHS)
    lines = ["VERSION 0.3", "DATA_TYPE brdf", "COLOR_MODEL spectrum", f"WAVELENGTH_LIST {NM:g}"]
    lines += ["PARAM_TYPE spherical_coordinate_system"]
    lines += [f"PARAM{n}_LIST {' '.join(f'{angle:g}' for angle in angles)}" for n, angles in enumerate(lists)]
    lines += ["SOURCE_TYPE measured", "DATA ascii"]
    values = [f"{f_r(i, r, turn):.6f}" for turn in AZIMUTHS for r in POLAR for i in LIGHTS]
    return "\n".join([*lines, *values, ""])


def openmaterial_document(metres: float = NM * 1e-9) -> dict[str, Any]:
    """Return the object of an OpenMATERIAL file, whose rows have the wavelength `metres`."""
    listed = [
        [metres, *(round(float(np.deg2rad(angle)), 8) for angle in (i, r, turn)), round(value, 6)]
        for i, r, turn, value in rows()
    ]
    schema = "https://raw.githubusercontent.com/asam-ev/OpenMATERIAL-3D/refs/tags/v1.0.0/schemas"
    metadata = {"name": "made", "sources": "measurement"}
    brdf = {"wavelengths": [metres], "lookupTable": listed}
    return {"$schema": f"{schema}/material_brdf_schema.json", "metadata": metadata, "brdf": brdf}


def openmaterial(metres: float = NM * 1e-9) -> str:
    """Return an OpenMATERIAL file."""
    return json.dumps(openmaterial_document(metres), indent=1)


def bird_document() -> dict[str, Any]:
    """Return the object of a universal BRDF file."""
    columns = np.array(list(rows())).T
    lists = {"theta_i": columns[0], "phi_i": 0.0 * columns[0], "theta_r": columns[1], "phi_r": columns[2]}
    data: dict[str, Any] = {name: {"unit": "deg", "values": angles.tolist()} for name, angles in lists.items()}
    data["BRDF"] = {"unit": "1/sr", "values": np.round(columns[3], 6).tolist()}
    data["wavelength_i"] = {"unit": "nm", "values": [NM] * columns.shape[1]}
    return {"metadata": {"type": "BRDF", "schema": "brdf_json_schema_v1.0.json"}, "data": data}


def bird() -> str:
    """Return a universal BRDF file."""
    return json.dumps(bird_document(), indent=1)


QUARTER = ((0.0, 9.0, 27.0, 45.0, 63.0, 90.0), (1, 8, 12, 12, 8))  # Klems' basis of 41 patches: bounds, counts


def klems_middles() -> Floats:
    """Return the middles of the patches of a quarter basis, (41, 2): polar angle and azimuth [degree]."""
    bounds, counts = QUARTER
    middles = []
    for low, high, count in zip(bounds[:-1], bounds[1:], counts, strict=True):
        theta = low if count == 1 else 0.5 * (low + high)
        middles += [(theta, 360.0 * number / count) for number in range(count)]
    return np.array(middles)


def klems() -> str:
    """Return a Klems matrix of 41 x 41 patches, with the values at their middles."""
    bounds, counts = QUARTER
    rings = "".join(
        f"<AngleBasisBlock><Theta>0</Theta><ThetaBounds><LowerTheta>{low:g}</LowerTheta><UpperTheta>{high:g}</UpperTheta>"
        f"</ThetaBounds><nPhis>{count}</nPhis></AngleBasisBlock>\n"
        for low, high, count in zip(bounds[:-1], bounds[1:], counts, strict=True)
    )
    middles = klems_middles()
    viewer, light = middles[:, np.newaxis], middles[np.newaxis]
    # the azimuth of a light is that of the patch to which it would be mirrored
    values = f_r(light[..., 0], viewer[..., 0], viewer[..., 1] - light[..., 1] - 180.0)
    numbers = "\n".join("".join(f"{value:.6f}," for value in row) for row in values)
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<WindowElement xmlns="http://windows.lbl.gov">
<Optical><Layer><Material><Name>made</Name></Material>
<DataDefinition><IncidentDataStructure>Columns</IncidentDataStructure>
<AngleBasis><AngleBasisName>LBNL/Klems Quarter</AngleBasisName>
{rings}</AngleBasis></DataDefinition>
<WavelengthData><Wavelength unit="Integral">Visible</Wavelength><WavelengthDataBlock>
<WavelengthDataDirection>Reflection Back</WavelengthDataDirection>
<ColumnAngleBasis>LBNL/Klems Quarter</ColumnAngleBasis><RowAngleBasis>LBNL/Klems Quarter</RowAngleBasis>
<ScatteringDataType>BRDF</ScatteringDataType><ScatteringData>
{numbers}
</ScatteringData></WavelengthDataBlock></WavelengthData></Layer></Optical></WindowElement>
"""


def utia_planes() -> Floats:
    """Return the numbers of a UTIA file, (3, 6, 48, 6, 48): 1, 2 and 3 times f_r in R, G and B."""
    polar, turns = 15.0 * np.arange(6), 7.5 * np.arange(48)
    theta_i, phi_i, theta_r, phi_r = np.meshgrid(polar, turns, polar, turns, indexing="ij")
    return np.stack([colour * f_r(theta_i, theta_r, phi_r - phi_i) for colour in (1.0, 2.0, 3.0)])


def merl_planes() -> Floats:
    """Return the numbers of a MERL file, (3, 90, 90, 180), at the centres of bins; -1 below the horizon."""
    theta_h, theta_d, phi_d = np.meshgrid(
        np.deg2rad((np.arange(90) + 0.5) ** 2 / 90.0),
        np.deg2rad(np.arange(90) + 0.5),
        np.deg2rad(np.arange(180) + 0.5),
        indexing="ij",
    )
    cosines = np.cos(theta_h) * np.cos(theta_d)
    across = np.sin(theta_h) * np.sin(theta_d) * np.cos(phi_d)
    above = (cosines - across > 0.0) & (cosines + across > 0.0)
    values = merl_f_r(theta_h, theta_d, phi_d)
    scales = np.array([1.0, 1.15, 1.66]) / 1500.0
    return np.stack([np.where(above, values / scale, -1.0) for scale in scales])


def merl_f_r(theta_h: Floats, theta_d: Floats, phi_d: Floats) -> Floats:
    """Return f_r [1/sr] of a surface over half and difference angles [rad], which is the same in all colours."""
    return np.asarray(0.1 + 0.4 * np.exp(-((theta_h / 0.5) ** 2)) + 0.05 * np.sin(theta_d) ** 2 * np.cos(phi_d) ** 2)
