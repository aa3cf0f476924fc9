"""Interpolation of a table in Dr.Jit, linear or cubic on each axis: `brdfdb.tables._interpolation`.

Numbers are stored as polynomials cell by cell, so that a few loads of adjacent numbers fetch a whole cell. This takes
up to 64 times the memory. If it is more than a cache holds, the first axes have weights of their nodes instead.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from brdfdb.mitsuba._buffers import Buffer, polynomial
from brdfdb.mitsuba._grid_axis import GridAxis
from brdfdb.tables._interpolation import Axes

Array = NDArray[np.float64]

_MOST_NUMBERS = 1 << 21  # of polynomials of a channel
_ALIKE = (
    4.0 * np.finfo(np.float32).eps
)  # of the largest number: an axis along which numbers differ less counts for none


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
            numbers = sum(_taken(numbers, at[..., k]) * _like(numbers, weight[..., k]) for k in range(axis.width))
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


def _taken(numbers: Any, at: NDArray[np.int64]) -> Any:
    if isinstance(numbers, np.ndarray):
        return numbers[at.ravel()]
    return dr.gather(mi.Float, numbers, mi.UInt32(at.ravel().astype(np.uint32)))


def _like(numbers: Any, weight: Array) -> Any:
    return weight.ravel() if isinstance(numbers, np.ndarray) else mi.Float(weight.ravel().astype(np.float32))
