"""Shapes: where rays hit them, against closed forms, and which way normals and tangents point."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError

from brdfdb.scenes.shapes import Array, Box, Cylinder, PlaneShape, Revolution, Shape, Sphere

RANDOM = np.random.default_rng(1)
ROUNDING = 1e-13  # 6.4e-14 measured: lengths of about 5, and rays that graze
# A radius that rays meet, against the smooth profile: between two cones it bulges; 2.5e-4 measured
FACETS = 3e-4
FRAME = 1e-15  # 4.4e-16 measured
SLOPE = 2e-10  # of the derivative, by differences over 2e-6: 1.3e-10 measured

VASE = [(0.4, 0.0), (0.5, 0.15), (0.5, 0.85), (0.3, 1.14), (0.34, 1.36)]
SHAPES: dict[str, Shape] = {
    "plane": PlaneShape(kind="plane", size=(2.0, 3.0)),
    "sphere": Sphere(kind="sphere", radius=1.0),
    "box": Box(kind="box", size=(1.0, 1.5, 2.0)),
    "cylinder": Cylinder(kind="cylinder", radius=0.7, height=1.5),
    "revolution": Revolution(kind="revolution", profile=VASE),
}
EVERY = pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)


def rays(count: int = 2000) -> tuple[Array, Array]:
    """From a sphere of radius 5 towards places around the origin."""
    origins = RANDOM.normal(size=(count, 3))
    origins *= 5.0 / np.linalg.norm(origins, axis=1, keepdims=True)
    directions = RANDOM.uniform(-1.0, 1.0, (count, 3)) - origins
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def met(shape: Shape) -> tuple[Array, Array, NDArray[np.int64]]:
    """Points that random rays meet, directions of these rays, and which they are."""
    origins, directions = rays()
    t = shape.hit(origins, directions)
    hit = np.flatnonzero(np.isfinite(t))
    assert hit.size > 100
    return origins[hit] + t[hit, np.newaxis] * directions[hit], directions[hit], hit


@pytest.mark.parametrize(
    ("shape", "origin", "direction", "distance"),
    [
        (SHAPES["plane"], (0.9, 1.4, 2.0), (0.0, 0.0, -1.0), 2.0),
        (SHAPES["plane"], (1.1, 0.0, 2.0), (0.0, 0.0, -1.0), np.inf),
        (SHAPES["plane"], (0.0, 0.0, 2.0), (0.0, 0.0, 1.0), np.inf),
        (SHAPES["plane"], (0.0, 0.0, 2.0), (1.0, 0.0, 0.0), np.inf),
        (SHAPES["sphere"], (0.6, 0.0, 3.0), (0.0, 0.0, -1.0), 2.2),
        (SHAPES["sphere"], (1.1, 0.0, 3.0), (0.0, 0.0, -1.0), np.inf),
        (SHAPES["sphere"], (0.0, 0.0, 3.0), (0.0, 0.0, 1.0), np.inf),
        (SHAPES["box"], (-3.0, 0.7, 1.0), (1.0, 0.0, 0.0), 2.5),
        (SHAPES["box"], (-3.0, 0.8, 1.0), (1.0, 0.0, 0.0), np.inf),
        (SHAPES["box"], (0.2, 0.0, 5.0), (0.0, 0.0, -1.0), 3.0),
        (SHAPES["cylinder"], (-3.0, 0.0, 0.5), (1.0, 0.0, 0.0), 2.3),
        (SHAPES["cylinder"], (-3.0, 0.0, 1.6), (1.0, 0.0, 0.0), np.inf),
        (SHAPES["cylinder"], (0.3, 0.3, 4.0), (0.0, 0.0, -1.0), 2.5),
        (SHAPES["cylinder"], (0.0, 0.6, -1.0), (0.0, 0.0, 1.0), 1.0),
        (SHAPES["revolution"], (0.0, -3.0, 0.5), (0.0, 1.0, 0.0), 2.5),
        (SHAPES["revolution"], (0.1, 0.1, 3.0), (0.0, 0.0, -1.0), 3.0 - 1.36),
    ],
)
def test_a_ray_meets_a_shape_where_it_should(
    shape: Shape, origin: tuple[float, ...], direction: tuple[float, ...], distance: float
) -> None:
    found = shape.hit(np.array([origin]), np.array([direction]))[0]
    assert found == distance or abs(found - distance) < ROUNDING


@EVERY
def test_frames_are_right_handed_and_normals_face_the_ray(shape: Shape) -> None:
    points, directions, _ = met(shape)
    frame = shape.frame(points)
    assert np.abs(frame @ frame.transpose(0, 2, 1) - np.eye(3)).max() < ROUNDING
    assert np.abs(np.linalg.det(frame) - 1.0).max() < ROUNDING
    facing = np.sum(frame[:, 2] * directions, axis=1) < 0.0
    if not isinstance(shape, PlaneShape | Revolution):  # planes have backs; smooth normals are not those of cones
        assert np.all(facing)
    assert np.mean(facing) > (0.4 if isinstance(shape, PlaneShape) else 0.99)


@EVERY
def test_a_shape_that_is_moved_and_turned_is_the_same_shape(shape: Shape) -> None:
    # the axis towards x, turned by 90 degrees about it: the z axis of the shape is the scene's x
    moved = shape.model_copy(update={"position": (0.3, -0.2, 0.1), "axis": (2.0, 0.0, 0.0), "turn_deg": 90.0})
    axes = moved._axes
    assert np.abs(axes[2] - [1.0, 0.0, 0.0]).max() < ROUNDING
    origins, directions = rays(500)
    t = shape.hit(origins, directions)
    there = moved.hit(origins @ axes + [0.3, -0.2, 0.1], directions @ axes)
    assert np.array_equal(np.isfinite(t), np.isfinite(there))
    hit = np.isfinite(t)
    assert np.abs(there[hit] - t[hit]).max() < ROUNDING
    points = origins[hit] + t[hit, np.newaxis] * directions[hit]
    assert np.abs(moved.frame(points @ axes + [0.3, -0.2, 0.1]) - shape.frame(points) @ axes).max() < FRAME


@pytest.mark.parametrize("name", ["sphere", "cylinder", "revolution", "box"])
def test_tangents_run_around_counter_clockwise(name: str) -> None:
    tangent = SHAPES[name].frame(np.array([[0.5, 0.0, 0.7]]))[0, 0]
    assert np.abs(tangent - [0.0, 1.0, 0.0]).max() < ROUNDING


def test_a_turn_is_counter_clockwise_about_the_axis() -> None:
    turned = PlaneShape(kind="plane", turn_deg=90.0).frame(np.zeros((1, 3)))[0]
    assert np.abs(turned - [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]).max() < ROUNDING


@pytest.mark.parametrize(("name", "z"), [("plane", 0.0), ("cylinder", 1.5), ("box", 2.0), ("revolution", 1.36)])
def test_tangents_of_flat_tops_are_the_x_axis(name: str, z: float) -> None:
    frame = SHAPES[name].frame(np.array([[0.1, 0.2, z]]))[0]
    assert np.abs(frame - np.eye(3)).max() < ROUNDING


def test_a_straight_profile_is_a_cylinder() -> None:
    straight = Revolution(kind="revolution", profile=[(0.7, 0.0), (0.7, 0.4), (0.7, 1.5)])
    origins, directions = rays()
    there, here = straight.hit(origins, directions), SHAPES["cylinder"].hit(origins, directions)
    hit = np.isfinite(here)
    assert np.array_equal(hit, np.isfinite(there))
    assert np.abs(there[hit] - here[hit]).max() < ROUNDING


def test_a_slanted_profile_is_a_cone() -> None:
    cone = Revolution(kind="revolution", profile=[(1.0, 0.0), (0.5, 1.0)])
    t = cone.hit(np.array([[-3.0, 0.0, 0.5]]), np.array([[1.0, 0.0, 0.0]]))[0]
    assert abs(t - 2.25) < ROUNDING
    normal = cone.frame(np.array([[-0.75, 0.0, 0.5]]))[0, 2]
    assert np.abs(normal - np.array([-2.0, 0.0, 1.0]) / np.sqrt(5.0)).max() < ROUNDING


def test_a_profile_passes_its_points_and_does_not_overshoot() -> None:
    shape = Revolution(kind="revolution", profile=VASE)
    radius, height = np.array(VASE).T
    assert np.abs(shape.radius_at(height)[0] - radius).max() < ROUNDING
    between = shape.radius_at(np.linspace(0.15, 0.85, 50))[0]
    assert np.abs(between - 0.5).max() < ROUNDING
    z = np.linspace(0.01, 1.35, 500)
    step = 1e-6
    slope = (shape.radius_at(z + step)[0] - shape.radius_at(z - step)[0]) / (2.0 * step)
    assert np.abs(slope - shape.radius_at(z)[1]).max() < SLOPE


def test_cones_follow_the_profile() -> None:
    shape = SHAPES["revolution"]
    points, _, _ = met(shape)
    side = (points[:, 2] > 1e-9) & (points[:, 2] < 1.36 - 1e-9)
    radius = np.hypot(points[side, 0], points[side, 1])
    assert np.abs(radius - shape.radius_at(points[side, 2])[0]).max() < FACETS


@pytest.mark.parametrize("profile", [[(1.0, 0.0), (0.0, 1.0)], [(1.0, 0.0), (1.0, 0.0)], [(1.0, 1.0), (1.0, 0.0)]])
def test_a_profile_needs_radii_and_heights_that_increase(profile: list[tuple[float, float]]) -> None:
    with pytest.raises(ValidationError, match="needs radii above 0 and heights that increase"):
        Revolution(kind="revolution", profile=profile)
