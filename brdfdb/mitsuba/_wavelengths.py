"""Wavelengths of the channels of a variant: numbers over wavelengths as columns of a table."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from brdfdb.mitsuba._buffers import Buffer

Array = NDArray[np.float64]

# Dominant wavelengths [nm] of the primaries of sRGB, for variants without a spectrum. Green stands for mono
WAVELENGTHS_NM = (611.4, 549.1, 464.2)

_STEP_NM = 0.1  # of columns, between which spectral variants interpolate linearly


def channels_nm() -> tuple[float, ...]:
    """Return the wavelengths [nm] of the channels of a variant that is not spectral."""
    return WAVELENGTHS_NM[1:2] if mi.is_monochromatic else WAVELENGTHS_NM


class Columns:
    """The wavelengths at which numbers of a table are kept: those of the channels, or close together in a spectrum."""

    def __init__(self, wavelength_nm: Array | None) -> None:
        """Take the wavelengths of the table; None of a grey one, which has one column."""
        if wavelength_nm is None:
            self.at_nm = None
        elif mi.is_spectral:
            low, high = wavelength_nm[0], wavelength_nm[-1]
            self.at_nm = np.linspace(low, high, int(np.ceil((high - low) / _STEP_NM)) + 1)
        else:
            self.at_nm = np.clip(channels_nm(), wavelength_nm[0], wavelength_nm[-1])
        self.count = 1 if self.at_nm is None else self.at_nm.size
        self._between = mi.is_spectral and self.count > 1

    def places(self, interaction: Any) -> list[Any]:
        """Return for each channel the place along the columns, as a number of columns."""
        channels = len(mi.UnpolarizedSpectrum(0.0))
        if not self._between or self.at_nm is None:
            return [float(min(channel, self.count - 1)) for channel in range(channels)]
        step = float(self.at_nm[1] - self.at_nm[0])
        wavelengths = mi.UnpolarizedSpectrum(interaction.wavelengths)
        return [dr.clip((nm - float(self.at_nm[0])) / step, 0.0, self.count - 1.0) for nm in wavelengths]

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
        column = dr.minimum(dr.floor(place), self.count - 2.0)
        begin, share = first + mi.UInt32(column), place - column
        return rows.at(begin) * (1.0 - share) + rows.at(begin + 1) * share
