"""UTIA files: the database's own interpolation worked out anew, and the encoding of dj_brdf."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import pytest

from brdfdb.formats import utia
from brdfdb.geometry import unit_vector
from tests.formats.a_file import check_refused, read_table
from tests.formats.small_tables import ANISOTROPIC, KINDS, SPECTRAL, small_table

PLANE = 288 * 288
SUM_ATOL = 5e-15  # of the largest number: sums of sixteen products; worst measured 5e-16


def interpolated(numbers: np.ndarray, angles: np.ndarray) -> list[float]:
    """Return three channels at theta_i, phi_i, theta_v, phi_v [rad], as UTIA's own reader interpolates."""
    corners = []
    for angle, step, count in zip(np.rad2deg(angles), (15.0, 7.5) * 2, (6, 48) * 2, strict=True):
        below = min(math.floor(angle / step), count - 2 if count == 6 else count - 1)
        share = angle / step - below
        corners.append(((below, 1.0 - share), ((below + 1) % count if count == 48 else below + 1, share)))
    total = [0.0, 0.0, 0.0]
    for (ti, a), (pi, b), (tv, c), (pv, d) in itertools.product(*corners):
        for plane in range(3):
            total[plane] += a * b * c * d * numbers[plane * PLANE + (ti * 48 + pi) * 288 + tv * 48 + pv]
    return total


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_is_read_as_its_own_reader_reads_it(tmp_path: Path, kind: str) -> None:
    utia.write(small_table(kind), tmp_path / "a.bin")
    numbers = np.fromfile(tmp_path / "a.bin", "<f8")
    assert numbers.size == 3 * PLANE
    reading = read_table(tmp_path / "a.bin")
    rng = np.random.default_rng(5)
    for angles in rng.uniform(0.0, [1.57, 6.28, 1.57, 6.28], (40, 4)):
        expected = interpolated(numbers, angles)
        np.testing.assert_allclose(reading.lookup(*angles), expected, rtol=0.0, atol=SUM_ATOL * numbers.max())


def test_places_by_hand(tmp_path: Path) -> None:
    table = small_table(ANISOTROPIC)
    utia.write(table, tmp_path / "a.bin")
    numbers = np.fromfile(tmp_path / "a.bin", "<f8")
    wi, wr = unit_vector(*np.deg2rad([45.0, 15.0])), unit_vector(*np.deg2rad([30.0, 202.5]))  # numbers 3, 2, 2 and 27
    for plane in range(3):
        index = plane * PLANE + (3 * 48 + 2) * 288 + 2 * 48 + 27
        assert numbers[index] == pytest.approx(float(table.lookup_vectors(wi, wr)), rel=1e-6)


def test_dj_brdf_decodes_its_encoding(tmp_path: Path) -> None:
    table = small_table(SPECTRAL)
    utia.write(table, tmp_path / "linear.bin")
    utia.write(table, tmp_path / "dj.bin", encoding="dj_brdf")
    linear, encoded = (np.fromfile(tmp_path / name, "<f8") for name in ("linear.bin", "dj.bin"))
    part = encoded / 140.0
    decoded = 100.0 * np.where(part > 0.0375, ((part + 0.055) / 1.055) ** 2.4, part / 12.92)
    np.testing.assert_allclose(decoded, linear, rtol=1e-6)
    reading = utia.read(tmp_path / "dj.bin")
    assert reading.record["encoding"] == "dj_brdf"
    angles = np.deg2rad([45.0, 15.0, 30.0, 202.5])  # a node
    np.testing.assert_allclose(reading.lookup(*angles), interpolated(decoded, angles), rtol=1e-5)


def test_damaged_files(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    for data in (bytes(8 * 3 * PLANE - 1), np.full(3 * PLANE, np.inf).tobytes()):
        path.write_bytes(data)
        check_refused(path, "", "utia")
