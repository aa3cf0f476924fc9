"""The report of an audit as data: the findings on each table and its answers to two questions, in one JSON document."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from typing import Annotated, Any, Literal, cast

from pydantic import BaseModel, BeforeValidator, Field, GetJsonSchemaHandler, SerializeAsAny
from pydantic_core import CoreSchema, core_schema

from brdfdb.audit.energy import Energy
from brdfdb.audit.finding import STRICT, F, Finding, NotJudged, Sentence, TableVerdict, Verdict, Word
from brdfdb.audit.glints import resting_on
from brdfdb.audit.model_energy import LOSS_UP_TO_DEG, ModelEnergy
from brdfdb.audit.reciprocity import Reciprocity
from brdfdb.audit.record import Difference
from brdfdb.audit.registry import FINDINGS
from brdfdb.audit.table_error import TableError
from brdfdb.errors import ParameterError, percent
from brdfdb.figure import Figure
from brdfdb.measurements.record import Measured

AS_PUBLISHED = "is it what the paper says?"
CONSERVES_ENERGY = "does the published model conserve energy?"
QUESTIONS = (AS_PUBLISHED, CONSERVES_ENERGY)
OF_DATA = ("is it what the data say?", "do the data conserve energy?")  # of measured and simulated tables
_OF_BOTH = ("as published, or as the data say?", "conserves energy?")  # of a list with tables of both kinds
NO_PAPER = "where no paper states a material, its model, or its function, takes the place of the paper"


class Answer(BaseModel):
    """The answer to one of the two questions, in a few words and in a sentence."""

    model_config = STRICT

    word: Word = Field(description="verdict behind the answer")
    text: str = Field(description="the answer in a few words, for a column")
    reason: str = Field(description="the answer in a sentence, with its angle and its wavelength")


def as_published(findings: Mapping[str, Finding], *, measured: Measured | None = None) -> Answer:
    """Return the answer to `AS_PUBLISHED`: every finding on the table, its excess over that of the model included.

    `measured` is the record of a table of data.
    """
    energy = findings[Energy.key]
    failing = [
        title.lower()
        for key, finding in findings.items()
        if key != Energy.key and finding.verdict == "violates"
        for title in dict.fromkeys(said.title for said in finding.sentences() if said.word == "violates")
        or (FINDINGS[key].title,)
    ]
    model_violates = isinstance(energy, Energy) and energy.model is not None and energy.model.verdict == "violates"
    if isinstance(energy, Energy) and energy.table.verdict == "violates" and not model_violates:
        failing.insert(0, "energy of the table")
    if failing:
        named = ", ".join(failing)
        if _is_measured(findings):
            text = f"the data break a law by more than their uncertainty, or the table misses them: {named}"
            return Answer(word="violates", text=f"no: {named}", reason=text)
        return Answer(word="violates", text=f"no: {named}", reason=f"the table differs from its source in: {named}")
    error = findings[TableError.key]
    if isinstance(error, NotJudged):
        resting = resting_on(measured)
        text = f"passes {resting}" if resting else "not judged" if measured is None else measured.origin
        return Answer(word="not judged", text=text, reason=error.reason)
    reason = "the table keeps to the formulas of its source within the error that it states"
    return Answer(word="passes", text="yes", reason=reason)


def conserves_energy(findings: Mapping[str, Finding], *, measured: Measured | None = None) -> Answer:
    """Return the answer to `CONSERVES_ENERGY`, which the table has no part in, unless it is measured."""
    energy = findings[Energy.key]
    if isinstance(energy, Energy) and _is_measured(findings):  # data have no model
        table = energy.table
        most = "not finite" if table.max_albedo is None else f"albedo {table.max_albedo:.3g}"
        where = f"{most} at {table.max_at_theta_i_deg:.3g}°"
        if table.verdict != "violates" and not table.is_certain:
            text = f"cannot be judged: {where}, and 1 is within the error of the table and its data"
            if table.max_albedo is not None and table.is_extrapolated:
                share = percent(table.extrapolated / table.max_albedo)
                text = f"cannot be judged: {share} of the albedo lies in directions that were not measured"
            return Answer(word="not judged", text=text, reason=table.reason or text)
        resting = f" {measured.where}" if measured is not None and measured.where else ""
        text = f"the data {'do not' if table.verdict == 'violates' else 'do'}{resting}: {where}"
        return Answer(word=table.verdict, text=text, reason=table.reason or text)
    if not isinstance(energy, Energy) or energy.model is None:
        return Answer(word="not judged", text="not judged", reason="no model of this table can be evaluated")
    model = energy.model
    return Answer(word=model.verdict, text=_short(model), reason=model.reason)


def _is_measured(findings: Mapping[str, Finding]) -> bool:
    reciprocity = findings[Reciprocity.key]
    return isinstance(reciprocity, Reciprocity) and reciprocity.table_random.measured


def _short(model: ModelEnergy) -> str:
    """Return the verdict on a model in a few words: yes, no, or the light that it loses or creates if lossless."""
    most = "not finite" if model.max_albedo is None else f"albedo {model.max_albedo:.3g}"
    where = f"{most} at {model.max_at_theta_i_deg:.3g}°"
    if model.max_at_wavelength_nm is not None:
        where += f", {model.max_at_wavelength_nm:g} nm"
    bounded = model.grazing is None or (model.grazing.power == 0.0 and model.grazing.passes_1_at_theta_i_deg is None)
    up_to = "" if bounded else f" for lights up to {model.judged_up_to_theta_i_deg:g}°"
    if model.verdict == "conserves":
        return f"yes{up_to}" if model.furnace is not None else f"yes{up_to}, no lossless form to judge"
    if model.verdict == "loses":
        assert model.furnace is not None
        judged = zip(model.furnace.theta_i_deg, model.furnace.albedo, strict=True)
        least = [(min(value for value in row if value is not None), at) for at, row in judged if at <= LOSS_UP_TO_DEG]
        albedo, at = min(least)
        loss = f"{percent(1.0 - albedo)} at {at:.3g}°"
        return f"conserves energy up to a loss of {loss}" if bounded else f"conserves energy{up_to}; loses up to {loss}"
    if model.verdict == "gains":
        largest = None if model.furnace is None else model.furnace.largest
        gain = 0.0 if largest is None else largest - 1.0
        return f"conserves energy{up_to}; would create {percent(gain)} if nothing were absorbed"
    return {
        "known published excess": f"no, as published: {where}",
        "accepted excess": f"no, as accepted: {where}",
        "violates": f"no: {where}",
    }[model.verdict]


def _read(findings: Any) -> Any:
    """Return findings as objects, from objects or a JSON document."""
    if not isinstance(findings, Mapping):
        return findings
    if unknown := [key for key in findings if key not in FINDINGS]:
        raise ParameterError("findings", f"{unknown[0]!r} is not one of {', '.join(FINDINGS)}")
    read: dict[str, Finding] = {}
    for key, value in findings.items():
        unjudged = isinstance(value, Mapping) and value.get("verdict") == "not judged"
        kind = NotJudged if unjudged else FINDINGS[key]
        read[key] = value if isinstance(value, Finding) else kind.model_validate(value)
    return read


def _referred(kind: type[Finding]) -> CoreSchema:
    """Return the schema of a finding under a name, so that documents define it once and refer to it."""
    schema: Any = kind.__pydantic_core_schema__
    if schema["type"] == "definitions":
        return cast(CoreSchema, schema)
    return core_schema.definitions_schema(core_schema.definition_reference_schema(schema["ref"]), [schema])


class _Registered:
    """The JSON schema of findings: for each kind of the registry, the finding or `NotJudged`."""

    @classmethod
    def __get_pydantic_json_schema__(cls, _: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        properties = {
            key: {"anyOf": [handler(_referred(kind)), handler(_referred(NotJudged))]} for key, kind in FINDINGS.items()
        }
        return {"type": "object", "properties": properties, "required": [*FINDINGS], "additionalProperties": False}


Findings = Annotated[dict[str, SerializeAsAny[Finding]], BeforeValidator(_read), _Registered]


class MaterialAudit(BaseModel):
    """All findings on one revision of one material."""

    model_config = STRICT

    material: str
    revision: str
    manifest_sha256: str = Field(default="", description="of the revision; empty: the table is not from a store")
    program: str = Field(default="", description="digest of the program that audited; empty: not recorded")
    model: str = Field(description="name of the model behind the table; empty: the table was audited alone")
    findings: Findings = Field(description="by key; the report explains each of them")
    sentences: list[Sentence] = Field(description="all findings in words, for programs without this library")
    as_published: Answer = Field(description=f"{AS_PUBLISHED} Of the table, within the error that it states")
    conserves_energy: Answer = Field(description=f"{CONSERVES_ENERGY} Of the model alone")
    verdict: TableVerdict = Field(
        description="worst of the findings. Validity, and findings that are not judged, do not count; not judged: "
        "nothing says what the values of the table are of"
    )

    verdict_in_words: str = Field(
        default="",
        description="the verdict, the share of the directions that it rests on if a part of them was measured, and "
        "that of the samples that the table misses: passes where measured, 1.4 %; empty: of a report of an older "
        "program",
    )

    def of(self, kind: type[F]) -> F:
        """Return the finding of one kind; LookupError if it is not judged."""
        finding = self.findings[kind.key]
        if not isinstance(finding, kind):
            raise LookupError(f"{kind.key} of {self.material} is not judged")
        return finding

    def problems(self) -> list[str]:
        """Return sentences on the findings that are not a plain pass."""
        return [sentence for finding in self.findings.values() for sentence in finding.problems()]

    @property
    def questions(self) -> tuple[str, str]:
        """The questions that `as_published` and `conserves_energy` answer."""
        return OF_DATA if _is_measured(self.findings) else QUESTIONS

    @property
    def not_judged(self) -> list[str]:
        """Return the titles of the findings that are not judged."""
        return [FINDINGS[key].title for key, finding in self.findings.items() if isinstance(finding, NotJudged)]


class FamilyAudit(BaseModel):
    """The record of a family, compared with its members and with a new measurement."""

    model_config = STRICT

    family: str
    snapshot: str = Field(default="", description="snapshot that holds the record; empty: the store itself")
    subject_sha256: str = Field(description="of the record and of the manifests of the members")
    compared: int = Field(description="number of leaves of the record that were compared")
    wrong: list[Difference] = Field(description="leaves that differ")
    damage: str = Field(default="", description="what is wrong with its files; empty: nothing")
    verdict: Verdict

    @property
    def text(self) -> str:
        """The verdict in a sentence."""
        if self.verdict == "passes":
            return f"all {self.compared} numbers and words of its record agree with a new measurement"
        return self.damage or "; ".join(difference.text for difference in self.wrong)


class Explanation(BaseModel):
    """The explanation of one finding of the report."""

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
    version: Literal[8] = 8
    store: str = Field(description="directory of the store")
    brdfdb: str = Field(description="version of the library")
    when: datetime = Field(description="of the last run; audits that a report of some materials keeps may be older")
    explanations: list[Explanation] = Field(description="explanations of the findings, in their order")
    materials: list[MaterialAudit]
    atlas: list[Figure] = Field(
        description="figures on the failures of methods: forms of the models compared with high-precision values"
    )
    gallery: list[Figure] = Field(description="the figures of the papers, computed")
    damaged: list[str] = Field(description="a sentence on each damaged table, which was not audited")
    violations: list[str] = Field(
        description="names of the materials with a violation that is neither known as published nor accepted"
    )
    not_judged: list[str] = Field(
        default=[], description="names of the tables that do not say what their values are of, or of an unknown model"
    )
    families: list[FamilyAudit] = Field(default=[], description="of a report on all materials")
    program: str = Field(default="", description="digest of the program of the last run: models, audits and materials")
    taken_over: list[str] = Field(
        default=[], description="materials of the last run whose audits an earlier report had, of the same bytes"
    )
    page_subjects: list[str] = Field(default=[], description="keys of the materials and figures on the page")
    page_sha256: str = Field(default="", description="of the page; empty: not recorded")
    sha256: str = Field(default="", description="of this document, one line, with this last field empty")

    @property
    def questions(self) -> tuple[str, str]:
        """The two questions on all materials, as headings."""
        kinds = {audited.questions for audited in self.materials} or {QUESTIONS}
        return kinds.pop() if len(kinds) == 1 else _OF_BOTH

    @property
    def families_wrong(self) -> list[str]:
        """Return the names of the families whose records are not those of a new measurement."""
        return [audited.family for audited in self.families if audited.verdict != "passes"]
