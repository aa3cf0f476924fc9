"""Profiles of Gaussian rough surfaces, and which of their points light reaches: a judge of shadowing by Smith."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SPACING = 0.05  # of points, over the autocorrelation length
POINTS = 2**17  # 6554 autocorrelation lengths


def profile(seed: int) -> Array:
    """Return heights over their rms value [1] along a line of a surface with the autocorrelation exp(-r^2 / tau^2).

    The array has POINTS heights, SPACING tau apart. A cut through a surface that is Gaussian and isotropic is such a
    line in every direction, so that shadows along it are those of the surface.
    """
    rng = np.random.default_rng(seed)
    k = 2.0 * np.pi * np.fft.rfftfreq(POINTS, SPACING)
    # the spectrum of exp(-r^2): exp(-k^2 / 4)
    z = np.fft.irfft((rng.standard_normal(k.size) + 1j * rng.standard_normal(k.size)) * np.exp(-(k**2) / 8.0), POINTS)
    return np.asarray(z / z.std())


def reached(heights: Array, slope: float, theta: float) -> NDArray[np.bool_]:
    """Return which points of a profile a direction reaches that leans by theta [rad] to its far end.

    `slope` is sigma_0 / tau. A point is reached where no later one stands higher than the ray through it.
    """
    above = slope * heights - SPACING * np.arange(heights.size) / np.tan(theta)
    return np.asarray(above >= np.maximum.accumulate(above[::-1])[::-1])
