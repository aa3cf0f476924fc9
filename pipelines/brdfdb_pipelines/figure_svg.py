"""Panels, maps and pictures as inline SVG, whose colours are variables of the page that they stand on."""

from __future__ import annotations

import base64
import html
import io
import math
import re
from collections import Counter
from collections.abc import Iterable
from typing import Any, Literal, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.image import imsave
from matplotlib.lines import Line2D
from matplotlib.patches import Wedge
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, MaxNLocator, MultipleLocator, NullLocator
from numpy.typing import NDArray

from brdfdb.figure import Curve, Map, Numbers, Panel, Picture, Role, superscript

Floats = NDArray[np.float64]
Drawing = Panel | Map | Picture

# What is drawn with, and the variable that stands in its place. The light page has these very colours, which tell
# apart with any kind of colour blindness (after Okabe and Ito); they differ in their lines, too.
OURS, PRINTED, TEXTBOOK, TRUTH = "#0b5fc0", "#c8401e", "#b47400", "#1b2028"
OTHERS = ("#00806b", "#8c4aa6", "#3e97cf", "#c0568f", "#77771e", "#6b7280")
GRID, MUTED = "#dde2e8", "#5a6470"
PLATE = "#14171c"  # behind pictures, in the dark as in the light
VARIABLES = {
    OURS: "--ours",
    PRINTED: "--printed",
    TEXTBOOK: "--textbook",
    TRUTH: "--truth",
    **{colour: f"--other-{index}" for index, colour in enumerate(OTHERS)},
    GRID: "--grid",
    MUTED: "--muted",
}


class _Look(NamedTuple):
    """Look of a line, and the lines below it: a thin truth stays visible on a strong line of ours."""

    colour: str
    width: float
    dashes: tuple[float, ...]
    order: int


_LOOKS = {
    "ours": _Look(OURS, 2.2, (), 3),
    "printed": _Look(PRINTED, 1.5, (4, 2), 4),
    "textbook": _Look(TEXTBOOK, 1.6, (1, 1.4), 4),
    "truth": _Look(TRUTH, 0.9, (), 5),
}
_DOT = 3.4  # diameter [point] of a sample
_OTHER_DASHES = ((), (6, 1.5), (5, 1.5, 1, 1.5), (2, 1), (8, 1.5, 1, 1.5, 1, 1.5), (1, 2.5))

# In points, of which a figure is as wide whatever it shows: rows of figures keep in line
WIDTH, _PLOT_HEIGHT, _LEFT, _RIGHT, _BELOW, _ROW, _TITLE = 300.0, 150.0, 44.0, 10.0, 34.0, 12.0, 15.0
_LETTER, _SAMPLE = 4.9, 34.0  # width of a letter of the legend, on average, and of what stands before the text
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
    "axes.linewidth": 0.8,
    "axes.axisbelow": True,
}
_PIXELS_PER_INCH = 72  # of maps
_BLANK: dict[str, Any] = {"Date": None, "Creator": None, "Format": None, "Type": None}
_NO_SOFTWARE: Any = {"Software": None}


def svg(drawing: Drawing, key: str) -> str:
    """Draw a panel, a map or a picture.

    Parameters
    ----------
    drawing : Panel or Map or Picture
        What to draw.
    key : str
        Unique on the page: what the ids in the SVG begin with.

    Returns
    -------
    str
        An ``svg`` element without a size, for a page that defines the `VARIABLES`. Lines of a panel stand in groups
        with the attribute ``data-curve``, their index.

    Raises
    ------
    ValueError
        If a polar panel asks for logarithmic axes, or has angles beyond -90 to 90 degrees.
    """
    if isinstance(drawing, Picture):
        return _picture(drawing)
    with mpl.rc_context({**STYLE, "svg.hashsalt": key}):
        if isinstance(drawing, Map):
            canvas = _map(drawing)
        else:
            canvas = _polar(drawing) if drawing.kind == "polar" else _curves(drawing)
        text = io.StringIO()
        canvas.savefig(text, format="svg", transparent=True, dpi=_PIXELS_PER_INCH, metadata=_BLANK)
    return _inline(text.getvalue(), key, _described(drawing))


def _curves(panel: Panel) -> Canvas:
    canvas, axes = _canvas(panel.title, [curve.label for curve in panel.curves], _PLOT_HEIGHT)
    _legend(canvas, curves_on(axes, panel), bool(panel.title))
    return canvas


def curves_on(axes: Axes, panel: Panel, *, powers: bool = False) -> list[Line2D]:
    """Draw the curves of a panel, its axes and their labels; return the lines, for a legend.

    With `powers`, logarithmic axes have powers of ten as labels whatever their range, for panels side by side.
    """
    lines = _lines(panel.curves)
    for index, (curve, line) in enumerate(zip(panel.curves, lines, strict=True)):
        line.set_data(curve.x, _array(curve.y).tolist())
        line.set_gid(f"curve-{index}")
        axes.add_line(line)
    _scale(axes, "x", [x for curve in panel.curves for x in curve.x], log=panel.log_x, powers=powers)
    _scale(axes, "y", [y for curve in panel.curves for y in curve.y], log=panel.log_y, powers=powers)
    axes.grid(color=GRID, linewidth=0.6, clip_on=False)
    axes.set_xlabel(panel.x_label)
    axes.set_ylabel(panel.y_label)
    axes.spines[["top", "right"]].set_visible(False)
    return lines


def _polar(panel: Panel) -> Canvas:
    """Draw the upper half disc, with the normal at the top."""
    if panel.log_x or panel.log_y:
        raise ValueError(f"{panel.title!r}: the axes of a polar panel are linear")
    if any(abs(x) > 90.0 for curve in panel.curves for x in curve.x):
        raise ValueError(f"{panel.title!r}: angles of a polar panel are between -90 and 90 degrees")
    canvas, axes = _canvas(panel.title, [curve.label for curve in panel.curves], _PLOT_HEIGHT + 6.0, below=18.0)
    values = [y for curve in panel.curves for y in curve.y if y is not None]
    rings = [
        r for r in MaxNLocator(4, steps=[1, 2, 2.5, 5, 10]).tick_values(0.0, max(values, default=0.0) or 1.0) if r > 0.0
    ]
    edge = rings[-1]
    for ring in rings:
        axes.add_patch(Wedge((0.0, 0.0), ring / edge, 0.0, 180.0, fill=False, edgecolor=GRID, linewidth=0.6))
        axes.text(ring / edge, -0.03, _plain(ring), ha="center", va="top", color=MUTED, fontsize=7)
    for angle in (-60, -30, 0, 30, 60):
        across, up = math.sin(math.radians(angle)), math.cos(math.radians(angle))
        axes.add_line(Line2D([0.0, across], [0.0, up], color=GRID, linewidth=0.6))
        axes.text(1.07 * across, 1.05 * up, f"{_plain(angle)}°", ha="center", va="center", color=MUTED, fontsize=7)
    lines = _lines(panel.curves)
    for index, (curve, line) in enumerate(zip(panel.curves, lines, strict=True)):
        theta, radius = np.radians(curve.x), _array(curve.y) / edge
        line.set_data((radius * np.sin(theta)).tolist(), (radius * np.cos(theta)).tolist())
        line.set_gid(f"curve-{index}")
        axes.add_line(line)
    box = axes.get_position()
    axes.set_position((0.02, box.y0, 0.96, box.height))
    axes.set_aspect("equal")
    axes.set_xlim(-1.1, 1.1)
    axes.set_ylim(-0.08, 1.1)
    axes.xaxis.set_major_locator(NullLocator())
    axes.yaxis.set_major_locator(NullLocator())
    axes.spines[:].set_visible(False)
    axes.set_xlabel(f"{panel.y_label} over {panel.x_label}", labelpad=3.0)
    _legend(canvas, lines, bool(panel.title))
    return canvas


def _map(drawn: Map) -> Canvas:
    """Draw values as an image of few pixels; dark is the smallest value, or zero where both signs occur."""
    canvas, axes = _canvas(drawn.title, [], _PLOT_HEIGHT + 12.0, right=62.0)
    values = np.array([_array(row) for row in drawn.values])
    usable = values[np.isfinite(values) & ((values > 0.0) | (not drawn.log))]
    low, high = (float(usable.min()), float(usable.max())) if usable.size else (1.0, 10.0)
    name = "viridis"
    if low < 0.0 < high:
        name, high = "berlin", max(-low, high)
        low = -high
    if low == high:
        low, high = (low / 2.0, 2.0 * high) if drawn.log else (low - 0.5, high + 0.5)
    low = low if drawn.low is None else drawn.low
    high = high if drawn.high is None else drawn.high
    norm = (mpl.colors.LogNorm if drawn.log else mpl.colors.Normalize)(low, high, clip=True)
    shown = np.ma.masked_invalid(np.where(values > 0.0, values, np.nan) if drawn.log else values)
    axes.set_xscale("log" if drawn.log_x else "linear")
    axes.set_yscale("log" if drawn.log_y else "linear")
    x, y = _edges(drawn.x, log=drawn.log_x), _edges(drawn.y, log=drawn.log_y)
    axes.pcolormesh(x, y, shown, cmap=name, norm=norm, rasterized=True)
    if len(drawn.x) > 1 and len(drawn.y) > 1:  # half of the outermost values would lie beyond the axes
        axes.set_xlim(drawn.x[0], drawn.x[-1])
        axes.set_ylim(drawn.y[0], drawn.y[-1])
    _ticks(axes, "x", *axes.get_xlim(), log=drawn.log_x)
    _ticks(axes, "y", *axes.get_ylim(), log=drawn.log_y)
    axes.set_xlabel(drawn.x_label)
    axes.set_ylabel(drawn.y_label)
    box = axes.get_position()
    bar = canvas.add_axes((box.x1 + 0.025, box.y0, 0.025, box.height))
    steps = np.geomspace(low, high, 65) if drawn.log else np.linspace(low, high, 65)
    middle = np.sqrt(steps[1:] * steps[:-1]) if drawn.log else (steps[1:] + steps[:-1]) / 2.0
    bar.pcolormesh([0.0, 1.0], steps, middle[:, np.newaxis], cmap=name, norm=norm, rasterized=True)
    bar.set_yscale("log" if drawn.log else "linear")
    bar.set_ylim(low, high)
    _ticks(bar, "y", low, high, log=drawn.log)
    bar.xaxis.set_major_locator(NullLocator())
    bar.yaxis.tick_right()
    bar.yaxis.set_label_position("right")
    bar.tick_params(length=0)
    bar.set_ylabel(drawn.value_label)
    return canvas


def _edges(centres: list[float], *, log: bool) -> Floats:
    """Return the edges of pixels with given centres: half way between them, and as far out as in at the ends."""
    middle = np.log(centres) if log else np.array(centres)
    half = np.diff(middle) / 2.0 if middle.size > 1 else np.array([0.5])
    edges = np.concatenate([[middle[0] - half[0]], middle[:-1] + half[: middle.size - 1], [middle[-1] + half[-1]]])
    return np.exp(edges) if log else edges


def _picture(picture: Picture) -> str:
    """Draw an image in sRGB, one pixel a value; the background is transparent."""
    radiance = np.array([_array(row) for row in picture.radiance])
    linear = np.clip(np.nan_to_num(radiance), 0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)
    image = io.BytesIO()
    grey = np.stack([encoded] * 3 + [np.isfinite(radiance).astype(np.float64)], axis=-1)
    imsave(image, np.round(255.0 * grey).astype(np.uint8), format="png", metadata=_NO_SOFTWARE)
    rows, columns = radiance.shape
    data = base64.b64encode(image.getvalue()).decode("ascii")
    side, above = 150.0, 16.0 if picture.title else 0.0
    height = side * rows / columns
    title = (
        f'<text y="10" style="font-size:7px;font-weight:bold;fill:var(--truth)">{html.escape(picture.title)}</text>'
        * bool(above)
    )
    return (
        f'<svg viewBox="0 0 {side:g} {above + height:g}" role="img" aria-label="{_described(picture)}">{title}'
        f'<rect y="{above:g}" width="{side:g}" height="{height:g}" rx="6" fill="{PLATE}"/>'
        f'<image y="{above:g}" width="{side:g}" height="{height:g}" href="data:image/png;base64,{data}"/></svg>'
    )


def _described(drawing: Drawing) -> str:
    """Return the description of a drawing for readers who do not see it, escaped for an attribute."""
    if isinstance(drawing, Picture):
        text = f"{drawing.title or 'Rendered image'}"
    elif isinstance(drawing, Map):
        text = f"{drawing.value_label} over {drawing.x_label} and {drawing.y_label}"
    else:
        labels = "; ".join(curve.label for curve in drawing.curves)
        text = f"{drawing.y_label} over {drawing.x_label}: {labels}"
    if drawing.title and not isinstance(drawing, Picture):
        text = f"{drawing.title}. {text}"
    return html.escape(text)


def _canvas(
    title: str, labels: list[str], plot: float, right: float = _RIGHT, below: float = _BELOW
) -> tuple[Canvas, Axes]:
    """Return a figure with room for its title and for a legend above the axes, where it hides no curve."""
    above = 13.0 + (_TITLE if title else 0.0) + _ROW * math.ceil(len(labels) / _columns(labels))
    height = above + plot + below
    canvas = Canvas(figsize=(WIDTH / 72.0, height / 72.0))
    axes = canvas.add_axes((_LEFT / WIDTH, below / height, (WIDTH - _LEFT - right) / WIDTH, plot / height))
    axes.tick_params(length=0)
    if title:
        canvas.text(6.0 / WIDTH, 1.0 - 4.0 / height, title, va="top", fontsize=9, fontweight="bold")
    return canvas, axes


def _columns(labels: list[str]) -> int:
    """Return the number of columns of a legend that fit; matplotlib fills them one after the other."""
    for columns in range(len(labels), 1, -1):
        widest = [max(map(len, column)) for column in np.array_split(np.array(labels), columns)]
        if sum(_SAMPLE + _LETTER * letters for letters in widest) < WIDTH - 12.0:
            return columns
    return 1


def _legend(canvas: Canvas, lines: list[Line2D], titled: bool) -> None:
    top = 1.0 - (4.0 + (_TITLE if titled else 0.0)) / (72.0 * canvas.get_figheight())
    canvas.legend(
        handles=lines,
        loc="upper left",
        bbox_to_anchor=(2.0 / WIDTH, top),
        ncols=_columns([str(line.get_label()) for line in lines]),
        frameon=False,
        borderpad=0.2,
        labelspacing=0.35,
        handlelength=2.6,
        columnspacing=1.2,
        handletextpad=0.5,
        fontsize=8,
    )


def _lines(curves: list[Curve]) -> list[Line2D]:
    """Draw an empty line for each curve, in the style of its role, or in the next style of the cycle."""
    lines, others = [], 0
    seen: Counter[Role] = Counter()
    for curve in curves:
        if curve.role == "other":
            look = _Look(OTHERS[others % len(OTHERS)], 1.5, _OTHER_DASHES[others % len(OTHERS)], 3)
            others += 1
        else:
            look = _LOOKS[curve.role]
            if seen[curve.role]:  # more of one role: the same colour, other dashes
                look = look._replace(dashes=_OTHER_DASHES[(seen[curve.role] + 1) % len(_OTHER_DASHES)])
            seen[curve.role] += 1
        line = Line2D(
            [],
            [],
            color=look.colour,
            linewidth=look.width,
            linestyle="none" if curve.dots else (0, look.dashes) if look.dashes else "-",
            marker="o" if curve.dots else "none",
            markersize=_DOT,
            markeredgewidth=0.0,
            zorder=look.order,
        )
        line.set_label(curve.label)
        lines.append(line)
    return lines


def _scale(
    axes: Axes, which: Literal["x", "y"], values: Iterable[float | None], *, log: bool, powers: bool = False
) -> None:
    """Set limits and ticks; limits start at 0 where that costs less than half of the height."""
    finite = [v for v in values if v is not None and math.isfinite(v) and (v > 0.0 or not log)]
    low, high = (min(finite), max(finite)) if finite else (0.1, 1.0)
    if log:
        low, high = (low / 2.0, high * 2.0) if low == high else (low, high)
        pad = (high / low) ** (0.04 if which == "y" else 0.0)
        low, high = low / pad, high * pad
    else:
        if low == high:
            low, high = low - 0.5, high + 0.5
        if which == "y":
            if 0.0 <= low < 0.5 * high:
                low = 0.0
            pad = 0.04 * (high - low)
            low, high = (low if low == 0.0 else low - pad), high + pad
    (axes.set_xscale if which == "x" else axes.set_yscale)("log" if log else "linear")
    (axes.set_xlim if which == "x" else axes.set_ylim)(low, high)
    _ticks(axes, which, low, high, log=log, powers=powers)


def _ticks(axes: Axes, which: Literal["x", "y"], low: float, high: float, *, log: bool, powers: bool = False) -> None:
    axis = axes.xaxis if which == "x" else axes.yaxis
    span = high - low
    if log and high / low > 20.0:
        axis.set_major_locator(LogLocator(numticks=6))
        as_power = powers or high / low > 1e5  # all labels of an axis or none
        axis.set_major_formatter(FuncFormatter(lambda value, _: _power(value) if as_power else _plain(value)))
    else:
        degrees = any(abs(span - turn) < 0.1 * turn for turn in (90.0, 180.0, 360.0))
        locator = MultipleLocator(15.0 * round(span / 90.0)) if degrees else MaxNLocator(6, steps=[1, 2, 2.5, 5, 10])
        inside = [tick for tick in locator.tick_values(low, high) if low <= tick <= high]
        axis.set_major_locator(FixedLocator(inside))
        axis.set_major_formatter(FuncFormatter(lambda value, _: _plain(value)))
    axis.set_minor_locator(NullLocator())


def _plain(value: float) -> str:
    return f"{value:.6g}".replace("-", "−")


def _power(value: float) -> str:
    """Return the label of a power of ten; empty below the smallest float."""
    if value <= 0.0:
        return ""
    exponent = round(math.log10(value))
    return "10" + superscript(exponent) if exponent else "1"


def _array(values: Numbers) -> Floats:
    return np.array([math.nan if value is None else value for value in values], dtype=np.float64)


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


def _inline(text: str, key: str, described: str) -> str:
    """Return an SVG for a page, with variables for colours and unique ids."""
    text = shortened(text)
    (box,) = re.findall(r'viewBox="[^"]*"', text)
    text = text[text.index(">") + 1 :]
    text = re.sub(r"<[^>]+>", _with_variables, text)
    text = re.sub(r' id="curve-(\d+)"', r' data-curve="\1"', text).replace("xlink:href", "href")
    return f'<svg {box} role="img" aria-label="{described}">{kept_ids(text, key)}'


def _with_variables(tag: re.Match[str]) -> str:
    return re.sub(r"#[0-9a-f]{6}\b", lambda colour: f"var({VARIABLES[colour[0]]})", tag[0])


def _terse(tag: re.Match[str]) -> str:
    """Return a tag with one decimal per point."""
    text = re.sub(r' transform="rotate\(-0 [^"]*"', "", tag[0])
    if "scale(" not in text:
        text = re.sub(r"-?\d+\.\d{2,}(?!\w)", lambda number: f"{float(number[0]):.1f}".removesuffix(".0"), text)
    text = re.sub(r"\s+", " ", text)
    if not re.search(r"[CQ] ", text):
        text = re.sub(r"(?<=\d) L ", " ", text)  # a line goes on as one; a curve would as a curve
    return text.replace(": ", ":").replace("; ", ";").replace(' "', '"')
