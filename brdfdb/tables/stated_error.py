"""The error that a table states against its source."""

from __future__ import annotations

import functools
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from brdfdb.errors import near_90
from brdfdb.geometry import Directions
from brdfdb.parameters import Floats
from brdfdb.tables import places

_ROUNDING = 1e-5  # relative error that float32 and the bits of a table leave
_STRICT = ConfigDict(frozen=True, extra="forbid")

Numbers = list[list[float]]
Rung = Literal["measured", "highest rung", "none known"]


class WorstPair(BaseModel):
    """The pair of directions at which the largest error was met."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    theta_i_deg: float
    theta_r_deg: float
    delta_phi_deg: float = Field(description="0 is back towards the light, 180 the mirror half plane")
    wavelength_nm: float | None = Field(description="null: grey")
    why: str = Field(description="why the error is large there, in words")


class Overall(BaseModel):
    """Relative error over all bands of theta_i, at the wavelength where it is largest."""

    model_config = _STRICT

    l1: float = Field(description="integral of abs(error) cos theta_r over that of f_r cos theta_r")
    median: float
    p95: float
    p99: float
    max: float


class Places(BaseModel):
    """Limits of the error in thin sets of directions: 98 of 100 values are within them, with a confidence of 98 %.

    The error is abs(table - model) / max(table, floor). It is relative to the table, the only value that a lookup
    knows: next to a pole a table can be too low by a factor.
    """

    model_config = _STRICT

    alongside: Numbers = Field(
        description="[band][wavelength]: theta_r within 10 degrees of theta_i, delta_phi within 90 degrees, and not "
        "both directions beyond 85 degrees; the largest of four: exactly towards the light, within two degrees of "
        "that, theta_r = theta_i, and within 10 degrees of that"
    )
    one_grazing: Numbers = Field(
        description="[ring][wavelength]: one direction beyond 85 degrees, at 85 to 87, 87 to 89 or 89 to 90 degrees"
    )
    both_grazing: Numbers = Field(
        description="[ring][wavelength]: both directions beyond 85 degrees, the lower one in the ring; the largest of "
        "three: any azimuth, exactly towards the light, and theta_r = theta_i"
    )

    def of_worst_row(self) -> Places:
        """Return the limits with one row of each kind, the largest in each column."""
        return Places(**{name: _worst_row(getattr(self, name)) for name in type(self).model_fields})

    def of_worst_column(self) -> Places:
        """Return the limits with one column, the largest of all."""
        return Places(**{name: _worst(getattr(self, name)) for name in type(self).model_fields})


class Between(BaseModel):
    """Limits of the error between neighbouring wavelengths, as those of `Places`, with the larger of two floors."""

    model_config = _STRICT

    wavelength_nm: list[float] = Field(
        description="where each interval was measured: where interpolation of the model itself is worst, of nine or "
        "more places in it"
    )
    bands: Numbers = Field(
        description="[band][interval], outside of the places; one row, of the worst band, of a mixture"
    )
    places: Places | None = Field(
        default=None, description="[band or ring][interval]; one row of each kind of a mixture"
    )
    overall: list[float] | None = Field(
        default=None, description="[interval], of all bands together; null in tables before version 6"
    )

    def of_worst_row(self) -> Between:
        """Return the limits with one row of each kind, the largest in each interval."""
        some = None if self.places is None else self.places.of_worst_row()
        return self.model_copy(update={"bands": _worst_row(self.bands), "places": some})

    def limits(self, intervals: int) -> NDArray[np.float64]:
        """Return the limits by row of `places`, shape (rows, intervals)."""
        if self.places is None:
            return _rows(_wide(np.array(self.bands), places.BANDS, intervals), None)
        kinds = (
            (self.bands, places.BANDS),
            (self.places.alongside, places.BANDS),
            (self.places.one_grazing, places.RINGS),
            (self.places.both_grazing, places.RINGS),
        )
        return np.concatenate([_wide(np.array(limits), rows, intervals) for limits, rows in kinds])


class Error(BaseModel):
    """The error of a table, abs(table - source) / max(source, floor), for each band of theta_i and each wavelength.

    A mixture states one column, that of its worst wavelength, because the same few parts make all of its wavelengths.
    Only the floor is then given for each wavelength. Between wavelengths a mixture states one row.

    Of measured data, only measured directions count. A band without any repeats the error of all bands.
    """

    model_config = _STRICT

    theta_i_deg: list[float] = Field(description="edges of the bands")
    directions: int = Field(
        description="number of random pairs of directions above the horizon, half over the hemisphere and half in the "
        "lobe; of measured data, only measured directions"
    )
    seed: int
    floor: list[float] = Field(
        description="1/sr, for each wavelength: a thousandth of the Lambertian BRDF of the same albedo"
    )
    l1: Numbers = Field(
        description="[band][wavelength]: integral of abs(error) cos theta_r over that of f_r cos theta_r"
    )
    median: Numbers = Field(description="[band][wavelength]")
    p95: Numbers = Field(description="[band][wavelength]")
    p99: Numbers = Field(description="[band][wavelength]")
    max: Numbers = Field(description="[band][wavelength]")
    overall: Overall
    worst: WorstPair | None = Field(
        default=None, description="directions of the largest error; null for families and in tables before version 4"
    )
    places: Places | None = Field(default=None, description="null in tables before version 3")
    between: Between | None = Field(default=None, description="null with one wavelength, and before version 3")

    @functools.cached_property
    def limits(self) -> NDArray[np.float64]:
        """The error that is stated, relative to a value of the table, nan where there is none: (rows, L + intervals).

        p99 of a band is relative to the source. Where the table is low by it, the value of the source is that of the
        table over 1 - p99; no more than twice the value is assumed.

        Rows are those of `places`. Columns are the wavelengths, and after them the intervals between them. In an
        interval no less is stated than at its two ends.
        """
        wavelengths = len(self.floor)
        p99 = np.array(self.p99)
        at = _wide(_rows(p99 / (1.0 - np.minimum(p99, 0.5)), self.places), places.ROWS, wavelengths)
        if self.between is None:
            return np.concatenate([at, np.full((places.ROWS, wavelengths - 1), np.nan)], axis=1)
        inside = self.between.limits(wavelengths - 1)
        return np.concatenate([at, np.maximum(inside, np.maximum(at[:, 1:], at[:, :-1]))], axis=1)

    @property
    def columns(self) -> int:
        """The number of columns of each statistic: one, or one for each wavelength."""
        return len(self.p99[0]) if self.p99 else 0

    def of_worst_wavelength(self) -> Error:
        """Return the error with one column, the largest of all wavelengths, and one row in the intervals between."""
        update: dict[str, object] = {name: _worst(getattr(self, name)) for name in Overall.model_fields}
        if self.places is not None:
            update["places"] = self.places.of_worst_column()
        if self.between is not None:
            update["between"] = self.between.of_worst_row()
        return self.model_copy(update=update)

    def of_all_bands(self, column: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the limit of 98 of 100 values over all bands, relative to a value of the table, shape (M,).

        `column` has those of `limits`. Where none was measured of all bands, it is the limit of the worst band.
        """
        p99 = self.overall.p99 / (1.0 - min(self.overall.p99, 0.5))
        known = None if self.between is None else self.between.overall
        between = self.limits[: places.BANDS, len(self.floor) :].max(axis=0) if known is None else np.array(known)
        return np.concatenate([np.full(len(self.floor), p99), np.maximum(between, p99)])[column]

    @functools.cached_property
    def floors(self) -> NDArray[np.float64]:
        """The floor [1/sr] of each column of `limits`."""
        floor = np.array(self.floor)
        return np.concatenate([floor, np.maximum(floor[1:], floor[:-1])])


def _worst(rows: Numbers) -> Numbers:
    return [[max(row)] for row in rows]


def _worst_row(rows: Numbers) -> Numbers:
    return [[max(column) for column in zip(*rows, strict=True)]]


def _wide(limits: NDArray[np.float64], rows: int, columns: int) -> NDArray[np.float64]:
    """Return limits for all rows and columns, where a single one may stand for all of them."""
    return np.broadcast_to(limits, (rows, columns))


def _rows(bands: Numbers | NDArray[np.float64], some: Places | None) -> NDArray[np.float64]:
    """Return limits by row; 0 for places that were not measured, where only the band counts."""
    if some is None:
        some = Places(
            alongside=np.zeros_like(bands).tolist(),
            one_grazing=np.zeros((places.RINGS, len(bands[0]))).tolist(),
            both_grazing=np.zeros((places.RINGS, len(bands[0]))).tolist(),
        )
    return np.concatenate([bands, some.alongside, some.one_grazing, some.both_grazing])


def stated(limits: Floats, floor: Floats, directions: Directions, brdf: Floats) -> Floats:
    """Return the error [1/sr] that a table, a family or a file states for values of f_r [1/sr], shape (..., M).

    `limits` (rows, M) are relative errors by row of `places` for each wavelength, such as columns of `Error.limits`,
    and `floor` (M,) [1/sr] their floors. `directions` broadcast to the shape of `brdf` without its last axis. The
    largest of what is stated for the band of theta_i and for the places of a pair counts; nan where a value is nan, or
    nothing is stated. It is 0 below the horizon, where f_r is exactly 0.
    """
    relative = functools.reduce(np.maximum, (limits[row] for row in places.rows_of(directions)))
    errors = relative * np.maximum(brdf, floor) + 0.0 * brdf
    return np.where(directions.below[..., np.newaxis], 0.0 * brdf, errors)


class FormulaError(BaseModel):
    """Error of the formula in a table against the highest rung: the form of its surface without an approximation."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    against: Rung = Field(
        description="measured: against a higher rung; highest rung: the formula is that rung, with an error of 0; "
        "none known: the formula is a fit, or there is no more exact form to compare with"
    )
    rung: str = Field(description="name of the highest rung; empty: none is known")
    directions: int = Field(
        description="number of random pairs above the horizon, half of the viewers in the lobe; 0: not measured"
    )
    overall: Overall | None = Field(
        description="abs(formula - rung) / max(rung, floor), as the error of a table is measured; null: none is known"
    )
    worst: WorstPair | None = Field(description="directions of the largest error; null: not measured")

    @property
    def p99(self) -> float | None:
        """Return the error [1] that 99 of 100 values keep to; None if no rung is known."""
        return None if self.overall is None else self.overall.p99

    def in_lists(self) -> dict[str, Any]:
        """Return the fields of `FormulaRung`."""
        return {"against": self.against, "rung": self.rung, "p99": self.p99}

    def in_words(self) -> str:
        """Return the standing of the formula in a few words, without its error."""
        return {
            "measured": f"against {self.rung}",
            "highest rung": f"exact form of its model: {self.rung}",
            "none known": "no more exact form to compare with",
        }[self.against]


class FormulaRung(BaseModel):
    """Standing of a formula among the forms of its surface, as lists show it."""

    against: Rung = Field(
        description="measured: against a higher rung; highest rung: it is that rung; none known: it is a fit"
    )
    rung: str = Field(description="name of the highest rung; empty: none is known")
    p99: float | None = Field(description="relative error that 99 of 100 values keep to; null: no rung is known")


class Grazing(BaseModel):
    """Directional albedo for lights between the last angle that is judged and 90 degrees, specular part included."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    power: float = Field(ge=0.0, description="the albedo grows as cos(theta_i) to the power of minus this; 0: bounded")
    origin: Literal["declared", "measured"] = Field(
        description="declared: by the model; measured: from albedos at cos(theta_i) of 1e-4, 1e-6 and 1e-8"
    )
    factor: float = Field(
        description="next to 90 degrees the albedo is a constant and this times cos(theta_i) to minus that power, at "
        "the wavelength where it is largest; if bounded, the albedo itself"
    )
    max_albedo: float | None = Field(description="largest up to 90 degrees; null: it grows without bound")
    passes_1_at_theta_i_deg: float | None = Field(
        description="angle beyond those judged above which the albedo exceeds 1; null: there is none, or it is smaller"
    )

    def in_words(self, largest: float, unit: str = " degrees") -> str:
        """Return the growth in a clause, for an albedo that is at most `largest` [1] up to the last angle judged."""
        at = self.passes_1_at_theta_i_deg
        passes = "" if at is None else f" and exceeds 1 above {near_90(at)}{unit}"
        if self.max_albedo is not None:
            beyond = f", at most {self.max_albedo:.4g}" if f"{self.max_albedo:.4g}" != f"{largest:.4g}" else ""
            return f"bounded{beyond}{passes}"
        power = "1/2" if self.power == 0.5 else f"{self.power:.3g}"
        return f"grows as cos^-{power}{passes}"


class LargestAlbedo(BaseModel):
    """The largest directional albedo of the model in a table, or of a table without a model, specular part included."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    albedo: float | None = Field(description="largest over lights and wavelengths; null: not finite")
    theta_i_deg: float
    wavelength_nm: float | None = Field(description="null: grey")
    tolerance: float = Field(description="absolute tolerance of the albedo")
    of: Literal["source", "table"] = Field(
        default="table", description="source: of the model or function that was tabulated; table: of its lookups"
    )
    up_to_theta_i_deg: float | None = Field(default=None, description="largest angle of the lights; null: not recorded")
    grazing: Grazing | None = Field(default=None, description="for lights beyond; null: not measured")

    @property
    def above_1(self) -> bool:
        """Return True if more light leaves than arrives, by more than the tolerance."""
        return self.albedo is None or self.albedo > 1.0 + self.tolerance

    def in_words(self) -> str:
        """Return the albedo, its place, and its growth at grazing light, in a sentence."""
        at = f"{self.theta_i_deg:g}°" + ("" if self.wavelength_nm is None else f", {self.wavelength_nm:g} nm")
        lights = "" if self.up_to_theta_i_deg is None else f" for lights up to {self.up_to_theta_i_deg:g}°"
        if self.albedo is None:
            return f"not finite at {at}"
        beyond = "" if self.grazing is None else f"; {self.grazing.in_words(self.albedo, '°')}"
        return f"at most {self.albedo:.3g}{lights}, at {at}{beyond}"
