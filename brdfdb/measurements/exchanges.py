"""Samples that are each other's swap of light and viewer, exactly or between others."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.geometry import degrees
from brdfdb.measurements.samples import Samples
from brdfdb.parameters import Floats

Rows = NDArray[np.intp]

_GRAZING_DEG = 85.0  # polar angles above which stray light and the spot decide
_SAME_DEG = 0.01  # directions closer than this are the same


class ExchangedRows(NamedTuple):
    """Numbers of samples (P,) that are each other's swap of light and viewer."""

    first: Rows
    second: Rows


def exchanged_rows(samples: Samples, one_side: bool) -> ExchangedRows:
    """Return the samples that are each other's swap, each pair once."""
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
        coordinates = (theta_i, theta_r, delta, 0 * delta)
        swapped = (theta_r, theta_i, other, 0 * delta)
    code, code_swapped = (
        ((a * turn + b) * turn + c) * turn + d  # four numbers of 16 bits
        for a, b, c, d in ([part.astype(np.uint64) for part in parts] for parts in (coordinates, swapped))
    )
    order = np.argsort(code, kind="stable")
    place = np.clip(np.searchsorted(code[order], code_swapped), 0, len(order) - 1)
    partner = order[place]
    first = np.flatnonzero((code[partner] == code_swapped) & (code < code_swapped))
    return ExchangedRows(first, partner[first])


class SwappedPairs(NamedTuple):
    """Pairs of samples with light and viewer exchanged, or of a sample and what is interpolated at its swap, (P,).

    `lever` is ln(cos theta_i / cos theta_r) of the first, at least 0, and `change` is ln(f / f').
    """

    lever: Floats
    change: Floats
    interpolated: bool = False

    def asymmetry(self, exponent: int) -> float:
        """Return the median of abs(f - f') over the sum of both [1], without a power of the cosines."""
        return float(np.median(np.abs(np.tanh(0.5 * (self.change - exponent * self.lever)))))


def ordered_pairs(lever: Floats, change: Floats, *, interpolated: bool = False) -> SwappedPairs:
    """Return pairs whose sample of the smaller polar angle of the light comes first."""
    sign = np.where(lever < 0.0, -1.0, 1.0)
    return SwappedPairs(sign * lever, sign * change, interpolated)


def exact_pairs(samples: Samples, one_side: bool) -> SwappedPairs | None:
    """Return the pairs of samples that are each other's swap; None without any."""
    first, second = exchanged_rows(samples, one_side)
    a, b = samples.values[first], samples.values[second]
    both = (a > 0.0) & (b > 0.0)
    change = np.log(a, out=np.zeros_like(a), where=both) - np.log(b, out=np.zeros_like(b), where=both)
    middle = np.array(
        [np.median(some[seen]) if seen.any() else np.nan for some, seen in zip(change, both, strict=True)]
    )
    steep = np.maximum(samples.theta_i[first], samples.theta_r[first]) > np.radians(_GRAZING_DEG)
    kept = np.isfinite(middle) & ~steep
    if not kept.any():
        return None
    lever = np.log(np.cos(samples.theta_i[first[kept]]) / np.cos(samples.theta_r[first[kept]]))
    return ordered_pairs(lever, middle[kept])
