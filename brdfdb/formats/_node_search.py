"""The search for the nodes of a file: the widest spacing whose error against the table is within a tolerance.

Formats differ in how they place nodes; they share the search for the level of error that the spacing aims at.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from brdfdb.parameters import Floats

_CLOSE = 0.85  # share of the tolerance above which an error is close enough to it
_WIDE = 0.8  # ratio of a level within the tolerance to one beyond it that need not be halved
_BISECTIONS = 60  # of the range of levels that a number of nodes is searched in

Grid = TypeVar("Grid")


class Trial(NamedTuple, Generic[Grid]):
    """A grid that was tried: the level that its spacing aims at, its number of values, its p99, and the grid.

    `is_coarsest` says that no axis has more than its two ends.
    """

    level: float
    size: int
    p99: float
    is_coarsest: bool
    grid: Grid

    def rank(self, tolerance: float) -> tuple[float, int]:
        """Return a sorting key: trials within the tolerance first, the smallest of them before the others."""
        return max(self.p99, tolerance), self.size


class Pace(NamedTuple):
    """Steps of a search: their number, the share of the tolerance that they aim at, and the largest ratio of levels.

    `halves` says that a search between a level within the tolerance and one beyond it takes their geometric mean.
    """

    rounds: int
    aim: float
    fastest: float
    halves: bool


def smallest(
    tried: Callable[[float], Trial[Grid]], first: float, least: float, tolerance: float, pace: Pace
) -> Trial[Grid]:
    """Return the smallest trial within a tolerance, or the nearest to it, of levels from `least` on."""
    level = max(first, least)
    best: Trial[Grid] | None = None
    within, beyond = 0.0, math.inf  # levels whose trials are, and are not, within the tolerance
    for _ in range(pace.rounds):
        trial = tried(level)
        if best is None or trial.rank(tolerance) < best.rank(tolerance):
            best = trial
        if trial.p99 <= tolerance:
            within = max(within, level)
        else:
            beyond = min(beyond, level)
        is_close = _CLOSE * tolerance <= trial.p99 <= tolerance
        is_least = trial.p99 < tolerance and trial.is_coarsest
        if is_close or is_least or beyond == least or (pace.halves and within > _WIDE * beyond):
            break
        if pace.halves and within > 0.0 and beyond < math.inf:
            level = math.sqrt(within * beyond)
        else:
            level *= float(np.clip(pace.aim * tolerance / max(trial.p99, 1e-9), 0.1, pace.fastest))
        level = max(level, least)
    assert best is not None
    return best


def finest(count: Callable[[float], int], most: int, low: float, high: float) -> float:
    """Return the smallest level, from `low` to `high`, whose grid has no more than `most` nodes."""
    for _ in range(_BISECTIONS):
        middle = math.sqrt(low * high)
        if count(middle) <= most:
            high = middle
        else:
            low = middle
    return high


def unevenness(wrong: Floats, most: float) -> Floats:
    """Return the errors of axes relative to their geometric mean, in [1 / most, most].

    A grid with as many nodes has the least error if all axes are wrong by the same.
    """
    wrong = np.maximum(wrong, 1e-3 * wrong.max()) + 1e-12
    return np.asarray(np.clip(wrong / np.exp(np.log(wrong).mean()), 1.0 / most, most))
