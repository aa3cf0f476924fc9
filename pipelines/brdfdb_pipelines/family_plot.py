"""Pictures of families: errors of forms along each parameter, their costs, and a table of all forms."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.lines import Line2D
from matplotlib.text import OffsetFrom
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from brdfdb.errors import counted
from brdfdb.forms.tradeoff import BetweenMembers, ChartedForm, FamilyChart, FamilyCurve, FamilyDiagnostic
from brdfdb_pipelines import figure_look, terminal
from brdfdb_pipelines.plot_panels import (
    BELOW,
    GAP,
    LEADER,
    LEFT,
    LINE,
    LOOKS,
    PLOT,
    RIGHT,
    ROW,
    WIDTH,
    Label,
    cost_axes,
    error_axis,
    height_of,
    labelled,
    legend,
    percent,
    table_of,
    titled,
    wavelengths,
)

_FAMILY_COLUMNS = (18.0, 250.0, 330.0, 410.0, 490.0, 580.0, 670.0, 760.0, 850.0, 988.0)
CLOSE = 0.01  # mean error below which a form replaces the exact one
_MEAN, _NAMES, _TAIL = (
    216.0,
    172.0,
    150.0,
)  # widths [point]: means, names, 99th percentiles
_FAMILY_ABOVE, _FAMILY_ROW = 76.0, 310.0  # heights [point]: for a diagnostic; of a parameter
_HIGHEST = 10.0  # largest error that is drawn: ten times the reflected light
_DASHES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1, 1.5)), (0, (5, 1.5, 1, 1.5)), (0, (9, 3)))
_APART = 26.0  # distance of labelled ticks [point]


def along(whole: FamilyChart, axis: str) -> list[list[int]]:
    """Return the indices of the members at each value of one parameter of a family."""
    shape = [len(values) for values in whole.axes.values()]
    numbers = np.arange(len(whole.members)).reshape(shape)
    return np.moveaxis(numbers, list(whole.axes).index(axis), 0).reshape(len(whole.axes[axis]), -1).tolist()


def middle(errors: Iterable[float | None]) -> float | None:
    """Return the median of the errors that are not None; None if there are none."""
    there = [error for error in errors if error is not None]
    return float(np.median(there)) if there else None


def drawn(whole: FamilyChart) -> Canvas:
    """Draw two panels of errors for each parameter, a panel of cost against error, and a table of all forms."""
    bottom = _FAMILY_ABOVE + PLOT + (len(whole.axes) - 1) * _FAMILY_ROW
    count_of = len(whole.curves) + (whole.between is not None)
    height = bottom + BELOW + ROW * (count_of + 2)
    several = "; lines are medians, bands all members of a value" if len(whole.axes) > 1 else ""
    subtitle = f"{whole.family}, {whole.model}, {wavelengths(whole)}, {len(whole.members)} members{several}."
    if whole.left_out:
        subtitle += f" {counted(len(whole.left_out), 'table')} of members cannot be made."
    canvas = titled(height, whole.title, f"{subtitle} Large: worth having there. Times are those of one member.")

    def box(left: float, top: float, width: float) -> tuple[float, float, float, float]:
        return left / WIDTH, 1.0 - (top + PLOT) / height, width / WIDTH, PLOT / height

    tail = LEFT + _MEAN + _NAMES
    for number, axis in enumerate(whole.axes):
        top = _FAMILY_ABOVE + number * _FAMILY_ROW
        mean = canvas.add_axes(box(LEFT, top, _MEAN))
        _sweep(mean, whole, axis, lambda curve: curve.l1, None if whole.between is None else whole.between.l1)
        mean.set_ylabel("mean error against the truth")
        _named(mean, whole, axis)
        if whole.diagnostic is None or len(whole.axes) > 1:
            headed(mean, "mean error")
        else:
            _diagnostic(mean, whole.axes[axis], whole.diagnostic)
        high = canvas.add_axes(box(tail, top, _TAIL))
        _sweep(high, whole, axis, lambda curve: curve.p99, None if whole.between is None else whole.between.p99)
        headed(high, "99th percentile")
        high.tick_params(labelleft=False)
    left = tail + _TAIL + 2.0 * GAP
    _costs(canvas.add_axes(box(left, _FAMILY_ABOVE, WIDTH - RIGHT - left)), whole)
    forms: list[FamilyCurve | BetweenMembers] = [*whole.curves, *([whole.between] if whole.between else [])]
    bar = Line2D(
        [], [], color=figure_look.MUTED, linewidth=3.0, alpha=0.3, label="from the least to the most of the members"
    )
    legend(canvas, {form.kind for form in forms}, [bar], bottom, height)
    table_of(
        canvas, _FAMILY_COLUMNS, _FAMILY_HEADS, [_family_row(whole, form) for form in forms], bottom + BELOW, height
    )
    return canvas


def _sweep(
    axes: Axes,
    whole: FamilyChart,
    axis: str,
    errors: Callable[[FamilyCurve], list[float | None]],
    between: float | None,
) -> None:
    """Draw errors along one parameter; forms worth having at most members of a value are drawn large."""
    x = whole.axes[axis]
    error_axis(axes, _HIGHEST)
    if x[0] > 0.0 and x[-1] > 8.0 * x[0]:
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if x[-1] < 50.0 * x[0] else (1.0,), numticks=8))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlabel(axis)
    members = along(whole, axis)
    used: Counter[str] = Counter()
    for curve in whole.curves:
        look, values = LOOKS[curve.kind], errors(curve)
        rows = [[v for index in some if (v := values[index]) is not None] for some in members]
        there = [index for index, row in enumerate(rows) if row]
        at = [x[index] for index in there]
        y = [height_of(float(np.median(rows[index]))) for index in there]
        if len(whole.axes) > 1:
            least, most = ([height_of(pick(rows[index])) for index in there] for pick in (min, max))
            axes.fill_between(at, least, most, color=look.colour, alpha=0.08, linewidth=0.0)
        axes.plot(at, y, color=look.colour, linestyle=_DASHES[used[curve.kind] % len(_DASHES)], linewidth=1.1)
        used[curve.kind] += 1
        fill = look.colour if curve.dtype == "float64" else "white"
        for index, value, height in zip(there, at, y, strict=True):
            chosen = 2 * sum(curve.key in whole.fronts[m] for m in members[index]) > len(members[index])
            size = 6.5 if chosen else 2.8
            axes.plot(value, height, look.marker, color=look.colour, markerfacecolor=fill, markersize=size, zorder=3)
    if between is not None:
        axes.axhline(height_of(between), color=LOOKS["table"].colour, linestyle=(0, (3, 2)), linewidth=0.9)


def headed(axes: Axes, text: str) -> None:
    axes.set_title(text, fontsize=8, color=figure_look.MUTED, loc="left")


def _diagnostic(axes: Axes, x: list[float], diagnostic: FamilyDiagnostic) -> None:
    """Write the diagnostic of members above the panel, of as many as there is room for."""
    shown = [len(x) - 1]
    for index in range(len(x) - 1, -1, -1):
        at, after = (axes.transData.transform((x[i], 1.0))[0] for i in (index, shown[-1]))
        if after - at > _APART * mpl.rcParams["figure.dpi"] / 72.0:
            shown.append(index)
    above = axes.secondary_xaxis("top")
    labels = [terminal.count(float(f"{diagnostic.values[index]:.2g}")) for index in shown]
    above.set_xticks([x[index] for index in shown], labels=labels)
    above.xaxis.set_minor_locator(NullLocator())
    above.set_xlabel(diagnostic.title)
    above.tick_params(length=0)
    above.spines["top"].set_visible(False)


def _named(axes: Axes, whole: FamilyChart, axis: str) -> None:
    """Draw number and name of each curve beside its right end, bold if it is worth having anywhere."""
    ends = []
    for number, curve in enumerate(whole.curves, 1):
        values = [middle([curve.l1[index] for index in some]) for some in along(whole, axis)]
        last = max(index for index, value in enumerate(values) if value is not None)
        bold = any(curve.key in front for front in whole.fronts)
        ends.append(
            (height_of(values[last] or 0.0), whole.axes[axis][last], f"{number} {curve.title}", bold, curve.kind)
        )
    if whole.between is not None:
        text = f"{len(whole.curves) + 1} {whole.between.title}"
        ends.append((height_of(whole.between.l1), whole.axes[axis][-1], text, False, whole.between.kind))
    ends.sort(key=lambda end: end[0])
    low, high = (math.log10(y) for y in axes.get_ylim())
    wanted = [PLOT * (math.log10(min(y, _HIGHEST)) - low) / (high - low) for y, *_ in ends]
    for (y, x, text, bold, kind), height in zip(ends, apart(wanted, LINE, PLOT), strict=True):
        axes.annotate(
            text,
            (x, min(y, _HIGHEST)),
            (_MEAN + 10.0, height),
            textcoords=OffsetFrom(axes, (0.0, 0.0)),
            va="center",
            fontsize=7.0,
            fontweight="bold" if bold else "normal",
            color=LOOKS[kind].colour,
            annotation_clip=False,
            arrowprops={**LEADER, "relpos": (0.0, 0.5), "shrinkA": 1.0, "shrinkB": 2.0},
        )


def apart(wanted: Sequence[float], least: float, most: float) -> list[float]:
    """Return increasing heights, moved as little as possible to be `least` apart and between 0 and `most`."""
    blocks: list[tuple[float, int]] = []  # names that touch: position of the first, and their number
    for index, height in enumerate(wanted):
        start, number = height - least * index, 1
        while blocks and blocks[-1][0] > start:
            before, several = blocks.pop()
            start, number = (before * several + start * number) / (several + number), several + number
        blocks.append((start, number))
    highest = most - least * (len(wanted) - 1)
    starts = [min(max(start, 0.0), highest) for start, number in blocks for _ in range(number)]
    return [start + least * index for index, start in enumerate(starts)]


def _costs(axes: Axes, whole: FamilyChart) -> None:
    """Draw error over cost: a bar from the least to the largest mean error of the members, a mark at the median."""
    labels = []
    forms: list[tuple[ChartedForm, list[float | None]]] = [(curve, curve.l1) for curve in whole.curves]
    if whole.between is not None:
        forms.append((whole.between, [whole.between.l1]))
    cost_axes(axes, [t for form, _ in forms for t in (form.batch.low, form.batch.high)], [_HIGHEST / 2.0])
    for number, (form, values) in enumerate(forms, 1):
        look, ns = LOOKS[form.kind], form.batch.ns
        there = [height_of(value) for value in values if value is not None]
        y, bold = float(np.median(there)), any(form.key in front for front in whole.fronts)
        axes.plot([ns, ns], [min(there), max(there)], color=look.colour, linewidth=3.0, alpha=0.3, zorder=2)
        fill = look.colour if form.dtype == "float64" else "white"
        size = 6.5 if bold else 4.5
        axes.plot(ns, y, look.marker, color=look.colour, markerfacecolor=fill, markersize=size, zorder=3)
        labels.append(Label(str(number), str(number), ns, min(y, _HIGHEST), bold))
    labelled(axes, sorted(labels, key=lambda label: not label.bold))
    axes.set_xlabel("ns a value, many directions at once")
    headed(axes, "mean error over cost")
    axes.tick_params(labelleft=False)


_FAMILY_HEADS = ("mean: least", "median", "most", "within 1 %", "p99: median", "ns, many", "ns, one", "worth having")


def _family_row(whole: FamilyChart, form: FamilyCurve | BetweenMembers) -> tuple[ChartedForm, tuple[str, ...], bool]:
    times = terminal.count(form.batch.ns), terminal.count(form.single.ns)
    if isinstance(form, BetweenMembers):
        return form, ("", percent(form.l1), "", "", percent(form.p99), *times, ""), False
    means, tails = ([v for v in values if v is not None] for values in (form.l1, form.p99))
    errors = (percent(min(means)), percent(float(np.median(means))), percent(max(means)))
    close, fronts = sum(v <= CLOSE for v in means), sum(form.key in front for front in whole.fronts)
    shares = [f"{number} of {len(whole.members)}" if number else "" for number in (close, fronts)]
    return form, (*errors, shares[0], percent(float(np.median(tails))), *times, shares[1]), fronts > 0
