"""The first numbers of a table: the error of its formula, where errors are largest, and the largest albedo."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from brdfdb import models
from brdfdb.audit.table_energy import table_energy_of
from brdfdb.forms import catalogue
from brdfdb.geometry import unit_vector
from brdfdb.materials import FunctionSource, presets
from brdfdb.tables import error_measurement
from brdfdb.tables.albedo import largest_albedo
from brdfdb.tables.error_measurement import RandomPairs, worst_pair
from brdfdb.tables.layout import Layout
from brdfdb.tables.planner import coarsest, plan
from brdfdb.tables.stated_error import LargestAlbedo
from brdfdb.tables.statements import DIRECTIONS, SEED, first_numbers, formula_error_of, highest_rung
from brdfdb.tables.tabulation import tabulate
from tests.tables.made_up import material, read_back, table_of

AT = np.array([460.0])


def largest_of(layout: Layout) -> Any:
    """The largest albedo that a build states."""
    values = tabulate(layout)[layout.variable].to_numpy()
    return first_numbers(layout, lambda rows: values[rows])["largest_albedo"]


def test_the_error_of_the_fit_is_that_of_its_chart() -> None:
    vase = presets()["clay-vase"]
    found = formula_error_of(vase, None)
    assert (found.against, found.rung) == ("measured", "facets integrated, eqs 8-20 and 47")
    drawn = error_measurement.draw(vase, None, DIRECTIONS, SEED)
    charted = {form.key: form for form in catalogue.forms(vase, None, ())}
    facets, fit = (charted[key].evaluate(drawn.wi, drawn.wr) for key in ("facets", "fit"))
    assert found.overall == error_measurement.compare(fit, facets, drawn, SEED).overall
    assert found.p99 == pytest.approx(0.12, abs=0.005)  # of the chart of the clay vase in the docs


def test_the_rung_of_a_body_with_a_surface_is_its_facets_with_that_surface() -> None:
    foam = presets()["foam"]
    rung = highest_rung(foam, None)
    assert rung is not None
    given = foam.arguments(None)
    wi, wr = unit_vector(np.array([0.4]), 0.0), unit_vector(np.array([0.7]), 2.0)
    direct = models.oren_nayar_gaussian_parts(0.4, 0.0, 0.7, 2.0, rho=given["rho"], sigma=given["sigma"]).direct
    surface = models.torrance_sparrow(0.4, 0.0, 0.7, 2.0, sigma=given["sigma"])
    expected = given["k_b"] * direct + given["k_s"] / given["e_0"] * surface  # section 5: without the bounce
    assert rung.vectors(wi, wr, **given) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("name", "against"),
    [("blue-plastic", "highest rung"), ("aluminum-cylinder-13c", "highest rung"), ("rolled-brass", "none known")],
)
def test_a_model_is_the_highest_rung_or_a_fit(name: str, against: str) -> None:
    found = formula_error_of(presets()[name], AT if presets()[name].spectral else None)
    assert (found.against, bool(found.rung)) == (against, against == "highest rung")
    assert found.p99 == (0.0 if against == "highest rung" else None)
    assert found.directions == 0


def test_no_rung_of_a_function_is_known() -> None:
    def flat(wi: Any, *_: Any) -> Any:
        return np.full(len(wi), 0.1)

    source = FunctionSource(brdf=flat, name="flat", title="Flat", provenance="made up")
    assert formula_error_of(source, None).against == "none known"


def test_half_vectors_of_ward_are_measured_against_his_ellipse() -> None:
    made = material("ward_half_vector", rho_d=0.1, rho_s=0.2, alpha_x=0.2, alpha_y=0.2)
    assert formula_error_of(made, None).rung == "elliptical Gaussian, eq. 5a"


@pytest.mark.parametrize(("name", "largest"), [("blue-plastic", 1.15), ("aluminum-cylinder-13b", 1.0)])
def test_the_largest_albedo_is_that_of_the_audit(name: str, largest: float) -> None:
    layout = plan(presets()[name], AT, 0.01)
    stated = largest_of(layout)
    audited = table_energy_of(read_back(tabulate(layout)), None)
    assert (audited.max_albedo, audited.max_at_theta_i_deg) == (pytest.approx(largest, abs=1e-6), 90.0)
    assert (stated.albedo, stated.theta_i_deg) == (pytest.approx(largest, abs=1e-4), 90.0)


def test_the_largest_albedo_is_that_of_the_model_at_each_tolerance() -> None:
    """Minnaert's law has the albedo rho cos^(k - 1): 1.0306 at 89.9 degrees, where tables stated 0.901 and 1.036."""
    made = material("minnaert", k=0.92, rho=0.62)
    stated = [largest_of(plan(made, None, tolerance)) for tolerance in (0.01, 0.05)]
    assert stated[0] == stated[1]
    assert stated[0].albedo == pytest.approx(0.62 * np.cos(np.deg2rad(89.9)) ** -0.08, abs=1e-3)
    assert (stated[0].theta_i_deg, stated[0].up_to_theta_i_deg, stated[0].of) == (89.9, 89.9, "source")
    assert stated[0].grazing.power == pytest.approx(0.08)
    assert stated[0].above_1


def test_the_largest_albedo_of_a_function_is_its_own_and_that_of_its_table_is_of_the_lookups() -> None:
    def rising(wi: Any, wr: Any, _: Any) -> Any:
        return (wi[:, 2] * wr[:, 2]) ** -0.08 * 0.62 * 1.92 / (2.0 * np.pi)

    source = FunctionSource(brdf=rising, name="m", title="M", provenance="made up", grazing_pole=True)
    table = table_of(plan(source, None, 0.05))
    stated = largest_albedo(table, source)
    assert stated.albedo == pytest.approx(1.0306, abs=1e-3)
    assert stated.grazing is not None
    assert (stated.of, stated.grazing.origin, stated.grazing.power) == ("source", "measured", 0.08)
    of_table = largest_albedo(table, None)
    assert of_table.grazing is not None
    assert (of_table.of, of_table.grazing.origin) == ("table", "measured")
    assert of_table.albedo == pytest.approx(table_energy_of(table, None).max_albedo, abs=1e-3)


def test_the_largest_albedo_has_the_specular_part() -> None:
    """Fresnel's reflectance is 1 at 90 degrees, and the uniform part of the plastic is 0.15."""
    plastic = presets()["blue-plastic"]
    largest = largest_of(Layout(plastic, coarsest(plastic), AT))
    assert (largest.theta_i_deg, largest.wavelength_nm) == (90.0, 460.0)
    assert largest.albedo == pytest.approx(1.15, abs=1e-3)
    assert largest.above_1


@pytest.mark.parametrize(("albedo", "above"), [(0.9, False), (1.0009, False), (1.0011, True), (None, True)])
def test_an_albedo_is_above_1_beyond_its_tolerance(albedo: float | None, above: bool) -> None:
    found = LargestAlbedo(albedo=albedo, theta_i_deg=0.0, wavelength_nm=None, tolerance=1e-3)
    assert found.above_1 is above


@pytest.mark.parametrize(
    ("theta_i", "theta_r", "turn", "f_r", "lobe", "why"),
    [
        (89.0, 88.0, 170.0, 1.0, True, "both directions are near the horizon, where f_r grows without bound"),
        (20.0, 87.0, 170.0, 1.0, True, "one direction is near the horizon, where f_r grows without bound"),
        (20.0, 30.0, 170.0, 1e-9, True, "f_r is less than the floor there, and errors are relative to the floor"),
        (20.0, 30.0, 170.0, 1.0, True, "the viewer is in the lobe, where f_r changes most"),
        (20.0, 25.0, 10.0, 1.0, False, "the viewer is beside the light, where f_r has a ridge"),
        (20.0, 60.0, 100.0, 1.0, False, "f_r is bent there"),
    ],
)
def test_the_largest_error_has_a_reason(
    theta_i: float, theta_r: float, turn: float, f_r: float, lobe: bool, why: str
) -> None:
    wi = unit_vector(np.deg2rad([10.0, theta_i]), 0.3)
    wr = unit_vector(np.deg2rad([10.0, theta_r]), 0.3 + np.deg2rad(turn))
    pairs = RandomPairs(wi, wr, np.zeros(2, int), np.ones(2), np.array([False, lobe]), np.ones(2, bool))
    truth = np.array([[1.0], [f_r]])
    found = worst_pair(np.array([[0.1], [0.5]]), truth, np.array([1e-4]), pairs, presets()["rolled-brass"], None)
    assert (found.theta_i_deg, found.theta_r_deg, found.delta_phi_deg) == (theta_i, theta_r, turn)
    assert found.why == why


def test_errors_of_rounding_need_no_other_reason() -> None:
    w = unit_vector(np.array([1.5]), 0.0)
    error = np.array([[1e-7]])
    pairs = RandomPairs(w, w, np.zeros(1, int), np.ones(1), np.array([False]), np.array([True]))
    found = worst_pair(error, error, np.array([1.0]), pairs, presets()["rolled-brass"], None)
    assert found.why == "it is rounding"
