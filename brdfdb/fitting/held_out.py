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
from brdfdb.parameters import Floats

GROUPS = 8  # groups of incidences at most; fewer incidences are left out one at a time
_EVALUATIONS = 40


def predicted(fitted: Fitted) -> Floats | None:
    """Return ln(model / sample) (N, C) at incidences that were left out in turn; None if the light has one direction.

    Each search begins where that of all samples ended, and ends at the samples that are left. More than eight
    incidences are left out in groups of neighbours. What is no positive sample, or hidden, is nan.
    """
    samples, surface, view = fitted.samples, fitted.surface, fitted.view
    groups = groups_of(samples)
    if len(groups) < 2:
        return None
    whole = Residual(samples, fitted.problem.residual.kind)
    counts = whole.used.any(axis=1) & ~fitted.hidden
    errors = np.full(samples.values.shape, np.nan)
    for rows in groups:
        kept = counts.copy()
        kept[rows] = False
        if not kept.any():
            continue
        some = np.flatnonzero(kept)
        part = Problem(surface, view.selected(some), whole.selected(some))
        part.scale = fitted.problem.scale
        end = part.descend(fitted.point.x[part.free], _EVALUATIONS)
        errors[rows] = logarithms(samples.selected(rows), surface.f_r(end.x, end.values, view.selected(rows)))
    errors[fitted.hidden] = np.nan
    return errors


def held_out(samples: Samples, errors: Floats | None, outliers: NDArray[np.bool_]) -> HeldOut | None:
    """Return the error at incidences that were left out, less outliers (N, C); None if nothing was predicted."""
    if errors is None:
        return None
    counts = np.isfinite(errors) & ~outliers
    groups = [rows for rows in groups_of(samples) if counts[rows].any()]
    if not groups:
        return None
    together = errors[counts]
    return HeldOut(
        theta_i_deg=[np.unique(np.round(degrees(samples.theta_i[rows]), 3)).tolist() for rows in groups],
        rms_ln=[float(np.sqrt(np.mean(errors[rows][counts[rows]] ** 2))) for rows in groups],
        rms=float(np.sqrt(np.mean(together**2))),
        median=float(np.median(np.abs(together))),
    )


def groups_of(samples: Samples) -> list[NDArray[np.int64]]:
    """Return the rows of each incidence, or of groups of neighbouring ones, by theta_i and then phi_i."""
    numbers, first = np.unique(samples.incidence, return_index=True)
    order = np.lexsort((samples.phi_i[first], samples.theta_i[first]))
    parts = np.array_split(numbers[order], min(GROUPS, numbers.size))
    return [np.flatnonzero(np.isin(samples.incidence, part)) for part in parts]
