"""The planner: tables keep to the tolerance at directions that it did not see, and are small."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb.materials import Material, exact_material, presets
from brdfdb.tables import error_measurement, tabulation
from brdfdb.tables.grids import ANISOTROPIC_HALF_DIFFERENCE_AXES, HALF_DIFFERENCE_AXES, ISOTROPIC_AXES
from brdfdb.tables.layout import Layout
from brdfdb.tables.planner import plan
from brdfdb.tables.stated_error import Error
from brdfdb.tables.table import Table

TOLERANCE = 0.01
FRESH = 20261121  # a seed that the planner does not use
ISOTROPIC_BYTES, ANISOTROPIC_BYTES = 2e6, 40e6  # promised, of a part that does not depend on the wavelength
WAVELENGTHS = np.linspace(380.0, 780.0, 21)

# one of each kind; tests/benchmarks/tables.py does all of them
NAMES = [
    "glossy-grey-paper",
    "rolled-aluminum",
    "wall-plaster",
    "foam",
    "scene-copper-sphere",
    "aluminum-cylinder-12f",
    "magnesium-oxide-ceramic",
    "sandpaper-220-grit",
    "aluminum-cylinder-13c",
]


def spectrum(material: Material) -> NDArray[np.float64] | None:
    if not material.spectral:
        return None
    return WAVELENGTHS if material.wavelengths_nm is None else np.array(material.wavelengths_nm)


def measured(layout: Layout, seed: int = FRESH) -> Error:
    values = np.concatenate([tabulation.block(layout, rows) for rows in layout.blocks])
    return error_measurement.measure(layout, lambda rows: values[rows], seed=seed)


@pytest.fixture(scope="module")
def planned() -> dict[str, Layout]:
    """A table of each kind of material at the tolerance."""
    materials = presets()
    return {name: plan(materials[name], spectrum(materials[name]), TOLERANCE) for name in NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_a_planned_table_keeps_to_its_tolerance_in_few_bytes(name: str, planned: dict[str, Layout]) -> None:
    layout = planned[name]
    found = measured(layout)
    assert found.overall.p99 <= TOLERANCE
    part = 4 * math.prod(layout.grid.shape)
    assert part <= (ANISOTROPIC_BYTES if layout.grid.anisotropic else ISOTROPIC_BYTES)


@pytest.mark.parametrize("name", NAMES)
def test_no_node_of_a_planned_table_is_below_0(name: str, planned: dict[str, Layout]) -> None:
    layout = planned[name]
    values = np.concatenate([tabulation.block(layout, rows) for rows in layout.blocks])
    assert Table.of(layout, values).brdf.min() >= 0.0
    assert layout.interpolation.logarithm or values.min() >= 0.0


def test_the_kind_of_table_suits_the_material(planned: dict[str, Layout]) -> None:
    kinds = {name: layout.grid.names for name, layout in planned.items()}
    assert kinds["glossy-grey-paper"] == HALF_DIFFERENCE_AXES
    assert kinds["rolled-aluminum"] == ANISOTROPIC_HALF_DIFFERENCE_AXES
    assert kinds["wall-plaster"] == kinds["scene-copper-sphere"] == ISOTROPIC_AXES
    assert planned["glossy-grey-paper"].interpolation.power == 0.5  # Ward's pole is 1 / sqrt(cos cos)
    assert planned["aluminum-cylinder-13c"].size == 8  # Lambert
    copper = planned["scene-copper-sphere"]
    assert copper.spectra is not None
    assert len(copper.spectra) < WAVELENGTHS.size / 2
    np.testing.assert_allclose(copper.spectra @ copper.spectra.T, np.eye(len(copper.spectra)), atol=1e-12)
    for layout in planned.values():
        assert layout.reason.startswith("for a tolerance of 0.01, ")


@pytest.mark.parametrize("name", ["rolled-aluminum", "scene-copper-sphere"])
def test_a_layout_survives_its_document(name: str, planned: dict[str, Layout]) -> None:
    layout = planned[name]
    again = Layout.from_document(layout.document())
    assert again.document() == layout.document()
    np.testing.assert_array_equal(tabulation.block(again, slice(0, 2)), tabulation.block(layout, slice(0, 2)))


def test_a_plan_is_the_same_every_time(planned: dict[str, Layout]) -> None:
    material = presets()["rolled-aluminum"]
    assert plan(material, None, TOLERANCE).document() == planned["rolled-aluminum"].document()


def test_a_smaller_tolerance_takes_a_larger_table() -> None:
    clay = presets()["clay-vase"]
    layouts = [plan(clay, None, tolerance) for tolerance in (0.05, 0.01, 0.002)]
    assert layouts[0].size < layouts[1].size < layouts[2].size
    assert [measured(layout).overall.p99 <= t for layout, t in zip(layouts, (0.05, 0.01, 0.002), strict=True)] == [
        True
    ] * 3


def test_a_plan_on_the_fit_keeps_to_its_tolerance_of_the_facets() -> None:
    """With the grid of the fit alone, 99 of 100 values of these facets are within 1.4 % only."""
    fit = presets()["rendered-sphere-10deg"]
    layout = plan(exact_material(fit), None, TOLERANCE, alike=fit)
    assert layout.source == exact_material(fit)
    drawn = error_measurement.draw(layout.source, None, 400, FRESH)
    truth = error_measurement.model_values(layout.source, None, drawn.wi, drawn.wr)
    values = np.concatenate([tabulation.block(layout, rows) for rows in layout.blocks])
    found = Table.of(layout, values).lookup_vectors(drawn.wi, drawn.wr).reshape(truth.shape)
    assert error_measurement.compare(found, truth, drawn).overall.p99 <= TOLERANCE


def test_a_surface_that_is_all_mirror_takes_the_smallest_grid() -> None:
    smooth = presets()["aluminum-cylinder-13b"]
    layout = plan(smooth, WAVELENGTHS, TOLERANCE)
    assert layout.grid.shape == (2, 2, 2)
    assert "specular part" in layout.reason
    assert measured(layout).overall.max == 0.0


@pytest.mark.parametrize("tolerance", [0.0, 1e-5, 0.6, -1.0, np.nan])
def test_a_tolerance_out_of_range_is_refused(tolerance: float) -> None:
    with pytest.raises(ValueError, match=r"^tolerance: .* is outside \[0\.0001, 0\.5\]"):
        plan(presets()["wall-plaster"], None, tolerance)


def test_grooves_are_planned_over_light_and_viewer() -> None:
    table = {"title": "Grooves", "model": "oren_nayar_unidirectional", "source": "no paper"}
    grooves = Material.from_table("grooves", {**table, "parameters": {"rho": 0.9, "theta_a_deg": 30, "phi_a_deg": 20}})
    layout = plan(grooves, None, 0.2)
    assert layout.grid.copies == 1
    assert measured(layout).overall.p99 <= 0.2
