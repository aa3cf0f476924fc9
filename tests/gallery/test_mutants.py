"""Wrong forms of the three papers, and the statements that notice them."""

from __future__ import annotations

import numba
import pytest

from brdfdb.gallery import GALLERY
from tests.gallery.mutants import he_torrance_1991, oren_nayar_1994, ward_1992
from tests.gallery.mutants.mutation import MutantTests


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="minutes without compilation")
class TestHeTorrance1991(MutantTests):
    keys = tuple(key for key in GALLERY if key.startswith(he_torrance_1991.PREFIX))
    mutants = he_torrance_1991.MUTANTS
    unchanged = he_torrance_1991.UNCHANGED


class TestOrenNayar1994(MutantTests):
    keys = tuple(key for key in GALLERY if key.startswith(oren_nayar_1994.PREFIX))
    mutants = oren_nayar_1994.MUTANTS
    unchanged = oren_nayar_1994.UNCHANGED


class TestWard1992(MutantTests):
    keys = tuple(key for key in GALLERY if key.startswith(ward_1992.PREFIX))
    mutants = ward_1992.MUTANTS
    unchanged = ward_1992.UNCHANGED
