"""A store with one revision, for every test of a store that asks for it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.store.a_store import lambert, publish


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A store with one revision of one material, rho = 0.25."""
    directory = tmp_path / "store"
    assert publish(directory, white=lambert(0.25)) == ["r000001"]
    return directory
