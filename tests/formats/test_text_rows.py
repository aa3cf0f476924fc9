"""Texts whose rows are not all alike, or lie in one plane: comments and units among them, repeated directions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brdfdb import formats
from brdfdb.errors import FileFormatError
from brdfdb.measurements import Samples
from brdfdb.measurements.statement import statement

NAMES = "theta_i,theta_r,delta_phi,brdf"
ROWS = "10,20,180,0.5\n40,20,180,0.25\n"


def samples(tmp_path: Path, text: str, **keywords: Any) -> Samples:
    path = tmp_path / "sheet.csv"
    path.write_text(text, encoding="utf-8")
    return formats.samples(path, **keywords)


@pytest.mark.parametrize(
    ("title", "comment", "sentence"),
    [
        ("wavelength 450 nm", "wavelength 650 nm", "gives a wavelength of 650 nm, and rows before it have 450 nm"),
        ("of paint", "wavelength 650 nm", "gives a wavelength of 650 nm, and rows before it have none"),
        ("of paint", "theta_r,theta_i,delta_phi,brdf", "names other columns than line 2: theta_r, theta_i, delta_phi"),
        ("of paint", "theta_i,theta_r,delta_phi,BRF", "names other columns than line 2: theta_i, theta_r, delta_phi"),
        ("of paint", "theta in radians", "gives angles another unit: 'theta in radians'"),
        ("theta in rad", "theta in degrees", "gives angles another unit: 'theta in degrees'"),
    ],
)
def test_rows_below_a_comment_that_changes_them_are_refused(
    title: str, comment: str, sentence: str, tmp_path: Path
) -> None:
    with pytest.raises(FileFormatError, match=rf"line 5 {sentence}.*; write a file for each"):
        samples(tmp_path, f"# {title}\n{NAMES}\n{ROWS}# {comment}\n{ROWS}")
    assert len(samples(tmp_path, f"# {title}\n{NAMES}\n{ROWS}# {comment}\n")) == 2  # no row is below it


def test_comments_that_change_nothing_are_left_out(tmp_path: Path) -> None:
    comments = (NAMES, "wavelength 450 nm", "the light is at 40 degrees now", "in degrees", "20,20,180,0.5", "values")
    text = "".join(f"# {comment}\n{angle},20,180,0.5\n" for angle, comment in enumerate(comments))
    assert len(samples(tmp_path, f"# wavelength 450 nm\n{NAMES}\n{ROWS}{text}")) == 2 + len(comments)


@pytest.mark.parametrize(("factor", "stated"), [(2.0, True), (1.1, False)])
def test_values_that_contradict_at_the_same_directions_of_a_file_are_stated(
    factor: float, stated: bool, tmp_path: Path
) -> None:
    again = f"10,20,180,{0.5 * factor}\n40,20,180,{0.25 * factor}\n"
    sheet = samples(tmp_path, f"{NAMES}\n{ROWS}{again}")
    sentence = "At 2 directions that more than one row has, f_r differs by 100 % in the median."
    assert (sentence in statement(sheet).notes) == stated
    assert np.unique(sheet.theta_i).size == 2


def test_a_row_of_units_below_the_names_is_read(tmp_path: Path) -> None:
    sheet = samples(tmp_path, "theta_i,theta_r,delta_phi,BRF,u\nrad,mrad,deg,%,%\n0.5,250,180,40,2\n")
    assert [sheet.theta_i[0], sheet.theta_r[0], sheet.phi_r[0]] == pytest.approx([0.5, 0.25, np.pi])
    assert sheet.values[0] == pytest.approx([0.4 / np.pi])
    assert sheet.uncertainty is not None
    assert sheet.uncertainty[0] == pytest.approx([0.02 * 0.4 / np.pi])
    assert "titles" not in sheet.record
    with pytest.raises(FileFormatError, match="the unit 'gon' is none of angles"):
        samples(tmp_path, f"{NAMES}\ngon,gon,gon,1/sr\n{ROWS}")
    waves = samples(tmp_path, f"wavelength,{NAMES}\num,deg,deg,deg,1/sr\n0.55,10,20,180,0.5\n")
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
    sheet = samples(tmp_path, f"# {title}\ntheta_i,theta_r,delta_phi,{name}\n10,20,180,0.5\n")
    assert sheet.values[0] == pytest.approx([factor * 0.5 / np.pi])
    assert ("Values in percent were divided by 100." in statement(sheet).notes) == (factor < 1.0)


@pytest.mark.parametrize(
    ("title", "wavelength_nm"),
    [
        ("measured at 532 nm", 532.0),
        ("bandwidth 10 nm\n# wavelength 0.65 um", 650.0),
        ("wavelength = 0.65 \u00b5m, polished to Rq = 35 nm", 650.0),
        ("laser: 632.8 nm, calibrated at 550 nm", 632.8),
        ("632.8 nm laser", 632.8),
        ("Wavelength: 450 nm and wavelength 650 nm", None),
        ("bandwidth 10 nm", None),
        ("roughness Rq = 35 nm", None),
        ("thickness of the coating 200 nm", None),
        ("laser bandwidth 10 nm", None),
    ],
)
def test_a_length_of_a_title_is_a_wavelength_only_by_its_words(
    title: str, wavelength_nm: float | None, tmp_path: Path
) -> None:
    sheet = samples(tmp_path, f"# {title}\n{NAMES}\n{ROWS}")
    assert sheet.channels == ("grey" if wavelength_nm is None else f"{wavelength_nm:g}nm",)


@pytest.mark.parametrize(
    ("name", "number", "shown"),
    [
        ("U (k=2)", 0.02, "divided by their coverage factor k, 2."),
        ("U (k = 2, 95 %)", 0.02, "divided by their coverage factor k, 2."),
        ("U [%] (k=2)", 4.0, "taken as percent of the values"),
        ("u [rel]", 0.02, "Relative uncertainties were multiplied by the values"),
        ("u [%]", 2.0, "taken as percent of the values"),
        ("u [1/sr]", 0.01, "read from the column u [1/sr]"),
    ],
)
def test_uncertainties_are_made_standard_ones_in_1_sr(name: str, number: float, shown: str, tmp_path: Path) -> None:
    text = f'{NAMES},"{name}"\n10,20,180,0.5,{number}\n'
    sheet = samples(tmp_path, text)
    assert sheet.uncertainty is not None
    assert sheet.uncertainty[0] == pytest.approx([0.01])
    assert any(shown in text for text in statement(sheet).notes)
    assert not any("not known" in text for text in statement(sheet).notes)


def test_a_probability_of_uncertainties_is_refused(tmp_path: Path) -> None:
    with pytest.raises(
        FileFormatError, match=r"line 1, field U \(95 %\): a probability is no unit; write the coverage"
    ):
        samples(tmp_path, f"{NAMES},U (95 %)\n10,20,180,0.5,0.02\n")


def test_titles_of_cosines_and_forward_azimuths_are_doubted(tmp_path: Path) -> None:
    cosine, forward = "values are BRDF times cos(theta_r)", "azimuth 0 is the forward (specular) direction"
    text = f"# {cosine}\n# {forward}\n{NAMES}\n{ROWS}"
    notes = statement(samples(tmp_path, text)).notes
    assert any(cosine in sentence and "--quantity f_r_cos" in sentence for sentence in notes)
    assert any(forward in sentence and "--azimuth forward" in sentence for sentence in notes)
    stated = statement(samples(tmp_path, text, quantity="f_r_cos", azimuth="forward")).notes
    assert not any("A title says" in sentence for sentence in stated)
    plain = "# values are f_r without the cosine\n# azimuth 0 is at the light, 180 is specular\n"
    assert statement(samples(tmp_path, f"{plain}{NAMES}\n{ROWS}")).notes == ()


@pytest.mark.parametrize("suffix", [".csv", ".txt"])
def test_without_azimuths_the_signs_of_polar_angles_tell_the_side(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"plane{suffix}"
    path.write_text("theta_i,theta_r,brdf\n30,-40,0.1\n30,0,0.2\n30,40,0.3\n")
    samples = formats.samples(path)
    assert np.round(np.degrees(samples.theta_r)).tolist() == [40.0, 0.0, 40.0]
    assert np.cos(samples.phi_r - samples.phi_i)[[0, 2]].tolist() == pytest.approx([1.0, -1.0])
    assert samples.values[:, 0].tolist() == [0.1, 0.2, 0.3]
    assert any("No column is an azimuth" in sentence for sentence in statement(samples).notes)
    assert not samples.turned
    path.write_text("theta_i,theta_r,brdf\n-30,-40,0.1\n-30,0,0.2\n-30,40,0.3\n-50,40,0.3\n")
    placed = formats.samples(path)
    assert np.cos(placed.phi_r - placed.phi_i)[[0, 2, 3]].tolist() == pytest.approx([1.0, -1.0, -1.0])


@pytest.mark.parametrize("suffix", [".csv", ".txt"])
def test_without_azimuths_and_signs_a_side_is_asked_for(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"plane{suffix}"
    path.write_text("theta_i,theta_r,brdf\n30,0,0.2\n30,40,0.3\n")
    with pytest.raises(FileFormatError, match=r"no column is the azimuth .* --column delta_phi=NAME"):
        formats.samples(path)
