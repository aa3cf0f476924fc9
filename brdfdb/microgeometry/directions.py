"""Directions at which a goniometer of rays measures a surface, so that f_r can be interpolated between them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.integrals.patches import BASES

Vectors = NDArray[np.float64]

LOWEST_DEG = 87.0  # polar angle of the lowest ring of lights and of viewers; beyond it f_r is extrapolated
_BETWEEN_DEG = (
    76.0  # of a ring between those of the patches: without it, interpolation is off by 3 % there, else by 1 %
)
_LOBE = np.array([0.0, 0.35, 0.7, 1.05, 1.5, 2.0, 2.6, 3.3])  # slopes of half vectors, in standard deviations
_SPOKES = 5  # azimuths of half vectors in half a turn


class GoniometerDirections(NamedTuple):
    """Unit vectors (I, 3) of lights, and of the viewers of all lights (V, 3), or of each light (I, V, 3)."""

    lights: Vectors
    viewers: Vectors


def goniometer_directions(
    *, isotropic: bool, slopes: tuple[float, float] | None = None, azimuth: float = 0.0
) -> GoniometerDirections:
    """Return lights and viewers.

    Parameters
    ----------
    isotropic : bool
        True for a surface that may be turned: lights have azimuth 0, and viewers those of half a turn.
    slopes : (float, float), optional
        Standard deviations of the slopes of mirror-like facets along their principal axes [1]: those of the ellipse of
        half vectors, x and y by default. Viewers about the mirror direction are added, at half vectors of up to 3.3
        standard deviations. Of isotropic surfaces both are the same.
    azimuth : float
        Azimuth of the first axis, any angle [rad].

    Notes
    -----
    Viewers are the middles of the 145 patches of Klems, and rings at 76 and 87 degrees. Isotropic surfaces have a
    light for each ring of patches and two at 76 and 87 degrees, others have the middles of 77 patches, and twelve
    lights at 87 degrees. Interpolation between them was off by 0.4 % (95 of 100 pairs up to 82.5 degrees) for
    Lambertian facets of Gaussian slopes of 20 degrees, and by 2 % in the median and 7 % at worst (of 144 pairs)
    where the slopes along y are those of 8 degrees. Of mirrors whose slopes are 0.3 and 0.1, along axes at any
    azimuth, it is off by 0.8 % in the median (95 of 100 pairs: 6 %) up to 70 degrees and 6 % (21 %) beyond, if it
    is over Beckmann's model, and by 3 % (13 %) and 9 % (45 %) over an isotropic lobe:
    ``tests/benchmarks/mirror_lobes.py``. Grooves in one direction have edges; without a model of them,
    interpolation is worse. Fewer lights leave half of all pairs unknown.
    """
    lowest = np.radians(LOWEST_DEG)
    between = np.radians(_BETWEEN_DEG)
    viewers = np.concatenate([BASES["full"].middles, _ring(between, 16), _ring(lowest, 16)])
    if isotropic:
        bounds = np.radians(BASES["full"].bounds_deg)
        theta = np.sort([0.0, *(0.5 * (bounds[1:-1] + bounds[2:])), between, lowest])
        lights = np.stack([np.sin(theta), 0.0 * theta, np.cos(theta)], axis=-1)
        viewers = viewers[viewers[:, 1] > -1e-9]
    else:
        lights = np.concatenate([BASES["half"].middles, _ring(lowest, 12)])
    if slopes is not None:
        lobes = [_about_mirror(light, slopes, azimuth, lowest, half=isotropic) for light in lights]
        viewers = np.concatenate([np.broadcast_to(viewers, (len(lights), *viewers.shape)), lobes], axis=1)
    return GoniometerDirections(lights, viewers)


def _ring(theta: float, count: int) -> Vectors:
    phi = np.arange(count) * (2.0 * np.pi / count)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.full(count, np.cos(theta))], axis=-1)


def _about_mirror(light: Vectors, slopes: tuple[float, float], azimuth: float, lowest: float, *, half: bool) -> Vectors:
    """Return viewers (V, 3) about the mirror direction of a light (3,), all above the lowest ring or on it.

    A spoke of half vectors ends where the viewer is on the lowest ring, and its half vectors move closer together.
    """
    turn = np.pi if half else 2.0 * np.pi
    count = _SPOKES if half else 2 * (_SPOKES - 1)
    around = np.linspace(0.0, turn, count, endpoint=half)
    cos, sin = np.cos(azimuth), np.sin(azimuth)
    axes = np.array([[cos, sin], [-sin, cos]]) * np.asarray(slopes)[:, np.newaxis]
    ends_at = np.stack([np.cos(around), np.sin(around)], axis=-1) @ axes  # on the ellipse of standard deviations
    radius = np.linalg.norm(ends_at, axis=-1)
    directions = ends_at / radius[:, np.newaxis]
    lobe = []
    for direction, slope in zip(directions, radius, strict=True):
        share = np.linspace(1.0, 0.0, 201)  # of the length of the spoke; the mirror direction is above, or the ring is
        ends = _mirrored(light, direction, slope * _LOBE[-1] * share)
        above = np.flatnonzero(ends[:, 2] >= np.cos(lowest) - 1e-9)
        longest = share[above[0]] if above.size else 0.0
        lobe.append(_mirrored(light, direction, slope * _LOBE[1:] * longest))
    return np.concatenate([_mirrored(light, directions[0], np.zeros(1)), *lobe])


def _mirrored(light: Vectors, direction: Vectors, slopes: NDArray[np.float64]) -> Vectors:
    """Return the mirror images (N, 3) of a light in facets that slope by `slopes` (N,) in a horizontal direction."""
    normals = np.column_stack([np.outer(slopes, direction), np.ones(slopes.size)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(2.0 * (normals @ light)[:, np.newaxis] * normals - light)
