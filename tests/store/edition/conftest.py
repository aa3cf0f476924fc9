"""A store with a table of each kind, and its edition, which tests copy before they change it."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import brdfdb
from brdfdb.store.edition.publishing import publish_edition
from brdfdb.store.reader import Store
from tests.store.edition import an_edition


@pytest.fixture(scope="session")
def published(tmp_path_factory: pytest.TempPathFactory) -> tuple[Store, Path]:
    """A store with a table of each kind, and the directory of its edition; no test changes them."""
    folder = tmp_path_factory.mktemp("edition")
    an_edition.make(folder / "store")
    publish_edition(folder / "store", folder / "edition")
    store = brdfdb.open(folder / "store")
    assert isinstance(store, Store)
    return store, folder / "edition"


@pytest.fixture
def copy(published: tuple[Store, Path], tmp_path: Path) -> Path:
    """A copy of the edition, to be changed."""
    return Path(shutil.copytree(published[1], tmp_path / "edition"))
