"""Profiles of Gaussian rough surfaces and the points that light reaches on them, to judge Smith's shadowing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SPACING = 0.05  # distance of points over the autocorrelation length
POINTS = 2**17  # points of a profile, 6554 autocorrelation lengths


def profile(seed: int) -> Array:
    """Return heights over their rms value [1] along a line of a surface with the autocorrelation exp(-r^2 / tau^2).

    The array has POINTS heights, SPACING tau apart. Every cut through a Gaussian isotropic surface is such a line, so
    that the shadows along it are those of the surface.
    """
    rng = np.random.default_rng(seed)
    k = 2.0 * np.pi * np.fft.rfftfreq(POINTS, SPACING)
    # exp(-r^2) has the spectrum exp(-k^2 / 4)
    z = np.fft.irfft((rng.standard_normal(k.size) + 1j * rng.standard_normal(k.size)) * np.exp(-(k**2) / 8.0), POINTS)
    return np.asarray(z / z.std())


def reached(heights: Array, slope: float, theta: float) -> NDArray[np.bool_]:
    """Return whether a direction that leans by theta [rad] to the far end of a profile reaches each of its points.

    `slope` is sigma_0 / tau. A point is reached if no later point stands above the ray through it.
    """
    above = slope * heights - SPACING * np.arange(heights.size) / np.tan(theta)
    return np.asarray(above >= np.maximum.accumulate(above[::-1])[::-1])
