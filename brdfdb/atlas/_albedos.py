"""Building blocks of the figures of energy: angles of incidence, albedos over them, and their curves."""

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
TOLERANCE = 1e-6  # absolute tolerance of the quadrature
EXACT = 1e-8  # absolute tolerance where a closed form exists
THREE_DIGITS = 0.5e-3 + TOLERANCE  # largest difference from a number that is known to three decimals


def albedo_of(
    model: str, theta_i_deg: ArrayLike = THETA_DEG, *, tolerance: float = TOLERANCE, **parameters: Any
) -> Array:
    """Return directional albedos [1], specular part included."""
    result = directional_albedo(model, radians(theta_i_deg), tolerance=tolerance, specular=True, **parameters)
    return np.asarray(result.albedo, dtype=np.float64)


def at(albedo: Array, theta_i_deg: float) -> float:
    """Return the albedo [1] at one of the angles that are drawn."""
    (index,) = np.flatnonzero(theta_i_deg == THETA_DEG)
    return float(albedo[index])


def largest(albedo: Array, theta_i_deg: Array = THETA_DEG) -> str:
    """Return the largest albedo [1] and its angle, in words."""
    return f"{albedo.max():.3f} at {theta_i_deg[albedo.argmax()]:g} degrees"


def curve(label: str, y: ArrayLike, role: Role = "other", x: Array = THETA_DEG) -> Curve:
    """Return a curve of albedos over the angle of incidence."""
    return curve_of(label, x, y, role)


def panel(title: str, curves: Sequence[Curve], *, log_y: bool = False) -> Panel:
    """Return a panel of albedos over the angle of incidence."""
    return Panel(title=title, x_label=THETA, y_label=ALBEDO, curves=list(curves), log_y=log_y)


def close(values: ArrayLike, published: ArrayLike, tolerance: float = THREE_DIGITS) -> bool:
    """Return whether values differ from published ones by an absolute tolerance at most."""
    return bool(np.allclose(values, published, rtol=0.0, atol=tolerance))


def onset_deg(albedo: Array, theta_i_deg: Array = THETA_DEG) -> float:
    """Return the angle [degree] beyond which the albedo stays above 1, interpolated between two angles."""
    last = int(np.flatnonzero(albedo <= 1.0)[-1])
    return float(np.interp(1.0, albedo[last : last + 2], theta_i_deg[last : last + 2]))


def difference(label: str, off: Array, x: Array = THETA_DEG, role: Role = "other") -> Curve:
    """Return a curve of differences [1] for a logarithmic axis; a difference of 0 is a gap."""
    return curve(label, np.where(off > 0.0, off, np.nan), role, x)
