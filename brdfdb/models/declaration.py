"""The declaration of a model. Its functions of angles and of unit vectors, their checks and their words follow from it.

`DeclaredModel` decorates a function, which has one of three forms. Its first arguments tell them apart:

* ``f(cos_i, cos_r, ..., parameters)``: a formula of numbers. The first arguments are properties that both
  `brdfdb.geometry.Angles` and `brdfdb.geometry.Vectors` have. It is compiled, and broadcasts over arrays.
* ``f(directions, parameters)``: a function of arrays, with `Angles` or `Vectors` as directions.
* ``f(directions, out, parameters)``: the same for a loop that fills an array. It writes to `out`, unless that is None
  or of another shape or dtype, and its values are 0 below the horizon and nan where a direction is nan.

Parameters arrive checked, in the order of the arguments, or as ``*parameters`` in the order of the declaration. The
docstring has a first sentence, paragraphs of notes, and an example that begins with ``>>>``.
"""

from __future__ import annotations

import functools
import inspect
import operator
import textwrap
from collections.abc import Callable
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any, NamedTuple, NoReturn, Protocol, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike

from brdfdb._numba import elementwise
from brdfdb.arrays import PLAIN_TYPES, array_function, entered
from brdfdb.geometry import Angles, Directions, Vectors, checked_angles, checked_vectors, finished
from brdfdb.models._rows import Loop, by_rows_of_vectors
from brdfdb.models.large_calls import PART, PART_BY_ANGLES, in_parts
from brdfdb.parameters import Floats, Gradient, ModelSpec, Parameter

R = TypeVar("R")

# Properties of directions of both kinds
FEATURES = frozenset(
    name
    for name, value in vars(Vectors).items()
    if isinstance(value, property | functools.cached_property) and name not in ("below", "given")
)

_OUT_AND_THREADS = """\
out : array, optional
    Writable, C-contiguous, in the shape and dtype of the result: it is written there and returned.
threads : int
    Number of threads that share a large call, at least 1; by default 1. Values are the same bit for bit."""
_RETURNS = """\
array [1/sr]
    In the broadcast shape of all arguments; 0 below the horizon, nan where an angle is nan."""


class FunctionOfDirections(Protocol[R]):
    """A public function of angles, with its twin of unit vectors."""

    __name__: str
    vectors: Callable[..., R]

    def __call__(self, *directions: ArrayLike, **parameters: Any) -> R:
        """Return the values at directions."""
        ...


class ModelFunction(FunctionOfDirections[Floats], Protocol):
    """The public function of a model, with its specification."""

    spec: ModelSpec


class Slopes(NamedTuple):
    """The loop that computes the derivatives of a model, called as `by_rows_of_vectors` says.

    It fills in f_r and then the derivatives by the parameters `names`. Its scalars are the parameters, or what the
    function `scalars` makes of them.
    """

    loop: Loop
    names: tuple[str, ...]
    scalars: Callable[..., tuple[Floats, ...]] | None = None


def _undeclared(*_: Any, **__: Any) -> NoReturn:
    raise TypeError("a DeclaredModel decorates a function")


@dataclass(frozen=True, kw_only=True)
class DeclaredModel(ModelSpec):
    """The declaration of a model, a decorator: fields of `ModelSpec`, of which the decorated function gives some.

    `references` are keys of the bibliography, the first of which is `reference`. `light` names what comes with the
    light, beside the parameters of a material. `optional` parameters are None where they are not given. A call with
    several values of the parameter `together` is not cut into parts. `slopes` computes the derivatives.
    """

    name: str = ""
    version: int = 1
    reference: str = ""
    evaluate: Callable[..., Floats] = _undeclared
    vectors: Callable[..., Floats] = _undeclared
    references: str
    light: tuple[Parameter, ...] = ()
    optional: tuple[Parameter, ...] = ()
    together: str = ""
    slopes: Slopes | None = None

    def __call__(self, function: Callable[..., Any]) -> ModelFunction:
        """Return the public function of angles, and define its twin, ``<name>_vectors``, in the module, too."""
        declared = _Declared(function, (*self.parameters, *self.light, *self.optional), self.optional)
        public = cast(ModelFunction, declared.public(self.references, "", self.together))
        public.spec = replace(
            self,
            name=function.__name__,
            reference=self.references.replace(",", " ").split()[0],
            evaluate=public,
            vectors=public.vectors,
            spectral=bool(self.light),
            gradient=declared.gradient(self.slopes) if self.slopes else None,
        )
        return public


def of_directions(
    *,
    parameters: tuple[Parameter, ...],
    references: str,
    returns: str = "",
    optional: tuple[Parameter, ...] = (),
    together: str = "",
) -> Callable[[Callable[..., R]], FunctionOfDirections[R]]:
    """Return a decorator for a function that is no model of the registry: it is declared as models are.

    A function with `returns`, the words of that section of its docstring, finishes its result itself, and takes neither
    `out` nor `threads`. A function whose first argument is `light` takes the direction of the light only.
    """

    def decorate(function: Callable[..., R]) -> FunctionOfDirections[R]:
        declared = _Declared(function, (*parameters, *optional), optional)
        return cast(FunctionOfDirections[R], declared.public(references, returns, together))

    return decorate


class _Kind(NamedTuple):
    """One way to give directions: the names of the arguments, their check, and their description."""

    names: tuple[str, ...]
    check: Callable[..., Directions]
    description: str


def _incident_angle(theta_i: ArrayLike) -> Angles:
    return checked_angles(theta_i, 0.0, 0.0, 0.0)


def _incident_vector(wi: ArrayLike) -> Vectors:
    return checked_vectors(wi, wi)


_BY_ANGLES = _Kind(
    ("theta_i", "phi_i", "theta_r", "phi_r"),
    checked_angles,
    "Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi], phi from x.",
)
_BY_VECTORS = _Kind(("wi", "wr"), checked_vectors, "`wi` (light) and `wr` (viewer)")
_BY_ANGLE = _Kind(("theta_i",), _incident_angle, "Angle of incidence, in [0, pi].")
_BY_VECTOR = _Kind(("wi",), _incident_vector, "`wi` (light)")


class _Declared:
    """A function with its parameters in the order of its arguments."""

    def __init__(
        self, function: Callable[..., Any], known: tuple[Parameter, ...], optional: tuple[Parameter, ...]
    ) -> None:
        by_name = {parameter.name: parameter for parameter in known}
        arguments = inspect.signature(function).parameters
        features = tuple(name for name in arguments if name in FEATURES)
        given = [name for name in arguments if name not in (*features, "directions", "light", "out")]
        several = any(argument.kind is argument.VAR_POSITIONAL for argument in arguments.values())
        if not several and sorted(given) != sorted(by_name):
            properties = ", ".join(sorted(FEATURES))
            raise TypeError(
                f"{function.__name__}: its arguments {', '.join(given) or 'none'} are not its parameters "
                f"{', '.join(by_name) or 'none'}; further arguments are directions, out, or of {properties}"
            )
        self.parameters = tuple(known if several else (by_name[name] for name in given))
        self.optional = optional
        self.function = function
        self.features = features
        self.takes_out = "out" in arguments
        self.of_light = "light" in arguments

    def public(self, references: str, returns: str, together: str) -> FunctionOfDirections[Any]:
        """Return the function of angles, with its twin as its attribute `vectors`."""
        kinds = (_BY_ANGLE, _BY_VECTOR) if self.of_light else (_BY_ANGLES, _BY_VECTORS)
        evaluate = self._evaluate(finish=not returns)
        call, twin = (self._call(kind, evaluate, large=not returns, together=together) for kind in kinds)
        call.__doc__ = self._document(kinds[0], references, returns)
        name = call.__name__
        unit = (returns or _RETURNS).partition("[")[2].partition("]")[0]
        words = f"Return `{name}` [{unit}] for unit vectors {kinds[1].description} of shape (..., 3)."
        public = cast(FunctionOfDirections[Any], call)
        public.vectors = self._defined(twin, f"{name}_vectors", words)
        return public

    def _defined(self, function: Callable[..., Any], name: str, words: str) -> Callable[..., Any]:
        """Return a function with its name and words, and make it a global name of the module, as if written there."""
        function.__name__ = function.__qualname__ = name
        function.__doc__ = words
        self.function.__globals__[name] = function
        return function

    def gradient(self, slopes: Slopes) -> Callable[..., Gradient]:
        """Return the function of unit vectors that gives the derivatives."""

        def derivatives(directions: Directions, _: None, *values: Floats) -> Gradient:
            assert isinstance(directions, Vectors)
            scalars = slopes.scalars(*values) if slopes.scalars else values
            several = (1 + len(slopes.names),)
            f_r, *others = by_rows_of_vectors(slopes.loop, directions, scalars, several=several)
            return Gradient(f_r, dict(zip(slopes.names, others, strict=True)))

        name = self.function.__name__
        call = self._call(_BY_VECTORS, derivatives, large=False, together="")
        return self._defined(call, f"{name}_gradient", f"Return `{name}_vectors` [1/sr] and its derivatives.")

    def _evaluate(self, *, finish: bool) -> Callable[..., Any]:
        """Return a function of directions, the array of the result or None, and checked parameters."""
        function = self.function
        if self.takes_out:
            return function
        if self.features:
            kernel = elementwise(function)
            features = operator.attrgetter(*self.features)
            one = len(self.features) == 1

            def formula(directions: Directions, _: Floats | None, *values: Floats) -> Floats:
                read = features(directions)
                return finished(kernel(read, *values) if one else kernel(*read, *values), directions)

            return formula
        if finish:
            return lambda directions, _, *values: finished(function(directions, *values), directions)
        return lambda directions, _, *values: function(directions, *values)

    def _call(self, kind: _Kind, evaluate: Callable[..., Any], *, large: bool, together: str) -> Callable[..., Any]:
        """Return a function of one kind of directions: with the gate of arrays, and with the checks."""
        signature = self._signature(kind)
        names = tuple(signature.parameters)
        count = len(kind.names)
        check = kind.check
        order = tuple(parameter.name for parameter in self.parameters)
        wanted = frozenset(order)
        most = len(order)
        read = operator.itemgetter(*order) if len(order) > 1 else lambda given: tuple(given[name] for name in order)
        checks = tuple(self._check(parameter) for parameter in self.parameters)
        optional = {parameter.name for parameter in self.optional}
        all_defaults = {name: signature.parameters[name].default for name in order}
        defaults = {name: value for name, value in all_defaults.items() if value is not inspect.Parameter.empty}

        def bound(directions: tuple[Any, ...], given: dict[str, Any]) -> tuple[tuple[Any, ...], dict[str, Any]]:
            """Return arguments as directions and parameters; TypeError if one is missing or unknown."""
            try:
                arguments = signature.bind(*directions, **given)
            except TypeError as error:
                raise TypeError(f"{plain.__name__}() {error}") from None
            arguments.apply_defaults()
            return arguments.args, arguments.kwargs

        def value(directions: tuple[Any, ...], given: dict[str, Any], out: Floats | None) -> Any:
            return evaluate(check(*directions), out, *map(operator.call, checks, read(given)))

        def computed(directions: tuple[Any, ...], given: dict[str, Any], out: Floats | None, threads: int) -> Any:
            if len(given) < most:
                given = defaults | given
            if len(directions) != count or given.keys() != wanted:
                directions, given = bound(directions, given)
            # theta_i, phi_i, theta_r: a row of azimuths is not scattered
            scattered = count == len(_BY_ANGLES.names) and any(
                isinstance(angle, np.ndarray) and angle.size > PART_BY_ANGLES for angle in directions[:3]
            )
            if out is None and type(threads) is int and threads == 1 and not scattered:
                return evaluate(check(*directions), None, *map(operator.call, checks, read(given)))

            def evaluate_part(arguments: dict[str, Any], part: Floats | None) -> Floats:
                return cast(Floats, value(tuple(arguments[name] for name in kind.names), arguments, part))

            whole = dict(zip(kind.names, directions, strict=True)) | given
            part_size = PART_BY_ANGLES if scattered else PART
            return in_parts(evaluate_part, whole, out, threads, part_size=part_size, together=together)

        def call(*directions: Any, out: Floats | None = None, threads: int = 1, **given: Any) -> Any:
            if PLAIN_TYPES.issuperset(map(type, directions)) and PLAIN_TYPES.issuperset(map(type, given.values())):
                return computed(directions, given, out, threads)
            ready = entered(names, directions, given)
            return ready.finish(computed(ready.args, ready.keywords, out, threads))

        def call_whole(*directions: Any, **given: Any) -> Any:
            return value(*bound(directions, given), None)

        plain: Any = call if large else call_whole
        functools.update_wrapper(plain, self.function)
        plain.__signature__ = signature
        returned = Floats if self.features else self.function.__annotations__.get("return", Any)
        plain.__annotations__ = {name: ArrayLike | None if name in optional else ArrayLike for name in names}
        plain.__annotations__["return"] = returned
        return cast(Callable[..., Any], plain if large else array_function(plain))

    def _check(self, parameter: Parameter) -> Callable[[Any], Any]:
        if parameter not in self.optional:
            return parameter.check
        return lambda value: None if value is None else parameter.check(value)

    def _signature(self, kind: _Kind) -> inspect.Signature:
        directions = [
            inspect.Parameter(name, inspect.Parameter.POSITIONAL_OR_KEYWORD, annotation="ArrayLike")
            for name in kind.names
        ]
        parameters = [
            inspect.Parameter(
                parameter.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=_default(parameter, optional=parameter in self.optional),
                annotation="ArrayLike | None" if parameter in self.optional else "ArrayLike",
            )
            for parameter in self.parameters
        ]
        returned = "Floats" if self.features else inspect.signature(self.function).return_annotation
        return inspect.Signature([*directions, *parameters], return_annotation=returned)

    def _document(self, kind: _Kind, references: str, returns: str) -> str:
        words, prompt, example = inspect.cleandoc(self.function.__doc__ or "").partition("\n>>> ")
        summary, _, notes = words.strip().partition("\n\n")
        parameters = [f"{', '.join(kind.names)} : array_like [rad]\n{_indented(kind.description)}"]
        parameters += [_described(parameter, optional=parameter in self.optional) for parameter in self.parameters]
        parameters += [] if returns else [_OUT_AND_THREADS]
        sections = {
            "Parameters": "\n".join(parameters),
            "Returns": returns or _RETURNS,
            "Raises": "ParameterError\n    If an argument is outside its range.",
            "Notes": notes,
            "References": references,
            "Examples": f">>> import numpy as np\n>>> {example}" if "np." in example else (prompt + example).strip(),
        }
        titled = [f"{title}\n{'-' * len(title)}\n{text}" for title, text in sections.items() if text]
        return "\n\n".join([summary, *titled]) + "\n"


def _default(parameter: Parameter, *, optional: bool) -> Any:
    if optional:
        return None
    return inspect.Parameter.empty if parameter.default is None else parameter.default


def _described(parameter: Parameter, *, optional: bool) -> str:
    """Return the entry of a parameter in a docstring."""
    meaning = parameter.meaning[:1].upper() + parameter.meaning[1:]
    if isinstance(parameter.default, bool):
        return f"{parameter.name} : bool\n{_indented(f'{meaning}; by default {parameter.default}.')}"
    more = (
        "; by default none" if optional else "" if parameter.default is None else f"; by default {parameter.default:g}"
    )
    kind = f"array_like [{parameter.unit}]" + (", optional" if optional else "")
    interval = f"[{_end(parameter.low)}, {_end(parameter.high)}]"
    return f"{parameter.name} : {kind}\n{_indented(f'{meaning}, in {interval}{more}.')}"


def _end(value: float) -> str:
    """Return an end of a range in words of a docstring."""
    if value in (np.pi, np.pi / 2):
        return "pi" if value == np.pi else "pi/2"
    if value and not 0.01 <= abs(value) < 1e4:
        return f"{value:.0e}".replace("e-0", "e-").replace("e+0", "e")
    return f"{value:g}"


def _indented(text: str) -> str:
    return textwrap.fill(text, 112, initial_indent="    ", subsequent_indent="    ")


def functions_of(module: ModuleType) -> list[Any]:
    """Return the functions of directions that a module declares, in the order of their declaration."""
    return [
        value
        for value in vars(module).values()
        if inspect.isfunction(value) and hasattr(value, "vectors") and value.__module__ == module.__name__
    ]
