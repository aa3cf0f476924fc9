"""Pictures of charts: the error of each form over its cost or along parameters, and tables of all forms."""

from __future__ import annotations

import itertools
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

from brdfdb.errors import counted
from brdfdb.forms.catalogue import Kind
from brdfdb.forms.surface_rays import ChartedSurface
from brdfdb.forms.tradeoff import (
    BetweenMembers,
    Chart,
    ChartedForm,
    ChartedSampler,
    ChartPoint,
    Cost,
    FamilyChart,
    FamilyCurve,
    FamilyDiagnostic,
)
from brdfdb.microgeometry.model_errors import SurfaceError
from brdfdb_pipelines import figure_canvas, terminal
from brdfdb_pipelines.figure_look import GRID, MUTED, OTHERS, OURS, PRINTED, TEXTBOOK, TRUTH

# Lengths in points
_WIDTH = 1000.0
_PLOT = 270.0  # height of a panel
_ABOVE = 64.0  # above the panels of a material
_FAMILY_ABOVE = 76.0  # above the panels of a family, with room for a diagnostic
_BELOW = 58.0
_ROW = 12.0  # height of a row of a table
_LEFT = 66.0
_GAP = 14.0
_RIGHT = 12.0
_BARS = 76.0  # height of the panels of samplers
_MEAN = 216.0  # width of the mean errors of a family
_NAMES = 172.0  # width of the names of forms
_TAIL = 150.0  # width of the 99th percentiles of a family
_FAMILY_ROW = 310.0  # height of a parameter of a family
_LETTER = 4.1  # width of a letter of a label, on average
_LINE = 9.0  # height of a label
_NEAR = 10.0  # distance of a label from its point beyond which a line joins them
_TICKS_APART = 26.0  # distance of the labelled ticks of a diagnostic

_SHARES = (0.38, 0.15, 0.15, 0.15, 0.17)  # widths of the panels of a material as shares of the whole
# Left end of titles and right ends of columns, of the tables of forms, of samplers and of a family
COLUMNS = (18.0, 230.0, 278.0, 412.0, 462.0, 512.0, 566.0, 656.0, 704.0, 756.0, 818.0, 940.0, 988.0)
_SAMPLER_COLUMNS = (18.0, 300.0, 390.0, 480.0, 620.0, 710.0, 800.0, 940.0)
_FAMILY_COLUMNS = (18.0, 250.0, 330.0, 410.0, 490.0, 580.0, 670.0, 760.0, 850.0, 988.0)
_WORK_HEADS = ("variance", "ns a sample", "ms to 1 % (quartiles)")
_FAMILY_HEADS = ("mean: least", "median", "most", "within 1 %", "p99: median", "ns, many", "ns, one", "worth having")

_SMALLEST = 1e-6  # smaller errors are drawn here: those of the exact form, and of forms that differ by rounding
_HIGHEST = 10.0  # largest error of a family that is drawn: ten times the reflected light
_SURFACE = "S"  # stands for the surface where forms have numbers
_EARTH = OTHERS[1]
_DOTS = (0, (1, 1.5))
CLOSE = 0.01  # mean error below which a form replaces the exact one
_LEADER: dict[str, Any] = {"arrowstyle": "-", "color": MUTED, "linewidth": 0.5}
_DASHES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (1, 1.5)), (0, (5, 1.5, 1, 1.5)), (0, (9, 3)))


class _Mark(NamedTuple):
    colour: str
    marker: str


_MARKS: dict[Kind, _Mark] = {
    "exact": _Mark(TRUTH, "o"),
    "quadrature": _Mark(TRUTH, "P"),
    "closed form": _Mark(OURS, "D"),
    "approximation": _Mark(TEXTBOOK, "s"),
    "customary": _Mark(OTHERS[2], "p"),
    "printed": _Mark(PRINTED, "X"),
    "other model": _Mark(MUTED, "v"),
    "table": _Mark(OTHERS[0], "^"),
}


def svg(chart: Chart | FamilyChart) -> str:
    """Return a chart as an SVG document."""
    return figure_canvas.svg(lambda: _drawn(chart), f"{chart.title}: error of each form over its cost")


def png(chart: Chart | FamilyChart) -> bytes:
    """Return a chart as PNG."""
    return figure_canvas.png(lambda: _drawn(chart))


def _drawn(chart: Chart | FamilyChart) -> Canvas:
    return _material(chart) if isinstance(chart, Chart) else _family(chart)


# Words and numbers of charts, which the terminal shows, too


def percent(value: float) -> str:
    """Return an error in percent as text."""
    if value <= _SMALLEST:
        return "0" if value == 0.0 else "≤ 0.0001 %"
    return f"{100.0 * value:.2g} %" if value < 0.995 else f"{100.0 * value:.0f} %"


def tail(point: ChartPoint) -> str:
    """Return the 99th percentile of the error and its confidence interval [%] as text."""
    if point.p99 <= _SMALLEST:
        return percent(point.p99)
    low, high = (percent(end).removesuffix(" %") for end in (point.p99_low, point.p99_high or math.inf))
    return f"{percent(point.p99)} ({low}-{high})"


def quartiles(cost: Cost) -> str:
    """Return the time of a form [ns] and its quartiles as text."""
    return f"{terminal.count(cost.ns)} ({terminal.count(cost.low)}-{terminal.count(cost.high)})"


def against(point: ChartPoint) -> str:
    """Return the speed of a form relative to the cheapest rung of the exact form that is as accurate, and that rung."""
    return "" if point.saving is None else f"{terminal.count(float(f'{point.saving.times:.2g}'))} ({point.rung})"


def of_surface(surface: ChartedSurface) -> list[str]:
    """Return how far the truth is from the surface, and what rays on the surface cost, in sentences for a line each."""
    lines = [surface.error.sentence]
    if surface.error.inside:
        lines.append("This is the error of the truth. The errors of the forms are relative to the truth.")
    if surface.cost is not None:
        ns, error = terminal.count(surface.cost.ns), terminal.error(surface.cost.standard_error)
        lines.append(f"Rays take {ns} ns a value for a standard error of {error}.")
    return lines


def works(sampler: ChartedSampler) -> tuple[str, ...]:
    """Return variance, time and their product of a sampler as text, for the albedo and then for the sphere."""
    cells: list[str] = []
    for work in (sampler.albedo, sampler.sphere):
        ms, low, high = (f"{value:.3g}" for value in (work.ms, work.low_ms, work.high_ms))
        cells += [f"{work.variance:.3g}", f"{work.ns:.3g}", f"{ms} ({low}-{high})"]
    return tuple(cells)


def along(family: FamilyChart, axis: str) -> list[list[int]]:
    """Return the indices of the members at each value of one parameter of a family."""
    shape = [len(values) for values in family.axes.values()]
    numbers = np.arange(len(family.members)).reshape(shape)
    return np.moveaxis(numbers, list(family.axes).index(axis), 0).reshape(len(family.axes[axis]), -1).tolist()


def middle(errors: Iterable[float | None]) -> float | None:
    """Return the median of the errors that are not None; None if there are none."""
    finite = [error for error in errors if error is not None]
    return float(np.median(finite)) if finite else None


# The sheet, and the axes that all charts have


class Sheet:
    """A canvas of a height [point], with the parts of charts at distances [point] from its top."""

    def __init__(self, height: float, title: str, subtitle: str) -> None:
        self.height = height
        self.canvas = Canvas(figsize=(_WIDTH / 72.0, height / 72.0), facecolor="white")
        self.canvas.text(8.0 / _WIDTH, 1.0 - 8.0 / height, title, va="top", fontsize=12, fontweight="bold")
        self.canvas.text(8.0 / _WIDTH, 1.0 - 25.0 / height, subtitle, va="top")

    def axes(self, left: float, top: float, width: float, height: float = _PLOT) -> Axes:
        """Return new axes."""
        below = 1.0 - (top + height) / self.height
        return self.canvas.add_axes((left / _WIDTH, below, width / _WIDTH, height / self.height))

    def legend(self, kinds: set[Kind], lines: Sequence[Line2D], top: float) -> None:
        """Draw the marks of kinds of forms, and lines, in a row."""
        handles = [
            Line2D([], [], linestyle="", color=mark.colour, marker=mark.marker, markersize=5, label=kind)
            for kind, mark in _MARKS.items()
            if kind in kinds
        ]
        handles.append(Line2D([], [], linestyle="", color=TRUTH, marker="o", markersize=5, label="hollow: float32"))
        handles[-1].set_markerfacecolor("white")
        handles += lines
        self.canvas.legend(
            handles=handles,
            loc="upper left",
            bbox_to_anchor=(_LEFT / _WIDTH - 0.01, 1.0 - (top + 26.0) / self.height),
            ncols=len(handles),
            frameon=False,
            columnspacing=1.4,
            handlelength=1.5,
            handletextpad=0.5,
        )

    def table(self, columns: Sequence[float], heads: Iterable[str], rows: Iterable[_Row], top: float) -> None:
        """Draw a numbered row for each form, those of the front in bold."""
        self.row(columns, 0, ("", "", *heads), top, color=MUTED)
        for number, row in enumerate(rows, 1):
            style = {"fontweight": "bold" if row.bold else "normal", "color": _MARKS[row.form.kind].colour}
            self.row(columns, number, (str(number), row.form.title, *row.cells), top, **style)

    def row(self, columns: Sequence[float], number: int, cells: Iterable[str], top: float, **how: Any) -> None:
        """Draw the cells of a row: a number, a title set left, and the others set right in their columns."""
        for column, (end, cell) in enumerate(zip(columns, cells, strict=True)):
            align = "left" if column == 1 else "right"
            x = columns[0] + 4.0 if column == 1 else end
            y = 1.0 - (top + _ROW * (number + 0.5)) / self.height
            if cell:
                self.canvas.text(x / _WIDTH, y, cell, ha=align, va="center", fontsize=7.5, **how)


class _Row(NamedTuple):
    """A form in a table, with the cells after its title; bold on the front."""

    form: ChartedForm
    cells: tuple[str, ...]
    bold: bool


def _against_rays() -> Line2D:
    """Return the line of the legend for the error of the truth."""
    label = "truth against rays, median"
    return Line2D([], [], color=_EARTH, linestyle=_DOTS, marker="*", linewidth=1.0, label=label)


def _wavelengths(chart: Chart | FamilyChart) -> str:
    if chart.wavelength_nm is None:
        return "grey"
    first, *others = chart.wavelength_nm
    return f"{1 + len(others)} wavelengths" if others else f"{first:g} nm"


def _height_of(error: float) -> float:
    return max(error, _SMALLEST)


def _error_axis(axes: Axes, top: float) -> None:
    axes.set_yscale("log")
    axes.set_ylim(_SMALLEST / 2.0, top)
    axes.grid(color=GRID, linewidth=0.6, clip_on=False)
    axes.tick_params(length=0)
    axes.spines[["top", "right"]].set_visible(False)
    powers = range(round(math.log10(_SMALLEST)), math.floor(math.log10(top)) + 1)
    axes.yaxis.set_major_locator(FixedLocator([10.0**power for power in powers]))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: percent(value)))
    axes.yaxis.set_minor_locator(NullLocator())


def _cost_axes(axes: Axes, costs: list[float], errors: list[float]) -> None:
    low, high = min(c for c in costs if c > 0.0), max(costs)  # the bytes of a function are unknown, and given as 0
    decades = max(math.log10(high / low), 1.0)
    axes.set_xscale("log")
    axes.set_xlim(low / 10 ** (0.06 * decades), high * 10 ** (0.09 * decades))
    _error_axis(axes, max(3.0, 2.0 * max(errors)))
    _log_ticks(axes, fine=decades < 1.7, most=6, text=terminal.count)


def _log_ticks(axes: Axes, *, fine: bool, most: int, text: Callable[[float], str]) -> None:
    """Label a logarithmic axis at powers of ten, or at 1, 2 and 5 of each decade."""
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if fine else (1.0,), numticks=most))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: text(value)))
    axes.xaxis.set_minor_locator(NullLocator())


def _short(value: float) -> str:
    return f"{value:g}"


# Labels that hide neither points nor one another


class _PointLabel(NamedTuple):
    """Text beside a point: the full text where there is room, else the shortest."""

    least: str
    full: str
    x: float
    y: float
    bold: bool

    def width(self, text: str) -> float:
        return _LETTER * len(text) * (1.12 if self.bold else 1.0) + 1.0


class Offset(NamedTuple):
    """Place of the left end of a text, in points from its point."""

    x: float
    y: float


class TextBox(NamedTuple):
    """The rectangle [point] that a text covers."""

    left: float
    bottom: float
    right: float
    top: float

    @classmethod
    def at(cls, point: Any, offset: Offset, width: float) -> TextBox:
        """Return the box of a text whose left end is at an offset from its point."""
        x, y = point[0] + offset.x, point[1] + offset.y
        return cls(x, y - _LINE / 2.0, x + width, y + _LINE / 2.0)

    def hidden(self, taken: Iterable[TextBox], frame: Any) -> float:
        """Return the area [point^2] that this box would hide; area outside the frame counts most."""
        area = sum(
            max(0.0, min(self.right, other.right) - max(self.left, other.left))
            * max(0.0, min(self.top, other.top) - max(self.bottom, other.bottom))
            for other in taken
        )
        beyond = max(0.0, frame[0] - self.left) + max(0.0, self.right - frame[2] - 6.0)
        beyond += max(0.0, frame[1] - self.bottom) + max(0.0, self.top - frame[3])
        return float(area + 100.0 * beyond)


def offsets(width: float) -> list[Offset]:
    """Return the places that a text of a width may have, the nearest first."""
    positions = []
    for far in (0.0, 8.0, 16.0, 26.0):
        positions += [Offset(x, y) for x in (6.0, -6.0 - width) for y in (far, -far)]
        positions += [Offset(-width / 2.0, 9.0 + far), Offset(-width / 2.0, -9.0 - far)]
    return positions


def _labelled(axes: Axes, labels: Sequence[_PointLabel]) -> None:
    """Draw texts beside points so that none hides a point or another text. Earlier texts have priority."""
    scale = 72.0 / mpl.rcParams["figure.dpi"]
    at = [axes.transData.transform((label.x, label.y)) * scale for label in labels]
    frame = axes.get_window_extent().extents * scale
    taken = [TextBox(x - 3.0, y - 3.0, x + 3.0, y + 3.0) for x, y in at]
    chosen = []
    for label, point in zip(labels, at, strict=True):
        width = label.width(label.least)
        boxes = {offset: TextBox.at(point, offset, width).hidden(taken, frame) for offset in offsets(width)}
        best = min(boxes, key=boxes.__getitem__)
        taken.append(TextBox.at(point, best, width))
        chosen.append(best)
    for index, (label, point, best) in enumerate(zip(labels, at, chosen, strict=True)):
        text = label.least
        number = len(at) + index
        width = label.width(label.full)
        others = [*taken[:number], *taken[number + 1 :]]
        near = [offset for offset in offsets(width) if abs(offset.y) <= _NEAR]
        free = [offset for offset in near if TextBox.at(point, offset, width).hidden(others, frame) == 0.0]
        if free:
            text = label.full
            best = free[0]
            taken[number] = TextBox.at(point, best, width)
        width = label.width(text)
        side = min(max(-best.x / width, 0.0), 1.0)  # side of the text that is next to its point: left, middle or right
        axes.annotate(
            text,
            (label.x, label.y),
            (best.x + side * width, best.y),
            textcoords="offset points",
            ha={0.0: "left", 1.0: "right"}.get(side, "center"),
            va="center",
            fontsize=7.5,
            fontweight="bold" if label.bold else "normal",
            color=TRUTH if label.bold else MUTED,
            zorder=4,
            bbox={"facecolor": "white", "alpha": 0.7, "edgecolor": "none", "pad": 0.3},
            arrowprops={**_LEADER, "relpos": (side, 0.5)} if abs(best.y) > _NEAR else None,
        )


# The chart of a material


class _CostPanel(NamedTuple):
    """A panel of error over one kind of cost: low, middle and high of a point, and the front."""

    label: str
    cost: Callable[[ChartPoint], tuple[float, float, float]]
    front: list[str]


def _material(chart: Chart) -> Canvas:
    """Draw panels of error over time and bytes with their fronts, a table of all forms, and the samplers."""
    table = _ABOVE + _PLOT + _BELOW
    below = 0 if chart.surface is None else 1 + len(of_surface(chart.surface))
    samplers = table + _ROW * (len(chart.points) + len(chart.left_out) + below + 3)
    subtitle = "Lines go up from the mean error to the 99th percentile, thick over its 95 % confidence interval."
    times = "Bars are quartiles of the time."
    if len(chart.ladder) > 1:
        times += " Dashed: the ladder, the truth by ever coarser quadrature."
    sheet = Sheet(
        samplers + _ROW * (len(chart.samplers) + 3) + _BARS + 44.0,
        chart.title,
        f"{chart.material}, {chart.model}, {_wavelengths(chart)}. {subtitle}\n{times}",
    )

    def quartiles_of(cost: Cost) -> tuple[float, float, float]:
        return cost.low, cost.ns, cost.high

    panels = (
        _CostPanel("ns a value, many directions at once", lambda p: quartiles_of(p.batch), chart.fronts.batch),
        _CostPanel("256 directions", lambda p: quartiles_of(p.block), []),
        _CostPanel("one direction", lambda p: quartiles_of(p.single), chart.fronts.single),
        _CostPanel("64 materials in turn", lambda p: quartiles_of(p.mixed), []),
        _CostPanel("bytes that it reads", lambda p: (p.bytes, p.bytes, p.bytes), chart.fronts.bytes),
    )
    room = _WIDTH - _LEFT - _RIGHT - 4.0 * _GAP
    left = _LEFT
    for share, panel in zip(_SHARES, panels, strict=True):
        axes = sheet.axes(left, _ABOVE, share * room)
        first = panel is panels[0]
        _panel(axes, chart, panel, named=first)
        axes.set_xlabel(panel.label)
        if first:
            axes.set_ylabel("error against the truth")
        else:
            axes.tick_params(labelleft=False)
        left += share * room + _GAP
    lines = [Line2D([], [], color=OURS, linewidth=5.0, alpha=0.16, label="front")]
    if len(chart.ladder) > 1:
        lines.append(Line2D([], [], color=TRUTH, linestyle=(0, (4, 2)), linewidth=1.0, label="ladder"))
    if chart.surface is not None and chart.surface.error.inside:
        lines.append(_against_rays())
    sheet.legend({point.kind for point in chart.points}, lines, _ABOVE + _PLOT)
    fronts = {*chart.fronts.batch, *chart.fronts.single}
    rows = []
    for point in chart.points:
        errors = (percent(point.l1), tail(point), *map(percent, (point.forward, point.back, point.grazing)))
        times_ns = (quartiles(point.batch), *map(terminal.count, (point.block.ns, point.single.ns, point.mixed.ns)))
        cells = (*errors, *times_ns, against(point), terminal.size(point.bytes))
        rows.append(_Row(point, cells, point.key in fronts))
    error_heads = ("mean error", "p99 (95 % interval)", "forward", "back", "grazing")
    cost_heads = ("ns, many (quartiles)", "256", "one", "in turn", "times as fast as its rung", "bytes")
    sheet.table(COLUMNS, (*error_heads, *cost_heads), rows, table)
    for number, out in enumerate(chart.left_out, len(rows) + 1):
        sheet.row(COLUMNS[:2], number, ("–", f"{out.title}: cannot be made. {out.reason}"), table, color=MUTED)
    if chart.surface is not None:
        number = len(rows) + len(chart.left_out) + 1
        ns = "" if chart.surface.cost is None else terminal.count(chart.surface.cost.ns)
        sheet.row(COLUMNS[:8], number, (_SURFACE, chart.surface.title, *[""] * 5, ns), table, color=_EARTH)
        for line, sentence in enumerate(of_surface(chart.surface), number + 1):
            sheet.row(COLUMNS[:2], line, ("", sentence), table, color=_EARTH)
    _samplers(sheet, chart, samplers)
    return sheet.canvas


def _samplers(sheet: Sheet, chart: Chart, top: float) -> None:
    """Draw variance and time of samplers as a table, and their product with its quartiles as bars."""
    variance, ns, product = _WORK_HEADS
    heads = [head for name in ("albedo", "sphere") for head in (f"{name}: {variance}", f"{name}: {ns}", product)]
    sheet.row(_SAMPLER_COLUMNS, 0, ("", "samplers of the material's model", *heads), top, color=MUTED)
    for number, sampler in enumerate(chart.samplers, 1):
        sheet.row(_SAMPLER_COLUMNS, number, (str(number), sampler.title, *works(sampler)), top)
    below = top + _ROW * (len(chart.samplers) + 2)
    room = (_WIDTH - _LEFT - _RIGHT - 4.0 * _GAP) / 2.0
    for which, label in enumerate(("albedo of light from 60 degrees", "sphere under a sky and a lamp")):
        axes = sheet.axes(_LEFT + which * (room + 4.0 * _GAP), below, room, _BARS)
        values = [(sampler.albedo, sampler.sphere)[which] for sampler in chart.samplers]
        axes.set_xscale("log")
        for y, work in enumerate(values):
            least = max(work.low_ms, 1e-6)
            axes.plot([least, max(work.high_ms, least)], [y, y], color=OURS, linewidth=4.0, alpha=0.4)
            axes.plot(max(work.ms, 1e-6), y, "o", color=OURS, markersize=4.5)
        axes.set_yticks(range(len(values)), [sampler.key for sampler in chart.samplers])
        axes.set_ylim(len(values) - 0.4, -0.6)
        ends = [max(value, 1e-6) for work in values for value in (work.low_ms, work.high_ms)]
        axes.set_xlim(0.6 * min(ends), 1.7 * max(ends))
        _log_ticks(axes, fine=max(ends) < 50.0 * min(ends), most=8, text=_short)
        axes.grid(color=GRID, linewidth=0.6, axis="x")
        axes.tick_params(length=0)
        axes.spines[["top", "right"]].set_visible(False)
        axes.set_xlabel(f"ms to a standard deviation of 1 %: {label}")


def _panel(axes: Axes, chart: Chart, panel: _CostPanel, *, named: bool) -> None:
    points = {point.key: point for point in chart.points}
    costs = {key: panel.cost(point) for key, point in points.items()}
    rays = chart.surface.cost if chart.surface is not None and named else None
    ends = [end for low, _, high in costs.values() for end in (low, high)] + ([rays.ns] if rays else [])
    _cost_axes(axes, ends, [p.p99 for p in chart.points])
    steps: list[tuple[float, float]] = []
    for key in panel.front:  # down in error, then across: there is nothing clearly cheaper below
        corner = costs[key][1], _height_of(points[key].l1)
        steps += [(steps[-1][0], corner[1]), corner] if steps else [corner]
    if steps:
        axes.plot(*zip(*steps, strict=True), color=OURS, linewidth=5.0, alpha=0.16, zorder=1, clip_on=False)
    if len(chart.ladder) > 1:
        rungs = [(costs[key][1], _height_of(points[key].l1)) for key in chart.ladder]
        axes.plot(*zip(*rungs, strict=True), color=TRUTH, linestyle=(0, (4, 2)), linewidth=1.0, zorder=1.5)
    for key, point in points.items():
        mark = _MARKS[point.kind]
        y = _height_of(point.l1)
        first, centre, last = costs[key]
        line: dict[str, Any] = {"color": mark.colour, "zorder": 2, "clip_on": False}
        axes.plot([centre, centre], [y, max(y, point.p99)], linewidth=0.7, alpha=0.55, **line)
        interval = [_height_of(point.p99_low), _height_of(point.p99_high or point.p99)]
        axes.plot([centre, centre], interval, linewidth=2.2, alpha=0.55, solid_capstyle="butt", **line)
        if first < last:
            axes.plot([first, last], [y, y], linewidth=2.0, alpha=0.4, **line)
        size = 6.5 if key in panel.front else 4.5
        fill = mark.colour if point.dtype == "float64" else "white"
        axes.plot(centre, y, mark.marker, markerfacecolor=fill, markersize=size, **line | {"zorder": 3})
    numbers = {point.key: str(number) for number, point in enumerate(chart.points, 1)}
    labels = []
    for key in (*panel.front, *(key for key in points if key not in panel.front)):
        full = f"{numbers[key]} {points[key].title}" if named else numbers[key]
        least = full if key in panel.front else numbers[key]
        labels.append(_PointLabel(least, full, costs[key][1], _height_of(points[key].l1), key in panel.front))
    if chart.surface is not None and chart.surface.error.inside:
        y = _height_of(max(chart.surface.error.median or 0.0, chart.surface.error.noise or 0.0))
        axes.axhline(y, color=_EARTH, linestyle=_DOTS, linewidth=1.0, zorder=1.5)
        if rays is not None:
            axes.plot(rays.ns, y, "*", color=_EARTH, markersize=7.0, zorder=3)
            labels.append(_PointLabel(_SURFACE, f"{_SURFACE} rays", rays.ns, y, False))
    _labelled(axes, labels)


# The chart of a family


def _family(family: FamilyChart) -> Canvas:
    """Draw two panels of errors for each parameter, a panel of cost against error, and a table of all forms."""
    bottom = _FAMILY_ABOVE + _PLOT + (len(family.axes) - 1) * _FAMILY_ROW
    forms: list[FamilyCurve | BetweenMembers] = [*family.curves, *([family.between] if family.between else [])]
    several = "; lines are medians, bands all members of a value" if len(family.axes) > 1 else ""
    subtitle = f"{family.family}, {family.model}, {_wavelengths(family)}, {len(family.members)} members{several}."
    if family.left_out:
        subtitle += f" {counted(len(family.left_out), 'table')} of members cannot be made."
    sheet = Sheet(
        bottom + _BELOW + _ROW * (len(forms) + 2),
        family.title,
        f"{subtitle} Large: worth having there. Times are those of one member.",
    )
    tails_left = _LEFT + _MEAN + _NAMES
    for number, axis in enumerate(family.axes):
        top = _FAMILY_ABOVE + number * _FAMILY_ROW
        mean = sheet.axes(_LEFT, top, _MEAN)
        between_l1 = None if family.between is None else family.between.l1
        _sweep(mean, family, axis, lambda curve: curve.l1, between_l1, family.surface)
        mean.set_ylabel("mean error against the truth")
        _named(mean, family, axis)
        if family.diagnostic is None or len(family.axes) > 1:
            _headed(mean, "mean error")
        else:
            _diagnostic(mean, family.axes[axis], family.diagnostic)
        high = sheet.axes(tails_left, top, _TAIL)
        _sweep(high, family, axis, lambda curve: curve.p99, None if family.between is None else family.between.p99)
        _headed(high, "99th percentile")
        high.tick_params(labelleft=False)
    left = tails_left + _TAIL + 2.0 * _GAP
    _family_costs(sheet.axes(left, _FAMILY_ABOVE, _WIDTH - _RIGHT - left), family)
    bar = Line2D([], [], color=MUTED, linewidth=3.0, alpha=0.3, label="from the least to the most of the members")
    lines = [bar, *([_against_rays()] if len(family.axes) == 1 and any(e and e.inside for e in family.surface) else [])]
    sheet.legend({form.kind for form in forms}, lines, bottom)
    rows = []
    for form in forms:
        times = terminal.count(form.batch.ns), terminal.count(form.single.ns)
        if isinstance(form, BetweenMembers):
            rows.append(_Row(form, ("", percent(form.l1), "", "", percent(form.p99), *times, ""), False))
            continue
        means, tails = ([v for v in values if v is not None] for values in (form.l1, form.p99))
        errors = (percent(min(means)), percent(float(np.median(means))), percent(max(means)))
        close = sum(v <= CLOSE for v in means)
        fronts = sum(form.key in front for front in family.fronts)
        within, worth = (f"{number} of {len(family.members)}" if number else "" for number in (close, fronts))
        cells = (*errors, within, percent(float(np.median(tails))), *times, worth)
        rows.append(_Row(form, cells, fronts > 0))
    sheet.table(_FAMILY_COLUMNS, _FAMILY_HEADS, rows, bottom + _BELOW)
    return sheet.canvas


def _sweep(
    axes: Axes,
    family: FamilyChart,
    axis: str,
    errors: Callable[[FamilyCurve], list[float | None]],
    between: float | None,
    surface: Sequence[SurfaceError | None] = (),
) -> None:
    """Draw errors along one parameter; forms worth having at most members of a value are drawn large.

    The errors of the truth against surfaces are drawn along the parameter of a family that has no other.
    """
    x = family.axes[axis]
    _error_axis(axes, _HIGHEST)
    if x[0] > 0.0 and x[-1] > 8.0 * x[0]:
        axes.set_xscale("log")
        _log_ticks(axes, fine=x[-1] < 50.0 * x[0], most=8, text=_short)
    axes.set_xlabel(axis)
    members = along(family, axis)
    used: Counter[str] = Counter()
    for curve in family.curves:
        mark = _MARKS[curve.kind]
        values = errors(curve)
        rows = [[v for index in alike if (v := values[index]) is not None] for alike in members]
        drawn = [index for index, row in enumerate(rows) if row]
        at = [x[index] for index in drawn]
        y = [_height_of(float(np.median(rows[index]))) for index in drawn]
        if len(family.axes) > 1:
            least, most = ([_height_of(pick(rows[index])) for index in drawn] for pick in (min, max))
            axes.fill_between(at, least, most, color=mark.colour, alpha=0.08, linewidth=0.0)
        axes.plot(at, y, color=mark.colour, linestyle=_DASHES[used[curve.kind] % len(_DASHES)], linewidth=1.1)
        used[curve.kind] += 1
        fill = mark.colour if curve.dtype == "float64" else "white"
        for index, value, height in zip(drawn, at, y, strict=True):
            chosen = 2 * sum(curve.key in family.fronts[m] for m in members[index]) > len(members[index])
            size = 6.5 if chosen else 2.8
            axes.plot(value, height, mark.marker, color=mark.colour, markerfacecolor=fill, markersize=size, zorder=3)
    if surface and len(family.axes) == 1:
        heights = [math.nan if error is None or error.median is None else _height_of(error.median) for error in surface]
        axes.plot(x, heights, color=_EARTH, linestyle=_DOTS, marker="*", markersize=5.0, linewidth=1.0)
    if between is not None:
        axes.axhline(_height_of(between), color=_MARKS["table"].colour, linestyle=(0, (3, 2)), linewidth=0.9)


def _headed(axes: Axes, text: str) -> None:
    axes.set_title(text, fontsize=8, color=MUTED, loc="left")


def _diagnostic(axes: Axes, x: list[float], diagnostic: FamilyDiagnostic) -> None:
    """Write the diagnostic of members above the panel, of as many as there is room for."""
    shown = [len(x) - 1]
    for index in range(len(x) - 1, -1, -1):
        at, after = (axes.transData.transform((x[i], 1.0))[0] for i in (index, shown[-1]))
        if after - at > _TICKS_APART * mpl.rcParams["figure.dpi"] / 72.0:
            shown.append(index)
    above = axes.secondary_xaxis("top")
    labels = [terminal.count(float(f"{diagnostic.values[index]:.2g}")) for index in shown]
    above.set_xticks([x[index] for index in shown], labels=labels)
    above.xaxis.set_minor_locator(NullLocator())
    above.set_xlabel(diagnostic.title)
    above.tick_params(length=0)
    above.spines["top"].set_visible(False)


class _CurveEnd(NamedTuple):
    """The right end of a curve, with the name that is drawn beside it."""

    y: float
    x: float
    text: str
    bold: bool
    kind: Kind


def _named(axes: Axes, family: FamilyChart, axis: str) -> None:
    """Draw number and name of each curve beside its right end, bold if it is worth having anywhere."""
    ends = []
    for number, curve in enumerate(family.curves, 1):
        values = [middle([curve.l1[index] for index in alike]) for alike in along(family, axis)]
        last = max(index for index, value in enumerate(values) if value is not None)
        bold = any(curve.key in front for front in family.fronts)
        y = _height_of(values[last] or 0.0)
        ends.append(_CurveEnd(y, family.axes[axis][last], f"{number} {curve.title}", bold, curve.kind))
    if family.between is not None:
        text = f"{len(family.curves) + 1} {family.between.title}"
        y = _height_of(family.between.l1)
        ends.append(_CurveEnd(y, family.axes[axis][-1], text, False, family.between.kind))
    ends.sort(key=lambda end: end.y)
    low, high = (math.log10(y) for y in axes.get_ylim())
    wanted = [_PLOT * (math.log10(min(end.y, _HIGHEST)) - low) / (high - low) for end in ends]
    for end, height in zip(ends, apart(wanted, _LINE, _PLOT), strict=True):
        axes.annotate(
            end.text,
            (end.x, min(end.y, _HIGHEST)),
            (_MEAN + 10.0, height),
            textcoords=OffsetFrom(axes, (0.0, 0.0)),
            va="center",
            fontsize=7.0,
            fontweight="bold" if end.bold else "normal",
            color=_MARKS[end.kind].colour,
            annotation_clip=False,
            arrowprops={**_LEADER, "relpos": (0.0, 0.5), "shrinkA": 1.0, "shrinkB": 2.0},
        )


def apart(wanted: Sequence[float], least: float, most: float) -> list[float]:
    """Return increasing heights, moved as little as possible to be `least` apart and between 0 and `most`."""
    blocks: list[tuple[float, int]] = []  # names that touch: position of the first, and their number
    for index, height in enumerate(wanted):
        start = height - least * index
        number = 1
        while blocks and blocks[-1][0] > start:
            before, several = blocks.pop()
            start = (before * several + start * number) / (several + number)
            number += several
        blocks.append((start, number))
    highest = most - least * (len(wanted) - 1)
    starts = itertools.chain.from_iterable([min(max(start, 0.0), highest)] * number for start, number in blocks)
    return [start + least * index for index, start in enumerate(starts)]


def _family_costs(axes: Axes, family: FamilyChart) -> None:
    """Draw error over cost: a bar from the least to the largest mean error of the members, a mark at the median."""
    labels = []
    forms: list[tuple[ChartedForm, list[float | None]]] = [(curve, curve.l1) for curve in family.curves]
    if family.between is not None:
        forms.append((family.between, [family.between.l1]))
    _cost_axes(axes, [t for form, _ in forms for t in (form.batch.low, form.batch.high)], [_HIGHEST / 2.0])
    for number, (form, values) in enumerate(forms, 1):
        mark = _MARKS[form.kind]
        ns = form.batch.ns
        heights = [_height_of(value) for value in values if value is not None]
        y = float(np.median(heights))
        bold = any(form.key in front for front in family.fronts)
        axes.plot([ns, ns], [min(heights), max(heights)], color=mark.colour, linewidth=3.0, alpha=0.3, zorder=2)
        fill = mark.colour if form.dtype == "float64" else "white"
        size = 6.5 if bold else 4.5
        axes.plot(ns, y, mark.marker, color=mark.colour, markerfacecolor=fill, markersize=size, zorder=3)
        labels.append(_PointLabel(str(number), str(number), ns, min(y, _HIGHEST), bold))
    _labelled(axes, sorted(labels, key=lambda label: not label.bold))
    axes.set_xlabel("ns a value, many directions at once")
    _headed(axes, "mean error over cost")
    axes.tick_params(labelleft=False)
