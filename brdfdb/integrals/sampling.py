"""Importance sampling of every model: directions that follow its lobe, their density, and the weights that make up."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brdfdb.errors import ParameterError
from brdfdb.geometry import checked_vectors
from brdfdb.integrals.quadrature import named, spec_of
from brdfdb.lobes import Lobe
from brdfdb.parameters import Floats, ModelSpec

Array = NDArray[np.float64]

_TINY = 1e-300  # u of 0 is read as this: its logarithm is finite
DIFFUSE = Lobe(np.asarray(0.0), np.asarray(1.0), np.asarray(1.0))


class Sample(NamedTuple):
    """Directions drawn for a light.

    `wr` are unit vectors of shape (..., 3), some below the horizon; `pdf` [1/sr] is their density over the sphere;
    `weight` [1] is f_r cos theta_r / pdf, 0 below the horizon: its mean is the albedo.
    """

    wr: Array
    pdf: Array
    weight: Array


def sample(model: ModelSpec | str, u1: ArrayLike, u2: ArrayLike, wi: ArrayLike, **parameters: ArrayLike) -> Sample:
    """Draw a viewer (or, what reciprocity makes the same, the next light of a path) for each light `wi`.

    Parameters
    ----------
    model : ModelSpec or str
        A model, or its name in `brdfdb.models.MODELS`.
    u1, u2 : array_like
        Uniform random numbers in [0, 1]; points that are stratified give directions that are.
    wi : array_like
        Unit vectors of the light, of shape (..., 3).
    **parameters : array_like
        Those of the model; they broadcast with u1, u2 and the vectors.

    Returns
    -------
    Sample
        (wr, pdf, weight), float64, in the broadcast shape of all arguments. nan where an argument is; the weight of a
        light below the horizon is 0.

    Raises
    ------
    ValueError
        If an argument is outside its range.

    Notes
    -----
    With the probability that the model's `lobe` gives, a half vector is drawn from a Gaussian of slopes, Ward's eq. 7
    with tan(delta) in (7a), which is printed without its arctan, and the light is mirrored in it; else a direction
    with a density of cos theta_r / pi. u1 chooses, and is stretched to serve again. Directions that a lobe throws below
    the horizon are kept, with a weight of 0: they are a part of the density. Ward's samples are not "uniformly
    weighted": the weights are those of `Sample`.
    The specular part of a model is not drawn: add `spec.specular` in the mirror direction.

    References
    ----------
    ward1992

    Examples
    --------
    >>> drawn = sample("lambert", 0.3, 0.7, [0.0, 0.0, 1.0], rho=0.5)
    >>> round(float(drawn.weight), 12)
    0.5
    """
    spec = spec_of(model)
    parameters = named(spec, parameters)
    v1, v2 = _uniform("u1", u1), _uniform("u2", u2)
    i = checked_vectors(wi, wi).w_i.astype(np.float64)
    lobe = lobe_of(spec, i, parameters)
    wr = directions(lobe, v1, v2, i)
    with np.errstate(all="ignore"):  # samples reach every corner; what is finite is tested, not flagged
        f_r = spec.vectors(i, wr, **parameters)
    wr = np.broadcast_to(wr, (*np.shape(f_r), 3)).copy()  # a lobe or none: parameters shape the result
    wr[np.isnan(f_r)] = np.nan
    density = mixture_density(lobe, i, wr)
    reflected = f_r * np.maximum(wr[..., 2], 0.0)
    # a density that has vanished leaves a direction that nothing draws
    weight = np.divide(reflected, density, where=density != 0.0, out=np.zeros(np.shape(density)))
    return Sample(wr, density[()], weight[()])


def pdf(model: ModelSpec | str, wi: ArrayLike, wr: ArrayLike, **parameters: ArrayLike) -> Floats:
    """Return the density [1/sr] with which `sample` draws `wr` for the light `wi`.

    Parameters
    ----------
    model : ModelSpec or str
        A model, or its name in `brdfdb.models.MODELS`.
    wi, wr : array_like
        Unit vectors, of shape (..., 3), `wr` anywhere on the sphere.
    **parameters : array_like
        Those of the model; they broadcast with the vectors.

    Returns
    -------
    array [1/sr]
        In the broadcast shape of all arguments; over the sphere it integrates to 1.

    Raises
    ------
    ValueError
        If an argument is outside its range.

    Examples
    --------
    >>> round(float(pdf("lambert", [0.0, 0.0, 1.0], [0.0, 0.0, 1.0], rho=0.5)), 6)
    0.31831
    """
    vectors = checked_vectors(wi, wr)
    i, r = vectors.w_i.astype(np.float64), vectors.w_r.astype(np.float64)
    spec = spec_of(model)
    parameters = named(spec, parameters)
    density = mixture_density(lobe_of(spec, i, parameters), i, r) + 0.0 * (i + r).sum(axis=-1)  # nan goes through
    shape = np.broadcast_shapes(density.shape, *(np.shape(value) for value in parameters.values()))
    return np.broadcast_to(density, shape).copy()[()]


def lobe_of(spec: ModelSpec, i: Array, parameters: Mapping[str, ArrayLike]) -> Lobe:
    """Return the lobe of a model for lights `i`; for a diffuse model, a lobe that has no share."""
    for parameter in spec.parameters:
        if parameter.name in parameters:
            parameter.check(parameters[parameter.name])
    return DIFFUSE if spec.lobe is None else spec.lobe(i[..., 2], **parameters)


def _uniform(name: str, u: ArrayLike) -> Array:
    array = np.asarray(u)
    if array.dtype.kind not in "iuf":
        raise ParameterError(name, f"{u!r} is not a number in [0, 1]")
    array = array.astype(np.float64)
    bad = (array < 0.0) | (array > 1.0)
    if np.any(bad):
        raise ParameterError(name, f"{array[bad].flat[0]:.9g} is outside [0, 1]", float(array[bad].flat[0]), (0.0, 1.0))
    return array


def directions(lobe: Lobe, u1: Array, u2: Array, i: Array) -> Array:
    """Return directions (..., 3) with the density `mixture_density`: u1 selects lobe or cosine, and is rescaled."""
    in_lobe = (u1 < lobe.share) | (lobe.share >= 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):  # of the component that is not taken
        stretched = np.where(in_lobe, u1 / lobe.share, (u1 - lobe.share) / (1.0 - lobe.share))
    angle = 2.0 * np.pi * u2
    mirrored = mirrored_in_lobe(np.clip(stretched, _TINY, 1.0), angle, i, lobe)
    return np.where(in_lobe[..., np.newaxis], mirrored, _cosine_weighted(np.clip(stretched, 0.0, 1.0), angle))


def mirrored_in_lobe(u1: Array, angle: Array, i: Array, lobe: Lobe) -> Array:
    """Return the light (..., 3) mirrored in half vectors whose slopes follow the distribution of the lobe."""
    radius = lobe.distribution.radius(u1)
    s_x, s_y = radius * lobe.alpha_x * np.cos(angle), radius * lobe.alpha_y * np.sin(angle)
    s_x, s_y = np.broadcast_arrays(s_x, s_y)
    h = np.stack([s_x, s_y, np.ones_like(s_x)], axis=-1)
    h /= np.sqrt(np.sum(h * h, axis=-1, keepdims=True))
    return np.asarray(2.0 * np.sum(h * i, axis=-1, keepdims=True) * h - i)


def _cosine_weighted(u1: Array, angle: Array) -> Array:
    sin_theta = np.sqrt(u1)
    x, y, z = np.broadcast_arrays(sin_theta * np.cos(angle), sin_theta * np.sin(angle), np.sqrt(1.0 - u1))
    return np.stack([x, y, z], axis=-1)


def mixture_density(lobe: Lobe, i: Array, r: Array) -> Array:
    """Return density [1/sr] of the mixture over the whole sphere."""
    cosine = np.maximum(r[..., 2], 0.0) / np.pi
    if not np.any(lobe.share):
        return np.asarray(cosine + 0.0 * i[..., 2])
    # h = i + r not normalised: h.i = length / 2, cos(delta) = h_z / length
    x, y, z = (i[..., axis] + r[..., axis] for axis in range(3))
    length2 = x * x + y * y + z * z
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        t2 = ((x / lobe.alpha_x) ** 2 + (y / lobe.alpha_y) ** 2) / (z * z)
        slopes = lobe.distribution.density(t2)
        mirrored = slopes * length2 / (2.0 * np.pi * lobe.alpha_x * lobe.alpha_y * np.abs(z) ** 3)
    mirrored = np.where(np.abs(z) < 1e-100, 0.0, mirrored)  # no half vector is drawn there
    return np.asarray(lobe.share * mirrored + (1.0 - lobe.share) * cosine)
