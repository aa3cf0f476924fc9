"""Wrong forms of the three papers, and the statements that notice them."""

from __future__ import annotations

import numba
import pytest

from tests.gallery.mutants import he_torrance_1991, oren_nayar_1994, ward_1992
from tests.gallery.mutants.mutation import MutantTests


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="minutes without compilation")
class TestHeTorrance1991(MutantTests):
    paper = he_torrance_1991


class TestOrenNayar1994(MutantTests):
    paper = oren_nayar_1994


class TestWard1992(MutantTests):
    paper = ward_1992
