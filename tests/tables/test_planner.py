"""The planner: tables keep to the tolerance at directions that it did not see, and are small."""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.materials import Material, exact_material, presets
from brdfdb.tables import error_measurement, plan_trials, planner, tabulation
from brdfdb.tables.grids import ANISOTROPIC_HALF_DIFFERENCE_AXES, HALF_DIFFERENCE_AXES, ISOTROPIC_AXES, Grid
from brdfdb.tables.layout import Layout
from brdfdb.tables.planner import plan
from brdfdb.tables.stated_error import Error
from tests.tables.made_up import error_of, material, table_of, values_of

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


def spectrum(source: Material) -> NDArray[np.float64] | None:
    if not source.spectral:
        return None
    return WAVELENGTHS if source.wavelengths_nm is None else np.array(source.wavelengths_nm)


def measured(layout: Layout) -> Error:
    return error_of(layout, seed=FRESH)


@pytest.fixture(scope="module")
def planned() -> dict[str, Layout]:
    """A table of each kind of material at the tolerance."""
    materials = presets()
    return {name: plan(materials[name], spectrum(materials[name]), TOLERANCE) for name in NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_a_planned_table_keeps_to_its_tolerance_in_few_bytes(name: str, planned: dict[str, Layout]) -> None:
    layout = planned[name]
    assert measured(layout).overall.p99 <= TOLERANCE
    part = 4 * math.prod(layout.grid.shape)
    assert part <= (ANISOTROPIC_BYTES if layout.grid.anisotropic else ISOTROPIC_BYTES)
    table = table_of(layout)
    assert table.brdf.min() >= 0.0
    assert layout.interpolation.logarithm or table.values.min() >= 0.0


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
    assert plan(presets()["rolled-aluminum"], None, TOLERANCE).document() == planned["rolled-aluminum"].document()


def test_a_smaller_tolerance_takes_a_larger_table() -> None:
    layouts = {tolerance: plan(presets()["clay-vase"], None, tolerance) for tolerance in (0.05, 0.01, 0.002)}
    sizes = [layout.size for layout in layouts.values()]
    assert sizes[0] < sizes[1] < sizes[2]
    for tolerance, layout in layouts.items():
        assert measured(layout).overall.p99 <= tolerance


def test_a_plan_on_the_fit_keeps_to_its_tolerance_of_the_facets() -> None:
    """With the grid of the fit alone, 99 of 100 values of these facets are within 1.4 % only."""
    fit = presets()["rendered-sphere-10deg"]
    layout = plan(exact_material(fit), None, TOLERANCE, alike=fit)
    assert layout.source == exact_material(fit)
    drawn = error_measurement.draw(layout.source, None, 400, FRESH)
    truth = error_measurement.model_values(layout.source, None, drawn.wi, drawn.wr)
    found = table_of(layout).lookup_vectors(drawn.wi, drawn.wr).reshape(truth.shape)
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
    layout = plan(material("oren_nayar_unidirectional", rho=0.9, theta_a_deg=30, phi_a_deg=20), None, 0.2)
    assert layout.grid.copies == 1
    assert measured(layout).overall.p99 <= 0.2


# Values of a plan relative to the smallest table of an exhaustive search: worst 1.92, rendered-sphere-10deg at 0.05
TIMES_THE_SMALLEST = 2.0
# The lobe of this one bends along phi_d where lines hardly see it; its table at 0.02 has 26400 values
BOUNDED = {"rho_d": 0.2, "rho_s": 0.3, "alpha_x": 0.3, "alpha_y": 0.45}


def ward_bounded(change: float = 0.0) -> Material:
    return material("ward_bounded", **BOUNDED | {"alpha_x": BOUNDED["alpha_x"] * (1.0 + change)})


@pytest.mark.parametrize("tolerance", [0.02, 0.005])
def test_the_last_digit_of_a_parameter_decides_not_whether_a_table_is_found(tolerance: float) -> None:
    """A kind of table that kept to 0.02 at few directions alone was the only one that was tried then."""
    layouts = [plan(ward_bounded(change), None, tolerance) for change in (0.0, 1e-15, -3e-15, 1e-12)]
    sizes = [layout.size for layout in layouts]
    assert max(sizes) <= 1.3 * min(sizes)  # a step of one axis; they are the same
    for layout in layouts[:2]:
        assert measured(layout).overall.p99 <= tolerance


@pytest.mark.parametrize(("k", "rho"), [(0.47658484, 0.81669623), (0.44454535, 0.50307130)])
def test_a_kind_that_fails_hides_none_that_keeps_to_the_tolerance(k: float, rho: float) -> None:
    """Two kinds fail in turn at stricter tolerances, and the second keeps to 0.01 at those where it is not tried."""
    layout = plan(material("minnaert", k=k, rho=rho), None, TOLERANCE)
    assert measured(layout).overall.p99 <= TOLERANCE


def test_kinds_that_promise_too_much_leave_their_turn_to_the_next() -> None:
    """Two kinds promise fewer nodes than they take, 700425; the third takes some hundreds."""
    bounded = material("ward_bounded", rho_d=0.17984396, rho_s=0.04964861, alpha_x=0.05635773, alpha_y=0.05635773)
    assert plan(bounded, None, TOLERANCE).size < 1000


def test_finer_axes_end_where_nodes_are_rounded_to_the_same() -> None:
    task = planner._task(material("minnaert", k=0.47658484, rho=0.81669623), None, TOLERANCE, None)
    kinds = [(layout, needs) for _, layout, needs in planner._table_kinds(task) if needs]
    finest = [planner._with_axes(*kind, TOLERANCE, {"theta_i": 11, "theta_r": 11}) for kind in kinds]
    assert None in finest
    assert any(finest)


def test_a_kind_that_fails_at_all_directions_leaves_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    finished = plan_trials.finished
    first = plan(presets()["glossy-grey-paper"], None, TOLERANCE)

    def failing(layout: Layout, *others: Any) -> Any:
        return None if layout.interpolation == first.interpolation else finished(layout, *others)

    monkeypatch.setattr(plan_trials, "finished", failing)
    other = plan(presets()["glossy-grey-paper"], None, TOLERANCE)
    assert other.interpolation != first.interpolation
    assert measured(other).overall.p99 <= TOLERANCE


@pytest.mark.parametrize(
    ("name", "tolerance"),
    [
        ("wall-plaster", 0.05),
        *itertools.product(("glossy-grey-paper", "ivory-computer-plastic", "rendered-sphere-10deg"), (0.05, 0.01)),
    ],
)
def test_no_table_of_an_exhaustive_search_has_half_the_values_of_a_plan(name: str, tolerance: float) -> None:
    """Every number of nodes of each axis is tabulated and measured, of each kind of table that a plan looks into."""
    source = presets()[name]
    most = plan(source, None, tolerance).size / TIMES_THE_SMALLEST
    task = planner._task(source, None, tolerance, None)
    for _, layout, needs in (kind for kind in planner._table_kinds(task) if kind[2]):
        shared = list(dict.fromkeys(needs.values()))
        for counts in itertools.product(*(need.counts for need in shared)):
            number = dict(zip(shared, counts, strict=True))
            if math.prod(number[need] for need in needs.values()) < most:
                axes = {axis: need.nodes(number[need]) for axis, need in needs.items()}
                trial = dataclasses.replace(layout, grid=Grid(axes))
                error = plan_trials.error_of(trial, plan_trials.values_of(trial), task.sample)
                assert error > plan_trials.MARGIN * tolerance, trial.grid.shape


@pytest.mark.parametrize("name", ["glossy-grey-paper", "blue-plastic"])
def test_the_values_of_a_plan_are_those_of_its_blocks(name: str) -> None:
    source = presets()[name]
    layout, values = planner.planned(source, np.array([450.0, 500.0, 600.0]) if source.spectral else None, 0.05)
    assert values is not None
    np.testing.assert_array_equal(values, values_of(layout))


def test_few_directions_rule_out_only_what_all_of_them_do() -> None:
    plaster = presets()["wall-plaster"]
    final = plan_trials.final_of(plaster, None)
    for nodes in (3, 6, 9, 18):
        theta = np.append(np.linspace(0.0, 88.0, nodes), 89.9)
        layout = Layout(plaster, Grid({"theta_i": theta, "theta_r": theta, "delta_phi": np.linspace(0.0, 180.0, 8)}))
        values = plan_trials.values_of(layout)
        error = plan_trials.error_of(layout, values, final)
        for goal in (0.5 * error, 0.99 * error, 1.01 * error, 2.0 * error):
            assert plan_trials.keeps(layout, values, final, goal) == (error <= goal)


# The hot spot

MOON = material("hapke", w=0.3, b=0.24, c=0.6, b_0=1.0, h=0.05, theta_bar_deg=20.05)


def near_the_light(layout: Layout) -> float:
    places = measured(layout).places
    assert places is not None
    return float(np.max(places.alongside))


def test_a_tolerance_near_the_light_is_kept_there() -> None:
    assert near_the_light(plan(MOON, None, 0.02)) > 0.06
    layout = plan(MOON, None, 0.02, hot_spot_tolerance=0.03)
    assert near_the_light(layout) <= 0.03
    assert layout.grid.names == HALF_DIFFERENCE_AXES


def test_a_tolerance_near_the_light_that_takes_too_much_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planner, "MOST_VALUES", 3000)
    with pytest.raises(ParameterError, match=r"^hot_spot_tolerance: 0.01 near the light, with 0.02 elsewhere, takes"):
        plan(MOON, None, 0.02, hot_spot_tolerance=0.01)
    with pytest.raises(ParameterError, match=r"^hot_spot_tolerance: 0.6 is outside \[0.0001, 0.5\]$"):
        plan(MOON, None, 0.02, hot_spot_tolerance=0.6)
