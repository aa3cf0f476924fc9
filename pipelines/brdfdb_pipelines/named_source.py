"""The material of a name on the command line: a preset, one of a recipe, or a table of a store."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import brdfdb
from brdfdb.errors import ParameterError
from brdfdb.materials import Source
from brdfdb.measurements import MeasuredSource
from brdfdb.parameters import closest
from brdfdb.tables.table import source_of_table
from brdfdb_pipelines import recipe_file
from brdfdb_pipelines.measured_job import MeasuredJob


def named_source(name: str, root: Path | None, recipe_path: Path | None) -> tuple[Source, NDArray[np.float64] | None]:
    """Return a material of the recipe (by default all presets) or of the store, with its wavelengths [nm].

    Raises
    ------
    ParameterError
        If neither has the name.
    """
    recipe = recipe_file.load(recipe_path, to_build=False)
    jobs = {job.material.name: job for job in recipe.jobs()}
    if name in jobs:
        return jobs[name].material, jobs[name].wavelength_nm
    measured = {job.name: job for job in recipe.measured_jobs()}
    if name in measured:
        return measured_source(measured[name])
    store = brdfdb.open(root) if root is not None and root.exists() else None
    if store is not None and name in store:
        return source_of_table(store[name]), store[name].wavelength_nm
    names = [*jobs, *measured, *(store or ())]
    raise ParameterError(name, f"no such material, neither in the store nor in the recipe{closest(name, names)}", name)


def measured_source(job: MeasuredJob) -> tuple[MeasuredSource, NDArray[np.float64] | None]:
    """Return the data of a measured table of a recipe, made to keep the laws that it asks for; its wavelengths [nm].

    Raises
    ------
    FileFormatError, ParameterError, OSError
        If the file cannot be read, or is not what a table needs.
    """
    source = job.source()
    for law in ("reciprocal", "conserving"):
        if getattr(job.table, law):
            source = source.made(law)
    return source, None if source.wavelengths_nm is None else np.array(source.wavelengths_nm)
