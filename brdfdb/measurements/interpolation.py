"""Interpolation of scattered samples: a simple base, and radial functions of the logarithm of f_r over the base."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.geometry import degrees
from brdfdb.measurements.coordinates import beyond, features, places
from brdfdb.measurements.glints import Glint, Glints, offsets_deg
from brdfdb.measurements.lobe_base import Base, LobeBase, lambert_and_lobe
from brdfdb.measurements.peaks import SamplePeak, glint_of, peaks_of, tracks_of
from brdfdb.measurements.record import HeldOut, Noise
from brdfdb.measurements.regions import Regions
from brdfdb.measurements.samples import Samples
from brdfdb.measurements.usable_values import (
    NEAR,
    check_values,
    contradict,
    floor_of,
    listed,
    noise_below_zero,
    noise_between,
)
from brdfdb.parameters import Floats

_MOST_CENTRES = 2500  # samples up to which each has a radial function
_CENTRES = 700  # radial functions of more samples
_SEARCHED = 500  # samples among which scales are chosen
_TOLD = 1200  # samples among which noise and peaks are looked for if there are too many
_SCALES = (0.5, 1.0, 2.0, 4.0)  # of the coordinates, tried against each other
_ROUGHNESS = (0.01, 0.1)  # noise that no uncertainty states, relative to the spread of the logarithm, tried
_SHORT = (0.05, 0.15, 0.4)  # narrower radial functions that are tried
_REACH = 0.2  # of what a light shows alone, as a share of the gap between lights
_FINE = 0.001  # noise of what they interpolate, relative to its spread
_NOISES = np.geomspace(3e-4, 0.3, 7)  # relative to the spread of the logarithm, of which the most likely one is taken
_PARTS = 10  # parts of samples without a pattern, held out one at a time
_MOST_ROUNDS = 24  # incidences that are held out one by one; more of them are held out in groups
_SIGMAS = 1.4826  # standard deviations in the median magnitude of normal noise, inverted
_JITTER = 1e-9  # added to the diagonal of a matrix, relative to it, so that rounding leaves it positive
_EXCHANGED = np.array([1.0, 1.0, -1.0, 1.0, 1.0])  # factors on the coordinates if light and viewer are exchanged
_CLEAR = 4.0  # standard deviations by which a peak stands above what the other samples predict
_AT_MIRROR_DEG = 1.0  # offset up to which a peak that other lights have too is a lobe
_SAME_IMAGE_DEG = 0.1  # distance of a sample from the mirror image of another, at most
_LOPSIDED = 2.0  # ratio of f_r to that of the mirror image beside a peak that is no lobe
_BRIGHT = 0.05  # share of the top from which on that counts
_MOST_GLINTS = 200  # glints of an isotropic surface beside the plane of incidence
_HIGHER = np.log(1.5)  # logarithm by which it does
_WRONG = 8.0  # standard deviations by which a single sample is wrong, if its neighbours agree
_AROUND = 8  # neighbours that must agree
_WRONG_BY = np.log(1.3)
_WITHIN = 2.5  # times its noise is how far f_r may pass from a sample
_AT_ONCE = 512  # directions whose radial functions are computed together, so that these lie in a cache
_NAMED = 12  # wrong samples that are named
_SEED = 1998


class _Scales(NamedTuple):
    """Scales of the coordinates, and the noise of the logarithm that no uncertainty states, relative to its spread."""

    half: float
    difference: float
    exchange: float
    noise: float


class NarrowPart(NamedTuple):
    """Radial functions that are narrower by `short`, and reach `apart` [rad] from the light of their sample.

    Each light of an instrument differs from a smooth f_r in a way of its own: lights in between do not.
    """

    short: float
    apart: float
    turned: bool
    #: coordinates of the samples, and if f_r is reciprocal, also with light and viewer exchanged, (M, D + 1 or 3)
    centres: tuple[Floats, ...]
    weights: Floats  # (M, C)

    def points(self, light: Floats, x: Floats) -> Floats:
        """Return coordinates (N, D + 1), or (N, D + 3) if turned, of lights (N, 3) and the coordinates (N, D)."""
        place = light if self.turned else np.arccos(np.clip(light[:, 2:], 0.0, 1.0))
        return np.hstack([x / self.short, place / self.apart])

    def both(self, wi: Floats, wr: Floats, x: Floats, *, exchanged: bool) -> tuple[Floats, ...]:
        """Return the coordinates of unit vectors (N, 3), and if that is asked for, those with both exchanged."""
        given = self.points(wi, x)
        return (given, self.points(wr, x * _EXCHANGED[: x.shape[1]])) if exchanged else (given,)

    def functions(self, wi: Floats, wr: Floats, x: Floats) -> Floats:
        """Return the radial functions (N, M) at unit vectors (N, 3), with coordinates (N, D)."""
        points = self.both(wi, wr, x, exchanged=len(self.centres) > 1)
        return np.asarray(sum(_radial(one, centres) for one in points for centres in self.centres))


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
    #: what samples show more than the smooth part allows
    narrow: NarrowPart | None = None

    def __call__(self, wi: Floats, wr: Floats) -> Floats:
        """Return f_r [1/sr] (N, C), at least 0, at unit vectors (N, 3)."""
        wi, wr = (_raised(w, self.lowest) for w in (wi, wr))
        values = np.empty((len(wi), self.level.size))
        for start in range(0, len(wi), _AT_ONCE):
            some = slice(start, start + _AT_ONCE)
            x = features(wi[some], wr[some], self.alpha, self.scales[:3], turned=self.turned)
            number = _logarithm(self.base(wi[some], wr[some]), self.level) + self.mean
            number += self.functions(x, self.centres) @ self.weights
            if self.narrow is not None:
                number += self.narrow.functions(wi[some], wr[some], x) @ self.narrow.weights
            values[some] = 2.0 * self.level * np.sinh(number)
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
    from scipy.spatial.distance import cdist

    r = np.asarray(cdist(x, centres))
    decay = np.exp(-r)
    r += 1.0
    r *= decay
    return r


class _Problem(NamedTuple):
    """Samples as the interpolation reads them."""

    #: wi, wr: directions, (N, 3)
    wi: Floats
    wr: Floats
    values: Floats  #: f_r; nan in holes, (N, C) [1/sr]
    #: of_base, y: logarithm of the base, and the number to interpolate: the logarithm of f_r less that of the base, (N,
    #: C)
    of_base: Floats
    y: Floats
    noise: Floats  #: noise of y that the file states, or 0, relative to its spread, (N,)
    #: group, fold: groups that are held out together, by incidences if there are, and at random, (N,)
    group: NDArray[np.int64]
    fold: NDArray[np.int64]
    #: row, place: number of the sample, and its number among those with values, (N,)
    row: NDArray[np.int64]
    place: NDArray[np.int64]

    def some(self, rows: NDArray[Any]) -> _Problem:
        return _Problem(*(part[rows] for part in self))


class Fitted(NamedTuple):
    """The interpolation of samples, its error at samples that were held out, and its base in words.

    Glints are peaks that it leaves out, `outliers` sentences on samples that it does not pass through.
    """

    f_r: SampleInterpolation
    held_out: HeldOut
    base: str
    noise: Noise | None
    glints: Glints | None
    outliers: list[str]


def fit(samples: Samples, base: Base | None = None, *, reciprocal: bool | None = None) -> Fitted:
    """Fit the interpolation of ten samples or more.

    `base` is f_r that the ratio is taken to; by default `lambert_and_lobe`, of the same samples. Of `reciprocal` data
    each sample counts with light and viewer exchanged, too; the base must be reciprocal. By default it is tried whether
    samples that are held out follow better then, unless a base is given. ParameterError if there are too few samples,
    no value is above 0, or numbers far below 0 stand for holes.

    Notes
    -----
    The radial functions (1 + r) exp(-r) are those of a smooth random function with noise, of which the result is the
    most likely one (kriging). Up to 2500 samples have one each: values at groups of samples follow from the others by
    blocks of one inverse (Ginsbourger and Schaerer 2024). More samples share 700. Scales are those with the smallest
    error at samples that are held out. Noise that no file states is that of repeats, or of the most likely function,
    or of exchanged pairs if that is smaller. The result passes each sample within 2.5 times its noise.

    A sample of a scan far above what the samples around and those of other lights predict is the top of a glint,
    and the smooth part passes what the glint leaves there. A sample that differs alone is an outlier, and left out.

    Of scans, which have many viewers for one light, all samples of a light are held out together: neighbours in
    a scan would tell too much. The gap is then twice that of the samples, and the stated error is rather too large
    between incidences than too small: of two lights it is that of extrapolation. Nothing is tested in wider gaps and
    in holes, which `brdfdb.measurements.extent.Extent` marks. Samples without such a pattern are held out in ten
    parts, by chance; those of scans as well, which gives the errors at measured lights.
    """
    check_values(samples)
    lobe = lambert_and_lobe(samples if reciprocal is not None else _without_peaks(samples))
    exchanges = (False, base is None and not contradict(samples)) if reciprocal is None else (reciprocal,)
    f_base = lobe.f_r if base is None else base
    problem, level = _problem(samples, f_base)
    lowest = float(min(problem.wi[:, 2].min(), problem.wr[:, 2].min()))
    order = np.random.default_rng(_SEED).permutation(len(problem.wi))
    few = problem.some(order[:_SEARCHED])
    tried = [
        SampleInterpolation(
            f_base,
            lobe.alpha,
            level,
            _Scales(half * both, both, both, noise),
            samples.turned,
            problem.y.mean(axis=0),
            lowest,
            exchanged,
        )
        for exchanged in sorted(set(exchanges))
        for half, both, noise in itertools.product((1.0, 2.0), _SCALES, _ROUGHNESS)
    ]
    # Samples that are far off, such as those of glints, count as others do
    scores = [np.mean(np.minimum(np.abs(_predicted(_kriged(how, few), few.group)), 3.0)) for how in tried]
    how = tried[int(np.argmin(scores))]
    peaks: list[SamplePeak] = []
    wrong: list[int] = []
    used = np.ones(len(problem.wi), dtype=bool)
    if reciprocal is None:
        peaks, wrong, used = _peaks(samples, how, problem, order)
    noise = _noise_of(samples, how, problem, order, used)
    how = replace(how, mean=problem.y[used].mean(axis=0))
    fine = _passing(how, problem.some(used), noise)
    glints: list[Glint] = []
    if peaks:
        peaks, glints, problem, used = _glints(samples, peaks, fine.f_r, problem, used)
        fine = _passing(how, problem.some(used), noise)
        glints = [_with_error(samples, peak, number, glints, fine.f_r) for number, peak in enumerate(peaks)]
    f_r = fine.f_r
    held_out = _held_out(samples, fine, problem.some(used), lobe)
    known = np.flatnonzero(samples.known.any(axis=1))
    found = None
    if glints:
        lights = _lights_deg(samples.selected(known))
        found = Glints(glints=tuple(glints), turned=samples.turned).with_dark_lights(lights[:, 0], lights[:, 1])
    words = lobe.words if base is None else "the given base"
    return Fitted(f_r, held_out, words, noise.record, found, _outliers(samples, wrong, f_r))


def _problem(samples: Samples, base: Base) -> tuple[_Problem, Floats]:
    """Return the problem, and the noise (C,) [1/sr] of small values."""
    wi, wr, values, uncertainty = listed(samples)
    level = np.maximum(noise_below_zero(values), floor_of(samples))
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
    row = np.flatnonzero(samples.known.any(axis=1))
    known = samples.selected(row)
    rng = np.random.default_rng(_SEED)
    lights = int(known.incidence.max()) + 1
    pairs = int(known.pair.max()) + 1
    apart = known.pair if pairs > 1 else np.arange(len(wi))
    if _by_incidences(known):
        group = np.arange(lights) if lights <= _MOST_ROUNDS else rng.permutation(lights) % _MOST_ROUNDS
        group = group[known.incidence]
        fold = (rng.permutation(int(apart.max()) + 1) % _PARTS)[apart]
    else:
        group = fold = (rng.permutation(int(apart.max()) + 1) % _PARTS)[apart]
    return _Problem(wi, wr, values, of_base, y, noise, group, fold, row, np.arange(len(row))), level


def _by_incidences(known: Samples) -> bool:
    return known.scanned and int(known.incidence.max()) > 0


def _x(how: SampleInterpolation, problem: _Problem) -> Floats:
    return features(problem.wi, problem.wr, how.alpha, how.scales[:3], turned=how.turned)


class _Kriged(NamedTuple):
    """The inverse (N, N) of the covariance of samples, and that times their numbers, (N, C)."""

    inverse: Floats
    weights: Floats


def _covariance(how: SampleInterpolation, problem: _Problem, variance: Floats) -> Floats:
    """Return the covariance (N, N) of samples with the variance (N,) of their noise."""
    x = _x(how, problem)
    matrix = how.functions(x, x)
    matrix[np.diag_indices_from(matrix)] *= 1.0 + _JITTER
    matrix[np.diag_indices_from(matrix)] += variance
    return matrix


def _variance(how: SampleInterpolation, problem: _Problem) -> Floats:
    return np.asarray(problem.noise**2 + how.scales.noise**2)


def _kriged(how: SampleInterpolation, problem: _Problem) -> _Kriged:
    inverse = _inverse(_covariance(how, problem, _variance(how, problem)))
    return _Kriged(inverse, inverse @ (problem.y - how.mean))


def _inverse(matrix: Floats) -> Floats:
    """Return the inverse of a positive definite matrix (N, N), which is overwritten."""
    from scipy.linalg.lapack import dpotrf, dpotri

    factor, _ = dpotrf(matrix.T, lower=1, overwrite_a=1)
    inverse, _ = dpotri(factor, lower=1, overwrite_c=1)
    inverse = np.tril(inverse)
    inverse += np.tril(inverse, -1).T
    return np.asarray(inverse)


def _predicted(kriged: _Kriged, group: NDArray[np.int64]) -> Floats:
    """Return differences (N, C) of groups of samples, each predicted from those of the other groups."""
    off = np.empty_like(kriged.weights)
    order = np.argsort(group, kind="stable")
    for own in np.split(order, np.flatnonzero(np.diff(group[order])) + 1):
        off[own] = np.linalg.solve(kriged.inverse[np.ix_(own, own)], kriged.weights[own])
    return off


def _peaks(
    samples: Samples, how: SampleInterpolation, problem: _Problem, order: NDArray[np.int64]
) -> tuple[list[SamplePeak], list[int], NDArray[np.bool_]]:
    """Return peaks that neither neighbours nor other lights predict, wrong samples, and those (N,) of neither.

    Rows of peaks and of wrong samples count among all samples.
    """
    known = samples.selected(problem.row)
    used = np.ones(len(problem.wi), dtype=bool)
    height = (problem.y + problem.of_base).mean(axis=1)
    candidates = peaks_of(known, height) if known.scanned else []
    told = np.arange(len(order))
    if len(order) > _MOST_CENTRES:
        own = [np.append(peak.ring, peak.top) for peak in candidates]
        told = np.unique(np.concatenate([order[:_TOLD], *own[:_TOLD]]))
    kriged = _kriged(how, problem.some(told))
    single = kriged.weights / np.diag(kriged.inverse)[:, np.newaxis]
    spread = 1.0 / np.sqrt(np.diag(kriged.inverse))
    sigma = max(float(_SIGMAS * np.median(np.abs(single.mean(axis=1)) / spread)), 1e-9)
    place = np.full(len(order), -1)
    place[told] = np.arange(len(told))
    found = []
    for peak in candidates:
        own = place[np.append(peak.top, peak.ring)]
        if np.any(own < 0):
            continue
        covariance = np.linalg.inv(kriged.inverse[np.ix_(own, own)])
        off = (covariance @ kriged.weights[own]).mean(axis=1)
        deviation = sigma * np.sqrt(np.diag(covariance))
        predicted = off[0] <= max(_HIGHER, _CLEAR * deviation[0])
        faint = np.nanmax(known.values[peak.top] / how.level) < _WRONG
        if faint or (predicted and not (samples.turned or _off_mirror(known, peak))):
            continue  # noise around 0, or the narrow lobe of a glossy surface
        found.append(peak)
        used[peak.top] = False
        used[peak.ring] = False
    wrong = _wrong(how, problem, told, used)
    used[wrong] = False
    row = problem.row
    peaks = [SamplePeak(int(row[peak.top]), row[peak.ring], peak.step_deg, peak.reach_deg) for peak in found]
    return peaks, [int(row[one]) for one in wrong], used


def _without_peaks(samples: Samples) -> Samples:
    """Return the samples without the peaks that are glints whatever other lights have."""
    known = samples.selected(np.flatnonzero(samples.known.any(axis=1)))
    if not known.scanned:
        return samples
    height = np.nanmean(_logarithm(known.values, floor_of(samples)), axis=1)
    rest = np.ones(len(known), dtype=bool)
    for peak in peaks_of(known, height):
        if known.turned or _off_mirror(known, peak):
            rest[np.append(peak.ring, peak.top)] = False
    return known.selected(rest) if np.count_nonzero(rest) >= _SEARCHED // 10 else samples


def _off_mirror(known: Samples, peak: SamplePeak) -> bool:
    """Return whether a peak is no lobe around the mirror direction, so that no isotropic grid has nodes for it.

    It lies far from that direction and falls towards it, which the flank of a lobe whose middle nobody measured does
    not; or samples beside it are not those of its mirror image.
    """
    rows = np.append(peak.top, peak.ring)
    at = np.stack(offsets_deg(known.w_i[rows], known.w_r[rows]), axis=1)
    offset = np.hypot(*at.T)
    if np.any(offset[1:] < offset[0] - 0.5 * peak.step_deg) and offset[0] > max(_AT_MIRROR_DEG, 0.6 * peak.step_deg):
        return True
    values = np.nan_to_num(known.values[rows]).mean(axis=1)
    return bool(np.any(_lopsided(at, values) & (values > _BRIGHT * values[0])))


def _lopsided(at: Floats, values: Floats) -> NDArray[np.bool_]:
    """Return which values (N,) at offsets (N, 2) [degree] are far above that of the mirror image."""
    images = np.linalg.norm(at[:, np.newaxis] * [1.0, -1.0] - at, axis=2) < _SAME_IMAGE_DEG
    return np.asarray(np.any(images & (values[:, np.newaxis] > _LOPSIDED * values), axis=1))


def _wrong(how: SampleInterpolation, problem: _Problem, told: NDArray[np.int64], used: NDArray[np.bool_]) -> list[int]:
    """Return samples that differ from what all others predict, although their neighbours do not."""
    told = told[used[told]]
    if len(told) < _PARTS:
        return []
    kriged = _kriged(how, problem.some(told))
    spread = 1.0 / np.sqrt(np.diag(kriged.inverse))
    off = kriged.weights.mean(axis=1) * spread**2
    sigma = max(float(_SIGMAS * np.median(np.abs(off) / spread)), 1e-9)
    suspects = np.flatnonzero(np.abs(off) > np.maximum(_WRONG * sigma * spread, _WRONG_BY))
    if not suspects.size or suspects.size > 0.02 * len(told) + 1:
        return []  # that many are no accident
    rest = np.setdiff1d(np.arange(len(told)), suspects)
    again = _kriged(how, problem.some(told[rest]))
    others = np.abs(again.weights.mean(axis=1)) / np.sqrt(np.diag(again.inverse)) / sigma
    x = _x(how, problem.some(told))
    wrong = []
    for one in suspects.tolist():
        distance = np.linalg.norm(x - x[one], axis=1)
        near = np.argsort(distance[rest])[:_AROUND]
        reach = distance[rest[near[-1]]]
        alone = np.count_nonzero(distance[suspects] <= reach) == 1
        if alone and np.all(others[near] < _CLEAR):
            wrong.append(int(told[one]))
    return wrong


class _Noise(NamedTuple):
    """Distance from each sample (N,) at which f_r may pass, and the record of the noise."""

    allowed: Floats
    record: Noise | None


def _noise_of(
    samples: Samples, how: SampleInterpolation, problem: _Problem, order: NDArray[np.int64], used: NDArray[np.bool_]
) -> _Noise:
    """Return the noise that the file states, or that repeats, exchanged pairs or neighbours show."""
    floor = floor_of(samples)
    if samples.uncertainty is not None:
        relative = (samples.uncertainty / np.maximum(np.abs(samples.values), floor))[samples.known]
        absolute = problem.noise * max(float(np.std(problem.y)), 1e-3)
        return _Noise(_WITHIN * absolute, _recorded(relative[np.isfinite(relative)], "stated"))
    known = samples.selected(problem.row[used])
    height = (problem.y + problem.of_base).mean(axis=1)[used]
    origin: Literal["repeats", "reciprocal pairs", "neighbours"] = "repeats"
    noise = noise_between(known, height, exchanged=False)
    if noise is None:
        dense = problem.some(_dense(problem, order[used[order]]))
        origin, noise = "neighbours", max(_likely(how, dense, float(one)) for one in _NOISES)[1]
        pairs = noise_between(known, height, exchanged=True)
        if pairs is not None and pairs < noise:
            origin, noise = "reciprocal pairs", pairs
    height_of = np.abs(np.nan_to_num(samples.values))
    slope = np.sqrt(height_of**2 + 4.0 * how.level**2) / np.maximum(height_of, how.level)
    near = np.inf if origin == "repeats" else NEAR / slope.max(axis=1)[problem.row]
    allowed = np.minimum(np.full(len(problem.wi), _WITHIN * noise), near)
    slope = np.sqrt(height_of**2 + 4.0 * how.level**2) / np.maximum(height_of, floor)
    return _Noise(allowed, _recorded((noise * slope)[samples.known], origin))


def _dense(problem: _Problem, order: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return samples that lie as close as all do: those of some groups if there are too many."""
    if len(order) <= _TOLD:
        return order
    number = problem.group[order]
    groups = np.random.default_rng(_SEED).permutation(np.unique(number))
    sizes = np.cumsum([np.count_nonzero(number == one) for one in groups])
    chosen = groups[: max(2, int(np.searchsorted(sizes, _TOLD)))]
    return order[np.isin(number, chosen)][:_MOST_CENTRES]


def _recorded(relative: Floats, origin: Literal["stated", "repeats", "reciprocal pairs", "neighbours"]) -> Noise:
    median, p95 = (float(f"{value:.3g}") for value in np.percentile(relative, [50.0, 95.0]))
    return Noise(median=median, p95=p95, origin=origin)


def _likely(how: SampleInterpolation, problem: _Problem, noise: float) -> tuple[float, float]:
    """Return the logarithm of the likelihood of a noise, and the noise as a standard deviation of the numbers."""
    from scipy.linalg import cho_factor, cho_solve

    covariance = _covariance(how, problem, np.full(len(problem.wi), noise**2))
    factor = cho_factor(covariance, lower=True, overwrite_a=True)
    y = problem.y - how.mean
    variance = max(float(np.mean(np.sum(y * cho_solve(factor, y), axis=0)) / len(y)), 1e-12)
    logarithm = -0.5 * len(y) * np.log(variance) - float(np.sum(np.log(np.diag(factor[0]))))
    return logarithm, noise * float(np.sqrt(variance))


class _Passing(NamedTuple):
    """An interpolation that passes samples within their noise, and what its narrow functions add at them, (N, C).

    `kriged` is that of the smooth part, `narrow` that of the narrow functions; None of many samples, or without any.
    """

    f_r: SampleInterpolation
    added: Floats
    kriged: _Kriged | None
    narrow: _Kriged | None


def _passing(how: SampleInterpolation, problem: _Problem, noise: _Noise) -> _Passing:
    """Return the interpolation with its weights, which passes each sample within what its noise allows.

    What the smooth part misses more than that is interpolated by narrower functions: their width is the one with the
    smallest error at samples that are held out.
    """
    none = np.zeros_like(problem.y)
    if len(problem.wi) > _MOST_CENTRES:
        centres = _x(how, problem.some(_centres(len(problem.wi))))
        phi = how.functions(_x(how, problem), centres)
        weights = _solved(*_normal(how, problem, phi), how.functions(centres, centres))
        return _Passing(replace(how, centres=centres, weights=weights), none, None, None)
    kriged = _kriged(how, problem)
    smooth = replace(how, centres=_x(how, problem), weights=kriged.weights)
    missed = _variance(how, problem)[:, np.newaxis] * kriged.weights
    allowed = np.maximum(noise.allowed[problem.place], 1e-6)[:, np.newaxis]
    # The larger what is missed, the less of it is noise (the garrote of Breiman 1995)
    added = np.where(np.abs(missed) > allowed, missed - allowed**2 / np.where(missed == 0.0, 1.0, missed), 0.0)
    if not np.any(added):
        return _Passing(smooth, none, kriged, None)
    groups = (problem.group, problem.fold)
    smoothly = [_predicted(kriged, group) - added for group in groups]

    def score(tried: tuple[_Kriged, NarrowPart]) -> float:
        pairs = zip(smoothly, groups, strict=True)
        return sum(float(np.mean(np.minimum(np.abs(off + _predicted(tried[0], group)), 3.0))) for off, group in pairs)

    apart = _apart(problem, turned=how.turned)
    narrow, part = min((_narrow(how, problem, added, short, apart) for short in _SHORT), key=score)
    return _Passing(replace(smooth, narrow=part), added, kriged, narrow)


def _narrow(
    how: SampleInterpolation, problem: _Problem, added: Floats, short: float, apart: float
) -> tuple[_Kriged, NarrowPart]:
    """Return what interpolates numbers (N, C) by functions that are narrower than the smooth ones."""
    x = _x(how, problem)
    part = NarrowPart(short, apart, how.turned, (), added)
    part = part._replace(centres=part.both(problem.wi, problem.wr, x, exchanged=how.reciprocal))
    matrix = part.functions(problem.wi, problem.wr, x)
    matrix[np.diag_indices_from(matrix)] += _FINE**2
    inverse = _inverse(matrix)
    weights = inverse @ added
    return _Kriged(inverse, weights), part._replace(weights=weights)


def _apart(problem: _Problem, *, turned: bool) -> float:
    """Return how far [rad] what a light shows alone reaches: a share of the typical gap; all, if there are no scans."""
    if np.array_equal(problem.group, problem.fold):
        return np.inf
    w = np.unique(np.round(problem.wi, 4), axis=0)
    if turned:
        from scipy.spatial import cKDTree

        gap = np.median(cKDTree(w).query(w, 2)[0][:, 1])
    else:
        gap = np.median(np.diff(np.unique(np.round(np.arccos(np.clip(w[:, 2], 0.0, 1.0)), 2))))
    return float(np.maximum(_REACH * gap, 1e-3))


def _glints(
    samples: Samples, peaks: Sequence[SamplePeak], f_r: SampleInterpolation, problem: _Problem, used: NDArray[np.bool_]
) -> tuple[list[SamplePeak], list[Glint], _Problem, NDArray[np.bool_]]:
    """Return peaks, their glints, the problem with what they leave of the samples, and which samples count (N,)."""
    glints: list[Glint] = []
    measured = samples
    peaks = list(peaks)
    tracks = tracks_of(samples, peaks)
    for peak, track in zip(peaks, tracks, strict=False):  # both grow
        glints.append(glint_of(samples, peak, f_r, track))
        near = np.append(peak.top, peak.ring)
        rest = samples.values.copy()
        rest[near] -= Glints(glints=(glints[-1],), turned=True).f_r(samples.w_i[near], samples.w_r[near])
        samples = replace(samples, values=rest)
        if samples.turned or len(peaks) == _MOST_GLINTS:
            continue
        of_light = np.flatnonzero(samples.incidence == samples.incidence[peak.top])
        wi, wr = samples.w_i[of_light], samples.w_r[of_light]
        values = np.fmax(rest[of_light].mean(axis=1), f_r(wi, wr).mean(axis=1))
        more = _lopsided(np.stack(offsets_deg(wi, wr), axis=1), values) & np.isin(of_light, peak.ring)
        more &= values > np.maximum(_BRIGHT * np.nanmean(measured.values[peak.top]), _WRONG * f_r.level.mean())
        if np.any(more):
            # what a round glint leaves beside the plane of incidence, where a smooth part is the same on both sides
            top = of_light[np.argmax(np.where(more, values, -np.inf))]
            reach = np.linalg.norm(samples.w_r[peak.ring] - samples.w_r[peak.top], axis=1).max()
            ring = of_light[(np.linalg.norm(wr - samples.w_r[top], axis=1) <= reach) & (of_light != top)]
            peaks.append(peak._replace(top=int(top), ring=ring))
            tracks.append(max(tracks) + 1)
    changed = np.isin(problem.row, np.concatenate([np.append(peak.top, peak.ring) for peak in peaks]))
    values = samples.values[problem.row]
    new = _logarithm(values, f_r.level) - problem.of_base
    y = np.where(changed[:, np.newaxis] & np.isfinite(new), new, problem.y)
    return peaks, glints, problem._replace(y=y, values=values), used | changed


def _with_error(
    samples: Samples, peak: SamplePeak, number: int, glints: Sequence[Glint], f_r: SampleInterpolation
) -> Glint:
    """Return a glint with the largest error of glints and a smooth f_r at its samples, relative to the top."""
    rows = np.append(peak.top, peak.ring)
    wi, wr, values = samples.w_i[rows], samples.w_r[rows], np.nan_to_num(samples.values[rows])
    of_light = tuple(one for one in glints if one.theta_i_deg == glints[number].theta_i_deg)
    whole = f_r(wi, wr) + Glints(glints=of_light, turned=True).f_r(wi, wr)
    error = np.abs(whole - values).max() / max(float(values[0].max()), 1e-300)
    return glints[number].model_copy(update={"error": float(f"{error:.2g}")})


def _outliers(samples: Samples, wrong: Sequence[int], f_r: SampleInterpolation) -> list[str]:
    """Return a sentence on each of some wrong samples, and on the number of the others."""
    listed = []
    for row in wrong[:_NAMED]:
        angles = [f"{degrees(getattr(samples, name)[row]):g}" for name in ("theta_i", "phi_i", "theta_r", "phi_r")]
        value = f_r(samples.w_i[[row]], samples.w_r[[row]])[0]
        column = int(np.argmax(np.abs(np.nan_to_num(samples.values[row]) - value)))
        listed.append(
            f"outlier: {samples.values[row, column]:.4g} /sr at {angles[0]}/{angles[1]} to {angles[2]}/{angles[3]} "
            f"degrees, where the samples around give {value[column]:.4g}; it is left out"
        )
    if len(wrong) > _NAMED:
        listed.append(f"{len(wrong) - _NAMED} more samples are left out as outliers")
    return listed


def _normal(how: SampleInterpolation, problem: _Problem, phi: Floats) -> tuple[Floats, Floats]:
    """Return the matrix and the right sides of the normal equations of some samples, from radial functions at them."""
    weighted = phi / _variance(how, problem)[:, np.newaxis]
    return weighted.T @ phi, weighted.T @ (problem.y - how.mean)


def _solved(matrix: Floats, right: Floats, smooth: Floats) -> Floats:
    """Return the weights of radial functions; values at all centres make them smooth where samples do not tell."""
    from scipy.linalg import cho_factor, cho_solve

    whole = matrix + smooth
    whole[np.diag_indices_from(whole)] *= 1.0 + _JITTER
    return np.asarray(cho_solve(cho_factor(whole), right))


def _predicted_by_centres(how: SampleInterpolation, problem: _Problem, group: NDArray[np.int64]) -> Floats:
    """Return differences (N, C) of groups of many samples, each predicted from those of the other groups."""
    phi = how.functions(_x(how, problem), how.centres)
    smooth = how.functions(how.centres, how.centres)
    matrix, right = _normal(how, problem, phi)
    of_centre = group[_centres(len(group))]
    off = np.empty_like(problem.y)
    for number in np.unique(group):
        own, rest = group == number, np.flatnonzero(of_centre != number)
        square = np.ix_(rest, rest)
        own_matrix, own_right = _normal(how, problem.some(own), phi[own])
        weights = _solved((matrix - own_matrix)[square], (right - own_right)[rest], smooth[square])
        off[own] = problem.y[own] - how.mean - phi[own][:, rest] @ weights
    return off


def _centres(count: int) -> NDArray[np.int64]:
    """Return the numbers of the samples whose places are the centres of radial functions."""
    return np.random.default_rng(_SEED).permutation(count)[:_CENTRES]


def _held_out(samples: Samples, fine: _Passing, problem: _Problem, lobe: LobeBase) -> HeldOut:
    """Return the error at samples that were held out and lie within the directions of the others."""
    known = samples.selected(problem.row)
    by_incidences = _by_incidences(known)

    x = places(problem.wi, problem.wr, turned=samples.turned)

    def errors(group: NDArray[np.int64]) -> tuple[NDArray[np.bool_], Floats, Floats]:
        """Return samples (N,) within the directions of the others, and errors (N, C): absolute [1/sr], and relative."""
        if fine.kriged is None:
            predicted = _predicted_by_centres(fine.f_r, problem, group)
        else:
            predicted = _predicted(fine.kriged, group)
        if fine.narrow is not None:
            predicted = predicted - fine.added + _predicted(fine.narrow, group)
        f_r = 2.0 * fine.f_r.level * np.sinh(problem.y + problem.of_base - predicted)
        off = np.abs(np.maximum(f_r, 0.0) - problem.values)
        inside = np.ones(len(x), dtype=bool)
        for number in np.unique(group):
            own = group == number
            others = x[~own] if samples.turned else np.concatenate([x[~own], x[~own] * [1.0, 1.0, -1.0]])
            inside[own] = ~beyond(x[own], others)
        return inside, off, off / np.maximum(f_r, floor_of(samples))

    inside, off, of = errors(problem.group)
    counted = inside if inside.any() else ~inside
    values, off, of = problem.values[counted], off[counted], of[counted]
    there = np.isfinite(of)
    median, p95, p99, largest = (float(f"{x:.3g}") for x in np.percentile(of[there], [50.0, 95.0, 99.0, 100.0]))
    regions = Regions(
        lobe=float(f"{lobe.reach:.3g}"),
        turned=samples.turned,
        lights_deg=[(round(float(a), 4), round(float(b), 4)) for a, b in _lights_deg(known)] if by_incidences else [],
    )
    number = regions.number(problem.wi, problem.wr) % 4
    at = number[counted] + 4 * by_incidences
    if by_incidences:
        beside, _, of_beside = errors(problem.fold)
        of = np.concatenate([of, of_beside[beside]])
        at = np.concatenate([at, number[beside]])
    return HeldOut(
        scheme="incidences" if by_incidences else "folds",
        rounds=int(np.unique(problem.group).size),
        samples=int(np.count_nonzero(counted)),
        outside=int(np.count_nonzero(~inside)),
        floor=[float(f"{x:.3g}") for x in floor_of(samples)],
        l1=float(f"{off[there].sum() / max(np.abs(values[there]).sum(), 1e-300):.3g}"),
        median=median,
        p95=p95,
        p99=p99,
        max=largest,
        regions=regions.stated(at, of),
    )


def _lights_deg(known: Samples) -> Floats:
    """Return the polar angles and azimuths (K, 2) [degree] of the lights of samples."""
    first = np.unique(known.incidence, return_index=True)[1]
    return degrees(np.stack([known.theta_i[first], known.phi_i[first]], axis=1))
