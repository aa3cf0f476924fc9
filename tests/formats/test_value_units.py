"""Units and cosines in the names of columns of values: read, or refused with the option that helps."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from brdfdb import formats
from brdfdb.errors import FileFormatError
from brdfdb.formats.text._columns import quantity_of
from brdfdb.measurements import Samples
from brdfdb.measurements.statement import statement

ANGLES = ("theta_i", "theta_r", "delta_phi", "values")


def samples(folder: Path, name: str, number: float, also: str = "", row: str = "60,20,180", **keywords: Any) -> Samples:
    """Return the samples of a text with one row, whose column of values has a name and a number."""
    path = folder / "sheet.csv"
    path.write_text(f"theta_i,theta_r,delta_phi,{name}{also}\n{row},{number!r}{',0.5' if also else ''}\n")
    return formats.samples(path, **keywords)


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
    of_light, of_viewer = (samples(tmp_path, f"brdf*cos(theta_{side})", 0.1) for side in "ir")
    assert of_light.values == pytest.approx(0.1 / np.cos(np.radians(60.0)))
    assert of_viewer.values == pytest.approx(0.1 / np.cos(np.radians(20.0)))
    assert any("values with the cosine of the light" in note for note in statement(of_light).notes)
    assert not any("not known" in note for note in statement(of_light).notes)
    stated = samples(tmp_path, "brdf", 0.1, quantity="f_r_cos_i")
    assert stated.values == pytest.approx(0.1 / np.cos(np.radians(60.0)))


def test_the_cosine_of_another_angle_is_asked_for(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"field brdf\*cos\(alpha\): the cosine is neither .* --quantity f_r_cos"):
        samples(tmp_path, "brdf*cos(alpha)", 0.1)
    assert samples(tmp_path, "brdf*cos(alpha)", 0.1, quantity="f_r").values == pytest.approx(0.1)


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
    sheet = samples(tmp_path, name, 0.25)
    assert sheet.values == pytest.approx(0.25 * factor, rel=1e-12)
    assert ("multiplied" in " ".join(statement(sheet).notes)) == ("%" not in name and factor not in (1.0,))


def test_a_wavelength_may_stand_in_brackets_behind_the_quantity(tmp_path: Path) -> None:
    sheet = samples(tmp_path, "BRDF (550 nm)", 0.25)
    assert sheet.wavelength_nm is not None
    assert sheet.wavelength_nm.tolist() == [550.0]


@pytest.mark.parametrize("unit", ["furlong", "x 1000", "10e-3/sr", "3/sr", "10^-3", "a.u."])
def test_a_unit_that_is_not_known_is_refused_unless_the_user_states_the_quantity(unit: str, tmp_path: Path) -> None:
    name = f"brdf [{unit}]"
    with pytest.raises(FileFormatError, match=r"line 1, field brdf .*the unit '.*' is not known; .* --quantity f_r "):
        samples(tmp_path, name, 0.25)
    sheet = samples(tmp_path, name, 0.25, quantity="f_r")
    assert sheet.values == pytest.approx(0.25)
    assert any(f"{unit!r} of the column {name} is not known" in note for note in statement(sheet).notes)


@pytest.mark.parametrize("name", ["BRDF [dB]", "log10(BRDF)", "ln BRDF"])
def test_logarithms_are_refused(name: str, tmp_path: Path) -> None:
    columns = {role: role for role in ANGLES[:3]}
    with pytest.raises(FileFormatError, match="values are logarithms; write f_r itself"):
        samples(tmp_path, name, -3.0, quantity="f_r", values=name, **columns)


@pytest.mark.parametrize(
    ("name", "also", "uncertainty"),
    [
        ("BRDF [1/sr]", ",u(BRDF)", 0.5),
        ("BRDF [10^-3 sr^-1]", ",std", 0.5e-3),
        ("BRDF [10^-3 sr^-1]", ",std [1/sr]", 0.5),
        ("BRDF [1/sr]", ",std [10^-3 /sr]", 0.5e-3),
    ],
)
def test_uncertainties_have_the_unit_of_the_values_or_their_own(
    name: str, also: str, uncertainty: float, tmp_path: Path
) -> None:
    sheet = samples(tmp_path, name, 0.25, also)
    assert sheet.uncertainty == pytest.approx(uncertainty)
    assert not any("not known" in note for note in statement(sheet).notes)
