"""The report of an audit as data: the findings on each table, in one JSON document."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, Field, GetJsonSchemaHandler, SerializeAsAny
from pydantic_core import CoreSchema

from brdfdb.audit.finding import STRICT, F, Finding, NotJudged, Sentence, Verdict
from brdfdb.audit.registry import FINDINGS
from brdfdb.errors import ParameterError
from brdfdb.figure import Figure


def _read(found: Any) -> Any:
    """Return findings as objects, from those of a JSON document."""
    if not isinstance(found, Mapping):
        return found
    if unknown := [key for key in found if key not in FINDINGS]:
        raise ParameterError("findings", f"{unknown[0]!r} is not one of {', '.join(FINDINGS)}")
    return {key: each if isinstance(each, Finding) else _one(key, each) for key, each in found.items()}


def _one(key: str, found: Any) -> Finding:
    judged = not (isinstance(found, Mapping) and found.get("verdict") == "not judged")
    return (FINDINGS[key] if judged else NotJudged).model_validate(found)


class _Registered:
    """The JSON schema of findings: each of the registry, or that it is not judged."""

    @classmethod
    def __get_pydantic_json_schema__(cls, _: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        not_judged = handler(NotJudged.__pydantic_core_schema__)
        properties = {
            key: {"anyOf": [handler(kind.__pydantic_core_schema__), not_judged]} for key, kind in FINDINGS.items()
        }
        return {"type": "object", "properties": properties, "required": [*FINDINGS], "additionalProperties": False}


Findings = Annotated[dict[str, SerializeAsAny[Finding]], BeforeValidator(_read), _Registered]


class MaterialAudit(BaseModel):
    """All findings on one revision of one material."""

    model_config = STRICT

    material: str
    revision: str
    model: str = Field(description="name of the model behind the table; empty: the table was audited alone")
    findings: Findings = Field(description="by key; the report says what each is about")
    sentences: list[Sentence] = Field(description="all findings in words, for readers without this library")
    verdict: Verdict = Field(description="worst of the findings; validity, and what is not judged, do not count")

    def of(self, kind: type[F]) -> F:
        """Return the finding of one kind.

        Raises
        ------
        LookupError
            If it is not judged.
        """
        found = self.findings[kind.key]
        if not isinstance(found, kind):
            raise LookupError(f"{kind.key} of {self.material} is not judged")
        return found

    def problems(self) -> list[str]:
        """Return a sentence on each finding that is no plain pass."""
        return [sentence for found in self.findings.values() for sentence in found.problems()]

    @property
    def not_judged(self) -> list[str]:
        """Return the titles of the findings that are not judged."""
        return [FINDINGS[key].title for key, found in self.findings.items() if isinstance(found, NotJudged)]


class Explanation(BaseModel):
    """What one finding of the report is about."""

    model_config = STRICT

    key: str
    title: str
    text: str


def explanations() -> list[Explanation]:
    """Return the explanations of all findings of the registry."""
    return [Explanation(key=kind.key, title=kind.title, text=kind.explanation) for kind in FINDINGS.values()]


class AuditReport(BaseModel):
    """The audit of a store."""

    model_config = STRICT

    format: Literal["brdfdb-audit"] = "brdfdb-audit"
    version: Literal[5] = 5
    store: str = Field(description="its directory")
    brdfdb: str = Field(description="version of the library")
    when: datetime
    explanations: list[Explanation] = Field(description="each finding, in the order of the findings")
    materials: list[MaterialAudit]
    atlas: list[Figure] = Field(description="where methods fail: forms of the models against high-precision values")
    gallery: list[Figure] = Field(description="the figures of the papers, computed")
    damaged: list[str] = Field(description="a sentence on each table that is damaged, and was not audited")
    violations: list[str] = Field(
        description="names of the materials that violate something that is neither known as published nor accepted"
    )
