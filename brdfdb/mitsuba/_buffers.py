"""Arrays of float32 that every variant of Mitsuba reads: gathers in Dr.Jit, plain numbers in scalar variants."""

from __future__ import annotations

import sys
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike

_SEVERAL = {"Float": "ArrayXf", "Float64": "ArrayXf64"}
_LINE = 64  # bytes: an address that is a multiple of it lets Dr.Jit load several numbers at once


def whole(place: Any, count: int) -> Any:
    """Return the number of the cell, of `count` cells of length 1, that holds a place: the first or last one beyond.

    All indices of gathers are made of these numbers. A place that is nan is in the first cell, so that nothing is read
    outside a buffer.
    """
    place = dr.detach(place)
    return mi.UInt32(dr.select(place > 0.0, dr.minimum(place, count - 1.0), 0.0))


class Buffer:
    """A flat array of numbers, loaded once into each variant that reads it."""

    def __init__(self, numbers: ArrayLike) -> None:
        values = np.asarray(numbers, dtype=np.float32).ravel()
        room = np.empty(values.size + _LINE // 4, np.float32)
        first = -room.ctypes.data % _LINE // 4
        self.numbers = room[first : first + values.size]
        self.numbers[:] = values
        self._arrays: dict[str | None, Any] = {}

    def at(self, index: Any) -> Any:
        """Return the numbers at an index."""
        if not dr.is_jit_v(index):
            return float(self.numbers[int(index)])
        return dr.gather(mi.Float, self.loaded(), mi.UInt32(index))

    def row(self, index: Any, width: int) -> list[Any]:
        """Return the numbers of a row of 1, 2, 4 or a multiple of eight numbers, in a few loads."""
        if not dr.is_jit_v(index):
            return [float(x) for x in self.numbers[int(index) * width : (int(index) + 1) * width]]
        loaded, first = self.loaded(), mi.UInt32(index)
        if width == 1:
            return [dr.gather(mi.Float, loaded, first)]
        if width == 2:
            return list(dr.gather(mi.Point2f, loaded, first))
        if width <= 4:
            return list(dr.gather(mi.Vector4f, loaded, first))
        several, eighths = getattr(sys.modules[mi.Float.__module__], _SEVERAL[mi.Float.__name__]), width // 8
        shape = (8, dr.width(first))
        return [x for k in range(eighths) for x in dr.gather(several, loaded, first * eighths + k, shape=shape)]

    def cell(self, x: Any, count: int, first: Any = 0) -> Any:
        """Return the number of the cell, of `count`, that holds x between numbers that increase, from `first` on."""
        if not dr.is_jit_v(x):
            row = self.numbers[int(first) : int(first) + count + 1]
            return int(np.clip(np.searchsorted(row, x, side="right") - 1, 0, count - 1))
        return dr.binary_search(1, count, lambda index: self.at(first + index) <= x) - 1

    def loaded(self) -> Any:
        """Return the numbers as an array of the variant."""
        variant = mi.variant()
        if variant not in self._arrays:
            self._arrays[variant] = mi.Float(self.numbers)
        return self._arrays[variant]

    def replace(self, numbers: Any) -> None:
        """Take other numbers, an array of the variant that may have derivatives."""
        self._arrays[mi.variant()] = numbers


def polynomial(coefficients: Any, x: Any) -> Any:
    """Return the polynomial with coefficients that begin with the constant one."""
    total = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        total = dr.fma(total, x, coefficient)
    return total
