"""The warp of RGL's files: densities on the unit square, linear between nodes, and the maps that they stand for.

A density is drawn from by inverting its marginal distribution over y (rows) and then that over x (columns). The inverse
takes a point of the square to uniform numbers, by which RGL's files look up what they store. Dupuy and Jakob (2018),
``dupuy2018``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Mixture:
    """Slices that are mixed for each of M points: their numbers and weights, both of shape (K, M)."""

    numbers: NDArray[np.int64]
    weights: Array

    def of(self, values: Array, *index: NDArray[np.int64]) -> Array:
        """Return the mixture of values (slices, ...) at an index into their other axes."""
        mixed = self.weights[0][..., *[np.newaxis] * (values.ndim - 1 - len(index))] * values[(self.numbers[0], *index)]
        for number, weight in zip(self.numbers[1:], self.weights[1:], strict=True):
            mixed += weight[..., *[np.newaxis] * (values.ndim - 1 - len(index))] * values[(number, *index)]
        return np.asarray(mixed)


def cell(x: Array, size: int) -> tuple[NDArray[np.int64], Array]:
    """Return the cell, of `size` nodes over [0, 1], and the place within it, in [0, 1], of points."""
    scaled = np.clip(x, 0.0, 1.0) * (size - 1)
    index = np.minimum(scaled.astype(np.int64), size - 2)
    return index, scaled - index


class Warp:
    """Densities on the unit square, one a slice, as the readers of RGL's files normalise and integrate them.

    Parameters
    ----------
    values : float32 array (slices, rows, columns)
        Values that each density is proportional to, positive.
    """

    def __init__(self, values: NDArray[np.float32]) -> None:
        exact = values.astype(np.float64)
        self.rows, self.columns = values.shape[1:]
        columns = np.zeros(exact.shape)
        np.cumsum(0.5 * (exact[..., :-1] + exact[..., 1:]), axis=-1, out=columns[..., 1:])
        ends = columns[..., -1]
        rows = np.zeros(ends.shape)
        np.cumsum(0.5 * (ends[:, :-1] + ends[:, 1:]), axis=-1, out=rows[:, 1:])
        scale = 1.0 / rows[:, -1:]
        self._density, self._columns, self._rows = (
            exact * scale[..., np.newaxis],
            columns * scale[..., np.newaxis],
            rows * scale,
        )

    def density(self, mixture: Mixture, x: Array, y: Array) -> Array:
        """Return the density at points (M,) of the unit square."""
        (i, u), (j, v) = cell(x, self.columns), cell(y, self.rows)
        low, high = self._edges(mixture, i, j, v)
        return np.asarray(((1.0 - u) * low + u * high) * (self.rows - 1) * (self.columns - 1))

    def inverse(self, mixture: Mixture, x: Array, y: Array) -> tuple[Array, Array]:
        """Return the uniform numbers that the warp takes to points (M,) of the unit square."""
        (i, u), (j, v) = cell(x, self.columns), cell(y, self.rows)
        low, high = self._edges(mixture, i, j, v)
        last = np.full_like(i, self.columns - 1)
        below = (1.0 - v) * mixture.of(self._columns, j, i) + v * mixture.of(self._columns, j + 1, i)
        row, above = mixture.of(self._columns, j, last), mixture.of(self._columns, j + 1, last)
        whole = (1.0 - v) * row + v * above
        part = below + u * (low + 0.5 * u * (high - low))
        s_x = np.divide(part, whole, out=np.zeros_like(part), where=whole > 0.0)  # no density on the line
        s_y = mixture.of(self._rows, j) + v * (row + 0.5 * v * (above - row))
        return s_x, s_y

    def forward(self, size: int) -> tuple[Array, Array]:
        """Return the points x, y, shape (slices, size, size), that the warps take a grid of uniform numbers to."""
        s = np.linspace(0.0, 1.0, size)
        slices = np.arange(len(self._rows))[:, np.newaxis]
        j = _interval(self._rows, np.broadcast_to(s, (len(slices), size)))
        ends = self._columns[..., -1]
        row, above = ends[slices, j], ends[slices, j + 1]
        v = _root(s - self._rows[slices, j], row, above)
        part = v[..., np.newaxis]
        columns = (1.0 - part) * self._columns[slices, j] + part * self._columns[slices, j + 1]
        density = (1.0 - part) * self._density[slices, j] + part * self._density[slices, j + 1]
        flat, wanted = columns.reshape(-1, self.columns), s * columns[..., -1:].reshape(-1, 1)
        i = _interval(flat, wanted)
        lines = np.arange(len(flat))[:, np.newaxis]
        dense = density.reshape(-1, self.columns)
        u = _root(wanted - flat[lines, i], dense[lines, i], dense[lines, i + 1])
        x = ((i + u) / (self.columns - 1)).reshape(len(slices), size, size)
        y = ((j + v) / (self.rows - 1))[..., np.newaxis]
        return x, np.broadcast_to(y, x.shape)

    def _edges(self, mixture: Mixture, i: NDArray[np.int64], j: NDArray[np.int64], v: Array) -> tuple[Array, Array]:
        """Return the values on the left and on the right edge of cells at the height v."""
        low = (1.0 - v) * mixture.of(self._density, j, i) + v * mixture.of(self._density, j + 1, i)
        high = (1.0 - v) * mixture.of(self._density, j, i + 1) + v * mixture.of(self._density, j + 1, i + 1)
        return low, high


def _interval(nodes: Array, wanted: Array) -> NDArray[np.int64]:
    """Return the interval of each line of ascending nodes (lines, n) that holds wanted numbers (lines, m)."""
    scale = nodes[:, -1:]
    lines = np.arange(len(nodes))[:, np.newaxis] * 2.0
    flat = (nodes / scale + lines).reshape(-1)
    index = np.searchsorted(flat, (wanted / scale + lines).reshape(-1), side="right").reshape(wanted.shape) - 1
    return np.asarray(np.clip(index - np.arange(len(nodes))[:, np.newaxis] * nodes.shape[1], 0, nodes.shape[1] - 2))


def _root(area: Array, low: Array, high: Array) -> Array:
    """Return where the integral of a line from `low` to `high` over [0, 1] is `area`."""
    area = np.maximum(area, 0.0)
    return np.asarray(
        np.minimum(2.0 * area / (low + np.sqrt(np.maximum(low**2 + 2.0 * area * (high - low), 0.0))), 1.0)
    )
