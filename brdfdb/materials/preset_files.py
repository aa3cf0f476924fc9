"""The materials of the papers: their published parameters, each with the table, figure or section it comes from.

Each paper has a TOML file, and each material a table in it. `brdfdb.materials.written_parameters` states the units.
"""

from __future__ import annotations

import tomllib
from functools import cache
from importlib import resources

from brdfdb.errors import ParameterError
from brdfdb.materials.material import Material


def presets() -> dict[str, Material]:
    """Return all materials of the papers by name, in the order of the files and of the tables in them.

    The files are read and checked once per process. The dict is a copy.
    """
    return dict(_presets())


@cache
def _presets() -> dict[str, Material]:
    materials: dict[str, Material] = {}
    files = (file for file in resources.files("brdfdb.materials").iterdir() if file.name.endswith(".toml"))
    for file in sorted(files, key=lambda file: file.name):
        for name, table in tomllib.loads(file.read_text(encoding="utf-8")).items():
            if name in materials:
                raise ParameterError(file.name, f"the material {name!r} is in another file too")
            materials[name] = Material.from_table(name, table)
    return materials
