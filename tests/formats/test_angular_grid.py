"""Angles of pairs of directions, and grids of them whose nodes are chosen by their error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from brdfdb.errors import ParameterError
from brdfdb.formats._angles import HalfDifference, Specular, Spherical, System
from brdfdb.formats._angular_grid import AngularGrid, Sink, chosen, mirrored, reciprocal, rounded
from brdfdb.formats._stated_error import Comparison, FileError
from brdfdb.geometry import unit_vector
from tests.formats.small_tables import ANISOTROPIC, DIFFUSE, GREY, KINDS, small_table

ANGLE_ATOL = 1e-13  # of angles and back [rad]; worst measured 8.4e-15
SYSTEMS: list[System] = [
    Spherical(False, True),
    Spherical(False, False),
    Spherical(True, False),
    Specular(False, True),
    Specular(True, False),
    Specular(True, True),
    *(HalfDifference(a, m, r) for a in (False, True) for m in (False, True) for r in (False, True)),
]


def pairs(count: int = 500) -> tuple[np.ndarray, np.ndarray]:
    """Return unit vectors of light and viewer, no closer to the horizon than 5 degrees."""
    rng = np.random.default_rng(7)
    theta, phi = np.deg2rad(rng.uniform(1.0, 85.0, (2, count))), rng.uniform(0.0, 2.0 * np.pi, (2, count))
    return unit_vector(theta[0], phi[0]), unit_vector(theta[1], phi[1])


@pytest.mark.parametrize("system", SYSTEMS, ids=repr)
def test_directions_of_angles_have_these_angles(system: System) -> None:
    angles = system.angles(*pairs())
    assert np.all((angles >= 0.0) & (angles <= np.array(system.ends) + ANGLE_ATOL))
    again = system.angles(*system.directions(angles))
    difference = np.abs(again - angles)
    difference = np.minimum(difference, np.abs(np.array(system.ends) - difference))  # the ends of an azimuth are one
    assert difference.max() < ANGLE_ATOL


def deg(system: System, light: tuple[float, float], viewer: tuple[float, float]) -> list[float]:
    """Return the angles [degree] of one pair, given as polar angle and azimuth [degree]."""
    wi, wr = (unit_vector(*np.deg2rad(np.array([[angle] for angle in w]))) for w in (light, viewer))
    return np.round(np.rad2deg(system.angles(wi, wr))[0], 9).tolist()


def test_specular_angles_by_hand() -> None:
    system = Specular(True, False)
    assert deg(system, (30.0, 40.0), (30.0, 220.0))[:3] == [30.0, 40.0, 0.0]
    assert deg(system, (30.0, 0.0), (0.0, 0.0)) == [30.0, 0.0, 30.0, 0.0]  # towards the normal: azimuth 0
    assert deg(system, (30.0, 0.0), (50.0, 180.0)) == [30.0, 0.0, 20.0, 180.0]
    assert deg(system, (0.0, 0.0), (20.0, 90.0)) == [0.0, 0.0, 20.0, 90.0]  # counter-clockwise from above
    assert deg(Specular(False, True), (0.0, 0.0), (20.0, 270.0)) == [0.0, 20.0, 90.0]


def test_half_difference_angles_by_hand() -> None:
    system = HalfDifference(True, mirrored=False, reciprocal=False)
    assert deg(system, (50.0, 0.0), (10.0, 0.0)) == [30.0, 0.0, 20.0, 0.0]
    assert deg(system, (10.0, 0.0), (50.0, 0.0)) == [30.0, 0.0, 20.0, 180.0]
    assert deg(HalfDifference(False), (10.0, 0.0), (50.0, 0.0)) == [30.0, 20.0, 0.0]
    assert deg(HalfDifference(True, False), (10.0, 70.0), (50.0, 70.0)) == [30.0, 70.0, 20.0, 0.0]


@pytest.mark.parametrize("system", SYSTEMS, ids=repr)
def test_all_nodes_have_directions_above_the_horizon(system: System) -> None:
    axes = [np.linspace(0.0, end, 7) for end in system.ends]
    angles = np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")], axis=1)
    for w in system.directions(angles):
        assert w[:, 2].min() > 1e-3
        np.testing.assert_allclose(np.linalg.norm(w, axis=1), 1.0, atol=1e-12)


def test_lines_between_nodes_and_beyond_them() -> None:
    nodes = (np.array([0.1, 0.5]), np.array([0.0]), np.array([0.0, 1.0, 2.0]))
    values = (10.0 * nodes[0][:, None, None] + nodes[2])[..., np.newaxis].astype(np.float32)
    system = Spherical(False, True)
    wi, wr = unit_vector(np.array([0.3, 1.0]), np.zeros(2)), unit_vector(np.array([0.2, 0.2]), np.array([0.5, 2.5]))
    np.testing.assert_allclose(AngularGrid(system, nodes, values).evaluate(wi, wr)[:, 0], [3.5, 12.5], rtol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_symmetries_are_those_of_the_table(kind: str) -> None:
    comparison = Comparison(small_table(kind))
    assert reciprocal(comparison)
    assert mirrored(comparison)


def test_a_table_without_mirror_images_is_noticed() -> None:
    table = small_table(ANISOTROPIC)
    skewed = replace(table, values=table.values * np.array([1.0, 1.3, 1.0, 1.0], np.float32))  # over phi_d
    assert not mirrored(Comparison(skewed))
    one_way = small_table(DIFFUSE)
    one_way = replace(one_way, values=one_way.values * np.linspace(1.0, 2.0, 7, dtype=np.float32)[:, None, None])
    assert not reciprocal(Comparison(one_way))


def _write(sink: Sink, grid: AngularGrid, _: FileError) -> None:
    """Write a header, which counts the more the smaller the file is, and six bytes a node."""
    sink.write(b"_" * (1000 + 6 * grid.values.size))


def test_a_smaller_tolerance_takes_more_nodes_and_a_limit_is_kept() -> None:
    table = small_table(GREY)
    comparison = Comparison(table)
    system = [HalfDifference(False)]
    loose, fine = (chosen(comparison, system, tolerance, 4.0, _write) for tolerance in (0.1, 0.03))
    assert loose[1].p99 <= 0.1
    assert fine[1].p99 <= 0.03
    assert loose[0].values.size < fine[0].values.size / 2
    least, error = chosen(comparison, system, 0.001, 0.003, _write)
    assert 200 < least.values.size <= (3000 - 1000) / 6
    assert error.p99 > 0.001
    with pytest.raises(
        ParameterError, match=r"size: 0\.001 MB are too few: the smallest file of grey-ward has 0\.00105 MB"
    ):
        chosen(comparison, system, 0.001, 0.001, _write)


def test_the_system_with_the_fewest_nodes_is_taken() -> None:
    table = small_table(DIFFUSE)
    grid, _ = chosen(Comparison(table), [Specular(False, True), Spherical(False, True)], 0.05, 4.0, _write)
    assert isinstance(grid.system, Spherical)


def test_rounded_values_are_those_of_the_text() -> None:
    values = np.array([0.0, 1.0, 123456.7, 9.99996e-7, 3.14159265])
    assert [f"{value:.5g}" for value in rounded(values)] == [f"{value:.5g}" for value in values]
    np.testing.assert_array_equal(rounded(values), [np.float32(f"{value:.5g}") for value in values])
