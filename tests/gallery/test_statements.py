"""Statements of the gallery name the basis of their thresholds; docs/results/mutants.md has all wrong models."""

from __future__ import annotations

import numba
import pytest

from brdfdb.gallery import GALLERY
from tests.gallery.mutants import document
from tests.gallery.mutants.mutation import BASES


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="minutes without compilation")
@pytest.mark.parametrize("key", GALLERY)
def test_statements_name_the_basis_of_their_thresholds(key: str) -> None:
    for statement in GALLERY[key]().statements:
        basis, _, reason = (statement.threshold_from or "").partition(": ")
        assert basis in BASES, statement
        assert reason, statement


def test_every_figure_is_covered_by_wrong_models() -> None:
    prefixes = tuple(module.PREFIX for module in document.PAPERS.values())
    assert [key for key in GALLERY if not key.startswith(prefixes)] == []


def test_twenty_wrong_models_have_names_of_their_own() -> None:
    for module in document.PAPERS.values():
        names = [mutant.name for mutant in module.MUTANTS]
        assert len(set(names)) == len(names)
    assert sum(len(module.MUTANTS) for module in document.PAPERS.values()) >= 20


def test_the_list_of_wrong_models_is_that_of_the_code() -> None:
    assert document.PATH.read_text(encoding="utf-8") == document.text()
