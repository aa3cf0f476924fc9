"""The picture of a conversion, as SVG or PNG."""

from __future__ import annotations

import html
import io
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure as Canvas

from brdfdb.figure import Figure, Panel
from brdfdb.store.files import write_file
from brdfdb_pipelines import figure_canvas

_COLUMNS, _PLOT, _LEFT, _RIGHT, _ABOVE, _BELOW, _HEAD = 2, 150.0, 46.0, 12.0, 44.0, 38.0, 40.0  # in points
_WIDTH = 360.0  # of a column
_DPI = 110
_STYLE: dict[Any, Any] = figure_canvas.STYLE | {"svg.hashsalt": "brdfdb", "font.family": "sans-serif"}
_BLANK: dict[str, Any] = {"Date": None, "Creator": None, "Format": None, "Type": None}


def write(path: Path, figure: Figure) -> None:
    """Write a figure of curves to a file whose name ends in .svg or .png."""
    data = png(figure) if path.suffix.lower() == ".png" else svg(figure).encode()
    path.parent.mkdir(parents=True, exist_ok=True)
    write_file(path, data, path.parent)


def svg(figure: Figure) -> str:
    """Return a figure of curves as an SVG document."""
    with mpl.rc_context(_STYLE):
        text = io.StringIO()
        _drawn(figure).savefig(text, format="svg", metadata=_BLANK)
    opening, rest = figure_canvas.kept_ids(figure_canvas.shortened(text.getvalue()), "c").split(">", 1)
    described = html.escape(f"{figure.title}. {figure.caption}")
    plate = '<rect width="100%" height="100%" fill="#fff"/>'
    return f'{opening} font-family="sans-serif" role="img" aria-label="{described}">{plate}{rest}\n'


def png(figure: Figure) -> bytes:
    """Return a figure of curves as PNG."""
    with mpl.rc_context(_STYLE):
        data = io.BytesIO()
        _drawn(figure).savefig(data, format="png", dpi=_DPI, metadata={"Software": None})
    return data.getvalue()


def _drawn(figure: Figure) -> Canvas:
    panels = [panel for panel in figure.panels if isinstance(panel, Panel)]
    rows = -(-len(panels) // _COLUMNS)
    each_row = _ABOVE + _PLOT + _BELOW
    width, height = _COLUMNS * _WIDTH, _HEAD + rows * each_row
    canvas = Canvas(figsize=(width / 72.0, height / 72.0), facecolor="white")
    canvas.text(8.0 / width, 1.0 - 8.0 / height, figure.title, va="top", fontsize=12, fontweight="bold")
    canvas.text(8.0 / width, 1.0 - 25.0 / height, figure.caption, va="top")
    for number, panel in enumerate(panels):
        row, column = divmod(number, _COLUMNS)
        left, top = column * _WIDTH, _HEAD + row * each_row
        below = 1.0 - (top + _ABOVE + _PLOT) / height
        axes = canvas.add_axes(((left + _LEFT) / width, below, (_WIDTH - _LEFT - _RIGHT) / width, _PLOT / height))
        axes.tick_params(length=0)
        canvas.text((left + 8.0) / width, 1.0 - (top + 6.0) / height, panel.title, va="top", fontweight="bold")
        canvas.legend(
            handles=figure_canvas.curves_on(axes, panel),
            loc="upper left",
            bbox_to_anchor=((left + 4.0) / width, 1.0 - (top + 14.0) / height),
            ncols=2,
            frameon=False,
            borderpad=0.2,
            labelspacing=0.3,
            handlelength=2.6,
            columnspacing=1.2,
            handletextpad=0.5,
        )
    return canvas
