"""Curves on axes of matplotlib, for pictures of several panels, and its SVG made small."""

from __future__ import annotations

import re
from typing import Any, Literal

from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedFormatter, FixedLocator, NullLocator

from brdfdb.figure import Panel
from brdfdb_pipelines.figure_look import (
    DOT,
    FRAME_WIDTH,
    GRID,
    GRID_WIDTH,
    MUTED,
    TRUTH,
    array_of,
    limits_of,
    looks_of,
    ticks_of,
)

STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",  # text stays text: small, and set in the font of the page
    "text.parse_math": False,  # a $ in a name is one
    "path.simplify": True,
    "font.size": 8.0,
    "axes.edgecolor": GRID,
    "axes.labelcolor": MUTED,
    "xtick.labelcolor": MUTED,
    "ytick.labelcolor": MUTED,
    "text.color": TRUTH,
    "axes.linewidth": FRAME_WIDTH,
    "axes.axisbelow": True,
}


def curves_on(axes: Axes, panel: Panel) -> list[Line2D]:
    """Draw the curves of a panel, its axes and their labels; return the lines, for a legend.

    Logarithmic axes have powers of ten as labels whatever their range, because panels stand side by side.
    """
    lines = []
    for curve, look in zip(panel.curves, looks_of(panel.curves), strict=True):
        line = Line2D(
            curve.x,
            array_of(curve.y).tolist(),
            color=look.colour,
            linewidth=look.width,
            linestyle="none" if curve.dots else (0, look.dashes) if look.dashes else "-",
            marker="o" if curve.dots else "none",
            markersize=DOT,
            markeredgewidth=0.0,
            zorder=look.order,
        )
        line.set_label(curve.label)
        axes.add_line(line)
        lines.append(line)
    _scale(axes, "x", [x for curve in panel.curves for x in curve.x], log=panel.log_x)
    _scale(axes, "y", [y for curve in panel.curves for y in curve.y], log=panel.log_y)
    axes.grid(color=GRID, linewidth=GRID_WIDTH, clip_on=False)
    axes.set_xlabel(panel.x_label)
    axes.set_ylabel(panel.y_label)
    axes.spines[["top", "right"]].set_visible(False)
    return lines


def _scale(axes: Axes, which: Literal["x", "y"], values: list[Any], *, log: bool) -> None:
    low, high = limits_of(values, which, log=log)
    (axes.set_xscale if which == "x" else axes.set_yscale)("log" if log else "linear")
    (axes.set_xlim if which == "x" else axes.set_ylim)(low, high)
    axis = axes.xaxis if which == "x" else axes.yaxis
    ticks = ticks_of(low, high, log=log, powers=True)
    axis.set_major_locator(FixedLocator([tick.at for tick in ticks]))
    axis.set_major_formatter(FixedFormatter([tick.label for tick in ticks]))
    axis.set_minor_locator(NullLocator())


def shortened(text: str) -> str:
    """Return an SVG of matplotlib from its first tag on, without invisible digits, names and bytes."""
    text = text[text.index("<svg") :]
    for unseen in (
        r"<!--.*?-->",
        r"<metadata>.*?</metadata>",
        r"<defs>\s*<style.*?</defs>",
        r"<g id=\"patch_1\">.*?</g>",
    ):
        text = re.sub(unseen, "", text, flags=re.DOTALL)
    text = re.sub(r"font-family:[^;\"]*;?", "", text)  # that of the page
    return re.sub(r"<[^>]+>", _terse, text)


def kept_ids(text: str, prefix: str) -> str:
    """Return an SVG in which only elements that others refer to have ids, each with a prefix."""
    used = set(re.findall(r'(?:url\(|href=")#([^)"]+)', text))
    text = re.sub(r' id="([^"]*)"', lambda m: f' id="{prefix}-{m[1]}"' if m[1] in used else "", text)
    text = re.sub(r'(url\(|href=")#', rf"\1#{prefix}-", text)
    text = re.sub(r">\s+<", "><", text).strip()
    return re.sub(r"<g/>|<g></g>", "", text)


def _terse(tag: re.Match[str]) -> str:
    """Return a tag with one decimal per point."""
    text = re.sub(r' transform="rotate\(-0 [^"]*"', "", tag[0])
    if "scale(" not in text:
        text = re.sub(r"-?\d+\.\d{2,}(?!\w)", lambda number: f"{float(number[0]):.1f}".removesuffix(".0"), text)
    text = re.sub(r"\s+", " ", text)
    if not re.search(r"[CQ] ", text):
        text = re.sub(r"(?<=\d) L ", " ", text)  # a line goes on as one; a curve would as a curve
    return text.replace(": ", ":").replace("; ", ";").replace(' "', '"')
