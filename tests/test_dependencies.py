"""The dependencies: the core works without the extras, and a cap stands only where the inside of a package is used."""

from __future__ import annotations

import importlib.metadata
import os
import re
import subprocess
import tomllib
import venv
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
import xarray as xr
from packaging.requirements import Requirement

import brdfdb
import brdfdb_api
import brdfdb_pipelines
from brdfdb import _numba
from brdfdb.store.publication import publish_dataset

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS: dict[str, list[str]] = PROJECT["optional-dependencies"]


def test_numba_alone_has_a_cap_below_the_next_major_version() -> None:
    extras = EXTRAS.keys() - {"test", "judges"}
    lines = [*PROJECT["dependencies"], *(line for name in extras for line in EXTRAS[name])]
    requirements = map(Requirement, lines)
    assert {
        requirement.name
        for requirement in requirements
        for specifier in requirement.specifier
        if specifier.operator == "<" and "." in specifier.version
    } == {"numba"}


def test_the_reason_for_the_cap_still_stands() -> None:
    # a newer version that passes here may be allowed; one whose inside is no longer used needs no cap
    def square(x: float) -> float:
        return x * x

    file = _numba.loop(square)._cache._cache_file  # type: ignore[attr-defined]
    assert file._source_stamp.endswith(_numba._shared_digest())
    part: Any = _numba.kernel(square)
    assert part is square  # for Python; numba asks for the attribute `_numba_type_`
    assert numba.typeof(part) == numba.typeof(part.dispatcher)


def test_all_is_every_extra() -> None:
    (line,) = EXTRAS["all"]
    assert set(Requirement(line).extras) == set(EXTRAS) - {"all", "site", "release", "test", "judges"}


def _closure(names: list[str]) -> set[str]:
    """Return the distributions that some need, themselves included."""
    found: set[str] = set()
    todo = list(names)
    while todo:
        name = re.sub(r"[-_.]+", "-", todo.pop()).lower()
        if name in found:
            continue
        found.add(name)
        for line in importlib.metadata.requires(name) or ():
            requirement = Requirement(line)
            if requirement.marker is None or requirement.marker.evaluate({"extra": ""}):
                todo.append(requirement.name)
    return found


@pytest.fixture(scope="module")
def core(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fresh environment that holds the core's dependencies alone, each a link to the installed one."""
    home = tmp_path_factory.mktemp("core")
    venv.create(home, symlinks=True)
    (site,) = home.glob("lib/python*/site-packages")
    for name in _closure([Requirement(line).name for line in PROJECT["dependencies"]]):
        distribution = importlib.metadata.distribution(name)
        for top in {file.parts[0] for file in distribution.files or () if file.parts[0] not in ("..", "__pycache__")}:
            if not (site / top).exists():
                (site / top).symlink_to(Path(str(distribution.locate_file(top))).resolve())
    for package in (brdfdb, brdfdb_pipelines, brdfdb_api):
        assert package.__file__ is not None
        (site / package.__name__).symlink_to(Path(package.__file__).parent)
    return home


def _run(core: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    # -I: neither PYTHONPATH nor the directory of the tests
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    return subprocess.run(
        [str(core / "bin" / "python"), "-I", *arguments], capture_output=True, text=True, check=False, env=environment
    )


RECIPE = """
materials = ["rolled-brass"]
wavelengths_nm = [550]
tolerance = 0.1
"""
LOOKUP = """
import sys
import brdfdb
table = brdfdb.open(sys.argv[1])["rolled-brass"]
print(table.lookup(0.5, 0.0, 0.5, 3.14159))
print(sorted(set(sys.modules) & {"fastapi", "matplotlib", "colour", "OpenEXR", "jinja2", "mpmath", "distributed"}))
"""


def test_the_core_alone_tabulates_and_looks_up(core: Path, tmp_path: Path) -> None:
    recipe, store = tmp_path / "recipe.toml", tmp_path / "store"
    recipe.write_text(RECIPE, encoding="utf-8")
    built = _run(core, "-m", "brdfdb_pipelines.cli", "build", str(recipe), "--store", str(store))
    assert built.returncode == 0, built.stderr
    found = _run(core, "-c", LOOKUP, str(store))
    assert found.returncode == 0, found.stderr
    value, loaded = found.stdout.splitlines()
    assert float(value) == pytest.approx(float(brdfdb.open(store)["rolled-brass"].lookup(0.5, 0.0, 0.5, 3.14159)))
    assert loaded == "[]"


@pytest.mark.parametrize(
    ("command", "extra"),
    [
        (["audit", "--store", "{store}"], "report"),
        (["chart", "rolled-brass"], "report"),
        (["render", "clay-vase"], "scenes"),
        (["serve", "--store", "{store}"], "serve"),
        (["export", "exr", "rolled-brass", "--store", "{store}"], "scenes"),
        (["build", "--scheduler", "tcp://127.0.0.1:1"], "dask"),
        (
            ["simulate", "--surface", "gaussian", "--slope-deg", "9", "--rho", "1", "--store", "{store}"],
            "microgeometry",
        ),
        (["import", "{store}", "--store", "{store}"], "report"),
    ],
)
def test_a_missing_extra_is_a_sentence_that_names_it(
    core: Path, tmp_path: Path, command: list[str], extra: str
) -> None:
    axes = {"theta_i": [0.0, 90.0], "theta_r": [0.0, 90.0], "delta_phi": [0.0, 180.0]}
    white = xr.Dataset({"brdf": (tuple(axes), np.full((2, 2, 2), 0.3, dtype=np.float32))}, axes)
    publish_dataset(tmp_path / "store", "rolled-brass", white)
    arguments = [part.format(store=tmp_path / "store") for part in command]
    done = _run(core, "-m", "brdfdb_pipelines.cli", *arguments)
    assert done.returncode == 2, done.stderr
    line = done.stderr.splitlines()[-1]  # progress may stand before it
    assert line.startswith("brdfdb: ")
    assert f"pip install -e '.[{extra}]' in a clone" in line  # no pip recorded where the packages are from
