"""A command of the program, run in this process; and the sentence of a command that fails."""

from __future__ import annotations

import pytest

from brdfdb_pipelines import cli

Captured = pytest.CaptureFixture[str]
COMPILING = "brdfdb: compiling kernels, once after an installation\n"  # precedes other lines in a new environment


def run(*arguments: object) -> int:
    here = ["--jobs", "1"] if arguments[:1] == ("audit",) else []  # no processes for what takes a second
    return cli.main([*map(str, arguments), *here])


def refused(capsys: Captured, *arguments: object) -> str:
    """Run a command that is refused; return its sentence, the last line of stderr, without "brdfdb: "."""
    capsys.readouterr()
    assert run(*arguments) == 2
    out, err = capsys.readouterr()
    err = err.replace(COMPILING, "")
    assert out == ""
    assert "Traceback" not in err
    assert err.count("brdfdb: ") == 1
    line = err.splitlines()[-1]
    assert line.startswith("brdfdb: ")
    return line.removeprefix("brdfdb: ")
