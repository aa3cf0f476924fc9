"""Measurement of the error of a table against its source, at random directions between its nodes."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb._elementary import COS_HORIZON
from brdfdb.geometry import degrees, radians, unit_vector
from brdfdb.integrals.sampling import mirrored_in_lobe, mixture_density
from brdfdb.lobes import Lobe
from brdfdb.materials import FunctionRecord, Material, Source
from brdfdb.measurements import MeasuredSource
from brdfdb.measurements.extent import Extent
from brdfdb.models.shared_integrals import sharing
from brdfdb.parameters import Floats
from brdfdb.tables import places
from brdfdb.tables._interpolation import weights_of_nodes
from brdfdb.tables.grids import Axis, Grid
from brdfdb.tables.layout import PLAIN, Interpolation, Layout
from brdfdb.tables.places import ALONGSIDE_DEG, BANDS_DEG, RINGS_DEG
from brdfdb.tables.stated_error import Between, Error, Overall, Places, WorstPair
from brdfdb.tables.table import Table, TableSource, points

FLOOR = 1e-3  # share of the Lambertian BRDF with the albedo of the source
WIDTHS = (1.0, 2.0)  # widths of the lobes that viewers are drawn from, relative to the lobe of the source
DIRECTIONS = 4000  # pairs of directions in each band of theta_i
# Each wavelength is measured: tables of more than _FEW wavelengths use fewer pairs
_FEW = 4
_FEWER_DIRECTIONS = 3000  # the same for such tables
SEED = 1991
# Numbers of pairs as shares of those of a band
_IN_PLACES = 1 / 10  # of a sample in a place
_BETWEEN = 1 / 6  # of a band, between wavelengths
_BETWEEN_IN_PLACES = 1 / 15  # of a sample in a place, between wavelengths
_SHARES = np.array([0.5, 0.95, 0.99, 1.0])  # of the values below the percentiles that are stated
_WITHIN = 0.98  # share of the values within a limit
_CONFIDENCE = 0.98  # probability that at least this share is within
_SEARCHED_AT = 40  # pairs in a band at which the worst wavelength of an interval is searched
_SEARCHED_WAVELENGTHS = 9  # smallest number of wavelengths that are tried in an interval
_SEARCHED_IN_ALL = 400  # number of wavelengths that are tried in all intervals together
_THIN = 0.05  # smallest share of random pairs that were measured; pairs of thinner data are drawn within their extent
_ROUNDING = 1e-5  # relative error that float32 and the bits of a table leave
_WINDOW = 1 << 21  # number of values of a table in memory
_EVALUATED = 1 << 16  # number of pairs of directions at which the source is evaluated together

Read = Callable[[slice], NDArray[np.float32]]  # rows of the first axis of a stored array


class RandomPairs(NamedTuple):
    """Random pairs of directions: unit vectors `wi` of the light and `wr` of the viewer (N, 3).

    `band` is the index of the band of theta_i, `weight` cos theta_r over the density of the viewer, as integrals need
    it, and 0 below the horizon. `in_lobe` is True for viewers that were drawn in the lobe, `measured` False for pairs
    outside of the directions that measured data cover.
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

    def some(self, rows: NDArray[np.bool_]) -> RandomPairs:
        """Return the pairs that a mask selects."""
        return RandomPairs(
            self.wi[rows], self.wr[rows], self.band[rows], self.weight[rows], self.in_lobe[rows], self.measured[rows]
        )

    def above_the_horizon(self) -> RandomPairs:
        """Return the pairs whose viewer is above the horizon. Weighted means do not change."""
        above = self.weight > 0.0
        return self.some(above)._replace(weight=self.weight[above] * np.mean(above))

    def classes(self) -> dict[str, NDArray[np.bool_]]:
        """Return which viewers look forward or back, within 45 degrees of azimuth, and which pairs are near grazing."""
        along = np.sum(self.wi[:, :2] * self.wr[:, :2], axis=1)
        across = np.hypot(*self.wi[:, :2].T) * np.hypot(*self.wr[:, :2].T)
        return {
            "forward": along < -np.sqrt(0.5) * across,
            "back": along > np.sqrt(0.5) * across,
            "grazing": np.minimum(self.wi[:, 2], self.wr[:, 2]) < np.cos(radians(75.0)),
        }

    def first_of_bands(self, count: int) -> NDArray[np.bool_]:
        """Return a mask of the pairs that count among the first `count` of each band, or among all without any."""
        first = _among_first(self.band, count) & self.above
        return first if first.any() else self.above


class _RandomDirections(NamedTuple):
    """Random numbers that the draws of all sources share.

    `lights` are uniform in their `band` of theta_i, `viewers` over the hemisphere, unit vectors (N, 3). `u` in (0, 1]
    and `angle` in [0, 2 pi) are for a viewer in a lobe, `selector` in [0, 1) chooses among hemisphere and lobes.
    """

    lights: Floats
    viewers: Floats
    u: Floats
    angle: Floats
    band: NDArray[np.int64]
    selector: Floats


@functools.lru_cache(maxsize=4)  # drawing takes half of the time of the error of a small table
def _random_directions(count: int, seed: int) -> _RandomDirections:
    """Return `count` random directions in each band of theta_i."""
    rng = np.random.default_rng(seed)
    band = np.repeat(np.arange(BANDS_DEG.size - 1), count)
    theta_i = radians(BANDS_DEG[band] + rng.random(band.size) * np.diff(BANDS_DEG)[band])
    lights = unit_vector(theta_i, rng.uniform(0.0, 2.0 * np.pi, band.size))
    u = 1.0 - rng.random(band.size)
    angle = rng.uniform(0.0, 2.0 * np.pi, band.size)
    drawn = _RandomDirections(lights, unit_vector(np.arccos(u), angle), u, angle, band, rng.random(band.size))
    for array in drawn:
        array.flags.writeable = False  # pairs of all sources share them
    return drawn


def draw(source: Source | FunctionRecord | None, wavelength_nm: Axis | None, count: int, seed: int) -> RandomPairs:
    """Draw `count` pairs of directions in each band of theta_i, half of the viewers in the lobe of the source.

    theta_i is uniform in its band, phi_i in the circle. The other viewers are uniform over the solid angle of the
    hemisphere. In the lobe the light is mirrored in half vectors that follow `Source.lobe`, of the wavelengths in
    turn, or a lobe twice as wide: the distribution of the lobe hardly ever reaches its shoulder. Masked facets are
    counted too. All viewers are drawn over the hemisphere if the source has no lobe, or is not known. If less than 5 %
    of these pairs were measured, for example in a single plane, pairs are drawn evenly over those that were.
    """
    pairs = _draw_everywhere(source, wavelength_nm, count, seed)
    extent = _extent_of(source)
    if extent is None or np.count_nonzero(pairs.above) >= _THIN * len(pairs.wi):
        return pairs
    wi, wr = extent.drawn(len(pairs.wi), np.random.default_rng(seed))
    band = np.clip(np.searchsorted(radians(BANDS_DEG), np.arccos(wi[:, 2]), side="right") - 1, 0, BANDS_DEG.size - 2)
    order = np.argsort(band, kind="stable")
    wi = wi[order]
    wr = wr[order]
    band = band[order]
    weight = wr[:, 2] * np.sinc(np.arccos(wr[:, 2]) / np.pi)  # drawn evenly in theta (cos phi, sin phi)
    none = np.zeros(band.size, dtype=bool)
    return RandomPairs(wi, wr, band, weight * (np.pi / weight.mean()), none, ~none)


def _draw_everywhere(
    source: Source | FunctionRecord | None, wavelength_nm: Axis | None, count: int, seed: int
) -> RandomPairs:
    """Draw pairs of directions as `draw` does, wherever the data of a measured source lie."""
    samples = _random_directions(count, seed)
    lights = samples.lights
    band = samples.band
    in_turn = None if wavelength_nm is None else wavelength_nm[np.arange(band.size) % wavelength_nm.size]
    lobe = None if source is None else source.lobe(lights[:, 2], in_turn)
    if lobe is None:
        viewers = samples.viewers
        none = np.zeros(band.size, dtype=bool)
        return RandomPairs(
            lights, viewers, band, viewers[:, 2] * (2.0 * np.pi), none, _measured(source, lights, viewers)
        )

    # Each viewer comes from the hemisphere (probability 1/2), or from a lobe of one of the widths (1/2 in total)
    choice = samples.selector * 2 * len(WIDTHS)
    from_lobe = choice < len(WIDTHS)
    width = np.array(WIDTHS)[np.where(from_lobe, choice, 0.0).astype(np.int64)]
    lobe_viewers = mirrored_in_lobe(samples.u, samples.angle, lights, _widened(lobe, width))
    viewers = np.where(from_lobe[:, np.newaxis], lobe_viewers, samples.viewers)

    hemisphere_pdf = 1.0 / (2.0 * np.pi)
    lobe_pdf = np.mean([mixture_density(_widened(lobe, width), lights, viewers) for width in WIDTHS], axis=0)
    pdf = 0.5 * hemisphere_pdf + 0.5 * lobe_pdf
    weight = np.where(viewers[:, 2] > 0.0, viewers[:, 2], 0.0) / pdf
    return RandomPairs(lights, viewers, band, weight, from_lobe, _measured(source, lights, viewers))


def _widened(lobe: Lobe, width: float | Floats) -> Lobe:
    """Return a lobe of all facets, masked ones too, with widths that are larger by a factor."""
    return lobe._replace(share=np.ones(1), alpha_x=width * lobe.alpha_x, alpha_y=width * lobe.alpha_y, visible=False)


def _measured(source: Source | FunctionRecord | None, wi: Floats, wr: Floats) -> NDArray[np.bool_]:
    """Return a mask of pairs of unit vectors (N, 3), False where f_r of measured data is extrapolated."""
    extent = _extent_of(source)
    return np.ones(len(wi), dtype=bool) if extent is None else ~extent.outside(wi, wr)


def _extent_of(source: Source | FunctionRecord | None) -> Extent | None:
    """Return the directions that were measured; None if f_r is known everywhere."""
    measured = source.measured if isinstance(source, MeasuredSource | TableSource) else None
    return None if measured is None else measured.extent


def model_values(source: Source, wavelength_nm: Axis | None, wi: Floats, wr: Floats) -> Floats:
    """Return f_r [1/sr] of a source, of shape (N, L), L = 1 for a grey source."""
    brdf = source.brdf_at(wavelength_nm)
    values = np.empty((len(wi), 1 if wavelength_nm is None else wavelength_nm.size))
    with sharing():
        for start in range(0, len(wi), _EVALUATED):
            rows = slice(start, start + _EVALUATED)
            values[rows] = brdf(wi[rows], wr[rows])
    return values


def floor_of(truth: Floats, pairs: RandomPairs) -> Floats:
    """Return the floor [1/sr] of relative errors at each wavelength: `FLOOR` of a Lambertian BRDF as bright."""
    return np.asarray(FLOOR / np.pi * np.mean(pairs.weight[:, np.newaxis] * truth, axis=0))


def relative(values: Floats, truth: Floats, floor: Floats) -> Floats:
    """Return the relative error [1], abs(values - truth) / max(truth, floor); 0 where both are 0."""
    scale = np.maximum(truth, floor)
    error = np.abs(values - truth)
    if np.min(floor) > 0.0:
        return error / scale  # in a third of the time
    return np.divide(error, scale, out=np.where(error > 0.0, np.inf, 0.0), where=scale > 0.0)


def mean_error(values: Floats, truth: Floats, weight: Floats) -> Floats:
    """Return the weighted mean of abs(values - truth) over that of truth, for each row of weights and wavelength."""
    difference = weight @ np.abs(values - truth)
    total = weight @ truth
    return np.divide(difference, total, out=np.zeros_like(difference), where=total > 0.0)


def directions_of_a_band(wavelength_nm: Axis | None) -> int:
    """Return the number of pairs of directions in each band of theta_i for the error of a table, as in every build."""
    return DIRECTIONS if wavelength_nm is None or wavelength_nm.size <= _FEW else _FEWER_DIRECTIONS


class _Compared(NamedTuple):
    """f_r [1/sr] of a table and of its source, shape (N, L)."""

    values: Floats
    truth: Floats


def _compared(
    layout: Layout, read: Read, wavelength_nm: Axis | None, *drawn: RandomPairs | places.Pairs
) -> list[_Compared]:
    """Return f_r of a table and of its source, at each draw of pairs."""
    values = _looked_up(layout, read, drawn, wavelength_nm)
    truth = (model_values(layout.source, wavelength_nm, pairs.wi, pairs.wr) for pairs in drawn)
    return [*map(_Compared, values, truth)]


def measure(layout: Layout, read: Read, count: int | None = None, seed: int = SEED) -> Error:
    """Measure the error of a table in each band and wavelength, overall, in places and between wavelengths.

    Parameters
    ----------
    layout : Layout
        Layout of the table. The error of a mixture is that at its worst wavelength alone.
    read : callable
        Gives some rows of the first axis of the stored array. Large tables are read piece by piece.
    count, seed : int
        Number of directions in a band of theta_i, by default 4000, or 3000 for more than four wavelengths; their seed.
    """
    count = directions_of_a_band(layout.wavelength_nm) if count is None else count
    pairs = draw(layout.source, layout.wavelength_nm, count, seed)
    near = places.draw(math.ceil(count * _IN_PLACES), seed)
    everywhere, in_places = _compared(layout, read, layout.wavelength_nm, pairs, near)
    error = compare(everywhere.values, everywhere.truth, pairs, seed)
    floor = np.array(error.floor)  # as it is stated, to three digits
    of_source = relative(everywhere.values, everywhere.truth, floor)
    of_table = relative(in_places.truth, in_places.values, floor)
    measured = error.model_copy(
        update={
            "worst": worst_pair(of_source, everywhere.truth, floor, pairs, layout.source, layout.wavelength_nm),
            "places": limits_in_places(of_table, near, _measured(layout.source, near.wi, near.wr)),
            "between": None if floor.size < 2 else _between(layout, read, pairs, near, floor, count),
        }
    )
    return measured if layout.part_nm is None else measured.of_worst_wavelength()


def worst_pair(
    error: Floats, truth: Floats, floor: Floats, pairs: RandomPairs, source: Source, wavelength_nm: Axis | None
) -> WorstPair:
    """Return the pair of directions that counts with the largest relative error (N, L) [1], and why it is large there.

    `truth` (N, L) [1/sr] is f_r of the source. Below `floor` (L,) [1/sr] an error is relative to the floor.
    """
    error = np.where(pairs.above[:, np.newaxis], error, -np.inf)
    row, column = np.unravel_index(int(np.argmax(error)), error.shape)
    light = pairs.wi[row]
    viewer = pairs.wr[row]
    theta_i, theta_r = (float(degrees(np.arccos(np.clip(w[2], -1.0, 1.0)))) for w in (light, viewer))
    turn = np.arctan2(viewer[1], viewer[0]) - np.arctan2(light[1], light[0])
    delta_phi = abs((float(degrees(turn)) + 180.0) % 360.0 - 180.0)
    grazing = sum(theta >= RINGS_DEG[0] for theta in (theta_i, theta_r))
    steep = "grows without bound" if source.grazing_pole else "changes fast"
    if error[row, column] < _ROUNDING:
        why = "it is rounding"
    elif grazing:
        which = "both directions are" if grazing == 2 else "one direction is"
        why = f"{which} near the horizon, where f_r {steep}"
    elif truth[row, column] <= floor[column]:
        why = "f_r is less than the floor there, and errors are relative to the floor"
    elif source.has_lobe and pairs.in_lobe[row]:
        why = "the viewer is in the lobe, where f_r changes most"
    elif abs(theta_i - theta_r) <= ALONGSIDE_DEG and delta_phi <= 90.0:
        why = "the viewer is beside the light, where f_r has a ridge"
    else:
        why = "f_r is bent there"
    return WorstPair(
        theta_i_deg=round(theta_i, 2),
        theta_r_deg=round(theta_r, 2),
        delta_phi_deg=round(delta_phi, 2),
        wavelength_nm=None if wavelength_nm is None else float(wavelength_nm[column]),
        why=why,
    )


def _between(layout: Layout, read: Read, pairs: RandomPairs, near: places.Pairs, floor: Floats, count: int) -> Between:
    """Measure the error between wavelengths, at some of the directions of the error on wavelengths."""
    assert layout.wavelength_nm is not None
    searched = pairs.first_of_bands(min(count, _SEARCHED_AT))
    interpolation = layout.interpolation
    if layout.part_nm is not None or interpolation.straight:  # f_r itself is interpolated
        interpolation = replace(PLAIN, wavelengths=interpolation.wavelengths)
    worst = worst_between(
        layout.source, layout.wavelength_nm, interpolation, pairs.wi[searched], pairs.wr[searched], floor
    )
    wavelength_nm = np.array([place.wavelength_nm for place in worst])
    chosen = pairs.first_of_bands(math.ceil(count * _BETWEEN))
    pairs = pairs.some(chosen)
    near = near.some(_among_first(near.sample, math.ceil(count * _BETWEEN_IN_PLACES)))
    # The error is relative to the table, the only value that a lookup knows
    everywhere, in_places = (
        relative(truth, values, np.maximum(floor[1:], floor[:-1]))
        for values, truth in _compared(layout, read, wavelength_nm, pairs, near)
    )
    elsewhere = ~places.anywhere(pairs.wi, pairs.wr)
    measured = _measured(layout.source, near.wi, near.wr)
    return Between(
        wavelength_nm=wavelength_nm.tolist(),
        bands=limits_of_bands(everywhere[elsewhere], pairs.band[elsewhere]),
        places=limits_in_places(in_places, near, measured),
        overall=not_less(limit_of(everywhere)),
    )


class WorstBetween(NamedTuple):
    """The wavelength [nm] of an interval at which interpolation of a source is worst, and its error there [1]."""

    wavelength_nm: float
    error: float


def worst_between(
    source: Source, stored_nm: Axis, interpolation: Interpolation, wi: Floats, wr: Floats, floor: Floats
) -> list[WorstBetween]:
    """Return the wavelength inside each interval where interpolation of the source itself is worst.

    The error of a wavelength is the 95th percentile at a few pairs of directions `wi`, `wr`. Nine or more wavelengths
    of an interval are tried, and the nodes of spectra. `floor` [1/sr] holds for the stored wavelengths,
    `interpolation` is that of the table.
    """
    intervals = stored_nm.size - 1
    within = max(_SEARCHED_WAVELENGTHS, _SEARCHED_IN_ALL // intervals)
    share = np.arange(1, within + 1) / (within + 1)
    tried_nm = (stored_nm[:-1, np.newaxis] + np.diff(stored_nm)[:, np.newaxis] * share).reshape(-1)
    if isinstance(source, Material) and source.spectra:
        kinks = np.unique(np.concatenate([spectrum.wavelengths_nm for spectrum in source.spectra.values()]))
        kinks = kinks[(kinks > stored_nm[0]) & (kinks < stored_nm[-1])]
        tried_nm = np.union1d(tried_nm, kinks[~np.isin(kinks, stored_nm)])
    mu = np.maximum(wi[:, 2], COS_HORIZON) * np.maximum(wr[:, 2], COS_HORIZON)
    numbers = interpolation.numbers(model_values(source, stored_nm, wi, wr), mu)
    nodes, weight = weights_of_nodes(stored_nm, tried_nm, cubic=not interpolation.straight)
    interval = np.searchsorted(stored_nm, tried_nm) - 1
    error = relative(  # relative to the interpolated value, the only one that a lookup knows
        model_values(source, tried_nm, wi, wr),
        np.maximum(interpolation.f_r(np.sum(numbers[:, nodes] * weight, axis=-1), mu), 0.0),
        np.maximum(floor[1:], floor[:-1])[interval],
    )
    p95 = np.percentile(error, 95.0, axis=0)
    worst = []
    for number in range(intervals):
        inside = np.flatnonzero(interval == number)
        most = inside[np.argmax(p95[inside])]
        worst.append(WorstBetween(float(tried_nm[most]), float(p95[most])))
    return worst


def limits_of_bands(error: Floats, band: NDArray[np.int64]) -> list[list[float]]:
    """Return the limit of errors (N, columns) in each band of theta_i."""
    return [not_less(limit_of(error[band == row])) for row in range(places.BANDS)]


def _among_first(sample: NDArray[np.int64], count: int) -> NDArray[np.bool_]:
    """Return a mask of the first `count` members of each sample; the numbers of the samples increase."""
    return np.asarray(np.arange(sample.size) - np.searchsorted(sample, sample) < count)


def limits_in_places(error: Floats, pairs: places.Pairs, measured: NDArray[np.bool_]) -> Places:
    """Return limits of errors (N, columns) at pairs drawn in places: the largest of the samples of each place.

    Pairs that are not `measured` do not count. The limit of a place without any other is 0.
    """
    samples = error.reshape(pairs.sample[-1] + 1, -1, error.shape[1])  # all have the same number of pairs
    if measured.all():
        of_samples = limit_of(samples)
    else:
        chosen = measured.reshape(samples.shape[:2])
        of_samples = np.stack([limit_of(sample[rows]) for sample, rows in zip(samples, chosen, strict=True)])
    rows = np.zeros((places.ROWS, error.shape[1]))
    np.maximum.at(rows, pairs.row[:: samples.shape[1]], of_samples)
    return Places(
        alongside=[not_less(limit) for limit in rows[places.ALONGSIDE : places.ONE_GRAZING]],
        one_grazing=[not_less(limit) for limit in rows[places.ONE_GRAZING : places.BOTH_GRAZING]],
        both_grazing=[not_less(limit) for limit in rows[places.BOTH_GRAZING :]],
    )


def limit_of(error: Floats) -> Floats:
    """Return the limit of 98 of 100 errors, with a confidence of 98 %, of samples (..., N, columns)."""
    count = error.shape[-2]
    if count == 0:
        return np.zeros(error.shape[-1])
    return np.asarray(np.sort(error, axis=-2)[..., -rank_of_limit(count, _WITHIN, _CONFIDENCE), :])


@functools.cache
def rank_of_limit(count: int, within: float, confidence: float) -> int:
    """Return the rank, from the largest of `count` values, of a bound of the quantile `within` of all values.

    The number of values beyond the quantile is binomial. A limit is too low if that number is below the rank, with a
    probability of at most 1 - `confidence`, unless there are too few values. The rank is at least 1.
    """
    rank = 0
    chance = 0.0  # that at most `rank` values are beyond the quantile
    while True:
        ways = math.lgamma(count + 1) - math.lgamma(rank + 1) - math.lgamma(count - rank + 1)
        chance += math.exp(ways + rank * math.log(1.0 - within) + (count - rank) * math.log(within))
        if chance > 1.0 - confidence:
            return max(rank, 1)
        rank += 1


def compare(values: Floats, truth: Floats, pairs: RandomPairs, seed: int = SEED) -> Error:
    """Return the error of values of f_r, shape (N, L), against the truth at the random pairs that count.

    A band of theta_i without such pairs, in which nothing was measured, repeats the error of all bands.
    """
    floor = floor_of(truth, pairs)
    counted = slice(None) if (above := pairs.above).all() else above
    weight = pairs.weight[counted]
    values = values[counted]
    truth = truth[counted]
    error = np.ascontiguousarray(relative(values, truth, floor).T)
    ends = np.searchsorted(pairs.band[counted], np.arange(BANDS_DEG.size))  # bands increase
    every = slice(0, weight.size)
    chosen = [slice(*some) if some[0] < some[1] else every for some in itertools.pairwise(ends)] + [every]
    l1 = np.stack([mean_error(values[rows], truth[rows], weight[rows]) for rows in chosen])
    percentiles = [_percentiles(error[:, rows], _SHARES) for rows in chosen]
    # [statistic][band][wavelength]
    bands = np.stack([l1[:-1], *np.moveaxis(np.stack(percentiles[:-1]), 1, 0)])
    overall = np.concatenate([[l1[-1].max()], percentiles[-1].max(axis=-1)])
    names = tuple(Overall.model_fields)
    return Error.model_validate(
        {
            "theta_i_deg": BANDS_DEG.tolist(),
            "directions": weight.size,
            "seed": seed,
            "floor": _three_digits(floor),
            "overall": dict(zip(names, _three_digits(overall), strict=True)),
            **{name: [_three_digits(row) for row in rows] for name, rows in zip(names, bands, strict=True)},
        }
    )


def _percentiles(error: Floats, shares: Floats) -> Floats:
    """Return what `numpy.percentile` does of rows (L, N), shape (shares, L), in a third of the time: by one sort."""
    ordered = np.sort(error, axis=1)
    place = shares * (error.shape[1] - 1)
    before = place.astype(np.int64)
    part = place - before
    low = ordered[:, before]
    high = ordered[:, np.minimum(before + 1, error.shape[1] - 1)]
    step = high - low
    values = np.where(part >= 0.5, high - step * (1.0 - part), low + step * part)
    return np.where(np.isnan(ordered[:, -1]), np.nan, values.T)


def _looked_up(
    layout: Layout, read: Read, drawn: Sequence[RandomPairs | places.Pairs], wavelength_nm: Axis | None
) -> Sequence[Floats]:
    """Return values (N, L) of a table at draws of pairs, read in windows of rows with an extra row on either side."""
    rows = layout.shape[0]
    step = max(2, min(rows, _WINDOW // (layout.size // rows)))
    width = 1 if wavelength_nm is None else wavelength_nm.size
    if step >= rows:
        table = Table.of(layout, read(slice(0, rows)))
        return [table.lookup_vectors(pairs.wi, pairs.wr, wavelength_nm).reshape(-1, width) for pairs in drawn]
    wi = np.concatenate([pairs.wi for pairs in drawn])  # each window is read once
    wr = np.concatenate([pairs.wr for pairs in drawn])
    values = np.zeros((len(wi), width))
    grid = layout.grid
    x = points(grid, wi, wr)
    row = np.clip(np.searchsorted(radians(next(iter(grid.axes.values()))), x[0], side="right") - 1, 0, rows - 2)
    for start in range(0, rows - 1, step):
        inside = (row >= start) & (row < start + step)
        window = slice(max(start - 1, 0), min(start + step + 2, rows))
        table = Table.of(layout, read(window), Grid.part(grid, window))
        values[inside] = table.lookup_vectors(wi[inside], wr[inside], wavelength_nm).reshape(-1, width)
    return np.split(values, np.cumsum([len(pairs.wi) for pairs in drawn])[:-1])


def not_less(values: Floats) -> list[float]:
    """Return numbers rounded up to three digits, so that errors that are all equal do not exceed their limit."""
    return [float(f"{1.00501 * value:.3g}") for value in values.tolist()]


def _three_digits(values: Floats) -> list[float]:
    """Return numbers to three digits."""
    return [float(f"{value:.3g}") for value in values.tolist()]
