"""Rays against intersections that NumPy computes triangle by triangle, over several tiles."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.geometry import unit_vector
from brdfdb.microgeometry.height_map import HeightMap
from brdfdb.microgeometry.rays import MOST_NODES, Tracer

TILES = 6  # on each side of the first tile
HEIGHTS = np.random.default_rng(1).random((6, 5))
MAP = HeightMap(HEIGHTS - HEIGHTS.mean(), 0.5, 0.7, periodic=True)


def random_rays(count: int, seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return points within and over the map, and directions of all azimuths, up and down."""
    rng = np.random.default_rng(seed)
    origins = rng.random((count, 3)) * [3.0, 3.5, 0.5] + [0.0, 0.0, 1.0]
    cosine = rng.choice([-1.0, 1.0], count) * rng.uniform(0.12, 0.9, count)  # lower rays go beyond the tiles
    directions = unit_vector(np.arccos(cosine), 2.0 * np.pi * rng.random(count))
    return origins, directions


def met_first(
    origins: NDArray[np.float64], directions: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the distance to the first facet of 13 x 13 tiles, and its number; infinity and -1 if there is none."""
    triangles = MAP.triangles()
    corners = triangles.vertices[triangles.faces]
    distance = np.full(len(origins), np.inf)
    face = np.full(len(origins), -1)
    for i in range(-TILES, TILES + 1):
        for j in range(-TILES, TILES + 1):
            a, b, c = np.moveaxis(np.add(corners, [i * 3.0, j * 3.5, 0.0]), 1, 0)
            # Moeller and Trumbore 1997
            p = np.cross(directions[:, np.newaxis], c - a)
            determinant = np.sum((b - a) * p, axis=-1)
            from_a = origins[:, np.newaxis] - a
            q = np.cross(from_a, b - a)
            u = np.sum(from_a * p, axis=-1) / determinant
            v = np.sum(directions[:, np.newaxis] * q, axis=-1) / determinant
            t = np.sum((c - a) * q, axis=-1) / determinant
            t[(u < 0.0) | (v < 0.0) | (u + v > 1.0) | (t <= 0.0)] = np.inf
            nearest = t.argmin(axis=1)
            nearer = t.min(axis=1) < distance
            distance[nearer] = t.min(axis=1)[nearer]
            face[nearer] = nearest[nearer]
    return distance, face


def test_rays_meet_the_facets_of_all_tiles() -> None:
    origins, directions = random_rays(400, 2)
    distance, face = met_first(origins, directions)
    tracer = Tracer(MAP)
    hits = tracer.hits(origins, directions)
    np.testing.assert_array_equal(hits.faces, face)
    np.testing.assert_array_equal(tracer.leave(origins, directions), face < 0)
    assert 50 < np.count_nonzero(face < 0) < 350
    met = face >= 0
    points = origins[met] + distance[met, np.newaxis] * directions[met]
    assert np.count_nonzero((points[:, :2] < 0.0) | (points[:, :2] > [3.0, 3.5])) > 50
    np.testing.assert_allclose(hits.points[met, 2], points[:, 2], atol=1e-5)
    apart = (hits.points[met, :2] - points[:, :2]) / [3.0, 3.5]
    np.testing.assert_allclose(apart, np.round(apart), atol=1e-5)


def test_points_of_a_surface_are_where_rays_from_above_meet_it() -> None:
    tracer = Tracer(MAP)
    places = np.random.default_rng(3).random((500, 2))
    found = tracer.at(places, tracer.measured)
    above = np.column_stack([found.points[:, :2], np.full(500, 5.0)])
    hits = tracer.hits(above, np.broadcast_to([0.0, 0.0, -1.0], (500, 3)))
    np.testing.assert_array_equal(found.faces, hits.faces)
    np.testing.assert_allclose(found.points, hits.points, atol=1e-6)
    np.testing.assert_allclose(found.points[:, :2], places * [3.0, 3.5], atol=1e-12)


def test_beyond_a_side_rays_go_on_above_a_place_of_the_same_height_and_slopes() -> None:
    x, y = np.meshgrid(np.arange(61.0), np.arange(91.0), indexing="ij")
    wave = HeightMap(np.sin(0.41 * x) + np.cos(0.53 * y), 1.0, 1.0)
    tracer = Tracer(wave)
    assert tracer.measured == (0.0, 60.0, 0.0, 90.0)
    inside = np.random.default_rng(4).random((200, 2)) * [60.0, 90.0]
    for axis, far in ((0, 60.0), (1, 90.0)):
        for high in (False, True):
            direction = np.array([0.0, 0.0, 0.01])
            direction[axis] = 1.0 if high else -1.0
            before = np.column_stack([inside, np.full(200, 1.9)])
            before[:, axis] = far if high else 0.0
            after = before.copy()
            going = tracer._entering(after, np.broadcast_to(direction, (200, 3)), np.arange(200))
            assert going.tolist() == list(range(200))
            moved, room = after[:, :2], np.abs((far if high else 0.0) - after[:, axis])
            assert np.all(room >= 0.5 * far - 1.0)
            for form in (lambda p: np.sin(0.41 * p[:, 0]) + np.cos(0.53 * p[:, 1]), lambda p: np.cos(0.41 * p[:, 0])):
                assert np.quantile(np.abs(form(moved) - form(before)), 0.9) < 0.4
            clearance = [at[:, 2] - np.sin(0.41 * at[:, 0]) - np.cos(0.53 * at[:, 1]) for at in (before, after)]
            np.testing.assert_allclose(clearance[0], clearance[1], atol=0.15)  # facets lie below arcs of the wave


def test_no_wall_stands_between_sides_of_different_heights() -> None:
    levels = np.repeat([-0.5, 0.5, -0.5, 0.5, -0.5, 0.5], 10)[:, np.newaxis]
    tracer = Tracer(HeightMap(levels + np.zeros((60, 10)), 1.0, 1.0))
    starts = np.column_stack([np.ones(50), np.linspace(0.1, 8.9, 50), np.full(50, -0.49)])
    # a wall as high as the other side would shade what is below 0.5 at x = -1; the next step is 3 um away or more
    assert tracer.leave(starts, np.broadcast_to(unit_vector(np.arctan(1.0 / 0.45), np.pi), (50, 3))).all()
    # the bottom is 10 um wide, and the step above it shades all directions that rise by less than 1 in 11
    assert not tracer.leave(starts, np.broadcast_to(unit_vector(np.arctan(1.0 / 0.09), np.pi), (50, 3))).any()


def test_maps_that_rays_cannot_be_traced_on_are_refused() -> None:
    tilted = HeightMap(0.1 * HEIGHTS + np.arange(6)[:, np.newaxis], 0.5, 0.7)
    with pytest.raises(ParameterError, match="level the map first"):
        Tracer(tilted)
    side = int(np.sqrt(MOST_NODES)) + 1
    with pytest.raises(ParameterError, match="fit into 2 GB"):
        Tracer(HeightMap(np.broadcast_to(0.0, (side, side)), 1.0, 1.0, periodic=True))
