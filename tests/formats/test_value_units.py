"""Units and cosines in the names of columns of values, and uncertainties."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brdfdb.errors import FileFormatError, ParameterError
from brdfdb.formats.text._columns import quantity_of
from brdfdb.measurements import Samples
from tests.formats.a_file import notes_of, samples_of


def of_column(folder: Path, name: str, number: float, also: str = "", field: str = "", **keywords: Any) -> Samples:
    """Return the samples of a row at 60 and 20 degrees, whose column of values has a name and a number."""
    text = f"theta_i,theta_r,delta_phi,{name}{also and ','}{also}\n60,20,180,{number!r}{field and ','}{field}\n"
    return samples_of(folder, text, **keywords)


@pytest.mark.parametrize(
    ("name", "quantity"),
    [
        ("brdf*cos(theta_i)", "f_r_cos_i"),
        ("BRDF cos(theta_i) [1/sr]", "f_r_cos_i"),
        ("f_r * cos(incidence)", "f_r_cos_i"),
        ("brdf*cos(light)", "f_r_cos_i"),
        ("brdf_cos_theta_i", "f_r_cos_i"),
        ("brdf*cos(theta_r)", "f_r_cos"),
        ("BRDF_cos", "f_r_cos"),
        ("brdf*cos(view)", "f_r_cos"),
        ("brdf*cos(theta_s)", "?"),
        ("brdf*cos(theta_i)*cos(theta_r)", "?"),
        ("brdf*cos(alpha)", "?"),
        ("cosine-corrected", ""),
    ],
)
def test_the_cosine_in_a_name_is_that_of_its_angle(name: str, quantity: str) -> None:
    assert quantity_of(name, ("theta_i", "theta_r", "delta_phi", name)) == quantity


def test_theta_s_is_that_of_the_columns() -> None:
    assert quantity_of("brdf*cos(theta_s)", ("theta_i", "theta_s", "delta_phi", "x")) == "f_r_cos"
    assert quantity_of("brdf*cos(theta_s)", ("theta_s", "theta_v", "delta_phi", "x")) == "f_r_cos_i"


def test_f_r_is_divided_by_the_cosine_that_is_named(tmp_path: Path) -> None:
    of_light, of_viewer = (of_column(tmp_path, f"brdf*cos(theta_{side})", 0.1) for side in "ir")
    assert of_light.values == pytest.approx(0.1 / np.cos(np.radians(60.0)))
    assert of_viewer.values == pytest.approx(0.1 / np.cos(np.radians(20.0)))
    assert "values with the cosine of the light" in notes_of(of_light)
    assert "not known" not in notes_of(of_light)
    stated = of_column(tmp_path, "brdf", 0.1, quantity="f_r_cos_i")
    assert stated.values == pytest.approx(0.1 / np.cos(np.radians(60.0)))


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("BRDF [10^-3 sr^-1]", 1e-3),
        ("BRDF [10⁻³ sr⁻¹]", 1e-3),
        ("BRDF [x10^-3 /sr]", 1e-3),
        ("BRDF (1e-6/sr)", 1e-6),
        ("BRDF [0.001 1/sr]", 1e-3),
        ("BRDF [1/msr]", 1e3),
        ("BRDF [mSr^-1]", 1e3),
        ("BRDF [per usr]", 1e6),
        ("BRDF [%/sr]", 1e-2),
        ("BRDF [10^-3 %]", 1e-5),
        ("BRDF [sr^{-1}]", 1.0),
        ("BRDF (550 nm)", 1.0),
        ("BRF [%]", 1e-2 / np.pi),
    ],
)
def test_units_are_powers_of_ten_of_one_over_steradian(name: str, factor: float, tmp_path: Path) -> None:
    sheet = of_column(tmp_path, name, 0.25)
    assert sheet.values == pytest.approx(0.25 * factor, rel=1e-12)
    assert ("multiplied" in notes_of(sheet)) == ("%" not in name and factor != 1.0)
    assert sheet.channels == (("550nm",) if "nm" in name else ("grey",))


# Name and field of a column of uncertainties behind one of values, 0.25; the standard uncertainty [1/sr], and a note
UNCERTAINTIES = [
    ("BRDF [1/sr]", "u(BRDF)", "0.5", 0.5, ""),
    ("BRDF [10^-3 sr^-1]", "std", "0.5", 0.5e-3, ""),
    ("BRDF [10^-3 sr^-1]", "std [1/sr]", "0.5", 0.5, ""),
    ("BRDF [1/sr]", "std [10^-3 /sr]", "0.5", 0.5e-3, ""),
    ("brdf", "U (k=2)", "0.02", 0.01, "divided by their coverage factor k, 2."),
    ("brdf", '"U (k = 2, 95 %)"', "0.02", 0.01, "divided by their coverage factor k, 2."),
    ("brdf", "U [%] (k=2)", "8", 0.01, "taken as percent of the values"),
    ("brdf", "u [rel]", "0.04", 0.01, "Relative uncertainties were multiplied by the values"),
    ("brdf", "u [%]", "4", 0.01, "taken as percent of the values"),
    ("brdf", "u [1/sr]", "0.01", 0.01, "read from the column u [1/sr]"),
]


@pytest.mark.parametrize(("name", "also", "field", "uncertainty", "note"), UNCERTAINTIES)
def test_uncertainties_are_made_standard_ones_in_1_sr(
    name: str, also: str, field: str, uncertainty: float, note: str, tmp_path: Path
) -> None:
    sheet = of_column(tmp_path, name, 0.25, also, field)
    assert sheet.uncertainty == pytest.approx(uncertainty)
    assert note in notes_of(sheet)
    assert "not known" not in notes_of(sheet)


@pytest.mark.parametrize(
    "title",
    [
        "BRDF [10^-3/sr]",
        "unit: 10^-3 sr^-1",
        "unit: 10⁻³ sr⁻¹",
        "Units: 1e-3/sr",
        "unit of BRDF: 1/msr",
        "BRDF in milli-steradian^-1",
        "BRDF in permille",
        "scale factor 1e-3",
        "scale: 3.14159",
        "values divided by 10",
        "multiply numbers by 0.001",
        "BRDF x 1000, noise floor 1e-6/sr",
    ],
)
def test_a_factor_in_a_title_is_doubted(title: str, tmp_path: Path) -> None:
    row = "theta_i,theta_r,delta_phi,brdf\n60,20,180,0.25\n"
    samples = samples_of(tmp_path, f"# {title}\n{row}")
    assert samples.values.tolist() == [[0.25]]
    assert f"Factor? A comment says {title!r}" in notes_of(samples)
    if title.startswith("BRDF ["):
        scaled = samples_of(tmp_path, f"# {title}\n{row.replace('brdf', title)}")
        assert scaled.values == pytest.approx(0.25e-3)
        assert "Factor?" not in notes_of(scaled)


@pytest.mark.parametrize(
    "title",
    [
        "BRDF divided by the cosine of the viewer",
        "unit: 1/sr",
        "BRDF [sr^-1] every 10 degrees",
        "data of 2024/10/01",
        "data of 10/10/2024 at 10:30",
        "noise floor 1e-6/sr",
        "values below 1e-5/sr were set to 0",
        "receiver solid angle 0.5 msr",
        "BRDF, band of 10 nm",
        "spot of 10 x 10 mm",
        "grey scale 18 %",
        "scale factor 1.0",
    ],
)
def test_titles_with_other_numbers_are_not_doubted(title: str, tmp_path: Path) -> None:
    samples = samples_of(tmp_path, f"# {title}\ntheta_i,theta_r,delta_phi,brdf\n60,20,180,0.25\n")
    assert "Factor?" not in notes_of(samples)


def test_percent_per_steradian_in_a_title_is_read(tmp_path: Path) -> None:
    samples = samples_of(tmp_path, "# BRDF, unit %/sr\ntheta_i,theta_r,delta_phi,brdf\n60,20,180,25\n")
    assert samples.values == pytest.approx(0.25)


@pytest.mark.parametrize(
    "title", ["wavelength in Angstrom", "lambda in Angstroem", "wavelength [A]", "wavelength in Å"]
)
def test_angstroms_in_a_title_are_refused(title: str, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"field wavelength: a title says .*: angstroms are not read"):
        samples_of(tmp_path, f"# {title}\ntheta_i,theta_r,delta_phi,wavelength,brdf\n60,20,180,5500,0.25\n")


def test_angles_from_the_light_are_doubted(tmp_path: Path) -> None:
    title = "# scatter angle is the angle between incident beam and detector"
    samples = samples_of(tmp_path, f"{title}\nAOI,scatter angle,brdf\n60,20,0.25\n")
    assert "Angles? A title says 'scatter angle is" in notes_of(samples)
    azimuths = "# delta_phi is the angle between light and viewer"
    samples = samples_of(tmp_path, f"{azimuths}\ntheta_i,theta_r,delta_phi,brdf\n60,20,180,0.25\n")
    assert "Angles?" not in notes_of(samples)


@pytest.mark.parametrize(
    ("stated", "sentence"),
    [
        ({"coverage_factor": 2.0}, "states no uncertainties"),
        ({"values": "brdf", "uncertainty": "brdf"}, "the column 'brdf' is given for values, too"),
        ({"wavelength_unit": "um"}, r"wavenumber \[1/cm\] of .* is no column of wavelengths"),
    ],
)
def test_options_that_a_text_cannot_mean_are_refused(stated: dict[str, Any], sentence: str, tmp_path: Path) -> None:
    text = "theta_i,theta_r,delta_phi,wavenumber [1/cm],brdf\n60,20,180,10000,0.25\n"
    with pytest.raises(ParameterError, match=sentence):
        samples_of(tmp_path, text, **stated)


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("BRDF/1000", "/1000"),
        ("BRDF*100", "*100"),
        ("BRDF x 1000", "x 1000"),
        ("BRDF_x100", "x100"),
        ("1000*BRDF", "1000*"),
        ("BRDF (1/sr) *1e3", "*1e3"),
    ],
)
def test_a_factor_in_a_name_is_no_wavelength(name: str, factor: str, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=re.escape(f"the unit {factor!r} is not known")):
        of_column(tmp_path, name, 0.25)
    assert of_column(tmp_path, name, 0.25, quantity="f_r").values == pytest.approx(0.25)


def test_a_single_number_that_may_be_a_factor_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="may be a wavelength or a factor"):
        of_column(tmp_path, "BRDF 1000", 0.25)
    two = of_column(tmp_path, "BRDF_1000", 0.25, also="BRDF_900", field="0.5")
    assert two.wavelength_nm is not None
    assert two.wavelength_nm.tolist() == [900.0, 1000.0]


@pytest.mark.parametrize("mark", ["1e30", "9.9e37", "-1e30"])
def test_numbers_that_are_too_large_are_holes(mark: str, tmp_path: Path) -> None:
    samples = samples_of(tmp_path, f"theta_i,theta_r,delta_phi,brdf\n60,20,180,0.25\n60,30,180,{mark}\n")
    assert np.isnan(samples.values[:, 0]).tolist() == [False, True]
    assert "Values above 1e+20 were read as holes: 1" in notes_of(samples)


def test_marks_of_saturation_are_told(tmp_path: Path) -> None:
    text = "theta_i,theta_r,delta_phi,brdf\n60,20,180,0.25\n60,30,180,65535\n"
    assert "Saturated? 1 value of 65535" in notes_of(samples_of(tmp_path, text))
    assert np.isnan(samples_of(tmp_path, text, missing=65535.0).values[1, 0])


@pytest.mark.parametrize(
    ("name", "number"),
    [("wavenumber (cm-1)", 1e7 / 500.0), ("Photon energy (eV)", 1239.841984 / 500.0), ("frequency [THz]", 599.584916)],
)
def test_wavelengths_are_made_of_wavenumbers_energies_and_frequencies(name: str, number: float, tmp_path: Path) -> None:
    samples = of_column(tmp_path, "brdf", 0.25, also=name, field=repr(number))
    assert samples.wavelength_nm == pytest.approx([500.0], rel=1e-6)


def test_a_decimal_comma_in_a_wavelength_is_one(tmp_path: Path) -> None:
    samples = samples_of(tmp_path, "theta_i;theta_r;delta_phi;632,8nm\n60;20;180;0,25\n")
    assert samples.channels == ("632.8nm",)


@pytest.mark.parametrize(
    ("name", "field", "expected"), [("u_rel (%)", "2", 0.005), ("2 sigma", "0.01", 0.005), ("u_rel", "0.02", 0.005)]
)
def test_names_of_relative_and_expanded_uncertainties(name: str, field: str, expected: float, tmp_path: Path) -> None:
    samples = of_column(tmp_path, "brdf", 0.25, also=name, field=field)
    assert samples.uncertainty is not None
    assert samples.uncertainty == pytest.approx(expected)


@pytest.mark.parametrize(
    ("name", "field"), [("log10 BRDF", "-0.60206"), ("BRDF_dB", "-6.0206"), ("ln(BRDF)", "-1.386294")]
)
def test_logarithms_beside_f_r_agree_with_it(name: str, field: str, tmp_path: Path) -> None:
    samples = of_column(tmp_path, "brdf", 0.25, also=name, field=field)
    assert samples.values.tolist() == [[0.25]]
    assert f"{name} agrees with it" in notes_of(samples)
    assert of_column(tmp_path, name, float(field)).values == pytest.approx(0.25, rel=1e-5)


@pytest.mark.parametrize(("names", "factor"), [("TE,TM", 1.0), ("Rs,Rp", 1.0 / np.pi)])
def test_s_and_p_alone_are_names(names: str, factor: float, tmp_path: Path) -> None:
    samples = samples_of(tmp_path, f"theta_i,theta_r,delta_phi,{names}\n60,20,180,0.3,0.1\n")
    assert samples.values == pytest.approx(0.2 * factor)


def test_a_stated_wavelength_may_be_that_of_the_file(tmp_path: Path) -> None:
    assert of_column(tmp_path, "532nm", 0.25, wavelength_nm=532.0).channels == ("532nm",)


def test_words_of_saturation_are_holes(tmp_path: Path) -> None:
    samples = samples_of(tmp_path, "theta_i,theta_r,delta_phi,brdf\n60,20,180,0.25\n60,30,180,overflow\n")
    assert np.isnan(samples.values[1, 0])
