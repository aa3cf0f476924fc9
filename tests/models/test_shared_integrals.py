"""Integrals that materials of one model share: the same numbers, once, and only where errors are measured."""

from __future__ import annotations

import numpy as np
import pytest

from brdfdb.geometry import unit_vector
from brdfdb.models import _oren_nayar_facets, oren_nayar_gaussian_vectors
from brdfdb.models.shared_integrals import shared, sharing

SIGMA = 0.4321  # of no other test: integrals are kept for a whole process


def test_models_of_one_sigma_integrate_once_to_the_same_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(5)
    wi, wr = (unit_vector(rng.uniform(0.0, 1.5, 50), rng.uniform(0.0, 6.0, 50)) for _ in range(2))
    calls = []
    integrate = _oren_nayar_facets._integrated

    def counted(columns: np.ndarray, lit: bool, bounce: bool, nodes: int) -> tuple[np.ndarray, np.ndarray]:
        calls.append(columns.shape)
        return integrate(columns, lit, bounce, nodes)

    monkeypatch.setattr(_oren_nayar_facets, "_integrated", counted)
    alone = [oren_nayar_gaussian_vectors(wi, wr, rho=rho, sigma=SIGMA) for rho in (0.5, 0.9)]
    assert len(calls) == 2, "a call outside of the context integrates, so that timings are those of the model"
    with sharing():
        together = [oren_nayar_gaussian_vectors(wi, wr, rho=rho, sigma=SIGMA) for rho in (0.5, 0.9)]
    assert len(calls) == 3
    np.testing.assert_array_equal(alone, together)


def test_what_is_kept_cannot_be_changed_and_is_told_apart_by_its_features() -> None:
    one, other = np.array([1.0, 2.0]), np.array([1.0, 3.0])
    with sharing():
        (kept,) = shared(one, ("sum",), lambda: (np.array([one.sum()]),))
        (others,) = shared(other, ("sum",), lambda: (np.array([other.sum()]),))
        (mean,) = shared(one, ("mean",), lambda: (np.array([one.mean()]),))
    assert (kept[0], others[0], mean[0]) == (3.0, 4.0, 1.5)
    with pytest.raises(ValueError, match="read-only"):
        kept[0] = 5.0
