"""Libraries of presets: the materials of the papers, and those that are computed.

The papers' materials are published parameters, each with the table, figure or section it comes from. Each paper has a
TOML file, and each material a table in it. `brdfdb.materials.written_parameters` states the units. The computed
libraries are those of `brdfdb.materials.computed_libraries`.
"""

from __future__ import annotations

import tomllib
from functools import cache
from importlib import resources

from brdfdb.errors import ParameterError
from brdfdb.materials.computed_libraries import entries, titles
from brdfdb.materials.material import Material

PAPERS = "papers"  # name of the library that is meant where none is named


def libraries() -> dict[str, str]:
    """Return the title of each library of presets by its name, that of the papers first."""
    return {PAPERS: "Materials that the papers print", **titles()}


def presets(library: str = PAPERS) -> dict[str, Material]:
    """Return all materials of a library by name, in the order of its files.

    The files are read and checked once per process. The dict is a copy.

    Parameters
    ----------
    library : str, optional
        A name of `libraries`. The default, ``"papers"``, has the materials that the papers print. ``"metals"`` and
        ``"metals-infrared"`` have computed surfaces of metals, semiconductors and dielectrics.

    Returns
    -------
    dict of str to Material
        Names are unique across all libraries.

    Raises
    ------
    ParameterError
        If there is no such library.

    Examples
    --------
    >>> presets(library="metals")["gold-satin"].refractive_index
    'main/Au/Babar'
    """
    if library == PAPERS:
        return dict(_of_papers())
    if library not in titles():
        known = libraries()
        raise ParameterError("library", f"{library!r} is not one of {', '.join(known)}", library, tuple(known))
    return {entry.material.name: entry.material for entry in entries(library)}


@cache
def _of_papers() -> dict[str, Material]:
    materials: dict[str, Material] = {}
    files = (file for file in resources.files("brdfdb.materials").iterdir() if file.name.endswith(".toml"))
    for file in sorted(files, key=lambda file: file.name):
        for name, table in tomllib.loads(file.read_text(encoding="utf-8")).items():
            if name in materials:
                raise ParameterError(file.name, f"the material {name!r} is in another file too")
            materials[name] = Material.from_table(name, table)
    return materials
