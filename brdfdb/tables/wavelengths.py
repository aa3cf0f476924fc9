"""The wavelengths of a table of spectra: as many as keep f_r between them to the tolerance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brdfdb.materials import Source
from brdfdb.tables import error_measurement
from brdfdb.tables.layout import LINEAR, PLAIN, Interpolation, over_wavelengths

MOST = 400  # wavelengths of a table, if some are added
_SHARE = 0.12  # of the tolerance that lines between wavelengths may take; the error over the angles takes the rest
_DECIMALS = 2  # of wavelengths that are added
_DRAWS, _SEED = 40, 1995  # directions of a band of theta_i
_STRAIGHT = Interpolation(PLAIN.method, wavelengths=LINEAR)


def refined(source: Source, wavelength_nm: NDArray[np.float64] | None, tolerance: float) -> NDArray[np.float64] | None:
    """Return wavelengths [nm] between which straight lines follow a source, those given among them.

    Each interval is divided where lines are worst, until the 95th percentile of their error is within a share of the
    tolerance, or there are `MOST` wavelengths. Only the wavelengths of sources whose parameters are spectra are added
    to.
    """
    if wavelength_nm is None or wavelength_nm.size < 2 or over_wavelengths(source) != LINEAR:
        return wavelength_nm
    drawn = error_measurement.draw(source, wavelength_nm, _DRAWS, _SEED).above_the_horizon()
    nodes = wavelength_nm
    while nodes.size < MOST:
        floor = error_measurement.floor_of(error_measurement.model_values(source, nodes, drawn.wi, drawn.wr), drawn)
        worst = error_measurement.worst_between(source, nodes, _STRAIGHT, drawn.wi, drawn.wr, floor)
        wrong = sorted((place for place in worst if place.error > _SHARE * tolerance), key=lambda place: -place.error)
        finer = np.union1d(nodes, np.round([place.wavelength_nm for place in wrong[: MOST - nodes.size]], _DECIMALS))
        if finer.size == nodes.size:
            break
        nodes = finer
    return nodes
