"""Text of other programs: columns by their names or by the caller's, units, quantities, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brdfdb import formats
from brdfdb.errors import FileFormatError, ParameterError
from brdfdb.formats.text._columns import role_of, wavelength_of
from brdfdb.measurements import Samples
from brdfdb.measurements.samples import RELATIVE
from brdfdb.measurements.statement import statement
from tests.formats.refusals import check_texts_refused

SR = "sza,vza,raa,brdf [1/sr]\n10,20,180,0.5\n"


def samples(tmp_path: Path, text: str, **keywords: Any) -> Samples:
    path = tmp_path / "sheet.txt"
    path.write_text(text, encoding="utf-8")
    return formats.samples(path, **keywords)


def test_names_of_other_programs_are_known() -> None:
    names = {
        "theta_i": ("theta_i", "sza", "src_z", "ThetaIn [deg]", "Incident zenith (°)", "AOI", "θi"),
        "theta_r": ("theta_o", "vza", "view_z", "theta_v", "Receiver Zenith", "theta_r_deg"),
        "phi_i": ("phi_i", "saa", "src_a", "solar azimuth"),
        "phi_r": ("phi_o", "vaa", "view_a", "phi_out"),
        "delta_phi": ("raa", "relative azimuth", "delta_phi"),
        "values": ("brdf", "f_r [1/sr]", "550nm", "BRF_1.6um", "550", "DSF"),
        "": ("row", "temperature", "12", "date"),
    }
    assert {name: role_of(name) for of_role in names.values() for name in of_role} == {
        name: role for role, of_role in names.items() for name in of_role
    }


def test_a_wavelength_may_be_in_micrometres() -> None:
    assert wavelength_of("BRF_1.6um") == 1600.0
    assert wavelength_of("pixel_550nm") is None


def test_titles_stand_before_the_names_and_say_that_values_are_reflectance_factors(tmp_path: Path) -> None:
    names = "src_z\tsrc_a\tview_z\tview_a\t2133.4nm\t1243.5nm"
    text = f"BRF Values\nTile 7, by 2 people\n{names}\n 10.0\t 0\t 20\t180\t0.5\t1\n"
    tile = samples(tmp_path, text)
    assert tile.channels == ("1243.5nm", "2133.4nm")
    assert tile.values[0] == pytest.approx([1.0 / np.pi, 0.5 / np.pi])
    assert np.degrees([tile.theta_i[0], tile.theta_r[0], tile.phi_r[0]]) == pytest.approx([10.0, 20.0, 180.0])
    assert tile.record["quantity"] == "reflectance_factor"
    assert tile.record["titles"] == ["BRF Values", "Tile 7, by 2 people"]


def test_the_caller_names_columns_and_the_quantity(tmp_path: Path) -> None:
    text = "a;b;c;d;e\n0,5;60;180;0,25;9\n"  # a decimal comma
    keywords = {
        "theta_i": "a",
        "theta_r": "b",
        "delta_phi": "c",
        "values": ["d"],
        "quantity": "f_r_cos",
        "angles": "deg",
    }
    sheet = samples(tmp_path, text, **keywords)
    assert np.degrees(sheet.theta_i) == pytest.approx([0.5])
    assert sheet.values[:, 0] == pytest.approx([0.5])
    assert sheet.record["columns_left_out"] == ["e"]
    without = samples(tmp_path, "10 20 180 0.3\n", theta_i="1", theta_r="2", delta_phi="3", values="4")
    assert without.values.tolist() == [[0.3]]


@pytest.mark.parametrize(
    ("header", "row"),
    [
        ("theta_i,theta_r_rad,raa,brdf", "0.5,1.25,3.1415927,0.3"),  # one name is enough
        ("theta_i [rad],theta_r [rad],raa [rad],brdf", "0.5,1.25,3.1415927,0.3"),
        ("theta_i [deg],theta_r [deg],raa [deg],brdf", "0.5,1.25,3.1415927,0.3"),
    ],
)
def test_the_unit_of_angles_is_that_of_the_names(header: str, row: str, tmp_path: Path) -> None:
    sheet = samples(tmp_path, f"{header}\n{row}\n")
    expected = np.radians(0.5) if "deg" in header else 0.5
    assert sheet.theta_i == pytest.approx([expected])
    assert "notes" not in sheet.record


@pytest.mark.parametrize(
    ("header", "row", "unit"),
    [
        ("theta_i (mrad),theta_r (mrad),raa (mrad),brdf", "500,1250,3141.5927,0.3", "milliradians"),
        ("theta_i_mrad,theta_r_mrad,raa_mrad,brdf", "500,1250,3141.5927,0.3", "milliradians"),
        ("theta_i [°],theta_r (Degree),raa [deg.],brdf", "28.647890,71.619724,180,0.3", "degrees"),
        ("theta_i [radian],theta_r [rad],raa [RAD],brdf", "0.5,1.25,3.1415927,0.3", "radians"),
    ],
)
def test_units_of_angles_in_brackets_are_read(header: str, row: str, unit: str, tmp_path: Path) -> None:
    sheet = samples(tmp_path, f"{header}\n{row}\n")
    assert [sheet.theta_i[0], sheet.theta_r[0], sheet.phi_r[0]] == pytest.approx([0.5, 1.25, np.pi])
    assert sheet.record["angles"] == unit


def test_a_unit_of_angles_that_is_none_is_refused_unless_the_user_states_one(tmp_path: Path) -> None:
    text = "theta_i [gon],theta_r [gon],raa [gon],brdf\n10,20,180,0.3\n"
    with pytest.raises(FileFormatError, match=r"line 1, field theta_i \[gon\]: the unit 'gon' is none of angles"):
        samples(tmp_path, text)
    assert np.degrees(samples(tmp_path, text, angles="deg").theta_i) == pytest.approx([10.0])


@pytest.mark.parametrize(("turn", "stated"), [("3.14159", True), ("180", False)])
def test_an_azimuth_without_a_unit_beside_degrees_may_be_radians(turn: str, stated: bool, tmp_path: Path) -> None:
    sheet = samples(tmp_path, f"theta_i [deg],theta_r [deg],delta_phi,brdf\n40,20,0,0.3\n40,20,{turn},0.5\n")
    notes = [text for text in statement(sheet).notes if "may be radians" in text]
    assert [text.startswith("The column delta_phi was taken as degrees") for text in notes] == [True] * stated


@pytest.mark.parametrize("header", ["theta_i,theta_r,delta_phi,brdf", "sza,vza,raa,brdf"])
def test_angles_without_a_unit_are_degrees_and_small_ones_are_stated(header: str, tmp_path: Path) -> None:
    path = tmp_path / "sheet.csv"
    path.write_text(f"{header}\n0.5,1.25,3.1415927,0.3\n")
    sheet = formats.samples(path)
    assert np.degrees(sheet.theta_i) == pytest.approx([0.5])
    assert any("taken as degrees" in note and "--angles rad" in note for note in statement(sheet).notes)
    radians = formats.samples(path, angles="rad")
    assert radians.theta_r == pytest.approx([1.25])
    assert statement(radians).notes == ()
    path.write_text(f"{header}\n0.5,1.25,10,0.3\n")  # 10 exceeds 2 pi
    assert statement(formats.samples(path)).notes == ()


@pytest.mark.parametrize(
    ("header", "row", "left"),
    [
        ("sza,vza,vaa,raa,brdf", "10,20,240,150,0.5", "vaa"),
        ("theta_i,theta_r,phi_r,delta_phi,brdf", "10,20,240,150,0.5", "phi_r"),
        ("theta_i,theta_r,phi_i,phi_r,delta_phi,brdf", "10,20,90,240,150,0.5", "delta_phi"),
    ],
)
def test_one_of_two_azimuths_of_the_viewer_is_used_and_the_other_named(
    header: str, row: str, left: str, tmp_path: Path
) -> None:
    sheet = samples(tmp_path, f"{header}\n{row}\n")
    assert np.degrees(sheet.phi_r - sheet.phi_i) % 360.0 == pytest.approx([150.0])
    assert f"Columns left out: {left}." in statement(sheet).notes


def test_a_negative_polar_angle_is_at_the_opposite_azimuth(tmp_path: Path) -> None:
    sheet = samples(tmp_path, "theta_i theta_r raa brdf\n30 -40 0 0.3\n-30 40 0 0.4\n")
    assert np.degrees(sheet.theta_r) == pytest.approx([40.0, 40.0])
    assert np.degrees(sheet.phi_r - sheet.phi_i) % 360.0 == pytest.approx([180.0, 180.0])


def test_theta_and_phi_that_are_exchanged_are_noticed(tmp_path: Path) -> None:
    text = "# at 532 nm\n# phi_i theta_i phi_o theta_o brdf\n75 -180 60 0 2.5\n75 -180 -60 0 0.5\n"
    chassis = samples(tmp_path, text)
    assert np.degrees(chassis.theta_i) == pytest.approx([75.0, 75.0])
    assert np.degrees(chassis.theta_r) == pytest.approx([60.0, 60.0])
    assert np.degrees(chassis.phi_r - chassis.phi_i) % 360.0 == pytest.approx([180.0, 0.0])
    assert "phi was read as the polar angle" in chassis.record["exchanged"]
    assert chassis.channels == ("532nm",)


def test_a_few_rows_below_the_horizon_exchange_no_letters(tmp_path: Path) -> None:
    rows = "".join(f"{light},0,20,{turn},0.5\n" for light in (10, 30) for turn in (0, 45, 90))
    sheet = samples(tmp_path, f"theta_i,phi_i,theta_r,phi_r,brdf\n{rows}150,0,30,45,0.01\n")
    assert "exchanged" not in sheet.record
    assert sheet.record["below_the_horizon"] == 1
    assert np.degrees(sheet.theta_i) == pytest.approx([10.0] * 3 + [30.0] * 3)


def test_a_column_of_wavelengths_becomes_channels(tmp_path: Path) -> None:
    rows = ("10,20,0,0.65,2,0.2", "10,20,0,0.45,1,0.1", "30,20,0,0.45,3,0.3", "10,20,0,0.65,4,0.4")
    text = "\n".join(("theta_i,theta_r,raa,lambda,brdf,u", *rows, ""))
    sheet = samples(tmp_path, text)
    assert sheet.channels == ("450nm", "650nm")
    expected = [[1.0, 2.0], [3.0, np.nan], [np.nan, 4.0]]  # the last row measures the first direction again
    np.testing.assert_array_equal(sheet.values, expected)
    assert sheet.uncertainty is not None
    np.testing.assert_allclose(sheet.uncertainty, 0.1 * np.array(expected))


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1"])
def test_other_encodings_are_read(encoding: str, tmp_path: Path) -> None:
    path = tmp_path / "sheet.csv"
    path.write_bytes("sza (°),vza (°),raa (°),brdf\r\n10,20,180,\r\n10,30,180,0.2\r\n".encode(encoding))
    sheet = formats.samples(path)
    assert sheet.known[:, 0].tolist() == [False, True]  # an empty field is a hole


def test_a_damaged_text_is_refused_with_line_and_field(tmp_path: Path) -> None:
    damages = [
        ("theta_i,theta_r,raa,brdf\n1,2,3,4\n1,2,3\n", "line 3 has 3 fields, and the first row 4"),
        ("theta_i,theta_r,raa,brdf\n1,2,3,4\n1,2,x,4\n", "line 3, field raa: 'x' is not a number"),
        ("theta_i,theta_r,raa,brdf\n1,2,3,4\n1,2,3,inf\n", "line 3, field brdf: 'inf' is not a number"),
        ("theta_i,theta_r,raa,brdf\n1,2,3,4\n1,,3,4\n", "line 3, field theta_r: an angle is missing"),
        ("theta_i,theta_r,raa,brdf\n1,200,3,4\n", "line 2: theta_r of 200 degrees is no polar angle"),
        ("theta_i,theta_r,raa,brdf\n1,100,3,4\n", "none of its 1 values is above the horizon"),
        ("theta_i,theta_r,raa,550nm,550nm\n1,2,3,4,5\n", "line 1: a wavelength stands twice"),
        ("theta_i,sza,theta_r,raa,brdf\n1,2,3,4,5\n", "line 1: theta_i and sza are both theta_i; name one"),
        ("a,b,c,d\n1,2,3,4\n", "among the columns a, b, c, d is none of theta_i, theta_r, values"),
        ("no numbers at all\n", "line 1: none of the first 1000 lines is a row of numbers"),
        ("theta_i,theta_r,raa,brdf\n1,2,3,4\n" + "5" * 1_100_000 + "\n", "line 3 has more than 1048576 characters"),
    ]
    check_texts_refused(tmp_path / "sheet.txt", damages, angles="deg")


def test_a_damaged_csv_is_refused_with_line_and_name(tmp_path: Path) -> None:
    damages = [
        ("theta_h,theta_d,brdf\n1,2,3\n1,2,abc\n", "line 3, field brdf: 'abc' is not a number"),
        ("theta_h,theta_d,brdf\n1,2,3\n1,2\n", "line 3 has 2 fields, and there are 3 names"),
        ("theta_h,theta_d,brdf\n1,2\n", "line 2 has 2 fields, and there are 3 names"),
        ("theta_h,theta_d,brdf\n", "line 1 has the names of columns, and no row follows"),
        ("theta_h,theta_d,550nm,550nm\n1,2,3,4\n", "line 1: a wavelength stands twice"),
        ("theta_i,theta_r,delta_phi,550nm,550nm\n1,2,3,4,5\n", "line 1: a wavelength stands twice"),
        ("theta_i,theta_r,delta_phi,brdf\n1,2,3,4\n1,2,3,abc\n", "line 3, field brdf: 'abc' is not a number"),
        ("theta_i,theta_r,delta_phi,brdf\n", "line 1 has the names of columns, and no row of numbers follows"),
    ]
    check_texts_refused(tmp_path / "sheet.csv", damages)


def test_columns_that_do_not_exist_are_refused(tmp_path: Path) -> None:
    text = "sza,vza,raa,brdf\n1,2,3,4\n"
    with pytest.raises(ParameterError, match=r"theta_i: 'src' is not a column of .* which has sza, vza, raa, brdf"):
        samples(tmp_path, text, theta_i="src")
    with pytest.raises(ParameterError, match="quantity: 'percent' is not one of auto, f_r"):
        samples(tmp_path, text, quantity="percent")


def test_percent_in_a_name_is_a_hundredth(tmp_path: Path) -> None:
    header = "sza [deg],vza [deg],raa [deg],"
    sheet = samples(tmp_path, f"{header}brdf,unc (%)\n10,20,180,0.5,3\n")
    assert sheet.uncertainty is not None
    assert sheet.uncertainty[0] == pytest.approx([0.015])
    assert any("percent of the values of their rows" in note for note in statement(sheet).notes)
    for name in ("BRF [%]", "BRF %", "brf_percent"):
        assert samples(tmp_path, f"{header}{name}\n10,20,180,3\n").values[0] == pytest.approx([0.03 / np.pi])
    path = tmp_path / "sheet.csv"
    path.write_text("theta_i,theta_r,delta_phi,brf [%]\n10,20,180,3\n")
    assert formats.samples(path).values[0] == pytest.approx([0.03 / np.pi])


def test_each_column_has_the_quantity_of_its_own_name(tmp_path: Path) -> None:
    sheet = samples(tmp_path, "sza,vza,raa,brdf_550nm,brf_650nm\n10,20,180,0.5,0.5\n")
    assert sheet.values[0] == pytest.approx([0.5, 0.5 / np.pi])
    for names in ("brf,brdf", "brdf,brf"):
        text = f"sza,vza,raa,{names}\n10,20,180,0.5,0.5\n"
        with pytest.raises(FileFormatError, match="line 1: brdf and brf are different quantities; name one as values"):
            samples(tmp_path, text)
        assert samples(tmp_path, text, values="brf").values == pytest.approx(0.5 / np.pi)


def test_small_letters_are_colours_and_positions(tmp_path: Path) -> None:
    assert samples(tmp_path, "sza,vza,raa,r,g,b\n10,20,180,1,2,3\n").channels == ("R", "G", "B")
    assert samples(tmp_path, "sza,vza,raa,X,Y,Z\n10,20,180,1,2,3\n").channels == ("X", "Y", "Z")
    assert samples(tmp_path, "sza,vza,raa,x,y,z,brdf\n10,20,180,1,2,3,4\n").values.tolist() == [[4.0]]
    with pytest.raises(FileFormatError, match="is none of values"):
        samples(tmp_path, "sza,vza,raa,x,y,z\n10,20,180,1,2,3\n", angles="deg")


def test_a_sweep_of_signed_angles_in_one_plane_is_relative_to_the_light(tmp_path: Path) -> None:
    rows = "30,0,40,0,1\n30,0,-40,0,2\n-30,0,40,0,3\n-30,0,-40,0,4\n"
    for text in (
        "aoi,phi_i,theta_scat,phi_scat,brdf\n" + rows,
        "aoi,theta_scat,phi_scat,brdf\n" + rows.replace(",0,40", ",40").replace(",0,-40", ",-40"),
    ):
        sweep = samples(tmp_path, text)
        assert not sweep.turned
        assert sweep.record["azimuths"] == RELATIVE
        assert np.degrees(sweep.phi_r - sweep.phi_i) % 360.0 == pytest.approx([0.0, 180.0, 180.0, 0.0])
    of_surface = samples(tmp_path, "sza,saa,vza,vaa,brdf\n-30,0,40,20,1\n30,0,40,20,2\n")
    assert of_surface.turned  # not in one plane: the azimuths are those of the surface


def test_rows_that_repeat_are_stated(tmp_path: Path) -> None:
    path = tmp_path / "sheet.csv"
    path.write_text("theta_i,theta_r,delta_phi,brdf\n10,20,180,0.5\n10,20,180,0.5\n10,20,180,0.6\n")
    sheet = formats.samples(path)
    assert len(sheet) == 2
    assert "1 row repeats the directions and values of another and was left out." in statement(sheet).notes


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("wavelength_um", "those of the column wavelength_um"),
        ("wavelength [um]", "those of the column wavelength [um]"),
        ("Wavelength [\u00b5m]", "those of the column Wavelength [\u00b5m]"),
        ("wl micron", "those of the column wl micron"),
        ("lambda", "gives no unit: its numbers, 0.45 to 0.55, were taken as micrometres"),
    ],
)
def test_wavelengths_in_micrometres_are_channels_in_nm(name: str, shown: str, tmp_path: Path) -> None:
    sheet = samples(tmp_path, f"sza,vza,raa,{name},brdf\n10,20,180,0.45,0.1\n10,20,180,0.55,0.2\n")
    assert sheet.channels == ("450nm", "550nm")
    assert sheet.values.tolist() == [[0.1, 0.2]]
    assert any(shown in note for note in statement(sheet).notes)
    assert "Wavelengths: 450 to 550 nm." in statement(sheet).sentences


def test_wavelengths_without_a_common_unit_are_refused(tmp_path: Path) -> None:
    damages = [
        ("lambda", "0.45", "line 1, field lambda: 0.45 and 550 have no unit in common; write it into the name"),
        ("lambda [cm-1]", "450", r"line 1, field lambda \[cm-1\]: the unit 'cm-1' is none of wavelengths"),
        ("lambda", "", "line 2, field lambda: a wavelength is missing"),
    ]
    for name, first, sentence in damages:
        text = f"sza,vza,raa,{name},brdf\n10,20,180,{first},0.1\n10,20,180,550,0.2\n"
        check_texts_refused(tmp_path / "sheet.txt", {text: sentence})


def test_names_of_a_csv_below_10_are_no_nm(tmp_path: Path) -> None:
    path = tmp_path / "grid.csv"
    rows = [f"{h},{d},{p},1,2" for h in (0, 45, 90) for d in (0, 45, 90) for p in (0, 45, 90)]
    path.write_text("\n".join(["theta_h,theta_d,phi_d,0.45,0.55", *rows, ""]))
    with pytest.raises(FileFormatError, match=r"line 1: 0\.45 is no wavelength in nm; write it as 550nm or 0\.55um"):
        formats.read(path)
    path.write_text(path.read_text().replace("0.45,0.55", "0.45um,0.55um"))
    assert formats.read(path).channels == ("450nm", "550nm")


@pytest.mark.parametrize("delimiter", ["\t", ";", " ", ","])
def test_decimal_commas_are_read_with_each_delimiter(delimiter: str, tmp_path: Path) -> None:
    fields = ["10,5", "20", "180", "0,25"]
    row = delimiter.join(f'"{field}"' if delimiter == "," else field for field in fields)
    sheet = samples(tmp_path, f"{delimiter.join(('sza', 'vza', 'raa', 'brdf'))}\n{row}\n")
    assert np.degrees(sheet.theta_i) == pytest.approx([10.5])
    assert sheet.values.tolist() == [[0.25]]


def test_commas_of_thousands_are_not_taken_for_decimals(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"line 2, field brdf: '1,000' has ',', and numbers before it '\.'"):
        samples(tmp_path, "sza\tvza\traa\tbrdf\n10.5\t20\t180\t1,000\n")


def test_phi_alone_is_the_azimuth_between_light_and_viewer(tmp_path: Path) -> None:
    sheet = samples(tmp_path, "theta_i [deg],theta_r [deg],Phi [deg],brdf\n10,20,150,0.5\n")
    assert np.degrees(sheet.phi_r - sheet.phi_i) == pytest.approx([150.0])
    assert "The column Phi [deg] was taken as the azimuth from the light to the viewer." in statement(sheet).notes
    with pytest.raises(FileFormatError, match="no column is the azimuth of the viewer"):
        samples(tmp_path, "theta_i,theta_r,phi_i,Phi,brdf\n10,20,0,150,0.5\n")


ROLES = {"theta_i": "sun", "theta_r": "view", "delta_phi": "turn", "values": "number"}


def test_a_damaged_first_row_is_no_title(tmp_path: Path) -> None:
    damages: list[tuple[str, dict[str, str], str]] = [
        ("sza,vza,raa,brdf\n1O,20,180,0.5\n10,20,180,0.5\n", {}, "line 2, field sza: '1O' is not a number"),
        ("sun view turn number\n2O 20 180 0.5\n10 20 180 0.5\n", ROLES, "line 2, field sun: '2O' is not a number"),
        ("sza,vza,raa,brdf\n10,20,180\n10,20,180,0.5\n", {}, "line 2 has 3 fields, and the first whole row 4"),
        ("2O 20 180 0.5\n10 20 180 0.5\n", {"angles": "deg"}, "line 1, field 1: '2O' is not a number"),
    ]
    for text, keywords, sentence in damages:
        check_texts_refused(tmp_path / "sheet.txt", {text: sentence}, **keywords)


def test_units_below_the_names_are_no_damaged_row(tmp_path: Path) -> None:
    assert len(samples(tmp_path, "sza,vza,raa,brdf\ndeg,deg,deg,1/sr\n10,20,180,0.5\n")) == 1


def test_a_text_that_no_format_recognises_shows_its_columns_and_how_to_name_them(tmp_path: Path) -> None:
    with pytest.raises(
        FileFormatError, match=r"it has the columns sun, view, turn, number: name them, .*--column theta_i="
    ):
        samples(tmp_path, "sun view turn number\n10 20 180 0.5\n")


def test_a_column_of_uncertainties_is_stated(tmp_path: Path) -> None:
    known = statement(samples(tmp_path, "sza,vza,raa,brdf,unc\n10,20,180,0.5,0.01\n10,30,180,0.5,0.02\n"))
    assert "Standard uncertainties were read from the column unc." in known.notes
    assert "Standard uncertainties are stated: 3 % of f_r in the median." in known.sentences


def test_a_wavelength_of_titles_is_stated(tmp_path: Path) -> None:
    known = statement(samples(tmp_path, f"# at 532 nm\n{SR}"))
    assert "The wavelength 532 nm was read from the titles of the file." in known.notes
    assert "No wavelength is stated; --wavelength-nm states one." in statement(samples(tmp_path, SR)).sentences


def test_the_user_states_a_wavelength_of_a_file_that_has_none(tmp_path: Path) -> None:
    sheet = samples(tmp_path, SR, wavelength_nm=550.0)
    assert (sheet.channels, sheet.wavelength_nm) == (("550nm",), [550.0])
    assert "The wavelength 550 nm was stated; the file has none." in statement(sheet).notes
    with pytest.raises(ParameterError, match=r"wavelength_nm: 0\.55 is outside \[10, 1e\+06\] nm"):
        samples(tmp_path, SR, wavelength_nm=0.55)
    with pytest.raises(ParameterError, match="wavelength_nm: sheet states its own: 532nm; leave it out"):
        samples(tmp_path, f"# at 532 nm\n{SR}", wavelength_nm=550.0)


@pytest.mark.parametrize("text", ["sza,vza,raa,brdf\n40,30,50,0.5\n", "sza,saa,vza,vaa,brdf\n40,10,30,60,0.5\n"])
def test_azimuths_may_count_from_the_forward_direction(text: str, tmp_path: Path) -> None:
    sheet = samples(tmp_path, text, azimuth="forward")
    assert np.degrees(sheet.phi_r - sheet.phi_i) % 360.0 == pytest.approx([230.0])
    assert np.degrees(sheet.phi_i) == pytest.approx([190.0 if "saa" in text else 0.0])
    assert any(note.startswith("Azimuths count from the forward direction") for note in statement(sheet).notes)
    with pytest.raises(ParameterError, match="azimuth: 'back' is not one of light, forward"):
        samples(tmp_path, text, azimuth="back")


def test_a_grid_may_count_azimuths_from_the_forward_direction(tmp_path: Path) -> None:
    path = tmp_path / "grid.csv"
    nodes = (0, 30, 60, 90)
    rows = [f"{i},{r},{turn},{1 + turn}" for i in nodes for r in nodes for turn in (0, 60, 120, 180)]
    header = "# columns: angles [degree], then f_r [1/sr], one column a wavelength; the last angle changes fastest"
    path.write_text("\n".join([header, "theta_i,theta_r,delta_phi,brdf", *rows, ""]))
    here, there = (formats.read(path, azimuth=azimuth) for azimuth in ("light", "forward"))
    angles = np.radians([30.0, 0.0, 60.0, 130.0])
    assert there.lookup(*angles) == pytest.approx(here.lookup(*angles[:3], angles[3] - np.pi))
    listed = formats.samples(path, azimuth="forward")
    assert statement(listed).sentences[0].startswith("64 nodes of 1 channel")
    tilted = listed.selected((listed.theta_i > 0.0) & (listed.theta_r > 0.0) & (listed.theta_r < 1.5))
    at = (tilted.theta_i, tilted.phi_i, tilted.theta_r, tilted.phi_r)
    assert there.lookup(*at) == pytest.approx(tilted.values[:, 0])
