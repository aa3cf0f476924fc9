"""Recipes that are wrong: one sentence with file and field, and nothing is written."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import brdfdb
from brdfdb_pipelines import cli
from tests.pipelines.recipes import DEFINED, GOOD, SWEPT

COPPER = GOOD.replace("foam", "scene-copper-sphere")
PLAIN = """\
theta_i_deg = [{ start = 0, stop = 80, step = 40 }]
theta_r_deg = [0, 80]
delta_phi_deg = [0, 180]
"""


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
    changed("delta_phi_deg = [0, 180]", "phi_r_deg = [0]", "grids.isotropic.delta_phi_deg: is missing"),
    changed("[grids.isotropic]\n", "[grids.isotropic]\nphi_i_deg = [0]\n", f"grids.isotropic.phi_i_deg: {UNKNOWN}"),
    changed("step = 40", "step = 40, count = 3", f"grids.isotropic.theta_i_deg.0.count: {UNKNOWN}"),
    changed('source = "me"', 'source = "me"\ncolour = "red"', "define.mine: colour: ", GOOD + DEFINED),
    # missing keys
    changed('materials = ["foam"]\n', "", "materials: is missing"),
    changed("wavelengths_nm = [500, 550]\n", "", "wavelengths_nm: is missing; scene-copper-sphere is spec", COPPER),
    changed(
        "[grids.isotropic]\n" + PLAIN,
        "",
        "grids.isotropic: is missing; foam needs it",
    ),
    changed('title = "one"', "tolerance = 5", "tolerance: 5 must be at most 0.5; 0.01 is 1 %"),
    changed(", step = 40", "", "grids.isotropic.theta_i_deg.0.step: is missing"),
    changed('title = "My own"\n', "", "define.mine: title: is missing", GOOD + DEFINED),
    changed('model = "ward"\n', "", "define.mine: model: is missing", GOOD + DEFINED),
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
    changed(
        '["foam"]',
        '["foam", "fome"]',
        "materials: 'fome' matches no material; closest: foam; `brdfdb list --presets` names",
    ),
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
    changed("[0.2, 0.4]", "[]", "sweep.mine.parameters.rho_s: has 0 values, needs at least 1", SWEPT),
    changed("[0.2, 0.4]", "[0.2]", "sweep.mine.parameters.rho_s: needs a list of at least two values", SWEPT),
    changed("[0.2, 0.4]", "[0.4, 0.2]", "sweep.mine.parameters.rho_s: the values must increase strictly", SWEPT),
    changed("[0.2, 0.4]", "[0.2, 0.2]", "sweep.mine.parameters.rho_s: the values must increase strictly", SWEPT),
    changed("[0.2, 0.4]", '[0.2, "0.4"]', "sweep.mine.parameters.rho_s.1: '0.4' is not a number", SWEPT),
    changed("[0.2, 0.4]", "[0.2, nan]", "sweep.mine.parameters.rho_s.1: nan is not a finite number", SWEPT),
    changed("[0.2, 0.4]", "[0.2, true]", "sweep.mine.parameters.rho_s.1: True is not a number", SWEPT),
    changed("[0.2, 0.4]", "[0.2, [0.4]]", "sweep.mine.parameters.rho_s.1: ", SWEPT),
    changed("[0.2, 0.4]", "[0.2, 1.4]", "sweep.mine.parameters.rho_s: 1.4 is outside [0, 1]", SWEPT),
    changed(
        "[0.2, 0.4]",
        "{ start = 0.2, stop = 0.4, step = 0.1 }",
        "sweep.mine.parameters.rho_s: a spectrum with start",
        SWEPT,
    ),
    changed("step = 0.1", "step = 0.07", "sweep.mine.parameters.alpha_x: steps of 0.07 from 0.2 do not end", SWEPT),
    changed("step = 0.1", "steps = 2", "sweep.mine.parameters.alpha_x.1.step: is missing", SWEPT),
    changed("step = 0.1", "step = 1e-7", "sweep.mine.parameters.alpha_x: steps of 1e-07 make more than the", SWEPT),
    changed("step = 0.1", "step = 2e-6", "sweep.mine.parameters: the lists make 100004 members, more than", SWEPT),
    changed("rho_s = [0.2, 0.4]\n", "", "sweep.mine.parameters.rho_s: missing, ward needs a value in [0, 1]", SWEPT),
    changed("rho_d = 0.1", "rho_d = -1", "sweep.mine.parameters.rho_d: -1 is outside [0, 1]", SWEPT),
    changed("rho_d = 0.1", "rho_d = 0.1\nrho_x = [1, 2]", "sweep.mine.parameters.rho_x: 1.0 given, but the par", SWEPT),
    changed('"ward"', '"wart"', "sweep.mine: model: 'wart' is not one of lambert, ", SWEPT),
    changed('"ward"', "5", "sweep.mine: model: 5 is not a text", SWEPT),
    changed('title = "My own"\n', "", "sweep.mine: title: is missing", SWEPT),
    changed('source = "me"\n', "", "sweep.mine: source: is missing", SWEPT),
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
