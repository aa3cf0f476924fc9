"""Samples from the cells of a table in Dr.Jit: `brdfdb.tables.sampler`, with alias tables in place of searches."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from brdfdb.mitsuba._buffers import Buffer, whole
from brdfdb.mitsuba._grid_axis import GridAxis
from brdfdb.tables._interpolation import prepared
from brdfdb.tables.sampler import LOBE_SHARE, Cells

Array = NDArray[np.float64]

_FLAT = 1e-30  # z of a half vector up to which the density counts as 0
_LEAST = 1e-20


class _Alias:
    """Rows of probabilities, from which one number draws a cell and the place in it (Walker 1977)."""

    def __init__(self, probability: Array) -> None:
        """Take probabilities (rows, cells) whose sums are 1."""
        rows, self._count = probability.shape
        left = probability * self._count
        begin, alias = np.ones_like(left), np.zeros_like(left)
        settled = np.zeros(left.shape, bool)
        every = np.arange(rows)
        for _ in range(self._count):
            # What a cell lacks to 1 comes from the fullest one
            poor = np.argmin(np.where(settled, np.inf, left), axis=1)
            rich = np.argmax(np.where(settled, -np.inf, left), axis=1)
            begin[every, poor], alias[every, poor] = np.clip(left[every, poor], 0.0, 1.0), rich
            left[every, rich] -= 1.0 - begin[every, poor]
            settled[every, poor] = True
        self._rows = Buffer(np.stack([begin, alias], axis=-1))

    def draw(self, row: Any, u: Any) -> tuple[Any, Any]:
        """Return the cell of a row that a random number chooses, and the place in it in [0, 1]."""
        scaled = u * self._count
        own = whole(scaled, self._count)
        rest = scaled - own
        begin, alias = self._rows.row(row * self._count + own, 2)
        kept = rest < begin
        place = dr.select(kept, rest, rest - begin) / dr.maximum(dr.select(kept, begin, 1.0 - begin), _LEAST)
        return dr.select(kept, own, mi.UInt32(alias)), dr.clip(place, 0.0, 1.0)


class CellsLobe:
    """The cells of half vectors of a table as the lobe of a sampler."""

    share = alone = LOBE_SHARE

    def __init__(self, cells: Cells) -> None:
        lights, self._rings, self._columns = cells.probability.shape
        self._turns = cells.turns
        self._theta_i = _axis(cells.theta_i)
        # Rings are found by the logarithm: those of a narrow lobe differ in size by orders of magnitude
        self._log_edges = _axis(np.log(np.append(0.5 * cells.edges[1], cells.edges[1:])))
        self._edges = Buffer(np.stack([cells.edges[:-1], np.diff(cells.edges)], axis=1))
        self._along_theta = _Alias(cells.rings)
        self._along_phi = _Alias(cells.along_phi.reshape(-1, self._columns))
        # The cells of two lights beside one another
        density = cells.density.reshape(lights // self._turns, self._turns, self._rings, self._columns)
        self._density = Buffer(np.stack([density[:-1], density[1:]], axis=-1))

    def draw(self, wi: Any, choice: Any, sample: Any) -> Any:
        """Return the direction `wi` mirrored in a half vector of the cells."""
        light, weight = self._light(wi)
        second, choice = _chosen(choice, weight)
        row = (light + dr.select(second, mi.UInt32(1), mi.UInt32(0))) * self._turns
        if self._turns > 1:
            turn, following, weight = self._turn(wi)
            second, _ = _chosen(choice, weight)
            row = row + dr.select(second, following, turn)
        ring, u = self._along_theta.draw(row, sample.x)
        low, width = self._edges.row(ring, 2)
        versine = low + width * u
        column, v = self._along_phi.draw(row * self._rings + ring, sample.y)
        sin_phi, cos_phi = dr.sincos((mi.Float(column) + v) * (dr.two_pi / self._columns))
        sin = dr.sqrt(dr.maximum(versine * (2.0 - versine), 0.0))
        h = self._turned(mi.Vector3f(sin * cos_phi, sin * sin_phi, 1.0 - versine), wi, 1.0)
        return mi.reflect(wi, h)

    def density(self, wi: Any, wo: Any) -> Any:
        """Return the density [1/sr] of the directions that `draw` gives, for directions above the horizon."""
        h = wi + wo
        inverse = dr.rsqrt(dr.maximum(dr.squared_norm(h), _LEAST))
        local = self._turned(h * inverse, wi, -1.0)
        versine = (dr.square(local.x) + dr.square(local.y)) / (1.0 + local.z)
        ring, _ = self._log_edges.place(dr.log(dr.maximum(versine, _LEAST)))
        column = whole(_turns(local, self._columns), self._columns)
        light, weight = self._light(wi)
        rows: list[tuple[Any, Any]] = [(1.0, mi.UInt32(0))]
        if self._turns > 1:
            turn, following, share = self._turn(wi)
            rows = [(1.0 - share, turn), (share, following)]
        total: Any = 0.0
        for share, row in rows:
            place = ((light * self._turns + row) * self._rings + ring) * self._columns + column
            begin, end = self._density.row(place, 2)
            total = total + share * (begin + weight * (end - begin))
        return dr.select(h.z > _FLAT, 0.5 * total * inverse, 0.0)

    def _light(self, wi: Any) -> tuple[Any, Any]:
        """Return the number of the light before `wi` in theta, and the weight of the one behind."""
        return self._theta_i.place(dr.atan2(dr.sqrt(dr.square(wi.x) + dr.square(wi.y)), wi.z))

    def _turn(self, wi: Any) -> tuple[Any, Any, Any]:
        """Return the numbers of the azimuths of lights before and behind `wi`, and the weight of the second."""
        turn = _turns(wi, self._turns)
        before = whole(turn, self._turns)
        following = dr.select(before >= self._turns - 1, mi.UInt32(0), before + 1)
        return before, following, dr.clip(turn - before, 0.0, 1.0)

    def _turned(self, h: Any, wi: Any, sign: float) -> Any:
        """Return half vectors of an isotropic table turned by the azimuth of the light; others stay."""
        if self._turns > 1:
            return h
        sin2 = dr.square(wi.x) + dr.square(wi.y)
        upright = sin2 < _LEAST
        inverse = dr.rsqrt(dr.select(upright, 1.0, sin2))
        cos_phi, sin_phi = dr.select(upright, 1.0, wi.x * inverse), dr.select(upright, 0.0, sign * wi.y * inverse)
        return mi.Vector3f(h.x * cos_phi - h.y * sin_phi, h.x * sin_phi + h.y * cos_phi, h.z)


def _axis(nodes: Array) -> GridAxis:
    return GridAxis(prepared([nodes], [("open", "open")], cubic=False), 0)


def _turns(w: Any, count: int) -> Any:
    """Return the azimuth in parts of the turn, from 0 to their number."""
    phi = dr.atan2(w.y, w.x)
    return dr.select(phi < 0.0, phi + dr.two_pi, phi) * (count / dr.two_pi)


def _chosen(choice: Any, weight: Any) -> tuple[Any, Any]:
    """Return whether a random number chooses the second of two with its weight, and the number to choose again."""
    second = choice < weight
    low, width = dr.select(second, 0.0, weight), dr.select(second, weight, 1.0 - weight)
    return second, (choice - low) / dr.maximum(width, _LEAST)
