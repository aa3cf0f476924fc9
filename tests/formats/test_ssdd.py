"""SSDD files: the order of entries and values, all wavelengths, the specular part, what libbsdf trips over, damage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from brdfdb.formats import ssdd
from tests.formats.a_file import check_changes_refused, exported, options_of, read_table
from tests.formats.round_trip import round_trip
from tests.formats.small_tables import KINDS, SPECTRAL, small_table

ERROR_RTOL = 1e-6  # of p99 of a file that is read again: worst measured 1.2e-7, of the seven digits in ASCII
ORDER = (
    *("VERSION", "SOFTWARE", "DATA_TYPE", "COLOR_MODEL", "WAVELENGTH_LIST", "PARAM_TYPE", "REDUCTION_TYPE"),
    *("PARAM0_LIST", "PARAM1_LIST", "PARAM2_LIST", "PARAM3_LIST", "NAME", "SOURCE_TYPE", "DATA"),
)
BY_HAND = """VERSION 0.3
# by hand
DATA_TYPE brdf
COLOR_MODEL rgb
PARAM_TYPE {kind}
{reduction}
PARAM0_LIST 0 80
PARAM2_LIST 0 40
PARAM3_LIST {azimuths}
DATA ascii
{values}
DATA_TYPE specular_reflectance
COLOR_MODEL monochrome
PARAM0_LIST 0 90
DATA ascii
0.25
0.5
"""
SPHERICAL = "spherical_coordinate_system"
ROWS = [f"{number} {10 * number} {100 * number}" for number in range(8)]
DAMAGES = [
    ("DATA_TYPE brdf", "DATA_TYPE btdf"),
    ("DATA_TYPE brdf", "DATA_TYPE light"),
    ("rgb", "cmyk"),
    ("rgb", "spectrum"),
    (SPHERICAL, "distorted_spherical_coordinate_system"),
    ("PARAM0_LIST 0 80\n", ""),
    ("PARAM0_LIST 0 80", "PARAM0_LIST 80 0"),
    ("PARAM0_LIST 0 80", "PARAM0_LIST 0 80\nPARAM4_LIST 0 5"),
    ("PARAM0_LIST 0 80", "PARAM0_LIST zero 80"),
    ("7 70 700", "7 70"),
    ("7 70 700", "7 70 nan"),
    ("7 70 700", "7 70 x"),
    ("DATA ascii\n0 ", "DATA binary\n0 "),
]


@pytest.mark.parametrize(("kind", "data"), [*((kind, "binary") for kind in KINDS), (SPECTRAL, "ascii")])
def test_entries_are_in_order(tmp_path: Path, kind: str, data: str) -> None:
    trip = round_trip(small_table(kind), tmp_path, "ssdd", **options_of("ssdd"), data=data)
    assert trip.measured == pytest.approx(trip.stated, rel=ERROR_RTOL)
    head = (tmp_path / f"{kind}.ssdd").read_bytes().partition(b"\nDATA ")[0].decode() + "\nDATA"
    names = [line.split(" ")[0] for line in head.split("\n") if line and not line.startswith("#")]
    assert names == [name for name in ORDER if name in names]


def test_the_specular_part_has_a_block_of_its_own(tmp_path: Path) -> None:
    table = small_table(SPECTRAL)
    record = ssdd.read(exported(tmp_path, "ssdd", SPECTRAL)).record
    assert table.specular is not None
    np.testing.assert_allclose(record["specular_reflectance"], table.specular, rtol=1e-6)
    assert record["specular_theta_i_deg"][0] == 0.0


def test_the_first_angle_runs_fastest(tmp_path: Path) -> None:
    path = tmp_path / "a.ssdd"
    text = BY_HAND.format(kind=SPHERICAL, reduction="", azimuths="0 180", values="\n".join(["# PARAM3: 0", *ROWS]))
    path.write_text(text, encoding="utf-8")
    reading = read_table(path)
    assert reading.channels == ("R", "G", "B")
    turn = np.deg2rad
    np.testing.assert_allclose(reading.lookup(turn(80.0), 0.0, 0.0, 0.0), [1, 10, 100], rtol=1e-6)
    np.testing.assert_allclose(reading.lookup(0.0, 0.0, turn(40.0), 0.0), [2, 20, 200], rtol=1e-6)
    np.testing.assert_allclose(reading.lookup(0.0, 0.0, turn(40.0), np.pi), [6, 60, 600], rtol=1e-6)
    np.testing.assert_allclose(reading.lookup(turn(40.0), 0.0, turn(20.0), np.pi / 2), [3.5, 35, 350], rtol=1e-6)
    assert reading.record["specular_reflectance"] == [[0.25], [0.5]]


def test_symmetries_are_filled_in(tmp_path: Path) -> None:
    path = tmp_path / "a.ssdd"
    kind, both = "half_difference_coordinate_system", "REDUCTION_TYPE bilateral_symmetry reciprocity"
    text = BY_HAND.format(kind=kind, reduction=both, azimuths="0 90", values="\n".join(ROWS))
    path.write_text(text, encoding="utf-8")
    reading = ssdd.read(path)
    light, viewer = (np.deg2rad(45.0), 0.3), (np.deg2rad(20.0), 2.0)
    expected = reading.lookup(*light, *viewer)
    np.testing.assert_allclose(reading.lookup(*viewer, *light), expected)
    np.testing.assert_allclose(reading.lookup(light[0], -light[1], viewer[0], -viewer[1]), expected)


def test_binary_values_never_look_like_a_comment() -> None:
    hashes = np.frombuffer(b"\n #\x3e" + b"\0\0\x80\x3f" * 7, "<f4").reshape(2, 1, 2, 2, 1)
    data = ssdd.encoded_block({"DATA_TYPE": "brdf"}, hashes, binary=True)
    values = data[data.index(b"binary\n") + 7 :]
    assert not values.lstrip().startswith(b"#")
    np.testing.assert_allclose(np.frombuffer(values[:32], "<f4"), hashes.reshape(-1), rtol=1e-4)


def test_values_of_a_block_are_read_back_where_they_were(tmp_path: Path) -> None:
    values = np.arange(2 * 3 * 2 * 4 * 3, dtype=np.float32).reshape(2, 3, 2, 4, 3)
    lists = {"PARAM0_LIST": "0 1", "PARAM1_LIST": "0 1 2", "PARAM2_LIST": "0 1", "PARAM3_LIST": "0 1 2 3"}
    entries = {"DATA_TYPE": "brdf", "COLOR_MODEL": "xyz", **lists}
    for binary in (True, False):
        data = ssdd.encoded_header("test", ["a comment"]) + ssdd.encoded_block(entries, values, binary) * 2
        (tmp_path / "a.ssdd").write_bytes(data)
        comments, blocks = ssdd.parsed(tmp_path / "a.ssdd")
        assert comments == ["a comment"]
        for block in blocks:
            np.testing.assert_allclose(block.values, values, rtol=1e-6, atol=1e-40)


def test_damaged_files(tmp_path: Path) -> None:
    text = BY_HAND.format(kind=SPHERICAL, reduction="", azimuths="0 180", values="\n".join(ROWS))
    check_changes_refused(tmp_path / "a.ssdd", text, [(old, new, "") for old, new in DAMAGES], "ssdd")
