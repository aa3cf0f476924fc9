"""The error of a model against rays on the surface that suits a material, read from maps that are shipped as data.

Lists of materials read this module, so that it loads neither NumPy nor pydantic.

The file model_errors.json has the key ``models``: a name, and an entry with

* ``model``: name of the model, by default the name of the entry;
* ``arguments``: other parameters of the model, such as ``{"offset": 0.33}``. The entry is only about materials with
  these values, so that all parameters of the model but the albedo ``rho`` stand here or in the rows;
* ``bounces``: "one", "two" or "all", the bounces of the rays;
* ``only_fit``: true of models whose slopes have no variance, which can only be fitted to a Gaussian surface;
* ``words``: how the parameters that suit a surface were found;
* ``rows``: a row for each slope and albedo, with

  * ``slope`` [1], the standard deviation along each axis, and ``rho`` [1], null if errors do not depend on it;
  * ``parameters`` that suit the surface, in the units of the model; they increase with the slope, and all albedos have
    the same;
  * for each light of ``lights_deg`` the statistics over viewers ``median``, ``p95``, ``worst``, ``towards_light``,
    ``forward`` and ``noise``; a row of slope 0, whose errors are 0, extends the map of a diffuse model to 0.
"""

from __future__ import annotations

import functools
import itertools
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from brdfdb.errors import ParameterError
from brdfdb.notebook import error_in_words

if TYPE_CHECKING:
    from brdfdb.materials import Material

NO_MAP = "not compared with rays"  # of a model without a map
_STATISTICS = ("median", "p95", "worst", "towards_light", "forward", "noise")
_STEEP_DEG = 75  # light [degree] whose error is stated by itself
_ROUNDING = 1e-9  # relative distance at which a parameter is at the end of a map: files have twelve digits of angles
_NOTABLE = 0.02  # smallest mean error [1] of a side that the sentence mentions
_Row = Mapping[str, Any]
_BOUNCES = {"one": " of one bounce", "two": " of up to two bounces", "all": ""}


@dataclass(frozen=True)
class SurfaceError:
    """The error of a model against rays on the surface that suits a material: relative errors [1], model over rays - 1.

    All numbers but `inside` are None where the parameters lie outside of the map.
    """

    # JSON schemas describe the fields by the docstrings below
    __pydantic_config__: ClassVar[dict[str, Any]] = {"use_attribute_docstrings": True, "extra": "forbid"}

    sentence: str
    """the error in words, the same in all documents"""
    inside: bool
    """false: the parameters lie outside of the map, and no error is stated"""
    slope: float | None = None
    """standard deviation of the slopes of the surface along each axis [1]"""
    median: float | None = None
    """median over viewers of the absolute error, and of this the median over lights"""
    p95: float | None = None
    """95th percentile over viewers, at the light where it is largest"""
    worst: float | None = None
    """largest error of all lights and viewers"""
    at_75: float | None = None
    """median over viewers for light from 75 degrees"""
    towards_light: float | None = None
    """mean error, with its sign, of viewers near the light's half plane with theta_r of at least 30 degrees"""
    forward: float | None = None
    """mean error, with its sign, of such viewers near the mirror half plane"""
    noise: float | None = None
    """standard error of the rays, the median over viewers and lights"""

    @property
    def in_lists(self) -> str:
        """The median error as the cell of a list; below the noise of the rays, that it is smaller than the noise."""
        if self.median is None or self.noise is None:
            return "outside of map"
        if self.slope == 0.0:
            return "0"
        words = error_in_words(max(self.median, self.noise))
        return words if self.median > self.noise or words.startswith("<") else f"< {words}"


class _Number(NamedTuple):
    """A median error, and the standard error of the rays that it is measured with."""

    error: float
    noise: float

    @property
    def hidden(self) -> bool:
        """True if the noise hides the error."""
        return self.error <= self.noise

    @property
    def in_words(self) -> str:
        """The error in percent, or the noise that hides it."""
        return f"within the noise ({error_in_words(self.noise)})" if self.hidden else error_in_words(self.error)


class _Errors(NamedTuple):
    """The slope of a surface, and the statistics of a row for each light; None for a side without viewers."""

    slope: float
    by_light: dict[str, list[float | None]]

    def of(self, statistic: str) -> list[float]:
        """Return a statistic for the lights that have it."""
        return [value for value in self.by_light[statistic] if value is not None]

    def mean(self, side: str) -> float | None:
        """Return the mean error of a side over the lights that are not along the normal, where azimuths say nothing."""
        pairs = zip(_document()["lights_deg"], self.by_light[side], strict=True)
        values = [value for light, value in pairs if light > 0 and value is not None]
        return sum(values) / len(values) if values else None


def surface_error(material: Material) -> SurfaceError | None:
    """Return the error of the model of a material against rays on the surface that suits its parameters.

    The result is None if there is no map for the model, or none for other parameters such as `interreflection`.
    """
    return surface_error_of(material.model, material.file_parameters())


def has_map(model: str | None) -> bool:
    """Return True if there is a map of the errors of a model, for some of its parameters at least."""
    return any(entry.get("model", name) == model for name, entry in _document()["models"].items())


def surface_error_of(model: str | None, parameters: Mapping[str, Any]) -> SurfaceError | None:
    """Return `surface_error` from the name of a model and its parameters as files write them.

    Angles are in degrees, under names in ``_deg``, and a spectrum is a mapping or an object with ``values``. Between
    the slopes and albedos of the map, errors are interpolated linearly. An albedo outside of the map is replaced by the
    nearest one, which the sentence says. Of two axes, and of the least and largest albedo of a spectrum, the worse one
    is stated. ParameterError if a parameter is no finite number, or an albedo is missing or not in [0, 1].
    """
    entry = _entry(model, parameters)
    if entry is None:
        return None
    first = entry["rows"][0]["parameters"]
    axes = [axis for axis in first if axis in parameters or f"{axis}_deg" in parameters]
    if not axes:
        return None  # the model has no roughness
    values = {axis: _number(parameters, axis) for axis in axes}
    albedos: list[float | None] = [None]
    if entry["rows"][0]["rho"] is not None:
        albedos = [*dict.fromkeys(_ends(parameters.get("rho")))]
    candidates = []
    for (axis, value), rho in itertools.product(values.items(), albedos):
        weighted = _weighted(entry["rows"], axis, value, rho)
        if not weighted:
            unit = "" if axis in parameters else " degrees"
            return SurfaceError(_outside(entry["rows"], axis, value, unit), inside=False)
        candidates.append(_mixed(weighted))
    worst = max(candidates, key=lambda errors: _middle(errors.of("median")))
    return _stated(entry, worst, _remarks(entry["rows"], values, albedos))


def suited_parameters(model: str, slope: float) -> dict[str, float] | None:
    """Return the parameters of a model that suit a Gaussian surface with a slope [1]; None outside of the map."""
    entry = _entry(model, {})
    suited = {row["slope"]: row["parameters"] for row in entry["rows"]} if entry else {}
    if not suited or not min(suited) <= slope <= max(suited):
        return None
    weights = _weights(sorted(suited), slope)
    return {name: sum(weight * suited[node][name] for node, weight in weights.items()) for name in suited[max(suited)]}


def _entry(model: str | None, parameters: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the map of a model for arguments among parameters; None if there is none."""
    return next(
        (
            entry
            for name, entry in _document()["models"].items()
            if entry.get("model", name) == model and _same(entry.get("arguments", {}), parameters)
        ),
        None,
    )


@functools.cache
def _document() -> dict[str, Any]:
    """Return the content of the file of the maps."""
    document: dict[str, Any] = json.loads(Path(__file__).with_name("model_errors.json").read_bytes())
    return document


def _same(arguments: Mapping[str, Any], parameters: Mapping[str, Any]) -> bool:
    """Return True if parameters have the values of arguments; n and k, which are no parameters, do not count."""
    return all(parameters[name] == value for name, value in arguments.items() if name in parameters)


def _number(parameters: Mapping[str, Any], name: str) -> float:
    """Return a parameter in the unit of the model; ParameterError if it is no finite number."""
    key = name if name in parameters else f"{name}_deg"
    value = parameters[key]
    if not isinstance(value, int | float) or not math.isfinite(value):
        raise ParameterError(key, f"{value!r} is not a finite number", value, "a finite number")
    return float(value) if key == name else math.radians(value)


def _ends(value: Any) -> tuple[float, float]:
    """Return the least and the largest albedo of a number or of a spectrum; ParameterError if there is none."""
    values = value.get("values") if isinstance(value, Mapping) else getattr(value, "values", value)
    albedos = values if isinstance(values, list | tuple) else [values]
    if not albedos or not all(isinstance(rho, int | float) and 0.0 <= rho <= 1.0 for rho in albedos):
        raise ParameterError("rho", f"{value!r} is no albedo; allowed are numbers from 0 to 1", value, (0.0, 1.0))
    return float(min(albedos)), float(max(albedos))


def _weighted(rows: Sequence[_Row], parameter: str, value: float, rho: float | None) -> list[tuple[float, _Row]]:
    """Return the rows around a value of a parameter and an albedo, with their weights; none outside of the map."""
    values = sorted({row["parameters"][parameter] for row in rows})
    if not math.isclose(min(max(value, values[0]), values[-1]), value, rel_tol=_ROUNDING):
        return []
    by_value = _weights(values, value)
    by_rho = {None: 1.0} if rho is None else _weights(sorted({row["rho"] for row in rows}), rho)
    return [
        (by_value[row["parameters"][parameter]] * by_rho[row["rho"]], row)
        for row in rows
        if row["parameters"][parameter] in by_value and row["rho"] in by_rho
    ]


def _mixed(weighted: Sequence[tuple[float, _Row]]) -> _Errors:
    """Return the weighted mean of rows."""

    def mean(values: Sequence[float | None]) -> float | None:
        products = [weight * value for (weight, _), value in zip(weighted, values, strict=True) if value is not None]
        return sum(products) if len(products) == len(values) else None

    lights = range(len(_document()["lights_deg"]))
    by_light = {name: [mean([row[name][light] for _, row in weighted]) for light in lights] for name in _STATISTICS}
    return _Errors(sum(weight * row["slope"] for weight, row in weighted), by_light)


def _weights(nodes: Sequence[float], value: float) -> dict[Any, float]:
    """Return the nodes around a value with their weights in linear interpolation; beyond an end, the node there."""
    inside = min(max(value, nodes[0]), nodes[-1])
    if inside in nodes:
        return {inside: 1.0}
    low = max(node for node in nodes if node < inside)
    high = min(node for node in nodes if node > inside)
    share = (inside - low) / (high - low)
    return {low: 1.0 - share, high: share}


def _middle(values: Sequence[float]) -> float:
    """Return the median of numbers; the module of Python that has it takes 5 ms to import."""
    ordered = sorted(values)
    return 0.5 * (ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2])


def _stated(entry: Mapping[str, Any], errors: _Errors, remarks: str) -> SurfaceError:
    """Return errors by light as the statement of a material."""
    towards_light, forward = errors.mean("towards_light"), errors.mean("forward")
    steep = _document()["lights_deg"].index(_STEEP_DEG)
    overall, at_75 = (
        _Number(middle(errors.of("median")), middle(errors.of("noise"))) for middle in (_middle, lambda of: of[steep])
    )
    rays = f"rays{_BOUNCES[entry.get('bounces', 'all')]}"
    against = f"Against {rays} on Gaussian surfaces of these slopes"
    if entry.get("only_fit", False):
        against = f"Against {rays} on the Gaussian surface that the model fits best"
    if errors.slope == 0.0:
        numbers = "0, since the surface is flat"
    elif overall.hidden and at_75.hidden:
        numbers = f"within the noise of the rays, {error_in_words(max(overall.noise, at_75.noise))}"
    else:
        numbers = f"{overall.in_words} in the median ({at_75.in_words} for light at {_STEEP_DEG} degrees)"
        numbers += f", at most {error_in_words(max(errors.of('p95')))} for 95 % of the viewers"
    sides = _sides({"towards the light": towards_light, "forward": forward}, overall.noise)
    return SurfaceError(
        sentence=f"{', '.join([f'{against}: {numbers}', *sides])}.{remarks}",
        inside=True,
        slope=errors.slope,
        median=overall.error,
        p95=max(errors.of("p95")),
        worst=max(errors.of("worst")),
        at_75=at_75.error,
        towards_light=towards_light,
        forward=forward,
        noise=overall.noise,
    )


def _sides(sides: Mapping[str, float | None], noise: float) -> Iterator[str]:
    """Yield where a model is too dark or too bright, by the mean errors of two sides."""
    for sign, which in ((-1.0, "too dark"), (1.0, "too bright")):
        where = [side for side, mean in sides.items() if mean is not None and sign * mean > max(noise, _NOTABLE)]
        if where:
            yield f"{which} {' and '.join(where)}"


def _remarks(rows: Sequence[_Row], values: Mapping[str, float], albedos: Sequence[float | None]) -> str:
    """Return sentences on what a statement leaves out: the second axis, and albedos outside of the map."""
    remarks = ""
    if len(set(values.values())) > 1:
        remarks += " The surfaces are isotropic, with the slopes of one axis or the other, and the worse is stated."
    known = [row["rho"] for row in rows]
    for rho in albedos:
        if rho is not None and not min(known) <= rho <= max(known):
            nearest = min(max(rho, min(known)), max(known))
            remarks += f" The map has no albedo of {rho:.3g}; the nearest is {nearest:g}."
    return remarks


def _outside(rows: Sequence[_Row], parameter: str, value: float, unit: str) -> str:
    """Return the sentence on a parameter outside of the map."""
    values = [row["parameters"][parameter] for row in rows]
    numbers = (value, min(values), max(values))
    given, least, most = (f"{math.degrees(number) if unit else number:.3g}" for number in numbers)
    where = f"{parameter} = {given}{unit} is outside of the map, {least} to {most}{unit}"
    return f"Against rays on Gaussian surfaces: {where}."
