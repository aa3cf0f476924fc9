"""What a model's parameters are: frozen data that feeds checks, recipes, the README table and the tests alike."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.errors import ParameterError

Floats = NDArray[np.floating[Any]]


@dataclass(frozen=True)
class Parameter:
    """One parameter of a model: its public name, the paper's symbol, its unit and the values it may take."""

    name: str
    symbol: str
    unit: str
    low: float
    high: float
    meaning: str
    default: float | bool | None = None

    @property
    def interval(self) -> str:
        """The allowed values as an interval with its unit, for messages and tables."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"[{self.low:g}, {self.high:g}]{unit}"

    def check(self, value: ArrayLike) -> Floats:
        """Return `value` as float64, or raise a ValueError that names the parameter, the value and the range."""
        given = np.asarray(value)
        if given.dtype.kind not in "biuf":
            raise ParameterError(
                self.name, f"{value!r} is not a number in {self.interval}", value, (self.low, self.high)
            )
        array = given.astype(np.float64)
        bad = ~((array >= self.low) & (array <= self.high))  # nan too
        if np.any(bad):
            first = array[bad].flat[0] if array.ndim else array[()]
            value, interval = f"{first:.16g}", self.interval
            if f"{first:g}" in (f"{self.low:g}", f"{self.high:g}"):  # next to an end: all digits, or they look alike
                value = repr(float(first))
                interval = interval.replace(f"{self.low:g}, {self.high:g}", f"{self.low!r}, {self.high!r}")
            raise ParameterError(self.name, f"{value} is outside {interval}", float(first), (self.low, self.high))
        return array


class Lobe(NamedTuple):
    """Where a model has its lobe: what samplers and quadratures look for, not a part of the model's value.

    `share` [1], in [0, 1], is about what part of the reflected light lies in the lobe around the mirror direction,
    whose half vectors have slopes distributed about as exp(-(s_x / alpha_x)^2 - (s_y / alpha_y)^2). The rest is looked
    for all over the hemisphere: a model with wider tails than this Gaussian leaves a tenth to that, or more.
    """

    share: Floats
    alpha_x: Floats
    alpha_y: Floats


def white(_: Mapping[str, Any]) -> dict[str, float]:
    """What makes a model lossless that absorbs by an albedo rho alone."""
    return {"rho": 1.0}


@dataclass(frozen=True)
class ModelSpec:
    """A model as the rest of the library sees it.

    `version` is written into every table and is raised whenever a tabulated value moves. `evaluate` has the call
    shape ``f(theta_i, phi_i, theta_r, phi_r, *, parameters)``, `vectors`, its twin, ``f(wi, wr, *, parameters)``;
    `specular`, where there is a Dirac part, is ``f(theta_i, *, parameters)`` of the parameters named in
    `specular_parameters`. `spectral` models take ``wavelength_nm, n, k`` beside their own parameters.
    `grazing_pole` marks a model that grows without bound as a direction reaches 90 degrees.
    `excess`, for a model whose equations as published can reflect more than they receive, says why, how much and where:
    an explanation for audits, which excuses nothing.
    `lobe_axes` names the two parameters that make the model anisotropic when they differ; `anisotropic`, of models that
    are so in another way, says of their parameters whether they make it so.
    `uniform`, if there is one, names the parameter that over pi is a part of the value, the same in all directions.
    `lobe`, of models that have one, is called as ``lobe(cos_i, **parameters)`` and says where; None: a diffuse model.
    `lossless` says which parameters to set to what so that nothing is absorbed: light that is then missing, the model
    itself loses. None where no parameters do that.
    """

    name: str
    version: int
    title: str
    equation: str
    reference: str
    parameters: tuple[Parameter, ...]
    evaluate: Callable[..., Floats]
    vectors: Callable[..., Floats]
    specular: Callable[..., Floats] | None = None
    specular_parameters: tuple[str, ...] = ()
    spectral: bool = False
    grazing_pole: bool = False
    lobe_axes: tuple[str, str] | None = None
    anisotropic: Callable[[Mapping[str, Any]], bool] | None = None
    lobe: Callable[..., Lobe] | None = None
    uniform: str | None = None
    excess: str = ""
    lossless: Callable[[Mapping[str, Any]], dict[str, float]] | None = None

    def parameter(self, name: str) -> Parameter:
        """The parameter called `name`; KeyError if the model has none."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        raise KeyError(name)


def closest(name: str, names: Iterable[str]) -> str:
    """How a message about an unknown name ends: with up to three names that are close to it, if there are any."""
    near = difflib.get_close_matches(name, list(names), n=3, cutoff=0.4)
    return f"; closest: {', '.join(near)}" if near else ""
