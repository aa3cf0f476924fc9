"""Scatter of polished surfaces around the mirror direction: two profiles over the distance of projected directions."""

from __future__ import annotations

from operator import attrgetter

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb._elementary import exp, log
from brdfdb._numba import inner_loop, kernel, loop
from brdfdb.lobes import GGX, Lobe
from brdfdb.models._rows import RowLoops
from brdfdb.parameters import Floats

Rows = NDArray[np.float64]

_ABG, _HARVEY = range(2)

_TINY = 1e-290  # guard against the logarithm of 0 in the mirror direction
_SHARE = 0.5  # share of samples in the lobe: the tails of most profiles are wider
_NARROWEST, _WIDEST = 1e-6, 2.0  # widths of the slopes for samplers


@kernel
def _profile(form: int, x2: float, first: float, second: float, third: float) -> float:
    """Return f_r [1/sr] at a squared distance x2 between the horizontal parts of viewer and mirror direction."""
    if form == _ABG:
        # A / (B + x^g)
        positive = _TINY if x2 < _TINY else x2
        return first / (second + exp(0.5 * third * log(positive)))
    # b_0 (1 + (x / L)^2)^(s / 2)
    return first * exp(0.5 * third * log(1.0 + x2 / (second * second)))


@inner_loop
def _angle_rows(form: int, x_r: Rows, y_r: Rows, scalars: Rows, f_r: Rows) -> None:
    for row in range(f_r.shape[0]):
        s, f = scalars[:, row], f_r[row]
        x_i, y_i, first, second, third = s[0], s[1], s[2], s[3], s[4]
        r_x, r_y = x_r[min(row, x_r.shape[0] - 1)], y_r[min(row, y_r.shape[0] - 1)]
        for j in range(f.shape[0]):
            # The mirror direction has the horizontal part -(x_i, y_i). Both parts are rounded alike, so that light and
            # viewer may be exchanged
            x, y = x_i + r_x[j], y_i + r_y[j]
            f[j] = _profile(form, x * x + y * y, first, second, third)


@inner_loop
def _vector_rows(form: int, w_i: Floats, w_r: Floats, scalars: Rows, f_r: Floats) -> None:
    for row in range(f_r.shape[0]):
        s, f = scalars[row], f_r[row]
        first, second, third = s[0], s[1], s[2]
        v, w = w_i[min(row, w_i.shape[0] - 1)].reshape(-1), w_r[min(row, w_r.shape[0] - 1)].reshape(-1)
        for j in range(f.shape[0]):
            z_i, z_r = np.float64(v[3 * j + 2]), np.float64(w[3 * j + 2])
            x, y = np.float64(v[3 * j]) + w[3 * j], np.float64(v[3 * j + 1]) + w[3 * j + 1]
            x2 = x * x + y * y
            value = _profile(form, x2, first, second, third)
            nothing = 0.0 * (x2 + z_i + z_r)  # 0, or nan
            f[j] = nothing + (0.0 if z_i < 0.0 or z_r < 0.0 else value)


def _loops(form: int) -> RowLoops:
    """Return loops of a form. The form is a constant to them, so they have no branch, and vectorise."""

    @loop
    def by_angles(x_r: Rows, y_r: Rows, scalars: Rows, f_r: Rows) -> None:
        _angle_rows(form, x_r, y_r, scalars, f_r)

    @loop
    def by_vectors(w_i: Floats, w_r: Floats, scalars: Rows, f_r: Floats) -> None:
        _vector_rows(form, w_i, w_r, scalars, f_r)

    return RowLoops(by_angles, by_vectors, attrgetter("x_r", "y_r"), attrgetter("x_i", "y_i"), of_viewers=True)


ABG_LOOPS = _loops(_ABG)
HARVEY_LOOPS = _loops(_HARVEY)


def lobe(cos_i: Floats, knee: ArrayLike) -> Lobe:
    """Return a lobe as wide as the knee of the profile [1], with half of the samples.

    At the mirror direction the slope of the half vector is the distance over 2 cos_i.
    """
    width = np.asarray(knee, np.float64) / (2.0 * np.maximum(cos_i, _NARROWEST))
    alpha = np.clip(width, _NARROWEST, _WIDEST)
    return Lobe(np.full(np.shape(alpha), _SHARE), alpha, alpha, GGX)
