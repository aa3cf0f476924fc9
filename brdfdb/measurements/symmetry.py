"""Symmetries of measured data: how far they keep to reciprocity and to mirror symmetry, and what they may assume."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.geometry import radians, unit_vector
from brdfdb.materials.source import Evaluate
from brdfdb.measurements.coordinates import DirectionPairs
from brdfdb.measurements.extent import Extent
from brdfdb.measurements.record import MeasuredSymmetry, Spread
from brdfdb.parameters import Floats

_HALF_TURN = np.array([-1.0, -1.0, 1.0])
MIRROR = np.array([1.0, -1.0, 1.0])  # of unit vectors, that exchanges left and right of the plane of phi = 0
_DRAWN = 4000
_UP_TO_DEG = 80.0
_SEED = 1924
_FAINT = 1e-3  # share of the median of abs(f_r) below which pairs do not count in an asymmetry
_ROUNDING = 1e-6  # asymmetry that a file in float32 has
_CONTRADICTED = 0.05  # asymmetry above which data of unknown noise contradict a symmetry
_SLOPES = np.geomspace(2.0**-9, 2.0, 11)  # of half vectors, from those of the narrowest lobes on: octaves
_IN_OCTAVE = 400
#: reciprocity of f_r that is interpolated as a reciprocal one
RECIPROCAL = MeasuredSymmetry(assumed=True, asymmetry=Spread(median=0.0, p99=0.0, max=0.0), allowed=None)
_WITHIN = 1.2  # times the noise is how large the asymmetry may be, because both are estimates


def drawn_pairs(extent: Extent | None = None, up_to_deg: float = _UP_TO_DEG) -> DirectionPairs:
    """Return pairs of unit vectors (N, 3) up to an angle [degree]; with an extent, those within it, also exchanged."""
    rng = np.random.default_rng(_SEED)
    theta = np.arccos(rng.uniform(np.cos(radians(up_to_deg)), 1.0, (2, _DRAWN)))
    phi = rng.uniform(0.0, 2.0 * np.pi, (2, _DRAWN))
    wi, wr = (unit_vector(theta[k], phi[k]) for k in (0, 1))
    if extent is None:
        return DirectionPairs(wi, wr)
    inside = _inside(extent, wi, wr)
    return DirectionPairs(wi[inside], wr[inside])


class LobePairs(NamedTuple):
    """Unit vectors (N, 3) of light and viewer, and the octave (N,) of the slope of their half vectors."""

    wi: Floats
    wr: Floats
    octave: NDArray[np.int64]


def lobe_pairs(extent: Extent | None = None) -> LobePairs:
    """Return pairs around the mirror direction and the light.

    As many pairs have half vectors with slopes of 0.002 to 0.004, as of 0.004 to 0.008, and so on up to 2: a lobe of
    any width has a share of them. The same viewers, turned by 180 degrees, are about the light. Those of samples lie
    within them, also exchanged.
    """
    rng = np.random.default_rng(_SEED)
    octave = np.repeat(np.arange(_SLOPES.size - 1), _IN_OCTAVE)
    slope = _SLOPES[octave] * 2.0 ** rng.uniform(0.0, 1.0, octave.size)
    theta = np.arccos(rng.uniform(np.cos(radians(_UP_TO_DEG)), 1.0, octave.size))
    phi = rng.uniform(0.0, 2.0 * np.pi, (2, octave.size))
    wi = unit_vector(theta, phi[0])
    half = unit_vector(np.arctan(slope), phi[1])
    wr = 2.0 * np.sum(wi * half, axis=1, keepdims=True) * half - wi
    wi = np.concatenate([wi, wi])
    wr = np.concatenate([wr, wr * _HALF_TURN])
    octave = np.concatenate([octave, octave + _SLOPES.size])
    inside = wr[:, 2] > np.cos(radians(_UP_TO_DEG))
    if extent is not None:
        inside &= _inside(extent, wi, wr)
    return LobePairs(wi[inside], wr[inside], octave[inside])


def _inside(extent: Extent, wi: Floats, wr: Floats) -> NDArray[np.bool_]:
    return ~(extent.outside(wi, wr) | extent.outside(wr, wi))


def spread_of(changes: Floats) -> Spread:
    """Return percentiles of relative differences, to three digits."""
    median, p99, largest = (float(f"{x:.3g}") for x in np.percentile(changes, [50.0, 99.0, 100.0]))
    return Spread(median=median, p99=p99, max=largest)


def asymmetries(f: Floats, other: Floats, level: float) -> Floats:
    """Return abs(f - f') / (abs(f) + abs(f')) [1] of values that a symmetry makes the same, without the faint ones.

    A pair is faint if its mean is at most a thousandth of `level` [1/sr], the median of abs(f), or has no value.
    """
    counts = are_bright(f, other, level)
    return np.asarray(np.abs(f - other)[counts] / (np.abs(f) + np.abs(other))[counts])


def are_bright(f: Floats, other: Floats, level: float) -> NDArray[np.bool_]:
    """Return which pairs of values are known and not faint, as `asymmetries` says."""
    total = np.abs(f) + np.abs(other)
    return np.asarray(np.isfinite(total) & (0.5 * total > _FAINT * level))


def _spread(f: Floats, other: Floats) -> Spread | None:
    """Return percentiles of `asymmetries`; None without any."""
    seen = asymmetries(f, other, float(np.median(np.abs(f)))) if f.size else np.empty(0)
    return spread_of(seen) if seen.size else None


def _floored(f: Floats, other: Floats) -> Spread | None:
    """Return the asymmetry of values (N, C) that a symmetry makes the same, as noise explains it; None without any.

    It is relative to a floor at least, as the errors at samples that were held out are.
    """
    total = np.abs(f) + np.abs(other)
    if not np.any(total > 0.0):
        return None
    floor = 1e-3 * total.mean(axis=0)
    return spread_of(np.abs(f - other) / np.maximum(total, floor))


def reciprocity(f_r: Evaluate, extent: Extent | None, noise: float | None) -> MeasuredSymmetry:
    """Return whether data keep to reciprocity within their noise [1]; it is not assumed where they cannot tell.

    Pairs everywhere and `lobe_pairs` decide. The asymmetry is that of pairs everywhere.
    """
    wi, wr = drawn_pairs(extent)
    f, other = (f_r(wi, wr), f_r(wr, wi)) if len(wi) else (np.empty((0, 1)),) * 2
    lobe = lobe_pairs(extent)
    spreads = [_floored(f, other)] if len(wi) else []
    spreads += [_floored(f_r(lobe.wi, lobe.wr), f_r(lobe.wr, lobe.wi))] if len(lobe.wi) else []
    p99 = max((one.p99 for one in spreads if one is not None), default=np.inf)
    allowed = _ROUNDING if noise is None else max(_WITHIN * noise, _ROUNDING)
    return MeasuredSymmetry(assumed=p99 <= allowed, asymmetry=_spread(f, other), allowed=noise)


def mirror(f_r: Evaluate, noise: float | None) -> MeasuredSymmetry:
    """Return whether data everywhere keep to the mirror symmetry that isotropic tables use."""
    wi, wr = drawn_pairs()
    f = f_r(wi, wr)
    other = f_r(wi * MIRROR, wr * MIRROR)
    seen = _floored(f, other)
    allowed = _CONTRADICTED if noise is None else max(_WITHIN * noise, _CONTRADICTED)
    kept = (seen is None or seen.median <= allowed) and _of_lobes(f_r, lambda w: w * MIRROR) <= allowed
    return MeasuredSymmetry(assumed=kept, asymmetry=_spread(f, other), allowed=noise)


def mirror_of_samples(f: Floats, other: Floats, noise: float) -> MeasuredSymmetry:
    """Return the mirror symmetry that tables of isotropic samples assume, with the asymmetry of samples (N, C)."""
    return MeasuredSymmetry(assumed=True, asymmetry=_spread(f, other), allowed=noise)


def is_turned(f_r: Evaluate, noise: float | None) -> bool:
    """Return True if f_r changes when the surface is turned about its normal, by more than noise or rounding."""
    wi, wr = drawn_pairs()
    allowed = max(_CONTRADICTED, 0.0 if noise is None else noise)
    seen = _floored(f_r(wi, wr), f_r(_turned(wi), _turned(wr)))
    return (seen is not None and seen.median > allowed) or _of_lobes(f_r, _turned) > allowed


def _turned(w: Floats) -> Floats:
    """Return unit vectors (N, 3), each turned about the normal by an angle of its own: the same ones in each call."""
    turn = np.random.default_rng(_SEED).uniform(0.0, 2.0 * np.pi, len(w))
    c, s = np.cos(turn), np.sin(turn)
    return np.stack([c * w[:, 0] - s * w[:, 1], s * w[:, 0] + c * w[:, 1], w[:, 2]], axis=1)


def _of_lobes(f_r: Evaluate, moved: Callable[[Floats], Floats]) -> float:
    """Return the largest asymmetry of `lobe_pairs` of an octave and a channel.

    It is the sum of the differences of f_r times cosine over the sum of both. So bright pairs count, which are few
    among all directions, and dark ones with more noise count less.
    """
    wi, wr, octave = lobe_pairs()
    f, other = (f_r(a, b) * wr[:, 2:] for a, b in ((wi, wr), (moved(wi), moved(wr))))
    number = octave[:, np.newaxis] == np.unique(octave)
    apart, total = (number.T.astype(np.float64) @ part for part in (np.abs(f - other), np.abs(f) + np.abs(other)))
    return float(np.max(apart / np.maximum(total, 1e-300)))
