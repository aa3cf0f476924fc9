"""The model that a source is converted to: which of its parameters are searched, and f_r for a set of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.integrals.pairs import Symmetry
from brdfdb.materials import Source
from brdfdb.parameters import Floats, ModelSpec, Parameter, closest
from brdfdb.spectra import refractive_index

Array = NDArray[np.float64]

_DECADES = 1e3  # ratio of the ends of a range from which on a variable is searched in logarithms
_LEAST = 1e-7  # share of the upper end at which a logarithmic range begins that has 0 as its lower end
_NORMAL, _EDGE = "reflectance at normal incidence", "edge"
_LEAST_K = 1e-6  # below it, k is 0
_MOST_N = 100.0  # n that models take, and 1 / n
_REFLECTANCES = 1e-4, 0.9999  # of facets whose n and k are searched


@dataclass(frozen=True)
class Variable:
    """One number that is searched, and its range. `step` is the length of an edge of the first simplex."""

    name: str
    low: float
    high: float
    logarithmic: bool
    loose: bool = False  # other values may be as good

    def value(self, u: float) -> float:
        """Return the value at u in [0, 1]."""
        if self.logarithmic:
            return float(np.clip(self.low * (self.high / self.low) ** u, self.low, self.high))
        return self.low + (self.high - self.low) * u

    @property
    def step(self) -> float:
        """A tenth of the range, or half an octave of a logarithmic one."""
        return 0.35 / math.log(self.high / self.low) if self.logarithmic else 0.1


def _variable(parameter: Parameter) -> Variable:
    low, high = parameter.low, parameter.high
    logarithmic = high > _DECADES * low if low > 0.0 else high > 100.0
    if logarithmic and low <= 0.0:
        low = high * _LEAST
    return Variable(parameter.name, low, high, logarithmic, loose=logarithmic)


def index_of(normal: float, edge: float) -> tuple[float, float]:
    """Return n and k [1] of facets with a reflectance at normal incidence, and their place between the two ends of n.

    ln n runs evenly from -ln m at `edge` = 0 to ln m at 1, m = (1 + sqrt(R)) / (1 - sqrt(R)), where k is 0. All n and k
    with the reflectance R = ((n - 1)^2 + k^2) / ((n + 1)^2 + k^2) lie on this line, once. n stays in [0.01, 100].
    """
    root = math.sqrt(normal)
    n = min((1.0 + root) / (1.0 - root), _MOST_N) ** (2.0 * edge - 1.0)
    k2 = (normal * (n + 1.0) ** 2 - (n - 1.0) ** 2) / (1.0 - normal)
    return n, math.sqrt(max(k2, 0.0))


class Target:
    """A model whose parameters are searched, for a source at L wavelengths, or 1 without any.

    Attributes
    ----------
    spec : ModelSpec
        The model.
    shape : list of Variable
        Numbers that all wavelengths share.
    colours : list of Variable
        Reflectances with a value at each of several wavelengths; empty where there is one.
    wavelength_nm : array (L,) [nm] or None
        Wavelengths of the model, None for a grey one.
    symmetry : Symmetry
        Symmetry that source and model have in common.
    entry : str or None
        The refractive index of a spectral model; None where n and k are searched, and for other models.
    """

    def __init__(
        self,
        spec: ModelSpec,
        source: Source,
        wavelength_nm: Array | None,
        fixed: Mapping[str, float],
        entry: str | None,
    ) -> None:
        self.spec, self.wavelength_nm, self.entry = spec, wavelength_nm, entry
        self.count = 1 if wavelength_nm is None else wavelength_nm.size
        self.fixed = {**_switches(spec), **_checked(spec, fixed)}
        self.tied = None
        if spec.lobe_axes and not source.anisotropic:  # an isotropic source has an isotropic likeness
            given = [self.fixed[name] for name in spec.lobe_axes if name in self.fixed]
            if len(given) == 1:
                self.fixed |= dict.fromkeys(spec.lobe_axes, given[0])
            elif not given:
                self.tied = spec.lobe_axes
        self.symmetry = self._symmetry(source)
        free = [p for p in spec.parameters if p.name not in self.fixed and not (self.tied and p.name == self.tied[1])]
        several = self.count > 1
        self.shape = [_variable(p) for p in free if not (several and p.reflectance)]
        self.colours = [_variable(p) for p in free if several and p.reflectance]
        self.searched_index = spec.spectral and entry is None
        if self.searched_index:
            self.shape += [Variable(_NORMAL, *_REFLECTANCES, False), Variable(_EDGE, 0.0, 1.0, False, loose=True)]
        self.indices = self._indices()
        if not self.shape and not self.colours:
            raise ParameterError("fixed", f"no parameter of {spec.name} is left to search", tuple(fixed))

    def _symmetry(self, source: Source) -> Symmetry:
        """Return the symmetry that the source and every set of parameters have."""
        if self.spec.anisotropic is not None:
            return Symmetry(True, False)
        if source.anisotropic:
            return Symmetry(True, source.elliptical)
        fixed = {self.fixed.get(name) for name in self.spec.lobe_axes or ()}
        return Symmetry(len(fixed) > 1, True)

    def _indices(self) -> list[dict[str, float]]:
        if not self.spec.spectral:
            return [{}] * self.count
        assert self.wavelength_nm is not None
        at = [{"wavelength_nm": float(value)} for value in self.wavelength_nm]
        if self.entry is None:
            return at
        n, k = refractive_index(self.entry, self.wavelength_nm)
        return [one | {"n": float(n[w]), "k": float(k[w])} for w, one in enumerate(at)]

    def numbers(self, shape: Array) -> dict[str, float]:
        """Return the shared parameters at a point of the unit cube, with n and k where they are searched."""
        values = {variable.name: variable.value(u) for variable, u in zip(self.shape, shape.tolist(), strict=True)}
        if self.tied:
            values[self.tied[1]] = values[self.tied[0]]
        if self.searched_index:
            n, k = index_of(values.pop(_NORMAL), values.pop(_EDGE))
            k = k if k > _LEAST_K else 0.0
            values |= {"n": n, "k": k}
        return values

    def arguments(self, numbers: Mapping[str, float], column: int, colours: Mapping[str, float]) -> dict[str, Any]:
        """Return the arguments of the model at one wavelength."""
        return {**self.fixed, **self.indices[column], **numbers, **colours}

    def specular(self, arguments: Mapping[str, Any], theta: Array) -> Floats | None:
        """Return the reflectance (V,) of the specular part; None without one."""
        if self.spec.specular is None:
            return None
        return self.spec.specular(theta, **{name: arguments[name] for name in self.spec.specular_parameters})

    def coloured(self, numbers: Mapping[str, float], column: int, wi: Floats, wr: Floats) -> Callable[[Array], Floats]:
        """Return f_r (N,) as a function of a point of the unit cube of colours, quick where f_r is linear in them."""
        names = [variable.name for variable in self.colours]

        def called(colours: Array) -> Floats:
            values = {v.name: v.value(u) for v, u in zip(self.colours, colours.tolist(), strict=True)}
            return self.spec.vectors(wi, wr, **self.arguments(numbers, column, values))

        if self.spec.degree != 1:
            return called
        none = called(np.zeros(len(names)))
        each_one = [called(unit) - none for unit in np.eye(len(names))]

        def summed(colours: Array) -> Floats:
            values = none.copy()
            for u, values_of_one in zip(colours, each_one, strict=True):
                values += u * values_of_one
            return values

        return summed

    def lobe_alphas(self, numbers: Mapping[str, float]) -> Array:
        """Return the widths (2,) of the lobe at normal incidence, at the first wavelength; nan for a diffuse model."""
        if self.spec.lobe is None:
            return np.full(2, np.nan)
        colours = {variable.name: 0.5 for variable in self.colours}
        lobe = self.spec.lobe(np.asarray(1.0), **self.arguments(numbers, 0, colours))
        return np.array([np.min(lobe.alpha_x), np.min(lobe.alpha_y)])


def _switches(spec: ModelSpec) -> dict[str, float]:
    """Return the parameters that are true or false, at their defaults: they are not searched."""
    return {p.name: p.default for p in spec.parameters if isinstance(p.default, bool)}


def _checked(spec: ModelSpec, fixed: Mapping[str, float]) -> dict[str, float]:
    names = [parameter.name for parameter in spec.parameters]
    for name, value in fixed.items():
        if name not in names:
            raise ParameterError(
                name, f"the parameters of {spec.name} are {', '.join(names)}{closest(name, names)}", name, tuple(names)
            )
        spec.parameter(name).check(value)
        if isinstance(spec.parameter(name).default, bool) != isinstance(value, bool):
            wanted = "true or false" if isinstance(spec.parameter(name).default, bool) else "a number"
            raise ParameterError(name, f"{value!r} is not {wanted}", value)
    return dict(fixed)
