"""Fixtures of the tests of the audit."""

from __future__ import annotations

import pytest

from tests.audit.model_energies import coarse_model_energy, each_model_once
from tests.pipelines.conftest import no_plots

__all__ = ["coarse_model_energy", "each_model_once", "few_samples", "no_plots"]


@pytest.fixture
def few_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw few samples: samplers are audited at length in test_audit_model.py."""
    monkeypatch.setattr("brdfdb.audit.sampling.SAMPLES", 2000)
