"""A finding that is added to the registry appears in terminal, page, JSON and explorer without any other change."""

from __future__ import annotations

import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from brdfdb.audit import FINDINGS, AuditReport
from brdfdb.audit.finding import Cell, Finding, Sentence, Subject, Verdict
from tests.api.a_store import client_of
from tests.pipelines.a_lambert import publish_lambert
from tests.pipelines.command import Captured, run


class Brightness(Finding):
    """The largest value of a table."""

    key, title, columns = "brightness", "Brightness", ("brightest",)
    explanation = "A surface that shines by more than 0.2 per steradian dazzles."

    largest: float
    verdict: Verdict

    @classmethod
    def judge(cls, subject: Subject) -> Finding:
        largest = float(np.max(subject.table.brdf))
        return cls(largest=largest, verdict="violates" if largest > 0.2 else "passes")

    def sentences(self) -> list[Sentence]:
        return [self.sentence(self.verdict, f"shines by {self.largest:.3f} 1/sr")]

    def cells(self) -> list[Cell]:
        return [Cell(self.verdict, f"{self.largest:.3f}", self.largest)]


def test_a_finding_of_twenty_lines_is_seen_everywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.setitem(FINDINGS, Brightness.key, Brightness)
    monkeypatch.setattr("brdfdb.audit.sampling.SAMPLES", 2000)
    for name, rho in (("grey", 0.5), ("white", 1.0)):
        publish_lambert(tmp_path, name, rho)
    assert run("audit", "--no-figures", "--store", tmp_path) == 1

    terminal = capsys.readouterr().out
    assert "brightest" in terminal.splitlines()[1]
    assert "white: shines by 0.318 1/sr\n" in terminal
    assert "grey: " not in terminal

    page = (tmp_path / "audit.html").read_text(encoding="utf-8")
    assert ">brightest</button>" in page
    assert "<b>Brightness: violates.</b> Shines by 0.318 1/sr." in page
    assert "<dd>A surface that shines by more than 0.2 per steradian dazzles.</dd>" in page

    document = json.loads((tmp_path / "audit.json").read_text(encoding="utf-8"))
    jsonschema.validate(document, AuditReport.model_json_schema())
    assert AuditReport.model_validate(document).model_dump(mode="json") == document
    assert document["violations"] == ["white"]
    assert document["materials"][1]["findings"]["brightness"] == {
        "verdict": "violates",
        "largest": pytest.approx(0.318, abs=1e-3),
    }

    audit = client_of(tmp_path).get("/v1/materials/white").json()["audit"]
    shown = [sentence for sentence in audit["sentences"] if sentence["finding"] == "brightness"]
    assert [(each["title"], each["word"], each["text"]) for each in shown] == [
        ("Brightness", "violates", "shines by 0.318 1/sr")
    ]
