"""The signatures of the models for editors: ``python -m brdfdb.models.stub`` writes them to `__init__.pyi`."""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any

from brdfdb import models

PATH = Path(models.__file__).with_suffix(".pyi")
_MOST = 120  # characters of a line

_WAYS = ("out: Floats | None, threads: int = 1", "threads: int")
_LARGE = "def {name}(*directions: ArrayLike, {arguments}, **parameters: ArrayLike | None) -> Floats: ...\n"

_HEAD = '''"""The signatures of the models. ``python -m brdfdb.models.stub`` wrote this file from the declarations."""

# fmt: off
# ruff: noqa: E501
from types import ModuleType
from typing import overload

from numpy.typing import ArrayLike

from brdfdb.models.he_torrance_1991 import Complexes
from brdfdb.models.he_torrance_1991_limits import HeTorranceParts
from brdfdb.models.oren_nayar_1994 import Parts
from brdfdb.models.registry import Registry
from brdfdb.parameters import Floats

MODELS: Registry
PAPERS: tuple[ModuleType, ...]
'''


def stub() -> str:
    """Return the text of the file."""
    functions = [getattr(models, name) for name in models.__all__ if name != "MODELS"]
    names = textwrap.fill(", ".join(f'"{name}"' for name in models.__all__), _MOST - 4)
    return "\n".join([_HEAD, *map(_signature, functions), f"__all__ = [\n{textwrap.indent(names, '    ')},\n]", ""])


def _signature(function: Callable[..., Any]) -> str:
    signature = inspect.signature(function)
    summary = (function.__doc__ or "").partition("\n")[0]
    given = [str(argument).replace("'", "") for argument in signature.parameters.values()]
    first = [argument.kind is argument.KEYWORD_ONLY for argument in signature.parameters.values()].index(True)
    returned = f") -> {signature.return_annotation}:"
    line = f"def {function.__name__}({', '.join([*given[:first], '*', *given[first:]])}{returned}"
    if len(line) > _MOST:
        arguments = textwrap.fill(", ".join([*given[:first], "*", *given[first:]]), _MOST - 4)
        line = f"def {function.__name__}(\n{textwrap.indent(arguments, '    ')},\n{returned}"
    explicit = f'{line}\n    """{summary}"""\n'
    by_angles = getattr(models, function.__name__.removesuffix("_vectors"))
    if "threads : int" not in (by_angles.__doc__ or ""):
        return explicit
    # With the explicit arguments alone, a call with `**parameters` of numbers would pass them as `out` and `threads`
    overloads = [explicit, *(_LARGE.format(name=function.__name__, arguments=arguments) for arguments in _WAYS)]
    return "".join(f"@overload\n{overload}" for overload in overloads)


if __name__ == "__main__":
    PATH.write_text(stub(), encoding="utf-8")
