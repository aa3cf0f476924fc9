"""Interpolation in one cell of a table with vector instructions, written in the language of LLVM.

The compiler does not find these vectors: neighbouring numbers of a table are one load of two or four, and the lanes of
a vector are nodes. Each function of Python says what its instructions do, and takes their place where nothing is
compiled. This file is one of `_numba.SHARED`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brdfdb._numba import instructions
from brdfdb.parameters import Array

Index = Any  # an int of Python, or a uint64 of a kernel
CUBIC_COLUMNS = 16  # of `Axes.lines`: four vectors of four weights
LANES = 4  # points that are interpolated linearly at once


class _Writer:
    """Write arithmetic of vectors that may fuse products and sums, as all kernels may."""

    def __init__(self, ir: Any, builder: Any) -> None:
        self.builder, self.ir = builder, ir

    def load(self, pointer: Any, offset: Any, kind: Any, lanes: int) -> Any:
        """Load neighbouring numbers as float64; arrays are aligned to their numbers only."""
        vector = self.ir.VectorType(kind, lanes)
        at = self.builder.bitcast(self.builder.gep(pointer, [offset]), vector.as_pointer())
        loaded = self.builder.load(at)
        loaded.align = 4 if isinstance(kind, self.ir.FloatType) else 8
        if isinstance(kind, self.ir.DoubleType):
            return loaded
        return self.builder.fpext(loaded, self.ir.VectorType(self.ir.DoubleType(), lanes))

    def store(self, pointer: Any, offset: Any, vector: Any) -> None:
        """Store float64 from `offset` on."""
        at = self.builder.bitcast(self.builder.gep(pointer, [offset]), vector.type.as_pointer())
        self.builder.store(vector, at).align = 8

    def shuffle(self, a: Any, b: Any, lanes: Sequence[int]) -> Any:
        """Return the lanes of two vectors, numbered one after the other."""
        int32 = self.ir.IntType(32)
        mask = [self.ir.Constant(int32, lane) for lane in lanes]
        return self.builder.shuffle_vector(a, b, self.ir.Constant(self.ir.VectorType(int32, len(mask)), mask))

    def add(self, a: Any, b: Any) -> Any:
        return self.builder.fadd(a, b, flags=("contract",))

    def sub(self, a: Any, b: Any) -> Any:
        return self.builder.fsub(a, b, flags=("contract",))

    def mul(self, a: Any, b: Any) -> Any:
        return self.builder.fmul(a, b, flags=("contract",))

    def lane(self, vector: Any, number: int) -> Any:
        return self.builder.extract_element(vector, self.ir.Constant(self.ir.IntType(32), number))

    def spread(self, scalar: Any, lanes: int) -> Any:
        """Return a vector with the scalar in every lane."""
        undefined = self.ir.Constant(self.ir.VectorType(scalar.type, lanes), self.ir.Undefined)
        first = self.builder.insert_element(undefined, scalar, self.ir.Constant(self.ir.IntType(32), 0))
        return self.shuffle(first, undefined, [0] * lanes)

    def one(self) -> Any:
        return self.ir.Constant(self.ir.DoubleType(), 1.0)


def _write_trilinear(
    ir: Any,
    builder: Any,
    table: Any,
    first: Any,
    row: Any,
    layer: Any,
    share_0: Any,
    share_1: Any,
    share_2: Any,
    j: Any,
    out: Any,
) -> None:
    w = _Writer(ir, builder)
    number, double = ir.FloatType(), ir.DoubleType()
    places = [builder.load(builder.gep(first, [builder.add(j, ir.Constant(j.type, p))])) for p in range(LANES)]
    ends = []
    for step in (None, row, layer, builder.add(row, layer)):
        pairs = [w.load(table, place if step is None else builder.add(place, step), number, 2) for place in places]
        halves = [w.shuffle(pairs[0], pairs[1], range(4)), w.shuffle(pairs[2], pairs[3], range(4))]
        ends.append(builder.fpext(w.shuffle(halves[0], halves[1], range(8)), ir.VectorType(double, 2 * LANES)))
    a, b, c, d = ends
    t_0, t_1, t_2 = (w.load(share, j, double, LANES) for share in (share_0, share_1, share_2))
    along_1, along_0 = (w.shuffle(t, t, (0, 0, 1, 1, 2, 2, 3, 3)) for t in (t_1, t_0))
    a = w.add(a, w.mul(along_1, w.sub(b, a)))
    c = w.add(c, w.mul(along_1, w.sub(d, c)))
    a = w.add(a, w.mul(along_0, w.sub(c, a)))
    before = w.shuffle(a, a, (0, 2, 4, 6))
    after = w.shuffle(a, a, (1, 3, 5, 7))
    w.store(out, j, w.add(w.mul(w.sub(w.spread(w.one(), LANES), t_2), before), w.mul(t_2, after)))


@instructions(_write_trilinear)
def trilinear_cells(
    table: NDArray[np.float32],
    first: NDArray[np.uint64],
    row: Index,
    layer: Index,
    share_0: Array,
    share_1: Array,
    share_2: Array,
    j: Index,
    out: Array,
) -> None:
    """Write the numbers at LANES points from the point `j` on, each linear along the three axes of its cell.

    `first` has the first node in the table of the cell of each point. The next along the axes are `layer`, `row` and 1
    further. The shares, in [0, 1], say how much of the cell lies before the point on each axis.
    """
    for point in range(int(j), int(j) + LANES):
        t_0 = share_0[point]
        t_1 = share_1[point]
        t_2 = share_2[point]
        o = int(first[point])
        ends = []
        for k in (o, o + 1):
            a, b, c, d = (float(table[at]) for at in (k, k + row, k + layer, k + layer + row))
            a, c = a + t_1 * (b - a), c + t_1 * (d - c)
            ends.append(a + t_0 * (c - a))
        out[point] = (1.0 - t_2) * ends[0] + t_2 * ends[1]


def _write_tricubic(
    ir: Any,
    builder: Any,
    table: Any,
    lines: Any,
    o: Any,
    row: Any,
    layer: Any,
    k_0: Any,
    k_1: Any,
    k_2: Any,
    t_0: Any,
    t_1: Any,
    t_2: Any,
) -> Any:
    w = _Writer(ir, builder)
    number = w.ir.FloatType()
    weights = [_write_weights(w, lines, k, t) for k, t in ((k_0, t_0), (k_1, t_1), (k_2, t_2))]
    w_0, w_1 = ([w.spread(w.lane(axis, node), 4) for node in range(4)] for axis in weights[:2])
    total = None
    at = o
    for i in range(4):
        across, start = None, at
        for k in range(4):
            part = w.mul(w_1[k], w.load(table, start, number, 4))
            across = part if across is None else w.add(across, part)
            start = builder.add(start, row)
        part = w.mul(w_0[i], across)
        total = part if total is None else w.add(total, part)
        at = builder.add(at, layer)
    last = w.mul(weights[2], total)
    return w.add(w.add(w.lane(last, 0), w.lane(last, 1)), w.add(w.lane(last, 2), w.lane(last, 3)))


def _write_weights(w: _Writer, lines: Any, k: Any, t: Any) -> Any:
    builder, double = w.builder, w.ir.DoubleType()
    two = w.ir.Constant(double, 2.0)
    three = w.ir.Constant(double, 3.0)
    rest, t2 = w.sub(w.one(), t), w.mul(t, t)
    rise = w.mul(t2, w.sub(three, w.mul(two, t)))
    factors = (
        w.mul(w.mul(t, rest), rest),
        w.mul(t2, w.sub(t, w.one())),
        w.sub(w.one(), rise),
        rise,
    )
    total = None
    for column, factor in enumerate(factors):
        at = builder.add(k, w.ir.Constant(k.type, 4 * column))
        part = w.mul(w.spread(factor, 4), w.load(lines, at, double, 4))
        total = part if total is None else w.add(total, part)
    return total


@instructions(_write_tricubic)
def tricubic_cell(
    table: NDArray[np.float32],
    lines: Array,
    o: Index,
    row: Index,
    layer: Index,
    k_0: Index,
    k_1: Index,
    k_2: Index,
    t_0: float,
    t_1: float,
    t_2: float,
) -> float:
    """Return the number at a point in a cell, cubic along three axes.

    `o` is the first of the 4 x 4 x 4 nodes that count. Those along the axes are `layer`, `row` and 1 further. k_0, k_1
    and k_2 are the places in `lines`, an `Axes.lines` made flat, where the weights of the cell on each axis begin.
    """
    w_0, w_1, w_2 = (_weights(lines[k : k + CUBIC_COLUMNS], t) for k, t in ((k_0, t_0), (k_1, t_1), (k_2, t_2)))
    total = np.zeros(4)
    for i in range(4):
        at = o + i * layer
        total += w_0[i] * sum(w_1[k] * table[at + k * row : at + k * row + 4].astype(np.float64) for k in range(4))
    last = w_2 * total
    return float((last[0] + last[1]) + (last[2] + last[3]))


def _weights(line: Array, t: float) -> Array:
    rise = t * t * (3.0 - 2.0 * t)
    factors = t * (1.0 - t) * (1.0 - t), t * t * (t - 1.0), 1.0 - rise, rise
    weights: Array = np.array(factors) @ np.reshape(line, (4, 4))
    return weights
