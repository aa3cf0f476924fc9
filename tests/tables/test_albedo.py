"""Albedos of tables that are looked up: against a finer rule, the model, and the error that the table states."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb.integrals import quadrature
from brdfdb.tables import albedo
from brdfdb.tables.albedo import QUADRATURE_TOLERANCE, THETA_I_DEG, directional_albedo
from brdfdb.tables.layout import Layout
from brdfdb.tables.planner import plan
from brdfdb.tables.table import Table
from brdfdb.tables.tabulation import tabulate
from tests.tables.made_up import error_of, material, read_back

WAVELENGTHS = np.linspace(400.0, 700.0, 13)

# On each kind of grid, with and without parts, an offset, a power, and a lobe
PLANNED: dict[str, tuple[str, dict[str, float], NDArray[np.float64] | None]] = {
    "polar": ("oren_nayar", {"rho": 0.6, "sigma_deg": 30.0}, None),
    "polar-parts": ("he_torrance", {"sigma_0_um": 0.13, "tau_um": 1.2}, WAVELENGTHS),
    "polar-anisotropic": ("oren_nayar_unidirectional", {"rho": 0.6, "theta_a_deg": 20.0, "phi_a_deg": 20.0}, None),
    "half-difference": ("ward", {"rho_d": 0.2, "rho_s": 0.2, "alpha_x": 0.2, "alpha_y": 0.2}, None),
    "half-difference-anisotropic": ("ward", {"rho_d": 0.2, "rho_s": 0.2, "alpha_x": 0.3, "alpha_y": 0.15}, None),
}
KINDS = pytest.mark.parametrize("kind", PLANNED)

# At 0, 45 and 80 degrees, of tables with an error of 0.02; worst measured 1.1e-3, of the spectra in parts
MODEL_TOLERANCE = 1.5e-3


def planned(model: str, parameters: dict[str, float], wavelength_nm: Any = None, tolerance: float = 0.02) -> Table:
    """A planned table as a store holds it."""
    return measured(plan(material(model, **parameters), wavelength_nm, tolerance))


def measured(layout: Layout) -> Table:
    """The table of a layout as a store holds it, its error measured."""
    return read_back(tabulate(layout), error=error_of(layout).model_dump(mode="json"))


@functools.cache
def table_of(kind: str) -> Table:
    model, parameters, wavelength_nm = PLANNED[kind]
    return planned(model, parameters, wavelength_nm)


@KINDS
def test_planned_tables_are_on_the_grids_that_they_are_meant_to_try(kind: str) -> None:
    table = table_of(kind)
    assert table.grid.half_difference == kind.startswith("half")
    assert table.grid.anisotropic == kind.endswith("anisotropic")
    assert (table.spectra is not None) == kind.endswith("parts")
    assert not albedo.linear_in_angles(table)


@KINDS
def test_the_quadrature_keeps_to_its_tolerance(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    table = table_of(kind)
    monkeypatch.setattr(albedo, "THETA_I_DEG", np.array([0.0, 30.0, 75.0, 89.0]))
    found = directional_albedo(table)
    monkeypatch.setattr(albedo, "QUADRATURE_TOLERANCE", 2e-7)
    monkeypatch.setattr(albedo, "_MOST_PANELS", 20_000)
    finer = directional_albedo(table)
    assert (found.error <= QUADRATURE_TOLERANCE).all()
    assert np.abs(found.albedo - finer.albedo).max() <= QUADRATURE_TOLERANCE
    assert finer.error.max() < found.error.max()


@KINDS
def test_the_albedo_is_that_of_the_model(kind: str) -> None:
    table = table_of(kind)
    found = directional_albedo(table)
    source = table.source
    np.testing.assert_array_equal(found.theta_i_deg, THETA_I_DEG)
    for at in (0, 9, 16):
        theta_i, phi_i = np.deg2rad(found.theta_i_deg[at]), np.deg2rad(found.phi_i_deg)
        for w in range(0, found.albedo.shape[2], 6):
            one = None if table.wavelength_nm is None else table.wavelength_nm[w]
            exact, _ = quadrature.directional_albedo(
                source.spec, theta_i, phi_i, tolerance=1e-6, **source.arguments(one)
            )
            np.testing.assert_allclose(found.albedo[at, :, w], exact, atol=MODEL_TOLERANCE)


def test_the_azimuths_go_as_far_as_symmetry_does_not() -> None:
    ellipse = directional_albedo(table_of("half-difference-anisotropic"))
    grooves = directional_albedo(table_of("polar-anisotropic"))
    isotropic = directional_albedo(table_of("polar"))
    assert ellipse.phi_i_deg.tolist() == [0.0, 30.0, 60.0, 90.0]
    assert grooves.phi_i_deg.tolist() == np.arange(0.0, 361.0, 30.0).tolist()
    assert isotropic.phi_i_deg.tolist() == [0.0]
    np.testing.assert_allclose(grooves.albedo[:, 0], grooves.albedo[:, -1], atol=QUADRATURE_TOLERANCE)
    expected = np.average(ellipse.albedo, axis=1, weights=[0.5, 1.0, 1.0, 0.5])
    np.testing.assert_allclose(ellipse.mean, expected, rtol=1e-14)
    assert np.ptp(ellipse.albedo[15]) > 1e-3


def test_of_a_planned_table_that_is_linear_it_is_exact_up_to_90_degrees() -> None:
    table = planned("lambert", {"rho": 0.7})
    found = directional_albedo(table)
    assert albedo.linear_in_angles(table)
    np.testing.assert_array_equal(found.theta_i_deg, [*THETA_I_DEG, 90.0])
    np.testing.assert_array_equal(found.error, 0.0)
    np.testing.assert_allclose(found.albedo, 0.7, rtol=1e-7)  # rho / pi rounded to float32: half an ulp is 6e-8


def test_a_table_that_holds_nan_has_no_albedo() -> None:
    table = table_of("half-difference")
    broken = replace(table, values=np.full_like(table.values, np.nan))
    assert np.isnan(directional_albedo(broken).albedo).all()
