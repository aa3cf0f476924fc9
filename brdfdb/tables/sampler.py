"""Directions drawn from a table alone: cells of half vectors for some lights, mixed with the cosine."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.geometry import radians, unit_vector
from brdfdb.measurements.glints import Glints
from brdfdb.parameters import Array

# f_r [1/sr] for unit vectors of lights and viewers, in their broadcast shape
Evaluate = Callable[[Array, Array], Array]

# Share of directions that follow the cells. The cosine draws the others, which bounds weights by 5 pi f_r
LOBE_SHARE = 0.8
# Lights whose cells are stored. In between, those of the lights next to it are mixed
_LIGHTS_DEG = (0, 12, 24, 34, 43, 51, 58, 64, 69, 73, 77, 80, 83, 85.5, 87.5, 88.8, 89.5)
_TURNS = 16  # azimuths of lights of an anisotropic table
THETA_CELLS = 64
PHI_CELLS = 32
# Angles of half vectors from which the edges of cells are chosen: half of them by the reflected light
_FINE = 400  # number of these angles
_LEAST = 1e-5  # smallest [rad] above 0
_EVEN = 0.35  # share of the edges that are spread evenly
_FLAT = 1e-100  # z of a half vector up to which the density counts as 0
_GAUSS = (0.5 - 0.5 / np.sqrt(3.0), 0.5 + 0.5 / np.sqrt(3.0))  # places in a cell at which f_r is evaluated


class Cells(NamedTuple):
    """Probabilities of half vectors, constant in each cell."""

    theta_i: Array  #: polar angles of the lights, (K,) [rad]
    #: number of azimuths of the lights, evenly around the circle; 1 of an isotropic table, whose half vectors are
    #: turned with the light
    turns: int
    #: edges of cells in 1 - cos(theta_h), from 0 to 1. Edges in phi_h are even from 0 to 2 pi, (T + 1,) [1]
    edges: Array
    probability: Array  #: probability of each cell, lights with their azimuths one after another, (K * turns, T, P) [1]
    albedo: Array  #: share of the light that the cells reflect, (K * turns,) [1]

    @property
    def rings(self) -> Array:
        """Probabilities (lights, T) [1] of the rings of theta_h."""
        return np.asarray(self.probability.sum(axis=2))

    @property
    def along_phi(self) -> Array:
        """Probabilities (lights, T, P) [1] of the cells of a ring if the ring is drawn; even if it never is."""
        even = np.full_like(self.probability, 1.0 / self.probability.shape[2])
        total = self.rings[..., np.newaxis]
        return np.divide(self.probability, total, out=even, where=total > 0.0)

    @property
    def density(self) -> Array:
        """Density (lights, T, P) [1/sr] of half vectors in each cell."""
        area = np.diff(self.edges)[:, np.newaxis] * (2.0 * np.pi / self.probability.shape[2])
        return np.asarray(self.probability / area)


def cells_of(evaluate: Evaluate, *, anisotropic: bool) -> Cells:
    """Return the cells of a table: the reflected light over half vectors, for lights from the normal to the horizon.

    `evaluate` takes unit vectors of lights and viewers, shape (N, 3), and returns f_r [1/sr].
    """
    theta_i = radians(_LIGHTS_DEG)
    turns = _TURNS if anisotropic else 1
    phi_i = 2.0 * np.pi * np.arange(turns) / turns
    lights = unit_vector(theta_i[:, np.newaxis], phi_i).reshape(-1, 1, 1, 3)
    edges = _edges(evaluate, lights)
    places = edges[:-1, np.newaxis] + np.diff(edges)[:, np.newaxis] * np.array(_GAUSS)
    # The two halves of an isotropic lobe are mirror images
    columns = PHI_CELLS if anisotropic else PHI_CELLS // 2
    phi_h = (np.arange(columns)[:, np.newaxis] + np.array(_GAUSS)) * (2.0 * np.pi / PHI_CELLS)
    h = unit_vector(np.arccos(1.0 - places.reshape(-1, 1)), phi_h.reshape(1, -1))
    light = _light_by_half_vector(evaluate, lights, h)
    mean = light.reshape(len(lights), THETA_CELLS, 2, columns, 2).mean(axis=(2, 4))
    if not anisotropic:
        mean = np.concatenate([mean, mean[:, :, ::-1]], axis=2)
    probability = mean * np.diff(edges)[:, np.newaxis]
    total = probability.sum(axis=(1, 2), keepdims=True)
    even = np.broadcast_to(np.diff(edges)[:, np.newaxis] / PHI_CELLS, probability.shape).copy()
    shares = np.divide(probability, total, out=even, where=total > 0.0)
    return Cells(theta_i, turns, edges, shares, total[:, 0, 0] * (2.0 * np.pi / PHI_CELLS))


def _edges(evaluate: Evaluate, lights: Array) -> Array:
    """Return edges in 1 - cos(theta_h) between which about as much light is reflected, and none is very wide."""
    theta_h = np.concatenate([[0.0], np.geomspace(_LEAST, np.pi / 2, _FINE)])
    middle = 0.5 * (theta_h[:-1] + theta_h[1:])
    phi_h = (np.arange(12) + 0.5) * (np.pi / 6)
    rings = _light_by_half_vector(evaluate, lights, unit_vector(middle[:, np.newaxis], phi_h)).mean(axis=2)
    rings = rings * np.diff(-np.cos(theta_h))
    total = rings.sum(axis=1, keepdims=True)
    share = np.divide(rings, total, out=np.zeros_like(rings), where=total > 0.0).mean(axis=0)
    summed = (1.0 - _EVEN) * np.cumsum(share) / max(share.sum(), 1e-300) + _EVEN * theta_h[1:] / theta_h[-1]
    chosen = np.interp(np.linspace(0.0, 1.0, THETA_CELLS + 1), np.append(0.0, summed / summed[-1]), theta_h)
    edges = 2.0 * np.sin(0.5 * chosen) ** 2
    edges[0] = 0.0
    edges[-1] = 1.0
    return np.asarray(edges)


def _light_by_half_vector(evaluate: Evaluate, lights: Array, h: Array) -> Array:
    """Return the density [1/sr] of reflected light over half vectors, f_r cos theta_r 4 (h.i)."""
    along = np.sum(lights * h, axis=-1)
    viewers = 2.0 * along[..., np.newaxis] * h - lights
    seen = (viewers[..., 2] > 0.0) & (along > 0.0)
    values = np.zeros(seen.shape)
    i = np.broadcast_to(lights, viewers.shape)[seen]
    values[seen] = np.maximum(evaluate(i, viewers[seen]), 0.0) * viewers[seen][:, 2] * 4.0 * along[seen]
    return values


class _WeightedRow(NamedTuple):
    """Weights of rows of cells, and their numbers."""

    weight: Array
    row: NDArray[np.int64]


class _CellPlace(NamedTuple):
    """The share in [0, 1] of a cell that lies before a place, and the number of the cell."""

    share: Array
    cell: NDArray[np.int64]


class Sampler:
    """Directions of viewers drawn from cells, from the cosine and from glints, with their density.

    The share of the glints of a light is that of their power in all reflected light.
    """

    def __init__(self, cells: Cells, glints: Glints | None = None) -> None:
        self.cells = cells
        self.glints = glints
        self._theta = _summed(cells.rings)
        self._phi = _summed(cells.probability)
        self._density = cells.density

    def draw(self, u1: Array, u2: Array, wi: Array) -> Array:
        """Return directions (..., 3) for random numbers and unit vectors (..., 3). Some are below the horizon."""
        if self.glints is None:
            return self._smooth(u1, u2, wi)
        share = self._glint_share(wi)
        shape = np.broadcast_shapes(np.shape(u1), np.shape(u2), share.shape)
        u1, u2, share = (np.broadcast_to(values, shape) for values in (u1, u2, share))
        wi = np.broadcast_to(wi, (*shape, 3))
        first = np.clip(np.divide(u1, share, out=np.zeros(shape), where=share > 0.0), 0.0, 1.0)
        of_glints = self.glints.draw(first.ravel(), u2.ravel(), wi.reshape(-1, 3)).reshape(*shape, 3)
        rest = np.clip(np.divide(u1 - share, 1.0 - share, out=np.zeros(shape), where=share < 1.0), 0.0, 1.0)
        return np.where((u1 < share)[..., np.newaxis], of_glints, self._smooth(rest, u2, wi))

    def density(self, wi: Array, wr: Array) -> Array:
        """Return the density [1/sr] of `draw` over the sphere, for unit vectors (..., 3)."""
        smooth = self._smooth_density(wi, wr)
        if self.glints is None:
            return smooth
        share = self._glint_share(wi)
        pairs = [np.broadcast_to(w, (*smooth.shape, 3)).reshape(-1, 3) for w in (wi, wr)]
        return np.asarray(share * self.glints.density(*pairs).reshape(smooth.shape) + (1.0 - share) * smooth)

    def _glint_share(self, wi: Array) -> Array:
        """Return the share of directions (...,) that glints draw."""
        assert self.glints is not None
        power = self.glints.power(wi.reshape(-1, 3)).mean(axis=1).reshape(wi.shape[:-1])
        smooth = sum(weight * self.cells.albedo[row] for weight, row in self._lights(wi))
        return np.asarray(np.divide(power, power + smooth, out=np.zeros(power.shape), where=power > 0.0))

    def _smooth(self, u1: Array, u2: Array, wi: Array) -> Array:
        """Return directions as of `draw`, without glints."""
        in_lobe = u1 < LOBE_SHARE
        # The first number is used again, in the component and in the cell that it has chosen
        first = np.clip(np.where(in_lobe, u1 / LOBE_SHARE, (u1 - LOBE_SHARE) / (1.0 - LOBE_SHARE)), 0.0, 1.0)
        sin = np.sqrt(first)
        angle = 2.0 * np.pi * u2
        cosine = np.stack(np.broadcast_arrays(sin * np.cos(angle), sin * np.sin(angle), np.sqrt(1.0 - first)), axis=-1)
        # Cumulative numbers are mixed, not lights drawn: numbers that are even stay even over half vectors
        _, rings, columns = self.cells.probability.shape
        lights = self._lights(wi)
        place, ring = _place(self._theta, lights, first)
        versine = self.cells.edges[ring] + np.diff(self.cells.edges)[ring] * place
        place, column = _place(self._phi, [_WeightedRow(weight, row * rings + ring) for weight, row in lights], u2)
        phi = (column + place) * (2.0 * np.pi / columns)
        sin = np.sqrt(versine * (2.0 - versine))
        h = self._turned(np.stack([sin * np.cos(phi), sin * np.sin(phi), 1.0 - versine], axis=-1), wi, 1.0)
        mirrored = 2.0 * np.sum(h * wi, axis=-1, keepdims=True) * h - wi
        return np.asarray(np.where(in_lobe[..., np.newaxis], mirrored, cosine + 0.0 * mirrored))

    def _smooth_density(self, wi: Array, wr: Array) -> Array:
        """Return the density [1/sr] of `_smooth`."""
        cells = self.cells
        h = wi + wr
        length = np.sqrt(np.sum(h * h, axis=-1))
        inclined = np.abs(h[..., 2]) > _FLAT  # no half vector is drawn at the horizon
        # A half vector whose back the light sees is that of directions below the horizon
        h = h / np.copysign(np.where(inclined, length, 1.0), h[..., 2])[..., np.newaxis]
        local = self._turned(h, np.broadcast_to(wi, h.shape), -1.0)
        # 1 - cos(theta_h), without a difference of numbers near 1
        versine = (local[..., 0] ** 2 + local[..., 1] ** 2) / (1.0 + np.maximum(local[..., 2], 0.0))
        _, rings, columns = cells.probability.shape
        ring = np.clip(np.searchsorted(cells.edges, versine, side="right") - 1, 0, rings - 1)
        phi = np.arctan2(local[..., 1], local[..., 0]) % (2.0 * np.pi)
        column = np.clip(np.nan_to_num(phi * (columns / (2.0 * np.pi))), 0, columns - 1).astype(np.int64)
        of_h = sum(weight * self._density[row, ring, column] for weight, row in self._lights(wi))
        mirrored = np.divide(of_h, 2.0 * length, out=np.zeros(of_h.shape), where=inclined)  # h.i = length / 2
        cosine = np.maximum(wr[..., 2], 0.0) / np.pi + 0.0 * length  # nan is passed on
        return np.asarray(LOBE_SHARE * mirrored + (1.0 - LOBE_SHARE) * cosine)

    def _lights(self, wi: Array) -> list[_WeightedRow]:
        """Return the weights and the rows of the lights around `wi`: two, or four of an anisotropic table."""
        theta_i = self.cells.theta_i
        turns = self.cells.turns
        theta = np.arctan2(np.hypot(wi[..., 0], wi[..., 1]), wi[..., 2])
        number = np.clip(np.searchsorted(theta_i, theta, side="right") - 1, 0, theta_i.size - 2)
        weight = np.clip((theta - theta_i[number]) / np.diff(theta_i)[number], 0.0, 1.0)
        along = [_WeightedRow(1.0 - weight, number * turns), _WeightedRow(weight, (number + 1) * turns)]
        if turns == 1:
            return along
        turn = np.arctan2(wi[..., 1], wi[..., 0]) % (2.0 * np.pi) * (turns / (2.0 * np.pi))
        whole = np.clip(np.nan_to_num(np.floor(turn)), 0.0, turns - 1.0).astype(np.int64)
        weight = np.clip(turn - whole, 0.0, 1.0)
        around = [(1.0 - weight, whole), (weight, (whole + 1) % turns)]
        return [_WeightedRow(share * weight, row + turned) for share, row in along for weight, turned in around]

    def _turned(self, h: Array, wi: Array, sign: float) -> Array:
        """Return half vectors of an isotropic table turned by the azimuth of the light; others stay."""
        if self.cells.turns > 1:
            return h
        sin = np.hypot(wi[..., 0], wi[..., 1])
        upright = sin == 0.0
        cos_phi = np.where(upright, 1.0, wi[..., 0] / np.where(upright, 1.0, sin))
        sin_phi = sign * np.where(upright, 0.0, wi[..., 1] / np.where(upright, 1.0, sin))
        x = h[..., 0]
        y = h[..., 1]
        return np.stack([x * cos_phi - y * sin_phi, x * sin_phi + y * cos_phi, h[..., 2]], axis=-1)


def _summed(probability: Array) -> Array:
    """Return sums of the probabilities (..., K) up to each cell, (rows, K + 1)."""
    rows = probability.reshape(-1, probability.shape[-1])
    return np.concatenate([np.zeros((len(rows), 1)), np.cumsum(rows, axis=1)], axis=1)


def _place(sums: Array, lights: list[_WeightedRow], u: Array) -> _CellPlace:
    """Return the place in a cell and its number, for a random number in the mixture of rows of sums over 2^m cells."""
    flat = sums.ravel()
    count = sums.shape[1] - 1
    starts = [(weight, row * (count + 1)) for weight, row in lights]

    def up_to(cell: NDArray[np.int64] | int) -> Array:
        return np.asarray(sum(weight * flat[start + cell] for weight, start in starts))

    wanted = u * up_to(count)
    cell = np.zeros(wanted.shape, np.int64)
    step = count // 2
    while step:
        cell = cell + step * (up_to(cell + step) <= wanted)
        step //= 2
    low = up_to(cell)
    high = up_to(cell + 1)
    width = high - low
    place = np.divide(wanted - low, width, out=np.full(width.shape, 0.5), where=width > 0.0)
    return _CellPlace(np.clip(place, 0.0, 1.0), cell)
