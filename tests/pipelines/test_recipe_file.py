"""Recipes: what each field does."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from brdfdb.materials import Material, presets
from brdfdb.tables.grids import HALF_DIFFERENCE_AXES
from brdfdb.tables.layout import digest
from brdfdb.tables.planner import PLAN_VERSION
from brdfdb_pipelines.recipe_file import Job, Members, load
from brdfdb_pipelines.recipe_grids import Range, RecipeError
from tests.pipelines.recipes import DEFINED, GOOD, HALF, SWEPT, TO_TOLERANCE, isotropic, recipe_file_of


def jobs_of(directory: Path, text: str) -> list[Job]:
    return load(recipe_file_of(directory, text)).jobs()


def test_what_no_material_needs_may_be_left_out(tmp_path: Path) -> None:
    (job,) = jobs_of(tmp_path, f'materials = ["foam"]\n{isotropic()}')
    assert (job.wavelength_nm, job.layout().shape) == (None, (2, 2, 2))
    (job,) = jobs_of(tmp_path, 'materials = ["rolled-brass"]\ntolerance = 0.1\n')
    assert job.tolerance == 0.1


def test_every_preset_is_a_job_of_the_default_recipe() -> None:
    jobs = load().jobs()
    assert [job.material.name for job in jobs] == list(presets())
    assert len(jobs) == 59
    for job in jobs:
        assert (job.grid, job.tolerance) == (None, 0.01)
        assert (job.wavelength_nm is not None) == job.material.spectral
        stated = job.material.wavelengths_nm
        if job.wavelength_nm is not None:
            wavelengths = np.arange(380.0, 781.0, 10.0) if stated is None else np.array(stated)
            assert job.wavelength_nm.tolist() == wavelengths.tolist()


def test_the_default_recipe_tabulates_facets_where_the_paper_prints_a_fit(tmp_path: Path) -> None:
    named = {name for name, material in presets().items() if material.model == "oren_nayar"}
    jobs = {job.material.name: job for job in load().jobs()}
    assert {name for name, job in jobs.items() if job.planned_on is not None} == named
    vase = jobs["clay-vase"]
    assert vase.material.model == "oren_nayar_gaussian"
    assert vase.planned_on == presets()["clay-vase"]
    assert vase.request["planned_on"]["material"]["model"] == "oren_nayar"
    assert {job.material.model for name, job in jobs.items() if name not in named} == {
        *("ward", "lambert", "he_torrance", "oren_nayar_body_surface")
    }
    (fit,) = jobs_of(tmp_path, 'materials = ["clay-vase"]\ntolerance = 0.1\n')
    assert (fit.material, fit.planned_on) == (presets()["clay-vase"], None)
    assert "planned_on" not in fit.request


def test_members_of_a_family_keep_their_formula(tmp_path: Path) -> None:
    sweep = """
materials = ["rough"]
tolerance = 0.1
forms = "exact"
[sweep.rough]
title = "Rough"
model = "oren_nayar"
source = "a sweep"
parameters = { rho = 0.5, sigma_deg = [10, 20] }
"""
    jobs = jobs_of(tmp_path, sweep)
    assert [(job.material.model, job.planned_on) for job in jobs] == [("oren_nayar", None)] * 2


def test_grids_may_be_of_half_and_difference_vectors_and_cubic(tmp_path: Path) -> None:
    paper, brass, copper = jobs_of(tmp_path, HALF)
    assert paper.grid is not None
    assert brass.grid is not None
    assert (paper.grid.names, brass.grid.copies) == (HALF_DIFFERENCE_AXES, 4)
    for job in (paper, brass, copper):
        how = job.layout().interpolation
        assert (how.method, how.logarithm, how.power) == ("cubic", True, 0.0)
        assert 0.0 < how.offset < 1e-3
        assert job.request["interpolation"] == "log-cubic"
    plain = jobs_of(tmp_path, HALF.replace('interpolation = "log-cubic"\n', ""))
    assert all(job.layout().plain for job in plain)


def test_a_tolerance_is_a_plan_that_is_made_when_the_table_is_laid_out(tmp_path: Path) -> None:
    (job,) = jobs_of(tmp_path, TO_TOLERANCE)
    assert (job.grid, job.tolerance) == (None, 0.05)
    assert job.request["grid"] is None
    assert job.request["plan_version"] == PLAN_VERSION
    assert job.layout().reason.startswith("for a tolerance of 0.05, ")


def test_the_kind_of_a_material_chooses_its_grid(tmp_path: Path) -> None:
    names = ["foam", "rolled-brass", "scene-copper-sphere", "blue-plastic"]
    jobs = jobs_of(tmp_path, GOOD.replace('["foam"]', str(names)))
    assert [job.name for job in jobs] == names
    # blue-plastic is stated at one wavelength: it has as many values as a grey material
    assert [job.grid and job.grid.shape for job in jobs] == [(3, 2, 2), (2, 3, 2, 3), (2, 2, 3), (3, 2, 2)]
    assert [job.layout().size for job in jobs] == [12, 36, 24, 12]
    wavelengths = [None if job.wavelength_nm is None else job.wavelength_nm.tolist() for job in jobs]
    assert wavelengths == [None, None, [500.0, 550.0], list(presets()["blue-plastic"].wavelengths_nm or ())]


@pytest.mark.parametrize(
    ("patterns", "chosen"),
    [
        (["foam"], ["foam"]),
        (["rolled-*"], ["rolled-brass", "rolled-aluminum"]),
        (["rolled-brass", "rolled-*", "rolled-brass"], ["rolled-brass", "rolled-aluminum"]),
        (["rolled-?rass"], ["rolled-brass"]),
        (["mine"], ["mine"]),
        (["m*e"], ["mine"]),
    ],
)
def test_patterns_choose_each_material_once(patterns: list[str], chosen: list[str], tmp_path: Path) -> None:
    jobs = jobs_of(tmp_path, GOOD.replace('["foam"]', str(patterns)) + DEFINED)
    assert [job.name for job in jobs] == chosen


def test_a_defined_material_is_what_was_written(tmp_path: Path) -> None:
    (job,) = jobs_of(tmp_path, GOOD.replace('["foam"]', '["mine"]') + DEFINED)
    assert job.material.parameters == {"rho_d": 0.1, "rho_s": 0.2, "alpha_x": 0.3, "alpha_y": 0.3}
    assert (job.material.title, job.material.source) == ("My own", "me")
    (other,) = jobs_of(tmp_path, GOOD + DEFINED)  # it is checked, and not built where no name asks for it
    assert other.name == "foam"
    assert "family" not in other.request


def test_a_sweep_is_a_material_for_each_of_its_values(tmp_path: Path) -> None:
    recipe = load(recipe_file_of(tmp_path, SWEPT))
    jobs = recipe.jobs()
    assert [job.material.name for job in jobs] == [f"mine-{number:03d}" for number in range(1, 7)]
    # in the order of the model's parameters, not of the file's: the last runs fastest
    assert [(job.material.parameters["rho_s"], job.material.parameters["alpha_x"]) for job in jobs] == [
        (0.2, 0.1), (0.2, 0.2), (0.2, 0.3), (0.4, 0.1), (0.4, 0.2), (0.4, 0.3),
    ]  # fmt: skip
    assert jobs[1].material.title == "My own, rho_s 0.2, alpha_x 0.2"
    assert jobs[1].request["family"] == {"name": "mine", "parameters": {"rho_s": 0.2, "alpha_x": 0.2}}
    assert [job.material.anisotropic for job in jobs] == [True, True, False] * 2
    (sweep,) = recipe.sweeps(jobs)
    assert sweep.axes == {"rho_s": [0.2, 0.4], "alpha_x": [0.1, 0.2, 0.3]}
    assert sweep.members == [job.material.name for job in jobs]
    assert sweep.request_sha256 == [digest(job.request) for job in jobs]


@pytest.mark.parametrize(
    ("patterns", "members", "whole"),
    [
        (["mine"], 6, True),
        (["m?ne"], 6, True),
        (["mine-*"], 6, True),
        (["mine-004", "mine"], 6, True),
        (["mine-00[1-3]"], 3, False),
        (["foam"], 0, False),
    ],
)
def test_the_name_of_a_family_chooses_all_members(
    patterns: list[str], members: int, whole: bool, tmp_path: Path
) -> None:
    recipe = load(recipe_file_of(tmp_path, SWEPT.replace('["mine"]', str(patterns))))
    jobs = recipe.jobs()
    assert sum(job.family is not None for job in jobs) == members
    sweeps = recipe.sweeps(jobs)
    assert len(sweeps) == whole
    assert all(sweep.members == sorted(sweep.members) for sweep in sweeps)


def test_angles_of_a_sweep_are_degrees_and_numbers_are_what_was_meant(tmp_path: Path) -> None:
    text = SWEPT[: SWEPT.index("[sweep.mine.parameters]")].replace("ward", "oren_nayar") + (
        "[sweep.mine.parameters]\nrho = [{ start = 0.1, stop = 0.7, step = 0.1 }]\nsigma_deg = [0, 20]\n"
    )
    recipe = load(recipe_file_of(tmp_path, text))
    jobs = recipe.jobs()
    assert jobs[-1].material.parameters["sigma"] == np.deg2rad(20.0)
    assert jobs[-1].material.title == "My own, rho 0.7, sigma_deg 20"
    assert recipe.sweeps(jobs)[0].axes == {
        "rho": [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7], "sigma_deg": [0.0, 20.0]
    }  # fmt: skip


def test_members_are_the_materials_that_would_be_written_alone(tmp_path: Path) -> None:
    text = SWEPT[: SWEPT.index("[sweep.mine.parameters]")].replace("ward", "oren_nayar") + (
        "[sweep.mine.parameters]\nrho = [0.1, 0.7]\nsigma_deg = [0, 20, 60]\n"
    )
    for job in jobs_of(tmp_path, text):
        assert job.family is not None
        table = {"title": job.material.title, "model": "oren_nayar", "source": "me"}
        alone = Material.from_table(job.name, {**table, "parameters": job.family["parameters"]})
        assert alone == job.material


@pytest.mark.parametrize(
    ("parameters", "named", "value"),
    [
        ("rho = [0.1, 0.7]\nsigma_deg = [0, 100, 200]", "sigma_deg", "100 "),
        ("rho = [0.1, 1.5, 2.5]\nsigma_deg = [0, 20]", "rho", "1.5 "),
        ("rho = [0.1, 1.5]\nsigma_deg = [-10, 20]", "sigma_deg", "-10 "),
    ],
)
def test_the_first_member_outside_of_the_range_is_named(
    parameters: str, named: str, value: str, tmp_path: Path
) -> None:
    text = SWEPT[: SWEPT.index("[sweep.mine.parameters]")].replace("ward", "oren_nayar")
    with pytest.raises(RecipeError, match=f"parameters.{named}: {value}is outside"):
        jobs_of(tmp_path, f"{text}[sweep.mine.parameters]\n{parameters}\n")


def test_members_take_no_memory_until_they_are_built(tmp_path: Path) -> None:
    text = SWEPT[: SWEPT.index("[sweep.mine.parameters]")].replace("ward", "oren_nayar") + (
        "[sweep.mine.parameters]\nrho = [{ start = 0.1, stop = 0.9, step = 0.01 }]\n"
        "sigma_deg = [{ start = 1, stop = 80, step = 0.1 }]\n"
    )
    path = recipe_file_of(tmp_path, text)
    load(path)  # loads the presets and the model
    tracemalloc.start()
    (members,) = load(path).orders()
    used = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert isinstance(members, Members)
    assert len(members.numbers) == 64_071
    assert used < 10_000_000  # reading any file takes 4 MB


@pytest.mark.parametrize(
    ("start", "stop", "step", "nodes"),
    [
        (0.0, 0.3, 0.1, [0.0, 0.1, 0.2, 0.3]),
        (380.0, 780.0, 200.0, [380.0, 580.0, 780.0]),
        (5.0, 5.0, 1.0, [5.0]),
        (0.0, 1.0, 1.0 / 3.0, [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0]),
    ],
)
def test_a_range_includes_both_ends(start: float, stop: float, step: float, nodes: list[float]) -> None:
    found = Range(start=start, stop=stop, step=step).nodes("theta")
    np.testing.assert_allclose(found, nodes, rtol=1e-15)
    assert (found[0], found[-1]) == (start, stop)


# Wavelengths of spectra

MOON = """
title = "Moon"
model = "hapke"
source = "a test"
[{table}.parameters]
w = {{ wavelengths_nm = [415, 689], values = [0.21, 0.5] }}
b = 0.24
c = 0.6
b_0 = 1.0
h = {h}
theta_bar_deg = 20
"""


def moon(kind: str, h: str, how: str) -> str:
    head = f'materials = ["moon"]\nwavelengths_nm = [415, 689]\n{how}\n[{kind}.moon]'
    return head + MOON.format(table=f"{kind}.moon", h=h)


def test_a_tolerance_adds_wavelengths_between_those_of_spectra(tmp_path: Path) -> None:
    (job,) = jobs_of(tmp_path, moon("define", "0.07", "tolerance = 0.05"))
    assert job.request["wavelength_nm"] == [415.0, 689.0]
    layout = job.layout()
    assert layout.wavelength_nm is not None
    assert {415.0, 689.0} < set(layout.wavelength_nm.tolist())
    assert layout.interpolation.wavelengths == "linear"


def test_grids_and_families_keep_the_wavelengths_of_the_recipe(tmp_path: Path) -> None:
    (on_grid,) = jobs_of(tmp_path, moon("define", "0.07", isotropic(kind="spectral")))
    members = jobs_of(tmp_path, moon("sweep", "[0.07, 0.1]", "tolerance = 0.05"))
    assert len(members) == 2
    for job in (on_grid, *members):
        layout = job.layout()
        assert layout.wavelength_nm is not None
        assert layout.wavelength_nm.tolist() == [415.0, 689.0]
        assert layout.interpolation.wavelengths == "linear"


def test_a_tolerance_near_the_light_is_part_of_the_request(tmp_path: Path) -> None:
    text = moon("define", "0.07", "tolerance = 0.05")
    (plain,) = jobs_of(tmp_path, text)
    (spot,) = jobs_of(tmp_path, text.replace("0.05", "0.05\nhot_spot_tolerance = 0.1", 1))
    assert "hot_spot_tolerance" not in plain.request
    assert spot.request == plain.request | {"hot_spot_tolerance": 0.1}
