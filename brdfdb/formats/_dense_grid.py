"""Dense tables: f_r itself on the nodes of a plain grid of angles, as few as a tolerance allows, interpolated linearly.

Between nodes every program interpolates in the same way, along all axes at once. The nodes of an axis are crowded where
f_r bends: linear interpolation in a cell of width h is off by h^2 / 8 times the second derivative.

`_angular_grid` chooses nodes for other angles, by halving intervals. For these axes it takes more values: 43 MB instead
of 18 MB of the spectra of an aluminium at a tolerance of 2 % (`aluminum-cylinder-12b`), and 23 MB instead of 18 MB of
copper, though it takes fewer for some wide lobes.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.formats._channels import Channels
from brdfdb.formats._node_search import Pace, Trial, finest, smallest, unevenness
from brdfdb.formats._stated_error import Comparison, FileError
from brdfdb.geometry import HALF_PI, radians, unit_vector, vectors_from_half_difference
from brdfdb.parameters import Floats
from brdfdb.tables._interpolation import weights_of_nodes
from brdfdb.tables.grids import (
    ANISOTROPIC_AXES,
    ANISOTROPIC_HALF_DIFFERENCE_AXES,
    HALF_DIFFERENCE_AXES,
    ISOTROPIC_AXES,
    Axis,
    Grid,
)
from brdfdb.tables.table import Table, points

MOST_BYTES = 100_000_000  # size of the values of a file
AXES = ("smallest", "light_viewer", "half_difference")
_WAVELENGTHS = 5  # that nodes are chosen for; the finished table is measured at all
_STEP_DEG = 0.5  # from which second derivatives are taken
_BINS = 60  # of an axis, with a second derivative each
_QUANTILE = 0.985  # of the second derivatives in a bin
_EASED = 0.1  # least density of nodes, relative to its mean
_LEVEL = 0.01  # error at which the axes are compared
_MOST_UNEVEN = 4.0  # largest ratio of the errors of two axes that is evened out
_PACE = Pace(rounds=9, aim=0.93, fastest=5.0, halves=False)
_LEVELS = 1e-8, 1e3  # range of levels
_LAST_DEG = 89.5  # of light and viewer where f_r has a pole at the horizon
_POLE = radians(2.0)  # angle from the horizon [rad] where the continuation begins if f_r has a pole there
_STRAIGHT = 7.5  # steps of such an angle that a straight line continues f_r by at most


@dataclass(frozen=True, eq=False)
class DenseTable:
    """f_r on a grid of angles."""

    grid: Grid  #: nodes of the axes [degree]
    channels: Channels  #: wavelengths, or "grey"
    #: f_r at the nodes, (*axes, C) [1/sr]. On axes of half and difference vectors it is continued in a straight line
    #: where light or viewer is below the horizon, so that cells at the horizon can be interpolated.
    values: NDArray[np.float32]
    error: FileError  #: error against the table, with linear interpolation
    tolerance: float | None = None  #: largest p99 that was asked for; None of a regular grid, [1]


def dense_table(
    table: Table,
    tolerance: float = 0.02,
    *,
    axes: str = "smallest",
    resolution: float = 0.0,
    most_values: int = MOST_BYTES // 4,
    digits: int = 0,
    last_deg: float = 90.0,
    channels: Channels | None = None,
) -> DenseTable:
    """Return a table on the smallest plain grid that is within a tolerance, or on a regular one.

    Parameters
    ----------
    axes : str
        "light_viewer": theta_i, theta_r, delta_phi, or theta_i, phi_i, theta_r, phi_r of anisotropic tables.
        "half_difference": theta_h, theta_d, phi_d, or theta_h, phi_h, theta_d, phi_d. "smallest": those that take fewer
        values.
    resolution : float [degree]
        Distance of the nodes on all axes; 0: as few nodes as the tolerance allows, where f_r bends.
    most_values : int
        Largest number of values. ParameterError if a regular grid has more; else the nearest smaller grid is returned.
    digits : int
        Significant digits that values are rounded to; 0: float32.
    last_deg : float [degree]
        Last polar angle of light and viewer that the format takes.
    """
    comparison = Comparison(table, channels)
    few = _at_few_wavelengths(comparison)
    kinds: dict[str, tuple[str, ...]] = {"light_viewer": ISOTROPIC_AXES, "half_difference": HALF_DIFFERENCE_AXES}
    if table.anisotropic:
        kinds = {"half_difference": ANISOTROPIC_HALF_DIFFERENCE_AXES, "light_viewer": ANISOTROPIC_AXES}
    plans = [_DensePlan(few, names, last_deg) for kind, names in kinds.items() if axes in (kind, "smallest")]
    if resolution:
        regular = min((plan.regular(resolution) for plan in plans), key=lambda grid: math.prod(grid.shape))
        size = math.prod(regular.shape) * len(comparison.channels.names)
        if size > most_values:
            raise ParameterError(
                "resolution",
                f"{resolution:g} degrees need {size} values; at most {most_values} are allowed",
                resolution,
            )
        return _tabulated(comparison, regular, digits)
    most_nodes = most_values // len(comparison.channels.names)
    trials: list[Trial[_DensePlan]] = []
    most_of_kind = most_nodes
    for plan in sorted(plans, key=lambda plan: math.prod(plan.grid(tolerance).shape)):
        least = finest(plan.count, most_of_kind, *_LEVELS)
        trials.append(smallest(plan.tried, tolerance, least, tolerance, _PACE))
        if trials[-1].p99 <= tolerance:
            most_of_kind = min(most_of_kind, trials[-1].size)
    best = min(trials, key=lambda trial: trial.rank(tolerance))
    level = best.level
    dense = _tabulated(comparison, best.grid.grid(level), digits)
    while dense.error.p99 > tolerance >= best.p99:  # the other wavelengths need more nodes
        level *= 0.9 * tolerance / dense.error.p99
        grid = best.grid.grid(level)
        if math.prod(grid.shape) > most_nodes:
            break
        dense = _tabulated(comparison, grid, digits)
    return replace(dense, tolerance=tolerance)


def interpolated(grid: Grid, values: NDArray[np.float32], wavelength_nm: Axis | None) -> Table:
    """Return a table in memory that interpolates f_r linearly between nodes, and not at all beyond the last ones."""
    shape = grid.shape if wavelength_nm is None else values.shape
    return Table("dense", "", {}, grid, wavelength_nm, np.ascontiguousarray(values, np.float32).reshape(shape), None)


def rounded(values: Floats, digits: int) -> NDArray[np.float64]:
    """Return values of so many significant digits as float64, which Python prints with no more."""
    exact = np.asarray(values, np.float64)
    power = np.floor(np.log10(np.where(exact == 0.0, 1.0, np.abs(exact)))).astype(int)
    # powers of ten up to 22 are exact: what is divided by one is the float64 nearest to the decimal number
    shift = np.clip(digits - 1 - power, 0, 22)
    scale = 10.0**shift
    return np.asarray(np.rint(exact * scale) / scale)


def values_at_nodes(table: Table, channels: Channels, grid: Grid) -> NDArray[np.float32]:
    """Return f_r [1/sr] of a table at the nodes of a grid, shape (*axes, C)."""
    continued = _Continued(table, channels, grid.names)
    values = np.empty((*grid.shape, len(channels.names)), np.float32)
    first, *others = (radians(nodes) for nodes in grid.axes.values())
    for row, node in enumerate(first):
        at = np.meshgrid(np.array([node]), *others, indexing="ij")
        values[row] = continued.at([column.reshape(-1) for column in at]).reshape(values.shape[1:])
    return values


def _tabulated(comparison: Comparison, grid: Grid, digits: int) -> DenseTable:
    """Return the table of a comparison on a grid, and its error there."""
    values = values_at_nodes(comparison.table, comparison.channels, grid)
    if digits:
        values = rounded(values, digits).astype(np.float32)
    reader = interpolated(grid, values, comparison.channels.wavelength_nm)
    count = len(comparison.channels.names)
    error = comparison.error_of(lambda wi, wr: np.asarray(reader.lookup_vectors(wi, wr)).reshape(len(wi), count))
    return DenseTable(grid, comparison.channels, values, error)


def _at_few_wavelengths(comparison: Comparison) -> Comparison:
    """Return a comparison at a few of its wavelengths, with the same pairs of directions."""
    channels = comparison.channels
    at = channels.wavelength_nm
    if at is None or at.size <= _WAVELENGTHS:
        return comparison
    few = np.unique(np.round(np.linspace(0, at.size - 1, _WAVELENGTHS)).astype(int))
    names = tuple(channels.names[index] for index in few)
    return Comparison(comparison.table, replace(channels, names=names, wavelength_nm=at[few]))


def _has_pole(table: Table) -> bool:
    return table.source is None or table.source.grazing_pole


class _DensePlan:
    """The nodes that a table needs on axes of one kind, in proportion to a level of error."""

    def __init__(self, comparison: Comparison, names: tuple[str, ...], last_deg: float) -> None:
        table = comparison.table
        self.comparison = comparison
        self.names = names
        self.continued = _Continued(table, comparison.channels, names)
        last_deg = min(last_deg, _LAST_DEG) if _has_pole(table) else last_deg
        ends = {"theta_i": last_deg, "theta_r": last_deg, "theta_h": 90.0, "theta_d": 90.0}
        ends |= dict.fromkeys(("phi_i", "phi_h"), 360.0 / table.grid.copies)
        ends |= {"delta_phi": 180.0, "phi_r": 360.0, "phi_d": 180.0 if table.anisotropic else 90.0}
        self.coarsest = Grid({name: np.array([0.0, ends[name]]) for name in names})
        self.above = comparison.wr[:, 2] > 0.0
        x = points(self.coarsest, comparison.wi[self.above], comparison.wr[self.above])
        self.x = np.minimum(x, np.array([radians(ends[name]) for name in names])[:, np.newaxis])

    @functools.cached_property
    def needs(self) -> list[Floats]:
        """The root of the second derivative of f_r in the bins of each axis [1/rad]."""
        needs = [self._need(axis) for axis in range(len(self.names))]
        wrong = np.array([self._line_error(axis, need) for axis, need in enumerate(needs)])
        shares = np.sqrt(unevenness(wrong, _MOST_UNEVEN))  # errors grow with the square of a step
        needs = [need * share for need, share in zip(needs, shares, strict=True)]
        if self.names == ISOTROPIC_AXES:  # reciprocity
            needs[:2] = [np.maximum(needs[0], needs[1])] * 2
        return needs

    def _line_error(self, axis: int, need: Floats) -> float:
        """Return the relative error that 99 of 100 pairs have at most on lines along a single axis."""
        nodes = radians(self._nodes_of(axis, need, _LEVEL))
        index, weights = weights_of_nodes(nodes, self.x[axis], cubic=False)
        truth = self.comparison.truth[self.above]
        line = np.zeros_like(truth)
        for side in (0, 1):
            at = [column if k != axis else nodes[index[:, side]] for k, column in enumerate(self.x)]
            line += weights[:, side, np.newaxis] * self.continued.at(at)
        scale = np.maximum(truth, self.comparison.floor)
        relative = np.divide(np.abs(line - truth), scale, out=np.zeros_like(line), where=scale > 0.0)
        return float(np.quantile(relative, 0.99, axis=0).max())

    def _nodes_of(self, axis: int, need: Floats, level: float) -> Floats:
        """Return the nodes [degree] of an axis whose cells leave an error of a level."""
        end = self.coarsest.axes[self.names[axis]][-1]
        total = np.append(0.0, np.cumsum(need))
        count = self._count(axis, need, level)
        at = np.interp(np.linspace(0.0, total[-1], count), total, np.linspace(0.0, end, _BINS + 1))
        return np.append(np.round(at[:-1], 4), end)

    def _count(self, axis: int, need: Floats, level: float) -> int:
        """Return the number of nodes of an axis whose cells leave an error of a level."""
        bin_width = radians(self.coarsest.axes[self.names[axis]][-1]) / _BINS
        return 1 + max(1, math.ceil(float(need.sum()) * bin_width / math.sqrt(8.0 * level)))

    def _need(self, axis: int) -> Floats:
        """Return the root of the second derivative of f_r, relative to f_r, in the bins of an axis [1/rad]."""
        end = float(radians(self.coarsest.axes[self.names[axis]][-1]))
        step = radians(_STEP_DEG)
        middle = np.clip(self.x[axis], step, end - step)
        three = []
        for shift in (-step, 0.0, step):
            at = [column if k != axis else middle + shift for k, column in enumerate(self.x)]
            three.append(self.continued.at(at))
        bent = np.abs(three[0] - 2.0 * three[1] + three[2]) / step**2
        scale = np.maximum(three[1], self.comparison.floor)
        relative = np.max(np.divide(bent, scale, out=np.zeros_like(bent), where=scale > 0.0), axis=1)
        number = np.minimum((self.x[axis] * (_BINS / end)).astype(int), _BINS - 1)
        known = np.full(_BINS, np.nan)
        for index in range(_BINS):
            in_bin = relative[number == index]
            if in_bin.size >= 5:
                known[index] = np.sqrt(np.quantile(in_bin, _QUANTILE))
        there = np.flatnonzero(np.isfinite(known))
        need = np.interp(np.arange(_BINS), there, known[there]) if there.size else np.zeros(_BINS)
        share = np.bincount(number, minlength=_BINS) * (_BINS / number.size)
        need = need * np.sqrt(np.clip(share, _BINS / number.size, 1.0))  # few pairs there: most may be off by more
        padded = np.pad(need, 1, mode="edge")
        need = np.maximum(need, 0.5 * (padded[:-2] + padded[2:]))
        return np.asarray(need + _EASED * need.mean() + 1e-9)

    def grid(self, level: float) -> Grid:
        """Return the grid whose cells leave an error of a level on each axis."""
        return Grid({name: self._nodes_of(axis, self.needs[axis], level) for axis, name in enumerate(self.names)})

    def regular(self, step_deg: float) -> Grid:
        """Return a grid with equal steps on each axis, at most so wide."""
        ends = {name: float(nodes[-1]) for name, nodes in self.coarsest.axes.items()}
        counts = {name: 1 + math.ceil(end / step_deg - 1e-9) for name, end in ends.items()}
        return Grid({name: np.round(np.linspace(0.0, end, counts[name]), 4) for name, end in ends.items()})

    def tried(self, level: float) -> Trial[_DensePlan]:
        """Return the trial of a level."""
        grid = self.grid(level)
        return Trial(level, math.prod(grid.shape), self._p99(grid), max(grid.shape) == 2, self)

    def count(self, level: float) -> int:
        """Return the number of nodes of the grid of a level."""
        return math.prod(self._count(axis, need, level) for axis, need in enumerate(self.needs))

    def _p99(self, grid: Grid) -> float:
        """Return the p99 of a grid from the corners of the cells with the pairs: no other nodes are looked up."""
        cells = [
            weights_of_nodes(radians(nodes), column, cubic=False)
            for nodes, column in zip(grid.axes.values(), self.x, strict=True)
        ]
        total: Floats = np.zeros((self.x.shape[1], len(self.comparison.channels.names)))
        for corner in itertools.product((0, 1), repeat=len(cells)):
            at: list[Floats] = []
            weight = np.ones(total.shape[0])
            for (index, weights), nodes, side in zip(cells, grid.axes.values(), corner, strict=True):
                at.append(radians(nodes)[index[:, side]])
                weight = weight * weights[:, side]
            total = total + weight[:, np.newaxis] * self.continued.at(at)
        values = np.zeros((len(self.above), total.shape[1]))
        values[self.above] = np.maximum(total, 0.0)
        return self.comparison.error_of(lambda _wi, _wr: values).p99


class _Continued(NamedTuple):
    """f_r of a table in channels at coordinates on axes, continued beyond the horizon."""

    table: Table
    channels: Channels
    names: tuple[str, ...]

    def at(self, x: Sequence[Floats]) -> Floats:
        """Return f_r [1/sr], shape (N, C), at coordinates [rad] of shape (N,)."""
        if self.names == ISOTROPIC_AXES:
            return self.channels.values(self.table, unit_vector(x[0], np.zeros(1)), unit_vector(x[1], x[2]))
        if self.names == ANISOTROPIC_AXES:
            return self.channels.values(self.table, unit_vector(x[0], x[1]), unit_vector(x[2], x[3]))
        theta_h, phi_h, theta_d, phi_d = x if len(x) == 4 else (x[0], np.zeros(x[0].shape), x[1], x[2])
        pole = _has_pole(self.table)
        lowest = math.sin(_POLE) if pole else 0.0  # cosine of light and viewer
        theta_h = np.minimum(theta_h, HALF_PI - _POLE if pole else HALF_PI)
        # cos theta_r = along cos theta_d - across sin theta_d, at phi_d or at the other side
        along = np.cos(theta_h)
        across = np.sin(theta_h) * np.abs(np.cos(phi_d))
        largest = np.arccos(np.minimum(lowest / np.maximum(np.hypot(along, across), 1e-12), 1.0))
        largest = np.maximum((largest - np.arctan2(across, along)) * (1.0 - 1e-12), 0.0)
        horizon = np.maximum((HALF_PI - np.arctan2(across, along)) * (1.0 - 1e-12), 0.0)
        nearest = np.where(theta_d > horizon, np.minimum(theta_d, largest), theta_d)
        values = self._half_difference(theta_h, phi_h, nearest, phi_d)
        beyond = np.flatnonzero(theta_d > nearest)
        if beyond.size:
            step = np.minimum(_POLE, 0.5 * largest[beyond])
            before = np.maximum(nearest[beyond] - step, 0.0)
            slope = values[beyond] - self._half_difference(theta_h[beyond], phi_h[beyond], before, phi_d[beyond])
            steps = np.minimum((theta_d[beyond] - nearest[beyond]) / np.maximum(step, 1e-9), _STRAIGHT)
            values[beyond] = np.maximum(values[beyond] + steps[:, np.newaxis] * slope, 0.0)
        return values

    def _half_difference(self, theta_h: Floats, phi_h: Floats, theta_d: Floats, phi_d: Floats) -> Floats:
        """Return f_r [1/sr], shape (N, C), at angles of half and difference vectors above the horizon."""
        pair = vectors_from_half_difference(theta_h, phi_h, theta_d, phi_d)
        for w in pair:
            w[..., 2] = np.maximum(w[..., 2], 0.0)  # rounding at the horizon
        return self.channels.values(self.table, *pair)
