"""Names of presets in recipes: the library that a recipe names, its packaged recipe, and sentences on wrong names."""

from __future__ import annotations

import fnmatch
from collections.abc import Iterable
from importlib import resources
from importlib.resources.abc import Traversable

from brdfdb.errors import ParameterError
from brdfdb.materials import PAPERS, libraries, presets
from brdfdb.parameters import closest


def known(library: str) -> str:
    """Return the name of a library; ParameterError with the known ones if there is none."""
    names = libraries()
    if library not in names:
        raise ParameterError("library", f"{library!r} is not one of {', '.join(names)}", library, tuple(names))
    return library


def checked(library: str) -> str:
    """Return the name of a library; ValueError with the sentence alone if there is none, for pydantic."""
    try:
        return known(library)
    except ParameterError as error:
        raise ValueError(error.sentence) from None


def library_of(name: str) -> str | None:
    """Return the library that has a preset of this name, or None."""
    return next((library for library in libraries() if name in presets(library)), None)


def recipe_of(library: str) -> Traversable:
    """Return the recipe file that comes with the program for a library; ParameterError if there is no such library."""
    name = "default" if known(library) == PAPERS else library
    return resources.files("brdfdb_pipelines") / "recipes" / f"{name}.toml"


def sentence_without(pattern: str, names: Iterable[str], library: str) -> str:
    """Return the sentence on a name or pattern of a recipe that matches none of the names that the recipe knows."""
    for other in libraries():
        if other != library and fnmatch.filter(presets(other), pattern):
            return f'{pattern!r} is in the library {other}; for its materials, write library = "{other}"'
    option = "" if library == PAPERS else f" --library {library}"
    return f"{pattern!r} matches no material{closest(pattern, names)}; `brdfdb list --presets{option}` names them"
