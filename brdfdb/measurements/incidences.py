"""Albedos of the directions of the light of samples: integrals of their values over the viewers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.errors import import_extra
from brdfdb.geometry import degrees
from brdfdb.measurements.samples import Samples
from brdfdb.parameters import Floats

_RIM = 360  # points of the rim, which continue the values to the horizon
PEAK = 0.1  # share of one viewer in an albedo from which on it is not known
BAND_DEG = 1.0
_BANDS_DEG = (10.0, 30.0, 50.0, 70.0)  # incidences of scattered directions, each with those within BAND_DEG
_MOST_IN_BAND = 20_000
_FEWEST_VIEWERS = 12  # of an incidence that is integrated
_MOST_INCIDENCES = 400  # that are integrated, evenly among all


class ScatteredValues(NamedTuple):
    """Values (N, C) at points (N, 2)."""

    points: Floats
    values: Floats


def averaged(points: Floats, values: Floats) -> ScatteredValues:
    """Return each point once, with the mean of its values without holes."""
    _, first, which = np.unique(np.round(points, 9), axis=0, return_index=True, return_inverse=True)
    which = which.reshape(-1)
    if first.size == len(points):
        return ScatteredValues(points, values)
    known = np.isfinite(values)
    totals, counts = np.zeros((2, first.size, values.shape[1]))
    np.add.at(totals, which, np.where(known, values, 0.0))
    np.add.at(counts, which, known)
    means = np.divide(totals, counts, out=np.full_like(totals, np.nan), where=counts > 0)
    return ScatteredValues(points[first], means)


@dataclass(frozen=True)
class DiskIntegrals:
    """Integrals (C,) of values over the unit disk, and over the share of it that the points surround.

    `peak` [1] is the largest share of one point in the integrals over the disk. Of many points it is small, unless the
    values have a peak that is narrower than the distance of the points.
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


@dataclass(frozen=True)
class Incidence:
    """Albedo of one direction of the light: the integral of its samples."""

    theta_i_deg: float
    phi_i_deg: float
    viewers: int  #: number of directions of the viewer
    covered: float  #: share of the projected hemisphere that viewers surround, in the channel with most holes
    measured: tuple[float, ...]  #: integral of f_r cos(theta_r) over what is covered, of each channel
    albedo: tuple[float, ...]  #: integral over the hemisphere; beyond the viewers f_r is that of the nearest
    # Largest share of one viewer in the albedo of a channel. Above a tenth the lobe is narrower than the steps between
    # viewers, and the albedo is not known
    peak: float


class Incidences(NamedTuple):
    """Albedos of directions of the light; of bands of theta_i if the directions are scattered."""

    incidences: tuple[Incidence, ...]
    in_bands: bool


def incidences_of(
    samples: Samples, delta_deg: Floats, progress: Callable[[float], None] | None, *, one_side: bool
) -> Incidences:
    """Return the albedos of directions of the light, or of bands of scattered directions.

    `delta_deg` (N,) are azimuths [degree] from the light to the viewer, in [0, 360). With `one_side` the viewers are on
    one side of the plane of incidence, and the other side is its mirror image. `progress` is called with the share [1]
    done.
    """
    for in_bands, groups in ((False, lights(samples)), (True, bands(samples))):
        incidences = []
        for number, rows in enumerate(groups):
            incidences.append(_incidence(samples, rows, delta_deg, one_side, in_bands))
            if progress is not None:
                progress((number + 1) / len(groups))
        if integrated := tuple(incidence for incidence in incidences if incidence is not None):
            return Incidences(integrated, in_bands)
    return Incidences((), False)


def lights(samples: Samples, fewest: int = _FEWEST_VIEWERS) -> list[NDArray[np.intp]]:
    """Return the rows of each direction of the light that has viewers enough, by theta_i."""
    number = samples.incidence
    theta_i = degrees(samples.theta_i)
    counts = np.bincount(number)
    enough = np.flatnonzero(counts >= fewest)
    if not enough.size:
        return []
    some = enough[np.unique(np.linspace(0, enough.size - 1, _MOST_INCIDENCES).astype(int))]
    order = np.argsort(number, kind="stable")
    ends = np.cumsum(counts)
    groups = [order[ends[k] - counts[k] : ends[k]] for k in some]
    return sorted(groups, key=lambda rows: float(theta_i[rows[0]]))


def bands(samples: Samples) -> list[NDArray[np.intp]]:
    """Return the rows of bands of theta_i, for directions of the light that are scattered."""
    theta_i = degrees(samples.theta_i)
    near = [np.flatnonzero(np.abs(theta_i - middle) <= BAND_DEG) for middle in _BANDS_DEG]
    thinned = [rows[:: max(1, -(-rows.size // _MOST_IN_BAND))] for rows in near]
    return [rows for rows in thinned if rows.size >= _FEWEST_VIEWERS]


def _incidence(
    samples: Samples, rows: NDArray[np.intp], delta: Floats, one_side: bool, in_bands: bool
) -> Incidence | None:
    """Return what the samples of one direction of the light integrate to; None if the viewers cover too little."""
    radius = np.sin(samples.theta_r[rows])
    turn = np.deg2rad(delta[rows])
    points = np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)
    values = samples.values[rows]
    if one_side or in_bands:
        points = np.concatenate([points, points * np.array([1.0, -1.0])])
        values = np.concatenate([values, values])
    points, values = averaged(points, values)
    covered = 1.0
    peak = 0.0
    (measured, albedo) = np.zeros((2, len(samples.channels)))
    patterns, of_pattern = np.unique(np.isfinite(values), axis=1, return_inverse=True)
    for number, known in enumerate(patterns.T):
        channels = np.flatnonzero(of_pattern.reshape(-1) == number)
        part = integrals(points[known], values[np.ix_(known, channels)])
        if part is None:
            return None
        covered = min(covered, part.covered)
        peak = max(peak, part.peak)
        measured[channels], albedo[channels] = part.inside, part.whole
    theta_i = degrees(samples.theta_i[rows])
    phi_i = degrees(samples.phi_i[rows]) % 360.0
    return Incidence(
        round(float(np.mean(theta_i)), 4),
        0.0 if in_bands else round(float(phi_i[0]), 4) % 360.0,
        len(rows),
        covered,
        tuple(measured.tolist()),
        tuple(albedo.tolist()),
        peak,
    )
