"""The errors of this package: one base class, so that a caller can tell a refused input from a bug."""

from __future__ import annotations

import difflib
import importlib
from collections.abc import Iterable
from types import ModuleType

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
        self.parameter, self.sentence, self.value, self.allowed = parameter, sentence, value, allowed

    def __str__(self) -> str:
        return f"{self.parameter}: {self.sentence}"


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


class StoreError(BrdfdbError):
    """A store that is missing, damaged, of another version, or cannot be written."""


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

    def __init__(self, name: str, names: Iterable[str] = ()) -> None:
        super().__init__(name)
        self.name = name
        self.closest = difflib.get_close_matches(name, names, n=5, cutoff=0.4)

    def __str__(self) -> str:
        hint = f"; closest: {', '.join(self.closest)}" if self.closest else ""
        shown = self.name if len(self.name) <= _SHOWN else f"{self.name[:_SHOWN]}..."
        return f"no {self.kind} {shown!r} in the store{hint}"


class UnknownFamilyError(UnknownMaterialError):
    """A name that is not that of a family in the store."""

    kind = "family"


class UnknownRevisionError(BrdfdbError, KeyError):
    """A revision that a material does not have."""

    def __str__(self) -> str:
        return str(self.args[0])


class BusyError(BrdfdbError):
    """A lock of the store that another build holds."""


# Modules that an optional extra of the distribution installs. The service needs those of scenes, too
EXTRAS = {
    "serve": ("fastapi", "uvicorn", "uvloop", "httptools", "orjson", "prometheus_client", "plotly"),
    "scenes": ("colour", "matplotlib", "OpenEXR", "scipy"),
    "report": ("jinja2", "matplotlib", "mpmath", "colour"),
    "dask": ("distributed",),
    "http": ("fsspec", "aiohttp"),
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
    commands = [f"pip install 'brdfdb[{extra}]'" for extra, modules in EXTRAS.items() if package in modules]
    if not commands:
        return None
    return MissingExtraError(f"{package} is not installed; it comes with {' or '.join(commands)}")
