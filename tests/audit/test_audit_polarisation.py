"""Polarised tables under audit: sound ones pass; elements that no surface has, or that the model has not, do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import brdfdb
from brdfdb import models
from brdfdb.audit.finding import Subject
from brdfdb.audit.polarisation import PolarisationFinding
from brdfdb.measurements.mueller import coherency_eigenvalues
from brdfdb.store.publication import publish_layout
from brdfdb.tables.table import Table
from tests.tables.test_polarisation import directions, polarised, rough


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Table:
    root = tmp_path_factory.mktemp("audited")
    publish_layout(root, "made-up", polarised(rough(), 0.05))
    return brdfdb.open(root)["made-up"]


def judged(table: Table) -> PolarisationFinding:
    return PolarisationFinding.judge(Subject(table, table.source))


def scaled(table: Table, factor: float) -> Table:
    elements = (factor * table.facets.elements).astype(np.float32)
    return replace(table, facets=replace(table.facets, elements=elements))


def test_a_sound_table_passes_within_its_stated_error(table: Table) -> None:
    finding = judged(table)
    assert finding.verdict == "passes"
    assert finding.error_p99 <= 0.05
    assert -finding.eigenvalue_tolerance <= finding.smallest_eigenvalue <= 0.0
    assert "smallest eigenvalue" in finding.sentences()[0].text
    assert finding.tables()[0].rows


def test_elements_above_those_of_any_surface_are_not_realisable(table: Table) -> None:
    finding = judged(scaled(table, 1.2))
    assert finding.verdict == "violates"
    assert finding.smallest_eigenvalue == pytest.approx(-0.1, abs=0.01)  # (1 - 1.2) / 2 where hardly any is depolarised
    assert "not physically realisable" in finding.sentences()[0].text


def test_elements_of_another_surface_are_off_by_more_than_is_stated(table: Table) -> None:
    finding = judged(scaled(table, 0.8))  # realisable, and depolarised by a fifth
    assert finding.smallest_eigenvalue >= -1e-6
    assert finding.verdict == "violates"


def test_eigenvalues_are_those_of_known_matrices() -> None:
    ideal, mirror = np.zeros((4, 4)), np.diag([1.0, 1.0, -1.0, -1.0])
    ideal[0, 0] = 1.0
    transposed = np.diag([1.0, 1.0, 1.0, -1.0])  # of the coherency matrix of full light: an eigenvalue of -1/2
    found = coherency_eigenvalues(np.stack([ideal, mirror, transposed]))
    assert found == pytest.approx(np.array([[0.25] * 4, [0, 0, 0, 1], [-0.5, 0.5, 0.5, 0.5]]), abs=1e-15)


def test_matrices_of_the_model_are_realisable_to_rounding() -> None:
    wi, wr = directions(500)
    mueller = models.he_torrance_mueller_vectors(wi, wr, **rough(a=0.0).arguments(500.0))
    assert coherency_eigenvalues(mueller).min() >= -1e-14  # measured -6e-16


def test_an_unpolarised_table_has_nothing_to_judge(table: Table) -> None:
    finding = judged(replace(table, facets=None))
    assert (finding.verdict, finding.lookups, finding.tables()) == ("passes", 0, [])
    assert [sentence.text for sentence in finding.sentences()] == ["the table is unpolarised"]
