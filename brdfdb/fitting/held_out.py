"""The error of a fit at incidences that it did not see."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brdfdb.fitting.document import HeldOut
from brdfdb.fitting.problem import Point, Problem
from brdfdb.fitting.residuals import Residual, logarithms
from brdfdb.geometry import degrees
from brdfdb.measurements import Samples

GROUPS = 8  # groups of incidences at most; fewer incidences are left out one at a time
_EVALUATIONS = 40


def held_out(problem: Problem, point: Point, samples: Samples) -> HeldOut | None:
    """Return the error at incidences that were left out in turn; None if the light has one direction.

    Each search begins where that of all samples ended, and ends at the samples that are left. More than eight
    incidences are left out in groups of neighbours.
    """
    groups = groups_of(samples)
    if len(groups) < 2:
        return None
    surface = problem.surface
    whole = Residual(samples, problem.residual.kind)
    angles, errors = [], []
    for rows in groups:
        seen = np.ones(len(samples), dtype=bool)
        seen[rows] = False
        kept = np.flatnonzero(seen & whole.used.any(axis=1))
        if not kept.size:
            continue
        part = Problem(surface, samples.w_i[kept], samples.w_r[kept], whole.selected(kept))
        part.scale = problem.scale
        end = part.descend(point.x[part.free], _EVALUATIONS)
        left = samples.selected(rows)
        difference = logarithms(left, surface.f_r(end.x, end.values, left.w_i, left.w_r))
        difference = difference[np.isfinite(difference)]
        if difference.size:
            angles.append(np.unique(np.round(degrees(samples.theta_i[rows]), 3)).tolist())
            errors.append(difference)
    if not errors:
        return None
    together = np.concatenate(errors)
    return HeldOut(
        theta_i_deg=angles,
        rms_ln=[float(np.sqrt(np.mean(one**2))) for one in errors],
        rms=float(np.sqrt(np.mean(together**2))),
        median=float(np.median(np.abs(together))),
    )


def groups_of(samples: Samples) -> list[NDArray[np.int64]]:
    """Return the rows of each incidence, or of groups of neighbouring ones, by theta_i and then phi_i."""
    numbers, first = np.unique(samples.incidence, return_index=True)
    order = np.lexsort((samples.phi_i[first], samples.theta_i[first]))
    parts = np.array_split(numbers[order], min(GROUPS, numbers.size))
    return [np.flatnonzero(np.isin(samples.incidence, part)) for part in parts]
