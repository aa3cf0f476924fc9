"""Grids of angles with linear interpolation, and the choice of their nodes: the fewest within a tolerance.

Formats of measurement programs list the nodes of each angle and a value at each combination of them. Their readers
interpolate linearly over each angle. Nodes need not be uniform: `chosen` places them where f_r curves.

`_dense_grid` chooses the nodes of tables by second derivatives. It takes fewer values for spectra on half and
difference vectors, and for light and viewer. It knows no angles about the specular direction, which are the best ones
of some formats here, and no lines that continue beyond the last node. Halving intervals works for all of them.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.formats._angles import HalfDifference, System
from brdfdb.formats._interface import FormatOption
from brdfdb.formats._node_search import Pace, Trial, finest, smallest, unevenness
from brdfdb.formats._nodes import weighted
from brdfdb.parameters import Floats

if TYPE_CHECKING:
    from brdfdb.formats._stated_error import Comparison, FileError

_AT_ONCE = 1 << 22  # values that are interpolated, or looked up, at a time
_FIRST = 8  # intervals of each axis before any is halved
_HALVINGS = 14
_FEWEST = 40  # pairs in an interval that is halved: of fewer, the percentile says nothing
# Smallest error of an interval, as a share of the target: of the first ones, and of those that were halved
_LEAST = 1 / 64
_LEAST_OF_HALVES = 1 / 4
_MOST = 0.97  # share of the pairs of an interval that its error stands for
_BALANCES = 2
_EVERY = 2  # of the pairs, one of so many chooses the nodes
_DECIMALS = 5  # of nodes in degrees, so that text holds them
_PACE = Pace(rounds=8, aim=0.9, fastest=8.0, halves=True)
_LEVELS = 1e-9, 1e6  # range of targets
_MOST_UNEVEN = 4.0  # largest ratio of the errors of two angles that is evened out at once
_SAME = 1e-3  # largest p99 between a table and its image under a symmetry
_SAMPLE = 20_000  # nodes of the grid that the size of a node in the file is taken from
_SHRUNK = 0.99  # share of the nodes that should fit, when a file was too large

SIZE = FormatOption(
    "size",
    16.0,
    "largest file [MB]; a table that needs more is written with a larger error, which the file states",
    low=0.1,
    high=1000.0,
    most_served=16.0,
)


class Sink(Protocol):
    """Bytes are written to it: a file, or a counter of bytes."""

    def write(self, data: bytes, /) -> object: ...


class _Counter:
    """The number of bytes that are written to it."""

    def __init__(self) -> None:
        self.nbytes = 0

    def write(self, data: bytes, /) -> None:
        self.nbytes += len(data)


@dataclass(frozen=True, eq=False)
class AngularGrid:
    """Values on a grid of angles, interpolated linearly over each."""

    system: System  #: the angles
    #: Nodes of each angle, strictly increasing, (n,) [rad]. One node means that the value does not depend on the angle.
    nodes: tuple[Floats, ...]
    values: NDArray[np.float32]  #: f_r at the nodes: an axis for each angle, and last the channels, (n, ..., C) [1/sr]

    @property
    def count(self) -> int:
        """The number of nodes."""
        return math.prod(self.values.shape[:-1])

    @functools.cached_property
    def _has_holes(self) -> bool:
        return bool(np.any(np.isnan(self.values)))

    def evaluate(self, wi: Floats, wr: Floats) -> Floats:
        """Return f_r [1/sr], shape (N, C), at unit vectors (N, 3). Lines continue beyond the first and last node.

        A hole, nan, makes all f_r nan that it has a part in.
        """
        channels = self.values.shape[-1]
        values = np.empty((len(wi), channels))
        step = max(1, _AT_ONCE // (channels << len(self.nodes)))
        for start in range(0, len(wi), step):
            pairs = slice(start, start + step)
            values[pairs] = self._interpolated(self.system.angles(wi[pairs], wr[pairs]))
        return values

    def _interpolated(self, angles: Floats) -> Floats:
        flat = self.values.reshape(-1, self.values.shape[-1])
        corners: list[tuple[tuple[NDArray[np.intp], Floats], ...]] = []
        for nodes, angle in zip(self.nodes, angles.T, strict=True):
            below = np.clip(np.searchsorted(nodes, angle, side="right") - 1, 0, max(nodes.size - 2, 0))
            if nodes.size == 1:
                corners.append(((below, np.ones(len(angle))),))
                continue
            share = (angle - nodes[below]) / (nodes[below + 1] - nodes[below])
            corners.append(((below, 1.0 - share), (below + 1, share)))
        total = np.zeros((len(angles), flat.shape[1]))
        for corner in itertools.product(*corners):
            index = np.ravel_multi_index(tuple(at for at, _ in corner), self.values.shape[:-1])
            weight = np.prod([share for _, share in corner], axis=0)
            total += weighted(weight, flat[index]) if self._has_holes else weight[:, np.newaxis] * flat[index]
        return total


class FittedGrid(NamedTuple):
    """A grid as a file holds it, and its error against the table."""

    grid: AngularGrid
    error: FileError


def filled(comparison: Comparison, system: System, nodes: Sequence[Floats]) -> AngularGrid:
    """Return a grid with f_r of the table of a comparison, in its channels, at nodes [rad] of each angle."""
    shape = tuple(axis.size for axis in nodes)
    count = math.prod(shape)
    channels = len(comparison.channels.names)
    values = np.empty((count, channels), np.float32)
    step = max(1, _AT_ONCE // channels)
    for start in range(0, count, step):
        numbers = np.arange(start, min(start + step, count))
        index = np.unravel_index(numbers, shape)
        angles = np.stack([axis[at] for axis, at in zip(nodes, index, strict=True)], axis=1)
        values[numbers] = comparison.channels.values(comparison.table, *system.directions(angles))
    return AngularGrid(system, tuple(nodes), values.reshape(*shape, channels))


class AngularPlan:
    """Densities of nodes on each angle of a system, from which grids of any tolerance are made.

    Each angle is treated separately: the value of a pair is compared with the line between the values at the two nodes
    around it, while its other angles stay the same. Intervals with errors above `target` are halved.

    Parameters
    ----------
    comparison : Comparison
        The table that is exported, pairs of directions, and the channels.
    system : System
        The angles.
    target : float [1]
        Error over each interval.
    """

    def __init__(self, comparison: Comparison, system: System, target: float) -> None:
        above = np.flatnonzero(comparison.wr[:, 2] > 0.0)[::_EVERY]
        self.system = system
        self.comparison = comparison
        self.target = target
        self._truth = comparison.truth[above]
        self._angles = system.angles(comparison.wi[above], comparison.wr[above])
        scale = np.maximum(self._truth, comparison.floor)
        self._scale = np.where(scale > 0.0, scale, 1.0)
        self._shares = np.ones(len(system.ends))
        self._intervals = [self._halved(axis, end) for axis, end in enumerate(system.ends)]
        for _ in range(_BALANCES):
            self._balance(self.nodes(target))

    def nodes(self, target: float) -> tuple[Floats, ...]:
        """Return nodes [rad] of each angle, between which linear interpolation is wrong by about `target`."""
        axes = []
        for intervals, share in zip(self._intervals, self._shares, strict=True):
            # The error is proportional to the square of a step
            steps = np.append(0.0, np.cumsum(np.sqrt(intervals.errors * share / target)))
            count = max(1, math.ceil(steps[-1] - 1e-9))
            nodes = np.interp(np.linspace(0.0, steps[-1], count + 1), steps, intervals.edges)
            axes.append(np.deg2rad(np.unique(np.round(np.rad2deg(nodes), _DECIMALS))))
        return tuple(axes)

    def count(self, target: float) -> int:
        """Return the number of nodes of the grid of a target."""
        return math.prod(axis.size for axis in self.nodes(target))

    def _balance(self, nodes: Sequence[Floats]) -> None:
        """Shift nodes between the angles, so that each is wrong by the same: then their product is the smallest."""
        pairs = np.arange(len(self._angles))
        wrong = np.empty(len(nodes))
        for axis, line in enumerate(nodes):
            below = np.clip(np.searchsorted(line, self._angles[:, axis], side="right") - 1, 0, line.size - 2)
            errors = self._wrong(pairs, axis, line[below], line[below + 1])
            wrong[axis] = np.partition(errors, int(0.99 * errors.size))[int(0.99 * errors.size)]
        self._shares *= unevenness(wrong, _MOST_UNEVEN)

    def _wrong(self, pairs: NDArray[np.intp], axis: int, low: Floats, high: Floats) -> Floats:
        """Return relative errors of the lines of one angle at pairs of directions, between `low` and `high` [rad]."""
        share = ((self._angles[pairs, axis] - low) / (high - low))[:, np.newaxis]
        line = (1.0 - share) * self._values(pairs, axis, low) + share * self._values(pairs, axis, high)
        return np.asarray((np.abs(line - self._truth[pairs]) / self._scale[pairs]).max(axis=1))

    def _values(self, pairs: NDArray[np.intp], axis: int, at: Floats) -> Floats:
        """Return f_r [1/sr] of pairs of directions of which one angle is moved to others [rad]."""
        moved = self._angles[pairs].copy()
        moved[:, axis] = at
        return self.comparison.channels.values(self.comparison.table, *self.system.directions(moved))

    def _halved(self, axis: int, end: float) -> Intervals:
        """Return intervals from 0 to `end` [rad], and the error over each, by halving."""
        angle = self._angles[:, axis]
        edges = np.linspace(0.0, end, _FIRST + 1)
        errors = np.full(_FIRST, np.nan)
        for _ in range(_HALVINGS):
            interval = np.clip(np.searchsorted(edges, angle, side="right") - 1, 0, len(errors) - 1)
            pairs = np.flatnonzero(np.isnan(errors)[interval])
            measured = self._wrong(pairs, axis, edges[interval[pairs]], edges[interval[pairs] + 1])
            counts = np.bincount(interval[pairs], minlength=len(errors))
            order = np.lexsort((measured, interval[pairs]))
            first = np.append(0, np.cumsum(counts))[:-1]
            for number in np.flatnonzero(np.isnan(errors)):
                in_order = measured[order[first[number] : first[number] + counts[number]]]
                errors[number] = in_order[int(_MOST * len(in_order))] if len(in_order) else 0.0
            split = (errors > self.target) & (counts >= _FEWEST)
            if not split.any():
                break
            middle = (edges[:-1] + edges[1:])[split] / 2.0
            errors = np.repeat(np.where(split, np.nan, errors), np.where(split, 2, 1))
            edges = np.sort(np.concatenate([edges, middle]))
        return Intervals(edges, np.nan_to_num(errors, nan=self.target)).graded(self.target)


class Intervals(NamedTuple):
    """Edges [rad] of intervals of an angle, and the error over each."""

    edges: Floats
    errors: Floats

    def graded(self, target: float) -> Intervals:
        """Return intervals none of which is more than twice as long as the next, with errors that are never 0.

        Otherwise a node next to a kink could be the end of a long straight line, which would miss the kink.
        """
        edges = self.edges
        errors = self.errors
        longest = (edges[-1] - edges[0]) / _FIRST
        while True:
            widths = np.diff(edges)
            neighbour = np.minimum(np.append(widths[1:], np.inf), np.append(np.inf, widths[:-1]))
            split = widths > 2.01 * neighbour
            if not split.any():
                break
            errors = np.repeat(np.where(split, errors / 4.0, errors), np.where(split, 2, 1))
            edges = np.sort(np.concatenate([edges, (edges[:-1] + edges[1:])[split] / 2.0]))
        least = np.where(np.diff(edges) < 0.99 * longest, _LEAST_OF_HALVES, _LEAST)
        return Intervals(edges, np.maximum(errors, least * target))


def chosen(
    comparison: Comparison,
    systems: Sequence[System],
    tolerance: float,
    size: float,
    write: Callable[[Sink, AngularGrid, FileError], None],
    *,
    as_text: bool = False,
) -> FittedGrid:
    """Return the smallest grid within a tolerance, of the system with the fewest nodes; else that of the least error.

    Parameters
    ----------
    size : float [MB]
        Largest size of the file.
    write : callable
        ``write(sink, grid, error)`` writes the file, from whose bytes its size is known.
    as_text : bool
        The file holds values with five significant digits.

    Raises
    ------
    ParameterError
        If the file of a grid with two nodes an angle is larger.
    """
    most_bytes = 1e6 * size

    def size_of(fitted: FittedGrid) -> int:
        counter = _Counter()
        write(counter, *fitted)
        return counter.nbytes

    def tried(plan: AngularPlan, target: float) -> Trial[FittedGrid]:
        grid = filled(comparison, plan.system, plan.nodes(target))
        grid = replace(grid, values=rounded(grid.values)) if as_text else grid
        fitted = FittedGrid(grid, comparison.error_of(grid.evaluate))
        return Trial(target, grid.values.size, fitted.error.p99, max(grid.values.shape[:-1]) == 2, fitted)

    def fitting(plan: AngularPlan) -> Trial[FittedGrid]:
        """Return the best trial of a plan whose file is small enough.

        The size of a file is known only when its numbers are: the number of nodes is reduced until it is small enough.
        """
        sample = tried(plan, finest(plan.count, _SAMPLE, *_LEVELS)).grid
        most = int(sample.grid.count * most_bytes / size_of(sample))
        while True:
            least = finest(plan.count, most, *_LEVELS)
            best = smallest(functools.partial(tried, plan), tolerance / 2.0, least, tolerance, _PACE)
            nbytes = size_of(best.grid)
            if nbytes <= most_bytes:
                return best
            grid = best.grid.grid
            if max(grid.values.shape[:-1]) <= 2:
                needed = f"the smallest file of {comparison.table.name} has {nbytes / 1e6:.3g} MB"
                raise ParameterError(SIZE.name, f"{size:g} MB are too few: {needed}", most)
            most = min(grid.count - 1, int(_SHRUNK * grid.count * most_bytes / nbytes))

    plans = [AngularPlan(comparison, system, tolerance / 2.0) for system in systems]
    plan = min(plans, key=lambda plan: plan.count(tolerance / 2.0))
    best = fitting(plan)
    if best.p99 > tolerance:
        steeper = AngularPlan(comparison, plan.system.steeper(), plan.target)
        best = min(best, fitting(steeper), key=lambda trial: trial.rank(tolerance))
    return best.grid


def reciprocal(comparison: Comparison) -> bool:
    """Return True if the table is the same when light and viewer are exchanged, but for rounding."""
    values = functools.partial(comparison.channels.values, comparison.table)
    return _same(comparison, lambda wi, wr: np.where(wr[:, 2:] > 0.0, values(_above(wr), wi), 0.0))


def mirrored(comparison: Comparison) -> bool:
    """Return True if the table is the same when light and viewer are mirrored at the plane of half vector and z."""
    values = functools.partial(comparison.channels.values, comparison.table)
    system = HalfDifference(anisotropic=True, mirrored=False, reciprocal=False)

    def turned(wi: Floats, wr: Floats) -> Floats:
        above = wr[:, 2] > 0.0
        angles = system.angles(wi, _above(wr)) * np.array([1.0, 1.0, 1.0, -1.0])
        return np.where(above[:, np.newaxis], values(*system.directions(angles)), 0.0)

    return _same(comparison, turned)


def _above(w: Floats) -> Floats:
    return np.where(w[:, 2:] > 0.0, w, np.array([0.0, 0.0, 1.0]))


def _same(comparison: Comparison, values: Callable[[Floats, Floats], Floats]) -> bool:
    return comparison.error_of(values).p99 < _SAME


def rounded(values: Floats) -> NDArray[np.float32]:
    """Return values with the five significant digits that text files have."""
    exponent = np.floor(np.log10(np.maximum(np.abs(values), 1e-30)))
    digits = 10.0 ** (4.0 - exponent)
    return (np.round(values * digits) / digits).astype(np.float32)
