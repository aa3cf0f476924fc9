"""Compilation of the kernels of a build before it starts, in processes: numba compiles one kernel at a time in each."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import as_completed
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb._numba import is_cached
from brdfdb.materials import FunctionSource, Material
from brdfdb.models import MODELS
from brdfdb.store.paths import material_path, pointer_path
from brdfdb.tables import _kernels
from brdfdb.tables.layout import Layout
from brdfdb.tables.planner import coarsest
from brdfdb.tables.table import Table, points
from brdfdb.tables.tabulation import block
from brdfdb_pipelines import workers
from brdfdb_pipelines.build_progress import Event
from brdfdb_pipelines.recipe_file import Recipe

_UP = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.6, 0.8]])  # three directions: any will do


def compile_kernels(recipe: Recipe, root: Path, jobs: int, report: Callable[[Event], None]) -> None:
    """Compile the kernels of a build into numba's cache, where tables are missing and nothing was compiled yet.

    A build compiles what is missing anyway, one kernel after the other; this takes less time and reports it.
    """
    missing = [job for job in recipe.jobs() if not pointer_path(material_path(root, job.material.name)).exists()]
    if jobs == 1 or not missing or is_cached(_kernels.by_vectors):
        return
    models: dict[str, Callable[[], None]] = {}
    for job in missing:
        models.setdefault(job.material.model, partial(_compile_model, job.material, job.wavelength_nm))
    # the longest first: kernels of a spectral model take as long as all others together
    tasks = sorted(models, key=lambda name: not MODELS[name].spectral)
    report({"event": "compiling", "kernels": 1 + len(tasks)})
    with workers.processes(min(jobs, 1 + len(tasks)), patient=False) as pool:  # a kernel takes up to half a minute
        futures: list[Any] = [pool.executor.submit(models[name]) for name in tasks[:1]]
        futures.append(pool.executor.submit(_compile_tables))
        futures += [pool.executor.submit(models[name]) for name in tasks[1:]]
        for _ in as_completed(futures):  # the build meets an error of a task again, and reports it
            report({"event": "compiled"})


def _compile_tables() -> None:
    """Compile the kernels of lookups."""
    white = FunctionSource(brdf=lambda wi, *_: np.full(len(wi), 0.3), name="white", title="White", provenance="none")
    layout = Layout(white, coarsest(white), None)
    Table.of(layout, np.zeros(layout.shape, np.float32)).lookup_vectors(_UP, _UP[::-1])
    points(layout.grid, _UP, _UP[::-1])


def _compile_model(material: Material, wavelength_nm: NDArray[np.float64] | None) -> None:
    """Compile the kernels of the model of a material."""
    at = None if wavelength_nm is None else wavelength_nm[:2]
    material.lookup_vectors(_UP, _UP[::-1], at)
    block(Layout(material, coarsest(material), at), slice(0, 1))
    material.specular_reflectance(0.5, at)
