"""File formats of others: each module of this room whose name begins with no underscore is one.

A module that writes is an `Exporter`, one that reads an `Importer`; most are both. The command line and HTTP iterate
over the registry.
"""

from __future__ import annotations

import importlib
import os
import pkgutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

from brdfdb.errors import FileFormatError, ParameterError
from brdfdb.formats._interface import Exporter, Importer, Option, options_of, parsed_options

if TYPE_CHECKING:
    from brdfdb.formats._readings import FileTable, Samples

__all__ = ["EXPORTERS", "IMPORTERS", "Exporter", "Importer", "Option", "options_of", "parsed_options", "read"]

_HEAD = 4096  # bytes of a file that tell its format


def _modules() -> dict[str, Any]:
    """Return the modules of the room by name."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__) if not module.name.startswith("_"))
    return {name: importlib.import_module(f"{__name__}.{name}") for name in names}


_MODULES = _modules()
EXPORTERS: dict[str, Exporter] = {name: module for name, module in _MODULES.items() if hasattr(module, "write")}
IMPORTERS: dict[str, Importer] = {name: module for name, module in _MODULES.items() if hasattr(module, "read")}


def read(path: str | os.PathLike[str], file_format: str = "") -> FileTable | Samples:
    """Return f_r of a file of another format as the tools of the format see it, or the samples that the file lists.

    Parameters
    ----------
    path : path
        The file.
    file_format : str
        One of `IMPORTERS`; by default the one that recognises the first bytes of the file, those with its suffix first.

    Raises
    ------
    ParameterError
        If there is no such format.
    FileFormatError
        If no format recognises the file, or it is damaged.
    OSError
        If the file cannot be read.

    Examples
    --------
    >>> from brdfdb import formats
    >>> formats.read("brass.exr")
    Traceback (most recent call last):
    FileNotFoundError: [Errno 2] No such file or directory: 'brass.exr'
    """
    path = Path(path)
    if file_format:
        if file_format not in IMPORTERS:
            raise ParameterError(
                "file_format", f"{file_format!r} is not one of {', '.join(IMPORTERS)}", file_format, tuple(IMPORTERS)
            )
        return IMPORTERS[file_format].read(path)
    with (path / "zarr.json" if path.is_dir() else path).open("rb") as file:  # a zarr group is a directory
        head = file.read(_HEAD)
    by_suffix = sorted(IMPORTERS.values(), key=lambda importer: not path.name.endswith(importer.suffix))
    for importer in by_suffix:
        if importer.recognises(head):
            return importer.read(path)
    raise FileFormatError(f"{path}: no format recognises it; there are {', '.join(IMPORTERS)}")
