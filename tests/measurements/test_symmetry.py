"""Asymmetries: one definition for samples that are pairs, and for f_r that tables are made of."""

import numpy as np
import pytest

from brdfdb.measurements.symmetry import asymmetries, drawn_pairs
from brdfdb.parameters import Floats
from tests.measurements.made_up import source_of


def test_pairs_that_are_faint_or_missing_do_not_count() -> None:
    f, other = np.array([1.0, 1e-5, np.nan, -1.0]), np.array([3.0, 3e-5, 1.0, 1.0])
    assert asymmetries(f, other, level=1.0).tolist() == [0.5, 1.0]


def test_the_asymmetry_of_a_table_is_that_of_its_definition_though_a_lobe_is_bright() -> None:
    """A bright lobe sets no floor for the rest."""

    def f_r(wi: Floats, wr: Floats) -> Floats:
        half = (wi + wr) / np.linalg.norm(wi + wr, axis=1, keepdims=True)
        return np.asarray((0.01 * (1.0 + wi[:, 2]) + 1e4 * np.exp((half[:, 2] - 1.0) * 2e4))[:, np.newaxis])

    seen = source_of(f_r).measured.reciprocity
    wi, wr = drawn_pairs()
    f, other = f_r(wi, wr), f_r(wr, wi)
    expected = float(np.median(np.abs(f - other) / (f + other)))
    assert seen.asymmetry.median == pytest.approx(expected, rel=0.01)
    assert expected > 0.05
