"""Fixtures of the tests of the audit."""

from __future__ import annotations

import pytest


@pytest.fixture
def few_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw few samples: samplers are audited at length in test_audit_model.py."""
    monkeypatch.setattr("brdfdb.audit.sampling.SAMPLES", 2000)
