"""The least-squares problem of a surface and samples, over the shape alone: coefficients are solved inside."""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.fitting.nuisance import UNDISTURBED, Nuisance
from brdfdb.fitting.residuals import Residual
from brdfdb.fitting.surface import SearchedSurface, total
from brdfdb.fitting.variables import best_apart, spread
from brdfdb.measurements.aperture import RESOLVED, InstrumentView
from brdfdb.parameters import Floats

POINTS = 128  # points of the unit cube that are tried at some of the samples
STARTS = 3  # descents, which begin at the best of these points
_SPREAD = 4096  # points among which those with a lobe that samples can show are chosen
_SOME = 300  # samples at which points are tried
_MORE = 1000  # samples of the promising descents
_NARROWEST = 0.002  # width of the narrowest lobe at which a descent begins
_WIDEST = 1.5  # width of the widest one
_STEP = 1e-6  # step of finite differences, in the unit cube
_NUISANCE_STEP = 1e-5  # the same of nuisance numbers
_INSIDE = 1e-9  # distance of beginnings from the surface of the cube
_COARSE = 20  # evaluations of descents at some samples
_FINE = 60  # evaluations of descents at more samples
_PROMISING = 1.5  # largest cost of a promising descent, over the least cost
_AT_END = 1e-12  # distance from an end of its range, in its unit, at which a coefficient is at the end

MOST = 60  # steps of the search for coefficients in a descent
_FEW = 6  # steps of that search in a trial
FINE = 1e-10  # relative change of the cost that ends the steps of a descent
COARSE = 1e-3  # relative change of the cost that ends the steps of a trial
_EDGE = 1e-12  # share of a range within which a coefficient is at its end
_FIRST_DAMPING = 1e-4  # damping of the first step: two equal lobes make a singular matrix
_LEAST_DAMPING = 1e-10  # damping of later steps


class Point(NamedTuple):
    """A point of the unit cube with its best coefficients: f_r, residuals and the cost.

    `nuisance` (Q,) are the nuisance numbers in the unit cube, `view` the directions that they tilt, and `residual` the
    residuals as functions of the undisturbed f_r.
    """

    x: Floats
    values: Floats
    basis: Floats
    f_r: Floats
    residuals: Floats
    cost: float
    nuisance: Floats
    view: InstrumentView
    residual: Residual

    @property
    def place(self) -> Floats:
        """Shape variables and nuisance numbers, from which a descent can begin."""
        return np.concatenate([self.x, self.nuisance])


class Problem:
    """A surface, the samples that it is fitted to, and the scale of robustness.

    `fixed` and `fixed_coefficients` are shape variables (places in the unit cube) and coefficients (values in each
    channel) that are not searched, by index.
    """

    def __init__(
        self,
        surface: SearchedSurface,
        view: InstrumentView,
        residual: Residual,
        fixed: Mapping[int, float] | None = None,
        fixed_coefficients: Mapping[int, float] | None = None,
        nuisance: Nuisance = UNDISTURBED,
        scale: float = 1.0,
    ) -> None:
        self.surface, self.view, self.residual = surface, view, residual
        self.nuisance, self.scale = nuisance, scale
        self.fixed = dict(fixed or {})
        self.free = [j for j in range(len(surface.shape)) if j not in self.fixed]
        shape = (len(surface.coefficients), surface.channels)
        self.low = np.array([np.full(surface.channels, one.low) for one in surface.coefficients]).reshape(shape)
        self.high = np.array([np.full(surface.channels, one.high) for one in surface.coefficients]).reshape(shape)
        for index, value in (fixed_coefficients or {}).items():
            self.low[index] = self.high[index] = value
        level = np.pi * float(np.median(np.maximum(residual.truth[residual.used], 0.0)))
        self.begin = np.broadcast_to(np.clip(level, 0.01, 0.5) * surface.units, shape)

    @property
    def searched(self) -> list[int]:
        """Indices of the free variables in `Point.place`: those of the shape, then all nuisance numbers."""
        shapes = len(self.surface.shape)
        return [*self.free, *range(shapes, shapes + len(self.nuisance))]

    def selected(self, rows: NDArray[np.int64]) -> Problem:
        """Return the problem of some of the samples."""
        part = copy(self)
        part.view, part.residual = self.view.selected(rows), self.residual.selected(rows)
        part.nuisance = self.nuisance.selected(rows)
        return part

    def placed(self, free: Floats) -> Floats:
        """Return points (..., S) of the unit cube whose free variables are given."""
        x = np.zeros((*free.shape[:-1], len(self.surface.shape)))
        x[..., self.free] = free
        for index, u in self.fixed.items():
            x[..., index] = u
        return x

    def at(
        self,
        free: Floats,
        start: Floats | None = None,
        tolerance: float = FINE,
        *,
        basis: Floats | None = None,
        values: Floats | None = None,
    ) -> Point:
        """Return a point with its best coefficients, whose search begins at `start`, or with `values` (K, C) instead.

        `free` are the free variables of the shape, and the nuisance numbers after them; `basis` is given if it is
        known.
        """
        x, nuisance = self.placed(free[: len(self.free)]), free[len(self.free) :]
        view, residual = self._disturbed(nuisance)
        if basis is None:
            basis = self.surface.basis(x, view)
        if values is None:
            values = self._coefficients(basis, residual, self.begin if start is None else start, tolerance)
        f_r = total(basis, self.surface.monomials(values))
        residuals = residual.of(f_r)
        cost = float(np.sum(cost_of(residuals, self.scale)))
        return Point(x, values, basis, f_r, residuals, cost, nuisance, view, residual)

    def _disturbed(self, u: Floats) -> tuple[InstrumentView, Residual]:
        """Return directions and residuals with nuisance numbers (Q,) in the unit cube."""
        if not self.nuisance.kinds:
            return self.view, self.residual
        view = self.nuisance.view(self.view, u)
        return view, self.residual.disturbed(self.nuisance.gain(u, view), self.nuisance.offset(u))

    def _coefficients(self, basis: Floats, residual: Residual, start: Floats, tolerance: float) -> Floats:
        """Return the coefficients (K, C) within their bounds that make the robust cost of residuals least.

        `basis` (M, N, C) or (M, N, 1) has the factors [1/sr] of the monomials. Coefficients with equal bounds are
        fixed. The steps are those of Gauss and Newton with Levenberg's damping, and end where the relative change of
        the cost is below `tolerance`. A coefficient at a bound stays there if its step would leave the range. Channels
        are independent, and each has its own damping.
        """
        surface, low, high = self.surface, self.low, self.high
        values = np.clip(start, low, high)
        if not len(values):
            return values
        span = np.where(high > low, high - low, 1.0)
        f_r = total(basis, surface.monomials(values))
        residuals = residual.of(f_r)
        cost = cost_of(residuals, self.scale)
        damping = np.full(cost.shape, _FIRST_DAMPING)
        diagonal = np.arange(len(values))
        for _ in range(MOST if tolerance < COARSE else _FEW):
            jacobian = surface.f_r_slopes(basis, values) * residual.slope(f_r)
            weights = 1.0 / np.hypot(1.0, residuals / self.scale)
            columns = np.ascontiguousarray(jacobian.transpose(2, 0, 1))  # (C, K, N): products of matrices are quick
            weighted = columns * weights.T[:, np.newaxis, :]
            gradient = np.einsum("ckn,cn->ck", weighted, residuals.T)
            normal = weighted @ columns.transpose(0, 2, 1)
            stays = ((values <= low + _EDGE * span) & (gradient.T > 0.0)) | (
                (values >= high - _EDGE * span) & (gradient.T < 0.0)
            )
            stays |= high <= low
            size = np.sqrt(np.maximum(normal[:, diagonal, diagonal], 1e-300))
            normal = normal / (size[:, :, np.newaxis] * size[:, np.newaxis, :])
            normal = np.where(stays.T[:, :, np.newaxis] | stays.T[:, np.newaxis, :], 0.0, normal)
            normal[:, diagonal, diagonal] = 1.0 + damping[:, np.newaxis]
            step = np.linalg.solve(normal, np.where(stays.T, 0.0, gradient / size)[..., np.newaxis])[..., 0] / size
            tried = np.clip(values - step.T, low, high)
            f_tried = total(basis, surface.monomials(tried))
            r_tried = residual.of(f_tried)
            cost_tried = cost_of(r_tried, self.scale)
            better = cost_tried <= cost
            gain = np.where(better, cost - cost_tried, 0.0)
            done = np.where(better, gain <= tolerance * cost, damping > 1e8)
            values = np.where(better, tried, values)
            f_r, residuals = np.where(better, f_tried, f_r), np.where(better, r_tried, residuals)
            cost = np.where(better, cost_tried, cost)
            damping = np.where(better, np.maximum(0.1 * damping, _LEAST_DAMPING), 10.0 * np.maximum(damping, 1e-6))
            if np.all(done):
                break
        return values

    def shape_jacobian(self, point: Point) -> Floats:
        """Return the derivatives (S + Q, N, C) of residuals by the free shape variables, at fixed coefficients.

        Models that have a gradient give them, the others differences. Those by nuisance numbers come after them.
        """
        monomials = self.surface.monomials(point.values)
        slope = point.residual.slope(point.f_r)
        columns = np.zeros((len(self.searched), *point.f_r.shape))
        derived = self.surface.basis_slopes(point.x, point.view)
        moved, rest = [], []
        for column, variable in enumerate(self.free):
            if variable in derived:
                columns[column] = slope * total(derived[variable], monomials)
                continue
            step = -_STEP if point.x[variable] > 0.5 else _STEP
            moved.append(np.where(np.arange(len(point.x)) == variable, point.x + step, point.x))
            rest.append((column, step))
        if rest:
            for (column, step), basis in zip(rest, self.surface.bases(np.array(moved), point.view), strict=True):
                columns[column] = slope * (total(basis, monomials) - point.f_r) / step
        for q in range(len(self.nuisance)):
            columns[len(self.free) + q] = self._nuisance_slope(point, q)
        return columns

    def _nuisance_slope(self, point: Point, q: int) -> Floats:
        """Return the derivative (N, C) of residuals by a nuisance number."""
        moved = point.nuisance.copy()
        step = -_NUISANCE_STEP if moved[q] > 0.5 else _NUISANCE_STEP
        moved[q] += step
        view, residual = self._disturbed(moved)
        f_r = point.f_r if view is self.view else self.surface.f_r(point.x, point.values, view)
        return np.asarray((residual.of(f_r) - point.residuals) / step)

    def coefficient_jacobian(self, point: Point) -> tuple[Floats, NDArray[np.bool_]]:
        """Return the derivatives (K, N, C) of residuals by coefficients, 0 for those at a bound, and which are free."""
        span = self.high - self.low
        units = self.surface.units
        free = (point.values > self.low + _AT_END * units) & (point.values < self.high - _AT_END * units) & (span > 0.0)
        jacobian = self.surface.f_r_slopes(point.basis, point.values) * point.residual.slope(point.f_r)
        return jacobian * free[:, np.newaxis, :], free

    def descend(self, begin: Floats, most: int) -> Point:
        """Return the point at which a descent from the free variables `begin` ends.

        Coefficients are eliminated by variable projection: the derivatives are those of residuals at fixed
        coefficients, less the part that coefficients undo.
        """
        from scipy.optimize import least_squares

        if not self.searched:
            return self.at(begin)
        last: Point | None = None

        def point_of(x: Floats) -> Point:  # residuals and derivatives are asked for one after the other
            nonlocal last
            if last is None or np.any(last.place[self.searched] != x):
                last = self.at(x, None if last is None else last.values)
            return last

        def jacobian(x: Floats) -> Floats:
            point = point_of(x)
            columns = self.shape_jacobian(point)
            inner, _ = self.coefficient_jacobian(point)
            weights = 1.0 / np.hypot(1.0, point.residuals / self.scale)
            if len(inner):  # less the part that lies in the span of the coefficients, channel by channel
                of_channels = inner.transpose(2, 0, 1)
                weighted = of_channels * weights.T[:, np.newaxis, :]
                normal = weighted @ of_channels.transpose(0, 2, 1)
                solved = np.linalg.pinv(normal, rcond=1e-12, hermitian=True) @ (weighted @ columns.transpose(2, 1, 0))
                columns -= (solved.transpose(0, 2, 1) @ of_channels).transpose(1, 2, 0)
            return np.asarray(columns[:, self.residual.used].T)

        end = least_squares(
            lambda x: point_of(x).residuals[self.residual.used],
            np.clip(begin, _INSIDE, 1.0 - _INSIDE),
            jac=jacobian,
            bounds=(0.0, 1.0),
            loss="soft_l1",
            f_scale=self.scale,
            max_nfev=most,
            xtol=1e-6,
            ftol=1e-7,
            gtol=1e-10,
        )
        return self.at(end.x, None if last is None else last.values)

    def begin_points(self) -> Floats:
        """Return points (P, S) of the free variables, spread evenly, whose lobes are as wide as samples can show."""
        points = spread(_SPREAD, max(len(self.free), 1))[:, : len(self.free)]
        chosen: list[Floats] = []
        narrowest = max(_NARROWEST, RESOLVED * self.view.half_angle)
        for some in np.split(points, _SPREAD // POINTS):
            widths = self.surface.widths(self.placed(some))
            chosen += list(some[np.all((narrowest <= widths) & (widths <= _WIDEST), axis=1)])
            if len(chosen) >= POINTS:
                break
        return np.array(chosen[:POINTS] if chosen else points[:POINTS])

    def best(self) -> Point:
        """Return the best end of descents from several beginnings, from which a descent at all samples goes on.

        Points are tried at some of the samples. Descents from the best three distant points end at those samples, and
        the promising ones go on at more of them.
        """
        if not self.free:
            return self.at(np.zeros(0))
        coarse = self.selected(self._brightest_and_others(_SOME))
        points = self.begin_points()
        bases = self.surface.bases(self.placed(points), coarse.view)
        values = np.array(
            [coarse.at(point, tolerance=COARSE, basis=basis).cost for point, basis in zip(points, bases, strict=True)]
        )
        ends = [coarse.descend(point, _COARSE) for point in best_apart(points, values, STARTS)]
        least = min(end.cost for end in ends)
        good = [end for end in ends if end.cost <= _PROMISING * least]
        apart = best_apart(np.array([end.x for end in good]), np.array([end.cost for end in good]), STARTS)
        more = self.selected(self._brightest_and_others(_MORE))
        best = min((more.descend(x[self.free], _FINE) for x in apart), key=lambda point: point.cost)
        return self.at(best.x[self.free], best.values)

    def _brightest_and_others(self, most: int) -> NDArray[np.int64]:
        """Return rows of samples: half of them are the brightest, the others are random."""
        count = len(self.view)
        if count <= most:
            return np.arange(count)
        brightness = np.where(self.residual.used, self.residual.truth, -np.inf).max(axis=1)
        order = np.argsort(-brightness, kind="stable")
        others = np.random.default_rng(0).permutation(order[most // 2 :])[: most // 2]
        return np.sort(np.concatenate([order[: most // 2], others]))


def cost_of(residuals: Floats, scale: float) -> Floats:
    """Return half of the sum (C,) over rows of s^2 rho((r / s)^2), rho(z) = 2 (sqrt(1 + z) - 1)."""
    return np.asarray(scale**2 * np.sum(np.hypot(1.0, residuals / scale) - 1.0, axis=0))
