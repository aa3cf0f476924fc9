"""The planner: from the error that a user asks for to the smallest table that keeps to it."""

from __future__ import annotations

import bisect
import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.geometry import radians, unit_vector
from brdfdb.materials import Source
from brdfdb.parameters import Floats
from brdfdb.tables import error_measurement, tabulation
from brdfdb.tables._interpolation import weights_of_nodes
from brdfdb.tables.grids import (
    ANISOTROPIC_AXES,
    ANISOTROPIC_HALF_DIFFERENCE_AXES,
    HALF_DIFFERENCE_AXES,
    ISOTROPIC_AXES,
    Axis,
    Grid,
)
from brdfdb.tables.layout import Interpolation, Layout
from brdfdb.tables.table import Table, points
from brdfdb.tables.tabulation import POLE_END_DEG

PLAN_VERSION = 1

MOST_VALUES = 10_000_000  # of a table: a tolerance that takes more is refused
_TRIED = 2  # ways to interpolate on each kind of grid, those that promise to be smallest
_ROUNDS = 8  # of finer and coarser axes
_MARGIN = 0.88  # of the tolerance: other directions than the planner's find other errors
_STRICTER = (1.0, 0.8, 0.65, 0.5, 0.4, 0.3, 0.2)  # tolerances at a few wavelengths, of that at all of them
_OF_A_BAND = 30.0  # times the tolerance is what the 99th percentile of a band of theta_i may be
_WAVELENGTHS = 4  # that the axes are chosen for; the finished table is measured at all
_DRAWS, _FINAL_DRAWS = 700, 2000  # directions of a band of theta_i, for the axes and for the finished table
_SEED = 1994
_LINES = 100
_POINTS = 145  # of a line
_COUNTS = (2, 3, 4, 5, 6, 8, 10, 12, 15, 18, 22, 27, 33, 41, 50, 61, 75, 92, 112, 137)  # nodes of an axis
_MOST_NODES = 400  # of an axis
_BEYOND = 4.0  # safety factor on the node count where the grid extends below the horizon
_HOPELESS = 8.0  # times the fewest values of another kind: a kind that takes so many is not looked into
_SMOOTHED = 9  # points of a line that the density of nodes is averaged over
_EASED = 0.15  # of the mean density of nodes is what the emptiest part of an axis gets
_BITS = range(9, 24)
_WORTH_ROUNDING = 4096  # values: of smaller tables nothing is rounded

# Where the points of a line lie, s in [0, 1]: (end [degree], power); a power p > 0 crowds them at 0 as s**p, p < 0 at
# the end
_LINE = {
    "theta_i": (90.0, -2.0),
    "theta_r": (90.0, -2.0),
    "delta_phi": (180.0, -1.5),
    "phi_i": (180.0, 1.0),
    "phi_r": (360.0, 1.0),
    "theta_h": (90.0, 2.0),
    "theta_d": (90.0, -1.5),
    "phi_h": (180.0, 1.0),
    "phi_d": (90.0, 1.0),
}


class _Need:
    """The need of an axis: the density of its nodes, and the error that so many of them leave on lines along it."""

    def __init__(self, layout: Layout, axis: int, numbers: Floats, weight: Floats) -> None:
        order = 4 if layout.interpolation.cubic else 2
        count, size, wavelengths = numbers.shape
        self.layout, self.axis, self.order = layout, axis, order
        self.rows = np.moveaxis(numbers, 2, 1).reshape(count * wavelengths, size)
        self.weights = np.moveaxis(weight, 2, 1).reshape(count * wavelengths, size)
        self.known: dict[int, float] = {}
        left = np.abs(np.diff(self.rows, order, axis=1)) * self.weights[:, order // 2 : size - order // 2]
        peak = np.pad(np.percentile(left, 98, axis=0) ** (1.0 / order), order // 2, mode="edge")
        smooth = np.convolve(
            np.pad(peak, _SMOOTHED // 2, mode="edge"), np.full(_SMOOTHED, 1.0 / _SMOOTHED), mode="valid"
        )
        density = smooth + _EASED * smooth.mean() + 1e-30
        self.density = density / density.sum()
        self.counts = [n for n in _COUNTS if _spread(self.density, n) is not None]

    def left(self, count: int) -> float:
        """Return the error that a number of nodes leaves."""
        if count not in self.known:
            at = _spread(self.density, count)
            assert at is not None
            self.known[count] = _left(self.layout, self.axis, at, self.rows, self.weights)
        return self.known[count]

    def count(self, error: float) -> float:
        """Return the smallest number of nodes that leaves no more than an error; infinite if no sensible one does.

        More nodes than lines have points are guessed, from the order of the interpolation.
        """
        at = bisect.bisect_left(self.counts, True, key=lambda count: self.left(count) <= error)
        if at < len(self.counts):
            return self.counts[at]
        guessed = math.ceil(self.counts[-1] * (self.left(self.counts[-1]) / error) ** (1.0 / self.order))
        return guessed if guessed <= _MOST_NODES else math.inf


# Likely number of values, layout at a coarse grid, needs of its axes: none where the number is only a bound
_TableKind = tuple[float, Layout, dict[str, _Need]]


class _Task(NamedTuple):
    """A plan to make: a source at a few wavelengths, directions, f_r there, and the tolerance."""

    source: Source
    wavelength_nm: NDArray[np.float64] | None
    drawn: error_measurement.Draw
    truth: Floats
    tolerance: float


def check_tolerance(tolerance: float) -> None:
    """Raise a ParameterError if no table is planned for a tolerance."""
    if not 1e-4 <= tolerance <= 0.5:
        raise ParameterError("tolerance", f"{tolerance:g} is outside [0.0001, 0.5]", tolerance, (1e-4, 0.5))


def plan(source: Source, wavelength_nm: NDArray[np.float64] | None, tolerance: float) -> Layout:
    """Return the layout of the smallest table that keeps to a tolerance.

    Parameters
    ----------
    source : Source
        Material or function to tabulate.
    wavelength_nm : array of shape (L,) [nm], or None
        For spectral sources, and only for them.
    tolerance : float
        The 99th percentile of the relative error of f_r against the source, at the worst wavelength, over the
        directions of `brdfdb.tables.error_measurement.draw`; in [1e-4, 0.5]. The l1 error keeps to it, too, and each
        band of theta_i to thirty times as much.

    Returns
    -------
    Layout
        Kind of grid, axes, interpolation, spectrum and bits, with the reason in words.

    Raises
    ------
    ValueError
        If the tolerance is outside its range, or takes more than `MOST_VALUES` values.

    Notes
    -----
    Along each axis of each kind of grid the numbers to be tabulated are looked at on lines through directions of the
    draw. The nodes of an axis are spread by what their differences, second for linear and fourth for cubic
    interpolation, leave of an error; the numbers of nodes are those that leave the same error on each axis. The kinds
    that promise the fewest values are tabulated, measured, and made coarser or finer until they keep to the tolerance.
    """
    check_tolerance(tolerance)
    task = _task(source, wavelength_nm, tolerance)
    if not task.truth.any():
        return Layout(source, coarsest(source), wavelength_nm, reason="f_r is 0: all light is in the specular part")
    table_kinds = tried = list(_table_kinds(task))
    for stricter in _STRICTER:
        layout = _smallest(task._replace(tolerance=stricter * tolerance), tried)
        if layout is not None:
            tried = [kind for kind in table_kinds if _kind(kind[1]) == _kind(layout)]
        finished = None if layout is None else _finished(layout, wavelength_nm, tolerance)
        if finished is not None:
            return replace(finished, reason=_reason(finished, tolerance, table_kinds))
    raise ParameterError(
        "tolerance",
        f"{tolerance:g} takes more than {MOST_VALUES} values of {source.name}; ask for another error, "
        "or say grazing_pole if f_r has a pole or a root at the horizon",
        tolerance,
    )


def _order(kind: _TableKind) -> tuple[float, int]:
    """Return a sorting key: the fewest values first, then the simplest."""
    size, layout, _ = kind
    how = layout.interpolation
    return size, how.cubic + how.logarithm + (how.power != 0.0)


def _smallest(task: _Task, table_kinds: list[_TableKind]) -> Layout | None:
    """Return the smallest table of some kinds that keeps to the tolerance of the task."""
    ranked = [kind for kind in sorted(table_kinds, key=_order) if kind[2]]
    for most in (0.5 * _HOPELESS * ranked[0][0], math.inf):  # nodes: a kind that takes many more than it seemed is left
        best: Layout | None = None
        tried: Counter[tuple[str, ...]] = Counter()
        for size, layout, needs in ranked:
            tried[layout.grid.names] += 1
            if tried[layout.grid.names] <= _TRIED and (best is None or size < math.prod(best.grid.shape)):
                values = min(MOST_VALUES, most * layout.size / math.prod(layout.grid.shape))
                best = _refined(task, layout, needs, values if best is None else best.size) or best
        if best is not None:
            return best
    return None


def _reason(layout: Layout, tolerance: float, table_kinds: list[_TableKind]) -> str:
    """Return the reason for a layout: its number of nodes, and those of the other grid and of the simplest table."""
    chosen, nodes = _kind(layout), math.prod(layout.grid.shape)
    clauses = [f"for a tolerance of {tolerance:g}, {chosen} takes {nodes} nodes"]
    ranked = sorted(table_kinds, key=_order)
    simplest = [c for c in ranked if c[1].interpolation.plain and not c[1].interpolation.cubic]
    others = [c for c in ranked if c[1].grid.names != layout.grid.names][:1] + simplest[:1]
    for size, other, needs in others:
        if _kind(other) != chosen:
            bound = "about" if needs else "more than"
            clauses.append(f"{_kind(other)} was expected to take {bound} {min(size, MOST_VALUES):.2g}")
    if layout.spectra is not None:
        clauses.append(f"{layout.spectra.shape[1]} wavelengths are made of {len(layout.spectra)} parts")
    return "; ".join(clauses)


def _kind(layout: Layout) -> str:
    how = layout.interpolation
    what = "logarithms" if how.logarithm else "f_r"
    weight = {0.0: "", 0.5: " times the root of cos cos", 1.0: " times cos cos"}[how.power]
    return f"{how.method} in {what}{weight} over {', '.join(layout.grid.names)}"


def _task(source: Source, wavelength_nm: NDArray[np.float64] | None, tolerance: float) -> _Task:
    some = wavelength_nm
    if wavelength_nm is not None and wavelength_nm.size > _WAVELENGTHS:
        some = wavelength_nm[np.round(np.linspace(0, wavelength_nm.size - 1, _WAVELENGTHS)).astype(int)]
    drawn = error_measurement.draw(source, some, _DRAWS, _SEED)
    return _Task(source, some, drawn, error_measurement.model_values(source, some, drawn.wi, drawn.wr), tolerance)


def offset_of(source: Source, wavelength_nm: NDArray[np.float64] | None) -> float:
    """Return the offset [1/sr] of f_r before logarithms are taken: half the floor of its relative error."""
    return _offset(_task(source, wavelength_nm, 0.01))


def _offset(task: _Task) -> float:
    return float(max(0.5 * error_measurement.floor_of(task.truth, task.drawn).min(), 1e-12))


def coarsest(source: Source) -> Grid:
    """Return the smallest grid that suits a source."""
    names = ANISOTROPIC_AXES if source.anisotropic else ISOTROPIC_AXES
    return _grid(source, names, pole=source.grazing_pole)


def _grid(source: Source, names: tuple[str, ...], *, pole: bool) -> Grid:
    """Return the grid with the two ends of each axis alone; with a pole, light and viewer end before it."""
    ends = {name: _end(source, name) for name in names}
    if pole:
        ends |= {name: POLE_END_DEG for name in ("theta_i", "theta_r") if name in names}
    return Grid({name: [0.0, end] for name, end in ends.items()})


def _end(source: Source, name: str) -> float:
    """Return the end of an axis [degree]; symmetry leaves out what it may."""
    if name in ("phi_i", "phi_h"):
        return 90.0 if source.elliptical else 360.0
    if name == "phi_d" and source.anisotropic:
        return 180.0
    return _LINE[name][0]


def _table_kinds(task: _Task) -> Iterator[_TableKind]:
    """Yield kinds of tables, each with the number of values that it is likely to take; simple ones first."""
    source = task.source
    offset = _offset(task)
    kinds: list[tuple[str, ...]]
    if source.anisotropic:
        kinds = [ANISOTROPIC_HALF_DIFFERENCE_AXES] if source.elliptical else [ANISOTROPIC_AXES]
    else:
        kinds = [ISOTROPIC_AXES, HALF_DIFFERENCE_AXES] if source.has_lobe else [ISOTROPIC_AXES]
    fewest = float(MOST_VALUES)
    for names in kinds:
        for power in (0.5, 1.0, 0.0) if source.grazing_pole else (0.0,):
            # what goes on beyond the horizon may fall below 0, which a logarithm does not
            for logarithm in (True,) if "theta_h" in names else (True, False):
                grid = _grid(source, names, pole=source.grazing_pole and power == 0.0)
                how = Interpolation("linear", logarithm, offset if logarithm else 0.0, power)
                layout = Layout(source, grid, task.wavelength_nm, how)
                lines: dict[str, tuple[Floats, Floats]] = {}
                for method in ("cubic", "linear"):
                    chosen = replace(layout, interpolation=replace(layout.interpolation, method=method))
                    needs: dict[str, _Need] = {}
                    size = 1.0
                    for axis, name in enumerate(names):
                        if name == "theta_r" and not source.anisotropic:
                            needs[name] = needs["theta_i"]  # reciprocity
                        else:
                            if name not in lines:
                                lines[name] = _lines(task, layout, axis)
                            needs[name] = _Need(chosen, axis, *lines[name])
                        size *= needs[name].count(task.tolerance)
                        if name == "theta_h" and power == 0.0:
                            size *= _BEYOND
                        if size > _HOPELESS * fewest:
                            needs = {}
                            break
                    fewest = min(fewest, size if needs else math.inf)
                    yield size, chosen, needs


def _points(name: str, end: float, s: Floats) -> Axis:
    """Return the place on an axis [degree] of the point s of a line, in [0, 1]."""
    power = _LINE[name][1]
    return np.asarray(end * (s**power if power > 0.0 else 1.0 - (1.0 - s) ** -power), dtype=np.float64)


def _lines(task: _Task, layout: Layout, axis: int) -> tuple[Floats, Floats]:
    """Numbers along lines of one axis through directions of the draw, (lines, points, L), and the error of f_r that an
    error of one in them makes, relative to f_r or its floor; 0 below the horizon."""
    grid = layout.grid
    above = np.flatnonzero(task.drawn.above)
    chosen = above[:: max(1, above.size // _LINES)][:_LINES]
    wi, wr = task.drawn.wi[chosen], task.drawn.wr[chosen]
    x = points(grid, wi, wr)
    name = grid.names[axis]
    coordinates = [np.repeat(column[:, np.newaxis], _POINTS, axis=1) for column in x]
    coordinates[axis][:] = radians(_points(name, grid.axes[name][-1], np.linspace(0.0, 1.0, _POINTS)))
    if grid.half_difference:
        theta_h, *others = coordinates
        phi_h, theta_d, phi_d = others if grid.anisotropic else (np.zeros_like(theta_h), *others)
        numbers = tabulation.continued(layout, theta_h, phi_h, theta_d, phi_d)
        cos_h, sin_h = np.cos(theta_h) * np.cos(theta_d), np.sin(theta_h) * np.sin(theta_d) * np.cos(phi_d)
        lowest, mu = cos_h - np.abs(sin_h), (cos_h + sin_h) * (cos_h - sin_h)
    else:
        theta_i, *others = coordinates
        phi_i, theta_r, phi_r = others if grid.anisotropic else (np.zeros_like(theta_i), *others)
        numbers = tabulation.numbers(layout, unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r))
        lowest, mu = np.minimum(np.cos(theta_i), np.cos(theta_r)), np.cos(theta_i) * np.cos(theta_r)
    how = layout.interpolation
    factor = np.maximum(mu, 1e-12)[..., np.newaxis] ** -how.power
    floor = error_measurement.floor_of(task.truth, task.drawn)
    uniform = 0.0 if layout.uniform is None else layout.uniform
    if how.logarithm:
        shifted = np.exp(numbers)
        f_r, slope = (shifted - how.offset) * factor + uniform, shifted * factor
    else:
        f_r, slope = numbers * factor + uniform, factor
    weight = np.where((lowest > 1e-3)[..., np.newaxis], slope / np.maximum(f_r, floor), 0.0)
    return numbers, weight


def _spread(density: Floats, count: int) -> NDArray[np.int64] | None:
    """Return the points of a line that are nodes of an axis with so many; None if two would be the same."""
    at = np.round(_quantiles(density, count) * (density.size - 1)).astype(np.int64)
    return at if np.all(np.diff(at) > 0) else None


def _quantiles(density: Floats, count: int) -> Floats:
    """Return places s in [0, 1] between which the density of nodes has equal integrals."""
    steps = 0.5 * (density[1:] + density[:-1])
    total = np.concatenate([[0.0], np.cumsum(steps)])
    return np.interp(np.linspace(0.0, total[-1], count), total, np.linspace(0.0, 1.0, density.size))


def _left(layout: Layout, axis: int, at: NDArray[np.int64], rows: Floats, weights: Floats) -> float:
    """Return the 99th percentile of the error on lines that are interpolated between some of their points."""
    grid = layout.grid
    name = grid.names[axis]
    x = _points(name, grid.axes[name][-1], np.linspace(0.0, 1.0, rows.shape[1]))
    nodes = x[at]
    index, weight = weights_of_nodes(nodes, x, grid.ends[axis], cubic=layout.interpolation.cubic)
    matrix = np.zeros((x.size, nodes.size))
    np.add.at(matrix, (np.arange(x.size)[:, np.newaxis], index), weight)
    error = np.abs(rows[:, at] @ matrix.T - rows) * weights
    return float(np.percentile(error[weights > 0.0], 99)) if np.any(weights > 0.0) else 0.0


def _with_axes(layout: Layout, needs: dict[str, _Need], error: float) -> Layout | None:
    """Return the layout whose axes leave the same error each; None if no known number of nodes does."""
    axes = {}
    for name, need in needs.items():
        count = need.count(error)
        if count == math.inf:
            return None
        end = layout.grid.axes[name][-1]
        nodes = _points(name, end, _quantiles(need.density, int(count)))
        axes[name] = np.append(np.round(nodes[:-1], 4), end)
    return replace(layout, grid=Grid(axes))


def _error(layout: Layout, values: NDArray[np.float32], drawn: error_measurement.Draw, truth: Floats) -> float:
    """Return the largest of the errors that are held to the tolerance.

    They are the 99th percentile of the relative error at the worst wavelength, the l1 error, as a few values that are
    off by orders of magnitude next to a pole escape any percentile, and the 99th percentile of each band of theta_i
    over `_OF_A_BAND`: grazing light is a ninth of the directions.
    """
    looked_up = Table.of(layout, values).lookup_vectors(drawn.wi, drawn.wr).reshape(truth.shape)
    error = error_measurement.relative(looked_up, truth, error_measurement.floor_of(truth, drawn))
    wrong = drawn.weight @ np.abs(looked_up - truth)
    l1 = np.divide(wrong, drawn.weight @ truth, out=np.zeros_like(wrong), where=wrong > 0.0)
    worst = max(np.percentile(error[drawn.above], 99, axis=0).max(), l1.max())
    for band in np.unique(drawn.band):
        in_band = error[drawn.above & (drawn.band == band)]
        worst = max(worst, np.percentile(in_band, 99, axis=0).max() / _OF_A_BAND)
    return float(worst)


def _values(layout: Layout) -> NDArray[np.float32]:
    return np.concatenate([tabulation.block(layout, rows) for rows in layout.blocks])


def _refined(task: _Task, layout: Layout, needs: dict[str, _Need], most: float) -> Layout | None:
    """Return the coarsest axes of those tried that keep to the tolerance with fewer than `most` values; or None."""
    goal, error, best = _MARGIN * task.tolerance, task.tolerance, None
    known: dict[tuple[int, ...], float] = {}
    for _ in range(_ROUNDS):
        trial = _with_axes(layout, needs, error)
        if trial is None or trial.size >= most:
            break
        if trial.grid.shape not in known:
            known[trial.grid.shape] = _error(trial, _values(trial), task.drawn, task.truth) / goal
        ratio = known[trial.grid.shape]
        if ratio <= 1.0 and (best is None or trial.size < best.size):
            best = trial
        if 0.75 <= ratio <= 1.0 or (ratio < 1.0 and max(trial.grid.shape) == 2):
            break
        error *= float(np.clip(0.85 / max(ratio, 1e-9), 0.25, 4.0))
    return best


def _finished(layout: Layout, wavelength_nm: NDArray[np.float64] | None, tolerance: float) -> Layout | None:
    """Return the layout at all wavelengths, with as few coefficients and bits as the error allows; None if none do."""
    drawn = error_measurement.draw(layout.source, wavelength_nm, _FINAL_DRAWS, _SEED + 1)
    truth = error_measurement.model_values(layout.source, wavelength_nm, drawn.wi, drawn.wr)
    goal = _MARGIN * tolerance
    reason = f"the smallest of those tried that keep 99 of 100 values within {tolerance:g} of the model, relative"
    layout = replace(layout, wavelength_nm=wavelength_nm, reason=reason)
    whole = _values(layout)
    if layout.interpolation.logarithm and wavelength_nm is not None and wavelength_nm.size > 2:
        rows = whole.reshape(-1, wavelength_nm.size).astype(np.float64)
        floor = error_measurement.floor_of(truth, drawn)
        significance = np.max(np.minimum(np.exp(rows) / floor, 1.0), axis=1, keepdims=True)
        seen = rows * significance
        basis = np.linalg.eigh(seen.T @ seen).eigenvectors[:, ::-1].T  # the spectra that say most come first
        for parts in range(1, wavelength_nm.size // 2 + 1):
            factored = replace(layout, spectra=basis[:parts])
            values = (rows @ basis[:parts].T).astype(np.float32).reshape(factored.shape)
            if _error(factored, values, drawn, truth) <= goal:
                layout, whole = factored, values
                break
    for bits in _BITS if layout.size > _WORTH_ROUNDING else (23,):
        rounded = replace(layout, bits=bits)
        if _error(rounded, tabulation.rounded(whole, bits), drawn, truth) <= goal:
            return rounded
    return None
