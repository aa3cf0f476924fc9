"""The error that a file states of f_r against the model of its table: by places, as tables do."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from brdfdb.errors import ParameterError
from brdfdb.formats._channels import Channels
from brdfdb.geometry import Directions
from brdfdb.parameters import Floats
from brdfdb.tables import error_measurement, places
from brdfdb.tables.stated_error import stated

if TYPE_CHECKING:
    from brdfdb.tables.table import Table

OF_A_BAND, IN_PLACES, _SEED = 600, 200, 2026  # pairs of each band of theta_i, and of each sample in a place
_MOST = 1e9  # largest limit that is written: JSON has no infinity
_ENDS = places.BANDS, places.ONE_GRAZING, places.BOTH_GRAZING

Evaluate = Callable[[Floats, Floats], Floats]


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
                raise ParameterError("error", "the file states none between its wavelengths")
            limits = np.where(on_nodes, limits, np.maximum(limits, self.between.limits))
        return stated(limits, floor, directions, brdf)

    @classmethod
    def read(cls, record: Mapping[str, Any], name: str) -> FileStatement:
        """Return the statement in the record of a file; ParameterError if there is none."""
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
    own, inside = len(drawn.wi), ~places.anywhere(drawn.wi, drawn.wr)
    file = np.asarray(evaluate(wi, wr))

    def rows(known: Floats, errors: Floats, of_file: Floats, least: Floats) -> Rows:
        """Return the limits of what a file is off by against lookups, shape (N, M), and of what these are off by."""
        relative = _quotient(np.abs(of_file - known) + errors, np.maximum(of_file, least))
        counted = np.asarray(np.isfinite(errors).all(axis=1))  # not where measured data are extrapolated
        some = counted[:own] & inside
        bands = np.array(error_measurement.limits_of_bands(relative[:own][some], drawn.band[some]))
        unseen = np.bincount(drawn.band[some], minlength=places.BANDS) == 0  # of measured data
        bands[unseen] = bands.max(axis=0)
        there = error_measurement.limits_in_places(relative[own:], pairs, counted[own:])
        return Rows.of(np.concatenate([bands, there.alongside, there.one_grazing, there.both_grazing]))

    at = channels.wavelength_nm
    brdf, errors = table.lookup_vectors_with_error(wi, wr, at)
    known, wrong = channels.of_spectra(brdf), channels.of_spectra(errors, absolute=True)
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
