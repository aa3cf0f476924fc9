"""A command of the program, run in this process."""

from __future__ import annotations

import pytest

from brdfdb_pipelines import cli

Captured = pytest.CaptureFixture[str]


def run(*arguments: object) -> int:
    here = ["--jobs", "1"] if arguments[:1] == ("audit",) else []  # no processes for what takes a second
    return cli.main([*map(str, arguments), *here])
