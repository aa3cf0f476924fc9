"""File formats of other programs: each module or folder of this package without a leading underscore is a format.

A module that writes is an `Exporter`, one that reads an `Importer`; most are both. The command line and HTTP iterate
over the registry.
"""

from __future__ import annotations

import importlib
import os
import pkgutil
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from brdfdb.errors import FileFormatError, ParameterError
from brdfdb.formats._input import check_file
from brdfdb.formats._interface import Exporter, FormatOption, Importer, options_of, parsed_options, schema_of
from brdfdb.parameters import check_nanometres
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.formats._readings import FileTable
    from brdfdb.formats._written import Written
    from brdfdb.measurements.samples import Samples
    from brdfdb.tables.table import Table

__all__ = [
    "EXPORTERS",
    "IMPORTERS",
    "Exporter",
    "FormatOption",
    "Importer",
    "members",
    "options_of",
    "packed",
    "parsed_options",
    "read",
    "samples",
    "served_options",
    "served_schemas",
    "write",
]

AZIMUTHS = ("light", "forward")
_TEXT = "text"
_SHOWN = 200  # characters of names of columns that a refusal repeats
_HEAD = 4096  # bytes of a file that tell its format


_NAMES = sorted(module.name for module in pkgutil.iter_modules(__path__) if not module.name.startswith("_"))
_MODULES: dict[str, Any] = {name: importlib.import_module(f"{__name__}.{name}") for name in _NAMES}
EXPORTERS: dict[str, Exporter] = {name: module for name, module in _MODULES.items() if hasattr(module, "write")}
IMPORTERS: dict[str, Importer] = {name: module for name, module in _MODULES.items() if hasattr(module, "read")}


def write(
    table: Table, path: str | os.PathLike[str], file_format: str, *, verdict: str | None = None, **options: Any
) -> Written:
    """Write a table as a file of another format: completely, or not at all.

    Parameters
    ----------
    table : Table
        Table in memory.
    path : path
        The file; an existing file is replaced. Some formats write a second file next to it.
    file_format : str
        One of `EXPORTERS`.
    verdict : str, optional
        Verdict of the audit of this revision, for the record in the file, which says "not stated" without one.
    **options
        Options of the format, as `brdfdb export FORMAT --help` lists them, with underscores.

    Returns
    -------
    Written
        The paths, and the error that the file states.

    Raises
    ------
    ParameterError
        If there is no such format or option, or an option cannot have its value.
    CannotHoldError
        If the format has no place for such a table.
    WriteError
        If a file cannot be written.

    Examples
    --------
    >>> import brdfdb
    >>> from brdfdb import formats
    >>> brass = brdfdb.open()["rolled-brass"]  # doctest: +SKIP
    >>> formats.write(brass, "brass.bsdf", "rgl", tolerance=0.05).error.p99 < 0.05  # doctest: +SKIP
    True
    """
    if file_format not in EXPORTERS:
        raise ParameterError(
            "file_format", f"{file_format!r} is not one of {', '.join(EXPORTERS)}", file_format, tuple(EXPORTERS)
        )
    exporter = EXPORTERS[file_format]
    texts = {name: str(value).lower() if isinstance(value, bool) else str(value) for name, value in options.items()}
    parsed = parsed_options(exporter, texts)
    return exporter.write(table, path_of(path), verdict=verdict, **parsed)


def served_options(file_format: str) -> dict[str, FormatOption]:
    """Return the options of a format by name, with the ranges that a service allows."""
    return {name: option.served for name, option in options_of(EXPORTERS[file_format]).items()}


def served_schemas() -> dict[str, tuple[dict[str, Any], str]]:
    """Return the JSON Schema and the help of each option of any format by name, as a service allows it."""
    options = {file_format: served_options(file_format) for file_format in EXPORTERS}
    names = dict.fromkeys(name for known in options.values() for name in known)
    return {name: schema_of({key: known[name] for key, known in options.items() if name in known}) for name in names}


def packed(table: Table, file_format: str, *, verdict: str, **options: Any) -> tuple[str, str, bytes]:
    """Return the name, the media type and the bytes of a file of another format; several files as a zip archive.

    `options` are values that `FormatOption.parse` returned. Errors are those of `write`.
    """
    from brdfdb.store.archive import ZIP, zipped  # the parser of the command line loads no store

    exporter = EXPORTERS[file_format]
    kind = f"_{options.get('kind', exporter.kinds[0])}" if exporter.kinds else ""
    with tempfile.TemporaryDirectory() as name:  # formats write files
        folder = Path(name)
        path = folder / f"{table.name}{kind}{exporter.suffix}"
        written = exporter.write(table, path, verdict=verdict, **options)
        if len(written.paths) == 1 and path.is_file():
            return path.name, exporter.media_type, path.read_bytes()
        files = sorted(file for file in folder.rglob("*") if file.is_file())
        contents = ((str(file.relative_to(folder)), file.read_bytes()) for file in files)
        return f"{path.name}.zip", ZIP, b"".join(zipped(contents))


def read(
    path: str | os.PathLike[str],
    file_format: str = "",
    *,
    azimuth: str = "light",
    wavelength_nm: float | None = None,
    **keywords: Any,
) -> FileTable | Samples:
    """Return f_r of a file of another format as the tools of the format see it, or the samples that the file lists.

    Parameters
    ----------
    path : path
        The file.
    file_format : str
        One of `IMPORTERS`; by default the one that recognises the first bytes of the file, those with its suffix first.
    azimuth : {"light", "forward"}
        Direction from which the file counts azimuths: that of the light, as here, or the one into which it travels.
    wavelength_nm : float, optional
        Wavelength [nm], in [10, 1e6], of a file of one channel that states none.
    **keywords
        Of a text its columns, quantity and angles, as of `brdfdb.formats.text.read`: with one of them any file is read
        as text. Of an archive the `member`, as of `brdfdb.formats.neural.read`. Of a Klems matrix its `side`.

    Raises
    ------
    ParameterError
        If there is no such format, keyword, column or member, files of the format are only written, or the file states
        the wavelength itself.
    FileFormatError
        If no format recognises the file, its format is only written, the file is damaged, or it is not a regular file
        of at most 2 GiB.
    OSError
        If the file cannot be read.

    Examples
    --------
    >>> from brdfdb import formats
    >>> formats.read("brass.exr")
    Traceback (most recent call last):
    FileNotFoundError: [Errno 2] No such file or directory: 'brass.exr'
    """
    from brdfdb.formats._readings import at_wavelength, from_forward

    if azimuth not in AZIMUTHS:
        raise ParameterError("azimuth", f"{azimuth!r} is not one of {', '.join(AZIMUTHS)}", azimuth, AZIMUTHS)
    path = path_of(path)
    importer = _importer(path, file_format, keywords)
    try:
        reading: FileTable | Samples = importer.read(path, **keywords)
        if reading.wavelength_nm is not None:
            check_nanometres("wavelength_nm", reading.wavelength_nm)
    except FileFormatError:
        raise
    except ParameterError as error:  # of rows that are not valid samples
        if error.parameter in getattr(importer, "keywords", ()):
            raise
        raise FileFormatError(f"{path}: {error}") from error
    reading = reading if wavelength_nm is None else at_wavelength(reading, wavelength_nm)
    return from_forward(reading) if azimuth == "forward" else reading


def samples(path: str | os.PathLike[str], file_format: str = "", **keywords: Any) -> Samples:
    """Return the samples that a file lists, or the values of a grid at its own directions above the horizon.

    Parameters
    ----------
    path : path
        The file.
    file_format : str
        As of `read`.
    **keywords
        As of `read`.

    Returns
    -------
    Samples
        Values as the file has them: negative ones stay, and holes are nan. Of grids the rows below the horizon are left
        out and counted in the record, and a value that stands at all azimuths of the normal is given once. Klems
        matrices and tensor trees give their averages at the middles of patches and cells. A network, which is a
        formula, gives values on a grid that its record names.

    Raises
    ------
    ParameterError
        If there is no such format, keyword or column.
    FileFormatError
        If no format recognises the file, it is damaged, or it holds a formula and no values.
    OSError
        If the file cannot be read.

    Examples
    --------
    >>> from brdfdb import formats
    >>> tile = formats.samples("tile.csv", quantity="reflectance_factor")  # doctest: +SKIP
    """
    from brdfdb.measurements.samples import NODES, Samples

    reading = read(path, file_format, **keywords)
    if isinstance(reading, Samples):
        return reading
    if reading.nodes is None:
        raise FileFormatError(f"{path}: it holds a formula, and no values at listed directions")
    nodes = reading.nodes()
    return replace(nodes, record={**nodes.record, NODES: True})


def members(path: str | os.PathLike[str], file_format: str = "", **keywords: Any) -> list[str]:
    """Return the names of the materials in an archive, for the keyword `member` of `read`; empty of any other file.

    Parameters and errors are those of `read`.
    """
    path = path_of(path)
    keywords = {name: value for name, value in keywords.items() if name not in ("azimuth", "wavelength_nm")}
    importer = _importer(path, file_format, keywords)
    return importer.members(path) if hasattr(importer, "members") else []


def _importer(path: Path, file_format: str, keywords: Mapping[str, Any]) -> Importer:
    """Return the importer of a file with keywords that it takes."""
    check_file(path)
    every = {key for importer in IMPORTERS.values() for key in getattr(importer, "keywords", ())}
    for name, value in keywords.items():
        if name not in every:
            allowed = ", ".join(sorted(every))
            raise ParameterError(
                name, f"no format has this keyword; allowed are {allowed}", value, tuple(sorted(every))
            )
    text = bool(keywords) and set(keywords) <= set(_MODULES[_TEXT].keywords)
    importer = _chosen(path, file_format or (_TEXT if text else ""))
    for name, value in keywords.items():
        if name not in getattr(importer, "keywords", ()):
            raise ParameterError(name, f"the format of {path} does not have this keyword", value)
    return importer


def _chosen(path: Path, file_format: str) -> Importer:
    """Return the importer of a format by its name, or the one that recognises a file."""
    only_written = {name: exporter for name, exporter in EXPORTERS.items() if name not in IMPORTERS}
    if file_format:
        if file_format in only_written:
            raise ParameterError("file_format", f"files of {file_format} can be written, but not read", file_format)
        if file_format not in IMPORTERS:
            raise ParameterError(
                "file_format", f"{file_format!r} is not one of {', '.join(IMPORTERS)}", file_format, tuple(IMPORTERS)
            )
        return IMPORTERS[file_format]
    with (path / "zarr.json" if path.is_dir() else path).open("rb") as file:  # a zarr group is a directory
        head = file.read(_HEAD)
    by_suffix = sorted(IMPORTERS.values(), key=lambda importer: not path.name.endswith(importer.suffix))
    for importer in by_suffix:
        if importer.recognises(head):
            return importer
    for name, exporter in only_written.items():
        recognises = getattr(exporter, "recognises", None)
        if path.name.endswith(exporter.suffix) and (recognises is None or recognises(head)):
            raise FileFormatError(f"{path}: files of {name} can be written, but not read")
    from brdfdb.fitting.published import SUFFIX

    known = f"{path}: no format recognises it; known formats are {', '.join(IMPORTERS)}"
    columns = _MODULES[_TEXT].columns_of(head)
    if columns:
        shown = ", ".join(columns)[:_SHOWN]
        known += f"; read as text it has the columns {shown}: name them with {_MODULES[_TEXT].HOW}"
    if path.name.lower().endswith(SUFFIX):
        raise FileFormatError(f"{path}: a file of published fits holds no samples; `brdfdb fit` lists the fits")
    raise FileFormatError(known)
