"""Peaks of samples that no smooth f_r can hold: where they are, and the glints through them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.geometry import degrees
from brdfdb.measurements.glints import WIDEST_DEG, Glint, Glints, offsets_deg
from brdfdb.measurements.samples import Samples
from brdfdb.parameters import Floats

_FEWEST = 5  # viewers of an incidence among which peaks are looked for
_CONTRAST = np.log(4.0)  # logarithm of a peak over the samples two steps from it, at least
_STEPS = 2.5  # steps to its neighbours within which a peak falls to a quarter: wider ones are between samples, too
_WIDEST_REACH_DEG = 8.0  # the same of samples that tell the azimuth of the light
_ANNULUS = 1.7  # outer radius of the samples around a peak, over its reach
_RING = 2.2  # the same of those that may belong to it
_SAME_DEG = 1e-3
_STANDS_OUT = 1.2  # f_r of a missed peak over that of its neighbours, at least
_MISSED = 0.04  # share of f_r that a table may miss at a sample without a glint
_MOST_MISSED = 0.05  # share of samples above which not peaks are missed, but the grid is too coarse
_FLAT = 0.02  # width of viewers across their plane, relative to their length, below which they are a scan in it
_SEEN = 0.02  # share of the top that a neighbour must have for a width to be resolved
_HIDDEN = 0.03  # share of a neighbour's value that a glint may add to it where the neighbour shows nothing
_NEAREST = 0.6  # distance of the centre of a glint from its top, over its reach: other samples are not nearer
_SAME_TRACK_DEG = 1.5  # difference of offsets of one glint from light to light, at most, besides the steps of viewers

Rows = NDArray[np.int64]


class SamplePeak(NamedTuple):
    """A sample above its surroundings: its row, and those of the samples around that may belong to its peak.

    `step_deg` is the distance of the closest, `reach_deg` that at which f_r has fallen to a quarter.
    """

    top: int
    ring: Rows
    step_deg: float
    reach_deg: float


def rows_of_lights(samples: Samples) -> list[NDArray[np.intp]]:
    """Return the rows of the samples of each light."""
    order = np.argsort(samples.incidence, kind="stable")
    return np.split(order, np.cumsum(np.bincount(samples.incidence))[:-1])


def neighbours(w_r: Floats) -> list[Rows]:
    """Return the neighbours of each of some viewers (N, 3): along a scan in a plane, or by Delaunay's triangulation.

    Viewers at the same direction have the same neighbours.
    """
    places = np.arctan2(np.hypot(w_r[:, 0], w_r[:, 1]), w_r[:, 2])
    turn = np.arctan2(w_r[:, 1], w_r[:, 0])
    points = np.stack([places * np.cos(turn), places * np.sin(turn)], axis=1)
    _, first, place = np.unique(np.round(points, 6), axis=0, return_index=True, return_inverse=True)
    points = points[first]
    beside: list[set[int]] = [set() for _ in first]
    if len(points) >= 3:
        _, spread, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
        if spread[1] <= _FLAT * spread[0]:
            order = np.argsort(points @ axes[0])
            pairs = np.stack([order[:-1], order[1:]], axis=1)
        else:
            from scipy.spatial import Delaunay

            corners = Delaunay(points).simplices
            pairs = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [0, 2]]])
        for a, b in pairs.tolist():
            beside[a].add(b)
            beside[b].add(a)
    return [first[sorted(beside[own])] for own in place.reshape(-1).tolist()]


def peaks_of(samples: Samples, logarithm: Floats) -> list[SamplePeak]:
    """Return the peaks of each incidence in the logarithm (N,) of f_r, which falls to a quarter within some degrees."""
    found = []
    for rows in rows_of_lights(samples):
        if rows.size < _FEWEST:
            continue
        beside = neighbours(samples.w_r[rows])
        height = logarithm[rows]
        highest = np.array([height[ring].max(initial=-np.inf) for ring in beside])
        clear = (height >= highest) & (height > np.median(height) + _CONTRAST)
        for own in np.flatnonzero(clear):
            chord = np.linalg.norm(samples.w_r[rows] - samples.w_r[rows[own]], axis=1)
            apart = degrees(2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0)))
            others = np.unique(np.round(apart[apart > _SAME_DEG], 3))
            widest = _WIDEST_REACH_DEG if samples.turned else 0.0  # grids over phi_i and phi_r do not follow them
            for reach in others[others <= max(widest, _STEPS * np.median(apart[beside[own]]))]:
                around = (apart >= reach - 1e-3) & (apart <= _ANNULUS * reach)
                if height[own] - np.max(height[around]) > _CONTRAST:
                    ring = np.flatnonzero((apart <= _RING * reach) & (np.arange(rows.size) != own))
                    found.append(SamplePeak(int(rows[own]), rows[ring], float(others[0]), float(reach)))
                    break
                if np.max(height[apart <= reach]) > height[own]:
                    break
    return found


def missed_peaks(samples: Samples, f_r: Floats, missed: Floats) -> list[SamplePeak]:
    """Return the samples of scans that a table misses by more than 4 % of f_r, and around them by less.

    f_r (N, C) is a fifth higher there than around; `missed` (N, C) is the difference of f_r and the table over f_r. If
    so many samples are missed that the grid is too coarse everywhere, there are none.
    """
    bright = f_r.mean(axis=1)
    height = missed.max(axis=1)
    tops = height > _MISSED
    if not samples.scanned or not tops.any() or np.mean(tops) > _MOST_MISSED:
        return []
    found = []
    for rows in rows_of_lights(samples):
        if rows.size < _FEWEST or not tops[rows].any():
            continue
        beside = neighbours(samples.w_r[rows])
        for own in np.flatnonzero(tops[rows]):
            ring = beside[own]
            if not ring.size or bright[rows[own]] < _STANDS_OUT * np.max(bright[rows[ring]]):
                continue
            if np.all(height[rows[ring]] <= height[rows[own]]):
                chord = np.linalg.norm(samples.w_r[rows[ring]] - samples.w_r[rows[own]], axis=1)
                step = float(degrees(chord.min()))
                found.append(SamplePeak(int(rows[own]), rows[ring], step, step))
    return found


class _Shape(NamedTuple):
    centre_deg: Floats  # offset from the top, in the plane and across
    width_deg: float
    resolved: bool


def glint_of(samples: Samples, peak: SamplePeak, smooth: Callable[[Floats, Floats], Floats], track: int) -> Glint:
    """Return the glint through the samples of a peak above a smooth f_r [1/sr]; it is that of the top exactly."""
    rows = np.append(peak.top, peak.ring)
    wi, wr = samples.w_i[rows], samples.w_r[rows]
    values = np.nan_to_num(samples.values[rows])
    excess = np.maximum(values - smooth(wi, wr), 0.0)
    share = excess[0] / max(float(excess[0].sum()), 1e-300)  # channels count as they do at the top
    at = np.stack(offsets_deg(wi, wr), axis=1)
    top = at[0]
    shape = _shape(at[1:] - top, excess @ share, (values @ share)[1:], peak.reach_deg)
    from_centre, width_deg = _below(shape, at[1:] - top, excess @ share, (values @ share)[1:])
    versine = 1.0 - np.cos(np.deg2rad(np.hypot(*from_centre)))
    amplitude = excess[0] * np.exp(versine / np.deg2rad(width_deg) ** 2)
    centre = direction_at(wi[0], *(top + from_centre))
    glint = Glint.through(wi[0], centre, amplitude, width_deg, resolved=shape.resolved, track=track)
    found = Glints(glints=(glint,), turned=True).f_r(wi[:1], wr[:1])[0]
    factor = np.divide(excess[0], found, out=np.zeros_like(found), where=found > 0.0)
    return glint.model_copy(update={"power": tuple((np.array(glint.power) * factor).tolist())})


def direction_at(wi: Floats, in_plane_deg: float, across_deg: float) -> Floats:
    """Return the viewer (3,) at offsets from the mirror direction of a light (3,): the inverse of `offsets_deg`."""
    theta = np.arctan2(np.hypot(wi[0], wi[1]), wi[2]) + np.deg2rad(in_plane_deg)
    side = np.arctan2(wi[1], wi[0]) + np.pi
    across = np.deg2rad(across_deg)
    radial = np.array([np.sin(theta) * np.cos(side), np.sin(theta) * np.sin(side), np.cos(theta)])
    return np.asarray(radial * np.cos(across) + np.array([-np.sin(side), np.cos(side), 0.0]) * np.sin(across))


def _shape(at: Floats, excess: Floats, values: Floats, reach_deg: float) -> _Shape:
    """Return the round Gaussian through a top and its neighbours at offsets (K, 2) [degree] from it.

    `excess` (K + 1,) is that of the top, and of the neighbours of the given values. A neighbour that shows no excess
    is a limit: the glint may add a few percent to it. Viewers in a plane show no width across it: it is that in it.
    """
    from scipy.optimize import least_squares

    top = max(float(excess[0]), 1e-300)
    of_ring = excess[1:]
    resolved = bool(np.any(of_ring > _SEEN * top))
    hidden = np.minimum(np.maximum(_HIDDEN * values, 1e-9 * top), 0.5 * top)
    distance = np.linalg.norm(at, axis=1)
    widths = distance / np.sqrt(2.0 * np.log(top / np.clip(np.maximum(of_ring, hidden), 1e-12 * top, 0.9 * top)))
    width = float(np.clip(widths.min(), 1e-3, WIDEST_DEG))
    if not resolved:
        return _Shape(np.zeros(2), width, False)
    _, spread, axes = np.linalg.svd(np.concatenate([np.zeros((1, 2)), at]), full_matrices=False)
    axes = axes[spread > _FLAT * spread[0]]

    def off(numbers: Floats) -> Floats:
        centre = numbers[1:] @ axes
        log = (np.sum((at - centre) ** 2, axis=1) - centre @ centre) / (-2.0 * np.exp(2.0 * numbers[0]))
        glint = top * np.exp(np.minimum(log, 50.0))
        relative = np.arcsinh((glint - of_ring) / (0.05 * np.maximum(values, 1e-9 * top)))
        return np.asarray(np.where(relative < 0.0, relative * lesser, relative))  # the smooth part takes the rest

    step = float(distance.min())
    highest = at[np.argmax(of_ring)] @ axes.T
    lesser = np.sqrt(np.clip(of_ring / top, 0.0, 1.0))
    tried = (width, 0.5 * step, 0.6 * reach_deg)
    starts = [np.append(np.log(w), s * highest) for w in tried for s in (0.0, 0.3)]
    low = np.append(np.log(0.05 * step), np.full(len(axes), -_NEAREST * reach_deg))
    high = np.append(np.log(min(WIDEST_DEG, 2.0 * reach_deg)), np.full(len(axes), _NEAREST * reach_deg))
    fits = [least_squares(off, np.clip(start, low + 1e-9, high - 1e-9), bounds=(low, high)) for start in starts]
    best = min(fits, key=lambda one: one.cost).x
    return _Shape(best[1:] @ axes, float(np.exp(best[0])), True)


def _below(shape: _Shape, at: Floats, excess: Floats, values: Floats) -> tuple[Floats, float]:
    """Return centre and width [degree] of a shape that is so narrow that it adds to no neighbour more than it shows."""
    most = np.minimum(np.maximum(excess[1:], _HIDDEN * values) / max(float(excess[0]), 1e-300), 1.0 - 1e-3)
    logarithm = -2.0 * np.log(np.maximum(most, 1e-12))
    for centre in (shape.centre_deg, np.zeros(2)):
        farther = np.sum((at - centre) ** 2, axis=1) - centre @ centre
        if np.all(farther > 0.0):
            return centre, min(shape.width_deg, float(np.sqrt(np.min(farther / logarithm))))
    return np.zeros(2), shape.width_deg  # a neighbour at the place of the top


def tracks_of(samples: Samples, peaks: Sequence[SamplePeak]) -> list[int]:
    """Return the number of the track of each peak: those of one track have similar offsets, from light to light."""
    tops = np.array([peak.top for peak in peaks], dtype=np.int64)
    offsets = np.stack(offsets_deg(samples.w_i[tops], samples.w_r[tops]), axis=1)
    last: list[tuple[Floats, float]] = []  # offset and step of the last peak of each track
    used: set[tuple[int, int]] = set()
    numbers = [0] * len(peaks)
    order = np.lexsort([np.linalg.norm(offsets, axis=1), samples.incidence[tops], samples.theta_i[tops]])
    for k in order.tolist():
        light = int(samples.incidence[tops[k]])
        near = [
            (float(np.linalg.norm(offset - offsets[k])), number)
            for number, (offset, step) in enumerate(last)
            if (number, light) not in used
            and np.linalg.norm(offset - offsets[k]) <= _SAME_TRACK_DEG + step + peaks[k].step_deg
        ]
        number = min(near)[1] if near else len(last)
        last[number : number + 1] = [(offsets[k], peaks[k].step_deg)]
        used.add((number, light))
        numbers[k] = number
    return numbers
