"""Units and cosines in the names of columns of values, and uncertainties."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

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
