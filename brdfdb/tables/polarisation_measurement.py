"""The error of the normalised elements of a polarised table against its model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brdfdb.materials import Source
from brdfdb.materials.polarised import polarised_source
from brdfdb.parameters import Floats
from brdfdb.tables import error_measurement
from brdfdb.tables.polarisation_record import ElementError
from brdfdb.tables.table import Table

SEED = 1852  # of the directions
DIRECTIONS, _FEWER_DIRECTIONS, _FEW = 2000, 500, 4  # of a band of theta_i; fewer where more wavelengths than _FEW
_ANGLES = 2001  # of theta_d at which the stored elements are measured
_SOME = 8  # wavelengths that are evaluated at a time


def element_error(table: Table, source: Source, seed: int = SEED) -> ElementError:
    """Measure the error of m_ij / m_00 between bases of the surface, at wavelengths and half way between them.

    Directions are those of `brdfdb.tables.error_measurement.draw` above the horizon. Those at which the model reflects
    nothing do not count.
    """
    assert table.wavelength_nm is not None
    nodes = table.wavelength_nm
    count = DIRECTIONS if nodes.size <= _FEW else _FEWER_DIRECTIONS
    drawn = error_measurement.draw(source, nodes, count, seed)
    wi, wr = drawn.wi[drawn.above], drawn.wr[drawn.above]
    p99, largest = _errors(table, source, wi, wr, nodes)
    middles = 0.5 * (nodes[1:] + nodes[:-1])
    between = None if nodes.size < 2 else _errors(table, source, wi, wr, middles)
    return ElementError(
        directions=len(wi),
        seed=seed,
        p99=_up(p99),
        max=_up(largest),
        between_p99=None if between is None else _up(between[0]),
        between_max=None if between is None else _up(between[1]),
        facet=_facet_error(table, source, nodes),
        between_facet=None if between is None else _facet_error(table, source, middles),
    )


def _errors(
    table: Table, source: Source, wi: Floats, wr: Floats, wavelength_nm: NDArray[np.float64]
) -> tuple[Floats, Floats]:
    """Return the 99th percentile and the maximum of the error of each element (4, 4), at the worst wavelength."""
    model = polarised_source(source)
    p99, largest = np.zeros((4, 4)), np.zeros((4, 4))
    for start in range(0, wavelength_nm.size, _SOME):
        some = wavelength_nm[start : start + _SOME]
        wrong = np.abs(_normalised(table.mueller_vectors(wi, wr, some)) - _normalised(model.mueller(wi, wr, some)))
        p99 = np.maximum(p99, np.nanpercentile(wrong, 99.0, axis=0).max(axis=0))
        largest = np.maximum(largest, np.nanmax(wrong, axis=(0, 1)))
    return p99, largest


def _facet_error(table: Table, source: Source, wavelength_nm: NDArray[np.float64]) -> float:
    """Return the largest error of the elements of the facet over theta_d, between bases of the plane."""
    theta_d = np.linspace(0.0, np.pi / 2.0, _ANGLES)
    stored = table.facet_mueller(theta_d, wavelength_nm)
    wrong = np.abs(stored - polarised_source(source).facet(theta_d, wavelength_nm)).max()
    return _up(np.full((1, 1), wrong))[0][0]


def _normalised(mueller: Floats) -> Floats:
    """Return m_ij / m_00; nan where nothing is reflected."""
    first = mueller[..., :1, :1]
    return np.divide(mueller, first, out=np.full_like(mueller, np.nan), where=first > 0.0)


def _up(values: Floats) -> list[list[float]]:
    """Return numbers to three digits, rounded up."""
    return [[float(f"{1.00501 * value:.3g}") for value in row] for row in values.tolist()]
