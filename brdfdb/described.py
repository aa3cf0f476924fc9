"""What a table says of itself, wherever its values are: its wavelengths, and the error that it states."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.error import Error, stated
from brdfdb.grids import Axis
from brdfdb.parameters import Floats

_Located = tuple[NDArray[np.int64], NDArray[np.float64], tuple[int, ...]]
_MOST_KNOWN = 64  # single wavelengths that are remembered


class Stated(NamedTuple):
    """Values of f_r with the error that their table states for them.

    Attributes
    ----------
    brdf : array [1/sr]
        As by `Table.lookup`.
    error : array [1/sr]
        In the same shape: 99 of 100 values of the table in this band of theta_i, at this wavelength, are within that
        of the model.
    """

    brdf: Floats
    error: Floats


class Described:
    """What a table in memory and one behind a service have in common; `Table` says what the attributes are."""

    name: str
    revision: str
    attrs: Mapping[str, Any]
    wavelength_nm: Axis | None

    @functools.cached_property
    def error(self) -> Error | None:
        """The error that the table states; None if none was measured."""
        return None if "error" not in self.attrs else Error.model_validate(self.attrs["error"])

    def _stated(self, theta_i: NDArray[Any], brdf: Floats, wavelength_nm: ArrayLike | None) -> Floats:
        if self.error is None:
            raise ValueError(f"with_error: the table of {self.name} states no error; build it anew")
        return self.stated_by(self.error, theta_i, brdf, wavelength_nm)

    def stated_by(
        self, error: Error, theta_i: NDArray[Any], brdf: Floats, wavelength_nm: ArrayLike | None = None
    ) -> Floats:
        """What an error at the wavelengths of the table says [1/sr] of values at theta_i [rad], in their shape.

        Between wavelengths it is the larger of the two.
        """
        low, weight, tail = self._wavelengths(wavelength_nm)
        values = brdf if tail else np.asarray(brdf)[..., np.newaxis]
        theta = np.broadcast_to(theta_i, values.shape[:-1])
        found = np.maximum(*(stated(error, theta, values, at) for at in (low, low + (weight > 0.0))))
        return np.asarray(found if tail else found[..., 0])[()]

    @functools.cached_property
    def _all_wavelengths(self) -> _Located:
        count = 1 if self.wavelength_nm is None else self.wavelength_nm.size
        return np.arange(count), np.zeros(count), () if self.wavelength_nm is None else (count,)

    @functools.cached_property
    def _known_wavelengths(self) -> dict[float, _Located]:
        return {}

    def _wavelengths(self, wavelength_nm: ArrayLike | None) -> _Located:
        """Lower node and weight of the upper one for each wavelength asked for, and the shape they add."""
        if wavelength_nm is None:
            return self._all_wavelengths
        if not isinstance(wavelength_nm, float):
            return self._located(wavelength_nm)
        known = (
            self._known_wavelengths
        )  # of points one by one: checks take as long as the lookup, and few are asked for
        found = known.get(wavelength_nm)
        if found is None:
            found = self._located(wavelength_nm)
            if len(known) >= _MOST_KNOWN:
                known.clear()
            known[wavelength_nm] = found
        return found

    def _located(self, wavelength_nm: ArrayLike) -> _Located:
        stored = self.wavelength_nm
        given = np.asarray(wavelength_nm)
        if given.size and given.dtype.kind not in "iuf":
            raise ValueError(f"wavelength_nm: {wavelength_nm!r} is not a number of nanometres")
        wanted = given.astype(np.float64)
        if wanted.ndim > 1:
            raise ValueError(f"wavelength_nm: {wanted.ndim} axes; allowed are a number and a list of numbers")
        flat = wanted.reshape(-1)
        good = (flat > 0.0) & np.isfinite(flat)
        if not np.all(good):
            raise ValueError(f"wavelength_nm: {flat[~good][0]:g} is not a positive number of nanometres")
        if stored is None:
            return np.zeros(flat.size, dtype=np.int64), np.zeros(flat.size), wanted.shape
        outside = (flat < stored[0]) | (flat > stored[-1])
        if np.any(outside):
            raise ValueError(
                f"wavelength_nm: {flat[outside][0]:.9g} is outside [{stored[0]:g}, {stored[-1]:g}] nm of {self.name}"
            )
        low = np.searchsorted(stored, flat, side="right") - 1
        step = stored[np.minimum(low + 1, stored.size - 1)] - stored[low]
        weight = np.divide(flat - stored[low], step, out=np.zeros(flat.size), where=step > 0.0)
        return low, weight, wanted.shape
