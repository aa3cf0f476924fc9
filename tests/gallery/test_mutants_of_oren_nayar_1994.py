"""Wrong forms of Oren and Nayar 1994, and the statements that notice them."""

from __future__ import annotations

from brdfdb.gallery import GALLERY
from tests.gallery.mutants.mutation import MutantTests
from tests.gallery.mutants.oren_nayar_1994 import MUTANTS, PREFIX, UNCHANGED


class TestMutants(MutantTests):
    keys = tuple(key for key in GALLERY if key.startswith(PREFIX))
    mutants = MUTANTS
    unchanged = UNCHANGED
