"""Commands that fail: one sentence on stderr, and the exit code."""

from __future__ import annotations

from tests.pipelines.command import Captured, run


def fails(capsys: Captured, *arguments: object) -> str:
    """The sentence of a command that fails: the last line of stderr, with no traceback, and nothing on stdout."""
    assert run(*arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert "Traceback" not in err
    sentence = err.splitlines()[-1]
    assert sentence.startswith("brdfdb: ")
    assert err.count("brdfdb: ") == 1
    return sentence
