"""Interpolation of a table in Dr.Jit, linear or cubic on each axis: `brdfdb.tables._interpolation`.

Numbers are stored as polynomials cell by cell, so that a few loads of adjacent numbers fetch a whole cell. This takes
up to 64 times the memory. If it is more than a cache holds, the first axes have weights of their nodes instead.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from brdfdb.mitsuba._buffers import Buffer, polynomial, whole
from brdfdb.tables._interpolation import Axes
from brdfdb.tables.grids import Grid

Array = NDArray[np.float64]

_MOST_BUCKETS = 1 << 14
_MOST_NUMBERS = 1 << 21  # of the polynomials of a channel
_ALIKE = 4.0 * np.finfo(np.float32).eps  # of the largest number: an axis whose numbers differ by less is left out
_HERMITE = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [-3, 3, -2, -1], [2, -2, 1, 1]])  # powers of t from f_0, f_1, m_0, m_1
_POLE = 1e-13  # square of the sine of theta_h below which its azimuth has no digits in float32
_LEAST = 1e-30


class CellPlace(NamedTuple):
    """The number of a cell, and the place in it, in [0, 1]."""

    cell: Any
    t: Any


class GridAxis:
    """One axis of a grid.

    `stencil` (cells, 2 or 4) are the numbers of the nodes that count in each cell, and `powers` (cells, 2 or 4, 2 or 4)
    the coefficients of the powers of the place in the cell, of each of these nodes.
    """

    def __init__(self, axes: Axes, number: int) -> None:
        first, count = int(axes.first[number]), int(axes.counts[number])
        rows = slice(first, first + count - 1)
        # Those that buffers hold: no place is before the first one, whatever the precision of the variant
        nodes = axes.nodes[first : first + count].astype(np.float32).astype(np.float64)
        self._low, self._high = float(nodes[0]), float(nodes[-1])
        self._uniform, self._scale = bool(axes.uniform[number]), float(axes.scale[number])
        if axes.width[number] == 4:
            slopes = axes.slopes[rows].reshape(-1, 2, 4)
            ends = np.broadcast_to(np.eye(4)[1:3], slopes.shape)
            self.stencil, self.powers = axes.stencil[rows], _HERMITE @ np.concatenate([ends, slopes], axis=1)
        else:
            self.stencil = axes.stencil[rows, 1:3]
            self.powers = np.broadcast_to([[1.0, 0.0], [-1.0, 1.0]], (count - 1, 2, 2))
        self.cells, self.width = self.stencil.shape
        self._weights, self._nodes = Buffer(np.swapaxes(self.powers, 1, 2)), Buffer(nodes)
        self._numbers = Buffer(self.stencil)
        self._inverse, self._buckets = Buffer(axes.inverse[rows]), self._buckets_of(nodes)

    def _buckets_of(self, nodes: Array) -> Buffer | None:
        """Return rows for equal pieces of the axis, not longer than a cell: a node, 1 / steps around it, its number.

        The node is that within the piece, or else the last one before it.
        """
        if self._uniform:
            return None
        steps = np.diff(nodes)
        pieces = int(np.ceil((self._high - self._low) / steps.min())) + 1
        if pieces > _MOST_BUCKETS:
            return None
        self._scale = pieces / (self._high - self._low)
        ends = self._low + (np.arange(pieces) + 1.0) / self._scale
        number = np.clip(np.searchsorted(nodes, ends, side="left") - 1, 0, self.cells - 1)
        return Buffer(np.stack([nodes[number], 1.0 / steps[np.maximum(number - 1, 0)], 1.0 / steps[number], number], 1))

    def place(self, x: Any) -> CellPlace:
        """Return the cell that holds x; beyond an end of the axis, the end."""
        if self._uniform:
            scaled = (x - self._low) * self._scale
            cell = whole(scaled, self.cells)
            return CellPlace(cell, dr.clip(scaled - cell, 0.0, 1.0))
        inside = dr.clip(x, self._low, self._high)
        if self._buckets is None:
            cell = self._nodes.cell(dr.detach(inside), self.cells)
            return CellPlace(cell, dr.clip((inside - self._nodes.at(cell)) * self._inverse.at(cell), 0.0, 1.0))
        piece = whole((inside - self._low) * self._scale, self._buckets.numbers.size // 4)
        node, before, after, number = self._buckets.row(piece, 4)
        beyond, lower = inside - node, dr.detach(inside) < node
        t = beyond * dr.select(lower, before, after) + dr.select(lower, 1.0, 0.0)
        cell = whole(number - dr.select(lower, 1.0, 0.0), self.cells)
        return CellPlace(cell, dr.clip(t, 0.0, 1.0))

    def nodes_of(self, cell: Any) -> list[Any]:
        """Return the numbers of the nodes that count in a cell."""
        return [mi.UInt32(node) for node in self._numbers.row(cell, self.width)]

    def weights(self, cell: Any, t: Any) -> list[Any]:
        """Return the weights of the nodes that count in a cell."""
        rows = self._weights.row(cell, self.width**2)
        return [polynomial(rows[k * self.width : (k + 1) * self.width], t) for k in range(self.width)]


class GridValues:
    """The numbers of a table as a function of the coordinates on its grid."""

    def __init__(self, axes: Axes, numbers: NDArray[np.float32]) -> None:
        """Take prepared axes, and numbers over them and, last, over channels."""
        self._axes: list[tuple[int, GridAxis]] = []
        alike = _ALIKE * float(np.max(np.abs(numbers)))
        for number in range(axes.counts.size):
            if np.all(np.ptp(numbers, axis=number) <= alike):
                numbers = np.mean(numbers, axis=number, keepdims=True, dtype=np.float64)
            else:
                self._axes.append((number, GridAxis(axes, number)))
        self._shape = tuple(axis.cells + 1 for _, axis in self._axes)
        flat = numbers.reshape(-1, numbers.shape[-1]).T
        self.channels = len(flat)
        self._outer = self._first_whole(int(np.prod(self._shape)))
        self.nodes = [Buffer(channel) for channel in flat]
        self._cells = [Buffer(self._polynomials(channel.astype(np.float64))) for channel in flat]

    def _first_whole(self, size: int) -> int:
        """Return the number of axes that come before those with polynomials."""
        first = len(self._axes)
        while first > 0:
            size *= self._axes[first - 1][1].width
            if size > _MOST_NUMBERS:
                return first
            first -= 1
        return 0

    def _polynomials(self, numbers: Any) -> Any:
        """Return flat coefficients over outer nodes, cells and powers, of flat numbers over nodes."""
        shape = list(self._shape)
        for place in range(self._outer, len(shape)):
            axis = self._axes[place][1]
            at = np.moveaxis(np.arange(int(np.prod(shape))).reshape(shape), place, -1)[..., axis.stencil]
            at = np.repeat(at[..., np.newaxis, :], axis.width, axis=-2)
            weight = np.broadcast_to(axis.powers, at.shape)
            # The cells take the place of the nodes, the powers come last
            at, weight = np.moveaxis(at, -3, place), np.moveaxis(weight, -3, place)
            shape = list(at.shape[:-1])
            numbers = sum(_weighted(numbers, at[..., k], weight[..., k]) for k in range(axis.width))
        return numbers

    def refresh(self) -> None:
        """Compute the polynomials of numbers at nodes that have been changed."""
        for nodes, cells in zip(self.nodes, self._cells, strict=True):
            cells.replace(self._polynomials(nodes.loaded()))

    def __call__(self, coordinates: Sequence[Any]) -> list[Any]:
        """Return the number of each channel."""
        places = [axis.place(coordinates[number]) for number, axis in self._axes]
        outer, inner = self._axes[: self._outer], self._axes[self._outer :]
        shape = (*self._shape[: self._outer], *(axis.cells for _, axis in inner))
        strides = [int(np.prod(shape[k + 1 :])) for k in range(len(shape))]
        ways = []
        for (_, axis), (cell, t), stride in zip(outer, places, strides, strict=False):
            nodes = [node * stride for node in axis.nodes_of(cell)]
            ways.append(list(zip(nodes, axis.weights(cell, t), strict=True)))
        base: Any = mi.UInt32(0)
        for (cell, _), stride in zip(places[self._outer :], strides[self._outer :], strict=True):
            base = base + cell * stride
        widths = [axis.width for _, axis in inner]
        variables = [t for _, t in places[self._outer :]]
        totals: list[Any] = [0.0] * self.channels
        for choice in itertools.product(*ways):
            first, weight = base, 1.0
            for offset, share in choice:
                first, weight = first + offset, weight * share
            for channel, cells in enumerate(self._cells):
                row = cells.row(first, int(np.prod(widths)))
                totals[channel] = totals[channel] + weight * _nested(row, widths, variables)
        return totals


def _nested(row: list[Any], widths: list[int], variables: list[Any]) -> Any:
    """Return the polynomial in several variables, the last one first."""
    for width, variable in zip(reversed(widths), reversed(variables), strict=True):
        row = [polynomial(row[k : k + width], variable) for k in range(0, len(row), width)]
    return row[0]


def _weighted(numbers: Any, at: NDArray[np.int64], weight: Array) -> Any:
    """Return numbers at places `at`, times weights, in NumPy or in Dr.Jit."""
    if isinstance(numbers, np.ndarray):
        return numbers[at.ravel()] * weight.ravel()
    taken = dr.gather(mi.Float, numbers, mi.UInt32(at.ravel().astype(np.uint32)))
    return taken * mi.Float(weight.ravel().astype(np.float32))


# Points on the four grids of tables: `brdfdb.tables._coordinates.points_of_vectors`


def points(grid: Grid, wi: Any, wo: Any) -> list[Any]:
    """Return the coordinates [rad] on the axes of a grid, for directions above the horizon."""
    if grid.half_difference:
        return _half_difference(grid, wi, wo)
    theta_i, theta_r = dr.atan2(_length(wi.x, wi.y), wi.z), dr.atan2(_length(wo.x, wo.y), wo.z)
    if not grid.anisotropic:
        dot, cross = wi.x * wo.x + wi.y * wo.y, wi.x * wo.y - wi.y * wo.x
        return [theta_i, theta_r, dr.abs(dr.atan2(cross, dot))]
    # The azimuth of the light is folded into its part of the turn by the symmetries of the surface
    phi, other = _full_turn(wi.y, wi.x), _full_turn(wo.y, wo.x)
    if grid.copies > 1:
        half = phi >= dr.pi
        phi, other = dr.select(half, phi - dr.pi, phi), dr.select(half, other - dr.pi, other)
    if grid.copies == 4:
        beyond = phi > dr.pi / 2
        phi, other = dr.select(beyond, dr.pi - phi, phi), dr.select(beyond, dr.pi - other, other)
    return [theta_i, phi, theta_r, _folded(other, dr.two_pi)]


def _half_difference(grid: Grid, wi: Any, wo: Any) -> list[Any]:
    h_x, h_y, h_z = wi.x + wo.x, wi.y + wo.y, wi.z + wo.z
    d_x, d_y, d_z = wi.x - wo.x, wi.y - wo.y, wi.z - wo.z
    flat2 = dr.square(h_x) + dr.square(h_y)
    h2 = flat2 + dr.square(h_z)
    # The difference vector along theta_h and along phi_h, both times one number. At the pole phi_h is 0
    pole = flat2 < _POLE * h2
    along = dr.select(pole, d_x, (d_x * h_x + d_y * h_y) * h_z - d_z * flat2)
    across = dr.select(pole, d_y, (d_y * h_x - d_x * h_y) * dr.sqrt(h2))
    theta_h = dr.atan2(dr.sqrt(dr.maximum(flat2, _LEAST)), h_z)
    theta_d = dr.atan2(dr.sqrt(dr.maximum(dr.square(d_x) + dr.square(d_y) + dr.square(d_z), _LEAST)), dr.sqrt(h2))
    if not grid.anisotropic:
        phi_d = dr.atan2(dr.abs(across), dr.abs(along) if grid.reciprocal else along)
        return [theta_h, theta_d, phi_d]
    phi_h = _full_turn(dr.select(pole, 0.0, h_y), dr.select(pole, 1.0, h_x))
    phi_d = _full_turn(across, along)
    if grid.copies > 1:
        phi_h = dr.select(phi_h >= dr.pi, phi_h - dr.pi, phi_h)
    if grid.copies == 4:
        beyond = phi_h > dr.pi / 2
        phi_h, phi_d = dr.select(beyond, dr.pi - phi_h, phi_h), dr.select(beyond, -phi_d, phi_d)
    return [theta_h, phi_h, theta_d, _folded(phi_d, dr.pi if grid.reciprocal else dr.two_pi)]


def _length(x: Any, y: Any) -> Any:
    return dr.sqrt(dr.maximum(dr.square(x) + dr.square(y), _LEAST))


def _full_turn(y: Any, x: Any) -> Any:
    phi = dr.atan2(y, x)
    return dr.select(phi < 0.0, phi + dr.two_pi, phi)


def _folded(phi: Any, period: float) -> Any:
    return phi - dr.floor(phi * (1.0 / period)) * period
