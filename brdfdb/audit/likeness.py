"""A name for the fault of a wrong table: the change of its model with which the table agrees much better.

The signed error decides nothing by itself, because a coarse table is too bright or too dark anyway. Once a table is
known to be wrong, it distinguishes a wrong scale, a wrong side and a wrong axis.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from brdfdb.audit.pairs import Pairs, representative_nm
from brdfdb.geometry import radians, spherical_angles, unit_vector
from brdfdb.materials import Source
from brdfdb.parameters import Floats
from brdfdb.tables import error_measurement
from brdfdb.tables.table import Table

DIRECTIONS = 3000  # number of directions at which changed models are evaluated
MUCH_BETTER = 0.5  # largest mean error with the change, as a share of the mean error without it
_TURNS_DEG = range(15, 180, 15)  # angles below half a turn, because a lobe with two axes repeats after half a turn
_SCALE = 0.01  # smallest difference of a scale from 1 that is reported

Directions = tuple[Floats, Floats]


def bias_of(pairs: Pairs) -> float | None:
    """Return the signed mean error [1] at the wavelength where it is largest; positive if the table is too bright."""
    weight = pairs.drawn.weight
    whole = weight @ pairs.model
    with np.errstate(invalid="ignore"):
        signed = np.divide(weight @ (pairs.table - pairs.model), whole, out=np.zeros_like(whole), where=whole > 0.0)
    largest = float(signed[np.argmax(np.abs(signed))])
    return float(f"{largest:.3g}") if np.isfinite(largest) else None


def likeness_of(table: Table, source: Source, pairs: Pairs) -> str:
    """Return, in words, the changed model with which a table agrees at least twice as well; empty if there is none."""
    chosen = np.flatnonzero(pairs.drawn.above)[:: max(len(pairs.drawn.wi) // DIRECTIONS, 1)]
    middle = pairs.table.shape[1] // 2
    wavelength = representative_nm(table)
    at = None if wavelength is None else np.array([wavelength])
    values, truth, weight = pairs.table[chosen, middle], pairs.model[chosen, middle], pairs.drawn.weight[chosen]
    if not np.isfinite(values).all():
        return ""
    light, viewer = pairs.drawn.wi[chosen], pairs.drawn.wr[chosen]
    errors = {"": weight @ np.abs(values - truth)}
    scale = float(weight @ values / (weight @ truth)) if weight @ truth > 0.0 else 1.0
    if abs(scale - 1.0) > _SCALE:
        errors[f"the model times {scale:.3g}"] = weight @ np.abs(values - scale * truth)
    for name, changed in _changes(source.anisotropic):
        model = error_measurement.model_values(source, at, *changed(light, viewer))[:, 0]
        errors[name] = weight @ np.abs(values - model)
    best = min(errors, key=lambda name: errors[name])
    return best if errors[best] < MUCH_BETTER * errors[""] else ""


def _changes(anisotropic: bool) -> Iterator[tuple[str, Callable[[Floats, Floats], Directions]]]:
    yield "the model with light and viewer exchanged", lambda wi, wr: (wr, wi)
    yield "the model seen from the other side, delta_phi of 180 degrees for 0", lambda wi, wr: (wi, _turned(wr, 180.0))
    yield "the model with theta counted from the horizon", lambda wi, wr: (_upended(wi), _upended(wr))
    if not anisotropic:
        return
    yield "the model in a mirror, -phi for phi", lambda wi, wr: (_mirrored(wi), _mirrored(wr))
    for angle in _TURNS_DEG:
        yield (
            f"the model turned by {angle} degrees",
            lambda wi, wr, by=float(angle): (_turned(wi, by), _turned(wr, by)),  # type: ignore[misc]
        )


def _turned(w: Floats, degrees: float) -> Floats:
    """Return unit vectors turned about the normal."""
    cos, sin = np.cos(radians(degrees)), np.sin(radians(degrees))
    return np.stack([cos * w[:, 0] - sin * w[:, 1], sin * w[:, 0] + cos * w[:, 1], w[:, 2]], axis=-1)


def _mirrored(w: Floats) -> Floats:
    return np.asarray(w * np.array([1.0, -1.0, 1.0]))


def _upended(w: Floats) -> Floats:
    """Return unit vectors with the complements of their polar angles."""
    theta, phi = spherical_angles(w)
    return unit_vector(np.clip(np.pi / 2.0 - theta, 0.0, np.pi / 2.0 - 1e-9), phi)
