"""The error of a formula against the highest rung of its surface, and the largest albedo, as a table states them."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from brdfdb.errors import near_90
from brdfdb.tables.stated_error import Overall
from brdfdb.tables.worst_pair import WorstPair

Rung = Literal["measured", "highest rung", "none known"]


class FormulaError(BaseModel):
    """Error of the formula in a table against the highest rung: the form of its surface without an approximation."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    against: Rung = Field(
        description="measured: against a higher rung; highest rung: the formula is that rung, with an error of 0; "
        "none known: there is no more exact form to compare with, as of a fit"
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
            "none known": "no more exact form to compare with",
        }[self.against]


class FormulaRung(BaseModel):
    """Standing of a formula among the forms of its surface, as lists show it."""

    against: Rung = Field(
        description="measured: against a higher rung; highest rung: it is that rung; none known: it is a fit"
    )
    rung: str = Field(description="name of the highest rung; empty: none is known")
    p99: float | None = Field(description="relative error that 99 of 100 values keep to; null: no rung is known")


class Grazing(BaseModel):
    """Directional albedo for lights between the last angle that is judged and 90 degrees, specular part included."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    power: float = Field(ge=0.0, description="the albedo grows as cos(theta_i) to the power of minus this; 0: bounded")
    origin: Literal["declared", "measured"] = Field(
        description="declared: by the model; measured: from albedos at cos(theta_i) of 1e-4, 1e-6 and 1e-8"
    )
    factor: float = Field(
        description="next to 90 degrees the albedo is a constant and this times cos(theta_i) to minus that power, at "
        "the wavelength where it is largest; if bounded, the albedo itself"
    )
    max_albedo: float | None = Field(description="largest up to 90 degrees; null: it grows without bound")
    passes_1_at_theta_i_deg: float | None = Field(
        description="angle beyond those judged above which the albedo exceeds 1; null: there is none, or it is smaller"
    )

    def in_words(self, largest: float, unit: str = " degrees") -> str:
        """Return the growth in a clause, for an albedo that is at most `largest` [1] up to the last angle judged."""
        at = self.passes_1_at_theta_i_deg
        passes = "" if at is None else f" and passes 1 at {near_90(at)}{unit}"
        if self.max_albedo is not None:
            beyond = f", at most {self.max_albedo:.4g}" if f"{self.max_albedo:.4g}" != f"{largest:.4g}" else ""
            return f"bounded{beyond}{passes}"
        power = "1/2" if self.power == 0.5 else f"{self.power:.3g}"
        return f"grows as cos^-{power}{passes}"


class LargestAlbedo(BaseModel):
    """The largest directional albedo of the model in a table, or of a table without a model, specular part included."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    albedo: float | None = Field(description="largest over lights and wavelengths; null: not finite")
    theta_i_deg: float
    wavelength_nm: float | None = Field(description="null: grey")
    tolerance: float = Field(description="absolute tolerance of the albedo")
    of: Literal["source", "table"] = Field(
        default="table", description="source: of the model or function that was tabulated; table: of its lookups"
    )
    up_to_theta_i_deg: float | None = Field(default=None, description="largest angle of the lights; null: not recorded")
    grazing: Grazing | None = Field(default=None, description="for lights beyond; null: not measured")

    @property
    def above_1(self) -> bool:
        """Return True if more light leaves than arrives, by more than the tolerance."""
        return self.albedo is None or self.albedo > 1.0 + self.tolerance

    def in_words(self) -> str:
        """Return the albedo, its place, and its growth at grazing light, in a sentence."""
        at = f"{self.theta_i_deg:g}°" + ("" if self.wavelength_nm is None else f", {self.wavelength_nm:g} nm")
        lights = "" if self.up_to_theta_i_deg is None else f" for lights up to {self.up_to_theta_i_deg:g}°"
        if self.albedo is None:
            return f"not finite at {at}"
        beyond = "" if self.grazing is None else f"; {self.grazing.in_words(self.albedo, '°')}"
        return f"at most {self.albedo:.3g}{lights}, at {at}{beyond}"
