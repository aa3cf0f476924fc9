"""Pictures of charts: error over time and bytes with the front, samplers, and a table of all forms below."""

from __future__ import annotations

import html
import io
import math
from collections.abc import Callable
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from brdfdb.forms.tradeoff import Chart, ChartedSampler, ChartPoint, Cost, FamilyChart
from brdfdb_pipelines import family_plot, figure_canvas, figure_look, terminal
from brdfdb_pipelines.plot_panels import (
    ABOVE,
    BELOW,
    GAP,
    LEFT,
    LOOKS,
    PLOT,
    RIGHT,
    ROW,
    SMALLEST,
    WIDTH,
    Label,
    cost_axes,
    height_of,
    labelled,
    legend,
    percent,
    row_of,
    table_of,
    titled,
    wavelengths,
)

_SHARES = (0.38, 0.15, 0.15, 0.15, 0.17)  # widths of the panels as shares of the whole
_DPI = 110
# Left end of titles and right ends of columns, of the table of forms and of that of samplers
COLUMNS = (18.0, 230.0, 278.0, 412.0, 462.0, 512.0, 566.0, 656.0, 704.0, 756.0, 818.0, 940.0, 988.0)
_SAMPLER_COLUMNS = (18.0, 300.0, 390.0, 480.0, 620.0, 710.0, 800.0, 940.0)
_BARS = 76.0  # height of the panels of samplers
_STYLE: dict[Any, Any] = figure_canvas.STYLE | {"svg.hashsalt": "brdfdb", "font.family": "sans-serif"}
_BLANK: dict[str, Any] = {"Date": None, "Creator": None, "Format": None, "Type": None}


def svg(chart: Chart | FamilyChart) -> str:
    """Return a chart as an SVG document."""
    with mpl.rc_context(_STYLE):
        text = io.StringIO()
        _canvas(chart).savefig(text, format="svg", metadata=_BLANK)
    opening, rest = figure_canvas.kept_ids(figure_canvas.shortened(text.getvalue()), "c").split(">", 1)
    described = html.escape(f"{chart.title}: error of each form over its cost")
    plate = '<rect width="100%" height="100%" fill="#fff"/>'
    return f'{opening} font-family="sans-serif" role="img" aria-label="{described}">{plate}{rest}\n'


def png(chart: Chart | FamilyChart) -> bytes:
    """Return a chart as PNG."""
    with mpl.rc_context(_STYLE):
        data = io.BytesIO()
        _canvas(chart).savefig(data, format="png", dpi=_DPI, metadata={"Software": None})
    return data.getvalue()


def _canvas(chart: Chart | FamilyChart) -> Canvas:
    return _drawn(chart) if isinstance(chart, Chart) else family_plot.drawn(chart)


def _drawn(chart: Chart) -> Canvas:
    table = ABOVE + PLOT + BELOW
    samplers = table + ROW * (len(chart.points) + len(chart.left_out) + 3)
    height = samplers + ROW * (len(chart.samplers) + 3) + _BARS + 44.0
    subtitle = "Lines go up from the mean error to the 99th percentile, thick over its 95 % confidence interval."
    times = "Bars are quartiles of the time."
    if len(chart.ladder) > 1:
        times += " Dashed: the ladder, the truth by ever coarser quadrature."
    canvas = titled(height, chart.title, f"{chart.material}, {chart.model}, {wavelengths(chart)}. {subtitle}\n{times}")
    room = WIDTH - LEFT - RIGHT - 4.0 * GAP
    left = LEFT

    def of(cost: Cost) -> tuple[float, float, float]:
        return cost.low, cost.ns, cost.high

    panels: tuple[tuple[str, Callable[[ChartPoint], tuple[float, float, float]], list[str]], ...] = (
        ("ns a value, many directions at once", lambda p: of(p.batch), chart.fronts.batch),
        ("256 directions", lambda p: of(p.block), []),
        ("one direction", lambda p: of(p.single), chart.fronts.single),
        ("64 materials in turn", lambda p: of(p.mixed), []),
        ("bytes that it reads", lambda p: (p.bytes, p.bytes, p.bytes), chart.fronts.bytes),
    )
    for number, (share, (label, cost, front)) in enumerate(zip(_SHARES, panels, strict=True)):
        box = (left / WIDTH, 1.0 - (ABOVE + PLOT) / height, share * room / WIDTH, PLOT / height)
        axes = canvas.add_axes(box)
        _panel(axes, chart, cost, front, named=number == 0)
        axes.set_xlabel(label)
        if number == 0:
            axes.set_ylabel("error against the truth")
        else:
            axes.tick_params(labelleft=False)
        left += share * room + GAP
    lines = [Line2D([], [], color=figure_look.OURS, linewidth=5.0, alpha=0.16, label="front")]
    if len(chart.ladder) > 1:
        lines.append(Line2D([], [], color=figure_look.TRUTH, linestyle=(0, (4, 2)), linewidth=1.0, label="ladder"))
    legend(canvas, {point.kind for point in chart.points}, lines, ABOVE + PLOT, height)
    fronts = {*chart.fronts.batch, *chart.fronts.single}
    rows = []
    for point in chart.points:
        errors = (point.forward, point.back, point.grazing)
        others = map(terminal.count, (point.block.ns, point.single.ns, point.mixed.ns))
        cells = (percent(point.l1), tail(point), *map(percent, errors), quartiles(point.batch), *others, against(point))
        rows.append((point, (*cells, terminal.size(point.bytes)), point.key in fronts))
    heads = ("mean error", "p99 (95 % interval)", "forward", "back", "grazing", "ns, many (quartiles)")
    table_of(
        canvas, COLUMNS, (*heads, "256", "one", "in turn", "times as fast as its rung", "bytes"), rows, table, height
    )
    for number, out in enumerate(chart.left_out, len(rows) + 1):
        cells = ("–", f"{out.title}: cannot be made. {out.reason}")
        row_of(canvas, COLUMNS[:2], number, cells, table, height, color=figure_look.MUTED)
    _samplers(canvas, chart, samplers, height)
    return canvas


def tail(point: ChartPoint) -> str:
    """Return the 99th percentile of the error and its confidence interval [%] as text."""
    if point.p99 <= SMALLEST:
        return percent(point.p99)
    low, high = (percent(end).removesuffix(" %") for end in (point.p99_low, point.p99_high or math.inf))
    return f"{percent(point.p99)} ({low}-{high})"


def quartiles(cost: Cost) -> str:
    """Return the time of a form [ns] and its quartiles as text."""
    ns, low, high = map(terminal.count, (cost.ns, cost.low, cost.high))
    return f"{ns} ({low}-{high})"


def against(point: ChartPoint) -> str:
    """Return the speed of a form relative to the cheapest rung of the exact form that is as accurate, and that rung."""
    return "" if point.saving is None else f"{terminal.count(float(f'{point.saving.times:.2g}'))} ({point.rung})"


_WORK_HEADS = ("variance", "ns a sample", "ms to 1 % (quartiles)")


def works(sampler: ChartedSampler) -> tuple[str, ...]:
    """Return variance, time and their product of a sampler as text, for the albedo and then for the sphere."""
    cells: list[str] = []
    for work in (sampler.albedo, sampler.sphere):
        ms, low, high = (f"{value:.3g}" for value in (work.ms, work.low_ms, work.high_ms))
        cells += [f"{work.variance:.3g}", f"{work.ns:.3g}", f"{ms} ({low}-{high})"]
    return tuple(cells)


def _samplers(canvas: Canvas, chart: Chart, top: float, height: float) -> None:
    """Draw variance and time of samplers as a table, and their product with its quartiles as bars."""
    heads = (*(f"albedo: {head}" for head in _WORK_HEADS[:2]), _WORK_HEADS[2])
    heads += (*(f"sphere: {head}" for head in _WORK_HEADS[:2]), _WORK_HEADS[2])
    row_of(
        canvas,
        _SAMPLER_COLUMNS,
        0,
        ("", "samplers of the material's model", *heads),
        top,
        height,
        color=figure_look.MUTED,
    )
    for number, sampler in enumerate(chart.samplers, 1):
        cells = (str(number), sampler.title, *works(sampler))
        row_of(canvas, _SAMPLER_COLUMNS, number, cells, top, height)
    below = top + ROW * (len(chart.samplers) + 2)
    room = (WIDTH - LEFT - RIGHT - 4.0 * GAP) / 2.0
    for which, label in enumerate(("albedo of light from 60 degrees", "sphere under a sky and a lamp")):
        left = LEFT + which * (room + 4.0 * GAP)
        axes = canvas.add_axes((left / WIDTH, 1.0 - (below + _BARS) / height, room / WIDTH, _BARS / height))
        values = [(sampler.albedo, sampler.sphere)[which] for sampler in chart.samplers]
        axes.set_xscale("log")
        for y, work in enumerate(values):
            least = max(work.low_ms, 1e-6)
            axes.plot([least, max(work.high_ms, least)], [y, y], color=figure_look.OURS, linewidth=4.0, alpha=0.4)
            axes.plot(max(work.ms, 1e-6), y, "o", color=figure_look.OURS, markersize=4.5)
        axes.set_yticks(range(len(values)), [sampler.key for sampler in chart.samplers])
        axes.set_ylim(len(values) - 0.4, -0.6)
        ends = [max(value, 1e-6) for work in values for value in (work.low_ms, work.high_ms)]
        axes.set_xlim(0.6 * min(ends), 1.7 * max(ends))
        axes.xaxis.set_major_locator(
            LogLocator(subs=(1.0, 2.0, 5.0) if max(ends) < 50.0 * min(ends) else (1.0,), numticks=8)
        )
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.grid(color=figure_look.GRID, linewidth=0.6, axis="x")
        axes.tick_params(length=0)
        axes.spines[["top", "right"]].set_visible(False)
        axes.set_xlabel(f"ms to a standard deviation of 1 %: {label}")


def _panel(
    axes: Axes, chart: Chart, cost: Callable[[ChartPoint], tuple[float, float, float]], front: list[str], *, named: bool
) -> None:
    points = {point.key: point for point in chart.points}
    costs = {key: cost(point) for key, point in points.items()}
    cost_axes(axes, [c[0] for c in costs.values()] + [c[2] for c in costs.values()], [p.p99 for p in chart.points])
    steps: list[tuple[float, float]] = []
    for key in front:  # down in error, then across: there is nothing clearly cheaper below
        corner = costs[key][1], height_of(points[key].l1)
        steps += [(steps[-1][0], corner[1]), corner] if steps else [corner]
    if steps:
        axes.plot(*zip(*steps, strict=True), color=figure_look.OURS, linewidth=5.0, alpha=0.16, zorder=1, clip_on=False)
    if len(chart.ladder) > 1:
        rungs = [(costs[key][1], height_of(points[key].l1)) for key in chart.ladder]
        axes.plot(*zip(*rungs, strict=True), color=figure_look.TRUTH, linestyle=(0, (4, 2)), linewidth=1.0, zorder=1.5)
    for key, point in points.items():
        look, (first, middle, last), y = LOOKS[point.kind], costs[key], height_of(point.l1)
        line: dict[str, Any] = {"color": look.colour, "zorder": 2, "clip_on": False}
        axes.plot([middle, middle], [y, max(y, point.p99)], linewidth=0.7, alpha=0.55, **line)
        interval = [height_of(point.p99_low), height_of(point.p99_high or point.p99)]
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
        labels.append(Label(least, full, costs[key][1], height_of(points[key].l1), key in front))
    labelled(axes, labels)
