"""Wrong forms of Ward 1992, and the statements that notice them."""

from __future__ import annotations

from functools import cache

from brdfdb.gallery import GALLERY
from tests.gallery.mutants.mutation import Matrix, matrix_of
from tests.gallery.mutants.ward_1992 import MUTANTS, PREFIX, UNCHANGED

KEYS = [key for key in GALLERY if key.startswith(PREFIX)]


@cache
def matrix() -> Matrix:
    return matrix_of(KEYS, MUTANTS)


def test_the_twin_that_mutants_change_is_the_model() -> None:
    assert not matrix_of(KEYS, UNCHANGED).noticed[UNCHANGED[0].name]
