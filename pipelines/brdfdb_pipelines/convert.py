"""The convert job: it searches the parameters of another model, prints them with the error, and draws both models."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from brdfdb.conversion.convert import STEPS, convert
from brdfdb.conversion.document import Conversion
from brdfdb.conversion.figure import figure_of
from brdfdb.conversion.nodes import Weigh
from brdfdb.errors import ParameterError, percent
from brdfdb.figure import Figure, Panel
from brdfdb.geometry import radians
from brdfdb.materials import written_name
from brdfdb.models import MODELS
from brdfdb.store.files import write_file
from brdfdb_pipelines import terminal
from brdfdb_pipelines.figure_look import (
    DOT,
    GRID,
    GRID_WIDTH,
    Limits,
    array_of,
    limits_of,
    styles_of,
    ticks_of,
)
from brdfdb_pipelines.named_source import named_source

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas
    from matplotlib.lines import Line2D

_PATIENCE_S = 2.0  # time [s] after which the progress bar appears

# Lengths of the picture in points
_COLUMNS = 2
_WIDTH = 360.0  # width of a column
_PLOT = 150.0  # height of a plot
_LEFT = 46.0
_RIGHT = 12.0
_ABOVE = 44.0
_BELOW = 38.0
_HEAD = 40.0


@dataclass(frozen=True)
class ConversionRequest:
    """Target of a conversion: the model, and the settings of its search.

    Wavelengths [nm] replace those of the material. Fixed parameters are ``name=value``, as recipes write them.
    """

    model: str
    wavelength_nm: Sequence[float] | None = None
    fixed: Sequence[str] = ()
    refractive_index: str | None = None
    weigh: Weigh | None = None

    def fixed_values(self) -> dict[str, float]:
        """Return the fixed parameters in the units of the model."""
        if self.model not in MODELS:
            return {}  # the conversion refuses the model
        parameters = {written_name(parameter): parameter for parameter in MODELS[self.model].parameters}
        values: dict[str, float] = {}
        for setting in self.fixed:
            name, _, text = setting.partition("=")
            if name not in parameters:
                names = ", ".join(parameters)
                sentence = f"the parameters of {self.model} are {names}"
                raise ParameterError(f"--fix {setting}", sentence, name, tuple(parameters))
            parameter = parameters[name]
            if text in ("true", "false"):
                values[parameter.name] = text == "true"
                continue
            try:
                value = float(text)
            except ValueError:
                raise ParameterError(f"--fix {setting}", f"{text!r} is not a number, true or false", text) from None
            values[parameter.name] = float(radians(value)) if parameter.unit == "rad" else value
        return values


def run(
    name: str,
    request: ConversionRequest,
    *,
    store: Path | None = None,
    recipe_path: Path | None = None,
    json: bool = False,
    picture: Path | None = None,
) -> Conversion:
    """Convert a material of the recipe or the store to another model, and print the result; ParameterError if refused.

    The store need not exist, and the recipe needs only to define materials. The picture shows both models.
    """
    named = named_source(name, store, recipe_path)
    terminal.say_without_glints("the conversion", named.source)
    wavelength_nm = named.wavelength_nm
    if request.wavelength_nm is not None:
        wavelength_nm = np.array(request.wavelength_nm, dtype=np.float64)
    fixed = request.fixed_values()
    with terminal.progress(counted=False, transient=True) as bar:
        task = bar.add_task(f"{name} to {request.model}", total=STEPS, visible=False)
        shown = threading.Timer(_PATIENCE_S, lambda: bar.update(task, visible=True))
        shown.start()
        try:
            conversion = convert(
                named.source,
                request.model,
                wavelength_nm,
                fixed=fixed,
                refractive_index=request.refractive_index,
                weigh=request.weigh,
                tick=lambda: bar.advance(task),
            )
        finally:
            shown.cancel()
    if picture is not None:
        from brdfdb_pipelines import figure_canvas

        figure = figure_of(named.source, conversion)
        if picture.suffix.lower() == ".png":
            data = figure_canvas.png(lambda: _drawn(figure))
        else:
            data = figure_canvas.svg(lambda: _drawn(figure), f"{figure.title}. {figure.caption}").encode()
        picture.parent.mkdir(parents=True, exist_ok=True)
        write_file(picture, data, picture.parent)
    if json:
        print(conversion.model_dump_json(indent=1))
    else:
        print(terminal.plain("\n".join(lines(conversion))))
    return conversion


def lines(conversion: Conversion) -> list[str]:
    """Return the lines that the command prints."""
    made = conversion.material
    text = [f"{conversion.source} ({conversion.source_model or 'no model'}) as {conversion.model}", "  parameters"]
    in_file = made.file_parameters()
    fixed = set(conversion.fixed)
    for parameter in made.spec.parameters:
        name = written_name(parameter)
        note = (
            "fixed"
            if parameter.name in fixed
            else _as_good(conversion, parameter.name, in_degrees=parameter.unit == "rad")
        )
        value = in_file[name]
        shown = f"{value:.6g}" if isinstance(value, float) else str(value)
        text.append(f"    {name:<16}{shown:<12}{note}".rstrip())
    for name, index in (("n", conversion.n), ("k", conversion.k)):
        if index is not None:
            text.append(f"    {name:<16}{index:<12.6g}{_as_good(conversion, name)}".rstrip())
    if conversion.n is None and conversion.refractive_index:
        text.append(f"    {'n, k':<16}{conversion.refractive_index}")
    view = conversion.worst_view
    text.append(f"  l1          {percent(conversion.l1)} of the light of {conversion.source} is missing or too much")
    text.append(f"  p99         {percent(conversion.p99)}: 99 of 100 values of f_r differ by less")
    text.append(f"  reflected   {100.0 * conversion.reflected:.3g} % of the light of {conversion.source}")
    peak = conversion.peak
    at_peak = f"in the mirror direction of {peak.theta_deg:g}°"
    text.append(f"  peak        f_r {peak.before:.3g} -> {peak.after:.3g} /sr {at_peak}")
    several = len(conversion.wavelengths_nm or ()) > 1
    text.append(
        f"  worst view  l1 {percent(view.l1)} from theta_r {view.theta_r_deg:g}°, phi_r {view.phi_r_deg:g}°"
        + (f" at {view.wavelength_nm:g} nm" if several else "")
    )
    light = f"theta_i {view.theta_i_deg:g}°, phi_i {view.phi_i_deg:g}°"
    text.append(f"              most for {light}: f_r {view.before:.3g} -> {view.after:.3g} /sr")
    text += [f"  note        {sentence}" for sentence in conversion.remarks]
    return [*text, "", *conversion.recipe.splitlines()]


def _as_good(conversion: Conversion, name: str, *, in_degrees: bool = False) -> str:
    """Return the range of values that are as good, in words."""
    if name not in conversion.as_good:
        return ""
    low, high = (np.rad2deg(value) if in_degrees else value for value in conversion.as_good[name])
    return f"{low:.3g} to {high:.3g} are within 1 %"


def _drawn(figure: Figure) -> Canvas:
    """Draw the panels of curves of a figure in two columns."""
    from matplotlib.figure import Figure as Canvas

    panels = [panel for panel in figure.panels if isinstance(panel, Panel)]
    rows = -(-len(panels) // _COLUMNS)
    each_row = _ABOVE + _PLOT + _BELOW
    width = _COLUMNS * _WIDTH
    height = _HEAD + rows * each_row
    canvas = Canvas(figsize=(width / 72.0, height / 72.0), facecolor="white")
    canvas.text(8.0 / width, 1.0 - 8.0 / height, figure.title, va="top", fontsize=12, fontweight="bold")
    canvas.text(8.0 / width, 1.0 - 25.0 / height, figure.caption, va="top")
    for number, panel in enumerate(panels):
        row, column = divmod(number, _COLUMNS)
        left = column * _WIDTH
        top = _HEAD + row * each_row
        below = 1.0 - (top + _ABOVE + _PLOT) / height
        axes = canvas.add_axes(((left + _LEFT) / width, below, (_WIDTH - _LEFT - _RIGHT) / width, _PLOT / height))
        axes.tick_params(length=0)
        canvas.text((left + 8.0) / width, 1.0 - (top + 6.0) / height, panel.title, va="top", fontweight="bold")
        canvas.legend(
            handles=curves_on(axes, panel),
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


def curves_on(axes: Axes, panel: Panel) -> list[Line2D]:
    """Draw the curves of a panel, its axes and their labels; return the lines, for a legend.

    Logarithmic axes have powers of ten as labels whatever their range, because panels stand side by side.
    """
    from matplotlib.lines import Line2D

    lines = []
    for curve, style in zip(panel.curves, styles_of(panel.curves), strict=True):
        line = Line2D(
            curve.x,
            array_of(curve.y).tolist(),
            color=style.colour,
            linewidth=style.width,
            linestyle="none" if curve.dots else (0, style.dashes) if style.dashes else "-",
            marker="o" if curve.dots else "none",
            markersize=DOT,
            markeredgewidth=0.0,
            zorder=style.order,
        )
        line.set_label(curve.label)
        axes.add_line(line)
        lines.append(line)
    x_limits = limits_of([x for curve in panel.curves for x in curve.x], "x", log=panel.log_x)
    y_limits = limits_of([y for curve in panel.curves for y in curve.y], "y", log=panel.log_y)
    _scale(axes, "x", x_limits, log=panel.log_x)
    _scale(axes, "y", y_limits, log=panel.log_y)
    axes.grid(color=GRID, linewidth=GRID_WIDTH, clip_on=False)
    axes.set_xlabel(panel.x_label)
    axes.set_ylabel(panel.y_label)
    axes.spines[["top", "right"]].set_visible(False)
    return lines


def _scale(axes: Axes, which: Literal["x", "y"], limits: Limits, *, log: bool) -> None:
    from matplotlib.ticker import FixedFormatter, FixedLocator, NullLocator

    (axes.set_xscale if which == "x" else axes.set_yscale)("log" if log else "linear")
    (axes.set_xlim if which == "x" else axes.set_ylim)(limits.low, limits.high)
    axis = axes.xaxis if which == "x" else axes.yaxis
    ticks = ticks_of(limits, log=log, powers=True)
    axis.set_major_locator(FixedLocator([tick.at for tick in ticks]))
    axis.set_major_formatter(FixedFormatter([tick.label for tick in ticks]))
    axis.set_minor_locator(NullLocator())
