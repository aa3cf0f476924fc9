"""Wrong forms of Oren and Nayar 1994, and the statements that notice them."""

from __future__ import annotations

from functools import cache

import pytest

from brdfdb.gallery import GALLERY
from tests.gallery.mutants.mutation import Matrix, Mutant, matrix_of
from tests.gallery.mutants.oren_nayar_1994 import MUTANTS, PREFIX, UNCHANGED

KEYS = [key for key in GALLERY if key.startswith(PREFIX)]


@cache
def matrix() -> Matrix:
    return matrix_of(KEYS, MUTANTS)


@pytest.mark.parametrize("twin", UNCHANGED, ids=lambda twin: twin.name)
def test_the_twin_that_mutants_change_is_the_model(twin: Mutant) -> None:
    assert not matrix_of(KEYS, [twin]).noticed[twin.name]


def test_every_statement_fails_for_a_wrong_model() -> None:
    assert not matrix().blind, str(matrix())


def test_every_wrong_model_is_noticed_by_two_statements() -> None:
    assert not matrix().overlooked, str(matrix())
