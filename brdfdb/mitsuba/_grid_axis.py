"""One axis of a table in Dr.Jit: the cell of a point, and what interpolation makes of the nodes around it."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from brdfdb.mitsuba._buffers import Buffer, polynomial, whole
from brdfdb.tables._interpolation import Axes

Array = NDArray[np.float64]

_MOST_BUCKETS = 1 << 14
_HERMITE = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [-3, 3, -2, -1], [2, -2, 1, 1]])  # powers of t from f_0, f_1, m_0, m_1


class GridAxis:
    """One axis of a grid.

    Attributes
    ----------
    stencil : array (cells, 2 or 4)
        The numbers of the nodes that count in each cell.
    powers : array (cells, 2 or 4, 2 or 4)
        Coefficients of the powers of the place in the cell, of each of these nodes.
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
        """Return rows for equal pieces of the axis, none longer than a cell: a node, 1 / steps beside it, its number.

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

    def place(self, x: Any) -> tuple[Any, Any]:
        """Return the number of the cell, and the place in it in [0, 1]. Beyond the ends, the ends."""
        if self._uniform:
            scaled = (x - self._low) * self._scale
            cell = whole(scaled, self.cells)
            return cell, dr.clip(scaled - cell, 0.0, 1.0)
        inside = dr.clip(x, self._low, self._high)
        if self._buckets is None:
            cell = self._nodes.cell(dr.detach(inside), self.cells)
            return cell, dr.clip((inside - self._nodes.at(cell)) * self._inverse.at(cell), 0.0, 1.0)
        piece = whole((inside - self._low) * self._scale, self._buckets.numbers.size // 4)
        node, before, after, number = self._buckets.row(piece, 4)
        beyond, lower = inside - node, dr.detach(inside) < node
        t = beyond * dr.select(lower, before, after) + dr.select(lower, 1.0, 0.0)
        return whole(number - dr.select(lower, 1.0, 0.0), self.cells), dr.clip(t, 0.0, 1.0)

    def nodes_of(self, cell: Any) -> list[Any]:
        """Return the numbers of the nodes that count in a cell."""
        return [mi.UInt32(node) for node in self._numbers.row(cell, self.width)]

    def weights(self, cell: Any, t: Any) -> list[Any]:
        """Return the weights of the nodes that count in a cell."""
        rows = self._weights.row(cell, self.width**2)
        return [polynomial(rows[k * self.width : (k + 1) * self.width], t) for k in range(self.width)]
