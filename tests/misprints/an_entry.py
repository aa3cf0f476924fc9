"""The two forms of an entry, the figures that it states, and tolerances against the reference."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from brdfdb.misprints import MISPRINTS

BY_KEY = {misprint.key: misprint for misprint in MISPRINTS}
GENERAL = {"theta_i": 0.7, "phi_i": 0.2, "theta_r": 0.4, "phi_r": 1.9}  # where no misprint of a limit is felt

# Relative to the reference, each just above the worst measured, which stands behind it
EXACT = 2e-13  # closed forms: 4.6e-14, the fit below zero; elsewhere 2.4e-15


def both(key: str, **changed: Any) -> tuple[Any, Any]:
    """The printed and the right value at the entry's own arguments, or at others."""
    misprint = BY_KEY[key]
    where = {**misprint.where, **changed}
    return misprint.as_printed(**where), misprint.corrected(**where)


def states(key: str, *figures: str) -> None:
    """The consequence states figures that were measured."""
    for figure in figures:
        assert re.search(rf"(?<![\d.]){re.escape(figure)}(?![\d])", BY_KEY[key].consequence), (figure, key)


def close(value: Any, expected: Any, tolerance: float = EXACT) -> None:
    np.testing.assert_allclose(value, float(expected), rtol=tolerance, atol=0.0)
