"""Panels, curves, values and statements of figures, for the tests of the gallery."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pytest

from brdfdb.figure import Curve, Figure, Panel, Statement
from brdfdb.spectra import refractive_index

Phrase = tuple[str, str]  # name of a figure, and a phrase of one of its statements


def cases(statements: Sequence[Phrase], broken: Mapping[Phrase, str]) -> list[Any]:
    """Return a test case per statement; broken statements, given with their reasons, have to fail."""
    marks = {phrase: [pytest.mark.xfail(strict=True, reason=reason)] for phrase, reason in broken.items()}
    return [pytest.param(*phrase, marks=marks.get(phrase, [])) for phrase in statements]


def statement_of(figure: Figure, phrase: str) -> Statement:
    """Return the only statement of a figure that contains a phrase."""
    (statement,) = (statement for statement in figure.statements if phrase in statement.says)
    return statement


def check_statement(figure: Figure, phrase: str) -> None:
    """Assert that the statement of a figure with a phrase says what its threshold is from, and holds."""
    statement = statement_of(figure, phrase)
    assert statement.threshold_from
    assert statement.holds, statement.seen


def check_phrases(statements: Sequence[Phrase], names: Sequence[str], figure: Callable[[str], Figure]) -> None:
    """Assert that the phrases are as many as the statements of each figure, in the order of the figures."""
    assert [name for name, _ in statements] == [name for name in names for _ in figure(name).statements]


def panel_of(figure: Figure, index: int = 0) -> Panel:
    """Return a panel of curves."""
    panel = figure.panels[index]
    assert isinstance(panel, Panel)
    return panel


def curve_of(figure: Figure, label: str, index: int = 0) -> Curve:
    """Return the curve with a label."""
    (curve,) = (curve for curve in panel_of(figure, index).curves if curve.label == label)
    return curve


def value_at(curve: Curve, x: float) -> float:
    """Return the value of a curve at one of its points."""
    value = curve.y[curve.x.index(x)]
    assert value is not None
    return value


def optics(page: str, wavelength_nm: float) -> dict[str, float]:
    """Return the wavelength [nm] and the refractive index at it."""
    n, k = refractive_index(page, np.array(wavelength_nm))
    return {"wavelength_nm": wavelength_nm, "n": float(n), "k": float(k)}
