"""Reciprocity of samples: the asymmetry of those that are each other's swap of light and viewer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brdfdb.geometry import degrees
from brdfdb.measurements.samples import Samples
from brdfdb.measurements.symmetry import are_bright, asymmetries

_SAME_DEG = 0.01  # directions closer than this are one


@dataclass(frozen=True)
class ExchangedPairs:
    """Asymmetry abs(a - b) / (abs(a) + abs(b)) [1] of samples that are each other's swap of light and viewer.

    Attributes
    ----------
    pairs : int
        Number of pairs.
    median, largest : float [1]
        Median and largest asymmetry over pairs and channels.
    """

    pairs: int
    median: float
    largest: float


def reciprocity_of(samples: Samples, one_side: bool) -> ExchangedPairs | None:
    """Return the asymmetry of samples that are each other's swap; None without any."""
    angles = [degrees(angle) for angle in (samples.theta_i, samples.phi_i, samples.theta_r, samples.phi_r)]
    theta_i, phi_i, theta_r, phi_r = (np.rint(angle / _SAME_DEG).astype(np.int64) for angle in angles)
    turn = round(360.0 / _SAME_DEG)
    if samples.turned:
        coordinates = theta_i, np.where(theta_i == 0, 0, phi_i % turn), theta_r, np.where(theta_r == 0, 0, phi_r % turn)
        swapped = coordinates[2], coordinates[3], coordinates[0], coordinates[1]
    else:
        delta = np.where((theta_i == 0) | (theta_r == 0), 0, (phi_r - phi_i) % turn)
        other = np.where(delta == 0, 0, turn - delta)
        delta, other = (np.minimum(delta, other),) * 2 if one_side else (delta, other)
        coordinates, swapped = (theta_i, theta_r, delta, 0 * delta), (theta_r, theta_i, other, 0 * delta)
    code, code_swapped = (((a * turn + b) * turn + c) * turn + d for a, b, c, d in (_wide(coordinates), _wide(swapped)))
    order = np.argsort(code, kind="stable")
    place = np.clip(np.searchsorted(code[order], code_swapped), 0, len(order) - 1)
    partner = order[place]
    first = np.flatnonzero((code[partner] == code_swapped) & (code < code_swapped))
    a, b = samples.values[first], samples.values[partner[first]]
    level = float(np.nanmedian(np.abs(samples.values))) if samples.known.any() else 0.0
    pairs = int(np.sum(are_bright(a, b, level).any(axis=1)))
    if not pairs:
        return None
    asymmetry = asymmetries(a, b, level)
    return ExchangedPairs(pairs, float(np.median(asymmetry)), float(asymmetry.max()))


def _wide(parts: Sequence[NDArray[np.int64]]) -> list[NDArray[np.uint64]]:
    """Return four whole numbers of 16 bits as unsigned numbers of 64, whose products do not overflow together."""
    return [part.astype(np.uint64) for part in parts]
