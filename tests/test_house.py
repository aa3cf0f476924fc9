"""The house itself: lint, types, import layers, generated documents, and what the README promises."""

from __future__ import annotations

import importlib
import pkgutil
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest
from numba.core.dispatcher import Dispatcher

import brdfdb
from brdfdb import _numba
from brdfdb_pipelines import documents

ROOT = Path(__file__).parent.parent


@pytest.mark.parametrize(
    "command",
    [
        pytest.param(["ruff", "check", "--no-cache", "."], id="lint"),
        pytest.param(["ruff", "format", "--check", "--no-cache", "."], id="format"),
        pytest.param(["mypy"], id="types"),
        pytest.param(["importlinter.cli", "lint-imports"], id="layers"),
    ],
)
def test_static_checks_pass(command: list[str]) -> None:
    module, *arguments = command
    if module == "importlinter.cli":
        run = [sys.executable, "-c", "from importlinter.cli import lint_imports_command; lint_imports_command()"]
    else:
        run = [sys.executable, "-m", module, *arguments]
    done = subprocess.run(run, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_design_names_every_room_and_file_of_the_library() -> None:
    home = ROOT / "brdfdb"
    files = [path.name for path in home.glob("*.py")]
    rooms = [f"{path.parent.name}/" for path in home.glob("*/__init__.py")]
    inside = (home / "DESIGN.md").read_text(encoding="utf-8").split("## Inside")[1].split("```")[1]
    named = re.findall(r"^  (\S+)", inside, flags=re.MULTILINE)
    assert sorted(named) == sorted(files + rooms)


@pytest.mark.parametrize("name", documents.SCHEMAS)
def test_schemas_are_those_of_the_code(name: str) -> None:
    written = (ROOT / "schemas" / f"{name}.schema.json").read_text(encoding="utf-8")
    assert written == documents.schema(name), "run python -m brdfdb_pipelines.documents and review the difference"


def test_the_check_runs_the_readmes_two_commands_and_then_the_judges() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    build, test = re.findall(r"^python3 -m venv .*$", text, flags=re.MULTILINE)
    assert "brdfdb build" in build
    assert test.startswith("python3 -m venv .venv && .venv/bin/pip install --no-compile -e '.[test]'")
    assert test in (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    check = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    readme, judges = check.index("mapfile -t commands < <(grep '^python3 -m venv' README.md)"), check.index("-m judge ")
    assert readme < judges
    assert f"{test.split(' && ')[-1].replace('pytest', 'pytest -m judge')}" in check


def test_every_reference_key_is_in_the_bibliography() -> None:
    from brdfdb.models import MODELS

    keys = set(re.findall(r"^@\w+\{(\w+),", (ROOT / "references.bib").read_text(encoding="utf-8"), flags=re.MULTILINE))
    assert {spec.reference for spec in MODELS.values()} <= keys


def kernels() -> list[Dispatcher]:
    """Every kernel of the library, each once; the plugins of Mitsuba have none."""
    names = [found.name for found in pkgutil.walk_packages(brdfdb.__path__, "brdfdb.")]
    modules = [importlib.import_module(name) for name in names if not name.startswith("brdfdb.mitsuba")]
    return [
        value
        for module in modules
        for value in vars(module).values()
        if isinstance(value, Dispatcher) and value.py_func.__module__ == module.__name__
    ]


def test_a_kernel_calls_kernels_of_its_own_file_or_of_the_shared_ones() -> None:
    # numba's cache knows the file of a kernel, not the files of what it calls: those would stay as they were
    found = kernels()
    assert len(found) > 10
    shared = [f"brdfdb.{name.removesuffix('.py').replace('/', '.')}" for name in _numba.SHARED]
    for kernel in found:
        function = kernel.py_func
        names = {name: function.__globals__.get(name) for name in function.__code__.co_names}
        scopes = [value for value in names.values() if isinstance(value, ModuleType)]
        called = [value for value in names.values() if isinstance(value, Dispatcher)]
        called += [getattr(scope, name, None) for scope in scopes for name in names]
        for callee in called:
            if isinstance(callee, Dispatcher):
                home = callee.py_func.__module__
                assert home in (function.__module__, *shared), f"{function.__qualname__} calls {callee}"
