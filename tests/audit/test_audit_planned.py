"""Audits of planned tables: their stated error excuses what it explains and nothing else, on each kind of grid."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numba
import numpy as np
import pytest

from brdfdb.audit import MaterialAudit, audit
from brdfdb.audit.energy import Energy
from brdfdb.audit.reciprocity import LOOKUP_RECIPROCITY_TOLERANCE, Reciprocity
from brdfdb.audit.table_energy import _band_means, table_energy_of
from brdfdb.audit.values import ValueCounts
from brdfdb.materials.provenance import KnownExcess
from brdfdb.tables.layout import Interpolation, Layout
from brdfdb.tables.table import Table
from brdfdb.tables.tabulation import tabulate
from tests.audit.a_table import ISOTROPIC, known, material, verdicts, written
from tests.tables.test_albedo import KINDS, PLANNED, planned, table_of

pytestmark = [
    pytest.mark.skipif(numba.config.DISABLE_JIT, reason="minutes without compilation"),
    pytest.mark.usefixtures("few_samples", "each_model_once", "coarse_model_energy"),
]
# An audit of the anisotropic polar table takes seconds: its half and difference vectors stand for it
FOUND_ANYWHERE = pytest.mark.parametrize("kind", [kind for kind in PLANNED if kind != "polar-anisotropic"])


def scaled(table: Table, factor: float) -> Table:
    """The table with all of f_r times a factor."""
    how = table.interpolation
    if not how.logarithm:
        values = table.values * np.float32(factor)
    elif table.spectra is None:
        values = table.values + np.float32(np.log(factor))
    else:  # rows are orthonormal: what they make of the logarithm of the factor, the same at each wavelength
        values = table.values + (np.log(factor) * table.spectra.sum(axis=1)).astype(np.float32)
    uniform = None if table.uniform is None else table.uniform * factor
    return replace(table, values=values, uniform=uniform, interpolation=replace(how, offset=how.offset * factor))


@cache
def audited(kind: str) -> MaterialAudit:
    """Return the audit of a planned table as it is."""
    return audit(table_of(kind))


@KINDS
def test_planned_tables_pass_and_their_reports_are_valid(kind: str) -> None:
    table, found = table_of(kind), audited(kind)
    bands = found.of(Energy).table.bands
    assert (found.verdict, verdicts(found), found.of(Energy).table.reason) == ("passes", {}, "")
    assert bands.stated_error == table.attrs["error"]["l1"]
    assert np.max(bands.excess) == 0.0
    assert np.min(bands.explained) > 0.0
    assert found.of(ValueCounts).looked_up > 1000
    assert found.of(ValueCounts).count >= table.values.size
    written([found])


@FOUND_ANYWHERE
def test_half_as_much_light_again_violates(kind: str) -> None:
    found = audit(scaled(table_of(kind), 1.5 / audited(kind).of(Energy).table.max_albedo))
    energy = found.of(Energy).table
    assert (found.verdict, energy.verdict) == ("violates", "violates")
    assert energy.max_albedo == pytest.approx(1.5, rel=0.02)
    assert "more than the error that the table states explains" in energy.reason
    assert energy.exceeds_1_beyond_error_from_theta_i_deg == energy.exceeds_1_from_theta_i_deg


@FOUND_ANYWHERE
def test_one_node_of_nan_violates_and_the_report_is_json(kind: str) -> None:
    table = table_of(kind)
    values = table.values.copy()
    values[(1,) * values.ndim if table.spectra is None else (1,) * (values.ndim - 1)] = np.nan
    found = audit(replace(table, values=values))
    assert (found.verdict, found.of(ValueCounts).finiteness) == ("violates", "violates")
    assert found.of(ValueCounts).not_finite > 0
    written([found])


@pytest.mark.parametrize(("kind", "name"), [("polar-parts", "spectra"), ("half-difference", "uniform")])
def test_what_is_stored_with_the_values_is_audited(kind: str, name: str) -> None:
    table = table_of(kind)
    broken = getattr(table, name).copy()
    broken.flat[0] = np.nan
    assert audit(replace(table, **{name: broken})).of(ValueCounts).finiteness == "violates"


def test_a_negative_uniform_part_violates() -> None:
    table = table_of("half-difference")
    found = audit(replace(table, uniform=-table.uniform)).of(ValueCounts)
    assert found.positivity == "violates"
    assert found.smallest < 0.0


def test_a_negative_node_violates_even_if_lookups_stop_at_0() -> None:
    cubic = Layout(material("lambert", {"rho": 0.5}), ISOTROPIC, interpolation=Interpolation("cubic"))
    dataset = tabulate(cubic)
    values = dataset["brdf"].values
    values[2, 3, 1] = values[3, 2, 1] = -1e-3
    found = audit(replace(Table.of(cubic, values), attrs=dataset.attrs)).of(ValueCounts)
    assert (found.positivity, found.negative, found.smallest) == ("violates", 2, np.float32(-1e-3))


@pytest.mark.parametrize("kind", ["polar", "polar-parts"])
def test_one_node_that_is_not_reciprocal_violates(kind: str) -> None:
    table = table_of(kind)
    values = table.values.copy()
    values[2, 5, 1] *= np.float32(1.0 + 1e-4)
    found = audit(replace(table, values=values))
    assert verdicts(found)["reciprocity"] == "violates"
    assert found.of(Reciprocity).table_nodes.max > 1e-5


@pytest.mark.parametrize("kind", ["half-difference", "half-difference-anisotropic"])
def test_half_and_difference_vectors_are_reciprocal_whatever_they_hold(kind: str) -> None:
    table = table_of(kind)
    noise = np.random.default_rng(5).uniform(0.9, 1.1, table.values.shape).astype(np.float32)
    found = audit(replace(table, values=table.values * noise))
    reciprocity = found.of(Reciprocity)
    assert reciprocity.table_nodes is None
    for each in (reciprocity.table_random, reciprocity.table_lobe):
        assert each.pairs > 1000
        assert each.max <= LOOKUP_RECIPROCITY_TOLERANCE == each.tolerance


# A surface that reflects all light, whose table therefore exceeds 1 wherever it errs on the bright side
IDEAL: dict[str, Any] = {"rho": 1.0, "roughness": 0.5}


@pytest.fixture(scope="module")
def ideal() -> Table:
    return planned("oren_nayar_energy_preserving", IDEAL)


def test_an_ideal_material_may_exceed_1_by_what_its_error_explains(ideal: Table) -> None:
    found = audit(ideal)
    energy = found.of(Energy).table
    assert energy.max_albedo > 1.001
    assert energy.exceeds_1_from_theta_i_deg is not None
    assert energy.exceeds_1_beyond_error_from_theta_i_deg is None
    assert (found.verdict, energy.verdict) == ("passes", "passes")
    assert energy.reason.endswith("degrees, within the error that the table states")
    assert 0.0 < np.max(energy.bands.excess) <= np.max(energy.bands.explained)


def test_the_same_table_without_a_stated_error_violates(ideal: Table) -> None:
    attrs = {key: value for key, value in ideal.attrs.items() if key != "error"}
    found = audit(replace(ideal, attrs=attrs))
    energy = found.of(Energy).table
    assert (found.verdict, energy.verdict, energy.bands) == ("violates", "violates", None)


def test_the_error_excuses_no_more_than_itself(ideal: Table) -> None:
    factor = 1.0 + 1.1 * np.max(ideal.error.l1)
    assert audit(scaled(ideal, factor)).of(Energy).table.verdict == "violates"


def test_a_stated_error_that_nobody_can_ask_for_is_no_excuse(ideal: Table) -> None:
    boast = {**ideal.attrs["error"], "l1": [[1e9] for _ in ideal.attrs["error"]["l1"]]}
    found = audit(replace(scaled(ideal, 3.0), attrs={**ideal.attrs, "error": boast}))
    assert found.of(Energy).table.verdict == "violates"


@pytest.mark.parametrize(
    ("excess", "verdict"),
    [(known(1.2, 0.0), "known published excess"), (known(1.05, 0.0), "violates"), (known(1.2, 60.0), "violates")],
)
def test_what_is_known_is_compared_as_1_is(ideal: Table, excess: KnownExcess, verdict: str) -> None:
    assert table_energy_of(scaled(ideal, 1.1), excess).verdict == verdict


def test_means_over_bands_are_those_of_what_is_linear_between_lights() -> None:
    lights, edges = np.array([0.0, 5.0, 10.0, 15.0, 20.0]), np.array([0.0, 10.0, 20.0])
    means = _band_means(lights, edges)
    np.testing.assert_allclose(means.sum(axis=1), 1.0, rtol=1e-12)
    np.testing.assert_allclose(means @ lights, [5.0, 15.0], rtol=1e-12)
    np.testing.assert_allclose(_band_means(lights[:3], edges) @ lights[:3], [5.0, 10.0], rtol=1e-12)


def test_a_limit_that_is_not_met_is_the_reason_of_an_excess_and_the_table_follows_its_model() -> None:
    found = audit(planned("ward", {"rho_d": 0.6, "rho_s": 0.45, "alpha_x": 0.1, "alpha_y": 0.1}))
    energy = found.of(Energy)
    assert found.verdict == energy.model.verdict == energy.table.verdict == "violates"
    limit = "(a limit is not met: rho_d + rho_s is 1.05, valid below 1, at the edge 1; Ward 1992, section 4.2)"
    assert energy.model.reason.endswith(limit)
    assert energy.table.reason.endswith(
        "at 0 degrees: the model itself reflects more than arrives, and the table follows it"
    )
    assert (found.as_published.text, found.conserves_energy.word) == ("yes", "violates")
