"""The goniometer: f_r of the facets of a surface by rays, for one, two and all bounces."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import qmc

from brdfdb.errors import ParameterError
from brdfdb.geometry import checked_vectors
from brdfdb.microgeometry.facets import Bounces, Facets
from brdfdb.microgeometry.height_map import HeightMap
from brdfdb.microgeometry.mirrors import mirror_bounces
from brdfdb.microgeometry.rays import Hits, Region, Tracer, Vectors

_MOST_BOUNCES = 1000
_TRIED = 1024  # directions that tell how many of them meet another facet
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)  # share of a turn between points of a lattice
_RAYS_AT_ONCE = 1 << 19  # rays to lights and viewers that are traced at a time: 100 MB


class _Walk(NamedTuple):
    """Points of light paths: where they are, and what leads there."""

    hits: Hits
    turn: NDArray[np.float64]  # angles by which lights and viewers are turned, (N,) [rad]
    onwards: Vectors  # two numbers of [0, 1)^2 for the direction in which each path goes on, (N, 2)


def bounces(
    surface: HeightMap | Tracer,
    facets: Facets,
    lights: ArrayLike,
    viewers: ArrayLike,
    *,
    rays: int,
    seed: int,
    turned: bool = False,
    gaussian_slopes: tuple[float, float] | None = None,
    region: tuple[float, float, float, float] | None = None,
) -> Bounces:
    """Return f_r of the facets of a surface for pairs of lights and viewers.

    Parameters
    ----------
    surface : HeightMap or Tracer
        The surface, or its facets prepared for rays.
    facets : Facets
        Their reflectance.
    lights : array (I, 3) [1]
        Unit vectors to the lights, above the horizon.
    viewers : array (V, 3) or (I, V, 3) [1]
        Unit vectors to the viewers, above the horizon: the same for all lights, or those of each light.
    rays : int
        Number of light paths; powers of two are spread most evenly.
    seed : int
        The same seed gives the same numbers.
    turned : bool
        True for isotropic surfaces: light and viewers are turned about the normal together, by an angle of each path.
    gaussian_slopes : tuple (along x, along y) [1], optional
        Standard deviations of slopes that are known to be Gaussian, for mirror-like facets. By default the density of
        their slopes is estimated.
    region : tuple (x_low, x_high, y_low, y_high) [um], optional
        Rectangle in which the light first meets the surface, by default all of the map.

    Returns
    -------
    Bounces

    Raises
    ------
    ParameterError
        If directions are no unit vectors above the horizon, if shapes do not fit, if `rays` is not positive, or if the
        rectangle is not inside the map.

    Notes
    -----
    Points of first hits have equal horizontal area. At each, rays tell which lights reach it, and which viewers see it:
    the product of their cosines is the light of one bounce, for all pairs at once. Then a path goes on from the point
    in a random direction, with the density of the cosine to the normal, or in several of them where few meet another
    facet. The light that reached the first point is seen by the viewers of the next points. A path backwards is as
    likely: if lights and viewers are the same directions, both are counted. Points, turns and first directions are
    scrambled Sobol points (Matousek 1998), later directions are random. Light with a mirror-like reflection on its way
    is added by `mirrors.mirror_bounces`.
    """
    tracer = surface if isinstance(surface, Tracer) else Tracer(surface)
    w_i, w_r = _directions("lights", lights), _directions("viewers", viewers)
    if w_i.ndim != 2 or w_r.ndim not in (2, 3) or (w_r.ndim == 3 and len(w_r) != len(w_i)):
        raise ParameterError("viewers", f"shape {w_r.shape} does not fit lights of shape {w_i.shape}", w_r.shape)
    if rays < 1:
        raise ParameterError("rays", f"{rays} is not a positive number", rays, (1, None))
    same = np.array_equal(w_r, w_i)
    # viewers that several lights share are traced once
    traced, columns = np.unique(w_r.reshape(-1, 3), axis=0, return_inverse=True)
    columns = np.broadcast_to(columns.reshape(w_r.shape[:-1]), (len(w_i), w_r.shape[-2]))
    rng = np.random.default_rng(seed)
    rho = np.asarray(facets.rho)
    sums = np.zeros((3, *columns.shape, rho.size))
    escaped = np.zeros((len(w_i), 3, rho.size))
    received = np.zeros(len(w_i))
    paths = max(1, _RAYS_AT_ONCE // max(len(w_i), len(traced)))
    within = tracer.checked(region)
    diffuse = bool(rho.any())
    branches = _branches(tracer, within, len(w_i) + len(traced), rng) if diffuse else 1
    for walk in _starts(tracer, rays, rng, within, turned, paths) if diffuse else ():
        lit = _received(tracer, walk, w_i)
        lit /= tracer.normals[walk.hits.faces, 2, np.newaxis]
        received += lit.sum(axis=0)
        for number in range(_MOST_BOUNCES):
            reached = np.any(lit > 0.0, axis=1)
            walk = _Walk(walk.hits.selected(reached), walk.turn[reached], walk.onwards[reached])
            lit = lit[reached]
            if not lit.size:
                break
            if same and number == 0:
                reflected = lit.T @ (lit * tracer.normals[walk.hits.faces, 2, np.newaxis])
            else:
                reflected = np.take_along_axis(lit.T @ _received(tracer, walk, traced), columns, axis=1)
            if same:
                reflected = 0.5 * (reflected + reflected.T)
            sums[min(number, 2)] += reflected[..., np.newaxis] * rho ** (number + 1)
            directions = branches if number == 0 else 1
            walk, parents = _next(tracer, walk, directions, rng)
            leaving = lit.sum(axis=0) - lit[parents].sum(axis=0) / directions
            escaped[:, min(number, 2)] += leaving[:, np.newaxis] * rho ** (number + 1)
            lit = lit[parents] / directions
    cosines = w_i[:, np.newaxis, 2] * w_r[..., 2]
    sums /= np.pi * rays * cosines[..., np.newaxis]
    escaped /= np.maximum(received, 1e-300)[:, np.newaxis, np.newaxis]
    if facets.mirror == 0.0:
        return Bounces(sums[0], sums[1], sums[2], escaped)
    mirrored = mirror_bounces(
        tracer,
        facets,
        w_i,
        w_r,
        rays=rays,
        seed=seed,
        turned=turned,
        gaussian_slopes=gaussian_slopes,
        region=region,
    )
    return Bounces(sums[0] + mirrored.one, sums[1] + mirrored.two, sums[2] + mirrored.further, mirrored.escaped)


def shadowed(
    surface: HeightMap | Tracer,
    directions: ArrayLike,
    *,
    rays: int,
    seed: int,
    turned: bool = False,
    region: tuple[float, float, float, float] | None = None,
) -> NDArray[np.float64]:
    """Return the share [1] of the area of facets facing each direction that other facets hide from it, shape (D,).

    It is the shadowing of a light in that direction, and the masking of a viewer there. Arguments and errors are those
    of `bounces`; `directions` are unit vectors (D, 3).
    """
    tracer = surface if isinstance(surface, Tracer) else Tracer(surface)
    towards = _directions("directions", directions).reshape(-1, 3)
    rng = np.random.default_rng(seed)
    facing, seen = np.zeros((2, len(towards)))
    paths = max(1, _RAYS_AT_ONCE // len(towards))
    for walk in _starts(tracer, rays, rng, tracer.checked(region), turned, paths):
        normals = tracer.normals[walk.hits.faces]
        area = 1.0 / normals[:, 2]
        facing += area @ (_cosines(normals, _turned(towards, walk.turn)) > 0.0)
        seen += area @ (_received(tracer, walk, towards) > 0.0)
    return 1.0 - seen / facing


def _directions(name: str, directions: ArrayLike) -> Vectors:
    """Return unit vectors (..., 3); ParameterError if they are none, or not above the horizon."""
    try:
        vectors = np.asarray(checked_vectors(directions, [0.0, 0.0, 1.0]).w_i, np.float64)
    except ParameterError as error:
        raise ParameterError(name, error.sentence, error.value, error.allowed) from None
    if not vectors.size:
        raise ParameterError(name, "there is none; needed is a direction or more", 0)
    low = vectors[~((vectors[..., 2] > 0.0) & np.all(np.isfinite(vectors), axis=-1))]
    if low.size:
        raise ParameterError(name, f"({low[0, 0]:g}, {low[0, 1]:g}, {low[0, 2]:g}) is not above the horizon", low[0])
    return vectors


def _starts(
    tracer: Tracer,
    count: int,
    rng: np.random.Generator,
    region: Region,
    turned: bool,
    most: int,
) -> Iterator[_Walk]:
    """Yield the first points of light paths, at most so many at a time."""
    sobol = qmc.Sobol(5, rng=rng).random_base2(int(np.ceil(np.log2(count))))[:count]
    # neighbours follow each other: their rays meet the same facets, which the processor's cache holds
    rows, columns = np.floor(sobol[:, :2].T * 64.0)
    sobol = sobol[np.lexsort((columns, rows))]
    for start in range(0, count, most):
        part = sobol[start : start + most]
        turn = 2.0 * np.pi * part[:, 2] * turned
        yield _Walk(tracer.at(part[:, :2], region), turn, part[:, 3:])


def _branches(tracer: Tracer, region: Region, directions: int, rng: np.random.Generator) -> int:
    """Return in how many directions a path goes on from its first point: more if few of them meet another facet.

    A direction costs a ray, and a point that is met costs one for each light and viewer.
    """
    hits = tracer.at(rng.random((_TRIED, 2)), region)
    onwards = _scattered(tracer.normals[hits.faces], rng.random((_TRIED, 2)))
    met = int(np.count_nonzero(tracer.hits(tracer.off(hits), onwards).faces >= 0))
    return int(np.clip(np.ceil(0.5 * _TRIED / max(met, 1)), 1, np.clip(directions // 8, 1, 32)))


def _next(tracer: Tracer, walk: _Walk, branches: int, rng: np.random.Generator) -> tuple[_Walk, NDArray[np.int64]]:
    """Return the next points of paths that go on in a number of directions, and the points that they come from."""
    parents, number = np.indices((len(walk.turn), branches)).reshape(2, -1)
    # each direction is shifted by a point of a lattice, so that those of a path are spread evenly
    lattice = np.stack([number / branches, number * _GOLDEN], axis=-1)
    onwards = _scattered(tracer.normals[walk.hits.faces[parents]], (walk.onwards[parents] + lattice) % 1.0)
    hits = tracer.hits(tracer.off(walk.hits)[parents], onwards)
    met = hits.faces >= 0
    parents = parents[met]
    return _Walk(hits.selected(met), walk.turn[parents], rng.random((len(parents), 2))), parents


def _turned(directions: Vectors, turn: NDArray[np.float64]) -> Vectors:
    """Return directions (D, 3) turned about the normal by angles (N,), shape (N, D, 3)."""
    x, y, z = directions.T
    cos, sin = np.cos(turn)[:, np.newaxis], np.sin(turn)[:, np.newaxis]
    return np.stack([cos * x - sin * y, sin * x + cos * y, np.broadcast_to(z, (len(turn), len(z)))], axis=-1)


def _cosines(normals: Vectors, directions: Vectors) -> NDArray[np.float64]:
    return np.asarray(np.einsum("nc,ndc->nd", normals, directions))


def _received(tracer: Tracer, walk: _Walk, directions: Vectors) -> NDArray[np.float64]:
    """Return the cosines to the normals at points of directions (D, 3), 0 where other facets lie between (N, D)."""
    towards = _turned(directions, walk.turn)
    cosines = _cosines(tracer.normals[walk.hits.faces], towards)
    rows, columns = np.nonzero(cosines > 0.0)
    cosines[cosines <= 0.0] = 0.0
    free = tracer.leave(tracer.off(walk.hits)[rows], towards[rows, columns])
    cosines[rows[~free], columns[~free]] = 0.0
    return cosines


def _scattered(normals: Vectors, numbers: Vectors) -> Vectors:
    """Return unit vectors with the density cos / pi about normals (N, 3), from numbers (N, 2) of [0, 1)^2."""
    # A point of the unit sphere about the tip of the normal: no frame is needed
    z = 1.0 - 2.0 * numbers[:, 0]
    radius = np.sqrt(np.maximum(1.0 - z * z, 0.0))
    phi = 2.0 * np.pi * numbers[:, 1]
    directions = normals + np.column_stack([radius * np.cos(phi), radius * np.sin(phi), z])
    return np.asarray(directions / np.linalg.norm(directions, axis=1, keepdims=True))
