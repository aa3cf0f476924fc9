"""Wrong forms of Ward 1992, and the statements that notice them."""

from __future__ import annotations

from brdfdb.gallery import GALLERY
from tests.gallery.mutants.mutation import MutantTests
from tests.gallery.mutants.ward_1992 import MUTANTS, PREFIX, UNCHANGED


class TestMutants(MutantTests):
    keys = tuple(key for key in GALLERY if key.startswith(PREFIX))
    mutants = MUTANTS
    unchanged = UNCHANGED
