"""The channels of a file: the wavelengths of the table, or colours of it."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brdfdb import spectra
from brdfdb.errors import CannotHoldError, ParameterError
from brdfdb.parameters import Floats

if TYPE_CHECKING:
    from brdfdb.tables.table import Table

RGB = ("R", "G", "B")
XYZ = ("X", "Y", "Z")
LUMINOUS = ("Y",)
GREY = ("grey",)
FILE_RANGE_NM = (10.0, 1e6)  # wavelengths of files: others are in another unit
_AT_ONCE = 1 << 22  # values of a table that are looked up at a time


@dataclass(frozen=True, eq=False)
class Channels:
    """The channels of a file."""

    #: ("R", "G", "B"), ("X", "Y", "Z"), ("Y",), ("grey",), or a wavelength each, such as "550nm"
    names: tuple[str, ...]
    #: wavelengths at which the table is looked up; None of a grey one, (L,) [nm]
    wavelength_nm: NDArray[np.float64] | None
    #: weights that take the wavelengths to the channels; None where they are the channels, (L, C)
    weights: NDArray[np.float64] | None
    meaning: str  #: the channels in words
    remarks: tuple[str, ...] = ()  #: a sentence for the record if the channels are others than those of the table

    def values(self, table: Table, wi: Floats, wr: Floats) -> Floats:
        """Return f_r [1/sr] of a table in the channels, shape (..., C), at unit vectors (..., 3)."""
        shape = np.broadcast_shapes(wi.shape, wr.shape)[:-1]
        wi, wr = (np.ascontiguousarray(np.broadcast_to(w, (*shape, 3))).reshape(-1, 3) for w in (wi, wr))
        values = np.empty((len(wi), len(self.names)))
        step = max(1, _AT_ONCE // (1 if self.wavelength_nm is None else self.wavelength_nm.size))
        for start in range(0, len(wi), step):
            pairs = slice(start, start + step)
            values[pairs] = self.of_spectra(np.asarray(table.lookup_vectors(wi[pairs], wr[pairs], self.wavelength_nm)))
        return values.reshape(*shape, len(self.names))

    def of_spectra(self, brdf: Floats, *, absolute: bool = False) -> Floats:
        """Return values in the channels, shape (..., C), from lookups at the wavelengths, shape (..., L), or grey.

        `absolute` takes errors in place of values: they add up whatever the sign of a weight is.
        """
        if self.wavelength_nm is None:
            return np.repeat(brdf[..., np.newaxis], len(self.names), axis=-1)
        if self.weights is None:
            return brdf
        return np.asarray(brdf @ (np.abs(self.weights) if absolute else self.weights))


def names_of(wavelength_nm: NDArray[np.float64] | None) -> tuple[str, ...]:
    """Return the names of channels at wavelengths [nm], such as 550nm; "grey" without wavelengths."""
    return GREY if wavelength_nm is None else tuple(f"{nm:g}nm" for nm in wavelength_nm)


def check_file_wavelengths(wavelength_nm: NDArray[np.float64], taken: str, refused: Collection[str]) -> None:
    """Raise ParameterError if wavelengths [nm] of a file are outside [10, 1e6] nm, with the unit that they may have.

    Numbers were taken to be in the unit `taken`. The unit is not named if the file refuses to be told of it.
    """
    from brdfdb.measurements.conventions import NM_PER, WAVELENGTH_UNITS

    low, high = FILE_RANGE_NM
    inside = (wavelength_nm >= low) & (wavelength_nm <= high)
    if np.all(inside):
        return
    wrong = float(wavelength_nm[~inside][0])
    text = f"{wrong:g} nm is outside [{low:g}, {high:g}] nm"
    for unit in WAVELENGTH_UNITS:
        other_nm = wavelength_nm * (NM_PER[unit] / NM_PER[taken])
        if np.all((other_nm >= low) & (other_nm <= high)) and "--wavelength-unit" not in refused:
            text += f"; if the numbers are {unit}, state --wavelength-unit {unit}"
            break
    raise ParameterError("wavelength_nm", text, wrong, FILE_RANGE_NM)


def has_spectrum(table: Table) -> bool:
    """Return True if a table has several wavelengths, so that it can have a colour."""
    return table.wavelength_nm is not None and table.wavelength_nm.size > 1


def channels_of(table: Table, colour: str = "") -> Channels:
    """Return the channels of a table: its wavelengths, or colours of it.

    Parameters
    ----------
    table : Table
        Grey or spectral.
    colour : str
        "" keeps the wavelengths. "rgb" is linear sRGB under D65. "xyz" is CIE XYZ of the 2 degree observer under the
        equal-energy illuminant, with Y = 1 of a white surface. "grey" is Y of it. "auto" is "xyz" for a table of
        several wavelengths, and "grey" for others. The channels of a grey table are all the same, and so are those of a
        table of one wavelength: f_r there.

    Raises
    ------
    CannotHoldError
        If a colour is asked for and the table has several wavelengths that do not reach from 420 to 680 nm.
    """
    at = table.wavelength_nm
    if colour == "auto":
        colour = "xyz" if has_spectrum(table) else "grey"
    names = {"": GREY, "rgb": RGB, "xyz": XYZ, "grey": LUMINOUS}[colour]
    same = "all channels are the same: the table is grey"
    if at is None:
        return Channels(names, None, None, "grey: the same at all wavelengths", (same,) if len(names) > 1 else ())
    if not colour:
        return Channels(names_of(at), at, None, "f_r at each wavelength")
    if not has_spectrum(table):
        meaning = f"{'all channels are ' if len(names) > 1 else ''}f_r at {at[0]:g} nm"
        return Channels(names, at, np.ones((1, len(names))), meaning, (meaning,))
    wavelengths = spectra.colour_wavelengths(at)
    if wavelengths is None:
        raise CannotHoldError(
            f"{table.name}: wavelengths of {at[0]:g} to {at[-1]:g} nm give no colour; the format needs "
            f"{spectra.VISIBLE_FROM_NM:g} to {spectra.VISIBLE_TO_NM:g} nm"
        )
    key = tuple(wavelengths.tolist())
    if colour == "rgb":
        weights = spectra.srgb_weights(key)
        meaning = "linear sRGB under D65"
    else:
        weights = spectra.xyz_weights(key, "E")
        meaning = "CIE XYZ, 2 degree observer, equal-energy illuminant"
        weights = weights / weights.sum(axis=0)
    if colour == "grey":
        weights = weights[:, 1:2]
        meaning = "luminous: CIE Y under the equal-energy illuminant"
    return Channels(names, wavelengths, weights, meaning, (f"of the spectrum: {meaning}",))


def at_wavelength(table: Table, wavelength_nm: float) -> Channels:
    """Return the one channel of a format that holds a single wavelength: that of a grey table, or a wavelength.

    ParameterError if the wavelength [nm] is outside those of the table; a table of one wavelength has that one.
    """
    at = table.wavelength_nm
    if at is None or at.size == 1:
        return channels_of(table)
    if not at[0] <= wavelength_nm <= at[-1]:
        raise ParameterError(
            "wavelength", f"{wavelength_nm:g} nm is outside [{at[0]:g}, {at[-1]:g}] nm of {table.name}", wavelength_nm
        )
    meaning = f"f_r at {wavelength_nm:g} nm alone"
    return Channels((f"{wavelength_nm:g}nm",), np.array([wavelength_nm]), None, meaning, (meaning,))
