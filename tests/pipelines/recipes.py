"""Texts that recipes of tests are put together from: grids, and materials as tables of TOML."""

from __future__ import annotations


def isotropic(theta: str = "[0, 80]", delta_phi: str = "[0, 180]", *, viewer: str = "", kind: str = "isotropic") -> str:
    """Return the isotropic or the spectral grid with these nodes [degree]; the viewer has those of the light."""
    return f"[grids.{kind}]\ntheta_i_deg = {theta}\ntheta_r_deg = {viewer or theta}\ndelta_phi_deg = {delta_phi}\n"


def anisotropic(theta: str = "[0, 80]", phi: str = "[0, 360]") -> str:
    """Return the anisotropic grid with these nodes [degree]."""
    return f"[grids.anisotropic]\ntheta_i_deg = {theta}\nphi_i_deg = {phi}\ntheta_r_deg = {theta}\nphi_r_deg = {phi}\n"


def material(name: str, title: str, model: str, *parameters: str, table: str = "define") -> str:
    """Return a material, or with the table "sweep" a family, of parameters as lines of TOML; a metal is copper."""
    lines = [f"[{table}.{name}]", f'title = "{title}"', f'model = "{model}"', 'source = "no paper"']
    if model == "he_torrance":
        lines.append('refractive_index = "main/Cu/Johnson"')
    return "\n".join([*lines, f"[{table}.{name}.parameters]", *parameters, ""])


COARSE = isotropic() + isotropic(kind="spectral") + anisotropic()  # two nodes an axis
