"""A small recipe with one material of every kind, a store built from it, and what a bad command must leave alone."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from brdfdb_pipelines import audit_page, cli
from tests.pipelines.a_build import changed
from tests.pipelines.recipes import anisotropic, isotropic, material

# Grey isotropic, anisotropic, spectral, one wavelength, nothing but a Dirac part
FINE, LESS = "[{ start = 0, stop = 80, step = 10 }, 85, 89.5]", "[{ start = 0, stop = 80, step = 20 }, 89.5]"
HEAD = """\
title = "Größe: one of every kind"
materials = ["foam", "rolled-brass", "scene-copper-sphere", "blue-plastic", "mirror"]
wavelengths_nm = [{ start = 400, stop = 700, step = 20 }]
"""
RECIPE = "".join(
    [
        HEAD,
        isotropic(FINE, "[{ start = 0, stop = 180, step = 15 }]"),
        isotropic(LESS, "[{ start = 0, stop = 180, step = 30 }]", kind="spectral"),
        anisotropic(LESS, "[{ start = 0, stop = 360, step = 30 }]"),
        material(
            "mirror", "Smooth copper: a Dirac part and nothing else", "he_torrance", "sigma_0_um = 0", "tau_um = 1"
        ),
    ]
)
NAMES = ["foam", "rolled-brass", "scene-copper-sphere", "blue-plastic", "mirror"]


@pytest.fixture(scope="session")
def names() -> list[str]:
    """The materials of the recipe, in its order."""
    return NAMES


@pytest.fixture(scope="session")
def recipe(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The recipe as a file."""
    path = tmp_path_factory.mktemp("recipe") / "recipe.toml"
    path.write_text(RECIPE, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory, recipe: Path) -> Path:
    """A store that the command line built from the recipe; tests must not change it."""
    root = tmp_path_factory.mktemp("built") / "store"
    assert cli.main(["build", str(recipe), "--store", str(root), "--jobs", "2"]) == 0
    return root


@pytest.fixture
def store_copy(built: Path, tmp_path: Path) -> Path:
    """A copy of that store, for tests that change it."""
    return Path(shutil.copytree(built, tmp_path / "store"))


@pytest.fixture
def changed_recipe(recipe: Path, tmp_path: Path) -> Path:
    """The recipe with another grid for foam and blue-plastic."""
    return changed(recipe, tmp_path / "changed.toml")


@pytest.fixture
def no_plots(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw no plots on the page of an audit in this process: they take most of its time."""
    monkeypatch.setattr(audit_page, "plots_of", lambda _: [])
