"""The uncertainty of a fit: covariance, resampled incidences, and profiles where the covariance misleads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.fitting.problem import Point, Problem
from brdfdb.parameters import Floats

NORMAL_95 = 1.959963984540054  # standard errors to each side of a 95 % interval
_RIDGE = 1e-13  # added to the normalised matrix, so that a direction without any information has a finite variance
_END = 1e-4  # distance from an end of the unit cube that is the end
_UNLIKE = 0.3  # relative difference of sqrt(deviance) from 1.96 at the ends of an interval: a profile is needed
_STEPS = 14  # of the search of an end of an interval
_FIRST = 0.02  # first step of a profile, of the range, for a number without a standard error
_EVALUATIONS = 25
_LEAST_NOISE = 1e-18  # variance of noise-free samples: residuals of 1e-9 are rounding
_DETERMINED = 1e-6  # share of the squares of a column that the other columns leave; less is not determined


class Covariance(NamedTuple):
    """Covariance of the numbers of a fit; nan for those at an end of their range."""

    place: Floats  # (S + Q, S + Q), of shape variables and nuisance numbers, in the unit cube
    channels: Floats  # (C, S + K, S + K), of shape variables and the coefficients of each channel
    noise: float  # factor between cost and deviance: twice the rise of the cost over it is chi-squared of one freedom


def noise_of(problem: Problem, residuals: Floats, searched: int) -> tuple[float, float]:
    """Return two factors, above 0: of the covariance of a robust fit, and between cost and deviance."""
    r = residuals[problem.residual.used]
    weights = 1.0 / np.hypot(1.0, r / problem.scale)
    squares = max(float(np.sum((r * weights) ** 2)) / max(r.size - searched, 1), _LEAST_NOISE)
    slope = float(np.mean(weights**3))
    return squares / slope**2, squares / slope


class FreeColumns(NamedTuple):
    """Derivatives of residuals by the numbers that are searched and not at an end of their range.

    `outer` (T, N, C) by shape variables and nuisance numbers, whose `indices` are those of `Point.place`; `inner`
    (K, N, C) by coefficients, of which `free` (K, C) are not at an end. `searched` is the number of all.
    """

    outer: Floats
    indices: NDArray[np.int64]
    inner: Floats
    free: NDArray[np.bool_]
    searched: int


def _free_columns(problem: Problem, point: Point) -> FreeColumns:
    inner, free = problem.coefficient_jacobian(point)
    places = point.place[problem.searched]
    inside = (places > _END) & (places < 1.0 - _END)
    indices = np.array(problem.searched, dtype=np.int64)[inside]
    return FreeColumns(problem.shape_jacobian(point)[inside], indices, inner, free, int(inside.sum() + free.sum()))


def covariance(problem: Problem, point: Point) -> Covariance:
    """Return the covariance of the numbers of a fit, from the derivatives of residuals at its best point."""
    outer, indices, inner, free, searched = _free_columns(problem, point)
    factor, noise = noise_of(problem, point.residuals, searched)
    reduced = np.zeros((len(outer), len(outer)))
    of_channels = []
    for c in range(inner.shape[2]):
        x, y = outer[:, :, c], inner[free[:, c], :, c]
        across, of_inner = x @ y.T, inverse(y @ y.T)
        reduced += x @ x.T - across @ of_inner @ across.T
        of_channels.append((of_inner, of_inner @ across.T))
    of_place = inverse(reduced)
    place = np.full((len(point.place),) * 2, np.nan)
    place[np.ix_(indices, indices)] = factor * of_place
    shapes = len(problem.surface.shape)
    channels = np.full((inner.shape[2], *(shapes + len(inner),) * 2), np.nan)
    channels[:, :shapes, :shapes] = place[:shapes, :shapes]
    of_shape = indices < shapes
    for c, (of_inner, gain) in enumerate(of_channels):
        own = shapes + np.flatnonzero(free[:, c])
        across = -factor * (gain @ of_place)[:, of_shape]
        channels[c][np.ix_(own, own)] = factor * (of_inner + gain @ of_place @ gain.T)
        channels[c][np.ix_(own, indices[of_shape])] = across
        channels[c][np.ix_(indices[of_shape], own)] = across.T
    return Covariance(place, channels, noise)


class GroupSpread(NamedTuple):
    """A step of Gauss and Newton from a point, and its spread with each group of samples left out in turn.

    `step` (S + Q,) is that of `Point.place`, `covariance` (S + Q, S + Q) that of independent residuals, `resampled`
    (S + Q, S + Q) that of the groups (delete-a-group jackknife); nan for numbers that do not move. `determined` are
    numbers that the others cannot replace. `coefficients` (K, C) are resampled variances, nan at a bound.
    """

    step: Floats
    covariance: Floats
    resampled: Floats
    coefficients: Floats
    determined: NDArray[np.bool_]
    groups: int

    @property
    def quantile(self) -> float:
        """Standard errors to each side of a 95 % interval: Student's t."""
        from scipy.stats import t

        return float(t.ppf(0.975, max(self.groups - 1, 1)))

    @property
    def inflation(self) -> float:
        """Square of a typical interval over that of independent residuals, at least 1."""
        alone, several = np.diag(self.covariance), np.diag(self.resampled)
        known = (alone > 0.0) & np.isfinite(several)
        ratio = float(np.median(several[known] / alone[known])) if known.any() else 1.0
        return max(ratio * (self.quantile / NORMAL_95) ** 2, 1.0)

    def ratio(self, index: int) -> float:
        """Return the size of the step of a number over its resampled standard error."""
        return float(np.abs(self.step[index]) / np.sqrt(max(self.resampled[index, index], 1e-300)))


def sums_by(groups: NDArray[np.int64]) -> Callable[[Floats], Floats]:
    """Return a function that sums the rows (N, ...) of each group (K, ...)."""
    order = np.argsort(groups, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(groups))[:-1]])
    return lambda rows: np.add.reduceat(rows[order], starts, axis=0)


def spread_of(problem: Problem, point: Point, groups: NDArray[np.int64], leave: Sequence[int] = ()) -> GroupSpread:
    """Return the step from a point to the least cost, its covariance, and that of the groups left out in turn.

    The steps are linear: what each group adds to the normal equations is taken from them. With K groups, the
    covariance is (K - 1) / K times the sum of the squared changes (the jackknife, CR3 of Bell and McCaffrey 2002).
    Numbers whose indices in `Point.place` are in `leave` do not move.
    """
    outer, indices, inner, free, searched = _free_columns(problem, point)
    moves = ~np.isin(indices, leave)
    outer, indices = outer[moves], indices[moves]
    weights = 1.0 / np.hypot(1.0, point.residuals / problem.scale)
    first = point.residuals * weights
    second = weights**3 * problem.residual.used
    sums = sums_by(groups)

    def without_each(rows: Floats) -> Floats:  # the sum over all, then less each group
        parts = sums(rows)
        return np.concatenate([[parts.sum(axis=0)], parts.sum(axis=0) - parts])

    shared, count = len(outer), int(groups.max()) + 1
    reduced = np.zeros((count + 1, shared, shared))
    gradient = np.zeros((count + 1, shared))
    squares = np.zeros(shared)
    of_channels = []
    for c in range(inner.shape[2]):
        x = np.concatenate([outer[:, :, c], inner[free[:, c], :, c]])
        normals = without_each((x[:, np.newaxis] * x * second[:, c]).transpose(2, 0, 1))
        slopes = without_each((x * first[:, c]).T)
        squares += np.diag(normals[0])[:shared]
        of_inner = np.array([inverse(matrix) for matrix in normals[:, shared:, shared:]])
        across = normals[:, :shared, shared:]
        reduced += normals[:, :shared, :shared] - across @ of_inner @ across.transpose(0, 2, 1)
        gradient += slopes[:, :shared] - np.einsum("kab,kbc,kc->ka", across, of_inner, slopes[:, shared:])
        of_channels.append((of_inner, across, slopes[:, shared:]))
    inverses = np.array([inverse(matrix) for matrix in reduced])
    steps = -np.einsum("kab,kb->ka", inverses, gradient)
    factor = (count - 1.0) / count
    coefficients = np.full(free.shape, np.nan)
    for c, (of_inner, across, slopes) in enumerate(of_channels):
        solved = -np.einsum("kab,kb->ka", of_inner, slopes + np.einsum("kab,ka->kb", across, steps))
        coefficients[free[:, c], c] = factor * np.sum((solved[1:] - solved[0]) ** 2, axis=0)
    moved = steps[1:] - steps[0]
    noise, _ = noise_of(problem, point.residuals, searched)
    mean = float(np.mean(second[problem.residual.used]))
    spread = GroupSpread(
        step=np.full(len(point.place), np.nan),
        covariance=np.full((len(point.place),) * 2, np.nan),
        resampled=np.full((len(point.place),) * 2, np.nan),
        coefficients=coefficients,
        determined=np.zeros(len(point.place), dtype=np.bool_),
        groups=count,
    )
    block = np.ix_(indices, indices)
    spread.step[indices] = steps[0]
    spread.covariance[block] = inverses[0] * noise * mean  # the normal matrix has the mean slope of the robust cost
    spread.resampled[block] = factor * moved.T @ moved
    spread.determined[indices] = np.diag(reduced[0]) > _DETERMINED * squares
    return spread


def inverse(matrix: Floats) -> Floats:
    """Return the inverse of a normal matrix, scaled before: units of its rows differ by powers of ten."""
    if not len(matrix):
        return matrix
    size = np.sqrt(np.maximum(np.diag(matrix), 1e-60 * max(float(np.max(np.diag(matrix))), 1e-30)))
    scaled = matrix / np.outer(size, size) + _RIDGE * np.eye(len(matrix))
    return np.asarray(np.linalg.pinv(scaled, rcond=1e-15, hermitian=True) / np.outer(size, size))


class Profile:
    """The deviance of a fit as a function of one number, with all others searched.

    `index` is that of `Covariance.channels`: a shape variable or, where the problem has one channel, a coefficient.
    """

    def __init__(self, problem: Problem, point: Point, known: Covariance, index: int) -> None:
        shapes = len(problem.surface.shape)
        self.problem, self.point, self.noise = problem, point, known.noise
        self.shape = index if index < shapes else None
        self.coefficient = None if index < shapes else index - shapes
        self.low, self.high = 0.0, 1.0
        if self.coefficient is not None:
            coefficient = problem.surface.coefficients[self.coefficient]
            self.low, self.high = coefficient.low, coefficient.high
        self.best = float(point.x[index] if index < shapes else point.values[index - shapes, 0])
        along = np.nan_to_num(known.channels[0, :shapes, index] / known.channels[0, index, index])
        self.along = np.where(np.isfinite(along), along, 0.0)  # changes of the others with the fixed number

    def deviation(self, at: float) -> float:
        """Return the square root of the deviance with the number fixed: 1.96 at the ends of a 95 % interval."""
        p = self.problem
        fixed = p.fixed if self.shape is None else {**p.fixed, self.shape: at}
        fixed_coefficients = None if self.coefficient is None else {self.coefficient: at}
        one = Problem(p.surface, p.view, p.residual, fixed, fixed_coefficients, p.nuisance, p.scale)
        begin = self.point.place
        begin[: len(self.along)] = np.clip(self.point.x + self.along * (at - self.best), 0.0, 1.0)
        cost = one.descend(begin[one.searched], _EVALUATIONS).cost
        return float(np.sqrt(max(2.0 * (cost - self.point.cost) / self.noise, 0.0)))

    def agrees(self, error: float) -> bool:
        """Return True if the interval of the covariance has the deviance of a 95 % interval at both ends."""
        for end in (self.best - NORMAL_95 * error, self.best + NORMAL_95 * error):
            if not self.low < end < self.high:
                return False
            if abs(self.deviation(end) / NORMAL_95 - 1.0) > _UNLIKE:
                return False
        return True

    def interval(self, error: float | None) -> tuple[float, float]:
        """Return the 95 % interval; an end of the range where the samples set no limit.

        `error` is the standard error of the covariance, from which the search begins, or None.
        """
        known = error is not None and np.isfinite(error) and error > 0.0
        span = min(self.high - self.low, max(abs(self.best), 1.0))
        step = min(NORMAL_95 * float(error), span) if known and error is not None else _FIRST * span
        return self._end(-step), self._end(step)

    def _end(self, step: float) -> float:
        bound = self.low if step < 0.0 else self.high
        inner, inner_deviation = self.best, 0.0
        while True:
            outer = self.best + step
            if (outer - bound) * step >= 0.0:
                outer = bound
            deviation = self.deviation(outer)
            if deviation >= NORMAL_95:
                return _root(self.deviation, inner, inner_deviation, outer, deviation)
            if outer == bound:
                return bound
            inner, inner_deviation, step = outer, deviation, 2.0 * step


def _root(function: Callable[[float], float], inner: float, below: float, outer: float, above: float) -> float:
    """Return where a function is 1.96, between two points on either side.

    Secants, and bisections in turn: a number that the samples set a limit to on one side alone has a flat profile that
    becomes steep, along which secants hardly move.
    """
    for step in range(_STEPS):
        share = 0.5 if step % 2 else float(np.clip((NORMAL_95 - below) / (above - below), 0.05, 0.95))
        middle = inner + share * (outer - inner)
        value = function(middle)
        if abs(value / NORMAL_95 - 1.0) < 0.01:
            return middle
        if value < NORMAL_95:
            inner, below = middle, value
        else:
            outer, above = middle, value
    return inner + (NORMAL_95 - below) / (above - below) * (outer - inner)
