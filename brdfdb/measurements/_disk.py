"""Integrals over the unit disk, on which areas are projected solid angles, of values at scattered points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from brdfdb.errors import import_extra
from brdfdb.parameters import Floats

_RIM = 360  # points of the rim, which continue the values to the horizon


def averaged(points: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return each point once, with the mean of its values without holes."""
    _, first, which = np.unique(np.round(points, 9), axis=0, return_index=True, return_inverse=True)
    which = which.reshape(-1)
    if first.size == len(points):
        return points, values
    known = np.isfinite(values)
    totals, counts = np.zeros((2, first.size, values.shape[1]))
    np.add.at(totals, which, np.where(known, values, 0.0))
    np.add.at(counts, which, known)
    return points[first], np.divide(totals, counts, out=np.full_like(totals, np.nan), where=counts > 0)


@dataclass(frozen=True)
class DiskIntegrals:
    """Integrals of values over the unit disk.

    Attributes
    ----------
    covered : float [1]
        Share of the disk that the points surround.
    inside, whole : array (C,)
        Integrals over what is covered, and over the disk.
    peak : float [1]
        Largest share of one point in the integrals over the disk: of many points it is small, unless the values have a
        peak that is narrower than the distance of the points.
    """

    covered: float
    inside: Floats
    whole: Floats
    peak: float


def integrals(points: Floats, values: Floats) -> DiskIntegrals | None:
    """Return the integrals of values (N, C) at points (N, 2) of the unit disk; None if less than half is covered.

    Values are linear on the Delaunay triangles of the points. Beyond them the value of each azimuth is that of the
    point closest to the rim there. What covers half of the disk surrounds its middle: every azimuth has an end.
    """
    spatial = import_extra("scipy.spatial")
    if len(points) < 3 or np.linalg.matrix_rank(points - points[0], tol=1e-6) < 2:
        return None
    hull = spatial.ConvexHull(points)
    if hull.volume < 0.5 * np.pi:
        return None
    corners = spatial.Delaunay(points).simplices
    a, b, c = (points[corners[:, number]] for number in range(3))
    areas = 0.5 * np.abs((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]))
    inner = np.bincount(corners.reshape(-1), np.repeat(areas / 3.0, 3), len(points))
    azimuth = np.arange(_RIM) * (2.0 * np.pi / _RIM)
    rim = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1)
    toward = rim @ hull.equations[:, :2].T  # of each azimuth and edge of the hull
    reach = np.min(
        -hull.equations[:, 2] / np.where(toward > 0.0, toward, np.nan), axis=1, initial=1.0, where=toward > 0.0
    )
    beyond = 1.0 - reach**2
    beyond *= (np.pi - hull.volume) / max(beyond.sum(), np.finfo(float).tiny)
    outer = np.bincount(spatial.cKDTree(points).query(rim)[1], beyond, len(points))
    parts = (inner + outer)[:, np.newaxis] * values
    whole = parts.sum(axis=0)
    shares = np.abs(parts).max(axis=0) / np.maximum(np.abs(whole), np.finfo(float).tiny)
    return DiskIntegrals(float(hull.volume / np.pi), inner @ values, whole, float(shares.max()))
