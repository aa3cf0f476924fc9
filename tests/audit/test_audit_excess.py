"""Albedos above 1 that are known as published or accepted, and the report of a store."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import version
from typing import Any

import jsonschema
import numba
import numpy as np
import pytest

from brdfdb.audit import FINDINGS, AuditReport, audit, report
from brdfdb.audit.energy import Energy
from brdfdb.audit.model_energy import cause_of
from brdfdb.audit.table_energy import table_energy_of
from brdfdb.audit.values import ValueCounts
from brdfdb.materials import presets
from brdfdb.materials.provenance import KnownExcess
from brdfdb.tables.albedo import directional_albedo
from tests.audit.a_table import (
    ABOUT,
    ANISOTROPIC,
    ISOTROPIC,
    SCHEMA,
    fine,
    known,
    lambert,
    material,
    node,
    tabulated,
    verdicts,
    written,
)
from tests.json_schema import validate

pytestmark = [
    pytest.mark.skipif(numba.config.DISABLE_JIT, reason="minutes without compilation"),
    pytest.mark.usefixtures("few_samples", "each_model_once"),
]


# What is known


@pytest.mark.parametrize(
    ("excess", "published"),
    [
        (known(1.06, 60.0), True),
        (known(1.06, 10.0), True),
        (known(1.04, 60.0), False),
        (known(1.06, 60.1), False),
        (None, False),
    ],
)
def test_an_excess_is_known_up_to_its_albedo_and_from_its_angle_on(excess: KnownExcess | None, published: bool) -> None:
    verdict = "known published excess" if published else "violates"
    reason = "reflects 1.05 of the incident light at 80 degrees" + (": Somebody 1991, p. 3" if published else "")
    table = lambert(0.5)
    mirror = np.array([0.1, 0.1, 0.1, 0.51, 0.55, 0.5], dtype=np.float32)
    found = table_energy_of(replace(table, specular=mirror), excess)
    assert (found.verdict, found.reason) == (verdict, reason)
    assert found.max_at_theta_i_deg == 80.0
    # 0.6 at 30 degrees, 1.01 at 60, and linear between them
    assert found.exceeds_1_from_theta_i_deg == pytest.approx(30.0 + 30.0 * 0.4 / 0.41, abs=0.002)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_no_excess_is_known_to_be_infinite(value: float) -> None:
    table = node(lambert(0.5), value)
    assert table_energy_of(table, known(1e300, 0.0)).verdict == "violates"


@pytest.mark.parametrize("accept", [False, True])
def test_an_excess_is_accepted_of_the_model_not_of_a_table_that_exceeds_1_where_it_does_not(accept: bool) -> None:
    table = tabulated(material("oren_nayar", {"rho": 0.98, "sigma_deg": 40}), fine(2.0))
    bright = table.brdf * np.float32(1.02 / np.max(directional_albedo(table).albedo))
    energy = audit(replace(table, values=bright), accept_excess=accept).of(Energy)
    assert energy.model.exceeds_1_from_theta_i_deg is None
    assert (energy.table.max_albedo, energy.table.verdict) == (pytest.approx(1.02, rel=1e-6), "violates")


def test_the_published_magnesium_oxide_is_a_known_excess() -> None:
    found = audit(tabulated(presets()["magnesium-oxide-ceramic"], fine(1.0), np.array([500.0])))
    assert verdicts(found) == {"energy": "known published excess"}
    assert found.verdict == "known published excess"
    cited = " of the incident light at 83 degrees and 500 nm: He et al. 1991, section 3.2.3"
    assert cited in found.of(Energy).table.reason
    assert found.of(Energy).table.exceeds_1_from_theta_i_deg == pytest.approx(54.0, abs=1.0)  # ERRATA


def test_oren_nayar_with_rho_1_violates_unless_it_is_accepted() -> None:
    table = tabulated(material("oren_nayar", {"rho": 1.0, "sigma_deg": 20}), fine(2.0))
    found = audit(table)
    assert (found.verdict, verdicts(found)) == ("violates", {"energy": "violates"})
    assert found.of(Energy).table.albedo[-2] == [pytest.approx(1.042, abs=0.002)]  # ERRATA of eqs 27 and 28, 89 degrees
    accepted = audit(table, accept_excess=True)
    assert (accepted.verdict, accepted.of(Energy).verdict) == ("accepted excess", "accepted excess")
    assert "this model does so by itself" in accepted.of(Energy).reason


@pytest.mark.parametrize(
    ("rho_d", "alpha", "limit", "general"), [(0.0, 1.0, False, True), (0.1, 1.0, True, True), (0.1, 0.1, True, False)]
)
def test_a_general_reason_follows_unless_only_energy_is_broken(
    rho_d: float, alpha: float, limit: bool, general: bool
) -> None:
    ward = {"rho_d": rho_d, "rho_s": 1.0, "alpha_x": alpha, "alpha_y": alpha}
    cause = cause_of(material("ward", ward), None)
    assert ("rho_d + rho_s is 1.1" in cause, "rougher lobes" in cause) == (limit, general)


def test_what_a_recipe_says_of_an_excess_is_repeated_and_excuses_nothing() -> None:
    ward = {"rho_d": 0.0, "rho_s": 1.0, "alpha_x": 1.0, "alpha_y": 0.001}
    claim = {"max_albedo": 2.0, "from_theta_i_deg": 0.0, "citation": "I say so"}
    table = tabulated(material("ward_half_vector", ward, known_excess=claim), ANISOTROPIC)
    found = audit(table)
    assert (found.verdict, found.of(Energy).verdict) == ("violates", "violates")
    assert found.of(Energy).reason.endswith("; its recipe excuses it, which is not accepted: I say so")


def test_what_is_accepted_excuses_nothing_but_the_energy_of_the_model() -> None:
    table = node(tabulated(material("oren_nayar", {"rho": 1.0, "sigma_deg": 20}), fine(5.0)), -1.0)
    found = audit(table, accept_excess=True)
    assert (found.verdict, found.of(Energy).model.verdict) == ("violates", "accepted excess")
    assert found.of(ValueCounts).positivity == "violates"


def test_oren_nayar_with_rho_1_conserves_energy_on_a_rough_surface() -> None:
    found = audit(tabulated(material("oren_nayar", {"rho": 1.0, "sigma_deg": 40}), fine(2.0)))
    assert found.verdict == "passes"


# The report


def test_the_report_names_the_violations_and_nothing_else() -> None:
    good, bad = lambert(0.5), node(lambert(0.5), -1.0)
    excused = tabulated(presets()["blue-plastic"], ISOTROPIC, np.array([460.0]))
    named = {"good": good, "bad": bad, "excused": excused}
    audits = [audit(table).model_copy(update={"material": name}) for name, table in named.items()]
    document = written(audits)
    assert (document["format"], document["version"], document["violations"]) == ("brdfdb-audit", 8, ["bad"])
    assert [entry["verdict"] for entry in document["materials"]] == ["passes", "violates", "known published excess"]
    answers = [[entry[key]["text"] for key in ("as_published", "conserves_energy")] for entry in document["materials"]]
    assert answers[0] == ["yes", "yes"]
    assert answers[1][0].startswith("no: ")
    assert answers[2] == ["yes", "no, as published: albedo 1.15 at 90°, 460 nm"]
    assert AuditReport.model_validate(document) == report(audits, **ABOUT)


def test_an_empty_report_is_a_report() -> None:
    about = {"store": "a store", "brdfdb": version("brdfdb"), "when": "2026-11-21T00:00:00Z"}
    empty: dict[str, list[Any]] = {"materials": [], "atlas": [], "gallery": [], "damaged": [], "violations": []}
    empty |= {"not_judged": [], "families": []}
    former = {"program": "", "taken_over": [], "page_subjects": [], "page_sha256": ""}  # of no use again
    document = written([])
    sealed = document["sha256"]
    assert [each["key"] for each in document.pop("explanations")] == list(FINDINGS)
    assert document == {"format": "brdfdb-audit", "version": 8, **about, **empty, **former, "sha256": sealed}


@pytest.mark.parametrize(
    "spoil",
    [
        lambda document: document.pop("violations"),
        lambda document: document.update(comment="fine"),
        lambda document: document["materials"][0].update(verdict="fine"),
        lambda document: document["materials"][0]["findings"]["energy"]["table"].update(max_albedo="1.0"),
        lambda document: document["materials"][0]["findings"]["values"].pop("count"),
    ],
)
def test_the_schema_refuses_what_is_no_report(spoil: Callable[[dict[str, Any]], Any]) -> None:
    document = written([audit(lambert(0.5))])
    spoil(document)
    with pytest.raises(jsonschema.ValidationError):
        validate(document, SCHEMA)
