"""The command line: one sentence and a non-zero exit for a store, a name or a directory that is wrong."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from tests.pipelines.command import Captured, run
from tests.pipelines.failing import fails
from tests.pipelines.recipes import isotropic

# Stores and names that are not there


def test_a_missing_store_is_one_sentence(tmp_path: Path, capsys: Captured) -> None:
    missing, empty, file = (tmp_path / name for name in ("missing", "empty", "file"))
    empty.mkdir()
    file.write_text("")
    for root in (missing, empty, file):
        for command in (
            "audit",
            "audit foam",
            "export exr --all",
            "list",
            "show foam",
            "history foam",
            "rollback foam r000001",
            "verify",
            "gc",
            "serve",
            "lookup foam 0 0 0 0",
        ):
            sentence = fails(capsys, *command.split(), "--store", root)
            assert sentence.startswith(f"brdfdb: no store at {root}: ")


def test_an_unknown_material_is_one_sentence_with_the_closest_names(built: Path, capsys: Captured) -> None:
    for name in ("fome", "../foam", "foam/r000001", ""):
        for arguments in (
            ("audit", name),
            ("audit", "foam", name),
            ("export", "exr", name, "--out", os.devnull),
            ("show", name),
            ("history", name),
            ("rollback", name, "r000001"),
            ("verify", name),
            ("lookup", name, 0, 0, 0, 0),
        ):
            sentence = fails(capsys, *arguments, "--store", built)
            assert sentence.startswith(f"brdfdb: no material {name!r} in the store")
            assert name != "fome" or sentence.endswith("; closest: foam")


def test_a_preset_that_was_not_built_is_named_as_one(built: Path, capsys: Captured) -> None:
    sentence = fails(capsys, "show", "gold-satin", "--store", built)
    assert sentence.endswith("; it is a preset of the library metals, and not built in this store")


def test_a_damaged_store_is_one_sentence(built: Path, tmp_path: Path, capsys: Captured) -> None:
    root = tmp_path / "store"
    shutil.copytree(built, root)
    (root / "materials" / "foam" / "r000001" / "brdf" / "c" / "0" / "0" / "0").unlink()
    said = "brdfdb: foam r000001 is damaged: brdf/c/0/0/0 is missing"
    for arguments in (
        ("audit", "foam"),
        ("show", "foam"),
        ("lookup", "foam", 0, 0, 0, 0),
        ("rollback", "foam", "r000001"),
    ):
        assert fails(capsys, *arguments, "--store", root) == said
    assert fails(capsys, "export", "exr", "foam", "--store", root, "--out", tmp_path / "exr") == said
    assert run("list", "--store", root) == 0  # reads pointers, no tables
    assert "foam" in capsys.readouterr().out
    (root / "materials" / "foam" / "HEAD.json").write_text("{")
    assert run("list", "--store", root) == 2  # of the others it tells all the same
    out, err = capsys.readouterr()
    assert "rolled-brass" in out
    assert "foam" not in out
    assert err == "brdfdb: foam is damaged: the first line of HEAD.json is not its digest\n"


# Directories that cannot be written


def test_a_store_that_cannot_be_written_is_one_sentence(recipe: Path, tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "file").write_text("precious")
    root = tmp_path / "file" / "store"
    assert fails(capsys, "build", recipe, "--store", root) == f"brdfdb: cannot write a store at {root}: Not a directory"
    said = fails(capsys, "build", recipe, "--store", tmp_path)
    assert said == f"brdfdb: {tmp_path} is not empty and not a store; name an empty or a new directory"
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_slices_that_cannot_be_written_are_one_sentence(built: Path, tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "file").write_text("precious")
    for out, reason in (("file", "it is a file, not a directory"), ("file/exr", "Not a directory")):
        sentence = fails(capsys, "export", "exr", "foam", "--store", built, "--out", tmp_path / out)
        assert sentence == f"brdfdb: cannot write to {tmp_path / out}: {reason}"
    assert (tmp_path / "file").read_text() == "precious"


def test_a_report_that_cannot_be_written_is_one_sentence(built: Path, tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "file").write_text("precious")
    for report in (tmp_path, tmp_path / "file" / "report.json", tmp_path / "none" / "report.json"):
        sentence = fails(capsys, "audit", "foam", "--store", built, "--report", report)
        assert sentence.startswith(f"brdfdb: {report}: ")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


# Export


def test_export_takes_names_or_all_and_its_options_anywhere(
    built: Path, tmp_path: Path, names: list[str], capsys: Captured
) -> None:
    assert fails(capsys, "export", "exr", "--store", built) == "brdfdb: export: name materials, or give --all"
    said = "brdfdb: export: name materials or give --all, not both"
    assert fails(capsys, "export", "exr", "foam", "--all", "--store", built) == said
    assert run("export", "exr", "--store", built, "--out", tmp_path / "some", "foam", "mirror") == 0
    out, err = capsys.readouterr()
    assert out.startswith("8 EXR files, ")
    assert out.endswith(f" in {tmp_path / 'some'}\n")
    assert "exporting" in err
    assert len(list((tmp_path / "some").iterdir())) == 8
    one = ("--jobs", 1)  # a process of its own for more than three tables: a second one imports as much again
    slices = ("--half", "--kind", "half_difference")
    assert run("export", "exr", "--all", *slices, "--out", tmp_path / "all", "--store", built, *one) == 0
    assert capsys.readouterr().out.startswith("5 EXR files, ")
    assert {path.name.rsplit("_")[0] for path in (tmp_path / "all").iterdir()} == set(names)


# Terminals and locales


def python(*arguments: object, **environment: str) -> Any:
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(command, env={**os.environ, **environment}, capture_output=True, check=False)


def test_a_terminal_without_the_letters_is_no_error(built: Path, tmp_path: Path) -> None:
    report = tmp_path / "report.json"
    arguments = ["-m", "brdfdb_pipelines.cli", "audit", "foam", "--jobs", 1, "--store", built, "--report", report]
    done = python(*arguments, PYTHONIOENCODING="ascii")
    assert done.returncode == 0, done.stderr
    assert b" at " in done.stdout
    assert b"\xc2" not in done.stdout
    assert b"?" in done.stdout


def test_no_file_is_opened_in_the_encoding_of_the_locale(tmp_path: Path) -> None:
    recipe = tmp_path / "recipe.toml"
    recipe.write_text('title = "Größe"\nmaterials = ["aluminum-cylinder-13c"]\n' + isotropic(), encoding="utf-8")
    code = """
import sys, warnings
warnings.filterwarnings("error", category=EncodingWarning, module=r"brdfdb")
from brdfdb_pipelines.cli import main
recipe, store, report = sys.argv[1:]
for command in (
    ["build", recipe],
    ["audit", "--no-figures", "--jobs", "1", "--report", report],
    ["show", "aluminum-cylinder-13c"],
    ["list"],
):
    assert main([*command, "--store", store]) == 0
"""
    done = python("-X", "warn_default_encoding", "-c", code, recipe, tmp_path / "store", tmp_path / "report.json")
    assert done.returncode == 0, done.stderr.decode()
