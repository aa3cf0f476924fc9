"""Interpolation of a table in Dr.Jit, linear or cubic on each axis: `brdfdb.tables._interpolation`."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from brdfdb.mitsuba._buffers import Buffer
from brdfdb.tables._interpolation import Axes


class _Axis:
    """One axis: the cell of a point, the numbers of the nodes that count, and their weights."""

    def __init__(self, axes: Axes, number: int) -> None:
        first, count = int(axes.first[number]), int(axes.counts[number])
        rows = slice(first, first + count)
        nodes = axes.nodes[rows]
        self.last = count - 2
        self.low, self.high = float(nodes[0]), float(nodes[-1])
        self.scale = float(axes.scale[number])
        self.uniform = bool(axes.uniform[number])
        self.cubic = bool(axes.width[number] == 4)
        # Nodes in an order in which those that count in a cell follow one another
        stencil = axes.stencil[rows]
        self.order = np.append(stencil[:-1, 0], stencil[-2, 1:]) if self.cubic else np.arange(count)
        begin = int(axes.bucket_first[number])
        end = int(axes.bucket_first[number + 1]) if number + 1 < axes.counts.size else axes.bucket.size
        self._bucket = Buffer(axes.bucket[begin:end])
        # Cells that begin in one bucket, at most: so many steps may follow the first guess
        self._steps = 0 if self.uniform else int(np.max(np.bincount(((nodes - self.low) * self.scale).astype(int))))
        self._nodes, self._inverse = Buffer(nodes), Buffer(axes.inverse[rows])
        self._slopes = Buffer(axes.slopes[rows])

    def place(self, x: Any) -> tuple[Any, list[Any]]:
        """Return the number of the first node that counts, in the order above, and the weights of all that count."""
        if self.uniform:
            scaled = (x - self.low) * self.scale
            cell = dr.floor(dr.clip(dr.detach(scaled), 0.0, float(self.last)))
            t = dr.clip(scaled - cell, 0.0, 1.0)
        else:
            inside = dr.clip(x, self.low, self.high)
            cell = self._bucket.at(dr.floor((dr.detach(inside) - self.low) * self.scale))
            for _ in range(self._steps):
                cell = dr.select(
                    (cell < self.last) & (dr.detach(inside) > self._nodes.at(cell + 1.0)), cell + 1.0, cell
                )
            t = dr.clip((inside - self._nodes.at(cell)) * self._inverse.at(cell), 0.0, 1.0)
        if not self.cubic:
            return mi.UInt32(cell), [1.0 - t, t]
        begin, end = self._slopes.four(cell * 8.0), self._slopes.four(cell * 8.0 + 4.0)
        t2, rest = dr.square(t), 1.0 - t
        rise, m_0, m_1 = t2 * (3.0 - 2.0 * t), t * dr.square(rest), t2 * (t - 1.0)
        weights = [m_0 * a + m_1 * b for a, b in zip(begin, end, strict=True)]
        return mi.UInt32(cell), [weights[0], weights[1] + (1.0 - rise), weights[2] + rise, weights[3]]


class GridValues:
    """The numbers of a table as a function of the coordinates on its grid."""

    def __init__(self, axes: Axes, numbers: NDArray[np.float32]) -> None:
        """Take prepared axes, and numbers over them and, last, over channels."""
        self._axes = [_Axis(axes, number) for number in range(axes.counts.size)]
        ordered = numbers[np.ix_(*(axis.order for axis in self._axes), np.arange(numbers.shape[-1]))]
        self.channels = numbers.shape[-1]
        sizes = ordered.shape[:-1]
        self._strides = [int(np.prod(sizes[k + 1 :])) for k in range(len(sizes))]
        self.buffers = [Buffer(ordered[..., channel]) for channel in range(self.channels)]

    def __call__(self, coordinates: Sequence[Any]) -> list[Any]:
        """Return the number of each channel."""
        places = [axis.place(x) for axis, x in zip(self._axes, coordinates, strict=True)]
        *outer, (cell, inner) = places
        totals: list[Any] = [0.0] * self.channels
        for choice in itertools.product(*(range(len(weights)) for _, weights in outer)):
            first, weight = cell, 1.0
            for number, (node, (begin, weights)) in enumerate(zip(choice, outer, strict=True)):
                first = first + (begin + node) * self._strides[number]
                weight = weight * weights[node]
            for channel, buffer in enumerate(self.buffers):
                numbers = buffer.four(first) if len(inner) == 4 else [buffer.at(first), buffer.at(first + 1)]
                line = sum((w * value for w, value in zip(inner[1:], numbers[1:], strict=True)), inner[0] * numbers[0])
                totals[channel] = totals[channel] + weight * line
        return totals
