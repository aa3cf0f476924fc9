"""The document of a model: its parameters as recipes write them, with the values that papers publish."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import asdict
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, WithJsonSchema

from brdfdb.errors import MaterialError, ParameterError
from brdfdb.materials.material import Material
from brdfdb.materials.preset_files import presets
from brdfdb.materials.written_parameters import as_written
from brdfdb.parameters import ModelSpec


class Mark(BaseModel):
    """A value that a paper publishes."""

    material: str
    value: float


class ParameterOfModel(BaseModel):
    """A parameter of a model as recipes write it."""

    name: str
    symbol: str = Field(description="of the paper")
    unit: str
    low: float
    high: float
    meaning: str
    default: float | bool | None = Field(description="null: it must be given")
    reflectance: bool = Field(description="whether it may be a spectrum")
    published: list[Mark] = Field(description="values of the materials that the papers print")
    typical: list[float] | None = Field(description="the smallest and the largest of them; null: none")


class ModelDocument(BaseModel):
    """A model and its parameters."""

    name: str
    version: int
    title: str
    equation: str
    paper: str = Field(description="key of the paper, such as he1991")
    spectral: bool = Field(description="whether it needs a refractive index")
    specular: bool = Field(description="whether it has a specular part")
    parameters: list[ParameterOfModel]


@functools.cache
def document_of(spec: ModelSpec) -> dict[str, Any]:
    """Return the fields of `ModelDocument`."""
    papers = [(name, material.file_parameters()) for name, material in presets().items() if material.model == spec.name]
    parameters = []
    for parameter in map(as_written, spec.parameters):
        values = [(name, written[parameter.name]) for name, written in papers]
        marks = [{"material": name, "value": float(value)} for name, value in values if isinstance(value, float | int)]
        ends: list[Any] = [mark["value"] for mark in marks]
        typical = [min(ends), max(ends)] if ends else None
        parameters.append({**asdict(parameter), "published": marks, "typical": typical})
    return {
        **{key: getattr(spec, key) for key in ("name", "version", "title", "equation", "spectral")},
        "paper": spec.reference,
        "specular": spec.specular is not None,
        "parameters": parameters,
    }


class Parameters(BaseModel):
    """A material as recipes define it: angles in degrees under names in _deg."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"example": {"parameters": {"rho": 0.5}}})

    parameters: Annotated[
        dict[str, Any],
        WithJsonSchema(
            {
                "type": "object",
                "additionalProperties": {"anyOf": [{"type": "number"}, {"type": "boolean"}, {"type": "object"}]},
            }
        ),
    ] = Field(description="by name, as recipes write them; a reflectance may be a spectrum")
    refractive_index: str | None = Field(
        default=None, description="of a spectral model: SHELF/BOOK/PAGE, or constant/N/K"
    )

    def material(self, spec: ModelSpec) -> Material:
        """Return the material, named "request"; ParameterError if the fields make no material. Files are not read."""
        for name, value in self.parameters.items():
            if isinstance(value, Mapping) and "csv" in value:
                raise ParameterError(name, "files are not read over HTTP; give wavelengths_nm and values", value)
        fields = {"title": "of a request", "model": spec.name, "source": "a request", "parameters": self.parameters}
        index = {} if self.refractive_index is None else {"refractive_index": self.refractive_index}
        try:
            return Material.from_table("request", fields | index)
        except MaterialError as error:
            raise ParameterError(error.parameter, error.sentence, error.value, error.allowed) from None
