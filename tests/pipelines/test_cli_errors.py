"""Exit codes of the command line: refused input is 2 with one sentence, a bug is 70 with its traceback in a file."""

from __future__ import annotations

import errno
import re
import sys
import tempfile
from pathlib import Path

import pytest

import brdfdb
from brdfdb.errors import ParameterError
from brdfdb_pipelines.commands import BUG, REFUSED
from tests.pipelines.command import Captured, refused, run


def raising(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    """Make `brdfdb chart` end with an error."""

    def fail(*_arguments: object, **_options: object) -> None:
        raise error

    monkeypatch.setattr("brdfdb_pipelines.chart.run", fail)


def test_a_bug_is_one_line_that_names_the_file_with_the_traceback(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    no_module = ModuleNotFoundError("No module named 'brdfdb.nowhere'", name="brdfdb.nowhere")
    for error in (ValueError("no: sentence"), KeyError("title"), ZeroDivisionError(), OSError("no errno"), no_module):
        raising(monkeypatch, error)
        assert run("chart", "foam") == BUG
        (file,) = tmp_path.iterdir()
        out, err = capsys.readouterr()
        assert out == ""
        assert re.fullmatch(rf"brdfdb: .* {file} \({type(error).__name__}: {re.escape(str(error))}\)\n", err)
        text = file.read_text(encoding="utf-8")
        assert text.startswith(f"brdfdb {brdfdb.__version__}, Python ")
        assert "\nbrdfdb chart foam\nTraceback (most recent call last):\n" in text
        assert "in fail\n    raise error\n" in text
        file.unlink()


def test_a_bug_without_a_directory_for_its_traceback_prints_it(
    monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", "/nonexistent")
    raising(monkeypatch, ZeroDivisionError("x"))
    assert run("chart", "foam") == BUG
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "Traceback (most recent call last):"
    assert lines[-1].startswith("brdfdb: this is a bug of brdfdb")


def test_what_the_user_can_act_on_is_one_sentence(monkeypatch: pytest.MonkeyPatch, capsys: Captured) -> None:
    for error, sentence in (
        (ParameterError("tolerance", "2 is outside [0, 1]", 2, (0, 1)), "tolerance: 2 is outside [0, 1]"),
        (FileNotFoundError(errno.ENOENT, "No such file or directory", "a.toml"), "a.toml: No such file or directory"),
        (OSError(errno.ENOSPC, "No space left on device"), "No space left on device"),
        (MemoryError(), "out of memory"),
        (MemoryError("Unable to allocate 8. TiB"), "Unable to allocate 8. TiB"),
        (
            ModuleNotFoundError("No module named 'jinja2'", name="jinja2"),
            "jinja2 is not installed; it comes with pip install 'brdfdb[report]'",
        ),
        (
            ModuleNotFoundError("No module named 'matplotlib.figure'", name="matplotlib.figure"),
            "matplotlib is not installed; it comes with pip install 'brdfdb[scenes]' or pip install 'brdfdb[report]'",
        ),
    ):
        raising(monkeypatch, error)
        assert run("chart", "foam") == REFUSED
        assert capsys.readouterr() == ("", f"brdfdb: {sentence}\n")


def test_debug_stands_anywhere_and_prints_the_traceback_before_the_sentence(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: Captured
) -> None:
    raising(monkeypatch, ParameterError("tolerance", "2 is outside [0, 1]"))
    for arguments in (("--debug", "chart", "foam"), ("chart", "foam", "--debug")):
        assert run(*arguments) == REFUSED
        lines = capsys.readouterr().err.splitlines()
        assert lines[0] == "Traceback (most recent call last):"
        assert lines[-2:] == [
            "brdfdb.errors.ParameterError: tolerance: 2 is outside [0, 1]",
            "brdfdb: tolerance: 2 is outside [0, 1]",
        ]
    assert run("export", "--debug", "exr", "foam", "--store", tmp_path) == REFUSED
    assert capsys.readouterr().err.startswith("Traceback")


def test_the_version_is_printed(capsys: Captured) -> None:
    with pytest.raises(SystemExit) as caught:
        run("--version")
    assert caught.value.code == 0
    assert capsys.readouterr().out == f"brdfdb {brdfdb.__version__}\n"


def test_a_misspelt_choice_is_answered_with_the_closest(capsys: Captured) -> None:
    for arguments, said in (
        (("biuld",), "argument COMMAND: invalid choice: 'biuld'; did you mean build?"),
        (("lokup", "foam"), "argument COMMAND: invalid choice: 'lokup'; did you mean lookup?"),
        (("export", "ex"), "argument FORMAT: invalid choice: 'ex'; did you mean exr?"),
        (("choose", "spheres", "--weigh", "byte"), "argument --weigh: invalid choice: 'byte'; did you mean bytes?"),
        (("zzz",), "argument COMMAND: invalid choice: 'zzz'; choose from audit, build, "),
        (("export", "pdf"), "invalid choice: 'pdf'; choose from astm, bird, "),
        (("export", "pdf"), "rgl is for Mitsuba 3 and pbrt"),
    ):
        with pytest.raises(SystemExit) as caught:
            run(*arguments)
        assert caught.value.code == REFUSED
        assert said in capsys.readouterr().err


def test_the_help_lists_the_exit_codes(capsys: Captured) -> None:
    with pytest.raises(SystemExit):
        run("--help")
    lines = [line.split() for line in capsys.readouterr().out.partition("exit codes:")[2].splitlines() if line]
    assert [line[0] for line in lines] == ["0", "1", "2", "70", "130", "143"]


def test_a_missing_server_is_one_sentence_that_names_the_extra(
    built: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "brdfdb_api.server", raising=False)
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    said = "uvicorn is not installed; it comes with pip install 'brdfdb[serve]'"
    assert refused(capsys, "serve", "--store", built) == said


def test_a_host_that_is_no_name_is_one_sentence(built: Path, capsys: Captured) -> None:
    for host in ("a..b", "x" * 70 + ".example", "256.256.256.256"):
        said = refused(capsys, "serve", "--store", built, "--host", host, "--port", 0)
        assert said.startswith(f"cannot listen on {host}, port 0: ")
