"""A fit as a material, and as text of a recipe."""

from __future__ import annotations

from typing import Any

from brdfdb.fitting.problem import Point
from brdfdb.fitting.surface import Surface
from brdfdb.geometry import degrees
from brdfdb.materials import Material, written_name
from brdfdb.materials.provenance import MOST_NAME
from brdfdb.materials.recipe_text import rounded, toml_of
from brdfdb.measurements import Samples
from brdfdb.measurements.measured_source import slug


def material_of(surface: Surface, point: Point, samples: Samples) -> tuple[Material | None, str | None]:
    """Return a fit as a material and its text in a recipe; None for a sum, and for colours without wavelengths.

    Reflectances of samples with a wavelength are spectra, also of one wavelength: the material holds there only.
    """
    at = samples.wavelength_nm
    several = len(samples.channels) > 1
    if len(surface.terms) > 1 or (several and at is None):
        return None, None
    spec = surface.terms[0].spec
    origin = f"fitted to {samples.name}"
    (numbers,) = surface.numbers(point.x)
    values: dict[str, Any] = {}
    for parameter in spec.parameters:
        name = parameter.name
        column = next((i for i, one in enumerate(surface.coefficients) if one.name == name), None)
        if at is not None and parameter.reflectance and (column is not None or not several):
            fitted = [numbers[name]] if column is None else point.values[column].tolist()
            spectrum = [rounded(value) for value in fitted]
            values[name] = {"wavelengths_nm": at.tolist(), "values": spectrum, "origin": origin}
            continue
        if column is not None and several:
            return None, None  # an amplitude that is no reflectance has no spectrum
        value = float(point.values[column, 0]) if column is not None else numbers[name]
        in_file = float(degrees(value)) if parameter.unit == "rad" else value
        values[written_name(parameter)] = value if isinstance(value, bool) else rounded(in_file)
    table: dict[str, Any] = {"title": f"{samples.name}, as {spec.title}", "model": spec.name, "source": origin}
    if surface.searched_index:
        table["refractive_index"] = f"constant/{rounded(numbers['n'])!r}/{rounded(numbers['k'])!r}"
    elif surface.entry is not None and spec.spectral:
        table["refractive_index"] = surface.entry
    spectra = any(isinstance(value, dict) for value in values.values())
    if spec.spectral or spectra:
        table["wavelengths_nm"] = surface.wavelength_nm.tolist()
    elif at is not None:
        table["note"] = f"fitted at {at[0]:g} nm; the model is grey, and its numbers hold at this wavelength only"
    table["parameters"] = values
    name = slug(f"{samples.name}-as-{spec.name}")[:MOST_NAME].rstrip("-")
    return Material.from_table(name, table), toml_of(name, table)
