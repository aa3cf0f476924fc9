"""File formats of others: each module of this room whose name begins with no underscore is one.

Each of them is an `Exporter`. The command line and HTTP iterate over the registry.
"""

from __future__ import annotations

import importlib
import pkgutil
from typing import Any

from brdfdb.formats._interface import Exporter, Option, options_of, parsed_options

__all__ = ["EXPORTERS", "Exporter", "Option", "options_of", "parsed_options"]


def _modules() -> dict[str, Any]:
    """Return the modules of the room by name."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__) if not module.name.startswith("_"))
    return {name: importlib.import_module(f"{__name__}.{name}") for name in names}


EXPORTERS: dict[str, Exporter] = _modules()
