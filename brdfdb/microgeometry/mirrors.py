"""f_r of facets that reflect as mirrors, alone or mixed with Lambert, by rays."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates, spline_filter
from scipy.spatial import KDTree
from scipy.stats import qmc

from brdfdb.microgeometry.facets import Bounces, Facets
from brdfdb.microgeometry.height_map import HeightMap
from brdfdb.microgeometry.rays import Hits, Region, Tracer, Vectors

Floats = NDArray[np.float64]

CONE = np.radians(10.0)  #: half angle of the receivers of light that leaves after several reflections [rad]

_RADIUS = 0.68  # of the kernel, in standard deviations of a part of the slopes. A Gaussian's peak is 0.27 % low
_CELL = 0.05  # of the grid of the density, in standard deviations
_WIDEST = 20.0  # slopes farther from their mean are left out of the density of a part, in standard deviations
_FITTED = 1 << 12  # points that tell the Gaussian parts of slopes
_MOST_POPULATIONS = 8
_GAIN = 0.05  # of the mean logarithm of the likelihood for which a part is added: Gaussian slopes have one
_STEPS = 60  # of the fit, at most
_NARROWEST = 1e-3  # standard deviation of a part, in those of all slopes
_FEWEST = 16  # points that tell the visible share of facets with a slope, even where none is within the radius
_MOST = 4096  # and at most
_MOST_ELONGATED = 1e6  # ratio of the variances of slopes along and across grooves; no density above it
_MOST_EQUAL = 0.05  # of the facets have the same slope; no density above it
_TURNS = 16  # azimuths of an isotropic surface
_GOLDEN = 0.5 * (1.0 + np.sqrt(5.0))
_FEWEST_POINTS, _MOST_POINTS = 1 << 14, 1 << 20  # points of the surface whose slopes are known, two for each facet
_PAIRS_AT_ONCE = 1 << 18  # points of pairs of light and viewer that are traced at a time: 100 MB
_CONNECTED = 1 / 16  # of the paths meet Lambertian points that rays connect to all viewers: these cost more
_POINTS_A_RAY = 1 / 64
_PATHS_AT_ONCE = 1 << 16
_RECEIVED_AT_ONCE = 1 << 23  # paths times viewers: 150 MB
_MOST_BOUNCES = 200
_FAINT = 0.1  # weight below which a path ends by chance


class _Slopes(NamedTuple):
    """Points of a surface with equal horizontal area, and the distribution of the slopes there."""

    hits: Hits
    mean: Floats  # mean slopes along x and y, (2,)
    whitening: Floats  # matrix (2, 2) from slopes to coordinates in standard deviations
    tree: KDTree  # of these coordinates
    density: Callable[[Floats], Floats]  # of slopes, at such coordinates (N, 2)


def mirror_bounces(
    tracer: Tracer,
    facets: Facets,
    lights: Vectors,
    viewers: Vectors,
    *,
    rays: int,
    seed: int,
    turned: bool = False,
    gaussian_slopes: tuple[float, float] | None = None,
    region: tuple[float, float, float, float] | None = None,
) -> Bounces:
    """Return f_r of the light that a mirror-like reflection is part of.

    Parameters
    ----------
    rays : int
        Number of paths of each light. Rays connect at most a sixteenth of them to the viewers after each bounce. A 64th
        of the number is that of the points which tell how much of the facets light and viewer see, at least 16 for
        each azimuth.
    others
        As those of `goniometer.bounces`, checked. With rho > 0, light that is reflected by Lambert and by mirrors is
        counted, too.

    Returns
    -------
    Bounces
        f_r of light with a mirror-like reflection or more. That of light whose last bounce, the second or a later
        one, is mirror-like is the mean over a receiver of `CONE` about the viewer, clipped at the horizon. So is
        that of one bounce if the slopes have no density, as `one_bounce_is_smoothed` tells: facets of grooves or
        flat parts have few directions. The shares that escape are those of all light.

    Notes
    -----
    With the density P22 of the slopes, the half vector h, and the share G of facets with this normal that light and
    viewer see, one bounce has f_r = F(theta_d) P22(slope of h) G / (4 h_z^4 cos(theta_i) cos(theta_r)) (as in
    Heitz 2014, with G by rays in place of Smith's). P22 is estimated by a kernel of fourth order with a radius of 0.68
    standard deviations of each Gaussian part of the slopes; G by rays from the points whose slopes are nearest to that
    of h. Both directions of a pair give the same value.

    Later bounces are walked from each light. Their mean over a receiver is a few per cent from f_r at its centre: on
    Gaussian slopes of 0.5, 2 % less of two bounces at normal incidence and viewing, where they have a peak.
    """
    if viewers.ndim == 2:
        viewers = np.broadcast_to(viewers, (len(lights), *viewers.shape))
    within = tracer.checked(region)
    rng = np.random.default_rng(seed)
    one = None
    slopes = _slopes(tracer, within, rng, gaussian_slopes) if facets.mirror > 0.0 else None
    if slopes is not None:
        turns = (rng.random() + np.arange(_TURNS)) * 2.0 * np.pi / _TURNS if turned else np.zeros(1)
        points = int(np.clip(_POINTS_A_RAY * rays / len(turns), _FEWEST, _MOST))
        one = _direct(tracer, facets, slopes, lights, viewers, turns, points)
    by_bounces = np.empty((3, *viewers.shape[:2], facets.wavelengths))
    escaped = np.empty((len(lights), 3, facets.wavelengths))
    for number, light in enumerate(lights):
        by_bounces[:, number], escaped[number] = _walks(
            tracer, facets, light, viewers[number], within, rays, turned, rng, slopes is None
        )
    if _same(lights, viewers):
        by_bounces = 0.5 * (by_bounces + by_bounces.transpose(0, 2, 1, 3))
    if one is not None:
        by_bounces[0] = one
    return Bounces(by_bounces[0], by_bounces[1], by_bounces[2], escaped)


def _slopes(
    tracer: Tracer, region: Region, rng: np.random.Generator, known: tuple[float, float] | None
) -> _Slopes | None:
    """Return points of the surface with the density of their slopes; None if it has none."""
    area = (region.x_high - region.x_low) * (region.y_high - region.y_low) / tracer.sides.prod()
    count = int(np.clip(2.0 * area * len(tracer.normals), _FEWEST_POINTS, _MOST_POINTS))
    hits = tracer.at(qmc.Sobol(2, rng=rng).random_base2(int(np.log2(count))), region)
    normals = tracer.normals[hits.faces]
    slopes = -normals[:, :2] / normals[:, 2:]
    if not _dense(slopes):
        return None
    mean = slopes.mean(axis=0)
    covariance = np.cov(slopes.T)
    if known is not None:
        mean = np.zeros(2)
        deviations = np.sqrt(np.diag(covariance))
        covariance *= np.outer(known, known) / np.outer(deviations, deviations)
    whitening = np.linalg.inv(np.linalg.cholesky(covariance)).T
    coordinates = (slopes - mean) @ whitening
    if known is None:
        # slopes of digital heights stand on a grid: they are spread over its cells
        steps = [np.median(np.diff(np.unique(np.round(slopes[:, axis], 7)))) for axis in (0, 1)]
        coordinates = coordinates + (np.random.default_rng(0).random(slopes.shape) - 0.5) * steps @ whitening
    scale = float(np.linalg.det(whitening))
    if known is None:
        density = _estimated_density(coordinates, scale)
    else:

        def density(at: Floats) -> Floats:
            return np.asarray(scale / (2.0 * np.pi) * np.exp(-0.5 * np.sum(at * at, axis=-1)))

    # such a tree is built in half the time, and queries take as long
    tree = KDTree(coordinates, balanced_tree=False, compact_nodes=False)
    return _Slopes(hits, mean, whitening, tree, density)


def _dense(slopes: Floats) -> bool:
    """Return True if slopes (N, 2) have a density.

    Slopes of grooves are few along an axis, or lie along a direction; many facets of flat parts have the same slope.
    """
    rounded = np.round(slopes[:4096], 6)
    different = min(np.unique(rounded[:, axis]).size for axis in (0, 1))
    equal = np.unique(rounded, axis=0, return_counts=True)[1].max()
    if different < 64 or equal > _MOST_EQUAL * len(rounded):
        return False
    return bool(np.linalg.cond(np.cov(slopes.T)) <= _MOST_ELONGATED)


def one_bounce_is_smoothed(surface: HeightMap) -> bool:
    """Return True if one reflection by mirrors is a mean over `CONE`: slopes of the surface have no density.

    A measured map has none if one of its 16 blocks has none, as a block with a flat part: blocks are measured apart.
    """
    cells = np.array(surface.closed().shape) - 1
    normals = surface.triangles().normals.reshape(2, *cells, 3)
    slopes = -normals[..., :2] / normals[..., 2:]
    count = 1 if surface.periodic else 4
    blocks = (part for rows in np.array_split(slopes, count, axis=1) for part in np.array_split(rows, count, axis=2))
    rng = np.random.default_rng(0)
    return not all(_dense(rng.permutation(block.reshape(-1, 2))) for block in blocks)


class _Population(NamedTuple):
    """A Gaussian part of a mixture of slopes."""

    share: float
    mean: Floats  # (2,)
    whitening: Floats  # from coordinates less the mean to those in standard deviations of the part (2, 2)

    def at(self, coordinates: Floats) -> Floats:
        """Return coordinates (N, 2) in standard deviations of the part."""
        return np.asarray((coordinates - self.mean) @ self.whitening)

    def log_density(self, coordinates: Floats) -> Floats:
        """Return the logarithm of its share times its density (N,)."""
        level = np.log(self.share * np.linalg.det(self.whitening) / (2.0 * np.pi))
        return np.asarray(level - 0.5 * np.sum(self.at(coordinates) ** 2, axis=1))


def _populations(coordinates: Floats) -> list[_Population]:
    """Return the Gaussian parts of a mixture that describes coordinates (N, 2): one of Gaussian slopes.

    A part is added where the points are densest in proportion to the mixture, or the largest part is halved along an
    axis, whichever suits more. The mixture is fitted by expectation and maximisation (Dempster, Laird and Rubin 1977),
    until the likelihood of a point no longer grows by `_GAIN`.
    """
    coordinates = coordinates[:_FITTED]
    neighbours = len(coordinates) // 32
    distance = np.maximum(KDTree(coordinates).query(coordinates, k=[neighbours])[0][:, 0], _NARROWEST)
    parts, likelihood = _fitted(np.ones((1, len(coordinates))), coordinates)
    while len(parts) < _MOST_POPULATIONS:
        logs = np.stack([part.log_density(coordinates) for part in parts])
        either = np.logaddexp.reduce(logs, axis=0)
        densest = int(np.argmax(-2.0 * np.log(distance) - either))
        added = _Population(1.0 / 32.0, coordinates[densest], np.eye(2) * 2.0 / distance[densest])
        more = np.concatenate([logs, added.log_density(coordinates)[np.newaxis]])
        starts = [np.exp(more - np.logaddexp.reduce(more, axis=0))]
        shares = np.exp(logs - either)
        largest = int(np.argmax([part.share for part in parts]))
        for positive in parts[largest].at(coordinates).T > 0.0:
            half = shares[largest] * positive
            starts.append(np.concatenate([np.delete(shares, largest, axis=0), [half, shares[largest] - half]]))
        best, larger = max((_fitted(start, coordinates) for start in starts), key=lambda fitted: fitted[1])
        if larger < likelihood + _GAIN:
            break
        parts, likelihood = best, larger
    return parts


def _fitted(shares: Floats, coordinates: Floats) -> tuple[list[_Population], float]:
    """Return a mixture, from the shares (parts, N) of its parts in points, and the mean logarithm of its likelihood."""
    likelihood = -np.inf
    for _ in range(_STEPS):
        parts = []
        for weights in shares:
            total = float(weights.sum())
            if total < _FEWEST:  # it has vanished
                continue
            mean = weights @ coordinates / total
            off = coordinates - mean
            covariance = (weights * off.T) @ off / total + np.eye(2) * _NARROWEST**2
            whitening = np.linalg.inv(np.linalg.cholesky(covariance)).T
            parts.append(_Population(total / len(coordinates), mean, whitening))
        logs = np.stack([part.log_density(coordinates) for part in parts])
        either = np.logaddexp.reduce(logs, axis=0)
        shares = np.exp(logs - either)
        before = likelihood
        likelihood = float(either.mean())
        if likelihood - before < 1e-4:
            break
    return parts, likelihood


def _estimated_density(coordinates: Floats, scale: float) -> Callable[[Floats], Floats]:
    """Return the density at points, estimated from coordinates (N, 2).

    Each point belongs in shares to the Gaussian parts of a mixture, and the density of a part is smoothed over a radius
    in proportion to its width: the narrow core of slopes is not smeared by wide tails. The mixture decides the radius
    alone; the sum of the parts is the density of the points, whatever they are.
    """
    parts = _populations(coordinates)
    logs = np.stack([part.log_density(coordinates) for part in parts])
    shares = np.exp(logs - np.logaddexp.reduce(logs, axis=0))
    smooth = [_smoothed(part.at(coordinates), weights) for part, weights in zip(parts, shares, strict=True)]

    def density(at: Floats) -> Floats:
        total = np.zeros(len(at))
        for part, (spline, reach) in zip(parts, smooth, strict=True):
            place = (part.at(at) + reach) / _CELL
            total += np.linalg.det(part.whitening) * map_coordinates(spline, place.T, order=3, prefilter=False)
        return np.asarray(np.maximum(total * (scale / len(coordinates)), 0.0))

    return density


def _smoothed(coordinates: Floats, weights: Floats) -> tuple[Floats, float]:
    """Return a spline on a grid of the smoothed density of weighted points (N, 2), and the reach of the grid.

    The kernel is (1 - u^2) (1 - 2 u^2) with u the distance in units of the radius.
    """
    farthest = np.abs(coordinates).max(axis=1)
    near = (farthest <= _WIDEST) & (weights > 1e-9)
    coordinates, weights = coordinates[near], weights[near]
    reach = float(farthest[near].max()) + 2.0 * _RADIUS
    cells = int(np.ceil(2.0 * reach / _CELL)) + 1
    place = (coordinates + reach) / _CELL
    first = np.floor(place).astype(np.int64)
    along = place - first
    counts = np.zeros(cells * cells)
    for i in (0, 1):
        for j in (0, 1):
            weight = weights * np.abs(1 - i - along[:, 0]) * np.abs(1 - j - along[:, 1])
            counts += np.bincount((first[:, 0] + i) * cells + first[:, 1] + j, weight, cells * cells)
    steps = np.arange(-int(_RADIUS / _CELL), int(_RADIUS / _CELL) + 1) * _CELL / _RADIUS
    u2 = steps[:, np.newaxis] ** 2 + steps**2
    kernel = np.where(u2 < 1.0, (1.0 - u2) * (1.0 - 2.0 * u2), 0.0)
    # around the grid is a margin as wide as the kernel, so that what leaves a side and enters the other is 0
    shape = (cells, cells)
    smooth = np.fft.irfft2(np.fft.rfft2(counts.reshape(shape)) * np.fft.rfft2(kernel / kernel.sum(), shape), shape)
    smooth = np.roll(smooth, -(len(steps) // 2), axis=(0, 1))
    return np.asarray(spline_filter(smooth / _CELL**2)), reach


def _direct(
    tracer: Tracer,
    facets: Facets,
    slopes: _Slopes,
    lights: Vectors,
    viewers: Vectors,
    turns: Floats,
    points: int,
) -> Floats:
    """Return f_r [1/sr] of one mirror-like reflection for lights (I, 3) and viewers (I, V, 3), shape (I, V, L)."""
    rows, columns = np.indices(viewers.shape[:2]).reshape(2, -1)
    if _same(lights, viewers):
        rows, columns = np.triu_indices(len(lights))
    w_i = lights[rows]
    w_r = viewers[rows, columns]
    half = w_i + w_r
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    distribution = np.zeros(len(w_i))
    positions = tracer.off(slopes.hits)
    normals = tracer.normals[slopes.hits.faces]
    # half vectors along the normal are the same at all azimuths: each takes other points, from a disk that has as many
    number = np.arange(len(turns))
    radius = np.sqrt(2.0 * points / len(normals) * number)
    angle = 2.0 * np.pi * number / _GOLDEN
    for turn, *shift in zip(turns, radius * np.cos(angle), radius * np.sin(angle), strict=True):
        for start in range(0, len(w_i), max(1, _PAIRS_AT_ONCE // points)):
            pairs = slice(start, start + max(1, _PAIRS_AT_ONCE // points))
            h = _about_normal(half[pairs], turn)
            at = (-h[:, :2] / h[:, 2:] - slopes.mean) @ slopes.whitening
            distance, near = slopes.tree.query(at + shift, k=points)
            seen = (distance < _RADIUS) | (np.arange(points) < _FEWEST)
            tried = seen.sum(axis=1)
            for side in (w_i, w_r):
                towards = _about_normal(side[pairs], turn)
                seen &= np.einsum("pkc,pc->pk", normals[near], towards) > 0.0
                pair, point = np.nonzero(seen)
                seen[pair, point] = tracer.leave(positions[near[pair, point]], towards[pair])
            distribution[pairs] += slopes.density(at) * seen.sum(axis=1) / tried
    distribution /= len(turns) * 4.0 * half[:, 2] ** 4 * w_i[:, 2] * w_r[:, 2]
    f_r = np.empty((*viewers.shape[:2], facets.wavelengths))
    f_r[rows, columns] = facets.mirrored(np.sum(half * w_i, axis=1)) * distribution[:, np.newaxis]
    if _same(lights, viewers):
        f_r[columns, rows] = f_r[rows, columns]
    return f_r


def _same(lights: Vectors, viewers: Vectors) -> bool:
    """Return True if viewers (I, I, 3) are the lights (I, 3): half of the pairs are the others backwards."""
    return viewers.shape[0] == viewers.shape[1] and bool(np.all(viewers == lights))


class _Paths(NamedTuple):
    """Light paths at a point of the surface."""

    hits: Hits
    directions: Vectors  # in which the light arrives, (N, 3)
    turn: Floats  # angles by which light and viewers are turned, (N,) [rad]
    weight: Floats  # light that the path carries, (N, L)
    mirrored: NDArray[np.bool_]  # True where the path has had a mirror-like reflection

    def of(self, rows: NDArray[np.bool_] | NDArray[np.int64]) -> _Paths:
        hits = Hits(self.hits.points[rows], self.hits.faces[rows])
        return _Paths(hits, self.directions[rows], self.turn[rows], self.weight[rows], self.mirrored[rows])


def _walks(
    tracer: Tracer,
    facets: Facets,
    light: Vectors,
    viewers: Vectors,
    region: Region,
    rays: int,
    turned: bool,
    rng: np.random.Generator,
    smooth_one: bool,
) -> tuple[Floats, Floats]:
    """Return f_r (3, V, L) of paths from a light after two and more bounces, and the shares that leave (3, L).

    With `smooth_one` f_r of one bounce is collected, too; else it is 0.
    """
    sums = np.zeros((2, 3, len(viewers), facets.wavelengths))  # connected by rays, and collected in receivers
    escaped = np.zeros((3, facets.wavelengths))
    arrived = 0.0
    most = min(_PATHS_AT_ONCE, max(1, _RECEIVED_AT_ONCE // len(viewers)))
    for start in range(0, rays, most):
        block = min(most, rays - start)
        numbers = qmc.Sobol(3, rng=rng).random_base2(int(np.ceil(np.log2(block))))[:block]
        # neighbours follow each other: their rays meet the same facets, which the processor's cache holds
        columns, rows = np.floor(numbers[:, :2].T * 64.0)
        numbers = numbers[np.lexsort((rows, columns))]
        hits = tracer.at(numbers[:, :2], region)
        turn = 2.0 * np.pi * numbers[:, 2] * turned
        towards = _about_normal(np.broadcast_to(light, (block, 3)), turn)
        normals = tracer.normals[hits.faces]
        weight = np.sum(normals * towards, axis=1) / (normals[:, 2] * light[2])
        reached = np.flatnonzero(weight > 0.0)
        reached = reached[tracer.leave(tracer.off(hits)[reached], towards[reached])]
        arrived += float(weight[reached].sum())
        weights = np.repeat(weight[:, np.newaxis], facets.wavelengths, axis=1)
        paths = _Paths(hits, -towards, turn, weights, np.zeros(block, dtype=bool)).of(reached)
        for bounce in range(_MOST_BOUNCES):
            if not paths.turn.size:
                break
            order = min(bounce, 2)
            paths, scattered = _reflected(tracer, facets, paths, rng, first=bounce == 0)
            late = np.flatnonzero(scattered & paths.mirrored)
            if late.size:
                chosen = rng.permutation(late)[: max(1, int(_CONNECTED * block))]
                seen = _seen(tracer, paths.of(chosen), viewers)
                sums[0, order] += seen.T @ paths.weight[chosen] * (late.size / chosen.size / np.pi)
            hits = tracer.hits(tracer.off(paths.hits), paths.directions)
            leaves = hits.faces < 0
            escaped[order] += paths.weight[leaves].sum(axis=0)
            if bounce > 0 or smooth_one:
                ends = paths.of(leaves & ~scattered)
                inside = _about_normal(ends.directions, -ends.turn) @ viewers.T > np.cos(CONE)
                sums[1, order] += inside.T.astype(np.float64) @ ends.weight
            paths = paths._replace(hits=hits).of(~leaves)
            largest = paths.weight.max(axis=1)
            lasting = rng.random(len(largest)) * _FAINT < largest
            paths = paths._replace(weight=paths.weight / np.clip(largest / _FAINT, 1e-9, 1.0)[:, np.newaxis]).of(
                lasting
            )
    sums[0] /= viewers[:, 2, np.newaxis]
    sums[1] /= cone_projected(viewers[:, 2])[:, np.newaxis]
    return sums.sum(axis=0) / rays, escaped / max(arrived, 1e-300)


def _reflected(
    tracer: Tracer, facets: Facets, paths: _Paths, rng: np.random.Generator, *, first: bool
) -> tuple[_Paths, NDArray[np.bool_]]:
    """Return paths with the directions and weights after a reflection, and which reflections are Lambert's."""
    normals = tracer.normals[paths.hits.faces]
    cosine = -np.sum(normals * paths.directions, axis=1)
    mirrored = facets.mirrored(np.clip(cosine, 0.0, 1.0))
    rho = np.asarray(facets.rho)
    shares = mirrored.mean(axis=1)
    either = shares + rho.mean()
    share = np.divide(shares, either, out=np.zeros_like(shares), where=either > 0.0)
    if first and rho.mean() > 0.0:
        # only paths that meet a mirror are counted: more of them meet one
        share = np.where(share > 0.0, np.maximum(share, 0.5), 0.0)
    scattered = rng.random(len(share)) >= share
    weight = np.where(scattered[:, np.newaxis], rho, mirrored)
    weight = paths.weight * weight / np.where(scattered, 1.0 - share, share)[:, np.newaxis]
    sphere = rng.standard_normal(normals.shape)
    # a point of the unit sphere about the tip of the normal has the density of the cosine
    diffuse = normals + sphere / np.linalg.norm(sphere, axis=1, keepdims=True)
    directions = np.where(scattered[:, np.newaxis], diffuse, paths.directions + 2.0 * cosine[:, np.newaxis] * normals)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return _Paths(paths.hits, directions, paths.turn, weight, paths.mirrored | ~scattered), scattered


def _seen(tracer: Tracer, paths: _Paths, viewers: Vectors) -> Floats:
    """Return the cosines to the normals at points of viewers (V, 3), 0 where other facets lie between (N, V)."""
    towards = _about_normal(viewers, paths.turn[:, np.newaxis])
    cosines = np.einsum("nc,nvc->nv", tracer.normals[paths.hits.faces], towards)
    rows, columns = np.nonzero(cosines > 0.0)
    free = tracer.leave(tracer.off(paths.hits)[rows], towards[rows, columns])
    seen = np.zeros(cosines.shape)
    seen[rows[free], columns[free]] = cosines[rows[free], columns[free]]
    return seen


def _about_normal(directions: Vectors, turn: float | Floats) -> Vectors:
    """Return directions (..., 3) turned about the normal by angles."""
    x, y, z = np.moveaxis(directions, -1, 0)
    cos, sin = np.cos(turn), np.sin(turn)
    return np.asarray(np.stack(np.broadcast_arrays(cos * x - sin * y, sin * x + cos * y, z), axis=-1))


def cone_projected(cosine: Floats) -> Floats:
    """Return the projected solid angles [sr] of cones of half angle `CONE`, clipped at the horizon.

    Parameters
    ----------
    cosine : array (V,) [1]
        Cosines of the axes to the normal, in (0, 1].
    """
    angle = (np.arange(512) + 0.5) * (CONE / 512)
    level = np.cos(angle) * cosine[:, np.newaxis]
    swing = np.sin(angle) * np.sqrt(1.0 - cosine**2)[:, np.newaxis]
    # the part of a ring above the horizon reaches as far as this azimuth on both sides
    reach = np.arccos(np.clip(-level / np.maximum(swing, 1e-300), -1.0, 1.0))
    above = 2.0 * (reach * level + np.sin(reach) * swing)
    return np.asarray(above @ np.sin(angle) * (CONE / 512))
