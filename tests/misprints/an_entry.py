"""An entry of the list of misprints: its two forms, the figures that it states, and the tolerance of closed forms."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from brdfdb.misprints import MISPRINTS, Misprint

BY_KEY = {misprint.key: misprint for misprint in MISPRINTS}
GENERAL = {"theta_i": 0.7, "phi_i": 0.2, "theta_r": 0.4, "phi_r": 1.9}  # where no misprint of a limit is felt

# Relative to the reference, each just above the worst measured, which stands behind it
EXACT = 2e-13  # closed forms: 4.6e-14, the fit below zero; elsewhere 2.4e-15


class Entry:
    """A misprint, and the arguments where its two forms differ."""

    def __init__(self, misprint: Misprint) -> None:
        self.misprint = misprint
        self.where: dict[str, Any] = dict(misprint.where)

    def both(self, **changed: Any) -> tuple[Any, Any]:
        """Return the printed and the right value at the entry's arguments, or at others."""
        where = {**self.where, **changed}
        return self.misprint.as_printed(**where), self.misprint.corrected(**where)

    def numbers(self, *names: str) -> list[Any]:
        """Return arguments of the entry."""
        return [self.where[name] for name in names]

    def states(self, *figures: str) -> None:
        """Assert that the consequence states figures that were measured."""
        for figure in figures:
            assert re.search(rf"(?<![\d.]){re.escape(figure)}(?![\d])", self.misprint.consequence), figure


def close(value: Any, expected: Any, tolerance: float = EXACT) -> None:
    np.testing.assert_allclose(value, float(expected), rtol=tolerance, atol=0.0)
