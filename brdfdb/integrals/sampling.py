"""Importance sampling of every model: directions that follow its lobe, their density, and their weights."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from brdfdb.arrays import array_function
from brdfdb.errors import ParameterError
from brdfdb.geometry import checked_vectors
from brdfdb.integrals.quadrature import named, spec_of
from brdfdb.lobes import Lobe
from brdfdb.parameters import Array, Floats, ModelSpec

_TINY = 1e-300  # least u, so that its logarithm is finite
_FLAT = 1e-70  # z of a half vector up to which the density counts as 0: z^4 is still a number
DIFFUSE = Lobe(np.asarray(0.0), np.asarray(1.0), np.asarray(1.0))


class Sample(NamedTuple):
    """Directions drawn for a light.

    `wr` holds unit vectors of shape (..., 3), some below the horizon. `pdf` [1/sr] is their density over the sphere.
    `weight` [1] is f_r cos theta_r / pdf, and 0 below the horizon. Its mean is the albedo.
    """

    wr: Array
    pdf: Array
    weight: Array


@array_function
def sample(model: ModelSpec | str, u1: ArrayLike, u2: ArrayLike, wi: ArrayLike, **parameters: ArrayLike) -> Sample:
    """Draw a viewer for each light `wi`. By reciprocity it is also the next light of a path.

    Parameters
    ----------
    model : ModelSpec or str
        A model, or its name in `brdfdb.models.MODELS`.
    u1, u2 : array_like
        Uniform random numbers in [0, 1]. Stratified numbers give stratified directions.
    wi : array_like
        Unit vectors of the light, of shape (..., 3).
    **parameters : array_like
        Parameters of the model, which broadcast with u1, u2 and the vectors.

    Returns
    -------
    Sample
        (wr, pdf, weight), float64, in the broadcast shape of all arguments. They are nan where an argument is nan. The
        weight of a light below the horizon is 0.

    Raises
    ------
    ParameterError
        If an argument is outside its range.

    Notes
    -----
    The `lobe` of the model gives the probability of a half vector from a Gaussian of slopes, in which the light is
    mirrored. It follows Ward's eq. 7 with tan(delta) in (7a), which is printed without its arctan. Half vectors of GGX
    are normals of facets that the light sees (Heitz 2018), drawn as Dupuy and Benyoub 2023 do. Otherwise the
    direction has a density of cos theta_r / pi. u1 selects the component, then is rescaled to [0, 1] and reused.
    Directions of a lobe that fall below the horizon are kept with a weight of 0, because they are a part of the
    density. Ward's samples are not "uniformly weighted": the weights are those of `Sample`. The specular part of a
    model is not drawn: add `spec.specular` in the mirror direction.

    References
    ----------
    ward1992, heitz2018, dupuybenyoub2023

    Examples
    --------
    >>> drawn = sample("lambert", 0.3, 0.7, [0.0, 0.0, 1.0], rho=0.5)
    >>> round(float(drawn.weight), 12)
    0.5
    """
    spec = spec_of(model)
    parameters = named(spec, parameters)
    v1 = check_uniform("u1", u1)
    v2 = check_uniform("u2", u2)
    i = checked_vectors(wi, wi).w_i.astype(np.float64)
    lobe = lobe_of(spec, i, parameters)
    wr = directions(lobe, v1, v2, i)
    with np.errstate(all="ignore"):  # extreme samples may raise flags; the values themselves are tested
        f_r = spec.vectors(i, wr, **parameters)
    wr = np.broadcast_to(wr, (*np.shape(f_r), 3)).copy()  # parameters shape the result even without a lobe
    wr[np.isnan(f_r)] = np.nan
    density = mixture_density(lobe, i, wr)
    reflected = f_r * np.maximum(wr[..., 2], 0.0)
    # A direction with a density of 0 is never drawn, so its weight is 0
    weight = np.divide(reflected, density, where=density != 0.0, out=np.zeros(np.shape(density)))
    return Sample(wr, density[()], weight[()])


@array_function
def pdf(model: ModelSpec | str, wi: ArrayLike, wr: ArrayLike, **parameters: ArrayLike) -> Floats:
    """Return the density [1/sr] with which `sample` draws `wr`, anywhere on the sphere, for the light `wi`.

    Arguments and errors are those of `sample`. The integral of the density over the sphere is 1.

    Examples
    --------
    >>> round(float(pdf("lambert", [0.0, 0.0, 1.0], [0.0, 0.0, 1.0], rho=0.5)), 6)
    0.31831
    """
    vectors = checked_vectors(wi, wr)
    i = vectors.w_i.astype(np.float64)
    r = vectors.w_r.astype(np.float64)
    spec = spec_of(model)
    parameters = named(spec, parameters)
    density = mixture_density(lobe_of(spec, i, parameters), i, r) + 0.0 * (i + r).sum(axis=-1)  # nan is passed on
    shape = np.broadcast_shapes(density.shape, *(np.shape(value) for value in parameters.values()))
    return np.broadcast_to(density, shape).copy()[()]


def lobe_of(spec: ModelSpec, i: Array, parameters: Mapping[str, ArrayLike]) -> Lobe:
    """Return the lobe of a model for lights `i`. A diffuse model gets a lobe with a share of 0."""
    for parameter in spec.parameters:
        if parameter.name in parameters:
            parameter.check(parameters[parameter.name])
    return DIFFUSE if spec.lobe is None else spec.lobe(i[..., 2], **parameters)


def check_uniform(name: str, u: ArrayLike) -> Array:
    """Return random numbers as float64; ParameterError if one is outside [0, 1]. nan passes through."""
    array = np.asarray(u)
    if array.dtype.kind not in "iuf":
        raise ParameterError(name, f"{u!r} is not a number in [0, 1]")
    array = array.astype(np.float64)
    bad = (array < 0.0) | (array > 1.0)
    if np.any(bad):
        raise ParameterError(name, f"{array[bad].flat[0]:.9g} is outside [0, 1]", float(array[bad].flat[0]), (0.0, 1.0))
    return array


def directions(lobe: Lobe, u1: Array, u2: Array, i: Array) -> Array:
    """Return directions (..., 3) with the density `mixture_density`.

    u1 selects the component, lobe or cosine, then is rescaled to [0, 1] and reused.
    """
    in_lobe = (u1 < lobe.share) | (lobe.share >= 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):  # the component that is not taken may divide by zero
        stretched = np.where(in_lobe, u1 / lobe.share, (u1 - lobe.share) / (1.0 - lobe.share))
    angle = 2.0 * np.pi * u2
    mirror = _mirrored_in_visible if lobe.visible else mirrored_in_lobe
    mirrored = mirror(np.clip(stretched, _TINY, 1.0), angle, i, lobe)
    share = np.clip(stretched, 0.0, 1.0)  # directions that follow the cosine
    sin_theta = np.sqrt(share)
    others = (sin_theta * np.cos(angle), sin_theta * np.sin(angle), np.sqrt(1.0 - share))
    chosen = [np.where(in_lobe, mirrored[..., axis], other) for axis, other in enumerate(others)]
    return _vectors(*chosen)


def mirrored_in_lobe(u1: Floats, angle: Floats, i: Floats, lobe: Lobe) -> Array:
    """Return the light (..., 3) mirrored in half vectors whose slopes follow the distribution of the lobe."""
    radius = lobe.distribution.radius(u1)
    s_x = radius * lobe.alpha_x * np.cos(angle)
    s_y = radius * lobe.alpha_y * np.sin(angle)
    return _mirrored((s_x, s_y, np.ones(())), i)


def _mirrored_in_visible(u1: Array, angle: Array, i: Array, lobe: Lobe) -> Array:
    """Return the light (..., 3) mirrored in the facets that it sees."""
    assert lobe.distribution.visible is not None
    # The surface is stretched until its slopes have the width 1. The light is stretched the other way
    x, y, z = np.broadcast_arrays(lobe.alpha_x * i[..., 0], lobe.alpha_y * i[..., 1], i[..., 2])
    w = np.stack([x, y, z], axis=-1) / _stretched_length(i, lobe)[..., np.newaxis]
    h_x, h_y, h_z = np.moveaxis(lobe.distribution.visible(u1, angle, w), -1, 0)
    return _mirrored((lobe.alpha_x * h_x, lobe.alpha_y * h_y, h_z), i)


def _stretched_length(i: Floats, lobe: Lobe) -> Array:
    return np.asarray(np.sqrt((lobe.alpha_x * i[..., 0]) ** 2 + (lobe.alpha_y * i[..., 1]) ** 2 + i[..., 2] ** 2))


def _mirrored(h: tuple[Floats, Floats, Floats], i: Floats) -> Array:
    """Return the light mirrored in half vectors of any length, of which `h` holds the components."""
    x, y, z = h
    length = np.sqrt(np.maximum(x * x + y * y + z * z, _TINY))
    unit = x / length, y / length, z / length
    h_i = unit[0] * i[..., 0] + unit[1] * i[..., 1] + unit[2] * i[..., 2]
    return _vectors(*(2.0 * h_i * component - i[..., axis] for axis, component in enumerate(unit)))


def _vectors(x: Floats, y: Floats, z: Floats) -> Array:
    """Return vectors (..., 3) of components, written one by one: arithmetic along an axis of three numbers is slow."""
    vectors = np.empty((*np.broadcast_shapes(x.shape, y.shape, z.shape), 3))
    for axis, component in enumerate((x, y, z)):
        vectors[..., axis] = component
    return vectors


def mixture_density(lobe: Lobe, i: Floats, r: Floats) -> Array:
    """Return the density [1/sr] of lobe and cosine together, over the whole sphere."""
    cosine = np.maximum(r[..., 2], 0.0) / np.pi
    if not np.any(lobe.share):
        return np.asarray(cosine + 0.0 * i[..., 2])
    # For h = i + r, not normalised, h.i = length / 2 and cos(delta) = h_z / length
    x, y, z = (i[..., axis] + r[..., axis] for axis in range(3))
    length2 = x * x + y * y + z * z
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        t2 = ((x / lobe.alpha_x) ** 2 + (y / lobe.alpha_y) ** 2) / (z * z)
        slopes = lobe.distribution.density(t2)
        if lobe.visible:
            mirrored = _of_visible(slopes, length2, z, lobe, i)
        else:
            mirrored = slopes * length2 / (2.0 * np.pi * lobe.alpha_x * lobe.alpha_y * np.abs(z) ** 3)
    mirrored = np.where(np.abs(z) < 1e-100, 0.0, mirrored)  # no half vector is drawn at the horizon
    return np.asarray(lobe.share * mirrored + (1.0 - lobe.share) * cosine)


def _of_visible(slopes: Floats, length2: Floats, z: Floats, lobe: Lobe, i: Floats) -> Array:
    """Return the density [1/sr] of directions mirrored in visible facets, D / (4 projected area)."""
    assert lobe.distribution.area is not None
    stretched = _stretched_length(i, lobe)
    area = stretched * lobe.distribution.area(i[..., 2] / stretched)
    density = slopes * length2**2 / (4.0 * np.pi * lobe.alpha_x * lobe.alpha_y * area * z**4)
    return np.where(z > _FLAT, density, 0.0)  # facets with z < 0 face away
