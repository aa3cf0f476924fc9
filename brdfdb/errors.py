"""The errors of this package: one base class, so that a caller can tell a refused input from a bug."""

from __future__ import annotations

import bisect
import difflib
import importlib
import math
import sys
import warnings
from collections.abc import Iterable, Mapping
from types import ModuleType
from typing import Any

_SHOWN = 60  # characters of an unknown name that a sentence repeats


class BrdfdbError(Exception):
    """An error that the user can act on; str() is one sentence with the value and the allowed values."""


class ParameterError(BrdfdbError, ValueError):
    """An argument that is not allowed.

    Parameters
    ----------
    parameter : str
        Name of the argument, as the caller gives it.
    sentence : str
        What is wrong with the value and what is allowed; it follows the name and a colon.
    value : object
        The value that was given.
    allowed : object
        The values that are allowed: an interval (low, high), a tuple of names, or a short description.
    """

    def __init__(self, parameter: str, sentence: str, value: object = None, allowed: object = None) -> None:
        super().__init__(parameter, sentence, value, allowed)
        self.parameter = parameter
        self.sentence = sentence
        self.value = value
        self.allowed = allowed

    def __str__(self) -> str:
        return f"{self.parameter}: {self.sentence}"


class DegreesWarning(UserWarning):
    """An angle [rad] that is likely to be in degrees: of more than two turns, or so labelled; scans may filter it."""


def warn_of_degrees(name: str, sentence: str) -> None:
    """Warn that an angle [rad] looks like degrees, at the line that called this package."""
    level = 1
    frame = sys._getframe()
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] == "brdfdb":
        level += 1
        frame = frame.f_back
    warnings.warn(f"{name}: {sentence}", DegreesWarning, stacklevel=level)


class MaterialError(ParameterError):
    """A description that is not that of a material; `parameter` is the field that is at fault.

    Parameters
    ----------
    material : str
        Name of the material.
    parameter, sentence, value, allowed
        As of `ParameterError`.
    """

    def __init__(
        self, material: str, parameter: str, sentence: str, value: object = None, allowed: object = None
    ) -> None:
        super().__init__(parameter, sentence, value, allowed)
        self.args = (material, parameter, sentence, value, allowed)
        self.material = material

    def __str__(self) -> str:
        return f"{self.material}: {super().__str__()}"


class WriteError(BrdfdbError, OSError):
    """A file that cannot be written, where the library that writes it does not say which error it met."""


class CannotHoldError(BrdfdbError):
    """A table that a file format has no place for; the sentence says why."""


class FileFormatError(BrdfdbError, ValueError):
    """A file that is not of the format that it is read as, or is damaged; the sentence names the file."""


class StoreError(BrdfdbError):
    """A store that is missing, damaged, of another version, or cannot be written."""


class NoEditionError(StoreError):
    """A place without an edition."""


class NoServiceError(StoreError):
    """An address where something else than a service of brdfdb answers."""


_COMPARED = 2000  # names that a wrong one is compared with: those next to it in the alphabet. Each takes 20 us


class UnknownMaterialError(BrdfdbError, KeyError):
    """A name that is not in the store.

    Parameters
    ----------
    name : str
        The name that was given.
    names : iterable of str
        The names that exist.

    Attributes
    ----------
    closest : list of str
        Up to five names that are close to it.
    """

    kind = "material"
    place = " in the store"

    def __init__(self, name: str, names: Iterable[str] = ()) -> None:
        super().__init__(name)
        self.name = name
        others = sorted(names)
        at = max(0, bisect.bisect(others, name) - _COMPARED // 2)
        self.closest = difflib.get_close_matches(name, others[at : at + _COMPARED], n=5, cutoff=0.4)

    def __str__(self) -> str:
        hint = f"; closest: {', '.join(self.closest)}" if self.closest else ""
        shown = self.name if len(self.name) <= _SHOWN else f"{self.name[:_SHOWN]}..."
        return f"no {self.kind} {shown!r}{self.place}{hint}"


class UnknownFamilyError(UnknownMaterialError):
    """A name that is not that of a family in the store."""

    kind = "family"


class UnknownModelError(UnknownMaterialError):
    """A name that is not that of a model."""

    kind = "model"
    place = ""


class UnknownRevisionError(BrdfdbError, KeyError):
    """A revision that a material does not have."""

    def __str__(self) -> str:
        return str(self.args[0])


class BusyError(BrdfdbError):
    """A lock of the store that another build holds."""


# Modules that an optional extra of the distribution installs. The service needs those of scenes, too
EXTRAS = {
    "serve": ("fastapi", "uvicorn", "uvloop", "httptools", "orjson", "prometheus_client", "pydantic_settings"),
    "scenes": ("colour", "matplotlib", "OpenEXR", "scipy"),
    "report": ("jinja2", "matplotlib", "mpmath", "colour"),
    "dask": ("distributed",),
    "editions": ("obstore", "pyarrow"),
    "http": ("fsspec", "aiohttp"),
    "measurements": ("scipy", "h5py"),
    "microgeometry": ("embreex", "scipy", "SurfaceTopography", "tifffile", "PIL"),
    "release": ("hatchling", "sphinx", "myst_nb"),
}


class MissingExtraError(BrdfdbError):
    """A module that is not installed because it belongs to an optional extra."""


def import_extra(module: str) -> ModuleType:
    """Return a module of an optional extra; MissingExtraError, with the command that installs it, where it is not."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        missing = missing_extra(error.name or module)
        if missing is None:
            raise
        raise missing from None


def missing_extra(module: str) -> MissingExtraError | None:
    """Return the error that names the extras which install a module; None for a module of no extra.

    Parameters
    ----------
    module : str
        Full name of the module that is not installed, as `ModuleNotFoundError.name` has it.
    """
    package = module.partition(".")[0]
    commands = [install_command(extra) for extra, modules in EXTRAS.items() if package in modules]
    if not commands:
        return None
    return MissingExtraError(f"{package} is not installed; it comes with {' or '.join(commands)}")


def install_command(extra: str) -> str:
    """Return the command that adds an extra to this installation, from the clone, wheel or index that it came from."""
    import importlib.metadata  # these imports take longer than those of a short command
    import json
    from urllib.parse import unquote, urlsplit

    try:
        origin = importlib.metadata.distribution("brdfdb").read_text("direct_url.json")
    except importlib.metadata.PackageNotFoundError:  # on a path of modules, without pip
        return f"pip install -e '.[{extra}]' in a clone"
    if origin is None:  # pip found it by its name
        return f"pip install 'brdfdb[{extra}]'"
    known = json.loads(origin)
    url = urlsplit(known["url"])
    if url.scheme == "file":
        editable = "-e " if known.get("dir_info", {}).get("editable") else ""
        return f"pip install {editable}'{unquote(url.path)}[{extra}]'"
    system = f"{known['vcs_info']['vcs']}+" if "vcs_info" in known else ""
    return f"pip install 'brdfdb[{extra}] @ {system}{known['url']}'"


# What is not of the type that a field has, by the types of pydantic's errors
_NO = {
    "string_type": "a text, in quotes",
    **dict.fromkeys(("float_type", "float_parsing"), "a number"),
    **dict.fromkeys(("int_type", "int_parsing", "int_from_float"), "a whole number"),
    "finite_number": "a finite number",
    **dict.fromkeys(("bool_type", "bool_parsing"), "true or false"),
    **dict.fromkeys(("list_type", "tuple_type"), "a list, in square brackets"),
    **dict.fromkeys(("dict_type", "model_type", "model_attributes_type"), "a table of fields"),
    **dict.fromkeys(("date_type", "datetime_type"), "a date"),
}
_LIMITS = {
    "greater_than": ("gt", "must be greater than"),
    "greater_than_equal": ("ge", "must be at least"),
    "less_than": ("lt", "must be less than"),
    "less_than_equal": ("le", "must be at most"),
}
_PATTERNS = {
    "^[a-z0-9]+(-[a-z0-9]+)*$": "lower-case letters, digits and single hyphens",
    "^[^/]+/[^/]+/[^/]+$": "SHELF/BOOK/PAGE of refractiveindex.info",
    r"^(\*|https?://[^/]+)$": "* or an origin such as https://example.org",
}


def sentence_of(error: Mapping[str, Any]) -> str:
    """Return the sentence on a finding of pydantic, without the name of its field: the value and what is allowed."""
    kind = error["type"]
    context = error.get("ctx", {})
    if kind == "missing":
        return "is missing"
    if kind == "extra_forbidden":
        return "unknown key"
    if kind == "value_error":
        wrong = context["error"]
        return wrong.sentence if isinstance(wrong, ParameterError) else str(wrong)
    value = repr(error["input"])
    value = value if len(value) <= _SHOWN else f"{value[:_SHOWN]}..."
    if kind in _NO:
        return f"{value} is not {_NO[kind]}"
    if kind in _LIMITS:
        bound, must = _LIMITS[kind]
        return f"{value} {must} {context[bound]:g}"
    if kind == "string_too_short":
        return "must not be empty"
    if kind == "string_too_long":
        return f"has more than the {counted(context['max_length'], 'character')} that are allowed"
    if kind == "too_short":
        return f"has {counted(context['actual_length'], 'value')}, needs at least {context['min_length']}"
    if kind == "too_long":
        return f"has more than the {counted(context['max_length'], 'value')} that are allowed"
    if kind == "literal_error":
        return f"{value} is not one of {context['expected'].replace(' or ', ', ')}"
    if kind == "string_pattern_mismatch" and context["pattern"] in _PATTERNS:
        return f"{value} is not {_PATTERNS[context['pattern']]}"
    return f"{value} is not allowed: {error['msg']}"


def near_90(theta_deg: float) -> str:
    """Return an angle [degree] below 90 as text, with two digits of its distance from 90."""
    return f"{theta_deg:.{max(1, 1 - math.floor(math.log10(max(90.0 - theta_deg, 1e-12))))}f}"


def counted(number: int, noun: str) -> str:
    """Return a number with its noun, which takes an s unless the number is 1."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def percent(share: float | None) -> str:
    """Return a share as text in percent, without decimals from 10 % on, with two digits below; empty if None."""
    if share is None:
        return ""
    return f"{100.0 * share:.2g} %" if abs(share) < 0.0995 else f"{100.0 * share:.0f} %"
