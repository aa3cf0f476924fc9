"""Pictures of charts: error over time and bytes, or along a family; what is worth having, and a table of all below."""

from __future__ import annotations

import html
import io
import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.lines import Line2D
from matplotlib.text import OffsetFrom
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullLocator

from brdfdb.charted import Between, Chart, Cost, Curve, FamilyChart, Form, Point, Sampler
from brdfdb.representations import Kind
from brdfdb_pipelines import charts, terminal

WIDTH, _PLOT, _ABOVE, _BELOW, _ROW = 1000.0, 270.0, 64.0, 58.0, 12.0  # points
_LEFT, _GAP, _RIGHT = 66.0, 14.0, 12.0
_SHARES = (0.38, 0.15, 0.15, 0.15, 0.17)  # of the width, of the panels
_DPI = 110
SMALLEST = 1e-6  # errors below are drawn here: the truth, and what differs from it by rounding
_LETTER, _LINE = 4.1, 9.0  # width and height of a letter of a label, on average
_LEADER: dict[str, Any] = {"arrowstyle": "-", "color": charts.MUTED, "linewidth": 0.5}
_NEAR = 10.0  # what is written further from its point has a line to it
# Left end of titles and right ends of columns, of the table of a material and of a family
_COLUMNS = (18.0, 230.0, 280.0, 385.0, 435.0, 485.0, 540.0, 630.0, 680.0, 735.0, 800.0, 935.0, 988.0)
_FAMILY_COLUMNS = (18.0, 250.0, 330.0, 410.0, 490.0, 580.0, 670.0, 760.0, 850.0, 988.0)
_SAMPLER_COLUMNS = (18.0, 300.0, 390.0, 480.0, 620.0, 710.0, 800.0, 940.0)
_BARS = 76.0  # height of the panels of samplers


class _Look(NamedTuple):
    colour: str
    marker: str


_LOOKS: dict[Kind, _Look] = {
    "exact": _Look(charts.TRUTH, "o"),
    "quadrature": _Look(charts.TRUTH, "P"),
    "closed form": _Look(charts.OURS, "D"),
    "approximation": _Look(charts.TEXTBOOK, "s"),
    "customary": _Look(charts.OTHERS[2], "p"),
    "printed": _Look(charts.PRINTED, "X"),
    "other model": _Look(charts.MUTED, "v"),
    "table": _Look(charts.OTHERS[0], "^"),
}
_STYLE: dict[Any, Any] = charts.STYLE | {"svg.hashsalt": "brdfdb", "font.family": "sans-serif"}
_BLANK: dict[str, Any] = {"Date": None, "Creator": None, "Format": None, "Type": None}


def svg(chart: Chart | FamilyChart) -> str:
    """The picture as a document of its own."""
    with mpl.rc_context(_STYLE):
        text = io.StringIO()
        _canvas(chart).savefig(text, format="svg", metadata=_BLANK)
    opening, rest = charts.kept_ids(charts.shortened(text.getvalue()), "c").split(">", 1)
    described = html.escape(f"{chart.title}: error of each representation over its cost")
    plate = '<rect width="100%" height="100%" fill="#fff"/>'
    return f'{opening} font-family="sans-serif" role="img" aria-label="{described}">{plate}{rest}\n'


def png(chart: Chart | FamilyChart) -> bytes:
    """The picture in pixels."""
    with mpl.rc_context(_STYLE):
        data = io.BytesIO()
        _canvas(chart).savefig(data, format="png", dpi=_DPI, metadata={"Software": None})
    return data.getvalue()


def _canvas(chart: Chart | FamilyChart) -> Canvas:
    return _drawn(chart) if isinstance(chart, Chart) else _drawn_family(chart)


def _drawn(chart: Chart) -> Canvas:
    table = _ABOVE + _PLOT + _BELOW
    samplers = table + _ROW * (len(chart.points) + 3)
    height = samplers + _ROW * (len(chart.samplers) + 3) + _BARS + 44.0
    said = "Lines go up from the mean error to the 99th percentile, thick over its 95 % confidence interval."
    times = "Bars are quartiles of the time."
    if len(chart.ladder) > 1:
        times += " Dashed: the ladder, the truth by ever coarser quadrature."
    canvas = _titled(height, chart.title, f"{chart.material}, {chart.model}, {_wavelengths(chart)}. {said}\n{times}")
    room = WIDTH - _LEFT - _RIGHT - 2.0 * _GAP
    left = _LEFT

    def of(cost: Cost) -> tuple[float, float, float]:
        return cost.low, cost.ns, cost.high

    panels: tuple[tuple[str, Callable[[Point], tuple[float, float, float]], list[str]], ...] = (
        ("ns a value, many directions at once", lambda p: of(p.batch), chart.fronts.batch),
        ("256 directions", lambda p: of(p.block), []),
        ("one direction", lambda p: of(p.single), chart.fronts.single),
        ("64 materials in turn", lambda p: of(p.mixed), []),
        ("bytes that it reads", lambda p: (p.bytes, p.bytes, p.bytes), chart.fronts.bytes),
    )
    for number, (share, (label, cost, front)) in enumerate(zip(_SHARES, panels, strict=True)):
        box = (left / WIDTH, 1.0 - (_ABOVE + _PLOT) / height, share * room / WIDTH, _PLOT / height)
        axes = canvas.add_axes(box)
        _panel(axes, chart, cost, front, named=number == 0)
        axes.set_xlabel(label)
        if number == 0:
            axes.set_ylabel("error against the truth")
        else:
            axes.tick_params(labelleft=False)
        left += share * room + _GAP
    lines = [Line2D([], [], color=charts.OURS, linewidth=5.0, alpha=0.16, label="front")]
    if len(chart.ladder) > 1:
        lines.append(Line2D([], [], color=charts.TRUTH, linestyle=(0, (4, 2)), linewidth=1.0, label="ladder"))
    _legend(canvas, {point.kind for point in chart.points}, lines, _ABOVE + _PLOT, height)
    fronts = {*chart.fronts.batch, *chart.fronts.single}
    rows = []
    for point in chart.points:
        errors = (point.forward, point.back, point.grazing)
        others = map(terminal.count, (point.block.ns, point.single.ns, point.mixed.ns))
        cells = (percent(point.l1), tail(point), *map(percent, errors), quartiles(point.batch), *others, against(point))
        rows.append((point, (*cells, terminal.size(point.bytes)), point.key in fronts))
    heads = ("mean error", "p99 (95 % interval)", "forward", "back", "grazing", "ns, many (quartiles)")
    _table(
        canvas, _COLUMNS, (*heads, "256", "one", "in turn", "times as fast as its rung", "bytes"), rows, table, height
    )
    _samplers(canvas, chart, samplers, height)
    return canvas


def tail(point: Point) -> str:
    """The 99th percentile of the error and its confidence interval, all in percent."""
    if point.p99 <= SMALLEST:
        return percent(point.p99)
    high = "" if point.p99_high is None else f"{100.0 * point.p99_high:.2g}"
    return f"{percent(point.p99)} ({100.0 * point.p99_low:.2g}-{high})"


def quartiles(cost: Cost) -> str:
    """The time of a form [ns], and its quartiles."""
    ns, low, high = map(terminal.count, (cost.ns, cost.low, cost.high))
    return f"{ns} ({low}-{high})"


def against(point: Point) -> str:
    """How many times as fast a form is as the cheapest rung of the truth that is as accurate, and which that is."""
    return "" if point.saving is None else f"{terminal.count(float(f'{point.saving.times:.2g}'))} ({point.rung})"


_WORK_HEADS = ("variance", "ns a sample", "ms to 1 % (quartiles)")


def works(sampler: Sampler) -> tuple[str, ...]:
    """Variance, time and their product of a sampler: for the albedo, then for the sphere."""
    cells: list[str] = []
    for work in (sampler.albedo, sampler.sphere):
        ms, low, high = (f"{value:.3g}" for value in (work.ms, work.low_ms, work.high_ms))
        cells += [f"{work.variance:.3g}", f"{work.ns:.3g}", f"{ms} ({low}-{high})"]
    return tuple(cells)


def _samplers(canvas: Canvas, chart: Chart, top: float, height: float) -> None:
    """Variance and time of samplers as a table, their product with its quartiles as bars."""
    heads = (*(f"albedo: {head}" for head in _WORK_HEADS[:2]), _WORK_HEADS[2])
    heads += (*(f"sphere: {head}" for head in _WORK_HEADS[:2]), _WORK_HEADS[2])
    _row(canvas, _SAMPLER_COLUMNS, 0, ("", "samplers of the material's model", *heads), top, height, color=charts.MUTED)
    for number, sampler in enumerate(chart.samplers, 1):
        cells = (str(number), sampler.title, *works(sampler))
        _row(canvas, _SAMPLER_COLUMNS, number, cells, top, height)
    below = top + _ROW * (len(chart.samplers) + 2)
    room = (WIDTH - _LEFT - _RIGHT - 4.0 * _GAP) / 2.0
    for which, label in enumerate(("albedo of light from 60 degrees", "sphere under a sky and a lamp")):
        left = _LEFT + which * (room + 4.0 * _GAP)
        axes = canvas.add_axes((left / WIDTH, 1.0 - (below + _BARS) / height, room / WIDTH, _BARS / height))
        values = [(sampler.albedo, sampler.sphere)[which] for sampler in chart.samplers]
        axes.set_xscale("log")
        for y, work in enumerate(values):
            least = max(work.low_ms, 1e-6)
            axes.plot([least, max(work.high_ms, least)], [y, y], color=charts.OURS, linewidth=4.0, alpha=0.4)
            axes.plot(max(work.ms, 1e-6), y, "o", color=charts.OURS, markersize=4.5)
        axes.set_yticks(range(len(values)), [sampler.key for sampler in chart.samplers])
        axes.set_ylim(len(values) - 0.4, -0.6)
        ends = [max(value, 1e-6) for work in values for value in (work.low_ms, work.high_ms)]
        axes.set_xlim(0.6 * min(ends), 1.7 * max(ends))
        axes.xaxis.set_major_locator(
            LogLocator(subs=(1.0, 2.0, 5.0) if max(ends) < 50.0 * min(ends) else (1.0,), numticks=8)
        )
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.grid(color=charts.GRID, linewidth=0.6, axis="x")
        axes.tick_params(length=0)
        axes.spines[["top", "right"]].set_visible(False)
        axes.set_xlabel(f"ms to a standard deviation of 1 %: {label}")


def _titled(height: float, title: str, said: str) -> Canvas:
    canvas = Canvas(figsize=(WIDTH / 72.0, height / 72.0), facecolor="white")
    canvas.text(8.0 / WIDTH, 1.0 - 8.0 / height, title, va="top", fontsize=12, fontweight="bold")
    canvas.text(8.0 / WIDTH, 1.0 - 25.0 / height, said, va="top")
    return canvas


def _wavelengths(chart: Chart | FamilyChart) -> str:
    if chart.wavelength_nm is None:
        return "grey"
    first, *others = chart.wavelength_nm
    return f"{1 + len(others)} wavelengths" if others else f"{first:g} nm"


def _panel(
    axes: Axes, chart: Chart, cost: Callable[[Point], tuple[float, float, float]], front: list[str], *, named: bool
) -> None:
    points = {point.key: point for point in chart.points}
    costs = {key: cost(point) for key, point in points.items()}
    _axes(axes, [c[0] for c in costs.values()] + [c[2] for c in costs.values()], [p.p99 for p in chart.points])
    steps: list[tuple[float, float]] = []
    for key in front:  # down in error, then across: there is nothing clearly cheaper below
        here = costs[key][1], _height(points[key].l1)
        steps += [(steps[-1][0], here[1]), here] if steps else [here]
    if steps:
        axes.plot(*zip(*steps, strict=True), color=charts.OURS, linewidth=5.0, alpha=0.16, zorder=1, clip_on=False)
    if len(chart.ladder) > 1:
        rungs = [(costs[key][1], _height(points[key].l1)) for key in chart.ladder]
        axes.plot(*zip(*rungs, strict=True), color=charts.TRUTH, linestyle=(0, (4, 2)), linewidth=1.0, zorder=1.5)
    for key, point in points.items():
        look, (first, middle, last), y = _LOOKS[point.kind], costs[key], _height(point.l1)
        line: dict[str, Any] = {"color": look.colour, "zorder": 2, "clip_on": False}
        axes.plot([middle, middle], [y, max(y, point.p99)], linewidth=0.7, alpha=0.55, **line)
        interval = [_height(point.p99_low), _height(point.p99_high or point.p99)]
        axes.plot([middle, middle], interval, linewidth=2.2, alpha=0.55, solid_capstyle="butt", **line)
        if first < last:
            axes.plot([first, last], [y, y], linewidth=2.0, alpha=0.4, **line)
        size, fill = 6.5 if key in front else 4.5, look.colour if point.dtype == "float64" else "white"
        axes.plot(middle, y, look.marker, markerfacecolor=fill, markersize=size, **line | {"zorder": 3})
    numbers = {point.key: str(number) for number, point in enumerate(chart.points, 1)}
    ordered = [*front, *(key for key in points if key not in front)]
    labels = []
    for key in ordered:
        full = f"{numbers[key]} {points[key].title}" if named else numbers[key]
        least = full if key in front else numbers[key]
        labels.append(_Label(least, full, costs[key][1], _height(points[key].l1), key in front))
    _label(axes, labels)


def _error_axis(axes: Axes, top: float) -> None:
    axes.set_yscale("log")
    axes.set_ylim(SMALLEST / 2.0, top)
    axes.grid(color=charts.GRID, linewidth=0.6, clip_on=False)
    axes.tick_params(length=0)
    axes.spines[["top", "right"]].set_visible(False)
    powers = range(round(math.log10(SMALLEST)), math.floor(math.log10(top)) + 1)
    axes.yaxis.set_major_locator(FixedLocator([10.0**power for power in powers]))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: percent(value)))
    axes.yaxis.set_minor_locator(NullLocator())


def _axes(axes: Axes, costs: list[float], errors: list[float]) -> None:
    low, high = min(costs), max(costs)
    decades = max(math.log10(high / low), 1.0)
    axes.set_xscale("log")
    axes.set_xlim(low / 10 ** (0.06 * decades), high * 10 ** (0.09 * decades))
    _error_axis(axes, max(3.0, 2.0 * max(errors)))
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if decades < 1.7 else (1.0,), numticks=6))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: terminal.count(value)))
    axes.xaxis.set_minor_locator(NullLocator())


class _Label(NamedTuple):
    """What is written beside a point: in full where there is room, else what has to be."""

    least: str
    full: str
    x: float
    y: float
    bold: bool

    def width(self, text: str) -> float:
        return _LETTER * len(text) * (1.12 if self.bold else 1.0) + 1.0


def _label(axes: Axes, labels: Sequence[_Label]) -> None:
    """Texts beside points, each where it hides neither a point nor another text; those given first come first."""
    scale = 72.0 / mpl.rcParams["figure.dpi"]
    at = [axes.transData.transform((label.x, label.y)) * scale for label in labels]
    frame = axes.get_window_extent().extents * scale
    taken = [(x - 3.0, y - 3.0, x + 3.0, y + 3.0) for x, y in at]
    chosen = []
    for label, here in zip(labels, at, strict=True):
        width = label.width(label.least)
        best = min(offsets(width), key=lambda offset: hidden(box(here, offset, width), taken, frame))
        taken.append(box(here, best, width))
        chosen.append(best)
    for index, (label, here, best) in enumerate(zip(labels, at, chosen, strict=True)):
        text, own, width = label.least, len(at) + index, label.width(label.full)
        others = [*taken[:own], *taken[own + 1 :]]
        near = [offset for offset in offsets(width) if abs(offset[1]) <= _NEAR]
        free = [offset for offset in near if hidden(box(here, offset, width), others, frame) == 0.0]
        if free:
            text, best, taken[own] = label.full, free[0], box(here, free[0], width)
        width = label.width(text)
        side = min(max(-best[0] / width, 0.0), 1.0)  # of the text, what is next to its point: left, middle or right
        axes.annotate(
            text,
            (label.x, label.y),
            (best[0] + side * width, best[1]),
            textcoords="offset points",
            ha={0.0: "left", 1.0: "right"}.get(side, "center"),
            va="center",
            fontsize=7.5,
            fontweight="bold" if label.bold else "normal",
            color=charts.TRUTH if label.bold else charts.MUTED,
            zorder=4,
            bbox={"facecolor": "white", "alpha": 0.7, "edgecolor": "none", "pad": 0.3},
            arrowprops={**_LEADER, "relpos": (side, 0.5)} if abs(best[1]) > _NEAR else None,
        )


Box = tuple[float, float, float, float]


def offsets(width: float) -> list[tuple[float, float]]:
    """Where the left end of a text may be, in points from its point: beside it first, then further out."""
    found = []
    for far in (0.0, 8.0, 16.0, 26.0):
        found += [(6.0, far), (6.0, -far), (-6.0 - width, far), (-6.0 - width, -far)]
        found += [(-width / 2.0, 9.0 + far), (-width / 2.0, -9.0 - far)]
    return found


def box(here: Any, offset: tuple[float, float], width: float) -> Box:
    """What a text covers whose left end is at an offset from its point."""
    x, y = here[0] + offset[0], here[1] + offset[1]
    return x, y - _LINE / 2.0, x + width, y + _LINE / 2.0


def hidden(box: Box, taken: list[Box], frame: Any) -> float:
    """The area of what a text would hide; what leaves the frame counts most."""
    area = sum(
        max(0.0, min(box[2], other[2]) - max(box[0], other[0]))
        * max(0.0, min(box[3], other[3]) - max(box[1], other[1]))
        for other in taken
    )
    beyond = max(0.0, frame[0] - box[0]) + max(0.0, box[2] - frame[2] - 6.0)
    beyond += max(0.0, frame[1] - box[1]) + max(0.0, box[3] - frame[3])
    return float(area + 100.0 * beyond)


def _legend(canvas: Canvas, present: set[Kind], lines: Sequence[Line2D], top: float, height: float) -> None:
    handles = [
        Line2D([], [], linestyle="", color=_LOOKS[k].colour, marker=_LOOKS[k].marker, markersize=5, label=k)
        for k in _LOOKS
        if k in present
    ]
    handles.append(Line2D([], [], linestyle="", color=charts.TRUTH, marker="o", markersize=5, label="hollow: float32"))
    handles[-1].set_markerfacecolor("white")
    handles += lines
    canvas.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(_LEFT / WIDTH - 0.01, 1.0 - (top + 26.0) / height),
        ncols=len(handles),
        frameon=False,
        columnspacing=1.4,
        handlelength=1.5,
        handletextpad=0.5,
    )


def _table(
    canvas: Canvas,
    columns: Sequence[float],
    heads: Iterable[str],
    rows: Iterable[tuple[Form, Iterable[str], bool]],
    top: float,
    height: float,
) -> None:
    """A row for each form, numbered, those that are worth having in bold."""
    _row(canvas, columns, 0, ("", "", *heads), top, height, color=charts.MUTED)
    for number, (form, cells, bold) in enumerate(rows, 1):
        style = {"fontweight": "bold" if bold else "normal", "color": _LOOKS[form.kind].colour}
        _row(canvas, columns, number, (str(number), form.title, *cells), top, height, **style)


def _row(
    canvas: Canvas, columns: Sequence[float], number: int, cells: Iterable[str], top: float, height: float, **how: Any
) -> None:
    """Cells of a row: a number, a title from the left, and the others up to the ends of their columns."""
    for column, (end, cell) in enumerate(zip(columns, cells, strict=True)):
        align = "left" if column == 1 else "right"
        x = columns[0] + 4.0 if column == 1 else end
        y = 1.0 - (top + _ROW * (number + 0.5)) / height
        if cell:
            canvas.text(x / WIDTH, y, cell, ha=align, va="center", fontsize=7.5, **how)


# Families

CLOSE = 0.01  # mean error of what the truth need not be evaluated for
_MEAN, _NAMES, _TAIL = 216.0, 172.0, 150.0  # widths: panel of means, names beside it, panel of the 99th percentile
_FAMILY_ABOVE, _FAMILY_ROW = 76.0, 310.0  # below the title, room for g; from one parameter to the next
_HIGHEST = 10.0  # of errors drawn: ten times the light that there is
_DASHES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1, 1.5)), (0, (5, 1.5, 1, 1.5)), (0, (9, 3)))
_APART = 26.0  # of ticks that are numbers of their own


def along(whole: FamilyChart, axis: str) -> list[list[int]]:
    """The members at each value of one parameter of a family."""
    shape = [len(values) for values in whole.axes.values()]
    numbers = np.arange(len(whole.members)).reshape(shape)
    return np.moveaxis(numbers, list(whole.axes).index(axis), 0).reshape(len(whole.axes[axis]), -1).tolist()


def middle(errors: Iterable[float | None]) -> float | None:
    """The median of those that are there."""
    there = [error for error in errors if error is not None]
    return float(np.median(there)) if there else None


def _drawn_family(whole: FamilyChart) -> Canvas:
    """For each parameter two panels, error along it; cost against error; all forms as a table."""
    bottom = _FAMILY_ABOVE + _PLOT + (len(whole.axes) - 1) * _FAMILY_ROW
    count_of = len(whole.curves) + (whole.between is not None)
    height = bottom + _BELOW + _ROW * (count_of + 2)
    several = "; lines are medians, bands all members of a value" if len(whole.axes) > 1 else ""
    said = f"{whole.family}, {whole.model}, {_wavelengths(whole)}, {len(whole.members)} members{several}."
    canvas = _titled(height, whole.title, f"{said} Large: worth having there. Times are those of one member.")

    def box(left: float, top: float, width: float) -> tuple[float, float, float, float]:
        return left / WIDTH, 1.0 - (top + _PLOT) / height, width / WIDTH, _PLOT / height

    tail = _LEFT + _MEAN + _NAMES
    for number, axis in enumerate(whole.axes):
        top = _FAMILY_ABOVE + number * _FAMILY_ROW
        mean = canvas.add_axes(box(_LEFT, top, _MEAN))
        _sweep(mean, whole, axis, lambda curve: curve.l1, None if whole.between is None else whole.between.l1)
        mean.set_ylabel("mean error against the truth")
        _named(mean, whole, axis)
        if whole.g is None or len(whole.axes) > 1:
            _headed(mean, "mean error")
        else:
            _heights(mean, whole.axes[axis], whole.g)
        high = canvas.add_axes(box(tail, top, _TAIL))
        _sweep(high, whole, axis, lambda curve: curve.p99, None if whole.between is None else whole.between.p99)
        _headed(high, "99th percentile")
        high.tick_params(labelleft=False)
    left = tail + _TAIL + 2.0 * _GAP
    _costs(canvas.add_axes(box(left, _FAMILY_ABOVE, WIDTH - _RIGHT - left)), whole)
    forms: list[Curve | Between] = [*whole.curves, *([whole.between] if whole.between else [])]
    bar = Line2D(
        [], [], color=charts.MUTED, linewidth=3.0, alpha=0.3, label="from the least to the most of the members"
    )
    _legend(canvas, {form.kind for form in forms}, [bar], bottom, height)
    _table(
        canvas, _FAMILY_COLUMNS, _FAMILY_HEADS, [_family_row(whole, form) for form in forms], bottom + _BELOW, height
    )
    return canvas


def _sweep(
    axes: Axes, whole: FamilyChart, axis: str, errors: Callable[[Curve], list[float | None]], between: float | None
) -> None:
    """Errors along one parameter; what is worth having at most of the members of a value is drawn large."""
    x = whole.axes[axis]
    _error_axis(axes, _HIGHEST)
    if x[0] > 0.0 and x[-1] > 8.0 * x[0]:
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if x[-1] < 50.0 * x[0] else (1.0,), numticks=8))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xlabel(axis)
    members = along(whole, axis)
    used: Counter[str] = Counter()
    for curve in whole.curves:
        look, values = _LOOKS[curve.kind], errors(curve)
        rows = [[v for index in some if (v := values[index]) is not None] for some in members]
        there = [index for index, row in enumerate(rows) if row]
        at = [x[index] for index in there]
        y = [_height(float(np.median(rows[index]))) for index in there]
        if len(whole.axes) > 1:
            least, most = ([_height(pick(rows[index])) for index in there] for pick in (min, max))
            axes.fill_between(at, least, most, color=look.colour, alpha=0.08, linewidth=0.0)
        axes.plot(at, y, color=look.colour, linestyle=_DASHES[used[curve.kind] % len(_DASHES)], linewidth=1.1)
        used[curve.kind] += 1
        fill = look.colour if curve.dtype == "float64" else "white"
        for index, value, height in zip(there, at, y, strict=True):
            chosen = 2 * sum(curve.key in whole.fronts[m] for m in members[index]) > len(members[index])
            size = 6.5 if chosen else 2.8
            axes.plot(value, height, look.marker, color=look.colour, markerfacecolor=fill, markersize=size, zorder=3)
    if between is not None:
        axes.axhline(_height(between), color=_LOOKS["table"].colour, linestyle=(0, (3, 2)), linewidth=0.9)


def _headed(axes: Axes, text: str) -> None:
    axes.set_title(text, fontsize=8, color=charts.MUTED, loc="left")


def _heights(axes: Axes, x: list[float], g: list[float]) -> None:
    """The g of members above the panel, of as many as there is room for."""
    shown = [len(x) - 1]
    for index in range(len(x) - 1, -1, -1):
        at, after = (axes.transData.transform((x[i], 1.0))[0] for i in (index, shown[-1]))
        if after - at > _APART * mpl.rcParams["figure.dpi"] / 72.0:
            shown.append(index)
    above = axes.secondary_xaxis("top")
    labels = [terminal.count(float(f"{g[index]:.2g}")) for index in shown]
    above.set_xticks([x[index] for index in shown], labels=labels)
    above.xaxis.set_minor_locator(NullLocator())
    above.set_xlabel("g along the normal, eq. 79")
    above.tick_params(length=0)
    above.spines["top"].set_visible(False)


def _named(axes: Axes, whole: FamilyChart, axis: str) -> None:
    """Number and name of each curve beside its right end, bold if it is worth having anywhere."""
    ends = []
    for number, curve in enumerate(whole.curves, 1):
        values = [middle([curve.l1[index] for index in some]) for some in along(whole, axis)]
        last = max(index for index, value in enumerate(values) if value is not None)
        bold = any(curve.key in front for front in whole.fronts)
        ends.append((_height(values[last] or 0.0), whole.axes[axis][last], f"{number} {curve.title}", bold, curve.kind))
    if whole.between is not None:
        text = f"{len(whole.curves) + 1} {whole.between.title}"
        ends.append((_height(whole.between.l1), whole.axes[axis][-1], text, False, whole.between.kind))
    ends.sort(key=lambda end: end[0])
    low, high = (math.log10(y) for y in axes.get_ylim())
    wanted = [_PLOT * (math.log10(min(y, _HIGHEST)) - low) / (high - low) for y, *_ in ends]
    for (y, x, text, bold, kind), here in zip(ends, apart(wanted, _LINE, _PLOT), strict=True):
        axes.annotate(
            text,
            (x, min(y, _HIGHEST)),
            (_MEAN + 10.0, here),
            textcoords=OffsetFrom(axes, (0.0, 0.0)),
            va="center",
            fontsize=7.0,
            fontweight="bold" if bold else "normal",
            color=_LOOKS[kind].colour,
            annotation_clip=False,
            arrowprops={**_LEADER, "relpos": (0.0, 0.5), "shrinkA": 1.0, "shrinkB": 2.0},
        )


def apart(wanted: Sequence[float], least: float, most: float) -> list[float]:
    """Increasing heights, moved as little as makes them `least` apart and keeps them between 0 and `most`."""
    blocks: list[tuple[float, int]] = []  # of names that touch: where the first would be, and how many
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
    """Error over cost: a bar from the least to the largest mean error of the members, a mark at the median."""
    labels = []
    forms: list[tuple[Form, list[float | None]]] = [(curve, curve.l1) for curve in whole.curves]
    if whole.between is not None:
        forms.append((whole.between, [whole.between.l1]))
    _axes(axes, [t for form, _ in forms for t in (form.batch.low, form.batch.high)], [_HIGHEST / 2.0])
    for number, (form, values) in enumerate(forms, 1):
        look, ns = _LOOKS[form.kind], form.batch.ns
        there = [_height(value) for value in values if value is not None]
        y, bold = float(np.median(there)), any(form.key in front for front in whole.fronts)
        axes.plot([ns, ns], [min(there), max(there)], color=look.colour, linewidth=3.0, alpha=0.3, zorder=2)
        fill = look.colour if form.dtype == "float64" else "white"
        size = 6.5 if bold else 4.5
        axes.plot(ns, y, look.marker, color=look.colour, markerfacecolor=fill, markersize=size, zorder=3)
        labels.append(_Label(str(number), str(number), ns, min(y, _HIGHEST), bold))
    _label(axes, sorted(labels, key=lambda label: not label.bold))
    axes.set_xlabel("ns a value, many directions at once")
    _headed(axes, "mean error over cost")
    axes.tick_params(labelleft=False)


_FAMILY_HEADS = ("mean: least", "median", "most", "within 1 %", "p99: median", "ns, many", "ns, one", "worth having")


def _family_row(whole: FamilyChart, form: Curve | Between) -> tuple[Form, tuple[str, ...], bool]:
    times = terminal.count(form.batch.ns), terminal.count(form.single.ns)
    if isinstance(form, Between):
        return form, ("", percent(form.l1), "", "", percent(form.p99), *times, ""), False
    means, tails = ([v for v in values if v is not None] for values in (form.l1, form.p99))
    errors = (percent(min(means)), percent(float(np.median(means))), percent(max(means)))
    close, fronts = sum(v <= CLOSE for v in means), sum(form.key in front for front in whole.fronts)
    shares = [f"{number} of {len(whole.members)}" if number else "" for number in (close, fronts)]
    return form, (*errors, shares[0], percent(float(np.median(tails))), *times, shares[1]), fronts > 0


def _height(error: float) -> float:
    return max(error, SMALLEST)


def percent(value: float) -> str:
    """An error as a human reads it."""
    if value <= SMALLEST:
        return "0" if value == 0.0 else "≤ 0.0001 %"
    return f"{100.0 * value:.2g} %" if value < 1.0 else f"{100.0 * value:.0f} %"
