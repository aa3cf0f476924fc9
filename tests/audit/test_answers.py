"""The two questions of an audit: the answers on a sound table, a spoilt one, and models that lose or create light."""

from __future__ import annotations

from typing import Any

import pytest

from brdfdb.audit.energy import Energy
from brdfdb.audit.finding import LEVELS, Finding, NotJudged
from brdfdb.audit.report import MaterialAudit, as_published, conserves_energy
from brdfdb.audit.table_error import TableError
from brdfdb.audit.validity import Validity
from tests.pipelines.a_report import material


@pytest.mark.parametrize(
    ("verdict", "text", "level"),
    [
        ("conserves", "yes", "good"),
        # The furnace of `a_report` is its albedo over its strength: 1 at the normal, 1 + (89/90)^3 / 5 at 89 degrees
        ("loses", "conserves energy up to a loss of 0 % at 0°", "calm"),
        ("gains", "conserves energy; would create 20 % if nothing were absorbed", "note"),
        ("known published excess", "no, as published: albedo 0.835 at 89°", "note"),
        ("accepted excess", "no, as accepted: albedo 0.835 at 89°", "note"),
        ("violates", "no: albedo 0.835 at 89°", "bad"),
    ],
)
def test_each_verdict_on_a_model_is_an_answer_of_its_own(verdict: Any, text: str, level: str) -> None:
    judged = material("paint", verdict)
    answer = conserves_energy(judged.findings)
    assert (answer.text, LEVELS[answer.word]) == (text, level)
    assert answer.reason == judged.of(Energy).reason


def with_energy(judged: MaterialAudit, **changes: Any) -> dict[str, Finding]:
    """The findings of an audit with other parts of its energy."""
    return judged.findings | {"energy": judged.of(Energy).model_copy(update=changes)}


@pytest.mark.parametrize(
    ("verdict", "text"),
    [
        ("conserves", "yes for lights up to 90°"),
        ("loses", "conserves energy for lights up to 90°; loses up to 0 % at 0°"),
        ("gains", "conserves energy for lights up to 90°; would create 20 % if nothing were absorbed"),
    ],
)
def test_the_answer_on_a_model_that_grows_beyond_the_last_light_says_where_it_ends(verdict: Any, text: str) -> None:
    judged = material("paint", verdict)
    model = judged.of(Energy).model
    grows = model.grazing.model_copy(update={"power": 0.5, "max_albedo": None})
    findings = with_energy(judged, model=model.model_copy(update={"grazing": grows}))
    assert conserves_energy(findings).text == text


def test_the_answer_names_the_wavelength_of_a_spectral_model() -> None:
    judged = material("oxide", "known published excess", 0.9, spectral=True)
    assert conserves_energy(judged.findings).text == "no, as published: albedo 1.07 at 89°, 700 nm"


def test_a_model_that_nothing_makes_lossless_answers_for_its_own_parameters() -> None:
    judged = material("foam")
    findings = with_energy(judged, model=judged.of(Energy).model.model_copy(update={"furnace": None}))
    assert conserves_energy(findings).text == "yes, no lossless form to judge"


@pytest.mark.parametrize("verdict", ["known published excess", "accepted excess", "violates"])
def test_a_published_excess_is_what_the_paper_says(verdict: Any) -> None:
    assert as_published(material("oxide", verdict).findings).text == "yes"  # the table is as its model


def test_a_table_that_exceeds_1_alone_is_not_what_the_paper_says() -> None:
    judged = material("paint")
    findings = with_energy(judged, table=judged.of(Energy).table.model_copy(update={"verdict": "violates"}))
    answer = as_published(findings)
    assert (answer.word, answer.text) == ("violates", "no: energy of the table")
    assert conserves_energy(findings).text == "yes"  # of the model


def test_every_finding_that_fails_is_named() -> None:
    findings = material("paint").findings
    bad = {key: findings[key].model_copy(update={"verdict": "violates"}) for key in ("values", "table_error")}
    assert as_published(findings | bad).text == "no: values, table error"


def test_without_a_source_neither_question_is_judged() -> None:
    findings = with_energy(material("paint"), model=None) | {TableError.key: NotJudged(reason="no source")}
    assert as_published(findings).text == conserves_energy(findings).text == "not judged"


@pytest.mark.parametrize(
    ("fresh", "stated", "verdict", "text"),
    [
        (0.016, 0.015, "passes", "1.6 % measured, 1.5 % stated, within chance"),
        (0.015, 0.016, "passes", "1.5 % measured, 1.6 % stated"),
        (0.01504, 0.015, "passes", "1.5 % measured, 1.5 % stated"),
        (0.5, 0.015, "violates", "50 % measured, 1.5 % stated"),
        (0.015, None, "passes", "1.5 % measured"),
        (None, 0.015, "violates", "not finite, 1.5 % stated"),
    ],
)
def test_a_measured_error_stands_beside_the_stated_one(fresh: Any, stated: Any, verdict: Any, text: str) -> None:
    changes = {"fresh_p99": fresh, "stated_p99": stated, "verdict": verdict}
    (cell,) = material("paint").of(TableError).model_copy(update=changes).cells()
    assert cell.text == text


@pytest.mark.parametrize(
    ("standings", "cell", "words"),
    [
        (("outside", "outside"), "2 of 2 limits not met", "2 limits that the paper states: 2 not met"),
        (("at the edge", "inside"), "1 of 2 limits at the edge", "limits that the paper states: 1 at the edge, 1 met"),
        (("unknown",), "", "1 limit that the paper states: 1 not known"),
        ((), "", "the paper states no limits"),
        (("inside", "inside"), "", "within both limits that the paper states"),
    ],
)
def test_limits_that_are_not_met_are_counted_as_such(standings: tuple[Any, ...], cell: str, words: str) -> None:
    validity = material("paint").of(Validity)
    limits = [validity.limits[0].model_copy(update={"standing": standing}) for standing in standings]
    changed = validity.model_copy(update={"limits": limits})
    assert changed.cells()[0].text == cell
    assert changed.sentences()[0].text.endswith(words)
