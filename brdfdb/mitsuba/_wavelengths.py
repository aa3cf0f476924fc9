"""Wavelengths of the channels of a variant: numbers over wavelengths as columns of a table."""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.mitsuba._buffers import Buffer, whole
from brdfdb.spectra import VISIBLE_FROM_NM, VISIBLE_TO_NM, colour_wavelengths, srgb_weights

Array = NDArray[np.float64]

# Dominant wavelengths [nm] of the primaries of sRGB, for variants without a spectrum. Green stands for mono
WAVELENGTHS_NM = (611.4, 549.1, 464.2)

SRGB, SINGLE = "srgb", "wavelengths"  # the property `channels`: a projected spectrum, or f_r at `WAVELENGTHS_NM`

_STEP_NM = 0.1  # of columns, between which spectral variants interpolate linearly


def channels_nm() -> tuple[float, ...]:
    """Return the wavelengths [nm] of the channels of a variant that is not spectral."""
    return WAVELENGTHS_NM[1:2] if mi.is_monochromatic else WAVELENGTHS_NM


class Projection(NamedTuple):
    """Wavelengths [nm] of a spectrum, shape (L,), and weights [1] that take it to linear sRGB under D65, (L, 3)."""

    wavelength_nm: Array
    weights: Array


def projection(props: Any, stored_nm: Array | None) -> Projection | None:
    """Return how channels follow from a spectrum that is known at given wavelengths, as in ``export rgl --kind rgb``.

    None stands for channels that have a wavelength each: in variants that are not RGB or polarised, for a surface that
    is grey or known at a single wavelength, and where the property `channels` of the plugin is "wavelengths".
    ParameterError says that the wavelengths make no colour, or that `channels` is neither "srgb" nor "wavelengths".
    """
    channels = props.get("channels", SRGB)
    if channels not in (SRGB, SINGLE):
        raise ParameterError("channels", f"{channels!r} is neither {SRGB} nor {SINGLE}", channels, (SRGB, SINGLE))
    if channels == SINGLE or not mi.is_rgb or mi.is_polarized or stored_nm is None or stored_nm.size < 2:
        return None
    at_nm = colour_wavelengths(stored_nm)
    if at_nm is None:
        raise ParameterError(
            "channels",
            f"wavelengths of {stored_nm[0]:g} to {stored_nm[-1]:g} nm give no colour, which needs {VISIBLE_FROM_NM:g} "
            f"to {VISIBLE_TO_NM:g} nm; {SINGLE!r} shows f_r at {', '.join(f'{nm:g}' for nm in WAVELENGTHS_NM)} nm, "
            "and the property wavelength_nm sets one wavelength",
            channels,
            (SRGB, SINGLE),
        )
    return Projection(at_nm, srgb_weights(tuple(at_nm.tolist())))


class Columns:
    """The wavelengths of the columns of a table: those of the channels, or closely spaced in spectral variants."""

    def __init__(self, wavelength_nm: Array | None, single_nm: float = 0.0) -> None:
        """Take the wavelengths of the table, None of a grey one, which has one column; one for all channels if not 0.

        A table of a single wavelength has one column, too. Spectra continue as constants beyond the wavelengths.
        ParameterError says that the wavelength of a channel lies outside those of the table, in variants without a
        spectrum.
        """
        if wavelength_nm is None:
            self.at_nm = None
        elif single_nm:
            self.at_nm = within(np.array([single_nm]), wavelength_nm)
        elif mi.is_spectral:
            low, high = wavelength_nm[0], wavelength_nm[-1]
            self.at_nm = np.linspace(low, high, int(np.ceil((high - low) / _STEP_NM)) + 1)
        else:
            self.at_nm = wavelength_nm if wavelength_nm.size == 1 else within(np.array(channels_nm()), wavelength_nm)
        self.count = 1 if self.at_nm is None else self.at_nm.size
        self._between = mi.is_spectral and self.count > 1

    def places(self, interaction: Any) -> list[Any]:
        """Return for each channel the place along the columns, as a number of columns."""
        channels = len(mi.UnpolarizedSpectrum(0.0))
        if not self._between or self.at_nm is None:
            return [float(min(channel, self.count - 1)) for channel in range(channels)]
        step = float(self.at_nm[1] - self.at_nm[0])
        wavelengths = mi.UnpolarizedSpectrum(interaction.wavelengths)
        places = [(nm - float(self.at_nm[0])) / step for nm in wavelengths]
        return [dr.select(dr.isnan(place), place, dr.clip(place, 0.0, self.count - 1.0)) for place in places]

    def nm(self, place: Any) -> Any:
        """Return the wavelength [nm] at a place; 0 of a grey table."""
        if self.at_nm is None:
            return 0.0
        if not self._between:
            return mi.Float(float(self.at_nm[int(place)]))
        return float(self.at_nm[0]) + place * float(self.at_nm[1] - self.at_nm[0])

    def read(self, rows: Buffer, row: Any, place: Any) -> Any:
        """Return the number of a row at a place."""
        first = row * self.count
        if not self._between:
            return rows.at(first + int(place))
        column = whole(place, self.count - 1)
        begin, share = first + column, place - column
        return rows.at(begin) * (1.0 - share) + rows.at(begin + 1) * share


def within(at_nm: Array, stored_nm: Array) -> Array:
    """Return wavelengths [nm] if they lie within those at which a table or a spectrum is known."""
    for nm in at_nm[(at_nm < stored_nm[0]) | (at_nm > stored_nm[-1])]:
        low, high = float(stored_nm[0]), float(stored_nm[-1])
        sentence = f"{nm:g} is outside [{low:g}, {high:g}] nm, the wavelengths that are known"
        raise ParameterError("wavelength_nm", sentence, float(nm), (low, high))
    return at_nm
