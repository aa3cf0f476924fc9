"""The error of a fit at incidences that it did not see."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from brdfdb.fitting.document import HeldOut
from brdfdb.fitting.fitted import Fitted
from brdfdb.fitting.problem import Problem
from brdfdb.fitting.residuals import Residual, logarithms
from brdfdb.geometry import degrees
from brdfdb.measurements import Samples

GROUPS = 8  # groups of incidences at most; fewer incidences are left out one at a time
_EVALUATIONS = 40


def held_out(fitted: Fitted) -> HeldOut | None:
    """Return the error at incidences that were left out in turn; None if the light has one direction.

    Each search begins where that of all samples ended, and ends at the samples that are left. More than eight
    incidences are left out in groups of neighbours.
    """
    samples, surface, view = fitted.samples, fitted.surface, fitted.view
    groups = groups_of(samples)
    if len(groups) < 2:
        return None
    whole = Residual(samples, fitted.problem.residual.kind)
    counts = whole.used.any(axis=1) & ~fitted.hidden
    angles, errors = [], []
    for rows in groups:
        kept = counts.copy()
        kept[rows] = False
        if not kept.any():
            continue
        some = np.flatnonzero(kept)
        part = Problem(surface, view.selected(some), whole.selected(some))
        part.scale = fitted.problem.scale
        end = part.descend(fitted.point.x[part.free], _EVALUATIONS)
        difference = logarithms(samples.selected(rows), surface.f_r(end.x, end.values, view.selected(rows)))
        difference = difference[np.isfinite(difference) & ~fitted.hidden[rows, np.newaxis]]
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
