"""The least-squares problem of a surface and samples, over the shape alone: coefficients are solved inside."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.fitting.residuals import Residual
from brdfdb.fitting.surface import SearchedSurface, Term, columns, total
from brdfdb.fitting.variables import EDGE, NORMAL, best_apart, index_slopes, spread
from brdfdb.measurements.aperture import RESOLVED, InstrumentView
from brdfdb.parameters import Floats

Array = NDArray[np.float64]

POINTS = 128  # points of the unit cube that are tried at some of the samples
STARTS = 3  # descents, which begin at the best of these points
_SPREAD = 4096  # points among which those with a lobe that samples can show are chosen
_SOME = 300  # samples at which points are tried
_MORE = 1000  # samples of the promising descents
_NARROWEST = 0.002  # width of the narrowest lobe at which a descent begins
_WIDEST = 1.5  # width of the widest one
_STEP = 1e-6  # step of finite differences, in the unit cube
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
    """A point of the unit cube with its best coefficients: f_r, residuals and the cost."""

    x: Array
    values: Array
    basis: Floats
    f_r: Floats
    residuals: Floats
    cost: float


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
    ) -> None:
        self.surface, self.view, self.residual = surface, view, residual
        self.fixed = dict(fixed or {})
        self.free = [j for j in range(len(surface.shape)) if j not in self.fixed]
        shape = (len(surface.coefficients), surface.channels)
        self.low = np.array([np.full(surface.channels, one.low) for one in surface.coefficients]).reshape(shape)
        self.high = np.array([np.full(surface.channels, one.high) for one in surface.coefficients]).reshape(shape)
        for index, value in (fixed_coefficients or {}).items():
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
        values = self._coefficients(basis, self.begin if start is None else start, tolerance)
        f_r = total(basis, self.surface.monomials(values))
        residuals = self.residual.of(f_r)
        return Point(x, values, basis, f_r, residuals, float(np.sum(_cost_of(residuals, self.scale))))

    def _coefficients(self, basis: Floats, start: Array, tolerance: float) -> Array:
        """Return the coefficients (K, C) within their bounds that make the robust cost of residuals least.

        `basis` (M, N, C) or (M, N, 1) has the factors [1/sr] of the monomials. Coefficients with equal bounds are
        fixed. The steps are those of Gauss and Newton with Levenberg's damping, and end where the relative change of
        the cost is below `tolerance`. A coefficient at a bound stays there if its step would leave the range. Channels
        are independent, and each has its own damping.
        """
        surface = self.surface
        residual = self.residual
        low, high = self.low, self.high
        values = np.clip(start, low, high)
        if not len(values):
            return values
        span = np.where(high > low, high - low, 1.0)
        f_r = total(basis, surface.monomials(values))
        residuals = residual.of(f_r)
        cost = _cost_of(residuals, self.scale)
        damping = np.full(cost.shape, _FIRST_DAMPING)
        diagonal = np.arange(len(values))
        for _ in range(MOST if tolerance < COARSE else _FEW):
            jacobian = _slopes_of(surface, basis, values) * residual.slope(f_r)
            weights = 1.0 / np.sqrt(1.0 + (residuals / self.scale) ** 2)
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
            cost_tried = _cost_of(r_tried, self.scale)
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
        """Return the derivatives (S, N, C) of residuals by the free shape variables, at fixed coefficients.

        Models that have a gradient give them, the others differences.
        """
        monomials = self.surface.monomials(point.values)
        slope = self.residual.slope(point.f_r)
        columns = np.zeros((len(self.free), *point.f_r.shape))
        derived = _basis_slopes(self.surface, point.x, self.view)
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
        jacobian = _slopes_of(self.surface, point.basis, point.values) * self.residual.slope(point.f_r)
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
        return self.at(end.x, values)

    def begin_points(self) -> Array:
        """Return points (P, S) of the free variables, spread evenly, whose lobes are as wide as samples can show."""
        points = spread(_SPREAD, max(len(self.free), 1))[:, : len(self.free)]
        chosen: list[Array] = []
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


def _cost_of(residuals: Floats, scale: float) -> Floats:
    """Return half of the sum (C,) over rows of s^2 rho((r / s)^2), rho(z) = 2 (sqrt(1 + z) - 1)."""
    z = (residuals / scale) ** 2
    return np.asarray(scale**2 * np.sum(np.sqrt(1.0 + z) - 1.0, axis=0))


def _slopes_of(surface: SearchedSurface, basis: Floats, values: Array) -> Floats:
    """Return the derivatives (K, N, C) [1/sr] of f_r by each coefficient (K, C)."""
    slopes = surface.slopes(values)
    if basis.shape[2] == 1:
        return np.asarray(np.einsum("mn,kmc->knc", basis[:, :, 0], slopes))
    return np.asarray(np.einsum("mnc,kmc->knc", basis, slopes))


def _basis_slopes(surface: SearchedSurface, x: Array, view: InstrumentView) -> dict[int, Floats]:
    """Return the derivatives (M, N, C) or (M, N, 1) [1/sr] of `SearchedSurface.basis` by shape variables, by index.

    Only models with a gradient have them. A specular part inside an aperture has none, nor have n and k where k is 0,
    the end of its range.
    """
    numbers = surface.numbers(x)
    several = surface.channels if surface.indexed else 1
    sizes = [len(term.polynomial.exponents) for term in surface.terms]
    slopes: dict[int, Floats] = {}
    of_variables = [_moves(surface, variable, x, numbers) for variable in range(len(surface.shape))]
    starts = np.concatenate([[0], np.cumsum(sizes)])
    refused: set[int] = set()
    for number, term in enumerate(surface.terms):
        wanted = {variable: moves[number] for variable, moves in enumerate(of_variables) if moves[number]}
        if not wanted:
            continue
        if term.spec.gradient is None or (view.half_angle and term.spec.specular is not None):
            refused |= wanted.keys()
            continue
        count = several if term.spec.spectral else 1
        names = {name for moves in wanted.values() for name in moves}
        by_name = [_term_slopes(term, view, surface.arguments(number, numbers[number], c), names) for c in range(count)]
        for variable, moves in wanted.items():
            of_term = np.stack([sum(move * one[name] for name, move in moves.items()) for one in by_name], axis=-1)
            if variable not in slopes:
                slopes[variable] = np.zeros((starts[-1], len(view), several))
            slopes[variable][starts[number] : starts[number + 1]] = of_term
    return {
        variable: np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)
        for variable, values in slopes.items()
        if variable not in refused and any(of_variables[variable])
    }


def _moves(
    surface: SearchedSurface, variable: int, x: Array, numbers: list[dict[str, float]]
) -> list[dict[str, float]]:
    """Return the derivatives of the parameters of each term by a shape variable; empty where a term has no part in it.

    All are empty for the variables in the place of n and k if k is 0: it begins there like a square root.
    """
    one, owner = surface.shape[variable], surface.owners[variable]
    moves: list[dict[str, float]] = [{} for _ in surface.terms]
    if owner is not None:
        term = surface.terms[owner]
        names = term.tied if term.tied and one.name == term.tied[0] else (one.name,)
        moves[owner] = dict.fromkeys(names, one.slope(float(x[variable])))
        return moves
    labels = [member.name for member in surface.shape]
    ends = {name: surface.shape[labels.index(name)].value(float(x[labels.index(name)])) for name in (NORMAL, EDGE)}
    for number, term in enumerate(surface.terms):
        if term.spec.spectral and numbers[number]["k"] > 0.0:
            slopes = index_slopes(ends[NORMAL], ends[EDGE])
            index = slopes.by_normal if one.name == NORMAL else slopes.by_edge
            moves[number] = {"n": index.n * one.slope(0.5), "k": index.k * one.slope(0.5)}
    return moves


def _term_slopes(term: Term, view: InstrumentView, given: Mapping[str, float], names: set[str]) -> dict[str, Floats]:
    """Return the derivatives (M, N) [1/sr] of the factors of a term by some of its parameters."""
    assert term.spec.gradient is not None
    model = term.spec.gradient
    ordered = sorted(names)
    arguments = columns([{**given, **node} for node in term.nodes])
    count = len(term.nodes)
    width = term.widths([given]) if view.half_angle else None

    def derivatives(wi: Floats, wr: Floats) -> Floats:
        by = model(wi, wr, **arguments).derivatives
        return np.concatenate([np.broadcast_to(by[name], (count, len(wi))) for name in ordered]).T

    with np.errstate(all="ignore"):  # extreme parameters may raise flags
        seen = view.mean(derivatives, None if width is None else float(width[0])).T
    values = seen.reshape(len(ordered), count, len(view))
    return dict(zip(ordered, values if term.scaled else term.polynomial.parts(values), strict=True))
