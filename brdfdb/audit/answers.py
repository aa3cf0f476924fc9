"""The two questions of an audit: is a table what the paper says, and does the published model conserve energy."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import BaseModel, Field

from brdfdb.audit.energy import Energy
from brdfdb.audit.finding import STRICT, Finding, NotJudged, Word
from brdfdb.audit.model_energy import LOSS_UP_TO_DEG, Furnace, ModelEnergy
from brdfdb.audit.reciprocity import Reciprocity
from brdfdb.audit.registry import FINDINGS
from brdfdb.audit.table_error import TableError

AS_PUBLISHED = "is it what the paper says?"
CONSERVES_ENERGY = "does the published model conserve energy?"
NO_PAPER = "where no paper states a material, its model, or its function, takes the place of the paper"


class Answer(BaseModel):
    """The answer to one of the two questions, in a few words and in a sentence."""

    model_config = STRICT

    word: Word = Field(description="verdict behind the answer")
    text: str = Field(description="the answer in a few words, for a column")
    reason: str = Field(description="the answer in a sentence, with its angle and its wavelength")


def as_published(findings: Mapping[str, Finding]) -> Answer:
    """Return the answer to `AS_PUBLISHED`: every finding on the table, its excess over that of the model included."""
    energy = findings[Energy.key]
    failing = [
        FINDINGS[key].title.lower() for key, finding in findings.items() if key != Energy.key and _violates(finding)
    ]
    if isinstance(energy, Energy) and _of_table_alone(energy):
        failing.insert(0, "energy of the table")
    if failing:
        named = ", ".join(failing)
        if _is_measured(findings):
            text = f"the data break a law by more than their uncertainty: {named}"
            return Answer(word="violates", text=f"no: {named}", reason=text)
        return Answer(word="violates", text=f"no: {named}", reason=f"the table differs from its source in: {named}")
    error = findings[TableError.key]
    if isinstance(error, NotJudged):
        return Answer(
            word="not judged", text="measured" if _is_measured(findings) else "not judged", reason=error.reason
        )
    reason = "the table keeps to the formulas of its source within the error that it states"
    return Answer(word="passes", text="yes", reason=reason)


def conserves_energy(findings: Mapping[str, Finding]) -> Answer:
    """Return the answer to `CONSERVES_ENERGY`, which the table has no part in, unless it is measured."""
    energy = findings[Energy.key]
    if isinstance(energy, Energy) and _is_measured(findings):
        return _of_data(energy)
    if not isinstance(energy, Energy) or energy.model is None:
        return Answer(word="not judged", text="not judged", reason="no model of this table can be evaluated")
    model = energy.model
    return Answer(word=model.verdict, text=_short(model), reason=model.reason)


def _is_measured(findings: Mapping[str, Finding]) -> bool:
    reciprocity = findings[Reciprocity.key]
    return isinstance(reciprocity, Reciprocity) and reciprocity.table_random.measured


def _of_data(energy: Energy) -> Answer:
    """Return the answer for measured data, which have no model: that of their table."""
    table = energy.table
    most = "not finite" if table.max_albedo is None else f"albedo {table.max_albedo:.3g}"
    where = f"{most} at {table.max_at_theta_i_deg:.3g}°"
    if table.verdict == "violates":
        text = f"the data do not: {where}"
    elif table.reason:
        text = f"cannot be judged: {where}, within the error of the table"
        return Answer(word="not judged", text=text, reason=table.reason)
    else:
        text = f"the data do: {where}"
    return Answer(word=table.verdict, text=text, reason=table.reason or text)


def _violates(finding: Finding) -> bool:
    return finding.verdict == "violates"


def _of_table_alone(energy: Energy) -> bool:
    """Return True if a table reflects too much where its model does not, or more than its model."""
    return energy.table.verdict == "violates" and (energy.model is None or energy.model.verdict != "violates")


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
        loss, at = _loss(model.furnace)
        return f"conserves energy{up_to} {'up to' if bounded else 'but for'} a loss of {_percent(loss)} at {at:.3g}°"
    if model.verdict == "gains":
        return f"conserves energy{up_to}; would create {_percent(_gain(model.furnace))} if nothing were absorbed"
    return {
        "known published excess": f"no, as published: {where}",
        "accepted excess": f"no, as accepted: {where}",
        "violates": f"no: {where}",
    }[model.verdict]


def _loss(furnace: Furnace | None) -> tuple[float, float]:
    """Return the largest loss [1] of a lossless model up to the last angle that is judged, and its angle [degree]."""
    assert furnace is not None
    judged = zip(furnace.theta_i_deg, furnace.albedo, strict=True)
    least = [(min(value for value in row if value is not None), at) for at, row in judged if at <= LOSS_UP_TO_DEG]
    return 1.0 - min(least)[0], min(least)[1]


def _gain(furnace: Furnace | None) -> float:
    """Return the largest excess [1] of a lossless model."""
    return 0.0 if furnace is None or furnace.largest is None else furnace.largest - 1.0


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %" if share < 0.995 else "100 %"
