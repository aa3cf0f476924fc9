"""The browser of all tests, the order of their files, and Hypothesis without chance and without a clock."""

from __future__ import annotations

import gc
import os
import shutil
from collections.abc import Generator, Iterator

import pytest
from hypothesis import settings

from tests.api.chromium import Chromium

settings.register_profile("brdfdb", derandomize=True, deadline=None, database=None)  # no clock: a first call compiles
settings.load_profile("brdfdb")

# Read by the workers of the tests and by the programs that they start: threads of linear algebra beside them wait for
# one another, and take time of the processor while they wait
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Files that begin, in this order: they take minutes. Workers take them in turn: while one builds the site, the other
# compiles the kernels of all models, which both would compile otherwise
_FIRST = ("test_site.py", "test_every_model_vectors.py", "test_house.py", "test_every_model.py", "test_numba.py")


# Allocations between two searches for garbage, as in the commands: Python's 700 cost 3 % of the time of all tests
_ALLOCATIONS = 50_000


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Search no garbage among modules and tests while they are collected, nor later: they stay until the end."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(_ALLOCATIONS)
        gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the long files: a worker that comes to them last keeps all others waiting."""
    items.sort(key=lambda item: _FIRST.index(item.path.name) if item.path.name in _FIRST else len(_FIRST))


@pytest.fixture(scope="session")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chromium]:
    """A Chromium; without one these tests are skipped, or fail where it is known to be there."""
    for name in ("chromium", "chromium-browser", "google-chrome"):
        if binary := shutil.which(name):
            with Chromium(binary, tmp_path_factory.mktemp("profile")) as browser:
                yield browser
            return
    if os.environ.get("BRDFDB_NEEDS_BROWSER"):
        pytest.fail("BRDFDB_NEEDS_BROWSER is set, and no chromium, chromium-browser or google-chrome is on PATH")
    pytest.skip("no chromium, chromium-browser or google-chrome on PATH")
