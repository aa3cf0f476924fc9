"""Text of other programs: columns by their names or by the caller's, their units, and what a statement says of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brdfdb import formats
from brdfdb.errors import ParameterError
from brdfdb.formats.text._columns import role_of, wavelength_of
from brdfdb.measurements.conventions import RELATIVE
from brdfdb.measurements.statement import statement
from tests.formats.a_file import notes_of, samples_of

SR = "sza,vza,raa,brdf [1/sr]\n10,20,180,0.5\n"
TEXT = "sheet.txt"  # a name that no format has as its own


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
    expected = {name: role for role, of_role in names.items() for name in of_role}
    assert {name: role_of(name) for name in expected} == expected
    assert wavelength_of("BRF_1.6um") == 1600.0
    assert wavelength_of("pixel_550nm") is None


def test_titles_stand_before_the_names_and_say_that_values_are_reflectance_factors(tmp_path: Path) -> None:
    names = "src_z\tsrc_a\tview_z\tview_a\t2133.4nm\t1243.5nm"
    tile = samples_of(tmp_path, f"BRF Values\nTile 7, by 2 people\n{names}\n 10.0\t 0\t 20\t180\t0.5\t1\n", TEXT)
    assert tile.channels == ("1243.5nm", "2133.4nm")
    assert tile.values[0] == pytest.approx([1.0 / np.pi, 0.5 / np.pi])
    assert np.degrees([tile.theta_i[0], tile.theta_r[0], tile.phi_r[0]]) == pytest.approx([10.0, 20.0, 180.0])
    assert tile.record["quantity"] == "reflectance_factor"
    assert tile.record["titles"] == ["BRF Values", "Tile 7, by 2 people"]


def test_the_caller_names_columns_and_the_quantity(tmp_path: Path) -> None:
    text = "a;b;c;d;e\n0,5;60;180;0,25;9\n"  # a decimal comma
    columns = {"theta_i": "a", "theta_r": "b", "delta_phi": "c", "values": ["d"]}
    sheet = samples_of(tmp_path, text, TEXT, **columns, quantity="f_r_cos", angles="deg")
    assert np.degrees(sheet.theta_i) == pytest.approx([0.5])
    assert sheet.values[:, 0] == pytest.approx([0.5])
    assert sheet.record["columns_left_out"] == ["e"]
    numbered = {"theta_i": "1", "theta_r": "2", "delta_phi": "3", "values": "4"}
    assert samples_of(tmp_path, "10 20 180 0.3\n", TEXT, **numbered).values.tolist() == [[0.3]]


# Header, row, unit in the record, and angles [rad] of light, viewer and the azimuth between them
ANGLES = [
    ("theta_i,theta_r_rad,raa,brdf", "0.5,1.25,3.1415927,0.3", "radians", (0.5, 1.25, np.pi)),  # one name is enough
    ("theta_i [rad],theta_r [rad],raa [rad],brdf", "0.5,1.25,3.1415927,0.3", "radians", (0.5, 1.25, np.pi)),
    ("theta_i [radian],theta_r [rad],raa [RAD],brdf", "0.5,1.25,3.1415927,0.3", "radians", (0.5, 1.25, np.pi)),
    ("theta_i (mrad),theta_r (mrad),raa (mrad),brdf", "500,1250,3141.5927,0.3", "milliradians", (0.5, 1.25, np.pi)),
    ("theta_i_mrad,theta_r_mrad,raa_mrad,brdf", "500,1250,3141.5927,0.3", "milliradians", (0.5, 1.25, np.pi)),
    ("theta_i [deg],theta_r [deg],raa [deg],brdf", "0.5,1.25,3,0.3", "degrees", np.radians([0.5, 1.25, 3.0])),
    ("theta_i [°],theta_r (Degree),raa [deg.],brdf", "10,20,180,0.3", "degrees", np.radians([10.0, 20.0, 180.0])),
]


@pytest.mark.parametrize(("header", "row", "unit", "angles"), ANGLES)
def test_the_unit_of_angles_is_that_of_the_names(header: str, row: str, unit: str, angles: Any, tmp_path: Path) -> None:
    sheet = samples_of(tmp_path, f"{header}\n{row}\n", TEXT)
    assert [sheet.theta_i[0], sheet.theta_r[0], sheet.phi_r[0]] == pytest.approx(angles)
    assert sheet.record["angles"] == unit
    assert "notes" not in sheet.record


@pytest.mark.parametrize(("turn", "stated"), [("3.14159", True), ("180", False)])
def test_an_azimuth_without_a_unit_beside_degrees_may_be_radians(turn: str, stated: bool, tmp_path: Path) -> None:
    text = f"theta_i [deg],theta_r [deg],delta_phi,brdf\n40,20,0,0.3\n40,20,{turn},0.5\n"
    notes = notes_of(samples_of(tmp_path, text, TEXT))
    assert ("The column delta_phi was taken as degrees" in notes) == ("may be radians" in notes) == stated


@pytest.mark.parametrize("header", ["theta_i,theta_r,delta_phi,brdf", "sza,vza,raa,brdf"])
def test_angles_without_a_unit_are_degrees_and_small_ones_are_stated(header: str, tmp_path: Path) -> None:
    text = f"{header}\n0.5,1.25,3.1415927,0.3\n"
    sheet = samples_of(tmp_path, text)
    assert np.degrees(sheet.theta_i) == pytest.approx([0.5])
    assert "taken as degrees" in notes_of(sheet)
    assert "--angles rad" in notes_of(sheet)
    radians = samples_of(tmp_path, text, angles="rad")
    assert radians.theta_r == pytest.approx([1.25])
    assert notes_of(radians) == ""
    assert notes_of(samples_of(tmp_path, f"{header}\n0.5,1.25,10,0.3\n")) == ""  # 10 exceeds 2 pi


@pytest.mark.parametrize(
    ("header", "row", "left"),
    [
        ("sza,vza,vaa,raa,brdf", "10,20,240,150,0.5", "vaa"),
        ("theta_i,theta_r,phi_r,delta_phi,brdf", "10,20,240,150,0.5", "phi_r"),
        ("theta_i,theta_r,phi_i,phi_r,delta_phi,brdf", "10,20,90,240,150,0.5", "delta_phi"),
    ],
)
def test_one_of_two_azimuths_of_the_viewer_is_used(header: str, row: str, left: str, tmp_path: Path) -> None:
    sheet = samples_of(tmp_path, f"{header}\n{row}\n", TEXT)
    assert np.degrees(sheet.phi_r - sheet.phi_i) % 360.0 == pytest.approx([150.0])
    assert f"Columns left out: {left}." in notes_of(sheet)


def test_a_negative_polar_angle_is_at_the_opposite_azimuth(tmp_path: Path) -> None:
    sheet = samples_of(tmp_path, "theta_i theta_r raa brdf\n30 -40 0 0.3\n-30 40 0 0.4\n", TEXT)
    assert np.degrees(sheet.theta_r) == pytest.approx([40.0, 40.0])
    assert np.degrees(sheet.phi_r - sheet.phi_i) % 360.0 == pytest.approx([180.0, 180.0])


def test_theta_and_phi_that_are_exchanged_are_noticed(tmp_path: Path) -> None:
    text = "# at 532 nm\n# phi_i theta_i phi_o theta_o brdf\n75 -180 60 0 2.5\n75 -180 -60 0 0.5\n"
    chassis = samples_of(tmp_path, text, TEXT)
    assert np.degrees(chassis.theta_i) == pytest.approx([75.0, 75.0])
    assert np.degrees(chassis.theta_r) == pytest.approx([60.0, 60.0])
    assert np.degrees(chassis.phi_r - chassis.phi_i) % 360.0 == pytest.approx([180.0, 0.0])
    assert "phi was read as the polar angle" in chassis.record["exchanged"]
    assert chassis.channels == ("532nm",)


def test_a_few_rows_below_the_horizon_exchange_no_letters(tmp_path: Path) -> None:
    rows = "".join(f"{light},0,20,{turn},0.5\n" for light in (10, 30) for turn in (0, 45, 90))
    sheet = samples_of(tmp_path, f"theta_i,phi_i,theta_r,phi_r,brdf\n{rows}150,0,30,45,0.01\n", TEXT)
    assert "exchanged" not in sheet.record
    assert sheet.record["below_the_horizon"] == 1
    assert np.degrees(sheet.theta_i) == pytest.approx([10.0] * 3 + [30.0] * 3)


def test_a_column_of_wavelengths_becomes_channels(tmp_path: Path) -> None:
    rows = ("10,20,0,0.65,2,0.2", "10,20,0,0.45,1,0.1", "30,20,0,0.45,3,0.3", "10,20,0,0.65,4,0.4")
    sheet = samples_of(tmp_path, "\n".join(("theta_i,theta_r,raa,lambda,brdf,u", *rows, "")), TEXT)
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


# Names and fields of columns behind sza, vza and raa; keywords; channels and f_r [1/sr]
VALUES: list[tuple[str, str, dict[str, Any], tuple[str, ...], list[float]]] = [
    ("brdf_550nm,brf_650nm", "0.5,0.5", {}, ("550nm", "650nm"), [0.5, 0.5 / np.pi]),
    ("brf,brdf", "0.5,0.5", {"values": "brf"}, ("grey",), [0.5 / np.pi]),
    ("brdf,brf", "0.5,0.5", {"values": "brf"}, ("grey",), [0.5 / np.pi]),
    ("r,g,b", "1,2,3", {}, ("R", "G", "B"), [1.0, 2.0, 3.0]),
    ("X,Y,Z", "1,2,3", {}, ("X", "Y", "Z"), [1.0, 2.0, 3.0]),
    ("x,y,z,brdf", "1,2,3,4", {}, ("grey",), [4.0]),
    ("BRF [%]", "3", {}, ("grey",), [0.03 / np.pi]),
    ("BRF %", "3", {}, ("grey",), [0.03 / np.pi]),
    ("brf_percent", "3", {}, ("grey",), [0.03 / np.pi]),
    ("brdf", "0.5\n10,20,180,0.5", {"wavelength_nm": 550.0}, ("550nm",), [0.5]),
]


@pytest.mark.parametrize("suffix", [".csv", ".txt"])
@pytest.mark.parametrize(("names", "fields", "keywords", "channels", "f_r"), VALUES)
def test_each_column_has_the_quantity_of_its_own_name(
    names: str, fields: str, keywords: Any, channels: Any, f_r: Any, suffix: str, tmp_path: Path
) -> None:
    text = f"sza [deg],vza [deg],raa [deg],{names}\n10,20,180,{fields}\n"
    sheet = samples_of(tmp_path, text, f"sheet{suffix}", **keywords)
    assert sheet.channels == channels
    assert sheet.values == pytest.approx(np.array([f_r]))


def test_a_sweep_of_signed_angles_in_one_plane_is_relative_to_the_light(tmp_path: Path) -> None:
    rows = "30,0,40,0,1\n30,0,-40,0,2\n-30,0,40,0,3\n-30,0,-40,0,4\n"
    for text in (
        "aoi,phi_i,theta_scat,phi_scat,brdf\n" + rows,
        "aoi,theta_scat,phi_scat,brdf\n" + rows.replace(",0,40", ",40").replace(",0,-40", ",-40"),
    ):
        sweep = samples_of(tmp_path, text, TEXT)
        assert not sweep.turned
        assert sweep.record["azimuths"] == RELATIVE
        assert np.degrees(sweep.phi_r - sweep.phi_i) % 360.0 == pytest.approx([0.0, 180.0, 180.0, 0.0])
    of_surface = samples_of(tmp_path, "sza,saa,vza,vaa,brdf\n-30,0,40,20,1\n30,0,40,20,2\n", TEXT)
    assert of_surface.turned  # not in one plane: the azimuths are those of the surface


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
    sheet = samples_of(tmp_path, f"sza,vza,raa,{name},brdf\n10,20,180,0.45,0.1\n10,20,180,0.55,0.2\n", TEXT)
    assert sheet.channels == ("450nm", "550nm")
    assert sheet.values.tolist() == [[0.1, 0.2]]
    assert shown in notes_of(sheet)
    assert "Wavelengths: 450 to 550 nm." in statement(sheet).sentences
    infrared = replace(statement(sheet), wavelength_nm=(632.8, 10600.0))
    assert "Wavelengths: 632.8 to 10600 nm." in infrared.sentences


def test_names_of_a_csv_may_be_in_micrometres(tmp_path: Path) -> None:
    rows = [f"{h},{d},{p},1,2" for h in (0, 45, 90) for d in (0, 45, 90) for p in (0, 45, 90)]
    text = "\n".join(["theta_h,theta_d,phi_d,0.45um,0.55um", *rows, ""])
    assert samples_of(tmp_path, text).channels == ("450nm", "550nm")


@pytest.mark.parametrize("delimiter", ["\t", ";", " ", ","])
def test_decimal_commas_are_read_with_each_delimiter(delimiter: str, tmp_path: Path) -> None:
    fields = ["10,5", "20", "180", "0,25"]
    row = delimiter.join(f'"{field}"' if delimiter == "," else field for field in fields)
    sheet = samples_of(tmp_path, f"{delimiter.join(('sza', 'vza', 'raa', 'brdf'))}\n{row}\n", TEXT)
    assert np.degrees(sheet.theta_i) == pytest.approx([10.5])
    assert sheet.values.tolist() == [[0.25]]


NOTES: list[tuple[str, dict[str, Any], str]] = [
    ("sza,vza,raa,brdf,unc (%)\n10,20,180,0.5,3\n", {}, "percent of the values of their rows"),
    ("sza,vza,raa,brdf,unc\n10,20,180,0.5,0.01\n", {}, "Standard uncertainties were read from the column unc."),
    (f"# at 532 nm\n{SR}", {}, "The wavelength 532 nm was read from the titles of the file."),
    (f"# Wellenl\u00e4nge 632,8 nm\n{SR}", {}, "The wavelength 632.8 nm was read from the titles of the file."),
    (f"# longueur d'onde : 0,532 \u00b5m\n{SR}", {}, "The wavelength 532 nm was read from the titles of the file."),
    (f"# wavenumber 943 cm-1\n{SR}", {}, "The wavelength 10604.5 nm was read from the titles of the file."),
    (SR, {"wavelength_nm": 550.0}, "The wavelength 550 nm was stated; the file has none."),
    (
        "theta_i [deg],theta_r [deg],Phi [deg],brdf\n10,20,150,0.5\n",
        {},
        "The column Phi [deg] was taken as the azimuth from the light to the viewer.",
    ),
    (
        "theta_i,theta_r,delta_phi,brdf\n10,20,180,0.5\n10,20,180,0.5\n10,20,180,0.6\n",
        {},
        "1 row repeats the directions and values of another and was left out.",
    ),
    (
        "theta_i,theta_r,delta_phi,wavelength_nm,brdf\n"
        + "".join(f"10,0,{turn},{nm},{1e-3 * nm}\n" for turn in (0, 30) for nm in (450, 550)),
        {},
        "2 rows repeat the directions and values of others and were left out.",
    ),
    ("# title\n,theta_i,theta_r,delta_phi,brdf\n0,10,20,180,0.5\n", {}, "Columns left out: index."),  # of pandas
]


@pytest.mark.parametrize(("text", "keywords", "note"), NOTES)
def test_a_statement_notes_how_a_text_was_read(text: str, keywords: Any, note: str, tmp_path: Path) -> None:
    assert note in notes_of(samples_of(tmp_path, text, **keywords))


def test_what_is_known_of_uncertainties_and_wavelengths_is_stated(tmp_path: Path) -> None:
    text = "sza,vza,raa,brdf,unc\n10,20,180,0.5,0.01\n10,30,180,0.5,0.02\n"
    known = statement(samples_of(tmp_path, text, TEXT)).sentences
    assert "Standard uncertainties are stated: 3 % of f_r in the median." in known
    assert "No wavelength is stated; --wavelength-nm states one." in known


def test_units_below_the_names_are_no_damaged_row(tmp_path: Path) -> None:
    assert len(samples_of(tmp_path, "sza,vza,raa,brdf\ndeg,deg,deg,1/sr\n10,20,180,0.5\n", TEXT)) == 1


@pytest.mark.parametrize(
    ("keywords", "sentence"),
    [
        ({"theta_i": "src"}, r"theta_i: 'src' is not a column of .* which has sza, vza, raa, brdf"),
        ({"quantity": "brf"}, "quantity: 'brf' is not one of f_r, reflectance_factor, percent"),
        ({"angles": "gon"}, "angles: 'gon' is not one of deg, rad, mrad, elevation"),
        ({"angles": "deg,rad"}, "angles: deg and rad exclude each other"),
        ({"coverage_factor": 0.0}, "coverage_factor: 0 is not a positive number"),
        ({"wavelength_unit": "um"}, "wavelength_unit: .* has no column of wavelengths"),
        ({"wavelength_nm": 0.55}, r"wavelength_nm: 0\.55 is outside \[10, 1e\+06\] nm"),
        ({"azimuth": "back"}, "azimuth: 'back' is not one of light, forward, mirror"),
    ],
)
def test_keywords_that_are_wrong_are_refused(keywords: Any, sentence: str, tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=sentence):
        samples_of(tmp_path, SR, TEXT, **keywords)
    with pytest.raises(ParameterError, match="wavelength_nm: sheet states its own: 532nm; leave it out"):
        samples_of(tmp_path, f"# at 532 nm\n{SR}", TEXT, wavelength_nm=550.0)


@pytest.mark.parametrize("text", ["sza,vza,raa,brdf\n40,30,50,0.5\n", "sza,saa,vza,vaa,brdf\n40,10,30,60,0.5\n"])
def test_azimuths_may_count_from_the_forward_direction(text: str, tmp_path: Path) -> None:
    sheet = samples_of(tmp_path, text, TEXT, azimuth="forward")
    assert np.degrees(sheet.phi_r - sheet.phi_i) % 360.0 == pytest.approx([230.0])
    assert np.degrees(sheet.phi_i) == pytest.approx([190.0 if "saa" in text else 0.0])
    assert "Azimuths count from the forward direction" in notes_of(sheet)


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
