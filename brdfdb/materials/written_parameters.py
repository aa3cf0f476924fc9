"""Parameters of a model as files write them: angles in degrees, under names that end in ``_deg``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from brdfdb.errors import ParameterError
from brdfdb.geometry import degrees, radians
from brdfdb.materials.provenance import Number
from brdfdb.materials.spectrum import Spectrum, spectrum_of
from brdfdb.parameters import ModelSpec, Parameter


def written_name(parameter: Parameter) -> str:
    """Return the name of a parameter in files. The name of an angle ends in ``_deg``, because files use degrees."""
    return f"{parameter.name}_deg" if parameter.unit == "rad" else parameter.name


def as_written(parameter: Parameter) -> Parameter:
    """Return a parameter as files write it: an angle is in degrees, under a name that ends in ``_deg``."""
    if parameter.unit != "rad":
        return parameter
    return replace(
        parameter,
        name=written_name(parameter),
        unit="degree",
        low=float(degrees(parameter.low)),
        high=float(degrees(parameter.high)),
        default=None if parameter.default is None else float(degrees(parameter.default)),
    )


def from_file(
    spec: ModelSpec, written: Mapping[str, Any], wavelengths_nm: Any = None, folder: Path | None = None
) -> dict[str, Number | Spectrum]:
    """Return the parameters of a file in the units of the model; ParameterError if one is not allowed.

    `wavelengths_nm` and `folder` are those of `spectrum_of`.
    """
    file_spec = replace(spec, parameters=tuple(as_written(parameter) for parameter in spec.parameters))
    reflectances = {parameter.name for parameter in spec.parameters if parameter.reflectance}
    read = {
        name: spectrum_of(name, value, wavelengths_nm, folder)
        if name in reflectances and isinstance(value, list | Mapping)
        else value
        for name, value in written.items()
    }
    values = completed(file_spec, read).values()
    return {
        parameter.name: float(radians(value)) if parameter.unit == "rad" and isinstance(value, float | int) else value
        for parameter, value in zip(spec.parameters, values, strict=True)
    }


def completed(spec: ModelSpec, parameters: Mapping[str, Any]) -> dict[str, Number | Spectrum]:
    """Return checked parameters in the order of the model, with defaults; ParameterError if one is not allowed."""
    names = [parameter.name for parameter in spec.parameters]
    for name, value in parameters.items():
        if name not in names:
            hint = "; wavelength_nm, n and k come from refractive_index" if spec.spectral else ""
            text = f"{value!r} given, but the parameters of {spec.name} are {', '.join(names)}{hint}"
            raise ParameterError(name, text, value, tuple(names))
    complete: dict[str, Number | Spectrum] = {}
    for parameter in spec.parameters:
        value = parameters.get(parameter.name, parameter.default)
        if value is None:
            raise ParameterError(
                parameter.name,
                f"missing, {spec.name} needs a value in {parameter.interval}",
                None,
                (parameter.low, parameter.high),
            )
        if isinstance(value, Spectrum) and parameter.reflectance:
            parameter.check(value.values)
            complete[parameter.name] = value
            continue
        if isinstance(value, Spectrum | list | Mapping):
            reflectances = ", ".join(p.name for p in spec.parameters if p.reflectance) or "none"
            raise ParameterError(
                parameter.name,
                f"a number is needed; parameters of {spec.name} that may be spectra: {reflectances}",
                value,
            )
        switch = isinstance(parameter.default, bool)
        if not isinstance(value, int | float) or isinstance(value, bool) != switch:
            raise ParameterError(parameter.name, f"{value!r} is not {'true or false' if switch else 'a number'}", value)
        parameter.check(value)
        complete[parameter.name] = value
    return complete
