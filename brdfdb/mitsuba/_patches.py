"""Smooth functions of one or two variables as cubic patches, which Dr.Jit gathers and differentiates."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from brdfdb.mitsuba._buffers import Buffer, polynomial, whole

Array = NDArray[np.float64]

_DEGREE = 3
_NODES = np.cos(np.pi * (np.arange(_DEGREE + 1) + 0.5) / (_DEGREE + 1))  # Chebyshev's, in [-1, 1]
_TO_POWERS = np.linalg.inv(np.vander((1.0 + _NODES) / 2.0, increasing=True))  # of a variable in [0, 1]


class Axis(NamedTuple):
    """The range of a variable and the number of patches along it."""

    low: float
    high: float
    patches: int

    @property
    def nodes(self) -> Array:
        """The places of interpolation, shape (patches, 4)."""
        size = (self.high - self.low) / self.patches
        return np.asarray(self.low + size * (np.arange(self.patches)[:, np.newaxis] + (1.0 + _NODES) / 2.0))

    def place(self, x: Any) -> tuple[Any, Any]:
        """Return the number of the patch that holds x, and the place in it, in [0, 1]. Beyond the ends, the ends."""
        size = (self.high - self.low) / self.patches
        number = whole((x - self.low) * (1.0 / size), self.patches)
        return number, dr.clip((x - (self.low + size * number)) * (1.0 / size), 0.0, 1.0)


class Patches:
    """Polynomials of degree three in each variable that interpolate a function patch by patch."""

    def __init__(self, function: Callable[..., Array], *axes: Axis) -> None:
        self._axes = axes
        if len(axes) == 1:
            powers = function(axes[0].nodes) @ _TO_POWERS.T
        else:
            p, q = axes[0].nodes[:, :, np.newaxis, np.newaxis], axes[1].nodes
            values = function(*np.broadcast_arrays(p, q))
            powers = np.einsum("kx,pxqy,ly->pqkl", _TO_POWERS, values, _TO_POWERS)
        self._rows = Buffer(powers)

    def __call__(self, *variables: Any) -> Any:
        """Return the function at numbers, or arrays of one number a ray."""
        places = [axis.place(x) for axis, x in zip(self._axes, variables, strict=True)]
        number, x = places[0]
        size = _DEGREE + 1
        if len(places) == 1:
            return polynomial(self._rows.row(number, size), x)
        column, y = places[1]
        row = self._rows.row(number * self._axes[1].patches + column, size * size)
        return polynomial([polynomial(row[size * k : size * (k + 1)], y) for k in range(size)], x)
