"""Mistakes at the command line: exit code 2 with one sentence; a bug is 70, with its traceback in a file."""

from __future__ import annotations

import errno
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import pytest

import brdfdb
from brdfdb.errors import ParameterError, install_command
from brdfdb_pipelines.commands import BUG, REFUSED
from tests.pipelines.command import Captured, refused, run
from tests.pipelines.recipes import isotropic


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
            f"jinja2 is not installed; it comes with {install_command('report')}",
        ),
        (
            ModuleNotFoundError("No module named 'matplotlib.figure'", name="matplotlib.figure"),
            f"matplotlib is not installed; it comes with {install_command('scenes')} or {install_command('report')}",
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


# Stores and names that are not there


OF_A_MATERIAL = (
    *("audit foam", "audit mirror foam", "show foam", "history foam"),
    *("rollback foam r000001", "lookup foam 0 0 0 0", "verify foam"),
)


def test_a_missing_store_is_one_sentence(tmp_path: Path, capsys: Captured) -> None:
    for command in (*OF_A_MATERIAL, "audit", "export exr --all", "list", "verify", "gc", "serve"):
        sentence = refused(capsys, *command.split(), "--store", tmp_path / "missing")
        assert sentence.startswith(f"no store at {tmp_path / 'missing'}: "), command


def test_an_unknown_material_is_one_sentence_with_the_closest_names(built: Path, capsys: Captured) -> None:
    for command in (*OF_A_MATERIAL, f"export exr foam --out {os.devnull}"):
        sentence = refused(capsys, *command.replace("foam", "fome").split(), "--store", built)
        assert sentence == "no material 'fome' in the store; closest: foam", command


def test_a_preset_that_was_not_built_is_named_as_one(built: Path, capsys: Captured) -> None:
    sentence = refused(capsys, "show", "gold-satin", "--store", built)
    assert sentence.endswith("; it is a preset of the library metals, and not built in this store")


def test_a_damaged_store_is_one_sentence(store_copy: Path, tmp_path: Path, capsys: Captured) -> None:
    (store_copy / "materials" / "foam" / "r000001" / "brdf" / "c" / "0" / "0" / "0").unlink()
    for command in ("audit foam", "show foam", "lookup foam 0 0 0 0", "rollback foam r000001", "export exr foam"):
        out = ("--out", tmp_path / "exr") if "export" in command else ()
        sentence = refused(capsys, *command.split(), "--store", store_copy, *out)
        assert sentence == "foam r000001 is damaged: brdf/c/0/0/0 is missing", command
    assert run("list", "--store", store_copy) == 0  # reads pointers, no tables
    assert "foam" in capsys.readouterr().out
    (store_copy / "materials" / "foam" / "HEAD.json").write_text("{")
    assert run("list", "--store", store_copy) == 2  # the other materials are listed
    out, err = capsys.readouterr()
    assert "rolled-brass" in out
    assert "foam" not in out
    assert err == "brdfdb: foam is damaged: the first line of HEAD.json is not its digest\n"


# Directories that cannot be written


def test_a_place_that_cannot_be_written_is_one_sentence(
    recipe: Path, built: Path, tmp_path: Path, capsys: Captured
) -> None:
    file = tmp_path / "file"
    file.write_text("precious")
    build, export, audit = ("build", recipe), ("export", "exr", "foam", "--store", built), ("audit", "foam")
    not_empty = f"{tmp_path} is not empty and not a store; name an empty or a new directory"
    for command, said in (
        ((*build, "--store", file / "store"), f"cannot write a store at {file}/store: Not a directory"),
        ((*build, "--store", tmp_path), not_empty),
        ((*export, "--out", file), f"cannot write to {file}: it is a file, not a directory"),
        ((*export, "--out", file / "exr"), f"cannot write to {file}/exr: Not a directory"),
        ((*audit, "--store", built, "--report", tmp_path), f"{tmp_path}: "),
        ((*audit, "--store", built, "--report", file / "report.json"), f"{file}/report.json: "),
        ((*audit, "--store", built, "--report", tmp_path / "none/report.json"), f"{tmp_path}/none/report.json: "),
    ):
        assert refused(capsys, *command).startswith(said)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert file.read_text() == "precious"


# Export


def test_export_takes_names_or_all_and_its_options_anywhere(
    built: Path, tmp_path: Path, names: list[str], capsys: Captured
) -> None:
    assert refused(capsys, "export", "exr", "--store", built) == "export: name materials, or give --all"
    said = "export: name materials or give --all, not both"
    assert refused(capsys, "export", "exr", "foam", "--all", "--store", built) == said
    assert run("export", "exr", "--store", built, "--out", tmp_path / "all_kinds", "foam") == 0
    out, err = capsys.readouterr()
    assert out.startswith("4 EXR files, ")
    assert out.endswith(f" in {tmp_path / 'all_kinds'}\n")
    assert "exporting" in err
    assert len(list((tmp_path / "all_kinds").iterdir())) == 4
    one = ("--jobs", 1)  # more than three tables are written by processes, which take time to start
    slices = ("--half", "--kind", "half_difference")
    assert run("export", "exr", "--all", *slices, "--out", tmp_path / "all", "--store", built, *one) == 0
    assert capsys.readouterr().out.startswith("5 EXR files, ")
    assert {path.name.rsplit("_")[0] for path in (tmp_path / "all").iterdir()} == set(names)


# Terminals and locales


def python(*arguments: object, **environment: str) -> Any:
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(command, env={**os.environ, **environment}, capture_output=True, check=False)


def test_a_terminal_without_the_letters_is_no_error(built: Path) -> None:
    done = python(*("-m", "brdfdb_pipelines.cli", "show", "blue-plastic", "--store", built), PYTHONIOENCODING="ascii")
    assert done.returncode == 0, done.stderr
    assert b"\xc2" not in done.stdout
    assert b"80?" in done.stdout


def test_no_file_is_opened_in_the_encoding_of_the_locale(tmp_path: Path) -> None:
    recipe = tmp_path / "recipe.toml"
    recipe.write_text('title = "Größe"\nmaterials = ["aluminum-cylinder-13c"]\n' + isotropic(), encoding="utf-8")
    code = """
import codecs, locale, sys, warnings
assert codecs.lookup(locale.getpreferredencoding(False)).name == "ascii"
warnings.filterwarnings("error", category=EncodingWarning, module=r"brdfdb")
from brdfdb_pipelines import cli, recipe_file
recipe, store, report = sys.argv[1:]
for command in (
    ["build", recipe],
    ["audit", "--no-figures", "--jobs", "1", "--report", report],
    ["show", "aluminum-cylinder-13c"],
    ["list"],
):
    assert cli.main([*command, "--store", store]) == 0
print(ascii(recipe_file.load(cli.place(recipe)).title))
"""
    ascii_locale = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    paths = (recipe, tmp_path / "store", tmp_path / "report.json")
    done = python("-X", "warn_default_encoding", "-c", code, *paths, **ascii_locale)
    assert done.returncode == 0, done.stderr.decode()
    assert done.stdout.decode().splitlines()[-1] == ascii("Größe")


# Servers


def test_a_missing_server_is_one_sentence_that_names_the_extra(
    built: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "brdfdb_api.server", raising=False)
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    said = f"uvicorn is not installed; it comes with {install_command('serve')}"
    assert refused(capsys, "serve", "--store", built) == said


def test_a_host_that_is_no_name_is_one_sentence(built: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BRDFDB_STORE", "put back afterwards")
    for host in ("a..b", "x" * 70 + ".example", "256.256.256.256"):
        said = refused(capsys, "serve", "--store", built, "--host", host, "--port", 0)
        assert said.startswith(f"cannot listen on {host}, port 0: ")
