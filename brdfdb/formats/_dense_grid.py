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
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.formats._channels import Channels
from brdfdb.formats._stated_error import Comparison, FileError
from brdfdb.geometry import HALF_PI, radians, unit_vector
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
_LEVEL, _BALANCE = 0.01, 4.0  # error at which the axes are compared, and the largest ratio that is evened out
_ROUNDS, _CLOSE = 9, 0.85  # steps of the search, and the share of the tolerance at which it ends
_LAST_DEG = 89.5  # of light and viewer where f_r has a pole at the horizon
_POLE_DEG, _STRAIGHT = radians(2.0), 7.5  # continuation: the angle from the horizon where it begins, and most steps


@dataclass(frozen=True, eq=False)
class DenseTable:
    """f_r on a grid of angles.

    Attributes
    ----------
    grid : Grid
        Nodes of the axes [degree].
    channels : Channels
        Wavelengths, or "grey".
    values : float32 array (*axes, C) [1/sr]
        f_r at the nodes. On axes of half and difference vectors it is continued in a straight line where light or
        viewer is below the horizon, so that cells at the horizon can be interpolated.
    error : FileError
        Error against the table, with linear interpolation.
    tolerance : float or None [1]
        Largest p99 that was asked for; None of a regular grid.
    """

    grid: Grid
    channels: Channels
    values: NDArray[np.float32]
    error: FileError
    tolerance: float | None = None


def dense_table(
    table: Table,
    tolerance: float,
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
    table : Table
        Table that is exported.
    tolerance : float [1]
        Largest p99 of the error against the table.
    axes : str
        "light_viewer": theta_i, theta_r, delta_phi, or theta_i, phi_i, theta_r, phi_r of anisotropic tables.
        "half_difference": theta_h, theta_d, phi_d, or theta_h, phi_h, theta_d, phi_d. "smallest": those that take fewer
        values.
    resolution : float [degree]
        Distance of the nodes on all axes; 0: as few nodes as the tolerance allows, where f_r bends.
    most_values : int
        Largest number of values. If it allows no grid within the tolerance, the nearest one is returned.
    digits : int
        Significant digits that values are rounded to; 0: float32.
    last_deg : float [degree]
        Last polar angle of light and viewer that the format takes.
    channels : Channels, optional
        The channels of the file, by default those of the table.

    Raises
    ------
    ParameterError
        If a regular grid has more values.
    """
    whole = Comparison(table, channels)
    few = _at_few_wavelengths(table, whole)
    names = _names(table)
    tried = [names[axes]] if axes != "smallest" else list(names.values())
    plans = [_Plan(table, few, some, last_deg) for some in tried]
    if resolution:
        regular = min((plan.regular(resolution) for plan in plans), key=lambda grid: math.prod(grid.shape))
        size = math.prod(regular.shape) * len(whole.channels.names)
        if size > most_values:
            raise ParameterError(
                "resolution", f"{resolution:g} degrees take {size} values; the most are {most_values}", resolution
            )
        return _tabulated(table, whole, regular, digits)
    most_nodes = most_values // len(whole.channels.names)
    chosen = _chosen(plans, tolerance, most_nodes)
    dense, level = _tabulated(table, whole, chosen.plan.grid(chosen.level), digits), chosen.level
    while dense.error.p99 > tolerance >= chosen.p99:  # the other wavelengths need more nodes
        level *= 0.9 * tolerance / dense.error.p99
        grid = chosen.plan.grid(level)
        if math.prod(grid.shape) > most_nodes:
            break
        dense = _tabulated(table, whole, grid, digits)
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
    values = np.empty((*grid.shape, len(channels.names)), np.float32)
    first, *others = (radians(nodes) for nodes in grid.axes.values())
    for row, node in enumerate(first):
        at = np.meshgrid(np.array([node]), *others, indexing="ij")
        values[row] = _values(table, channels, grid.names, [column.reshape(-1) for column in at]).reshape(
            values.shape[1:]
        )
    return values


def _tabulated(table: Table, comparison: Comparison, grid: Grid, digits: int) -> DenseTable:
    values = values_at_nodes(table, comparison.channels, grid)
    if digits:
        values = rounded(values, digits).astype(np.float32)
    reader = interpolated(grid, values, comparison.channels.wavelength_nm)
    count = len(comparison.channels.names)
    error = comparison.error_of(lambda wi, wr: np.asarray(reader.lookup_vectors(wi, wr)).reshape(len(wi), count))
    return DenseTable(grid, comparison.channels, values, error)


def _names(table: Table) -> dict[str, tuple[str, ...]]:
    if table.anisotropic:
        return {"half_difference": ANISOTROPIC_HALF_DIFFERENCE_AXES, "light_viewer": ANISOTROPIC_AXES}
    return {"light_viewer": ISOTROPIC_AXES, "half_difference": HALF_DIFFERENCE_AXES}


def _at_few_wavelengths(table: Table, whole: Comparison) -> Comparison:
    """Return the comparison at some of the wavelengths, with the same pairs of directions."""
    channels = whole.channels
    at = channels.wavelength_nm
    if at is None or at.size <= _WAVELENGTHS:
        return whole
    some = np.unique(np.round(np.linspace(0, at.size - 1, _WAVELENGTHS)).astype(int))
    return Comparison(table, replace(channels, names=tuple(channels.names[i] for i in some), wavelength_nm=at[some]))


def _has_pole(table: Table) -> bool:
    return table.source is None or table.source.grazing_pole


class _Choice(NamedTuple):
    """A grid of a plan: its level, its number of nodes and its p99 at a few wavelengths."""

    plan: _Plan
    level: float
    nodes: int
    p99: float


def _order(choice: _Choice, tolerance: float) -> tuple[float, int]:
    """Return a sorting key: those within the tolerance first, the smallest of them before the others."""
    return max(choice.p99, tolerance), choice.nodes


def _chosen(plans: list[_Plan], tolerance: float, most_nodes: int) -> _Choice:
    """Return the smallest grid of the plans that is within the tolerance, or else the nearest."""
    choices: list[_Choice] = []
    for plan in sorted(plans, key=lambda plan: math.prod(plan.grid(tolerance).shape)):
        choices.append(plan.smallest(tolerance, most_nodes))
        if choices[-1].p99 <= tolerance:
            most_nodes = min(most_nodes, choices[-1].nodes)
    return min(choices, key=lambda choice: _order(choice, tolerance))


class _Plan:
    """The nodes that a table needs on axes of one kind, in proportion to a level of error."""

    def __init__(self, table: Table, comparison: Comparison, names: tuple[str, ...], last_deg: float) -> None:
        self.table, self.comparison, self.names = table, comparison, names
        last_deg = min(last_deg, _LAST_DEG) if _has_pole(table) else last_deg
        ends = {name: _end(table, name, last_deg) for name in names}
        self.coarsest = Grid({name: np.array([0.0, end]) for name, end in ends.items()})
        above = comparison.wr[:, 2] > 0.0
        x = points(self.coarsest, comparison.wi[above], comparison.wr[above])
        self.x = np.minimum(x, np.array([radians(end) for end in ends.values()])[:, np.newaxis])
        self.above = above

    @functools.cached_property
    def needs(self) -> list[Floats]:
        """The root of the second derivative of f_r in the bins of each axis [1/rad]."""
        needs = [self._need(axis) for axis in range(len(self.names))]
        wrong = np.array([self._line_error(axis, need) for axis, need in enumerate(needs)])
        wrong = np.maximum(wrong, 1e-3 * wrong.max()) + 1e-12
        # the grid is the smallest one if the axes are off by the same, and errors grow with the square of a step
        shares = np.sqrt(np.clip(wrong / np.exp(np.log(wrong).mean()), 1.0 / _BALANCE, _BALANCE))
        needs = [need * share for need, share in zip(needs, shares, strict=True)]
        if self.names == ISOTROPIC_AXES:  # reciprocity
            needs[:2] = [np.maximum(needs[0], needs[1])] * 2
        return needs

    def _line_error(self, axis: int, need: Floats) -> float:
        """Return the relative error that 99 of 100 pairs have at most on lines along one axis alone."""
        nodes = radians(self._nodes_of(axis, need, _LEVEL))
        index, weights = weights_of_nodes(nodes, self.x[axis], cubic=False)
        truth = self.comparison.truth[self.above]
        line = np.zeros_like(truth)
        for side in (0, 1):
            at = [column if k != axis else nodes[index[:, side]] for k, column in enumerate(self.x)]
            line += weights[:, side, np.newaxis] * _values(self.table, self.comparison.channels, self.names, at)
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
            three.append(_values(self.table, self.comparison.channels, self.names, at))
        bent = np.abs(three[0] - 2.0 * three[1] + three[2]) / step**2
        scale = np.maximum(three[1], self.comparison.floor)
        relative = np.max(np.divide(bent, scale, out=np.zeros_like(bent), where=scale > 0.0), axis=1)
        number = np.minimum((self.x[axis] * (_BINS / end)).astype(int), _BINS - 1)
        known = np.full(_BINS, np.nan)
        for index in range(_BINS):
            some = relative[number == index]
            if some.size >= 5:
                known[index] = np.sqrt(np.quantile(some, _QUANTILE))
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

    def smallest(self, tolerance: float, most_nodes: int) -> _Choice:
        """Return the largest level whose p99 is within the tolerance, or else the smallest that is not too large."""
        least = self._least(most_nodes)
        level, best = max(tolerance, least), None
        for _ in range(_ROUNDS):
            grid = self.grid(level)
            trial = _Choice(self, level, math.prod(grid.shape), self._p99(grid))
            if best is None or _order(trial, tolerance) < _order(best, tolerance):
                best = trial
            close = _CLOSE * tolerance <= trial.p99 <= tolerance
            if close or (trial.p99 > tolerance and level == least) or (trial.p99 < tolerance and max(grid.shape) == 2):
                break
            level = max(least, level * float(np.clip(0.93 * tolerance / max(trial.p99, 1e-9), 0.1, 5.0)))
        assert best is not None
        return best

    def _least(self, most_nodes: int) -> float:
        """Return the smallest level whose grid has no more than so many nodes."""
        low, high = 1e-8, 1e3
        for _ in range(60):
            middle = math.sqrt(low * high)
            low, high = (low, middle) if self._nodes(middle) <= most_nodes else (middle, high)
        return high

    def _nodes(self, level: float) -> int:
        return math.prod(self._count(axis, need, level) for axis, need in enumerate(self.needs))

    def _p99(self, grid: Grid) -> float:
        """Return the p99 of a grid from the corners of the cells with the pairs: no other nodes are looked up."""
        channels = self.comparison.channels
        cells = [
            weights_of_nodes(radians(nodes), column, cubic=False)
            for nodes, column in zip(grid.axes.values(), self.x, strict=True)
        ]
        total: Floats = np.zeros((self.x.shape[1], len(channels.names)))
        for corner in _corners(len(cells)):
            at: list[Floats] = []
            weight = np.ones(total.shape[0])
            for (index, weights), nodes, side in zip(cells, grid.axes.values(), corner, strict=True):
                at.append(radians(nodes)[index[:, side]])
                weight = weight * weights[:, side]
            total = total + weight[:, np.newaxis] * _values(self.table, channels, self.names, at)
        values = np.zeros((len(self.above), total.shape[1]))
        values[self.above] = np.maximum(total, 0.0)
        return self.comparison.error_of(lambda _wi, _wr: values).p99


def _corners(axes: int) -> Iterator[tuple[int, ...]]:
    return itertools.product((0, 1), repeat=axes)


def _end(table: Table, name: str, last_deg: float) -> float:
    """Return the last node of an axis [degree]."""
    if name in ("theta_i", "theta_r"):
        return last_deg
    if name in ("phi_i", "phi_h"):
        return 360.0 / table.grid.copies
    if name == "phi_d":
        return 180.0 if table.anisotropic else 90.0
    return {"delta_phi": 180.0, "phi_r": 360.0}.get(name, 90.0)


def _values(table: Table, channels: Channels, names: tuple[str, ...], at: list[Floats]) -> Floats:
    """Return f_r [1/sr] at coordinates [rad] of shape (N,), shape (N, C), continued beyond the horizon."""
    if names == ISOTROPIC_AXES:
        return channels.values(table, unit_vector(at[0], np.zeros(1)), unit_vector(at[1], at[2]))
    if names == ANISOTROPIC_AXES:
        return channels.values(table, unit_vector(at[0], at[1]), unit_vector(at[2], at[3]))
    theta_h, phi_h, theta_d, phi_d = at if len(at) == 4 else (at[0], np.zeros(at[0].shape), at[1], at[2])
    pole = _has_pole(table)
    lowest = math.sin(_POLE_DEG) if pole else 0.0  # cosine of light and viewer
    theta_h = np.minimum(theta_h, HALF_PI - _POLE_DEG if pole else HALF_PI)
    # cos theta_r = along cos theta_d - across sin theta_d, at phi_d or at the other side
    along, across = np.cos(theta_h), np.sin(theta_h) * np.abs(np.cos(phi_d))
    largest = np.arccos(np.minimum(lowest / np.maximum(np.hypot(along, across), 1e-12), 1.0))
    largest = np.maximum((largest - np.arctan2(across, along)) * (1.0 - 1e-12), 0.0)
    horizon = np.maximum((HALF_PI - np.arctan2(across, along)) * (1.0 - 1e-12), 0.0)
    held = np.where(theta_d > horizon, np.minimum(theta_d, largest), theta_d)
    values = _half_difference(table, channels, theta_h, phi_h, held, phi_d)
    past = np.flatnonzero(theta_d > held)
    if past.size:
        step = np.minimum(_POLE_DEG, 0.5 * largest[past])
        some = theta_h[past], phi_h[past], np.maximum(held[past] - step, 0.0), phi_d[past]
        slope = values[past] - _half_difference(table, channels, *some)
        share = np.minimum((theta_d[past] - held[past]) / np.maximum(step, 1e-9), _STRAIGHT)
        values[past] = np.maximum(values[past] + share[:, np.newaxis] * slope, 0.0)
    return values


def _half_difference(
    table: Table, channels: Channels, theta_h: Floats, phi_h: Floats, theta_d: Floats, phi_d: Floats
) -> Floats:
    sin_h, cos_h, turned_x, turned_y = np.sin(theta_h), np.cos(theta_h), np.cos(phi_h), np.sin(phi_h)
    across, z = np.sin(theta_d), np.cos(theta_d)
    x, y = across * np.cos(phi_d), across * np.sin(phi_d)
    pair = []
    for sign in (1.0, -1.0):  # the viewer is the light turned by half a turn about the half vector
        along = sign * x * cos_h + z * sin_h
        up = np.maximum(z * cos_h - sign * x * sin_h, 0.0)  # rounding at the horizon
        side = sign * y
        pair.append(np.stack([along * turned_x - side * turned_y, along * turned_y + side * turned_x, up], axis=-1))
    return channels.values(table, *pair)
