"""Lobes: the distribution of facet slopes that samplers, quadratures and audits look for around a mirror direction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]

_EXPONENT = 700.0  # beyond this t^2 the Gaussian counts as 0: no half vector is drawn there


@dataclass(frozen=True)
class SlopeDistribution:
    """A distribution of the slopes of half vectors, in widths of the lobe.

    The slopes are s = t (alpha_x cos psi, alpha_y sin psi), with psi uniform in the circle. A distribution is that of t
    alone. Its scale is t = 1: quadratures resolve that, and octaves of t beyond it.

    Attributes
    ----------
    name : str
        A word for it.
    radius : callable
        ``radius(u)``: the t that a share u of half vectors exceeds, for u in (0, 1]. Random numbers u in, t out.
    density : callable
        ``density(t2)``: probability density [1] of the square of t at t2 >= 0. It integrates to 1 over t2.
    """

    name: str
    radius: Callable[[Array], Array]
    density: Callable[[Array], Array]


def _gaussian_radius(u: Array) -> Array:
    # Ward 1992, eq. (7a), as the tangent of delta
    return np.asarray(np.sqrt(-np.log(u)))


def _gaussian_density(t2: Array) -> Array:
    return np.asarray(np.where(t2 > _EXPONENT, 0.0, np.exp(-t2)))


GAUSSIAN = SlopeDistribution("Gaussian", _gaussian_radius, _gaussian_density)


class Lobe(NamedTuple):
    """The lobe of a model: what samplers and quadratures look for, not a part of the model's value.

    Attributes
    ----------
    share : array [1]
        Approximate part of the reflected light that lies in the lobe around the mirror direction, in [0, 1]. The rest
        is looked for over the whole hemisphere: a model with wider tails than its distribution leaves a tenth to that,
        or more.
    alpha_x, alpha_y : array [1]
        Widths of the slopes of half vectors along x and y.
    distribution : SlopeDistribution
        Slopes in these widths. A Gaussian has the density exp(-(s_x / alpha_x)^2 - (s_y / alpha_y)^2).
    """

    share: Array
    alpha_x: Array
    alpha_y: Array
    distribution: SlopeDistribution = GAUSSIAN
