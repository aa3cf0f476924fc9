"""The material of a name on the command line: a preset, one of a recipe, or a table of a store."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import brdfdb
from brdfdb.errors import ParameterError
from brdfdb.materials import Source
from brdfdb.parameters import closest
from brdfdb.tables.table_source import source_of_table
from brdfdb_pipelines import recipe_file


def named_source(name: str, root: Path | None, recipe_path: Path | None) -> tuple[Source, NDArray[np.float64] | None]:
    """Return a material of the recipe (by default all presets) or of the store, with its wavelengths [nm].

    Raises
    ------
    ParameterError
        If neither has the name.
    """
    jobs = {job.material.name: job for job in recipe_file.load(recipe_path, to_build=False).jobs()}
    if name in jobs:
        return jobs[name].material, jobs[name].wavelength_nm
    store = brdfdb.open(root) if root is not None and root.exists() else None
    if store is not None and name in store:
        return source_of_table(store[name]), store[name].wavelength_nm
    names = [*jobs, *(store or ())]
    raise ParameterError(name, f"no such material, neither in the store nor in the recipe{closest(name, names)}", name)
