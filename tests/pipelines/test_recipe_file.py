"""Recipes: what each field does, and one sentence with file and field for every way to get one wrong."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import brdfdb
from brdfdb.materials import Material, presets
from brdfdb.tables.grids import HALF_DIFFERENCE_AXES
from brdfdb.tables.layout import digest
from brdfdb.tables.planner import PLAN_VERSION
from brdfdb_pipelines import cli
from brdfdb_pipelines.recipe_file import Range, RecipeError, load

GOOD = """\
title = "one"
materials = ["foam"]
wavelengths_nm = [500, 550]
[grids.isotropic]
theta_i_deg = [{ start = 0, stop = 80, step = 40 }]
theta_r_deg = [0, 80]
delta_phi_deg = [0, 180]
[grids.spectral]
theta_i_deg = [0, 40]
theta_r_deg = [0, 40]
delta_phi_deg = [0, 90, 180]
[grids.anisotropic]
theta_i_deg = [0, 60]
phi_i_deg = [0, 180, 360]
theta_r_deg = [0, 60]
phi_r_deg = [0, 180, 360]
"""
DEFINED = """\
[define.mine]
title = "My own"
model = "ward"
source = "me"
[define.mine.parameters]
rho_d = 0.1
rho_s = 0.2
alpha_x = 0.3
alpha_y = 0.3
"""
SWEPT = (
    GOOD.replace('["foam"]', '["mine"]')
    + """\
[sweep.mine]
title = "My own"
model = "ward"
source = "me"
[sweep.mine.parameters]
alpha_x = [0.1, { start = 0.2, stop = 0.3, step = 0.1 }]
rho_d = 0.1
rho_s = [0.2, 0.4]
alpha_y = 0.3
"""
)
COPPER = GOOD.replace("foam", "scene-copper-sphere")


def tree(root: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in root.rglob("*") if path.is_file()}


def write(directory: Path, text: str, old: str = "", new: str = "") -> Path:
    """A recipe file in which `old` is replaced by `new`, once."""
    assert text.count(old) >= 1
    path = directory / "bad.toml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    return path


def changed(old: str, new: str, said: str, text: str = GOOD) -> object:
    return pytest.param(text, old, new, said, id=f"{new or 'without'} {'' if new else old}"[:60])


UNKNOWN = "unknown key"
BAD = [
    # unknown keys, at each level
    changed('title = "one"', "colour = 5", f"colour: {UNKNOWN}"),
    changed("[grids.isotropic]", "[grids.polar]\nx = 1\n[grids.isotropic]", f"grids.polar: {UNKNOWN}"),
    changed("delta_phi_deg = [0, 180]", "phi_r_deg = [0]", "grids.isotropic.delta_phi_deg: Field required"),
    changed("[grids.isotropic]\n", "[grids.isotropic]\nphi_i_deg = [0]\n", f"grids.isotropic.phi_i_deg: {UNKNOWN}"),
    changed("step = 40", "step = 40, count = 3", f"grids.isotropic.theta_i_deg.0.count: {UNKNOWN}"),
    changed('source = "me"', 'source = "me"\ncolour = "red"', "define.mine: colour: ", GOOD + DEFINED),
    # missing keys
    changed('materials = ["foam"]\n', "", "materials: Field required"),
    changed("wavelengths_nm = [500, 550]\n", "", "wavelengths_nm: Field required"),
    changed(", step = 40", "", "grids.isotropic.theta_i_deg.0.step: Field required"),
    changed('title = "My own"\n', "", "define.mine: title: Field required", GOOD + DEFINED),
    changed('model = "ward"\n', "", "define.mine: model: Field required", GOOD + DEFINED),
    changed("alpha_y = 0.3\n", "", "define.mine: alpha_y: missing", GOOD + DEFINED),
    changed("define.mine", "define.foam", "define.foam: is the name of a preset", GOOD + DEFINED),
    # another type
    changed('title = "one"', "title = 5", "title: "),
    changed('["foam"]', '"foam"', "materials: "),
    changed('["foam"]', "[5]", "materials.0: "),
    changed("[500, 550]", "500", "wavelengths_nm: "),
    changed("[500, 550]", '["500", 550]', "wavelengths_nm.0: "),
    changed("[500, 550]", "[500, true]", "wavelengths_nm.1: "),
    changed("[0, 80]", "[0, [80]]", "grids.isotropic.theta_r_deg.1: "),
    changed("[0, 80]", "[0, 1979-05-27]", "grids.isotropic.theta_r_deg.1: "),
    changed("[0, 80]", "{ start = 0, stop = 80, step = 1 }", "grids.isotropic.theta_r_deg: "),
    changed("step = 40", 'step = "40"', "grids.isotropic.theta_i_deg.0.step: "),
    changed("step = 40", "step = true", "grids.isotropic.theta_i_deg.0.step: "),
    changed('title = "one"', "define = 5", "define: "),
    changed('title = "one"', "define.mine = 5", "define.mine: "),
    # numbers that are none
    changed("[500, 550]", "[500, nan]", "wavelengths_nm.1: "),
    changed("[500, 550]", "[500, inf]", "wavelengths_nm.1: "),
    changed("[0, 80]", "[0, -inf]", "grids.isotropic.theta_r_deg.1: "),
    changed("[0, 80]", f"[0, 1{'0' * 400}]", "grids.isotropic.theta_r_deg.1: "),
    changed("step = 40", "step = nan", "grids.isotropic.theta_i_deg.0.step: "),
    changed("step = 40", "step = inf", "grids.isotropic.theta_i_deg.0.step: "),
    changed("stop = 80", "stop = inf", "grids.isotropic.theta_i_deg.0.stop: "),
    # ranges that lead nowhere
    changed("step = 40", "step = 30", "grids.isotropic.theta_i_deg: steps of 30 from 0 do not end at 80"),
    changed("step = 40", "step = 0", "grids.isotropic.theta_i_deg.0.step: "),
    changed("step = 40", "step = -40", "grids.isotropic.theta_i_deg.0.step: "),
    changed("start = 0", "start = 81", "grids.isotropic.theta_i_deg: steps of 40 from 81 do not end at 80"),
    changed("step = 40", "step = 1e-300", "grids.isotropic.theta_i_deg: steps of 1e-300 make more than"),
    changed("step = 40", "step = 1e-9", "grids.isotropic.theta_i_deg: steps of 1e-09 make more than"),
    changed("stop = 80, step = 40", "stop = 1e308, step = 1e-308", "grids.isotropic.theta_i_deg: steps of 1e-308"),
    # axes that are none
    changed("[0, 80]", "[0, 80, 40]", "grids.isotropic.theta_r_deg: the nodes must increase strictly"),
    changed("[0, 80]", "[0, 0, 80]", "grids.isotropic.theta_r_deg: the nodes must increase strictly"),
    changed("[0, 80]", "[]", "grids.isotropic.theta_r_deg: "),
    changed("[0, 80]", "[0]", "grids.isotropic.theta_r_deg: needs a list of at least two nodes"),
    changed("[0, 80]", "[10, 80]", "grids.isotropic.theta_r_deg: starts at 10 degrees, must start at 0"),
    changed("[0, 80]", "[0, 91]", "grids.isotropic.theta_r_deg: ends at 91 degrees, must end at or below 90"),
    changed("[0, 180]", "[0, 90]", "grids.isotropic.delta_phi_deg: ends at 90 degrees, must end at 180"),
    changed("phi_i_deg = [0, 180, 360]", "phi_i_deg = [0, 120]", "grids.anisotropic.phi_i_deg: ends at 120 degrees"),
    changed("[0, 80]", "[0, 90]", "foam on grids.isotropic: grid: theta of 90 degrees is a pole of foam"),
    # wavelengths
    changed("[500, 550]", "[]", "wavelengths_nm: "),
    changed("[500, 550]", "[550, 500]", "wavelengths_nm: must be positive and increase strictly"),
    changed("[500, 550]", "[500, 500]", "wavelengths_nm: must be positive and increase strictly"),
    changed("[500, 550]", "[0, 550]", "wavelengths_nm: must be positive and increase strictly"),
    changed("[500, 550]", "[100, 550]", "scene-copper-sphere on grids.spectral: wavelength_nm: 100 has no", COPPER),
    changed("[500, 550]", "[500, 9e9]", "scene-copper-sphere on grids.spectral: wavelength_nm: 9e+09 has no", COPPER),
    # materials
    changed('["foam"]', "[]", "materials: "),
    changed('["foam"]', '["foam", "fome"]', "materials: 'fome' matches no material; `brdfdb list --presets` names"),
    changed('["foam"]', '["foam", "steel-*"]', "materials: 'steel-*' matches no material"),
    changed('["foam"]', '["../foam"]', "materials: '../foam' matches no material"),
    changed("alpha_y = 0.3", "alpha_y = -1", "define.mine: alpha_y: -1 is outside ", GOOD + DEFINED),
    changed("alpha_y = 0.3", "alpha_y = nan", "define.mine: alpha_y: nan is outside ", GOOD + DEFINED),
    changed("alpha_y = 0.3", 'alpha_y = "0.3"', "define.mine: alpha_y: '0.3' is not a number", GOOD + DEFINED),
    changed("alpha_y = 0.3", "alpha_y = true", "define.mine: alpha_y: True is not a number", GOOD + DEFINED),
    changed("alpha_y = 0.3", "alpha_z = 0.3", "define.mine: alpha_z: 0.3 given, but the parameters", GOOD + DEFINED),
    changed('"ward"', '"wart"', "define.mine: model: 'wart' is not one of lambert, ", GOOD + DEFINED),
    changed('"ward"', '"he_torrance"', "define.mine: rho_d: 0.1 given, but the parameters of he_tor", GOOD + DEFINED),
    changed("[define.mine]", '[define."../x"]\nmodel = "lambert"\n[define.mine]', "define.../x: ", GOOD + DEFINED),
    # sweeps
    changed("[0.2, 0.4]", "[]", "sweep.mine.parameters.rho_s: List should have at least 1 item", SWEPT),
    changed("[0.2, 0.4]", "[0.2]", "sweep.mine.parameters.rho_s: needs a list of at least two values", SWEPT),
    changed("[0.2, 0.4]", "[0.4, 0.2]", "sweep.mine.parameters.rho_s: the values must increase strictly", SWEPT),
    changed("[0.2, 0.4]", "[0.2, 0.2]", "sweep.mine.parameters.rho_s: the values must increase strictly", SWEPT),
    changed("[0.2, 0.4]", '[0.2, "0.4"]', "sweep.mine.parameters.rho_s.1: Input should be a valid number", SWEPT),
    changed("[0.2, 0.4]", "[0.2, nan]", "sweep.mine.parameters.rho_s.1: Input should be a finite number", SWEPT),
    changed("[0.2, 0.4]", "[0.2, true]", "sweep.mine.parameters.rho_s.1: Input should be a valid number", SWEPT),
    changed("[0.2, 0.4]", "[0.2, [0.4]]", "sweep.mine.parameters.rho_s.1: ", SWEPT),
    changed("[0.2, 0.4]", "[0.2, 1.4]", "sweep.mine.parameters.rho_s: 1.4 is outside [0, 1]", SWEPT),
    changed("[0.2, 0.4]", "{ start = 0.2, stop = 0.4, step = 0.1 }", "sweep.mine.parameters.rho_s: {'start'", SWEPT),
    changed("step = 0.1", "step = 0.07", "sweep.mine.parameters.alpha_x: steps of 0.07 from 0.2 do not end", SWEPT),
    changed("step = 0.1", "steps = 2", "sweep.mine.parameters.alpha_x.1.step: Field required", SWEPT),
    changed("step = 0.1", "step = 1e-7", "sweep.mine.parameters.alpha_x: steps of 1e-07 make more than the", SWEPT),
    changed("step = 0.1", "step = 2e-6", "sweep.mine.parameters: the lists make 100004 members, more than", SWEPT),
    changed("rho_s = [0.2, 0.4]\n", "", "sweep.mine.parameters.rho_s: missing, ward needs a value in [0, 1]", SWEPT),
    changed("rho_d = 0.1", "rho_d = -1", "sweep.mine.parameters.rho_d: -1 is outside [0, 1]", SWEPT),
    changed("rho_d = 0.1", "rho_d = 0.1\nrho_x = [1, 2]", "sweep.mine.parameters.rho_x: 1.0 given, but the par", SWEPT),
    changed('"ward"', '"wart"', "sweep.mine: model: 'wart' is not one of lambert, ", SWEPT),
    changed('"ward"', "5", "sweep.mine: model: Input should be a valid string", SWEPT),
    changed('title = "My own"\n', "", "sweep.mine: title: Field required", SWEPT),
    changed('source = "me"\n', "", "sweep.mine: source: Field required", SWEPT),
    changed('source = "me"', 'source = "me"\ncolour = 5', "sweep.mine: colour: ", SWEPT),
    changed("[sweep.mine]", '[sweep."../x"]\n[sweep.mine]', "sweep.../x.parameters: give a list of numbers", SWEPT),
    changed("[sweep.mine]", "[sweep.Mine]\n[sweep.mine]", "sweep.Mine.parameters: give a list of numbers", SWEPT),
    changed("[sweep.mine.parameters]", "[sweep.mine.values]", "sweep.mine.parameters: give a list of numbers", SWEPT),
    changed("[sweep.mine.parameters]", "parameters = 5\n[sweep.mine.x]", "sweep.mine.parameters: give a list", SWEPT),
    changed("[sweep.mine]", DEFINED + "[sweep.mine]", "sweep.mine: 'mine' is the name of another material", SWEPT),
    changed("[sweep.mine]", DEFINED.replace("mine", "mine-002") + "[sweep.mine]", "sweep.mine: 'mine-002' is", SWEPT),
    changed('title = "one"', "sweep = 5", "sweep: "),
    # not TOML
    changed('title = "one"', "title = ", "not TOML: "),
    changed('title = "one"', 'title = "one', "not TOML: "),
    changed('title = "one"', 'title = "one"\ntitle = "two"', "not TOML: "),
]


def refused(path: Path, root: Path, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    """`build` says so in one sentence with file and field, and neither makes a store nor changes one."""
    before = tree(root.parent)
    assert cli.main(["build", str(path), "--store", str(root)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"brdfdb: {path}: {said}")
    assert err.count("\n") == 1
    assert tree(root.parent) == before


@pytest.mark.parametrize(("text", "old", "new", "said"), BAD)
def test_a_bad_recipe_is_one_sentence_and_nothing_is_written(
    text: str, old: str, new: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    refused(write(tmp_path, text, old, new), tmp_path / "store", said, capsys)
    assert not (tmp_path / "store").exists()


def test_a_bad_recipe_leaves_the_old_revision_served(
    tmp_path: Path, built: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    heads = {name: brdfdb.open(built).head(name) for name in brdfdb.open(built)}
    before = tree(built)
    refused(write(tmp_path, GOOD, "[0, 80]", "[0, 90]"), built, "foam on grids.isotropic: ", capsys)
    assert tree(built) == before
    store = brdfdb.open(built)
    store.verify("foam")
    assert {name: store.head(name) for name in store} == heads


@pytest.mark.parametrize(
    ("name", "said"),
    [("none.toml", "No such file or directory"), (".", "Is a directory"), ("file/none.toml", "Not a directory")],
)
def test_a_recipe_that_cannot_be_read_is_one_sentence(
    name: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    refused(tmp_path / name, tmp_path / "store", said, capsys)


@pytest.mark.parametrize("data", [b'title = "Gr\xf6\xdfe"', b"\xff\xfe\x00", b"\x00", b"PK\x03\x04\x00\x00\xe5"])
def test_a_file_of_something_else_is_one_sentence(
    data: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "bad.toml"
    path.write_bytes(data)
    refused(path, tmp_path / "store", "not TOML: ", capsys)


def test_recipes_are_utf8_whatever_the_locale_is(recipe: Path) -> None:
    environment = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    code = (
        "import codecs, locale, sys; from pathlib import Path; from brdfdb_pipelines.recipe_file import load\n"
        "assert codecs.lookup(locale.getpreferredencoding(False)).name == 'ascii'\n"
        "print(ascii(load(Path(sys.argv[1])).title))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, recipe], env=environment, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (0, ascii("Größe: one of every kind") + "\n"), done.stderr


# What the fields do


def recipe_of(directory: Path, text: str) -> Path:
    path = directory / "recipe.toml"
    path.write_text(text, encoding="utf-8")
    return path


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


@pytest.mark.parametrize("grids", [True, False], ids=["both", "neither"])
def test_a_recipe_names_either_a_tolerance_or_grids(tmp_path: Path, grids: bool) -> None:
    text = "tolerance = 0.01\n" + GOOD if grids else GOOD[: GOOD.index("[grids")]
    with pytest.raises(RecipeError, match=r"recipe\.toml: tolerance, grids: give one of the two$"):
        load(recipe_of(tmp_path, text))


HALF = """\
title = "one"
materials = ["glossy-grey-paper", "rolled-brass", "scene-copper-sphere"]
wavelengths_nm = [500, 550]
interpolation = "log-cubic"
[grids.isotropic]
theta_h_deg = [0, 2, 5, 10, 20, 45, 90]
theta_d_deg = [0, 45, 90]
phi_d_deg = [0, 45, 90]
[grids.spectral]
theta_i_deg = [0, 40]
theta_r_deg = [0, 40]
delta_phi_deg = [0, 90, 180]
[grids.anisotropic]
theta_h_deg = [0, 5, 90]
phi_h_deg = [0, 45, 90]
theta_d_deg = [0, 90]
phi_d_deg = [0, 90, 180]
"""


def test_grids_may_be_of_half_and_difference_vectors_and_cubic(tmp_path: Path) -> None:
    paper, brass, copper = load(recipe_of(tmp_path, HALF)).jobs()
    assert paper.grid is not None
    assert brass.grid is not None
    assert (paper.grid.names, brass.grid.copies) == (HALF_DIFFERENCE_AXES, 4)
    for job in (paper, brass, copper):
        how = job.layout().interpolation
        assert (how.method, how.logarithm, how.power) == ("cubic", True, 0.0)
        assert 0.0 < how.offset < 1e-3
        assert job.request["interpolation"] == "log-cubic"
    plain = load(recipe_of(tmp_path, HALF.replace('interpolation = "log-cubic"\n', ""))).jobs()
    assert all(job.layout().plain for job in plain)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"log-cubic"', '"quintic"', "interpolation: Input should be 'linear', 'cubic', 'log-linear' or 'log-cubic'"),
        ("phi_d_deg = [0, 45, 90]", "phi_d_deg = [0, 45, 91]", "grids.isotropic.phi_d_deg: ends at 91 degrees, must"),
        ("phi_d_deg = [0, 45, 90]\n", "", "grids.isotropic.phi_d_deg: Field required"),
        ("theta_d_deg = [0, 90]", "theta_r_deg = [0, 90]", "grids.anisotropic.theta_d_deg: Field required"),
    ],
)
def test_what_is_wrong_with_such_a_recipe_is_one_sentence(tmp_path: Path, old: str, new: str, said: str) -> None:
    with pytest.raises(RecipeError, match=rf"recipe\.toml: {re.escape(said)}"):
        load(recipe_of(tmp_path, HALF.replace(old, new)))


def test_an_interpolation_without_grids_is_refused(tmp_path: Path) -> None:
    text = 'tolerance = 0.01\ninterpolation = "cubic"\n' + GOOD[: GOOD.index("[grids")]
    with pytest.raises(RecipeError, match=r"interpolation: goes with grids"):
        load(recipe_of(tmp_path, text))


@pytest.mark.parametrize("tolerance", ["0", "0.00001", "0.9", "-1", "nan", '"small"'])
def test_a_tolerance_out_of_range_is_refused(tmp_path: Path, tolerance: str) -> None:
    with pytest.raises(RecipeError, match=r"recipe\.toml: tolerance: "):
        load(recipe_of(tmp_path, f"tolerance = {tolerance}\n" + GOOD[: GOOD.index("[grids")]))


def test_a_tolerance_is_a_plan_that_is_made_when_the_table_is_laid_out(tmp_path: Path) -> None:
    (job,) = load(recipe_of(tmp_path, "tolerance = 0.05\n" + GOOD[: GOOD.index("[grids")])).jobs()
    assert (job.grid, job.tolerance) == (None, 0.05)
    assert job.request["grid"] is None
    assert job.request["plan_version"] == PLAN_VERSION
    assert job.layout().reason.startswith("for a tolerance of 0.05, ")


def test_the_kind_of_a_material_chooses_its_grid(tmp_path: Path) -> None:
    names = ["foam", "rolled-brass", "scene-copper-sphere", "blue-plastic"]
    text = GOOD.replace('["foam"]', str(names))
    jobs = {job.material.name: job for job in load(recipe_of(tmp_path, text)).jobs()}
    assert {name: job.grid.shape for name, job in jobs.items()} == {
        "foam": (3, 2, 2),
        "rolled-brass": (2, 3, 2, 3),
        "scene-copper-sphere": (2, 2, 3),
        "blue-plastic": (3, 2, 2),  # stated at one wavelength: as many values as a grey one
    }
    assert {name: job.layout().size for name, job in jobs.items()} == {
        "foam": 12, "rolled-brass": 36, "scene-copper-sphere": 24, "blue-plastic": 12,
    }  # fmt: skip
    wavelengths = {name: job.wavelength_nm for name, job in jobs.items()}
    assert wavelengths["foam"] is None
    assert wavelengths["scene-copper-sphere"] is not None
    assert wavelengths["scene-copper-sphere"].tolist() == [500.0, 550.0]
    assert wavelengths["blue-plastic"] is not None
    assert wavelengths["blue-plastic"].tolist() == list(presets()["blue-plastic"].wavelengths_nm or ())


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
    text = GOOD.replace('["foam"]', str(patterns)) + DEFINED
    names = [job.material.name for job in load(recipe_of(tmp_path, text)).jobs()]
    assert names == chosen


def test_a_defined_material_is_what_was_written(tmp_path: Path) -> None:
    (job,) = load(recipe_of(tmp_path, GOOD.replace('["foam"]', '["mine"]') + DEFINED)).jobs()
    assert job.material.parameters == {"rho_d": 0.1, "rho_s": 0.2, "alpha_x": 0.3, "alpha_y": 0.3}
    assert (job.material.title, job.material.source) == ("My own", "me")
    assert job.grid.shape == (3, 2, 2)


def test_a_sweep_is_a_material_for_each_of_its_values(tmp_path: Path) -> None:
    recipe = load(recipe_of(tmp_path, SWEPT))
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
    recipe = load(recipe_of(tmp_path, SWEPT.replace('["mine"]', str(patterns))))
    jobs = recipe.jobs()
    assert sum(job.family is not None for job in jobs) == members
    sweeps = recipe.sweeps(jobs)
    assert len(sweeps) == whole
    assert all(sweep.members == sorted(sweep.members) for sweep in sweeps)


def test_angles_of_a_sweep_are_degrees_and_numbers_are_what_was_meant(tmp_path: Path) -> None:
    text = SWEPT[: SWEPT.index("[sweep.mine.parameters]")].replace("ward", "oren_nayar") + (
        "[sweep.mine.parameters]\nrho = [{ start = 0.1, stop = 0.7, step = 0.1 }]\nsigma_deg = [0, 20]\n"
    )
    recipe = load(recipe_of(tmp_path, text))
    jobs = recipe.jobs()
    assert jobs[-1].material.parameters["sigma"] == np.deg2rad(20.0)
    assert jobs[-1].material.title == "My own, rho 0.7, sigma_deg 20"
    assert recipe.sweeps(jobs)[0].axes == {
        "rho": [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7], "sigma_deg": [0.0, 20.0]
    }  # fmt: skip


def test_what_a_material_that_is_no_member_asks_for_does_not_say_family(tmp_path: Path) -> None:
    (job,) = load(recipe_of(tmp_path, GOOD)).jobs()
    assert "family" not in job.request


def test_more_lists_than_a_lookup_can_take_are_refused(tmp_path: Path) -> None:
    lists = "".join(f"x{number} = [0, 1]\n" for number in range(7))
    text = SWEPT.replace("rho_s = [0.2, 0.4]\n", lists).replace("[0.1, {", "0.1 # [0.1, {")
    with pytest.raises(RecipeError, match=r"sweep\.mine\.parameters: 7 are lists, at most 6 may be$"):
        load(recipe_of(tmp_path, text))


def test_a_defined_material_that_nobody_asked_for_is_checked_and_not_built(tmp_path: Path) -> None:
    assert [job.material.name for job in load(recipe_of(tmp_path, GOOD + DEFINED)).jobs()] == ["foam"]


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


def test_a_range_of_more_nodes_than_any_memory_holds_is_refused() -> None:
    with pytest.raises(RecipeError, match=r"^theta: steps of 1e-09 make more than the 100000 nodes an axis may have$"):
        Range(start=0.0, stop=90.0, step=1e-9).nodes("theta")


def test_the_request_in_a_table_is_that_of_the_recipe(recipe: Path, built: Path) -> None:
    for job in load(recipe).jobs():
        written = brdfdb.open(built).metadata(job.material.name).request
        assert written == json.loads(json.dumps(job.request))
        assert Material.model_validate(written["material"]) == job.material
