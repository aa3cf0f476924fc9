"""Growth of tensor trees: cells divide where f_r varies most, until the file is as near to the table as is wanted."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from brdfdb.formats.radiance._tree import ISOTROPIC, Index, Tree, lights, viewers
from brdfdb.parameters import Floats

Evaluate = Callable[[Floats, Floats], Floats]  # f_r (..., C) at unit vectors (..., 3) of light and viewer

_DENSE = {3: 5, 4: 4}  # level by rank down to which all cells are looked at, so that no lobe is missed
_NODE = 0.5 / np.sqrt(3.0)  # distance of the two Gauss-Legendre nodes of an axis from the middle of a cell of length 1
_AT_ONCE = 1 << 16  # cells that are evaluated at a time
_DARK = 0.03  # [1/sr] added to the root of the average in the measure of Radiance's rttree_reduce
# Levels below the root: Radiance samples as many lights as the smallest cell has room for, which takes long, and its
# smallest cell is then 0.45 degrees
_DEEPEST = 8
_ROUND = 0.3  # share of the cells that a round adds: those of a round are chosen at once
_NONE = -1


class Growth:
    """A tree that grows.

    The measure of a cell is that of Radiance's rttree_reduce, (largest - least) / (sqrt(average) + 0.03), times the
    square root of its volume. With that root, fewer cells lead to the same error: it puts them where light is.

    Parameters
    ----------
    evaluate : callable
        f_r [1/sr], shape (..., C), at unit vectors (..., 3) of light and viewer, which broadcast.
    rank : int
        3 or 4.
    channels : int
        C.
    """

    def __init__(self, evaluate: Evaluate, rank: int, channels: int) -> None:
        self.rank = rank
        self._evaluate = evaluate
        self._channels = channels
        self._kin = 1 << rank
        self._bits = (np.arange(self._kin)[:, np.newaxis] >> np.arange(rank)) & 1
        self._plant()
        self._leaves: Index = np.zeros(1, dtype=np.int64)
        self._open = np.zeros(len(self._child), dtype=bool)

    def __len__(self) -> int:
        return len(self._leaves)

    def _plant(self) -> None:
        """Make all nodes down to the dense level: averages and extremes of coarse cells are those of the fine ones."""
        dense = _DENSE[self.rank]
        corners = [np.zeros((1, self.rank), dtype=np.int64)]
        for _ in range(dense):
            corners.append((2 * corners[-1][:, np.newaxis] + self._bits).reshape(-1, self.rank))
        cells = [self._cells(corners[-1], np.full(len(corners[-1]), dense))]
        for _ in range(dense):
            mean, low, high = (part.reshape(-1, self._kin, self._channels) for part in cells[0])
            cells.insert(0, (mean.mean(axis=1), low.min(axis=1), high.max(axis=1)))
        counts = [len(corner) for corner in corners]
        first = np.cumsum([0, *counts])
        inner = [first[level + 1] + self._kin * np.arange(counts[level]) for level in range(dense)]
        self._child = np.concatenate([*inner, np.full(counts[-1], _NONE)])
        self._corner = np.concatenate(corners)
        self._level = np.repeat(np.arange(dense + 1), counts)
        self._mean = np.concatenate([mean for mean, _, _ in cells])
        spread = np.concatenate([high - low for _, low, high in cells])
        self._measure = self._measured(self._mean, spread, self._level)

    def _cells(self, corner: Index, level: Index) -> tuple[Floats, Floats, Floats]:
        """Return average, least and largest value, each (N, C), of cells: two nodes an axis, exact for cubics."""
        mean, low, high = np.zeros((3, len(corner), self._channels))
        offsets = 0.5 + _NODE * (2.0 * self._bits - 1.0)
        # One half of the first axis of rank 3 is not used
        live = np.flatnonzero(corner[:, 0] < 0.5 * 2.0**level) if self.rank == ISOTROPIC else np.arange(len(corner))
        for start in range(0, len(live), _AT_ONCE):
            cells = live[start : start + _AT_ONCE]
            place = (corner[cells, np.newaxis] + offsets) * 0.5 ** level[cells, np.newaxis, np.newaxis]
            # The first bits of a node are those of the light, the last two those of the viewer
            light, viewer = lights(place[:, : self._kin // 4, :-2]), viewers(place[:, :: self._kin // 4, -2:])
            values = self._evaluate(light[:, np.newaxis], viewer[:, :, np.newaxis])
            values = values.reshape(-1, self._kin, self._channels)
            mean[cells], low[cells], high[cells] = values.mean(axis=1), values.min(axis=1), values.max(axis=1)
        return mean, low, high

    def _measured(self, mean: Floats, spread: Floats, level: Index) -> Floats:
        measure = (spread / (np.sqrt(np.maximum(mean, 0.0)) + _DARK)).max(axis=-1) * 0.5 ** (0.5 * self.rank * level)
        return np.asarray(np.where(level < _DEEPEST, measure, 0.0))

    def to(self, cells: float) -> bool:
        """Grow to at least a number of cells, by one division at most beyond; return False if nothing varies."""
        while len(self) < cells:
            wanted = min(cells - len(self), _ROUND * len(self)) / (self._kin - 1)
            if not self._split(max(1, int(wanted))):
                return False
        return True

    def _split(self, count: int) -> bool:
        """Divide the `count` leaves with the largest measure; return False if f_r varies in no leaf."""
        measure = self._measure[self._leaves]
        count = min(count, len(self._leaves))
        chosen = np.argpartition(-measure, count - 1)[:count]
        chosen = chosen[measure[chosen] > 0.0]
        parents = self._leaves[chosen]
        childless = parents[self._child[parents] == _NONE]
        if childless.size:
            self._bear(childless)
        self._open[parents] = True
        children = (self._child[parents][:, np.newaxis] + np.arange(self._kin)).reshape(-1)
        self._leaves = np.concatenate([np.delete(self._leaves, chosen), children])
        return chosen.size > 0

    def _bear(self, parents: Index) -> None:
        """Give children to nodes that have none."""
        corner = (2 * self._corner[parents][:, np.newaxis] + self._bits).reshape(-1, self.rank)
        level = np.repeat(self._level[parents] + 1, self._kin)
        mean, low, high = self._cells(corner, level)
        self._child[parents] = len(self._child) + self._kin * np.arange(len(parents))
        self._child = np.concatenate([self._child, np.full(len(corner), _NONE)])
        self._corner = np.concatenate([self._corner, corner])
        self._level = np.concatenate([self._level, level])
        self._mean = np.concatenate([self._mean, mean])
        self._measure = np.concatenate([self._measure, self._measured(mean, high - low, level)])
        self._open = np.concatenate([self._open, np.zeros(len(corner), dtype=bool)])

    def deepen(self, level: int) -> int:
        """Divide the cells in the first corner of the cube down to a level; return the number of the leaf there."""
        node = 0
        for _ in range(level):
            if not self._open[node]:
                if self._child[node] == _NONE:
                    self._bear(np.array([node]))
                self._open[node] = True
                children = self._child[node] + np.arange(self._kin)
                self._leaves = np.concatenate([self._leaves[self._leaves != node], children])
            node = int(self._child[node])
        while self._open[node]:
            node = int(self._child[node])
        return int(np.searchsorted(np.sort(self._leaves), node))

    def tree(self) -> tuple[Tree, Floats]:
        """Return the tree, with the numbers of its leaves as values, and their averages [1/sr], shape (leaves, C)."""
        inner = np.flatnonzero(self._open)
        leaves = np.sort(self._leaves)
        code = np.zeros(len(self._child), dtype=np.int64)
        code[inner], code[leaves] = np.arange(len(inner)), -1 - np.arange(len(leaves))
        children = code[self._child[inner][:, np.newaxis] + np.arange(self._kin)].reshape(-1, self._kin)
        number = np.arange(len(leaves))
        return Tree(self.rank, children, number, np.zeros_like(number), number.astype(np.float64)), self._mean[leaves]
