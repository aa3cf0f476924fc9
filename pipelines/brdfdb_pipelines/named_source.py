"""The material of a name on the command line: a preset, a material of a recipe, or a table of a store."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.materials import Source
from brdfdb.parameters import closest
from brdfdb.store import open_tables
from brdfdb.store.edition.reader import Edition
from brdfdb.store.reader import Store
from brdfdb.tables.table import source_of_table
from brdfdb_pipelines import recipe_file


class NamedSource(NamedTuple):
    """A source and its wavelengths [nm]; None: it is grey."""

    source: Source
    wavelength_nm: NDArray[np.float64] | None


def tables_at(place: Path | str | None) -> Store | Edition | None:
    """Return the store or the edition at a place; None where there is no place, or no directory."""
    return None if place is None or (isinstance(place, Path) and not place.exists()) else open_tables(place)


def named_source(name: str, root: Path | str | None, recipe_path: Path | None) -> NamedSource:
    """Return a material of the recipe (by default all presets) or of the store; ParameterError for an unknown name."""
    recipe = recipe_file.load(recipe_path, to_build=False)
    jobs = {job.material.name: job for job in recipe.jobs()}
    if name in jobs:
        return NamedSource(jobs[name].material, jobs[name].wavelength_nm)
    measured = {job.name: job for job in recipe.measured_jobs()}
    if name in measured:
        source = measured[name].lawful_source()
        return NamedSource(source, None if source.wavelengths_nm is None else np.array(source.wavelengths_nm))
    store = tables_at(root)
    if store is not None and name in store:
        return NamedSource(source_of_table(store[name]), store[name].wavelength_nm)
    if name in (job.name for job in recipe.simulated_jobs()):
        raise ParameterError(name, "is simulated; build the recipe first, and give the store", name)
    names = [*jobs, *measured, *(store or ())]
    raise ParameterError(name, f"no such material, neither in the store nor in the recipe{closest(name, names)}", name)
