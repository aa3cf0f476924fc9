"""A store with one revision, for every test of a store that asks for it."""

from __future__ import annotations

from pathlib import Path

import pytest

from brdfdb.store.publication import publish_dataset
from tests.store.a_store import lambert


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A store with one revision of one material, rho = 0.25."""
    directory = tmp_path / "store"
    assert publish_dataset(directory, "white", lambert(0.25))[0] == "r000001"
    return directory
