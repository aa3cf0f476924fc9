"""Needs of axes: how many nodes an axis of a table takes for an error, and where they lie."""

from __future__ import annotations

import bisect
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.geometry import radians, unit_vector
from brdfdb.parameters import Floats
from brdfdb.tables import error_measurement, tabulation
from brdfdb.tables._interpolation import weights_of_nodes
from brdfdb.tables.grids import Axis
from brdfdb.tables.layout import Layout
from brdfdb.tables.table import points

_LINES = 100
_POINTS = 145  # points on a line
_COUNTS = (2, 3, 4, 5, 6, 8, 10, 12, 15, 18, 22, 27, 33, 41, 50, 61, 75, 92, 112, 137)  # nodes of an axis
_MOST_NODES = 400  # largest number of nodes of an axis
_SMOOTHED = 9  # points of a line over which the density of nodes is averaged
_PERCENTILE = 99.0  # percentile of the errors on lines
# Smallest difference that shifts nodes: along an axis where numbers hardly change, rounding would decide their places
_LEAST = 1e-10
_EASED = 0.15  # smallest density of nodes on an axis, as a share of the mean density

# Places of the points of a line, s in [0, 1]: (end [degree], power). A power p > 0 crowds points at 0 as s**p, p < 0 at
# the end
LINE = {
    "theta_i": (90.0, -2.0),
    "theta_r": (90.0, -2.0),
    "delta_phi": (180.0, -1.5),
    "phi_i": (180.0, 1.0),
    "phi_r": (360.0, 1.0),
    "theta_h": (90.0, 2.0),
    "theta_d": (90.0, -1.5),
    "phi_h": (180.0, 1.0),
    "phi_d": (90.0, 1.0),
}


class Need:
    """The need of an axis: the density of its nodes, and the interpolation error on lines for each number of nodes."""

    def __init__(self, layout: Layout, axis: int, numbers: Floats, weight: Floats) -> None:
        order = 4 if layout.interpolation.cubic else 2
        count, size, wavelengths = numbers.shape
        self.layout = layout
        self.axis = axis
        self.order = order
        name = layout.grid.names[axis]
        self.x = _points(name, layout.grid.axes[name][-1], np.linspace(0.0, 1.0, size))
        self.rows = np.moveaxis(numbers, 2, 1).reshape(count * wavelengths, size)
        self.weights = np.moveaxis(weight, 2, 1).reshape(count * wavelengths, size)
        self.known: dict[int, tuple[float, float]] = {}  # largest error exceeded, smallest error kept
        self.counted = int(np.count_nonzero(self.weights > 0.0))
        left = np.abs(np.diff(self.rows, order, axis=1)) * self.weights[:, order // 2 : size - order // 2]
        steepest = np.maximum(np.percentile(left, 98, axis=0), _LEAST)
        peak = np.pad(steepest ** (1.0 / order), order // 2, mode="edge")
        smooth = np.convolve(
            np.pad(peak, _SMOOTHED // 2, mode="edge"), np.full(_SMOOTHED, 1.0 / _SMOOTHED), mode="valid"
        )
        density = smooth + _EASED * smooth.mean() + 1e-30
        self.density = density / density.sum()
        # The points of a line that are nodes, for each number of nodes; numbers that would repeat a point are left out
        at = np.round(_LADDER.places(self.density) * (size - 1)).astype(np.int64)
        repeated = np.append(at[1:] <= at[:-1], False)
        repeated[_ENDS - 1] = False  # there the points for the next number begin
        usable = ~np.logical_or.reduceat(repeated, _ENDS - _COUNTS)
        ladder = zip(_COUNTS, _ENDS, usable, strict=True)
        self.points = {count: at[end - count : end] for count, end, is_usable in ladder if is_usable}
        self.counts = [*self.points]

    def left(self, count: int) -> float:
        """Return the error on the lines with a number of nodes: the 99th percentile."""
        error = self._errors(count)[self.weights > 0.0]
        return float(np.percentile(error, _PERCENTILE)) if error.size else 0.0

    def keeps(self, count: int, error: float) -> bool:
        """Return True if the error with a number of nodes is at most `error`.

        Larger errors are counted, which is fast; the percentile is computed only if the count is too close to decide.
        """
        above, kept = self.known.get(count, (-math.inf, math.inf))
        if above < error < kept:
            beyond = np.count_nonzero(self._errors(count) > error)
            rank = math.floor((self.counted - 1) * (_PERCENTILE / 100.0))
            larger = self.counted - 1 - rank  # errors above the one below the percentile
            keeps = beyond < larger if abs(beyond - larger) > 1 else self.left(count) <= error
            self.known[count] = above, kept = (above, error) if keeps else (error, kept)
        return error >= kept

    def count(self, error: float) -> float:
        """Return the smallest number of nodes with at most an error; infinite if more than 400 are needed.

        Numbers beyond the points of a line are extrapolated from the order of the interpolation.
        """
        at = bisect.bisect_left(self.counts, True, key=lambda count: self.keeps(count, error))
        if at < len(self.counts):
            return self.counts[at]
        guessed = math.ceil(self.counts[-1] * (self.left(self.counts[-1]) / error) ** (1.0 / self.order))
        return guessed if guessed <= _MOST_NODES else math.inf

    def _errors(self, count: int) -> Floats:
        """Return the errors on lines that are interpolated between so many of their points."""
        layout = self.layout
        x = self.x
        at = self.points[count]
        index, weight = weights_of_nodes(x[at], x, layout.grid.ends[self.axis], cubic=layout.interpolation.cubic)
        matrix = np.zeros((x.size, at.size))
        for column, share in zip(index.T, weight.T, strict=True):
            matrix[np.arange(x.size), column] += share
        error = self.rows[:, at] @ matrix.T
        error -= self.rows
        return np.multiply(np.abs(error, out=error), self.weights, out=error)

    def more(self, count: float, steps: int) -> float:
        """Return the number of nodes that is some steps of the ladder above a number; infinite above 400."""
        for _ in range(steps):
            larger = [n for n in _COUNTS if n > count]
            count = larger[0] if larger else math.ceil(count * _COUNTS[-1] / _COUNTS[-2])
        return count if count <= _MOST_NODES else math.inf

    def nodes(self, count: int) -> Axis:
        """Return so many nodes of the axis [degree], spread by the density."""
        grid = self.layout.grid
        name = grid.names[self.axis]
        end = grid.axes[name][-1]
        return np.append(np.round(_points(name, end, Quantiles.of(count).places(self.density))[:-1], 4), end)


def _points(name: str, end: float, s: Floats) -> Axis:
    """Return the place on an axis [degree] of the point s of a line, in [0, 1]."""
    power = LINE[name][1]
    return np.asarray(end * (s**power if power > 0.0 else 1.0 - (1.0 - s) ** -power), dtype=np.float64)


def _quotient(above: Floats, below: Floats) -> Floats:
    """Return a quotient, and 0 where a surface that is black at a wavelength makes it one by 0."""
    shape = np.broadcast_shapes(np.shape(above), below.shape)
    return np.divide(above, below, out=np.zeros(shape), where=np.broadcast_to(below > 0.0, shape))


class Lines(NamedTuple):
    """f_r along lines of one axis through directions of a draw, the same for all interpolations.

    `values` are f_r [1/sr] of the shape (lines, points, L) with the product of cosines. `before` are the values a step
    before the horizon as of `tabulation.evaluated_to_horizon`, only on grids of half and difference vectors. `lowest`
    is the lower of the cosines of light and viewer, `mu` their product; both are negative below the horizon.
    """

    values: tabulation.NumberFactors
    before: tuple[tabulation.NumberFactors, tabulation.Beyond] | None
    lowest: Floats
    mu: Floats


def lines(layout: Layout, axis: int, drawn: error_measurement.RandomPairs) -> Lines:
    """Evaluate a source along lines of one axis of a layout through directions of a draw."""
    grid = layout.grid
    above = np.flatnonzero(drawn.above)
    chosen = above[:: max(1, above.size // _LINES)][:_LINES]
    wi = drawn.wi[chosen]
    wr = drawn.wr[chosen]
    x = points(grid, wi, wr)
    name = grid.names[axis]
    coordinates = [column[:, np.newaxis] for column in x]
    coordinates[axis] = radians(_points(name, grid.axes[name][-1], np.linspace(0.0, 1.0, _POINTS)))
    if grid.half_difference:
        theta_h, *others = coordinates
        phi_h, theta_d, phi_d = others if grid.anisotropic else (np.zeros(()), *others)
        values, before = tabulation.evaluated_to_horizon(layout, theta_h, phi_h, theta_d, phi_d, tabulation.factors)
        cos_h = np.cos(theta_h) * np.cos(theta_d)
        sin_h = np.sin(theta_h) * np.sin(theta_d) * np.cos(phi_d)
        return Lines(values, before, cos_h - np.abs(sin_h), (cos_h + sin_h) * (cos_h - sin_h))
    theta_i, *others = coordinates
    phi_i, theta_r, phi_r = others if grid.anisotropic else (np.zeros(()), *others)
    at = tabulation.factors(layout, unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r))
    cos_i = np.cos(theta_i)
    cos_r = np.cos(theta_r)
    return Lines(at, None, np.minimum(cos_i, cos_r), cos_i * cos_r)


class LineNumbers(NamedTuple):
    """The numbers of a layout along lines of one axis, and what an error in them makes of f_r.

    Both have the shape (lines, points, L). `weight` is the error of f_r that an error of one makes, relative to f_r or
    to its floor [1/sr]; it is 0 below the horizon. Of a mixture, there are parts in place of wavelengths.
    """

    numbers: Floats
    weight: Floats


def numbers_along(layout: Layout, along: Lines, floor: Floats) -> LineNumbers:
    """Return the numbers of a layout along lines of one axis, for errors relative to a floor [1/sr]."""
    how = layout.interpolation
    before = None if along.before is None else (how.numbers(*along.before[0]), along.before[1])
    numbers = tabulation.extended(layout.source, how.numbers(*along.values), before)
    factor = np.maximum(along.mu, 1e-12)[..., np.newaxis] ** -how.power
    uniform = 0.0 if layout.uniform is None else layout.uniform
    if how.logarithm:
        shifted = np.exp(numbers)
        f_r = (shifted - how.offset) * factor
        slope = shifted * factor
    else:
        f_r = numbers * factor
        slope = factor
    if layout.part_nm is None or layout.spectra is None:
        share = _quotient(slope, np.maximum(f_r + uniform, floor))
    else:  # of a part at the wavelength where its error counts most
        mixed = np.maximum(f_r @ layout.spectra + uniform, floor)
        counts = [np.max(_quotient(np.abs(row), mixed), axis=-1) for row in layout.spectra]
        share = slope * np.stack(counts, axis=-1)
    weight = np.where((along.lowest > 1e-3)[..., np.newaxis], share, 0.0)
    return LineNumbers(numbers, weight)


class Quantiles(NamedTuple):
    """Quantiles of a density of nodes: the number of each, and the number of the last of the same axis."""

    number: Floats
    last: Floats

    @classmethod
    def of(cls, *counts: int) -> Quantiles:
        """Return those of axes with so many nodes, one axis after the other."""
        number = [np.arange(float(count)) for count in counts]
        return cls(np.concatenate(number), np.repeat(np.array(counts) - 1.0, counts))

    def places(self, density: Floats) -> Floats:
        """Return places s in [0, 1] between which the density of nodes has equal integrals."""
        steps = 0.5 * (density[1:] + density[:-1])
        total = np.concatenate([[0.0], np.cumsum(steps)])
        at = np.where(self.number == self.last, total[-1], self.number * (total[-1] / self.last))
        return np.asarray(np.interp(at, total, np.linspace(0.0, 1.0, density.size)))


_LADDER = Quantiles.of(*_COUNTS)
_ENDS: NDArray[np.int64] = np.cumsum(_COUNTS)
