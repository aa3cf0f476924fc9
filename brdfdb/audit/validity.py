"""The standing of a material in the range that a paper states of its model, in the paper's own words."""

from __future__ import annotations

from pydantic import BaseModel, Field

from brdfdb.audit.finding import RANKS, STRICT, Cell, Finding, Sentence, Subject
from brdfdb.materials import Material
from brdfdb.parameters import Standing
from brdfdb.tables.grids import Axis

_ORDER: tuple[Standing, ...] = ("inside", "at the edge", "outside")


class Limit(BaseModel):
    """One limit that a paper states of its model, and where a material stands."""

    model_config = STRICT

    quantity: str
    value: str = Field(description="of the material")
    valid: str = Field(description="what was taken as inside and as the edge, where the paper gives no number")
    standing: Standing = Field(description="unknown: the material does not say")
    words: str = Field(description="of the paper")
    where: str


class Validity(Finding):
    """All limits of a model that its paper states. The verdict on the table does not count them."""

    key = "validity"
    order = 8
    explanation = (
        "Whether the parameters lie inside what the paper of the model says it is good for. Where it says “gentle” "
        "or “much less” and no number, a tenth is taken for inside, and 1 for the edge. The verdict on a table does "
        "not count this: what a paper tabulates is audited as it is."
    )

    limits: list[Limit]
    verdict: Standing = Field(description="worst of those that are known; inside: no limit is stated")

    @classmethod
    def judge(cls, subject: Subject) -> Finding:
        """Judge the parameters of the model of a table."""
        if not isinstance(subject.source, Material):
            return subject.not_judged("limits are those of the model of the source")
        return validity_of(subject.source, subject.table.wavelength_nm)

    def sentences(self) -> list[Sentence]:
        """Return a sentence on all limits, and one on each in the words of the paper."""
        standings = [limit.standing for limit in self.limits]
        kept = ", ".join(f"{standings.count(word)} {word}" for word in dict.fromkeys(standings))
        limits = "1 limit" if len(standings) == 1 else f"{len(standings)} limits"
        text = f"of {limits} that its paper states {kept}" if kept else "its paper states no limits"
        return [
            self.sentence(self.verdict, text),
            *(
                self.sentence(
                    limit.standing,
                    f"{limit.value} ({limit.valid})",
                    title=limit.quantity[:1].upper() + limit.quantity[1:],
                    quote=limit.words,
                    where=limit.where,
                )
                for limit in self.limits
            ),
        ]

    def cells(self) -> list[Cell]:
        """Return the number of limits that are not kept well inside."""
        edges = sum(limit.standing in ("at the edge", "outside") for limit in self.limits)
        return [Cell(self.verdict, f"{edges} of {len(self.limits)} limits" if edges else "", -RANKS[self.verdict])]


def validity_of(material: Material, wavelength_nm: Axis | None) -> Validity:
    """Return the limits of the model, judged at the wavelengths [nm] of the table where they depend on them."""
    stated = material.spec.limits
    limits = [] if stated is None else [Limit(**each._asdict()) for each in stated(material.arguments(wavelength_nm))]
    known = [limit.standing for limit in limits if limit.standing != "unknown"]
    return Validity(limits=limits, verdict=max(known, key=_ORDER.index, default="inside"))
