"""Compilation of the kernels of a build before it starts, in processes: numba compiles one kernel at a time in each."""

from __future__ import annotations

import contextlib
import gc
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import partial
from pathlib import Path
from threading import Lock

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
_AZIMUTHS = np.linspace(0.0, np.pi, 16)  # a row for which He-Torrance sums its table of the series


def compile_kernels(recipe: Recipe, root: Path, jobs: int, report: Callable[[Event], None]) -> None:
    """Compile the kernels of a build into numba's cache, where tables are missing and nothing was compiled yet.

    A build compiles what is missing anyway, one kernel after the other; this takes less time and reports it. This
    process compiles, too: it has imported already what each process imports.
    """
    missing = [job for job in recipe.jobs() if not pointer_path(material_path(root, job.material.name)).exists()]
    if jobs == 1 or not missing or is_cached(_kernels.by_vectors):
        return
    models: dict[str, Callable[[], None]] = {}
    for job in missing:
        models.setdefault(job.material.model, partial(_compile_model, job.material, job.wavelength_nm))
    # the longest first: lookups, and kernels of spectral models
    tasks = deque(
        [_compile_tables, *(models[name] for name in sorted(models, key=lambda name: not MODELS[name].spectral))]
    )
    others = min(jobs, len(tasks)) - 1
    lock = Lock()
    report({"event": "compiling", "kernels": len(tasks)})

    def work(run: Callable[[Callable[[], None]], None]) -> None:
        with contextlib.suppress(IndexError):  # no task is left
            while True:
                task = tasks.popleft()
                with contextlib.suppress(Exception):  # the build meets the error again, and reports it
                    run(task)
                with lock:
                    report({"event": "compiled"})

    with ThreadPoolExecutor(others) as threads, workers.processes(others, patient=False) as pool:
        helpers = [
            threads.submit(work, lambda task: pool.executor.submit(_compiled, task).result()) for _ in range(others)
        ]
        try:
            work(_compiled)
            wait(helpers)
        finally:
            tasks.clear()  # no other task begins after Ctrl-C


def _compiled(task: Callable[[], None]) -> None:
    """Run a task without the collector of garbage, which takes a tenth of the time: what numba makes stays in use."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        task()
    finally:
        if enabled:
            gc.enable()


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
    material.lookup(0.5, 0.0, 0.5, _AZIMUTHS, at)
    material.specular_reflectance(0.5, at)
