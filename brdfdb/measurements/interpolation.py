"""Interpolation of scattered samples: a simple base, and radial functions of the logarithm of f_r over the base."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.measurements.coordinates import beyond, features, half_angles, places
from brdfdb.measurements.record import HeldOut
from brdfdb.measurements.samples import Samples
from brdfdb.parameters import Floats

Base = Callable[[Floats, Floats], Floats]  # f_r [1/sr] (N, C) at unit vectors (N, 3)

FLOOR = 1e-3  # floor of relative errors, as a share of the mean f_r times cosine
_CENTRES = 700  # largest number of radial functions
_SEARCHED = 300  # samples among which scales are chosen
_ALPHAS = np.geomspace(0.01, 2.0, 24)  # widths of the lobe of the base that are tried
_SEEN = 5  # samples within the width of a lobe that are needed to see its height
_SCALES = (0.5, 1.0, 2.0, 4.0)  # of the coordinates, tried against each other
_ROUGHNESS = (0.01, 0.1)  # noise that no uncertainty states, relative to the spread of the logarithm, tried
_PARTS = 10  # parts of samples without a pattern, held out one at a time
_MOST_ROUNDS = 24  # incidences that are held out one by one; more of them are held out in groups
_SIGMAS = 1.4826  # standard deviations in the median magnitude of normal noise, inverted
_ABSURD = 3.0  # times the noise, and the largest value, is what no value is below 0 by
_OFTEN = 3  # samples with the same number below 0 that make it suspicious
_JITTER = 1e-9  # added to the diagonal of a matrix, relative to it, so that rounding leaves it positive
_EXCHANGED = np.array([1.0, 1.0, -1.0, 1.0, 1.0])  # factors on the coordinates if light and viewer are exchanged
_SEED = 1998


class _Scales(NamedTuple):
    half: float
    difference: float
    exchange: float
    noise: float


@dataclass(frozen=True, eq=False)
class SampleInterpolation:
    """f_r of samples everywhere: a base times a smooth ratio.

    The logarithm is asinh(f_r / (2 noise)), which is linear where f_r is less than its noise: values below 0 count.
    """

    base: Base  #: f_r [1/sr] that the ratio is taken to
    alpha: float  #: width [1] of the lobe that the coordinates crowd in
    #: noise of small values: their uncertainty, or that of the values below 0, which a few wrong ones do not set, (C,)
    #: [1/sr]
    level: Floats
    #: scales of the coordinates, and the noise of the logarithm that no uncertainty states, relative to its spread
    scales: _Scales
    turned: bool  #: True if the samples can tell the azimuth of the light
    mean: Floats  #: mean of the logarithm of the ratio, (C,)
    #: smallest cosine of a light or a viewer that was measured. Directions closer to the horizon have the values there,
    #: as in tables: a lobe that is continued may reflect any amount
    lowest: float
    reciprocal: bool = False  #: True if f_r is the same with light and viewer exchanged, as each sample is then, too
    #: centres, weights: centres of the radial functions in the coordinates, and their weights, (M, D) (M, C)
    centres: Floats = field(default_factory=lambda: np.empty((0, 0)))
    weights: Floats = field(default_factory=lambda: np.empty((0, 0)))

    def __call__(self, wi: Floats, wr: Floats) -> Floats:
        """Return f_r [1/sr] (N, C), at least 0, at unit vectors (N, 3)."""
        wi, wr = (_raised(w, self.lowest) for w in (wi, wr))
        values = np.empty((len(wi), self.level.size))
        for start in range(0, len(wi), 1 << 13):
            some = slice(start, start + (1 << 13))
            x = features(wi[some], wr[some], self.alpha, self.scales[:3], turned=self.turned)
            number = _logarithm(self.base(wi[some], wr[some]), self.level) + self.mean
            values[some] = 2.0 * self.level * np.sinh(number + self.functions(x, self.centres) @ self.weights)
        return np.maximum(values, 0.0)

    def functions(self, x: Floats, centres: Floats) -> Floats:
        """Return the radial functions (N, M) of centres (M, D) at points (N, D) of the coordinates."""
        values = _radial(x, centres)
        if self.reciprocal:
            values += _radial(x * _EXCHANGED[: x.shape[1]], centres)
        return values


def _raised(w: Floats, lowest: float) -> Floats:
    """Return unit vectors (N, 3) with cosines of at least `lowest`, at the same azimuths."""
    sine = np.sqrt((1.0 - lowest**2) / np.maximum(1.0 - w[:, 2] ** 2, 1e-12))
    raised = np.stack([w[:, 0] * sine, w[:, 1] * sine, np.full(len(w), lowest)], axis=1)
    return np.where((w[:, 2] < lowest)[:, np.newaxis], raised, w)


def _logarithm(f_r: Floats, level: Floats) -> Floats:
    return np.asarray(np.arcsinh(f_r / (2.0 * level)))


def _radial(x: Floats, centres: Floats) -> Floats:
    """Return (1 + r) exp(-r) of the distances r between points (N, D) and centres (M, D)."""
    r: Floats = np.sum(x**2, axis=1)[:, np.newaxis] + np.sum(centres**2, axis=1)
    r -= 2.0 * x @ centres.T  # in place: new memory takes as long as the exponential
    np.sqrt(np.maximum(r, 0.0, out=r), out=r)
    decay = np.negative(r)
    np.exp(decay, out=decay)
    r += 1.0
    r *= decay
    return r


class LobeBase(NamedTuple):
    """A base, the width of its lobe [1], and its name in words."""

    f_r: Base
    alpha: float
    words: str


class _LobeFit(NamedTuple):
    """Coefficients (3, C) of a base with a lobe of a width [1], and the residual of its fit."""

    residual: float
    alpha: float
    tail: bool
    coefficients: Floats


def lambert_and_lobe(samples: Samples) -> LobeBase:
    """Return the base that fits samples best.

    It is Lambert and one lobe in tan theta_h, Gaussian or with a tail, alone and with Schlick's fifth power, over a
    denominator that is never 0; coefficients are not negative. A lobe that a few samples do not lie within could
    have any height, and is not tried.
    """
    from scipy.optimize import nnls

    wi, wr, values, _ = _listed(samples)
    some = np.random.default_rng(_SEED).permutation(len(wi))[: 4 * _SEARCHED]
    wi = wi[some]
    wr = wr[some]
    values = values[some]
    weight = 1.0 / (np.abs(values) + FLOOR * np.nanmean(np.abs(values), axis=0))
    best: _LobeFit | None = None
    tan2 = np.sort(half_angles(wi, wr).tan2_h)
    narrowest = np.sqrt(tan2[min(_SEEN, tan2.size) - 1])
    for alpha, tail in itertools.product(np.append(_ALPHAS[narrowest <= _ALPHAS], _ALPHAS[-1]), (False, True)):
        columns = _columns(wi, wr, alpha, tail=tail)
        fits = [
            nnls(columns[good] * weight[good, c, np.newaxis], values[good, c] * weight[good, c])
            for c in range(values.shape[1])
            for good in [np.isfinite(values[:, c])]
        ]
        residual = float(sum(residual for _, residual in fits))
        if best is None or residual < best.residual:
            best = _LobeFit(residual, float(alpha), tail, np.stack([fit for fit, _ in fits], axis=1))
    assert best is not None
    chosen = best

    def base(wi: Floats, wr: Floats) -> Floats:
        return np.asarray(_columns(wi, wr, chosen.alpha, tail=chosen.tail) @ chosen.coefficients)

    kind = "with a tail" if chosen.tail else "Gaussian"
    return LobeBase(base, chosen.alpha, f"Lambert and one {kind} lobe of width {chosen.alpha:.2g}")


def _columns(wi: Floats, wr: Floats, alpha: float, *, tail: bool) -> Floats:
    tan2, theta_d = half_angles(wi, wr)
    slope = tan2 / alpha**2
    lobe = (1.0 + slope) ** -2.0 if tail else np.exp(-slope)
    lobe = lobe / (wi[:, 2] + wr[:, 2] - wi[:, 2] * wr[:, 2])
    return np.stack([np.full(len(wi), 1.0 / np.pi), lobe, lobe * (1.0 - np.cos(theta_d)) ** 5], axis=1)


def _listed(samples: Samples) -> tuple[Floats, Floats, Floats, Floats | None]:
    """Return directions and values of the samples with a value in any channel; ParameterError for fewer than ten."""
    rows = np.flatnonzero(samples.known.any(axis=1))
    if rows.size < _PARTS:
        raise ParameterError("samples", f"{rows.size} values are too few; a table needs {_PARTS} or more", rows.size)
    uncertainty = None if samples.uncertainty is None else samples.uncertainty[rows]
    return samples.w_i[rows], samples.w_r[rows], samples.values[rows], uncertainty


def _check_values(samples: Samples) -> None:
    """Refuse samples of which no value is above 0, or that stand for holes with numbers that noise does not explain.

    Such a number is below minus three times the largest value, or occurs three times or more in a channel, and is below
    0 by three times the noise or the tenth percentile of the values above 0.
    """
    values = samples.values
    largest = np.max(values, where=samples.known, initial=0.0)
    lowest = np.min(values, where=samples.known, initial=0.0)
    if not largest > 0.0:
        raise ParameterError("values", "no value is above 0: there is nothing to tabulate", float(largest))
    if lowest < -_ABSURD * largest:
        text = f"{lowest:g} is not a possible f_r, whose largest value is {largest:g}; a hole must be nan"
        raise ParameterError("values", text, lowest)
    for channel, column in zip(samples.channels, values.T, strict=True):
        numbers, counts = np.unique(column[column < 0.0], return_counts=True)
        often = numbers[counts >= _OFTEN]
        if often.size == 0 or not np.any(column > 0.0):
            continue
        noise = [
            np.percentile(column[column > 0.0], 10.0),
            _SIGMAS * np.median(np.append(-numbers[numbers > often[0]], 0.0)),
        ]
        if samples.uncertainty is not None:
            noise.append(np.nanmedian(samples.uncertainty))
        if -often[0] > _ABSURD * max(noise):
            times = int(counts[np.searchsorted(numbers, often[0])])
            raise ParameterError(
                "values",
                f"{often[0]:g} is the value of {times} samples of {channel}, and no f_r; a hole is nan",
                often[0],
            )


def _noise_below_zero(values: Floats) -> Floats:
    """Return the noise [1/sr] (C,) that values below 0 show; 0 without any.

    It is that of the median of their magnitudes, and at most the magnitude that twice as many values stay below: where
    f_r is less than its noise, half of the values are below 0.
    """
    noise = np.zeros(values.shape[1])
    for c, column in enumerate(values.T):
        below = -column[column < 0.0]
        if below.size:
            small = np.sort(np.abs(column[np.isfinite(column)]))
            noise[c] = min(_SIGMAS * np.median(below), small[min(2 * below.size, small.size) - 1])
    return noise


def floor_of(samples: Samples) -> Floats:
    """Return the floor [1/sr] (C,) of relative errors: `FLOOR` of the mean f_r of the samples, above 0."""
    mean = np.nanmean(np.abs(samples.values), axis=0)
    return np.asarray(np.maximum(FLOOR * mean, 1e-12))


class _Problem(NamedTuple):
    """Samples as the least-squares problem reads them."""

    #: wi, wr: directions, (N, 3)
    wi: Floats
    wr: Floats
    values: Floats  #: f_r; nan in holes, (N, C) [1/sr]
    #: of_base, y: logarithm of the base, and the number to interpolate: the logarithm of f_r less that of the base, (N,
    #: C)
    of_base: Floats
    y: Floats
    noise: Floats  #: noise of y, relative to its spread, (N,)
    group: NDArray[np.int64]  #: groups that are held out together, (N,)

    def some(self, rows: NDArray[Any]) -> _Problem:
        return _Problem(*(part[rows] for part in self))


class Fitted(NamedTuple):
    """The interpolation of samples, its error at samples that were held out, and its base in words."""

    f_r: SampleInterpolation
    held_out: HeldOut
    base: str


def fit(samples: Samples, base: Base | None = None, *, reciprocal: bool = False) -> Fitted:
    """Fit the interpolation of ten samples or more.

    `base` is f_r that the ratio is taken to; by default `lambert_and_lobe`, of the same samples. Of `reciprocal` data
    each sample counts with light and viewer exchanged, too; the base must be reciprocal. ParameterError if there are
    too few samples, no value is above 0, or numbers far below 0 stand for holes.

    Notes
    -----
    The radial functions (1 + r) exp(-r) are those of a smooth random function with noise, of which the result is the
    most likely one. Their scales are those with the smallest error at samples that are held out. Of scans, which have
    many viewers for one light, all samples of a light are held out together: neighbours in a scan would tell too much.
    The gap is then twice that of the samples, and the stated error is rather too large between incidences than too
    small: of two lights it is that of extrapolation. Nothing is tested in wider gaps and in holes, which
    `brdfdb.measurements.extent.Extent` marks. Samples without such a pattern are held out in ten parts, by chance.
    """
    _check_values(samples)
    lobe = lambert_and_lobe(samples)
    f_base = lobe.f_r if base is None else base
    problem, level, scheme = _problem(samples, f_base)
    mean = problem.y.mean(axis=0)
    lowest = float(min(problem.wi[:, 2].min(), problem.wr[:, 2].min()))
    order = np.random.default_rng(_SEED).permutation(len(problem.wi))
    few = problem.some(order[:_SEARCHED])
    tried = [
        SampleInterpolation(
            f_base, lobe.alpha, level, _Scales(half * both, both, both, noise), samples.turned, mean, lowest, reciprocal
        )
        for half, both, noise in itertools.product((1.0, 2.0), _SCALES, _ROUGHNESS)
    ]
    scores = [np.mean(np.minimum(np.abs(_held_out(one, few, few) - few.y), 3.0)) for one in tried]
    chosen = tried[int(np.argmin(scores))]
    centres = problem.some(order[:_CENTRES])
    held_out = _stated(samples, problem, _held_out(chosen, problem, centres), chosen, scheme)
    at = _x(chosen, centres)
    weights = _solved(*_normal(chosen, problem, chosen.functions(_x(chosen, problem), at)), chosen.functions(at, at))
    return Fitted(
        replace(chosen, centres=at, weights=weights), held_out, lobe.words if base is None else "the given base"
    )


def _problem(samples: Samples, base: Base) -> tuple[_Problem, Floats, str]:
    """Return the problem, the noise (C,) [1/sr] of small values, and the scheme by which groups are held out."""
    wi, wr, values, uncertainty = _listed(samples)
    level = np.maximum(_noise_below_zero(values), floor_of(samples))
    if uncertainty is not None:
        uncertainty = np.where(np.isnan(uncertainty), np.nanmedian(uncertainty), uncertainty)  # as of the others
        level = np.maximum(np.median(uncertainty, axis=0), level)
    of_base = _logarithm(base(wi, wr), level)
    y = _logarithm(values, level) - of_base
    y = np.where(np.isfinite(y), y, np.nanmean(y, axis=1, keepdims=True))  # a hole of one channel is like the others
    noise = np.zeros(len(wi))
    if uncertainty is not None:
        slope = np.sqrt(values**2 + 4.0 * level**2)
        noise = np.nan_to_num(np.nanmean(uncertainty / slope, axis=1)) / max(float(np.std(y)), 1e-3)
    known = samples.selected(np.flatnonzero(samples.known.any(axis=1)))
    lights = int(known.incidence.max()) + 1
    pairs = int(known.pair.max()) + 1
    scans = lights > 1 and known.scanned
    rng = np.random.default_rng(_SEED)
    if scans:
        group = np.arange(lights) if lights <= _MOST_ROUNDS else rng.permutation(lights) % _MOST_ROUNDS
        group = group[known.incidence]
    else:
        apart = known.pair if pairs > 1 else np.arange(len(wi))
        group = (rng.permutation(int(apart.max()) + 1) % _PARTS)[apart]
    return _Problem(wi, wr, values, of_base, y, noise, group), level, "incidences" if scans else "folds"


def _x(how: SampleInterpolation, problem: _Problem) -> Floats:
    return features(problem.wi, problem.wr, how.alpha, how.scales[:3], turned=how.turned)


def _normal(how: SampleInterpolation, problem: _Problem, phi: Floats) -> tuple[Floats, Floats]:
    """Return the matrix and the right sides of the normal equations of some samples, from radial functions at them."""
    weighted = phi / (problem.noise**2 + how.scales.noise**2)[:, np.newaxis]
    return weighted.T @ phi, weighted.T @ (problem.y - how.mean)


def _solved(matrix: Floats, right: Floats, smooth: Floats) -> Floats:
    """Return the weights of radial functions; values at all centres make them smooth where samples do not tell."""
    from scipy.linalg import cho_factor, cho_solve

    whole = matrix + smooth
    whole[np.diag_indices_from(whole)] *= 1.0 + _JITTER
    return np.asarray(cho_solve(cho_factor(whole), right))


def _held_out(how: SampleInterpolation, problem: _Problem, centres: _Problem) -> Floats:
    """Return the numbers (N, C) that the interpolation gives at each group of samples from those of the others.

    The centres of radial functions stay: only values tell, not places.
    """
    at = _x(how, centres)
    phi = how.functions(_x(how, problem), at)
    smooth = how.functions(at, at)
    matrix, right = _normal(how, problem, phi)
    predicted = np.empty_like(problem.y)
    for group in np.unique(problem.group):
        own = problem.group == group
        own_matrix, own_right = _normal(how, problem.some(own), phi[own])
        predicted[own] = phi[own] @ _solved(matrix - own_matrix, right - own_right, smooth) + how.mean
    return predicted


def _stated(samples: Samples, problem: _Problem, predicted: Floats, how: SampleInterpolation, scheme: str) -> HeldOut:
    """Return the error at samples that were held out and lie within the directions of the others."""
    inside = np.ones(len(problem.wi), dtype=bool)
    x = places(problem.wi, problem.wr, turned=samples.turned)
    for group in np.unique(problem.group):
        own = problem.group == group
        others = x[~own] if samples.turned else np.concatenate([x[~own], x[~own] * [1.0, 1.0, -1.0]])
        inside[own] = ~beyond(x[own], others)
    counted = inside if inside.any() else ~inside
    f_r = np.maximum(2.0 * how.level * np.sinh(problem.of_base + predicted), 0.0)[counted]
    values = problem.values[counted]
    floor = floor_of(samples)
    known = np.isfinite(values)
    off = np.abs(f_r - values)
    errors = off / np.maximum(f_r, floor)
    error = errors[known]
    median, p95, p99, largest = (float(f"{x:.3g}") for x in np.percentile(error, [50.0, 95.0, 99.0, 100.0]))
    stated = HeldOut(
        scheme="incidences" if scheme == "incidences" else "folds",
        rounds=int(np.unique(problem.group).size),
        samples=int(np.count_nonzero(counted)),
        outside=int(np.count_nonzero(~inside)),
        floor=[float(f"{x:.3g}") for x in floor],
        l1=float(f"{off[known].sum() / max(np.abs(values[known]).sum(), 1e-300):.3g}"),
        median=median,
        p95=p95,
        p99=p99,
        max=largest,
    )
    # held-out lights of reciprocal samples tell errors between viewers, too
    lowest = np.minimum(problem.wi[:, 2], problem.wr[:, 2])[counted]
    return stated.with_levels(errors, f_r, lowest) if how.reciprocal else stated
