"""Spectra: a reflectance of a surface at wavelengths, with its origin."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from brdfdb.errors import ParameterError
from brdfdb.materials.provenance import Text
from brdfdb.parameters import check_nanometres

MOST_VALUES = 10_000  # of a spectrum
_LEAST_NM = 20.0  # below it, the wavelengths of a spectrum are likely to be micrometres
UPSAMPLED = "assumed: the smooth spectrum of Jakob and Hanika 2019 with this colour under D65"

Values = Annotated[tuple[float, ...], Field(min_length=1, max_length=MOST_VALUES, fail_fast=True)]


class Spectrum(BaseModel):
    """A reflectance over the wavelength, as the value of a parameter that is a reflectance or an albedo.

    Attributes
    ----------
    wavelengths_nm : tuple of float
        Wavelengths [nm], strictly increasing.
    values : tuple of float
        Reflectance [1] at each of them, one or more. Between two of them it is a straight line; outside there is no
        value.
    origin : str
        The source of the values in words.

    Raises
    ------
    ParameterError
        If the wavelengths do not increase, or there is not one value for each.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    wavelengths_nm: Values
    values: Values
    origin: Text

    def record(self) -> dict[str, Any]:
        """Return the spectrum for JSON. Whole wavelengths have no fraction: spectra fill half of a small table."""
        whole = [int(wavelength) if wavelength.is_integer() else wavelength for wavelength in self.wavelengths_nm]
        return {**self.model_dump(mode="json"), "wavelengths_nm": whole}

    @model_validator(mode="after")
    def _check_lengths(self) -> Spectrum:
        if np.any(np.diff(check_nanometres("wavelengths_nm", self.wavelengths_nm)) <= 0.0):
            raise ParameterError("wavelengths_nm", "those of a spectrum must be positive and increase strictly")
        if len(self.values) != len(self.wavelengths_nm):
            raise ParameterError(
                "values", f"{len(self.values)} are given for {len(self.wavelengths_nm)} wavelengths of a spectrum"
            )
        return self

    def at(self, name: str, wavelength_nm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the reflectance [1] at wavelengths [nm], in their shape.

        Raises
        ------
        ParameterError
            If a wavelength is outside the range of the spectrum; `name` is the parameter, for the sentence.
        """
        low, high = self.wavelengths_nm[0], self.wavelengths_nm[-1]
        outside = ~((wavelength_nm >= low) & (wavelength_nm <= high))
        if np.any(outside):
            wrong = float(np.atleast_1d(wavelength_nm)[np.atleast_1d(outside)][0])
            raise ParameterError(
                "wavelength_nm",
                f"{wrong:g} has no {name}, whose spectrum covers [{low:g}, {high:g}] nm{_hint(high)}",
                wrong,
                (low, high),
            )
        return np.asarray(np.interp(wavelength_nm, self.wavelengths_nm, self.values))

    def __str__(self) -> str:
        if len(self.values) == 1:
            return f"{self.values[0]:.6g} at {self.wavelengths_nm[0]:g} nm"
        low, high = min(self.values), max(self.values)
        return f"{low:.3g} to {high:.3g} over {self.wavelengths_nm[0]:g} to {self.wavelengths_nm[-1]:g} nm"

    def __format__(self, _: str) -> str:
        return str(self)


def _hint(high: float) -> str:
    return "; are they micrometres? A spectrum is in nm" if high < _LEAST_NM else ""


def made_lossless(
    lossless: Callable[[Mapping[str, Any]], dict[str, Any]], parameters: Mapping[str, Any]
) -> dict[str, float | Spectrum]:
    """Return the changes that a model's `lossless` makes to parameters, some of which may be spectra.

    Spectra are joined: they get the wavelengths of all of them that lie in the range of each.
    """
    spectra = {name: value for name, value in parameters.items() if isinstance(value, Spectrum)}
    if not spectra:
        return lossless(parameters)
    every = np.unique(np.concatenate([value.wavelengths_nm for value in spectra.values()]))
    low = max(value.wavelengths_nm[0] for value in spectra.values())
    high = min(value.wavelengths_nm[-1] for value in spectra.values())
    nodes = every[(every >= low) & (every <= high)]
    given = {**parameters, **{name: value.at(name, nodes) for name, value in spectra.items()}}
    return {
        name: Spectrum(wavelengths_nm=tuple(nodes.tolist()), values=tuple(value.tolist()), origin="made lossless")
        if np.ndim(value)
        else float(value)
        for name, value in lossless(given).items()
    }


def assumptions(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return an assumption for each spectrum whose origin says that it is assumed."""
    return {
        name: {"why": value.origin}
        for name, value in parameters.items()
        if isinstance(value, Spectrum) and UPSAMPLED in value.origin
    }
