"""The planner: from the error that a user asks for to the smallest table that keeps to it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError, counted
from brdfdb.materials import Material, Source
from brdfdb.tables import axis_nodes, plan_trials
from brdfdb.tables.axis_nodes import LINE, Need
from brdfdb.tables.grids import (
    ANISOTROPIC_AXES,
    ANISOTROPIC_HALF_DIFFERENCE_AXES,
    HALF_DIFFERENCE_AXES,
    ISOTROPIC_AXES,
    Grid,
)
from brdfdb.tables.layout import Interpolation, Layout, over_wavelengths
from brdfdb.tables.mixture import Mixture, mixture_of
from brdfdb.tables.plan_trials import MARGIN, SEED, PlannedTable, PlanSample
from brdfdb.tables.tabulation import POLE_END_DEG

if TYPE_CHECKING:
    from brdfdb.tables.table import Table

PLAN_VERSION = 3

MOST_VALUES = 10_000_000  # largest table [values]; tolerances that need more are refused
_TRIED = 2  # interpolations that are refined on each kind of grid, the most promising first
_ROUNDS = 8  # rounds of finer and coarser axes
_STALLED = 0.95  # ratio of errors of two rounds above which the lines are taken to misjudge an axis
_PATIENCE = 2  # such rounds, after which each axis is refined alone
_STEPS = 2  # steps on the ladder of numbers of nodes, for an axis that lines misjudge
_STRICTER = (1.0, 0.8, 0.65, 0.5, 0.4, 0.3, 0.2)  # tolerances at a few wavelengths, relative to that at all of them
_WAVELENGTHS = 4  # number of wavelengths for which axes are chosen; the finished table is measured at all
_DRAWS = 700  # pairs of directions in a band of theta_i, for the axes
_BEYOND = 4.0  # safety factor on the node count where the grid extends below the horizon
_HOPELESS = 8.0  # kinds that need this many times the values of the smallest kind are dropped


class _TableKind(NamedTuple):
    """A kind of table: its likely number of values, its layout at a coarse grid, and the needs of its axes.

    There are no needs where the number is only a bound.
    """

    size: float
    layout: Layout
    needs: dict[str, Need]

    @property
    def order(self) -> tuple[float, int]:
        """A sorting key: the fewest values first, then the simplest."""
        how = self.layout.interpolation
        return self.size, how.cubic + how.logarithm + (how.power != 0.0)


class _Task(NamedTuple):
    """The task of a plan: a source at a few wavelengths, a sample of it there, and the tolerance.

    `mixture` gives f_r at these wavelengths from a few of them; None: each wavelength is tabulated.
    """

    source: Source
    wavelength_nm: NDArray[np.float64] | None
    sample: PlanSample
    tolerance: float
    mixture: Mixture | None


def check_tolerance(tolerance: float, name: str = "tolerance") -> None:
    """Raise a ParameterError if no table is planned for a tolerance."""
    if not 1e-4 <= tolerance <= 0.5:
        raise ParameterError(name, f"{tolerance:g} is outside [0.0001, 0.5]", tolerance, (1e-4, 0.5))


def plan(
    source: Source,
    wavelength_nm: NDArray[np.float64] | None,
    tolerance: float,
    *,
    alike: Source | None = None,
    hot_spot_tolerance: float | None = None,
) -> Layout:
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
    alike : Source, optional
        A source that is about as smooth and faster to evaluate, such as a fit of an integral. Its axes are tried, and
        the finished table is measured against `source`.
    hot_spot_tolerance : float, optional
        Largest error near the light, in [1e-4, 0.5]: theta_r within 10 degrees of theta_i and delta_phi within 90, as
        `brdfdb.tables.stated_error.Places` states it. By default there is no limit.

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
    return planned(source, wavelength_nm, tolerance, alike=alike, hot_spot_tolerance=hot_spot_tolerance).layout


def planned(
    source: Source,
    wavelength_nm: NDArray[np.float64] | None,
    tolerance: float,
    *,
    alike: Source | None = None,
    hot_spot_tolerance: float | None = None,
) -> PlannedTable:
    """Return the layout that `plan` describes, and the values of its table, which the plan was measured with."""
    check_tolerance(tolerance)
    hot_spot = None
    if hot_spot_tolerance is not None:
        check_tolerance(hot_spot_tolerance, "hot_spot_tolerance")
        hot_spot = tolerance / hot_spot_tolerance
    mixture = mixture_of(source, wavelength_nm)
    planned_on = source if alike is None else alike
    task = _task(planned_on, wavelength_nm, tolerance, mixture, hot_spot)
    if not task.sample.truth.any():
        reason = "f_r is 0: all light is in the specular part"
        return PlannedTable(Layout(source, coarsest(source), wavelength_nm, reason=reason), None)
    final: PlanSample | None = None
    for hopeless in (_HOPELESS, math.inf):  # kinds that were dropped are tried if the others fail
        table_kinds = left = list(_table_kinds(task, hopeless))
        while left:
            failed: Counter[str] = Counter()
            for stricter in _STRICTER:
                layout = _smallest(task._replace(tolerance=stricter * tolerance), left)
                if layout is None:
                    break
                failed[_kind(layout)] += 1
                final = final or plan_trials.final_of(source, wavelength_nm, hot_spot)
                layout = replace(layout, source=source)
                finished = plan_trials.finished(layout, final, wavelength_nm, tolerance, mixture)
                if finished is not None:
                    reason = _reason(finished.layout, tolerance, table_kinds)
                    return finished._replace(layout=replace(finished.layout, reason=reason))
            if not failed:
                break
            # Other kinds may keep to the tolerance with more nodes: try them without the kind that failed most often
            ((hiding, _),) = failed.most_common(1)
            left = [kind for kind in left if _kind(kind.layout) != hiding]
    if hot_spot_tolerance is not None:
        raise ParameterError(
            "hot_spot_tolerance",
            f"{hot_spot_tolerance:g} near the light, with {tolerance:g} elsewhere, takes more than {MOST_VALUES} "
            f"values of {source.name}; choose a larger one",
            hot_spot_tolerance,
        )
    hint = "" if isinstance(source, Material) else ", or set grazing_pole if f_r has a pole or a root at the horizon"
    raise ParameterError(
        "tolerance",
        f"{tolerance:g} takes more than {MOST_VALUES} values of {source.name}; choose a larger one{hint}",
        tolerance,
    )


def _smallest(task: _Task, table_kinds: list[_TableKind]) -> Layout | None:
    """Return the smallest table of some kinds that keeps to the tolerance of the task."""
    ranked = [kind for kind in sorted(table_kinds, key=lambda kind: kind.order) if kind.needs]
    if not ranked:
        return None
    for most in (
        0.5 * _HOPELESS * ranked[0].size,
        math.inf,
    ):  # nodes; the first limit drops kinds that promised too much
        best: Layout | None = None
        tried: Counter[tuple[str, ...]] = Counter()
        for size, layout, needs in ranked:
            if tried[layout.grid.names] < _TRIED and (best is None or size < math.prod(best.grid.shape)):
                values = min(MOST_VALUES, most * layout.size / math.prod(layout.grid.shape))
                smaller = _refined(task, layout, needs, values if best is None else best.size, probing=most == math.inf)
                best = smaller or best
                # A kind that fails does not count as tried
                tried[layout.grid.names] += int(smaller is not None)
        if best is not None:
            return best
    return None


def _reason(layout: Layout, tolerance: float, table_kinds: list[_TableKind]) -> str:
    """Return the reason for a layout: its number of nodes, and those of the other grid and of the simplest table."""
    chosen = _kind(layout)
    clauses = [first_reason(layout, tolerance)]
    ranked = sorted(table_kinds, key=lambda kind: kind.order)
    simplest = [kind for kind in ranked if kind.layout.interpolation.plain and not kind.layout.interpolation.cubic]
    others = [kind for kind in ranked if kind.layout.grid.names != layout.grid.names][:1] + simplest[:1]
    for size, other, needs in others:
        if _kind(other) != chosen:
            bound = "about" if needs else "more than"
            clauses.append(f"{_kind(other)} was expected to take {bound} {min(size, MOST_VALUES):.2g}")
    if layout.spectra is not None:
        clauses.append(f"{layout.spectra.shape[1]} wavelengths are made of {counted(len(layout.spectra), 'part')}")
    return "; ".join(clauses)


def first_reason(layout: Layout | Table, tolerance: float) -> str:
    """Return the first clause of the reason for a planned layout: its kind, and its number of nodes."""
    return f"for a tolerance of {tolerance:g}, {_kind(layout)} takes {math.prod(layout.grid.shape)} nodes"


def _kind(layout: Layout | Table) -> str:
    how = layout.interpolation
    what = "logarithms" if how.logarithm else "f_r"
    weight = {0.0: "", 0.5: " times the root of cos cos", 1.0: " times cos cos"}[how.power]
    return f"{how.method} in {what}{weight} over {', '.join(layout.grid.names)}"


def _task(
    source: Source,
    wavelength_nm: NDArray[np.float64] | None,
    tolerance: float,
    mixture: Mixture | None,
    hot_spot: float | None = None,
) -> _Task:
    few_nm = wavelength_nm
    if wavelength_nm is not None and wavelength_nm.size > _WAVELENGTHS:
        chosen = np.round(np.linspace(0, wavelength_nm.size - 1, _WAVELENGTHS)).astype(int)
        if mixture is not None:
            chosen = np.union1d(chosen, mixture.extremes)
            mixture = mixture._replace(spectra=mixture.spectra[:, chosen])
        few_nm = wavelength_nm[chosen]
    return _Task(source, few_nm, plan_trials.sample_of(source, few_nm, _DRAWS, SEED, hot_spot), tolerance, mixture)


def offset_of(source: Source, wavelength_nm: NDArray[np.float64] | None) -> float:
    """Return the offset [1/sr] of f_r before logarithms are taken: half the floor of its relative error."""
    return _offset(_task(source, wavelength_nm, 0.01, None))


def _offset(task: _Task) -> float:
    floor = task.sample.floor
    if task.mixture is not None:  # an error of a part counts as much as its weight
        floor = floor / np.maximum(np.abs(task.mixture.spectra).max(axis=0), 1e-12)
    return float(max(0.5 * floor.min(), 1e-12))


def coarsest(source: Source) -> Grid:
    """Return the smallest grid that suits a source."""
    names = ANISOTROPIC_AXES if source.anisotropic else ISOTROPIC_AXES
    return _grid(source, names, pole=source.grazing_pole)


def _grid(source: Source, names: tuple[str, ...], *, pole: bool) -> Grid:
    """Return the grid with the two ends of each axis alone; with a pole, light and viewer end before it."""
    ends = {name: end for name, (end, _) in LINE.items()}
    # Symmetry leaves out azimuths
    ends |= dict.fromkeys(("phi_i", "phi_h"), 90.0 if source.elliptical else 360.0)
    ends["phi_d"] = 90.0 * (1 + source.anisotropic) * (2 - source.reciprocal)
    if pole:
        ends |= dict.fromkeys(("theta_i", "theta_r"), POLE_END_DEG)
    return Grid({name: [0.0, ends[name]] for name in names})


def _table_kinds(task: _Task, hopeless: float = _HOPELESS) -> Iterator[_TableKind]:
    """Yield kinds of tables, each with its expected number of values; simple ones first.

    A kind is dropped as soon as some of its axes need `hopeless` times the values of the smallest kind.
    """
    source = task.source
    offset = _offset(task)
    floor = task.sample.floor
    kinds: list[tuple[str, ...]]
    if source.anisotropic:
        kinds = [ANISOTROPIC_HALF_DIFFERENCE_AXES] if source.elliptical else [ANISOTROPIC_AXES]
    else:
        of_halves = source.has_lobe or task.sample.hot_spot is not None
        kinds = [ISOTROPIC_AXES, HALF_DIFFERENCE_AXES] if of_halves else [ISOTROPIC_AXES]
        if source.grazing_pole:  # a pole needs many nodes over light and viewer: this kind, tried last, is soon dropped
            kinds = kinds[::-1]
    fewest = float(MOST_VALUES)
    known: dict[tuple[str, bool, bool], axis_nodes.Lines] = {}  # of a kind of grid, where f_r is the same
    for names in kinds:
        known.clear()
        for power in (0.5, 1.0, 0.0) if source.grazing_pole else (0.0,):
            # Beyond the horizon the continued f_r may be negative, its logarithm may not
            for logarithm in (True,) if "theta_h" in names else (True, False):
                grid = _grid(source, names, pole=source.grazing_pole and power == 0.0)
                how = Interpolation("linear", logarithm, offset if logarithm else 0.0, power, over_wavelengths(source))
                layout = Layout(source, grid, task.wavelength_nm, how)
                if task.mixture is not None:
                    layout = replace(layout, spectra=task.mixture.spectra, part_nm=task.mixture.part_nm)
                lines: dict[str, axis_nodes.LineNumbers] = {}
                for method in ("cubic", "linear"):
                    chosen = replace(layout, interpolation=replace(layout.interpolation, method=method))
                    needs: dict[str, Need] = {}
                    size = 1.0
                    for axis, name in enumerate(names):
                        if name == "theta_r" and not source.anisotropic and source.reciprocal:
                            needs[name] = needs["theta_i"]
                        else:
                            if name not in lines:
                                same = name, power == 0.0, layout.plain
                                if same not in known:
                                    known[same] = axis_nodes.lines(layout, axis, task.sample.for_lines)
                                lines[name] = axis_nodes.numbers_along(layout, known[same], floor)
                            needs[name] = Need(chosen, axis, *lines[name])
                        size *= needs[name].count(task.tolerance)
                        if name == "theta_h" and power == 0.0:
                            size *= _BEYOND
                        if size > hopeless * fewest:
                            needs = {}
                            break
                    fewest = min(fewest, size if needs else math.inf)
                    yield _TableKind(size, chosen, needs)


def _with_axes(layout: Layout, needs: dict[str, Need], error: float, finer: Mapping[str, int]) -> Layout | None:
    """Return the layout whose axes leave the same error each, some of them finer.

    None if no known number does, or if so many nodes are the same as they are rounded.
    """
    axes = {}
    for name, need in needs.items():
        count = need.more(need.count(error), finer.get(name, 0))
        if count == math.inf:
            return None
        axes[name] = need.nodes(int(count))
        if np.any(np.diff(axes[name]) <= 0.0):
            return None
    return replace(layout, grid=Grid(axes))


def _refined(task: _Task, layout: Layout, needs: dict[str, Need], most: float, *, probing: bool) -> Layout | None:
    """Return the coarsest axes of those tried that keep to the tolerance with fewer than `most` values; or None.

    If `probing` and finer axes leave the error as it is, lines misjudge one of them: the one that helps most gets more.
    """
    goal = MARGIN * task.tolerance
    error = task.tolerance
    best = None
    finer: dict[str, int] = {}  # steps on some axes beyond what lines tell
    known: dict[tuple[int, ...], float] = {}

    def measured(trial: Layout) -> float:
        if trial.grid.shape not in known:
            known[trial.grid.shape] = plan_trials.error_of(trial, plan_trials.values_of(trial), task.sample) / goal
        return known[trial.grid.shape]

    # The axes, those that share a need together
    alike = [tuple(name for name in needs if needs[name] is need) for need in dict.fromkeys(needs.values())]
    last = math.inf
    stalled = 0
    rounds = _ROUNDS
    while rounds > 0:
        trial = _with_axes(layout, needs, error, finer)
        if trial is None or trial.size >= most:
            break
        ratio = measured(trial)
        if ratio <= 1.0 and (best is None or trial.size < best.size):
            best = trial
        if 0.75 <= ratio <= 1.0 or (ratio < 1.0 and max(trial.grid.shape) == 2):
            break
        stalled = stalled + 1 if probing and best is None and ratio > _STALLED * last else 0
        last = min(last, ratio)
        if stalled >= _PATIENCE:
            steps = {axes: _with_axes(layout, needs, error, _finer(finer, axes)) for axes in alike}
            some = {axes: trial for axes, trial in steps.items() if trial is not None and trial.size < most}
            if not some:
                break
            finer = _finer(finer, min(some, key=lambda axes: measured(some[axes])))
        else:
            rounds -= 1
            error *= float(np.clip(0.85 / max(ratio, 1e-9), 0.25, 4.0))
    return best


def _finer(finer: Mapping[str, int], axes: tuple[str, ...]) -> dict[str, int]:
    """Return the steps beyond what lines tell, with more of them on some axes."""
    return {**finer, **{name: finer.get(name, 0) + _STEPS for name in axes}}
