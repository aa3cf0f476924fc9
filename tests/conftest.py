"""The browser of all tests, the order of their files, judges, and Hypothesis without chance and without a clock."""

from __future__ import annotations

import gc
import os
import shutil
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

from tests.smells import smells

if TYPE_CHECKING:
    from tests.api.chromium import Chromium

settings.register_profile("brdfdb", derandomize=True, deadline=None, database=None)  # no clock: a first call compiles
settings.load_profile("brdfdb")

# Read by the workers of the tests and by the programs that they start: threads of linear algebra beside them wait for
# one another, and take time of the processor while they wait. numpy is imported below this line
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# Files that begin, in this order: they take minutes. Workers take them in turn: while one builds the site, the other
# compiles the kernels of all models, which both would compile otherwise
_FIRST = ("test_site.py", "test_every_model_vectors.py", "test_house.py", "test_every_model.py", "test_numba.py")

# Folders, files and fixtures whose tests have the mark `judge`: they need a program of others, or take minutes. The
# README's command leaves them out, `.ci/run` runs them alone. Single tests of other files have the mark themselves
_JUDGES = (
    "site/test_site.py",
    "mitsuba/",
    "models/test_mitsuba.py",
    "api/test_fuzz.py",
    "api/test_generated_client.py",
    "api/test_caching_proxy.py",
    "api/test_proxies.py",
    "api/test_lowest_versions.py",
    "api/test_server.py",
    "pipelines/test_workers.py",
    "store/edition/test_judges.py",
)
_FIXTURES_OF_JUDGES = {"chromium"}


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


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark judges, and begin with the long files: a worker that comes to them last keeps all others waiting."""
    here = Path(__file__).parent
    for item in items:
        path = item.path.relative_to(here).as_posix()
        if path.startswith(_JUDGES) or not _FIXTURES_OF_JUDGES.isdisjoint(getattr(item, "fixturenames", ())):
            item.add_marker(pytest.mark.judge)
    items.sort(key=lambda item: _FIRST.index(item.path.name) if item.path.name in _FIRST else len(_FIRST))


@pytest.fixture(scope="session")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chromium]:
    """A Chromium; without one these tests are skipped, or fail where it is known to be there."""
    from tests.api.chromium import Chromium

    for name in ("chromium", "chromium-browser", "google-chrome"):
        if binary := shutil.which(name):
            with Chromium(binary, tmp_path_factory.mktemp("profile")) as browser:
                yield browser
            return
    if os.environ.get("BRDFDB_NEEDS_BROWSER"):
        pytest.fail("BRDFDB_NEEDS_BROWSER is set, and no chromium, chromium-browser or google-chrome is on PATH")
    pytest.skip("no chromium, chromium-browser or google-chrome on PATH")


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the smells of the house after its tests."""
    reports = [report for reports in terminalreporter.stats.values() for report in reports]
    if any(getattr(report, "nodeid", "").startswith("tests/test_house.py") for report in reports):
        lines = smells()
        terminalreporter.section(f"{len(lines)} smells of the house, which fail no test")
        for line in lines:
            terminalreporter.write_line(line)
