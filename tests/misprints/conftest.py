"""The entry that a test is about: the one with the key that the name of the test spells."""

import pytest

from tests.misprints.an_entry import BY_KEY, Entry


@pytest.fixture
def entry(request: pytest.FixtureRequest) -> Entry:
    return Entry(BY_KEY[request.node.name.removeprefix("test_").replace("_", "-")])
