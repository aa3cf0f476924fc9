"""Zemax BSDF files: the order of the text, its conventions by hand, round trips, TIS, damage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from brdfdb import formats
from brdfdb.formats import zemax
from brdfdb.formats._readings import FileTable
from brdfdb.formats._written import Written
from brdfdb.tables.albedo import directional_albedo
from tests.formats.refusals import check_changes_refused
from tests.formats.small_tables import DIFFUSE, GREY, KINDS, SPECTRAL, small_table

SIZE, LOOSE = 0.3, 0.2  # MB, and tolerance, so that tests are quick
ERROR_RTOL = 1e-9  # of p99 of a file that is read again: no difference was measured
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
def exported(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Written]:
    """A kind of table, and its file."""
    path = tmp_path_factory.mktemp("zemax") / "a.bsdf"
    return request.param, zemax.write(small_table(request.param), path, tolerance=LOOSE, size=SIZE, verdict="sound")


def test_spectra_are_xyz_and_anisotropic_tables_have_four_angles(exported: tuple[str, Written]) -> None:
    kind, written = exported
    assert zemax.read(written.paths[0]).channels == (("X", "Y", "Z") if kind == SPECTRAL else ("Y",))
    text = written.paths[0].read_text(encoding="utf-8")
    assert ("Symmetry ASymmetrical4D" if small_table(kind).anisotropic else "Symmetry PlaneSymmetrical") in text
    assert text.count("DataBegin") == text.count("DataEnd") == (3 if kind == SPECTRAL else 1)


def test_tis_is_the_albedo_of_the_table(exported: tuple[str, Written]) -> None:
    kind, written = exported
    record = zemax.read(written.paths[0]).record
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
    reading = formats.read(path)
    assert isinstance(reading, FileTable)
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


def test_it_is_told_from_rgl_files_of_the_same_suffix() -> None:
    assert not zemax.recognises(b"tensor_file\0\x01\0" + bytes(100))
    assert zemax.recognises(BY_HAND.encode())
    assert not zemax.recognises(b"# name: something else\n1 2 3\n")
