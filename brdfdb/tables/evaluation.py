"""Values of a table, of its model or of a family at many points: spectra or colours, errors, the specular part."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.materials import Material
from brdfdb.spectra import ILLUMINANT, colour_weights
from brdfdb.tables.points import Angles, Points
from brdfdb.tables.stokes_document import stokes_document

if TYPE_CHECKING:
    from brdfdb.tables.table import Table

Output = Literal["spectrum", "xyz", "linear-srgb"]

_AT_ONCE = 25_000  # points whose spectra are in memory at once while colours are computed


class Values(NamedTuple):
    """Values at points: f_r [1/sr], its error or None, the specular part or None; colours on the last axis.

    `stokes` has the fields of `StokesDocument`, or is None where no incident Stokes vector was given.
    """

    surface: Surface
    points: Points
    output: Output
    illuminant: str | None  # None of spectra
    brdf: Any
    error: Any
    specular_reflectance: Any
    stokes: dict[str, Any] | None = None

    @property
    def array(self) -> NDArray[np.float64]:
        """One array: the reflected Stokes vectors where there are some; else f_r, or f_r and error on a first axis."""
        if self.stokes is not None:
            return np.asarray(self.stokes["reflected"])
        return np.asarray(self.brdf if self.error is None else np.stack([self.brdf, self.error]))


class Surface(NamedTuple):
    """Subject of a lookup.

    Attributes
    ----------
    source : Table, Material or other object
        It has `lookup` and `specular_reflectance`; a table has `lookup_with_error` and `extrapolated`, too.
    kind : str
        "table", "model" or "family".
    wavelength_nm : array (L,) [nm] or None
        Wavelengths that are meant where a request names none; None: grey.
    """

    source: Any
    kind: Literal["table", "model", "family"]
    wavelength_nm: NDArray[np.float64] | None

    def wavelengths(self, points: Points) -> Any:
        """Return the wavelengths [nm] of the values at some points; None if they are grey."""
        return self.wavelength_nm if points.wavelength_nm is None else points.wavelength_nm

    def values(
        self,
        points: Points,
        output: Output = "spectrum",
        illuminant: str | None = None,
        *,
        error: bool = False,
        specular: bool = True,
        incident: Sequence[float] | None = None,
    ) -> Values:
        """Return the values at points, with the stated `error`, and with the `specular` part at their theta_i.

        With an `incident` Stokes vector (I, Q, U, V) the light that a polarised table reflects is beside its spectra.

        Raises
        ------
        ParameterError
            Outside the range of the surface, where it makes no colour, or where it is not polarised.
        """
        if incident is not None and getattr(self.source, "facets", None) is None:
            raise ParameterError("stokes", f"the table of {self.source.name} is unpolarised", incident)
        # A table takes None as all of its wavelengths, which is faster than naming them
        at = points.wavelength_nm if self.kind == "table" else self.wavelengths(points)

        def spectra(angles: Angles) -> tuple[Any, Any]:
            source = self.source
            return source.lookup_with_error(*angles, at) if error else (source.lookup(*angles, at), None)

        def dirac() -> Any:
            return self.source.specular_reflectance(points.angles[0], at) if specular else None

        if output == "spectrum":
            stokes = None if incident is None else stokes_document(self.source, points, incident)
            return Values(self, points, output, None, *spectra(points.angles), dirac(), stokes)
        grey = self.wavelength_nm is None
        if grey and points.wavelength_nm is not None:
            raise ParameterError("wavelength_nm", "a colour of a grey material has no wavelengths")
        wavelengths = None if grey else np.atleast_1d(self.wavelengths(points))
        light = illuminant or ILLUMINANT
        weights = colour_weights(output, wavelengths, light)
        brdf, stated = _coloured(points, spectra, weights, grey, error=error)
        mirrored = _mixed(dirac(), weights, grey) if specular else None
        return Values(self, points, output, light, brdf, stated, mirrored)


def surface_of(table: Table, kind: str = "table") -> Surface:
    """Return a table, or the "model" that it was made of; ParameterError if it keeps none."""
    if kind == "table":
        return Surface(table, "table", table.wavelength_nm)
    if not isinstance(table.source, Material):
        raise ParameterError("from", f"the table of {table.name} keeps no model; ask for from=table", kind)
    return Surface(_InRange(table.source, table), "model", table.wavelength_nm)


class _InRange(NamedTuple):
    """A material at the wavelengths that a table covers."""

    material: Material
    table: Table

    def lookup(self, *given: Any) -> Any:
        self.table.specular_reflectance(0.0, given[-1])  # refuses wavelengths outside the table
        return self.material.lookup(*given)

    def specular_reflectance(self, theta_i: Any, wavelength_nm: Any) -> Any:
        return self.material.specular_reflectance(theta_i, wavelength_nm)


def _coloured(
    points: Points,
    spectra: Callable[[Angles], tuple[Any, Any]],
    weights: NDArray[np.float64],
    grey: bool,
    *,
    error: bool,
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    """Return colours of spectra, in batches of points: 41 values of each of a million points would be 300 MB."""
    flat = [np.broadcast_to(angle, points.shape).reshape(-1) for angle in points.angles]
    brdf, stated = np.empty((points.count, 3)), np.empty((points.count, 3)) if error else None
    for start in range(0, points.count, _AT_ONCE):
        rows = slice(start, start + _AT_ONCE)
        t_i, p_i, t_r, p_r = (angle[rows] for angle in flat)
        spectrum, errors = spectra((t_i, p_i, t_r, p_r))
        brdf[rows] = _mixed(spectrum, weights, grey)
        if stated is not None:
            stated[rows] = _mixed(errors, np.abs(weights), grey)
    shape = (*points.shape, 3)
    return brdf.reshape(shape), None if stated is None else stated.reshape(shape)


def _mixed(values: Any, weights: NDArray[np.float64], grey: bool) -> Any:
    """Return colours (..., 3) of spectra (..., L), or of grey values (...)."""
    whole = np.asarray(values)
    return np.asarray((whole[..., np.newaxis] if grey else whole) @ weights)
