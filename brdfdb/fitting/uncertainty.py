"""The uncertainty of a fit: covariance, correlations, and profiles where the covariance misleads."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.fitting.problem import Point, Problem
from brdfdb.parameters import Floats

Array = NDArray[np.float64]

NORMAL_95 = 1.959963984540054  # standard errors to each side of a 95 % interval
_RIDGE = 1e-13  # added to the normalised matrix, so that a direction without any information has a finite variance
_END = 1e-4  # distance from an end of the unit cube that is the end
_UNLIKE = 0.3  # relative difference of sqrt(deviance) from 1.96 at the ends of an interval: a profile is needed
_STEPS = 14  # of the search of an end of an interval
_FIRST = 0.02  # first step of a profile, of the range, for a number without a standard error
_EVALUATIONS = 25
_LEAST_NOISE = 1e-18  # variance of noise-free samples: residuals of 1e-9 are rounding


class Covariance(NamedTuple):
    """Covariance of the numbers of a fit; nan for those at an end of their range."""

    shape: Array  # (S, S), of all shape variables, in the unit cube
    coefficients: Array  # (K, C), variances
    both: Array  # (S + K, S + K), of shape and the coefficients of the first channel
    noise: float  # factor between cost and deviance: twice the rise of the cost over it is chi-squared of one freedom
    searched: int  # numbers that were searched and are not at an end


def noise_of(problem: Problem, residuals: Floats, searched: int) -> tuple[float, float]:
    """Return two factors, above 0: of the covariance of a robust fit, and between cost and deviance."""
    r = residuals[problem.residual.used]
    z = (r / problem.scale) ** 2
    squares = max(float(np.sum(r * r / (1.0 + z))) / max(r.size - searched, 1), _LEAST_NOISE)
    slope = float(np.mean((1.0 + z) ** -1.5))
    return squares / slope**2, squares / slope


def covariance(problem: Problem, point: Point) -> Covariance:
    """Return the covariance of the numbers of a fit, from the derivatives of residuals at its best point."""
    inner, free = problem.coefficient_jacobian(point)
    columns = problem.shape_jacobian(point)
    inside = np.array([_END < point.x[j] < 1.0 - _END for j in problem.free], dtype=bool)
    searched = int(inside.sum() + free.sum())
    factor, noise = noise_of(problem, point.residuals, searched)
    some = columns[inside]
    count = len(inner)
    shapes = len(problem.surface.shape)
    of_channels = []
    for c in range(point.f_r.shape[1]):
        outer = some[:, :, c]
        of_inner = inner[free[:, c], :, c]
        of_channels.append((outer @ outer.T, outer @ of_inner.T, of_inner @ of_inner.T))
    reduced = np.zeros((len(some), len(some)))
    for a, b, d in of_channels:
        reduced += a - b @ _inverse(d) @ b.T
    of_shape = _inverse(reduced)
    variances = np.full((count, point.f_r.shape[1]), np.nan)
    for c, (_, b, d) in enumerate(of_channels):
        inverse = _inverse(d)
        gain = inverse @ b.T
        variances[free[:, c], c] = factor * np.diag(inverse + gain @ of_shape @ gain.T)
    indices = np.array(problem.free, dtype=np.int64)[inside]
    shape = np.full((shapes, shapes), np.nan)
    shape[np.ix_(indices, indices)] = factor * of_shape
    both = np.full((shapes + count,) * 2, np.nan)
    _, b, d = of_channels[0]
    inverse = _inverse(d)
    gain = inverse @ b.T
    first = shapes + np.flatnonzero(free[:, 0])
    both[np.ix_(indices, indices)] = factor * of_shape
    both[np.ix_(first, first)] = factor * (inverse + gain @ of_shape @ gain.T)
    both[np.ix_(first, indices)] = -factor * gain @ of_shape
    both[np.ix_(indices, first)] = both[np.ix_(first, indices)].T
    return Covariance(shape, variances, both, noise, searched)


def _inverse(matrix: Array) -> Array:
    """Return the inverse of a normal matrix, scaled before: units of its rows differ by powers of ten."""
    if not len(matrix):
        return matrix
    size = np.sqrt(np.maximum(np.diag(matrix), 1e-60 * max(float(np.max(np.diag(matrix))), 1e-30)))
    scaled = matrix / np.outer(size, size) + _RIDGE * np.eye(len(matrix))
    return np.asarray(np.linalg.pinv(scaled, rcond=1e-15, hermitian=True) / np.outer(size, size))


class Profile:
    """The deviance of a fit as a function of one number, with all others searched.

    The number is a shape variable or, where the problem has one channel, a coefficient.
    """

    def __init__(
        self,
        problem: Problem,
        point: Point,
        known: Covariance,
        *,
        shape: int | None = None,
        coefficient: int | None = None,
    ) -> None:
        self.problem = problem
        self.point = point
        self.noise = known.noise
        self.shape, self.coefficient = shape, coefficient
        if shape is not None:
            self.low = 0.0
            self.high = 1.0
            self.best = float(point.x[shape])
        else:
            assert coefficient is not None
            one = problem.surface.coefficients[coefficient]
            self.low = one.low
            self.high = one.high
            self.best = float(point.values[coefficient, 0])
        shapes = len(problem.surface.shape)
        index = shape if shape is not None else shapes + int(coefficient or 0)
        along = np.nan_to_num(known.both[:shapes, index] / known.both[index, index])
        self.along = np.where(np.isfinite(along), along, 0.0)  # changes of the others with the fixed number

    def deviation(self, at: float) -> float:
        """Return the square root of the deviance with the number fixed: 1.96 at the ends of a 95 % interval."""
        p = self.problem
        fixed = p.fixed if self.shape is None else {**p.fixed, self.shape: at}
        fixed_coefficients = None if self.coefficient is None else {self.coefficient: at}
        one = Problem(p.surface, p.view, p.residual, fixed, fixed_coefficients)
        one.scale = p.scale
        begin = np.clip(self.point.x + self.along * (at - self.best), 0.0, 1.0)
        cost = one.descend(begin[one.free], _EVALUATIONS).cost
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
        inner = self.best
        inner_deviation = 0.0
        while True:
            outer = self.best + step
            if (outer - bound) * step >= 0.0:
                outer = bound
            deviation = self.deviation(outer)
            if deviation >= NORMAL_95:
                return _root(self.deviation, inner, inner_deviation, outer, deviation)
            if outer == bound:
                return bound
            inner = outer
            inner_deviation = deviation
            step = 2.0 * step


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
