"""Mixtures: f_r at a few wavelengths of a source that make f_r at all of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.materials import Source
from brdfdb.tables import error_measurement

MOST_PARTS = 4
_DRAWS, _SEED = 40, 2026  # directions in each band of theta_i
_EXACT = 1e-7  # error of a mixture [1], relative to f_r of the direction at its brightest wavelength


class Mixture(NamedTuple):
    """A few wavelengths whose f_r, without the uniform part, makes f_r at all wavelengths.

    Attributes
    ----------
    part_nm : array (parts,) [nm]
        Wavelengths of the parts.
    spectra : array (parts, L) [1]
        f_r at wavelength l is the sum over parts p of spectra[p, l] times f_r at part_nm[p].
    extremes : int64 array
        Numbers of the wavelengths where the source is brightest and darkest.
    """

    part_nm: NDArray[np.float64]
    spectra: NDArray[np.float64]
    extremes: NDArray[np.int64]


def mixture_of(source: Source, wavelength_nm: NDArray[np.float64] | None) -> Mixture | None:
    """Return the mixture that makes a source, or None if it takes more than `MOST_PARTS` wavelengths.

    Notes
    -----
    Wavelengths are chosen one by one, as the columns of an interpolative decomposition: the next is the one that the
    chosen ones explain least. A grey lobe times a spectrum takes one.
    """
    if wavelength_nm is None or wavelength_nm.size < 3:
        return None
    rest = source.without_uniform()
    drawn = error_measurement.draw(source, wavelength_nm, _DRAWS, _SEED)
    above = drawn.above
    f_r = error_measurement.model_values(rest, wavelength_nm, drawn.wi[above], drawn.wr[above])
    whole = error_measurement.model_values(source, wavelength_nm, drawn.wi[above], drawn.wr[above]).mean(axis=0)
    extremes = np.array([np.argmin(whole), np.argmax(whole)])
    brightest = f_r.max(axis=1, keepdims=True)
    columns = np.divide(f_r, brightest, out=np.zeros_like(f_r), where=brightest > 0.0)
    chosen: list[int] = []
    left = columns
    for _ in range(min(MOST_PARTS, wavelength_nm.size - 1)):
        chosen.append(int(np.argmax(np.sum(left**2, axis=0))))
        spectra = np.linalg.lstsq(columns[:, chosen], columns, rcond=None)[0]
        spectra[:, chosen] = np.eye(len(chosen))
        left = columns - columns[:, chosen] @ spectra
        if np.abs(left).max(initial=0.0) <= _EXACT:
            return Mixture(wavelength_nm[chosen], spectra, extremes)
    return None
