"""File formats of other programs: each module or folder of this package without a leading underscore is a format.

A module that writes is an `Exporter`, one that reads an `Importer`; most are both. The command line and HTTP iterate
over the registry.
"""

from __future__ import annotations

import importlib
import os
import pkgutil
import re
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from brdfdb.errors import FileFormatError, ParameterError
from brdfdb.formats._input import check_file, encoding_of, foreign, head_of
from brdfdb.formats._interface import Exporter, FormatOption, Importer, options_of, parsed_options, schema_of
from brdfdb.place import path_of

if TYPE_CHECKING:
    from brdfdb.formats._readings import FileTable
    from brdfdb.formats._written import Written
    from brdfdb.measurements.conventions import Convention, FormatConventions
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
    "written_by",
]

_TURNED = ("lighttools", "pabopto")  # readers that turn azimuths or change the side
STATED = "stated"  # angle_unit of formats that state it themselves
#: keywords of `read` that hold for every format
_OF_NUMBERS = (
    *("missing", "quantity", "angles", "azimuth", "wavelength_unit", "coverage_factor", "wavelength_nm"),
    "mueller_frame",
)
_TEXT = "text"
_SHOWN = 200  # characters of names of columns that a refusal repeats
_PICTURES = (b"\x89PNG", b"\xff\xd8\xff", b"GIF8")  # first bytes
_ARCHIVE = b"PK"  # first bytes of zip, in which some formats are

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
    return written_by(exporter, table, path_of(path), verdict=verdict, **parsed)


def written_by(exporter: Exporter, table: Table, path: Path, *, verdict: str | None, **options: Any) -> Written:
    """Write a table by an exporter, without what no format can hold: glints, which `Written.remarks` name.

    `options` are values that `FormatOption.parse` returned. Errors are those of `write`.
    """
    from brdfdb.formats._record import glint_remark

    written = exporter.write(table.without_glints(), path, verdict=verdict, **options)
    return replace(written, remarks=(*written.remarks, *glint_remark(table)))


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
        written = written_by(exporter, table, path, verdict=verdict, **options)
        if len(written.paths) == 1 and path.is_file():
            return path.name, exporter.media_type, path.read_bytes()
        files = sorted(file for file in folder.rglob("*") if file.is_file())
        contents = ((str(file.relative_to(folder)), file.read_bytes()) for file in files)
        return f"{path.name}.zip", ZIP, b"".join(zipped(contents))


def read(
    path: str | os.PathLike[str],
    file_format: str = "",
    *,
    quantity: str = "",
    angles: str = "",
    azimuth: str = "",
    wavelength_unit: str = "",
    coverage_factor: float | None = None,
    wavelength_nm: float | None = None,
    mueller_frame: str = "",
    missing: float | None = None,
    **keywords: Any,
) -> FileTable | Samples:
    """Return f_r of a file of another format as the tools of the format see it, or the samples that the file lists.

    Parameters
    ----------
    path : path
        The file.
    file_format : str
        One of `IMPORTERS`; by default the one that recognises the first bytes of the file, those with its suffix first.
    quantity : str, optional
        What the values of the file are, in any format: one of `brdfdb.measurements.conventions.QUANTITIES`, such as
        reflectance_factor, percent, log10, f_r_cos (times the cosine of the viewer) or f_r_cos_i (of the light). By
        default f_r, or what the file says.
    angles : str, optional
        What the angles are, words with commas: deg, rad or mrad; elevation (or elevation_i, elevation_r of light or
        viewer alone), where polar angles count from the surface; exchanged, where theta is phi.
    azimuth : str, optional
        From where azimuths count: light, those of viewers from the light; mirror, from the mirror direction; absolute,
        from a direction of the surface; forward, those of lights are those into which it travels. By default as the
        format or the names of columns say.
    wavelength_unit : {"nm", "um", "m"}, optional
        Unit of the wavelengths, where it is not that of the format or of the names of columns.
    coverage_factor : float, optional
        Factor k of expanded uncertainties, which are divided by it.
    wavelength_nm : float, optional
        Wavelength [nm], in [10, 1e6], of a file of one channel that states none.
    mueller_frame : {"s", "p"}, optional
        Frame of the Mueller matrices of the file, as in `brdfdb.measurements.mueller.FRAME_WORDS`.
    missing : float, optional
        Number of the file that marks values that were not measured. The nodes of a grid are samples then.
    **keywords
        Of a text its columns and `where`, as of `brdfdb.formats.text.read`: with one of them any file is read as text.
        Of an archive the `member`, as of `brdfdb.formats.neural.read`. Of a Klems matrix its `side`.

    Raises
    ------
    ParameterError
        If there is no such format, keyword, column or member, files of the format are only written, what is stated is
        not what a file of the format may hold, or the file states the wavelength itself.
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
    from brdfdb.formats._readings import as_stated, at_wavelength, in_frame
    from brdfdb.measurements.conventions import Convention
    from brdfdb.measurements.samples import Samples

    words = {"quantity": quantity, "angles": angles, "azimuth": azimuth, "wavelength_unit": wavelength_unit}
    convention = Convention(**words, coverage_factor=coverage_factor)
    path = path_of(path)
    importer = _importer(path, file_format, keywords)
    conventions = _own(path, importer, convention)
    taken = getattr(importer, "keywords", ())
    own: dict[str, Any] = {"quantity": quantity, "angles": ",".join(convention.words)}
    own["wavelength_unit"] = wavelength_unit
    own = {name: word for name, word in own.items() if word and name in taken}
    if missing is not None and "missing" in taken:
        own["missing"], missing = missing, None
    try:
        reading = importer.read(path, **keywords, **own)
        reading = as_stated(reading, convention, conventions, _name_of(importer), missing)
        if wavelength_unit and reading.wavelength_nm is None:
            raise ParameterError("wavelength_unit", f"{path} states no wavelengths", wavelength_unit)
    except FileFormatError:
        raise
    except ParameterError as error:  # of rows that are not valid samples
        if error.parameter in (*taken, *words):
            raise
        raise FileFormatError(f"{path}: field {error}") from error
    if coverage_factor is not None:
        rows = reading if isinstance(reading, Samples) else reading.nodes and reading.nodes()
        if not rows or rows.uncertainty is None:
            raise ParameterError("coverage_factor", f"{path} states no uncertainties", coverage_factor)
    reading = reading if wavelength_nm is None else at_wavelength(reading, wavelength_nm)
    return in_frame(reading, mueller_frame) if mueller_frame else reading


def _name_of(importer: Importer) -> str:
    """Return the name of a format in the registry."""
    return next((name for name, known in IMPORTERS.items() if known is importer), "this format")


def _own(path: Path, importer: Importer, convention: Convention) -> FormatConventions:
    """Return the conventions of a format; ParameterError if its numbers cannot mean what the user states."""
    from brdfdb.measurements.conventions import ANGLE_WORDS, AZIMUTHS, FormatConventions

    for parameter in ("angles", "azimuth"):
        if text := _refusal(importer, stated := getattr(convention, parameter)):
            raise ParameterError(parameter, f"{path}: {text}", stated)
    options = [("angles", word) for word in ANGLE_WORDS] + [("azimuth", word) for word in AZIMUTHS]
    refused = [f"--{name} {word}" for name, word in options if _refusal(importer, word)]
    unit = getattr(importer, "angle_unit", "")
    unit = "deg" if unit in ("", STATED) else unit
    return FormatConventions(unit, getattr(importer, "wavelength_unit", "nm"), tuple(refused))


def _refusal(importer: Importer, stated: str) -> str:
    """Return why files of a format cannot mean what a user states on angles or azimuths; empty if they can."""
    from brdfdb.measurements.conventions import ANGLE_UNITS, EXCHANGED

    name = _name_of(importer)
    unit = getattr(importer, "angle_unit", "")
    words = stated.replace(" ", "").split(",")
    if not unit and stated and stated != "forward":
        return f"files of {name} list no angles of light and viewer that may mean something else"
    if EXCHANGED in words and name in _TURNED:
        return f"files of {name} count azimuths from another direction, so that theta and phi are not exchanged"
    if set(words) & set(ANGLE_UNITS) and unit == STATED:
        return f"files of {name} state the unit of their angles"
    return ""


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
    from brdfdb.measurements.conventions import NODES
    from brdfdb.measurements.samples import Samples

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
    keywords = {name: value for name, value in keywords.items() if name not in _OF_NUMBERS}
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
    head = head_of(path / "zarr.json" if path.is_dir() else path)  # a zarr group is a directory
    kind = foreign(head)
    if kind and not head.startswith(_ARCHIVE):
        raise FileFormatError(f"{path}: {kind}")
    by_suffix = sorted(IMPORTERS.values(), key=lambda importer: not path.name.endswith(importer.suffix))
    for importer in by_suffix:
        if importer.recognises(head):
            return importer
    for name, exporter in only_written.items():
        recognises = getattr(exporter, "recognises", None)
        if path.name.endswith(exporter.suffix) and (recognises is None or recognises(head)):
            raise FileFormatError(f"{path}: files of {name} can be written, but not read")
    for importer in by_suffix:  # its reader says what is missing
        if (signs := getattr(importer, "signs", None)) and signs.search(head):
            return importer
    if _MODULES[_TEXT].nearly_recognises(head):  # as above
        return IMPORTERS[_TEXT]
    from brdfdb.fitting.published import SUFFIX

    if path.name.lower().endswith(SUFFIX):
        raise FileFormatError(f"{path}: a file of published fits holds no samples; `brdfdb fit` lists the fits")
    raise FileFormatError(f"{path}: no format recognises it: {kind or _unrecognised(head)}")


def _unrecognised(head: bytes) -> str:
    """Return what a file of no known format looks like, by its first bytes, and what it lacks."""
    of_text = _MODULES[_TEXT]
    if columns := of_text.columns_of(head):
        return f"read as text it has the columns {', '.join(columns)[:_SHOWN]}: name them with {of_text.HOW}"
    read = ", ".join(IMPORTERS)
    if head.startswith(_PICTURES):
        return "it is a picture; f_r is read of files of numbers"
    if encoding_of(head) is None:
        return f"it is binary, and does not begin as a file of one of the formats {read}"
    if head.startswith(b"{"):
        names = ", ".join(re.findall(r'"([^"\n]{1,40})"\s*:', head.decode("utf-8", "replace")))[:_SHOWN]
        lists = "bird needs metadata and data.BRDF, openmaterial needs brdf.lookupTable"
        return f"it is JSON with the fields {names or 'of no name'}; {lists}"
    if element := re.match(rb"(?:<[?!].*?>\s*)*<([\w:.-]{1,40})", head, re.DOTALL):
        return f"it is XML of the element {element[1].decode()}; klems and radiance need WindowElement"
    if not head:
        return "it is empty"
    words = "names of columns such as theta_i, theta_r, delta_phi, BRDF and rows of numbers below them"
    return f"it is text without {words}, and without the first lines of one of the formats {read}"
