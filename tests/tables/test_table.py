"""Lookups: exact on the nodes, linear between them, seamless around them, and one sentence for what cannot be asked."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from brdfdb.tables.table import Table
from tests.tables.made_up import INTERPOLATION_TOLERANCE, KINDS, WAVELENGTHS, made_up, random_directions, scipys_cubic

pytestmark = pytest.mark.filterwarnings("ignore::brdfdb.errors.DegreesWarning")  # full turns are meant

# A node of delta_phi passes through the folding, which moves it by an ulp of pi; measured 2e-16 of the largest value
NODE_TOLERANCE = 1e-15
STEP = 1e-9  # [rad] to either side of a seam


def directions(table: Table, *nodes: Any) -> tuple[Any, ...]:
    """theta_i, phi_i, theta_r, phi_r of coordinates along the axes of a table, all in radians."""
    if table.anisotropic:
        return nodes
    theta_i, theta_r, delta_phi = nodes
    return theta_i, 0.0, theta_r, delta_phi


@KINDS
@pytest.mark.parametrize("wavelengths", [None, WAVELENGTHS, WAVELENGTHS[:1]], ids=["grey", "spectral", "single"])
def test_the_stored_value_comes_back_on_every_node(kind: str, wavelengths: Any) -> None:
    table = made_up(kind, wavelengths)
    nodes = np.meshgrid(*(np.deg2rad(axis) for axis in table.axes_deg.values()), indexing="ij")
    found = table.lookup(*directions(table, *nodes))
    assert found.dtype == np.float64
    np.testing.assert_allclose(found, table.brdf, rtol=0.0, atol=NODE_TOLERANCE)


@KINDS
def test_between_nodes_it_is_scipys_interpolators_linear_in_angles_and_cubic_in_wavelengths(kind: str) -> None:
    table = made_up(kind, WAVELENGTHS)
    nodes = [np.deg2rad(axis) for axis in table.axes_deg.values()]
    rng = np.random.default_rng(3)
    points = [rng.uniform(0.0, axis[-1], 500) for axis in nodes]
    wavelengths = rng.uniform(400.0, 2000.0, 9)
    scipys = RegularGridInterpolator(nodes, table.brdf.astype(np.float64))
    expected = scipys_cubic(scipys(np.stack(points, axis=-1)), wavelengths)
    found = table.lookup(*directions(table, *points), wavelengths)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=INTERPOLATION_TOLERANCE)


def test_an_isotropic_table_is_even_in_the_difference_of_azimuths_and_blind_to_their_mean() -> None:
    table = made_up("isotropic")
    theta_i, phi_i, theta_r, phi_r = random_directions(200)
    straight = table.lookup(theta_i, phi_i, theta_r, phi_r)
    for azimuths in ((-phi_i, -phi_r), (phi_r, phi_i), (phi_i + 1.0, phi_r + 1.0)):
        found = table.lookup(theta_i, azimuths[0], theta_r, azimuths[1])
        np.testing.assert_allclose(found, straight, rtol=0.0, atol=1e-12)
    folded = np.arccos(np.cos(phi_r - phi_i))  # worth 1e-8 rad near 0 and 180 degrees
    np.testing.assert_allclose(table.lookup(theta_i, 0.0, theta_r, folded), straight, rtol=0.0, atol=1e-7)


def test_an_anisotropic_table_does_depend_on_each_azimuth() -> None:
    table = made_up("anisotropic")
    assert table.lookup(0.3, 1.0, 0.4, 2.0) != pytest.approx(table.lookup(0.3, 1.5, 0.4, 2.5), rel=1e-3)


@KINDS
@pytest.mark.parametrize("seam", [-2 * np.pi, -np.pi, 0.0, np.pi, 2 * np.pi, 4 * np.pi])
@pytest.mark.parametrize("moved", ["phi_i", "phi_r"])
def test_there_is_no_step_at_a_seam(kind: str, seam: float, moved: str) -> None:
    table = made_up(kind)
    angles = {"theta_i": 0.3, "phi_i": 0.0, "theta_r": 0.4, "phi_r": 0.0}
    before, at, after = (table.lookup(**(angles | {moved: seam + step})) for step in (-STEP, 0.0, STEP))
    steepest = 20 * STEP  # values up to 1 over at least 5 degrees
    assert abs(before - at) < steepest
    assert abs(after - at) < steepest


@KINDS
def test_past_the_last_theta_node_the_value_is_that_of_the_node(kind: str) -> None:
    table = made_up(kind)
    _, phi_i, _, phi_r = random_directions(50)
    last_i, last_r = (np.deg2rad(table.axes_deg[name][-1]) for name in ("theta_i", "theta_r"))
    at_node = table.lookup(last_i, phi_i, last_r, phi_r)
    assert np.ptp(at_node) > 0.1
    for beyond in (np.deg2rad(85.001), np.deg2rad(89.9), np.pi / 2):
        np.testing.assert_array_equal(table.lookup(beyond, phi_i, beyond, phi_r), at_node)
        np.testing.assert_array_equal(table.lookup(last_i, phi_i, beyond, phi_r), at_node)


@KINDS
@pytest.mark.parametrize("below", [np.nextafter(np.pi / 2, 2), 1.6, 3.0, np.pi])
def test_below_the_horizon_it_is_dark(kind: str, below: float) -> None:
    table = made_up(kind, WAVELENGTHS, dirac=True)
    assert table.lookup(0.3, 0.0, 0.4, 0.0).min() > 0.0
    for theta_i, theta_r in ((below, 0.4), (0.3, below), (below, below)):
        np.testing.assert_array_equal(table.lookup(theta_i, 0.0, theta_r, 0.0), np.zeros(4))
    np.testing.assert_array_equal(table.specular_reflectance(below), np.zeros(4))


@KINDS
@pytest.mark.parametrize("position", range(4))
def test_nan_in_any_angle_gives_nan_there_and_nowhere_else(kind: str, position: int) -> None:
    table = made_up(kind, WAVELENGTHS)
    angles = [np.array([0.1, 0.2, 2.0]) for _ in range(4)]
    clean = table.lookup(*angles)
    angles[position] = np.array([0.1, np.nan, 2.0])
    found = table.lookup(*angles)
    assert np.all(np.isnan(found[1]))
    np.testing.assert_array_equal(found[[0, 2]], clean[[0, 2]])
    below = [3.0] * 4
    below[position] = np.nan
    assert np.isnan(table.lookup(*below, 500.0))


def test_nan_gives_nan_in_the_dirac_part() -> None:
    found = made_up("isotropic", dirac=True).specular_reflectance(np.array([0.1, np.nan]))
    assert np.isfinite(found).tolist() == [True, False]
