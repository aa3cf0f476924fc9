"""The stated error of a table, checked for contradictions and compared with the error at fresh directions.

If the table is the one that was measured, both errors are samples of one population. The number of fresh values above
a percentile of the first sample then follows the beta-binomial distribution, for any distribution of the errors. The
count is too large or too small if its probability is below `CHANCE`. A maximum is the highest order statistic and is
judged in the same way: the number of larger values counts, their size does not, because it has no bound. Ratios of
integrals, l1 and the floor, are judged by standard errors.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field

from brdfdb.audit.finding import STRICT
from brdfdb.audit.pairs import ComparedPairs
from brdfdb.parameters import Floats
from brdfdb.tables import error_measurement
from brdfdb.tables.error_measurement import RandomPairs
from brdfdb.tables.grids import Axis
from brdfdb.tables.places import BANDS, BANDS_DEG, RINGS
from brdfdb.tables.stated_error import Error, Overall

Statistic = Literal["l1", "median", "p95", "p99", "max", "floor"]

# Probability that one test fails a sound table. A table of 41 wavelengths takes 3000 tests, so that one in 300 000 such
# tables fails by chance
CHANCE = 1e-9
# Allowed difference of two ratios, in standard errors. A ratio that a few rare directions make too large has a standard
# error about as large as itself: it takes 49 such directions to exceed this limit
STANDARD_ERRORS = 7.0
# Smallest ratio of the fresh floor to the stated one. A stated floor that is larger may rest on a rare direction
SHORT = 0.5
# Smallest error that is judged [1]. float32 is exact to 6e-8, and offsets of logarithms cost digits
EXACT = 1e-6
DIGITS = 1.1e-2  # relative rounding: stated errors and their floor have three digits
LEAST_DIRECTIONS = 500  # smallest number of directions of a band with which a statement is judged
QUANTILES: dict[Statistic, float] = {"median": 0.5, "p95": 0.95, "p99": 0.99, "max": 1.0}
_WORDS: dict[Statistic, str] = {
    "l1": "mean error",
    "median": "median",
    "p95": "95th percentile",
    "p99": "99th percentile",
    "max": "maximum",
    "floor": "floor",
}
NAMES: tuple[Statistic, ...] = ("l1", *QUANTILES)

Counts = NDArray[np.int64]


class Disagreement(BaseModel):
    """One number of the stated error that differs from fresh directions by more than chance explains."""

    model_config = STRICT

    statistic: Statistic
    theta_i_deg: tuple[float, float] = Field(description="ends of the band; 0 and 90: all directions")
    wavelength_nm: float | None = Field(description="null: the table is grey")
    stated: float
    fresh: float | None = Field(description="null: not finite")
    times: float | None = Field(description="ratio of the larger number to the smaller; null: not finite")

    @property
    def text(self) -> str:
        """Both numbers with their band and wavelength, in words."""
        low, high = self.theta_i_deg
        where = "overall" if (low, high) == (0.0, 90.0) else f"at theta_i of {low:g} to {high:g} degrees"
        at = "" if self.wavelength_nm is None else f", {self.wavelength_nm:g} nm"
        fresh = "not finite" if self.fresh is None else f"{self.fresh:.3g}"
        return f"{_WORDS[self.statistic]} {fresh}, stated {self.stated:.3g}, {where}{at}"


class _Band(NamedTuple):
    """Fresh directions of a band of theta_i, or all of them, and the number of directions behind the statement."""

    name: tuple[float, float]
    chosen: NDArray[np.bool_]
    drawn: int
    stated: int


def contradictions(error: Error, wavelengths: int) -> list[str]:
    """Return a sentence on each contradiction in a stated error."""
    bands = BANDS_DEG.size - 1
    columns = 1 if error.columns == 1 else wavelengths  # one: of the worst wavelength
    tables = {name: getattr(error, name) for name in NAMES}
    shapes = {name: {len(row) for row in rows} | {-len(rows)} for name, rows in tables.items()}
    if not np.array_equal(error.theta_i_deg, BANDS_DEG) or len(error.floor) != wavelengths:
        return [f"it is not about {bands} bands of theta_i and {wavelengths} wavelengths"]
    if any(shape_of_rows != {columns, -bands} for shape_of_rows in shapes.values()):
        return [f"it is not about {bands} bands of theta_i and {wavelengths} wavelengths"]
    arrays = {name: np.array(rows, dtype=np.float64).reshape(bands, columns) for name, rows in tables.items()}
    overall = {name: float(getattr(error.overall, name)) for name in Overall.model_fields}
    numbers = [*arrays.values(), np.array(error.floor), np.array([*overall.values()])]
    if not all(np.all(np.isfinite(array) & (array >= 0.0)) for array in numbers):
        return ["not all of its numbers are finite and at least 0"]
    if not _whole(error, columns, wavelengths - 1, mixed=columns < wavelengths):
        return ["its limits in places and between wavelengths are not all finite and at least 0"]
    sentences = []
    ordered = [arrays[name] for name in QUANTILES]
    if any(np.any(low > high) for low, high in pairwise(ordered)):
        sentences.append("a percentile is above a higher one")
    for name, of_bands in arrays.items():
        # At each wavelength, a percentile or a mean of all bands lies between those of the single bands
        high = float(of_bands.max())
        low = high if name == "max" else float(of_bands.min(axis=0).max())
        if not low * (1.0 - DIGITS) <= overall[name] <= high * (1.0 + DIGITS):
            sentences.append(
                f"its overall {name} of {overall[name]:.3g} is not between those of its bands, {low:.3g} to {high:.3g}"
            )
    return sentences


def _whole(error: Error, at: int, between: int, *, mixed: bool) -> bool:
    """Return whether the limits in places, and between wavelengths, have so many columns, finite and at least 0.

    A mixture has one row of each kind between wavelengths.
    """
    bands, rings = (1, 1) if mixed else (BANDS, RINGS)
    parts = [] if error.places is None else [(error.places, at, BANDS, RINGS)]
    tables: list[tuple[list[list[float]], int, int]] = []
    if error.between is not None:
        tables.append((error.between.bands, bands, between))
        parts += [] if error.between.places is None else [(error.between.places, between, bands, rings)]
    for places, columns, of_bands, of_rings in parts:
        tables += [
            (places.alongside, of_bands, columns),
            (places.one_grazing, of_rings, columns),
            (places.both_grazing, of_rings, columns),
        ]
    return all(
        len(rows) == count
        and all(len(row) == columns and np.all(np.isfinite(row)) and min(row, default=0.0) >= 0.0 for row in rows)
        for rows, count, columns in tables
    )


def disagreements(error: Error, pairs: ComparedPairs, wavelength_nm: Axis | None) -> list[Disagreement]:
    """Return the numbers of a consistent statement that fresh directions contradict, the worst first.

    The statement is taken as one of as many directions as builds draw. What it says of that is itself under test.
    """
    contradicted = _disagreements(error, pairs, wavelength_nm)
    return sorted(contradicted, key=lambda number: np.inf if number.times is None else number.times, reverse=True)


def _disagreements(error: Error, pairs: ComparedPairs, wavelength_nm: Axis | None) -> Iterator[Disagreement]:
    drawn = pairs.drawn
    floor = np.array(error.floor)  # the stated floor; that of the fresh draw differs by a few percent
    with np.errstate(invalid="ignore"):
        relative = error_measurement.relative(pairs.table, pairs.model, floor)
    nm = [None] * floor.size if wavelength_nm is None else wavelength_nm.tolist()
    bands = list(_bands(drawn, wavelength_nm))
    of_worst = error.columns < floor.size
    for number, band in enumerate(bands):
        whole = number == len(bands) - 1
        for name, quantile in QUANTILES.items():
            stated = np.broadcast_to(
                getattr(error.overall, name) if whole else getattr(error, name)[number], floor.size
            )
            least, most = limits(band.stated, int(np.count_nonzero(band.chosen)), quantile)
            of_band = relative[band.chosen]
            above = _exceeding(of_band, np.maximum(stated, EXACT) * (1.0 + DIGITS))
            around = _exceeding(of_band, stated * (1.0 - DIGITS))
            too_good = _judged(whole, of_worst, (around <= least) & (stated > EXACT))
            for w in np.flatnonzero((above >= most) | too_good):
                finite = np.where(np.isfinite(of_band[:, w]), of_band[:, w], np.inf)
                fresh = float(np.percentile(finite, 100.0 * quantile, method="lower"))
                yield _disagreement(name, band, nm[w], float(stated[w]), fresh)
        stated = np.broadcast_to(error.overall.l1 if whole else error.l1[number], floor.size)
        ratio, off = _ratio(np.abs(pairs.table - pairs.model), pairs.model, drawn.weight, band)
        more = ratio - stated * (1.0 + DIGITS) > STANDARD_ERRORS * off + EXACT
        rare = np.zeros(floor.size) if whole else _rare(np.array(error.max[number]), pairs.model, drawn.weight, band)
        low = ratio + STANDARD_ERRORS * off + EXACT + rare < stated * (1.0 - DIGITS)
        less = _judged(whole, of_worst, low)
        more |= ~np.isfinite(ratio)
        for w in np.flatnonzero(more | less):
            yield _disagreement("l1", band, nm[w], float(stated[w]), float(ratio[w]))
    yield from _of_floor(floor, pairs, bands[-1], nm)


def _judged(whole: bool, of_worst: bool, too_good: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return at which wavelengths a statement is judged to be too large.

    Numbers of the worst wavelength are too large if they are so at each wavelength. Overall numbers are not judged: at
    other wavelengths they may be smaller.
    """
    if whole:
        return np.zeros_like(too_good)
    return np.full_like(too_good, np.all(too_good)) if of_worst else too_good


def _of_floor(stated: Floats, pairs: ComparedPairs, band: _Band, nm: list[float | None]) -> Iterator[Disagreement]:
    """Yield the disagreements on the floor, a share of the mean reflectance over uniform directions."""
    values = error_measurement.FLOOR / np.pi * pairs.drawn.weight[:, np.newaxis] * pairs.model
    fresh = values.mean(axis=0)
    off = STANDARD_ERRORS * values.std(axis=0) / np.sqrt(band.drawn) * np.sqrt(1.0 + band.drawn / band.stated)
    wrong = (fresh - stated * (1.0 + DIGITS) > off) | (fresh + off < SHORT * stated)
    for w in np.flatnonzero(wrong):
        yield _disagreement("floor", band, nm[w], float(stated[w]), float(fresh[w]))


def _bands(drawn: RandomPairs, wavelength_nm: Axis | None) -> Iterator[_Band]:
    """Yield each band of theta_i, then all directions. Every draw has the same share of directions in a band."""
    share = error_measurement.directions_of_a_band(wavelength_nm) * BANDS / len(drawn.band)
    for number, name in enumerate(zip(BANDS_DEG[:-1].tolist(), BANDS_DEG[1:].tolist(), strict=True)):
        in_band = drawn.band == number
        chosen = drawn.above & in_band
        stated = max(int(share * np.count_nonzero(chosen)), LEAST_DIRECTIONS)
        yield _Band(name, chosen, int(np.count_nonzero(in_band)), stated)
    stated = max(int(share * np.count_nonzero(drawn.above)), LEAST_DIRECTIONS)
    yield _Band((0.0, 90.0), drawn.above, len(drawn.band), stated)


class CountLimits(NamedTuple):
    """Counts up to `least`, and from `most` on, have a probability below `CHANCE`."""

    least: int
    most: int


def limits(stated: int, fresh: int, quantile: float) -> CountLimits:
    """Return the limits of the number of `fresh` values above a quantile of `stated` others.

    `least` is -1 if no count is too small. The quantile lies between two order statistics: each limit takes that which
    makes it wider.
    """
    rank = int(quantile * (stated - 1)) + 1
    lower = np.cumsum(_probabilities(stated, fresh, min(rank + 1, stated)))
    upper = np.cumsum(_probabilities(stated, fresh, rank)[::-1])[::-1]  # probability of at least so many
    least = int(np.count_nonzero(lower <= CHANCE)) - 1
    return CountLimits(least if quantile < 1.0 else -1, int(np.count_nonzero(upper > CHANCE)))


def _probabilities(stated: int, fresh: int, rank: int) -> Floats:
    """Return the probability that 0, 1, ..., `fresh` values are above the `rank`-th smallest of `stated` others."""
    log_factorial = _log_factorials(1 << (stated + fresh).bit_length())
    above = np.arange(fresh + 1)
    # Number of orders of all values in which so many of the fresh ones are above
    orders = _choose(log_factorial, fresh - above + rank - 1, rank - 1) + _choose(
        log_factorial, above + stated - rank, stated - rank
    )
    return np.asarray(np.exp(orders - _choose(log_factorial, np.array(stated + fresh), stated)))


@functools.cache
def _log_factorials(count: int) -> Floats:
    """Return ln(n!) of n below `count`."""
    return np.concatenate([[0.0], np.cumsum(np.log(np.arange(1.0, count)))])


def _choose(log_factorial: Floats, n: Counts, k: int) -> Floats:
    return np.asarray(log_factorial[n] - log_factorial[k] - log_factorial[n - k])


def _exceeding(values: Floats, limit: Floats) -> Counts:
    """Return the number of values above a limit or not finite."""
    return np.asarray(np.count_nonzero(~(values <= limit), axis=0))


class _Ratio(NamedTuple):
    """The ratio of two integrals over a band, and the standard error of its difference from a stated one."""

    value: Floats
    error: Floats


def _ratio(difference: Floats, truth: Floats, weight: Floats, band: _Band) -> _Ratio:
    """Return the ratio of the integrals of a difference and of the truth."""
    rows = band.chosen
    weights = weight[rows, np.newaxis]
    above = weights * difference[rows]
    below = weights * truth[rows]
    total = below.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.where(total > 0.0, above.sum(axis=0) / total, 0.0)
        influence = (above - ratio * below) / np.where(total > 0.0, total, 1.0)
        off = np.sqrt(np.sum(influence**2, axis=0) * (1.0 + np.count_nonzero(rows) / band.stated))
    return _Ratio(ratio, np.where(np.isfinite(off), off, 0.0))


def _rare(largest: Floats, truth: Floats, weight: Floats, band: _Band) -> Floats:
    """Return the part of a stated l1 [1] that directions too rare for the fresh draw can explain.

    Their number is such that the fresh draw misses all of them with the probability `CHANCE`. Each of them has the
    largest stated error and the largest weight of the fresh draw.
    """
    fresh = int(np.count_nonzero(band.chosen))
    if fresh == 0:
        return np.zeros(largest.size)
    count = np.log(CHANCE) / np.log(band.stated / (band.stated + fresh))
    share = weight[band.chosen, np.newaxis] * truth[band.chosen]
    mean = share.mean(axis=0)
    largest_share = np.divide(share.max(axis=0), mean, out=np.ones(mean.size), where=mean > 0.0)
    return np.asarray(count * largest * largest_share / band.stated)


def _disagreement(name: Statistic, band: _Band, nm: float | None, stated: float, fresh: float) -> Disagreement:
    least = 0.0 if name == "floor" else EXACT
    low, high = sorted((max(stated, least), max(fresh, least)))
    times = high / low if np.isfinite(fresh) and low > 0.0 else np.inf
    return Disagreement(
        statistic=name,
        theta_i_deg=band.name,
        wavelength_nm=nm,
        stated=stated,
        fresh=float(f"{fresh:.3g}") if np.isfinite(fresh) else None,
        times=float(f"{times:.3g}") if np.isfinite(times) else None,
    )
