"""Directions as an instrument sees them: averages of f_r over the solid angles of light and receiver."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.geometry import common_solid_angle, versine
from brdfdb.materials.source import Evaluate
from brdfdb.measurements.instrument import Instrument
from brdfdb.parameters import Floats

WIDE = 20.0  # half angles of the aperture, from which on the width of a lobe is not changed by it
RESOLVED = 0.25  # half angle of the aperture, below which the width of a lobe is not resolved
_AROUND = (6, 12)  # directions of a ring, of one ring and of more
_RINGS = 3  # of lobes that are narrower than the half angle


class DiskRule(NamedTuple):
    """Points (Q, 2) of a disk of radius 1, the middle first, and their weights (Q,), which add up to 1."""

    points: NDArray[np.float64]
    weights: NDArray[np.float64]


@cache
def disk(rings: int) -> DiskRule:
    """Return the rule of a disk with so many rings of points around its middle.

    Radau's rule in the square of the radius, with equal steps around. One ring has 7 points, and is exact for
    polynomials of degree 5. Three rings have 37, and are exact to degree 11.
    """
    legendre = np.polynomial.legendre
    x = np.sort(legendre.legroots([0.0] * rings + [1.0, 1.0]).real)[1:]  # without the end at -1
    last = legendre.legval(x, [0.0] * rings + [1.0])
    weights = 0.5 * (1.0 - x) / ((rings + 1.0) * last) ** 2
    count = _AROUND[rings > 1]
    turns = 2.0 * np.pi * np.arange(count) / count
    circle = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    points = np.sqrt(0.5 * (1.0 + x))[:, np.newaxis, np.newaxis] * circle
    middle = 1.0 / (rings + 1.0) ** 2
    return DiskRule(
        np.concatenate([np.zeros((1, 2)), points.reshape(-1, 2)]),
        np.array([middle, *np.repeat(weights / count, count)]),
    )


def cone(w: Floats, half_angle: float, rings: int = 1) -> Floats:
    """Return directions (Q, N, 3) in a cone about unit vectors (N, 3); the half angle [rad] is small.

    A mean over the cone is their sum with the weights of `disk`.
    """
    helper = np.where(np.abs(w[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    u = np.cross(w, helper)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(w, u)
    at = np.tan(half_angle) * disk(rings).points
    spread = w + at[:, 0, np.newaxis, np.newaxis] * u + at[:, 1, np.newaxis, np.newaxis] * v
    return np.asarray(spread / np.linalg.norm(spread, axis=2, keepdims=True))


class _Around(NamedTuple):
    """Lights and viewers (Q N, 3) at the points of the aperture besides the middle.

    `weights` (Q, N) are those of the mean; `above` (Q, N) tells the viewers above the horizon.
    """

    w_i: Floats
    w_r: Floats
    weights: Floats
    above: NDArray[np.bool_]


class InstrumentView:
    """Pairs of directions, unit vectors (N, 3), as an instrument with wide light and receiver sees them.

    Solid angles that are unknown count as 0; without an instrument f_r is that at the directions themselves.
    `half_angle` [rad] is that of the disk that light and receiver make together; 0 where neither has a known solid
    angle.

    Notes
    -----
    Light and receiver are disks. A direction counts by its cosine, as light does on the sample and on the receiver. A
    lobe is a function of the half vector, which light and viewer move by the same amount. Both are replaced by one disk
    about the viewer, whose solid angle is the sum of theirs: what is left out is of the fourth order in the ratio of
    aperture and lobe. Directions below the horizon count with the value of the middle.
    """

    def __init__(self, w_i: Floats, w_r: Floats, instrument: Instrument | None = None) -> None:
        self.w_i = w_i
        self.w_r = w_r
        self.instrument = instrument
        angles = () if instrument is None else (instrument.source_solid_angle_sr, instrument.receiver_solid_angle_sr)
        self._half_angles = [
            float(np.arccos(max(1.0 - solid_angle / (2.0 * np.pi), 0.0)))
            for solid_angle in angles
            if solid_angle is not None
        ]
        self.half_angle = float(np.hypot.reduce(self._half_angles)) if self._half_angles else 0.0
        self._spread: dict[int, _Around] = {}

    def __len__(self) -> int:
        return len(self.w_i)

    def selected(self, rows: NDArray[np.int64]) -> InstrumentView:
        """Return the view of some of the pairs."""
        return InstrumentView(self.w_i[rows], self.w_r[rows], self.instrument)

    @cached_property
    def theta_i(self) -> Floats:
        """Polar angles [rad] of the light, shape (N,)."""
        return np.asarray(np.arccos(np.clip(self.w_i[:, 2], -1.0, 1.0)))

    @cached_property
    def from_mirror(self) -> Floats:
        """Angles [rad] between the viewer and the mirror direction of the light, shape (N,)."""
        mirror = self.w_i * [-1.0, -1.0, 1.0]
        return np.asarray(2.0 * np.arcsin(np.clip(0.5 * np.linalg.norm(self.w_r - mirror, axis=1), 0.0, 1.0)))

    @cached_property
    def mirror(self) -> Floats:
        """f_r [1/sr] that a specular reflectance of 1 adds, shape (N,); 0 where no solid angle is known.

        The specular part of the light from the source, within the receiver: the solid angle that the receiver and the
        mirror image of the light share, over the product of both and the cosine of the viewer.
        """
        if not self._half_angles:
            return np.zeros(len(self))
        first = self._half_angles[0]
        last = self._half_angles[-1]
        shared = common_solid_angle(np.asarray(first), np.asarray(last), self.from_mirror)
        if len(self._half_angles) == 1:  # the other is a point
            shared = np.where(self.from_mirror < first, _solid_angle(first), 0.0)
            return np.asarray(shared / (_solid_angle(first) ** 2 * self.w_r[:, 2]))
        return np.asarray(shared / (_solid_angle(first) * _solid_angle(last) * self.w_r[:, 2]))

    def points(self, width: float | None = None) -> int:
        """Return the number of directions that the mean of a lobe takes at each pair; `width` as of `mean`."""
        rings = _rings(self.half_angle, width)
        return len(disk(rings).weights) if rings else 1

    def mean(self, brdf: Callable[[Floats, Floats], Floats], width: float | None = None) -> Floats:
        """Return f_r [1/sr] averaged over the aperture.

        `brdf` gives f_r [1/sr], shape (M,) or (M, C), at unit vectors (M, 3) of light and viewer. `width` [1] is that
        of its lobe, in slopes: a narrow lobe takes more points, and a very wide one the middle alone.
        """
        middle = np.asarray(brdf(self.w_i, self.w_r))
        rings = _rings(self.half_angle, width)
        if not rings:
            return middle
        if rings not in self._spread:
            spread = cone(self.w_r, self.half_angle, rings)[1:]
            above = spread[:, :, 2] > 0.0
            viewers = np.where(above[:, :, np.newaxis], spread, self.w_r)
            light = np.ascontiguousarray(np.broadcast_to(self.w_i, viewers.shape)).reshape(-1, 3)
            weights = disk(rings).weights[1:, np.newaxis] * viewers[:, :, 2] / self.w_r[:, 2]
            self._spread[rings] = _Around(light, viewers.reshape(-1, 3), weights, above)
        around = self._spread[rings]
        values = np.asarray(brdf(around.w_i, around.w_r)).reshape(*around.above.shape, *middle.shape[1:])
        further = (...,) + (np.newaxis,) * (middle.ndim - 1)
        values = np.where(around.above[further], values, middle)
        return np.asarray(disk(rings).weights[0] * middle + np.sum(around.weights[further] * values, axis=0))


def averaged(brdf: Evaluate, instrument: Instrument) -> Evaluate:
    """Return f_r averaged over the solid angles of an instrument, a function of unit vectors like `brdf`.

    `brdf` gives f_r [1/sr], shape (N, C), at unit vectors (N, 3) of light and viewer.
    """
    return lambda w_i, w_r: InstrumentView(w_i, w_r, instrument).mean(brdf)


def _solid_angle(half_angle: float) -> float:
    """Return the solid angle [sr] of a cone."""
    return float(2.0 * np.pi * versine(np.asarray(half_angle)))


def _rings(half_angle: float, width: float | None) -> int:
    """Return the rings of points that the mean of a lobe takes; 0 for the middle alone."""
    if half_angle == 0.0 or (width is not None and width > WIDE * half_angle):
        return 0
    return 1 if width is None or width >= half_angle else _RINGS
