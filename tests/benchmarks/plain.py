"""The presets on plain grids, large and multilinear: what benchmarks of kernels, codec and build work on."""

from __future__ import annotations

from collections.abc import Sequence

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


COARSE_GRIDS = {
    "isotropic": {"theta_i_deg": _theta(75, 15), "theta_r_deg": _theta(75, 15), "delta_phi_deg": _phi(180, 30)},
    "spectral": {"theta_i_deg": _theta(75, 15), "theta_r_deg": _theta(75, 15), "delta_phi_deg": _phi(180, 30)},
    "anisotropic": {
        "theta_i_deg": _theta(60, 30),
        "phi_i_deg": _phi(360, 60),
        "theta_r_deg": _theta(60, 30),
        "phi_r_deg": _phi(360, 60),
    },
}
COARSE_NAMES = ("clay-vase", "rolled-brass", "scene-copper-sphere")


def plain_recipe(models: Sequence[str] = (), *, coarse: bool = False) -> Recipe:
    """Return the default recipe on these grids; only the materials of some models, if they are named.

    A coarse one has few nodes, and a material of each paper.
    """
    recipe = load()
    jobs = [job for job in recipe.jobs() if not models or job.material.model in models]
    names = [job.material.name for job in jobs if not coarse or job.material.name in COARSE_NAMES]
    grids = COARSE_GRIDS if coarse else GRIDS
    return Recipe.model_validate({**recipe.model_dump(), "materials": names, "tolerance": None, "grids": grids})
