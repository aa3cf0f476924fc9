"""The sum over m of He et al. 1991, eq. 78, in Dr.Jit and float32. Its cost is the same for every g and V.

As rows of `brdfdb.models.he_torrance` do, it reads a table of the sum that `brdfdb.models` computes.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import drjit as dr
import numpy as np

from brdfdb.mitsuba._patches import Array, Axis, Patches
from brdfdb.models._diffraction_series import diffraction_series as exact_series
from brdfdb.models._he_torrance_kernels import variance

# The table holds the logarithm of the sum, plus t = V / (10 + g), over ln(g) and t / (t + 10). Its error is below 1e-6
# where the sum is above 1e-26 of its largest value. Below the least g the sum is its first term, e^-V, and values that
# differ are smaller than 1e-8 of it. Above the largest g it is a function of V / g
_LOG_G_LOW, _LOG_G_HIGH, _OFFSET, _SCALE, _FARTHEST = -18.0, 18.0, 10.0, 10.0, 100.0
_G_LOW, _G_HIGH = math.exp(_LOG_G_LOW), math.exp(_LOG_G_HIGH)
_PATCHES_G, _PATCHES_V = 288, 160
_K_HIGH, _PATCHES_K = 37.0, 256  # range of ln(1 + K)


def diffraction_series(g: Any, V: Any) -> Any:
    """Return the sum [1] of eq. 78 divided by g, as `brdfdb.models._diffraction_series.diffraction_series` does."""
    inside = dr.clip(g, _G_LOW, _G_HIGH)
    beyond = dr.minimum(_G_HIGH / dr.maximum(g, _G_HIGH), 1.0)
    t = dr.minimum(V * beyond / (_OFFSET + inside), _FARTHEST)
    return dr.exp(_table()(dr.log(inside), t / (t + _SCALE)) - t) * dr.square(beyond)


def effective_variance(K: Any) -> Any:
    """Return (sigma / sigma_0)^2 [1] of eqs 80-81 for K = K_i + K_r."""
    return _variances()(dr.log(1.0 + K))


@functools.cache
def _table() -> Patches:
    def logarithm(log_g: Array, share: Array) -> Array:
        g, t = np.exp(log_g), _SCALE * share / (1.0 - share)
        return np.asarray(np.log(exact_series(g, (_OFFSET + g) * t)) + t)

    last = _FARTHEST / (_FARTHEST + _SCALE)
    return Patches(logarithm, Axis(_LOG_G_LOW, _LOG_G_HIGH, _PATCHES_G), Axis(0.0, last, _PATCHES_V))


@functools.cache
def _variances() -> Patches:
    return Patches(lambda log_K: np.asarray(variance(np.expm1(log_K))), Axis(0.0, _K_HIGH, _PATCHES_K))
