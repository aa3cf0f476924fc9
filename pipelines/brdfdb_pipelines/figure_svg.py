"""Panels, maps and pictures as inline SVG, whose colours are variables of the page that they stand on.

The SVG is written as text, because matplotlib takes 45 ms for a plot of two lines.
"""

from __future__ import annotations

import base64
import html
import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.figure import Curve, Map, Panel, Picture, png_of
from brdfdb_pipelines.figure_look import (
    DOT,
    FRAME_WIDTH,
    GRID,
    GRID_WIDTH,
    MUTED,
    TRUTH,
    VARIABLES,
    Limits,
    LineStyle,
    Tick,
    array_of,
    limits_of,
    plain,
    rings_of,
    styles_of,
    ticks_of,
)

Floats = NDArray[np.float64]
Drawing = Panel | Map | Picture

PLATE = "#14171c"  # behind pictures, in the dark as in the light

# Lengths in points. All figures have the same width, so that figures in a row are aligned
WIDTH = 300.0
_PLOT_HEIGHT = 150.0
_LEFT = 44.0
_RIGHT = 10.0
_BELOW = 34.0
_ROW = 12.0  # row of a legend
_TITLE = 15.0
_POLAR_HEIGHT = 156.0
_POLAR_BELOW = 18.0
_MAP_HEIGHT = 162.0
_MAP_RIGHT = 62.0  # with the colour bar
_BAR_GAP = 7.5
_BAR_WIDTH = 7.5
_LETTER = 4.9  # mean width of a letter of the legend
_SAMPLE = 34.0  # line of a legend and the space around its text
_HANDLE = 20.8  # line before a text of the legend
_DIGIT = 5.1  # width of a digit of a tick
_SIGN = 6.7  # width of its minus
_POINT = 2.5  # width of its decimal point
_RAISED = 3.4  # width of a digit of an exponent
_FAR = 2000.0  # distance below the axes of values without a logarithm: their line leaves the plot

_COLOURS = 65  # number of colours of the bar beside a map


def svg(drawing: Drawing, key: str) -> str:
    """Draw a panel, a map or a picture as an ``svg`` element without a size, for a page that defines the `VARIABLES`.

    Ids begin with the key, which is unique on the page. Lines of a panel stand in groups with the attribute
    ``data-curve``, their index. ValueError if a polar panel has logarithmic axes, or angles beyond -90 to 90 degrees.
    """
    if isinstance(drawing, Picture):
        return _picture(drawing)
    if isinstance(drawing, Map):
        return _map(drawing)
    return _polar(drawing, key) if drawing.kind == "polar" else _curves(drawing, key)


class _Axis(NamedTuple):
    """An axis: its limits, and where they lie in the drawing."""

    limits: Limits
    begin: float
    end: float
    log: bool

    def at(self, values: Floats) -> Floats:
        """Return the positions of values; values without a logarithm are far before the beginning."""
        low, high = self.limits
        if self.log:
            low, high = math.log(low), math.log(high)
            with np.errstate(divide="ignore"):
                values = np.log(np.maximum(values, 0.0))
        positions = self.begin + (values - low) * ((self.end - self.begin) / (high - low))
        far = self.begin - math.copysign(_FAR, self.end - self.begin)
        return np.asarray(np.where(np.isneginf(values), far, positions))

    def values_at(self, positions: NDArray[np.floating]) -> Floats:
        """Return the values at positions."""
        low, high = self.limits
        share = (positions - self.begin) / (self.end - self.begin)
        if self.log:
            return np.asarray(low * (high / low) ** share)
        return np.asarray(low + (high - low) * share)

    def ticks(self) -> list[Tick]:
        """Return the ticks at their positions in the drawing."""
        ticks = ticks_of(self.limits, log=self.log)
        positions = self.at(np.array([tick.at for tick in ticks])).tolist()
        return [tick._replace(at=at) for at, tick in zip(positions, ticks, strict=True)]


class _Box(NamedTuple):
    """The place of axes in a drawing of a height, below its title and its legend."""

    left: float
    right: float
    top: float
    bottom: float
    height: float

    @property
    def middle(self) -> float:
        return (self.left + self.right) / 2.0


def _curves(panel: Panel, key: str) -> str:
    box = _box(panel.title, panel.curves, _PLOT_HEIGHT, _BELOW)
    limits = limits_of([x for curve in panel.curves for x in curve.x], "x", log=panel.log_x)
    x = _Axis(limits, box.left, box.right, panel.log_x)
    limits = limits_of([y for curve in panel.curves for y in curve.y], "y", log=panel.log_y)
    y = _Axis(limits, box.bottom, box.top, panel.log_y)
    across, up = x.ticks(), y.ticks()
    grid = "".join(f"M{_n(at)} {_n(box.top)}V{_n(box.bottom)}" for at, _ in across)
    grid += "".join(f"M{_n(box.left)} {_n(at)}H{_n(box.right)}" for at, _ in up)
    frame = f"M{_n(box.left)} {_n(box.top)}V{_n(box.bottom)}H{_n(box.right)}"
    parts = [
        f'<path d="{grid}" {_line(GRID, GRID_WIDTH)}/>' if grid else "",
        f'<path d="{frame}" {_line(GRID, FRAME_WIDTH)}/>',
        _ticks_below(across, box.bottom),
        _ticks_beside(up, box.left - 3.5, "end"),
        _label_below(panel.x_label, box),
        _turned(panel.y_label, box.left - 9.4 - _widest(up), (box.top + box.bottom) / 2.0),
    ]
    points = [(x.at(np.array(curve.x)), y.at(array_of(curve.y))) for curve in panel.curves]
    return _whole(panel, box, [*parts, _lines(panel.curves, points, box, key)])


def _polar(panel: Panel, key: str) -> str:
    """Draw the upper half disc, with the normal at the top."""
    if panel.log_x or panel.log_y:
        raise ValueError(f"{panel.title!r}: the axes of a polar panel are linear")
    if any(abs(x) > 90.0 for curve in panel.curves for x in curve.x):
        raise ValueError(f"{panel.title!r}: angles of a polar panel are between -90 and 90 degrees")
    box = _box(panel.title, panel.curves, _POLAR_HEIGHT, _POLAR_BELOW)
    box = box._replace(left=6.0, right=WIDTH - 6.0)
    rings = rings_of(max((y for curve in panel.curves for y in curve.y if y is not None), default=0.0))
    radius = min((box.right - box.left) / 2.2, (box.bottom - box.top) / 1.18)  # labels need the space beside and below
    x = box.middle
    y = box.top + 1.1 * radius
    arcs, labels = "", ""
    for ring in rings:
        r = radius * ring / rings[-1]
        arcs += f"M{_n(x - r)} {_n(y)}A{_n(r)} {_n(r)} 0 0 1 {_n(x + r)} {_n(y)}z"
        labels += _text(x + r, y + 9.2, plain(ring))
    for angle in (-60, -30, 0, 30, 60):
        across, up = math.sin(math.radians(angle)), math.cos(math.radians(angle))
        arcs += f"M{_n(x)} {_n(y)}L{_n(x + radius * across)} {_n(y - radius * up)}"
        labels += _text(x + 1.07 * radius * across, y + 1.8 - 1.05 * radius * up, f"{plain(angle)}°")
    parts = [
        f'<path d="{arcs}" {_line(GRID, GRID_WIDTH)}/>',
        f'<g style="font-size:7px;text-anchor:middle;fill:{_colour(MUTED)}">{labels}</g>',
        _labels("middle", _text(x, box.bottom + 9.2, f"{panel.y_label} over {panel.x_label}")),
    ]
    points = []
    for curve in panel.curves:
        theta = np.radians(curve.x)
        distance = array_of(curve.y) * (radius / rings[-1])
        points.append((x + distance * np.sin(theta), y - distance * np.cos(theta)))
    return _whole(panel, box, [*parts, _lines(panel.curves, points, box, key)])


def _map(drawn: Map) -> str:
    """Draw values as an image of few pixels; dark is the smallest value, or zero where both signs occur."""
    import matplotlib as mpl

    box = _box(drawn.title, [], _MAP_HEIGHT, _BELOW, _MAP_RIGHT)
    values = np.array([array_of(row) for row in drawn.values])
    usable = values[np.isfinite(values) & ((values > 0.0) | (not drawn.log))]
    low, high = (float(usable.min()), float(usable.max())) if usable.size else (1.0, 10.0)
    name = "viridis"
    if low < 0.0 < high:
        name = "berlin"
        high = max(-low, high)
        low = -high
    if low == high:
        low, high = (low / 2.0, 2.0 * high) if drawn.log else (low - 0.5, high + 0.5)
    low = low if drawn.low is None else drawn.low
    high = high if drawn.high is None else drawn.high
    bar = _Axis(Limits(low, high), box.bottom, box.top, drawn.log)

    def pixels(values: Floats) -> NDArray[np.uint8]:
        share = (bar.at(values) - bar.begin) / (bar.end - bar.begin)
        share = np.where((values > 0.0) | (not drawn.log), np.clip(share, 0.0, 1.0), np.nan)
        return np.asarray(mpl.colormaps[name](np.ma.masked_invalid(share), bytes=True))

    x_edges, y_edges = _edges(drawn.x, log=drawn.log_x), _edges(drawn.y, log=drawn.log_y)
    # Half of the outermost values would lie beyond the axes
    whole = len(drawn.x) > 1 and len(drawn.y) > 1
    (left, *_, right), (below, *_, above) = (drawn.x, drawn.y) if whole else (x_edges.tolist(), y_edges.tolist())
    x = _Axis(Limits(left, right), box.left, box.right, drawn.log_x)
    y = _Axis(Limits(below, above), box.bottom, box.top, drawn.log_y)
    columns = _cells(x_edges, x.values_at(box.left + 0.5 + np.arange(round(box.right - box.left))))
    rows = _cells(y_edges, y.values_at(box.top + 0.5 + np.arange(round(box.bottom - box.top))))
    at = box.right + _BAR_GAP
    steps = bar.values_at(box.top + (np.arange(_COLOURS) + 0.5) * ((box.bottom - box.top) / _COLOURS))
    bar_box = box._replace(left=at, right=at + _BAR_WIDTH)
    across, up, beside = x.ticks(), y.ticks(), bar.ticks()
    parts = [
        _image(pixels(values[rows[:, np.newaxis], columns]), box),
        _image(pixels(steps[:, np.newaxis]), bar_box),
        _ticks_below(across, box.bottom),
        _ticks_beside(up, box.left - 3.5, "end"),
        _ticks_beside(beside, bar_box.right + 3.5, "start"),
        _label_below(drawn.x_label, box),
        _turned(drawn.y_label, box.left - 9.4 - _widest(up), (box.top + box.bottom) / 2.0),
        _turned(drawn.value_label, bar_box.right + 14.4 + _widest(beside), (box.top + box.bottom) / 2.0),
    ]
    return _whole(drawn, box, parts)


def _edges(centres: list[float], *, log: bool) -> Floats:
    """Return the edges of pixels with given centres: half way between them, and as far out as in at the ends."""
    middle = np.log(centres) if log else np.array(centres)
    half = np.diff(middle) / 2.0 if middle.size > 1 else np.array([0.5])
    edges = np.concatenate([[middle[0] - half[0]], middle[:-1] + half[: middle.size - 1], [middle[-1] + half[-1]]])
    return np.exp(edges) if log else edges


def _cells(edges: Floats, values: Floats) -> NDArray[np.intp]:
    return np.clip(np.searchsorted(edges, values, side="right") - 1, 0, edges.size - 2)


def _picture(picture: Picture) -> str:
    """Draw an image in sRGB, one pixel a value; the background is transparent."""
    radiance = np.array([array_of(row) for row in picture.radiance])
    linear = np.clip(np.nan_to_num(radiance), 0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)
    grey = np.stack([encoded] * 3 + [np.isfinite(radiance).astype(np.float64)], axis=-1)
    data = _png(np.round(255.0 * grey).astype(np.uint8))
    rows, columns = radiance.shape
    side = 150.0
    above = 16.0 if picture.title else 0.0
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


def _box(title: str, curves: Sequence[Curve], plot: float, below: float, right: float = _RIGHT) -> _Box:
    """Return the place of axes, with room for a title and a legend above, where it hides no curve."""
    top = 13.0 + (_TITLE if title else 0.0) + _ROW * math.ceil(len(curves) / _columns([c.label for c in curves]))
    return _Box(_LEFT, WIDTH - right, top, top + plot, top + plot + below)


def _whole(drawing: Panel | Map, box: _Box, parts: Iterable[str]) -> str:
    """Return a drawing with its title, and with the legend of a panel."""
    title = ""
    if drawing.title:
        look = f"font-size:9px;font-weight:700;fill:{_colour(TRUTH)}"
        title = f'<text x="6" y="10.8" style="{look}">{_escaped(drawing.title)}</text>'
    legend = "" if isinstance(drawing, Map) else _legend(drawing.curves, _TITLE if drawing.title else 0.0)
    inside = "".join([title, legend, *parts])
    size = f'viewBox="0 0 {WIDTH:g} {_n(box.height)}"'
    return f'<svg {size} role="img" aria-label="{_described(drawing)}">{inside}</svg>'


def _columns(labels: Sequence[str]) -> int:
    """Return the number of columns of a legend that fit; its columns are filled one after the other."""
    for columns in range(len(labels), 1, -1):
        if sum(_widths(labels, columns)) < WIDTH - 12.0:
            return columns
    return 1


def _widths(labels: Sequence[str], columns: int) -> list[float]:
    parts = np.array_split(np.array(labels), columns)
    return [_SAMPLE + _LETTER * max(map(len, part.tolist()), default=0) for part in parts]


def _legend(curves: Sequence[Curve], above: float) -> str:
    labels = [curve.label for curve in curves]
    columns = _columns(labels)
    column_of = np.array_split(np.arange(len(curves)), columns)
    lefts = np.cumsum([7.6, *_widths(labels, columns)]).tolist()
    styles = styles_of(curves)
    handles, texts = "", ""
    for left, members in zip(lefts[:-1], column_of, strict=True):
        for row, index in enumerate(members.tolist()):
            y = 12.9 + above + _ROW * row
            path = f"M{_n(left + _HANDLE / 2.0)} {_n(y)}h0" if curves[index].dots else f"M{_n(left)} {_n(y)}h{_HANDLE}"
            handles += f'<path d="{path}" {_drawn(curves[index], styles[index])}/>'
            texts += _text(left + _HANDLE + 4.0, y + 2.8, labels[index])
    return f'{handles}<g style="font-size:8px;fill:{_colour(TRUTH)}">{texts}</g>' if labels else ""


def _lines(curves: Sequence[Curve], points: Sequence[tuple[Floats, Floats]], box: _Box, key: str) -> str:
    """Return the curves inside the axes, those above others last."""
    styles = styles_of(curves)
    lines = [
        f'<g data-curve="{index}"><path d="{_path(*points[index], dots=curves[index].dots)}" '
        f"{_drawn(curves[index], styles[index])}/></g>"
        for index in sorted(range(len(curves)), key=lambda index: styles[index].order)
    ]
    left, top, width, height = (_n(v) for v in (box.left, box.top, box.right - box.left, box.bottom - box.top))
    inside = f'<clipPath id="{key}-axes"><rect x="{left}" y="{top}" width="{width}" height="{height}"/></clipPath>'
    return f'{inside}<g clip-path="url(#{key}-axes)">{"".join(lines)}</g>'


def _path(x: Floats, y: Floats, *, dots: bool) -> str:
    """Return the path of a line through points, with gaps where one is not finite, or a point at each of them."""
    path = []
    pen = "M"
    for across, down, seen in zip(x.tolist(), y.tolist(), (np.isfinite(x) & np.isfinite(y)).tolist(), strict=True):
        if not seen:
            pen = "M"
            continue
        path.append(f"{pen}{_n(across)} {_n(down)}{'h0' if dots else ''}")
        pen = "M" if dots else "L" if pen == "M" else " "
    return "".join(path)


def _drawn(curve: Curve, style: LineStyle) -> str:
    """Return the attributes of the path of a curve."""
    if curve.dots:
        return _line(style.colour, DOT, "round")
    dashes = ",".join(_n(style.width * dash) for dash in style.dashes)
    return _line(style.colour, style.width, "" if dashes else "square", dashes)


def _line(colour: str, width: float, cap: str = "", dashes: str = "") -> str:
    style = f"fill:none;stroke:{_colour(colour)};stroke-width:{width:g}"
    style += f";stroke-linecap:{cap}" if cap else ""
    return f'style="{style}{f";stroke-dasharray:{dashes}" if dashes else ""}"'


def _image(pixels: NDArray[np.uint8], box: _Box) -> str:
    left, top, width, height = (_n(v) for v in (box.left, box.top, box.right - box.left, box.bottom - box.top))
    place = f'x="{left}" y="{top}" width="{width}" height="{height}"'
    return (
        f'<image {place} preserveAspectRatio="none" href="data:image/png;base64,{_png(pixels)}"/>'
        f"<rect {place} {_line(GRID, FRAME_WIDTH)}/>"
    )


def _png(pixels: NDArray[np.uint8]) -> str:
    """Return pixels (rows, columns, 4) as the text of a PNG."""
    return base64.b64encode(png_of(pixels, level=9)).decode("ascii")


def _ticks_below(ticks: Iterable[Tick], bottom: float) -> str:
    return _labels("middle", "".join(_text(at, bottom + 9.6, label) for at, label in ticks))


def _ticks_beside(ticks: Iterable[Tick], x: float, anchor: str) -> str:
    return _labels(anchor, "".join(_text(x, at + 3.0, label) for at, label in ticks))


def _widest(ticks: Iterable[Tick]) -> float:
    """Return the width [point] of the widest label."""
    widths = {**dict.fromkeys("0123456789", _DIGIT), "−": _SIGN, ".": _POINT}
    return max((sum(widths.get(letter, _RAISED) for letter in label) for _, label in ticks), default=0.0)


def _label_below(label: str, box: _Box) -> str:
    return _labels("middle", _text(box.middle, box.bottom + 21.6, label))


def _turned(label: str, x: float, y: float) -> str:
    """Return a text that runs upwards."""
    turn = f'transform="rotate(-90 {_n(x)} {_n(y)})"'
    return _labels("middle", f'<text x="{_n(x)}" y="{_n(y)}" {turn}>{_escaped(label)}</text>') if label else ""


def _labels(anchor: str, texts: str) -> str:
    return f'<g style="font-size:8px;text-anchor:{anchor};fill:{_colour(MUTED)}">{texts}</g>' if texts else ""


def _text(x: float, y: float, text: str) -> str:
    return f'<text x="{_n(x)}" y="{_n(y)}">{_escaped(text)}</text>' if text else ""


def _escaped(text: str) -> str:
    return html.escape(text, quote=False)


def _colour(colour: str) -> str:
    return f"var({VARIABLES[colour]})"


def _n(value: float) -> str:
    """Return a position with one decimal."""
    return f"{value:.1f}".removesuffix(".0")
