"""The rule of residuals: estimates of many values at once, against what they should be."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

ROUNDING = 1e-9  # of the largest value: below it, values are equal
DIM = 0.01  # of the peak: what is below it is dim
DRAWS = 999  # random signs that tell how large chi-square is by chance


class Residuals(NamedTuple):
    """Distances of the means of estimates from expected values, in standard errors."""

    relative_error: float  # largest standard error, where the value exceeds a hundredth of its peak [1]
    dim_error: float  # the same where it does not, but is not 0 [1]
    within_three: float  # share of residuals within three standard errors [1]
    chi_square: float  # mean of squared residuals [1]
    p: float  # share of random signs with a chi-square as large [1]

    @property
    def agree(self) -> bool:
        """True if 99 % are within three standard errors, and chi-square is no larger than by chance."""
        return self.within_three >= 0.99 and self.p > 1e-3


def residuals(
    estimates: Sequence[NDArray[np.float64]] | NDArray[np.float64],
    expected: NDArray[np.float64] | float,
    scale: NDArray[np.float64] | None = None,
) -> Residuals:
    """Return the residuals of independent estimates (M, ...) of expected values (...).

    Errors are relative to the expected values, or to `scale` if these are differences.

    Values of an estimate share their light paths, so that the sum of squares has not the chi-square distribution of
    independent values. Its distribution is that of the same deviations with a random sign for each estimate.
    """
    values = np.reshape(np.asarray(estimates), (len(estimates), -1))
    expected = np.broadcast_to(expected, np.shape(estimates)[1:]).reshape(-1)
    of = expected if scale is None else np.ravel(scale)
    count = len(values)
    deviations = values - expected
    floor = ROUNDING * float(of.max())
    squares = np.sum(deviations**2, axis=0)

    def z(signs: NDArray[np.float64]) -> NDArray[np.float64]:
        mean = signs @ deviations / count
        variance = np.maximum(squares - count * mean**2, 0.0) / (count - 1) / count
        return mean / np.sqrt(variance + floor**2)

    of_signs = np.random.default_rng(0).choice([-1.0, 1.0], (DRAWS, count))
    residual = z(np.ones(count))
    chi_square = float(np.mean(residual**2))
    by_chance = sum(float(np.mean(z(signs) ** 2)) >= chi_square for signs in of_signs)
    error = values.std(axis=0, ddof=1) / np.sqrt(count)
    bright = of > DIM * float(of.max())
    dim = (of > 0.0) & ~bright
    return Residuals(
        float(np.max(error[bright] / of[bright], initial=0.0)),
        float(np.max(error[dim] / of[dim], initial=0.0)),
        float(np.mean(np.abs(residual) <= 3.0)),
        chi_square,
        (1 + by_chance) / (1 + DRAWS),
    )
