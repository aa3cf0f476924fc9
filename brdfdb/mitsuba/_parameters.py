"""Parameters of a model as textures of Mitsuba, checked against the ranges of the model."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.materials.written_parameters import as_written, written_name
from brdfdb.mitsuba._wavelengths import within
from brdfdb.parameters import ModelSpec, Parameter

Array = NDArray[np.float64]

# Widths along both axes that are given as one property, as in Mitsuba's own plugins
_BOTH = {"alpha": ("alpha_x", "alpha_y")}
_ENDS_NM = (300.0, 900.0)  # of spectra in Mitsuba, which are 0 beyond: ours continue as constants


class PluginParameters:
    """Textures and switches that are read from the properties of a plugin, by the names of the model's parameters.

    Reflectances and those of `coloured` have a value for each channel or wavelength. Spectra continue as constants
    beyond their ends. Mitsuba makes colours of reflectances; `coloured` are taken at `at_nm` [nm] if this is given. All
    other parameters have a single value, which is moved to the end of its range if a texture is beyond. Angles are in
    degrees, under names that end in ``_deg``.
    """

    def __init__(
        self,
        props: Any,
        spec: ModelSpec,
        coloured: tuple[Parameter, ...] = (),
        at_nm: tuple[float, ...] | None = None,
    ) -> None:
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
                self.textures[common] = _texture(props, common, as_written(parameter), at_nm)

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
                    values[name] = dr.select(dr.isnan(value), value, dr.clip(value, *self._ranges[name]))
        return values

    def traverse(self, callback: Any, constants: Collection[str] = ()) -> None:
        """Show the textures to the scene as differentiable parameters, but for those of given names."""
        for name in (name for name in self.textures if name not in constants):
            callback.put(name, self.textures[name], mi.ParamFlags.Differentiable)


def spectrum_of(props: Any, name: str) -> tuple[Array, Array] | None:
    """Return wavelengths [nm] and values of a property that is a spectrum; None of a number, a colour or a texture."""
    value: Any = props.get(name, None)
    if len(getattr(value, "wavelengths", ())) == 0:
        return None
    return np.array(value.wavelengths), np.array(value.values)


def _texture(props: Any, name: str, parameter: Parameter, at_nm: tuple[float, ...] | None) -> Any:
    if name in props:
        value = props[name]
        if isinstance(value, int | float):
            parameter.check(value)
    elif parameter.default is None:
        raise ParameterError(parameter.name, f"a number in {parameter.interval} or a texture is missing")
    spectrum = spectrum_of(props, name)
    if spectrum is not None:
        for value in spectrum[1]:
            parameter.check(float(value))
        props[name] = _readable(*spectrum, type(props[name]), None if parameter.reflectance else at_nm)
    read = props.get_texture if parameter.reflectance else props.get_unbounded_texture
    return read(name) if name in props else read(name, float(parameter.default or 0.0))


def _readable(wavelength_nm: Array, values: Array, spectrum: Any, channels_nm: tuple[float, ...] | None) -> Any:
    """Return a spectrum as a property from which Mitsuba makes the channels, at their wavelengths if given."""
    if channels_nm is not None:
        numbers = np.interp(within(np.array(channels_nm), wavelength_nm), wavelength_nm, values).tolist()
        return mi.ScalarColor3d(*numbers) if len(numbers) == 3 else numbers[0]
    at_nm = np.union1d(wavelength_nm, [nm for nm in _ENDS_NM if not wavelength_nm[0] <= nm <= wavelength_nm[-1]])
    return spectrum(at_nm.tolist(), np.interp(at_nm, wavelength_nm, values).tolist())
