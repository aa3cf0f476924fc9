"""A line of a list in words: of new pointers, of those of older programs, and of audits old and new."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest

from brdfdb.errors import StoreError, percent
from brdfdb.store.reader import Store
from brdfdb.store.records import Summary, fields_of, record_of
from brdfdb.store.summary_words import Audited, colours, energy, formula_error, last_audit

ANSWERS = ("as_published", "conserves_energy")
ALBEDO = {"albedo": 1.37, "theta_i_deg": 80.0, "wavelength_nm": 550.0, "tolerance": 1e-3}


@pytest.mark.parametrize(
    ("at", "text"), [(None, ""), ([], "grey"), ([500.0, 500.0], "500 nm"), ([380.0, 780.0], "380-780 nm")]
)
def test_a_grey_material_says_so(at: Any, text: str) -> None:
    assert colours({} if at is None else {"wavelength_range_nm": at}) == text


@pytest.mark.parametrize(
    ("stated", "text"),
    [
        (None, "not measured"),
        ({"against": "measured", "rung": "facets", "p99": 0.119}, "12 %"),
        ({"against": "highest rung", "rung": "the sum", "p99": 0.0}, "0, exact form"),
        ({"against": "none known", "rung": "", "p99": None}, "no exact form"),
    ],
)
def test_the_formula_stands_apart_from_the_table(stated: Any, text: str) -> None:
    assert formula_error({"error_p99": 0.0077, "formula_error": stated}, percent) == text
    assert formula_error({"error_p99": 0.0077}, percent) == "not measured"


def test_an_albedo_above_1_is_told_before_any_audit_and_by_the_audit_after_it() -> None:
    head = {"largest_albedo": ALBEDO}
    assert energy(head, None) == "not audited: albedo of the table 1.37 at 80°, 550 nm"
    answer = "no, as published: albedo 1.37 at 80°, 550 nm"
    assert energy(head, Audited("yes", answer)) == answer
    for quiet in ({}, {"largest_albedo": None}, {"largest_albedo": {**ALBEDO, "albedo": 1.0005}}):
        assert energy(quiet, None) == "not audited"
    assert energy({"largest_albedo": {**ALBEDO, "albedo": None, "wavelength_nm": None}}, None).endswith(
        "albedo of the table not finite at 80°"
    )
    below = ALBEDO | {"albedo": 0.4, "of": "source", "grazing": {"passes_1_at_theta_i_deg": 89.99647}}
    assert energy({"largest_albedo": below}, None) == "not audited: albedo of the model exceeds 1 above 89.9965°"
    above = ALBEDO | {"of": "source"}
    assert energy({"largest_albedo": above}, None) == "not audited: albedo of the model 1.37 at 80°, 550 nm"


def audited(path: Path, **answers: str) -> None:
    """Write an audit of the first revisions of materials, each with an answer."""
    materials = [
        {"material": name, "revision": "r1", "verdict": "x", **{key: {"text": text} for key in ANSWERS}}
        for name, text in answers.items()
    ]
    path.write_text(json.dumps({"materials": materials}), encoding="utf-8")


def test_the_audit_of_an_older_program_has_one_verdict(tmp_path: Path) -> None:
    old = {"material": "old", "revision": "r1", "verdict": "passes"}
    (tmp_path / "audit.json").write_text(json.dumps({"materials": [old]}), encoding="utf-8")
    assert last_audit(tmp_path) == {("old", "r1"): Audited("passes", "")}
    for broken in ("", "[]", '{"materials": [1]}', '{"materials": [{"as_published": 1}]}'):
        (tmp_path / "audit.json").write_text(broken, encoding="utf-8")
        assert last_audit(tmp_path) == {}


def test_a_pointer_of_an_older_program_is_read_and_a_wrong_one_is_not(root: Path) -> None:
    head = dict(Store(root).summary("white"))
    assert (head["wavelength_range_nm"], head["formula_error"]) == ([], None)  # published without a measurement
    older = {field.name: head[field.name] for field in fields_of(Summary) if field.required}
    assert record_of(older, Summary, "white", "HEAD.json") == older
    wrong = older | {"formula_error": 0.1}
    with pytest.raises(StoreError, match=r"HEAD\.json has no valid 'formula_error'"):
        record_of(wrong, Summary, "white", "HEAD.json")


def test_errors_at_the_samples_are_plain_numbers(tmp_path: Path) -> None:
    finding = {"held_out_p95": 1.13, "worst": {"error": 0.0312}, "glints": [{}]}
    entry = {"material": "a", "revision": "r1", "verdict": "x", **{key: {"text": "yes"} for key in ANSWERS}}
    document = {"materials": [{**entry, "findings": {"glints": finding}}]}
    (tmp_path / "audit.json").write_text(json.dumps(document), encoding="utf-8")
    assert last_audit(tmp_path)["a", "r1"].samples == "held out (p95) 113 %, worst sample 3.1 %, 1 glint"


def test_the_newer_of_two_audits_answers_for_the_materials_in_both(tmp_path: Path) -> None:
    part = tmp_path / "audit-part.json"
    audited(tmp_path / "audit.json", a="old", b="old")
    audited(part, b="new", c="new")
    os.utime(tmp_path / "audit.json", (1.0, 1.0))
    answers = last_audit(tmp_path)
    assert [answers[name, "r1"] for name in "abc"] == [Audited(text, text) for text in ("old", "new", "new")]
    os.utime(part, (0.0, 0.0))
    assert last_audit(tmp_path)["b", "r1"].as_published == "old"
    part.write_text("{", encoding="utf-8")
    assert set(last_audit(tmp_path)) == {("a", "r1"), ("b", "r1")}
