"""The materials of the papers: their published parameters, each with the table, figure or section it comes from.

One TOML file a paper, one table a material. In the files an angle is written in degrees under a name that ends in
``_deg``; inside `Material` every parameter has the unit of its model.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from importlib import resources
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic_core import ErrorDetails

from brdfdb.errors import MaterialError, ParameterError
from brdfdb.geometry import degrees, radians
from brdfdb.materials.provenance import Assumption, KnownExcess, Number, Text, Words
from brdfdb.models import MODELS
from brdfdb.parameters import Floats, ModelSpec, Parameter
from brdfdb.spectra import refractive_index

MOST_NAME = 128  # characters: file systems take 255 bytes
_SOURCED = ("refractive_index", "wavelengths_nm")  # what may have a source of its own, besides parameters

# Directions from which on a call each is faster than one for all wavelengths: they are one row of the kernel then. One
# call and a call each of copper at 8 wavelengths: 278 and 637 ns a value at 256 directions, 293 and 204 at 16384
_MANY = 2000


class Material(BaseModel):
    """One material: a model, its parameters in the units of the model, and where each number comes from.

    Attributes
    ----------
    name : str
        Slug of lower-case words joined by hyphens.
    model : str
        Key of `brdfdb.models.MODELS`.
    parameters : dict
        All parameters of the model in its units (angles in radians), those left out filled in by their defaults.
    source : str
        Paper and table, figure or section of every value that is not in `sources`.
    sources : dict
        Where single values come from, where that is another place.
    assumed : dict of str to Assumption
        Values that the paper does not print, by parameter: why ours was chosen, and what the alternatives would give.
    refractive_index : str or None
        ``shelf/book/page`` for `brdfdb.spectra.refractive_index`; spectral models have one, no other model has.
    wavelengths_nm : tuple of float or None
        The wavelengths [nm] that the paper's parameters are stated for; None if the model may be used at any.
    known_excess : KnownExcess or None
        Set where the published parameters are known to break energy conservation.

    Raises
    ------
    ValueError
        For an unknown model, a missing, unknown or out-of-range parameter, a source or an assumption about a value
        that the material does not have, a known excess that rests on an assumption.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str = Field(pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$", max_length=MOST_NAME)
    title: Text
    model: str
    parameters: dict[str, Number]
    source: Text
    sources: dict[str, Text] = {}
    assumed: dict[str, Assumption] = {}
    note: Words = ""
    refractive_index: str | None = Field(default=None, pattern=r"^[^/]+/[^/]+/[^/]+$")
    wavelengths_nm: Annotated[tuple[float, ...], Field(fail_fast=True)] | None = Field(default=None, min_length=1)
    known_excess: KnownExcess | None = None

    @classmethod
    def from_table(cls, name: str, table: Mapping[str, Any]) -> Material:
        """The material that a table of a TOML file describes; MaterialError if it does not.

        Parameters, and their names in sources and assumed, are read as `file_parameters` writes them: angles in
        degrees, under names that end in ``_deg``.
        """
        fields = {**table, "name": name}
        model, parameters = table.get("model"), table.get("parameters", {})
        try:
            if isinstance(model, str) and model in MODELS and isinstance(parameters, Mapping):
                fields["parameters"] = _from_file(MODELS[model], parameters)
                own = {written_name(parameter): parameter.name for parameter in MODELS[model].parameters}
                most = len(own) + len(_SOURCED)
                for field in ("sources", "assumed"):
                    if isinstance(stated := table.get(field), Mapping):
                        if len(stated) > most:  # pydantic would keep an error for each of a million
                            raise ParameterError(
                                field,
                                f"{len(stated)} are given, {model} has {most} values at most",
                                len(stated),
                                (0, most),
                            )
                        fields[field] = {own.get(written, written): each for written, each in stated.items()}
            return cls.model_validate(fields)
        except ValidationError as error:
            (field, sentence), *others = map(_field_and_sentence, error.errors())
            sentences = [sentence, *(f"{field}: {sentence}" for field, sentence in others)]
            raise MaterialError(name, field, "; ".join(sentences)) from None
        except ParameterError as error:
            raise MaterialError(name, error.parameter, error.sentence, error.value, error.allowed) from None

    @field_validator("model")
    @classmethod
    def _check_model(cls, model: str) -> str:
        if model not in MODELS:
            raise ParameterError("model", f"{model!r} is not one of {', '.join(MODELS)}", model, tuple(MODELS))
        return model

    @field_validator("parameters")
    @classmethod
    def _check_parameters(cls, parameters: dict[str, Number], info: ValidationInfo) -> dict[str, Number]:
        if "model" not in info.data:  # an unknown model has been reported already
            return parameters
        return _complete(MODELS[info.data["model"]], parameters)

    @field_validator("wavelengths_nm")
    @classmethod
    def _check_wavelengths(cls, wavelengths_nm: tuple[float, ...] | None) -> tuple[float, ...] | None:
        if wavelengths_nm is not None and not (wavelengths_nm[0] > 0.0 and np.all(np.diff(wavelengths_nm) > 0.0)):
            raise ParameterError(
                "wavelengths_nm", f"{list(wavelengths_nm)} must be positive and increasing", wavelengths_nm
            )
        return wavelengths_nm

    @model_validator(mode="after")
    def _check_provenance(self) -> Material:
        if self.spectral and self.refractive_index is None:
            raise ParameterError("refractive_index", f"the spectral model {self.model} needs an entry, shelf/book/page")
        if not self.spectral and (self.refractive_index, self.wavelengths_nm) != (None, None):
            raise ParameterError(
                "refractive_index, wavelengths_nm", f"the model {self.model} is not spectral and has neither"
            )
        values = (*self.parameters, *_SOURCED)
        alternatives = (
            name for each in self.assumed.values() for other in each.alternatives for name in other.parameters
        )
        written = (*map(written_name, self.spec.parameters), *_SOURCED)
        for field, names, allowed in (
            ("sources", self.sources, values),
            ("assumed", self.assumed, values),
            ("assumed alternatives", alternatives, written),
        ):
            for name in names:
                if name not in allowed:
                    raise ParameterError(field, f"{name!r} is not one of {', '.join(allowed)}", name, tuple(allowed))
        for name, assumption in self.assumed.items():
            if self.known_excess is not None and assumption.decides is not False:
                raise ParameterError("known_excess", f"it rests on {name!r}, which is assumed and not published")
        return self

    @property
    def spec(self) -> ModelSpec:
        """The specification of the material's model."""
        return MODELS[self.model]

    @property
    def spectral(self) -> bool:
        """Whether the BRDF depends on the wavelength."""
        return self.spec.spectral

    @property
    def anisotropic(self) -> bool:
        """Whether the BRDF changes when the surface is turned about its normal."""
        if self.spec.anisotropic is not None:
            return self.spec.anisotropic(self.parameters)
        axes = self.spec.lobe_axes
        return axes is not None and self.parameters[axes[0]] != self.parameters[axes[1]]

    def evaluated_at(self, wavelength_nm: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Where a picture at some wavelengths [nm] evaluates the material: there, but for models that are not spectral.

        One whose parameters are stated for some wavelengths, which make no colour, is evaluated at the first of them.
        """
        if not self.spectral:
            return None
        return wavelength_nm if self.wavelengths_nm is None else np.array(self.wavelengths_nm[:1])

    def arguments(self, wavelength_nm: ArrayLike | None = None) -> dict[str, Any]:
        """Keyword arguments of the model call, angles apart.

        Parameters
        ----------
        wavelength_nm : array_like [nm], optional
            Wavelengths for a spectral model; by default those that the parameters are stated for. Other models
            do without.

        Returns
        -------
        dict
            The parameters; for a spectral model also ``wavelength_nm`` [nm], ``n`` and ``k`` [1], float64 arrays of
            one shape.

        Raises
        ------
        ValueError
            If a spectral model is left without wavelengths, or its refractive index is not known at one of them.
        """
        if self.refractive_index is None:
            return dict(self.parameters)
        if wavelength_nm is None:
            wavelength_nm = self.wavelengths_nm
        if wavelength_nm is None:
            raise ParameterError("wavelength_nm", f"{self.name} needs wavelengths, its model {self.model} is spectral")
        wavelength = np.asarray(wavelength_nm, dtype=np.float64)
        n, k = refractive_index(self.refractive_index, wavelength)
        return {**self.parameters, "wavelength_nm": wavelength, "n": n, "k": k}

    def brdf_at(
        self, wavelength_nm: NDArray[np.float64] | None, vectors: Callable[..., Floats] | None = None
    ) -> Callable[[Floats, Floats], Floats]:
        """Return f_r of the model as a function of directions alone, with the spectra looked up once.

        Parameters
        ----------
        wavelength_nm : array of shape (L,) [nm], or None
            For spectral models, and only for them.
        vectors : callable, optional
            Takes the arguments of the model and stands for it, such as an approximation.

        Returns
        -------
        callable
            ``brdf(wi, wr)``: f_r [1/sr], shape (N, L), L = 1 of a grey material, of unit vectors of shape (N, 3).

        Raises
        ------
        ValueError
            If the refractive index is not known at one of the wavelengths.
        """
        f_r, together = vectors or self.spec.vectors, self.arguments(wavelength_nm)
        if wavelength_nm is None:
            return lambda wi, wr: f_r(wi, wr, **together)[:, np.newaxis]
        each = _each(together)

        def brdf(wi: Floats, wr: Floats) -> Floats:
            if len(each) > 1 and len(wi) < _MANY:
                return f_r(wi[:, np.newaxis], wr[:, np.newaxis], **together)
            return np.stack([f_r(wi, wr, **arguments) for arguments in each], axis=-1)

        return brdf

    def lookup(
        self,
        theta_i: ArrayLike,
        phi_i: ArrayLike,
        theta_r: ArrayLike,
        phi_r: ArrayLike,
        wavelength_nm: ArrayLike | None = None,
    ) -> Floats:
        """f_r of the model itself, where `brdfdb.tables.table.Table.lookup` gives that of its table.

        Parameters
        ----------
        theta_i, phi_i, theta_r, phi_r : array_like [rad]
            Directions of light and viewer; they broadcast.
        wavelength_nm : float or array_like (M,) [nm], optional
            As in `arguments`. Models that are not spectral take any.

        Returns
        -------
        array [1/sr]
            In the shape of the angles, with a last axis for a list of wavelengths.

        Raises
        ------
        ValueError
            As the model and `arguments` do.
        """
        return self._spectrum(self.spec.evaluate, (theta_i, phi_i, theta_r, phi_r), wavelength_nm, None)

    def specular_reflectance(self, theta_i: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats:
        """Reflectance [1] of the Dirac part of the model at theta_i [rad], 0 if it has none; shaped as by `lookup`."""
        if self.spec.specular is None:
            wavelengths = () if wavelength_nm is None else np.shape(wavelength_nm)
            return np.zeros((*np.shape(theta_i), *wavelengths))[()]
        return self._spectrum(self.spec.specular, (theta_i,), wavelength_nm, self.spec.specular_parameters)

    def _spectrum(
        self,
        function: Callable[..., Floats],
        angles: tuple[ArrayLike, ...],
        wavelength_nm: ArrayLike | None,
        names: tuple[str, ...] | None,
    ) -> Floats:
        """A function of angles and parameters (`names` of them, or all), wavelength by wavelength on a last axis."""
        if not self.spectral:
            value = function(*angles, **self.parameters)
            if wavelength_nm is None or np.ndim(wavelength_nm) == 0:
                return value
            return np.repeat(np.asarray(value)[..., np.newaxis], np.size(wavelength_nm), axis=-1)
        given = self.arguments(wavelength_nm)
        used = given if names is None else {name: given[name] for name in names}
        if given["wavelength_nm"].ndim == 0:
            return function(*angles, **used)
        return np.stack([function(*angles, **arguments) for arguments in _each(used)], axis=-1)

    def file_parameters(self) -> dict[str, Number]:
        """The parameters as a human reads and writes them: angles in degrees, under names that end in ``_deg``."""
        written: dict[str, Number] = {}
        for parameter in self.spec.parameters:
            value = self.parameters[parameter.name]
            # twelve digits: degrees to radians and back moves the last one
            written[_as_written(parameter).name] = float(f"{degrees(value):.12g}") if parameter.unit == "rad" else value
        return written


def presets() -> dict[str, Material]:
    """All materials of the papers by name, in the order of the files and of the tables in them.

    The files are read and checked once a process; the dict is the caller's own.
    """
    return dict(_presets())


def _each(arguments: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The arguments of a spectral model at each wavelength."""
    return [
        {name: value[w] if np.ndim(value) else value for name, value in arguments.items()}
        for w in range(arguments["wavelength_nm"].size)
    ]


@cache
def _presets() -> dict[str, Material]:
    materials: dict[str, Material] = {}
    files = (file for file in resources.files(__name__).iterdir() if file.name.endswith(".toml"))
    for file in sorted(files, key=lambda file: file.name):
        for name, table in tomllib.loads(file.read_text(encoding="utf-8")).items():
            if name in materials:
                raise ParameterError(file.name, f"the material {name!r} is in another file too")
            materials[name] = Material.from_table(name, table)
    return materials


def written_name(parameter: Parameter) -> str:
    """The name of a parameter in files: that of an angle, which they give in degrees, ends in ``_deg``."""
    return f"{parameter.name}_deg" if parameter.unit == "rad" else parameter.name


def _as_written(parameter: Parameter) -> Parameter:
    """A parameter as it appears in files: an angle in degrees, under a name that ends in ``_deg``."""
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


def _from_file(spec: ModelSpec, written: Mapping[str, Any]) -> dict[str, Number]:
    """Parameters in the units of the model, from those in a file."""
    file_spec = replace(spec, parameters=tuple(_as_written(parameter) for parameter in spec.parameters))
    values = _complete(file_spec, written).values()
    return {
        parameter.name: float(radians(value)) if parameter.unit == "rad" else value
        for parameter, value in zip(spec.parameters, values, strict=True)
    }


def _complete(spec: ModelSpec, parameters: Mapping[str, Any]) -> dict[str, Number]:
    """Checked parameters in the order of the model, defaults filled in."""
    names = [parameter.name for parameter in spec.parameters]
    for name, value in parameters.items():
        if name not in names:
            hint = "; wavelength_nm, n and k come from refractive_index" if spec.spectral else ""
            raise ParameterError(
                name,
                f"{value!r} given, but the parameters of {spec.name} are {', '.join(names)}{hint}",
                value,
                tuple(names),
            )
    complete: dict[str, Number] = {}
    for parameter in spec.parameters:
        value = parameters.get(parameter.name, parameter.default)
        if value is None:
            raise ParameterError(
                parameter.name,
                f"missing, {spec.name} needs a value in {parameter.interval}",
                None,
                (parameter.low, parameter.high),
            )
        switch = isinstance(parameter.default, bool)
        if not isinstance(value, int | float) or isinstance(value, bool) != switch:
            raise ParameterError(parameter.name, f"{value!r} is not {'true or false' if switch else 'a number'}", value)
        parameter.check(value)
        complete[parameter.name] = value
    return complete


def _field_and_sentence(error: ErrorDetails) -> tuple[str, str]:
    """Return the field that pydantic finds fault with, and the sentence; our own errors name the field themselves."""
    ours = error["ctx"]["error"] if error["type"] == "value_error" else error["msg"]
    if isinstance(ours, ParameterError):
        return ours.parameter, ours.sentence
    return ".".join(map(str, error["loc"])), str(ours)
