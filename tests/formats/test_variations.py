"""Variations of files as laboratories send them: read right at three directions, or refused in one sentence.

The files are those of `made_files`, whose f_r is a closed form. A refusal names the line or the field, and a remedy.
"""

from __future__ import annotations

import gzip
import json
import re
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pytest
import xarray as xr

from brdfdb import formats
from brdfdb.errors import FileFormatError, ParameterError
from brdfdb.formats._planes import read_planes
from brdfdb.measurements import Samples
from brdfdb.measurements.statement import statement
from brdfdb.parameters import Floats
from tests.formats import made_files as made
from tests.formats.a_file import exported, read_table

DIGITS = 2e-6  # of numbers with six decimals, twice rounded, at cosines down to 0.5 [1/sr]
ABOUT_SPECULAR = [
    made.of_specular(theta, radial, turn) for theta, radial, turn in ((10, 15, 90), (35, 5, 330), (60, 25, 60))
]
PATCHES = [(0.0, 18.0, 45.0), (36.0, 54.0, 30.0), (18.0, 36.0, 345.0)]  # of theta_i, theta_r and delta_phi


class Good(NamedTuple):
    """A file that is read: its name, its content, keywords of `samples`, a part of its notes, and directions."""

    name: str
    content: str | bytes
    keywords: Mapping[str, Any] = MappingProxyType({})
    noted: str = ""
    directions: Any = made.DIRECTIONS


def scaled(text: str, factor: float) -> str:
    """Return a text whose last field of each row is multiplied by a factor."""
    return re.sub(r"(?m)(?<=[,\t ])0\.\d{6}$", lambda value: f"{factor * float(value[0]):.8f}", text)


def in_degrees() -> str:
    """Return an ASTM file of degrees."""
    rows = "\n".join(f"{i:g},0,{r:g},{turn:g},{value:.6f}" for i, r, turn, value in made.rows())
    return f"NUM_POINTS {len(list(made.rows()))}\nVARS theta_i,phi_i,theta_s,phi_s,550nm\n{rows}\n"


def document(change: Callable[[dict[str, Any]], Any], of: Callable[[], dict[str, Any]] = made.bird_document) -> str:
    """Return the JSON of an object that was changed."""
    known = of()
    change(known)
    return json.dumps(known)


def in_radians(known: dict[str, Any]) -> None:
    for name in ("theta_i", "phi_i", "theta_r", "phi_r"):
        known["data"][name] = {"unit": "rad", "values": np.deg2rad(known["data"][name]["values"]).tolist()}


def om_with_degrees(content: dict[str, Any]) -> None:
    for row in content["brdf"]["lookupTable"]:
        row[3] = float(np.rad2deg(row[3]))


def om_in_degrees(known: dict[str, Any]) -> None:
    rows = known["brdf"]["lookupTable"]
    known["brdf"]["lookupTable"] = [
        [at, *(round(float(np.rad2deg(a)), 6) for a in angles), f] for at, *angles, f in rows
    ]


def of_s(known: dict[str, Any]) -> None:
    count = len(known["data"]["BRDF"]["values"])
    known["data"]["polarization_i"] = {"unit": "", "values": ["s"] * count}


def scaled_in_words(known: dict[str, Any]) -> None:
    known["metadata"]["description"] = "values were multiplied by 1000"


def with_hole(known: dict[str, Any]) -> None:
    known["data"]["BRDF"]["values"][0] = None


def negative_polar() -> str:
    """Return an ASTM file in which viewers at azimuths from 180 degrees have negative polar angles."""
    lines = made.astm().splitlines()
    for number, line in enumerate(lines[3:], 3):
        theta_i, phi_i, theta_s, phi_s, value = line.split(",")
        if float(phi_s) > 3.1:
            lines[number] = f"{theta_i},{phi_i},-{theta_s},{float(phi_s) - np.pi:.8g},{value}"
    return "\n".join([*lines, ""])


def exponents_of_logarithms(name: str) -> str:
    """Return an ASTM file of decadic logarithms."""
    logarithm = re.compile(r"(?m)(?<=,)0\.\d{6}$")
    return logarithm.sub(lambda value: f"{np.log10(float(value[0])):.8f}", made.astm(name))


def fred_in_radians(azimuth: float) -> str:
    """Return a file of FRED whose numbers are radians, which its second line does not say."""
    head, *blocks = re.split(r"(?m)(?<=scale=1\n)", made.fred(azimuth))
    angles = re.compile(r"(?m)^([\d.]+)\t([\d.]+)")
    return head + angles.sub(
        lambda pair: "\t".join(f"{np.deg2rad(float(text)):.9g}" for text in pair.groups()), blocks[0]
    )


FRED = made.fred()
KLEMS = made.klems()
ZEMAX = made.zemax()
PAB = made.pabopto()
ONE_LIGHT = PAB[: PAB.index("#sample_name", 5)].replace("#intheta 10\n#inphi 20", "#incident_angle 10 20")
SHEET = made.sheet()
SEMICOLONS = SHEET.replace(",", ";").replace(".", ",")
LATIN = made.sheet("theta_i [°];theta_r [°];delta_phi [°];BRDF").replace(",", ";").encode("latin-1")


def in_blocks() -> str:
    """Return a text with the light above its rows."""
    lines = []
    for light in made.LIGHTS:
        lines += [f"AOI = {light:g}", "theta_r,delta_phi,BRDF"]
        lines += [f"{r:g},{turn:g},{value:.6f}" for i, r, turn, value in made.rows() if i == light]
    return "\n".join([*lines, ""])


def elevations() -> str:
    """Return a text whose polar angles count from the surface."""
    rows = [f"{90 - i:g},{90 - r:g},{turn:g},{value:.6f}" for i, r, turn, value in made.rows()]
    return "\n".join(["light elevation,viewer elevation,delta_phi,BRDF", *rows, ""])


def two_materials() -> str:
    """Return a text of two samples, of which one is twice as bright."""
    rows = [
        f"{name},{i:g},{r:g},{turn:g},{k * v:.6f}" for i, r, turn, v in made.rows() for name, k in (("A", 1), ("B", 2))
    ]
    return "\n".join(["sample,theta_i,theta_r,delta_phi,BRDF", *rows, ""])


def of_states() -> str:
    """Return a text of s and p whose mean is f_r."""
    rows = [
        f"{name},{i:g},{r:g},{turn:g},{k * v:.6f}"
        for i, r, turn, v in made.rows()
        for name, k in (("s", 1.5), ("p", 0.5))
    ]
    return "\n".join(["polarization,theta_i,theta_r,delta_phi,BRDF", *rows, ""])


def above(head: str, form: str = "{i:g},{r:g},{t:g},{v:.6f}") -> str:
    """Return a text with lines above its rows, which have a form."""
    return "\n".join([head, *(form.format(i=i, r=r, t=turn, v=value) for i, r, turn, value in made.rows()), ""])


def in_cells() -> str:
    """Return a text with the light in a line of cells above its rows, and the names in the first line."""
    lines = ["theta_r,phi,BRDF,flag"]
    for light in made.LIGHTS:
        lines += [f"AOI (deg),{light:g},,"]
        lines += [f"{r:g},{turn:g},{value:.6f},1" for i, r, turn, value in made.rows() if i == light]
    return "\n".join([*lines, ""])


def in_thousandths() -> str:
    """Return a text whose numbers have three decimals each, or none, behind a comma."""
    rows = [f"{i:g};{r:g};{turn:g};{1e3 * v:.3f}".replace(".", ",") for i, r, turn, v in made.rows()]
    return "\n".join(["theta_i;theta_r;delta_phi;BRDF [10^-3/sr]", *rows, ""])


def on_both_sides() -> str:
    """Return a text of the plane of incidence whose viewers are behind the surface, too."""
    rows = [f"{i:g},{r:g},{v:.6f}\n{i:g},{180 - r:g},0.1" for i, r, turn, v in made.rows() if turn == 180.0]
    return "\n".join(["AOI,theta_r,BSDF", *rows, ""])


def two_lines_of_angles() -> str:
    """Return a matrix with the angles of light and viewer above its columns, and a row a wavelength."""
    columns = [row for row in made.rows() if row[2] == 180.0]
    rows = [",".join([f"{nm:g}", *(f"{value:.6f}" for *_, value in columns)]) for nm in (0.45, 0.55)]
    return "\n".join(
        [
            f"AOI,{','.join(f'{i:g}' for i, *_ in columns)}",
            f"theta_r,{','.join(f'{r:g}' for _, r, *_ in columns)}",
            *rows,
            "",
        ]
    )


IN_PLANE = [(10.0, 40.0, 180.0), (35.0, 60.0, 180.0), (60.0, 20.0, 180.0)]
TWO_VALUES = "{i:g},{r:g},{t:g},{v:.6f},0.3"
COLUMNS = {"theta_i": "sun", "theta_r": "view", "delta_phi": "turn", "values": "number"}
READ = {
    "sheet": Good("a.csv", SHEET),
    "sheet in UTF-16": Good("a.csv", SHEET.encode("utf-16")),
    "sheet in UTF-16 without a mark": Good("a.csv", SHEET.encode("utf-16-le")),
    "sheet in UTF-32": Good("a.csv", SHEET.encode("utf-32")),
    "sheet with a mark and CR": Good("a.csv", SHEET.replace("\n", "\r").encode("utf-8-sig")),
    "sheet below blank lines": Good("a.csv", f"\n\n{SHEET}"),
    "sheet with decimal commas": Good("a.csv", SEMICOLONS),
    "sheet in the letters of Windows": Good("a.csv", LATIN),
    "sheet below comments with !": Good("a.txt", f"! a tile\n! of white\n{SHEET}"),
    "sheet with #N/A": Good("a.csv", f"{SHEET}70,0,0,#N/A\n", {}, ""),
    "sheet of percent": Good("a.csv", scaled(SHEET.replace("BRDF", "BRDF_percent"), 100.0), {}, "divided by 100"),
    "sheet of reflectance factors": Good(
        "a.csv", scaled(SHEET.replace("BRDF", "BRF"), np.pi), {}, "reflectance factors"
    ),
    "sheet with a column of text": Good("a.csv", re.sub(r"(?m)(?<=\d)$", ",good", SHEET).replace("BRDF", "BRDF,flag")),
    "sheet with other names": Good("a.csv", made.sheet("sun,view,turn,number"), COLUMNS),
    "sheet of elevations": Good("a.csv", elevations(), {}, "count from the surface"),
    "sheet of two samples": Good("a.csv", two_materials(), {"where": {"sample": "A"}}),
    "sheet of s and p": Good("a.csv", of_states(), {}, "mean"),
    "sheet of s": Good("a.csv", scaled(of_states(), 1 / 1.5), {"where": {"polarization": "s"}}),
    "sheet below a comment on s": Good("a.csv", f"# s-polarised light\n{SHEET}", {}, "not of unpolarised light"),
    "sheet in blocks": Good("a.txt", in_blocks(), {}, "give AOI: 10, 35, 60"),
    "sheet with cells over several names": Good(
        "a.csv", above("Light,Viewer,,\ntheta,theta,phi,BRDF"), {}, "column phi"
    ),
    "sheet with wavelengths above names": Good(
        "a.csv", above(",,,450 nm,550 nm\ntheta_i,theta_r,delta_phi,BRDF,BRDF", TWO_VALUES), {}, "550nm"
    ),
    "sheet with numbers of wavelengths above names": Good(
        "a.csv", above("Wavelength (nm),,,450,550\ntheta_i,theta_r,delta_phi,BRDF,BRDF", TWO_VALUES), {}, "550nm"
    ),
    "sheet with columns that are empty": Good(
        "a.csv", above("theta_i,,theta_r,,delta_phi,,BRDF,", "{i:g},,{r:g},,{t:g},,{v:.6f},")
    ),
    "sheet with names in French": Good("a.csv", SHEET.replace("delta_phi", "Azimut"), {}, "azimuth from the light"),
    "sheet with one space between names": Good(
        "a.txt", above("# theta_i [deg] theta_r [deg] delta_phi [deg] BRDF [1/sr]", "{i:g} {r:g} {t:g} {v:.6f}")
    ),
    "sheet whose rows end in a delimiter": Good(
        "a.csv", above("theta_i;theta_r;delta_phi;BRDF", "{i};{r};{t};{v:.6f};")
    ),
    "sheet with the light in cells": Good("a.csv", in_cells(), {}, "give AOI [deg]: 10, 35, 60"),
    "sheet whose columns are numbered": Good(
        "a.csv", SHEET.replace("\n", "\n1,2,3,4\n", 1), {}, "Row? Line 2 has 1 to 4"
    ),
    "sheet below the angle of another file": Good("a.csv", f"AOI = 45\n{SHEET}", {}, "AOI = 45, but theta_i was read"),
    "sheet of thousandths": Good("a.csv", in_thousandths(), {}, "Thousands? All numbers with ','"),
    "sheet of both sides": Good("a.csv", on_both_sides(), {}, "Normal? theta_r reaches 180 degrees", IN_PLANE),
    "sheet below a title on transmission": Good("a.csv", f"# BTDF of a diffuser\n{SHEET}", {}, "Transmission?"),
    "sheet below a title on a standard": Good("a.csv", f"# reflectance relative to PTFE\n{SHEET}", {}, "Factor?"),
    "sheet with phi_s": Good(
        "a.csv", SHEET.replace("theta_r,delta_phi", "theta_s,phi_s"), {}, "phi_s was taken as the azimuth from"
    ),
    "sheet cut between lines": Good("a.csv", SHEET[: SHEET[:-200].rindex("\n") + 1], {}, "Cut or joined"),
    "astm": Good("a.astm", made.astm()),
    "astm in UTF-16": Good("a.astm", made.astm().encode("utf-16")),
    "astm in UTF-16 without a mark": Good("a.astm", made.astm().encode("utf-16-be")),
    "astm with a mark and CRLF": Good("a.astm", made.astm().replace("\n", "\r\n").encode("utf-8-sig")),
    "astm with CR": Good("a.astm", made.astm().replace("\n", "\r").encode()),
    "astm below blank lines": Good("a.astm", f"\n\n{made.astm()}"),
    "astm with 10.6um": Good("a.astm", made.astm("10.6um"), {}, "10600nm"),
    "astm with 0.55um": Good("a.astm", made.astm("0.55um"), {}, "550nm"),
    "astm with 550": Good("a.astm", made.astm("550"), {}, "550nm"),
    "astm with BRDF_percent": Good("a.astm", scaled(made.astm("BRDF_percent"), 100.0), {}, "percent"),
    "astm with BRF": Good("a.astm", scaled(made.astm("BRF"), np.pi), {}, "reflectance factors"),
    "astm with log10_BRDF": Good("a.astm", exponents_of_logarithms("log10_BRDF"), {}, "logarithms"),
    "astm of percent that is stated": Good("a.astm", scaled(made.astm(), 100.0), {"quantity": "percent"}),
    "astm with negative polar angles": Good("a.astm", negative_polar()),
    "astm of degrees that are stated": Good("a.astm", in_degrees(), {"angles": "deg"}),
    "astm with a hole": Good("a.astm", made.astm()[:-9] + "nan\n"),
    "astm below a unit": Good("a.astm", f"COMMENT BRDF [10^-3/sr]\n{made.astm()}", {}, "Factor?"),
    "astm without an end": Good("a.astm", made.astm().rstrip(), {}, "no end"),
    "astm under the name of a text": Good("a.txt", made.astm()),
    "fred": Good("a.fred.txt", FRED),
    "fred with a light into 30 degrees": Good("a.fred.txt", made.fred(30.0), {}, "azimuth in the line of the light"),
    "fred below a blank line": Good("a.fred.txt", f"\n{FRED}"),
    "fred in UTF-16": Good("a.fred.txt", FRED.encode("utf-16-le")),
    "fred with CRLF and blank lines": Good("a.fred.txt", FRED.replace("\n", "\r\n\r\n").encode()),
    "fred with other letters and spaces": Good("a.dat", FRED.replace("type ", "Type  ").replace("s=deg", "s = DEG")),
    "fred with a scale": Good("a.fred.txt", scaled(FRED, 0.01).replace("scale=1", "scale=100")),
    "fred with comments": Good("a.fred.txt", f"# a coating\n! laser at 1.064 um\n{FRED}", {}, "1064nm"),
    "fred in radians": Good("a.fred.txt", fred_in_radians(30.0).replace("=deg", "=rad")),
    "fred in radians that are stated": Good("a.fred.txt", fred_in_radians(30.0), {"angles": "rad"}),
    "fred in degrees that are stated": Good("a.fred.txt", made.fred(30.0).replace("=deg", "=rad"), {"angles": "deg"}),
    "fred below a unit": Good("a.fred.txt", f"! BRDF [10^-3/sr]\n{FRED}", {}, "Factor?"),
    "fred with exponents of Fortran": Good("a.fred.txt", re.sub(r"0\.(\d{6})", r"0.\1D+00", FRED)),
    "fred cut between lines": Good("a.fred.txt", FRED[: FRED[:-60].rindex("\n") + 1], {}, "Cut or joined"),
    "pab-opto of three lights": Good("a.dat", PAB),
    "pab-opto of the DSF": Good("a.dat", made.pabopto("DSF"), {}, "cosine of the viewer"),
    "pab-opto with a unit": Good("a.dat", f"#unit: 10^-3/sr\n{PAB}", {}, "Factor?"),
    "pab-opto with tabs and CRLF": Good("a.dat", PAB.replace(" ", "\t").replace("\n", "\r\n").encode("utf-8-sig")),
    "pab-opto with one light": Good("a.dat", ONE_LIGHT, {}, "", made.DIRECTIONS[:1]),
    "OpenMATERIAL": Good("a.xompt", made.openmaterial()),
    "OpenMATERIAL in UTF-16": Good("a.xompt", made.openmaterial().encode("utf-16")),
    "OpenMATERIAL in nm that are stated": Good("a.xompt", made.openmaterial(550.0), {"wavelength_unit": "nm"}, "550nm"),
    "OpenMATERIAL in degrees that are stated": Good(
        "a.xompt", document(om_in_degrees, made.openmaterial_document), {"angles": "deg"}
    ),
    "OpenMATERIAL without a schema": Good("a.json", made.openmaterial().replace("$schema", "comment")),
    "BiRD": Good("a.json", made.bird()),
    "BiRD of s": Good("a.json", document(of_s), {}, "Polarised? A comment says 'polarization_i: s'"),
    "BiRD with a factor": Good("a.json", document(scaled_in_words), {}, "Factor? A comment says 'values were"),
    "BiRD with a mark": Good("a.json", made.bird().encode("utf-8-sig")),
    "BiRD in um": Good("a.json", made.bird().replace('"nm"', '"um"').replace("550.0", "0.55"), {}, "550nm"),
    "BiRD in m": Good("a.json", made.bird().replace('"nm"', '"m"').replace("550.0", "5.5e-7"), {}, "550nm"),
    "BiRD at 10.6 nm": Good("a.json", made.bird().replace("550.0", "10.6"), {}, "--wavelength-unit um"),
    "BiRD in radians": Good("a.json", document(in_radians)),
    "BiRD with a hole": Good("a.json", document(with_hole)),
    "Zemax": Good("a.bsdf", ZEMAX, {}, "", ABOUT_SPECULAR),
    "Zemax with a mark and CRLF": Good(
        "a.bsdf", ZEMAX.replace("\n", "\r\n").encode("utf-8-sig"), {}, "", ABOUT_SPECULAR
    ),
    "Zemax with a comment on percent": Good(
        "a.bsdf", f"# all values are in percent\n{ZEMAX}", {}, "--quantity percent", ABOUT_SPECULAR
    ),
    "Zemax under the name of a text": Good("a.txt", f"\n\n{ZEMAX}", {}, "", ABOUT_SPECULAR),
    "LightTools": Good("a.bsdf", made.lighttools()),
    "LightTools in um": Good("a.bsdf", made.lighttools().replace("Wavelength 550", "Wavelength 0.55"), {}, "550nm"),
    "LightTools in m": Good("a.bsdf", made.lighttools().replace("Wavelength 550", "Wavelength 5.5e-7"), {}, "550nm"),
    "astm with the end of DOS": Good("a.astm", f"{made.astm()}\x1a"),
    "SSDD": Good("a.ssdd", made.ssdd()),
    "SSDD in UTF-16": Good("a.ssdd", made.ssdd().encode("utf-16")),
    "SSDD with CR": Good("a.ssdd", made.ssdd().replace("\n", "\r").encode()),
    "Klems": Good("a.xml", KLEMS, {}, "", PATCHES),
    "Klems in UTF-16": Good("a.xml", KLEMS.replace("UTF-8", "UTF-16").encode("utf-16"), {}, "", PATCHES),
    "Klems below a blank line": Good("a.xml", f"\n\n{KLEMS}", {}, "", PATCHES),
    "Klems under the name of a text": Good("a.txt", KLEMS.replace("\n", "\r\n").encode(), {}, "", PATCHES),
}


def value_at(samples: Samples, direction: Any) -> float:
    """Return the value of the sample in a direction: theta_i, theta_r, delta_phi [degree]."""
    theta_i, theta_r, turn = np.deg2rad(np.array(direction, dtype=np.float64))
    wanted = [np.sin(theta_r) * np.cos(turn), np.sin(theta_r) * np.sin(turn)]
    turned = samples.phi_r - samples.phi_i
    found = [np.sin(samples.theta_r) * np.cos(turned), np.sin(samples.theta_r) * np.sin(turned)]
    distance = np.abs(samples.theta_i - theta_i) + np.hypot(found[0] - wanted[0], found[1] - wanted[1])
    assert distance.min() < 1e-5, f"no sample at {direction}"
    return float(samples.values[distance.argmin(), 0])


def written(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


@pytest.mark.parametrize("variation", READ)
def test_a_variation_is_read_right(variation: str, tmp_path: Path) -> None:
    good = READ[variation]
    samples = formats.samples(written(tmp_path, good.name, good.content), **good.keywords)
    for direction in good.directions:
        assert value_at(samples, direction) == pytest.approx(float(made.f_r(*direction)), abs=DIGITS)
    assert good.noted in " ".join((*statement(samples).sentences, *samples.channels))


JOINED = PAB + PAB.replace("BRDF", "DSF")
VARS = "VARS theta_i,phi_i,theta_s,phi_s"
BIRD = made.bird_document


def without_units(known: dict[str, Any]) -> None:
    in_radians(known)
    for name in ("theta_i", "phi_i", "theta_r", "phi_r"):
        known["data"][name]["unit"] = ""


def one_short(known: dict[str, Any]) -> None:
    known["data"]["BRDF"]["values"].pop()


def negative_uncertainty(known: dict[str, Any]) -> None:
    count = len(known["data"]["BRDF"]["values"])
    known["data"]["uBRDF"] = {"unit": "1/sr", "values": [-0.01] * count}


def two_states(known: dict[str, Any]) -> None:
    count = len(known["data"]["BRDF"]["values"])
    known["data"]["polarization_i"] = {"unit": "sp", "values": ["s", "p"] * (count // 2)}


def without_row(known: dict[str, Any]) -> None:
    rows = known["brdf"]["lookupTable"]
    known["brdf"]["lookupTable"] = rows + [[6e-7, *row[1:]] for row in rows[:-1]]
    known["brdf"]["wavelengths"] = [5.5e-7, 6e-7]


def other_wavelengths(known: dict[str, Any]) -> None:
    known["brdf"]["wavelengths"] = [5.5e-7, 6e-7]


def text_of_row(known: dict[str, Any]) -> None:
    known["brdf"]["lookupTable"][2][4] = "0,3"


MATRIX = KLEMS.replace("</Layer>", KLEMS[KLEMS.index("<WavelengthData>") : KLEMS.index("</Layer>")] + "</Layer>")
PAGE = (
    "<!DOCTYPE html>\n<html><head><title>a</title></head><body><pre>theta_i,theta_r,delta_phi,BRDF</pre></body></html>"
)
OF_OM = made.openmaterial_document
BAD: dict[str, tuple[str, str | bytes, str]] = {
    "sheet of logarithms": ("a.csv", SHEET.replace("BRDF", "log_BRDF"), "line 1, field log_BRDF: .*--quantity"),
    "sheet of two samples": ("a.csv", two_materials(), "sample.*--where"),
    "sheet with a letter": (
        "a.csv",
        SHEET.replace("20,0,", "2O,0,", 1),
        "line 14, field theta_r: '2O' is not a number",
    ),
    "sheet with two columns of a name": (
        "a.csv",
        above("theta_i,theta_r,delta_phi,BRDF,BRDF", TWO_VALUES),
        "BRDF, BRDF are all values, .* --column values=NAME",
    ),
    "sheet with two lines of angles": (
        "a.csv",
        two_lines_of_angles(),
        "line 2 has numbers above the columns, and so has line 1; write a row for each pair",
    ),
    "sheet with a field less": ("a.csv", SHEET.replace("20,0,", "20,", 1), "line 14 has 3 fields"),
    "sheet without its values": ("a.csv", SHEET.replace("BRDF", "x"), "theta_i, theta_r, delta_phi, x"),
    "sheet with negative uncertainties": (
        "a.csv",
        re.sub(r"(?m)(?<=\d)$", ",-2", SHEET).replace("BRDF", "BRDF,U [%]"),
        r"line 2, field U \[%\]: -2 is below 0; an uncertainty is positive, or empty",
    ),
    "astm cut between rows": (
        "a.astm",
        made.astm()[:2000].rpartition("\n")[0] + "\n",
        r"line 2, field NUM_POINTS: 180",
    ),
    "astm joined": ("a.astm", made.astm() * 2, r"line 184: a second header, 'TITLE made'"),
    "astm with a second VARS": ("a.astm", made.astm() + VARS + ",600nm\n0,0,0,0,1\n", "line 184: a second header"),
    "astm of logarithms": (
        "a.astm",
        made.astm("log_BRDF"),
        "field VARS: .* 'log_BRDF' are not known; name the channel",
    ),
    "astm with an uncertainty": (
        "a.astm",
        made.astm("BRDF,sigma"),
        "line 4 has 5 fields, but there are 6 names of columns",
    ),
    "astm of degrees": ("a.astm", in_degrees(), "line 3, field theta_i: 10 is no polar angle in rad.*--angles deg"),
    "astm with decimal commas": (
        "a.astm",
        made.astm().replace("0.", "0,"),
        "line 4 has . fields, but there are 5 names",
    ),
    "astm without channels": ("a.astm", made.astm("").replace("phi_s,", "phi_s"), "line 3, field VARS: its columns"),
    "astm without VARS": ("a.astm", made.astm().replace("VARS", "NAMES"), "it has no line VARS; VARS theta_i,phi_i"),
    "fred joined": ("a.fred.txt", FRED * 2, "line 186: a second header, 'type bsdf_data'"),
    "fred of gon": ("a.fred.txt", FRED.replace("=deg", "=gon"), "line 2, field angles: 'gon'.* allowed is angles=deg"),
    "fred of logarithms": ("a.fred.txt", FRED.replace("=value", "=log"), "line 2, field bsdf: 'log' .* bsdf=value"),
    "fred cut below a light": (
        "a.fred.txt",
        FRED[: FRED.index("35\t0\n") + 5],
        "line 64 is a light without viewers: the file was cut",
    ),
    "fred without its title": ("a.fred.txt", FRED.partition("\n")[2], "line 1: it does not begin with the lines 'type"),
    "pab-opto of two quantities": (
        "a.dat",
        JOINED,
        "line 194, field #format: 'theta phi DSF' differs from .*write a file",
    ),
    "pab-opto cut below a header": (
        "a.dat",
        PAB[: PAB.rindex("#inphi 20") + 10],
        "line 131: no rows follow this header",
    ),
    "pab-opto of two lights at once": (
        "a.dat",
        PAB.replace("#inphi 20", "#inphi 20\n#incident_angle 70 0", 1),
        "line 5, field #incident_angle: .* contradicts #intheta and #inphi",
    ),
    "pab-opto of transmission": ("a.dat", PAB.replace("BRDF", "BTDF"), "field #format: BTDF is transmission"),
    "pab-opto without a light": ("a.dat", PAB.replace("#in", "#out"), "field #incident_angle, or .* is missing"),
    "OpenMATERIAL in nm": ("a.xompt", made.openmaterial(550.0), "field wavelength_nm: .* state --wavelength-unit nm"),
    "OpenMATERIAL with azimuths in degrees": (
        "a.xompt",
        document(om_with_degrees, made.openmaterial_document),
        "row 2, delta_phi: 30 is no azimuth in radians",
    ),
    "OpenMATERIAL in um": ("a.xompt", made.openmaterial(0.55), "field wavelength_nm: .* state --wavelength-unit um"),
    "OpenMATERIAL in degrees": (
        "a.xompt",
        document(om_in_degrees, OF_OM),
        "field brdf.lookupTable, row 1, theta_i: 10 is no polar angle in radians, .* --angles deg",
    ),
    "OpenMATERIAL with other wavelengths": (
        "a.xompt",
        document(other_wavelengths, OF_OM),
        "field brdf.wavelengths: it lists 2 wavelengths .*, but the rows have 1",
    ),
    "OpenMATERIAL without a row": (
        "a.xompt",
        document(without_row, OF_OM),
        "field brdf.lookupTable: 600 nm has 179 rows",
    ),
    "OpenMATERIAL with a text": (
        "a.xompt",
        document(text_of_row, OF_OM),
        'row 3, .*"0,3"., is not five finite numbers',
    ),
    "OpenMATERIAL with a field twice": (
        "a.xompt",
        made.openmaterial().replace('"brdf": {', '"brdf": {}, "brdf": {'),
        "an object has the field 'brdf' twice; write a file for each",
    ),
    "BiRD cut": ("a.json", made.bird()[:9000], "it is not JSON, or is damaged"),
    "BiRD with a short list": ("a.json", document(one_short), "field data: the lists differ in length: .*BRDF 179"),
    "BiRD in percent": ("a.json", made.bird().replace('"1/sr"', '"%"'), "field data.BRDF: .* '%'; allowed are 1/sr"),
    "BiRD without units": ("a.json", document(without_units), "field data.theta_i: it has no unit, .* deg or rad"),
    "BiRD with a negative uncertainty": (
        "a.json",
        document(negative_uncertainty),
        "field uncertainty: -0.01 is below 0",
    ),
    "BiRD of two states": ("a.json", document(two_states), "field data.polarization_i: .*write a file for each"),
    "BiRD of transmission": (
        "a.json",
        document(lambda known: known["metadata"].update(type="BTDF")),
        "field metadata.type: 'BTDF' is not read; allowed is BRDF",
    ),
    "Zemax with a count too small": (
        "a.bsdf",
        ZEMAX.replace("Radial 4", "Radial 3"),
        "field ScatterRadial: '25' is one",
    ),
    "Zemax with a count too large": (
        "a.bsdf",
        ZEMAX.replace("Radial 4", "Radial 5"),
        "field ScatterRadial: 'Monochrome'",
    ),
    "Zemax with a row too many": ("a.bsdf", ZEMAX.replace("TIS", "0.1 0.1 0.1 0.1\nTIS").replace("0.1 ", "", 4), "TIS"),
    "Zemax joined": ("a.bsdf", ZEMAX * 2, "field DataEnd: 'Source' follows the last block; write a file for each"),
    "Zemax cut": ("a.bsdf", ZEMAX[:-9], "the file ends where DataEnd is expected: it was cut"),
    "Zemax with another entry": ("a.bsdf", f"AngleUnit rad\n{ZEMAX}", "line 1, field AngleUnit: it is not an entry"),
    "LightTools with a count too small": (
        "a.bsdf",
        made.lighttools().replace("Radial 5", "Radial 4"),
        "field ScatterRadial: '80' is one number more than are stated",
    ),
    "LightTools cut": ("a.bsdf", made.lighttools()[:-8], "field DataEnd: the file ends without it, after 3 blocks"),
    "LightTools joined": ("a.bsdf", made.lighttools() * 2, "field DataEnd: 'Symmetry' follows the last block"),
    "SSDD with a long list": (
        "a.ssdd",
        made.ssdd().replace("10 35 60", "10 35 60 70"),
        "field DATA: it has 180 values",
    ),
    "SSDD in um": ("a.ssdd", made.ssdd().replace("T 550", "T 0.55"), "field wavelength_nm: .* --wavelength-unit um"),
    "SSDD joined": ("a.ssdd", made.ssdd() * 2, "field DATA(_TYPE)?: "),
    "Klems with other patches": ("a.xml", KLEMS.replace("<nPhis>8", "<nPhis>9", 1), "field AngleBasis .* rename it"),
    "Klems with a block twice": ("a.xml", MATRIX, "field WavelengthData: the block Visible .* stands twice"),
    "Klems with a number less": (
        "a.xml",
        re.sub(r"0\.\d{6},", "", KLEMS, count=1),
        "field ScatteringData: block Visible has 1680",
    ),
    "Klems cut": ("a.xml", KLEMS[:9000], "it is not XML: .*line"),
    "a page named csv": ("a.csv", PAGE, "it is a web page .HTML., .* download the file itself"),
    "a page named xml": ("a.xml", f"\n\n{PAGE}", "it is a web page .HTML., .* download the file itself"),
    "a page in UTF-16 named binary": ("a.binary", PAGE.encode("utf-16"), "it is a web page .HTML., .* download"),
    "gzip named csv": ("a.csv", gzip.compress(made.sheet().encode()), "it is a gzip archive; unpack it"),
    "a pointer of Git LFS": ("a.bsdf", "version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "git lfs pull"),
    "Klems of the other side": (
        "a.xml",
        KLEMS.replace("Reflection Back", "Reflection Front"),
        "field WavelengthData: it has no Visible block of Reflection Back, .*--side front reads Reflection Front",
    ),
    "an answer of a server": ("a.bsdf", "404: Not Found", "it is the answer of a server, 404, and not the file"),
    "a picture named csv": ("a.csv", b"\x89PNG\r\n\x1a\n\0\0", "it is a picture; f_r is read of files of numbers"),
    "a PDF named txt": ("a.txt", b"%PDF-1.7\n", "it is a PDF; ask for the numbers as text"),
    "prose": ("a.txt", "dear colleague\nplease find the data below\n", "it is text without names of columns"),
    "JSON of another program": ("a.json", '{"angles": [1], "f": [2]}', "the fields angles, f; bird needs metadata and"),
    "XML of another program": (
        "a.txt",
        '<?xml version="1.0"?>\n<scene/>',
        "XML of the element scene; .* WindowElement",
    ),
    "half a number": ("a.dat", PAB[: PAB.rindex(".") + 3], "line 192: .* fewer decimals than all numbers above it"),
    "1_0 for a number": ("a.fred.txt", FRED.replace("0.2", "0_2", 1), "line 4 has text that is not a number"),
}


@pytest.mark.parametrize("variation", BAD)
def test_a_variation_is_refused_in_a_sentence(variation: str, tmp_path: Path) -> None:
    name, content, pattern = BAD[variation]
    with pytest.raises(FileFormatError, match=pattern) as refusal:
        formats.samples(written(tmp_path, name, content))
    sentence = str(refusal.value)
    assert "\n" not in sentence
    assert sentence.startswith(str(tmp_path / name))


def test_fred_in_another_unit_than_its_line_says_is_doubted(tmp_path: Path) -> None:
    def notes(text: str, **keywords: Any) -> str:
        return " ".join(formats.samples(written(tmp_path, "a.fred.txt", text), **keywords).record.get("notes", ()))

    radians = fred_in_radians(30.0)
    assert "Angles? Line 2 says angles=deg, but no polar angle exceeds 1.4, " in notes(radians)
    assert "Angles?" not in notes(radians, angles="rad") + notes(FRED)
    gon = re.sub(r"(?m)^([\d.]+)\t([\d.]+)", lambda pair: f"{float(pair[1]) / 0.9}\t{float(pair[2]) / 0.9}", FRED)
    assert "Angles? Azimuths span 366.667 degrees" in notes(gon)


def test_azimuths_of_half_angles_cannot_be_stated(tmp_path: Path) -> None:
    path = exported(tmp_path, "netcdf", axes="half_difference")
    for name, word in (("azimuth", "mirror"), ("angles", "elevation")):
        stated: dict[str, Any] = {name: word}
        with pytest.raises(ParameterError, match="the file lists no angles of light and viewer"):
            formats.read(path, **stated)


def vectors_at(theta_h: float, theta_d: float, phi_d: float) -> tuple[Floats, Floats]:
    """Return unit vectors of light and viewer with half and difference angles [rad]."""
    half = np.array([np.sin(theta_h), 0.0, np.cos(theta_h)])
    x, y, z = np.sin(theta_d) * np.cos(phi_d), np.sin(theta_d) * np.sin(phi_d), np.cos(theta_d)
    turned = [np.cos(theta_h) * x + np.sin(theta_h) * z, y, np.cos(theta_h) * z - np.sin(theta_h) * x]
    light = np.array(turned)
    return light, 2.0 * (light @ half) * half - light


def with_nan(planes: Floats) -> Floats:
    return np.asarray(np.where(planes == -1.0, np.nan, planes))


@pytest.mark.parametrize(
    ("order", "change", "noted"),
    [
        ("<", lambda planes: planes, ""),
        (">", lambda planes: planes, "big-endian"),
        ("<", lambda planes: np.moveaxis(planes, 0, -1), "interleaved"),
        ("<", with_nan, "are nan and were read as holes"),
    ],
)
def test_merl_in_any_order(order: str, change: Callable[[Any], Any], noted: str, tmp_path: Path) -> None:
    head = np.array([90, 90, 180], f"{order}i4").tobytes()
    path = written(tmp_path, "a.binary", head + change(made.merl_planes()).astype(f"{order}f8").tobytes())
    reading = read_table(path)
    for bins in ((20, 30, 40), (40, 10, 100), (5, 45, 170)):
        theta_h, theta_d, phi_d = np.deg2rad([(bins[0] + 0.5) ** 2 / 90.0, bins[1] + 0.5, bins[2] + 0.5])
        expected = made.merl_f_r(theta_h, theta_d, phi_d)
        found = reading.lookup_vectors(*vectors_at(theta_h, theta_d, phi_d))
        np.testing.assert_allclose(found, [expected] * 3, rtol=1e-6)
    assert noted in " ".join(reading.record.get("notes", [""]))


@pytest.mark.parametrize(
    ("order", "change", "noted"),
    [
        ("<", lambda planes: planes, ""),
        (">", lambda planes: planes, "big-endian"),
        ("<", lambda planes: np.moveaxis(planes, 0, -1), "interleaved"),
        ("<", lambda planes: np.moveaxis(planes[[0, 0, 0]], 0, -1), "interleaved"),
    ],
)
def test_utia_in_any_order(order: str, change: Callable[[Any], Any], noted: str, tmp_path: Path) -> None:
    path = written(tmp_path, "a.bin", change(made.utia_planes()).astype(f"{order}f8").tobytes())
    reading = read_table(path)
    for theta_i, theta_r, turn in ((15.0, 30.0, 90.0), (45.0, 60.0, 187.5), (75.0, 15.0, 337.5)):
        found = reading.lookup(*np.deg2rad([theta_i, 0.0, theta_r, turn]))
        assert found[0] == pytest.approx(float(made.f_r(theta_i, theta_r, turn)), rel=1e-6)
    assert noted in " ".join(reading.record.get("notes", [""]))


@pytest.mark.parametrize("interleaved", [False, True])
@pytest.mark.parametrize("theta_d", [0.0, 0.2])
def test_merl_without_dependence_on_phi_d(theta_d: float, interleaved: bool, tmp_path: Path) -> None:
    numbers = np.exp(-np.arange(90.0)[:, np.newaxis] / 30.0) * (1.0 + theta_d * np.arange(90.0) / 90.0)
    planes = np.tile(numbers[:, :, np.newaxis], (3, 1, 1, 180))
    stored = np.moveaxis(planes, 0, -1) if interleaved else planes
    head = np.array([90, 90, 180], "<i4").tobytes()
    content = read_planes(written(tmp_path, "a.binary", head + stored.astype("<f8").tobytes()), 12, (90, 90, 180))
    np.testing.assert_array_equal(content.numbers, planes)
    assert bool(content.notes) == interleaved


def test_merl_with_numbers_of_another_order_than_the_header(tmp_path: Path) -> None:
    head = np.array([90, 90, 180], "<i4").tobytes()
    path = written(tmp_path, "a.binary", head + np.moveaxis(made.merl_planes(), 0, -1).astype(">f8").tobytes())
    reading = read_table(path)
    at = np.deg2rad([(20 + 0.5) ** 2 / 90.0, 30.5, 40.5])
    np.testing.assert_allclose(reading.lookup_vectors(*vectors_at(*at)), [made.merl_f_r(*at)] * 3, rtol=1e-6)
    assert all(word in " ".join(reading.record["notes"]) for word in ("big-endian", "interleaved"))


def test_binary_files_that_are_others(tmp_path: Path) -> None:
    header = np.array([90, 90, 180], "<i4").tobytes()
    other = np.array([90, 90, 360], "<i4").tobytes()
    infinite = made.merl_planes()
    infinite[1, 2, 3, 4] = np.inf
    with zipfile.ZipFile(tmp_path / "book.csv", "w") as archive:
        archive.writestr("[Content_Types].xml", "<Types/>")
    bad = {
        "half.binary": (header + bytes(4 * 3 * 90 * 90 * 180), "32-bit floats are not read"),
        "wide.binary": (other + bytes(100), "its header states 90 x 90 x 360 bins, and it has 112 bytes"),
        "infinite.binary": (header + infinite.tobytes(), "number 1490945 of 4374000 is infinite; a hole must be"),
        "cut.bin": (made.utia_planes().tobytes()[:-8], "it has 1990648 bytes; a UTIA file has 1990656"),
        "book.csv": ((tmp_path / "book.csv").read_bytes(), "a workbook or document of an Office program; save the"),
        "new.nc": (b"\x89HDF\r\n\x1a\n_NCProperties" + bytes(500), "netCDF 4 is not read; write netCDF 3"),
        "unknown.dat": (bytes(range(256)) * 20, "no format recognises it: it is binary"),
    }
    for name, (content, pattern) in bad.items():
        with pytest.raises(FileFormatError, match=pattern):
            formats.samples(written(tmp_path, name, content))


def test_netcdf_states_its_units(tmp_path: Path) -> None:
    polar, turns = np.deg2rad([0.0, 20.0, 40.0, 60.0, 90.0]), np.deg2rad([0.0, 90.0, 180.0])
    theta_i, theta_r, turn = np.meshgrid(np.rad2deg(polar), np.rad2deg(polar), np.rad2deg(turns), indexing="ij")
    axes = {"theta_i": polar, "theta_r": polar, "delta_phi": turns, "wavelength": [0.55, 0.65]}
    units = {"theta_i": "rad", "theta_r": "rad", "delta_phi": "rad", "wavelength": "um"}
    values = np.repeat(made.f_r(theta_i, theta_r, turn)[..., np.newaxis], 2, axis=-1)
    data = xr.Dataset({"brdf": (tuple(axes), values, {"units": "sr-1"})}, coords=axes)
    for name, unit in units.items():
        data[name].attrs["units"] = unit
    data.to_netcdf(tmp_path / "a.nc", engine="scipy")
    samples = formats.samples(tmp_path / "a.nc")
    assert samples.channels == ("550nm", "650nm")
    for direction in ((20.0, 40.0, 90.0), (40.0, 60.0, 180.0), (60.0, 20.0, 0.0)):
        assert value_at(samples, direction) == pytest.approx(float(made.f_r(*direction)), abs=1e-6)
    for name in ("theta_i", "wavelength"):
        damaged = data.copy(deep=True)
        del damaged[name].attrs["units"]
        damaged.to_netcdf(tmp_path / "b.nc", engine="scipy")
        sentence = (
            "field theta_i: it has no units, .* degree or rad" if name == "theta_i" else "wavelength-unit um|0.55"
        )
        with pytest.raises(FileFormatError, match=sentence):
            formats.samples(tmp_path / "b.nc")
