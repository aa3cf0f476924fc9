"""The picture of a chart: error over time and bytes, the front drawn and named, and a table of all points below."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullLocator

from brdfdb.chart import Chart, Point
from brdfdb_pipelines import charts, terminal

WIDTH, _PLOT, _ABOVE, _BELOW, _ROW = 860.0, 270.0, 52.0, 58.0, 12.0  # points
_LEFT, _GAP, _RIGHT = 66.0, 14.0, 12.0
_SHARES = (0.44, 0.26, 0.30)  # of the width, of the panels
_DPI = 110
SMALLEST = 1e-6  # errors below are drawn here: the truth, and what differs from it by rounding
_LETTER, _LINE = 4.3, 9.0  # width and height of a letter of a label, on average
_NEAR = 10.0  # what is written further from its point has a line to it
_COLUMNS = (18.0, 250.0, 318.0, 386.0, 454.0, 522.0, 590.0, 690.0, 770.0, 848.0)  # left end of titles, right ends


class _Look(NamedTuple):
    colour: str
    marker: str


_LOOKS = {
    "exact": _Look(charts.TRUTH, "o"),
    "closed form": _Look(charts.OURS, "D"),
    "approximation": _Look(charts.TEXTBOOK, "s"),
    "printed": _Look(charts.PRINTED, "X"),
    "other model": _Look(charts.MUTED, "v"),
    "table": _Look(charts.OTHERS[0], "^"),
}
_STYLE: dict[Any, Any] = charts.STYLE | {"svg.hashsalt": "brdfdb", "font.family": "sans-serif"}
_BLANK: dict[str, Any] = {"Date": None, "Creator": None, "Format": None, "Type": None}


def svg(chart: Chart) -> str:
    """The picture as a document of its own."""
    with mpl.rc_context(_STYLE):
        text = io.StringIO()
        _drawn(chart).savefig(text, format="svg", metadata=_BLANK)
    opening, rest = charts.kept_ids(charts.shortened(text.getvalue()), "c").split(">", 1)
    return f'{opening} font-family="sans-serif"><rect width="100%" height="100%" fill="#fff"/>{rest}\n'


def png(chart: Chart) -> bytes:
    """The picture in pixels."""
    with mpl.rc_context(_STYLE):
        data = io.BytesIO()
        _drawn(chart).savefig(data, format="png", dpi=_DPI, metadata={"Software": None})
    return data.getvalue()


def _drawn(chart: Chart) -> Canvas:
    height = _ABOVE + _PLOT + _BELOW + _ROW * (len(chart.points) + 2)
    canvas = Canvas(figsize=(WIDTH / 72.0, height / 72.0), facecolor="white")
    wavelengths = "grey" if chart.wavelength_nm is None else f"{len(chart.wavelength_nm)} wavelengths"
    canvas.text(8.0 / WIDTH, 1.0 - 8.0 / height, chart.title, va="top", fontsize=12, fontweight="bold")
    said = f"{chart.material}, {chart.model}, {wavelengths}. Lines go up from the mean error to the 99th percentile"
    canvas.text(8.0 / WIDTH, 1.0 - 25.0 / height, f"{said}; bars are quartiles of the time.", va="top")
    room = WIDTH - _LEFT - _RIGHT - 2.0 * _GAP
    left = _LEFT
    panels: tuple[tuple[str, Callable[[Point], tuple[float, float, float]], list[str]], ...] = (
        ("ns a value, many directions at once", lambda p: (p.batch.low, p.batch.ns, p.batch.high), chart.fronts.batch),
        ("ns a value, one direction", lambda p: (p.single.low, p.single.ns, p.single.high), chart.fronts.single),
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
    _legend(canvas, chart, height)
    _table(canvas, chart, height)
    return canvas


def _panel(
    axes: Axes, chart: Chart, cost: Callable[[Point], tuple[float, float, float]], front: list[str], *, named: bool
) -> None:
    points = {point.key: point for point in chart.points}
    costs = {key: cost(point) for key, point in points.items()}
    low, high = min(c[0] for c in costs.values()), max(c[2] for c in costs.values())
    spread = max(math.log10(high / low), 1.0)
    axes.set_xscale("log")
    axes.set_xlim(low / 10 ** (0.06 * spread), high * 10 ** (0.09 * spread))
    axes.set_yscale("log")
    axes.set_ylim(SMALLEST / 2.0, max(3.0, 2.0 * max(point.p99 for point in chart.points)))
    axes.grid(color=charts.GRID, linewidth=0.6, clip_on=False)
    axes.tick_params(length=0)
    axes.spines[["top", "right"]].set_visible(False)
    top = math.floor(math.log10(axes.get_ylim()[1]))
    ticks = [10.0**power for power in range(round(math.log10(SMALLEST)), top + 1)]
    axes.yaxis.set_major_locator(FixedLocator(ticks))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: percent(value)))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if spread < 1.7 else (1.0,), numticks=8))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: count(value)))
    axes.xaxis.set_minor_locator(NullLocator())
    steps_x: list[float] = []
    steps_y: list[float] = []
    for key in front:  # a step: no form is as accurate and clearly cheaper
        if steps_x:
            steps_x.append(steps_x[-1])
            steps_y.append(_height(points[key].l1))
        steps_x.append(costs[key][1])
        steps_y.append(_height(points[key].l1))
    axes.plot(
        steps_x, steps_y, color=charts.OURS, linewidth=5.0, alpha=0.16, zorder=1, clip_on=False, solid_joinstyle="round"
    )
    for key, point in points.items():
        look, (first, middle, last), y = _LOOKS[point.kind], costs[key], _height(point.l1)
        fill = look.colour if point.dtype == "float64" else "white"
        axes.plot(
            [middle, middle],
            [y, max(y, point.p99)],
            color=look.colour,
            linewidth=0.7,
            alpha=0.55,
            zorder=2,
            clip_on=False,
        )
        axes.plot([first, last], [y, y], color=look.colour, linewidth=2.0, alpha=0.4, zorder=2, clip_on=False)
        size = 6.5 if key in front else 4.5
        axes.plot(
            middle, y, look.marker, color=look.colour, markerfacecolor=fill, markersize=size, zorder=3, clip_on=False
        )
    numbers = {point.key: str(number) for number, point in enumerate(chart.points, 1)}
    texts = {key: f"{numbers[key]} {points[key].title}" if named and key in front else numbers[key] for key in points}
    ordered = [*front, *(key for key in points if key not in front)]
    _label(axes, [(texts[k], costs[k][1], _height(points[k].l1), k in front) for k in ordered])


def _label(axes: Axes, labels: Iterable[tuple[str, float, float, bool]]) -> None:
    """Texts beside points, each where it hides neither a point nor another text; bold ones come first."""
    labels = list(labels)
    scale = 72.0 / mpl.rcParams["figure.dpi"]
    at = [axes.transData.transform((x, y)) * scale for _, x, y, _ in labels]
    frame = axes.get_window_extent().extents * scale
    taken = [(x - 3.0, y - 3.0, x + 3.0, y + 3.0) for x, y in at]
    for (text, x, y, bold), here in zip(labels, at, strict=True):
        width = _LETTER * len(text) * (1.12 if bold else 1.0) + 1.0
        best = min(offsets(width), key=lambda offset: hidden(box(here, offset, width), taken, frame))
        taken.append(box(here, best, width))
        axes.annotate(
            text,
            (x, y),
            (best[0], best[1]),
            textcoords="offset points",
            va="center",
            fontsize=7.5,
            fontweight="bold" if bold else "normal",
            color=charts.TRUTH if bold else charts.MUTED,
            zorder=4,
            arrowprops={"arrowstyle": "-", "color": charts.MUTED, "linewidth": 0.5} if abs(best[1]) > _NEAR else None,
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


def _legend(canvas: Canvas, chart: Chart, height: float) -> None:
    kinds = [kind for kind in _LOOKS if any(point.kind == kind for point in chart.points)]
    handles = [
        Line2D([], [], linestyle="", color=_LOOKS[k].colour, marker=_LOOKS[k].marker, markersize=5, label=k)
        for k in kinds
    ]
    handles.append(Line2D([], [], linestyle="", color=charts.TRUTH, marker="o", markersize=5, label="hollow: float32"))
    handles[-1].set_markerfacecolor("white")
    handles.append(Line2D([], [], color=charts.OURS, linewidth=5.0, alpha=0.16, label="front"))
    canvas.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(_LEFT / WIDTH - 0.01, 1.0 - (_ABOVE + _PLOT + 26.0) / height),
        ncols=len(handles),
        frameon=False,
        columnspacing=1.4,
        handlelength=1.5,
        handletextpad=0.3,
    )


def _table(canvas: Canvas, chart: Chart, height: float) -> None:
    heads = ("", "mean error", "p99", "forward", "back", "grazing", "ns, many (quartiles)", "ns, one", "bytes")
    fronts = {*chart.fronts.batch, *chart.fronts.single}
    top = _ABOVE + _PLOT + _BELOW

    def row(number: int, cells: Iterable[str], **how: Any) -> None:
        for column, (end, cell) in enumerate(zip(_COLUMNS, cells, strict=True)):
            align = "left" if column == 1 else "right"
            x = _COLUMNS[0] + 4.0 if column == 1 else end
            y = 1.0 - (top + _ROW * (number + 0.5)) / height
            if cell:
                canvas.text(x / WIDTH, y, cell, ha=align, va="center", fontsize=7.5, **how)

    row(0, ("", *heads), color=charts.MUTED)
    for number, point in enumerate(chart.points, 1):
        errors = (point.l1, point.p99, point.forward, point.back, point.grazing)
        times = f"{count(point.batch.ns)} ({count(point.batch.low)}-{count(point.batch.high)})", count(point.single.ns)
        cells = (str(number), point.title, *map(percent, errors), *times, terminal.size(point.bytes))
        bold = "bold" if point.key in fronts else "normal"
        row(number, cells, fontweight=bold, color=_LOOKS[point.kind].colour)


def _height(error: float) -> float:
    return max(error, SMALLEST)


def percent(value: float) -> str:
    """An error as a human reads it."""
    if value <= SMALLEST:
        return "0" if value == 0.0 else "≤ 0.0001 %"
    return f"{100.0 * value:.2g} %" if value < 1.0 else f"{100.0 * value:.0f} %"


def count(value: float) -> str:
    """A number to three digits, thousands with a k."""
    for unit in ("", "k", "M"):
        if value < 999.5:
            return f"{value:.3g}{unit}"
        value /= 1000.0
    return f"{value:.3g}G"
