"""Lookups on planned grids: kinds of numbers, nan, the horizon, poles, seams, symmetries and the Dirac part."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from brdfdb.geometry import unit_vector
from brdfdb.tables.layout import Interpolation, Layout
from brdfdb.tables.table import Table
from brdfdb.tables.tabulation import tabulate
from tests.audit.a_table import ISOTROPIC, material
from tests.tables.test_albedo import KINDS, planned, table_of

# Azimuths are folded, which rounds them: measured 1.8e-13, of f_r far below the offset of its logarithm
FOLDED = 4e-13
# Of the Dirac part, linear over nodes 0.5 and 0.1 degrees apart; measured 3.4e-6
DIRAC_TOLERANCE = 5e-6
ANGLES: tuple[Any, ...] = (np.linspace(0.0, 1.5, 40), 0.3, np.linspace(1.4, 0.1, 40), 2.0)


@KINDS
def test_the_float32_horizon_is_the_horizon_and_beyond_it_is_dark(kind: str) -> None:
    table = table_of(kind)
    horizon = np.array([np.pi / 2], np.float32)
    zero = np.float32(0.0)
    at = table.lookup(zero, zero, horizon, zero)
    np.testing.assert_allclose(at, table.lookup(0.0, 0.0, [np.pi / 2], 0.0), rtol=1e-6)
    assert (table.lookup(zero, zero, np.nextafter(horizon, np.float32(2.0)), zero) == 0.0).all()


@KINDS
def test_a_table_of_nan_gives_nan(kind: str) -> None:
    table = table_of(kind)
    broken = replace(table, values=np.full_like(table.values, np.nan))
    assert np.isnan(broken.lookup(*ANGLES)).all()
    assert np.isnan(broken.lookup(0.2, 0.0, 0.3, 1.0)).all()


@KINDS
@pytest.mark.filterwarnings("ignore::brdfdb.errors.DegreesWarning")  # full turns are meant
def test_vectors_and_angles_agree_and_turns_change_nothing(kind: str) -> None:
    table = table_of(kind)
    once = table.lookup(*ANGLES)
    theta_i, phi_i, theta_r, phi_r = ANGLES
    vectors = table.lookup_vectors(unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r))
    np.testing.assert_allclose(vectors, once, rtol=FOLDED)
    turned = table.lookup(theta_i, phi_i - 20.0 * np.pi, theta_r, phi_r + 40.0 * np.pi)
    np.testing.assert_allclose(turned, once, rtol=FOLDED)


def test_the_symmetries_of_an_ellipse() -> None:
    table = table_of("half-difference-anisotropic")
    theta_i, phi_i, theta_r, phi_r = ANGLES
    once = table.lookup(*ANGLES)
    for other in (
        (theta_i, phi_i + np.pi, theta_r, phi_r + np.pi),
        (theta_i, -phi_i, theta_r, -phi_r),
        (theta_i, np.pi - phi_i, theta_r, np.pi - phi_r),
        (theta_r, phi_r, theta_i, phi_i),
    ):
        np.testing.assert_allclose(table.lookup(*other), once, rtol=FOLDED)


@pytest.mark.parametrize("seam", [0.0, np.pi / 2, np.pi, 3 * np.pi / 2, 2 * np.pi])
@pytest.mark.parametrize("theta", [(0.5, 0.5), (0.0, 0.5), (1.2, 1.3)])
@KINDS
def test_there_is_no_step_at_a_seam(kind: str, theta: tuple[float, float], seam: float) -> None:
    table = table_of(kind)
    for phi_r in (0.0, 0.5 * np.pi, np.pi):
        before, at, after = (table.lookup(theta[0], seam + step, theta[1], phi_r) for step in (-1e-9, 0.0, 1e-9))
        np.testing.assert_allclose([before, after], [at, at], rtol=1e-6)


def test_a_cubic_that_overshoots_is_0_there() -> None:
    layout = Layout(material("lambert", {"rho": 0.5}), ISOTROPIC, interpolation=Interpolation("cubic"))
    values = tabulate(layout)["brdf"].values
    values[...] = 0.0
    values[2, 2] = 1.0
    theta = np.linspace(0.0, 1.5, 300)
    found = Table.of(layout, values).lookup(theta, 0.0, np.deg2rad(30.0), 0.0)
    assert found.min() == 0.0
    assert np.count_nonzero(found == 0.0) > 50
    assert found.max() >= 1.0 - 1e-4


def test_a_pole_at_the_horizon_is_not_tabulated() -> None:
    table = planned("torrance_sparrow", {"sigma_deg": 10.0}, tolerance=0.05)
    assert table.error is not None
    assert table.error.overall.l1 <= 0.05
    assert np.abs(table.values).max() < 20.0  # logarithms: they were 54
    assert table.error.overall.max < 10.0  # it was 1e14


def test_the_dirac_part_of_a_planned_table_has_nodes_of_its_own() -> None:
    wavelengths = np.array([550.0])
    table = planned("he_torrance", {"sigma_0_um": 0.02, "tau_um": 5.0, "a": 0.1}, wavelengths)
    assert table.specular_theta_deg is not None
    assert table.specular_theta_deg.size > 400
    spec, arguments = table.source.spec, table.source.arguments(550.0)
    theta_i = np.deg2rad(np.linspace(0.0, 85.0, 1000))  # beyond, the shadows of this surface grow within 0.1 degrees
    assert spec.specular is not None
    exact = spec.specular(theta_i, **{name: arguments[name] for name in spec.specular_parameters})
    np.testing.assert_allclose(table.specular_reflectance(theta_i, 550.0), exact, atol=DIRAC_TOLERANCE)


@KINDS
def test_the_stated_error_has_the_shape_of_the_values(kind: str) -> None:
    table = table_of(kind)
    found = table.lookup_with_error(*ANGLES)
    assert found.error.shape == found.brdf.shape
    assert (found.error > 0.0).all()
    np.testing.assert_array_equal(found.brdf, table.lookup(*ANGLES))
    above, under = table.lookup_vectors_with_error([[0.0, 0.0, 1.0], [0.6, 0.0, -0.8]], [0.0, 0.6, 0.8]).error
    assert np.all(above > 0.0)
    assert np.all(under == 0.0)
    assert np.all(table.lookup_with_error(2.0, 0.0, 0.5, 1.0).error == 0.0)


@KINDS
@pytest.mark.parametrize("turn", [0.0, np.pi])
def test_the_last_bit_of_an_azimuth_moves_nothing_in_the_plane_of_incidence(kind: str, turn: float) -> None:
    table = table_of(kind)
    number = np.random.default_rng(9)
    theta_i, theta_r = np.arccos(number.uniform(0.05, 1.0, (2, 2000)))
    phi_i = number.uniform(0.0, 2.0 * np.pi, 2000)
    phi_r = phi_i + turn
    at = table.lookup(theta_i, phi_i, theta_r, phi_r)
    for beside in (np.nextafter(phi_r, 100.0), np.nextafter(phi_r, -100.0)):
        moved = table.lookup(theta_i, phi_i, theta_r, beside)
        np.testing.assert_allclose(moved, at, rtol=1e-12, atol=1e-13 * at.max())  # an offset is taken away again
