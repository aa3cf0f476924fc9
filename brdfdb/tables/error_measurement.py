"""The error of a table against its model, measured at directions that are not its nodes."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb._elementary import COS_HORIZON
from brdfdb.geometry import radians, unit_vector
from brdfdb.integrals.sampling import mirrored_in_lobe, mixture_density
from brdfdb.lobes import Lobe
from brdfdb.materials import FunctionRecord, Material, Source
from brdfdb.measurements import MeasuredSource
from brdfdb.measurements.extent import Extent
from brdfdb.models.shared_integrals import sharing
from brdfdb.parameters import Floats
from brdfdb.tables import places
from brdfdb.tables._interpolation import weights_of_nodes
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import PLAIN, Interpolation, Layout
from brdfdb.tables.places import BANDS_DEG
from brdfdb.tables.stated_error import Between, Error, Overall, Places
from brdfdb.tables.table import Table, points
from brdfdb.tables.table_source import TableSource
from brdfdb.tables.worst_pair import worst_pair

FLOOR = 1e-3  # share of the Lambertian BRDF with the albedo of the source
WIDTHS = (1.0, 2.0)  # widths of the lobes to draw directions from, relative to that of the source
# Directions in each band of theta_i. Tables of more than _FEW wavelengths use fewer: each wavelength is measured
DIRECTIONS = 4000
_FEW, _FEWER_DIRECTIONS = 4, 3000
SEED = 1991
# Directions of a sample in a place, and of a band between wavelengths, of those of a band at the wavelengths
_IN_PLACES, _BETWEEN, _BETWEEN_IN_PLACES = 1 / 10, 1 / 6, 1 / 15
_WITHIN, _CONFIDENCE = 0.98, 0.98  # share of the values within a limit, and how sure that is
_SEARCHED, _SEARCHED_AT = (9, 400), 40  # wavelengths of an interval, of all; directions of a band: for the worst
_THIN = 0.05  # share of the pairs that count below which they are drawn among those that were measured
_WINDOW = 1 << 21  # values of a table that are held at a time
_EVALUATED = 1 << 16  # directions at which the source is evaluated at a time


class Draw(NamedTuple):
    """Pairs of directions: unit vectors (N, 3), the band of theta_i of each, and what an integral weighs it with.

    `weight` is cos theta_r over the density with which the viewer was drawn; 0 below the horizon. `in_lobe` says which
    viewers were drawn in the lobe, `measured` which pairs count: of measured data those that are not extrapolated.
    """

    wi: Floats
    wr: Floats
    band: NDArray[np.int64]
    weight: Floats
    in_lobe: NDArray[np.bool_]
    measured: NDArray[np.bool_]

    @property
    def above(self) -> NDArray[np.bool_]:
        """Mask of the pairs that count: the viewer is above the horizon, and f_r is not extrapolated."""
        return np.asarray((self.weight > 0.0) & self.measured)

    def above_the_horizon(self) -> Draw:
        """Return the pairs whose viewer is above the horizon. Means that are weighed stay as they are."""
        kept = self.weight > 0.0
        weight = self.weight[kept] * np.mean(kept)
        return Draw(self.wi[kept], self.wr[kept], self.band[kept], weight, self.in_lobe[kept], self.measured[kept])


def draw(
    source: Source | FunctionRecord | None, wavelength_nm: NDArray[np.float64] | None, count: int, seed: int
) -> Draw:
    """Draw `count` pairs of directions a band, half of the viewers over the hemisphere and half in the lobe.

    theta_i is uniform in its band, phi_i in the circle. Over the hemisphere the solid angle is uniform; in the lobe the
    light is mirrored in half vectors that follow `Source.lobe`, of the wavelengths in turn, or a lobe twice as wide:
    its own distribution hardly ever reaches the shoulder where the lobe ends. All facets count alike, seen or not.
    Viewers of a source without a lobe, or of an unknown one, are all drawn over the hemisphere. Where hardly any of
    these pairs was measured, such as in a single plane, pairs are drawn evenly over those that were.
    """
    drawn = _over_all(source, wavelength_nm, count, seed)
    extent = _extent_of(source)
    if extent is None or np.count_nonzero(drawn.above) >= _THIN * len(drawn.wi):
        return drawn
    wi, wr = extent.drawn(len(drawn.wi), np.random.default_rng(seed))
    band = np.clip(np.searchsorted(radians(BANDS_DEG), np.arccos(wi[:, 2]), side="right") - 1, 0, BANDS_DEG.size - 2)
    order = np.argsort(band, kind="stable")
    wi, wr, band = wi[order], wr[order], band[order]
    weight = wr[:, 2] * np.sinc(np.arccos(wr[:, 2]) / np.pi)  # drawn evenly in theta (cos phi, sin phi)
    none = np.zeros(band.size, dtype=bool)
    return Draw(wi, wr, band, weight * (np.pi / weight.mean()), none, ~none)


def _over_all(
    source: Source | FunctionRecord | None, wavelength_nm: NDArray[np.float64] | None, count: int, seed: int
) -> Draw:
    """Draw pairs of directions as `draw` does, everywhere."""
    wi, over, u, angle, band, among = (array.copy() for array in _directions(count, seed))
    in_turn = None if wavelength_nm is None else wavelength_nm[np.arange(band.size) % wavelength_nm.size]
    lobe = None if source is None else source.lobe(wi[:, 2], in_turn)
    if lobe is None:
        none = np.zeros(band.size, dtype=bool)
        return Draw(wi, over, band, over[:, 2] * (2.0 * np.pi), none, _measured(source, wi, over))

    def wider(width: float | Floats) -> Lobe:
        return lobe._replace(
            share=np.ones(1), alpha_x=width * lobe.alpha_x, alpha_y=width * lobe.alpha_y, visible=False
        )

    which = among * 2 * len(WIDTHS)  # one half over the hemisphere, the other among the lobes
    in_lobe = which < len(WIDTHS)
    own = np.array(WIDTHS)[np.where(in_lobe, which, 0.0).astype(np.int64)]
    wr = np.where(in_lobe[:, np.newaxis], mirrored_in_lobe(u, angle, wi, wider(own)), over)
    density = 0.5 / (2.0 * np.pi) + 0.5 * np.mean([mixture_density(wider(width), wi, wr) for width in WIDTHS], axis=0)
    weight = np.where(wr[:, 2] > 0.0, wr[:, 2], 0.0) / density
    return Draw(wi, wr, band, weight, in_lobe, _measured(source, wi, wr))


@functools.lru_cache(maxsize=4)
def _directions(count: int, seed: int) -> tuple[NDArray[Any], ...]:
    """Return what draws of all sources share. Kept, because it takes half of the time of the error of a small table.

    Lights and viewers over the hemisphere, shape (N, 3); two numbers for a viewer in the lobe, in (0, 1] and in
    [0, 2 pi); the band of each light; a number in [0, 1) that chooses among lobes and hemisphere.
    """
    rng = np.random.default_rng(seed)
    band = np.repeat(np.arange(BANDS_DEG.size - 1), count)
    theta_i = radians(BANDS_DEG[band] + rng.random(band.size) * np.diff(BANDS_DEG)[band])
    wi = unit_vector(theta_i, rng.uniform(0.0, 2.0 * np.pi, band.size))
    u, angle = 1.0 - rng.random(band.size), rng.uniform(0.0, 2.0 * np.pi, band.size)
    return wi, unit_vector(np.arccos(u), angle), u, angle, band, rng.random(band.size)


def _measured(source: Source | FunctionRecord | None, wi: Floats, wr: Floats) -> NDArray[np.bool_]:
    """Return which pairs of unit vectors (N, 3) count: all, or of measured data those that are not extrapolated."""
    extent = _extent_of(source)
    return np.ones(len(wi), dtype=bool) if extent is None else ~extent.outside(wi, wr)


def _extent_of(source: Source | FunctionRecord | None) -> Extent | None:
    """Return the directions that were measured; None if all are known."""
    measured = source.measured if isinstance(source, MeasuredSource | TableSource) else None
    return None if measured is None else measured.extent


def model_values(source: Source, wavelength_nm: NDArray[np.float64] | None, wi: Floats, wr: Floats) -> Floats:
    """Return f_r [1/sr] of a source, of shape (N, L), L = 1 for a grey one."""
    brdf = source.brdf_at(wavelength_nm)
    values = np.empty((len(wi), 1 if wavelength_nm is None else wavelength_nm.size))
    with sharing():
        for start in range(0, len(wi), _EVALUATED):
            some = slice(start, start + _EVALUATED)
            values[some] = brdf(wi[some], wr[some])
    return values


def floor_of(truth: Floats, drawn: Draw) -> Floats:
    """Return the floor [1/sr] of relative errors at each wavelength: `FLOOR` of a Lambertian BRDF as bright."""
    return np.asarray(FLOOR / np.pi * np.mean(drawn.weight[:, np.newaxis] * truth, axis=0))


def relative(values: Floats, truth: Floats, floor: Floats) -> Floats:
    """Return the relative error [1], abs(values - truth) / max(truth, floor); 0 where both are 0."""
    scale = np.maximum(truth, floor)
    error = np.abs(values - truth)
    if np.min(floor) > 0.0:
        return error / scale  # in a third of the time
    return np.divide(error, scale, out=np.where(error > 0.0, np.inf, 0.0), where=scale > 0.0)


def mean_error(values: Floats, truth: Floats, weight: Floats) -> Floats:
    """Return the weighted mean of abs(values - truth) over that of truth, for each row of weights and wavelength."""
    wrong, whole = weight @ np.abs(values - truth), weight @ truth
    return np.divide(wrong, whole, out=np.zeros_like(wrong), where=whole > 0.0)


def classes(drawn: Draw) -> dict[str, NDArray[np.bool_]]:
    """Return which viewers of a draw look forward or back, within 45 degrees of azimuth, and which pairs graze."""
    wi, wr = drawn.wi, drawn.wr
    along = np.sum(wi[:, :2] * wr[:, :2], axis=1)
    across = np.hypot(*wi[:, :2].T) * np.hypot(*wr[:, :2].T)
    return {
        "forward": along < -np.sqrt(0.5) * across,
        "back": along > np.sqrt(0.5) * across,
        "grazing": np.minimum(wi[:, 2], wr[:, 2]) < np.cos(radians(75.0)),
    }


def measure(
    layout: Layout, read: Callable[[slice], NDArray[np.float32]], count: int | None = None, seed: int = SEED
) -> Error:
    """Measure the error of a table.

    Parameters
    ----------
    layout : Layout
        Of the table.
    read : callable
        Gives some rows of the first axis of the stored array. Large tables are read piece by piece.
    count : int, optional
        Directions a band of theta_i, by default 4000, or 3000 of more than four wavelengths.
    seed : int
        Of the directions.

    Returns
    -------
    Error
        For each band and wavelength, and overall, to three digits; and limits in places and between wavelengths. Of a
        mixture, at its worst wavelength alone.
    """
    count = directions_of_a_band(layout.wavelength_nm) if count is None else count
    drawn = draw(layout.source, layout.wavelength_nm, count, seed)
    pairs = places.draw(math.ceil(count * _IN_PLACES), seed)
    wi, wr = np.concatenate([drawn.wi, pairs.wi]), np.concatenate([drawn.wr, pairs.wr])
    truth = model_values(layout.source, layout.wavelength_nm, wi, wr)
    values = _looked_up(layout, read, wi, wr, layout.wavelength_nm)
    own = len(drawn.wi)
    inside = _measured(layout.source, pairs.wi, pairs.wr)
    error = compare(values[:own], truth[:own], drawn, seed)
    floor = np.array(error.floor)  # as it is stated, to three digits
    worst = worst_pair(
        np.where(drawn.above[:, np.newaxis], relative(values[:own], truth[:own], floor), -np.inf),
        truth[:own],
        floor,
        drawn.wi,
        drawn.wr,
        drawn.in_lobe,
        layout.source,
        layout.wavelength_nm,
    )
    measured = error.model_copy(
        update={
            "worst": worst,
            "places": limits_in_places(relative(truth[own:], values[own:], floor), pairs, inside),
            "between": None if floor.size < 2 else _between(layout, read, drawn, pairs, floor, count),
        }
    )
    return measured if layout.part_nm is None else measured.of_worst_wavelength()


def directions_of_a_band(wavelength_nm: NDArray[np.float64] | None) -> int:
    """Return how many directions of each band of theta_i the error of a table is measured at: those of every build."""
    return DIRECTIONS if wavelength_nm is None or wavelength_nm.size <= _FEW else _FEWER_DIRECTIONS


def _between(
    layout: Layout,
    read: Callable[[slice], NDArray[np.float32]],
    drawn: Draw,
    pairs: places.Pairs,
    floor: Floats,
    count: int,
) -> Between:
    """Measure the error between wavelengths, at some of the directions that it was measured at on them."""
    assert layout.wavelength_nm is not None
    few = _some(drawn, min(count, _SEARCHED_AT))
    how = layout.interpolation
    if layout.part_nm is not None or how.straight:  # f_r itself is interpolated
        how = replace(PLAIN, wavelengths=how.wavelengths)
    at = worst_wavelengths(layout.source, layout.wavelength_nm, how, drawn.wi[few], drawn.wr[few], floor)
    some = _some(drawn, math.ceil(count * _BETWEEN))
    fewer = pairs.some(_first(pairs.sample, math.ceil(count * _BETWEEN_IN_PLACES)))
    wi, wr = np.concatenate([drawn.wi[some], fewer.wi]), np.concatenate([drawn.wr[some], fewer.wr])
    values, truth = _looked_up(layout, read, wi, wr, at), model_values(layout.source, at, wi, wr)
    error = relative(truth, values, np.maximum(floor[1:], floor[:-1]))  # to what a lookup knows
    own = np.count_nonzero(some)
    elsewhere = ~places.anywhere(wi[:own], wr[:own])
    return Between(
        wavelength_nm=at.tolist(),
        bands=limits_of_bands(error[:own][elsewhere], drawn.band[some][elsewhere]),
        places=limits_in_places(error[own:], fewer, _measured(layout.source, fewer.wi, fewer.wr)),
        overall=not_less(limit_of(error[:own])),
    )


def worst_wavelengths(
    source: Source, stored: NDArray[np.float64], how: Interpolation, wi: Floats, wr: Floats, floor: Floats
) -> NDArray[np.float64]:
    """Return the wavelength [nm] inside each interval where interpolation of the source itself is worst.

    Nine or more wavelengths of an interval are tried, at a few pairs of directions `wi`, `wr`. `floor` is that of the
    `stored` wavelengths, `how` the interpolation of the table. The nodes of spectra are tried, too.
    """
    return np.array([worst.wavelength_nm for worst in worst_between(source, stored, how, wi, wr, floor)])


class WorstBetween(NamedTuple):
    """The wavelength [nm] of an interval at which interpolation of a source is worst, and its error there [1]."""

    wavelength_nm: float
    error: float


def worst_between(
    source: Source, stored: NDArray[np.float64], how: Interpolation, wi: Floats, wr: Floats, floor: Floats
) -> list[WorstBetween]:
    """Return where `worst_wavelengths` finds the largest 95th percentile of the error, and that, for each interval."""
    intervals = stored.size - 1
    within = max(_SEARCHED[0], _SEARCHED[1] // intervals)
    share = np.arange(1, within + 1) / (within + 1)
    at = (stored[:-1, np.newaxis] + np.diff(stored)[:, np.newaxis] * share).reshape(-1)
    if isinstance(source, Material) and source.spectra:
        kinks = np.unique(np.concatenate([spectrum.wavelengths_nm for spectrum in source.spectra.values()]))
        kinks = kinks[(kinks > stored[0]) & (kinks < stored[-1])]
        at = np.union1d(at, kinks[~np.isin(kinks, stored)])
    mu = np.maximum(wi[:, 2], COS_HORIZON) * np.maximum(wr[:, 2], COS_HORIZON)
    numbers = how.numbers(model_values(source, stored, wi, wr), mu)
    nodes, weight = weights_of_nodes(stored, at, cubic=not how.straight)
    interval = np.searchsorted(stored, at) - 1
    error = relative(  # to what a lookup knows
        model_values(source, at, wi, wr),
        np.maximum(how.f_r(np.sum(numbers[:, nodes] * weight, axis=-1), mu), 0.0),
        np.maximum(floor[1:], floor[:-1])[interval],
    )
    of_each = np.percentile(error, 95.0, axis=0)
    worst = []
    for number in range(intervals):
        inside = np.flatnonzero(interval == number)
        most = inside[np.argmax(of_each[inside])]
        worst.append(WorstBetween(float(at[most]), float(of_each[most])))
    return worst


def limits_of_bands(error: Floats, band: NDArray[np.int64]) -> list[list[float]]:
    """Return the limit of errors (N, columns) in each band of theta_i."""
    return [not_less(limit_of(error[band == row])) for row in range(places.BANDS)]


def _some(drawn: Draw, count: int) -> NDArray[np.bool_]:
    """Return which pairs count, of the first `count` of each band; all that do where none of these does."""
    first = _first(drawn.band, count) & drawn.above
    return first if first.any() else drawn.above


def _first(sample: NDArray[np.int64], count: int) -> NDArray[np.bool_]:
    """Return which members of samples are among the first `count` of theirs; those of a sample stand together."""
    return np.asarray(np.arange(sample.size) - np.searchsorted(sample, sample) < count)


def limits_in_places(error: Floats, pairs: places.Pairs, inside: NDArray[np.bool_]) -> Places:
    """Return limits of errors (N, columns) at pairs drawn in places: the largest of the samples of each place.

    `inside` says which pairs count. The limit of a place without any is 0.
    """
    rows: dict[int, Floats] = {}
    ends = np.searchsorted(pairs.sample, np.arange(pairs.sample[-1] + 2))  # those of a sample stand together
    for members in map(slice, ends[:-1], ends[1:]):
        row = int(pairs.row[members][0])
        rows[row] = np.maximum(rows.get(row, 0.0), limit_of(error[members][inside[members]]))

    limits = {row: not_less(limit) for row, limit in rows.items()}
    return Places(
        alongside=[limits[row] for row in range(places.ALONGSIDE, places.ONE_GRAZING)],
        one_grazing=[limits[row] for row in range(places.ONE_GRAZING, places.BOTH_GRAZING)],
        both_grazing=[limits[row] for row in range(places.BOTH_GRAZING, places.ROWS)],
    )


def limit_of(error: Floats) -> Floats:
    """Return the limit that `_WITHIN` of all errors are within, with `_CONFIDENCE`, of a sample (N, columns)."""
    if len(error) == 0:
        return np.zeros(error.shape[1])
    return np.asarray(np.sort(error, axis=0)[-rank_of_limit(len(error), _WITHIN, _CONFIDENCE)])


@functools.cache
def rank_of_limit(count: int, within: float, confidence: float) -> int:
    """Return which of so many values, from the largest, 1 or more, bounds the quantile `within` of all values.

    The number of values beyond the quantile is binomial. That fewer than the rank are is the chance of a limit that is
    too low: at most 1 - `confidence`, unless the values are too few for that.
    """
    rank, chance = 0, 0.0  # the chance that no more than `rank` are beyond
    while True:
        ways = math.lgamma(count + 1) - math.lgamma(rank + 1) - math.lgamma(count - rank + 1)
        chance += math.exp(ways + rank * math.log(1.0 - within) + (count - rank) * math.log(within))
        if chance > 1.0 - confidence:
            return max(rank, 1)
        rank += 1


def compare(values: Floats, truth: Floats, drawn: Draw, seed: int = SEED) -> Error:
    """Return the error of values of f_r, shape (N, L), against the truth at the directions of a draw that count.

    A band of theta_i without any, in which nothing was measured, repeats the error of all bands.
    """
    floor = floor_of(truth, drawn)
    count = BANDS_DEG.size - 1
    above = drawn.above
    bands_of = [above & (drawn.band == band) for band in range(count)]
    chosen = [rows if rows.any() else above for rows in bands_of] + [above]  # each band of theta_i, then all of them
    l1 = mean_error(values, truth, np.where(chosen, drawn.weight, 0.0))
    error = np.ascontiguousarray(relative(values, truth, floor).T)
    percentiles = [np.percentile(error[:, rows], [50.0, 95.0, 99.0, 100.0], axis=1) for rows in chosen]
    # [statistic][band][wavelength]
    bands = np.stack([l1[:-1], *np.moveaxis(np.stack(percentiles[:-1]), 1, 0)])
    worst = np.concatenate([[l1[-1].max()], percentiles[-1].max(axis=-1)])
    names = tuple(Overall.model_fields)
    return Error.model_validate(
        {
            "theta_i_deg": BANDS_DEG.tolist(),
            "directions": int(np.count_nonzero(above)),
            "seed": seed,
            "floor": _short(floor),
            "overall": dict(zip(names, _short(worst), strict=True)),
            **{name: [_short(row) for row in rows] for name, rows in zip(names, bands, strict=True)},
        }
    )


def _looked_up(
    layout: Layout,
    read: Callable[[slice], NDArray[np.float32]],
    wi: Floats,
    wr: Floats,
    wavelength_nm: NDArray[np.float64] | None,
) -> Floats:
    """Return values (N, L) of a table at directions, read in windows of rows with one more on either side."""
    rows = layout.shape[0]
    step = max(2, min(rows, _WINDOW // (layout.size // rows)))
    values = np.zeros((len(wi), 1 if wavelength_nm is None else wavelength_nm.size))
    if step >= rows:
        return Table.of(layout, read(slice(0, rows))).lookup_vectors(wi, wr, wavelength_nm).reshape(values.shape)
    grid = layout.grid
    x = points(grid, wi, wr)
    row = np.clip(np.searchsorted(radians(next(iter(grid.axes.values()))), x[0], side="right") - 1, 0, rows - 2)
    for start in range(0, rows - 1, step):
        inside = (row >= start) & (row < start + step)
        window = slice(max(start - 1, 0), min(start + step + 2, rows))
        table = Table.of(layout, read(window), Grid.part(grid, window))
        values[inside] = table.lookup_vectors(wi[inside], wr[inside], wavelength_nm).reshape(-1, values.shape[1])
    return values


def not_less(values: Floats) -> list[float]:
    """Return numbers to three digits, rounded up: errors that are all alike would exceed a smaller limit."""
    return [float(f"{1.00501 * value:.3g}") for value in values.tolist()]


def _short(values: Floats) -> list[float]:
    """Return numbers to three digits."""
    return [float(f"{value:.3g}") for value in values.tolist()]
