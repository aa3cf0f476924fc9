"""The contents of a store for lists and services: the last audit, lines of materials with filters, and documents."""

from __future__ import annotations

import contextlib
import json
import math
import os
import threading
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from brdfdb.errors import ParameterError
from brdfdb.materials import written_name
from brdfdb.materials.provenance import KnownExcess
from brdfdb.materials.spectrum import Spectrum
from brdfdb.measurements.record import Measured
from brdfdb.microgeometry.model_errors import SurfaceError, surface_error_of
from brdfdb.models import MODELS
from brdfdb.store.records import summary_of
from brdfdb.store.summary_words import NOT_AUDITED
from brdfdb.tables.metadata import TableMetadata
from brdfdb.tables.stated_error import Error, FormulaError, FormulaRung, LargestAlbedo

if TYPE_CHECKING:
    from brdfdb.tables.table import Table

_SEARCHED = ("name", "title", "model", "model_title", "paper", "source")  # fields in which words are looked for

SortKey = tuple[bool, float, str]  # value is unknown, value, name; pages of a list write it as JSON
SpectrumKind = Annotated[
    Literal["grey", "one wavelength", "spectral"],
    Field(description="grey: the same value at all wavelengths; one wavelength: shown as grey"),
]


# The last audit


_IN_WORDS = (
    "the verdict, and the share of the directions that it rests on if a part of them was measured: passes where "
    "measured, 1.4 %; empty or null: not recorded"
)


class ShownAnswer(BaseModel):
    """The answer of an audit to one of its two questions."""

    word: str = Field(description="verdict behind the answer")
    text: str = Field(description="the answer in a few words")
    reason: str = Field(description="the answer in a sentence, with its angle and its wavelength")


class ShownSentence(BaseModel):
    """One sentence of an audit, with the title of its subject."""

    finding: str
    title: str
    word: str
    text: str
    quote: str = Field(default="", description="words of a paper; empty: none")
    where: str = Field(default="", description="place of the quote")


class AuditSummary(BaseModel):
    """The verdict of an audit, its answers to two questions, and its findings in sentences."""

    revision: str = Field(description="revision that was audited")
    model: str
    verdict: str
    verdict_in_words: str = Field(default="", description=_IN_WORDS)
    sentences: list[ShownSentence]
    as_published: ShownAnswer = Field(description="of the table: is it what the paper says, or the data?")
    conserves_energy: ShownAnswer = Field(description="of the model or the data: do they conserve energy?")


class AuditedMaterial(AuditSummary):
    """Results of an audit for a material, as lists and pages show them; other fields of the report are stored."""

    model_config = ConfigDict(extra="allow")

    material: str
    manifest_sha256: str = Field(default="", description="of the revision; empty in reports of older programs")

    def is_of(self, revision: str, digest: str) -> bool:
        """Return True if the audit is about the table with the number of a revision, and the digest of its manifest."""
        return self.revision == revision and self.manifest_sha256 in ("", digest)


class Verdict(NamedTuple):
    """The audit of a material: the findings, their date, and whether they are about the current revision."""

    finding: AuditedMaterial
    when: str
    current: bool

    def document(self, table: Table) -> dict[str, Any]:
        """Return the fields of `ShownAudit`, as far as the report has them, for a page on a table."""
        finding = self.finding.model_dump(include={*AuditSummary.model_fields}, exclude_unset=True)
        return {**finding, "current": self.finding.is_of(table.revision, table.digest), "when": self.when}


class LastAudit(NamedTuple):
    """The report of an audit: its date, and its findings on each material."""

    when: str
    by_name: dict[str, AuditedMaterial]


class AuditFile:
    """The file of a report of ``brdfdb audit``, read anew when it changes; it may be missing. Threads may share it."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = threading.Lock()
        self._known: tuple[tuple[int, int], LastAudit] | None = None

    def read(self) -> LastAudit:
        """Return the report, empty if the file is none; entries that lack a shown field are left out."""
        try:
            at = os.stat(self._path)
        except OSError:
            return LastAudit("", {})
        seen = at.st_mtime_ns, at.st_size
        with self._lock:
            if self._known is None or self._known[0] != seen:
                self._known = seen, self._read()
            return self._known[1]

    def _read(self) -> LastAudit:
        try:
            document = json.loads(self._path.read_bytes())
            when = str(document["when"])
            entries = list(document["materials"])
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            return LastAudit("", {})
        by_name = {}
        for entry in entries:
            with contextlib.suppress(ValidationError):
                audited = AuditedMaterial.model_validate(entry)
                by_name[audited.material] = audited
        return LastAudit(when, by_name)


# Lines of materials


class Line(BaseModel):
    """One line of the catalogue; of a damaged material only `name` and `damaged`."""

    name: str
    title: str = ""
    model: str | None = Field(default=None, description="null: measured, or a function")
    model_title: str = ""
    paper: str = Field(default="", description="key of the paper of the model, such as he1991")
    source: str = Field(default="", description="paper and table, figure or section of the parameters")
    measured: bool = Field(default=False, description="true: the table is of measured data")
    anisotropic: bool | None = None
    wavelength_range_nm: list[float] | None = Field(default=None, description="first and last [nm]; null: grey")
    error_p99: float | None = Field(
        default=None, description="of the table: relative error that 99 of 100 values keep to; null: not measured"
    )
    formula_error: FormulaRung | None = Field(default=None, description="of its formula; null: not measured")
    surface_error: SurfaceError | None = Field(
        default=None, description="of its formula against rays on the surface that suits the material; null: no map"
    )
    largest_albedo: LargestAlbedo | None = Field(default=None, description="with the specular part; null: not measured")
    spectrum: SpectrumKind | None = None
    verdict: str | None = Field(default=None, description="of the audit of this revision; null: it has none")
    verdict_in_words: str | None = Field(default=None, description=_IN_WORDS)
    as_published: ShownAnswer | None = Field(default=None, description="is the table what the paper says, or the data?")
    conserves_energy: ShownAnswer | None = Field(
        default=None, description="does the published model conserve energy, or do the data?"
    )
    revision: str = ""
    created: str | None = None
    bytes: int | None = None
    incomplete: str | None = Field(default=None, description="what the table does not state of itself; null: nothing")
    damaged: str | None = Field(default=None, description="what is wrong with its files")


def line_of(name: str, head: Mapping[str, Any], metadata: Callable[[], TableMetadata]) -> dict[str, Any]:
    """Return the line of a revision, but for its audit, from what lists show of it.

    The pointer of an older program says less: then `metadata` reads those of the revision.
    """
    facts: Any = head if "incomplete" in head else summary_of(metadata(), head["bytes"], head["created"])
    model = facts["model"] or None
    return {
        "name": name,
        "title": facts["title"],
        "model": model,
        "model_title": facts["model_title"],
        "paper": facts["model_reference"],
        "source": facts["source"],
        "measured": facts["measured"],
        "anisotropic": facts["anisotropic"],
        "wavelength_range_nm": facts["wavelength_range_nm"] or None,
        "spectrum": spectrum_of(facts["wavelength_range_nm"]),
        "incomplete": facts["incomplete"] or None,
        "formula_error": facts["formula_error"],
        "surface_error": surface_error_of(model, facts["parameters"]),
        "largest_albedo": facts["largest_albedo"],
        "revision": head["revision"],
        **{key: head.get(key) for key in ("error_p99", "created", "bytes")},
    }


def spectrum_of(range_nm: Sequence[float]) -> str:
    """Return whether a table has colours: grey, one wavelength or spectral, by its first and last wavelength [nm]."""
    if not range_nm:
        return "grey"
    return "one wavelength" if range_nm[0] == range_nm[-1] else "spectral"


class Choice(BaseModel):
    """The materials that a list shows, and their order."""

    model_config = ConfigDict(frozen=True)

    sort: Literal["name", "error_p99", "-error_p99", "created", "-created", "bytes", "-bytes"] = Field(
        default="name",
        description="order; with a minus the largest, or the newest, first; unknown ones last, then by name",
    )
    model: str = Field(default="", description="only materials of this model; measured: only measured data")
    paper: str = Field(default="", description="only materials with this text in the key of the paper or in the source")
    q: str = Field(default="", description="only materials with all of these words in name, title, model or source")
    verdict: (
        Literal["passes", "known published excess", "accepted excess", "violates", "not judged", "not audited"] | None
    ) = Field(default=None, description="only with this verdict of the audit of the current revision")
    anisotropic: bool | None = Field(
        default=None, description="true: only anisotropic materials; false: only isotropic materials"
    )
    wavelength_nm: tuple[float, ...] = Field(
        default=(), description="only tables that cover this wavelength [nm], repeatable; grey tables cover all"
    )

    def rank(self, name: str, line: Mapping[str, Any]) -> SortKey:
        """Return the sort key of a material; unknown values come last."""
        value = line.get(self.sort.removeprefix("-"))
        if self.sort == "name" or value is None:
            return self.sort != "name", 0.0, name
        number = datetime.fromisoformat(value).timestamp() if isinstance(value, str) else float(value)
        return False, -number if self.sort.startswith("-") else number, name

    def lets_through(self, line: Mapping[str, Any]) -> bool:
        """Return True if the filters let a line through."""
        text = " ".join(str(line.get(key) or "") for key in _SEARCHED).casefold()
        low, high = line.get("wavelength_range_nm") or (0.0, math.inf)
        return (
            self.model in ("", line.get("model", ""), "measured" if line.get("measured") else "")
            and self.paper.casefold() in _papers(line)
            and all(word in text for word in self.q.casefold().split())
            and self.verdict in (None, line.get("verdict") or NOT_AUDITED)
            and self.anisotropic in (None, line.get("anisotropic"))
            and all(low <= wavelength <= high for wavelength in self.wavelength_nm)
        )

    @property
    def of_names(self) -> bool:
        """True if the names of materials are enough to choose and to sort them."""
        return all(getattr(self, name) == field.default for name, field in Choice.model_fields.items())

    def chosen(self, names: Sequence[str], line: Callable[[str], Mapping[str, Any]]) -> list[SortKey]:
        """Return the places of the materials that the filters let through, in order; `line` returns a line by name.

        ParameterError says that neither this program nor a line knows the model or the paper.
        """
        if self.of_names:
            return [self.rank(name, {}) for name in sorted(names)]
        lines = {name: line(name) for name in names}
        models = {"measured", *MODELS, *(str(known["model"]) for known in lines.values() if known.get("model"))}
        if self.model and self.model not in models:
            raise ParameterError("model", f"{self.model!r} is not one of {', '.join(sorted(models))}", self.model)
        texts = [_papers(known) for known in lines.values()]
        keys = {*(spec.reference for spec in MODELS.values()), *(str(known.get("paper")) for known in lines.values())}
        if not any(self.paper.casefold() in text for text in (*texts, *map(str.casefold, keys))):
            shown = ", ".join(sorted(keys - {"", "None"}))
            raise ParameterError("paper", f"{self.paper!r} is in no source, and in none of {shown}", self.paper)
        return sorted(self.rank(name, known) for name, known in lines.items() if self.lets_through(known))


def _papers(line: Mapping[str, Any]) -> str:
    return f"{line.get('paper', '')} {line.get('source', '')}".casefold()


# The document of a material: where its table comes from, where it is sampled, and how far to believe it


class Attributes(TableMetadata):
    """The attributes of a table; those of other programs may be missing."""

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

    current: bool = Field(description="true: the audit is of this revision")
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
    surface_error: SurfaceError | None = Field(
        description="of the model against rays on the surface that suits the material; null: there is no map for it"
    )
    largest_albedo: LargestAlbedo | None = Field(description="specular part included; null: not measured")
    incomplete: str | None = Field(description="what the table does not state of itself; null: nothing")
    audit: ShownAudit | None = Field(description="null: none")
    attributes: Attributes = Field(description="all that the table records of itself")


def material_document(table: Table, verdict: Verdict | None) -> dict[str, Any]:
    """Return the fields of `MaterialDocument`, with numpy arrays, of a table and the last audit of its material."""
    metadata = table.metadata
    attributes = table.attrs
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
        "surface_error": surface_error_of(metadata.model, metadata.parameters),
        "largest_albedo": attributes.get("largest_albedo"),
        "incomplete": metadata.gaps or None,
        "audit": None if verdict is None else verdict.document(table),
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
