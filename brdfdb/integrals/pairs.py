"""Nodes over all pairs of directions, with cosine weights: quadrature that follows the lobe of each viewer."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from brdfdb.gauss import gauss_rule
from brdfdb.geometry import HALF_PI, unit_vector
from brdfdb.integrals.quadrature import mirrored_on_rays
from brdfdb.lobes import Lobe
from brdfdb.parameters import Array

# The least and the largest width [1] that nodes follow: lobes beyond count as these. A diffuse f_r has the latter
WIDTHS = 1e-5, 0.5


class Counts(NamedTuple):
    """Numbers of nodes: viewers over theta, and over a quarter turn; lights along a ray, and over a quarter turn."""

    theta: int
    phi: int
    ray: int
    turn: int

    def finer(self, times: float) -> Counts:
        """Return counts that are larger by a factor."""
        return Counts(*(int(np.ceil(times * count)) for count in self))


class Symmetry(NamedTuple):
    """Symmetry of f_r: anisotropic or not, and elliptical, about the x and the y axis."""

    anisotropic: bool
    elliptical: bool


class View(NamedTuple):
    """A viewer at theta, phi [rad], and lights that follow the lobe around its mirror direction.

    `wr` (3,) and `wi` (N, 3) are unit vectors. `weight` [sr] is cos theta_r times the solid angle of the viewer: its
    sum over all viewers is pi. `weights` (N,) [sr] are cos theta_i times those of the lights: their sum is close to pi.
    """

    theta: float
    phi: float
    weight: float
    wr: Array
    wi: Array
    weights: Array


def views(lobe: Callable[[Array], Lobe | None], counts: Counts, symmetry: Symmetry) -> Iterator[View]:
    """Yield viewers over the hemisphere, each with lights over the hemisphere.

    The sum of weight * weights * f_r over all of them is the integral of f_r cos theta_i cos theta_r over both
    hemispheres, pi times the mean albedo. ``lobe(cos)`` gives the lobe of f_r for directions with that cosine, None for
    a diffuse f_r; its widths may be arrays over the wavelength, of which the narrowest counts.

    Notes
    -----
    Viewers: Gauss's rule over theta_r. An anisotropic f_r has equal steps of phi_r, whose sum converges as fast for a
    periodic function; one quarter turn serves an ellipse. Lights: the rays of
    `brdfdb.integrals.quadrature.mirrored_on_rays`, which are stretched so that the lobe and each octave beyond it have
    nodes. An isotropic f_r is the same on both sides of the plane of incidence.
    """
    thetas, steps = gauss_rule(counts.theta).on(0.0, HALF_PI)
    quarters = 4 if symmetry.anisotropic and not symmetry.elliptical else 1
    around = quarters * counts.phi if symmetry.anisotropic else 1
    phis = (np.arange(around) + 0.5) * (quarters * HALF_PI / around) if symmetry.anisotropic else np.zeros(1)
    for theta, step in zip(thetas.tolist(), steps.tolist(), strict=True):
        weight = np.cos(theta) * np.sin(theta) * step * 2.0 * np.pi / around
        for phi in phis.tolist():
            yield view_of(lobe, theta, phi, counts, symmetry, weight)


def view_of(
    lobe: Callable[[Array], Lobe | None],
    theta: float,
    phi: float,
    counts: Counts,
    symmetry: Symmetry,
    weight: float = 1.0,
) -> View:
    """Return one viewer at theta, phi [rad] with its lights; the arguments are those of `views`."""
    wr = unit_vector(theta, phi)
    around = lobe(wr[2])
    alpha_x = alpha_y = WIDTHS[1]
    if around is not None:
        alpha_x, alpha_y = (float(np.clip(np.min(alpha), *WIDTHS)) for alpha in (around.alpha_x, around.alpha_y))
    x, of_x = gauss_rule(counts.ray).on(0.0, 1.0)
    across = np.arctan2(alpha_x * wr[0], -alpha_y * wr[1]) if theta > 0.0 else HALF_PI
    quarters = 4 if symmetry.anisotropic else 2
    quarter = gauss_rule(counts.turn).on(0.0, HALF_PI)
    first = across + HALF_PI  # a psi in the plane of incidence
    psi = np.concatenate([first + HALF_PI * number + quarter.nodes for number in range(quarters)])
    of_psi = np.tile(quarter.weights, quarters) * (4 / quarters)
    wi, measure = mirrored_on_rays((wr[0], wr[1], wr[2]), alpha_x, alpha_y, x[:, np.newaxis], psi)
    weights = measure * np.maximum(wi[..., 2], 0.0) * of_x[:, np.newaxis] * of_psi
    return View(theta, phi, float(weight), wr, wi.reshape(-1, 3), weights.reshape(-1))
