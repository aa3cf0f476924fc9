"""Parameters and specifications of models: frozen data for checks, recipes, audits, charts, HTTP and tests."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.arrays import PLAIN_TYPES, plain, unlabelled
from brdfdb.errors import ParameterError
from brdfdb.lobes import Lobe

Array = NDArray[np.float64]
Floats = NDArray[np.floating[Any]]
Arguments = Mapping[str, Any]  # of a model call, directions apart; a spectral model's include wavelength_nm, n and k

LEAST_NM = 1.0  # least wavelength: smaller numbers are micrometres, and shorter ones are no light

FormKind = Literal["exact", "quadrature", "closed form", "approximation", "customary", "printed", "other model"]
Standing = Literal["inside", "at the edge", "outside", "unknown"]
STANDINGS: tuple[Standing, ...] = ("inside", "at the edge", "outside")  # the best first
MUCH = 10.0  # ratio that counts as "much" where a paper gives no number: "much less" is a tenth
OPAQUE = 1.0 / (4.0 * math.pi)  # least k of a substance that absorbs light within a wavelength


@dataclass(frozen=True)
class Parameter:
    """One parameter of a model: its public name, the paper's symbol, its unit and the values it may take.

    `reflectance` marks an albedo or a reflectance, which a material may give as a spectrum.
    """

    name: str
    symbol: str
    unit: str
    low: float
    high: float
    meaning: str
    default: float | bool | None = None
    reflectance: bool = False

    @property
    def interval(self) -> str:
        """The allowed values as an interval with its unit, for messages and tables."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"[{self.low:g}, {self.high:g}]{unit}"

    def check(self, value: ArrayLike) -> Floats:
        """Return `value` as float64, or raise a ValueError that names the parameter, the value and the range."""
        usual = type(value) in PLAIN_TYPES
        given = np.asarray(value if usual else plain(self.name, unlabelled(self.name, value)))
        if given.dtype.kind not in "biuf":
            raise ParameterError(
                self.name, f"{value!r} is not a number in {self.interval}", value, (self.low, self.high)
            )
        array = given.astype(np.float64)
        bad = ~((array >= self.low) & (array <= self.high))  # True for nan, too
        if bad.any():
            first = array[bad].flat[0] if array.ndim else array[()]
            value, interval = f"{first:.16g}", self.interval
            if f"{first:g}" in (f"{self.low:g}", f"{self.high:g}"):  # next to an end: all digits, or they look alike
                value = repr(float(first))
                interval = interval.replace(f"{self.low:g}, {self.high:g}", f"{self.low!r}, {self.high!r}")
            if self.unit == "nm" and 0.0 < first < self.low:
                interval += "; is it in micrometres?"
            raise ParameterError(self.name, f"{value} is outside {interval}", float(first), (self.low, self.high))
        return array


@dataclass(frozen=True)
class Count(Parameter):
    """A parameter that is one whole number."""

    def check(self, value: Any) -> Floats:
        """Return `value` as float64, or raise a ParameterError if it is no whole number in the range."""
        if isinstance(value, bool) or not isinstance(value, int | np.integer) or not self.low <= value <= self.high:
            range_ = (self.low, self.high)
            raise ParameterError(self.name, f"{value!r} is not a whole number in {self.interval}", value, range_)
        return super().check(value)


# What comes with the light and with the substance, beside the parameters of a surface
WAVELENGTH_NM = Parameter("wavelength_nm", "λ", "nm", LEAST_NM, 1e7, "wavelength in vacuum")
N = Parameter("n", "n", "1", 1e-3, 100.0, "refractive index")
K = Parameter("k", "k", "1", 0.0, 1e4, "extinction coefficient")


def check_nanometres(name: str, wavelength_nm: ArrayLike) -> NDArray[np.float64]:
    """Return wavelengths [nm] as float64; ParameterError if one is not finite, or below `LEAST_NM`."""
    given = np.asarray(plain(name, wavelength_nm))
    if given.size and given.dtype.kind not in "iuf":
        raise ParameterError(name, f"{wavelength_nm!r} is not a number of nanometres", wavelength_nm)
    wanted = given.astype(np.float64)
    bad = ~((wanted >= LEAST_NM) & (wanted < np.inf))  # True for nan, too
    if bad.any():
        first = float(wanted[bad].flat[0])
        raise ParameterError(name, f"{first:g} {not_nanometres(first)}", first, (LEAST_NM, np.inf))
    return wanted


def not_nanometres(wavelength: float) -> str:
    """Return the end of a sentence on a number that is refused as a wavelength [nm]."""
    if 0.0 < wavelength < LEAST_NM:
        return f"is below {LEAST_NM:g} nm; is it in micrometres?"
    return "is not a positive number of nanometres"


def white(_: Mapping[str, Any]) -> dict[str, float]:
    """Return the parameters that make a model lossless if it absorbs by an albedo rho alone."""
    return {"rho": 1.0}


def grows_with(weight: str, power: float) -> Callable[[Arguments], float]:
    """Return a `ModelSpec.grazing_power`: a power where the parameter `weight` is above 0, else 0."""
    return lambda arguments: power if np.any(np.asarray(arguments[weight]) > 0.0) else 0.0


def bytes_of(arguments: Arguments) -> int:
    """Return the size [byte] of the arguments of a model call in float64."""
    return 8 * sum(int(np.size(value)) for value in arguments.values())


class ModelForm(NamedTuple):
    """One form of a model for charts: the model itself, an approximation, or a formula that a paper prints.

    Attributes
    ----------
    key : str
        Unique among those of a model: lower-case words joined by hyphens.
    title : str
        Title with the equation.
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
        Chart it with float32 in and out, too.
    degree : int or None
        As `ModelSpec.degree`, of this form.
    """

    key: str
    title: str
    kind: FormKind
    python: str
    vectors: Callable[..., Floats]
    bytes: int
    single: bool = False
    degree: Literal[1, 2] | None = None


class StatedLimit(NamedTuple):
    """One limit of validity that a paper states of its model, and the standing of some parameters in it.

    `quantity` is the limited quantity, `value` its value and `valid` its range, in words. `words` is the quotation,
    `where` its paper and section. If a paper says "much less" without a number, values up to a tenth are inside, and
    values between a tenth and 1 at the edge. `of_energy` marks a limit beyond which the model creates energy.
    """

    quantity: str
    value: str
    valid: str
    standing: Standing
    words: str
    where: str
    of_energy: bool = False


def standing(value: float, inside: float, edge: float) -> Standing:
    """Return the standing of a value that must be small: inside up to the first limit, at the edge below the second."""
    return "inside" if value <= inside else "at the edge" if value < edge else "outside"


class Diagnostic(NamedTuple):
    """A number that shows the regime of a model: its symbol, a title, and a function of the arguments."""

    symbol: str
    title: str
    value: Callable[[Arguments], float]


class Polarised(NamedTuple):
    """The polarised form of a model whose light was reflected once, by a facet, or is uniform and unpolarised.

    `mueller` is the Mueller BRDF [1/sr], ``mueller(wi, wr, *, parameters)`` of shape (..., 4, 4). Its first element is
    f_r. `facet` is the Mueller matrix of the facet over its first element, ``facet(theta_d, *, n, k)``, between the s
    and p of the plane of light and viewer, which are 2 theta_d apart. `brdfdb.tables.stokes` states the convention.
    """

    mueller: Callable[..., Floats]
    facet: Callable[..., Floats]


class Gradient(NamedTuple):
    """f_r [1/sr] of a model and its derivatives by parameters, by their names, in 1/sr over the unit of each."""

    f_r: Floats
    derivatives: dict[str, Floats]


class Draw(NamedTuple):
    """The usual ranges of parameters, from which training sets draw materials, and the condition that materials keep.

    A range is the name of a parameter and both ends, in the units of the model. Parameters without one have the whole
    of theirs. `allowed` returns which of many materials keep the condition, and `condition` says it in words.
    """

    ranges: tuple[tuple[str, float, float], ...] = ()
    allowed: Callable[[Arguments], NDArray[np.bool_]] | None = None
    condition: str = ""


_WHOLE_RANGES = Draw()


@dataclass(frozen=True, kw_only=True)
class SurfaceRelation:
    """The relation of a model to made surfaces: maps of its error against rays on Gaussian ones are made from it."""

    facets: Literal["diffuse", "mirror"]
    bounces: Literal["one", "two", "all"]  #: the bounces that the model states
    words: str = ""  #: how the roughness follows from the surface; empty: it is the value that suits best
    parameters: tuple[str, ...] = ()  #: parameters of the roughness, which have one value
    per_slope: float | None = None  #: their value over the slope along an axis; None: the value that suits best
    bounds: tuple[float, float] = (1e-4, 1.0)  #: range of a value that is fitted
    arguments: Arguments = field(default_factory=dict, hash=False)  #: other arguments of the model
    factor: bool = False  #: True if a factor in front of f_r is fitted, too: the lobe is not normalised
    by_rho: bool = False  #: True if the errors depend on the albedo
    only_fit: bool = False  #: True if slopes of the model have no variance, so that no Gaussian surface is its own
    grooves: bool = False  #: True if the surface is V-grooves along y, and the parameter the angle of their walls


SurfaceProperty = Literal[
    "Gaussian heights",
    "Gaussian correlation",
    "Gaussian slopes",
    "long-tailed slopes",
    "large facets",
    "no specular part",
    "diffuse facets",
    "mirror-like facets",
]


class SurfaceAssumption(NamedTuple):
    """One property that a model assumes of its surface, which statistics of a height map and n + ik judge.

    `words` is the assumption as the paper states it, `where` the paper and section.
    """

    property: SurfaceProperty
    words: str
    where: str


class SurfaceNumbers(NamedTuple):
    """The statistics of a measured surface that parameters of models follow from.

    rms height [um], length where the correlation is 1 / e [um], rms slope along an axis in the mean of both [1], and
    those along x and y, which are equal if the surface is isotropic [1].
    """

    sigma_0_um: float
    tau_um: float
    slope: float
    slope_x: float
    slope_y: float


class HeightRelation(NamedTuple):
    """The relation of a model to a surface whose heights were measured.

    `parameters` returns the parameters that follow from the statistics, in the units of the model, and `words` says how
    they do. `assumptions` are those on the surface, beside the limits of the parameters. A model whose parameters do
    not follow from heights has `left_out`, the reason, instead.
    """

    parameters: Callable[[SurfaceNumbers], dict[str, float]] | None = None
    words: str = ""
    assumptions: tuple[SurfaceAssumption, ...] = ()
    left_out: str = ""


@dataclass(frozen=True)
class ModelSpec:
    """The specification of a model. No code outside the model's own modules knows a model by name.

    `version` is written into every table and is raised whenever a tabulated value changes. `evaluate` has the call
    shape ``f(theta_i, phi_i, theta_r, phi_r, *, parameters)``, `vectors`, its twin, ``f(wi, wr, *, parameters)``;
    `specular`, where there is a specular part, is ``f(theta_i, *, parameters)`` of the parameters named in
    `specular_parameters`. `spectral` models take ``wavelength_nm, n, k`` beside their own parameters.
    `grazing_pole` marks a model that grows without bound as a direction reaches 90 degrees. `grazing_power` declares
    how its directional albedo grows there: as cos theta_i to the power -p, where p is 0 if it is bounded. It is p, or a
    function of the parameters that returns p. None: not declared, so that audits measure it.
    `excess` explains, for a model whose published equations can reflect more than they receive, the reason, the amount
    and the directions. Audits quote it, and it excuses nothing.
    `lobe_axes` names the two parameters that make the model anisotropic if they differ. Models that are anisotropic in
    another way have `anisotropic`, a function of the parameters that returns True if they make the model so.
    `degree` is the degree of f_r as a polynomial in its reflectances, 1 or 2, if it is one: spectra of them then take
    a few evaluations, not one for each wavelength. None: it is no such polynomial.
    `uniform` names the parameter that, divided by pi, is the uniform part of f_r; None: there is none.
    `lobe` returns the lobe of the model as ``lobe(cos_i, **parameters)``; None: a diffuse model.
    `lossless` returns the parameters to change, with their values, so that nothing is absorbed; reflectances may be
    arrays over the wavelength. Light that is still
    missing is lost by the model itself. None: no parameters do that.

    For charts, `forms` gives the forms of the model at some arguments, the exact one first; None: the model itself.
    `highest_rung` names the formula of the model if no form of its surface is more exact, such as the whole sum of a
    series. Empty: `forms` begin with a more exact one, or none is known, because the model is a fit itself.
    `exact_model` names another model of the registry, with its parameters, that this one approximates at some
    parameters, or None: charted tables hold that one. `diagnostic` is shown along the members of a family.
    For audits, `limits` gives the limits that a paper states, judged at some arguments. `slow` marks a model whose
    values are integrals, of about 30 us each: audits compute fewer of them. `uniform_bound_cosine` marks a model whose
    uniform part is limited by energy conservation only. It returns the lowest cos theta_i [1] at which the largest
    reflectance is searched. `polarised` is the polarised form of the model; None: it is of unpolarised light.
    `gradient` is called as `vectors` is, and returns the `Gradient`; None: nobody has derived it.
    `draw` says which materials training sets draw. `surfaces` relates the model to Gaussian surfaces, with the default
    arguments first; empty: it is compared with none. `heights` relates it to measured surfaces; None: another form of
    the model does.
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
    grazing_power: float | Callable[[Arguments], float] | None = None
    lobe_axes: tuple[str, str] | None = None
    anisotropic: Callable[[Mapping[str, Any]], bool] | None = None
    lobe: Callable[..., Lobe] | None = None
    degree: Literal[1, 2] | None = None
    uniform: str | None = None
    excess: str = ""
    lossless: Callable[[Mapping[str, Any]], dict[str, Any]] | None = None
    forms: Callable[[Arguments], Iterable[ModelForm]] | None = None
    exact_model: Callable[[Mapping[str, Any]], tuple[str, dict[str, Any]] | None] | None = None
    highest_rung: str = ""
    diagnostic: Diagnostic | None = None
    limits: Callable[[Arguments], Iterable[StatedLimit]] | None = None
    slow: bool = False
    uniform_bound_cosine: Callable[[Arguments], float] | None = None
    polarised: Polarised | None = None
    gradient: Callable[..., Gradient] | None = None
    draw: Draw = _WHOLE_RANGES
    surfaces: tuple[SurfaceRelation, ...] = ()
    heights: HeightRelation | None = None

    @property
    def short_title(self) -> str:
        """The title up to the first comma, for lists of models that differ in more than their form."""
        return self.title.partition(",")[0]

    def parameter(self, name: str) -> Parameter:
        """Return the parameter called `name`; KeyError if the model has none."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        raise KeyError(name)


def closest(name: str, names: Iterable[str]) -> str:
    """Return the end of a message about an unknown name: up to three names that are close to it, if there are any."""
    near = difflib.get_close_matches(name, list(dict.fromkeys(names)), n=3, cutoff=0.4)
    return f"; closest: {', '.join(near)}" if near else ""
