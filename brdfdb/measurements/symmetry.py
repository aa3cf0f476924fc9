"""Symmetries of measured data: how far they keep to reciprocity and to mirror symmetry, and what they may assume."""

from __future__ import annotations

import numpy as np

from brdfdb.geometry import radians, unit_vector
from brdfdb.materials.source import Evaluate
from brdfdb.measurements.coordinates import Hull
from brdfdb.measurements.record import Spread, Symmetry
from brdfdb.parameters import Floats

MIRROR = np.array([1.0, -1.0, 1.0])  # of unit vectors, that exchanges left and right of the plane of phi = 0
_DRAWN, _UP_TO_DEG, _SEED = 4000, 80.0, 1924
_ROUNDING = 1e-6  # asymmetry that a file in float32 has
_CONTRADICTED = 0.05  # median asymmetry of the mirror image above which data of unknown noise contradict it
_WITHIN = 1.2  # times the noise is how large the asymmetry may be, because both are estimates


def drawn_pairs(hull: Hull | None = None, up_to_deg: float = _UP_TO_DEG) -> tuple[Floats, Floats]:
    """Return pairs of unit vectors (N, 3) up to an angle [degree]; with a hull, those within it, also exchanged."""
    rng = np.random.default_rng(_SEED)
    theta = np.arccos(rng.uniform(np.cos(radians(up_to_deg)), 1.0, (2, _DRAWN)))
    phi = rng.uniform(0.0, 2.0 * np.pi, (2, _DRAWN))
    wi, wr = (unit_vector(theta[k], phi[k]) for k in (0, 1))
    if hull is None:
        return wi, wr
    inside = ~(hull.outside(wi, wr) | hull.outside(wr, wi))
    return wi[inside], wr[inside]


def spread_of(changes: Floats) -> Spread:
    """Return percentiles of relative differences, to three digits."""
    median, p99, largest = (float(f"{x:.3g}") for x in np.percentile(changes, [50.0, 99.0, 100.0]))
    return Spread(median=median, p99=p99, max=largest)


def asymmetry_of(f: Floats, other: Floats) -> Spread | None:
    """Return the asymmetry of values (N, C) that a symmetry makes the same; None without any."""
    total = np.abs(f) + np.abs(other)
    if not np.any(total > 0.0):
        return None
    floor = 1e-3 * total.mean(axis=0)
    return spread_of(np.abs(f - other) / np.maximum(total, floor))


def reciprocity(f_r: Evaluate, hull: Hull | None, noise: float | None) -> Symmetry:
    """Return whether data keep to reciprocity within their noise [1]; it is not assumed where they cannot tell."""
    wi, wr = drawn_pairs(hull)
    seen = asymmetry_of(f_r(wi, wr), f_r(wr, wi)) if len(wi) else None
    allowed = _ROUNDING if noise is None else max(_WITHIN * noise, _ROUNDING)
    return Symmetry(assumed=seen is not None and seen.p99 <= allowed, asymmetry=seen, allowed=noise)


def mirror(f_r: Evaluate, noise: float | None) -> Symmetry:
    """Return whether data everywhere keep to the mirror symmetry that isotropic tables use."""
    wi, wr = drawn_pairs()
    seen = asymmetry_of(f_r(wi, wr), f_r(wi * MIRROR, wr * MIRROR))
    allowed = _CONTRADICTED if noise is None else max(_WITHIN * noise, _CONTRADICTED)
    return Symmetry(assumed=seen is None or seen.median <= allowed, asymmetry=seen, allowed=noise)


def is_turned(f_r: Evaluate, noise: float | None) -> bool:
    """Return True if f_r changes when the surface is turned about its normal, by more than noise or rounding."""
    wi, wr = drawn_pairs()
    turn = np.random.default_rng(_SEED).uniform(0.0, 2.0 * np.pi, len(wi))
    c, s = np.cos(turn), np.sin(turn)
    turned = (np.stack([c * w[:, 0] - s * w[:, 1], s * w[:, 0] + c * w[:, 1], w[:, 2]], axis=1) for w in (wi, wr))
    seen = asymmetry_of(f_r(wi, wr), f_r(*turned))
    return seen is not None and seen.median > max(_CONTRADICTED, 0.0 if noise is None else noise)
