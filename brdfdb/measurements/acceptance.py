"""Values of a table at the samples' own directions: the worst sample, and the energy of each incidence."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from brdfdb.geometry import degrees
from brdfdb.measurements.peaks import rows_of_lights
from brdfdb.measurements.record import AtSamples, IncidenceEnergy, WorstSample
from brdfdb.measurements.samples import Samples
from brdfdb.parameters import Floats

_IN_PLANE = 0.02  # width of viewers across their plane, relative to their length, below which they are a scan in it
_FEWEST = 5  # viewers of an incidence whose values are summed
_CLOSE = 0.05  # relative difference within which a table keeps a sample
_MOST_ENERGIES = 200  # incidences that a record lists: those with the largest differences


def at_samples(
    samples: Samples, values: Floats, looked_up: Floats, floor: Floats, channels: Sequence[str]
) -> AtSamples | None:
    """Return the differences of looked-up values (N, C) [1/sr] from the values (N, C) of samples; None without any.

    Differences are relative to the sample, or to the `floor` (C,) [1/sr] if it is larger. Holes are nan.
    """
    known = np.isfinite(values)
    if not known.any():
        return None
    error = np.where(known, np.abs(looked_up - values) / np.maximum(np.abs(values), floor), 0.0)
    row, column = divmod(int(np.argmax(error)), error.shape[1])
    worst = WorstSample(
        **_degrees(samples, row),
        theta_r_deg=_digits(float(degrees(samples.theta_r[row])), 6),
        phi_r_deg=_digits(float(degrees(samples.phi_r[row])), 6),
        channel=channels[column],
        sample=_digits(values[row, column], 6),
        table=_digits(looked_up[row, column], 6),
        error=_digits(error[row, column]),
    )
    energies = []
    for rows in rows_of_lights(samples) if samples.scanned else []:
        weight = viewer_weights(samples.w_r[rows])
        if weight is None:
            continue
        of_samples = weight @ np.where(known[rows], values[rows], 0.0)
        of_table = weight @ np.where(known[rows], looked_up[rows], 0.0)
        off = np.abs(of_table - of_samples) / np.maximum(np.abs(of_samples), 1e-300)
        worst_channel = int(np.argmax(off))
        energies.append(
            IncidenceEnergy(
                **_degrees(samples, int(rows[0])),
                channel=channels[worst_channel],
                samples=_digits(of_samples[worst_channel], 5),
                table=_digits(of_table[worst_channel], 5),
                error=_digits(off[worst_channel]),
            )
        )
    listed = sorted(energies, key=lambda one: -one.error)[:_MOST_ENERGIES]
    listed.sort(key=lambda one: (one.theta_i_deg, one.phi_i_deg))
    p95 = _digits(np.percentile(error[known], 95.0))
    within = _digits(np.mean(error[known] <= _CLOSE), 4)
    return AtSamples(p95=p95, within=within, worst=worst, energies=listed)


def viewer_weights(w_r: Floats) -> Floats | None:
    """Return weights (N,) that sum f_r at viewers (N, 3) to a trapezoid sum of f_r cos(theta_r); None for too few.

    Viewers in one plane have the trapezoid rule in theta_r [rad]. Others have that of triangles in the projected
    disk [sr]. Repeats of a viewer share its weight.
    """
    _, first, place = np.unique(np.round(w_r, 5), axis=0, return_index=True, return_inverse=True)
    place = place.reshape(-1)
    points = w_r[first, :2]
    if first.size < _FEWEST:
        return None
    _, spread, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    if spread[1] <= _IN_PLANE * spread[0]:
        angle = np.arcsin(np.clip(points @ axes[0], -1.0, 1.0))
        order = np.argsort(angle)
        gap = np.diff(angle[order])
        weight: Floats = np.empty(first.size)
        weight[order] = 0.5 * (np.append(gap, 0.0) + np.append(0.0, gap)) * w_r[first[order], 2]
    else:
        from scipy.spatial import Delaunay

        corners = Delaunay(points).simplices
        a, b, c = (points[corners[:, number]] for number in range(3))
        area = 0.5 * np.abs((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]))
        weight = np.asarray(np.bincount(corners.reshape(-1), np.repeat(area / 3.0, 3), first.size), np.float64)
    return np.asarray((weight / np.bincount(place))[place])


def _degrees(samples: Samples, row: int) -> dict[str, float]:
    """Return the direction of the light of a sample."""
    angles = {"theta_i_deg": samples.theta_i[row], "phi_i_deg": samples.phi_i[row]}
    return {name: _digits(float(degrees(angle)), 6) for name, angle in angles.items()}


def _digits(value: float | np.floating[Any], count: int = 3) -> float:
    return float(f"{value:.{count}g}")
