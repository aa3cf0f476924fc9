"""Parameters and specifications of models: frozen data for checks, recipes, audits, charts, HTTP and tests."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.errors import ParameterError
from brdfdb.lobes import Lobe

Floats = NDArray[np.floating[Any]]
Arguments = Mapping[str, Any]  # of a model call, directions apart; a spectral model's include wavelength_nm, n and k

FormKind = Literal["exact", "quadrature", "closed form", "approximation", "customary", "printed", "other model"]
Standing = Literal["inside", "at the edge", "outside", "unknown"]


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


def white(_: Mapping[str, Any]) -> dict[str, float]:
    """Return the parameters that make a model lossless if it absorbs by an albedo rho alone."""
    return {"rho": 1.0}


def bytes_of(arguments: Arguments) -> int:
    """Return the size [byte] of the arguments of a model call in float64."""
    return 8 * sum(int(np.size(value)) for value in arguments.values())


class ModelForm(NamedTuple):
    """One way to get f_r of a model, to be charted: the model itself, an approximation, or what a paper prints.

    Attributes
    ----------
    key : str
        Unique among those of a model: lower-case words joined by hyphens.
    title : str
        A name for people, with the equation.
    kind : str
        "exact"; "quadrature", the same by a coarser integral or sum; "closed form"; "approximation"; "customary", usual
        in programs and printed by no paper; "printed" by a paper, where this library holds another form; "other model",
        of the same parameters and meant to differ.
    python : str
        The function in Python.
    vectors : callable
        ``vectors(wi, wr, **arguments)``: f_r [1/sr], called as `ModelSpec.vectors` is.
    bytes : int
        Size of the numbers that an evaluation reads: parameters, spectra, and constants that kernels look up.
    single : bool
        Whether to chart it with float32 in and out, too.
    """

    key: str
    title: str
    kind: FormKind
    python: str
    vectors: Callable[..., Floats]
    bytes: int
    single: bool = False


class StatedLimit(NamedTuple):
    """One limit of validity that a paper states of its model, and the standing of some parameters in it.

    `quantity` is what is limited, `value` its value and `valid` its range, in words. `words` is the quotation, `where`
    its paper and section. Where a paper says "much less" and no number, a tenth is inside, and what is less, but not by
    that much, at the edge.
    """

    quantity: str
    value: str
    valid: str
    standing: Standing
    words: str
    where: str


class Diagnostic(NamedTuple):
    """A number that tells in which regime a model is: its symbol, a title, and a function of the arguments."""

    symbol: str
    title: str
    value: Callable[[Arguments], float]


@dataclass(frozen=True)
class ModelSpec:
    """A model as the rest of the library sees it: nothing outside its own modules knows a model by name.

    `version` is written into every table and is raised whenever a tabulated value moves. `evaluate` has the call
    shape ``f(theta_i, phi_i, theta_r, phi_r, *, parameters)``, `vectors`, its twin, ``f(wi, wr, *, parameters)``;
    `specular`, where there is a specular part, is ``f(theta_i, *, parameters)`` of the parameters named in
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

    For charts, `forms` gives the forms of the model at some arguments, the exact one first; None: the model itself.
    `exact_model` names another model of the registry, with its parameters, that this one approximates at some
    parameters, or None: charted tables hold that one. `diagnostic` is shown along the members of a family.
    For audits, `limits` gives the limits that a paper states, judged at some arguments. `slow` marks a model whose
    values are integrals, of about 30 us each: audits ask for fewer. `uniform_bound_cosine` marks a model whose uniform
    part is free up to what energy conservation leaves; at some arguments it gives the lowest cos theta_i [1] down to
    which the largest reflectance is searched.
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
    forms: Callable[[Arguments], Iterable[ModelForm]] | None = None
    exact_model: Callable[[Mapping[str, Any]], tuple[str, dict[str, Any]] | None] | None = None
    diagnostic: Diagnostic | None = None
    limits: Callable[[Arguments], Iterable[StatedLimit]] | None = None
    slow: bool = False
    uniform_bound_cosine: Callable[[Arguments], float] | None = None

    def parameter(self, name: str) -> Parameter:
        """Return the parameter called `name`; KeyError if the model has none."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        raise KeyError(name)


def closest(name: str, names: Iterable[str]) -> str:
    """Return the end of a message about an unknown name: up to three names that are close to it, if there are any."""
    near = difflib.get_close_matches(name, list(names), n=3, cutoff=0.4)
    return f"; closest: {', '.join(near)}" if near else ""
