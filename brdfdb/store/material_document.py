"""The document of a material: where its table comes from, where it is sampled, and how far to believe it."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from brdfdb.materials import written_name
from brdfdb.materials.provenance import KnownExcess
from brdfdb.materials.spectrum import Spectrum
from brdfdb.measurements.record import Measured
from brdfdb.models import MODELS
from brdfdb.store.catalogue import SpectrumKind, spectrum_of
from brdfdb.store.last_audit import AuditSummary, Verdict
from brdfdb.tables.metadata import TableMetadata
from brdfdb.tables.stated_error import Error, FormulaError, LargestAlbedo
from brdfdb.tables.table import Table


class Attributes(TableMetadata):
    """The attributes of a table; tables of other programs may lack any."""

    model_config = ConfigDict(json_schema_extra={"required": []})

    known_excess: KnownExcess | dict[str, Any] | None = None  # type: ignore[assignment]


class ParameterDocument(BaseModel):
    """A parameter of a material."""

    name: str
    value: float | bool | Spectrum
    unit: str
    meaning: str
    source: str
    assumed: bool = Field(description="the paper does not print it: our choice, explained in attributes.assumed")


class ShownAudit(AuditSummary):
    """The last audit of a material."""

    current: bool = Field(description="whether that is this one")
    when: str


class MaterialDocument(BaseModel):
    """One material: where its table comes from, where it is sampled, how far to believe it."""

    name: str
    revision: str
    digest: str = Field(description="sha256 of the manifest of the revision, which names all bytes of the table")
    title: str
    model: str | None = Field(description="name of the model; null: measured, or a function")
    parameters: list[ParameterDocument]
    anisotropic: bool
    wavelength_nm: list[float] | None = Field(description="wavelengths [nm]; null: grey")
    n: list[float] | None = Field(description="refractive index [1] at the wavelengths; null: the model has none")
    k: list[float] | None = Field(description="extinction coefficient [1] at the wavelengths")
    spectrum: SpectrumKind
    axes_deg: dict[str, list[float]] = Field(description="the grid of the table [degrees]")
    specular: bool = Field(description="whether there is a specular part: specular_reflectance is not 0 everywhere")
    error: Error | None = Field(description="of the table against its model, or the data; null: not measured")
    measured: Measured | None = Field(
        description="origin, symmetries and errors of measured data; null: the values are a model's or a function's"
    )
    formula_error: FormulaError | None = Field(description="of the model against the highest rung; null: not measured")
    largest_albedo: LargestAlbedo | None = Field(description="specular part included; null: not measured")
    incomplete: str | None = Field(description="what the table does not state of itself; null: nothing")
    audit: ShownAudit | None = Field(description="null: none")
    attributes: Attributes = Field(description="all that the table records of itself")


def material_document(table: Table, verdict: Verdict | None) -> dict[str, Any]:
    """Return the fields of `MaterialDocument`, with numpy arrays, of a table and the last audit of its material."""
    metadata, attributes = table.metadata, table.attrs
    return {
        "name": table.name,
        "revision": table.revision,
        "digest": table.digest,
        "title": metadata.title or "",
        "model": metadata.model,
        "parameters": _parameters(metadata),
        "anisotropic": table.anisotropic,
        "wavelength_nm": table.wavelength_nm,
        "n": table.n,
        "k": table.k,
        "spectrum": spectrum_of([] if table.wavelength_nm is None else table.wavelength_nm.tolist()),
        "axes_deg": {axis: np.ascontiguousarray(values) for axis, values in table.axes_deg.items()},
        "specular": table.specular is not None,
        "error": None if table.error is None else attributes["error"],
        "measured": None if metadata.measured is None else metadata.measured.model_dump(exclude={"extent"}),
        "formula_error": attributes.get("formula_error"),
        "largest_albedo": attributes.get("largest_albedo"),
        "incomplete": metadata.gaps or None,
        "audit": None if verdict is None else _audited(verdict, table),
        "attributes": {
            key: value
            for key, value in attributes.items()
            if key not in ("error", "request", *metadata.strange, *metadata.uncited)
        },
    }


def _parameters(metadata: TableMetadata) -> list[dict[str, Any]]:
    """Return the parameters as recipes write them: value, unit, meaning, source."""
    spec = MODELS.get(metadata.model or "")
    meanings = {} if spec is None else {written_name(parameter): parameter for parameter in spec.parameters}
    return [
        {
            "name": name,
            "value": value.model_dump() if isinstance(value, Spectrum) else value,
            "unit": ("degree" if meanings[name].unit == "rad" else meanings[name].unit) if name in meanings else "",
            "meaning": meanings[name].meaning if name in meanings else "",
            "source": metadata.parameter_sources.get(name, metadata.source or ""),
            "assumed": name in metadata.assumed,
        }
        for name, value in metadata.parameters.items()
    ]


def _audited(verdict: Verdict, table: Table) -> dict[str, Any]:
    """Return the fields of `ShownAudit`, as far as the report has them."""
    finding = verdict.finding.model_dump(include={*AuditSummary.model_fields}, exclude_unset=True)
    return {**finding, "current": verdict.finding.is_of(table.revision, table.digest), "when": verdict.when}
