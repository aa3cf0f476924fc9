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
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.formats._angles import HalfDifference, System
from brdfdb.formats._interface import Option
from brdfdb.formats._nodes import weighted
from brdfdb.parameters import Floats

if TYPE_CHECKING:
    from brdfdb.formats._stated_error import Comparison, FileError
    from brdfdb.tables.table import Table

_AT_ONCE = 1 << 22  # values that are interpolated, or looked up, at a time
_FIRST = 8  # intervals of each axis before any is halved
_HALVINGS = 14
_FEWEST = 40  # pairs in an interval that is halved: of fewer, the percentile says nothing
# Smallest error of an interval, as a share of the target: of the first ones, and of those that were halved
_LEAST, _LEAST_OF_HALVES = 1 / 64, 1 / 4
_MOST = 0.97  # share of the pairs of an interval that its error stands for
_BALANCES = 2
_EVERY = 2  # of the pairs, one of so many chooses the nodes
_DECIMALS = 5  # of nodes in degrees, so that text holds them
_SEARCHES = 8
_SAME = 1e-3  # largest p99 between a table and its image under a symmetry
_NEAR = 0.85  # a grid whose error is above this share of the tolerance is small enough
_SAMPLE = 20_000  # nodes of the grid that the size of a node in the file is taken from
_SHRUNK = 0.99  # share of the nodes that should fit, when a file was too large

SIZE = Option(
    "size",
    16.0,
    "largest file [MB]: a table that needs more is written with the error it has",
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
    """Values on a grid of angles, interpolated linearly over each.

    Attributes
    ----------
    system : System
        The angles.
    nodes : tuple of array (n,) [rad]
        Nodes of each angle, strictly increasing. One node means that the value does not depend on the angle.
    values : float32 array (n, ..., C) [1/sr]
        f_r at the nodes: an axis for each angle, and last the channels.
    """

    system: System
    nodes: tuple[Floats, ...]
    values: NDArray[np.float32]

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
            some = slice(start, start + step)
            values[some] = self._interpolated(self.system.angles(wi[some], wr[some]))
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


def filled(table: Table, comparison: Comparison, system: System, nodes: Sequence[Floats]) -> AngularGrid:
    """Return a grid with f_r of a table, in the channels of the comparison, at nodes [rad] of each angle."""
    shape = tuple(axis.size for axis in nodes)
    count, channels = math.prod(shape), len(comparison.channels.names)
    values = np.empty((count, channels), np.float32)
    step = max(1, _AT_ONCE // channels)
    for start in range(0, count, step):
        some = np.arange(start, min(start + step, count))
        index = np.unravel_index(some, shape)
        angles = np.stack([axis[at] for axis, at in zip(nodes, index, strict=True)], axis=1)
        values[some] = comparison.channels.values(table, *system.directions(angles))
    return AngularGrid(system, tuple(nodes), values.reshape(*shape, channels))


class Plan:
    """Densities of nodes on each angle of a system, from which grids of any tolerance are made.

    Each angle is taken alone: the value of a pair is compared with the line between the values at both nodes beside it,
    where its other angles stay the same. Intervals with errors above `target` are halved.

    Parameters
    ----------
    table : Table
        Table that is exported.
    comparison : Comparison
        Pairs of directions, and the channels.
    system : System
        The angles.
    target : float [1]
        Error over each interval.
    """

    def __init__(self, table: Table, comparison: Comparison, system: System, target: float) -> None:
        above = np.flatnonzero(comparison.wr[:, 2] > 0.0)[::_EVERY]
        self.system = system
        self.table, self._comparison, self._target = table, comparison, target
        self._truth = comparison.truth[above]
        self._angles = system.angles(comparison.wi[above], comparison.wr[above])
        scale = np.maximum(self._truth, comparison.floor)
        self._scale = np.where(scale > 0.0, scale, 1.0)
        self._shares = np.ones(len(system.ends))
        self._lines = [self._halved(axis, end, target) for axis, end in enumerate(system.ends)]
        for _ in range(_BALANCES):
            self._balance(self.nodes(target))

    def nodes(self, target: float) -> tuple[Floats, ...]:
        """Return nodes [rad] of each angle, between which linear interpolation is wrong by about `target`."""
        axes = []
        for (edges, errors), share in zip(self._lines, self._shares, strict=True):
            # the error is proportional to the square of a step
            steps = np.append(0.0, np.cumsum(np.sqrt(errors * share / target)))
            count = max(1, math.ceil(steps[-1] - 1e-9))
            nodes = np.interp(np.linspace(0.0, steps[-1], count + 1), steps, edges)
            axes.append(np.deg2rad(np.unique(np.round(np.rad2deg(nodes), _DECIMALS))))
        return tuple(axes)

    def count(self, target: float) -> int:
        """Return the number of nodes of the grid of a target."""
        return math.prod(axis.size for axis in self.nodes(target))

    def finest(self, most: int) -> float:
        """Return the smallest target whose grid has no more than `most` nodes."""
        low, high = 1e-9, 1e6
        for _ in range(60):
            middle = math.sqrt(low * high)
            low, high = (low, middle) if self.count(middle) <= most else (middle, high)
        return high

    def steeper(self) -> Plan:
        """Return the plan with directions of nodes that come closer to the horizon."""
        return Plan(self.table, self._comparison, self.system.steeper(), self._target)

    def grid(self, target: float, written: Callable[[AngularGrid], AngularGrid]) -> tuple[AngularGrid, FileError]:
        """Return the grid of a target as a file holds it, and its error."""
        grid = written(filled(self.table, self._comparison, self.system, self.nodes(target)))
        return grid, self._comparison.error_of(grid.evaluate)

    def _balance(self, nodes: Sequence[Floats]) -> None:
        """Shift nodes between the angles, so that each is wrong by the same: then their product is the smallest."""
        every = np.arange(len(self._angles))
        wrong = np.empty(len(nodes))
        for axis, line in enumerate(nodes):
            below = np.clip(np.searchsorted(line, self._angles[:, axis], side="right") - 1, 0, line.size - 2)
            errors = self._wrong(every, axis, line[below], line[below + 1])
            wrong[axis] = np.partition(errors, int(0.99 * errors.size))[int(0.99 * errors.size)]
        wrong = np.maximum(wrong, 1e-3 * wrong.max()) + 1e-12
        self._shares *= np.clip(wrong / np.exp(np.log(wrong).mean()), 1 / 4, 4.0)

    def _wrong(self, some: NDArray[np.intp], axis: int, low: Floats, high: Floats) -> Floats:
        """Return relative errors of the lines of one angle at some pairs, between `low` and `high` [rad]."""
        share = ((self._angles[some, axis] - low) / (high - low))[:, np.newaxis]
        line = (1.0 - share) * self._values(some, axis, low) + share * self._values(some, axis, high)
        return np.asarray((np.abs(line - self._truth[some]) / self._scale[some]).max(axis=1))

    def _values(self, some: NDArray[np.intp], axis: int, at: Floats) -> Floats:
        moved = self._angles[some].copy()
        moved[:, axis] = at
        return self._comparison.channels.values(self.table, *self.system.directions(moved))

    def _halved(self, axis: int, end: float, target: float) -> tuple[Floats, Floats]:
        """Return edges [rad] of intervals from 0 to `end`, and the error over each, by halving."""
        angle = self._angles[:, axis]
        edges = np.linspace(0.0, end, _FIRST + 1)
        errors = np.full(_FIRST, np.nan)
        for _ in range(_HALVINGS):
            interval = np.clip(np.searchsorted(edges, angle, side="right") - 1, 0, len(errors) - 1)
            some = np.flatnonzero(np.isnan(errors)[interval])
            measured = self._wrong(some, axis, edges[interval[some]], edges[interval[some] + 1])
            counts = np.bincount(interval[some], minlength=len(errors))
            order = np.lexsort((measured, interval[some]))
            first = np.append(0, np.cumsum(counts))[:-1]
            for number in np.flatnonzero(np.isnan(errors)):
                in_order = measured[order[first[number] : first[number] + counts[number]]]
                errors[number] = in_order[int(_MOST * len(in_order))] if len(in_order) else 0.0
            split = (errors > target) & (counts >= _FEWEST)
            if not split.any():
                break
            middle = (edges[:-1] + edges[1:])[split] / 2.0
            errors = np.repeat(np.where(split, np.nan, errors), np.where(split, 2, 1))
            edges = np.sort(np.concatenate([edges, middle]))
        return _graded(edges, np.nan_to_num(errors, nan=target), target)


def _graded(edges: Floats, errors: Floats, target: float) -> tuple[Floats, Floats]:
    """Return intervals none of which is more than twice as long as the next, with errors that are never 0.

    Else a node beside a kink could be the end of a long straight line, which would miss the kink.
    """
    longest = (edges[-1] - edges[0]) / _FIRST
    while True:
        widths = np.diff(edges)
        beside = np.minimum(np.append(widths[1:], np.inf), np.append(np.inf, widths[:-1]))
        split = widths > 2.01 * beside
        if not split.any():
            break
        errors = np.repeat(np.where(split, errors / 4.0, errors), np.where(split, 2, 1))
        edges = np.sort(np.concatenate([edges, (edges[:-1] + edges[1:])[split] / 2.0]))
    least = np.where(np.diff(edges) < 0.99 * longest, _LEAST_OF_HALVES, _LEAST)
    return edges, np.maximum(errors, least * target)


def chosen(
    table: Table,
    comparison: Comparison,
    systems: Sequence[System],
    tolerance: float,
    size: float,
    write: Callable[[Sink, AngularGrid, FileError], None],
    written: Callable[[AngularGrid], AngularGrid] = lambda grid: grid,
) -> tuple[AngularGrid, FileError]:
    """Return the smallest grid within a tolerance, and its error; if there is none, that of the smallest error.

    Parameters
    ----------
    table : Table
        Table that is exported.
    comparison : Comparison
        Pairs of directions, and the channels.
    systems : sequence of System
        Systems of angles among which the one with the fewest nodes is taken.
    tolerance : float [1]
        Largest p99.
    size : float [MB]
        Largest size of the file.
    write : callable
        ``write(sink, grid, error)`` writes the file, from whose bytes its size is known.
    written : callable
        Gives the grid as the file holds it, with its rounded numbers.

    Raises
    ------
    ParameterError
        If the file of a grid with two nodes an angle is larger.
    """

    def size_of(grid: AngularGrid, error: FileError) -> int:
        counter = _Counter()
        write(counter, grid, error)
        return counter.nbytes

    plans = [Plan(table, comparison, system, tolerance / 2.0) for system in systems]
    plan = min(plans, key=lambda some: some.count(tolerance / 2.0))
    grid, error = _fitting(plan, tolerance, 1e6 * size, size_of, written)
    if error.p99 > tolerance:
        other = _fitting(plan.steeper(), tolerance, 1e6 * size, size_of, written)
        grid, error = min((grid, error), other, key=lambda some: _rank(some[0], some[1], tolerance))
    return grid, error


def _fitting(
    plan: Plan,
    tolerance: float,
    most_bytes: float,
    size_of: Callable[[AngularGrid, FileError], int],
    written: Callable[[AngularGrid], AngularGrid],
) -> tuple[AngularGrid, FileError]:
    """Return the smallest grid of a plan within a tolerance, or that of the smallest error, whose file is small enough.

    The size of a file is known only when its numbers are: the number of nodes is reduced until it is small enough.
    """
    grid, error = plan.grid(plan.finest(_SAMPLE), written)
    most = int(grid.count * most_bytes / size_of(grid, error))
    while True:
        grid, error = _smallest(plan, tolerance, most, written)
        nbytes = size_of(grid, error)
        if nbytes <= most_bytes:
            return grid, error
        if max(grid.values.shape[:-1]) <= 2:
            name, mega = plan.table.name, nbytes / 1e6
            raise ParameterError(
                SIZE.name, f"{most_bytes / 1e6:g} MB are too few: the smallest file of {name} has {mega:.3g} MB", most
            )
        most = min(grid.count - 1, int(_SHRUNK * grid.count * most_bytes / nbytes))


def _smallest(
    plan: Plan, tolerance: float, most: int, written: Callable[[AngularGrid], AngularGrid]
) -> tuple[AngularGrid, FileError]:
    """Return the smallest grid of a plan within a tolerance, or that of the smallest error, and its error."""
    finest = plan.finest(most)
    target = max(tolerance / 2.0, finest)
    best: tuple[AngularGrid, FileError] | None = None
    within, beyond = 0.0, math.inf  # targets whose grids are, and are not, within the tolerance
    for _ in range(_SEARCHES):
        grid, error = plan.grid(target, written)
        if best is None or _rank(grid, error, tolerance) < _rank(*best, tolerance):
            best = grid, error
        if error.p99 <= tolerance:
            within = max(within, target)
        else:
            beyond = min(beyond, target)
        if _NEAR * tolerance <= error.p99 <= tolerance or beyond == finest or within > 0.8 * beyond:
            break
        if within > 0.0 and beyond < math.inf:
            target = math.sqrt(within * beyond)
        else:
            target *= float(np.clip(0.9 * tolerance / max(error.p99, 1e-9), 0.1, 8.0))
        target = max(target, finest)
    assert best is not None
    return best


def _rank(grid: AngularGrid, error: FileError, tolerance: float) -> tuple[bool, float]:
    beyond = error.p99 > tolerance
    return beyond, error.p99 if beyond else grid.values.size


def reciprocal(table: Table, comparison: Comparison) -> bool:
    """Return True if a table is the same when light and viewer are exchanged, but for rounding."""
    values = comparison.channels.values
    return _same(comparison, lambda wi, wr: np.where(wr[:, 2:] > 0.0, values(table, _above(wr), wi), 0.0))


def mirrored(table: Table, comparison: Comparison) -> bool:
    """Return True if a table is the same when light and viewer are mirrored at the plane of half vector and normal."""
    values = comparison.channels.values
    system = HalfDifference(anisotropic=True, mirrored=False, reciprocal=False)

    def turned(wi: Floats, wr: Floats) -> Floats:
        above = wr[:, 2] > 0.0
        angles = system.angles(wi, _above(wr)) * np.array([1.0, 1.0, 1.0, -1.0])
        return np.where(above[:, np.newaxis], values(table, *system.directions(angles)), 0.0)

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
