"""Rows of texts: units and comments among them, titles above them, repeated directions, rows in a plane, cut files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from brdfdb.errors import FileFormatError
from tests.formats.a_file import check_texts_refused, notes_of, samples_of

NAMES = "theta_i,theta_r,delta_phi,brdf"
ROWS = "10,20,180,0.5\n40,20,180,0.25\n"


def test_comments_that_change_nothing_are_left_out(tmp_path: Path) -> None:
    comments = (NAMES, "wavelength 450 nm", "the light is at 40 degrees now", "in degrees", "20,20,180,0.5", "values")
    text = "".join(f"# {comment}\n{angle},20,180,0.5\n" for angle, comment in enumerate(comments))
    assert len(samples_of(tmp_path, f"# wavelength 450 nm\n{NAMES}\n{ROWS}{text}")) == 2 + len(comments)


@pytest.mark.parametrize(("factor", "stated"), [(2.0, True), (1.1, False)])
def test_values_that_contradict_at_the_same_directions_of_a_file_are_stated(
    factor: float, stated: bool, tmp_path: Path
) -> None:
    again = f"10,20,180,{0.5 * factor}\n40,20,180,{0.25 * factor}\n"
    sheet = samples_of(tmp_path, f"{NAMES}\n{ROWS}{again}")
    sentence = "At 2 directions that more than one row has, f_r differs by 100 % in the median."
    assert (sentence in notes_of(sheet)) == stated
    assert np.unique(sheet.theta_i).size == 2


def test_a_row_of_units_below_the_names_is_read(tmp_path: Path) -> None:
    sheet = samples_of(tmp_path, "theta_i,theta_r,delta_phi,BRF,u\nrad,mrad,deg,%,%\n0.5,250,180,40,2\n")
    assert [sheet.theta_i[0], sheet.theta_r[0], sheet.phi_r[0]] == pytest.approx([0.5, 0.25, np.pi])
    assert sheet.values[0] == pytest.approx([0.4 / np.pi])
    assert sheet.uncertainty is not None
    assert sheet.uncertainty[0] == pytest.approx([0.02 * 0.4 / np.pi])
    assert "titles" not in sheet.record
    waves = samples_of(tmp_path, f"wavelength,{NAMES}\num,deg,deg,deg,1/sr\n0.55,10,20,180,0.5\n")
    assert waves.channels == ("550nm",)


@pytest.mark.parametrize(
    ("title", "name", "factor"),
    [
        ("BRF in percent", "BRF", 0.01),
        ("reflectance factors [%]", "BRF", 0.01),
        ("values are given in %", "BRF", 0.01),
        ("uncertainty of the BRF in percent: 2", "BRF", 1.0),
        ("BRF at a humidity of 40 percent", "BRF", 1.0),
        ("BRF in percent", "BRF [1]", 1.0),
    ],
)
def test_percent_beside_the_quantity_in_a_title_counts(title: str, name: str, factor: float, tmp_path: Path) -> None:
    sheet = samples_of(tmp_path, f"# {title}\ntheta_i,theta_r,delta_phi,{name}\n10,20,180,0.5\n")
    assert sheet.values[0] == pytest.approx([factor * 0.5 / np.pi])
    assert ("Values in percent were divided by 100." in notes_of(sheet)) == (factor < 1.0)


@pytest.mark.parametrize(
    ("title", "channel"),
    [
        ("measured at 532 nm", "532nm"),
        ("bandwidth 10 nm\n# wavelength 0.65 um", "650nm"),
        ("wavelength = 0.65 \u00b5m, polished to Rq = 35 nm", "650nm"),
        ("laser: 632.8 nm, calibrated at 550 nm", "632.8nm"),
        ("632.8 nm laser", "632.8nm"),
        ("Wavelength: 450 nm and wavelength 650 nm", "grey"),
        ("bandwidth 10 nm", "grey"),
        ("roughness Rq = 35 nm", "grey"),
        ("thickness of the coating 200 nm", "grey"),
        ("laser bandwidth 10 nm", "grey"),
    ],
)
def test_a_length_of_a_title_is_a_wavelength_only_by_its_words(title: str, channel: str, tmp_path: Path) -> None:
    assert samples_of(tmp_path, f"# {title}\n{NAMES}\n{ROWS}").channels == (channel,)


@pytest.mark.parametrize(
    ("title", "unit"), [("all angles in radians", "radians"), ("Angles: deg", "degrees"), ("25 degree angle", "")]
)
def test_a_title_on_angles_gives_their_unit(title: str, unit: str, tmp_path: Path) -> None:
    sheet = samples_of(tmp_path, f"# {title}\n{NAMES}\n0.5,1,3,0.5\n0.5,1.2,3,0.5\n")
    assert sheet.record["angles"] == (unit or "degrees")
    assert (f"Angles were taken as {unit}: a title says {title!r}." in notes_of(sheet)) == bool(unit)
    assert ("may be radians" in notes_of(sheet)) == (not unit)


def test_titles_of_cosines_and_forward_azimuths_are_doubted(tmp_path: Path) -> None:
    cosine, forward = "values are BRDF times cos(theta_r)", "azimuth 0 is the forward (specular) direction"
    text = f"# {cosine}\n# {forward}\n{NAMES}\n{ROWS}"
    notes = notes_of(samples_of(tmp_path, text))
    for shown in (cosine, "--quantity f_r_cos", forward, "--azimuth forward"):
        assert shown in notes
    assert "A title says" not in notes_of(samples_of(tmp_path, text, quantity="f_r_cos", azimuth="forward"))
    plain = "# values are f_r without the cosine\n# azimuth 0 is at the light, 180 is specular\n"
    assert notes_of(samples_of(tmp_path, f"{plain}{NAMES}\n{ROWS}")) == ""


@pytest.mark.parametrize("suffix", [".csv", ".txt"])
def test_without_azimuths_the_signs_of_polar_angles_tell_the_side(suffix: str, tmp_path: Path) -> None:
    name, text = f"plane{suffix}", "theta_i,theta_r,brdf\n30,-40,0.1\n30,0,0.2\n30,40,0.3\n"
    plane = samples_of(tmp_path, text, name)
    assert np.round(np.degrees(plane.theta_r)).tolist() == [40.0, 0.0, 40.0]
    assert np.cos(plane.phi_r - plane.phi_i)[[0, 2]].tolist() == pytest.approx([1.0, -1.0])
    assert plane.values[:, 0].tolist() == [0.1, 0.2, 0.3]
    assert "No column is an azimuth" in notes_of(plane)
    assert not plane.turned
    placed = samples_of(tmp_path, text.replace("\n30", "\n-30") + "-50,40,0.3\n", name)
    assert np.cos(placed.phi_r - placed.phi_i)[[0, 2, 3]].tolist() == pytest.approx([1.0, -1.0, -1.0])


# Files that were cut, as csv and for FRED

LISTED = [f"{light},{viewer},180,{0.1 * light + 0.01 * viewer:.6f}" for light in (10, 20, 30) for viewer in (0, 15, 25)]
HEAD = ["type bsdf_data", "format angles=deg bsdf=value scale=1"]
BLOCKS = [
    row
    for light in (10, 20, 30)
    for row in (f"{light}\t0", *(f"{r}\t{p}\t{0.01 * (r + p):.4f}" for r in (5, 15) for p in (0, 90)))
]
CSV, FRED = "sheet.csv", "sheet.fred.txt"
EXPONENTS = [NAMES, *(f"10,{viewer},180,{0.0125 * viewer:.2e}" for viewer in range(5, 60, 5))]


@pytest.mark.parametrize(
    ("lines", "end", "name"),
    [
        ([NAMES, *LISTED], LISTED[-1][:-2], CSV),
        ([*HEAD, *BLOCKS], BLOCKS[-1][:-2], FRED),
        ([*EXPONENTS, "10,60,180,7.50e-01"], "10,60,180,1.25e-0", CSV),
        ([*EXPONENTS, "10,60,180,7.50e-01"], "10,60,180,1.2", CSV),
    ],
)
def test_a_file_that_was_cut_within_its_last_number_is_refused(
    lines: list[str], end: str, name: str, tmp_path: Path
) -> None:
    assert len(samples_of(tmp_path, "\n".join(lines), name)) > 1
    sentence = rf"line {len(lines)}: '.*' has fewer decimals .* cut within it"
    check_texts_refused(tmp_path / name, {"\n".join([*lines[:-1], end]): sentence})


@pytest.mark.parametrize(
    ("lines", "name", "shown"),
    [
        ([NAMES, *LISTED[:-1]], CSV, "2 rows where others have 3"),
        ([*HEAD, *BLOCKS[:-2]], FRED, "2 rows where others have 4"),
    ],
)
def test_a_file_without_an_end_whose_last_light_has_few_viewers_is_doubted(
    lines: list[str], name: str, shown: str, tmp_path: Path
) -> None:
    notes = notes_of(samples_of(tmp_path, "\n".join(lines), name))
    assert "Cut? Its last line has no end" in notes
    assert shown in notes
    assert "Cut?" not in notes_of(samples_of(tmp_path, "\n".join([*lines, ""]), name))


def test_whole_files_without_an_end_and_numbers_of_any_length_are_not_doubted(tmp_path: Path) -> None:
    rows = ["10,0,180,0.125", "10,20,180,1", "20,0,180,0.5", "20,20,180,2"]
    for lines in ([NAMES, *LISTED], [NAMES, *rows]):
        assert "Cut?" not in notes_of(samples_of(tmp_path, "\n".join(lines)))


@pytest.mark.parametrize(("lines", "line"), [([*HEAD, *BLOCKS[:5], "20\t0"], 8), ([*HEAD, "10\t0", *BLOCKS], 3)])
def test_a_light_of_fred_without_viewers_is_refused(lines: list[str], line: int, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=f"line {line} is a light without viewers"):
        samples_of(tmp_path, "\n".join([*lines, ""]), FRED)
