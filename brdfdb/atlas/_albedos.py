"""What the figures of energy have in common: angles of incidence, albedos over them, and their curves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.figure import Curve, Panel, Role, curve_of
from brdfdb.geometry import radians
from brdfdb.integrals.quadrature import directional_albedo

Array = NDArray[np.float64]

THETA_DEG = np.concatenate(
    [np.arange(0.0, 76.0, 5.0), [77.5, 80, 82, 84, 85, 85.5, 86, 87, 88, 88.5, 89, 89.5, 89.7, 89.9]]
)
THETA = "theta_i [degree]"
ALBEDO = "directional albedo [1]"
TOLERANCE = 1e-6  # absolute, of the quadrature
EXACT = 1e-8  # the same, where a closed form is held against it
THREE_DIGITS = 0.5e-3 + TOLERANCE  # what a figure that is known to three decimals may differ by


def albedo_of(
    model: str, theta_i_deg: ArrayLike = THETA_DEG, *, tolerance: float = TOLERANCE, **parameters: Any
) -> Array:
    """Directional albedo, Dirac part included."""
    found = directional_albedo(model, radians(theta_i_deg), tolerance=tolerance, specular=True, **parameters)
    return np.asarray(found.albedo, dtype=np.float64)


def at(albedo: Array, theta_i_deg: float) -> float:
    """The value at one of the angles that are drawn."""
    (index,) = np.flatnonzero(theta_i_deg == THETA_DEG)
    return float(albedo[index])


def largest(albedo: Array, theta_i_deg: Array = THETA_DEG) -> str:
    """The largest value and where it is, in words."""
    return f"{albedo.max():.3f} at {theta_i_deg[albedo.argmax()]:g} degrees"


def curve(label: str, y: ArrayLike, role: Role = "other", x: Array = THETA_DEG) -> Curve:
    return curve_of(label, x, y, role)


def panel(title: str, curves: Sequence[Curve], *, log_y: bool = False) -> Panel:
    return Panel(title=title, x_label=THETA, y_label=ALBEDO, curves=list(curves), log_y=log_y)


def close(values: ArrayLike, said: ArrayLike, tolerance: float = THREE_DIGITS) -> bool:
    return bool(np.allclose(values, said, rtol=0.0, atol=tolerance))


def onset_deg(albedo: Array, theta_i_deg: Array = THETA_DEG) -> float:
    """Where the albedo rises above 1 for good, between two of the angles."""
    last = int(np.flatnonzero(albedo <= 1.0)[-1])
    return float(np.interp(1.0, albedo[last : last + 2], theta_i_deg[last : last + 2]))


def difference(label: str, off: Array, x: Array = THETA_DEG, role: Role = "other") -> Curve:
    """A curve over a logarithmic axis, on which 0 has no place."""
    return curve(label, np.where(off > 0.0, off, np.nan), role, x)
