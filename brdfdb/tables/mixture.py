"""Wavelengths of a table: few whose f_r makes f_r at all others, or more where lines between those given are wrong."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.materials import Source
from brdfdb.tables import error_measurement
from brdfdb.tables.grids import Axis
from brdfdb.tables.layout import LINEAR, PLAIN, Interpolation, over_wavelengths

MOST_PARTS = 4
_DIRECTIONS = 40  # directions in each band of theta_i
_SEED = 2026
_EXACT = 1e-7  # error of a mixture [1], relative to f_r of the direction at its brightest wavelength
MOST = 400  # largest number of wavelengths of a table, if wavelengths are added
_SHARE = 0.12  # of the tolerance that lines between wavelengths may take; the error over the angles takes the rest
_DECIMALS = 2  # of wavelengths that are added
_REFINED_SEED = 1995
_STRAIGHT = Interpolation(PLAIN.method, wavelengths=LINEAR)


class Mixture(NamedTuple):
    """A few wavelengths [nm] whose f_r, without the uniform part, makes f_r at all wavelengths.

    f_r at wavelength l is the sum over parts p of spectra[p, l] times f_r at part_nm[p]. `extremes` are the numbers of
    the wavelengths where the source is brightest and darkest.
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
    drawn = error_measurement.draw(source, wavelength_nm, _DIRECTIONS, _SEED)
    above = drawn.above
    f_r = error_measurement.model_values(rest, wavelength_nm, drawn.wi[above], drawn.wr[above])
    mean = error_measurement.model_values(source, wavelength_nm, drawn.wi[above], drawn.wr[above]).mean(axis=0)
    extremes = np.array([np.argmin(mean), np.argmax(mean)])
    brightest = f_r.max(axis=1, keepdims=True)
    columns = np.divide(f_r, brightest, out=np.zeros_like(f_r), where=brightest > 0.0)
    chosen: list[int] = []
    unexplained = columns
    for _ in range(min(MOST_PARTS, wavelength_nm.size - 1)):
        chosen.append(int(np.argmax(np.sum(unexplained**2, axis=0))))
        spectra = np.linalg.lstsq(columns[:, chosen], columns, rcond=None)[0]
        spectra[:, chosen] = np.eye(len(chosen))
        unexplained = columns - columns[:, chosen] @ spectra
        if np.abs(unexplained).max(initial=0.0) <= _EXACT:
            return Mixture(wavelength_nm[chosen], spectra, extremes)
    return None


def refined_wavelengths(source: Source, wavelength_nm: Axis | None, tolerance: float) -> Axis | None:
    """Return wavelengths [nm] between which straight lines follow a source, those given among them.

    Each interval is divided where lines are worst, until the 95th percentile of their error is within a share of the
    tolerance, or there are `MOST` wavelengths. Only the wavelengths of sources whose parameters are spectra are added
    to.
    """
    if wavelength_nm is None or wavelength_nm.size < 2 or over_wavelengths(source) != LINEAR:
        return wavelength_nm
    drawn = error_measurement.draw(source, wavelength_nm, _DIRECTIONS, _REFINED_SEED).above_the_horizon()
    refined_nm = wavelength_nm
    while (size := refined_nm.size) < MOST:
        truth = error_measurement.model_values(source, refined_nm, drawn.wi, drawn.wr)
        floor = error_measurement.floor_of(truth, drawn)
        worst = error_measurement.worst_between(source, refined_nm, _STRAIGHT, drawn.wi, drawn.wr, floor)
        wrong = sorted((place for place in worst if place.error > _SHARE * tolerance), key=lambda place: -place.error)
        added_nm = np.round([place.wavelength_nm for place in wrong[: MOST - size]], _DECIMALS)
        refined_nm = np.union1d(refined_nm, added_nm)
        if refined_nm.size == size:
            break
    return refined_nm
