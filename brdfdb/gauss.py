"""Gauss and Legendre's rule of integration."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class GaussRule(NamedTuple):
    """Nodes and weights of Gauss and Legendre's rule."""

    nodes: NDArray[np.float64]
    weights: NDArray[np.float64]

    def on(self, low: float, high: float) -> GaussRule:
        """Return the rule of an interval, for the rule on [-1, 1]."""
        half = 0.5 * (high - low)
        return GaussRule(low + half * (self.nodes + 1.0), half * self.weights)


@functools.cache  # a rule takes a millisecond
def gauss_rule(count: int) -> GaussRule:
    """Return Gauss and Legendre's rule of `count` nodes on [-1, 1]; its arrays cannot be written."""
    rule = GaussRule(*np.polynomial.legendre.leggauss(count))
    for array in rule:
        array.flags.writeable = False
    return rule
