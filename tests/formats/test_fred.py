"""Tabulated scatter of FRED: the lines by hand, where the mirror direction is, round trips, damage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.formats.a_file import check_changes_refused, exported, notes_of, read_table, samples_of
from tests.formats.small_tables import GREY, small_table

# Light at 10 and 50 degrees; bright towards the mirror direction, at azimuth 0
BY_HAND = """\
type bsdf_data
format angles=deg bsdf=value scale=2
10\t0
0\t0\t1
40\t0\t2
40\t180\t1.5
40\t270\t1.7
40\t90\t1.7
50\t0
0\t0\t3
40\t0\t8
40\t90\t5
40\t180\t4
40\t270\t5
"""


def test_both_sides_are_written_and_the_normal_once(tmp_path: Path) -> None:
    table = small_table(GREY)
    lines = exported(tmp_path, "fred", GREY).read_text(encoding="ascii").splitlines()
    assert lines[:3] == ["type bsdf_data", "format angles=deg bsdf=value scale=1", "0\t0"]
    rows = [[float(word) for word in line.split("\t")] for line in lines[2:]]
    lights = [number for number, row in enumerate(rows) if len(row) == 2]
    block = rows[lights[1] + 1 : lights[2]]
    assert sum(theta == 0.0 for theta, _, _ in block) == 1
    values = {(theta, round(phi, 5)): value for theta, phi, value in block}
    light = np.deg2rad(rows[lights[1]][0])
    for (theta, phi), value in values.items():
        if theta:
            assert values[theta, round((360.0 - phi) % 360.0, 5)] == value
        if theta < 89.0:
            f_r = float(table.lookup(light, np.pi, np.deg2rad(theta), np.deg2rad(phi)))
            assert value == pytest.approx(f_r, rel=6e-5)


def test_azimuths_count_from_the_mirror_direction(tmp_path: Path) -> None:
    path = tmp_path / "a.fred.txt"
    path.write_text(BY_HAND, encoding="ascii")
    reading = read_table(path)
    light, viewer = np.deg2rad([30.0, 20.0])
    # at theta_i = 30 degrees, half way between both lights, and half way between the normal and 40 degrees; scale 2
    assert reading.lookup(light, 0.0, viewer, np.pi) == pytest.approx((1 + 2 + 3 + 8) / 2, rel=1e-6)
    assert reading.lookup(light, 0.0, viewer, 0.0) == pytest.approx((1 + 1.5 + 3 + 4) / 2, rel=1e-6)
    assert reading.lookup(light, 0.4, viewer, 0.4 + np.pi / 2) == pytest.approx((1 + 1.7 + 3 + 5) / 2, rel=1e-6)


def test_directions_that_are_no_grid_are_samples(tmp_path: Path) -> None:
    samples = samples_of(tmp_path, BY_HAND.replace("40\t180\t4\n", ""), "a.fred.txt")
    assert samples.values.shape == (9, 1)
    brightest = int(samples.values[:, 0].argmax())
    delta_phi = np.rad2deg(samples.phi_r - samples.phi_i)[brightest] % 360.0
    assert (samples.values[brightest, 0], round(delta_phi)) == (16.0, 180)


def test_azimuths_turn_with_the_light(tmp_path: Path) -> None:
    """A light that travels into 60 degrees: azimuths are those on the sample, counter-clockwise from above."""
    head = "type bsdf_data\nformat angles=deg bsdf=value scale=1\n"
    text = f"{head}10 0\n40 0 2\n40 90 7\n40 180 1\n50 60\n40 60 8\n40 150 5\n"
    samples = samples_of(tmp_path, text, "a.fred.txt")
    turned = np.rad2deg(samples.phi_r - samples.phi_i) % 360.0
    np.testing.assert_allclose(np.rad2deg(samples.phi_i), [180, 180, 180, 240, 240])
    np.testing.assert_allclose(turned, [180, 270, 0, 180, 270], atol=1e-9)  # 8 is in the mirror direction
    np.testing.assert_array_equal(samples.values[:, 0], [2, 7, 1, 8, 5])
    assert "azimuth in the line of the light" in notes_of(samples)
    bright = "\n".join(f"40 {phi} {9 if phi == 0 else 1}" for phi in range(0, 360, 45))
    assert "--azimuth mirror" in notes_of(samples_of(tmp_path, f"{head}50 90\n{bright}\n", "a.fred.txt"))


def test_damage_is_named(tmp_path: Path) -> None:
    changes = [
        ("angles=deg", "angles=gon", "line 2, field angles: 'gon' is not known; allowed is angles=deg or rad"),
        ("angles=deg", "angles=rad", "line 3, field theta: 10 is no polar angle in the unit of line 2"),
        ("bsdf=value", "bsdf=log", "line 2, field bsdf: 'log' is not known; allowed is bsdf=value"),
        ("scale=2", "scale=2 units=percent", "line 2, field units: it is not known"),
        ("50\t0\n0", "type bsdf_data\nformat angles=deg bsdf=value scale=2\n50\t0\n0", "line 9: a second header"),
        ("scale=2", "scale=", "line 2, field scale: it is not a number"),
        ("40\t0\t8", "40\tzero\t8", "line 11 has text that is not a number"),
        ("40\t0\t8", "40\t0\t8\t9", "line 11 has 4 numbers"),
        ("10\t0\n", "", "line 3 has 3 numbers"),
        ("40\t0\t8", "40\t0\tnan", "line 11 has a number that is not finite"),
    ]
    check_changes_refused(tmp_path / "a.fred.txt", BY_HAND, changes, "fred")
