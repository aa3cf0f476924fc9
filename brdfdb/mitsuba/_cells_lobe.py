"""Samples from the cells of a table in Dr.Jit: `brdfdb.tables.sampler`."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi

from brdfdb.mitsuba._buffers import Buffer
from brdfdb.tables.sampler import LOBE_SHARE, Cells

_FLAT = 1e-10  # z of a half vector up to which the density counts as 0
_LEAST = 1e-20


class CellsLobe:
    """The cells of half vectors of a table as the lobe of a sampler."""

    share = alone = LOBE_SHARE

    def __init__(self, cells: Cells) -> None:
        self._lights, self._rings, self._columns = cells.probability.shape
        self._turns = cells.turns
        self._theta_i = Buffer(cells.theta_i)
        self._edges = Buffer(cells.edges)
        self._along_theta, self._along_phi = Buffer(cells.along_theta), Buffer(cells.along_phi)
        self._density = Buffer(cells.density)
        self._thetas = cells.theta_i.size

    def draw(self, wi: Any, choice: Any, sample: Any) -> Any:
        """Return the direction `wi` mirrored in a half vector of the cells."""
        row: Any = mi.UInt32(0)
        for weight, low, high in self._near(wi):
            second = choice < weight
            width = dr.maximum(dr.select(second, weight, 1.0 - weight), _LEAST)
            choice = (choice - dr.select(second, 0.0, weight)) / width
            row = row + dr.select(second, high, low)
        ring, u = self._drawn(self._along_theta, row, sample.x, self._rings)
        low_edge = self._edges.at(ring)
        versine = low_edge + (self._edges.at(ring + 1) - low_edge) * u
        column, v = self._drawn(self._along_phi, row * self._rings + ring, sample.y, self._columns)
        sin_phi, cos_phi = dr.sincos((mi.Float(column) + v) * (dr.two_pi / self._columns))
        sin = dr.sqrt(dr.maximum(versine * (2.0 - versine), 0.0))
        h = self._turned(mi.Vector3f(sin * cos_phi, sin * sin_phi, 1.0 - versine), wi, 1.0)
        return mi.reflect(wi, h)

    def density(self, wi: Any, wo: Any) -> Any:
        """Return the density [1/sr] of the directions that `draw` gives, for directions above the horizon."""
        h = wi + wo
        length = dr.norm(h)
        local = self._turned(h / length, wi, -1.0)
        versine = (dr.square(local.x) + dr.square(local.y)) / (1.0 + local.z)
        ring = self._edges.cell(versine, self._rings)
        phi = dr.atan2(local.y, local.x)
        turn = dr.select(phi < 0.0, phi + dr.two_pi, phi) * (self._columns / dr.two_pi)
        column = mi.UInt32(dr.clip(dr.floor(turn), 0.0, self._columns - 1.0))
        total: Any = 0.0
        rows: list[tuple[Any, Any]] = [(1.0, mi.UInt32(0))]
        for weight, low, high in self._near(wi):
            pairs = ((1.0 - weight, low), (weight, high))
            rows = [(share * part, row + number) for share, row in rows for part, number in pairs]
        for share, row in rows:
            total = total + share * self._density.at((row * self._rings + ring) * self._columns + column)
        return dr.select(h.z > _FLAT, total / (2.0 * length), 0.0)

    def _near(self, wi: Any) -> list[tuple[Any, Any, Any]]:
        """Return for each axis of lights the weight of the second of two neighbours, and the rows of both."""
        theta = dr.atan2(dr.sqrt(dr.square(wi.x) + dr.square(wi.y)), wi.z)
        number = self._theta_i.cell(theta, self._thetas - 1)
        begin, end = self._theta_i.at(number), self._theta_i.at(number + 1)
        row = number * self._turns
        axes = [(dr.clip((theta - begin) / (end - begin), 0.0, 1.0), row, row + self._turns)]
        if self._turns > 1:
            phi = dr.atan2(wi.y, wi.x)
            turn = dr.select(phi < 0.0, phi + dr.two_pi, phi) * (self._turns / dr.two_pi)
            whole = dr.clip(dr.floor(turn), 0.0, self._turns - 1.0)
            last = whole >= self._turns - 1.0
            following = mi.UInt32(dr.select(last, 0.0, whole + 1.0))
            axes.append((dr.clip(turn - whole, 0.0, 1.0), mi.UInt32(whole), following))
        return axes

    def _drawn(self, sums: Buffer, row: Any, u: Any, count: int) -> tuple[Any, Any]:
        """Return the cell that a random number chooses in a cumulative row, and the place in it."""
        first = row * (count + 1)
        cell = sums.cell(u, count, first)
        low, high = sums.at(first + cell), sums.at(first + cell + 1)
        return cell, dr.clip((u - low) / dr.maximum(high - low, _LEAST), 0.0, 1.0)

    def _turned(self, h: Any, wi: Any, sign: float) -> Any:
        """Return half vectors of an isotropic table turned by the azimuth of the light; others stay."""
        if self._turns > 1:
            return h
        sin2 = dr.square(wi.x) + dr.square(wi.y)
        upright = sin2 < _LEAST
        inverse = dr.rsqrt(dr.select(upright, 1.0, sin2))
        cos_phi, sin_phi = dr.select(upright, 1.0, wi.x * inverse), dr.select(upright, 0.0, sign * wi.y * inverse)
        return mi.Vector3f(h.x * cos_phi - h.y * sin_phi, h.x * sin_phi + h.y * cos_phi, h.z)
