"""f_r cos(theta_r) of a table over lights and half vectors, as files of RGL want it."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from brdfdb.formats._rgl_fields import Floats32, directions
from brdfdb.formats._rgl_warp import Array
from brdfdb.parameters import Floats

if TYPE_CHECKING:
    from brdfdb.formats._channels import Channels
    from brdfdb.tables.table import Table

LAST_THETA = np.deg2rad(89.0)  # last node of theta_i; readers continue with its values
_LOWEST = 0.002  # cosine of theta_r below which f_r is continued: some models have a pole at the horizon
_SYMMETRIES = {4: ((1.0, -1.0), (-1.0, 1.0)), 2: ((-1.0, -1.0),)}  # signs of x and y that leave f_r as it is
_DRAWN, _SAME = 2000, 1e-3  # pairs that symmetries are tested with, and their largest relative difference
# Nodes of the factors: of the half vector, of the light, and lights that the former is averaged over
_COLUMNS, _ROWS, _LIGHTS, _SIDES = 384, 97, 8, 12
_DARKEST = 1e-3  # share of the mean f_r that is added before logarithms are taken
_NEAR_HORIZON = 0.05  # cosine of theta_r from which on values count for the factors


@dataclass(frozen=True, eq=False)
class Values:
    """Values at half vectors: f_r cos(theta_r), and what belongs to it.

    Attributes
    ----------
    brdf : array (..., C) [1/sr]
        f_r cos(theta_r), continued below the horizon, where it is negative.
    cosine : array (...) [1]
        Cosine of theta_r.
    solid_angle : array (...) [sr]
        Solid angle of the viewer for each area of the unit square of half vectors.
    """

    brdf: Array
    cosine: Array
    solid_angle: Array


class Surface:
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
        self._table, self._channels = table, channels
        self.isotropic = not table.anisotropic
        self.reduction = 1 if full or self.isotropic else _reduction(table, channels)

    def values(self, wi: Array, x: Array, y: Array) -> Values:
        """Return the values at lights (slices, 1, 1, 3) and half vectors x, y (slices, rows, columns).

        The rows are those of the unit square from 0 to 1. Of isotropic tables only half of them are looked up.
        """
        rows = x.shape[1]
        if not self.isotropic:
            return self._looked_up(wi, x, y)
        half = self._looked_up(wi, x[:, : (rows + 1) // 2], y[:, : (rows + 1) // 2])
        return Values(*(_mirrored(part, rows // 2) for part in (half.brdf, half.cosine, half.solid_angle)))

    def _looked_up(self, wi: Array, x: Array, y: Array) -> Values:
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
        return Values(f_r * cosine[..., np.newaxis], cosine, solid_angle)

    @functools.cached_property
    def factors(self) -> tuple[Floats32, Floats32]:
        """The factor over half vectors, shape (h, w), and the divisor over the light, both of the mean channel.

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
        return ndf.astype(np.float32), np.stack([sigma, sigma]).astype(np.float32)


def _mirrored(values: Array, count: int) -> Array:
    """Return rows with as many of them again, in reverse order: the other side of the plane of incidence."""
    return np.concatenate([values, values[:, :count][:, ::-1]], axis=1)


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
