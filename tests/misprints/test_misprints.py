"""The list of misprints: keys, texts, forms that differ, and a test for each figure."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import numpy as np
import pytest

import brdfdb
from brdfdb import misprints
from brdfdb.misprints import MISPRINTS, Misprint
from tests.misprints.an_entry import BY_KEY

FIELDS = ("key", "paper", "equation", "printed", "right", "consequence")


def test_keys_are_unique_and_papers_in_order() -> None:
    assert len(BY_KEY) == len(MISPRINTS) >= 20
    papers = [misprint.paper for misprint in MISPRINTS]
    assert papers == sorted(papers, key=[misprints.ORENNAYAR, misprints.HE, misprints.WARD].index)


@pytest.mark.parametrize("misprint", MISPRINTS, ids=lambda misprint: misprint.key)
def test_every_text_is_one_line_that_says_something(misprint: Misprint) -> None:
    for name in FIELDS:
        text = getattr(misprint, name)
        assert text == text.strip() != ""
        assert "\n" not in text
    assert re.search(r"\d", misprint.consequence)
    bibliography = (Path(__file__).parents[2] / "references.bib").read_text(encoding="utf-8")
    assert f"{{{misprint.paper}," in bibliography


@pytest.mark.parametrize("misprint", MISPRINTS, ids=lambda misprint: misprint.key)
def test_the_two_forms_differ_visibly(misprint: Misprint) -> None:
    printed, right = np.asarray(misprint.as_printed(**misprint.where)), np.asarray(misprint.corrected(**misprint.where))
    assert printed.shape == right.shape
    assert np.isfinite(right).all()
    assert not np.allclose(printed, right, rtol=0.05, atol=1e-4)


def test_what_is_a_custom_or_words_alone_is_not_called_printed() -> None:
    kinds = {kind: {each.key for each in MISPRINTS if each.kind == kind} for kind in ("printed", "customary", "words")}
    assert kinds["customary"] == {"surface-radiance-as-brdf", "ten-terms", "beckmanns-limit", "root-search"}
    assert kinds["words"] == {
        "visible-and-masked-widths",
        "hemispherical-for-bidirectional",
        "local-normal-for-z",
        "deviation-of-slopes",
        "arctangent-of-7a",
    }
    assert sum(map(len, kinds.values())) == len(MISPRINTS)


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
