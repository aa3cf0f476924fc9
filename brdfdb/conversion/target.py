"""The model that a source is converted to: which of its parameters are searched, and f_r for a set of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.fitting.variables import EDGE, NORMAL, index_of, index_variables, switches, variable
from brdfdb.integrals.pairs import Symmetry
from brdfdb.materials import Source
from brdfdb.parameters import Floats, ModelSpec, closest
from brdfdb.spectra import refractive_index

Array = NDArray[np.float64]

_LEAST_K = 1e-6  # below it, k is 0


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
        self.fixed = {**switches(spec), **_checked(spec, fixed)}
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
        self.shape = [variable(p) for p in free if not (several and p.reflectance)]
        self.colours = [variable(p) for p in free if several and p.reflectance]
        self.searched_index = spec.spectral and entry is None
        if self.searched_index:
            self.shape += index_variables()
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
            n, k = index_of(values.pop(NORMAL), values.pop(EDGE))
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
