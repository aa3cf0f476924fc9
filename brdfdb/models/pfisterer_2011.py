"""Pfisterer 2011: the ABg model, which programs for stray light fit to measured scatter."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from brdfdb.geometry import Directions
from brdfdb.lobes import Lobe
from brdfdb.models import _stray_light
from brdfdb.models._rows import Out
from brdfdb.models.declaration import DeclaredModel
from brdfdb.parameters import Floats, Parameter

A = Parameter("a", "A", "1/sr", 0.0, 1.0, "level: f_r in the mirror direction is a / b")
B = Parameter("b", "B", "1", 1e-8, 10.0, "the profile bends at the distance b^(1 / g) from the mirror direction")
G = Parameter("g", "g", "1", 0.5, 6.0, "the profile falls as distance^-g")


def lobe(cos_i: Floats, *, b: ArrayLike, g: ArrayLike, **_: ArrayLike) -> Lobe:
    """Return a lobe as wide as the distance at which the profile bends."""
    return _stray_light.lobe(cos_i, np.asarray(b, np.float64) ** (1.0 / np.asarray(g, np.float64)))


@DeclaredModel(
    title="ABg scatter",
    equation="A / (B + x^g)",
    references="pfisterer2011, fest2013",
    parameters=(A, B, G),
    grazing_power=0.0,
    lobe=lobe,
    excess="Pfisterer 2011: a fit to measured scatter, not normalised; a may be so large that more light is scattered "
    "than arrives",
)
def abg(directions: Directions, out: Out, *parameters: Floats) -> Floats:
    """Return the BRDF [1/sr] of the ABg model of scatter, A / (B + x^g).

    x is the distance of beta, the horizontal part of the viewer's unit vector, from beta_0, that of the mirror
    direction: x = abs(beta - beta_0). So f_r is a function of sines, the same at any angle of incidence. The specular
    reflection itself is not a part of it. Programs allow g = 0, which is `lambert` with rho = pi a / (b + 1). The light
    scattered at normal incidence is pi a ln(1 + 1 / b) for g = 2. Polished surfaces have a g of 1 to 2.5.

    >>> round(float(abg(0.3, 0.0, 0.31, np.pi, a=0.0025, b=0.001, g=1.8)), 4)
    2.0314
    """
    return _stray_light.ABG_LOOPS.evaluated(directions, out, parameters)
