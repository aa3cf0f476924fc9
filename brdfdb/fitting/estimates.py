"""Estimates of a fit: numbers with standard errors and 95 % intervals, and pairs that samples do not distinguish."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from brdfdb.fitting.document import Correlation, Estimate, Method
from brdfdb.fitting.search import FittedSurface
from brdfdb.fitting.surface import SCALE
from brdfdb.fitting.uncertainty import NORMAL_95, GroupSpread, Profile
from brdfdb.fitting.variables import EDGE, NORMAL, index_of
from brdfdb.geometry import degrees
from brdfdb.materials import written_name
from brdfdb.parameters import Floats

_STEP = 1e-6  # step of finite differences, in the unit cube
_CLOSE = 0.99  # correlation above which the samples do not distinguish two numbers
_SAME = 0.1  # relative difference of two standard errors of logarithms below which a ratio or a product is measured


class SearchedNumber(NamedTuple):
    """A number of a fit, in the variable in which it is searched.

    The variances are those of the covariance and of resampled incidences; nan where there is none. `shown` converts the
    variable to the number of the document, and `slope` is its derivative.
    """

    name: str
    unit: str
    best: float
    low: float
    high: float
    variance: float
    resampled: float
    channel: str | None = None
    shown: Callable[[float], float] = float
    slope: float = 1.0

    def estimate(self, spread: GroupSpread | None, profile: Profile | None = None) -> Estimate:
        """Return the number with the 95 % interval of its covariance, or a better one that is known.

        An interval of resampled incidences is taken where it is wider. Otherwise that of the profile is taken where the
        number is at an end of its range, or where the deviance at an end of its interval is not what the covariance
        says.
        """
        error = float(np.sqrt(self.variance)) if np.isfinite(self.variance) else None
        resampled = 0.0 if error is None or not np.isfinite(self.resampled) else float(np.sqrt(self.resampled))
        reach = 0.0
        method: Method = "end of range"
        if error is not None:
            reach, method = NORMAL_95 * error, "covariance"
        if spread is not None and spread.quantile * resampled > reach:
            reach, method = spread.quantile * resampled, "incidences"
        low, high = max(self.best - reach, self.low), min(self.best + reach, self.high)
        if profile is not None and method != "incidences" and (error is None or not profile.agrees(error)):
            low, high = profile.interval(error)
            method = "profile"
        return Estimate(
            name=self.name,
            channel=self.channel,
            unit=self.unit,
            value=self.shown(self.best),
            standard_error=None if error is None else max(error, resampled) * abs(self.slope),
            low=self.shown(low),
            high=self.shown(high),
            method=method,
        )


def estimates_of(fitted: FittedSurface, *, profiles: bool, spread: GroupSpread | None = None) -> list[Estimate]:
    """Return all numbers of a fit: shared ones first, then those of each channel, then n and k where searched.

    With a `spread`, standard errors and intervals are those of resampled incidences where they are wider. With
    `profiles`, intervals are those of profiles where the covariance misleads.
    """
    covariance = fitted.covariance
    if spread is not None:  # profiles rise as slowly as the spread of incidences says
        covariance = covariance._replace(noise=covariance.noise * spread.inflation)
    several = len(fitted.samples.channels) > 1
    shapes = [_shape(fitted, index, spread) for index in range(len(fitted.surface.shape))]
    estimates = []
    for index, number in enumerate([*shapes, *_coefficients(fitted, spread)]):
        profile = None
        if profiles and (index < len(shapes) or not several):
            profile = Profile(fitted.problem, fitted.point, covariance, index)
        estimates.append(number.estimate(spread, profile))
    return [*estimates, *(number.estimate(spread) for number in _indices(fitted, spread))]


def nuisance_estimates(fitted: FittedSurface, spread: GroupSpread | None = None) -> list[Estimate]:
    """Return the nuisance numbers of a fit."""
    estimates = []
    for index, number in enumerate(fitted.nuisance.numbers, len(fitted.surface.shape)):
        place = float(fitted.point.place[index])

        def shown(u: float, size: float = number.size) -> float:
            return size * (2.0 * u - 1.0)

        variances, slope = _variances(fitted, index, spread), 2.0 * number.size
        searched = SearchedNumber(number.name, number.unit, place, 0.0, 1.0, *variances, shown=shown, slope=slope)
        estimates.append(searched.estimate(spread))
    return estimates


def _variances(fitted: FittedSurface, index: int, spread: GroupSpread | None) -> tuple[float, float]:
    """Return the two variances of a shape variable or a nuisance number, by its index in `Point.place`."""
    resampled = np.nan if spread is None else float(spread.resampled[index, index])
    return float(fitted.covariance.place[index, index]), resampled


def _shape(fitted: FittedSurface, index: int, spread: GroupSpread | None) -> SearchedNumber:
    """Return a shape variable, in the unit cube."""
    surface, variable = fitted.surface, fitted.surface.shape[index]
    u, owner = float(fitted.point.x[index]), surface.owners[index]
    parameter = None if owner is None else surface.terms[owner].spec.parameter(variable.name)
    angle = parameter is not None and parameter.unit == "rad"

    def shown(place: float) -> float:
        value = variable.value(min(max(place, 0.0), 1.0))
        return float(degrees(value)) if angle else value

    name, unit = surface.labels[index], "1"
    if parameter is not None:
        name = f"{name.removesuffix(variable.name)}{written_name(parameter)}"
        unit = "degree" if angle else parameter.unit
    slope = (shown(u + _STEP) - shown(u - _STEP)) / (min(u + _STEP, 1.0) - max(u - _STEP, 0.0))
    return SearchedNumber(name, unit, u, 0.0, 1.0, *_variances(fitted, index, spread), shown=shown, slope=slope)


def _coefficients(fitted: FittedSurface, spread: GroupSpread | None) -> list[SearchedNumber]:
    """Return the coefficients, channel by channel."""
    surface, channels = fitted.surface, fitted.samples.channels
    variances = np.diagonal(fitted.covariance.channels, axis1=1, axis2=2)[:, len(surface.shape) :]
    numbers = []
    for row, coefficient in enumerate(surface.coefficients):
        scale = coefficient.name == SCALE
        unit = "1" if scale else surface.terms[coefficient.term].spec.parameter(coefficient.name).unit
        for column, channel in enumerate(channels):
            numbers.append(
                SearchedNumber(
                    coefficient.label,
                    unit,
                    float(fitted.point.values[row, column]),
                    coefficient.low,
                    coefficient.high,
                    float(variances[column, row]),
                    np.nan if spread is None else float(spread.coefficients[row, column]),
                    channel if len(channels) > 1 else None,
                )
            )
    return numbers


def _indices(fitted: FittedSurface, spread: GroupSpread | None) -> list[SearchedNumber]:
    """Return n and k where they were searched, whose variance is that of the two variables in their place."""
    surface = fitted.surface
    if not surface.searched_index:
        return []
    names = [variable.name for variable in surface.shape]
    at = [names.index(NORMAL), names.index(EDGE)]
    best = fitted.point.x[at]
    variances = np.nan_to_num(fitted.covariance.place[np.ix_(at, at)])
    resampled = np.full((2, 2), np.nan) if spread is None else spread.resampled[np.ix_(at, at)]
    if np.all(np.isfinite(resampled)):
        variances = resampled

    def index_at(u: Floats, part: int) -> float:
        return index_of(*(surface.shape[index].value(float(v)) for index, v in zip(at, u, strict=True)))[part]

    numbers = []
    for name, part, least in (("n", 0, 0.01), ("k", 1, 0.0)):
        value = index_at(best, part)
        gradient = np.zeros(2)
        for axis in range(2):
            step = np.zeros(2)
            step[axis] = -_STEP if best[axis] > 0.5 else _STEP
            gradient[axis] = (index_at(best + step, part) - value) / step[axis]
        variance = float(gradient @ variances @ gradient)
        variance = variance if variance > 0.0 else np.nan
        numbers.append(
            SearchedNumber(name, "1", value, least, np.inf, variance, variance if variances is resampled else np.nan)
        )
    return numbers


def correlations_of(fitted: FittedSurface) -> list[Correlation]:
    """Return the pairs of numbers with a correlation near 1 or -1, with a sentence on what is measured."""
    surface = fitted.surface
    shapes = len(surface.shape)
    count = shapes + (len(surface.coefficients) if len(fitted.samples.channels) == 1 else 0)
    names = [*surface.labels, *(one.label for one in surface.coefficients)]
    matrix = fitted.covariance.channels[0, :count, :count]
    with np.errstate(invalid="ignore"):
        errors = np.sqrt(np.diag(matrix))
    pairs = []
    for a, b in itertools.combinations(np.flatnonzero(errors > 0.0).tolist(), 2):
        coefficient = float(matrix[a, b] / (errors[a] * errors[b]))
        if not abs(coefficient) > _CLOSE:
            continue
        measured = "a combination of the two"
        first, second = (_relative_error(fitted, index, float(errors[index])) for index in (a, b))
        if first is not None and second is not None and abs(np.log(first / second)) < _SAME:
            measured = "their ratio" if coefficient > 0.0 else "their product"
        sentence = f"{names[a]} and {names[b]} are correlated by {coefficient:.3f}: only {measured} is measured."
        pairs.append(Correlation(first=names[a], second=names[b], coefficient=coefficient, sentence=sentence))
    return pairs


def _relative_error(fitted: FittedSurface, index: int, error: float) -> float | None:
    """Return the standard error of the logarithm of a number; None if it is 0."""
    shapes = len(fitted.surface.shape)
    if index >= shapes:
        value = float(fitted.point.values[index - shapes, 0])
        return error / value if value > 0.0 else None
    variable = fitted.surface.shape[index]
    if variable.logarithmic:
        return float(error * np.log(variable.high / variable.low))
    value = variable.value(float(fitted.point.x[index]))
    return error * (variable.high - variable.low) / value if value > 0.0 else None
