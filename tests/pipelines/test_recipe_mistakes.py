"""Recipes that are wrong: one sentence with file and field, and nothing is written."""

from __future__ import annotations

from pathlib import Path

import brdfdb
from tests.pipelines.command import Captured, refused
from tests.pipelines.recipes import DEFINED, GOOD, HALF, SWEPT, TO_TOLERANCE, isotropic

COPPER = GOOD.replace("foam", "scene-copper-sphere")
PLAIN = isotropic("[{ start = 0, stop = 80, step = 40 }]", viewer="[0, 80]")


def tree(root: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in root.rglob("*") if path.is_file()}


def write(directory: Path, text: str, old: str = "", new: str = "") -> Path:
    """A recipe file in which `old` is replaced by `new`, once."""
    assert text.count(old) >= 1
    path = directory / "bad.toml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    return path


SEVEN_LISTS = "".join(f"x{number} = [0, 1]\n" for number in range(7))
# A recipe, the text that is replaced in it, the text in its place, and the field that the sentence names
BAD: list[tuple[str, str, str, str]] = [
    # unknown keys, at each level
    (GOOD, 'title = "one"', "colour = 5", "colour: unknown key"),
    (GOOD, "[grids.isotropic]", "[grids.polar]\nx = 1\n[grids.isotropic]", "grids.polar: unknown key"),
    (GOOD, "delta_phi_deg = [0, 180]", "phi_r_deg = [0]", "grids.isotropic.delta_phi_deg: "),
    (GOOD, "[grids.isotropic]\n", "[grids.isotropic]\nphi_i_deg = [0]\n", "grids.isotropic.phi_i_deg: unknown key"),
    (GOOD, "step = 40", "step = 40, count = 3", "grids.isotropic.theta_i_deg.0.count: unknown key"),
    # missing keys
    (GOOD, 'materials = ["foam"]\n', "", "materials: "),
    (COPPER, "wavelengths_nm = [500, 550]\n", "", "wavelengths_nm: "),
    (GOOD, PLAIN, "", "grids.isotropic: "),
    (GOOD, ", step = 40", "", "grids.isotropic.theta_i_deg.0.step: "),
    (GOOD + DEFINED, "define.mine", "define.foam", "define.foam: "),
    # another type
    (GOOD, '["foam"]', "[5]", "materials.0: "),
    (GOOD, "[500, 550]", '["500", 550]', "wavelengths_nm.0: "),
    (GOOD, "[500, 550]", "[500, true]", "wavelengths_nm.1: "),
    (GOOD, "[0, 80]", "[0, [80]]", "grids.isotropic.theta_r_deg.1: "),
    (GOOD, "[0, 80]", "[0, 1979-05-27]", "grids.isotropic.theta_r_deg.1: "),
    (GOOD, "[0, 80]", "{ start = 0, stop = 80, step = 1 }", "grids.isotropic.theta_r_deg: "),
    (GOOD, "step = 40", 'step = "40"', "grids.isotropic.theta_i_deg.0.step: "),
    (GOOD, "step = 40", "step = true", "grids.isotropic.theta_i_deg.0.step: "),
    (GOOD, 'title = "one"', "define = 5", "define: "),
    (GOOD, 'title = "one"', "define.mine = 5", "define.mine: "),
    # numbers that are none
    (GOOD, "[500, 550]", "[500, nan]", "wavelengths_nm.1: "),
    (GOOD, "[0, 80]", f"[0, 1{'0' * 400}]", "grids.isotropic.theta_r_deg.1: "),
    (GOOD, "step = 40", "step = nan", "grids.isotropic.theta_i_deg.0.step: "),
    (GOOD, "stop = 80", "stop = inf", "grids.isotropic.theta_i_deg.0.stop: "),
    # ranges that lead nowhere
    (GOOD, "step = 40", "step = 30", "grids.isotropic.theta_i_deg: "),
    (GOOD, "step = 40", "step = 0", "grids.isotropic.theta_i_deg.0.step: "),
    (GOOD, "start = 0", "start = 81", "grids.isotropic.theta_i_deg: "),
    (GOOD, "step = 40", "step = 1e-300", "grids.isotropic.theta_i_deg: "),
    (GOOD, "stop = 80, step = 40", "stop = 1e308, step = 1e-308", "grids.isotropic.theta_i_deg: "),
    # axes that are none
    (GOOD, "[0, 80]", "[0, 80, 40]", "grids.isotropic.theta_r_deg: "),
    (GOOD, "[0, 80]", "[]", "grids.isotropic.theta_r_deg: "),
    (GOOD, "[0, 80]", "[10, 80]", "grids.isotropic.theta_r_deg: "),
    (GOOD, "[0, 80]", "[0, 91]", "grids.isotropic.theta_r_deg: "),
    (GOOD, "[0, 180]", "[0, 90]", "grids.isotropic.delta_phi_deg: "),
    (GOOD, "phi_i_deg = [0, 180, 360]", "phi_i_deg = [0, 120]", "grids.anisotropic.phi_i_deg: "),
    (GOOD, "[0, 80]", "[0, 90]", "foam on grids.isotropic: grid: "),
    # wavelengths
    (GOOD, "[500, 550]", "[]", "wavelengths_nm: "),
    (GOOD, "[500, 550]", "[550, 500]", "wavelengths_nm: "),
    (GOOD, "[500, 550]", "[0, 550]", "wavelengths_nm: "),
    (COPPER, "[500, 550]", "[100, 550]", "scene-copper-sphere on grids.spectral: wavelength_nm: "),
    (COPPER, "[500, 550]", "[500, 9e9]", "scene-copper-sphere on grids.spectral: wavelength_nm: "),
    # materials
    (GOOD, '["foam"]', "[]", "materials: "),
    (GOOD, '["foam"]', '["foam", "fome"]', "materials: 'fome' matches no material; closest: foam"),
    (GOOD, '["foam"]', '["../foam"]', "materials: '../foam' "),
    (GOOD + DEFINED, "alpha_y = 0.3", "alpha_y = -1", "define.mine: alpha_y: "),
    (GOOD + DEFINED, '"ward"', '"wart"', "define.mine: model: "),
    (GOOD + DEFINED, "[define.mine]", '[define."../x"]\nmodel = "lambert"\n[define.mine]', "define.../x: "),
    # sweeps
    (SWEPT, "[0.2, 0.4]", "[]", "sweep.mine.parameters.rho_s: "),
    (SWEPT, "[0.2, 0.4]", "[0.2]", "sweep.mine.parameters.rho_s: "),
    (SWEPT, "[0.2, 0.4]", "[0.4, 0.2]", "sweep.mine.parameters.rho_s: "),
    (SWEPT, "[0.2, 0.4]", '[0.2, "0.4"]', "sweep.mine.parameters.rho_s.1: "),
    (SWEPT, "[0.2, 0.4]", "[0.2, nan]", "sweep.mine.parameters.rho_s.1: "),
    (SWEPT, "[0.2, 0.4]", "[0.2, 1.4]", "sweep.mine.parameters.rho_s: "),
    (SWEPT, "[0.2, 0.4]", "{ start = 0.2, stop = 0.4, step = 0.1 }", "sweep.mine.parameters.rho_s: "),
    (SWEPT, "step = 0.1", "step = 0.07", "sweep.mine.parameters.alpha_x: "),
    (SWEPT, "step = 0.1", "steps = 2", "sweep.mine.parameters.alpha_x.1.step: "),
    (SWEPT, "step = 0.1", "step = 1e-7", "sweep.mine.parameters.alpha_x: "),
    (SWEPT, "step = 0.1", "step = 2e-6", "sweep.mine.parameters: "),
    (SWEPT, "rho_s = [0.2, 0.4]\n", SEVEN_LISTS, "sweep.mine.parameters: "),
    (SWEPT, "rho_s = [0.2, 0.4]\n", "", "sweep.mine.parameters.rho_s: "),
    (SWEPT, "rho_d = 0.1", "rho_d = 0.1\nrho_x = [1, 2]", "sweep.mine.parameters.rho_x: "),
    (SWEPT, '"ward"', '"wart"', "sweep.mine: model: "),
    (SWEPT, '"ward"', "5", "sweep.mine: model: "),
    (SWEPT, 'title = "My own"\n', "", "sweep.mine: title: "),
    (SWEPT, "[sweep.mine]", '[sweep."../x"]\n[sweep.mine]', "sweep.../x.parameters: "),
    (SWEPT, "[sweep.mine]", "[sweep.Mine]\n[sweep.mine]", "sweep.Mine.parameters: "),
    (SWEPT, "[sweep.mine.parameters]", "[sweep.mine.values]", "sweep.mine.parameters: "),
    (SWEPT, "[sweep.mine.parameters]", "parameters = 5\n[sweep.mine.x]", "sweep.mine.parameters: "),
    (SWEPT, "[sweep.mine]", DEFINED + "[sweep.mine]", "sweep.mine: "),
    (SWEPT, "[sweep.mine]", DEFINED.replace("mine", "mine-002") + "[sweep.mine]", "sweep.mine: "),
    (GOOD, 'title = "one"', "sweep = 5", "sweep: "),
    # tolerance, interpolation and half vectors
    (TO_TOLERANCE, "tolerance = 0.05\n", "", "tolerance, grids: "),
    (GOOD, 'title = "one"', "tolerance = 0.01", "tolerance, grids: "),
    (TO_TOLERANCE, "0.05", "0.00001", "tolerance: "),
    (TO_TOLERANCE, "0.05", "0.9", "tolerance: "),
    (TO_TOLERANCE, "0.05", "nan", "tolerance: "),
    (TO_TOLERANCE, "0.05", '"small"', "tolerance: "),
    (TO_TOLERANCE, "0.05", '0.05\nforms = "best"', "forms: "),
    (TO_TOLERANCE, "0.05", '0.05\ninterpolation = "cubic"', "interpolation: "),
    (GOOD, 'title = "one"', "hot_spot_tolerance = 0.1", "hot_spot_tolerance: "),
    (HALF, '"log-cubic"', '"quintic"', "interpolation: 'quintic' is not one of 'linear', 'cubic', "),
    (HALF, "phi_d_deg = [0, 45, 90]", "phi_d_deg = [0, 45, 91]", "grids.isotropic.phi_d_deg: ends at 91 degrees, must"),
    (HALF, "phi_d_deg = [0, 45, 90]\n", "", "grids.isotropic.phi_d_deg: is missing"),
    (HALF, "theta_d_deg = [0, 90]", "theta_r_deg = [0, 90]", "grids.anisotropic.theta_d_deg: is missing"),
    # not TOML
    (GOOD, 'title = "one"', "title = ", "not TOML: "),
]


def check_refused(path: Path, root: Path, said: str, capsys: Captured) -> None:
    """`build` names file and field in one sentence, and neither makes nor changes a store."""
    before = tree(root.parent)
    assert refused(capsys, "build", path, "--store", root).startswith(f"{path}: {said}")
    assert tree(root.parent) == before


def test_a_bad_recipe_is_one_sentence_and_nothing_is_written(tmp_path: Path, capsys: Captured) -> None:
    for text, old, new, field in BAD:
        check_refused(write(tmp_path, text, old, new), tmp_path / "store", field, capsys)
    assert not (tmp_path / "store").exists()


def test_a_bad_recipe_leaves_the_old_revision_served(tmp_path: Path, built: Path, capsys: Captured) -> None:
    check_refused(write(tmp_path, GOOD, "[0, 80]", "[0, 90]"), built, "foam on grids.isotropic: ", capsys)
    brdfdb.open(built).verify("foam")


def test_a_file_that_is_no_recipe_is_one_sentence(tmp_path: Path, capsys: Captured) -> None:
    (tmp_path / "file").write_text("")
    for name, said in (("none.toml", "No such file"), (".", "Is a directory"), ("file/none.toml", "Not a directory")):
        check_refused(tmp_path / name, tmp_path / "store", said, capsys)
    path = tmp_path / "bad.toml"
    for data in (b'title = "Gr\xf6\xdfe"', b"\xff\xfe\x00", b"\x00", b"PK\x03\x04\x00\x00\xe5"):
        path.write_bytes(data)
        check_refused(path, tmp_path / "store", "not TOML: ", capsys)
