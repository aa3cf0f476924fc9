"""Pfisterer 2011: the ABg model, which programs for stray light fit to measured scatter."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from brdfdb.lobes import Lobe
from brdfdb.models import _stray_light
from brdfdb.models._stray_light import ABG, by_angles, by_vectors
from brdfdb.models.large_calls import for_large_calls
from brdfdb.parameters import Floats, ModelSpec, Parameter

A = Parameter("a", "A", "1/sr", 0.0, 1.0, "level: f_r in the mirror direction is a / b")
B = Parameter("b", "B", "1", 1e-8, 10.0, "the profile bends at the distance b^(1 / g) from the mirror direction")
G = Parameter("g", "g", "1", 0.5, 6.0, "the profile falls as distance^-g")


@for_large_calls
def abg(
    theta_i: ArrayLike,
    phi_i: ArrayLike,
    theta_r: ArrayLike,
    phi_r: ArrayLike,
    *,
    a: ArrayLike,
    b: ArrayLike,
    g: ArrayLike,
) -> Floats:
    """Return the BRDF [1/sr] of the ABg model of scatter, A / (B + x^g).

    Parameters
    ----------
    theta_i, phi_i, theta_r, phi_r : array_like [rad]
        Directions of light (i) and viewer (r), pointing away from the surface; theta in [0, pi].
    a : array_like [1/sr]
        Level, in [0, 1]. In the mirror direction f_r is a / b.
    b : array_like [1]
        In [1e-8, 10]. The profile bends at the distance x = b^(1 / g).
    g : array_like [1]
        Exponent, in [0.5, 6]. Polished surfaces have 1 to 2.5.

    Returns
    -------
    array [1/sr]
        In the broadcast shape of all arguments; 0 below the horizon, nan where an angle is nan.

    Raises
    ------
    ParameterError
        If an argument is outside its range.

    Notes
    -----
    x is the distance of beta, the horizontal part of the viewer's unit vector, from beta_0, that of the mirror
    direction: x = abs(beta - beta_0). So f_r is a function of sines, the same at any angle of incidence. The specular
    reflection itself is not a part of it. Programs allow g = 0, which is `lambert` with rho = pi a / (b + 1). The light
    scattered at normal incidence is pi a ln(1 + 1 / b) for g = 2.

    References
    ----------
    pfisterer2011, fest2013

    Examples
    --------
    >>> import numpy as np
    >>> round(float(abg(0.3, 0.0, 0.31, np.pi, a=0.0025, b=0.001, g=1.8)), 4)
    2.0314
    """
    return by_angles(ABG, (theta_i, phi_i, theta_r, phi_r), _checked(a, b, g))


@for_large_calls
def abg_vectors(wi: ArrayLike, wr: ArrayLike, *, a: ArrayLike, b: ArrayLike, g: ArrayLike) -> Floats:
    """Return `abg` [1/sr] for unit vectors `wi` (light) and `wr` (viewer) of shape (..., 3)."""
    return by_vectors(ABG, wi, wr, _checked(a, b, g))


def _checked(a: ArrayLike, b: ArrayLike, g: ArrayLike) -> tuple[Floats, Floats, Floats]:
    return A.check(a), B.check(b), G.check(g)


def lobe(cos_i: Floats, *, b: ArrayLike, g: ArrayLike, **_: ArrayLike) -> Lobe:
    """Return a lobe as wide as the distance at which the profile bends."""
    return _stray_light.lobe(cos_i, np.asarray(b, np.float64) ** (1.0 / np.asarray(g, np.float64)))


SPEC = ModelSpec(
    name="abg",
    version=1,
    title="ABg scatter",
    equation="A / (B + x^g)",
    reference="pfisterer2011",
    parameters=(A, B, G),
    evaluate=abg,
    vectors=abg_vectors,
    grazing_power=0.0,
    lobe=lobe,
    excess="Pfisterer 2011: a fit to measured scatter, not normalised; a may be so large that more light is scattered "
    "than arrives",
)
