"""The error of a formula against the highest rung of its surface, and the largest albedo, as a table states them."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from brdfdb.tables.stated_error import Overall
from brdfdb.tables.worst_pair import WorstPair

Rung = Literal["measured", "highest rung", "none known"]


class FormulaError(BaseModel):
    """Error of the formula in a table against the highest rung: the form of its surface without an approximation."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    against: Rung = Field(
        description="measured: against a higher rung; highest rung: the formula is that rung, with an error of 0; "
        "none known: the formula is a fit, or no higher rung is known"
    )
    rung: str = Field(description="name of the highest rung; empty: none is known")
    directions: int = Field(description="drawn above the horizon, half of the viewers in the lobe; 0: not measured")
    overall: Overall | None = Field(
        description="abs(formula - rung) / max(rung, floor), as the error of a table is measured; null: none is known"
    )
    worst: WorstPair | None = Field(description="where the largest was met; null: not measured")

    @property
    def p99(self) -> float | None:
        """Return the error [1] that 99 of 100 values keep to; None if no rung is known."""
        return None if self.overall is None else self.overall.p99

    def in_lists(self) -> dict[str, Any]:
        """Return the fields of `FormulaRung`."""
        return {"against": self.against, "rung": self.rung, "p99": self.p99}

    def in_words(self) -> str:
        """Return the standing of the formula in a few words, without its error."""
        return {
            "measured": f"against {self.rung}",
            "highest rung": f"exact form of its model: {self.rung}",
            "none known": "no higher rung is known",
        }[self.against]


class FormulaRung(BaseModel):
    """Standing of a formula among the forms of its surface, as lists show it."""

    against: Rung = Field(
        description="measured: against a higher rung; highest rung: it is that rung; none known: it is a fit"
    )
    rung: str = Field(description="name of the highest rung; empty: none is known")
    p99: float | None = Field(description="relative error that 99 of 100 values keep to; null: no rung is known")


class LargestAlbedo(BaseModel):
    """The largest directional albedo of a table, specular part included."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    albedo: float | None = Field(description="largest over lights and wavelengths; null: not finite")
    theta_i_deg: float
    wavelength_nm: float | None = Field(description="null: grey")
    tolerance: float = Field(description="absolute tolerance of the albedo")

    @property
    def above_1(self) -> bool:
        """Return True if more light leaves than arrives, by more than the tolerance."""
        return self.albedo is None or self.albedo > 1.0 + self.tolerance
