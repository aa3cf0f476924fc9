"""Texts that are refused: the sentence names the line, the field and what is wrong with it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from brdfdb.errors import FileFormatError
from tests.formats.a_file import check_texts_refused, samples_of

DEGREES = {"angles": "deg", "file_format": "text"}
ROLES = {"theta_i": "sun", "theta_r": "view", "delta_phi": "turn", "values": "number"}
PLANE = "theta_i,theta_r,delta_phi,brdf"
ROWS = "10,20,180,0.5\n40,20,180,0.25\n"
# Texts, keywords and sentences
REFUSED: list[tuple[str, dict[str, str], str]] = [
    ("theta_i,theta_r,raa,brdf\n1,2,3,4\n1,2,3\n", DEGREES, "line 3 has 3 fields, but the first row has 4"),
    ("theta_i,theta_r,raa,brdf\n1,2,3,4\n1,2,x,4\n", DEGREES, "line 3, field raa: 'x' is not a number"),
    ("theta_i,theta_r,raa,brdf\n1,2,3,4\n1,2,3,inf\n", DEGREES, "line 3, field brdf: 'inf' is not a number"),
    ("theta_i,theta_r,raa,brdf\n1,2,3,4\n1,,3,4\n", DEGREES, "line 3, field theta_r: an angle is missing"),
    ("theta_i,theta_r,raa,brdf\n1,200,3,4\n", DEGREES, "line 2: theta_r of 200 degrees is not a polar angle"),
    ("theta_i,theta_r,raa,brdf\n1,100,3,4\n", DEGREES, "none of its 1 values is above the horizon"),
    ("theta_i,sza,theta_r,raa,brdf\n1,2,3,4,5\n", DEGREES, "line 1: theta_i and sza are both theta_i; name the column"),
    ("a,b,c,d\n1,2,3,4\n", DEGREES, "no column is theta_i, theta_r, values, among a, b, c, d"),
    ("no numbers at all\n", DEGREES, "line 1: none of the first 1000 lines is a row of numbers"),
    (f"theta_i,theta_r,raa,brdf\n1,2,3,4\n{'5' * 1_100_000}\n", DEGREES, "line 3 has more than 1048576 characters"),
    ("sza,vza,raa,x,y,z\n10,20,180,1,2,3\n", DEGREES, "no column is values, among"),
    ("2O 20 180 0.5\n10 20 180 0.5\n", DEGREES, "line 1, field 1: '2O' is not a number"),
    ("sun view turn number\n2O 20 180 0.5\n10 20 180 0.5\n", ROLES, "line 2, field sun: '2O' is not a number"),
    ("sza,vza,raa,brdf\n1O,20,180,0.5\n10,20,180,0.5\n", {}, "line 2, field sza: '1O' is not a number"),
    ("sza,vza,raa,brdf\n10,20,180\n10,20,180,0.5\n", {}, "line 2 has 3 fields, but the first valid row has 4"),
    (
        "sza\tvza\traa\tbrdf\n10.5\t20\t180\t1,000\n",
        {},
        r"line 2, field brdf: '1,000' has ',' where numbers above it have",
    ),
    ("sun view turn number\n10 20 180 0.5\n", {}, r"the columns sun, view, turn, number: .*--column theta_i="),
    (
        "theta_i [gon],theta_r [gon],raa [gon],brdf\n1,2,3,4\n",
        {},
        r"field theta_i \[gon\]: the unit 'gon' is not a unit of",
    ),
    (f"{PLANE}\ngon,gon,gon,1/sr\n{ROWS}", {}, "the unit 'gon' is not a unit of angles"),
    ("theta_i,theta_r,phi_i,Phi,brdf\n10,20,0,150,0.5\n", {}, "no column is the azimuth of the viewer"),
    (
        "theta_i,theta_r,rel_azimuth_2,brdf\n30,0,0,0.2\n30,40,0,0.3\n",
        {},
        "unless rel_azimuth_2 is; .* --column delta_phi=NAME",
    ),
    ("sza,vza,raa,brf,brdf\n1,2,3,4,5\n", {}, "line 1: brdf and brf are different quantities; name the columns"),
    ("sza,vza,raa,brdf,brf\n1,2,3,4,5\n", {}, "line 1: brdf and brf are different quantities; name the columns"),
    ("sza,vza,raa,lambda,brdf\n1,2,3,0.45,4\n1,2,3,550,4\n", {}, "field lambda: 0.45 and 550 have no unit in common"),
    (
        "sza,vza,raa,lambda [cm-1],brdf\n1,2,3,450,4\n",
        {},
        r"field lambda \[cm-1\]: the unit 'cm-1' is not a unit of wave",
    ),
    ("sza,vza,raa,lambda,brdf\n1,2,3,,4\n1,2,3,550,4\n", {}, "line 2, field lambda: a wavelength is missing"),
    (f"{PLANE},wavelength_nm\n10,20,180,0.5,500\n10,30,180,0.5,\n", {}, "line 3, field wavelength_nm: a wavelength"),
    (f"{PLANE},U (95 %)\n10,20,180,0.5,0.02\n", {}, r"line 1, field U \(95 %\): a probability is not a unit; write"),
    (f"# title\n{PLANE}\n{ROWS}\n20,500,180,0.5\n{ROWS}", {}, "line 6: theta_r of 500 degrees is not a polar angle"),
    (f"# title\n{PLANE}\n{ROWS}\n-200,10,180,0.5\n{ROWS}", {}, "line 6: theta_i of 200 degrees is not a polar angle"),
    (f"# title\n{PLANE}\n{ROWS}\n20,,180,0.5\n{ROWS}", {}, "line 6, field theta_r: an angle is missing"),
    # As csv, by names that this program writes
    ("theta_h,theta_d,brdf\n1,2,3\n1,2,abc\n", {}, "line 3, field brdf: 'abc' is not a number"),
    ("theta_h,theta_d,brdf\n1,2,3\n1,2\n", {}, "line 3 has 2 fields, but there are 3 names"),
    ("theta_h,theta_d,brdf\n1,2\n", {}, "line 2 has 2 fields, but there are 3 names"),
    ("theta_h,theta_d,brdf\n", {}, "line 1 has the names of columns, but no row follows"),
    ("theta_h,theta_d,550nm,550nm\n1,2,3,4\n", {}, "line 1: a wavelength is listed twice"),
    (f"{PLANE}\n1,2,3,4\n1,2,3,abc\n", {}, "line 3, field brdf: 'abc' is not a number"),
    (f"{PLANE}\n# 10,20,180,0.5\n", {}, "line 2: all rows begin with the sign of a comment; remove it"),
    (f"{PLANE}\n", {}, "line 1 has the names of columns, but no row of numbers follows"),
    (f"{PLANE[:-4]}nannm\n10,10,0,1\n10,20,0,1\n", {}, "no column is values, among"),
    (f"{PLANE[:-4]}-5nm\n10,10,0,1\n10,20,0,1\n", {}, "-5nm: a wavelength is less than 10 nm"),
    (f"{PLANE[:-4]}-550nm\n10,10,0,1\n10,20,0,1\n", {}, "-550nm: a wavelength is less than 10 nm"),
    ("theta_i,theta_r,brdf\n0,-10,inf\n10,20,1\n", {}, "line 2, field brdf: 'inf' is not a number"),
    ("theta_i,theta_r,brdf\nnan,-10,1\n10,20,1\n", {}, "field theta_i: an angle is missing"),
    ("theta_i,theta_r,brdf\n1000,-10,1\n10,20,1\n", {}, "theta_i of 1000 degrees is not a polar angle"),
    ("theta_h,theta_d,phi_d,0.45,0.55\n0,0,0,1,2\n", {}, "0.45 is not a wavelength in nm; write it as 550nm or 0.55um"),
]


@pytest.mark.parametrize(("text", "keywords", "sentence"), REFUSED, ids=range(len(REFUSED)))
def test_a_text_is_refused_with_line_and_field(text: str, keywords: Any, sentence: str, tmp_path: Path) -> None:
    check_texts_refused(tmp_path / "sheet.csv", {text: sentence}, **keywords)


@pytest.mark.parametrize(
    ("title", "comment", "sentence"),
    [
        ("of paint", "wavelength 650 nm", "gives a wavelength to rows below it, but no line gives one to line 3"),
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
        samples_of(tmp_path, f"# {title}\n{PLANE}\n{ROWS}# {comment}\n{ROWS}")
    assert len(samples_of(tmp_path, f"# {title}\n{PLANE}\n{ROWS}# {comment}\n")) == 2  # no row is below it


# Of columns of values: an unknown unit or cosine, which the caller may take as f_r, and logarithms
@pytest.mark.parametrize("unit", ["furlong", "x 1000", "10e-3/sr", "3/sr", "10^-3", "a.u."])
def test_a_unit_that_is_not_known_is_refused_unless_the_user_states_the_quantity(unit: str, tmp_path: Path) -> None:
    text = f"theta_i,theta_r,delta_phi,brdf [{unit}]\n60,20,180,0.25\n"
    sentence = r"line 1, field brdf .*the unit '.*' is not known; .* --quantity f_r "
    check_texts_refused(tmp_path / "sheet.csv", {text: sentence})
    sheet = samples_of(tmp_path, text, quantity="f_r")
    assert sheet.values == pytest.approx(0.25)
    assert any(f"{unit!r} of the column brdf [{unit}] is not known" in note for note in sheet.record["notes"])


def test_the_cosine_of_another_angle_is_asked_for(tmp_path: Path) -> None:
    text = "theta_i,theta_r,delta_phi,brdf*cos(alpha)\n60,20,180,0.1\n"
    sentence = r"field brdf\*cos\(alpha\): the cosine is neither .* --quantity f_r_cos"
    check_texts_refused(tmp_path / "sheet.csv", {text: sentence})
    assert samples_of(tmp_path, text, quantity="f_r").values == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("name", "quantity"),
    [("BRDF [dB]", "f_r"), ("log2(BRDF)", ""), ("ln BRDF", "percent"), ("log_BRDF", ""), ("log BRDF", "")],
)
def test_logarithms_that_are_not_known_are_refused(name: str, quantity: str, tmp_path: Path) -> None:
    text = f"theta_i,theta_r,delta_phi,{name}\n60,20,180,-3\n"
    sentence = "values are logarithms; --quantity log10, ln, decibel says which, or write f_r itself"
    if not quantity:
        sentence = "the base of the logarithms of '.*' is not known; state --quantity log10 or --quantity ln"
        assert samples_of(tmp_path, text, quantity="log10").values == pytest.approx(1e-3)
    check_texts_refused(tmp_path / "sheet.csv", {text: sentence}, **({"quantity": quantity} if quantity else {}))
