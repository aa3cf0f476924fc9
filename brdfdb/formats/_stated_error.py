"""The error that an exported file states: f_r as its reader sees it, against the table, at pairs drawn at random."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from brdfdb.errors import ParameterError
from brdfdb.formats._channels import Channels, channels_of
from brdfdb.geometry import Directions, unit_vector
from brdfdb.integrals.sampling import mirrored_in_lobe, mixture_density
from brdfdb.parameters import Floats
from brdfdb.tables import error_measurement, places
from brdfdb.tables.error_measurement import WIDTHS, rank_of_limit
from brdfdb.tables.stated_error import stated

if TYPE_CHECKING:
    from brdfdb.tables.table import Table

PAIRS = 10000  # pairs of each of the two draws
SEED = 2018
FLOOR = 1e-3  # share of the Lambertian BRDF with the albedo of the table
_WITHIN, _CONFIDENCE = 0.99, 0.999  # share of the values within p99, and how sure that is
_ROUNDING = 1e-9  # of sums of weights
OF_A_BAND, IN_PLACES, _SEED = 600, 200, 2026  # pairs of each band of theta_i, and of each sample in a place
_MOST = 1e9  # largest limit that is written: JSON has no infinity
_ENDS = places.BANDS, places.ONE_GRAZING, places.BOTH_GRAZING

Evaluate = Callable[[Floats, Floats], Floats]


@dataclass(frozen=True)
class FileError:
    """Error of the values of a file against those of its table, abs(file - table) / max(table, floor).

    Light and viewer are drawn cosine-weighted over the hemisphere. In a second draw the viewers are in the lobe, and
    each pair is weighted by the cosine of its viewer. Each number is that of the channel where it is largest.
    """

    p99: float  #: limit of 99 of 100 values, with a confidence of 99.9 %: the larger one of the two draws, [1]
    #: The limit of each draw, [1]. They are equal if the source has no lobe.
    p99_hemisphere: float
    p99_lobe: float
    l1: float  #: mean of abs(file - table) over that of the table, cosine-weighted, [1]
    largest: float  #: largest error of all pairs, [1]
    #: gives `statement`
    measure: Callable[[], FileStatement | None] | None = field(default=None, repr=False, compare=False)

    def document(self) -> dict[str, float]:
        """Return the numbers by name, to three digits and rounded up."""
        return {name: up(getattr(self, name)) for name in ("p99", "p99_hemisphere", "p99_lobe", "l1", "largest")}

    def __getstate__(self) -> dict[str, Any]:
        """Return the error for another process, with the statement measured: its closures stay in this one."""
        return {**self.__dict__, "measure": None, "statement": self.statement}

    @functools.cached_property
    def statement(self) -> FileStatement | None:
        """The error of the file against the model, measured at first use; None if its table states no error."""
        return None if self.measure is None else self.measure()


class Comparison:
    """Pairs of directions, and the f_r of a table there, that files are compared with.

    Parameters
    ----------
    table : Table
        Table that is exported.
    channels : Channels
        The channels of the file, by default those of the table.

    Attributes
    ----------
    wi, wr : array (N, 3)
        Unit vectors of light and viewer: first those over the hemisphere, then those in the lobe.
    truth : array (N, C) [1/sr]
        f_r of the table in the channels.
    """

    def __init__(self, table: Table, channels: Channels | None = None) -> None:
        self.table = table
        self.channels = channels_of(table) if channels is None else channels
        self.wi, self.wr, self._weight, lobe = _drawn(table)
        self._above = self._weight > 0.0
        # pairs drawn over the hemisphere have equal weights; those in the lobe are weighted by the cosine of the viewer
        self._share = np.where(self._above, 1.0, 0.0)
        if lobe:
            self._share[PAIRS:] = np.maximum(self.wr[PAIRS:, 2], 0.0)
        self._draws = slice(0, PAIRS), slice(PAIRS, 2 * PAIRS) if lobe else slice(0, 2 * PAIRS)
        self.truth = self.channels.values(table, self.wi, self.wr)

    @functools.cached_property
    def floor(self) -> Floats:
        """The floor [1/sr] of relative errors in each channel."""
        return np.asarray(FLOOR / np.pi * np.abs(self._weight @ self.truth) / len(self.wi))

    def error_of(self, evaluate: Callable[[Floats, Floats], Floats]) -> FileError:
        """Return the error of a file, whose reader gives f_r [1/sr], shape (N, C), at unit vectors (N, 3)."""
        values = evaluate(self.wi, self.wr)
        wrong = np.where(self._above[:, np.newaxis], np.abs(values - self.truth), 0.0)  # below, files may have holes
        scale = np.maximum(self.truth, self.floor)
        relative = np.divide(wrong, scale, out=np.where(wrong > 0.0, np.inf, 0.0), where=scale > 0.0)
        whole = self._weight @ np.abs(self.truth)
        l1 = np.divide(self._weight @ wrong, whole, out=np.zeros_like(whole), where=whole > 0.0)
        hemisphere, lobe = (self._p99(relative, draw) for draw in self._draws)
        return FileError(
            p99=max(hemisphere, lobe),
            p99_hemisphere=hemisphere,
            p99_lobe=lobe,
            l1=float(l1.max()),
            largest=float(relative[self._above].max()),
            measure=functools.partial(of_file, self.table, self.channels, self.floor, evaluate),
        )

    def _p99(self, relative: Floats, draw: slice) -> float:
        """Return the limit of 99 of 100 errors (N, C) of a draw, weighted by `_share`, of the worst channel."""
        share = self._share[draw]
        count = int(share.sum() ** 2 / (share**2).sum())  # as many pairs of equal weight are as sure
        beyond = rank_of_limit(count, _WITHIN, _CONFIDENCE) / count * share.sum()
        order = np.argsort(-relative[draw], axis=0)
        rank = (np.cumsum(share[order], axis=0) < beyond * (1.0 - _ROUNDING)).sum(axis=0)
        limits = relative[draw][order[rank, np.arange(relative.shape[1])], np.arange(relative.shape[1])]
        return float(limits.max())


def _drawn(table: Table) -> tuple[Floats, Floats, Floats, bool]:
    """Draw lights and viewers (2 PAIRS, 3) for a table: first over the hemisphere, then in the lobe.

    Their weights are the cosine of the viewer over the density with which it was drawn; 0 below the horizon. `lobe` is
    False if the source has no lobe, or none is known: all viewers are then over the hemisphere.
    """
    rng = np.random.default_rng(SEED)
    count = 2 * PAIRS
    wi = _cosine_weighted(rng, count)
    over = _cosine_weighted(rng, count)
    at = table.wavelength_nm
    in_turn = None if at is None else at[np.arange(count) % at.size]
    lobe = None if table.source is None else table.source.lobe(wi[:, 2], in_turn)
    if lobe is None:
        return wi, over, np.full(count, np.pi), False
    lobes = [
        lobe._replace(share=np.ones(1), alpha_x=width * lobe.alpha_x, alpha_y=width * lobe.alpha_y, visible=False)
        for width in WIDTHS
    ]
    u = 1.0 - rng.random(count)
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    wr = over
    for part, drawn in enumerate(lobes):  # the second half, in equal parts
        start = PAIRS + part * PAIRS // len(lobes)
        wr = np.where((np.arange(count) >= start)[:, np.newaxis], mirrored_in_lobe(u, angle, wi, drawn), wr)
    cosine = np.maximum(wr[:, 2], 0.0)
    density = 0.5 * cosine / np.pi + 0.5 * np.mean([mixture_density(drawn, wi, wr) for drawn in lobes], axis=0)
    return wi, wr, cosine / density, True


def _cosine_weighted(rng: np.random.Generator, count: int) -> NDArray[np.float64]:
    """Return unit vectors (N, 3) whose density over the hemisphere is proportional to the cosine."""
    theta = np.arcsin(np.sqrt(rng.random(count)))
    return unit_vector(theta, rng.uniform(0.0, 2.0 * np.pi, count))


class Rows(BaseModel):
    """Limits of the error by place, as of `brdfdb.tables.stated_error.Places`, and of bands of theta_i elsewhere."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    bands: list[float] = Field(min_length=places.BANDS, max_length=places.BANDS)
    alongside: list[float] = Field(min_length=places.BANDS, max_length=places.BANDS)
    one_grazing: list[float] = Field(min_length=places.RINGS, max_length=places.RINGS)
    both_grazing: list[float] = Field(min_length=places.RINGS, max_length=places.RINGS)

    @classmethod
    def of(cls, limits: Floats) -> Rows:
        """Return limits (rows of places, channels) of the channel where each is largest."""
        worst = map(up, np.minimum(np.nan_to_num(limits, nan=_MOST).max(axis=1), _MOST).tolist())
        parts = np.split(np.array([*worst]), _ENDS)
        return cls(**{name: part.tolist() for name, part in zip(cls.model_fields, parts, strict=True)})

    @property
    def limits(self) -> Floats:
        """The limits as a column, shape (rows of places, 1)."""
        return np.array([[*self.bands, *self.alongside, *self.one_grazing, *self.both_grazing]]).T


class FileStatement(BaseModel):
    """The error of f_r of a file, abs(file - model) / max(file, floor).

    98 of 100 values are within. It is what the table states at the wavelengths of the file, and what the grid and the
    interpolation of the format add, for the channel where it is largest.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    against: str = Field(description="the model, or the data of a measured table")
    p98: float = Field(description="over all directions, half over the hemisphere and half in the lobe")
    floor: list[float] = Field(description="1/sr, of each channel")
    places: Rows
    between: Rows | None = Field(
        description="on straight lines between the wavelengths of the file; null without two, or where it is not known"
    )

    def error(
        self, directions: Directions, brdf: Floats, nodes: NDArray[np.int64] | None = None, on_nodes: Any = True
    ) -> Floats:
        """Return the error [1/sr] of values (..., M).

        They are those of the channels, or of wavelengths between the channels `nodes`, shape (M, 2), of which
        `on_nodes` says which are those of a channel.
        """
        floor = np.array(self.floor)
        floor = floor if nodes is None else floor[nodes].max(axis=1)
        limits = np.broadcast_to(self.places.limits, (places.ROWS, floor.size))
        if not np.all(on_nodes):
            if self.between is None:
                raise ParameterError("error", "the file states no error between its wavelengths")
            limits = np.where(on_nodes, limits, np.maximum(limits, self.between.limits))
        return stated(limits, floor, directions, brdf)

    @classmethod
    def read(cls, record: Mapping[str, Any], name: str) -> FileStatement:
        """Return the statement in the record of a file; ParameterError if the record has no statement."""
        try:
            return cls.model_validate(record.get("error"))
        except ValidationError:
            raise ParameterError("error", f"{name} states no error that this program reads") from None


def up(value: float) -> float:
    """Return the next number of three digits that is not below a value."""
    if not 0.0 < value < math.inf:
        return value
    unit = 10.0 ** (math.floor(math.log10(value)) - 2)
    return float(f"{math.ceil(value / unit) * unit:.3g}")


def of_table(table: Table) -> FileStatement | None:
    """Return the statement of a file that holds values of a table as they are; None if the table states no error."""
    if table.error is None:
        return None
    count = len(table.error.floor)
    columns = np.arange(count)
    rows = Rows.of(table.error.limits[:, :count] + _uncertainty(table))
    p98 = up(float((table.error.of_all_bands(columns) + _uncertainty(table)).max()))
    return FileStatement(against=_against(table), p98=p98, floor=table.error.floor, places=rows, between=None)


def of_file(table: Table, channels: Channels, floor: Floats, evaluate: Evaluate) -> FileStatement | None:
    """Return the statement of a file whose reader gives f_r [1/sr], shape (N, C), at unit vectors (N, 3).

    None if the table states no error.

    Raises
    ------
    ParameterError
        If the file holds a wavelength between those of the table, where its error was not measured.
    """
    error = table.error
    if error is None:
        return None
    drawn = error_measurement.draw(table.source, table.wavelength_nm, OF_A_BAND, _SEED).above_the_horizon()
    pairs = places.draw(IN_PLACES, _SEED)
    wi, wr = np.concatenate([drawn.wi, pairs.wi]), np.concatenate([drawn.wr, pairs.wr])
    own = len(drawn.wi)
    inside = ~places.anywhere(drawn.wi, drawn.wr)
    file = np.asarray(evaluate(wi, wr))

    def rows(known: Floats, errors: Floats, of_file: Floats, least: Floats) -> Rows:
        """Return the limits of what a file is off by against lookups, shape (N, M), and of what these are off by."""
        relative = _quotient(np.abs(of_file - known) + errors, np.maximum(of_file, least))
        counted = np.asarray(np.isfinite(errors).all(axis=1))  # not where measured data are extrapolated
        elsewhere = counted[:own] & inside
        bands = np.array(error_measurement.limits_of_bands(relative[:own][elsewhere], drawn.band[elsewhere]))
        unseen = np.bincount(drawn.band[elsewhere], minlength=places.BANDS) == 0  # of measured data
        bands[unseen] = bands.max(axis=0)
        there = error_measurement.limits_in_places(relative[own:], pairs, counted[own:])
        return Rows.of(np.concatenate([bands, there.alongside, there.one_grazing, there.both_grazing]))

    at = channels.wavelength_nm
    brdf, errors = table.lookup_vectors_with_error(wi, wr, at)
    known = channels.of_spectra(brdf)
    wrong = channels.of_spectra(errors, absolute=True)
    column = table.columns_of(at)
    typical = (error.of_all_bands(column) + _uncertainty(table)) * np.maximum(brdf, error.floors[column])
    off = np.abs(file - known) + channels.of_spectra(typical, absolute=True)
    of_all = _quotient(off, np.maximum(known, floor))[:own][np.isfinite(wrong[:own]).all(axis=1)]
    between = None
    if at is not None and at.size > 1 and channels.weights is None and error.between is not None:
        nm = 0.5 * (at[1:] + at[:-1])
        if np.array_equal(at, table.wavelength_nm if table.wavelength_nm is not None else nm):
            nm = np.concatenate([nm, error.between.wavelength_nm])
        below = np.clip(np.searchsorted(at, nm, side="right") - 1, 0, at.size - 2)
        share = (nm - at[below]) / (at[below + 1] - at[below])
        line = file[:, below] * (1.0 - share) + file[:, below + 1] * share
        brdf, errors = table.lookup_vectors_with_error(wi, wr, nm)
        between = rows(brdf, errors, line, np.maximum(floor[below], floor[below + 1]))
    return FileStatement(
        against=_against(table),
        p98=up(float(min(error_measurement.limit_of(of_all).max(), _MOST))),
        floor=[float(f"{value:.3g}") for value in floor],
        places=rows(known, wrong, file, floor),
        between=between,
    )


def _against(table: Table) -> str:
    return "the data" if table.metadata.measured else "the model"


def _uncertainty(table: Table) -> float:
    """Return the relative uncertainty of measured data, which their error adds to; 0 of a model."""
    measured = table.metadata.known_measured()
    return 0.0 if measured is None or measured.uncertainty is None else measured.uncertainty


def _quotient(wrong: Floats, scale: Floats) -> Floats:
    return np.divide(wrong, scale, out=np.where(wrong > 0.0, _MOST, 0.0), where=scale > 0.0)
