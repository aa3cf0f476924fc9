"""ASTM E1392 files: the rows by hand, grids and lists of rows, round trips, damage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.formats.a_file import check_texts_refused, exported, read_table, samples_of
from tests.formats.small_tables import KINDS, small_table

LOGARITHMS = 1e-10  # of f_r [1/sr] of a table of logarithms of f_r + 1e-4, in float32: worst measured 2e-11
HEAD = "A measurement\nNUM_POINTS 8\nVARS theta_i,phi_i,theta_s,phi_s,400nm,500nm\n"
ROWS = [
    f"{theta_i},0,{theta_s},{phi_s},{number},{10 * number}"
    for number, (theta_i, theta_s, phi_s) in enumerate(
        (theta_i, theta_s, phi_s) for phi_s in (0.0, 3.1415927) for theta_s in (0.5, 1.0) for theta_i in (0.0, 1.0)
    )
]


@pytest.mark.parametrize("kind", KINDS)
def test_rows_are_f_r_of_the_table(kind: str, tmp_path: Path) -> None:
    table = small_table(kind)
    head, rows = exported(tmp_path, "astm", kind).read_text(encoding="utf-8").split("VARS ")
    names, *texts = rows.strip().split("\n")
    assert f"NUM_POINTS {len(texts)}\n" in head
    assert names.startswith("theta_i,phi_i,theta_s,phi_s,")
    numbers = np.array([[float(number) for number in text.split(",")] for text in texts])
    assert len(np.unique(numbers[:, :4].astype(np.float32), axis=0)) == len(numbers)  # libbsdf has 32 bit angles
    above = (numbers[:, [0, 2]] < np.deg2rad(89.4)).all(axis=1)
    f_r = np.asarray(table.lookup(*numbers[above, :4].T))
    np.testing.assert_allclose(numbers[above, 4:], f_r.reshape(len(f_r), -1), rtol=6e-5, atol=LOGARITHMS)
    ends = np.unique(numbers[:, 3].astype(np.float32))[[0, -1]]
    np.testing.assert_array_equal(ends, np.array([0.0, 2.0 * np.pi], np.float32))  # else libbsdf looks for them


def test_a_grid_by_hand(tmp_path: Path) -> None:
    path = tmp_path / "a.astm"
    path.write_text(HEAD + "\n".join(ROWS[::-1]) + "\n", encoding="utf-8")
    reading = read_table(path)
    np.testing.assert_array_equal(reading.wavelength_nm, [400.0, 500.0])
    np.testing.assert_allclose(reading.lookup(1.0, 0.7, 0.5, 0.7), [1, 10], rtol=1e-6)
    np.testing.assert_allclose(reading.lookup(0.0, 0.0, 1.0, 0.0), [2, 20], rtol=1e-6)
    for side in (0.5, 1.5):
        np.testing.assert_allclose(reading.lookup(0.5, 0.0, 0.75, side * np.pi), [3.5, 35], rtol=1e-6)
    assert reading.lookup(1.0, 0.0, 0.5, 0.0, 450.0) == pytest.approx(5.5)


def test_rows_that_are_no_grid_are_samples(tmp_path: Path) -> None:
    reading = samples_of(tmp_path, HEAD + "\n".join(ROWS[:-1]) + "\n0.1,-0.5,0.2,0.3,-4,5\n", "a.astm")
    assert reading.values.shape == (8, 2)
    assert reading.phi_i[-1] == pytest.approx(2.0 * np.pi - 0.5)
    assert reading.values[-1].tolist() == [-4.0, 5.0]  # as the file has them; libbsdf takes negative values for 0


def test_damaged_files(tmp_path: Path) -> None:
    texts = [
        "NUM_POINTS 8\n",
        HEAD,
        HEAD.replace(",400nm,500nm", ""),
        HEAD.replace("theta_i,phi_i", "phi_i,theta_i") + ROWS[0],
        HEAD + ROWS[0] + ",7\n",
        HEAD + ROWS[0].replace("0,", "x,", 1),
        HEAD + ROWS[0].rsplit(",", 1)[0] + ",nan",
    ]
    check_texts_refused(tmp_path / "a.astm", [(text, "") for text in texts], "astm")
