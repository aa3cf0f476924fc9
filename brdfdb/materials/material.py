"""Model materials: a model, its parameters, and where each number comes from."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    PrivateAttr,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic_core import ErrorDetails

from brdfdb.arrays import array_lookup
from brdfdb.errors import MaterialError, ParameterError, sentence_of
from brdfdb.geometry import degrees
from brdfdb.lobes import Lobe
from brdfdb.materials.provenance import MOST_NAME, NAME_PATTERN, Assumption, KnownExcess, Number, Text, Words
from brdfdb.materials.source import (
    Evaluate,
    FourAngles,
    Lookups,
    Lossless,
    RefractiveIndices,
    check_wavelengths,
    no_specular_part,
)
from brdfdb.materials.spectrum import Spectrum, assumptions, made_lossless
from brdfdb.materials.written_parameters import completed, from_file, written_name
from brdfdb.models import MODELS
from brdfdb.notebook import card, listed, spectrum
from brdfdb.parameters import Floats, ModelSpec, check_nanometres
from brdfdb.refractive_indices import refractive_index

_SOURCED = ("refractive_index", "wavelengths_nm")  # fields besides parameters that may have an entry in `sources`


class Material(BaseModel, Lookups):
    """One material: a model, its parameters in the units of the model, and where each number comes from.

    Attributes
    ----------
    name : str
        Slug of lower-case words joined by hyphens.
    model : str
        Key of `brdfdb.models.MODELS`.
    parameters : dict
        All parameters of the model in its units (angles in radians), with defaults for missing ones. A reflectance is
        a number or a `Spectrum`.
    source : str
        Paper and table, figure or section of every value that is not in `sources`.
    sources : dict
        Provenance of single values that come from another place than `source`.
    assumed : dict of str to Assumption
        Values that the paper does not print, by parameter: the reason for the value, and the results of alternatives.
    refractive_index : str or None
        ``shelf/book/page`` for `brdfdb.refractive_indices`; spectral models have an entry, no other model has.
    wavelengths_nm : tuple of float or None
        Wavelengths [nm] for which the parameters are stated; None if the material may be used at any wavelength. A
        grey material has none.
    known_excess : KnownExcess or None
        The published excess, if the published parameters are known to violate energy conservation.

    Raises
    ------
    ParameterError
        If the model is unknown, if a parameter is missing, unknown or out of range, if a source or an assumption is
        about a value that the material does not have, or if a known excess rests on an assumption. pydantic reports it
        in its ValidationError; both are ValueErrors.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")
    reciprocal: ClassVar[bool] = True  # of all models that are tabulated; the audit measures it

    name: str = Field(pattern=NAME_PATTERN, max_length=MOST_NAME)
    title: Text
    model: str
    parameters: dict[str, Number | Spectrum]
    source: Text
    sources: dict[str, Text] = {}
    assumed: dict[str, Assumption] = {}
    note: Words = ""
    refractive_index: str | None = Field(default=None, pattern=r"^[^/]+/[^/]+/[^/]+$")
    wavelengths_nm: Annotated[tuple[float, ...], Field(fail_fast=True)] | None = Field(default=None, min_length=1)
    known_excess: KnownExcess | None = None

    # Arguments of the model that replace those of the material: for its lossless form, or without its uniform part
    _changed: dict[str, float | Spectrum | NDArray[np.float64]] = PrivateAttr(default_factory=dict)

    @classmethod
    def from_table(cls, name: str, table: Mapping[str, Any], folder: Path | None = None) -> Material:
        """Return the material that a TOML table describes; MaterialError if it describes none.

        Parameters, and their names in sources and assumed, are read as `file_parameters` writes them: angles are in
        degrees, under names that end in ``_deg``. A reflectance may be a spectrum, in one of the ways of
        `brdfdb.materials.spectrum.spectrum_of`; paths of CSV files begin at `folder`.
        """
        fields = {**table, "name": name}
        model = table.get("model")
        parameters = table.get("parameters", {})
        try:
            if isinstance(model, str) and model in MODELS and isinstance(parameters, Mapping):
                fields["parameters"] = from_file(MODELS[model], parameters, table.get("wavelengths_nm"), folder)
                own = {written_name(parameter): parameter.name for parameter in MODELS[model].parameters}
                most = len(own) + len(_SOURCED)
                for field in ("sources", "assumed"):
                    if isinstance(stated := table.get(field), Mapping):
                        if len(stated) > most:  # pydantic would keep an error for each of a million
                            text = f"{len(stated)} are given, {model} has {most} values at most"
                            raise ParameterError(field, text, len(stated), (0, most))
                        fields[field] = {own.get(written, written): value for written, value in stated.items()}
                if isinstance(stated := fields.get("assumed", {}), Mapping):
                    fields["assumed"] = assumptions(fields["parameters"]) | dict(stated)
            return cls.model_validate(fields)
        except ValidationError as error:
            first, *others = map(_parameter_error, error.errors())
            raise MaterialError(name, first.parameter, "; ".join([first.sentence, *map(str, others)])) from None
        except ParameterError as error:
            raise MaterialError(name, error.parameter, error.sentence, error.value, error.allowed) from None

    @field_validator("model")
    @classmethod
    def _check_model(cls, model: str) -> str:
        return MODELS[model].name

    @field_validator("parameters")
    @classmethod
    def _check_parameters(
        cls, parameters: dict[str, Number | Spectrum], info: ValidationInfo
    ) -> dict[str, Number | Spectrum]:
        if "model" not in info.data:  # an unknown model has been reported already
            return parameters
        return completed(MODELS[info.data["model"]], parameters)

    _check_wavelengths = field_validator("wavelengths_nm")(check_wavelengths)

    @model_validator(mode="after")
    def _check_provenance(self) -> Material:
        if self.spec.spectral and self.refractive_index is None:
            raise ParameterError("refractive_index", f"the spectral model {self.model} needs an entry, shelf/book/page")
        if not self.spec.spectral and self.refractive_index is not None:
            raise ParameterError("refractive_index", f"the model {self.model} takes none")
        if not self.spectral and self.wavelengths_nm is not None:
            text = f"the model {self.model} is grey, and no parameter is a spectrum; leave them out"
            raise ParameterError("wavelengths_nm", text)
        for name, spectrum_of_it in self.spectra.items():
            if self.wavelengths_nm is not None:
                spectrum_of_it.at(name, np.array(self.wavelengths_nm))
        values = (*self.parameters, *_SOURCED)
        alternatives = (
            name
            for assumption in self.assumed.values()
            for other in assumption.alternatives
            for name in other.parameters
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
    def numbers(self) -> dict[str, Number]:
        """Return the parameters that are numbers, in the units of the model: all but the spectra."""
        return {name: value for name, value in self.parameters.items() if not isinstance(value, Spectrum)}

    @property
    def spectra(self) -> dict[str, Spectrum]:
        """Return the parameters that are spectra."""
        return {name: value for name, value in self.parameters.items() if isinstance(value, Spectrum)}

    @property
    def provenance(self) -> str:
        """Return the paper and table, figure or section of the values."""
        return self.source

    @property
    def spectral(self) -> bool:
        """Return True if f_r depends on the wavelength."""
        return self.spec.spectral or bool(self.spectra)

    @property
    def anisotropic(self) -> bool:
        """Return True if f_r changes when the surface is turned about its normal."""
        if self.spec.anisotropic is not None:
            return self.spec.anisotropic(self.parameters)
        return self.spec.lobe_axes is not None and len({self.parameters[axis] for axis in self.spec.lobe_axes}) > 1

    @property
    def elliptical(self) -> bool:
        """Return True if f_r has the symmetry of an ellipse, with axes along x and y."""
        return self.spec.lobe_axes is not None

    @property
    def grazing_pole(self) -> bool:
        """Return True if f_r grows without bound as a direction reaches 90 degrees."""
        return self.spec.grazing_pole

    def grazing_power(self, wavelength_nm: NDArray[np.float64] | None) -> float | None:
        """Return the power that the model declares, at least 0, or None: see `ModelSpec.grazing_power`."""
        declared = self.spec.grazing_power
        return float(declared(self.arguments(wavelength_nm))) if callable(declared) else declared

    @property
    def has_lobe(self) -> bool:
        """Return True if the model has a lobe around the mirror direction."""
        return self.spec.lobe is not None

    @property
    def has_specular(self) -> bool:
        """Return True if the model has a specular part (a Dirac delta)."""
        return self.spec.specular is not None

    def uniform_at(self, wavelength_nm: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
        """Return the uniform part of f_r [1/sr]: shape (L,) if it is a spectrum, else (1,); None if none is named."""
        if self.spec.uniform is None:
            return None
        value = self.parameters[self.spec.uniform]
        if isinstance(value, Spectrum):
            value = self.arguments(wavelength_nm)[self.spec.uniform]
        return np.atleast_1d(np.asarray(value) / np.pi)

    def without_uniform(self) -> Material:
        """Return the material without its uniform part."""
        return self if self.spec.uniform is None else self.changed({self.spec.uniform: 0.0})

    @property
    def lossless(self) -> Lossless | None:
        """Return the material with nothing absorbed; None if no parameters of the model do that."""
        if self.spec.lossless is None:
            return None
        changes = made_lossless(self.spec.lossless, self.parameters)
        return Lossless(self.changed(changes), changes)

    def changed(self, changes: Mapping[str, float | Spectrum | NDArray[np.float64]]) -> Material:
        """Return the material with other arguments of its model, such as n and k [1] at the wavelengths of a table."""
        changed = self.model_copy()
        changed._changed = {**self._changed, **changes}
        return changed

    def evaluated_at(self, wavelength_nm: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return the wavelengths [nm] at which a picture at some wavelengths evaluates the material; None if grey.

        A material that is stated for a few wavelengths, too few for a colour, is evaluated at the first of them.
        """
        if not self.spectral:
            return None
        return wavelength_nm if self.wavelengths_nm is None else np.array(self.wavelengths_nm[:1])

    def arguments(self, wavelength_nm: ArrayLike | None = None) -> dict[str, Any]:
        """Return the keyword arguments of the model call, without the angles.

        A spectrum is an array in the shape of the wavelengths [nm], which are by default those of the material; grey
        materials ignore them. A spectral model also has ``wavelength_nm`` [nm], ``n`` and ``k`` [1] of that shape.
        ParameterError says that wavelengths are missing, or that n and k or a spectrum are not known at one.
        """
        given = {**self.parameters, **self._changed}
        if not self.spectral:
            return given
        wavelength_nm = self.wavelengths_nm if wavelength_nm is None else wavelength_nm
        if wavelength_nm is None:
            reason = f"its model {self.model} is spectral" if self.spec.spectral else "a parameter is a spectrum"
            raise ParameterError("wavelength_nm", f"{self.name} needs wavelengths, {reason}")
        wavelength = check_nanometres("wavelength_nm", wavelength_nm)
        arguments: dict[str, Any] = {
            name: value.at(name, wavelength) if isinstance(value, Spectrum) else value for name, value in given.items()
        }
        if self.refractive_index is None:
            return arguments
        if {"n", "k"} <= self._changed.keys():  # the entry takes half a second to load
            return arguments | {"wavelength_nm": wavelength}
        n, k = refractive_index(self.refractive_index, wavelength)
        return {**arguments, "wavelength_nm": wavelength, "n": arguments.get("n", n), "k": arguments.get("k", k)}

    def brdf_at(
        self,
        wavelength_nm: NDArray[np.float64] | None,
        vectors: Callable[..., Floats] | None = None,
        degree: int | None = None,
    ) -> Evaluate:
        """Return f_r [1/sr] of the model as a function of directions alone, with the refractive index looked up once.

        ``brdf(wi, wr)`` gives f_r of shape (N, L) for unit vectors (N, 3). `wavelength_nm` (L,) [nm] is None for a grey
        material, whose L is 1. `vectors` replaces the model, for example by an approximation with the same arguments,
        and `degree` is its degree as a polynomial in the reflectances, as `ModelSpec.degree`. ParameterError if the
        refractive index or a spectrum is not known at one of the wavelengths.
        """
        f_r = vectors or self.spec.vectors
        together = self.arguments(wavelength_nm)
        if wavelength_nm is None:
            return lambda wi, wr: f_r(wi, wr, **together)[:, np.newaxis]
        if self.refractive_index is None:
            of = degree if vectors else self.spec.degree
            return evaluations(self.spec, together, wavelength_nm.size, of).summed(f_r)
        # one row of the kernel a wavelength, because rows share what directions alone decide
        rows = {name: np.broadcast_to(value, wavelength_nm.shape)[:, np.newaxis] for name, value in together.items()}
        return lambda wi, wr: np.moveaxis(f_r(wi, wr, **rows), 0, -1)

    def _at_angles(self, angles: FourAngles, wavelength_nm: ArrayLike | None) -> Floats:
        return self._spectrum(self.spec.evaluate, angles, wavelength_nm, None)

    @array_lookup
    def lookup_vectors(self, wi: ArrayLike, wr: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats:
        return self._spectrum(self.spec.vectors, (wi, wr), wavelength_nm, None)

    @array_lookup
    def specular_reflectance(self, theta_i: ArrayLike, wavelength_nm: ArrayLike | None = None) -> Floats:
        """Return the reflectance [1] of the specular part at theta_i [rad], 0 without one; shaped as by `lookup`."""
        if self.spec.specular is None:
            return no_specular_part(theta_i, wavelength_nm)
        return self._spectrum(self.spec.specular, (theta_i,), wavelength_nm, self.spec.specular_parameters)

    def _spectrum(
        self,
        function: Callable[..., Floats],
        angles: tuple[ArrayLike, ...],
        wavelength_nm: ArrayLike | None,
        names: tuple[str, ...] | None,
    ) -> Floats:
        """Evaluate a function of angles and parameters (all, or those in `names`). Wavelengths are the last axis."""
        wavelength_nm = None if wavelength_nm is None else check_nanometres("wavelength_nm", wavelength_nm)
        if not self.spectral:
            value = function(*angles, **self.arguments())
            if wavelength_nm is None or np.ndim(wavelength_nm) == 0:
                return value
            return np.repeat(np.asarray(value)[..., np.newaxis], np.size(wavelength_nm), axis=-1)
        given = self.arguments(wavelength_nm)
        used = given if names is None else {name: given[name] for name in names}
        shape = np.shape(self.wavelengths_nm or () if wavelength_nm is None else wavelength_nm)
        sets = [used]
        if shape:
            sets = [{name: v[w] if np.ndim(v) else v for name, v in used.items()} for w in range(shape[0])]
        values = [function(*angles, **arguments) for arguments in sets]
        return np.stack(values, axis=-1) if shape else values[0]

    def lobe(self, cos_i: Floats, wavelength_nm: NDArray[np.float64] | None) -> Lobe | None:
        """Return the lobe for lights with the cosine cos_i, which broadcasts with wavelengths [nm]; None if diffuse."""
        return None if self.spec.lobe is None else self.spec.lobe(cos_i, **self.arguments(wavelength_nm))

    def refractive_indices(self, wavelength_nm: NDArray[np.float64] | None) -> RefractiveIndices | None:
        """Return n and k [1] at wavelengths [nm]; None if the model is not spectral."""
        arguments = {} if self.refractive_index is None else self.arguments(wavelength_nm)
        return RefractiveIndices(arguments["n"], arguments["k"]) if arguments else None

    def file_parameters(self) -> dict[str, Number | Spectrum]:
        """Return the parameters as files write them: angles in degrees, under names ending in ``_deg``."""
        return {
            # Twelve digits, because the conversion from degrees to radians and back changes the last ones
            written_name(parameter): float(f"{degrees(value):.12g}")
            if parameter.unit == "rad" and not isinstance(value, Spectrum)
            else value
            for parameter in self.spec.parameters
            for value in [self.parameters[parameter.name]]
        }

    def attributes(self) -> dict[str, Any]:
        """Return the attributes of the material in its table, with angles in degrees."""
        spec = self.spec
        written = {parameter.name: written_name(parameter) for parameter in spec.parameters}
        sources = {n: v.origin for n, v in self.parameters.items() if isinstance(v, Spectrum)} | self.sources
        return {
            "title": self.title,
            "material": self.name,
            "model": spec.name,
            "model_version": spec.version,
            "model_title": spec.title,
            "model_equation": spec.equation,
            "model_reference": spec.reference,
            "parameters": {
                name: value.model_dump(mode="json") if isinstance(value, Spectrum) else value
                for name, value in self.file_parameters().items()
            },
            "parameter_sources": {in_file: sources.get(name, self.source) for name, in_file in written.items()},
            "source": self.source,
            "assumed": {written.get(n, n): value.model_dump(mode="json") for n, value in self.assumed.items()},
            "note": self.note,
            "refractive_index": self.refractive_index or "",
            "known_excess": self.known_excess.model_dump() if self.known_excess else {},
        }

    def _repr_html_(self) -> str:
        """Return the material for notebooks."""
        facts = [
            ("model", f"{self.spec.title} ({self.spec.equation})"),
            ("parameters", listed(self.file_parameters())),
            ("source", self.source),
            ("assumed", ", ".join(self.assumed)),
            ("refractive index", self.refractive_index or ""),
            ("wavelengths", spectrum(self.wavelengths_nm) if self.wavelengths_nm or not self.spectral else "any"),
            ("note", self.note),
        ]
        return card("Material", self.name, self.title, facts)

    def document(self) -> dict[str, Any]:
        """Return the material as JSON, parameters in the units of the model; `brdfdb.materials.source_of` reads it."""
        material = self.model_dump(mode="json")
        spectra = {name: value.record() for name, value in self.spectra.items()}
        material["parameters"] |= spectra
        return {"model_version": self.spec.version, "material": material}


def _parameter_error(error: ErrorDetails) -> ParameterError:
    """Return an error of pydantic as one that names the field."""
    ours = error["ctx"]["error"] if error["type"] == "value_error" else sentence_of(error)
    return ours if isinstance(ours, ParameterError) else ParameterError(".".join(map(str, error["loc"])), str(ours))


def exact_material(material: Material) -> Material:
    """Return the material with the exact model that its own approximates, or itself if the registry has none.

    Statements about parameters that the exact model lacks are left out, and so is a known excess: it belongs to the
    other model.
    """
    exact = None if material.spec.exact_model is None else material.spec.exact_model(material.parameters)
    if exact is None:
        return material
    model, parameters = exact
    stated = {
        "sources": {name: source for name, source in material.sources.items() if name in parameters},
        "assumed": {name: assumption for name, assumption in material.assumed.items() if name in parameters},
        "known_excess": None,
    }
    return material.model_copy(update={"model": model, "parameters": parameters, **stated})


class Evaluations(NamedTuple):
    """Sets of arguments of a model, all numbers, and weights (sets, wavelengths) that make f_r of their values.

    Without weights there is a set for each wavelength.
    """

    sets: list[dict[str, Any]]
    weights: NDArray[np.float64] | None

    def summed(self, f_r: Callable[..., Floats]) -> Evaluate:
        """Return a function of directions that gives f_r at all wavelengths."""

        def brdf(wi: Floats, wr: Floats) -> Floats:
            values = np.stack([f_r(wi, wr, **arguments) for arguments in self.sets], axis=-1)
            # a BLAS sums in an order that depends on where a row stands: what was symmetric would not stay it
            return values if self.weights is None else np.einsum("...e,el->...l", values, self.weights)

        return brdf


def evaluations(spec: ModelSpec, arguments: Mapping[str, Any], count: int, degree: int | None) -> Evaluations:
    """Return the sets of arguments that make f_r at all wavelengths of a model that takes no wavelength itself.

    A model that is a polynomial of a `degree` in its reflectances takes a few calls; None: it is none. `arguments` are
    numbers, or arrays (L,) of reflectances at `count` wavelengths.
    """
    spectra = {name: np.asarray(value) for name, value in arguments.items() if np.ndim(value)}
    numbers = {name: value for name, value in arguments.items() if name not in spectra}
    if not spectra:
        return Evaluations([numbers], np.ones((1, count)))
    low = {name: spec.parameter(name).low for name in spectra}
    high = {name: spec.parameter(name).high for name in spectra}
    share = {name: (value - low[name]) / (high[name] - low[name]) for name, value in spectra.items()}
    if degree == 1 and count > len(spectra) + 1:
        corners = [numbers | low, *(numbers | low | {name: high[name]} for name in spectra)]
        return Evaluations(corners, np.stack([1.0 - sum(share.values()), *share.values()]))
    pairs = list(itertools.combinations_with_replacement(range(len(spectra) + 1), 2))
    if degree == 2 and count > len(pairs):
        # Lagrange's polynomials through the corners of the simplex and the middles between them
        names = [*spectra]
        corner = np.eye(len(spectra) + 1)[:, 1:]
        middles = [dict(zip(names, 0.5 * (corner[a] + corner[b]), strict=True)) for a, b in pairs]
        sets = [numbers | {name: low[name] + m[name] * (high[name] - low[name]) for name in names} for m in middles]
        s = np.stack([1.0 - sum(share.values()), *share.values()])
        weights = [s[a] * (2.0 * s[a] - 1.0) if a == b else 4.0 * s[a] * s[b] for a, b in pairs]
        return Evaluations(sets, np.stack(weights))
    return Evaluations([numbers | {name: value[w] for name, value in spectra.items()} for w in range(count)], None)
