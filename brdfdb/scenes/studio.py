"""The light of material pictures: a soft sky over a dark floor, with two area lights."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class _Softbox(NamedTuple):
    """A rectangle of light far away.

    `centre` is the direction of its middle, `width` and `height` are the tangents of half of its angles, `edge` is the
    part of these over which its radiance falls to 0, and `radiance` is that of its middle.
    """

    centre: tuple[float, float, float]
    width: float
    height: float
    edge: float
    radiance: float


# In the frame of the picture: x to the right, y upwards, z towards the viewer
_KEY = _Softbox((-0.58, 0.64, 0.50), 0.46, 0.46, 0.30, 11.0)
_STRIP = _Softbox((0.92, 0.10, 0.10), 0.16, 0.80, 0.50, 3.5)
_SKY, _HORIZON, _FLOOR = 0.48, 0.24, 0.05


def studio(towards: Array) -> Array:
    """Return the radiance [1] that comes from directions (..., 3) in the frame of the picture.

    The unit is arbitrary; `brdfdb.scenes.lit_sphere` exposes it. x points to the right, y upwards and z towards the
    viewer.
    """
    up = towards[..., 1]
    above = _HORIZON + (_SKY - _HORIZON) * _smooth(up)
    sky = _FLOOR + (above - _FLOOR) * _smooth((up + 0.25) / 0.35)
    return np.asarray(sky + _seen(_KEY, towards) + _seen(_STRIP, towards))


def _seen(light: _Softbox, towards: Array) -> Array:
    """Return the radiance [1] of one light in directions."""
    axis = np.array(light.centre) / np.linalg.norm(light.centre)
    right = np.cross((0.0, 1.0, 0.0), axis)
    right /= np.linalg.norm(right)
    forward = towards @ axis
    depth = np.maximum(forward, 1e-6)
    x, y = np.abs(towards @ right) / depth, np.abs(towards @ np.cross(axis, right)) / depth
    inside = _smooth((1.0 - x / light.width) / light.edge) * _smooth((1.0 - y / light.height) / light.edge)
    return np.asarray(np.where(forward > 0.0, light.radiance * inside, 0.0))


def _smooth(x: Array) -> Array:
    """Return the smooth step from 0 at x = 0 to 1 at x = 1."""
    t = np.clip(x, 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))
