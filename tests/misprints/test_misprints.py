"""The list of misprints: keys, texts, forms that differ, and a test for each figure."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import numpy as np

import brdfdb
from brdfdb import misprints
from brdfdb.misprints import MISPRINTS
from tests.misprints.an_entry import BY_KEY


def test_entries_are_in_order_differ_visibly_and_say_something_in_one_line() -> None:
    assert len(BY_KEY) == len(MISPRINTS) >= 20
    papers = [misprint.paper for misprint in MISPRINTS]
    assert papers == sorted(papers, key=[misprints.ORENNAYAR, misprints.HE, misprints.WARD].index)
    bibliography = (Path(__file__).parents[2] / "references.bib").read_text(encoding="utf-8")
    for entry in MISPRINTS:
        assert f"{{{entry.paper}," in bibliography
        for text in (entry.key, entry.paper, entry.equation, entry.printed, entry.right, entry.consequence):
            assert text == text.strip() != "", entry.key
            assert "\n" not in text, entry.key
        assert re.search(r"\d", entry.consequence), entry.key
        printed, right = (np.asarray(form(**entry.where)) for form in (entry.as_printed, entry.corrected))
        assert printed.shape == right.shape, entry.key
        assert np.isfinite(right).all(), entry.key
        assert not np.allclose(printed, right, rtol=0.05, atol=1e-4), entry.key


def test_every_misprint_is_tested_for_its_figure() -> None:
    files = Path(__file__).parent.glob("test_*.py")
    names = {name for path in files for name in re.findall(r"^def (test_\w+)", path.read_text(encoding="utf-8"), re.M)}
    assert {f"test_{key.replace('-', '_')}" for key in BY_KEY} <= names


def test_the_printed_forms_are_imported_only_where_they_are_set_against_the_right_ones() -> None:
    root = Path(brdfdb.__file__).parent
    for path in sorted(root.rglob("*.py")):
        if path.parent in (root / "atlas", root / "misprints"):
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            imported = [alias.name for alias in node.names] if isinstance(node, ast.Import | ast.ImportFrom) else []
            imported += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not any("misprints" in name.split(".") for name in imported), path
