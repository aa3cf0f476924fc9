"""Plots of the energy of a material: albedos of model and table, the white furnace, the bound on a uniform part."""

from __future__ import annotations

import math
from collections.abc import Iterable

from brdfdb.audit.model_energy import Furnace, ModelEnergy, UniformBound
from brdfdb.audit.table_energy import TableEnergy
from brdfdb.figure import Curve, Numbers, Panel

_CURVES = 4  # largest number of wavelengths in a plot
_ALL_OF_IT = Curve(label="all that arrives", x=[0.0, 90.0], y=[1.0, 1.0])
_IDEAL = Curve(label="ideal", x=[0.0, 90.0], y=[1.0, 1.0], role="truth")
_THETA, _ALBEDO = "angle of the light, degrees", "directional albedo"


def panels_of(model: ModelEnergy | None, table: TableEnergy) -> list[Panel]:
    """Return the panels of a table, and of its model if it is known."""
    panels: list[Panel] = []
    strongest, at = 0, ""
    wavelengths, albedo = table.wavelength_nm, table.albedo if model is None else model.albedo
    if wavelengths is not None and len(wavelengths) > 1:
        strongest = _strongest(albedo)
        at = f" at {wavelengths[strongest]:g} nm"
        if model is not None:
            curves = _spectral(model.theta_i_deg, model.albedo, wavelengths)
            panels.append(Panel(title="Albedo of the model", x_label=_THETA, y_label=_ALBEDO, curves=curves))
        curves = [Curve(label="table", x=wavelengths, y=table.hemispherical, role="ours")]
        if model is not None:
            curves.append(Curve(label="model", x=wavelengths, y=model.hemispherical, role="truth"))
        panels.append(Panel(title="In uniform light", x_label="wavelength, nm", y_label="albedo", curves=curves))
    both = [Curve(label="table", x=table.theta_i_deg, y=_column(table.albedo, strongest), role="ours")]
    if model is not None:
        both.append(Curve(label="model", x=model.theta_i_deg, y=_column(model.albedo, strongest), role="truth"))
    title = f"{'Table' if model is None else 'Model and table'}{at}"
    panels.append(Panel(title=title, x_label=_THETA, y_label=_ALBEDO, curves=[*both, _ALL_OF_IT]))
    if model is not None and model.furnace is not None:
        panels.append(_of_furnace(model.furnace))
    if model is not None and model.bound_on_a is not None and len(model.bound_on_a.wavelength_nm) > 1:
        panels.append(_of_bound(model.bound_on_a))
    return panels


def _of_furnace(furnace: Furnace) -> Panel:
    curves = [*_spectral(furnace.theta_i_deg, furnace.albedo, furnace.wavelength_nm), _IDEAL]
    return Panel(title="White furnace: made lossless", x_label=_THETA, y_label=_ALBEDO, curves=curves)


def _of_bound(bound: UniformBound) -> Panel:
    x = bound.wavelength_nm
    curves = [
        Curve(label="this material", x=x, y=bound.preset, role="ours"),
        Curve(label="largest that conserves", x=x, y=bound.largest, role="truth"),
    ]
    return Panel(title="Uniform diffuse part a(λ)", x_label="wavelength, nm", y_label="a(λ)", curves=curves)


def _spectral(x: list[float], rows: list[Numbers], wavelengths: list[float] | None) -> list[Curve]:
    """Return curves at a few wavelengths, the first and the last among them."""
    if wavelengths is None or len(rows[0]) == 1:
        return [Curve(label="model", x=x, y=_column(rows, 0), role="ours")]
    count = min(_CURVES, len(wavelengths))
    chosen = sorted({round(k * (len(wavelengths) - 1) / max(count - 1, 1)) for k in range(count)})
    return [Curve(label=f"{wavelengths[k]:g} nm", x=x, y=_column(rows, k)) for k in chosen]


def _strongest(rows: list[Numbers]) -> int:
    """Return the index of the wavelength with the largest albedo."""

    def largest(values: Iterable[float | None]) -> float:
        return max((value for value in values if value is not None), default=-math.inf)

    return max(range(len(rows[0])), key=lambda k: largest(row[k] for row in rows))


def _column(rows: list[Numbers], k: int) -> Numbers:
    return [row[k] for row in rows]
