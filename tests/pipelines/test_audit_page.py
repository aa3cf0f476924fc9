"""The page of an audit: it is complete and well formed, and fetches nothing."""

from __future__ import annotations

import re
from collections import Counter

import numpy as np
import pytest

from brdfdb.audit.energy import Energy, furnace_cell
from brdfdb.audit.finding import LEVELS
from brdfdb.audit.report import Answer, AuditReport
from brdfdb.audit.table_error import TableError
from brdfdb.figure import number
from brdfdb_pipelines import audit_page, figure_look
from tests.pipelines.a_page import Document
from tests.pipelines.a_report import ODD, material, report_of, whole


@pytest.fixture(scope="module")
def report() -> AuditReport:
    return whole()


@pytest.fixture(scope="module")
def html(report: AuditReport) -> str:
    return audit_page.render(report)


@pytest.fixture(scope="module")
def document(html: str) -> Document:
    return Document(html)


def test_every_tag_is_closed_where_it_should_be(document: Document) -> None:
    assert document.unbalanced == []
    assert len(document.elements) > 1000


def test_a_tag_left_open_would_be_noticed() -> None:
    assert Document("<p><b>bold</p>").unbalanced == ["p", "p", "b"]


def test_ids_are_unique_and_every_link_has_its_target(document: Document) -> None:
    ids = Counter(document.attributes("id"))
    assert [name for name, count in ids.items() if count > 1] == []
    local = [link[1:] for link in document.attributes("href") if link.startswith("#")]
    local += [found for path in document.attributes("clip-path") for found in re.findall(r"url\(#(.+)\)", path)]
    local += document.attributes("aria-controls")
    assert len(local) > 30  # a plot refers to its clip once, a page to each of its sections
    assert set(local) <= set(ids)


def test_nothing_is_fetched_from_anywhere(document: Document) -> None:
    fetched = [value for name in ("src", "href", "srcset", "data", "action") for value in document.attributes(name)]
    assert {value[:5] for value in fetched if not value.startswith("#")} == {"data:"}
    styles = " ".join(text for tag, text in document.text if tag == "style")
    assert "url(" not in styles
    assert "@import" not in styles
    (policy,) = [value for value in document.attributes("content") if "default-src" in value]
    assert policy.startswith("default-src 'none'; ")


def test_every_material_figure_and_statement_is_there(document: Document, report: AuditReport) -> None:
    words = document.words()
    for each in report.materials:
        assert words.count(each.material) >= 2  # in the table, and on top of its section
        assert audit_page.anchor(each.material) in document.attributes("id")
    for each in (*report.atlas, *report.gallery):
        assert each.title in words
        assert each.caption in words
        for statement in each.statements:
            assert statement.says in words
            assert statement.seen in words
            assert statement.threshold_from is None or f"Threshold from {statement.threshold_from}." in words
    drawings = sum(len(each.panels) for each in (*report.atlas, *report.gallery))
    drawings += sum(len(each.of(TableError).maps) for each in report.materials)
    drawings += 4 * 2 + 5  # grey: model and table, furnace; spectral: the model alone, uniform light, the bound, too
    assert document.count("svg") == drawings
    found = [each.holds for figure in (*report.atlas, *report.gallery) for each in figure.statements]
    assert words.count("Does not hold:") == found.count(False) > 0
    assert words.count("Holds:") == found.count(True) > 0


def test_reasons_are_sentences_and_said_once(document: Document) -> None:
    words = document.words()
    assert words.count("Reflects up to 0.4774 at 89 degrees.") == 1  # of model and table alike
    for sentence in (
        "Energy of the table: passes. As the model; in uniform light the model reflects 0.7, the table",
        "Reciprocity: passes. Asymmetry up to 3·10⁻¹³, of 1·10⁻¹¹ allowed.",
        "Table error: passes. 99 of 100 fresh values are within 0.91 %, on average off by −0.2 % of the",
        "Alpha: at the edge. 0.2 (at most 0.2). up to about 0.2 section 4",
    ):
        assert sentence in words


def test_the_two_questions_have_answers_on_every_material(document: Document, report: AuditReport) -> None:
    words = document.words()
    for question in audit_page.QUESTIONS:
        assert words.count(question.capitalize()) == 1 + len(report.materials)  # in the words, and in each section
    for text in (
        "conserves energy up to a loss of 0 % at 0°",
        "no, as published: albedo 1.07 at 89°, 700 nm",
        "no: albedo 1.55 at 89°",
    ):
        assert text in words


def test_one_material_violates_and_a_remark_on_a_model_that_passes_is_said() -> None:
    good = material("good", "gains")
    bad = material("bad", "violates")
    words = Document(audit_page.render(report_of([good, bad], ["bad"]))).words()
    assert "1 of 2 violates a law of energy, or what another finding demands, and" in words
    assert " 1 passes with a remark on the model: it would create light" in words
    assert audit_page.remarked(report_of([good, bad], ["bad"])) == 1
    assert audit_page.remarked(report_of([bad], ["bad"])) == 0


def test_an_albedo_that_may_be_above_1_is_not_counted_as_one_that_conserves_energy() -> None:
    good = material("good", "conserves")
    unclear = Answer(word="not judged", text="cannot be judged", reason="1 is within the error of the table")
    found = report_of([good.model_copy(update={"conserves_energy": unclear})], [])
    page = audit_page.render(found)
    assert "<dt>conserves</dt><dd>0</dd>" in page
    assert "<dt>not judged</dt><dd>1</dd>" in page


def test_violations_come_first_then_known_excess_then_losses(html: str) -> None:
    rows = re.findall(r'<th scope="row"><a href="#([^"]+)">', html)
    assert rows == [audit_page.anchor(name) for name in (ODD, "gold", "oxide", "paint", "brass")]


def test_names_with_markup_in_them_stay_names(html: str, document: Document) -> None:
    assert ODD not in html
    assert ODD in document.words()


def test_anchors_of_different_names_differ() -> None:
    names = ["a b", "a_b", "a-b", "a_20_b", "ä", "a.b", "a/b"]
    anchors = [audit_page.anchor(name) for name in names]
    assert len(set(anchors)) == len(names)
    assert all(re.fullmatch(r"m-[A-Za-z0-9_-]+", anchor) for anchor in anchors)


def test_the_dark_page_has_a_colour_for_every_variable(html: str) -> None:
    dark = html[html.index("prefers-color-scheme: dark") :]
    dark = dark[: dark.index("}")]
    for variable in {*figure_look.VARIABLES.values(), *re.findall(r"var\((--[a-z0-9-]+)\)", html)}:
        if variable not in ("--text", "--display", "--tone", "--back"):
            assert f"{variable}: #" in dark, variable


def test_numbers_are_those_that_people_write() -> None:
    values = [0.0, 0.01234, -2.0, 3e-13, 1.26e5, None, 1.0, np.inf]
    assert [number(value) for value in values] == ["0", "0.0123", "−2", "3·10⁻¹³", "1.3·10⁵", "–", "1", "not finite"]


@pytest.mark.parametrize(("of", "column"), [("model", 2), ("table", 3)])
def test_an_albedo_that_is_not_finite_sorts_after_all_others(of: str, column: int) -> None:
    good = material("good", "violates", 3.0)
    energy = good.of(Energy)
    not_finite = getattr(energy, of).model_copy(update={"max_albedo": None})
    findings = good.findings | {"energy": energy.model_copy(update={of: not_finite})}
    bad = good.model_copy(update={"material": "bad", "findings": findings})
    found = report_of([good, bad], ["good", "bad"])
    html = audit_page.render(found)
    cells = [float(value) for value in Document(html).attributes("data-sort")]
    columns = np.array(cells).reshape(2, -1)  # rows: bad, good
    assert np.all(np.isfinite(columns))
    assert columns[0, column] > columns[1, column]
    assert "not finite at 89°" in html


@pytest.mark.parametrize(
    ("shown", "word"), [([1.0], "conserves"), ([1.005, 0.98], "loses"), ([1.25], "gains"), ([0.99, 1.02], "gains")]
)
def test_a_furnace_conserves_neither_where_it_loses_light_nor_where_it_makes_it_up(
    shown: list[float], word: str
) -> None:
    model = material("paint").of(Energy).model
    assert model is not None
    assert model.furnace is not None
    cell = furnace_cell(model.furnace.model_copy(update={"hemispherical": shown}))
    assert (cell.word, LEVELS[cell.word]) == (word, {"conserves": "good", "loses": "calm", "gains": "note"}[word])


def test_a_report_of_nothing_is_a_page(document: Document) -> None:
    empty = Document(audit_page.render(report_of([], [])))
    assert empty.unbalanced == []
    assert "atlas" in document.attributes("id")
    assert "atlas" not in empty.attributes("id")
