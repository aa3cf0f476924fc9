"""Polarised sources: materials whose model has Mueller matrices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.materials.material import Material
from brdfdb.materials.source import Source
from brdfdb.models import MODELS
from brdfdb.parameters import Floats, Polarised


@dataclass(frozen=True)
class PolarisedSource:
    """The Mueller matrices of a material, in the convention of `brdfdb.tables.stokes`."""

    material: Material
    form: Polarised

    def mueller(self, wi: Floats, wr: Floats, wavelength_nm: NDArray[np.float64]) -> Floats:
        """Return the Mueller BRDF [1/sr] between bases of the surface, shape (N, L, 4, 4), at unit vectors (N, 3)."""
        arguments = self.material.arguments(wavelength_nm)
        return self.form.mueller(wi[:, np.newaxis], wr[:, np.newaxis], **arguments)

    def facet(self, theta_d: Floats, wavelength_nm: NDArray[np.float64]) -> Floats:
        """Return the Mueller matrix [1] of the facet over its first element, shape (N, L, 4, 4), at theta_d (N,) [rad].

        Its bases are those of the plane of light and viewer.
        """
        arguments = self.material.arguments(wavelength_nm)
        return self.form.facet(theta_d[:, np.newaxis], n=arguments["n"], k=arguments["k"])

    def depolarised(self, wavelength_nm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the depolarised part of f_r [1/sr], which is uniform: shape (1,), or (L,) if it is a spectrum."""
        uniform = self.material.uniform_at(wavelength_nm)
        return np.zeros(1) if uniform is None else uniform


def polarised_source(source: Source) -> PolarisedSource:
    """Return the Mueller matrices of a source; ParameterError if it has none."""
    if isinstance(source, Material) and source.spec.polarised is not None:
        return PolarisedSource(source, source.spec.polarised)
    known = tuple(name for name, spec in MODELS.items() if spec.polarised is not None)
    model = f"its model {source.model}" if isinstance(source, Material) else "the source"
    raise ParameterError("polarised", f"{model} has no Mueller matrices; {', '.join(known)} has", source.name, known)
