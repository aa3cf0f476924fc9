"""The instrument of a measurement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brdfdb.errors import ParameterError


@dataclass(frozen=True)
class Instrument:
    """The instrument of a measurement; None, or an empty text, where something is not known.

    Solid angles [sr] of light and receiver are those that the sample sees. `spot_mm` is the diameter of the spot that
    is measured, `polarisation` that of light and receiver in words.
    """

    name: str = ""
    source_solid_angle_sr: float | None = None
    receiver_solid_angle_sr: float | None = None
    spot_mm: float | None = None
    polarisation: str = ""

    def __post_init__(self) -> None:
        for quantity in ("source_solid_angle_sr", "receiver_solid_angle_sr", "spot_mm"):
            value = getattr(self, quantity)
            if value is not None and not 0.0 < value < np.inf:
                raise ParameterError(quantity, f"{value:g} is not a positive number", value, (0.0, np.inf))
