"""brdfdb: spectral BRDF tables from published surface parameters.

Importing this package is cheap: the models, the store and the exports load when they are first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from brdfdb.store import open

if TYPE_CHECKING:
    from brdfdb.materials import presets

    __version__: str

__all__ = ["__version__", "open", "presets"]


# Rooms that are imported when they are first used; their modules are imported by name
_ROOMS = (
    *("atlas", "audit", "derivatives", "formats", "forms", "fresnel", "gallery", "geometry", "integrals", "materials"),
    *("measurements", "microgeometry", "misprints", "mitsuba", "models", "refractive_indices", "roughness", "scenes"),
    *("spectra", "store", "tables"),
)


def __getattr__(name: str) -> Any:
    if name in _ROOMS:
        return importlib.import_module(f"brdfdb.{name}")
    if name == "presets":
        return importlib.import_module("brdfdb.materials").presets
    if name == "__version__":
        return importlib.import_module("importlib.metadata").version("brdfdb")
    raise AttributeError(f"module 'brdfdb' has no attribute {name!r}")
