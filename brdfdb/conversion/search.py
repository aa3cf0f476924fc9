"""The search for the parameters of a model that come closest to a source."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.conversion.minimisation import downhill
from brdfdb.conversion.nodes import Nodes
from brdfdb.conversion.target import Target
from brdfdb.fitting.variables import best_apart, spread
from brdfdb.integrals.pairs import WIDTHS

Array = NDArray[np.float64]

SPREAD = 4096  # points of the unit cube, of which those with a lobe about as wide are tried
TRIED = 160  # points that are tried at coarse nodes
FEW_TRIED = 40  # of a model whose values are integrals, or whose colours are searched for each
BEGINNINGS = 3  # points from which simplexes go downhill
STEPS = 1 + 2 * BEGINNINGS  # calls of `tick` in a search, at most
_COARSE, _FINE = 1e-4, 1e-7  # tolerances of simplexes at coarse and at all nodes
_FIRST_EDGE, _NEXT_EDGE = 0.1, 0.02  # of the simplexes of colours, which begin where the last ones ended
_COLOURS = 1e-6  # tolerance of the simplexes of colours, below that of the shared parameters
_PROMISING = 1.03  # times the least distance at coarse nodes: the nodes themselves change less
REFUSED = 1e9  # distance of parameters that are not tried
# Lobes narrower than this, relative to the lobe that nodes follow, are not tried: nodes would miss them
_NARROWEST = 0.25
# Widths of lobes, relative to that of the source, that are tried where lightness is weighed, to keep a highlight
_SAME_HIGHLIGHT = 0.5, 2.0
# Share by which the distance rises, at most four times less, from the middle of ranges to their ends. It decides where
# nothing else does, as between surfaces of He and Torrance with the same slopes
_LOOSE = 1e-3
_AS_GOOD = 1.01  # times the least distance


class Result(NamedTuple):
    """The parameters that came closest.

    Attributes
    ----------
    numbers : dict
        Parameters that all wavelengths share, with n and k where they were searched.
    distance : float
        Distance [1] at the nodes of the search.
    as_good : dict
        Range of each number among the sets with nearly this distance.
    evaluations : int
        Sets of parameters that were tried.
    """

    numbers: dict[str, float]
    distance: float
    as_good: dict[str, tuple[float, float]]
    evaluations: int


class Distance:
    """The mean distance over the columns of a truth, as a function of a point of the unit cube of shared parameters.

    The colours of each column are searched inside, from where the last search ended.
    """

    def __init__(self, target: Target, nodes: Nodes, columns: NDArray[np.int64], alphas: Array) -> None:
        self.target, self.nodes, self.columns = target, nodes, columns
        free = not set(target.spec.lobe_axes or ()) & set(target.fixed)
        low, high = _SAME_HIGHLIGHT if nodes.weigh == "lightness" and free else (_NARROWEST, np.inf)
        self.narrowest = low * np.where(np.isnan(alphas), WIDTHS[1], alphas)
        self.widest = high * np.where(np.isnan(alphas), np.inf, alphas)
        self.loose = np.array([variable.loose for variable in target.shape], dtype=bool)
        self.colours = np.full((columns.size, len(target.colours)), 0.5)
        self.edge = _FIRST_EDGE
        self.record: list[tuple[float, dict[str, float]]] = []

    def __call__(self, shape: Array) -> float:
        """Return the distance [1], with a trifle for loose variables; `REFUSED` where nodes do not resolve the lobe."""
        numbers = self.target.numbers(shape)
        widths = self.target.lobe_alphas(numbers)
        if np.any((widths < self.narrowest) | (widths > self.widest)):
            return REFUSED
        total = 0.0
        for row, column in enumerate(self.columns.tolist()):
            best, self.colours[row] = self.of_column(numbers, row, column)
            total += best
        self.edge = _NEXT_EDGE
        mean = total / self.columns.size
        mean = min(mean, REFUSED) if math.isfinite(mean) else REFUSED
        mean *= 1.0 + _LOOSE * float(np.mean((shape[self.loose] - 0.5) ** 2)) if self.loose.any() else 1.0
        self.record.append((mean, numbers))
        return mean

    def of_column(self, numbers: Mapping[str, float], row: int, column: int) -> tuple[float, Array]:
        """Return the distance [1] in a column of the truth, with the colours that make it least.

        `row` is the column of the truth at the nodes, `column` the wavelength of the target.
        """
        nodes, target = self.nodes, self.target
        f_r = target.coloured(numbers, column, nodes.wi, nodes.wr)

        def left(colours: Array) -> float:
            values = {v.name: v.value(u) for v, u in zip(target.colours, colours.tolist(), strict=True)}
            mirror = target.specular(target.arguments(numbers, column, values), nodes.theta)
            with np.errstate(all="ignore"):  # extreme parameters may raise flags; the sum is tested
                return nodes.distance(row, f_r(colours), mirror)

        if not target.colours:
            return left(np.zeros(0)), np.zeros(0)
        size = np.full(len(target.colours), self.edge)
        best, value = downhill(left, self.colours[row], size, tolerance=_COLOURS, most=60 * size.size)
        return value, best


def search(
    target: Target, coarse: Nodes, fitted: Nodes, columns: NDArray[np.int64], alphas: Array, tick: Callable[[], None]
) -> Result:
    """Search the shared parameters.

    Parameters
    ----------
    target : Target
        The model.
    coarse, fitted : Nodes
        The truth at few nodes, for many sets of parameters, and at those of the last descents.
    columns : array of int
        Wavelengths of the target in the columns of both.
    alphas : array (2,) [1]
        Widths of the lobe of the source along x and y; nan for a diffuse one.
    tick : callable
        A function that is called `STEPS` times.

    Returns
    -------
    Result
        The best parameters.

    Notes
    -----
    Points are spread evenly over the ranges of the parameters. The first of them, and those whose lobe is most nearly
    as wide as that of the source, are tried at coarse nodes. Simplexes begin at the best three that are not near each
    other, and go downhill at coarse nodes. Ends within 3 % of the best go on at all nodes.
    """
    distances = Distance(target, coarse, columns, alphas), Distance(target, fitted, columns, alphas)
    steps = np.array([variable.step for variable in target.shape])
    if not target.shape:
        distances[1](np.zeros(0))
        return _result(distances)
    points = _beginnings(target, alphas)
    values = np.array([distances[0](point) for point in points])
    tick()
    starts = []
    for point in best_apart(points, values, BEGINNINGS):
        starts.append(downhill(distances[0], point, steps, tolerance=_COARSE, most=80 * steps.size))
        tick()
    ends, values = np.array([end for end, _ in starts]), np.array([value for _, value in starts])
    good = values <= _PROMISING * values.min()
    for point in best_apart(ends[good], values[good], BEGINNINGS):
        downhill(distances[1], point, 0.2 * steps, tolerance=_FINE, most=100 * steps.size)
        tick()
    return _result(distances)


def _result(distances: tuple[Distance, Distance]) -> Result:
    record = distances[1].record
    if not record:
        return Result({}, REFUSED, {}, 0)
    best, numbers = min(record, key=lambda entry: entry[0])
    near = [entry[1] for entry in record if entry[0] <= _AS_GOOD * best]
    ranges = {name: (min(one[name] for one in near), max(one[name] for one in near)) for name in numbers}
    return Result(numbers, best, ranges, sum(len(distance.record) for distance in distances))


def _beginnings(target: Target, alphas: Array) -> Array:
    """Return points of the unit cube to try, spread over it: half of them any, half those whose lobe is as wide."""
    points = spread(SPREAD, len(target.shape))
    tried = FEW_TRIED if target.spec.slow or target.colours else TRIED
    if target.spec.lobe is None or np.isnan(alphas).any():
        return points[:tried]
    with np.errstate(all="ignore"):  # a lobe of extreme parameters may be no number
        widths = np.array([target.lobe_alphas(target.numbers(point)) for point in points])
        off = np.abs(np.log(widths / alphas)).sum(axis=1)
    nearest = np.argsort(np.where(np.isfinite(off), off, np.inf), kind="stable")
    # A highlight may best be left out, by a lobe of another width
    wide = np.flatnonzero(np.all(widths >= _NARROWEST * alphas, axis=1))
    chosen = np.unique(np.concatenate([nearest[: tried // 2], wide[: tried // 2]]))
    return np.asarray(points[chosen])
