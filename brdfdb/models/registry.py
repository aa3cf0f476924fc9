"""The registry of models: ours, those of installed packages, and those of files that the user names."""

from __future__ import annotations

import hashlib
import importlib.metadata
import importlib.util
import inspect
import math
import os
import re
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any, get_args

from brdfdb.errors import BrdfdbError, ParameterError
from brdfdb.parameters import HeightRelation, ModelSpec, Parameter, SurfaceProperty, closest
from brdfdb.place import path_of

GROUP = "brdfdb.models"  # group of entry points, each of which gives a model or an iterable of models
VARIABLE = "BRDFDB_MODELS"  # environment variable with paths of Python files, separated as in PATH

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
_FUNCTIONS = ("evaluate", "vectors")
_OPTIONAL_FUNCTIONS = (
    "specular",
    "anisotropic",
    "lobe",
    "lossless",
    "forms",
    "exact_model",
    "limits",
    "uniform_bound_cosine",
)


class Registry(dict[str, ModelSpec]):
    """Models by name. An unknown name raises `ParameterError`."""

    def __missing__(self, name: str) -> ModelSpec:
        text = f"{name!r} is not one of {', '.join(self)}{closest(name, self)}; --models FILE adds your models"
        raise ParameterError("model", text, name, tuple(self))

    def add(self, models: Iterable[Any], origin: str) -> None:
        """Add models: all of them, or none if one cannot be added.

        Parameters
        ----------
        models : iterable
            Functions that are declared as models, or specifications.
        origin : str
            Package or file that defines them, for messages.

        Raises
        ------
        BrdfdbError
            If one is no model, one of its fields is no such thing as a ModelSpec has, or its name is taken.
        """
        new: dict[str, ModelSpec] = {}
        for model in models:
            spec = _spec_of(model)
            if spec is None:
                raise BrdfdbError(f"{origin}: {model!r:.80} is not a declared model or a brdfdb.parameters.ModelSpec")
            _check(spec, origin)
            if spec.name in self or spec.name in new:
                raise BrdfdbError(f"{origin}: the name {spec.name!r} is that of another model; choose another name")
            new[spec.name] = spec
        self.update(new)

    def add_packages(self) -> None:
        """Add the models of installed packages, which name them as entry points of the group `GROUP`.

        Raises
        ------
        BrdfdbError
            If an entry point cannot be loaded or gives no model, or if the name of a model is taken.
        """
        for entry in importlib.metadata.entry_points(group=GROUP):
            origin = f"entry point {entry.name} = {entry.value}"
            try:
                given: Any = entry.load()
                specs = [given] if _spec_of(given) else list(given)
            except Exception as error:
                raise BrdfdbError(f"{origin}: {_message(error)}") from error
            self.add(specs, origin)

    def add_files(self, paths: Iterable[str | os.PathLike[str]]) -> None:
        """Add the models of Python files, for this process and those that it starts.

        Parameters
        ----------
        paths : iterable of path
            Each file is run once. Every declared model and every `ModelSpec` among its global names is added, except
            the ones of this registry that it imports.

        Raises
        ------
        BrdfdbError
            If a file does not exist, raises an error or defines no model, or if the name of a model is taken.
        """
        for path in paths:
            file = path_of(path, "paths").absolute()
            if os.pathsep in str(file):
                raise BrdfdbError(
                    f"{file}: the path of a file of models must not have {os.pathsep!r}, which separates paths"
                )
            self._add_file(file)
            known = [str(Path(entry).absolute()) for entry in os.environ.get(VARIABLE, "").split(os.pathsep) if entry]
            # absolute paths: a process that is started later may have another working directory
            os.environ[VARIABLE] = os.pathsep.join(dict.fromkeys([*known, str(file)]))

    def add_environment(self) -> None:
        """Add the models of the files that the environment variable `VARIABLE` names, as `add_files` does."""
        self.add_files([path for path in os.environ.get(VARIABLE, "").split(os.pathsep) if path])

    def _add_file(self, file: Path) -> None:
        # The module has the same name in every process, so that objects of the file can be pickled
        name = f"brdfdb_models_{hashlib.sha256(str(file).encode()).hexdigest()[:12]}"
        if name in sys.modules:
            return
        if not file.is_file():
            raise BrdfdbError(f"{file}: no such file of models")
        description = importlib.util.spec_from_file_location(name, file)
        if description is None or description.loader is None:
            raise BrdfdbError(f"{file}: the name of a file of models must end in .py")
        module = importlib.util.module_from_spec(description)
        sys.modules[name] = module
        try:
            try:
                description.loader.exec_module(module)
            except (Exception, SystemExit) as error:
                raise BrdfdbError(f"{file}: {_message(error)}") from error
            ours = {id(spec) for spec in self.values()}
            specs = {id(spec): spec for spec in map(_spec_of, vars(module).values()) if spec is not None}
            new = [spec for key, spec in specs.items() if key not in ours]
            if not new:
                raise BrdfdbError(f"{file}: it declares no model, and no brdfdb.parameters.ModelSpec")
            self.add(new, str(file))
        except BrdfdbError:
            del sys.modules[name]
            raise


def _spec_of(model: Any) -> ModelSpec | None:
    """Return the specification of a declared model, or the specification itself; None of anything else."""
    spec = getattr(model, "spec", None) if inspect.isfunction(model) else model
    return spec if isinstance(spec, ModelSpec) else None


def _check(spec: ModelSpec, origin: str) -> None:
    """Raise a BrdfdbError that names the first field of a model which cannot be used."""
    if not isinstance(spec.name, str) or not _NAME.fullmatch(spec.name):
        raise BrdfdbError(
            f"{origin}: name: {spec.name!r} is not a name of letters, digits, _ and - that begins with a letter"
        )
    if not isinstance(spec.version, int) or spec.version < 1:
        raise BrdfdbError(f"{origin}: {spec.name}: version: {spec.version!r} is not an integer of at least 1")
    parameters: Any = spec.parameters
    if not isinstance(parameters, tuple) or not all(isinstance(parameter, Parameter) for parameter in parameters):
        raise BrdfdbError(
            f"{origin}: {spec.name}: parameters: {parameters!r:.80} is not a tuple of brdfdb.parameters.Parameter"
        )
    for field in (*_FUNCTIONS, *_OPTIONAL_FUNCTIONS):
        given = getattr(spec, field)
        if not callable(given) and (given is not None or field in _FUNCTIONS):
            allowed = "a function" if field in _FUNCTIONS else "a function or None"
            raise BrdfdbError(f"{origin}: {spec.name}: {field}: {given!r:.80} is not {allowed}")
    power = spec.grazing_power
    if not (power is None or callable(power) or (isinstance(power, int | float) and 0.0 <= power < math.inf)):
        allowed = "a number of at least 0, a function or None"
        raise BrdfdbError(f"{origin}: {spec.name}: grazing_power: {power!r:.80} is not {allowed}")
    heights = spec.heights
    if not isinstance(heights, HeightRelation | None):
        raise BrdfdbError(f"{origin}: {spec.name}: heights: {heights!r:.80} is not a HeightRelation or None")
    for assumption in heights.assumptions if heights else ():
        if assumption.property not in get_args(SurfaceProperty):
            allowed = ", ".join(get_args(SurfaceProperty))
            raise BrdfdbError(f"{origin}: {spec.name}: heights: {assumption.property!r} is not one of {allowed}")


def _message(error: BaseException) -> str:
    """Return the class and the first line of an error."""
    return f"{type(error).__name__}: {error}".partition("\n")[0]
