"""The best point of a surface, and its search: robustness, hidden samples, the noise, nuisance numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from brdfdb.fitting.nuisance import UNDISTURBED, Nuisance
from brdfdb.fitting.problem import Point, Problem, cost_of
from brdfdb.fitting.residuals import MAD, Kind, NoiseFloor, Residual, logarithms, noise_floor
from brdfdb.fitting.surface import SearchedSurface
from brdfdb.fitting.uncertainty import Covariance, covariance
from brdfdb.geometry import radians, versine
from brdfdb.measurements import Samples
from brdfdb.measurements.aperture import InstrumentView
from brdfdb.parameters import Floats

Mask = NDArray[np.bool_]

ROBUST = 3.0  # size of a residual [robust standard deviations] above which it counts less than squared
LEAST_SCALE = 1e-9  # scale of noise-free samples
FAR = 6.0  # size of the residual of an outlier [robust standard deviations]
_PATTERN = 0.5  # larger correlations of neighbouring residuals are a pattern
_SETTLED = 0.05  # relative change of the scale that ends the iterations
_SCALES = 4  # largest number of iterations of the scale
_FLOORS = 3  # largest number of estimates of the floor of the noise
_SETTLED_FLOOR = 0.3  # relative change of the floor that ends these
_GROSS = 0.05  # share of samples off by a factor of e, above which no model follows the dim ones
_DIM = 1e-3  # share of the reflected light of these
_LEAST_VARIANCE = 1e-6  # of the noise, from which on the bias of logarithms is taken out
_EVALUATIONS = 60  # evaluations of a descent at all samples
_HELD_OUT_EVALUATIONS = 40  # evaluations of a descent without one group of incidences
_GROUPS = 8  # largest number of groups of incidences; fewer incidences are left out one at a time
_NEAR_MIRROR = float(radians(3.0))  # angle from the mirror direction within which apertures may catch a specular part
_COUNTS = 0.01  # share of f_r that a specular part must add in an aperture of that half angle to count


@dataclass(frozen=True)
class FittedSurface:
    """The best point of a surface, with the samples that it was fitted to."""

    samples: Samples
    problem: Problem
    point: Point
    sigma: float  # robust standard deviation of the residuals
    rows: NDArray[np.int64]  # samples that count: those of the problem
    hidden: Mask  # samples (N,) that are left out, because they may contain a specular part in an unknown aperture
    residual: Residual  # the residuals of all samples
    nuisance: Nuisance = UNDISTURBED  # nuisance numbers of all samples

    @property
    def surface(self) -> SearchedSurface:
        """The surface that was fitted."""
        return self.problem.surface

    @cached_property
    def covariance(self) -> Covariance:
        """The covariance of the numbers of the fit."""
        return covariance(self.problem, self.point)

    @cached_property
    def view(self) -> InstrumentView:
        """The directions of all samples, as their instrument sees them."""
        return InstrumentView(self.samples.w_i, self.samples.w_r, self.samples.instrument)

    def f_r(self, wi: Floats, wr: Floats) -> Floats:
        """Return f_r (N, C) [1/sr] of the fit at unit vectors (N, 3) of light and viewer, without its specular part."""
        return self.surface.f_r(self.point.x, self.point.values, InstrumentView(wi, wr))

    def seen(self, view: InstrumentView) -> Floats:
        """Return f_r (N, C) [1/sr] of the fit as an instrument sees it."""
        return self.surface.f_r(self.point.x, self.point.values, view)

    @cached_property
    def readings(self) -> Floats:
        """Readings of the fit by the instrument at all samples (N, C) [1/sr], with its nuisance numbers."""
        return self.readings_of(self.point, np.arange(len(self.samples)))

    def readings_of(self, point: Point, rows: NDArray[np.int64]) -> Floats:
        """Return what the instrument reads of a point of the search at some samples (M, C) [1/sr]."""
        nuisance = self.nuisance.selected(rows)
        tilted = nuisance.view(self.view.selected(rows), point.nuisance)
        f_r = self.surface.f_r(point.x, point.values, tilted)
        return nuisance.gain(point.nuisance, tilted) * f_r + nuisance.offset(point.nuisance)

    @cached_property
    def logarithms(self) -> Floats:
        """ln(model / sample) (N, C); nan where the sample is not positive, or is left out."""
        difference = logarithms(self.samples, self.readings)
        return np.where(self.hidden[:, np.newaxis], np.nan, difference)

    @cached_property
    def predicted(self) -> Floats | None:
        """ln(model / sample) (N, C) at incidences that were left out in turn; None if the light has one direction.

        Each search begins at the best point for all samples, and fits the remaining samples. More than eight incidences
        are left out in groups of neighbours. Samples that are hidden or not positive have nan.
        """
        groups = incidence_groups(self.samples)
        if len(groups) < 2:
            return None
        counts = self.residual.used.any(axis=1) & ~self.hidden
        errors = np.full(self.samples.values.shape, np.nan)
        for rows in groups:
            remaining = np.setdiff1d(np.flatnonzero(counts), rows)
            if not remaining.size:
                continue
            view, residual = self.view.selected(remaining), self.residual.selected(remaining)
            nuisance = self.nuisance.selected(remaining)
            part = Problem(self.surface, view, residual, nuisance=nuisance, scale=self.problem.scale)
            end = part.descend(self.point.place[part.searched], _HELD_OUT_EVALUATIONS)
            errors[rows] = logarithms(self.samples.selected(rows), self.readings_of(end, rows))
        errors[self.hidden] = np.nan
        return errors

    def cost_at(self, scale: float) -> float:
        """Return the cost of the best point with another scale of robustness."""
        return float(np.sum(cost_of(self.point.residuals, scale)))

    @cached_property
    def clipped(self) -> Floats:
        """Residuals at the samples that count; outliers have the size from which on they are outliers."""
        return np.clip(self.point.residuals, -FAR * self.sigma, FAR * self.sigma)

    @cached_property
    def nearest(self) -> NDArray[np.int64]:
        """For each sample that counts the row of the nearest other pair of directions; there are at least two."""
        from scipy.spatial import cKDTree

        pairs = np.concatenate([self.problem.view.w_i, self.problem.view.w_r], axis=1)
        return np.asarray(cKDTree(pairs).query(pairs, k=2)[1][:, 1])

    @cached_property
    def pattern(self) -> float:
        """The correlation of residuals with those of the nearest other direction."""
        if len(self.rows) < 3:
            return 0.0
        used = self.problem.residual.used & self.problem.residual.used[self.nearest]
        size = float(np.sum((self.clipped * self.clipped)[used]))
        return min(float(np.sum((self.clipped * self.clipped[self.nearest])[used]) / size), 1.0) if size > 0.0 else 0.0


def incidence_groups(samples: Samples) -> list[NDArray[np.int64]]:
    """Return the rows of each incidence, or of groups of neighbouring ones, by theta_i and then phi_i."""
    numbers, first = np.unique(samples.incidence, return_index=True)
    order = np.lexsort((samples.phi_i[first], samples.theta_i[first]))
    parts = np.array_split(numbers[order], min(_GROUPS, numbers.size))
    return [np.flatnonzero(np.isin(samples.incidence, part)) for part in parts]


def searched(samples: Samples, surface: SearchedSurface, kind: Kind) -> FittedSurface:
    """Return the best point of a surface, without nuisance numbers.

    Samples near the mirror direction are hidden, and the search is repeated, where the specular part of the surface is
    too large to ignore and the aperture is not known.
    """
    shown = np.zeros(len(samples), dtype=np.bool_)
    residual = Residual(samples, kind)
    fitted = _descended(samples, surface, residual, shown)
    hidden = _hidden(fitted)
    if hidden.any() and np.any(fitted.problem.residual.used[~hidden[fitted.rows]]):
        fitted = _descended(samples, surface, residual, hidden)
    return with_noise(fitted) if kind == "noise" else fitted


def with_noise(fitted: FittedSurface) -> FittedSurface:
    """Return a fit with the floor of the noise that its residuals show, and without the bias of its residual.

    Where a fit is off by a factor of e at more than one sample of 20, the floor is at least the f_r below which samples
    have a thousandth of the reflected light: no model follows them, and they would decide all numbers.
    """
    for _ in range(_FLOORS):
        shown = fitted.residual.used & ~fitted.hidden[:, np.newaxis]
        noise = noise_floor(fitted.samples, fitted.readings, shown)
        gross = np.abs(fitted.logarithms) > 1.0
        last = fitted.residual.noise
        if np.mean(gross[shown]) > _GROSS:
            noise = _dim(fitted.samples, noise)
        elif last is None and fitted.pattern > _PATTERN:
            break  # the model is wrong by more than noise, which says nothing on its floor
        if noise is last or (noise and last and abs(noise.level / last.level - 1.0) < _SETTLED_FLOOR):
            break
        fitted = refitted(fitted, Residual(fitted.samples, "noise", noise))
    variance = fitted.sigma**2 * (1.0 - max(fitted.pattern, 0.0))  # what neighbours share is no noise
    if abs(variance - fitted.residual.variance) < max(_LEAST_VARIANCE, 0.1 * variance):
        return fitted
    return refitted(fitted, fitted.residual.unbiased(variance))


def _dim(samples: Samples, noise: NoiseFloor | None) -> NoiseFloor:
    """Return a floor of at least the f_r [1/sr] below which samples have a thousandth of the reflected light."""
    values = np.where(samples.known & (samples.values > 0.0), samples.values, 0.0)
    light = values * (np.cos(samples.theta_i) * np.cos(samples.theta_r))[:, np.newaxis]
    order = np.argsort(values, axis=None)
    sums = np.cumsum(light.ravel()[order])
    level = float(values.ravel()[order[np.searchsorted(sums, _DIM * sums[-1])]])
    explained = samples.known & (samples.values <= 0.0) & (samples.values > -level)
    return noise if noise is not None and noise.level >= level else NoiseFloor(level, explained)


def refitted(
    fitted: FittedSurface, residual: Residual | None = None, nuisance: Nuisance | None = None
) -> FittedSurface:
    """Return the fit with another residual or other nuisance numbers, searched from the best point."""
    nuisance = fitted.nuisance if nuisance is None else nuisance
    begin = fitted.point
    if nuisance.kinds != fitted.nuisance.kinds:
        begin = begin._replace(nuisance=np.full(len(nuisance), 0.5))
    residual = fitted.residual if residual is None else residual
    return _descended(fitted.samples, fitted.surface, residual, fitted.hidden, nuisance, begin)


def _descended(
    samples: Samples,
    surface: SearchedSurface,
    residual: Residual,
    hidden: Mask,
    nuisance: Nuisance = UNDISTURBED,
    begin: Point | None = None,
) -> FittedSurface:
    """Return the best point of a surface at the samples that count and are not hidden."""
    rows = np.flatnonzero(residual.used.any(axis=1) & ~hidden)
    view = InstrumentView(samples.w_i[rows], samples.w_r[rows], samples.instrument)
    problem = Problem(surface, view, residual.selected(rows), nuisance=nuisance.selected(rows))
    point = problem.best() if begin is None else problem.at(begin.place[problem.searched], begin.values)
    sigma = sigma_of(problem, point)
    for _ in range(_SCALES):
        problem.scale = max(ROBUST * sigma, LEAST_SCALE)
        point = problem.descend(point.place[problem.searched], _EVALUATIONS)
        last = sigma
        sigma = sigma_of(problem, point)
        if abs(sigma - last) <= _SETTLED * last:
            break
    return FittedSurface(samples, problem, point, sigma, rows, hidden, residual, nuisance)


def at_point(fitted: FittedSurface, nuisance: Nuisance) -> FittedSurface:
    """Return a fit with nuisance numbers of 0 besides those that it has, before any search."""
    old, chosen = fitted.problem, nuisance.selected(fitted.rows)
    problem = Problem(old.surface, old.view, old.residual, nuisance=chosen, scale=old.scale)
    known = dict(zip(fitted.nuisance.numbers, fitted.point.nuisance, strict=True))
    places = np.array([known.get(number, 0.5) for number in nuisance.numbers])
    point = problem.at(np.concatenate([fitted.point.x, places]), values=fitted.point.values)
    return replace(fitted, problem=problem, point=point, nuisance=nuisance)


def _hidden(fitted: FittedSurface) -> Mask:
    """Return the samples (N,) at which a specular part is too large to ignore and the aperture is not known."""
    view = fitted.view
    near = (view.from_mirror < _NEAR_MIRROR) & (view.w_r[:, 2] > 0.0)
    if view.half_angle or not near.any() or all(term.spec.specular is None for term in fitted.surface.terms):
        return np.zeros(len(view), dtype=np.bool_)
    rows = np.flatnonzero(near)
    some = view.selected(rows)
    reflected = fitted.surface.reflected(fitted.point.x, fitted.point.values, some)
    added = reflected / (2.0 * np.pi * versine(np.asarray(_NEAR_MIRROR)) * some.w_r[:, 2:])
    near[rows] = np.any(added > _COUNTS * fitted.seen(some), axis=1)
    return near


def sigma_of(problem: Problem, point: Point) -> float:
    """Return the robust standard deviation of residuals."""
    return MAD * float(np.median(np.abs(point.residuals[problem.residual.used])))
