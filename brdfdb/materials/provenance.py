"""Statements about the values of a material: texts, assumptions, and excesses that are known as published."""

from __future__ import annotations

import unicodedata
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from brdfdb.errors import ParameterError

MOST_NAME = 128  # longest name [characters]; file systems allow 255 bytes
NAME_PATTERN = r"^[a-z0-9]+(-[a-z0-9]+)*$"  # lower-case words joined by hyphens

_CONTROLS = ("Cc", "Cf", "Cs")


def _printable(text: str) -> str:
    """Return the text; ValueError if it holds a control character, which a terminal would obey."""
    wrong = next(
        (letter for letter in text if unicodedata.category(letter) in _CONTROLS and letter not in "\n\t"), None
    )
    if wrong is not None:
        raise ValueError(f"{text[:40]!r} holds the control character {wrong!r}")
    return text


Words = Annotated[str, AfterValidator(_printable)]
Text = Annotated[str, Field(min_length=1), AfterValidator(_printable)]
Number = float | bool


class KnownExcess(BaseModel):
    """A published set of constants that reflects more than it receives, with the place of publication.

    `max_albedo` [1] is the largest directional albedo that the published parameters give, specular part included.
    `from_theta_i_deg` [degree] is the angle of incidence above which it exceeds 1. Audits accept it only from presets.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    max_albedo: float = Field(gt=1.0, allow_inf_nan=False)
    from_theta_i_deg: float = Field(ge=0.0, le=90.0)
    citation: Text


class Alternative(BaseModel):
    """Other values that the paper allows for an assumption, with the largest directional albedo [1] that they give."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    parameters: dict[str, Number | str] = Field(min_length=1)
    max_albedo: float = Field(ge=0.0, allow_inf_nan=False)


class Assumption(BaseModel):
    """A value that the paper does not print, with the reason for it and the results of alternatives.

    `max_albedo` [1] is the largest directional albedo of the material with this value, specular part included. It is
    given together with `alternatives`. Both show how far the verdict on energy depends on the assumption.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    why: Text
    max_albedo: float | None = Field(default=None, ge=0.0, allow_inf_nan=False)
    alternatives: tuple[Alternative, ...] = ()

    @model_validator(mode="after")
    def _check_compared(self) -> Assumption:
        if (self.max_albedo is None) != (not self.alternatives):
            raise ParameterError("assumed", "max_albedo and alternatives are given together, or neither")
        return self

    @property
    def decides(self) -> bool | None:
        """Return True if an alternative moves the largest albedo across 1; None if no alternative is recorded."""
        if self.max_albedo is None:
            return None
        return any((other.max_albedo > 1.0) != (self.max_albedo > 1.0) for other in self.alternatives)
