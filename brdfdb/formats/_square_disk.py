"""Directions in Radiance's tensor trees: the square and the disk of Shirley and Chiu, and positions of pairs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brdfdb.parameters import Floats

ISOTROPIC, ANISOTROPIC = 3, 4  # ranks of a tree
_INSIDE = 1.0 - 1e-12  # largest coordinate of a position, so that it lies in a cell


def disk(square: Floats) -> Floats:
    """Return points (..., 2) of the unit disk for points (..., 2) of the unit square; areas keep their ratio.

    Shirley and Chiu 1997: concentric squares become concentric circles.
    """
    a, b = 2.0 * square[..., 0] - 1.0, 2.0 * square[..., 1] - 1.0
    wide = np.abs(a) > np.abs(b)
    radius = np.where(wide, a, b)
    ratio = np.divide(np.where(wide, b, a), radius, out=np.zeros_like(radius), where=radius != 0.0)
    angle = np.where(wide, 0.25 * np.pi * ratio, 0.5 * np.pi - 0.25 * np.pi * ratio)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def square(disk: Floats) -> Floats:
    """Return points (..., 2) of the unit square for points (..., 2) of the unit disk: the inverse of `disk`."""
    x, y = disk[..., 0], disk[..., 1]
    radius = np.hypot(x, y)
    wide = np.abs(x) > np.abs(y)
    far, near = np.where(wide, x, y), np.where(wide, y, x)
    large, small = np.copysign(radius, far), radius * np.arctan2(near, np.abs(far)) * (4.0 / np.pi)
    return np.stack([np.where(wide, large, small), np.where(wide, small, large)], axis=-1) * 0.5 + 0.5


def _risen(xy: Floats) -> NDArray[np.float64]:
    """Return the unit vectors (..., 3) above the points (..., 2) of the unit disk."""
    z = np.sqrt(np.maximum(0.0, 1.0 - np.sum(xy * xy, axis=-1, keepdims=True)))
    return np.concatenate([xy, z], axis=-1)


def lights(place: Floats) -> Floats:
    """Return unit vectors (..., 3) of the light at the first one (rank 3) or two (rank 4) coordinates of positions.

    Rank 4: the square of the mirrored light. Rank 3: (1 - sin theta) / 2, with an azimuth of pi.
    """
    if place.shape[-1] == 2:
        return _risen(-disk(place))
    along = 2.0 * place - 1.0
    return _risen(np.concatenate([along, np.zeros_like(along)], axis=-1))


def viewers(place: Floats) -> Floats:
    """Return unit vectors (..., 3) of the viewer at the last two coordinates of positions."""
    return _risen(disk(place))


def positions(wi: Floats, wr: Floats, rank: int) -> Floats:
    """Return positions (N, rank) in the unit cube of a tree for unit vectors (N, 3) of light and viewer."""
    if rank == ANISOTROPIC:
        place = np.concatenate([square(-wi[:, :2]), square(wr[:, :2])], axis=-1)
    else:
        sine = np.hypot(wi[:, 0], wi[:, 1])
        safe = np.where(sine > 0.0, sine, 1.0)
        # Cosine and sine of the azimuth of the mirrored light, towards which the frame of the viewer is turned
        c, s = np.where(sine > 0.0, -wi[:, 0] / safe, 1.0), np.where(sine > 0.0, -wi[:, 1] / safe, 0.0)
        turned = np.stack([c * wr[:, 0] + s * wr[:, 1], c * wr[:, 1] - s * wr[:, 0]], axis=-1)
        place = np.concatenate([(0.5 - 0.5 * sine)[:, np.newaxis], square(turned)], axis=-1)
        place[:, 0] = np.minimum(place[:, 0], 0.5 * _INSIDE)
    return np.asarray(np.clip(place, 0.0, _INSIDE))
