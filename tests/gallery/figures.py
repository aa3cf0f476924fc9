"""Figures of the gallery, with their panels, curves and values, for its tests."""

from __future__ import annotations

from functools import cache

import numpy as np

from brdfdb.figure import Curve, Figure, Panel
from brdfdb.gallery import GALLERY
from brdfdb.refractive_indices import refractive_index


@cache
def figure(key: str) -> Figure:
    """Return a figure, which is computed once."""
    return GALLERY[key]()


def panel_of(figure: Figure, index: int = 0) -> Panel:
    """Return a panel of curves."""
    return figure.panels[index]


def curve_of(figure: Figure, label: str, index: int = 0) -> Curve:
    """Return the curve with a label."""
    (curve,) = (curve for curve in panel_of(figure, index).curves if curve.label == label)
    return curve


def value_at(curve: Curve, x: float) -> float:
    """Return the value of a curve at one of its points."""
    return curve.y[curve.x.index(x)]


def optics(page: str, wavelength_nm: float) -> dict[str, float]:
    """Return the wavelength [nm] and the refractive index at it."""
    n, k = refractive_index(page, np.array(wavelength_nm))
    return {"wavelength_nm": wavelength_nm, "n": float(n), "k": float(k)}
