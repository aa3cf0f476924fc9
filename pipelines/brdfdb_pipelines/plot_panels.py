"""Common parts of charts: marks of forms, axes of errors and costs, labels, legends, tables."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullLocator

from brdfdb.forms.catalogue import Kind
from brdfdb.forms.tradeoff import Chart, ChartedForm, FamilyChart
from brdfdb_pipelines import figure_look, terminal

WIDTH, PLOT, ABOVE, BELOW, ROW = 1000.0, 270.0, 64.0, 58.0, 12.0  # points
LEFT, GAP, RIGHT = 66.0, 14.0, 12.0
SMALLEST = 1e-6  # smaller errors are drawn at this one: the exact form, and forms that differ from it by rounding
_LETTER, LINE = 4.1, 9.0  # width and height of a letter of a label, on average
LEADER: dict[str, Any] = {"arrowstyle": "-", "color": figure_look.MUTED, "linewidth": 0.5}
_NEAR = 10.0  # distance [points] of a text from its point beyond which a line joins them


class Look(NamedTuple):
    colour: str
    marker: str


LOOKS: dict[Kind, Look] = {
    "exact": Look(figure_look.TRUTH, "o"),
    "quadrature": Look(figure_look.TRUTH, "P"),
    "closed form": Look(figure_look.OURS, "D"),
    "approximation": Look(figure_look.TEXTBOOK, "s"),
    "customary": Look(figure_look.OTHERS[2], "p"),
    "printed": Look(figure_look.PRINTED, "X"),
    "other model": Look(figure_look.MUTED, "v"),
    "table": Look(figure_look.OTHERS[0], "^"),
}


def titled(height: float, title: str, subtitle: str) -> Canvas:
    canvas = Canvas(figsize=(WIDTH / 72.0, height / 72.0), facecolor="white")
    canvas.text(8.0 / WIDTH, 1.0 - 8.0 / height, title, va="top", fontsize=12, fontweight="bold")
    canvas.text(8.0 / WIDTH, 1.0 - 25.0 / height, subtitle, va="top")
    return canvas


def wavelengths(chart: Chart | FamilyChart) -> str:
    if chart.wavelength_nm is None:
        return "grey"
    first, *others = chart.wavelength_nm
    return f"{1 + len(others)} wavelengths" if others else f"{first:g} nm"


def error_axis(axes: Axes, top: float) -> None:
    axes.set_yscale("log")
    axes.set_ylim(SMALLEST / 2.0, top)
    axes.grid(color=figure_look.GRID, linewidth=0.6, clip_on=False)
    axes.tick_params(length=0)
    axes.spines[["top", "right"]].set_visible(False)
    powers = range(round(math.log10(SMALLEST)), math.floor(math.log10(top)) + 1)
    axes.yaxis.set_major_locator(FixedLocator([10.0**power for power in powers]))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: percent(value)))
    axes.yaxis.set_minor_locator(NullLocator())


def cost_axes(axes: Axes, costs: list[float], errors: list[float]) -> None:
    low, high = min(c for c in costs if c > 0.0), max(costs)  # the bytes of a function are unknown, and given as 0
    decades = max(math.log10(high / low), 1.0)
    axes.set_xscale("log")
    axes.set_xlim(low / 10 ** (0.06 * decades), high * 10 ** (0.09 * decades))
    error_axis(axes, max(3.0, 2.0 * max(errors)))
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if decades < 1.7 else (1.0,), numticks=6))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: terminal.count(value)))
    axes.xaxis.set_minor_locator(NullLocator())


class Label(NamedTuple):
    """Text beside a point: the full text where there is room, else the shortest."""

    least: str
    full: str
    x: float
    y: float
    bold: bool

    def width(self, text: str) -> float:
        return _LETTER * len(text) * (1.12 if self.bold else 1.0) + 1.0


def labelled(axes: Axes, labels: Sequence[Label]) -> None:
    """Draw texts beside points so that none hides a point or another text. Earlier texts have priority."""
    scale = 72.0 / mpl.rcParams["figure.dpi"]
    at = [axes.transData.transform((label.x, label.y)) * scale for label in labels]
    frame = axes.get_window_extent().extents * scale
    taken = [(x - 3.0, y - 3.0, x + 3.0, y + 3.0) for x, y in at]
    chosen = []
    for label, point in zip(labels, at, strict=True):
        width = label.width(label.least)
        best = min(offsets(width), key=lambda offset: hidden(box(point, offset, width), taken, frame))
        taken.append(box(point, best, width))
        chosen.append(best)
    for index, (label, point, best) in enumerate(zip(labels, at, chosen, strict=True)):
        text, own, width = label.least, len(at) + index, label.width(label.full)
        others = [*taken[:own], *taken[own + 1 :]]
        near = [offset for offset in offsets(width) if abs(offset[1]) <= _NEAR]
        free = [offset for offset in near if hidden(box(point, offset, width), others, frame) == 0.0]
        if free:
            text, best, taken[own] = label.full, free[0], box(point, free[0], width)
        width = label.width(text)
        side = min(max(-best[0] / width, 0.0), 1.0)  # side of the text that is next to its point: left, middle or right
        axes.annotate(
            text,
            (label.x, label.y),
            (best[0] + side * width, best[1]),
            textcoords="offset points",
            ha={0.0: "left", 1.0: "right"}.get(side, "center"),
            va="center",
            fontsize=7.5,
            fontweight="bold" if label.bold else "normal",
            color=figure_look.TRUTH if label.bold else figure_look.MUTED,
            zorder=4,
            bbox={"facecolor": "white", "alpha": 0.7, "edgecolor": "none", "pad": 0.3},
            arrowprops={**LEADER, "relpos": (side, 0.5)} if abs(best[1]) > _NEAR else None,
        )


Box = tuple[float, float, float, float]


def offsets(width: float) -> list[tuple[float, float]]:
    """Return positions for the left end of a text, in points from its point: the nearest first."""
    positions = []
    for far in (0.0, 8.0, 16.0, 26.0):
        positions += [(6.0, far), (6.0, -far), (-6.0 - width, far), (-6.0 - width, -far)]
        positions += [(-width / 2.0, 9.0 + far), (-width / 2.0, -9.0 - far)]
    return positions


def box(point: Any, offset: tuple[float, float], width: float) -> Box:
    """Return the box that a text covers if its left end is at an offset from its point."""
    x, y = point[0] + offset[0], point[1] + offset[1]
    return x, y - LINE / 2.0, x + width, y + LINE / 2.0


def hidden(box: Box, taken: list[Box], frame: Any) -> float:
    """Return the area [point^2] that a text would hide; area outside the frame counts most."""
    area = sum(
        max(0.0, min(box[2], other[2]) - max(box[0], other[0]))
        * max(0.0, min(box[3], other[3]) - max(box[1], other[1]))
        for other in taken
    )
    beyond = max(0.0, frame[0] - box[0]) + max(0.0, box[2] - frame[2] - 6.0)
    beyond += max(0.0, frame[1] - box[1]) + max(0.0, box[3] - frame[3])
    return float(area + 100.0 * beyond)


def legend(canvas: Canvas, present: set[Kind], lines: Sequence[Line2D], top: float, height: float) -> None:
    handles = [
        Line2D([], [], linestyle="", color=LOOKS[k].colour, marker=LOOKS[k].marker, markersize=5, label=k)
        for k in LOOKS
        if k in present
    ]
    handles.append(
        Line2D([], [], linestyle="", color=figure_look.TRUTH, marker="o", markersize=5, label="hollow: float32")
    )
    handles[-1].set_markerfacecolor("white")
    handles += lines
    canvas.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(LEFT / WIDTH - 0.01, 1.0 - (top + 26.0) / height),
        ncols=len(handles),
        frameon=False,
        columnspacing=1.4,
        handlelength=1.5,
        handletextpad=0.5,
    )


def table_of(
    canvas: Canvas,
    columns: Sequence[float],
    heads: Iterable[str],
    rows: Iterable[tuple[ChartedForm, Iterable[str], bool]],
    top: float,
    height: float,
) -> None:
    """Draw a numbered row for each form, those of the front in bold."""
    row_of(canvas, columns, 0, ("", "", *heads), top, height, color=figure_look.MUTED)
    for number, (form, cells, bold) in enumerate(rows, 1):
        style = {"fontweight": "bold" if bold else "normal", "color": LOOKS[form.kind].colour}
        row_of(canvas, columns, number, (str(number), form.title, *cells), top, height, **style)


def row_of(
    canvas: Canvas, columns: Sequence[float], number: int, cells: Iterable[str], top: float, height: float, **how: Any
) -> None:
    """Draw the cells of a row: a number, a title set left, and the others set right in their columns."""
    for column, (end, cell) in enumerate(zip(columns, cells, strict=True)):
        align = "left" if column == 1 else "right"
        x = columns[0] + 4.0 if column == 1 else end
        y = 1.0 - (top + ROW * (number + 0.5)) / height
        if cell:
            canvas.text(x / WIDTH, y, cell, ha=align, va="center", fontsize=7.5, **how)


def height_of(error: float) -> float:
    return max(error, SMALLEST)


def percent(value: float) -> str:
    """Return an error in percent as text."""
    if value <= SMALLEST:
        return "0" if value == 0.0 else "≤ 0.0001 %"
    return f"{100.0 * value:.2g} %" if value < 0.995 else f"{100.0 * value:.0f} %"
