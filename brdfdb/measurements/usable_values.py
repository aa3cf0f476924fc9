"""Values of samples that can be interpolated: holes that numbers stand for are refused; floor and noise of others."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from brdfdb.errors import ParameterError
from brdfdb.measurements.exchanges import exchanged_rows
from brdfdb.measurements.samples import Samples
from brdfdb.parameters import Floats

FLOOR = 1e-3  # floor of relative errors, as a share of the mean f_r times cosine
_FEWEST = 10  # samples of a table
_SIGMAS = 1.4826  # standard deviations in the median magnitude of normal noise, inverted
_ABSURD = 3.0  # times the noise, and the largest value, is what no value is below 0 by
_CONTRADICT = 0.05  # share of exchanged pairs that differ by more than a reciprocal f_r may pass from both
_FEWEST_REPEATS = 10  # repeats that tell the noise
_FEWEST_PAIRS = 30  # exchanged pairs that do
_SAME_DEG = 1e-3  # angles of repeats differ by at most
NEAR = 0.04  # relative difference of f_r from a sample, at most, if no repeats tell its noise
_SUDDEN = 0.01  # smallest value above 0 over their median, from which on f_r does not fall to 0 gradually
_RESOLVED = 0.1  # difference of values over the smallest, up to which 0 is no rounded number
_OFTEN = 3  # samples with the same number below 0 that make it suspicious


class ListedSamples(NamedTuple):
    """Directions (N, 3), values and uncertainties (N, C) of the samples with a value in any channel."""

    wi: Floats
    wr: Floats
    values: Floats
    uncertainty: Floats | None


def listed(samples: Samples) -> ListedSamples:
    """Return directions and values of the samples with a value in any channel; ParameterError for fewer than ten."""
    rows = np.flatnonzero(samples.known.any(axis=1))
    if rows.size < _FEWEST:
        raise ParameterError("samples", f"{rows.size} values are too few; a table needs {_FEWEST} or more", rows.size)
    uncertainty = None if samples.uncertainty is None else samples.uncertainty[rows]
    return ListedSamples(samples.w_i[rows], samples.w_r[rows], samples.values[rows], uncertainty)


def check_values(samples: Samples) -> None:
    """Refuse samples of which no value is above 0, or that stand for holes with numbers that noise does not explain.

    Such a number is below minus three times the largest value, or occurs three times or more in a channel, and is below
    0 by three times the noise or the tenth percentile of the values above 0.
    """
    values = samples.values
    largest = np.max(values, where=samples.known, initial=0.0)
    lowest = np.min(values, where=samples.known, initial=0.0)
    if not largest > 0.0:
        raise ParameterError("values", "no value is above 0: there is nothing to tabulate", float(largest))
    if lowest < -_ABSURD * largest:
        text = f"{lowest:g} is not a possible f_r, whose largest value is {largest:g}; a hole must be nan"
        raise ParameterError("values", text, lowest)
    for channel, column in zip(samples.channels, values.T, strict=True):
        numbers, counts = np.unique(column[column < 0.0], return_counts=True)
        often = numbers[counts >= _OFTEN]
        if often.size == 0 or not np.any(column > 0.0):
            continue
        noise = [
            np.percentile(column[column > 0.0], 10.0),
            _SIGMAS * np.median(np.append(-numbers[numbers > often[0]], 0.0)),
        ]
        if samples.uncertainty is not None:
            noise.append(np.nanmedian(samples.uncertainty))
        if -often[0] > _ABSURD * max(noise):
            times = int(counts[np.searchsorted(numbers, often[0])])
            raise ParameterError(
                "values",
                f"{often[0]:g} is the value of {times} samples of {channel}, and no f_r; a hole is nan",
                often[0],
            )


def without_filled(samples: Samples) -> tuple[Samples, list[str]]:
    """Return samples without the zeros that fill directions which were not measured, and a sentence on them.

    A value of 0 is no measurement if it is beside values far above 0: there are none in between, and numbers that
    differ by much less. Exports about the mirror direction fill what lies beyond the reach of the instrument.
    """
    values, told = samples.values.copy(), []
    for channel, column in zip(samples.channels, values.T, strict=True):
        filled = column == 0.0
        above = np.unique(column[column > 0.0])
        if np.count_nonzero(filled) < _OFTEN or np.any(column < 0.0) or above.size < _FEWEST:
            continue
        if above[0] > _SUDDEN * np.median(above) and np.diff(above).min() < _RESOLVED * above[0]:
            column[filled] = np.nan
            told.append(
                f"{np.count_nonzero(filled)} values of 0 ({channel}) are left out as holes: no other is below "
                f"{above[0]:.3g} /sr"
            )
    return (replace(samples, values=values) if told else samples), told


def noise_below_zero(values: Floats) -> Floats:
    """Return the noise [1/sr] (C,) that values below 0 show; 0 without any.

    It is that of the median of their magnitudes, and at most the magnitude that twice as many values stay below: where
    f_r is less than its noise, half of the values are below 0. Zeros alone are values that were cut off there: the
    noise is that of as many values above 0.
    """
    noise = np.zeros(values.shape[1])
    for c, column in enumerate(values.T):
        below, small = -column[column < 0.0], np.sort(np.abs(column[np.isfinite(column)]))
        zeros = int(np.count_nonzero(column == 0.0))
        if below.size:
            noise[c] = min(_SIGMAS * np.median(below), small[min(2 * below.size, small.size) - 1])
        elif zeros:
            noise[c] = _SIGMAS * small[min(zeros + zeros // 2, small.size - 1)]
    return noise


def floor_of(samples: Samples) -> Floats:
    """Return the floor [1/sr] (C,) of relative errors: `FLOOR` of the mean f_r of the samples, above 0."""
    mean = np.nanmean(np.abs(samples.values), axis=0)
    return np.asarray(np.maximum(FLOOR * mean, 1e-12))


def contradict(samples: Samples) -> bool:
    """Return whether pairs with light and viewer exchanged differ so much that no reciprocal f_r passes near both."""
    known = samples.selected(np.flatnonzero(samples.known.any(axis=1)))
    off = _differences(known, np.nanmean(np.arcsinh(known.values / (2.0 * floor_of(samples))), axis=1), exchanged=True)
    return bool(off.size) and float(np.mean(np.abs(off) > 2.0 * NEAR)) > _CONTRADICT


def noise_between(known: Samples, height: Floats, *, exchanged: bool) -> float | None:
    """Return the standard deviation of the logarithm (N,) of f_r, as normal noise has it, that `_differences` show."""
    off = _differences(known, height, exchanged=exchanged)
    if off.size < (_FEWEST_PAIRS if exchanged else _FEWEST_REPEATS):
        return None
    return max(float(_SIGMAS * np.median(np.abs(off)) / np.sqrt(2.0)), 1e-6)


def _differences(known: Samples, height: Floats, *, exchanged: bool) -> Floats:
    """Return differences of `height` (N,) of repeats of one direction, or of pairs with light and viewer exchanged."""
    if exchanged:
        first, second = exchanged_rows(known, one_side=True)
        off = height[first] - height[second]
    else:
        directions = np.rint(np.hstack([known.w_i, known.w_r]) / np.deg2rad(_SAME_DEG)).astype(np.int64)
        own = np.unique(directions, axis=0, return_inverse=True)[1].reshape(-1)
        order = np.argsort(own, kind="stable")
        off = np.diff(height[order])[np.diff(own[order]) == 0]
    return np.asarray(off[off != 0.0])  # a value that is listed twice is no repeat
