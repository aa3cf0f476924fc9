"""MERL files: bins worked out by hand, readers that look up and readers that interpolate, damage."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from brdfdb.formats import merl
from brdfdb.formats._channels import channels_of
from brdfdb.formats._written import Written
from brdfdb.geometry import unit_vector
from tests.formats.a_file import check_refused, read_table
from tests.formats.small_tables import ISOTROPIC, SMOOTH, SPECULAR, small_table

HEADER = 12  # byte
PLANE = 90 * 90 * 180
SCALES = (1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0)
INFINITE = np.array([np.inf]).tobytes()
FLOAT32_RTOL = 1e-7  # values are 32 bit numbers here: worst measured 3.9e-8


def looked_up(planes: np.ndarray, light: list[float], viewer: list[float]) -> list[float]:
    """Return R, G, B of one pair [rad] as BRDF Explorer looks it up, with Matusik's half and difference angles."""
    wi, wr = unit_vector(*light), unit_vector(*viewer)
    half = (wi + wr) / np.linalg.norm(wi + wr)
    theta_h, phi_h = math.acos(half[2]), math.atan2(half[1], half[0])
    x, y = wi[0] * math.cos(phi_h) + wi[1] * math.sin(phi_h), wi[1] * math.cos(phi_h) - wi[0] * math.sin(phi_h)
    x, z = x * math.cos(theta_h) - wi[2] * math.sin(theta_h), x * math.sin(theta_h) + wi[2] * math.cos(theta_h)
    theta_d, phi_d = math.acos(z), math.atan2(y, x)
    phi_d += math.pi if phi_d < 0.0 else 0.0
    at_h = min(int(90.0 * math.sqrt(theta_h / (math.pi / 2.0))), 89)
    at_d, at_phi = min(int(theta_d / (math.pi / 2.0) * 90.0), 89), min(int(phi_d / math.pi * 180.0), 179)
    index = at_phi + 180 * (at_d + 90 * at_h)
    return [planes[channel * PLANE + index] * scale for channel, scale in enumerate(SCALES)]


@pytest.fixture(scope="module", params=ISOTROPIC)
def exported(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Written]:
    """A kind of table, and its file with values at centres of bins."""
    path = tmp_path_factory.mktemp("merl") / "a.binary"
    return request.param, merl.write(small_table(request.param), path, tolerance=0.001, verdict="sound")


def test_a_file_is_read_as_brdf_explorer_reads_it(exported: tuple[str, Written]) -> None:
    _, written = exported
    data = written.paths[0].read_bytes()
    assert len(data) == 34992012
    assert np.frombuffer(data, "<i4", 3).tolist() == [90, 90, 180]
    numbers = np.frombuffer(data, "<f8", 3 * PLANE, HEADER)
    reading = read_table(written.paths[0])
    rng = np.random.default_rng(3)
    for light, viewer in rng.uniform((0, 0), (1.5, 6.2), (40, 2, 2)).tolist():
        expected = looked_up(numbers, light, viewer)
        assert min(expected) >= 0.0  # a direction above the horizon is not invalid
        np.testing.assert_allclose(reading.lookup(*light, *viewer), expected, rtol=1e-12)


def test_bins_have_the_value_at_their_centre_and_none_below_the_horizon(exported: tuple[str, Written]) -> None:
    kind, written = exported
    channels = channels_of(small_table(kind), "rgb")
    numbers = np.fromfile(written.paths[0], "<f8", offset=HEADER).reshape(3, 90, 90, 180)
    # theta_h = 90 (30.5 / 90)^2, theta_d = 20.5, phi_d = 90.5: by hand, the light at 90 + 0.5 about the half vector
    theta_h, theta_d, phi_d = np.deg2rad([90.0 * (30.5 / 90.0) ** 2, 20.5, 90.5])
    d = unit_vector(theta_d, phi_d)
    turn = np.array([[np.cos(theta_h), 0, np.sin(theta_h)], [0, 1, 0], [-np.sin(theta_h), 0, np.cos(theta_h)]])
    f_r = channels.values(small_table(kind), turn @ d, turn @ (d * np.array([-1.0, -1.0, 1.0])))
    np.testing.assert_allclose(numbers[:, 30, 20, 90] * SCALES, f_r, rtol=1e-9)
    assert numbers[0, 80, 80, 0] == -1.0  # theta_h 71, theta_d 80, in the plane: below the horizon
    assert numbers[0, 80, 80, 90] > 0.0  # across it: above
    np.testing.assert_array_equal(numbers, numbers[..., ::-1])  # mirror image and reciprocity


def test_interpolating_readers_are_nearer(exported: tuple[str, Written], tmp_path: Path) -> None:
    kind, centres = exported
    edges = merl.write(small_table(kind), tmp_path / "edges.binary", samples="edges")
    assert centres.error is not None
    assert edges.error is not None
    assert edges.error.p99 < max(centres.error.p99, FLOAT32_RTOL)
    reading = merl.read(tmp_path / "edges.binary")
    assert reading.record["samples"] == "edges"
    # at theta_h = 90 (i / 90)^2, theta_d = j and phi_d = k degrees a reader sees the number itself
    numbers = np.fromfile(tmp_path / "edges.binary", "<f8", offset=HEADER).reshape(3, 90, 90, 180)
    theta_h, theta_d = np.deg2rad(90.0 * (20.0 / 90.0) ** 2), np.deg2rad(30.0)
    f_r = reading.lookup(theta_d + theta_h, 0.0, theta_d - theta_h, np.pi)
    np.testing.assert_allclose(f_r, numbers[:, 20, 30, 0] * SCALES, rtol=FLOAT32_RTOL)


def test_the_record_is_beside_the_file_and_says_what_is_left_out(exported: tuple[str, Written]) -> None:
    kind, written = exported
    assert [path.name for path in written.paths] == ["a.binary", "a.binary.json"]
    document = json.loads(written.paths[1].read_text(encoding="utf-8"))
    assert (document["audit"], document["samples"], document["tolerance"]) == ("sound", "centres", 0.001)
    assert any("specular part" in remark for remark in document["remarks"]) == (kind in SPECULAR)
    assert "centres of bins" in document["holds"]
    assert written.within == (kind == SMOOTH)  # its f_r is the same everywhere


def test_damaged_files(tmp_path: Path) -> None:
    path = tmp_path / "a.binary"
    head, rest = np.array([90, 90, 180], "<i4").tobytes(), bytes(3 * 8 * PLANE)
    for data in (head + rest[:-1], head + rest + b"0", b"\x5b" + head[1:] + rest, head + INFINITE + rest[8:]):
        path.write_bytes(data)
        check_refused(path, "", "merl")
