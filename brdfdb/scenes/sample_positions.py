"""Sample positions in a picture: spread evenly over it, and crowded at limbs, terminators and edges of shadows."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from brdfdb.scenes.gbuffer import gather_at
from brdfdb.scenes.scene import Scene
from brdfdb.scenes.shapes import Array

# Least distance of a position from an edge, in powers of ten below the width of a pixel. A limb as wide as a pixel is
# seen at 89.99 degrees there
DECADES = 8
_HALVINGS = 32  # halvings of a pixel that locate an edge more precisely than the nearest position
_TRIES = 4  # draws of positions; each draws twice the wanted number, because the edge may leave the pixel
_PRIME = np.uint64(1_000_003)


def even(width: int, height: int, rng: np.random.Generator) -> Array:
    """Return places (height * width, 2), a random one in each pixel of a picture, row by row from the top.

    Places are those of `brdfdb.scenes.scene.Camera.through`.
    """
    column, row = np.meshgrid(np.arange(width), np.arange(height))
    turn = rng.random((2, height, width))
    return _places(np.stack([column + turn[0], row + turn[1]], axis=-1).reshape(-1, 2), width, height)


def at_edges(scene: Scene, width: int, height: int, count: int, rng: np.random.Generator) -> Array:
    """Return places (N, 2) near edges, with distances from the edges that are even in their logarithm.

    Edges are searched between places that are a pixel apart. N is `count`, or less if the scene, which must not be
    recorded, has few edges. Each place is drawn independently: a point on an edge between two neighbours of a grid,
    across or down, then one of its two sides, then a distance along the grid, from the width of a pixel down to
    `DECADES` powers of ten less.

    Rays on the two sides of an edge meet different objects, directly or in a mirror, different faces of an object, or
    different lights. Edges are limbs and outlines, terminators and the edges of shadows. At a distance d from its limb
    a sphere of radius R is seen at sqrt(2 d / R) from grazing, so that even logarithms cover all grazing angles
    equally.
    """
    hard = scene.model_copy(
        update={
            "lights": [light.model_copy(update={"solid_angle_sr": 0.0}) for light in scene.lights],
            "environment": None,
        }
    )
    size = np.array([width, height], dtype=np.float64)

    def met(pixels: Array) -> NDArray[np.uint64]:
        return _met(hard, _places(pixels, width, height))

    corners, axes = _straddling(met, width, height, rng)
    positions = [np.empty((0, 2))]
    missing = count if len(corners) else 0
    for _ in range(_TRIES):
        if missing <= 0:
            break
        chosen = rng.integers(len(corners), size=2 * missing)
        near, axis = corners[chosen], axes[chosen]
        rows = np.arange(len(near))
        near[rows, 1 - axis] += rng.random(len(near)) - 0.5  # a random point along the edge in this pixel
        far = near + np.eye(2)[axis]
        first = met(near)
        differs = first != met(far)
        near, far, first, axis = near[differs], far[differs], first[differs], axis[differs]
        for _ in range(_HALVINGS):
            middle = (near + far) / 2.0
            same = (met(middle) == first)[:, np.newaxis]
            near, far = np.where(same, middle, near), np.where(same, far, middle)
        before = rng.random(len(near)) < 0.5
        place = np.where(before[:, np.newaxis], near, far)
        away = 10.0 ** (-DECADES * rng.random(len(near)))
        place[np.arange(len(near)), axis] += np.where(before, -away, away)
        place = place[np.all((place >= 0.0) & (place <= size), axis=1)]
        positions.append(place[:missing])
        missing -= len(positions[-1])
    return _places(np.concatenate(positions), width, height)


def _straddling(
    met: Callable[[Array], NDArray[np.uint64]], width: int, height: int, rng: np.random.Generator
) -> tuple[Array, NDArray[np.int64]]:
    """Return places (N, 2) of a grid, in pixels, and the axis along which the next place lies beyond an edge."""
    grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1) + rng.random(2)
    known = met(grid.reshape(-1, 2)).reshape(height, width)
    across = grid[:, :-1][known[:, :-1] != known[:, 1:]]
    down = grid[:-1][known[:-1] != known[1:]]
    return np.concatenate([across, down]), np.repeat([0, 1], [len(across), len(down)])


def _places(pixels: Array, width: int, height: int) -> Array:
    """Return places in halves of the height, from the middle, of places in pixels from the upper left corner."""
    return np.stack([2.0 * pixels[:, 0] - width, height - 2.0 * pixels[:, 1]], axis=1) / height


def _met(scene: Scene, places: Array) -> NDArray[np.uint64]:
    """Return numbers (N,) that are the same where rays meet the same objects, faces of them and lights."""
    view = gather_at(scene, places)
    numbers = {item.name: number + 1 for number, item in enumerate(scene.objects)}
    met = np.zeros(len(places), dtype=np.uint64)
    for points in view.points:
        state = 2 * numbers[points.name] + (points.wr[:, 2] > 0.0).astype(np.uint64)
        for irradiance in points.irradiance:
            state = 2 * state + (irradiance > 0.0)
        at = points.at if points.via is None else view.points[points.via].at[points.at]
        met[at] = met[at] * _PRIME + state.astype(np.uint64)
    return met
