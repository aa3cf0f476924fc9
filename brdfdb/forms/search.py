"""Minimisation of a function of a few bounded variables: points spread evenly, then simplexes downhill."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Function = Callable[[Array], float]

_PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29)
MOST_VARIABLES = len(_PRIMES)
_EXTENT = 100.0  # size of the last simplex, relative to the tolerance of its values
_NOTHING = 0.01  # value below which differences are relative to this one: there is hardly anything to gain
_NEAR = 0.05  # distance, in the unit cube, below which two points are the same beginning


def spread(count: int, variables: int) -> Array:
    """Return points (count, variables) spread evenly over the unit cube: Halton's sequence, the same at every call."""
    points = np.zeros((count, variables))
    for column, base in enumerate(_PRIMES[:variables]):
        index, share = np.arange(1, count + 1), 1.0 / base
        while index.any():
            points[:, column] += share * (index % base)
            index, share = index // base, share / base
    return points


def best_apart(points: Array, values: Array, count: int) -> Array:
    """Return the points with the least values, of which no two are near each other."""
    chosen: list[Array] = []
    for index in np.argsort(values, kind="stable"):
        if all(np.max(np.abs(points[index] - other)) > _NEAR for other in chosen):
            chosen.append(points[index])
        if len(chosen) == count:
            break
    return np.array(chosen)


def downhill(
    function: Function, begin: Array, size: Array, *, tolerance: float = 1e-7, most: int = 400
) -> tuple[Array, float]:
    """Return a minimum of a function in the unit cube, and its value, by the simplex of Nelder and Mead 1965.

    Parameters
    ----------
    function : callable
        A function of an array (variables,) in [0, 1].
    begin : array (variables,)
        The first corner of the simplex.
    size : array (variables,)
        Lengths of its edges.
    tolerance : float
        The search stops when values at the corners differ by less than this, relative to the least or to a hundredth,
        and the corners by less than a hundred times as much. Corners on both sides of a minimum may have the same
        value.
    most : int
        Number of evaluations at which the search stops.

    Returns
    -------
    array (variables,), float
        The best corner and its value.

    Notes
    -----
    Corners outside the cube are moved to its surface. No gradient is needed: the integral of an absolute difference has
    none where the difference is 0 over a region.

    References
    ----------
    neldermead1965
    """
    dimensions = begin.size
    corners = np.tile(begin, (dimensions + 1, 1))
    for axis in range(dimensions):  # towards the side with more room
        corners[axis + 1, axis] += size[axis] if begin[axis] <= 0.5 else -size[axis]
    corners = np.clip(corners, 0.0, 1.0)
    values = np.array([function(corner) for corner in corners])
    done = values.size
    while done < most:
        order = np.argsort(values, kind="stable")
        corners, values = corners[order], values[order]
        extent = np.max(np.abs(corners[1:] - corners[0]))
        if values[-1] - values[0] <= tolerance * max(abs(values[0]), _NOTHING) and extent <= _EXTENT * tolerance:
            break
        centre = corners[:-1].mean(axis=0)
        away = centre - corners[-1]
        tried, value = _at(function, centre + away)
        done += 1
        if value < values[0]:
            further, lower = _at(function, centre + 2.0 * away)
            done += 1
            corners[-1], values[-1] = (further, lower) if lower < value else (tried, value)
        elif value < values[-2]:
            corners[-1], values[-1] = tried, value
        else:
            nearer, lower = _at(function, centre + (0.5 if value < values[-1] else -0.5) * away)
            done += 1
            if lower < min(value, values[-1]):
                corners[-1], values[-1] = nearer, lower
            else:
                corners[1:] = corners[0] + 0.5 * (corners[1:] - corners[0])
                values[1:] = [function(corner) for corner in corners[1:]]
                done += dimensions
    best = int(np.argmin(values))
    return corners[best], float(values[best])


def _at(function: Function, point: Array) -> tuple[Array, float]:
    inside = np.clip(point, 0.0, 1.0)
    return inside, function(inside)
