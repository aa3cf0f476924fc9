"""Parameters of a model as textures of Mitsuba, checked against the ranges of the model."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from brdfdb.errors import ParameterError
from brdfdb.materials.written_parameters import as_written, written_name
from brdfdb.parameters import ModelSpec, Parameter

# Widths along both axes that are given as one property, as in Mitsuba's own plugins
_BOTH = {"alpha": ("alpha_x", "alpha_y")}


class Parameters:
    """Textures and switches that are read from the properties of a plugin, by the names of the model's parameters.

    Reflectances, n and k have a value for each channel or wavelength. All other parameters have a single value, which
    is moved to the end of its range if a texture is beyond. Angles are in degrees, under names that end in ``_deg``.
    """

    def __init__(self, props: Any, spec: ModelSpec, coloured: tuple[Parameter, ...] = ()) -> None:
        self.textures: dict[str, Any] = {}
        self._coloured = {p.name for p in (*spec.parameters, *coloured) if p.reflectance or p in coloured}
        self._angles = {parameter.name for parameter in spec.parameters if parameter.unit == "rad"}
        self._ranges = {parameter.name: (parameter.low, parameter.high) for parameter in spec.parameters}
        self._switches: dict[str, bool] = {}
        self._names: dict[str, str] = {}
        for parameter in (*spec.parameters, *coloured):
            name = parameter.name
            written = written_name(parameter)
            common = next((both for both, names in _BOTH.items() if name in names and both in props), written)
            self._names[name] = common
            if isinstance(parameter.default, bool):
                self._switches[name] = bool(props.get(name, parameter.default))
            elif common not in self.textures:
                self.textures[common] = _texture(props, common, as_written(parameter))

    def at(self, interaction: Any, active: Any) -> dict[str, Any]:
        """Return the values of all parameters where a ray meets the surface, by name."""
        values: dict[str, Any] = dict(self._switches)
        for name, common in self._names.items():
            if name not in self._switches:
                texture = self.textures[common]
                if name in self._coloured:
                    values[name] = texture.eval(interaction, active)
                else:
                    value = texture.eval_1(interaction, active)
                    value = dr.deg2rad(value) if name in self._angles else value
                    values[name] = dr.clip(value, *self._ranges[name])
        return values

    def traverse(self, callback: Any) -> None:
        """Show all textures to the scene as differentiable parameters."""
        for name, texture in self.textures.items():
            callback.put(name, texture, mi.ParamFlags.Differentiable)


def _texture(props: Any, name: str, parameter: Parameter) -> Any:
    if name in props:
        value = props[name]
        if isinstance(value, int | float):
            parameter.check(value)
    elif parameter.default is None:
        raise ParameterError(parameter.name, f"a number in {parameter.interval} or a texture is missing")
    read = props.get_texture if parameter.reflectance else props.get_unbounded_texture
    return read(name) if name in props else read(name, float(parameter.default or 0.0))
