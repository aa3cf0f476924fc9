"""The interface of a file format, and its options as command line and HTTP give them: as text."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

from brdfdb.errors import ParameterError

if TYPE_CHECKING:
    from brdfdb.formats._readings import FileTable
    from brdfdb.formats._written import Written
    from brdfdb.measurements.conventions import ListedRows
    from brdfdb.measurements.samples import Samples


@dataclass(frozen=True)
class FormatOption:
    """An option of a format."""

    name: str  #: name of the keyword argument
    #: value that is used if none is given, also where it is outside of the range; its type is that of the option
    default: bool | int | float | str
    help: str  #: a few words for people, with the unit
    #: range of a number, both ends included
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()  #: values of a text
    #: largest number for which a service makes a file: larger ones take gigabytes or minutes
    most_served: float = math.inf

    @property
    def served(self) -> FormatOption:
        """The option with the range that a service allows."""
        return replace(self, high=min(self.high, self.most_served))

    @property
    def allowed(self) -> str:
        """Return the values of the option in words."""
        if isinstance(self.default, bool):
            return "true or false"
        if isinstance(self.default, str):
            return ", ".join(self.choices)
        number = "a whole number" if isinstance(self.default, int) else "a number"
        other = "" if self.low <= self.default <= self.high else f", or {self.default:g}"
        return f"{number} in [{self.low:g}, {self.high:g}]{other}"

    def parse(self, text: str) -> bool | int | float | str:
        """Return the value that a text denotes.

        Raises
        ------
        ParameterError
            If the option cannot have it.
        """
        if isinstance(self.default, bool):
            if text not in ("true", "false"):
                raise ParameterError(self.name, f"{text!r} is neither true nor false", text, ("true", "false"))
            return text == "true"
        if isinstance(self.default, str):
            if text not in self.choices:
                raise ParameterError(self.name, f"{text!r} is not one of {', '.join(self.choices)}", text, self.choices)
            return text
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        is_whole = isinstance(self.default, int)
        if (not self.low <= value <= self.high and value != self.default) or (is_whole and value != int(value)):
            raise ParameterError(self.name, f"{text!r} is not {self.allowed}", text, (self.low, self.high))
        return int(value) if is_whole else value


_KINDS = ((bool, "boolean"), (str, "string"), (object, "number"))


def schema_of(of: Mapping[str, FormatOption]) -> tuple[dict[str, Any], str]:
    """Return the JSON Schema of an option of one or more formats, with the values that any allows, and its help.

    It has no default: generated clients send defaults, and a format refuses options of others.
    """
    kinds = {next(word for kind, word in _KINDS if isinstance(option.default, kind)) for option in of.values()}
    schema: dict[str, Any] = {"type": kinds.pop() if len(kinds) == 1 else "string"}
    if schema["type"] == "number":
        ends = [end for option in of.values() for end in (option.low, option.high, float(option.default))]
        schema |= {"minimum": min(ends), "maximum": max(ends)}
    elif all(option.choices for option in of.values()):
        schema["enum"] = list(dict.fromkeys(choice for option in of.values() for choice in option.choices))
    words: dict[str, list[str]] = {}
    for key, option in of.items():
        words.setdefault(f"{option.help}; {option.allowed}; default {option.default}", []).append(key)
    return schema, ". ".join(f"{', '.join(keys)}: {sentence}" for sentence, keys in words.items())


TOLERANCE = FormatOption(
    "tolerance",
    0.02,
    "largest relative error of 99 % of the values against the table; the smallest file within it is written",
    low=1e-4,
    high=1.0,
)

FIXED = replace(
    TOLERANCE,
    help="largest relative error of 99 % of the values against the table; the grid is fixed; "
    "a larger error is reported",
)

MEGABYTES = FormatOption(
    "megabytes",
    64.0,
    "largest file [MB]; a table that needs more is written with a larger error, which the file states",
    low=0.1,
    high=2000.0,
    most_served=64.0,
)

WAVELENGTH = FormatOption(
    "wavelength", 550.0, "wavelength [nm] at which a spectral table is written", low=1.0, high=1e6
)


class Exporter(Protocol):
    """A format that tables are written to: a module or folder of `brdfdb.formats`, or another object with these names.

    It imports packages other than NumPy, and the tables, only when it writes.
    """

    suffix: str  #: end of the names of its files, with the dot
    media_type: str  #: media type over HTTP
    summary: str  #: a few words on what is written
    tools: str  #: programs that read such files
    #: Kinds of files, one file each, that are made of one table: values of the keyword argument `kind`. Empty if one
    #: file holds the table.
    kinds: tuple[str, ...]
    options: tuple[FormatOption, ...]  #: all other keyword arguments
    #: ``write(table, path, verdict=None, **options)`` writes the file, and those beside it, completely or not at all;
    #: files that exist are replaced. Its options are `options` and `kind`, whose `help` says what they mean. `verdict`
    #: is that of the audit of this revision, or None if the caller does not know it. It raises CannotHoldError for a
    #: table that the format has no place for (anisotropic, or of wavelengths that give no colour), ParameterError if an
    #: option cannot be met (no file is so small, no such wavelength), and WriteError if a file cannot be written. A
    #: module without `read` may have `recognises`, as importers do: files with its suffix are then of this format only
    #: if it recognises them.
    write: Callable[..., Written]


class Importer(Protocol):
    """A format that is read: a module or folder of `brdfdb.formats`, or another object with these names."""

    suffix: str  #: end of the names of its files, with the dot
    #: ``recognises(head)`` is true if the first bytes of a file, 4096 of them or all, are those of this format. Texts
    #: of any encoding come as UTF-8 with LF, without space before the first line. A module may have ``signs``, a
    #: regular expression of bytes: a file with a match that no format recognises is read by this one, which says what
    #: is missing.
    recognises: Callable[[bytes], bool]
    #: ``read(path)`` gives f_r as the tools of the format see it, or the rows that the file lists. It raises
    #: FileFormatError if the file is damaged or of another format, and OSError if it cannot be read. A module whose
    #: `read` takes more has a tuple ``keywords`` with their names. A module whose files may hold several materials has
    #: ``members(path)``, which gives the names that its keyword ``member`` takes, none of a file with one material. A
    #: module whose files list polar angles and azimuths of light and viewer has ``angle_unit``: deg, rad, or "stated"
    #: where each file states it. ``wavelength_unit`` is that of its numbers, by default nm. What a user states on them
    #: is applied to the rows, of which `brdfdb.formats.read` makes samples; a reader has words of it in ``keywords``
    #: only if it cannot read without them.
    read: Callable[..., FileTable | ListedRows | Samples]


def options_of(exporter: Exporter) -> dict[str, FormatOption]:
    """Return all options of a format by name, the kind of file among them."""
    kinds = exporter.kinds
    kind = [FormatOption("kind", kinds[0], "kind of file", choices=kinds)] if kinds else []
    return {option.name: option for option in (*kind, *exporter.options)}


def parsed_options(exporter: Exporter, texts: Mapping[str, str]) -> dict[str, Any]:
    """Return keyword arguments of `Exporter.write` from texts by name.

    Raises
    ------
    ParameterError
        If an option is not one of the format, or cannot have its value.
    """
    options = options_of(exporter)
    for name, text in texts.items():
        if name not in options:
            raise ParameterError(name, f"the options of this format are {', '.join(options)}", text, tuple(options))
    return {name: options[name].parse(text) for name, text in texts.items()}
