"""The bound that energy conservation puts on the uniform diffuse part of He et al. 1991, section 3.2.3."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.geometry import HALF_PI
from brdfdb.integrals.quadrature import spectral_albedo
from brdfdb.models import MODELS
from brdfdb.models.he_torrance_1991 import checked_surface
from brdfdb.parameters import Floats

Array = NDArray[np.float64]

# Angles of the first search, even in arcsinh(tan theta_i), which is theta_i near 0 and -ln(cos theta_i) near grazing:
# there the reflectance peaks where shadowing begins
_ANGLES = 40
_ROUNDS = 12  # of the search around the largest of them, each of which halves the step: as a rule four are enough


def he_torrance_a_max(
    *,
    wavelength_nm: ArrayLike,
    sigma_0_um: ArrayLike,
    tau_um: ArrayLike,
    n: ArrayLike,
    k: ArrayLike,
    tolerance: float = 1e-6,
) -> Floats:
    """The largest a(lambda) with which `he_torrance` reflects no more than it receives, from any direction.

    Parameters
    ----------
    wavelength_nm, sigma_0_um, tau_um, n, k : array_like
        As in `brdfdb.models.he_torrance`; they broadcast, and are integrated together.
    tolerance : float
        Absolute error of the directional albedo that is allowed, in [1e-13, 1].

    Returns
    -------
    array [1]
        1 less the largest directional-hemispherical reflectance, specular and directional diffuse, of all angles of
        incidence from 0 to 90 degrees; 0 where that is above 1.

    Raises
    ------
    ValueError
        If an argument is outside its range.

    Notes
    -----
    Section 3.2.3: a(lambda) is "a constrained, but otherwise free, parameter. The constraint is based on energy
    conservation and gives an upper bound." A smooth surface reflects everything at grazing: its bound is 0, and any
    a > 0 breaks it. The worst angle is searched in cos theta_i down to a hundredth of sigma_0 / tau, where
    shadowing has taken the specular part away.

    References
    ----------
    he1991 (section 3.2.3)

    Examples
    --------
    >>> ceramic = dict(wavelength_nm=500.0, sigma_0_um=1.45, tau_um=13.2, n=1.7456, k=0.0)
    >>> round(float(he_torrance_a_max(**ceramic)), 3)  # the paper takes 0.9
    0.777
    """
    surface = checked_surface(wavelength_nm, sigma_0_um, tau_um, n, k)
    arrays = np.broadcast_arrays(surface.wavelength_um * 1000.0, surface.sigma_0, surface.tau, surface.n, surface.k)
    names = ("wavelength_nm", "sigma_0_um", "tau_um", "n", "k")
    surfaces = {name: np.ravel(array) for name, array in zip(names, arrays, strict=True)}
    steepest = np.arccosh(1.0 / lowest_cosine(surfaces))
    theta_i = np.append(np.arctan(np.sinh(np.linspace(0.0, steepest, _ANGLES))), HALF_PI)
    reflectance = np.stack([_reflectance(theta, surfaces, tolerance) for theta in theta_i])
    return a_max(theta_i, reflectance, surfaces, tolerance).reshape(arrays[0].shape)[()]


def a_max(theta_i: Array, reflectance: Floats, surfaces: Mapping[str, ArrayLike], tolerance: float) -> Array:
    """`he_torrance_a_max` of surfaces whose reflectance is known at some angles, among which it is searched on.

    Parameters
    ----------
    theta_i : array (angles,) [rad]
        Increasing, up to 90 degrees; the last but one near `lowest_cosine`.
    reflectance : array (angles, surfaces) [1]
        Specular and directional diffuse.
    surfaces : mapping
        wavelength_nm, sigma_0_um, tau_um, n and k; numbers, or arrays of one shape (surfaces,).
    tolerance : float
        As in `he_torrance_a_max`.

    Returns
    -------
    array (surfaces,) [1]
        1 less the largest reflectance, at these angles or between them; 0 where that is above 1.
    """
    below = theta_i < HALF_PI
    peak = _peak(
        np.arcsinh(np.tan(theta_i[below])),
        reflectance[below],
        lambda x: _reflectance(float(np.arctan(np.sinh(x))), surfaces, tolerance),
        tolerance,
    )
    return np.asarray(np.maximum(0.0, 1.0 - np.maximum(peak, reflectance.max(axis=0))))


def lowest_cosine(surfaces: Mapping[str, ArrayLike]) -> float:
    """Of theta_i where a search for the worst angle of the surfaces may end."""
    slope = np.min(np.asarray(surfaces["sigma_0_um"]) / np.asarray(surfaces["tau_um"]))
    return float(np.clip(1e-2 * slope, 1e-9, 1e-3))


def _reflectance(theta_i: float, surfaces: Mapping[str, ArrayLike], tolerance: float) -> Array:
    """Specular and directional diffuse reflectance of all surfaces."""
    spec = MODELS["he_torrance"]
    assert spec.specular is not None
    diffuse, _ = spectral_albedo(spec, theta_i, 0.0, {**surfaces, "a": 0.0}, tolerance=tolerance, mirrored=True)
    return np.asarray(diffuse + spec.specular(theta_i, **surfaces))


def _peak(x: Array, y: Floats, f: Callable[[float], Array], tolerance: float) -> Array:
    """The largest value of each of several functions that are known at increasing x, as y of shape (x, functions).

    The steps around the largest value of a function are halved until the top of the parabola through the highest three
    stays where it is.
    """
    top = _tops(x, y)
    moving = np.ones(top.size, dtype=bool)
    for _ in range(_ROUNDS):
        at = np.unique(np.clip(np.argmax(y[:, moving], axis=0), 1, x.size - 2))
        fresh = np.unique([(x[i + side - 1] + x[i + side]) / 2.0 for i in at for side in (0, 1)])
        x, y = np.append(x, fresh), np.concatenate([y, [f(one) for one in fresh]])
        order = np.argsort(x)
        x, y, before = x[order], y[order], top
        top = _tops(x, y)
        moving &= np.abs(top - before) > tolerance
        if not np.any(moving):
            break
    return top


def _tops(x: Array, y: Floats) -> Array:
    """The highest points of the parabolas through the largest values and their neighbours, not beyond these."""
    middle = np.clip(np.argmax(y, axis=0), 1, x.size - 2)
    each = np.arange(y.shape[1])
    (x0, x1, x2), (y0, y1, y2) = (x[middle + i] for i in (-1, 0, 1)), (y[middle + i, each] for i in (-1, 0, 1))
    rise, fall = (y1 - y0) / (x1 - x0), (y2 - y1) / (x2 - x1)
    bend = (fall - rise) / (x2 - x0)
    # of y1 + s (x - x1) + bend (x - x1)^2, with the slope s at x1
    s = rise + bend * (x1 - x0)
    step = np.divide(-s, 2.0 * bend, out=np.zeros_like(s), where=bend < 0.0)
    inside = np.clip(step, x0 - x1, x2 - x1)
    return np.asarray(np.maximum(y1 + s * inside + bend * inside**2, np.maximum(np.maximum(y0, y1), y2)))
