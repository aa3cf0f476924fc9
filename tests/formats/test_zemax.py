"""Zemax BSDF files: the order of the text, its conventions by hand, round trips, TIS, damage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from brdfdb.formats import zemax
from brdfdb.tables.albedo import directional_albedo
from tests.formats.a_file import check_changes_refused, exported, read_table
from tests.formats.small_tables import DIFFUSE, GREY, KINDS, SPECTRAL, small_table

TIS_ATOL = 1e-4  # of the quadrature
BY_HAND = """# a measurement
Source  Measured
Symmetry  {symmetry}
SpectralContent  Monochrome
ScatterType  BRDF
SampleRotation  {turns}
AngleOfIncidence  2
0 60
ScatterAzimuth 3
0 90 180
ScatterRadial 2
0 40

Monochrome
DataBegin
{blocks}
DataEnd
"""
BLOCKS = "TIS 0.1\n1 2\n1 4\n1 6\n# between\nTIS 0.2\n3 8\n3 10\n3 12"
DAMAGES = [
    ("PlaneSymmetrical", "Round"),
    ("Monochrome\nScatter", "Infrared\nScatter"),
    ("BRDF", "BTDF"),
    ("0 60", "60 0"),
    ("0 60", "x 60"),
    ("AngleOfIncidence  2", "AngleOfIncidence  1e300"),
    ("AngleOfIncidence  2", "AngleOfIncidence  -2"),
    ("ScatterRadial 2\n0 40\n", ""),
    ("3 12", "3"),
    ("3 12", "3 nan"),
    ("TIS 0.2", "TIS"),
]


@pytest.fixture(scope="module", params=KINDS)
def file(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    """A kind of table, and its file."""
    return request.param, exported(tmp_path_factory.mktemp("zemax"), "zemax", request.param)


def test_anisotropic_tables_have_four_angles_and_channels_their_blocks(file: tuple[str, Path]) -> None:
    kind, path = file
    text = path.read_text(encoding="utf-8")
    assert ("Symmetry ASymmetrical4D" if small_table(kind).anisotropic else "Symmetry PlaneSymmetrical") in text
    assert text.count("DataBegin") == text.count("DataEnd") == (3 if kind == SPECTRAL else 1)


def test_tis_is_the_albedo_of_the_table(file: tuple[str, Path]) -> None:
    kind, path = file
    record = zemax.read(path).record
    tis = np.array(record["tis"])  # rotations, incidences, channels
    albedo = directional_albedo(small_table(kind), tolerance=TIS_ATOL)
    at_normal = albedo.albedo[0].min(), albedo.albedo[0].max()  # over azimuths and wavelengths
    assert record["theta_i_deg"][0] == 0.0
    assert np.all((tis[:, 0] > 0.999 * at_normal[0]) & (tis[:, 0] < 1.001 * at_normal[1]))
    if kind in (GREY, DIFFUSE):
        known = np.interp(record["theta_i_deg"], albedo.theta_i_deg, albedo.albedo[:, 0, 0])
        np.testing.assert_allclose(tis[0, :, 0], known, atol=TIS_ATOL)


def test_a_file_by_hand(tmp_path: Path) -> None:
    path = tmp_path / "other.BSDF"
    path.write_text(BY_HAND.format(symmetry="PlaneSymmetrical", turns="1\n0", blocks=BLOCKS), encoding="utf-8")
    reading = read_table(path)
    degrees = np.deg2rad
    assert reading.lookup(degrees(60.0), 1.0, degrees(60.0), 1.0 + np.pi) == pytest.approx(3.0)  # specular
    # 40 degrees from the specular direction towards the normal: azimuth 0
    assert reading.lookup(degrees(60.0), 0.0, degrees(20.0), np.pi) == pytest.approx(8.0)
    assert reading.lookup(degrees(30.0), 0.0, degrees(10.0), np.pi) == pytest.approx((1.5 + 5.5) / 2.0)
    # light along the normal, viewer 40 degrees off at 90 degrees to either side
    for side in (0.5, 1.5):
        assert reading.lookup(0.0, 0.0, degrees(40.0), side * np.pi) == pytest.approx(4.0)
    assert reading.record["tis"] == [[[0.1], [0.2]]]


def test_rotations_come_first(tmp_path: Path) -> None:
    path = tmp_path / "turned.bsdf"
    blocks = BLOCKS + "\n" + BLOCKS.replace("1 ", "5 ")
    path.write_text(BY_HAND.format(symmetry="ASymmetrical4D", turns="2\n0 90", blocks=blocks), encoding="utf-8")
    reading = zemax.read(path)
    assert reading.lookup(0.0, 0.0, 0.0, 0.0) == pytest.approx(1.0)
    assert reading.lookup(1e-9, np.pi / 2, 0.0, 0.0) == pytest.approx(5.0)


def test_damaged_files(tmp_path: Path) -> None:
    text = BY_HAND.format(symmetry="PlaneSymmetrical", turns="1\n0", blocks=BLOCKS)
    check_changes_refused(tmp_path / "a.bsdf", text, [(old, new, "") for old, new in DAMAGES], "zemax")
