"""The channels of a file: the wavelengths of the table, or colours of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brdfdb import spectra
from brdfdb.errors import CannotHoldError, ParameterError
from brdfdb.parameters import Floats

if TYPE_CHECKING:
    from brdfdb.tables.table import Table

RGB, XYZ = ("R", "G", "B"), ("X", "Y", "Z")
_AT_ONCE = 1 << 22  # values of a table that are looked up at a time


@dataclass(frozen=True, eq=False)
class Channels:
    """The channels of a file.

    Attributes
    ----------
    names : tuple of str
        ("R", "G", "B"), ("X", "Y", "Z"), ("grey",), or a wavelength each, such as "550nm".
    wavelength_nm : array (L,) [nm] or None
        Wavelengths at which the table is looked up; None of a grey one.
    weights : array (L, C) or None
        Weights that take the wavelengths to the channels; None where they are the channels.
    meaning : str
        The channels in words.
    """

    names: tuple[str, ...]
    wavelength_nm: NDArray[np.float64] | None
    weights: NDArray[np.float64] | None
    meaning: str

    def values(self, table: Table, wi: Floats, wr: Floats) -> Floats:
        """Return f_r [1/sr] of a table in the channels, shape (..., C), at unit vectors (..., 3)."""
        shape = np.broadcast_shapes(wi.shape, wr.shape)[:-1]
        wi, wr = (np.ascontiguousarray(np.broadcast_to(w, (*shape, 3))).reshape(-1, 3) for w in (wi, wr))
        values = np.empty((len(wi), len(self.names)))
        step = max(1, _AT_ONCE // (1 if self.wavelength_nm is None else self.wavelength_nm.size))
        for start in range(0, len(wi), step):
            some = slice(start, start + step)
            values[some] = self.of_spectra(np.asarray(table.lookup_vectors(wi[some], wr[some], self.wavelength_nm)))
        return values.reshape(*shape, len(self.names))

    def of_spectra(self, brdf: Floats) -> Floats:
        """Return values in the channels, shape (..., C), from lookups at the wavelengths, shape (..., L), or grey."""
        if self.wavelength_nm is None:
            return np.repeat(brdf[..., np.newaxis], len(self.names), axis=-1)
        return brdf if self.weights is None else np.asarray(brdf @ self.weights)


def channels_of(table: Table, colour: str = "") -> Channels:
    """Return the channels of a table: its wavelengths, or colours of it.

    Parameters
    ----------
    table : Table
        Grey or spectral.
    colour : str
        "" keeps the wavelengths. "rgb" is linear sRGB under D65. "xyz" is CIE XYZ of the 2 degree observer under the
        equal-energy illuminant, with Y = 1 of a white surface. "grey" is Y of it.

    Raises
    ------
    CannotHoldError
        If a colour is asked for and the wavelengths of the table do not reach from 420 to 680 nm.
    """
    at = table.wavelength_nm
    names = {"": ("grey",), "rgb": RGB, "xyz": XYZ, "grey": ("Y",)}[colour]
    if at is None:
        return Channels(names, None, None, "grey: the same at all wavelengths")
    if not colour:
        return Channels(tuple(f"{value:g}nm" for value in at), at, None, "f_r at each wavelength")
    wavelengths = at if spectra.covers_visible(at) else spectra.picture_wavelengths(at)
    if wavelengths is None:
        raise CannotHoldError(
            f"{table.name}: wavelengths of {at[0]:g} to {at[-1]:g} nm give no colour; the format needs "
            f"{spectra.VISIBLE_FROM_NM:g} to {spectra.VISIBLE_TO_NM:g} nm"
        )
    key = tuple(wavelengths.tolist())
    if colour == "rgb":
        return Channels(names, wavelengths, spectra.srgb_weights(key), "linear sRGB under D65")
    weights = spectra.xyz_weights(key, "E")
    weights = weights / weights.sum(axis=0)
    if colour == "grey":
        return Channels(names, wavelengths, weights[:, 1:2], "luminous: CIE Y under the equal-energy illuminant")
    return Channels(names, wavelengths, weights, "CIE XYZ, 2 degree observer, equal-energy illuminant")


def at_wavelength(table: Table, wavelength_nm: float) -> Channels:
    """Return the one channel of a format that holds a single wavelength: that of a grey table, or a wavelength.

    Raises
    ------
    ParameterError
        If the wavelength [nm] is outside those of the table; a table of one wavelength has that one.
    """
    at = table.wavelength_nm
    if at is None or at.size == 1:
        return channels_of(table)
    if not at[0] <= wavelength_nm <= at[-1]:
        raise ParameterError(
            "wavelength", f"{wavelength_nm:g} nm is outside [{at[0]:g}, {at[-1]:g}] nm of {table.name}", wavelength_nm
        )
    return Channels((f"{wavelength_nm:g}nm",), np.array([wavelength_nm]), None, f"f_r at {wavelength_nm:g} nm alone")
