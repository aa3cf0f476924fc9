"""Metadata of a table: its origin and its errors, as one typed record of the attributes of its zarr group."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PlainSerializer, PrivateAttr, ValidationError

from brdfdb.errors import ParameterError, sentence_of
from brdfdb.materials.provenance import Assumption, KnownExcess
from brdfdb.materials.spectrum import Spectrum
from brdfdb.measurements.record import Measured
from brdfdb.tables.layout import Interpolation
from brdfdb.tables.stated_error import Error, FormulaError, LargestAlbedo
from brdfdb.tables.stokes import Polarisation

MANTISSA_BITS = 23  # of a float32 value

# Attributes without which a table cannot be interpreted
REQUIRED = ("title", "material", "table_version", "model", "model_version", "parameters", "source", "conventions")
_OF_MODELS = ("model", "model_version", "parameters")
# Attributes that cite: only a record of the source proves that the table is of the cited material
_CITING = (
    "model_title",
    "model_equation",
    "model_reference",
    "parameter_sources",
    "source",
    "assumed",
    "note",
    "known_excess",
)


def _assumptions(value: Any) -> Any:
    """Return assumptions by parameter; tables built before assumptions had reasons list the parameters alone."""
    return dict.fromkeys(value) if isinstance(value, list) else value


def _or_empty(schema: dict[str, Any]) -> None:
    """Let a JSON Schema allow an empty object, too."""
    schema["anyOf"].append({"type": "object", "maxProperties": 0})


class TableMetadata(BaseModel):
    """The attributes of a table.

    Any of them may be missing: other programs publish tables, too. `read` never fails, and `gaps` names what is
    missing or not what it must be.
    """

    model_config = ConfigDict(frozen=True, json_schema_extra={"required": list(REQUIRED)})

    title: str | None = Field(default=None, description="one line that names the material for people")
    material: str | None = Field(default=None, description="name of the material")
    table_version: int | None = Field(default=None, description="version of the variables, dimensions and attributes")
    model: str | None = Field(default=None, description="name of the model")
    model_version: int | None = Field(default=None, description="raised when the values of the model change")
    model_title: str | None = Field(default=None, description="authors and subject of the model")
    model_equation: str | None = Field(default=None, description="equations of the paper that are evaluated")
    model_reference: str | None = Field(default=None, description="key of the paper in references.bib")
    parameters: dict[str, bool | float | Spectrum] = Field(
        default_factory=dict,
        description="of the model, as files write them: angles in degrees, under names in _deg; a reflectance may be a "
        "spectrum",
    )
    parameter_sources: dict[str, str] = Field(default_factory=dict, description="where each parameter is printed")
    source: str | None = Field(default=None, description="paper and table, figure or section of the parameters")
    assumed: Annotated[dict[str, Assumption | None], BeforeValidator(_assumptions)] = Field(
        default_factory=dict,
        description="parameters that the source does not print, and why they were chosen; null: the note says why",
    )
    note: str = Field(default="", description="remarks on the parameters")
    refractive_index: str = Field(default="", description="entry of refractiveindex.info that n and k are of, or empty")
    known_excess: Annotated[
        KnownExcess | None,
        BeforeValidator(lambda value: value or None),
        PlainSerializer(lambda known: {} if known is None else known.model_dump(mode="json")),
    ] = Field(
        default=None,
        description="a published excess of the albedo over 1; an empty object without one",
        json_schema_extra=_or_empty,
    )
    source_record: dict[str, Any] | None = Field(
        default=None,
        description="the source complete: a material in the units of its model, or what is known of a function",
    )
    measured: Measured | None = Field(
        default=None, description="origin, symmetries and errors of measured data; null: the values are a model's"
    )
    conventions: str | None = Field(default=None, description="the meaning of the angles and of f_r, in words")
    anisotropic: bool | None = Field(default=None, description="true if the azimuth of the light counts")
    symmetries: list[str] = Field(default_factory=list, description="what the table leaves out or repeats, in words")
    wavelength_range_nm: list[float] = Field(
        default_factory=list, description="first and last wavelength [nm]; empty for a grey table"
    )
    interpolation: Interpolation = Field(
        default=Interpolation(), description="the way from the numbers stored at nodes to f_r"
    )
    part_wavelengths_nm: list[float] = Field(
        default_factory=list, description="of a mixture, the wavelengths at which its parts are f_r; else empty"
    )
    bits: int = Field(default=MANTISSA_BITS, ge=1, le=MANTISSA_BITS, description="bits of the mantissa that are kept")
    reconstruction: str | None = Field(default=None, description="the formula for f_r, in one line")
    reason: str = Field(default="", description="why the planner laid the table out so; empty for a grid of a recipe")
    request: dict[str, Any] | None = Field(
        default=None, description="the request of the build that made the table, but for what source_record says"
    )
    request_sha256: str | None = Field(default=None, description="sha256 of the whole request")
    error: Error | None = Field(default=None, description="the stated error; null: not measured")
    polarisation: Polarisation | None = Field(
        default=None, description="Mueller matrices of the table, and their stated error; null: it is unpolarised"
    )
    formula_error: FormulaError | None = Field(
        default=None, description="error of the model against the highest rung of its surface; null: not measured"
    )
    largest_albedo: LargestAlbedo | None = Field(
        default=None,
        description="largest directional albedo of the model, or of a table without one, specular part included, and "
        "its growth at grazing light; null: not measured",
    )

    _strange: dict[str, str] = PrivateAttr(default_factory=dict)
    _uncited: tuple[str, ...] = PrivateAttr(default=())

    @classmethod
    def read(cls, attributes: Mapping[str, Any]) -> TableMetadata:
        """Return the metadata that attributes hold; an attribute that is not valid is left out.

        What a table cites is left out, too, unless it keeps a record of its source, or of measured data.
        """
        known = {key: attributes[key] for key in cls.model_fields if key in attributes}
        records = [attributes.get(key) for key in ("source_record", "request")]  # tables kept the source in the request
        of_source = any(isinstance(record, Mapping) and {"material", "function"} & record.keys() for record in records)
        uncited = (
            () if of_source or attributes.get("measured") else tuple(key for key in _CITING if known.pop(key, None))
        )
        strange: dict[str, str] = {}
        try:
            metadata = cls.model_validate(known)
        except ValidationError as error:
            strange = {str(item["loc"][0]): sentence_of(item) for item in error.errors(include_url=False)}
            metadata = cls.model_validate({key: value for key, value in known.items() if key not in strange})
        metadata._strange.update(strange)
        metadata._uncited = uncited
        return metadata

    def attributes(self) -> dict[str, Any]:
        """Return the attributes to store, ready for JSON; those that are not known are left out."""
        return {key: value for key, value in self.model_dump(mode="json").items() if value is not None}

    @property
    def strange(self) -> dict[str, str]:
        """The attributes that are not valid, each with the reason."""
        return self._strange

    @property
    def uncited(self) -> tuple[str, ...]:
        """The attributes that cite, and that no record of the source supports: they are left out."""
        return self._uncited

    @property
    def of_function(self) -> bool:
        """Return True if the table was tabulated from a function, which has no model."""
        return "function" in (self.source_record or {})

    @property
    def missing(self) -> list[str]:
        """The required attributes that the table does not have."""
        needed = [key for key in REQUIRED if key not in _OF_MODELS] if self.of_function else REQUIRED
        known = {*self.model_fields_set, *self.strange, *self.uncited}
        return [key for key in needed if key not in known]

    def without_source(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """Return a request as a table stores it, without the entries that the source record repeats."""
        record = self.source_record or {}
        return {key: value for key, value in request.items() if key not in record or record[key] != value}

    @property
    def whole_request(self) -> dict[str, Any]:
        """The request with the entries of the source record; empty if the table stores none."""
        return {} if self.request is None else {**(self.source_record or {}), **self.request}

    def known_interpolation(self) -> Interpolation:
        """Return the interpolation; ValueError if it is one that this program does not know."""
        if "interpolation" in self.strange:
            raise ParameterError("interpolation", self.strange["interpolation"])
        return self.interpolation

    def known_measured(self) -> Measured | None:
        """Return the record of measured data; ParameterError if it is one that this program does not know."""
        if "measured" in self.strange:
            why = f"its record is of another version, or damaged ({self.strange['measured']})"
            raise ParameterError("measured", f"{why}; import or build the table anew")
        return self.measured

    @property
    def gaps(self) -> str:
        """A phrase that names the missing and the invalid attributes; empty for a complete record."""
        phrases = [f"does not state its {', '.join(map(_words, self.missing))}"] if self.missing else []
        phrases += [f"states its {_words(key)} wrongly ({why})" for key, why in self.strange.items()]
        return ", and ".join(phrases)


def _words(key: str) -> str:
    return key.replace("_", " ")
