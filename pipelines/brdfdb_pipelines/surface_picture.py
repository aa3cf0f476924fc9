"""Pictures of the maps of the error of models against rays on surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure as Canvas

from brdfdb.models import MODELS
from brdfdb_pipelines import figure_canvas
from brdfdb_pipelines.figure_look import MUTED, PRINTED, TRUTH
from brdfdb_pipelines.surface_maps import Document, Row, errors_at, percent, rows_of

_LEVELS = (0.0, 0.02, 0.05, 0.1, 0.2, 0.5, 1e9)  # relative errors at which colours change
_COLOURS = ("#eaf3fb", "#c3dcf0", "#f6efc9", "#f3cf8f", "#e58e5a", "#b8402a")
# Lengths in points
_PANEL = 150.0  # sides of a panel
_GAP = 34.0  # between panels of a row
_ROW_GAP = 62.0  # between rows, for the limit of one panel and the name of the next
_ACROSS = 3  # panels in a row
_ABOVE = 64.0
_BELOW = 34.0
_LEFT = 34.0
_LIMIT_AT = -0.13  # place of the words on the limit, in heights of a panel
_SHOWN_RHO = 0.5  # albedo of the maps of a picture


def draw(document: Document, names: Sequence[str], file: Path) -> None:
    """Draw the maps of models as SVG or PNG, by the name of the file."""
    if file.suffix.lower() == ".svg":
        text = figure_canvas.svg(lambda: _drawn(document, names), "Errors of models over slope and angle of the light")
        file.write_text(text, encoding="utf-8")
    else:
        file.write_bytes(figure_canvas.png(lambda: _drawn(document, names)))


def _drawn(document: Document, names: Sequence[str]) -> Canvas:
    down = -(-len(names) // _ACROSS)
    across = min(_ACROSS, len(names))
    width = _LEFT + _ACROSS * (_PANEL + _GAP)  # the title needs it, of a single panel too
    height = _ABOVE + down * _PANEL + (down - 1) * _ROW_GAP + _BELOW
    canvas = Canvas(figsize=(width / 72.0, height / 72.0))
    for index, name in enumerate(names):
        row, column = divmod(index, across)
        left = _LEFT + column * (_PANEL + _GAP)
        bottom = height - _ABOVE - (row + 1) * _PANEL - row * _ROW_GAP
        axes = canvas.add_axes((left / width, bottom / height, _PANEL / width, _PANEL / height))
        _panel(axes, document, name)
    title = "Error against rays on Gaussian surfaces: 95 % of viewers are within the number of a cell [%]"
    canvas.text(_LEFT / width, 1.0 - 16.0 / height, title, fontsize=10.0, fontweight="bold")
    words = "Upwards: slope along each axis. To the right: angle of the light."
    if any(row["rho"] == _SHOWN_RHO for name in names for row in rows_of(document, name)):
        words += f" Albedo of the facets {_SHOWN_RHO:g}, where it matters."
    canvas.text(_LEFT / width, 1.0 - 30.0 / height, words, color=MUTED)
    return canvas


def _panel(axes: Axes, document: Document, name: str) -> None:
    """Draw the map of a model: a cell for each slope and light."""
    entry = document["models"][name]
    slopes = sorted({row["slope"] for row in rows_of(document, name)})
    lights = document["lights_deg"]
    values = np.array([errors_at(entry, slope, "p95", _SHOWN_RHO)[0] for slope in slopes])
    norm = BoundaryNorm(_LEVELS, len(_COLOURS))
    edges = np.arange(len(lights) + 1), np.arange(len(slopes) + 1)
    axes.pcolormesh(*edges, values, cmap=ListedColormap(_COLOURS), norm=norm)
    for row, column in np.ndindex(values.shape):
        colour = "#ffffff" if values[row, column] >= _LEVELS[-2] else TRUTH
        text = percent(float(values[row, column]))
        axes.text(column + 0.5, row + 0.5, text, ha="center", va="center", fontsize=7.0, color=colour)
    axes.set_xticks(np.arange(len(lights)) + 0.5, [f"{light}°" for light in lights])
    axes.set_yticks(np.arange(len(slopes)) + 0.5, [f"{slope:g}" for slope in slopes])
    axes.tick_params(length=0.0)
    for side in axes.spines.values():
        side.set_visible(False)
    axes.set_title(name.replace(" ", "\n", 1), loc="left", fontsize=8.0, pad=3.0)
    _limit(axes, entry, slopes)


def _limit(axes: Axes, entry: Row, slopes: Sequence[float]) -> None:
    """Draw where the limit that the paper states begins, between the rows of slopes inside and beyond it."""
    beyond = limit_of(entry, slopes)
    if beyond is None:
        axes.set_xlabel("no limit stated", color=MUTED, fontsize=7.0)
        return
    width = axes.get_xlim()[1]
    axes.fill_between(
        (0.0, width), beyond, len(slopes), facecolor="none", edgecolor=PRINTED, hatch="////", alpha=0.35, linewidth=0.0
    )
    axes.plot((0.0, width), (beyond, beyond), color=PRINTED, linewidth=1.6)
    axes.set_xlabel("red: limit of the paper", color=PRINTED, fontsize=7.0)


def limit_of(entry: Row, slopes: Sequence[float]) -> int | None:
    """Return how many slopes are inside the limits that the paper states; None if it states none for a slope."""
    spec = MODELS[entry["model"]]
    if spec.limits is None:
        return None
    for row in entry["rows"]:
        if row["slope"] in slopes:
            limits = spec.limits({**entry["arguments"], **row["parameters"], "rho": row["rho"] or 1.0})
            if not {limit.standing for limit in limits} <= {"inside", "unknown"}:
                return slopes.index(row["slope"])
    return len(slopes)
