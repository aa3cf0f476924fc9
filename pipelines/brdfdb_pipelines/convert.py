"""The convert job: searches the parameters of another model, and prints them with the error that is left."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from brdfdb.conversion.convert import STEPS, convert
from brdfdb.conversion.document import Conversion, percent
from brdfdb.conversion.figure import figure_of
from brdfdb.conversion.nodes import Weigh
from brdfdb.errors import ParameterError
from brdfdb.geometry import radians
from brdfdb.materials import written_name
from brdfdb.models import MODELS
from brdfdb_pipelines import terminal
from brdfdb_pipelines.named_source import named_source

PATIENCE_S = 2.0  # time [s] after which the bar of progress appears


def run(
    name: str,
    model: str,
    *,
    store: Path | None = None,
    recipe_path: Path | None = None,
    wavelength_nm: Sequence[float] | None = None,
    fixed: Sequence[str] = (),
    refractive_index: str | None = None,
    weigh: Weigh | None = None,
    json: bool = False,
    picture: Path | None = None,
) -> Conversion:
    """Convert a material to another model and print the result.

    Parameters
    ----------
    name : str
        A material of the recipe (by default every preset) or of the store.
    model : str
        The model to convert to.
    store : Path, optional
        Store whose materials are known as well; it need not exist.
    recipe_path : Path, optional
        A recipe that defines materials, and the wavelengths of spectral ones. It needs nothing else.
    wavelength_nm : sequence of float [nm], optional
        Wavelengths in place of those of the recipe.
    fixed : sequence of str
        Parameters that are not searched, ``name=value`` as recipes write them.
    refractive_index, weigh
        As of `brdfdb.conversion.convert.convert`.
    json : bool
        Print the whole document as JSON.
    picture : Path, optional
        A file to draw both models in, whose name ends in .svg or .png.

    Returns
    -------
    Conversion
        The document.

    Raises
    ------
    ParameterError
        If the material is unknown, or the conversion is refused.
    """
    source, at = named_source(name, store, recipe_path)
    if wavelength_nm is not None:
        at = np.array(wavelength_nm, dtype=np.float64)
    values = _values(model, fixed)
    with terminal.progress(counted=False, transient=True) as bar:
        task = bar.add_task(f"{name} to {model}", total=STEPS, visible=False)
        shown = threading.Timer(PATIENCE_S, lambda: bar.update(task, visible=True))
        shown.start()
        try:
            conversion = convert(
                source,
                model,
                at,
                fixed=values,
                refractive_index=refractive_index,
                weigh=weigh,
                tick=lambda: bar.advance(task),
            )
        finally:
            shown.cancel()
    if picture is not None:
        from brdfdb_pipelines import conversion_picture

        conversion_picture.write(picture, figure_of(source, conversion))
    if json:
        print(conversion.model_dump_json(indent=1))
    else:
        print(terminal.plain("\n".join(lines(conversion))))
    return conversion


def _values(model: str, settings: Sequence[str]) -> dict[str, float]:
    """Return parameters from ``name=value``, as recipes write them, in the units of the model."""
    if model not in MODELS:
        return {}  # the conversion refuses it
    parameters = {written_name(parameter): parameter for parameter in MODELS[model].parameters}
    values: dict[str, float] = {}
    for setting in settings:
        name, _, text = setting.partition("=")
        if name not in parameters:
            raise ParameterError(
                f"--fix {setting}", f"the parameters of {model} are {', '.join(parameters)}", name, tuple(parameters)
            )
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


def lines(conversion: Conversion) -> list[str]:
    """Return the lines that the command prints."""
    made, was = conversion.material, conversion.source_model or "no model"
    text = [f"{conversion.source} ({was}) as {conversion.model}", "  parameters"]
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
