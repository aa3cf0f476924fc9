"""Recipes that tests change, and texts that recipes of tests are put together from."""

from __future__ import annotations

from pathlib import Path


def isotropic(theta: str = "[0, 80]", delta_phi: str = "[0, 180]", *, viewer: str = "", kind: str = "isotropic") -> str:
    """Return the isotropic or the spectral grid with these nodes [degree]; the viewer has those of the light."""
    return f"[grids.{kind}]\ntheta_i_deg = {theta}\ntheta_r_deg = {viewer or theta}\ndelta_phi_deg = {delta_phi}\n"


def anisotropic(theta: str = "[0, 80]", phi: str = "[0, 360]") -> str:
    """Return the anisotropic grid with these nodes [degree]."""
    return f"[grids.anisotropic]\ntheta_i_deg = {theta}\nphi_i_deg = {phi}\ntheta_r_deg = {theta}\nphi_r_deg = {phi}\n"


HEAD = 'title = "one"\nmaterials = ["foam"]\nwavelengths_nm = [500, 550]\n'
GOOD = "".join(
    [
        HEAD,
        isotropic("[{ start = 0, stop = 80, step = 40 }]", viewer="[0, 80]"),
        isotropic("[0, 40]", "[0, 90, 180]", kind="spectral"),
        anisotropic("[0, 60]", "[0, 180, 360]"),
    ]
)
TO_TOLERANCE = f"tolerance = 0.05\n{HEAD}"
HALF = """\
title = "one"
materials = ["glossy-grey-paper", "rolled-brass", "scene-copper-sphere"]
wavelengths_nm = [500, 550]
interpolation = "log-cubic"
[grids.isotropic]
theta_h_deg = [0, 2, 5, 10, 20, 45, 90]
theta_d_deg = [0, 45, 90]
phi_d_deg = [0, 45, 90]
[grids.anisotropic]
theta_h_deg = [0, 5, 90]
phi_h_deg = [0, 45, 90]
theta_d_deg = [0, 90]
phi_d_deg = [0, 90, 180]
""" + isotropic("[0, 40]", "[0, 90, 180]", kind="spectral")
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


def material(name: str, title: str, model: str, *parameters: str, table: str = "define") -> str:
    """Return a material, or with the table "sweep" a family, of parameters as lines of TOML; a metal is copper."""
    lines = [f"[{table}.{name}]", f'title = "{title}"', f'model = "{model}"', 'source = "no paper"']
    if model == "he_torrance":
        lines.append('refractive_index = "main/Cu/Johnson"')
    return "\n".join([*lines, f"[{table}.{name}.parameters]", *parameters, ""])


COARSE = isotropic() + isotropic(kind="spectral") + anisotropic()  # two nodes an axis


def recipe_file_of(directory: Path, text: str) -> Path:
    """Write a recipe into a directory."""
    path = directory / "recipe.toml"
    path.write_text(text, encoding="utf-8")
    return path
