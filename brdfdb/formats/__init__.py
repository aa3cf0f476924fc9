"""File formats of others: each module of this room whose name begins with no underscore is one.

A module with a function `write` is an `Exporter`, one with a function `read` an `Importer`. The command line and HTTP
iterate over the registries.
"""

from __future__ import annotations

import importlib
import pkgutil
from typing import Any

from brdfdb.formats._interface import Exporter, Importer, Option, options_of, parsed_options

__all__ = ["EXPORTERS", "IMPORTERS", "Exporter", "Importer", "Option", "options_of", "parsed_options"]


def _modules(function: str) -> dict[str, Any]:
    """Return the formats with a function, by name."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__) if not module.name.startswith("_"))
    modules = {name: importlib.import_module(f"{__name__}.{name}") for name in names}
    return {name: module for name, module in modules.items() if hasattr(module, function)}


EXPORTERS: dict[str, Exporter] = _modules("write")
IMPORTERS: dict[str, Importer] = _modules("read")
