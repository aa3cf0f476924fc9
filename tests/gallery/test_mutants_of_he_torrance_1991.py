"""Wrong forms of He et al. 1991, and the statements that notice them."""

from __future__ import annotations

import numba
import pytest

from brdfdb.gallery import GALLERY
from tests.gallery.mutants.he_torrance_1991 import MUTANTS, PREFIX, UNCHANGED
from tests.gallery.mutants.mutation import MutantTests

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="minutes without compilation")


class TestMutants(MutantTests):
    keys = tuple(key for key in GALLERY if key.startswith(PREFIX))
    mutants = MUTANTS
    unchanged = UNCHANGED
