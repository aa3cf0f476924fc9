"""Estimates of a fit: numbers with standard errors and 95 % intervals, and pairs that samples do not distinguish."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.fitting.document import Correlation, Estimate
from brdfdb.fitting.fitted import FittedSurface
from brdfdb.fitting.surface import SCALE
from brdfdb.fitting.uncertainty import NORMAL_95, Profile
from brdfdb.fitting.variables import EDGE, NORMAL, Variable, index_of
from brdfdb.geometry import degrees
from brdfdb.materials import written_name

Array = NDArray[np.float64]

_STEP = 1e-6  # step of finite differences, in the unit cube
_CLOSE = 0.99  # correlation above which the samples do not distinguish two numbers
_SAME = 0.1  # relative difference of two standard errors of logarithms below which a ratio or a product is measured


def estimates_of(fitted: FittedSurface, *, profiles: bool) -> list[Estimate]:
    """Return all numbers of a fit: shared ones first, then those of each channel, then n and k where searched.

    With `profiles`, intervals are those of profiles where the number is at an end of its range, or where the deviance
    at an end of its interval is not what the covariance says.
    """
    surface, covariance = fitted.surface, fitted.covariance
    estimates = []
    for index, one in enumerate(surface.shape):
        variance = covariance.shape[index, index]
        profile = Profile(fitted.problem, fitted.point, covariance, shape=index) if profiles else None
        estimates.append(_of_variable(fitted, index, one, float(variance), profile))
    several = len(fitted.samples.channels) > 1
    for number, coefficient in enumerate(surface.coefficients):
        for channel, name in enumerate(fitted.samples.channels):
            value, variance = (float(a[number, channel]) for a in (fitted.point.values, covariance.coefficients))
            profile = None
            if profiles and not several:
                profile = Profile(fitted.problem, fitted.point, covariance, coefficient=number)
            error = float(np.sqrt(variance)) if np.isfinite(variance) else None
            interval = _interval(value, error, coefficient.low, coefficient.high, profile)
            spec = surface.terms[coefficient.term].spec
            unit = "1" if coefficient.name == SCALE else spec.parameter(coefficient.name).unit
            estimates.append(
                Estimate(
                    name=coefficient.label,
                    channel=name if several else None,
                    unit=unit,
                    value=value,
                    standard_error=error,
                    **interval._asdict(),
                )
            )
    return [*estimates, *_indices(fitted)]


class _Interval(NamedTuple):
    """A 95 % interval of a number, and the method that gives it."""

    low: float
    high: float
    method: Literal["covariance", "profile", "end of range"]


def _interval(best: float, error: float | None, low: float, high: float, profile: Profile | None) -> _Interval:
    """Return the 95 % interval of a number in the variable in which it is searched."""
    if profile is not None and (error is None or not profile.agrees(error)):
        return _Interval(*profile.interval(error), "profile")
    if error is None:
        return _Interval(best, best, "end of range")
    return _Interval(max(best - NORMAL_95 * error, low), min(best + NORMAL_95 * error, high), "covariance")


def _of_variable(
    fitted: FittedSurface, index: int, one: Variable, variance: float, profile: Profile | None
) -> Estimate:
    """Return the estimate of a shape variable."""
    surface = fitted.surface
    u = float(fitted.point.x[index])
    error = float(np.sqrt(variance)) if np.isfinite(variance) else None
    interval = _interval(u, error, 0.0, 1.0, profile)
    owner = surface.owners[index]
    parameter = None if owner is None else surface.terms[owner].spec.parameter(one.name)
    angle = parameter is not None and parameter.unit == "rad"

    def shown(place: float) -> float:
        value = one.value(min(max(place, 0.0), 1.0))
        return float(degrees(value)) if angle else value

    slope = (shown(u + _STEP) - shown(u - _STEP)) / (min(u + _STEP, 1.0) - max(u - _STEP, 0.0))
    name = surface.labels[index]
    if parameter is not None:
        name = f"{name.removesuffix(one.name)}{written_name(parameter)}"
    return Estimate(
        name=name,
        channel=None,
        unit="1" if parameter is None else "degree" if angle else parameter.unit,
        value=shown(u),
        standard_error=None if error is None else float(error * abs(slope)),
        low=shown(interval.low),
        high=shown(interval.high),
        method=interval.method,
    )


def _indices(fitted: FittedSurface) -> list[Estimate]:
    """Return n and k where they were searched, whose variance is that of the two variables in their place."""
    surface = fitted.surface
    x = fitted.point.x
    if not surface.searched_index:
        return []
    names = [one.name for one in surface.shape]
    at = [names.index(NORMAL), names.index(EDGE)]
    variances = fitted.covariance.shape[np.ix_(at, at)]
    variances = np.where(np.isfinite(variances), variances, 0.0)
    variables = [surface.shape[index] for index in at]
    best = x[at]

    def index_at(u: Array, part: int) -> float:
        return index_of(*(one.value(float(v)) for one, v in zip(variables, u, strict=True)))[part]

    estimates = []
    for name, part, least in (("n", 0, 0.01), ("k", 1, 0.0)):
        value = index_at(best, part)
        gradient = np.zeros(2)
        for axis in range(2):
            step = np.zeros(2)
            step[axis] = -_STEP if best[axis] > 0.5 else _STEP
            gradient[axis] = (index_at(best + step, part) - value) / step[axis]
        error = float(np.sqrt(max(float(gradient @ variances @ gradient), 0.0)))
        estimates.append(
            Estimate(
                name=name,
                channel=None,
                unit="1",
                value=value,
                standard_error=error or None,
                low=max(value - NORMAL_95 * error, least),
                high=value + NORMAL_95 * error,
                method="covariance" if error else "end of range",
            )
        )
    return estimates


def correlations_of(fitted: FittedSurface) -> list[Correlation]:
    """Return the pairs of numbers with a correlation near 1 or -1, with a sentence on what is measured."""
    surface, covariance = fitted.surface, fitted.covariance
    shapes = len(surface.shape)
    single = len(fitted.samples.channels) == 1
    count = shapes + (len(surface.coefficients) if single else 0)
    names = [*surface.labels, *(one.label for one in surface.coefficients)]
    matrix = covariance.both[:count, :count]
    with np.errstate(invalid="ignore"):
        errors = np.sqrt(np.diag(matrix))
    pairs = []
    for a in range(count):
        for b in range(a + 1, count):
            coefficient = matrix[a, b] / (errors[a] * errors[b]) if errors[a] > 0.0 and errors[b] > 0.0 else np.nan
            if not abs(coefficient) > _CLOSE:
                continue
            measured = "a combination of the two"
            first, second = (_relative_error(fitted, index, float(errors[index])) for index in (a, b))
            if first is not None and second is not None and abs(np.log(first / second)) < _SAME:
                measured = "their ratio" if coefficient > 0.0 else "their product"
            sentence = f"{names[a]} and {names[b]} are correlated by {coefficient:.3f}: only {measured} is measured."
            pairs.append(
                Correlation(first=names[a], second=names[b], coefficient=float(coefficient), sentence=sentence)
            )
    return pairs


def _relative_error(fitted: FittedSurface, index: int, error: float) -> float | None:
    """Return the standard error of the logarithm of a number; None if it is 0."""
    surface = fitted.surface
    if index < len(surface.shape):
        one = surface.shape[index]
        if one.logarithmic:
            return float(error * np.log(one.high / one.low))
        value = one.value(float(fitted.point.x[index]))
        return error * (one.high - one.low) / value if value > 0.0 else None
    value = float(fitted.point.values[index - len(surface.shape), 0])
    return error / value if value > 0.0 else None
