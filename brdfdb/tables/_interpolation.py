"""Interpolation on rectilinear grids: the cell of a point on each axis, and the nodes that count, with weights."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb._numba import inner_loop, kernel
from brdfdb.parameters import Array
from brdfdb.tables._simd import CUBIC_COLUMNS, LANES, tricubic_cell, trilinear_cells

_AT_END = 4  # first column of `Axes.slopes` for the end of a cell; those for its beginning come first
POINTS = 1024  # points in a block of a lookup: a block costs as much as 60 points
_MOST_BUCKETS = 1 << 15  # of an axis: nodes closer together than a part in this share a bucket


class Axes(NamedTuple):
    """The axes of a grid as kernels read them, one after another in flat arrays.

    Attributes
    ----------
    counts, first : int64 (axes,)
        Number of nodes, and where those of an axis begin in the arrays of nodes.
    nodes, inverse : float64 (nodes,)
        Nodes, and the inverse of the step to the next one.
    uniform : bool (axes,)
        True if the steps of an axis are equal: its cells need no search.
    crowded : bool (axes,)
        True if a bucket of an axis may hold more than one node.
    scale : float64 (axes,)
        Cells or buckets for one unit along the axis.
    bucket, bucket_first : int64
        The cell at the beginning of each bucket; where the buckets of an axis begin.
    width : int64 (axes,)
        Nodes that count in a cell: 2, or 4 of a cubic.
    stencil : int64 (nodes, 4)
        The numbers of those nodes; if two count, they are in the middle. Of a periodic axis the last is the first.
    slopes : float64 (nodes, 8)
        The slopes at both ends of a cell, times its length, as weights of those nodes.
    lines : float64 (nodes, 16)
        For each cell the weights of four neighbouring nodes that stand for the slopes at both its ends, and for its
        two ends. Empty if an axis has no four neighbours in each cell.
    """

    counts: NDArray[np.int64]
    first: NDArray[np.int64]
    nodes: Array
    inverse: Array
    uniform: NDArray[np.bool_]
    crowded: NDArray[np.bool_]
    scale: Array
    bucket: NDArray[np.int64]
    bucket_first: NDArray[np.int64]
    width: NDArray[np.int64]
    stencil: NDArray[np.int64]
    slopes: Array
    lines: Array


def prepared(axes: Sequence[Array], ends: Sequence[tuple[str, str]], *, cubic: bool) -> Axes:
    """Prepare axes for kernels.

    Parameters
    ----------
    axes : sequence of float64 arrays
        Nodes, strictly increasing, two or more on each axis.
    ends : sequence of (str, str)
        The continuation of the function beyond the first and the last node: "even" where it is mirrored there,
        "periodic" where the last node is the first again, "open" where nothing is.
    cubic : bool
        Catmull-Rom cubics on the axes that have three nodes or more, else linear.
    """
    tables = [_buckets(nodes) for nodes in axes]
    cells = [_cubic_cells(nodes, end) for nodes, end in zip(axes, ends, strict=True)]
    counts = np.array([nodes.size for nodes in axes])
    sizes = np.array([bucket.size for bucket, _, _ in tables])
    return Axes(
        counts=counts,
        first=np.cumsum(counts) - counts,
        nodes=np.concatenate(axes),
        inverse=np.concatenate([np.append(1.0 / np.diff(nodes), 0.0) for nodes in axes]),
        uniform=np.array([uniform for _, _, uniform in tables]),
        crowded=np.array(
            [scale * np.diff(nodes).min() < 1.0 for nodes, (_, scale, _) in zip(axes, tables, strict=True)]
        ),
        scale=np.array([scale for _, scale, _ in tables]),
        bucket=np.concatenate([bucket for bucket, _, _ in tables]),
        bucket_first=np.cumsum(sizes) - sizes,
        width=np.array([4 if cubic and nodes.size > 2 else 2 for nodes in axes]),
        stencil=np.concatenate([stencil for stencil, _ in cells]),
        slopes=np.concatenate([slopes for _, slopes in cells]),
        lines=_lines(cells, ends) if cubic else np.empty((0, CUBIC_COLUMNS)),
    )


def weights_of_nodes(
    nodes: Array, x: Array, ends: tuple[str, str] = ("open", "open"), *, cubic: bool = True
) -> tuple[NDArray[np.int64], Array]:
    """Return the nodes of one axis that count at points, and their weights, both of shape (points, 4).

    Parameters
    ----------
    nodes : float64 array (N,)
        Strictly increasing.
    x : float64 array (points,)
        Within the nodes.
    ends, cubic
        As in `prepared`.

    Returns
    -------
    index : int64 array (points, 4)
        The nodes that count.
    weight : float64 array (points, 4)
        Their weights. They add up to 1. On a node the weight of that node is exactly 1, and the others are 0.
    """
    index, weight = np.zeros((x.size, 4), np.int64), np.zeros((x.size, 4))
    if nodes.size == 1:
        weight[:, 0] = 1.0
        return index, weight
    cell = np.clip(np.searchsorted(nodes, x, side="right") - 1, 0, nodes.size - 2)
    t = (x - nodes[cell]) / (nodes[cell + 1] - nodes[cell])
    if not cubic or nodes.size == 2:
        index[:, 0], index[:, 1] = cell, cell + 1
        weight[:, 0], weight[:, 1] = 1.0 - t, t
        return index, weight
    stencil, slopes = _cubic_cells(nodes, ends)
    rise = t * t * (3.0 - 2.0 * t)
    for k in range(4):
        weight[:, k] = t * (1 - t) ** 2 * slopes[cell, k] + t * t * (t - 1) * slopes[cell, k + _AT_END]
    weight[:, 1] += 1.0 - rise
    weight[:, 2] += rise
    return stencil[cell], weight


def _buckets(nodes: Array) -> tuple[NDArray[np.int64], float, bool]:
    """Return equal pieces of an axis, none longer than its shortest cell: the cell at each begin, and pieces a unit."""
    steps = np.diff(nodes)
    extent = nodes[-1] - nodes[0]
    if np.ptp(steps) <= 1e-9 * steps[0]:
        return np.arange(steps.size), steps.size / extent, True
    pieces = int(min(np.ceil(extent / steps.min()) + 1, _MOST_BUCKETS))
    begins = nodes[0] + np.arange(pieces + 1) * (extent / pieces)
    return np.clip(np.searchsorted(nodes, begins, side="right") - 1, 0, nodes.size - 2), pieces / extent, False


def _cubic_cells(nodes: Array, ends: tuple[str, str]) -> tuple[NDArray[np.int64], Array]:
    """Return the four nodes that count in each cell of an axis, and the slopes at its two ends as weights of them.

    Catmull-Rom for unequal steps: Hermite's cubic whose slope at a node is that of the parabola through it and its two
    neighbours. The cell after the last node is never looked up.
    """
    count = nodes.size
    (before, x_before), (after, x_after) = (
        _beyond(nodes, end, low) for end, low in zip(ends, (True, False), strict=True)
    )
    x = np.concatenate([[x_before], nodes, [x_after]])
    index = np.concatenate([[before], np.arange(count), [after]])
    if ends[1] == "periodic":  # their numbers are rounded each by itself, which would leave a step
        index[-2] = 0
    stencil, slopes = np.zeros((count, 4), np.int64), np.zeros((count, 2, 4))
    for k in range(4):
        stencil[:-1, k] = index[k : k + count - 1]
    if count < 3:
        return stencil, slopes.reshape(count, 8)
    at_nodes = _slopes(x[:-2], x[1:-1], x[2:], x[1:-1])
    slopes[:-1, 0, 0:3], slopes[:-1, 1, 1:4] = at_nodes[:-1], at_nodes[1:]
    if np.isnan(x_before):  # the parabola through the nodes inside; the one outside gets no weight
        slopes[0, 0] = [0.0, *_slopes(nodes[0], nodes[1], nodes[2], nodes[0])]
    if np.isnan(x_after):
        slopes[-2, 1] = [*_slopes(nodes[-3], nodes[-2], nodes[-1], nodes[-1]), 0.0]
    slopes[:-1] *= np.diff(nodes)[:, np.newaxis, np.newaxis]
    return stencil, slopes.reshape(count, 8)


def _lines(cells: Sequence[tuple[NDArray[np.int64], Array]], ends: Sequence[tuple[str, str]]) -> Array:
    """Return `Axes.lines`. A mirrored node outside is one inside, whose weight it adds to."""
    if any(len(stencil) < 4 or "periodic" in end for (stencil, _), end in zip(cells, ends, strict=True)):
        return np.empty((0, CUBIC_COLUMNS))
    lines = []
    for stencil, slopes in cells:
        line, rows = np.zeros((len(stencil), 4, 4)), np.arange(len(stencil) - 1)
        begin = np.clip(rows - 1, 0, len(stencil) - 4)
        for k in range(4):
            node = stencil[:-1, k] - begin
            for end in range(2):
                line[rows, end, node] += slopes[:-1, 4 * end + k]
        line[rows, 2, rows - begin] = 1.0
        line[rows, 3, rows + 1 - begin] = 1.0
        lines.append(line.reshape(-1, CUBIC_COLUMNS))
    return np.concatenate(lines)


def _beyond(nodes: Array, end: str, low: bool) -> tuple[int, float]:
    """Return the number and place of the node one beyond an end of an axis; the place is nan if nothing is known."""
    last = nodes.size - 1
    if end == "even":
        return (1, 2.0 * nodes[0] - nodes[1]) if low else (last - 1, 2.0 * nodes[last] - nodes[last - 1])
    if end == "periodic":
        turn = nodes[last] - nodes[0]
        return (last - 1, nodes[last - 1] - turn) if low else (1, nodes[1] + turn)
    return (0 if low else last), np.nan


def _slopes(a: Any, b: Any, c: Any, at: Any) -> Array:
    """Return the slopes of parabolas through three nodes at one of them, as weights of their values: shape (..., 3)."""
    return np.stack(
        [
            (2.0 * at - b - c) / ((a - b) * (a - c)),
            (2.0 * at - a - c) / ((b - a) * (b - c)),
            (2.0 * at - a - b) / ((c - a) * (c - b)),
        ],
        axis=-1,
    )


@kernel
def locate(axes: Axes, axis: int, x: Array, count: int, cell: NDArray[np.int32]) -> None:
    """Write the cell of each point on one axis, and replace x by the share of it in [0, 1] that lies before the point.

    A point beyond an end is moved to it. x and cell have a row an axis.
    """
    row = np.uint64(axis)
    first = np.uint64(axes.first[row])
    last = axes.counts[row] - 2
    low, scale = axes.nodes[first], axes.scale[row]
    if axes.uniform[row]:
        top = float(last)
        for j in range(count):
            y = (x[row, j] - low) * scale
            y = y if y > 0.0 else 0.0  # nan too
            whole = np.floor(y)
            whole = whole if whole < top else top
            y = y - whole
            x[row, j] = y if y < 1.0 else 1.0
            cell[row, j] = np.int32(whole)
        return
    high = axes.nodes[first + np.uint64(last + 1)]
    for j in range(count):
        y = x[row, j] if x[row, j] < high else high
        y = y if y > low else low  # nan too
        x[row, j] = y
        cell[row, j] = np.int32((y - low) * scale)
    one, buckets = np.uint64(1), np.uint64(axes.bucket_first[row])
    crowded = axes.crowded[row]  # a bucket may have more nodes than one
    for j in range(count):
        y = x[row, j]
        c = np.uint64(axes.bucket[buckets + np.uint64(cell[row, j])])
        c += np.uint64(y > axes.nodes[first + c + one])
        if crowded:
            while y > axes.nodes[first + c + one]:
                c += one
        x[row, j] = (y - axes.nodes[first + c]) * axes.inverse[first + c]
        cell[row, j] = np.int32(c)


@kernel
def _weigh(axes: Axes, axis: int, c: int, t: float, stride: int, row: int, at: NDArray[np.uint64], w: Array) -> None:
    """Write offsets and weights of the nodes that count for a point into a row of `at` and `w`."""
    k = np.uint64(axes.first[axis] + c)
    if axes.width[axis] == 2:
        at[row, 0], at[row, 1] = np.uint64(axes.stencil[k, 1] * stride), np.uint64(axes.stencil[k, 2] * stride)
        w[row, 0], w[row, 1] = 1.0 - t, t
        return
    t2 = t * t
    h_1 = t2 * (3.0 - 2.0 * t)
    m_0, m_1 = t * (1.0 - t) * (1.0 - t), t2 * (t - 1.0)
    for node in range(4):
        at[row, node] = np.uint64(axes.stencil[k, node] * stride)
        w[row, node] = m_0 * axes.slopes[k, node] + m_1 * axes.slopes[k, node + _AT_END]
    w[row, 1] += 1.0 - h_1
    w[row, 2] += h_1


@kernel
def room(points: int) -> int:
    """Return the points for which the arrays of a block have room: at most POINTS, and a multiple of LANES."""
    return (min(POINTS, points) + LANES - 1) // LANES * LANES


@kernel
def trilinear(
    axes: Axes, cell: NDArray[np.int32], share: Array, count: int, table: NDArray[np.float32], out: Array
) -> None:
    """Interpolate linearly on three axes of a table with one value a node, at the points of `locate`.

    The arrays have `room` for groups of LANES points. The last group is computed whole.
    """
    n_1, n_2 = axes.counts[1], axes.counts[2]
    row, layer = np.uint64(n_2), np.uint64(n_1 * n_2)
    groups = (count + LANES - 1) // LANES
    first = np.empty(groups * LANES, np.uint64)
    for j in range(count, groups * LANES):
        first[j] = np.uint64(0)
    for j in range(count):
        first[j] = np.uint64((np.int64(cell[0, j]) * n_1 + cell[1, j]) * n_2 + cell[2, j])
    share_0, share_1, share_2 = share[0], share[1], share[2]
    for group in range(groups):
        trilinear_cells(table, first, row, layer, share_0, share_1, share_2, np.uint64(group * LANES), out)


@kernel
def tricubic(
    axes: Axes, cell: NDArray[np.int32], share: Array, count: int, table: NDArray[np.float32], out: Array
) -> None:
    """Interpolate with cubics on three axes of a table with one value a node, if `axes.lines` is not empty."""
    n_0, n_1, n_2 = axes.counts[0], axes.counts[1], axes.counts[2]
    row, layer = np.uint64(n_2), np.uint64(n_1 * n_2)
    lines = axes.lines.reshape(-1)
    first = axes.first[0], axes.first[1], axes.first[2]
    for j in range(count):
        i, k, m = np.int64(cell[0, j]), np.int64(cell[1, j]), np.int64(cell[2, j])
        begin_0, begin_1 = min(max(i - 1, 0), n_0 - 4), min(max(k - 1, 0), n_1 - 4)
        o = np.uint64((begin_0 * n_1 + begin_1) * n_2 + min(max(m - 1, 0), n_2 - 4))
        k_0, k_1 = np.uint64((first[0] + i) * CUBIC_COLUMNS), np.uint64((first[1] + k) * CUBIC_COLUMNS)
        k_2 = np.uint64((first[2] + m) * CUBIC_COLUMNS)
        t_0, t_1, t_2 = share[0, j], share[1, j], share[2, j]
        out[j] = tricubic_cell(table, lines, o, row, layer, k_0, k_1, k_2, t_0, t_1, t_2)


@kernel
def weighted(
    axes: Axes,
    cell: NDArray[np.int32],
    share: Array,
    count: int,
    table: NDArray[np.float32],
    channels: int,
    out: Array,
) -> None:
    """Interpolate on three or four axes of a table with `channels` values a node, at the points of `locate`.

    `out` holds the channels of one point after those of another.
    """
    dimensions = axes.counts.size
    at, w = np.zeros((4, 4), np.uint64), np.zeros((4, 4))
    w[0, 0] = 1.0  # of three axes, there is no first
    widths = np.ones(4, np.int64)
    lead = 4 - dimensions
    for axis in range(dimensions):
        widths[lead + axis] = axes.width[axis]
    for j in range(count):
        stride = channels
        for back in range(dimensions):
            axis = dimensions - 1 - back
            _weigh(axes, axis, int(cell[axis, j]), share[axis, j], stride, lead + axis, at, w)
            stride *= axes.counts[axis]
        if channels == 1:
            total = 0.0
            for i in range(widths[0]):
                for k in range(widths[1]):
                    for m in range(widths[2]):
                        base = at[0, i] + at[1, k] + at[2, m]
                        line = w[3, 0] * table[base + at[3, 0]] + w[3, 1] * table[base + at[3, 1]]
                        if widths[3] == 4:
                            line += w[3, 2] * table[base + at[3, 2]] + w[3, 3] * table[base + at[3, 3]]
                        total += w[0, i] * w[1, k] * w[2, m] * line
            out[j] = total
            continue
        for channel in range(channels):
            out[j * channels + channel] = 0.0
        for i in range(widths[0]):
            for k in range(widths[1]):
                for m in range(widths[2]):
                    for n in range(widths[3]):
                        base = at[0, i] + at[1, k] + at[2, m] + at[3, n]
                        factor = w[0, i] * w[1, k] * w[2, m] * w[3, n]
                        if factor != 0.0:
                            for channel in range(channels):
                                out[j * channels + channel] += factor * table[base + np.uint64(channel)]


@inner_loop
def interpolated(
    axes: Axes,
    table: NDArray[np.float32],
    channels: int,
    x: Array,
    count: int,
    numbers: Array,
    cell: NDArray[np.int32],
) -> None:
    """Interpolate the numbers of a table at points on its grid: `channels` numbers a point, point after point.

    `cell` has the shape of `x`. Both are overwritten.
    """
    for axis in range(x.shape[0]):
        locate(axes, axis, x, count, cell)
    width = axes.width  # summed by hand: a method would load all that numba knows of arrays with the stored kernel
    if channels == 1 and x.shape[0] == 3 and width[0] + width[1] + width[2] == 6:
        trilinear(axes, cell, x, count, table, numbers)
    elif channels == 1 and x.shape[0] == 3 and axes.lines.shape[0] > 0:
        tricubic(axes, cell, x, count, table, numbers)
    else:
        weighted(axes, cell, x, count, table, channels, numbers)
