"""Polarised columns of texts: ss, sp, ps and pp, s and p, and Mueller elements of ellipsometers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from brdfdb import formats
from brdfdb.errors import FileFormatError, ParameterError
from brdfdb.measurements import joined
from brdfdb.measurements.mueller import from_frame
from brdfdb.measurements.samples import Samples
from brdfdb.measurements.statement import statement
from tests.measurements.test_mueller import ellipsometric

THETA_DEG = (20.0, 45.0, 60.0, 70.0)
INDEX = 1.5 - 0.0j


def written(tmp_path: Path, names: str, rows: list[list[float]], title: str = "") -> Path:
    path = tmp_path / "sheet.csv"
    lines = [title] if title else []
    lines += [f"aoi,theta_r,delta_phi,{names}", *(",".join(f"{number:.9g}" for number in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def elements(first: int) -> str:
    return ",".join(f"m{row + first}{column + first}" for row in range(4) for column in range(4))


def mirrors(scale: float = 1.0) -> list[list[float]]:
    return [[theta, theta, 180.0, *(scale * ellipsometric(np.radians(theta), INDEX)).ravel()] for theta in THETA_DEG]


def notes(samples: Samples) -> str:
    return " ".join(samples.record.get("notes", ()))


@pytest.mark.parametrize(
    "names",
    ["ss,sp,ps,pp", "BRDF_ss,BRDF_sp,BRDF_ps,BRDF_pp", "f_r s-s,f_r s-p,f_r p-s,f_r p-p", "fr_ss,fr_sp,fr_ps,fr_pp"],
)
def test_four_polarised_values_make_f_r_and_four_elements(tmp_path: Path, names: str) -> None:
    rows = [[theta, 30.0, 180.0, 0.4, 0.1, 0.06, 0.24] for theta in THETA_DEG]
    read = formats.samples(written(tmp_path, names, rows))
    assert read.values[:, 0] == pytest.approx(np.full(4, 0.4))  # ((0.4 + 0.1) + (0.06 + 0.24)) / 2
    assert read.mueller is not None
    assert read.mueller[0, 0, :2, :2] == pytest.approx(np.array([[1.0, 0.25], [0.15, 0.6]]))
    assert np.isnan(read.mueller[0, 0]).sum() == 12
    assert "whose first letter is that of the light" in notes(read)
    assert "columns_left_out" not in read.record


def test_the_order_of_the_columns_does_not_matter(tmp_path: Path) -> None:
    read = formats.samples(written(tmp_path, "pp,ps,sp,ss", [[20.0, 30.0, 180.0, 0.24, 0.06, 0.1, 0.4]] * 4))
    assert read.mueller is not None
    assert read.mueller[0, 0, :2, :2] == pytest.approx(np.array([[1.0, 0.25], [0.15, 0.6]]))


def test_polarisations_may_have_a_row_each(tmp_path: Path) -> None:
    values = {"ss": 0.4, "sp": 0.1, "ps": 0.06, "pp": 0.24}
    lines = ["aoi,theta_r,delta_phi,source_pol,detector_pol,BRDF"]
    lines += [f"{theta},30,180,{pair[0]},{pair[1]},{value}" for theta in THETA_DEG for pair, value in values.items()]
    path = tmp_path / "sheet.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    read = formats.samples(path)
    assert read.values[:, 0] == pytest.approx(np.full(4, 0.4))
    assert read.mueller is not None
    assert read.mueller[0, 0, :2, :2] == pytest.approx(np.array([[1.0, 0.25], [0.15, 0.6]]))


def test_three_of_four_are_refused(tmp_path: Path) -> None:
    path = written(tmp_path, "ss,sp,pp", [[20.0, 30.0, 180.0, 0.4, 0.1, 0.24]] * 4)
    with pytest.raises(FileFormatError, match=r"line 1, field polarisation: rows have .* pp, sp, ss, and only"):
        formats.samples(path)
    assert formats.samples(path, where={"polarisation": "pp"}).values[0, 0] == 0.24


def test_both_polarisers_of_one_light_make_its_f_r(tmp_path: Path) -> None:
    values = {"ss": 0.4, "sp": 0.1, "pp": 0.24}
    lines = ["aoi,theta_r,delta_phi,Pol in,Pol out,BRDF,u(BRDF)"]
    lines += [f"{theta},30,180,{pair[0]},{pair[1]},{f_r},0.03" for theta in THETA_DEG for pair, f_r in values.items()]
    path = tmp_path / "sheet.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    with pytest.raises(FileFormatError, match="--where 'Pol in'=s --where 'Pol out'=s reads one polarisation"):
        formats.samples(path)
    read = formats.samples(path, where={"Pol in": "s"})
    assert read.values[:, 0] == pytest.approx(np.full(4, 0.5))
    assert read.uncertainty is not None
    assert read.uncertainty == pytest.approx(np.full((4, 1), 0.03 * np.sqrt(2.0)))
    assert read.mueller is None
    assert "Light of s: f_r is the sum of sp and ss at the same directions" in notes(read)
    assert read.instrument.polarisation == "s"
    one = formats.samples(path, where={"Pol in": "s", "Pol out": "s"})
    assert one.values[:, 0] == pytest.approx(np.full(4, 0.4))


@pytest.mark.parametrize("names", ["brdf_s,brdf_p", "s,p", "TE,TM", "s-pol,p-pol"])
def test_light_of_two_polarisations_is_f_r_and_half_of_a_table(tmp_path: Path, names: str) -> None:
    read = formats.samples(written(tmp_path, names, [[theta, 30.0, 180.0, 0.3, 0.1] for theta in THETA_DEG]))
    assert read.values[:, 0] == pytest.approx(np.full(4, 0.2))
    assert "f_r is the mean of s and p" in notes(read)
    assert "A polarised table needs ss, sp, ps and pp" in notes(read)
    said = " ".join(statement(read).sentences)
    assert "No polarised table: a polarised table needs" in said
    assert f"the file has {' and '.join(names.split(','))}, which make m00, m01" in said


def test_columns_of_a_wavelength_each_row_are_kept_apart(tmp_path: Path) -> None:
    rows = [[t, 30.0, 180.0, nm, 0.4, 0.1, 0.06, 0.24 * nm / 500.0] for t in THETA_DEG for nm in (500.0, 600.0)]
    read = formats.samples(written(tmp_path, "wavelength,ss,sp,ps,pp", rows))
    assert read.channels == ("500nm", "600nm")
    assert read.values[0] == pytest.approx([0.4, 0.424])
    assert read.mueller is not None
    assert read.mueller.shape == (4, 2, 4, 4)
    assert read.mueller[0, 1, 0, 1] == pytest.approx((0.4 + 0.1 - 0.06 - 0.288) / 0.848)


@pytest.mark.parametrize("first", [0, 1])
def test_elements_of_ellipsometers_over_the_first_beside_f_r(tmp_path: Path, first: int) -> None:
    rows = [[*row[:3], 0.2, *row[3:]] for row in mirrors()]
    path = written(tmp_path, f"brdf,{elements(first)}", rows)
    read = formats.samples(path, mueller_frame="p")
    expected = np.array([from_frame(ellipsometric(np.radians(theta), INDEX), "p") for theta in THETA_DEG])
    assert read.mueller is not None
    assert read.mueller[:, 0] == pytest.approx(expected, abs=1e-8)
    assert read.values == pytest.approx(0.2)
    assert "Q > 0 is p-polarised" in notes(read)
    as_it_stands = formats.samples(path)
    assert as_it_stands.mueller is not None
    assert as_it_stands.mueller[:, 0, 0, 1] == pytest.approx(-expected[:, 0, 1], abs=1e-8)
    said = " ".join(statement(joined([as_it_stands, as_it_stands])).sentences)
    assert "--mueller-frame p" in said


def test_absolute_elements_have_f_r_as_the_first(tmp_path: Path) -> None:
    read = formats.samples(written(tmp_path, elements(1), mirrors(0.03)))
    assert read.values == pytest.approx(0.03)
    assert read.mueller is not None
    assert read.mueller[2, 0] == pytest.approx(ellipsometric(np.radians(60.0), INDEX), abs=1e-7)
    assert "absolute" in notes(read)
    both = formats.samples(written(tmp_path, f"brdf,{elements(0)}", [[*r[:3], r[3], *r[3:]] for r in mirrors(0.03)]))
    assert both.mueller is not None
    assert both.mueller == pytest.approx(read.mueller, abs=1e-7)


@pytest.mark.parametrize(
    ("names", "rows", "why"),
    [
        (elements(0), mirrors(), "elements are divided by m00, and no column has f_r"),
        (
            f"brdf,{elements(0)}",
            [[*r[:3], 0.2, *r[3:]] for r in mirrors(0.03)],
            "m00 is neither 1",
        ),
        (
            "brdf,m01,m10,m11",
            [[20.0, 30.0, 180.0, 0.2, 3.0, 2.0, 4.0]] * 4,
            "elements above 1.5 are not",
        ),
    ],
)
def test_elements_without_a_scale_are_refused(tmp_path: Path, names: str, rows: list[list[float]], why: str) -> None:
    with pytest.raises(FileFormatError, match=f"sheet.csv: line 1: {why}"):
        formats.samples(written(tmp_path, names, rows))


def test_elements_above_1_beside_m00_of_1_are_read_and_judged(tmp_path: Path) -> None:
    large = np.where(np.eye(4) == 1.0, 1.0, 1.6) * ellipsometric(np.radians(50.0), INDEX)
    read = formats.samples(written(tmp_path, f"brdf,{elements(0)}", [[50.0, 50.0, 180.0, 0.2, *large.ravel()]] * 4))
    assert read.mueller is not None
    assert read.mueller[0, 0] == pytest.approx(large)
    assert "Physical: 0 % of" in " ".join(statement(read).sentences)


def test_logarithms_have_no_mean_of_polarisations(tmp_path: Path) -> None:
    path = written(tmp_path, "ss,sp,ps,pp", [[20.0, 30.0, 180.0, -0.4, -1.0, -1.2, -0.6]] * 4)
    with pytest.raises(ParameterError, match="stated to be log10, and rows of s and p have no mean"):
        formats.samples(path, quantity="log10")


def test_a_frame_is_for_matrices_alone(tmp_path: Path) -> None:
    path = written(tmp_path, "ss,sp,ps,pp", [[20.0, 30.0, 180.0, 0.4, 0.1, 0.06, 0.24]] * 4)
    with pytest.raises(ParameterError, match="mueller_frame: sheet has no elements of Mueller matrices"):
        formats.samples(path, mueller_frame="p")
