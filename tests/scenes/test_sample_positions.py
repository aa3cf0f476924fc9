"""Places in a picture: one in each pixel, and beside edges at distances of every magnitude."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from brdfdb.scenes import sample_positions
from brdfdb.scenes.scene import Scene

HEIGHT = 2.5  # of what the camera sees
WALL: dict[str, Any] = {"name": "wall", "material": "clay-vase", "shape": {"kind": "plane", "axis": (0, -1, 0)}}
BALL = {"name": "ball", "material": "clay-vase", "shape": {"kind": "sphere", "radius": 1}}


def scene_of(*objects: dict[str, Any], **more: Any) -> Scene:
    camera = {"position": (0.0, -5.0, 0.0), "height": HEIGHT, "aspect": 1.0}
    return Scene.model_validate({"ambient": 1.0, "camera": camera, "objects": list(objects), **more})


def test_even_places_are_one_in_each_pixel() -> None:
    places = sample_positions.even(7, 5, np.random.default_rng(1))
    column, row = (places[:, 0] * 5 + 7) / 2, (5 - places[:, 1] * 5) / 2
    expected = [[x, y] for y in range(5) for x in range(7)]
    np.testing.assert_array_equal(np.floor(np.stack([column, row], axis=1)), expected)
    assert np.std(column % 1.0) > 0.2


def test_a_limb_is_seen_at_distances_of_every_magnitude_on_both_sides() -> None:
    places = sample_positions.at_edges(scene_of(BALL), 48, 48, 4000, np.random.default_rng(2))
    assert places.shape == (4000, 2)
    depth = 1.0 - np.hypot(*(places.T * HEIGHT / 2.0))
    assert np.count_nonzero(depth > 0.0) / 4000 == pytest.approx(0.5, abs=0.03)
    # radially no further than along the grid, and at worst not half as far: each power of ten has its eighth
    decades, _ = np.histogram(np.log10(np.abs(depth)), bins=np.arange(-9.0, -1.0))
    assert np.all(np.abs(decades / 4000 - 1 / sample_positions.DECADES) < 0.03)
    theta = np.degrees(np.arcsin(1.0 - depth[depth > 0.0]))
    assert [np.mean(theta > limit) > 0.05 for limit in (85.0, 89.0, 89.9, 89.99)] == [True, True, True, True]


def test_terminators_and_the_edges_of_shadows_are_edges() -> None:
    wall = {**WALL, "shape": {**WALL["shape"], "position": (0, 1, 0)}}
    lights = [{"direction": (-1.0, 0.0, 0.0)}]
    places = sample_positions.at_edges(scene_of(BALL, lights=lights), 48, 48, 2000, np.random.default_rng(3))
    x, z = places.T * HEIGHT / 2.0
    near = (np.abs(x) < 1e-4) & (np.hypot(x, z) < 0.99)
    assert np.mean(near) > 0.05
    # light along x = y moves the shadow of the ball by 1 on the wall behind it: an ellipse from -0.4 to 2.4
    lights = [{"direction": (-1.0, -1.0, 0.0)}]
    places = sample_positions.at_edges(scene_of(BALL, wall, lights=lights), 48, 48, 2000, np.random.default_rng(4))
    x, z = places.T * HEIGHT / 2.0
    off = np.abs(np.hypot((x - 1.0) / np.sqrt(2.0), z) - 1.0)
    assert np.mean((off < 1e-4) & (np.hypot(x, z) > 1.01)) > 0.05


def test_a_picture_without_edges_has_no_places_beside_them() -> None:
    assert sample_positions.at_edges(scene_of(WALL), 8, 8, 100, np.random.default_rng(5)).shape == (0, 2)
