"""The command `brdfdb topography`: its report, JSON, recipe, and the sentences on maps that it refuses."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from brdfdb.microgeometry.model_errors import surface_error
from brdfdb_pipelines.recipe_file import Recipe
from tests.microgeometry.made_maps import Array, MadeMap, write
from tests.pipelines.command import Captured, refused, run

MADE = MadeMap(nodes=(160, 160), noise=0.02, holes=0.01, tilt=(0.02, 0.0))


@pytest.fixture
def plate(tmp_path: Path) -> Path:
    path = tmp_path / "Brass plate.sdf"
    write(path, MADE.measured(0))
    return path


def test_the_report_says_what_was_done_and_what_the_surface_is(plate: Path, capsys: Captured) -> None:
    assert run("topography", plate, "--refractive-index", "Cu") == 0
    out = capsys.readouterr().out
    lines = {line[2:13].strip(): line[14:] for line in out.splitlines() if line.startswith("  ") and line[2] != " "}
    assert out.startswith(f"{plate}: ISO 25178-71 SDF\n")
    assert lines["map"] == "160 x 160 heights, 80 x 80 um, pixels of 0.5 um"
    assert lines["axes"] == "x and y of the file"
    assert lines["levelled"].startswith("plane subtracted; the tilt was 1.")
    assert lines["holes"].endswith("left out")
    assert lines["outliers"] == lines["steps"] == "none"
    assert "from the flat end of the spectrum; taken out" in lines["noise"]
    assert " % of its square, which is added" in lines["sigma_0"]
    assert lines["correlation"].startswith("Gaussian: H ")
    assert "Gaussian within chance" in lines["heights"]
    assert lines["direction"].startswith("isotropic within chance")
    assert lines["band"] == "spatial wavelengths from 1 um (two pixels) to 80 um (the map)"
    assert "    550 nm    roughness of this band shows at theta_r of 0.39 to 33 degrees, for light" in out
    assert "    Beckmann    assumptions met\n" in out
    assert "    Oren-Nayar  not met\n      not met     extinction coefficient k of the facets: 2.4" in out  # a metal
    assert "  left out    VMF diffuse: its facets face all directions of a sphere, " in out
    assert "He et al. 1991, eq. 79" in out
    assert lines["warning"]
    assert lines["assumed"] == "rho = 0.5 (--rho)"


def test_the_report_says_which_substance_is_assumed(plate: Path, capsys: Captured) -> None:
    assert run("topography", plate) == 0
    assumed = "n = 1.5 and k = 0 (--refractive-index names the substance), rho = 0.5 (--rho)"
    assert f"  assumed     {assumed}\n" in capsys.readouterr().out


def test_the_report_as_json(plate: Path, capsys: Captured) -> None:
    assert run("topography", plate, "--json", "--holes", "fill") == 0
    found = json.loads(capsys.readouterr().out)
    true = MADE.truth()
    for name in ("sigma_0_um", "slope_x", "tau_y_um"):
        assert found["statistics"][name]["value"] == pytest.approx(true[name], rel=0.25)
    assert found["levelling"]["filled"] == found["levelling"]["holes"] > 0
    assert {(one["model"], one["wavelength_nm"]) for one in found["models"]} >= {
        ("he_torrance", 550.0),
        ("ggx", 10_600.0),
    }
    assert any("interpolated" in sentence for sentence in found["warnings"])


def test_a_recipe_of_four_materials_is_accepted(plate: Path, tmp_path: Path, capsys: Captured) -> None:
    recipe = tmp_path / "plate.toml"
    assert run("topography", plate, "--recipe", recipe, "--name", "plate", "--rho", "0.7") == 0
    report = capsys.readouterr().out
    assert "assumed     n = 1.5 and k = 0" in report
    content = tomllib.loads(recipe.read_text())
    jobs = Recipe.model_validate(content).jobs()
    assert [job.name for job in jobs] == ["plate-oren-nayar", "plate-he-torrance", "plate-ggx", "plate-beckmann"]
    for title, job in (("Oren-Nayar", jobs[0]), ("GGX", jobs[2]), ("Beckmann", jobs[3])):
        error = surface_error(job.material)
        assert error is not None
        assert f"    {title:<12}{error.sentence}\n" in report
    oren_nayar = content["define"]["plate-oren-nayar"]
    assert oren_nayar["parameters"]["rho"] == 0.7
    sources = jobs[0].material.attributes()["parameter_sources"]
    assert "rms slope" in sources["sigma_deg"]
    assert sources["interreflection"] == "default of the model; heights do not tell it"
    alpha = content["define"]["plate-ggx"]["parameters"]["alpha_x"]
    assert alpha == pytest.approx(np.sqrt(2.0) * MADE.truth()["slope_x"], rel=0.2)


def test_a_recipe_is_built_without_change(plate: Path, tmp_path: Path) -> None:
    recipe = tmp_path / "plate.toml"
    assert run("topography", plate, "--recipe", recipe, "--name", "plate") == 0
    text = recipe.read_text()
    only = text.replace(text.splitlines()[0], 'materials = ["plate-oren-nayar"]')
    recipe.write_text(only)
    assert run("build", recipe, "--store", tmp_path / "store", "--jobs", "1") == 0
    assert run("show", "plate-oren-nayar", "--store", tmp_path / "store") == 0


def test_models_whose_range_is_exceeded_are_left_out_and_named(tmp_path: Path, capsys: Captured) -> None:
    path, recipe = tmp_path / "rock.npy", tmp_path / "rock.toml"
    np.save(path, MADE.surface(0))
    options = [path, "--pixel-um", "25000", "--height-um", "25000"]  # sigma_0 is 12.5 mm
    assert run("topography", *options, "--recipe", recipe) == 0
    out = capsys.readouterr().out
    assert "  sigma_0     " in out
    assert "  left out    He-Torrance: sigma_0_um: " in out
    assert "3 materials" in out
    assert [job.name for job in Recipe.model_validate(tomllib.loads(recipe.read_text())).jobs()] == [
        *("rock-oren-nayar", "rock-ggx", "rock-beckmann"),
    ]
    assert run("topography", *options, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert list(found["left_out"]) == ["vmf_diffuse", "he_torrance"]
    assert {one["model"] for one in found["models"]} == {"oren_nayar", "ggx", "beckmann"}
    assert found["axes"].startswith("x along a row")


def test_pixels_and_noise_are_options(tmp_path: Path, capsys: Captured) -> None:
    made = replace(MADE, step_y=0.8)
    path = tmp_path / "map.png"
    given = write(path, made.measured(0))
    options = ["--height-um", given.height_um, "--hole-value", "0", "--noise-um", "0.02", "--pixel-um", "0.5,0.8"]
    assert run("topography", *options, path) == 0
    out = capsys.readouterr().out
    assert "80 x 128 um, pixels of 0.5 x 0.8 um, which are not square" in out
    assert "0.02 um, as given; taken out" in out


@pytest.mark.parametrize(
    ("file", "options", "sentence"),
    [
        ("map.npy", [], "--pixel-um: "),
        ("map.npy", ["--pixel-um", "0.5"], "--height-um: "),
        ("map.npy", ["--pixel-um", "1,2,3"], "--pixel-um: 3 numbers are given"),
        ("map.sdf", ["--pixel-um", "0.5"], "--pixel-um: "),
        ("map.sdf", ["--holes", "refuse"], "--holes: "),
        ("map.npy", ["--unit", "mm"], "states no lengths; give --pixel-um and --height-um instead"),
        ("map.sdf", ["--unit", "inch"], "--unit: 'inch' is not one of"),
        ("map.sdf", ["--noise-um", "9"], "--noise-um: 9 um is not at least 0"),
        ("map.sdf", ["--rho", "1.5"], "--rho: 1.5 is not in [0, 1]"),
        ("map.sdf", ["--name", "A B"], "--name: 'A B' is not made of"),
        ("map.sdf", ["--recipe", "plate.txt"], "--recipe: 'plate.txt' does not end in .toml"),
        ("map.sdf", ["--refractive-index", "Xx"], "--refractive-index: 'Xx' is no refractive index"),
        ("map.sdf", ["--refractive-index", "main/Xx/Yy"], "--refractive-index: "),
        ("map.sdf", ["--refractive-index", "main/Ag/Windt"], "--refractive-index: "),  # it ends in the ultraviolet
        ("missing.sdf", [], "missing.sdf: No such file or directory"),
    ],
)
def test_what_is_refused_is_a_sentence(
    file: str, options: list[str], sentence: str, tmp_path: Path, capsys: Captured
) -> None:
    path = tmp_path / file
    if file != "missing.sdf":
        write(path, MADE.measured(0))
    assert sentence in refused(capsys, "topography", path, *options)


@pytest.mark.parametrize(
    ("option", "height", "change"), [("--outliers", 3.0, lambda z: z[40:41, 50]), ("--steps", 0.5, lambda z: z[70:])]
)
def test_faults_of_a_map_are_refused_by_the_name_of_their_option(
    option: str, height: float, change: Callable[[Array], Array], tmp_path: Path, capsys: Captured
) -> None:
    measured = replace(MADE, holes=0.0).measured(0)
    change(measured.heights_um)[...] += height
    path = tmp_path / "map.sdf"
    write(path, measured)
    assert refused(capsys, "topography", path).startswith(f"{option}: ")
    assert run("topography", path, option, "keep") == 0
    assert "  warning     1 " in capsys.readouterr().out


def test_outliers_of_one_height_are_likely_a_number_for_missing_heights(tmp_path: Path, capsys: Captured) -> None:
    measured = replace(MADE, holes=0.0).measured(0)
    measured.heights_um[40:60:7, 50] = -999.0
    write(tmp_path / "map.sdf", measured)
    sentence = refused(capsys, "topography", tmp_path / "map.sdf")
    assert sentence.startswith("--outliers: 3 heights of 25600 are outliers")
    assert sentence.endswith("all are -999 um: if this stands for missing heights, give --hole-value -999")


@pytest.mark.parametrize(
    ("heights", "sentence"),
    [
        (np.zeros((64, 64)), "all heights are the same after levelling"),
        (np.random.default_rng(1).normal(size=(64, 64)), "pixels; 2 or more are needed: measure with a smaller pixel"),
        (np.zeros((64, 48, 3)), "an array of shape (64, 48, 3) is no map of heights"),
        (np.zeros((64, 64), complex), "numbers of type complex128 are no heights; real numbers of 16 bits or more"),
    ],
)
def test_a_fault_of_the_heights_is_named_with_the_file(
    heights: Array, sentence: str, tmp_path: Path, capsys: Captured
) -> None:
    path = tmp_path / "height_map.npy"  # which is also a key of recipes, and is repeated as it is
    np.save(path, heights)
    said = refused(capsys, "topography", "--pixel-um", "0.5", "--height-um", "1", path)
    assert said.startswith(f"{path}: ")
    assert sentence in said


def test_a_header_is_named_with_its_line(tmp_path: Path, capsys: Captured) -> None:
    path = tmp_path / "map.csv"
    path.write_text("# a plate\nleft,middle,right,end\n" + "1,2,3,4\n" * 40)
    said = refused(capsys, "topography", path, "--pixel-um", "0.5", "--height-um", "1")
    assert said.startswith(f"{path}: line 2 is no row of numbers: 'left,middle,right,end'; allowed are")
