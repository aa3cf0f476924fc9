"""Tables as sources: f_r of a stored table where the function that it was tabulated from is not known."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import PrivateAttr

from brdfdb.geometry import radians, unit_vector
from brdfdb.materials import FunctionRecord, FunctionSource, Material, Source
from brdfdb.materials.function_source import Function
from brdfdb.measurements.record import Measured
from brdfdb.parameters import Floats
from brdfdb.tables.sampler import Sampler
from brdfdb.tables.table import Table

# Variance of f_r over its mean square, for directions that follow the cosine. Up to it, the cosine has less noise than
# cells of a table: see docs/results/environments.json
_EVEN = 0.1
_LIGHTS_DEG, _DRAWN = (0.0, 25.0, 50.0, 70.0), 1024  # lights, and directions of each, that this variance is taken from
_TURN = (np.sqrt(5.0) - 1.0) / 2.0  # the golden section
_BLACK = 1e-100  # least albedo


class TableSource(FunctionSource):
    """A table as a source: the values of its lookups are its f_r.

    Parameters
    ----------
    table : Table
        The table.
    held_to : array (L,) [nm], optional
        Wavelengths, increasing, at which the source is known. Beyond the range of a table of two or more wavelengths
        f_r is that of its first or last one. By default the source has the range of the table.
    """

    _table: Table = PrivateAttr()

    def __init__(self, table: Table, held_to: NDArray[np.float64] | None = None) -> None:
        recorded = table.source
        wavelength_nm, metadata = table.wavelength_nm, table.metadata
        if held_to is not None and wavelength_nm is not None and wavelength_nm.size > 1:
            wavelength_nm = np.union1d(wavelength_nm, held_to)
        stated = metadata.source or "source not stated"
        record: dict[str, Any] = {
            "name": table.name,
            "title": metadata.title or table.name,
            "provenance": f"{stated}; by way of the table {table.name} {table.revision}",
            "wavelengths_nm": None if wavelength_nm is None else tuple(wavelength_nm.tolist()),
            "anisotropic": table.anisotropic,
            "elliptical": table.anisotropic and table.grid.copies == 4,
        }
        if isinstance(recorded, FunctionRecord):
            record |= {name: getattr(recorded, name) for name in ("reciprocal", "grazing_pole", "alpha")}
        super().__init__(brdf=_brdf_of(table), **record)
        self._table = table

    @property
    def measured(self) -> Measured | None:
        """Return the record of the data if the table is measured, or None."""
        return self._table.metadata.measured

    @functools.cached_property
    def sampler(self) -> Sampler | None:
        """The sampler of the table; None if f_r hardly varies, where the cosine draws directions with less noise."""
        number, wi = np.arange(_DRAWN), unit_vector(radians(_LIGHTS_DEG)[:, np.newaxis], 0.0)
        drawn = self._table.sample((number + 0.5) / _DRAWN, number * _TURN % 1.0, wi)
        weight, pdf = (np.reshape(values, (*drawn.wr.shape[:2], -1)) for values in (drawn.weight, drawn.pdf))
        mean, density, cosine = weight.mean(axis=-1), pdf[..., 0], np.maximum(drawn.wr[..., 2], 0.0)
        square = np.divide(np.pi * mean**2 * density, cosine, out=np.zeros(cosine.shape), where=cosine > 0.0)
        albedo = np.maximum(mean.mean(axis=1), _BLACK)
        varies = np.mean(square.mean(axis=1) / albedo**2 - 1.0) > _EVEN
        return self._table.sampler if varies else None

    @property
    def has_specular(self) -> bool:
        """Return True if the table holds the reflectance of a specular part."""
        return self._table.specular is not None

    def evaluated_at(self, wavelength_nm: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return the same wavelengths [nm], or the only one of the table; None if grey."""
        stored = self._table.wavelength_nm
        return wavelength_nm if stored is not None and stored.size > 1 else stored

    def specular_reflectance(self, theta_i: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats:
        """Return the reflectance [1] of the specular part at theta_i [rad], 0 without one; shaped as by `lookup`."""
        return self._table.specular_reflectance(theta_i, _held(self._table, wavelength_nm))

    def _check_function(self) -> None:
        """Take the table as it is: between its nodes the two halves of a symmetry differ by its error."""


def _brdf_of(table: Table) -> Function:
    def brdf(wi: Floats, wr: Floats, wavelength_nm: NDArray[np.float64] | None) -> Floats:
        return table.lookup_vectors(wi, wr, _held(table, wavelength_nm))

    return brdf


def _held(table: Table, wavelength_nm: ArrayLike | None) -> ArrayLike | None:
    """Return wavelengths [nm], or the end of the range of a table where they are beyond it."""
    stored = table.wavelength_nm
    return wavelength_nm if wavelength_nm is None or stored is None else np.clip(wavelength_nm, stored[0], stored[-1])


def source_of_table(table: Table, held_to: NDArray[np.float64] | None = None) -> Source:
    """Return the material that a table was tabulated from, or else the table as a source, as of `TableSource`.

    Raises
    ------
    ParameterError
        If the table holds what no f_r can be, or its name is not that of a material.
    """
    return table.source if isinstance(table.source, Material) else TableSource(table, held_to)
