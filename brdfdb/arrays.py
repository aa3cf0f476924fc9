"""The gate of array arguments: each becomes a NumPy array that says the same, or is refused in one sentence.

Masked entries become nan. Labelled arrays, such as those of xarray, broadcast by the names of their dimensions, and the
result is labelled. Arrays of other libraries become NumPy arrays of the same dtype. They are known by their attributes,
because models import none of these libraries.
"""

from __future__ import annotations

import functools
import inspect
import operator
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple, ParamSpec, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError, warn_of_degrees

P = ParamSpec("P")
R = TypeVar("R")

# Types that pass unchanged. Lists pass if their elements do
PLAIN_TYPES: frozenset[type] = frozenset(
    (float, int, bool, complex, str, type(None), np.ndarray, np.float64, np.float32, np.int64, np.int32, np.bool_)
)
FLOAT_TYPES: frozenset[type] = frozenset((float, np.float64))

_VECTORS = ("wi", "wr", "vectors")
_OWN_CHECKS = ("self", "out", "model")  # arguments that are no array of numbers, or that may not be another array
_TRAILING = {  # names of the axes that a result adds, by their lengths
    (): (),
    (3,): ("component",),
    (4, 4): ("stokes_reflected", "stokes_incident"),
    (2, 2): ("amplitude_reflected", "amplitude_incident"),
}


def plain(name: str, value: Any) -> Any:
    """Return an argument as NumPy reads it: masked entries as nan, an array of another library as an array.

    Labels are dropped: call `unlabelled` where that would pair numbers that do not belong together.

    Raises
    ------
    ParameterError
        If the array is lazy, requires a gradient, lies on another device, bears a unit, or cannot become an array.
    """
    if type(value) in PLAIN_TYPES:
        return value
    if isinstance(value, list | tuple):
        if PLAIN_TYPES.issuperset(map(type, value)):
            return value
        parts = [plain(name, unlabelled(name, element)) for element in value]
        try:
            whole = np.asarray(parts)
        except ValueError:
            raise ParameterError(name, "its lists have unequal lengths") from None
        return whole if any(isinstance(part, np.ndarray) for part in parts) else parts
    if isinstance(value, np.ma.MaskedArray):
        mask = np.ma.getmaskarray(value)
        data = np.asarray(value.data)
        if not mask.any():
            return data
        return np.where(mask, np.nan, data).astype(data.dtype if data.dtype.kind == "f" else np.float64)
    if _has(value, "unit") or _has(value, "magnitude"):
        unit = getattr(value, "unit", None) or getattr(value, "units", "")
        raise ParameterError(name, f"it bears the unit {unit}; give numbers in the documented unit")
    if isinstance(value, np.generic):
        return value
    if not any(hasattr(value, way) for way in ("__array__", "__dlpack__")):
        return value  # numbers of other kinds, buffers, and what a check refuses
    _check_at_hand(name, value)
    if is_labelled(value):
        return np.asarray(plain(name, value.data))
    return _converted(name, value)


def unlabelled(name: str, value: Any) -> Any:
    """Return a value; ParameterError if it has dimensions with names, which the caller cannot compare."""
    if type(value) not in PLAIN_TYPES and is_labelled(value) and len(value.dims):
        raise ParameterError(
            name, f"its dimensions {_listed(value.dims)} would lose their names here; give a NumPy array (.values)"
        )
    return value


def is_labelled(value: Any) -> bool:
    """Return True for an array whose dimensions have names."""
    return type(value) not in PLAIN_TYPES and isinstance(getattr(value, "dims", None), tuple) and hasattr(value, "data")


def array_function(function: Callable[P, R]) -> Callable[P, R]:
    """Add the gate to a function whose arguments broadcast.

    If an argument has labelled dimensions, the arguments broadcast by name, and each array of the result is labelled.
    """
    names = tuple(inspect.signature(function).parameters)

    @functools.wraps(function)
    def call(*args: Any, **given: Any) -> Any:
        if PLAIN_TYPES.issuperset(map(type, args)) and (not given or PLAIN_TYPES.issuperset(map(type, given.values()))):
            return function(*args, **given)
        ready = entered(names, args, given)
        return ready.finish(function(*ready.args, **ready.keywords))

    return cast(Callable[P, R], call)


def array_lookup(method: Callable[P, R]) -> Callable[P, R]:
    """Add the gate to a method whose argument `wavelength_nm` does not broadcast, but adds the last axis."""
    names = tuple(inspect.signature(method).parameters)

    @functools.wraps(method)
    def call(owner: Any, *args: Any, **given: Any) -> Any:
        if PLAIN_TYPES.issuperset(map(type, args)) and (not given or PLAIN_TYPES.issuperset(map(type, given.values()))):
            return method(owner, *args, **given)
        ready = entered(names, (owner, *args), given, added=functools.partial(_added, owner))
        return ready.finish(method(*ready.args, **ready.keywords))

    return cast(Callable[P, R], call)


class Entered(NamedTuple):
    """Arguments that passed the gate, and what gives the labels of the arguments to the result."""

    args: tuple[Any, ...]
    keywords: dict[str, Any]
    finish: Callable[[Any], Any]


def entered(
    names: tuple[str, ...],
    args: tuple[Any, ...],
    keywords: dict[str, Any],
    added: Callable[[Any], dict[str, Any]] | None = None,
) -> Entered:
    """Return arguments of any kind as NumPy reads them; `added` gives the axes that a result adds to the directions."""
    positional = dict(zip(names, args, strict=False))
    if len(args) > len(positional) or not positional.keys().isdisjoint(keywords):
        return Entered(args, keywords, _unchanged)  # the call raises a TypeError
    given = {name: value for name, value in (positional | keywords).items() if name not in _OWN_CHECKS}
    _check_tables(given)
    apart = {"wavelength_nm": given.pop("wavelength_nm")} if added and "wavelength_nm" in given else {}
    labels = _Labels.of(given)
    ready = given if labels is None else {name: labels.aligned(name, value) for name, value in given.items()}
    ready = {name: plain(name, value) for name, value in (ready | apart).items()}
    axes = added(apart.get("wavelength_nm")) if added and labels is not None else {}
    return Entered(
        tuple(ready.get(name, value) for name, value in positional.items()),
        {name: ready.get(name, value) for name, value in keywords.items()},
        _unchanged if labels is None else functools.partial(labels.attached, added=axes),
    )


def _unchanged(result: Any) -> Any:
    return result


class _Labels:
    """The dimensions that labelled arguments broadcast to by name, with their coordinates."""

    def __init__(self, template: Any, dims: tuple[str, ...], *, alike: bool) -> None:
        self.template = template
        self.dims = dims
        self.alike = alike

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> _Labels | None:
        """Return the labels of arguments; None if there are none, ParameterError if they do not fit one another."""
        labelled = {name: value for name, value in given.items() if is_labelled(value)}
        if not labelled:
            return None
        parts: dict[str, Any] = {}
        for name, value in labelled.items():
            if not hasattr(value, "coords"):
                raise ParameterError(name, f"{type(value).__name__} has no coordinates; give a DataArray")
            _check_at_hand(name, value)
            units = str(getattr(value, "attrs", {}).get("units", ""))
            if name.startswith(("theta", "phi")) and units.lower().startswith(("deg", "°")):
                warn_of_degrees(name, f"its units are {units!r}, but angles are radians; convert it and set its units")
            whole = value.isel({value.dims[-1]: 0}, drop=True) if name in _VECTORS and value.dims else value
            for other, part in parts.items():
                _check_same_labels(other, part, name, whole)
            parts[name] = whole
        template = functools.reduce(operator.or_, (p.copy(data=np.zeros(p.shape, np.bool_)) for p in parts.values()))
        template.name = None
        template.attrs = {}
        return cls(template, template.dims, alike=all(part.dims == template.dims for part in parts.values()))

    def aligned(self, name: str, value: Any) -> Any:
        """Return an argument with the axes of the result, of length 1 where it does not have one."""
        own = 1 if name in _VECTORS else 0  # axes that do not broadcast
        if not is_labelled(value):
            if not self.alike and np.ndim(plain(name, value)) > own:
                raise ParameterError(
                    name, f"it has no names of dimensions, but the other arrays broadcast by name: {_listed(self.dims)}"
                )
            return value
        last = value.dims[len(value.dims) - own :]
        if set(last) & set(self.dims):
            raise ParameterError(name, f"its dimension {last[0]!r} holds vectors, but another argument has it, too")
        array = value.transpose(*(dim for dim in self.dims if dim in value.dims), *last)
        axes = tuple(slice(None) if dim in value.dims else np.newaxis for dim in self.dims)
        return np.asarray(plain(name, array.data))[axes]

    def attached(self, result: Any, added: dict[str, Any]) -> Any:
        """Return a result with labels: its arrays, those of its fields or of its entries."""
        if isinstance(result, tuple):
            parts = [self.attached(part, added) for part in result]
            return type(result)(*parts) if hasattr(result, "_fields") else tuple(parts)
        if isinstance(result, dict):
            return {key: self.attached(value, added) for key, value in result.items()}
        values = np.asarray(result)
        last = values.shape[len(self.dims) :]
        new = {}
        if added and last[:1] == tuple(map(len, added.values())):
            new = dict(added)
            last = last[1:]
        names = _TRAILING.get(last, tuple(f"axis_{axis}" for axis in range(len(last))))
        if taken := {*new, *names} & set(self.dims):
            raise ParameterError(taken.pop(), "the result adds this dimension, which an argument has; rename it")
        new |= dict(zip(names, last, strict=True))
        whole = self.template.expand_dims(new, axis=list(range(len(self.dims), values.ndim))) if new else self.template
        return whole.copy(data=values)


def _added(owner: Any, wavelength_nm: Any) -> dict[str, Any]:
    """Return the name and the labels of the axis that a lookup adds to the directions; empty if there is none."""
    if wavelength_nm is not None:
        at = np.asarray(plain("wavelength_nm", wavelength_nm))
        name = wavelength_nm.dims[0] if is_labelled(wavelength_nm) and wavelength_nm.dims else "wavelength"
        return {name: at} if at.ndim == 1 else {}
    for attribute in ("wavelength_nm", "wavelengths_nm"):
        if getattr(owner, attribute, None) is not None:
            return {"wavelength": list(getattr(owner, attribute))}
    channels = getattr(owner, "channels", ())
    return {"channel": list(channels)} if len(channels) > 1 else {}


def _check_same_labels(name: str, value: Any, other_name: str, other: Any) -> None:
    """Raise a ParameterError if two labelled arrays share a dimension, but not its length or its coordinate."""
    for dim in set(value.dims) & set(other.dims):
        same = value.sizes[dim] == other.sizes[dim]
        if same and dim in value.coords and dim in other.coords:
            same = value.coords[dim].to_index().equals(other.coords[dim].to_index())
        if not same:
            raise ParameterError(f"{name}, {other_name}", f"their labels along {dim!r} differ; align them first")


def check_rows(columns: Mapping[str, Any]) -> None:
    """Raise a ParameterError if labelled columns that are paired row by row have different rows."""
    labelled = {name: column for name, column in columns.items() if is_labelled(column) and column.dims}
    first, *others = labelled or ("",)
    for name in others:
        if labelled[name].dims[0] != labelled[first].dims[0]:
            rows = f"{labelled[first].dims[0]!r} and {labelled[name].dims[0]!r}"
            raise ParameterError(f"{first}, {name}", f"their rows are the dimensions {rows}; give the same for both")
        _check_same_labels(first, labelled[first], name, labelled[name])
    _check_tables(columns)


def _check_tables(given: Mapping[str, Any]) -> None:
    """Raise a ParameterError if columns of tables, such as Series of pandas, have different rows."""
    columns = {name: value.index for name, value in given.items() if hasattr(value, "iloc")}
    first, *others = columns or ("",)
    for name in others:
        if not columns[name].equals(columns[first]):
            raise ParameterError(f"{first}, {name}", "their rows have different labels; align them first")


def _check_at_hand(name: str, value: Any) -> None:
    """Raise a ParameterError if the numbers of an array are not in the memory of this process, or bear a gradient."""
    graph = getattr(value, "__dask_graph__", None)
    if graph is not None and graph() is not None:
        raise ParameterError(name, "it is lazy (dask); give it computed: .compute()")
    if getattr(value, "requires_grad", False) is True:
        raise ParameterError(name, "it requires a gradient, which would be lost; give .detach()")
    device = getattr(value, "device", None)
    if device is not None and not callable(device):
        where = str(getattr(device, "type", getattr(device, "platform", device)))
        if where and "cpu" not in where.lower():
            raise ParameterError(name, f"it lies on the device {where}; copy it to the CPU first")


def _converted(name: str, value: Any) -> NDArray[Any]:
    """Return an array of another library as a NumPy array of its dtype."""
    try:
        array = np.asarray(value) if hasattr(value, "__array__") else np.from_dlpack(value)
        if array.dtype == object and hasattr(value, "iloc"):  # numbers of pandas with missing ones among them
            array = value.to_numpy(dtype=np.float64, na_value=np.nan)
    except Exception as error:  # each library has errors of its own
        first = str(error).partition("\n")[0]
        raise ParameterError(name, f"{type(value).__name__} cannot become a NumPy array: {first}") from None
    return array


def _has(value: Any, attribute: str) -> bool:
    return hasattr(value, "__array__") and hasattr(type(value), attribute)


def _listed(names: Iterable[Any]) -> str:
    return ", ".join(map(str, names)) or "none"
