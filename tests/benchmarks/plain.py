"""The presets on plain grids, large and multilinear: what benchmarks of kernels, codec and build work on."""

from __future__ import annotations

from brdfdb_pipelines.recipe_file import Recipe, load


def _theta(stop: int, step: int) -> list[dict[str, float] | float]:
    return [{"start": 0.0, "stop": float(stop), "step": float(step)}, 89.5]


def _phi(stop: int, step: int) -> list[dict[str, float]]:
    return [{"start": 0.0, "stop": float(stop), "step": float(step)}]


GRIDS = {
    "isotropic": {"theta_i_deg": _theta(89, 1), "theta_r_deg": _theta(89, 1), "delta_phi_deg": _phi(180, 1)},
    "spectral": {"theta_i_deg": _theta(88, 2), "theta_r_deg": _theta(88, 2), "delta_phi_deg": _phi(180, 2)},
    "anisotropic": {
        "theta_i_deg": _theta(87, 3),
        "phi_i_deg": _phi(360, 3),
        "theta_r_deg": _theta(87, 3),
        "phi_r_deg": _phi(360, 3),
    },
}


def plain_recipe(models: list[str] | None = None) -> Recipe:
    """The default recipe on these grids; only the materials of some models, if they are named."""
    recipe = load()
    names = [job.material.name for job in recipe.jobs() if not models or job.material.model in models]
    return Recipe.model_validate({**recipe.model_dump(), "materials": names, "tolerance": None, "grids": GRIDS})
