"""The bound that energy conservation sets on the uniform part of a model that leaves it free."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from brdfdb.arrays import array_function
from brdfdb.errors import ParameterError
from brdfdb.geometry import HALF_PI
from brdfdb.integrals.quadrature import named, spec_of, spectral_albedo
from brdfdb.parameters import Array, Floats, ModelSpec

# Angles of the first search are even in arcsinh(tan theta_i), which is theta_i near 0 and -ln(cos theta_i) near
# grazing. The reflectance near grazing has its peak where shadowing begins
_ANGLES = 40
_ROUNDS = 12  # rounds of the search around the largest value; each halves the step, and four are often enough


@array_function
def largest_uniform(model: ModelSpec | str, *, tolerance: float = 1e-6, **parameters: ArrayLike) -> Floats:
    """Return the largest albedo [1] of the uniform part with which a model reflects no more than it receives.

    It is 1 less the largest directional-hemispherical reflectance, specular and directional diffuse, over all angles of
    incidence from 0 to 90 degrees, and 0 where that reflectance is above 1.

    Parameters
    ----------
    model : ModelSpec or str
        An isotropic model that leaves its uniform part free (`ModelSpec.uniform_bound_cosine`), or its name.
    tolerance : float
        Absolute error of the directional albedo, in [1e-13, 1].
    **parameters : array_like
        Parameters of the model except the uniform part. They broadcast, and are integrated together.

    Raises
    ------
    ParameterError
        If an argument is outside its range, or energy does not bound the uniform part of the model.

    Notes
    -----
    He et al. 1991, section 3.2.3: a(lambda) is "a constrained, but otherwise free, parameter. The constraint is based
    on energy conservation and gives an upper bound." A smooth surface reflects everything at grazing. Its bound is 0,
    and any a > 0 violates it.

    References
    ----------
    he1991 (section 3.2.3)

    Examples
    --------
    >>> ceramic = dict(wavelength_nm=500.0, sigma_0_um=1.45, tau_um=13.2, n=1.7456, k=0.0)
    >>> round(float(largest_uniform("he_torrance", **ceramic)), 3)  # the paper takes 0.9
    0.777
    """
    spec = spec_of(model)
    if spec.uniform_bound_cosine is None or spec.uniform is None:
        raise ParameterError("model", f"{spec.name!r} has no uniform part that only energy conservation bounds")
    given = named(spec, dict(**parameters, **{spec.uniform: 0.0}))
    normal = np.array([0.0, 0.0, 1.0])
    spec.vectors(normal, normal, **given)  # checks the parameters
    del given[spec.uniform]
    arrays = np.broadcast_arrays(*(np.asarray(value, dtype=np.float64) for value in given.values()))
    surfaces = {name: np.ravel(array) for name, array in zip(given, arrays, strict=True)}
    steepest = np.arccosh(1.0 / spec.uniform_bound_cosine(surfaces))
    theta_i = np.append(np.arctan(np.sinh(np.linspace(0.0, steepest, _ANGLES))), HALF_PI)
    reflectance = _reflectance(spec, theta_i, surfaces, tolerance)
    return largest_uniform_beside(spec, theta_i, reflectance, surfaces, tolerance).reshape(arrays[0].shape)[()]


def largest_uniform_beside(
    spec: ModelSpec, theta_i: Array, reflectance: Floats, surfaces: Mapping[str, ArrayLike], tolerance: float
) -> Array:
    """Return `largest_uniform` [1], shape (surfaces,), of surfaces whose reflectance is known at some angles.

    Angles between the known ones are searched for a larger reflectance. `theta_i` (angles,) [rad] increases up to 90
    degrees; `reflectance` (angles, surfaces) [1] is specular and directional diffuse; `surfaces` are the arguments of
    the model except the uniform part: numbers, or arrays of one shape (surfaces,).
    """
    below = theta_i < HALF_PI
    peak = _peak(
        np.arcsinh(np.tan(theta_i[below])),
        reflectance[below],
        lambda x: _reflectance(spec, np.arctan(np.sinh(x)), surfaces, tolerance),
        tolerance,
    )
    return np.asarray(np.maximum(0.0, 1.0 - np.maximum(peak, reflectance.max(axis=0))))


def _reflectance(spec: ModelSpec, theta_i: Array, surfaces: Mapping[str, ArrayLike], tolerance: float) -> Array:
    """Return the reflectance (angles, surfaces) [1], specular and directional diffuse."""
    assert spec.uniform is not None
    arguments = {**surfaces, spec.uniform: 0.0}
    diffuse, _ = spectral_albedo(spec, theta_i, 0.0, arguments, tolerance=tolerance, mirrored=True)
    if spec.specular is None:
        return np.asarray(diffuse)
    given = {name: surfaces[name] for name in spec.specular_parameters}
    return np.asarray(diffuse + spec.specular(theta_i[:, np.newaxis], **given))


def _peak(x: Array, y: Floats, f: Callable[[Array], Array], tolerance: float) -> Array:
    """Return the largest value of each function, whose values y (x, functions) are known at increasing x.

    The steps around the largest value of a function are halved until the top of the parabola through the three highest
    values no longer moves.
    """
    top = tops(x, y)
    moving = np.ones(top.size, dtype=bool)
    for _ in range(_ROUNDS):
        at = np.unique(np.clip(np.argmax(y[:, moving], axis=0), 1, x.size - 2))
        fresh = np.unique([(x[i + side - 1] + x[i + side]) / 2.0 for i in at for side in (0, 1)])
        x = np.append(x, fresh)
        order = np.argsort(x)
        x = x[order]
        y = np.concatenate([y, f(fresh)])[order]
        before = top
        top = tops(x, y)
        moving &= np.abs(top - before) > tolerance
        if not np.any(moving):
            break
    return top


def tops(x: Array, y: Floats) -> Array:
    """Return the tops of the parabolas through the largest values and their neighbours, between these neighbours."""
    middle = np.clip(np.argmax(y, axis=0), 1, x.size - 2)
    column = np.arange(y.shape[1])
    (x0, x1, x2) = (x[middle + i] for i in (-1, 0, 1))
    (y0, y1, y2) = (y[middle + i, column] for i in (-1, 0, 1))
    rise = (y1 - y0) / (x1 - x0)
    fall = (y2 - y1) / (x2 - x1)
    bend = (fall - rise) / (x2 - x0)
    # The parabola is y1 + s (x - x1) + bend (x - x1)^2, with the slope s at x1
    s = rise + bend * (x1 - x0)
    step = np.divide(-s, 2.0 * bend, out=np.zeros_like(s), where=bend < 0.0)
    inside = np.clip(step, x0 - x1, x2 - x1)
    return np.asarray(np.maximum(y1 + s * inside + bend * inside**2, np.maximum(np.maximum(y0, y1), y2)))
