"""Trials of a plan: tables that are tabulated and measured, and the finished one with its values."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.materials import Source
from brdfdb.parameters import Floats
from brdfdb.tables import error_measurement, places, tabulation
from brdfdb.tables.layout import Layout
from brdfdb.tables.mixture import Mixture
from brdfdb.tables.table import Table

MARGIN = 0.88  # share of the tolerance that a plan may use: the final measurement draws other directions
SEED = 1994
_DRAWS = 2000  # pairs of directions in a band of theta_i, for the finished table
_OF_A_BAND = 30.0  # largest 99th percentile of a band of theta_i, in units of the tolerance
_NEAR_THE_LIGHT = 200  # pairs of each sample near the light
_SOME = 8  # one in eight pairs is measured first
_BITS = range(9, 24)
_WORTH_ROUNDING = 4096  # smallest number of values of a table that is rounded


class HotSpot(NamedTuple):
    """Pairs near the light, f_r [1/sr] there, and the tolerance over that near the light."""

    pairs: places.Pairs
    truth: Floats
    scale: float


class PlanSample(NamedTuple):
    """Pairs of directions above the horizon, f_r [1/sr] there, shape (N, L), and the floor of relative errors, (L,).

    `hot_spot` has pairs near the light if their error has a tolerance of its own.
    """

    drawn: error_measurement.RandomPairs
    truth: Floats
    floor: Floats
    hot_spot: HotSpot | None = None

    def at(self, wavelengths: NDArray[np.bool_]) -> PlanSample:
        """Return the sample at some of its wavelengths."""
        spot = self.hot_spot and self.hot_spot._replace(truth=self.hot_spot.truth[:, wavelengths])
        return self._replace(truth=self.truth[:, wavelengths], floor=self.floor[wavelengths], hot_spot=spot)

    @property
    def for_lines(self) -> error_measurement.RandomPairs:
        """The pairs that lines are drawn through: those near the light, too, if their error has a tolerance."""
        if self.hot_spot is None:
            return self.drawn
        pairs = self.hot_spot.pairs
        wi = np.concatenate([self.drawn.wi, pairs.wi])
        wr = np.concatenate([self.drawn.wr, pairs.wr])
        order = np.random.default_rng(SEED).permutation(len(wi))
        ones = np.ones(len(wi))
        none = np.zeros(len(wi), dtype=bool)
        return error_measurement.RandomPairs(wi[order], wr[order], np.zeros(len(wi), np.int64), ones, none, ~none)


class TrialErrors(NamedTuple):
    """Relative errors of a table, of the shape of the truth, and its l1 errors, of shape (L,)."""

    relative: Floats
    l1: Floats


class PlannedTable(NamedTuple):
    """The layout of a plan, and the values of its table, those of `tabulation.block`; None if none were tabulated."""

    layout: Layout
    values: NDArray[np.float32] | None


def sample_of(
    source: Source, wavelength_nm: NDArray[np.float64] | None, count: int, seed: int, hot_spot: float | None = None
) -> PlanSample:
    """Draw a sample of a source at wavelengths [nm], of `count` pairs a band above the horizon.

    `hot_spot` is the tolerance over that near the light; None: there is none near the light.
    """
    drawn = error_measurement.draw(source, wavelength_nm, count, seed).above_the_horizon()
    truth = error_measurement.model_values(source, wavelength_nm, drawn.wi, drawn.wr)
    sample = PlanSample(drawn, truth, error_measurement.floor_of(truth, drawn))
    if hot_spot is None:
        return sample
    pairs = places.draw(_NEAR_THE_LIGHT, seed)
    pairs = pairs.some(pairs.row < places.ONE_GRAZING)
    there = error_measurement.model_values(source, wavelength_nm, pairs.wi, pairs.wr)
    return sample._replace(hot_spot=HotSpot(pairs, there, hot_spot))


def error_of(layout: Layout, values: NDArray[np.float32], sample: PlanSample) -> float:
    """Return the largest of the errors that the tolerance limits.

    They are the 99th percentile of the relative error at the worst wavelength; the l1 error, since a few values next to
    a pole that are wrong by orders of magnitude do not change a percentile; `hot_spot_error`; and the 99th percentile
    of each band of theta_i over `_OF_A_BAND`, since grazing light is only a ninth of the directions.
    """
    error, l1 = _errors(layout, values, sample)
    counts = sample.drawn.above
    counted = np.ascontiguousarray(error[counts].T)
    band = sample.drawn.band[counts]
    worst = max(np.percentile(counted, 99, axis=1).max(), l1.max(), hot_spot_error(layout, values, sample))
    if counted.max() > _OF_A_BAND * worst:  # else no band can be worse
        for row in np.unique(band):
            worst = max(worst, np.percentile(counted[:, band == row], 99, axis=1).max() / _OF_A_BAND)
    return float(worst)


def hot_spot_error(layout: Layout, values: NDArray[np.float32], sample: PlanSample) -> float:
    """Return the limit of the error near the light, in its worst band, in units of the tolerance; 0 without one."""
    if sample.hot_spot is None:
        return 0.0
    pairs, truth, scale = sample.hot_spot
    looked_up = Table.of(layout, values).lookup_vectors(pairs.wi, pairs.wr).reshape(truth.shape)
    error = error_measurement.relative(truth, looked_up, sample.floor).max(axis=1)
    of_samples = error.reshape(pairs.sample[-1] + 1, -1)
    return scale * float(error_measurement.limit_of(of_samples.T).max())


def _errors(layout: Layout, values: NDArray[np.float32], sample: PlanSample) -> TrialErrors:
    """Return the errors of a table at a sample."""
    drawn, truth, floor, _ = sample
    looked_up = Table.of(layout, values).lookup_vectors(drawn.wi, drawn.wr).reshape(truth.shape)
    error = error_measurement.relative(looked_up, truth, floor)
    return TrialErrors(error, error_measurement.mean_error(looked_up, truth, drawn.weight))


def keeps(layout: Layout, values: NDArray[np.float32], sample: PlanSample, goal: float) -> bool:
    """Return True if `error_of` a table is at most a goal; a few directions are tried first.

    Errors are counted, not sorted, which takes a tenth of the time.
    """
    drawn, truth, floor, _ = sample
    few = slice(None, None, _SOME)
    looked_up = Table.of(layout, values).lookup_vectors(drawn.wi[few], drawn.wr[few]).reshape(truth[few].shape)
    error = error_measurement.relative(looked_up, truth[few], floor)
    beyond = np.count_nonzero((error > goal) & drawn.above[few, np.newaxis], axis=0).max()
    most = 0.01 * np.count_nonzero(drawn.above) + 2.0  # with more the 99th percentile of all is beyond the goal
    if beyond > most:
        return False
    error, l1 = _errors(layout, values, sample)
    counted = error[drawn.above]
    if not (l1.max() <= goal and _within(counted, goal) and hot_spot_error(layout, values, sample) <= goal):
        return False
    band = drawn.band[drawn.above]
    limit = _OF_A_BAND * goal
    return counted.max() <= limit or all(_within(counted[band == row], limit) for row in np.unique(band))


def _within(error: Floats, limit: float) -> bool:
    """Return True if the 99th percentile of each column of errors is within a limit."""
    place = 0.99 * (len(error) - 1)  # of the percentile, which lies between two errors, in the order of size
    beyond = np.count_nonzero(error > limit, axis=0)
    if beyond.max() >= len(error) - math.floor(place):
        return False
    between = beyond == len(error) - 1 - math.floor(place)
    return not between.any() or bool(np.percentile(error[:, between], 99, axis=0).max() <= limit)


def values_of(layout: Layout) -> NDArray[np.float32]:
    """Return the values of a whole table as they are stored, of the shape of the layout."""
    return np.concatenate([tabulation.block(layout, rows) for rows in layout.blocks])


def final_of(source: Source, wavelength_nm: NDArray[np.float64] | None, hot_spot: float | None = None) -> PlanSample:
    """Return the sample that finished tables of a source are measured at, at all wavelengths [nm]."""
    return sample_of(source, wavelength_nm, _DRAWS, SEED + 1, hot_spot)


def finished(
    layout: Layout,
    final: PlanSample,
    wavelength_nm: NDArray[np.float64] | None,
    tolerance: float,
    mixture: Mixture | None,
) -> PlannedTable | None:
    """Return the layout at all wavelengths, with as few coefficients and bits as the error allows, and its values.

    None if no number of coefficients and bits keeps to the tolerance.
    """
    goal = MARGIN * tolerance
    reason = f"the smallest of those tried that keep 99 of 100 values within {tolerance:g} of the model, relative"
    if mixture is not None or wavelength_nm is None or not layout.interpolation.logarithm:
        spectra = None if mixture is None else mixture.spectra
        if mixture is None and wavelength_nm is not None and layout.wavelength_nm is not None:
            few = np.isin(wavelength_nm, layout.wavelength_nm)  # a table that fails at these fails at all of them
            if not few.all() and not keeps(layout, values_of(layout), final.at(few), goal):
                return None
        layout = replace(layout, wavelength_nm=wavelength_nm, reason=reason, spectra=spectra)
        return _rounded(layout, values_of(layout), None, final, goal)
    assert layout.wavelength_nm is not None
    numbers = _numbers(layout)
    few = np.isin(wavelength_nm, layout.wavelength_nm)
    if not few.all():
        if not keeps(layout, _as_values(layout, numbers), final.at(few), goal):
            return None
        known = numbers
        numbers = np.empty((*layout.grid.shape, wavelength_nm.size))
        numbers[..., few] = known
        numbers[..., ~few] = _numbers(replace(layout, wavelength_nm=wavelength_nm[~few]))
    layout = replace(layout, wavelength_nm=wavelength_nm, reason=reason)
    whole = _as_values(layout, numbers)
    if wavelength_nm.size > 2:
        rows = whole.reshape(-1, wavelength_nm.size).astype(np.float64)
        significance = np.exp(np.minimum(np.max(rows - np.log(final.floor), axis=1, keepdims=True), 0.0))
        seen = rows * significance
        basis = np.linalg.eigh(seen.T @ seen).eigenvectors[:, ::-1].T  # the spectra that say most come first
        for parts in range(1, wavelength_nm.size // 2 + 1):
            factored = replace(layout, spectra=basis[:parts])
            values = (rows @ basis[:parts].T).astype(np.float32).reshape(factored.shape)
            if keeps(factored, values, final, goal):
                layout = factored
                whole = values
                break
    return _rounded(layout, whole, numbers, final, goal)


def _rounded(
    layout: Layout, whole: NDArray[np.float32], numbers: Floats | None, final: PlanSample, goal: float
) -> PlannedTable | None:
    """Return the layout with as few bits as the error allows, and its values; None if no number of bits does.

    `numbers` are those of the nodes of a spectrum that may be factored: `whole` has the coefficients to the last digits
    only, because a BLAS sums them.
    """
    for bits in _BITS if layout.size > _WORTH_ROUNDING else (23,):
        values = tabulation.rounded(whole, bits)
        if keeps(replace(layout, bits=bits), values, final, goal):
            if layout.spectra is not None and numbers is not None:
                stored = [
                    _as_values(layout, numbers[rows]) for rows in tabulation.slabs(layout, slice(0, len(numbers)))
                ]
                values = tabulation.rounded(np.concatenate(stored), bits)
            return PlannedTable(replace(layout, bits=bits), values)
    return None


def _numbers(layout: Layout) -> Floats:
    """Return the numbers of all nodes at all wavelengths."""
    rows = slice(0, layout.grid.shape[0])
    return np.concatenate([tabulation.node_numbers(layout, some) for some in tabulation.slabs(layout, rows)])


def _as_values(layout: Layout, numbers: Floats) -> NDArray[np.float32]:
    """Return the values of a table that some rows of numbers make."""
    return tabulation.stored(layout, numbers).astype(np.float32).reshape(len(numbers), *layout.shape[1:])
