"""The picture of a choice: truth, choice and next cheaper forms, with their differences from the truth."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from brdfdb.scenes import image
from brdfdb.scenes.choice import Seen
from brdfdb.scenes.shapes import Array

TIMES = 2.0  # end of the bar of colours, relative to the tolerance
BEYOND = "#e5341a"  # colour of larger differences
BAR = 16  # height of the bar [pixel]
_PANEL = 420  # pixels across, as nearly as makes each pixel of the scene a square of whole ones
_GAP, _TITLE, _MORE = 14, 30, 60  # pixels: around panels, above them, beside the bar
_DPI = 128  # a power of two: sizes in inches are whole pixels again
_TEXT: dict[str, Any] = {"fontsize": 7}


def png(seen: Seen, choice: Array, cheaper: Array | None, left_out: Sequence[str] = ()) -> bytes:
    """Draw five panels: truth, choice and next cheaper, and below a bar of colours and the differences of the two.

    Parameters
    ----------
    seen : Seen
        The scene, with the truth and the measure of differences.
    choice, cheaper : array (height, width, L)
        Spectral radiance. `cheaper` is None if nothing is cheaper.
    left_out : sequence of str
        Material and title of each form that could not be made. They are listed below the bar.
    """
    height, width = seen.truth.shape[:2]
    times = max(1, round(_PANEL / width))
    across, down = times * width, times * height
    wide, high = 3 * across + 4 * _GAP, 2 * (down + _TITLE) + 2 * _GAP
    canvas = Figure(figsize=(wide / _DPI, high / _DPI), dpi=_DPI, facecolor="white")

    def panel(column: int, row: int, title: str, size: tuple[int, int] = (across, down)) -> Axes:
        left, top = _GAP + column * (across + _GAP), (row + 1) * _TITLE + row * (down + _GAP)
        axes = canvas.add_axes((left / wide, 1.0 - (top + size[1]) / high, size[0] / wide, size[1] / high))
        axes.set_title(title, **_TEXT)
        return axes

    tolerance = seen.scene.tolerance
    most = TIMES * tolerance.value
    scale, colours = Normalize(0.0, most), mpl.colormaps["viridis"].with_extremes(over=BEYOND)
    last = "nothing is cheaper" if cheaper is None else "next cheaper of each material"
    images = (("truth", seen.truth), ("choice", choice), (last, cheaper))
    for column, (title, picture) in enumerate(images):
        axes = panel(column, 0, title)
        axes.set_axis_off()
        if picture is None:
            continue
        axes.imshow(image.srgb(seen.scene, picture), interpolation="nearest", aspect="auto")
        if column > 0:
            off = seen.differences(picture)
            below = panel(column, 1, f"off by {off.max():.2g} at most")
            below.imshow(off, norm=scale, cmap=colours, interpolation="nearest", aspect="auto")
            below.set_axis_off()
    unit = "CIEDE2000" if tolerance.unit == "CIEDE2000" else "relative, at the worst wavelength"
    bar = canvas.colorbar(
        ScalarMappable(scale, colours),
        cax=panel(0, 1, f"difference from the truth, {unit}", (across - _MORE, BAR)),
        orientation="horizontal",
        extend="max",
        ticks=[0.0, tolerance.value, most],
    )
    bar.ax.set_xticklabels(["0", f"{tolerance.value:g}, the tolerance", f"{most:g}"], **_TEXT)
    bar.ax.axvline(tolerance.value, color="white", linewidth=2.0)
    beside: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "offset pixels", "va": "center"}
    bar.ax.annotate("more", (1.0, 0.5), (_MORE / 2.0, 0.0), **beside, **_TEXT)
    if left_out:
        bar.ax.annotate(
            "\n".join(["cannot be made:", *left_out]),
            (0.0, 0.0),
            (0.0, -3.0 * BAR),
            xycoords="axes fraction",
            textcoords="offset pixels",
            va="top",
            **_TEXT,
        )
    data = io.BytesIO()
    canvas.savefig(data, format="png", dpi=_DPI, metadata={"Software": None})
    return data.getvalue()
