"""Statements of a user on the numbers of a file of any format: quantity, angles, azimuths, wavelengths and k."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from brdfdb import formats
from brdfdb.errors import FileFormatError, ParameterError
from brdfdb.formats import EXPORTERS, IMPORTERS
from brdfdb.measurements.conventions import ANGLE_WORDS, AZIMUTHS, CONVENTION_KEYS, QUANTITIES, remedy
from brdfdb_pipelines.commands import _reading
from brdfdb_pipelines.measured_job import MeasuredTable
from tests.formats import made_files as made
from tests.formats.a_file import POLARISED_ALONE, exported, notes_of, samples_of
from tests.formats.small_tables import DIFFUSE

# Three samples: theta_i, phi_i, theta_r, phi_r [degree] and f_r [1/sr]
ROWS = ((20.0, 0.0, 40.0, 180.0, 0.5), (60.0, 0.0, 10.0, 90.0, 0.125), (50.0, 0.0, 30.0, 45.0, 0.0625))
ANGLES = np.radians(np.array(ROWS)[:, :4])
F_R = np.array(ROWS)[:, 4]
NUMBERS = {  # of f_r, by their definitions
    "f_r": F_R,
    "reflectance_factor": np.pi * F_R,
    "percent": 100.0 * F_R,
    "reflectance_factor_percent": 100.0 * np.pi * F_R,
    "log10": np.log10(F_R),
    "ln": np.log(F_R),
    "decibel": 10.0 * np.log10(F_R),
    "f_r_cos": F_R * np.cos(ANGLES[:, 2]),
    "f_r_cos_i": F_R * np.cos(ANGLES[:, 0]),
}


def text_of(rows: Any, numbers: Any, form: str) -> str:
    """Return the samples as a text with commas, ASTM in radians as given, FRED, pab-opto or OpenMATERIAL."""
    lines = [(*row[:4], number) for row, number in zip(rows, numbers, strict=True)]
    if form == "csv":
        return "theta_i,phi_i,theta_r,phi_r,brdf\n" + "".join(",".join(map(repr, map(float, x))) + "\n" for x in lines)
    if form == "astm":
        body = "".join(",".join(map(repr, map(float, x))) + "\n" for x in lines)
        return f"ASTM E1392\nNUM_POINTS {len(lines)}\nVARS theta_i,phi_i,theta_s,phi_s,BRDF\n{body}"
    if form == "fred":  # azimuths of viewers count from the mirror direction
        blocks = "".join(f"{i:g}\t{p:g}\n{r:g}\t{(p + 180 - q) % 360:g}\t{n!r}\n" for i, p, r, q, n in lines)
        return f"type bsdf_data\nformat angles=deg bsdf=value scale=1\n{blocks}"
    table = [[550e-9, *np.radians(x[:1]), *np.radians(x[2:4]), x[4]] for x in lines]
    return json.dumps({"$schema": "material_brdf_schema", "brdf": {"wavelengths": [550e-9], "lookupTable": table}})


def radians_of(rows: Any) -> list[tuple[float, ...]]:
    return [(*np.radians(row[:4]), row[4]) for row in rows]


@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize(
    ("name", "form"), [("a.csv", "csv"), ("a.astm", "astm"), ("a.fred.txt", "fred"), ("a.xompt", "")]
)
def test_every_quantity_is_read_from_every_listed_format(name: str, form: str, quantity: str, tmp_path: Path) -> None:
    rows = radians_of(ROWS) if form == "astm" else ROWS
    samples = samples_of(tmp_path, text_of(rows, NUMBERS[quantity].tolist(), form), name, quantity=quantity)
    assert len(samples) == 3
    for angles, f_r in zip(ANGLES, F_R, strict=True):
        at = np.argmin(np.abs(samples.theta_i - angles[0]) + np.abs(samples.theta_r - angles[2]))
        assert (samples.theta_i[at], samples.theta_r[at]) == pytest.approx((angles[0], angles[2]), abs=1e-6)
        assert samples.values[at, 0] == pytest.approx(f_r, rel=1e-9)


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        (lambda i, p, r, q: (90.0 - i, p, 90.0 - r, q), "elevation"),
        (lambda i, p, r, q: (90.0 - i, p, r, q), "elevation_i"),
        (lambda i, p, r, q: (i, p, 90.0 - r, q), "elevation_r"),
        (lambda i, p, r, q: (np.radians(i), np.radians(p), np.radians(r), np.radians(q)), "rad"),
        (lambda i, p, r, q: (*np.radians([90.0 - i, p, 90.0 - r, q]),), "rad,elevation"),
        (lambda i, p, r, q: (p, i, q, r), "exchanged"),
    ],
)
def test_angles_are_what_is_stated(columns: Any, words: str, tmp_path: Path) -> None:
    text = text_of([(*columns(*row[:4]), row[4]) for row in ROWS], F_R, "csv")
    samples = samples_of(tmp_path, text, angles=words)
    order = np.argsort(-samples.values[:, 0])
    for name, column in zip(("theta_i", "phi_i", "theta_r", "phi_r"), ANGLES.T, strict=True):
        assert getattr(samples, name)[order] == pytest.approx(column, abs=1e-9)


def test_elevations_of_the_normal_may_be_rounded(tmp_path: Path) -> None:
    """pi / 2 with four and more digits, above and below; a degree beyond it is none."""
    sheet = "theta_i,theta_r,delta_phi,brdf\n1.5708,1.5707963,3.1416,0.5\n1.0,1.57079633,3.1416,0.4\n"
    samples = samples_of(tmp_path, sheet, angles="elevation,rad")
    assert np.sort(samples.theta_r) == pytest.approx([0.0, 2.7e-8], abs=1e-8)
    with pytest.raises(FileFormatError, match="theta_i"):
        samples_of(tmp_path, sheet.replace("1.5708,", "1.5882,"), angles="elevation,rad")


def test_degrees_in_a_format_of_radians_are_read_if_stated(tmp_path: Path) -> None:
    samples = samples_of(tmp_path, text_of(ROWS, F_R, "astm"), "a.astm", angles="deg")
    assert samples.theta_r[np.argsort(-samples.values[:, 0])] == pytest.approx(ANGLES[:, 2])
    assert "Angles were read as stated: deg." in notes_of(samples)


def test_wavelengths_are_in_the_unit_that_is_stated(tmp_path: Path) -> None:
    text = text_of(ROWS, F_R, "").replace("5.5e-07", "550.0")
    assert samples_of(tmp_path, text, "a.xompt", wavelength_unit="nm").wavelength_nm == pytest.approx([550.0])
    sheet = "theta_i,theta_r,delta_phi,wavelength,brdf\n10,20,180,10.6,0.5\n20,30,180,10.6,0.4\n"
    assert samples_of(tmp_path, sheet, wavelength_unit="um").wavelength_nm == pytest.approx([10600.0])


@pytest.mark.parametrize(
    ("word", "viewer", "light"),
    [
        ("absolute", lambda p, q: q + 0.0 * p, lambda p: p),
        ("light", lambda p, q: q - p, lambda p: p),
        ("mirror", lambda p, q: q - p - 180.0, lambda p: p),
        ("forward", lambda p, q: q + 0.0 * p, lambda p: p + 180.0),
    ],
)
def test_azimuths_count_from_where_it_is_stated(word: str, viewer: Any, light: Any, tmp_path: Path) -> None:
    turned = [(i, 30.0 + 40.0 * number, r, q, f) for number, (i, _, r, q, f) in enumerate(ROWS)]
    text = text_of([(i, light(p), r, viewer(p, q), f) for i, p, r, q, f in turned], F_R, "csv")
    samples = samples_of(tmp_path, text, azimuth=word)
    order = np.argsort(-samples.values[:, 0])
    for angle, column in ((samples.phi_i, 1), (samples.phi_r, 3)):
        assert np.cos(angle[order] - np.radians(np.array(turned)[:, column])) == pytest.approx(1.0)


def test_uncertainties_follow_their_values(tmp_path: Path) -> None:
    text = "theta_i,theta_r,delta_phi,brdf,std\n60,20,180,0.25,0.01\n"
    samples = samples_of(tmp_path, text, quantity="f_r_cos_i", coverage_factor=2.0)
    assert samples.values[0, 0] == pytest.approx(0.5)
    assert samples.uncertainty is not None
    assert samples.uncertainty[0, 0] == pytest.approx(0.01)  # 0.01 / 0.5 / 2
    text = "theta_i,theta_r,delta_phi,brdf,std\n60,20,180,-1,0.01\n"
    samples = samples_of(tmp_path, text, quantity="log10")
    assert samples.uncertainty is not None
    assert samples.uncertainty[0, 0] == pytest.approx(0.1 * np.log(10.0) * 0.01)


def test_relative_uncertainties_are_those_of_f_r_where_values_are_logarithms(tmp_path: Path) -> None:
    samples = samples_of(tmp_path, "theta_i,theta_r,delta_phi,brdf,std [%]\n60,20,180,-1,3\n", quantity="log10")
    assert samples.uncertainty is not None
    assert samples.uncertainty[0, 0] == pytest.approx(0.1 * 0.03)


def test_f_r_between_the_values_of_a_table_is_converted(tmp_path: Path) -> None:
    path = exported(tmp_path, "merl", DIFFUSE)
    there = formats.read(path)
    angles = np.radians([50.0, 0.0, 20.0, 120.0])
    cosine = np.cos(angles[0])
    assert formats.read(path, quantity="f_r_cos_i").lookup(*angles) == pytest.approx(there.lookup(*angles) / cosine)
    assert formats.read(path, quantity="reflectance_factor").lookup(*angles) == pytest.approx(
        there.lookup(*angles) / np.pi
    )
    for keywords, sentence in (
        ({"angles": "elevation"}, "angles: .*files of merl list no angles of light and viewer"),
        ({"azimuth": "mirror"}, "azimuth: .*files of merl list no angles of light and viewer"),
    ):
        with pytest.raises(ParameterError, match=sentence):
            formats.read(path, **keywords)


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        (lambda i, p, r, q: (90.0 - i, p, 90.0 - r, q), "elevation"),
        (lambda i, p, r, q: (*np.radians([i, p, r, q]),), "rad"),
        (lambda i, p, r, q: (p, i, q, r), "exchanged"),
    ],
)
def test_fred_counts_azimuths_from_the_mirror_direction_whatever_angles_are(
    columns: Any, words: str, tmp_path: Path
) -> None:
    """The numbers of the file are theta_i, phi_i, theta_r and the azimuth from the mirror direction."""
    blocks = ""
    for (*angles, _), number in zip(ROWS, F_R.tolist(), strict=True):
        i, p, r, q = columns(angles[0], angles[1], angles[2], (angles[1] + 180.0 - angles[3]) % 360.0)
        blocks += f"{i!r}\t{p!r}\n{r!r}\t{q!r}\t{number!r}\n".replace("np.float64(", "").replace(")", "")
    text = f"type bsdf_data\nformat angles=deg bsdf=value scale=1\n{blocks}"
    samples = samples_of(tmp_path, text, "a.fred.txt", angles=words)
    order = np.argsort(-samples.values[:, 0])
    assert samples.theta_i[order] == pytest.approx(ANGLES[:, 0])
    assert samples.theta_r[order] == pytest.approx(ANGLES[:, 2])
    assert np.cos(samples.phi_r - samples.phi_i)[order] == pytest.approx(np.cos(ANGLES[:, 3]), abs=1e-9)


@pytest.mark.parametrize(
    ("angles", "sentence"),
    [("rad", "files of pabopto state the unit of their angles"), ("exchanged", "files of pabopto count azimuths from")],
)
def test_what_a_format_cannot_mean_is_refused(angles: str, sentence: str, tmp_path: Path) -> None:
    text = "#format: theta phi BRDF\n#intheta 10\n#inphi 0\n20 30 0.5\n"
    with pytest.raises(ParameterError, match=sentence):
        samples_of(tmp_path, text, "a.txt", file_format="pabopto", angles=angles)


def test_command_line_and_recipes_have_the_same_words() -> None:
    assert tuple(QUANTITIES) == _reading.QUANTITIES
    assert _reading.ANGLE_WORDS == ANGLE_WORDS
    assert _reading.AZIMUTHS == AZIMUTHS
    of_recipe = MeasuredTable.model_fields
    assert get_args(of_recipe["quantity"].annotation) == ("", *QUANTITIES)
    assert get_args(of_recipe["azimuth"].annotation) == ("", *AZIMUTHS)
    table = MeasuredTable(
        samples="a.csv", quantity="log10", angles="rad,elevation", azimuth="mirror", coverage_factor=2
    )
    assert {key: table.keywords[key] for key in CONVENTION_KEYS if key in table.keywords} == {
        "quantity": "log10",
        "angles": "rad,elevation",
        "azimuth": "mirror",
        "coverage_factor": 2.0,
    }
    with pytest.raises(ValueError, match="'gon' is not one of deg"):
        MeasuredTable(samples="a.csv", angles="gon")


FORMULA = ("materialx", "neural")  # no directions are listed


@pytest.mark.parametrize("name", [name for name in IMPORTERS if name not in FORMULA])
def test_options_that_are_proposed_are_taken(name: str, tmp_path: Path) -> None:
    """`remedy` gives the words of an option where `read` takes it, and none where it refuses it."""
    texts = {"text": made.sheet, "lighttools": made.lighttools, "pabopto": made.pabopto, "astm": made.astm}
    path = tmp_path / "a.txt"
    if name in texts:
        path.write_text(texts[name]())
    elif name == "utia":
        path.write_bytes(made.utia_planes().astype("<f8").tobytes())
    elif name in EXPORTERS and name not in POLARISED_ALONE:
        path = exported(tmp_path, name)
    else:
        pytest.skip("its own tests have files")
    samples = formats.samples(path, name)
    record = samples.record
    options = [("angles", word) for word in ("rad", "elevation", "exchanged")]
    options += [("azimuth", word) for word in ("mirror", "forward")]
    if samples.wavelength_nm is not None:
        options.append(("wavelength_unit", "um"))
    for keyword, value in (*options, ("missing", 0.5)):
        words = f"--{keyword.replace('_', '-')} {value} reads them"
        try:
            formats.read(path, name, **{keyword: value})
            taken = True
        except FileFormatError:  # it is taken, and does not fit these numbers
            taken = True
        except ParameterError:
            taken = False
        assert remedy(record, words) == (words if taken else "correct the file"), words


def _with_lambda(name: str, number: float) -> str:
    lines = made.sheet(f"theta_i,theta_r,delta_phi,BRDF,{name}").splitlines()
    return "\n".join([lines[0], *(f"{line},{number:g}" for line in lines[1:]), ""])


@pytest.mark.parametrize(
    ("name", "content", "unit"),
    [
        ("a.csv", _with_lambda("lambda_nm", 0.55), "um"),
        ("a.csv", _with_lambda("lambda_nm", 5.5e-7), "m"),
        ("a.csv", _with_lambda("lambda_nm", 2e6), ""),
        ("a.csv", made.sheet("theta_i,theta_r,delta_phi,BRDF_2000000nm"), ""),
        ("a.astm", made.astm("5nm"), "um"),
        ("a.astm", made.astm("2000000nm"), ""),
        ("a.ssdd", made.ssdd().replace("T 550", "T 0.55"), "um"),
        ("a.ssdd", made.ssdd().replace("T 550", "T 2000000"), ""),
        ("a.xompt", made.openmaterial(550.0), "nm"),
        ("a.xompt", made.openmaterial(0.55), "um"),
        ("a.xompt", made.openmaterial(5e6), ""),
        ("a.json", made.bird().replace("550.0", "5.5e-7"), "m"),
        ("a.json", made.bird().replace("550.0", "2e6"), ""),
    ],
)
def test_a_unit_of_wavelengths_is_proposed_where_it_is_taken_and_mends_them(
    name: str, content: str, unit: str, tmp_path: Path
) -> None:
    path = tmp_path / name
    path.write_text(content)
    end = f"; if the numbers are {unit}, state --wavelength-unit {unit}" if unit else r"outside \[10, 1e\+06\] nm"
    with pytest.raises(FileFormatError, match=f"field wavelength_nm: .*{end}$"):
        formats.samples(path)
    if unit:
        at = formats.samples(path, wavelength_unit=unit).wavelength_nm
        assert at is not None
        assert at[0] in (550.0, 5000.0)
