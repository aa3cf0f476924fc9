"""The least-squares problem of a surface and samples, over the shape alone: coefficients are solved inside."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.fitting.projection import COARSE, FINE, cost_of, project, slopes_of
from brdfdb.fitting.residuals import Residual
from brdfdb.fitting.shape_slopes import basis_slopes
from brdfdb.fitting.surface import Surface, total
from brdfdb.fitting.variables import best_apart, spread
from brdfdb.measurements.aperture import RESOLVED, InstrumentView
from brdfdb.parameters import Floats

Array = NDArray[np.float64]

POINTS = 128  # points of the unit cube that are tried at some of the samples
STARTS = 3  # of them from which descents begin
_SPREAD = 4096  # points among which those with a lobe that samples can show are chosen
_SOME, _MORE = 300, 1000  # samples at which points are tried, and at which the promising ones go on
_NARROWEST, _WIDEST = 0.002, 1.5  # widths of lobes that descents begin with
_STEP = 1e-6  # of differences, in the unit cube
_INSIDE = 1e-9  # distance of beginnings from the surface of the cube
_COARSE, _FINE = 20, 60  # evaluations of descents, at some samples and at more
_PROMISING = 1.5  # times the least cost at some samples
_AT_END = 1e-12  # distance of a coefficient from an end of its range that is the end, in its unit


class Point(NamedTuple):
    """A point of the unit cube with its best coefficients: f_r, residuals and the cost."""

    x: Array
    values: Array
    basis: Floats
    f_r: Floats
    residuals: Floats
    cost: float


class Problem:
    """A surface, the samples it is fitted to, and the scale of robustness.

    Parameters
    ----------
    surface : Surface
        The surface.
    view : InstrumentView
        Directions of light and viewer as the instrument sees them.
    residual : Residual
        Of the same N samples.
    fixed : mapping of int to float
        Shape variables that are held, with their places in the unit cube.
    held : mapping of int to float
        Coefficients that are held at a value in each channel.
    """

    def __init__(
        self,
        surface: Surface,
        view: InstrumentView,
        residual: Residual,
        fixed: Mapping[int, float] | None = None,
        held: Mapping[int, float] | None = None,
    ) -> None:
        self.surface, self.view, self.residual = surface, view, residual
        self.fixed = dict(fixed or {})
        self.free = [j for j in range(len(surface.shape)) if j not in self.fixed]
        shape = (len(surface.coefficients), surface.channels)
        self.low = np.array([np.full(surface.channels, one.low) for one in surface.coefficients]).reshape(shape)
        self.high = np.array([np.full(surface.channels, one.high) for one in surface.coefficients]).reshape(shape)
        for index, value in (held or {}).items():
            self.low[index] = self.high[index] = value
        level = np.pi * float(np.median(np.maximum(residual.truth[residual.used], 0.0)))
        self.begin = np.broadcast_to(np.clip(level, 0.01, 0.5) * surface.units, shape)
        self.scale = 1.0

    def selected(self, rows: NDArray[np.int64]) -> Problem:
        """Return the problem of some of the samples."""
        part = Problem.__new__(Problem)
        part.__dict__ |= self.__dict__
        part.view, part.residual = self.view.selected(rows), self.residual.selected(rows)
        return part

    def placed(self, free: Array) -> Array:
        """Return points (..., S) of the unit cube whose free variables are given."""
        x = np.zeros((*free.shape[:-1], len(self.surface.shape)))
        x[..., self.free] = free
        for index, u in self.fixed.items():
            x[..., index] = u
        return x

    def at(
        self, free: Array, start: Array | None = None, tolerance: float = FINE, basis: Floats | None = None
    ) -> Point:
        """Return a point whose free shape variables are given, with its best coefficients; `basis` if it is known."""
        x = self.placed(free)
        if basis is None:
            basis = self.surface.basis(x, self.view)
        begin = self.begin if start is None else start
        values = project(self.surface, basis, self.residual, self.scale, (self.low, self.high), begin, tolerance)
        f_r = total(basis, self.surface.monomials(values))
        residuals = self.residual.of(f_r)
        return Point(x, values, basis, f_r, residuals, float(np.sum(cost_of(residuals, self.scale))))

    def shape_jacobian(self, point: Point) -> Floats:
        """Return the derivatives (S, N, C) of residuals by the free shape variables, at fixed coefficients.

        Models that have a gradient give them, the others differences.
        """
        monomials = self.surface.monomials(point.values)
        slope = self.residual.slope(point.f_r)
        columns = np.zeros((len(self.free), *point.f_r.shape))
        derived = basis_slopes(self.surface, point.x, self.view)
        rest = [column for column, variable in enumerate(self.free) if variable not in derived]
        for column, variable in enumerate(self.free):
            if variable in derived:
                columns[column] = slope * total(derived[variable], monomials)
        variables = np.array(self.free, dtype=np.int64)[rest]
        steps = np.where(point.x[variables] > 0.5, -_STEP, _STEP)
        moved = np.tile(point.x, (len(rest), 1))
        moved[np.arange(len(rest)), variables] += steps
        if rest:
            for column, step, basis in zip(rest, steps, self.surface.bases(moved, self.view), strict=True):
                columns[column] = slope * (total(basis, monomials) - point.f_r) / step
        return columns

    def coefficient_jacobian(self, point: Point) -> tuple[Floats, NDArray[np.bool_]]:
        """Return the derivatives (K, N, C) of residuals by coefficients, 0 for those at a bound, and which are free."""
        span = self.high - self.low
        units = self.surface.units
        free = (point.values > self.low + _AT_END * units) & (point.values < self.high - _AT_END * units) & (span > 0.0)
        jacobian = slopes_of(self.surface, point.basis, point.values) * self.residual.slope(point.f_r)
        return jacobian * free[:, np.newaxis, :], free

    def descend(self, begin: Array, most: int) -> Point:
        """Return the point at which a descent from the free variables `begin` ends.

        Coefficients are eliminated by variable projection: the derivatives are those of residuals at fixed
        coefficients, less the part that coefficients undo.
        """
        from scipy.optimize import least_squares

        if not self.free:
            return self.at(begin)
        last: dict[bytes, Point] = {}
        values: Array | None = None

        def point_of(x: Array) -> Point:
            nonlocal values
            key = x.tobytes()
            if key not in last:
                last.clear()
                last[key] = self.at(x, values)
                values = last[key].values
            return last[key]

        def jacobian(x: Array) -> Array:
            point = point_of(x)
            columns = self.shape_jacobian(point)
            inner, _ = self.coefficient_jacobian(point)
            weights = 1.0 / np.sqrt(1.0 + (point.residuals / self.scale) ** 2)
            columns -= _undone(columns, inner, weights)
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
        return self.at(end.x, values)

    def begin_points(self) -> Array:
        """Return points (P, S) of the free variables, spread evenly, whose lobes are as wide as samples can show."""
        points = spread(_SPREAD, max(len(self.free), 1))[:, : len(self.free)]
        chosen: list[Array] = []
        for some in np.split(points, _SPREAD // POINTS):
            chosen += list(some[self._shows(self.placed(some))])
            if len(chosen) >= POINTS:
                break
        return np.array(chosen[:POINTS] if chosen else points[:POINTS])

    def _shows(self, points: Array) -> NDArray[np.bool_]:
        """Return False for points (P, S) where a lobe is too narrow or too wide to begin with."""
        narrowest, widths = max(_NARROWEST, RESOLVED * self.view.half_angle), self.surface.widths(points)
        return np.asarray(np.all((narrowest <= widths) & (widths <= _WIDEST), axis=1))

    def best(self) -> Point:
        """Return the best end of descents from several beginnings, from which a descent at all samples goes on.

        Points are tried at some of the samples. Descents from the best three that are apart end at those samples, and
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
        """Return some of the samples: half of them the brightest, half of them any."""
        count = len(self.view)
        if count <= most:
            return np.arange(count)
        brightness = np.where(self.residual.used, self.residual.truth, -np.inf).max(axis=1)
        order = np.argsort(-brightness, kind="stable")
        others = np.random.default_rng(0).permutation(order[most // 2 :])[: most // 2]
        return np.sort(np.concatenate([order[: most // 2], others]))


def _undone(columns: Floats, inner: Floats, weights: Floats) -> Floats:
    """Return the part (S, N, C) of columns that lies in the span of the inner ones (K, N, C), channel by channel."""
    if not len(inner):
        return np.zeros_like(columns)
    of_channels = inner.transpose(2, 0, 1)
    weighted = of_channels * weights.T[:, np.newaxis, :]
    normal = weighted @ of_channels.transpose(0, 2, 1)
    solved = np.linalg.pinv(normal, rcond=1e-12, hermitian=True) @ (weighted @ columns.transpose(2, 1, 0))
    return np.asarray((solved.transpose(0, 2, 1) @ of_channels).transpose(1, 2, 0))
