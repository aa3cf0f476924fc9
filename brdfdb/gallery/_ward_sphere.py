"""Ward 1992, Fig. 7: the sphere whose grain follows its meridians, under a distant light."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.geometry import HALF_PI, radians, unit_vector

Array = NDArray[np.float64]

CAMERA_DEG, LIGHT_DEG = 35.0, 75.0  # elevations of camera and light above the equator of the sphere


class Points(NamedTuple):
    """Points of the sphere: frames (..., 3, 3) with x along the meridian, and camera and light in them (..., 3)."""

    frame: Array
    camera: Array
    light: Array


def points_at(across: Array, up: Array) -> Points:
    """Return the points at places [radius] in the image of a unit sphere."""
    camera, light = (unit_vector(HALF_PI - radians(elevation), 0.0) for elevation in (CAMERA_DEG, LIGHT_DEG))
    right = np.array([0.0, 1.0, 0.0])
    normal = across[..., None] * right + up[..., None] * np.cross(camera, right)
    normal = normal + np.sqrt(1.0 - across**2 - up**2)[..., None] * camera
    parallel = np.cross([0.0, 0.0, 1.0], normal)
    parallel /= np.linalg.norm(parallel, axis=-1, keepdims=True)
    frame = np.stack([np.cross(normal, parallel), parallel, normal], axis=-2)
    return Points(frame, frame @ camera, frame @ light)
