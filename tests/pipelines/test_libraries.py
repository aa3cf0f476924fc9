"""Libraries on the command line and in recipes: lists, packaged recipes, wrong names, audited tables."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

import brdfdb
from brdfdb.materials import PAPERS, libraries, presets
from brdfdb_pipelines.recipe_file import load, recipe_of
from brdfdb_pipelines.recipe_grids import RecipeError
from tests.pipelines.command import Captured, refused, run

# A few tables that build in seconds: a metal and a glass, at few wavelengths
SMALL = """\
library = "metals"
materials = ["gold-mirror", "n-bk7-polished"]
wavelengths_nm = [400, 550, 700]
tolerance = 0.1
"""


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("library")
    (folder / "small.toml").write_text(SMALL, encoding="utf-8")
    assert run("build", folder / "small.toml", "--store", folder / "store") == 0
    return folder / "store"


@pytest.mark.parametrize("library", libraries())
def test_list_prints_every_preset_of_a_library(library: str, tmp_path: Path, capsys: Captured) -> None:
    assert run("list", "--presets", "--library", library, "--store", tmp_path / "none") == 0
    lines = capsys.readouterr().out.splitlines()
    names = list(presets(library))
    assert lines[0].split()[:2] == [str(len(names)), "presets"]
    assert [line.split()[0] for line in lines[2 : 2 + len(names)]] == names
    computed = [line for line in lines if "Computed, not measured" in line]
    assert len(computed) == (library != PAPERS)  # once, below the table
    assert lines[1].split() == ["material", "title", "model", "colours", "source"]
    assert all(re.search(r"  (grey|spectral|[0-9]+ nm)  ", line) for line in lines[2 : 2 + len(names)])
    assert libraries()[library] in lines[-2]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("list", "--presets", "--library", "metal"), "library: 'metal' is not one of papers, metals, metals-infrared"),
        (("build", "--library", "metal"), "library: 'metal' is not one of papers, metals, metals-infrared"),
        (("list", "--library", "metals"), "--library: "),
        (("build", "mine.toml", "--library", "metals"), "--library: "),
    ],
)
def test_a_wrong_option_is_one_sentence(
    arguments: tuple[str, ...], sentence: str, tmp_path: Path, capsys: Captured
) -> None:
    assert refused(capsys, *arguments, "--store", tmp_path / "none").startswith(sentence)
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize("library", libraries())
def test_each_library_has_a_recipe_of_all_its_materials(library: str) -> None:
    jobs = load(library=library).jobs()
    assert [job.material.name for job in jobs] == list(presets(library))
    assert {job.tolerance for job in jobs} == {0.01 if library == PAPERS else 0.02}
    assert recipe_of(library).is_file()
    ends = {(job.wavelength_nm[0], job.wavelength_nm[-1]) for job in jobs if job.wavelength_nm is not None}
    if library != PAPERS:
        assert (min(low for low, _ in ends), max(high for _, high in ends)) == (
            (380.0, 780.0) if library == "metals" else (350.0, 2500.0)
        )


def test_a_recipe_names_materials_of_one_library(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    head = 'wavelengths_nm = [633]\ntolerance = 0.01\nlibrary = "metals"\n'
    path.write_text(f'{head}materials = ["gold-*", "mine"]\n{DEFINED}', encoding="utf-8")
    names = [job.material.name for job in load(path).jobs()]
    assert names == ["gold-mirror", "gold-polished", "gold-satin", "gold-rough", "mine"]


DEFINED = '[define.mine]\ntitle = "Mine"\nmodel = "lambert"\nsource = "a test"\nparameters = { rho = 0.5 }\n'
GOLD = DEFINED.replace("mine", "gold-satin")


@pytest.mark.parametrize(
    ("head", "sentence"),
    [
        ('library = 3\nmaterials = ["*"]', "library: 3 is not a text"),
        ('materials = ["gold-satin"]', "materials: 'gold-satin' is in the library metals; for its materials, write "),
        ('library = "metals"\nmaterials = ["foam"]', "materials: 'foam' is in the library papers; for its materials, "),
        ('library = "metals"\nmaterials = ["gold-stain"]', "materials: 'gold-stain' matches no material; closest: "),
        (f'library = "metals"\nmaterials = ["*"]\n{GOLD}', "define.gold-satin: is the name of a preset"),
    ],
)
def test_a_wrong_library_or_name_is_one_sentence(tmp_path: Path, head: str, sentence: str) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(f"tolerance = 0.1\nwavelengths_nm = [550]\n{head}\n", encoding="utf-8")
    with pytest.raises(RecipeError) as caught:
        load(path)
    assert str(caught.value).startswith(f"{path}: {sentence}")


def test_tables_say_that_they_are_computed(small: Path, capsys: Captured) -> None:
    store = brdfdb.open(small)
    assert sorted(store) == ["gold-mirror", "n-bk7-polished"]
    gold = store["gold-mirror"]
    assert gold.attrs["source"].startswith("Computed, not measured: ")
    assert run("show", "gold-mirror", "--store", small) == 0
    out = capsys.readouterr().out
    assert "Computed, not measured" in out
    assert "Babar and Weaver 2015" in out


def test_the_specular_part_of_a_mirror_is_that_of_eq_70(small: Path) -> None:
    # Fresnel at normal incidence, times exp(-g) with g = (4 pi sigma_0 / lambda)^2; nothing is hidden there
    for name, sigma_0_nm in (("gold-mirror", 3.0), ("n-bk7-polished", 10.0)):
        table = brdfdb.open(small)[name]
        n, k = brdfdb.refractive_indices.refractive_index(table.source.refractive_index, 550.0)
        fresnel = ((n - 1.0) ** 2 + k**2) / ((n + 1.0) ** 2 + k**2)
        expected = fresnel * np.exp(-((4.0 * np.pi * sigma_0_nm / 550.0) ** 2))
        assert table.specular_reflectance(0.0, 550.0) == pytest.approx(expected, rel=1e-6)


def test_the_audit_of_library_tables_has_no_violation(small: Path) -> None:
    report = small.parent / "report.json"
    assert run("audit", "gold-mirror", "n-bk7-polished", "--store", small, "--report", report) == 0
    audits = json.loads(report.read_text(encoding="utf-8"))["materials"]
    materials = {audit["material"]: audit for audit in audits}
    assert [materials[name]["verdict"] for name in ("gold-mirror", "n-bk7-polished")] == ["passes", "passes"]
    assert materials["gold-mirror"]["findings"]["validity"]["verdict"] == "inside"
    assert materials["n-bk7-polished"]["findings"]["validity"]["verdict"] == "outside"
