"""Adaptive integrals over rectangles by the rules of Gauss and Kronrod, many integrals at a time."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.parameters import Array, Floats

Indices = NDArray[np.intp]
Integrand = Callable[[Indices, Array, Array], Array]

# Nodes and weights, from 0 on, of Gauss's rule of 7 nodes on [-1, 1] and of Kronrod's rule of 15 that extends it
_NODES = np.array(
    [
        0.0,
        0.207784955007898467600689403773245,
        0.405845151377397166906606412076961,
        0.586087235467691130294144691693013,
        0.741531185599394439863864773280788,
        0.864864423359769072789712788640926,
        0.949107912342758524526189684047851,
        0.991455371120812639206854697526329,
    ]
)
_KRONROD = np.array(
    [
        0.209482141084727828012999174891714,
        0.204432940075298892414161999234649,
        0.190350578064785409913256402421014,
        0.169004726639267902826583426598550,
        0.140653259715525918745189590510238,
        0.104790010322250183839876322541518,
        0.063092092629978553290700663189204,
        0.022935322010529224963732008058970,
    ]
)
_GAUSS = np.array(
    [
        0.417959183673469387755102040816327,
        0.0,
        0.381830050505118944950369775488975,
        0.0,
        0.279705391489276667901467771423780,
        0.0,
        0.129484966168869693270611432679082,
        0.0,
    ]
)
_X = np.concatenate([-_NODES[:0:-1], _NODES])
_W_KRONROD = np.concatenate([_KRONROD[:0:-1], _KRONROD])
_W_GAUSS = np.concatenate([_GAUSS[:0:-1], _GAUSS])

# Safety factor on the difference of two rules, which an edge inside a panel makes too small. 1.6 was measured
_SAFETY = 4.0
# Panels evaluated at a time, of 225 points each: fewer where a point has several values, but enough for a model that is
# faster in one row of 2000 points or more
_BATCH = 200
_FEWEST = 64


def rectangles(first: Floats, second: Floats) -> Array:
    """Return panels between edges (..., edges) of many integrals, shape (..., panels, 4).

    A row has the centre, then half the width, in the first and second variable.
    """
    first = first[..., :, np.newaxis]
    second = second[..., np.newaxis, :]
    parts: list[Floats] = [(first[..., :-1, :] + first[..., 1:, :]) / 2.0, (second[..., :-1] + second[..., 1:]) / 2.0]
    parts += [np.diff(first, axis=-2) / 2.0, np.diff(second) / 2.0]
    panels = np.stack(np.broadcast_arrays(*parts), axis=-1)
    return panels.reshape(*panels.shape[:-3], -1, 4)


class Integrals(NamedTuple):
    """Integrals, and estimates of their errors."""

    values: Array
    errors: Array


def integrated(
    integrand: Integrand, panels: Array, of: Indices, tolerance: Floats, most_panels: int, width: int = 1
) -> Integrals:
    """Return integrals over panels, shape (integrals, width), and estimates of their errors (integrals,).

    Panels with large errors are halved, until those of each integral add up to less than the tolerance. All integrals
    that still want panels are evaluated in one call.

    Parameters
    ----------
    integrand : callable
        ``integrand(of, x, y)`` gives values (P, 15, 15, width) for P panels: the integral to which each belongs (P,),
        and the variables at its nodes, (P, 15, 1) and (P, 1, 15).
    panels, of : array (P, 4), array (P,)
        Rectangles, as from `rectangles`, and the index of the integral of each. Each integral has a panel at least.
    tolerance : array (integrals,)
        Absolute error of each to stay below, for the worst of its `width` values.
    most_panels : int
        Number of new panels at which an integral stops.
    """
    count = int(of.max(initial=-1)) + 1
    values, errors = _rules(integrand, panels, of, width)
    done = np.zeros(count, dtype=np.intp)
    while True:
        total = errors.sum(axis=1)
        wanting = (_sums(of, total, count) > tolerance) & (done < most_panels)
        if not np.any(wanting):
            # numpy sums contiguous numbers by pairs
            order = np.argsort(of, kind="stable")
            ends = np.flatnonzero(np.diff(of[order])) + 1
            columns = np.split(np.ascontiguousarray(values[order].T), ends, axis=1)
            sums = np.stack([np.ascontiguousarray(column).sum(axis=1) for column in columns])
            return Integrals(sums, _sums(of, total, count))
        chosen = _chosen(total, of, wanting, tolerance)
        halved = _halved(panels[chosen], errors[chosen])
        of_halved = np.tile(of[chosen], 2)
        new_values, new_errors = _rules(integrand, halved, of_halved, width)
        panels = np.concatenate([panels[~chosen], halved])
        of = np.concatenate([of[~chosen], of_halved])
        values = np.concatenate([values[~chosen], new_values])
        errors = np.concatenate([errors[~chosen], new_errors])
        done += np.bincount(of_halved, minlength=count)


def _sums(of: Indices, terms: Array, count: int) -> Array:
    return np.asarray(np.bincount(of, weights=terms, minlength=count), dtype=np.float64)


def _chosen(total: Array, of: Indices, wanting: NDArray[np.bool_], tolerance: Floats) -> NDArray[np.bool_]:
    """Return which panels are halved: of each integral that wants it, all but those that add up to half the tolerance.

    These are the panels with the smallest errors.
    """
    rows = np.flatnonzero(wanting[of])
    rows = rows[np.lexsort((total[rows], of[rows]))]
    first = np.searchsorted(of[rows], of[rows])  # position of the first panel of the same integral
    _, integral = np.unique(of[rows], return_inverse=True)
    place = np.arange(rows.size) - first
    table = np.zeros((int(integral.max()) + 1, int(place.max()) + 1))
    table[integral, place] = total[rows]
    chosen = np.zeros(total.size, dtype=bool)
    chosen[rows] = np.cumsum(table, axis=1)[integral, place] > 0.5 * tolerance[of[rows]]
    return chosen


def _halved(panels: Array, errors: Array) -> Array:
    """Return each panel cut in two, across the variable in which its rules differ most."""
    axis = np.argmax(errors, axis=1)
    row = np.arange(len(panels))
    low = panels.copy()
    high = panels.copy()
    half = panels[row, 2 + axis] / 2.0
    for child, sign in ((low, -1.0), (high, 1.0)):
        child[row, axis] += sign * half
        child[row, 2 + axis] = half
    return np.concatenate([low, high])


def _rules(integrand: Integrand, panels: Array, of: Indices, width: int) -> Integrals:
    """Return integrals over each panel, and their largest change with Gauss's rule in the first or second variable.

    The integrand gives `width` values per point, in a last axis.
    """
    values = np.empty((len(panels), width))
    errors = np.empty((len(panels), 2))
    step = max(_BATCH // width, _FEWEST)
    for start in range(0, len(panels), step):
        batch = slice(start, start + step)
        c_1, c_2, h_1, h_2 = (column[:, np.newaxis, np.newaxis] for column in panels[batch].T)
        f = integrand(of[batch], c_1 + h_1 * _X[:, np.newaxis], c_2 + h_2 * _X)
        by_first = _W_KRONROD @ f  # integral over the second variable, (panels, 15, width)
        by_second = (_W_KRONROD @ f.reshape(*f.shape[:2], -1)).reshape(by_first.shape)
        area = (h_1 * h_2)[:, 0]
        values[batch] = area * (_W_KRONROD @ by_first)
        errors[batch, 0] = _SAFETY * np.max(np.abs(values[batch] - area * (_W_GAUSS @ by_first)), axis=1)
        errors[batch, 1] = _SAFETY * np.max(np.abs(values[batch] - area * (_W_GAUSS @ by_second)), axis=1)
    return Integrals(values, errors)
