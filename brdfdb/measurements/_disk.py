"""Integrals over the unit disk, on which areas are projected solid angles, of values at scattered points."""

from __future__ import annotations

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


def integrals(points: Floats, values: Floats) -> tuple[float, Floats, Floats]:
    """Return the covered share of the unit disk, and integrals (C,) of values over it and over the whole disk."""
    spatial = import_extra("scipy.spatial")
    dark = np.zeros(values.shape[1])
    if len(points) < 3 or np.linalg.matrix_rank(points - points[0], tol=1e-6) < 2:
        return 0.0, dark, dark
    area, inside = _over_triangles(points, values)
    azimuth = np.arange(_RIM) * (2.0 * np.pi / _RIM)
    rim = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1)
    distance, nearest = spatial.cKDTree(points).query(rim)
    apart = distance > 1e-6
    whole_area, whole = _over_triangles(
        np.concatenate([points, rim[apart]]), np.concatenate([values, values[nearest[apart]]])
    )
    return area / np.pi, inside, whole * (np.pi / whole_area)


def _over_triangles(points: Floats, values: Floats) -> tuple[float, Floats]:
    """Return the area of the Delaunay triangles of points, and the integrals (C,) of values that are linear on them."""
    spatial = import_extra("scipy.spatial")
    corners = spatial.Delaunay(points).simplices
    a, b, c = (points[corners[:, number]] for number in range(3))
    areas = 0.5 * np.abs((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]))
    return float(areas.sum()), np.einsum("t,tc->c", areas, values[corners].mean(axis=1))
