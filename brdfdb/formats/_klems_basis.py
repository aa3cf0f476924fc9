"""The bases of Klems: patches of the hemisphere, and averages of f_r over pairs of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from brdfdb.integrals.quadrature import gauss_rule
from brdfdb.parameters import Floats

Index = NDArray[np.int64]
Evaluate = Callable[[Floats, Floats], Floats]  # f_r (..., C) at unit vectors (..., 3) of light and viewer

_NODE = 0.5 / np.sqrt(3.0)  # distance of the two Gauss-Legendre nodes of an axis from the middle of a cell of length 1
_AT_ONCE = 1 << 13  # cells that are evaluated at a time
_LIGHTS = {145: 4, 77: 5, 41: 6}  # nodes of the light along each axis of a patch, by the number of patches
_DEEPEST = 6  # halvings of a patch of the viewer
_AROUND = 2  # halvings of the patch that is a whole ring
_AT_LEAST = 4  # halvings at the mirror direction
_NEXT = 1.3  # radii of a cell from its middle to the mirror direction, at which its nodes may miss the lobe
# A cell is divided if its nodes differ by more than a share of their average, and by more than a share of the albedo
_STEEP, _NEGLIGIBLE = 0.15, 3e-4


@dataclass(frozen=True)
class Basis:
    """A basis: rings of patches, each of which lies at 0 degrees of azimuth with its middle.

    Attributes
    ----------
    name : str
        Name in files.
    bounds_deg : tuple of float (rings + 1,) [degree]
        Polar angles between the rings.
    counts : tuple of int (rings,)
        Patches of each ring.
    """

    name: str
    bounds_deg: tuple[float, ...]
    counts: tuple[int, ...]

    def __len__(self) -> int:
        return sum(self.counts)

    @property
    def rings(self) -> Index:
        """The ring of each patch."""
        return np.repeat(np.arange(len(self.counts)), self.counts)

    @property
    def solid_angles(self) -> Floats:
        """Projected solid angles [sr] of the patches."""
        cosine2 = np.cos(np.radians(self.bounds_deg)) ** 2
        return np.asarray((np.pi * (cosine2[:-1] - cosine2[1:]) / np.array(self.counts))[self.rings])

    @property
    def middles(self) -> Floats:
        """Unit vectors (patches, 3) at the middles of the patches; of a patch that is a whole ring, at its axis."""
        bounds = np.radians(self.bounds_deg)
        theta = np.where(np.array(self.counts) == 1, bounds[:-1], 0.5 * (bounds[:-1] + bounds[1:]))[self.rings]
        counts = np.array(self.counts)
        number = np.arange(len(self)) - np.repeat(np.cumsum(counts) - counts, counts)
        phi = 2.0 * np.pi * number / counts[self.rings]
        return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)

    def vectors(self, patch: Index, place: Floats) -> Floats:
        """Return unit vectors (..., 3) at places (..., 2) in [0, 1]^2 of patches (...), which have equal measure."""
        counts = np.array(self.counts)
        first = np.cumsum(counts) - counts
        ring = self.rings[patch]
        sine2 = np.sin(np.radians(self.bounds_deg)) ** 2
        radius2 = sine2[ring] + place[..., 0] * (sine2[ring + 1] - sine2[ring])
        phi = 2.0 * np.pi * (patch - first[ring] + place[..., 1] - 0.5) / counts[ring]
        radius = np.sqrt(radius2)
        return np.stack([radius * np.cos(phi), radius * np.sin(phi), np.sqrt(1.0 - radius2)], axis=-1)

    def patches(self, vectors: Floats) -> Index:
        """Return the patches of unit vectors (N, 3) above the horizon."""
        counts = np.array(self.counts)
        theta = np.degrees(np.arccos(np.clip(vectors[:, 2], -1.0, 1.0)))
        ring = np.minimum(np.searchsorted(self.bounds_deg, theta, side="right") - 1, len(counts) - 1)
        turns = np.arctan2(vectors[:, 1], vectors[:, 0]) / (2.0 * np.pi)
        step = np.floor(turns * counts[ring] + 0.5).astype(np.int64) % counts[ring]
        return np.asarray((np.cumsum(counts) - counts)[ring] + step)


BASES = {
    "full": Basis("LBNL/Klems Full", (0, 5, 15, 25, 35, 45, 55, 65, 75, 90), (1, 8, 16, 20, 24, 24, 24, 16, 12)),
    "half": Basis("LBNL/Klems Half", (0, 6.5, 19.5, 32.5, 45.5, 58.5, 71.5, 90), (1, 8, 12, 16, 20, 12, 8)),
    "quarter": Basis("LBNL/Klems Quarter", (0, 9, 27, 45, 63, 90), (1, 8, 12, 12, 8)),
}
FLIPPED = np.array([-1.0, -1.0, 1.0])


def light(basis: Basis, patch: Index, place: Floats) -> Floats:
    """Return unit vectors towards the light: its patches are those that it would mirror to."""
    return np.asarray(basis.vectors(patch, place) * FLIPPED)


def averages(evaluate: Evaluate, basis: Basis, channels: int, *, isotropic: bool) -> Floats:
    """Return averages [1/sr] of f_r over pairs of patches, weighted with projected solid angles.

    Parameters
    ----------
    evaluate : callable
        f_r [1/sr], shape (..., C), at unit vectors (..., 3) of light and viewer, which broadcast.
    basis : Basis
        The patches of light and viewer.
    channels : int
        C.
    isotropic : bool
        True if f_r depends on the difference of the azimuths alone, whatever its sign.

    Returns
    -------
    array (viewers, lights, C)
        In the order of files.

    Notes
    -----
    Two Gauss-Legendre nodes along each of the four axes of a pair. Where they differ, and where the patch of the viewer
    is that of the mirror direction or touches it, there are more nodes of the light, and for each of them cells of the
    viewer divide until their nodes are alike: column sums, which are albedos, are right then.
    """
    size = len(basis)
    viewer, incident = np.divmod(np.arange(size * size), size)
    alike, whose = _alike(basis, viewer, incident) if isotropic else (np.arange(size * size), np.arange(size * size))
    viewer, incident = viewer[alike], incident[alike]
    nodes, _ = _rule(2)
    pair = np.arange(len(viewer))
    mean, spread = np.zeros((2, len(viewer), channels))
    for start in range(0, len(viewer), _AT_ONCE):
        some = pair[start : start + _AT_ONCE, np.newaxis]
        wi, wr = light(basis, incident[some], nodes), basis.vectors(viewer[some], nodes)
        values = evaluate(wi[:, np.newaxis], wr[:, :, np.newaxis]).reshape(len(some), -1, channels)
        mean[some[:, 0]], spread[some[:, 0]] = values.mean(axis=1), np.ptp(values, axis=1)
    weight = basis.solid_angles[viewer][:, np.newaxis]
    columns = basis.solid_angles @ mean[whose].reshape(size, -1)
    negligible = _NEGLIGIBLE * float(columns.max())
    steep = np.any((spread > _STEEP * mean) & (spread * weight > negligible), axis=-1)
    # Two nodes around a whole ring are none
    steep |= _next_to_mirror(basis)[viewer, incident] | (viewer == 0) | (incident == 0)
    for ring in (True, False):  # the first patch is a whole ring
        some = np.flatnonzero(steep & ((incident == 0) == ring))
        nodes, weights = _rule(_LIGHTS[size], periodic=ring)
        refined = _refined(evaluate, basis, viewer[some], incident[some], nodes, channels, negligible)
        mean[some] = np.einsum("pnc,n->pc", refined, weights)
    return mean[whose].reshape(size, size, channels)


def _refined(
    evaluate: Evaluate, basis: Basis, viewer: Index, incident: Index, nodes: Floats, channels: int, negligible: float
) -> Floats:
    """Return averages over the patches of the viewer, shape (pairs, nodes, C), for lights at nodes of their patches."""
    count = len(nodes)
    result = np.zeros((len(viewer) * count, channels))
    item = np.arange(len(result))
    corner = np.zeros((len(item), 2))
    halves = (np.arange(4)[:, np.newaxis] >> np.arange(2)) & 1
    for depth in range(_DEEPEST + 1):
        length = 0.5**depth
        mean, spread = np.zeros((2, len(item), channels))
        lit = np.zeros(len(item), dtype=bool)
        for start in range(0, len(item), _AT_ONCE):
            some = slice(start, start + _AT_ONCE)
            pair, node = np.divmod(item[some], count)
            wi = light(basis, incident[pair], nodes[node])
            place = corner[some, np.newaxis] + length * (0.5 + _NODE * (2.0 * halves - 1.0))
            wr = basis.vectors(viewer[pair, np.newaxis], place)
            values = np.ascontiguousarray(np.moveaxis(evaluate(wi[:, np.newaxis], wr), 1, 0))  # reduced faster
            mean[some], spread[some] = values.mean(axis=0), np.ptp(values, axis=0)
            if depth < _AT_LEAST:
                lit[some] = _at_mirror(wi, wr)
        pair = item // count
        weight = length**2 * basis.solid_angles[viewer[pair]][:, np.newaxis]
        divided = np.any((spread > _STEEP * mean) & (spread * weight > negligible), axis=-1)
        divided |= lit
        divided |= (viewer[pair] == 0) & (depth < _AROUND)
        divided &= depth < _DEEPEST
        np.add.at(result, item[~divided], length**2 * mean[~divided])
        corner = (corner[divided][:, np.newaxis] + 0.5 * length * halves).reshape(-1, 2)
        item = np.repeat(item[divided], 4)
        if not item.size:
            break
    return result.reshape(-1, count, channels)


def _at_mirror(wi: Floats, wr: Floats) -> NDArray[np.bool_]:
    """Return whether the mirror directions of lights (N, 3) are in cells with nodes (N, 4, 3), or next to them."""
    middle = wr.mean(axis=1)
    radius = np.sqrt(3.0) * np.linalg.norm(wr - middle[:, np.newaxis], axis=-1).max(axis=-1)
    return np.asarray(np.linalg.norm(wi * FLIPPED - middle, axis=-1) < _NEXT * radius)


def _rule(count: int, *, periodic: bool = False) -> tuple[Floats, Floats]:
    """Return nodes (N, 2) in the unit square and their weights, of a Gauss-Legendre rule of `count` nodes an axis.

    Along the second axis of a patch that is a whole ring, `periodic`, they have equal distances.
    """
    x, w = gauss_rule(count)
    x, w = 0.5 + 0.5 * x, 0.5 * w
    around, share = ((np.arange(count) + 0.5) / count, np.full(count, 1.0 / count)) if periodic else (x, w)
    return np.stack(np.meshgrid(x, around, indexing="ij"), axis=-1).reshape(-1, 2), np.outer(w, share).reshape(-1)


def _alike(basis: Basis, viewer: Index, incident: Index) -> tuple[Index, Index]:
    """Return pairs of which no two are turned or mirrored into each other, and the number among them of each pair."""
    rings, counts = basis.rings, np.array(basis.counts)
    whole = int(np.lcm.reduce(counts))
    azimuth = np.concatenate([np.arange(count) * (whole // count) for count in counts])
    apart = (azimuth[viewer] - azimuth[incident]) % whole
    key = (rings[viewer] * len(counts) + rings[incident]) * whole + np.minimum(apart, whole - apart)
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    return first, inverse


def _next_to_mirror(basis: Basis) -> NDArray[np.bool_]:
    """Return, by viewer and light, whether the patches are the same one or touch."""
    rings, counts = basis.rings, np.array(basis.counts)
    middle = np.concatenate([np.arange(count) / count for count in counts])
    half = 0.5 / counts[rings]
    apart = np.abs((middle[:, np.newaxis] - middle + 0.5) % 1.0 - 0.5)
    touching = apart <= half[:, np.newaxis] + half + 1e-9
    return np.asarray((np.abs(rings[:, np.newaxis] - rings) <= 1) & touching)
