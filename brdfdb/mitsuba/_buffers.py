"""Arrays of float32 that every variant of Mitsuba reads: gathers in Dr.Jit, plain numbers in scalar variants."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike


class Buffer:
    """A flat array of numbers, loaded once into each variant that reads it."""

    def __init__(self, numbers: ArrayLike) -> None:
        self.numbers = np.ascontiguousarray(numbers, dtype=np.float32).ravel()
        self._arrays: dict[str | None, Any] = {}

    def at(self, index: Any) -> Any:
        """Return the numbers at an index, which is a whole number in a variable of floats."""
        if not dr.is_jit_v(index):
            return float(self.numbers[int(index)])
        return dr.gather(mi.Float, self.loaded(), mi.UInt32(index))

    def four(self, index: Any) -> Any:
        """Return four numbers one after another, of which `index` is the first."""
        if not dr.is_jit_v(index):
            return self.numbers[int(index) : int(index) + 4].tolist()
        loaded, first = self.loaded(), mi.UInt32(index)
        return [dr.gather(mi.Float, loaded, first + k) for k in range(4)]

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
