"""Glints: peaks of measured f_r that no interpolant or grid can hold, each as a round Gaussian."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from brdfdb.errors import ParameterError
from brdfdb.geometry import degrees, radians, spherical_angles, unit_vector
from brdfdb.parameters import Floats

REACH = 5.0  # widths from its centre beyond which a glint is 0
WIDEST_DEG = 10.0
_CAP = 0.5 * REACH**2  # (1 - cos) at this reach, over the square of the width
_INSIDE = -np.expm1(-_CAP)  # share of the Gaussian within the reach
_SHOWN = np.linspace(-REACH, REACH, 41)  # widths from its centre at which curves show a glint
_POWERS = 5  # numbers of a row before its powers
_AT_A_LIGHT = 0.02  # degrees from a measured light, or sample, up to which a glint counts as measured
_FAINT = 0.05  # share of the smooth f_r up to which a glint changes nothing that samples around it would show
_FWHM = 2.0 * math.sqrt(2.0 * math.log(2.0))  # full width at half maximum of a Gaussian, over its standard deviation
_DECIMALS = 6  # of angles of a glint [degree]
_NAMED = 4  # glints that a sentence names
_SAME_AZIMUTH = 1e-6  # degrees
_ANGLES = ("theta_i_deg", "phi_i_deg", "in_plane_deg", "across_deg")
_STRICT = ConfigDict(frozen=True, extra="forbid")


class Glint(BaseModel):
    """A glint of one light: f_r cos theta_r is a round Gaussian around a direction near that of the mirror."""

    model_config = _STRICT

    theta_i_deg: float = Field(ge=0.0, lt=90.0, description="polar angle of the light")
    phi_i_deg: float = Field(default=0.0, description="azimuth of the light")
    in_plane_deg: float = Field(
        default=0.0,
        description="offset from the mirror direction in the plane of incidence, above 0 away from the normal",
    )
    across_deg: float = Field(
        default=0.0, gt=-90.0, lt=90.0, description="offset out of this plane, above 0 towards larger azimuths"
    )
    width_deg: float = Field(gt=0.0, le=WIDEST_DEG, description="standard deviation of the Gaussian")
    resolved: bool = Field(
        description="false: one sample shows it, and width and power are upper bounds: no wider than samples around "
        "it allow, and no more power than 1"
    )
    power: tuple[Annotated[float, Field(ge=0.0)], ...] = Field(
        min_length=1,
        description="integral of f_r cos theta_r over solid angle [1], for each wavelength of the source, or one if it "
        "is grey; 0: the light was measured, and has no such glint",
    )
    track: int = Field(default=0, ge=0, description="glints of one number belong together from light to light")
    error: float | None = Field(
        default=None, ge=0.0, description="relative error of its f_r at the samples; null: unknown"
    )

    @classmethod
    def through(cls, wi: Floats, wr: Floats, values: Floats, width_deg: float, **more: Any) -> Self:
        """Return the glint centred at `wr` whose f_r there is `values` (C,) [1/sr], for unit vectors (3,) of one pair.

        `more` are further fields, such as `resolved`. A glint that is not resolved is so narrow that it reflects at
        most all light.
        """
        cosine_r, width = float(wr[2]), float(radians(width_deg))
        if not more.get("resolved"):
            full = 2.0 * np.pi * _INSIDE * max(float(np.max(values)), 1e-300) * max(cosine_r, width)
            width = min(width, 1.0 / math.sqrt(full))
        power = np.maximum(values, 0.0) * (2.0 * np.pi * width**2 * _INSIDE * float(_mean_cosine(cosine_r, width)))
        angles = np.round([*degrees(spherical_angles(wi)), *offsets_deg(wi, wr)], _DECIMALS).tolist()
        return cls(
            **dict(zip(_ANGLES, angles, strict=True)),
            width_deg=float(degrees(width)),
            power=tuple(np.atleast_1d(power).tolist()),
            **more,
        )

    @property
    def centre(self) -> Floats:
        """Unit vector (3,) of its centre."""
        return np.asarray(_centre(*(radians([getattr(self, name)]) for name in _ANGLES))[0])

    @property
    def phrase(self) -> str:
        """Return where the glint is and how much it reflects, in words."""
        apart = float(np.hypot(self.in_plane_deg, self.across_deg))
        where = "in the mirror direction" if apart < 0.05 else f"{apart:.2g} degrees from the mirror direction"
        most = "" if self.resolved else "at most "
        share = 100.0 * float(np.mean(self.power))
        shape = f"{most}{self.fwhm_deg:.2g} degrees wide at half its height"
        reflects = f"reflects {most}{share if self.resolved else min(share, 100.0):.3g} %"
        return f"of light at {self.theta_i_deg:g} degrees, {where}, {shape}, {reflects}"

    @property
    def fwhm_deg(self) -> float:
        """Full width at half maximum [degree]."""
        return _FWHM * self.width_deg


@dataclass(frozen=True, eq=False)  # numbers of glints are compared, not what is computed from them
class _Track:
    """Glints of one track, by azimuths of lights: rows of numbers, those of one azimuth by increasing polar angle.

    A row has the offsets in the plane and across [rad], the width [rad], the error [1], 1 if it is not resolved, and
    powers [1].
    """

    azimuths: Floats  # (A,) [rad], increasing, in [0, 2 pi)
    first: NDArray[np.int64]  # numbers of the first row of each azimuth, and the number of rows (A + 1,)
    theta_i: Floats  # [rad], a number a row
    rows: Floats

    @property
    def farthest(self) -> float:
        """Largest 1 - cos of the angle from the mirror direction to a direction within reach of a glint."""
        apart = np.max(np.abs(self.rows[:, 0]) + np.abs(self.rows[:, 1])) + 1.01 * REACH * np.max(self.rows[:, 2])
        return float(1.0 - np.cos(np.minimum(apart, np.pi)))


class _Spots(NamedTuple):
    """Glints of one track for N lights. Powers are weighted sums of four rows of the track."""

    centre: Floats  # unit vectors (N, 3)
    width: Floats  # [rad]
    error: Floats  # relative [1], nan if it is unknown
    guessed: Floats  # 1: the shape is a guess, as the glint is not resolved
    measured: NDArray[np.bool_]  # true: the light is one that was measured
    row: NDArray[np.int64]  # (N, 4)
    weight: Floats  # (N, 4)
    powers: Floats  # of all rows

    @property
    def power(self) -> Floats:
        """Powers (N, C) [1]."""
        return np.asarray(np.einsum("nk,nkc->nc", self.weight, self.powers[self.row]))

    def versine(self, wr: Floats) -> Floats:
        """Return 1 - cos of the angles (N,) from the centres to viewers (N, 3)."""
        return np.asarray(0.5 * np.sum((wr - self.centre) ** 2, axis=1))

    @property
    def highest(self) -> Floats:
        """Density [1/sr] (N,) of the Gaussians at their centres."""
        return np.asarray(1.0 / (2.0 * np.pi * self.width**2 * _INSIDE))

    def density(self, wr: Floats) -> Floats:
        """Return the density [1/sr] of the Gaussian at viewers (N, 3)."""
        over = self.versine(wr) / self.width**2
        return np.asarray(np.where(over < _CAP, np.exp(-over) * self.highest, 0.0))

    @property
    def power_per_cosine(self) -> Floats:
        """Ratio (N, C) of f_r to the density."""
        return np.asarray(self.power / _mean_cosine(self.centre[:, 2], self.width)[:, np.newaxis])


class Glints(BaseModel):
    """All glints of a surface, and the rule between the lights that were measured.

    A glint follows the mirror direction. Between the lights of its track offset, width and power are interpolated
    linearly in theta_i (and in the azimuth of the light, if the surface is turned); beyond the first and last light
    they are those of that light. Both are marked as extrapolated. A measured light without the glint is an entry of
    power 0: `with_dark_lights` adds them.

    f_r = P exp(-(1 - cos g) / s^2) / (2 pi s^2 c cos theta_c) up to five widths: g is the angle to the centre, s the
    width, theta_c the polar angle of the centre, and c makes the integral of f_r cos theta_r the power P, but for the
    part of a glint that lies below the horizon. cos theta_c is at least s: glints fade at the horizon.
    """

    model_config = _STRICT

    glints: tuple[Glint, ...] = Field(min_length=1)
    turned: bool = Field(default=False, description="true: the azimuth of the light counts (an anisotropic surface)")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if len({len(glint.power) for glint in self.glints}) > 1:
            raise ParameterError("power", "glints have different numbers of wavelengths")
        assert self._tracks  # which refuses two glints of one track and light
        return self

    @property
    def sentence(self) -> str:
        """Return a sentence that names the glints of the largest power, up to a few."""
        return sentence_of(self.glints)

    def left_out(self, where: str) -> str:
        """Return a sentence that says that an output leaves the glints out; `where` names it, such as "the file"."""
        most = 100.0 * min(float(np.mean(self.strongest.power)), 1.0)
        return f"not in {where}: the glints of the table, up to {most:.3g} % of the light of a direction"

    @property
    def lit(self) -> tuple[Glint, ...]:
        """The glints that have power."""
        return tuple(glint for glint in self.glints if any(glint.power))

    @property
    def strongest(self) -> Glint:
        """The glint of the largest power."""
        return max(self.glints, key=lambda glint: float(np.mean(glint.power)))

    @property
    def channels(self) -> int:
        """Number of wavelengths of the powers."""
        return len(self.glints[0].power)

    def with_dark_lights(self, theta_i_deg: Floats, phi_i_deg: Floats) -> Self:
        """Return the glints with an entry of power 0 for each measured light (K,) that lacks one, in each track."""
        complete: list[Glint] = []
        for number in sorted({glint.track for glint in self.glints}):
            own = [glint for glint in self.glints if glint.track == number]
            for theta, phi in zip(np.ravel(theta_i_deg).tolist(), np.ravel(phi_i_deg).tolist(), strict=True):
                around = np.array([abs((glint.phi_i_deg - phi + 180.0) % 360.0 - 180.0) for glint in own])
                around *= np.sin(radians(theta)) if self.turned else 0.0
                apart = np.hypot([glint.theta_i_deg - theta for glint in own], around)
                if apart.min() > _AT_A_LIGHT:
                    place = {"theta_i_deg": theta, "phi_i_deg": phi, "power": (0.0,) * self.channels}
                    own.append(own[int(np.argmin(apart))].model_copy(update=place))
            complete += own
        return type(self)(glints=tuple(complete), turned=self.turned)

    def limited(self, room: Floats) -> Self:
        """Return the glints with at most some power [1] for all glints of a light; `room` is that of each (K, C) light.

        A glint that is not resolved becomes narrower, and keeps f_r at its centre; others lose power.
        """
        wi = unit_vector(radians([g.theta_i_deg for g in self.glints]), radians([g.phi_i_deg for g in self.glints]))
        total = self.power(wi)
        factors = np.min(np.minimum(room / np.maximum(total, 1e-300), 1.0), axis=1, where=total > 0.0, initial=1.0)
        changed = []
        for glint, factor in zip(self.glints, factors.tolist(), strict=True):
            width = glint.width_deg * (1.0 if glint.resolved else math.sqrt(max(factor, 1e-6)))
            power = tuple(factor * share for share in glint.power)
            changed.append(glint.model_copy(update={"power": power, "width_deg": width}))
        return type(self)(glints=tuple(changed), turned=self.turned)

    def mixed(self, weights: Floats) -> Self:
        """Return the glints at other wavelengths: powers times weights (C, M), at least 0."""
        powers = (tuple(np.maximum(np.array(glint.power) @ weights, 0.0).tolist()) for glint in self.glints)
        changed = (glint.model_copy(update={"power": row}) for glint, row in zip(self.glints, powers, strict=True))
        return type(self)(glints=tuple(changed), turned=self.turned)

    def f_r(self, wi: Floats, wr: Floats) -> Floats:
        """Return f_r [1/sr] (N, C) of the glints at unit vectors (N, 3) of light and viewer; 0 below the horizon."""
        values = np.zeros((len(wi), self.channels))
        for spots, at in self._reached(wi, wr):
            values[at] += spots.power_per_cosine * spots.density(wr[at])[:, np.newaxis]
        return values

    def error(self, wi: Floats, wr: Floats, smooth: Floats, noise: float) -> Floats:
        """Return the error [1/sr] (N, C) of `f_r`; nan where it is extrapolated, or its error is unknown.

        It is at least the relative `noise` of the samples. Off the sample that shows it a glint that is not resolved
        may be as low as 0, or as high as the sample; where it is faint beside the `smooth` f_r (N,) [1/sr], samples
        around it show that it is not higher.
        """
        errors = np.zeros((len(wi), self.channels))
        for spots, at in self._reached(wi, wr):
            density, f_r_per_density = spots.density(wr[at]), spots.power_per_cosine
            faint = f_r_per_density.mean(axis=1) * density <= _FAINT * smooth[at]
            between = (spots.guessed > 0.0) & (spots.versine(wr[at]) > 0.5 * radians(_AT_A_LIGHT) ** 2)
            bound = np.where(faint, density, np.maximum(density, spots.highest - density))
            error = np.where(between, bound, np.maximum(spots.error, noise) * density)
            errors[at] += f_r_per_density * np.where(spots.measured, error, np.nan)[:, np.newaxis]
        return errors

    def power(self, wi: Floats, *, guessed: bool = False) -> Floats:
        """Return the power [1] (N, C) of all glints of lights (N, 3): what they add to the albedo.

        With `guessed` the part that may be less: of glints that are not resolved, or at lights not measured.
        """
        every = [_spots(track, wi) for track in self._tracks]
        shares = [np.where(spots.measured, spots.guessed, 1.0) if guessed else 1.0 for spots in every]
        return np.asarray(sum((spots.power.T * share).T for spots, share in zip(every, shares, strict=True)))

    def near(self, wi: Floats, wr: Floats, *, extrapolated: bool = False) -> NDArray[np.bool_]:
        """Return which pairs of unit vectors (N, 3) lie within the reach of a glint, five widths.

        With `extrapolated` those in a glint whose light is not one of those measured.
        """
        inside = np.zeros(len(wi), dtype=bool)
        for spots, at in self._reached(wi, wr):
            inside[at] |= ~spots.measured if extrapolated else True
        return inside

    def _reached(self, wi: Floats, wr: Floats) -> Iterator[tuple[_Spots, NDArray[np.int64]]]:
        """Yield the glints of each track that have power at some pairs, and the numbers of these pairs."""
        off = 0.5 * np.sum((wr - wi * (-1.0, -1.0, 1.0)) ** 2, axis=1)  # 1 - cos of the angle to the mirror direction
        for track in self._tracks:
            near = np.flatnonzero(off <= track.farthest)
            spots = _spots(track, wi[near])
            lit = np.einsum("nk,nk->n", spots.weight, spots.powers.max(axis=1)[spots.row]) > 0.0
            at = np.flatnonzero(lit & (spots.versine(wr[near]) < _CAP * spots.width**2) & (wr[near, 2] >= 0.0))
            if at.size:
                chosen = {name: values[at] for name, values in spots._asdict().items() if name != "powers"}
                yield spots._replace(**chosen), near[at]

    def viewers_deg(self, theta_i_deg: float, phi_i_deg: float) -> Floats:
        """Return polar angles [degree] of viewers that show the glints of a light, above 0 on the mirror side."""
        wi = unit_vector(radians([theta_i_deg]), radians([phi_i_deg]))
        spots = [spot for spot in (_spots(track, wi) for track in self._tracks) if np.any(spot.power > 0.0)]
        x, y, z = np.reshape([spot.centre for spot in spots], (-1, 3)).T
        side = radians(phi_i_deg) + np.pi
        width = np.reshape([spot.width for spot in spots], (-1, 1))
        shown = degrees(np.arctan2(x * np.cos(side) + y * np.sin(side), z)[:, np.newaxis] + width * _SHOWN)
        return np.asarray(np.clip(shown.ravel(), -90.0, 90.0))

    def draw(self, u1: Floats, u2: Floats, wi: Floats) -> Floats:
        """Return viewers (N, 3) drawn from the glints of lights (N, 3), by uniform random numbers (N,).

        Some are below the horizon. Where a light has no glint the viewer is the mirror direction of the first track.
        """
        spots = [_spots(track, wi) for track in self._tracks]
        share = _shares(spots)
        sums = np.cumsum(share, axis=0)
        chosen = np.minimum(np.sum(u1 >= sums, axis=0), len(spots) - 1)
        number = np.arange(len(wi))
        below = np.where(chosen > 0, sums[chosen - 1, number], 0.0)
        own = share[chosen, number]
        u = np.clip(np.divide(u1 - below, own, out=np.zeros(len(wi)), where=own > 0.0), 0.0, 1.0)
        centre = np.stack([spot.centre for spot in spots])[chosen, number]
        width = np.stack([spot.width for spot in spots])[chosen, number]
        versine = -np.log1p(-u * _INSIDE) * width**2
        sin = np.sqrt(versine * (2.0 - versine))
        theta, phi = spherical_angles(centre)
        down, side = unit_vector(theta + 0.5 * np.pi, phi), unit_vector(0.5 * np.pi, phi + 0.5 * np.pi)
        angle = 2.0 * np.pi * u2[:, np.newaxis]
        across = down * np.cos(angle) + side * np.sin(angle)
        return np.asarray(centre * (1.0 - versine)[:, np.newaxis] + across * sin[:, np.newaxis])

    def density(self, wi: Floats, wr: Floats) -> Floats:
        """Return the density [1/sr] (N,) of `draw`; 0 for lights without a glint."""
        spots = [_spots(track, wi) for track in self._tracks]
        shared = zip(_shares(spots), spots, strict=True)
        return np.asarray(sum(share * spot.density(wr) for share, spot in shared))

    @functools.cached_property
    def _tracks(self) -> list[_Track]:
        tracks = []
        for number in sorted({glint.track for glint in self.glints}):
            of_track = [glint for glint in self.glints if glint.track == number]
            table = [  # angles in degrees; an error of None is nan
                (
                    round(g.phi_i_deg % 360.0 / _SAME_AZIMUTH) if self.turned else 0,
                    *(g.theta_i_deg, g.in_plane_deg, g.across_deg, g.width_deg),
                    *(g.error, not g.resolved, *g.power),
                )
                for g in of_track
            ]
            rows = np.array(sorted(table, key=lambda row: row[:2]), dtype=np.float64)
            if not np.diff(rows[:, :2], axis=0).any(axis=1).all():
                raise ParameterError("track", f"two glints of track {number} have one light", number)
            azimuths, first = np.unique(rows[:, 0], return_index=True)
            rows[:, 1:5] = radians(rows[:, 1:5])
            starts = np.append(first, len(rows))
            tracks.append(_Track(radians(azimuths * _SAME_AZIMUTH), starts, rows[:, 1], rows[:, 2:]))
        return tracks


def _spots(track: _Track, wi: Floats) -> _Spots:
    """Return the glints of a track for lights (N, 3)."""
    theta, phi = spherical_angles(wi)
    count = track.azimuths.size
    # Number of the azimuth before that of the light, around the circle, and the share of the way to the next
    edges = np.append(track.azimuths - track.azimuths[0], 2.0 * np.pi)
    turn = np.interp((phi - track.azimuths[0]) % (2.0 * np.pi), edges, np.arange(count + 1.0))
    before = np.minimum(turn.astype(np.int64), count - 1)
    rows, weights = [], []
    for azimuth, share in ((before, 1.0 - turn + before), ((before + 1) % count, turn - before)):
        place = np.empty(len(wi))
        for number in np.unique(azimuth):
            start, end = track.first[number : number + 2]
            at = azimuth == number
            place[at] = np.interp(theta[at], track.theta_i[start:end], np.arange(float(start), float(end)))
        low = place.astype(np.int64)
        rows += [low, np.minimum(low + 1, track.first[azimuth + 1] - 1)]
        weights += [share * (1.0 - place + low), share * (place - low)]
    row, weight = np.stack(rows, axis=1), np.stack(weights, axis=1)
    above = np.where(wi[:, 2] >= 0.0, 1.0, 0.0)
    shape = np.einsum("nk,nkc->nc", weight, track.rows[row, :_POWERS])
    centre = _centre(theta, phi, shape[:, 0], shape[:, 1])
    nearest = np.take_along_axis(row, weight.argmax(axis=1)[:, np.newaxis], axis=1)[:, 0]
    azimuth = track.azimuths[np.searchsorted(track.first, nearest, side="right") - 1]
    around = np.abs((phi - azimuth + np.pi) % (2.0 * np.pi) - np.pi) * np.sin(theta) if count > 1 else 0.0
    measured = np.hypot(theta - track.theta_i[nearest], around) <= radians(_AT_A_LIGHT)
    powers = track.rows[:, _POWERS:]
    width, error, guessed = shape[:, 2:_POWERS].T
    return _Spots(centre, width, error, guessed, measured, row, weight * above[:, np.newaxis], powers)


def _centre(theta_i: Floats, phi_i: Floats, in_plane: Floats, across: Floats) -> Floats:
    """Return the directions (N, 3) at offsets [rad] from the mirror directions of lights at angles [rad]."""
    radial, tangent = unit_vector(theta_i + in_plane, phi_i + np.pi), unit_vector(0.5 * np.pi, phi_i - 0.5 * np.pi)
    return np.asarray(radial * np.cos(across)[:, np.newaxis] + tangent * np.sin(across)[:, np.newaxis])


def _mean_cosine(cosine: Floats | float, width: Floats | float) -> Floats:
    """Return the mean of cos theta_r over a Gaussian of a width [rad] whose centre has a `cosine`."""
    return np.asarray((1.0 - np.square(width) * (1.0 - _CAP * np.exp(-_CAP) / _INSIDE)) * np.maximum(cosine, width))


def _shares(spots: list[_Spots]) -> Floats:
    """Return the share of each track in the power of a light, (tracks, N), by the mean over wavelengths."""
    power = np.stack([spot.power.mean(axis=1) for spot in spots])
    total = power.sum(axis=0)
    return np.asarray(np.divide(power, total, out=np.zeros(power.shape), where=total > 0.0))


def sentence_of(glints: Sequence[Glint]) -> str:
    """Return a sentence that names the glints of the largest power, up to a few."""
    lit = sorted((glint for glint in glints if any(glint.power)), key=lambda glint: -float(np.mean(glint.power)))
    named = sorted(lit[:_NAMED], key=lambda glint: glint.theta_i_deg)
    some = f", the strongest {_NAMED}" if len(lit) > _NAMED else ""
    count = "one glint" if len(lit) == 1 else f"{len(lit)} glints"
    where = "; ".join(glint.phrase for glint in named)
    return f"{count} kept beside the grid, which cannot hold such peaks{some}: {where}"


def offsets_deg(wi: Floats, wr: Floats) -> tuple[Floats, Floats]:
    """Return the offsets [degree] of viewers from the mirror directions of lights, unit vectors (..., 3).

    The first is in the plane of incidence, above 0 away from the normal; the second is across, above 0 towards larger
    azimuths.
    """
    theta_i, phi_i = spherical_angles(wi)
    side = phi_i + np.pi
    radial = wr[..., 0] * np.cos(side) + wr[..., 1] * np.sin(side)
    tangent = wr[..., 1] * np.cos(side) - wr[..., 0] * np.sin(side)
    return degrees(np.arctan2(radial, wr[..., 2]) - theta_i), degrees(np.arcsin(np.clip(tangent, -1.0, 1.0)))
