"""The look of figures: colours, lines, limits and ticks of panels, whoever draws them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.figure import Curve, Numbers, Role, superscript

# What is drawn with, and the variable that stands in its place. The light page has these very colours, which tell
# apart with any kind of colour blindness (after Okabe and Ito); they differ in their lines, too.
OURS, PRINTED, TEXTBOOK, TRUTH = "#0b5fc0", "#c8401e", "#b47400", "#1b2028"
OTHERS = ("#00806b", "#8c4aa6", "#3e97cf", "#c0568f", "#77771e", "#6b7280")
GRID, MUTED = "#dde2e8", "#5a6470"
VARIABLES = {
    OURS: "--ours",
    PRINTED: "--printed",
    TEXTBOOK: "--textbook",
    TRUTH: "--truth",
    **{colour: f"--other-{index}" for index, colour in enumerate(OTHERS)},
    GRID: "--grid",
    MUTED: "--muted",
}


class LineStyle(NamedTuple):
    """Style of a line; lines of a higher order lie above, so that a thin truth stays visible on a thick line of ours.

    The width is in points, dashes are in widths of the line.
    """

    colour: str
    width: float
    dashes: tuple[float, ...]
    order: int


_STYLES = {
    "ours": LineStyle(OURS, 2.2, (), 3),
    "printed": LineStyle(PRINTED, 1.5, (4, 2), 4),
    "textbook": LineStyle(TEXTBOOK, 1.6, (1, 1.4), 4),
    "truth": LineStyle(TRUTH, 0.9, (), 5),
}
DOT = 3.4  # diameter [point] of a sample
GRID_WIDTH = 0.6  # width [point] of lines of the grid
FRAME_WIDTH = 0.8  # width [point] of axes
_OTHER_DASHES = ((), (6, 1.5), (5, 1.5, 1, 1.5), (2, 1), (8, 1.5, 1, 1.5, 1, 1.5), (1, 2.5))


class Limits(NamedTuple):
    """The ends of an axis."""

    low: float
    high: float


class Tick(NamedTuple):
    """A value on an axis, and its label."""

    at: float
    label: str


def styles_of(curves: Sequence[Curve]) -> list[LineStyle]:
    """Return the style of each curve: that of its role, or the next of the cycle."""
    styles = []
    others = 0
    used: Counter[Role] = Counter()
    for curve in curves:
        if curve.role == "other":
            style = LineStyle(OTHERS[others % len(OTHERS)], 1.5, _OTHER_DASHES[others % len(OTHERS)], 3)
            others += 1
        else:
            style = _STYLES[curve.role]
            if used[curve.role]:  # more curves of one role: the same colour, other dashes
                style = style._replace(dashes=_OTHER_DASHES[(used[curve.role] + 1) % len(_OTHER_DASHES)])
            used[curve.role] += 1
        styles.append(style)
    return styles


def limits_of(values: Iterable[float | None], which: Literal["x", "y"], *, log: bool) -> Limits:
    """Return the limits of an axis; they start at 0 where that costs less than half of the height."""
    finite = [v for v in values if v is not None and math.isfinite(v) and (v > 0.0 or not log)]
    low, high = (min(finite), max(finite)) if finite else (0.1, 1.0)
    if log:
        low, high = (low / 2.0, high * 2.0) if low == high else (low, high)
        pad = (high / low) ** (0.04 if which == "y" else 0.0)
        return Limits(low / pad, high * pad)
    if low == high:
        low = low - 0.5
        high = high + 0.5
    if which == "x":
        return Limits(low, high)
    if 0.0 <= low < 0.5 * high:
        low = 0.0
    pad = 0.04 * (high - low)
    return Limits(low if low == 0.0 else low - pad, high + pad)


def ticks_of(limits: Limits, *, log: bool, powers: bool = False) -> list[Tick]:
    """Return the ticks of an axis.

    With `powers`, logarithmic axes have powers of ten as labels whatever their range, for panels side by side.
    """
    from matplotlib.ticker import LogLocator, MaxNLocator, MultipleLocator  # it takes 0.2 s to load

    low, high = limits
    span = high - low
    if log and high / low > 20.0:
        locator: LogLocator | MaxNLocator | MultipleLocator = LogLocator(numticks=6)
        label = power if powers or high / low > 1e5 else plain  # all labels of an axis or none
    else:
        degrees = any(abs(span - turn) < 0.1 * turn for turn in (90.0, 180.0, 360.0))
        locator = MultipleLocator(15.0 * round(span / 90.0)) if degrees else MaxNLocator(6, steps=[1, 2, 2.5, 5, 10])
        label = plain
    return [Tick(float(at), label(at)) for at in locator.tick_values(low, high) if low <= at <= high]


def rings_of(largest: float) -> list[float]:
    """Return the radii of the rings of a polar panel, of which the last is no smaller than the largest radius."""
    from matplotlib.ticker import MaxNLocator

    radii = MaxNLocator(4, steps=[1, 2, 2.5, 5, 10]).tick_values(0.0, largest or 1.0)
    return [float(radius) for radius in radii if radius > 0.0]


def plain(value: float) -> str:
    """Return a number as a label."""
    return f"{value:.6g}".replace("-", "−")


def power(value: float) -> str:
    """Return the label of a power of ten; empty below the smallest float."""
    if value <= 0.0:
        return ""
    exponent = round(math.log10(value))
    return "10" + superscript(exponent) if exponent else "1"


def array_of(values: Numbers) -> NDArray[np.float64]:
    """Return numbers as an array, with nan for gaps."""
    return np.array([math.nan if value is None else value for value in values], dtype=np.float64)
