"""f_r cos(theta_r) of a table over lights and half vectors, as files of RGL want it."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from brdfdb.formats.rgl._fields import Array, Floats32, bilinear, directions
from brdfdb.parameters import Floats

if TYPE_CHECKING:
    from brdfdb.formats._channels import Channels
    from brdfdb.tables.table import Table

LAST_THETA = np.deg2rad(89.0)  # last node of theta_i; readers continue with its values
_LOWEST = 0.002  # cosine of theta_r below which f_r is continued: some models have a pole at the horizon
_SYMMETRIES = {4: ((1.0, -1.0), (-1.0, 1.0)), 2: ((-1.0, -1.0),)}  # signs of x and y that leave f_r as it is
_DRAWN, _SAME = 2000, 1e-3  # pairs that symmetries are tested with, and their largest relative difference
# Nodes of the factors: of the half vector, of the light, and lights that the former is averaged over
_COLUMNS = 384
_ROWS = 97
_LIGHTS = 8
_SIDES = 12
_DARKEST = 1e-3  # share of the mean f_r that is added before logarithms are taken
_NEAR_HORIZON = 0.05  # cosine of theta_r from which on values count for the factors
_FLOOR = 0.02  # share of the mean value that bends are relative to, where values are smaller
_MOST_BENT = 1e4  # largest relative second derivative that counts
_EVERYWHERE = 0.03  # weight of half vectors that no pair of directions has
_POWER = 0.2  # densities are least in error for a power of the second derivative between 1/5 and 1/2
_SHARE = 0.5  # share of a density that follows the bends; the rest is even
_RAMP = 0.3  # cosine of theta_r below the horizon at which the even part of a ramp ends
_LEAST = 0.02  # density there
_SMOOTHINGS = 3
_CENTRE = 0.15  # place up to which densities grow from 0 along rows: theta_m then grows as the uniform numbers


@dataclass(frozen=True, eq=False)
class HalfVectorValues:
    """Values at half vectors: f_r cos(theta_r), and what belongs to it."""

    brdf: Array  #: f_r cos(theta_r), continued below the horizon, where it is negative, (..., C) [1/sr]
    cosine: Array  #: cosine of theta_r, (...) [1]
    solid_angle: Array  #: solid angle of the viewer for each area of the unit square of half vectors, (...) [sr]


class Factors(NamedTuple):
    """The factor over half vectors, shape (h, w), and the divisor over the light."""

    ndf: Floats32
    sigma: Floats32


class Bends(NamedTuple):
    """Densities along rows (slices, rows, columns) and over the rows (slices, rows) from second derivatives."""

    along: Array
    across: Array


class HalfVectorSurface:
    """The values of a table.

    Parameters
    ----------
    table : Table
        Table in memory.
    channels : Channels
        Channels that are looked up.
    full : bool
        The file is to hold all azimuths of the light, even if those of a part of the circle are enough.
    """

    def __init__(self, table: Table, channels: Channels, full: bool = False) -> None:
        self._table = table
        self._channels = channels
        self.isotropic = not table.anisotropic
        self.reduction = 1 if full or self.isotropic else _reduction(table, channels)

    def values(self, wi: Array, x: Array, y: Array) -> HalfVectorValues:
        """Return the values at lights (slices, 1, 1, 3) and half vectors x, y (slices, rows, columns).

        The rows are those of the unit square from 0 to 1. Of isotropic tables only half of them are looked up.
        """
        rows = x.shape[1]
        if not self.isotropic:
            return self._looked_up(wi, x, y)
        half = self._looked_up(wi, x[:, : (rows + 1) // 2], y[:, : (rows + 1) // 2])
        # The other side of the plane of incidence has the same rows in reverse order
        parts = (half.brdf, half.cosine, half.solid_angle)
        return HalfVectorValues(*(np.concatenate([part, part[:, : rows // 2][:, ::-1]], axis=1) for part in parts))

    def _looked_up(self, wi: Array, x: Array, y: Array) -> HalfVectorValues:
        m = directions(x, y)
        along = np.sum(wi * m, axis=-1)
        wr = 2.0 * along[..., np.newaxis] * m - wi
        cosine = wr[..., 2]
        height = np.maximum(np.abs(cosine), _LOWEST)  # of the viewer that is looked up: mirrored at the horizon
        length = np.sqrt(np.maximum(wr[..., 0] ** 2 + wr[..., 1] ** 2, 1e-30))
        flat = wr[..., :2] * (np.sqrt(np.maximum(1.0 - height**2, 0.0)) / length)[..., np.newaxis]
        above = np.concatenate([flat, np.minimum(height, 1.0)[..., np.newaxis]], axis=-1)
        f_r = self._channels.values(self._table, np.broadcast_to(wi, above.shape), above)
        solid_angle = 8.0 * np.pi**2 * x * np.sin(x**2 * (np.pi / 2.0)) * np.maximum(along, 0.0)
        return HalfVectorValues(f_r * cosine[..., np.newaxis], cosine, solid_angle)

    @functools.cached_property
    def factors(self) -> Factors:
        """The factors of the mean channel.

        ln f_r is taken as a sum of a function of the half vector and one of theta_i, as near as least squares come.
        """
        theta_i = np.linspace(0.0, LAST_THETA, _LIGHTS)
        phi_i = np.zeros(1) if self.isotropic else np.linspace(-np.pi, -np.pi + 2.0 * np.pi / self.reduction, 2)
        wi = lights(theta_i, phi_i).reshape(-1, 1, 1, 3)
        # of isotropic tables the factor is the same at all azimuths, and one side of the plane of incidence is enough
        rows = (np.arange(_SIDES) + 0.5) / (2 * _SIDES) if self.isotropic else np.linspace(0.0, 1.0, _ROWS)
        columns = np.linspace(0.0, 1.0, _COLUMNS)
        x, y = (np.broadcast_to(u, (len(wi), rows.size, _COLUMNS)) for u in np.meshgrid(columns, rows))
        values = self._looked_up(wi, x, y)
        weight = np.where(values.cosine > _NEAR_HORIZON, values.cosine, 0.0)
        f_r = np.maximum(values.brdf.mean(axis=-1) / np.maximum(values.cosine, _NEAR_HORIZON), 0.0)
        counted = weight * values.solid_angle
        mean = np.sum(f_r * counted) / np.sum(counted)
        logarithm = np.where(weight > 0.0, np.log(f_r + _DARKEST * mean + 1e-30), 0.0)
        axes = (0, 1) if self.isotropic else (0,)
        whole = np.sum(weight, axis=axes, keepdims=True)
        of_light = np.zeros((len(wi), 1, 1))
        for _ in range(6):
            of_half = np.sum(weight * (logarithm - of_light), axis=axes, keepdims=True) / np.maximum(whole, 1e-9)
            of_light = np.sum(weight * (logarithm - of_half), axis=(1, 2), keepdims=True)
            of_light /= np.sum(weight, axis=(1, 2), keepdims=True)
        lines = [
            np.interp(columns, columns[known > 0.0], line[known > 0.0])
            for line, known in zip(of_half[0], whole[0], strict=True)
        ]
        ndf = np.exp(np.array(lines * (2 if self.isotropic else 1)))
        u = np.linspace(0.0, 1.0, 128)
        of_theta = np.interp(u**2 * (np.pi / 2.0), theta_i, of_light.reshape(phi_i.size, -1).mean(axis=0))
        sigma = 0.25 * np.exp(-of_theta)
        return Factors(ndf.astype(np.float32), np.stack([sigma, sigma]).astype(np.float32))


def lights(theta_i: Floats, phi_i: Floats) -> Array:
    """Return unit vectors (P, N, 3) of all polar angles and azimuths [rad]."""
    phi, theta = np.meshgrid(phi_i.astype(np.float64), theta_i.astype(np.float64), indexing="ij")
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)


def _reduction(table: Table, channels: Channels) -> int:
    """Return by how much the circle of azimuths can be reduced for the symmetries of a table: 4, 2 or 1."""
    rng = np.random.default_rng(1)
    u, v = rng.random((2, 2, _DRAWN))
    theta = np.arccos(0.1 + 0.9 * u)
    phi = 2.0 * np.pi * v
    wi, wr = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    values = channels.values(table, wi, wr)
    for reduction, symmetries in _SYMMETRIES.items():
        mirrored = [channels.values(table, wi * (*signs, 1.0), wr * (*signs, 1.0)) for signs in symmetries]
        if all(np.all(np.abs(other - values) <= _SAME * np.abs(values) + 1e-9) for other in mirrored):
            return reduction
    return 1


def densities(
    surface: HalfVectorSurface, wi: Array, ndf: Floats32, rows: int, columns: int, horizon: float
) -> Floats32:
    """Return densities over half vectors, shape (slices, rows, columns), for lights (slices, 1, 1, 3).

    `ndf` is the factor over half vectors, which is not in the values that are stored. Two rows and two columns give the
    identity warp. `horizon` is the share of each row above the horizon; 0: there is none, and densities fall off slowly
    below it.
    """
    if rows == 2:
        return np.ones((len(wi), 2, 2), np.float32)
    shape = (len(wi), rows, columns)
    u, v = np.linspace(0.0, 1.0, columns), np.linspace(0.0, 1.0, rows)
    x, y = (np.broadcast_to(axis, shape) for axis in np.meshgrid(u, v))
    values = surface.values(wi, x, y)
    ramp = np.clip(1.0 + values.cosine / _RAMP, _LEAST, 1.0)
    factor = bilinear(ndf, x[0], y[0])
    along, across = _bends(values, factor, np.sin(x**2 * (np.pi / 2.0)) * x, ramp)
    if horizon == 0.0:
        line = _SHARE * _even(along * ramp) + (1.0 - _SHARE) * _even(ramp) + 1e-3
    else:
        azimuth = 0.0 if surface.isotropic else np.arctan2(wi[..., 1], wi[..., 0])[..., 0]
        line = _up_to_horizon(along, u, _horizon(wi[:, 0], (2.0 * v - 1.0) * np.pi - azimuth), horizon)
    line = line * np.clip(u / _CENTRE, 1e-3, 1.0)
    whole = np.sum(line[..., 1:] + line[..., :-1], axis=-1)
    row = _SHARE * across / across.mean(axis=-1, keepdims=True) + (1.0 - _SHARE)
    density = line * (row / whole)[..., np.newaxis]
    density = density / density.mean(axis=(1, 2), keepdims=True)
    return np.asarray(density).astype(np.float32)


def _bends(values: HalfVectorValues, factor: Array, area: Array, ramp: Array) -> Bends:
    """Return the densities that follow the bends of values."""
    stored = values.brdf / factor[..., np.newaxis]
    scale = np.abs(stored) + _FLOOR * np.abs(stored).mean(axis=(1, 2), keepdims=True) + 1e-30
    rows, columns = factor.shape
    along = np.zeros(stored.shape)
    along[:, :, 1:-1] = np.abs(np.diff(stored, 2, axis=2)) / scale[:, :, 1:-1] * (columns - 1) ** 2
    along[:, :, 0], along[:, :, -1] = along[:, :, 1], along[:, :, -2]
    across = np.abs(np.diff(_around(stored), 2, axis=1)) / scale * (rows - 1) ** 2
    bent_along, bent_across = (np.minimum(bent.mean(axis=-1), _MOST_BENT) for bent in (along, across))
    above = values.cosine > 0.0
    hemisphere = np.where(above, values.cosine * values.solid_angle, 0.0)
    lobe = np.where(above, factor * area, 0.0)
    weight = sum(part / np.maximum(part.mean(axis=(1, 2), keepdims=True), 1e-30) for part in (hemisphere, lobe))
    dense = (bent_along**2 * (weight + _EVERYWHERE)) ** _POWER + 1e-9
    over_rows = np.sum((bent_across**2 * weight) ** _POWER * ramp, axis=2) / np.sum(ramp, axis=2) + 1e-9
    for _ in range(_SMOOTHINGS):
        dense[:, :, 1:-1] = 0.25 * (dense[:, :, 2:] + 2.0 * dense[:, :, 1:-1] + dense[:, :, :-2])
        dense = _smooth(dense)
        over_rows = _smooth(over_rows)
    return Bends(dense, over_rows)


def _up_to_horizon(dense: Array, u: Array, horizon: Array, share: float) -> Array:
    """Return densities along rows of which a share lies before the horizon, at (slices, rows) of [0, 1].

    They go on beyond it for as far as the rest takes them: of a mixture of two lights the horizon then is where it is
    of each, because the readers mix the integrals of densities.
    """
    inside = u <= horizon[..., np.newaxis]
    count = np.maximum(inside.sum(axis=-1), 1)
    last = (count - 1)[..., np.newaxis]
    dense = np.take_along_axis(dense, np.minimum(np.arange(u.size), last), axis=-1)
    mean = np.sum(dense * inside, axis=-1) / count
    line = _SHARE * dense / mean[..., np.newaxis] + (1.0 - _SHARE)
    edge = np.take_along_axis(line, last, axis=-1)[..., 0]
    width = np.maximum((1.0 - share) / share * horizon * np.sum(line * inside, axis=-1) / (count * edge), u[1])
    beyond = np.clip(((horizon + width)[..., np.newaxis] - u) / u[1] + 0.5, 0.0, 1.0)
    first, second = np.where(inside, line, 0.0), np.where(inside, 0.0, line * beyond + 1e-3)
    ends = np.ones_like(horizon)
    wanted = share * _integral(first, ends) - _integral(first, horizon)
    given = _integral(second, horizon) - share * _integral(second, ends)
    scale = np.clip(wanted / np.minimum(given, -1e-9), 0.02, 50.0)
    return np.asarray(first + scale[..., np.newaxis] * second)


def _horizon(wi: Array, azimuth: Array) -> Array:
    """Return where rows meet the horizon of the viewer, shape (slices, rows), for azimuths from that of the light."""
    sine = np.hypot(wi[..., 0], wi[..., 1])
    theta_m = 0.5 * np.arctan2(wi[..., 2], -sine * np.cos(azimuth))
    return np.asarray(np.sqrt(theta_m * (2.0 / np.pi)))


def _integral(line: Array, end: Array) -> Array:
    """Return the integrals, in cells, of straight lines between nodes over [0, 1], up to their ends."""
    cells = line.shape[-1] - 1
    i = np.minimum((end * cells).astype(np.int64), cells - 1)[..., np.newaxis]
    part = end * cells - i[..., 0]
    sums = np.zeros(line.shape)
    np.cumsum(0.5 * (line[..., 1:] + line[..., :-1]), axis=-1, out=sums[..., 1:])
    low, high, below = (np.take_along_axis(a, k, axis=-1)[..., 0] for a, k in ((line, i), (line, i + 1), (sums, i)))
    return np.asarray(below + part * (low + 0.5 * part * (high - low)))


def _even(line: Array) -> Array:
    return np.asarray(line / line.mean(axis=-1, keepdims=True))


def _around(values: Array) -> Array:
    """Return values with one more row at each end: azimuths go round."""
    return np.concatenate([values[:, -2:-1], values, values[:, 1:2]], axis=1)


def _smooth(values: Array) -> Array:
    around = _around(values)
    return np.asarray(0.25 * (around[:, 2:] + 2.0 * around[:, 1:-1] + around[:, :-2]))
