"""Mueller matrices on half and difference vectors, as few nodes as a tolerance allows, interpolated linearly."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.formats._angles import HalfDifference
from brdfdb.formats._angular_grid import AngularGrid
from brdfdb.formats._channels import Channels
from brdfdb.formats._dense_grid import dense_table, values_at_nodes
from brdfdb.formats._stated_error import Comparison, FileError
from brdfdb.geometry import radians
from brdfdb.parameters import Floats
from brdfdb.tables.grids import Grid

if TYPE_CHECKING:
    from brdfdb.tables.table import Table

_ELEMENTS = ((0, 0), (0, 1), (1, 1), (2, 2), (2, 3))  # that are stored; [1, 0], [3, 3] and [3, 2] follow from them
_BYTES = 16 * 4  # of a matrix
_COPIES = 4  # of phi_d, of which symmetry leaves a quarter
_SPLIT = 0.5  # share of the tolerance up to which a cell of theta_d may change the elements of a facet
_FIRST_DEG, _LEAST_DEG = np.linspace(0.0, 90.0, 10), 0.1


@dataclass(frozen=True, eq=False)
class MuellerGrid:
    """Mueller matrices at nodes of theta_h, theta_d and phi_d.

    Attributes
    ----------
    grid : Grid
        Nodes [degree]; phi_d ends at 90.
    channels : Channels
        Wavelengths.
    values : float32 array (theta_h, theta_d, phi_d, L, 4, 4) [1/sr]
        Matrices between bases of the plane of light and viewer, continued below the horizon.
    error : FileError
        Error of f_r against the table.
    element_p99 : float [1]
        Limit of 99 of 100 errors of the normalised elements, of the worst element and wavelength.
    """

    grid: Grid
    channels: Channels
    values: NDArray[np.float32]
    error: FileError
    element_p99: float


def mueller_grid(table: Table, channels: Channels, tolerance: float, nbytes: float) -> MuellerGrid:
    """Return the smallest grid within a tolerance, of f_r and of the normalised elements, or the nearest of a size.

    Raises
    ------
    ParameterError
        If no grid is so small [byte].
    """
    facet = _theta_d(table, channels, _SPLIT * tolerance)
    most = nbytes / (_BYTES * _COPIES)
    share = 1.0
    while True:
        dense = dense_table(table, tolerance, axes="half_difference", most_values=int(share * most), channels=channels)
        axes = dense.grid.axes
        grid = Grid({**axes, "theta_d": np.union1d(axes["theta_d"], facet)})
        size = math.prod(grid.shape) * len(channels.names)
        if size <= most:
            return _filled(table, channels, grid)
        if share * most < 8 * len(channels.names):
            raise ParameterError("megabytes", f"{nbytes / 1e6:g} MB are too few for any file of {table.name}", nbytes)
        share *= 0.9 * most / size


def _theta_d(table: Table, channels: Channels, tolerance: float) -> NDArray[np.float64]:
    """Return nodes [degree] of theta_d between which straight lines keep to the elements of a facet."""
    nodes = _FIRST_DEG
    while True:
        at = radians(nodes)
        middle = 0.5 * (at[1:] + at[:-1])
        ends, between = (table.facet_mueller(angle, channels.wavelength_nm) for angle in (at, middle))
        wrong = np.abs(0.5 * (ends[1:] + ends[:-1]) - between).max(axis=(1, 2, 3))
        split = (wrong > tolerance) & (np.diff(nodes) > _LEAST_DEG)
        if not split.any():
            return nodes
        nodes = np.sort(np.concatenate([nodes, np.rad2deg(middle[split]).round(4)]))


def _filled(table: Table, channels: Channels, grid: Grid) -> MuellerGrid:
    f_r = values_at_nodes(table, channels, grid).astype(np.float64)
    depolarised = table.depolarised(channels.wavelength_nm)
    facet = table.facet_mueller(radians(grid.axes["theta_d"]), channels.wavelength_nm)
    values = (f_r - depolarised)[..., np.newaxis, np.newaxis] * facet[np.newaxis, :, np.newaxis]
    values[..., 0, 0] = f_r
    stored = values.astype(np.float32)
    error, element_p99 = _errors(table, channels, grid, stored)
    return MuellerGrid(grid, channels, stored, error, element_p99)


def _errors(table: Table, channels: Channels, grid: Grid, values: NDArray[np.float32]) -> tuple[FileError, float]:
    """Return the error of f_r, and the p99 of the normalised elements, as readers interpolate the values."""
    comparison = Comparison(table, channels)
    rows, columns = np.array(_ELEMENTS).T
    some = values[..., rows, columns]
    nodes = tuple(radians(axis) for axis in grid.axes.values())
    reader = AngularGrid(HalfDifference(anisotropic=False), nodes, some.reshape(*grid.shape, -1))

    def evaluate(wi: Floats, wr: Floats) -> Floats:
        return reader.evaluate(wi, wr).reshape(len(wi), len(channels.names), len(_ELEMENTS))

    error = comparison.error_of(lambda wi, wr: np.maximum(evaluate(wi, wr)[..., 0], 0.0))
    above = comparison.wr[:, 2] > 0.0
    wi, wr = comparison.wi[above], comparison.wr[above]
    truth = table.mueller_in_plane(wi, wr, channels.wavelength_nm)[..., rows, columns]
    read = evaluate(wi, wr)
    counted = (truth[..., 0] > 0.0) & (read[..., 0] > 0.0)
    wrong = np.abs(read[counted] / read[counted][:, :1] - truth[counted] / truth[counted][:, :1])
    return error, float(np.percentile(wrong, 99.0, axis=0).max(initial=0.0))
