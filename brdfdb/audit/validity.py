"""The standing of a material in the limits of validity that a paper states for its model."""

from __future__ import annotations

from pydantic import BaseModel, Field

from brdfdb.audit.finding import RANKS, STRICT, Cell, Finding, Sentence, Subject, Word
from brdfdb.materials import Material
from brdfdb.materials.stated_limits import counts_of, in_words, limits_of
from brdfdb.microgeometry.model_errors import SurfaceError, surface_error
from brdfdb.parameters import Standing
from brdfdb.tables.grids import Axis

_ORDER: tuple[Standing, ...] = ("inside", "at the edge", "outside")


class Limit(BaseModel):
    """One limit that a paper states for its model, and the standing of a material in it."""

    model_config = STRICT

    quantity: str
    value: str = Field(description="value of the quantity for the material")
    valid: str = Field(description="range that counts as inside and as the edge; assumed if the paper gives no number")
    standing: Standing = Field(description="unknown: the material does not give the quantity")
    words: str = Field(description="quotation from the paper")
    where: str


class Validity(Finding):
    """All limits that a paper states for its model. They do not count for the verdict on the table."""

    key = "validity"
    order = 8
    explanation = (
        "The parameters are compared with the limits that the paper states for its model. If the paper says “gentle” "
        "or “much less” without a number, values up to a tenth are inside, and values up to 1 at the edge. Validity "
        "does not count for the verdict on a table, because the papers themselves go beyond these limits. If errors "
        "of the model against rays on surfaces are known, those at these parameters are stated, too."
    )

    limits: list[Limit]
    verdict: Standing = Field(description="worst of the known standings; inside: no limit is stated")
    surface: SurfaceError | None = Field(
        default=None,
        description="error of the model against rays on the surface that suits the parameters; null: there is no map",
    )

    @classmethod
    def judge(cls, subject: Subject) -> Finding:
        """Judge the parameters of the model of a table."""
        if not isinstance(subject.source, Material):
            return subject.not_judged("limits are those of the model of the source")
        return validity_of(subject.source, subject.table.wavelength_nm)

    def sentences(self) -> list[Sentence]:
        """Return a sentence on all limits, one on each with the quotation from the paper, and one on rays."""
        sentences = [
            self.sentence(self.verdict, in_words([limit.standing for limit in self.limits])),
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
        if self.surface is not None:
            word: Word = "compared" if self.surface.inside else "unknown"
            sentences.append(self.sentence(word, self.surface.sentence, title="Surface"))
        return sentences

    def cells(self) -> list[Cell]:
        """Return the number of limits that are not met, or at the edge, and the median error against rays."""
        standings = [limit.standing for limit in self.limits]
        edges = [words for word, words in counts_of(standings) if word in ("at the edge", "outside")]
        texts = [words.replace(" ", f" of {len(self.limits)} limits ", 1) for words in edges]
        if self.surface is not None:
            texts.append(f"rays: {self.surface.in_lists}")
        text = ", ".join(texts)
        return [Cell(self.verdict, text, -RANKS[self.verdict])]


def validity_of(material: Material, wavelength_nm: Axis | None) -> Validity:
    """Return the limits of the model, judged at the wavelengths [nm] of the table."""
    limits = [
        Limit(**{name: getattr(limit, name) for name in Limit.model_fields})
        for limit in limits_of(material, wavelength_nm)
    ]
    known = [limit.standing for limit in limits if limit.standing != "unknown"]
    verdict: Standing = max(known, key=_ORDER.index, default="inside")
    return Validity(limits=limits, verdict=verdict, surface=surface_error(material))
