"""The catalogue of a store: a line for each material, the filters that choose lines, and their order."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from brdfdb.errors import ParameterError
from brdfdb.models import MODELS
from brdfdb.store.decoding import read_metadata
from brdfdb.store.last_audit import ShownAnswer
from brdfdb.store.summary_words import NOT_AUDITED
from brdfdb.tables.stated_error import FormulaRung, LargestAlbedo

_SEARCHED = ("name", "title", "model", "model_title", "paper", "source")  # fields in which words are looked for

SpectrumKind = Annotated[
    Literal["grey", "one wavelength", "spectral"],
    Field(description="grey: no colour is known, all wavelengths are alike; one wavelength: shown as grey"),
]


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
    largest_albedo: LargestAlbedo | None = Field(default=None, description="with the specular part; null: not measured")
    spectrum: SpectrumKind | None = None
    verdict: str | None = Field(default=None, description="of the audit of this revision; null: it has none")
    as_published: ShownAnswer | None = Field(default=None, description="is the table what the paper says?")
    conserves_energy: ShownAnswer | None = Field(default=None, description="does the published model conserve energy?")
    revision: str = ""
    created: str | None = None
    bytes: int | None = None
    incomplete: str | None = Field(default=None, description="what the table does not state of itself; null: nothing")
    damaged: str | None = Field(default=None, description="what is wrong with its files")


def line_of(name: str, group: Path, head: Mapping[str, Any]) -> dict[str, Any]:
    """Return the line of a revision, but for its audit, from its metadata and the pointer of the material."""
    metadata = read_metadata(group)
    return {
        "name": name,
        "title": metadata.title or "",
        "model": metadata.model,
        "model_title": metadata.model_title or metadata.model or "",
        "paper": metadata.model_reference or "",
        "source": metadata.source or "",
        "measured": metadata.measured is not None,
        "anisotropic": metadata.anisotropic,
        "wavelength_range_nm": metadata.wavelength_range_nm or None,
        "spectrum": spectrum_of(metadata.wavelength_range_nm),
        "incomplete": metadata.gaps or None,
        "formula_error": None if metadata.formula_error is None else metadata.formula_error.in_lists(),
        "largest_albedo": None if metadata.largest_albedo is None else metadata.largest_albedo.model_dump(mode="json"),
        "revision": group.name,
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
    model: str = Field(default="", description="only of this model; measured: only of measured data")
    paper: str = Field(default="", description="only with this in the key of the paper or in the source")
    q: str = Field(default="", description="only with all of these words in name, title, model or source")
    verdict: (
        Literal["passes", "known published excess", "accepted excess", "violates", "not judged", "not audited"] | None
    ) = Field(default=None, description="only with this verdict of the audit of the current revision")
    anisotropic: bool | None = Field(default=None, description="only anisotropic, or only isotropic ones")
    wavelength_nm: tuple[float, ...] = Field(
        default=(), description="only with tables at this wavelength [nm], repeatable; grey ones hold at all"
    )

    def rank(self, name: str, line: Mapping[str, Any]) -> tuple[bool, float, str]:
        """Return the place of a material in the order."""
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

    def chosen(self, names: Sequence[str], line: Callable[[str], Mapping[str, Any]]) -> list[tuple[bool, float, str]]:
        """Return the places of the materials that the filters let through, in order; `line` returns a line by name.

        Raises
        ------
        ParameterError
            For a model or a paper that neither this program nor a line knows.
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
    """Return the text in which papers are looked for."""
    return f"{line.get('paper', '')} {line.get('source', '')}".casefold()
