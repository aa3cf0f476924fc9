"""Axes that several plots of tables share: one scale, a colour for each plot, and one legend."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from brdfdb.errors import ParameterError, import_extra
from brdfdb.geometry import radians
from brdfdb.parameters import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Colours that remain distinct with colour blindness (after Okabe and Ito), in the order of the curves
COLOURS = ("#0b5fc0", "#c8401e", "#00806b", "#8c4aa6", "#b47400", "#3e97cf")
INK = "#1b2028"
MUTED = "#5a6470"
GRID = "#dde2e8"
DASHES = ("-", (0, (5, 2)), (0, (1.5, 1.5)), (0, (7, 2, 1.5, 2)), (0, (9, 3)), (0, (3, 1, 1, 1, 1, 1)))
_ONLY = "brdfdb, of one plot or one scale"  # id of artists that the next plot on the axes replaces
_PLOTS = "_brdfdb_plots"  # attribute of axes that holds their plots


@dataclass(frozen=True)
class DrawnCurve:
    """A curve of a plot, and its look while the plot has the axes for itself."""

    label: str
    x: Floats
    y: Floats
    colour: str | tuple[float, ...]
    dashes: Any


@dataclass(frozen=True, eq=False)
class Drawn:
    """A plot on axes: its kind, the name of the table with its wavelength, and its curves with their artists."""

    kind: str
    name: str
    curves: Sequence[DrawnCurve]
    artists: Sequence[Any]


def axes_for(kind: str, ax: Axes | None, size: tuple[float, float]) -> Axes:
    """Return the axes to draw on, in the look of all plots.

    Parameters
    ----------
    kind : str
        What is drawn: "lobe", "cuts", "albedo" or "slices".
    ax : matplotlib Axes or None
        Axes of the caller; None makes a figure.
    size : (float, float) [inch]
        Size of that figure.

    Raises
    ------
    ParameterError
        If `ax` is no rectangular Axes, or shows a plot of another kind, or an image and `kind` is one.
    """
    if ax is None:
        ax = import_extra("matplotlib.pyplot").subplots(figsize=size, layout="constrained")[1]
    elif getattr(ax, "name", "") != "rectilinear":
        raise ParameterError("ax", "is not Axes with straight x and y axes, as pyplot.subplots() makes", ax)
    shown = {plot.kind: plot.name for plot in drawn_on(ax)}
    if other := [drawn_kind for drawn_kind in shown if drawn_kind != kind or kind == "slices"]:
        raise ParameterError("ax", f"shows {other[0]} of {shown[other[0]]}; {kind} need axes of their own", ax)
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines[["left", "bottom"]].set_color(GRID)
    ax.tick_params(colors=MUTED, length=0)
    ax.set_axisbelow(True)
    return ax


def drawn_on(axes: Axes) -> list[Drawn]:
    """Return the plots that axes show; those that were cleared away are not among them."""
    there = {*axes.lines, *axes.images}
    return [plot for plot in vars(axes).get(_PLOTS, ()) if there.issuperset(plot.artists)]


def add(axes: Axes, kind: str, name: str, curves: Sequence[DrawnCurve], *, legend: bool = True) -> list[Drawn]:
    """Draw the curves of a plot, and return all plots on the axes.

    A plot that has the axes for itself has the colours of its curves. Of several, each has a colour, and its curves
    differ by their dashes. The legend names all lines that have a label, also those of the caller.

    Parameters
    ----------
    axes : Axes
        From `axes_for`.
    kind, name, curves
        As of `Drawn`.
    legend : bool
        Draw a legend even if this plot has the axes for itself.
    """
    lines = [
        axes.plot(curve.x, curve.y, color=curve.colour, linestyle=curve.dashes, lw=1.8, label=curve.label)[0]
        for curve in curves
    ]
    plots = remember(axes, Drawn(kind, name, curves, lines))
    if len(plots) > 1:
        for number, plot in enumerate(plots):
            colour: Any = COLOURS[number % len(COLOURS)]
            if number >= len(COLOURS):  # hues that differ from those before
                hue = (0.618 * number % 1.0, 0.75, 0.6)
                colour = tuple(import_extra("matplotlib.colors").hsv_to_rgb(hue).tolist())
            for index, (line, curve) in enumerate(zip(plot.artists, plot.curves, strict=True)):
                line.set(color=colour, linestyle=DASHES[index % len(DASHES)])
                line.set_label(", ".join(filter(None, [plot.name, curve.label])))
    if legend or len(plots) > 1:
        look: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.02), "frameon": False}
        if axes.figure.get_layout_engine() is None:  # nothing makes room beside the axes
            look = {"loc": "best", "fontsize": "small", "framealpha": 0.9, "edgecolor": "none"}
        axes.legend(labelcolor="linecolor", **look)
    axes.set_title(", ".join(plot.name for plot in plots), loc="left")
    return plots


def remember(axes: Axes, plot: Drawn) -> list[Drawn]:
    """Return all plots on the axes, the new one last."""
    plots = [*drawn_on(axes), plot]
    setattr(axes, _PLOTS, plots)
    return plots


def only(*artists: Any) -> None:
    """Mark artists that `without_only` removes, since the next plot replaces them."""
    for artist in artists:
        artist.set_gid(_ONLY)


def without_only(axes: Axes) -> None:
    """Remove the artists that `only` marked."""
    for artist in [*axes.lines, *axes.texts, *axes.collections]:
        if artist.get_gid() == _ONLY:
            artist.remove()


def polar_grid(axes: Axes, curves: Sequence[DrawnCurve]) -> float:
    """Draw half circles at values of f_r [1/sr] and spokes every 30 degrees, and return the radius of the last circle.

    It reaches over the lines on the axes and the curves that will be drawn, and replaces the grid that is there.
    """
    without_only(axes)
    points = [(np.asarray(line.get_xdata()), np.asarray(line.get_ydata())) for line in axes.lines]
    radii = np.concatenate([np.hypot(x, y) for x, y in [*points, *((curve.x, curve.y) for curve in curves)]])
    largest = float(np.nanmax(radii, initial=0.0)) or 1.0
    ticks = import_extra("matplotlib.ticker").MaxNLocator(4, steps=[1, 2, 2.5, 5, 10]).tick_values(0.0, largest)
    rings = [float(ring) for ring in ticks if ring > 0.0]
    edge = rings[-1]
    turn = np.linspace(-np.pi / 2.0, np.pi / 2.0, 181)
    thin: dict[str, Any] = {"color": GRID, "lw": 0.8, "zorder": 0, "label": "_grid"}
    small: dict[str, Any] = {"ha": "center", "color": MUTED, "fontsize": "small"}
    for ring in rings:
        only(*axes.plot(ring * np.sin(turn), ring * np.cos(turn), **thin))
        only(axes.text(ring, -0.02 * edge, f"{ring:g}", va="top", **small))
    for angle_deg in range(-90, 91, 30):
        x = edge * float(np.sin(radians(angle_deg)))
        y = edge * float(np.cos(radians(angle_deg)))
        only(*axes.plot([0.0, x], [0.0, y], **thin))
        if abs(angle_deg) < 90:
            only(axes.text(1.06 * x, 1.05 * y, f"{abs(angle_deg)}°", va="center", **small))
    return edge
