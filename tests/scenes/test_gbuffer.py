"""What a camera sees of a scene: which way is up, right and along the grain, shadows, mirrors, recorded directions."""

from __future__ import annotations

import itertools
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from brdfdb.errors import ParameterError
from brdfdb.scenes.gbuffer import VisiblePoints, gather
from brdfdb.scenes.image import write_channels
from brdfdb.scenes.scene import Scene
from brdfdb.scenes.shapes import Array
from tests.scenes import a_scene
from tests.scenes.a_scene import ABOVE, SPHERE

ROUNDING = 1e-15  # 3.3e-16 measured
LIMB = 3e-13  # of a radius of 1, next to the limb, where a normal is least certain: 2e-13 measured
SINGLE = 2e-7  # the same of 32 bit floats: 1.2e-7 measured
MOVED = 1.5e-9  # 1.3e-9 measured, moved by ten thousand radii: next to limbs, where hits are least certain
FAR = {**a_scene.FAR, "height": 2.2}
WIDTH = 40


def scene(
    shape: dict[str, Any] | None = None, *, light: Any = (0.0, -1.0, 0.0), material: str = "clay-vase", **fields: Any
) -> Scene:
    """A sphere, or another shape, lit from the camera."""
    return a_scene.scene(material, shape, **{"lights": [{"direction": list(light)}], "camera": FAR, **fields})


def only(view_of: Scene, width: int = WIDTH) -> VisiblePoints:
    (points,) = gather(view_of, width).points
    return points


def test_irradiance_of_a_sphere_is_pi_times_the_cosine() -> None:
    points = only(scene(light=(1.0, -1.0, 0.5)))
    row, column = np.divmod(points.at, WIDTH)
    x, z = ((2.0 * column + 1.0) / WIDTH - 1.0) * 1.1, (1.0 - (2.0 * row + 1.0) / WIDTH) * 1.1
    normal = np.stack([x, -np.sqrt(1.0 - x * x - z * z), z], axis=1)
    expected = np.pi * np.maximum(normal @ [1.0, -1.0, 0.5], 0.0) / 1.5
    assert np.abs(points.irradiance[0] - expected).max() < LIMB
    assert np.abs(points.wr[:, 2] + normal[:, 1]).max() < LIMB


def test_angles_between_viewer_and_light_are_those_of_the_scene() -> None:
    points = only(scene(light=(3.0, -4.0, 0.0)))
    assert np.abs(np.sum(points.wi[0] * points.wr, axis=1) - 0.8).max() < ROUNDING
    assert np.abs(np.linalg.norm(points.wi, axis=-1) - 1.0).max() < ROUNDING


@pytest.mark.parametrize(
    ("grain_deg", "towards"), [(0.0, (0.6, 0.0, 0.8)), (90.0, (0.0, -0.6, 0.8)), (180.0, (-0.6, 0.0, 0.8))]
)
def test_the_grain_turns_counter_clockwise_from_the_tangent(grain_deg: float, towards: tuple[float, ...]) -> None:
    # A plane seen from above, its x axis to the right as in the picture, light from the right
    points = only(scene({"kind": "plane"}, light=(0.6, 0.0, 0.8), camera=ABOVE, grain_deg=grain_deg))
    assert np.abs(points.wi[0] - towards).max() < ROUNDING
    assert np.abs(points.wr - [0.0, 0.0, 1.0]).max() < ROUNDING


def test_the_grain_of_a_cylinder_runs_around_it() -> None:
    shape = {"kind": "cylinder", "radius": 1.0, "height": 2.0, "position": [0.0, 0.0, -1.0]}
    points = only(scene(shape, light=(0.0, -0.8, 0.6)))
    middle = np.argmin(np.abs(points.wr[:, 0]))  # where the surface faces the camera, but for half a pixel
    assert abs(points.wi[0, middle, 1] - 0.6) < ROUNDING  # from above: across the grain
    assert abs(points.wi[0, middle, 0]) < 0.8 * 1.1 / WIDTH + ROUNDING


def test_a_pinhole_looks_through_the_angle_of_view() -> None:
    camera = {"position": [0.0, 0.0, 2.0], "up": [0.0, 1.0, 0.0], "fov_deg": 90.0, "aspect": 1.0}
    points = only(scene({"kind": "plane"}, light=(0.0, 0.0, 1.0), camera=camera))
    tan = np.hypot(points.wr[:, 0], points.wr[:, 1]) / points.wr[:, 2]
    assert abs(tan.max() - np.sqrt(2.0) * (1.0 - 1.0 / WIDTH)) < ROUNDING  # the middle of a corner pixel


@pytest.mark.parametrize("shadows", [True, False])
def test_a_sphere_casts_a_round_shadow(shadows: bool) -> None:
    ball = {"name": "ball", "material": "foam", "shape": {**SPHERE, "position": [0.0, 0.0, 4.0]}}
    camera = {"position": [0.0, -6.0, 6.0], "height": 4.0, "aspect": 1.0}  # the ball is above the middle of the view
    view = gather(scene({"kind": "plane"}, light=(0.0, 0.0, 1.0), camera=camera, more=[ball], shadows=shadows), 200)
    (plane,) = (each for each in view.points if each.name == "thing")
    area = np.count_nonzero(plane.irradiance[0] == 0.0) * (4.0 / 200) ** 2 * np.sqrt(2.0)
    assert abs(area - np.pi * shadows) < 0.004  # 0.0036 measured: whole pixels at the edge


@pytest.mark.parametrize("camera", [{"fov_deg": 24.0}, {"height": 2.5}], ids=["pinhole", "far"])
@pytest.mark.parametrize(("scale", "offset"), [(1e-10, 0.0), (1e-4, 0.0), (1e5, 0.0), (1.0, 100.0), (1.0, 1e4)])
def test_a_scaled_and_a_moved_scene_are_the_same_picture(camera: dict[str, float], scale: float, offset: float) -> None:
    def put(scale: float, offset: float) -> list[VisiblePoints]:
        def at(*place: float) -> list[float]:
            return [scale * each + offset for each in place]

        ball = {"kind": "sphere", "radius": 0.5 * scale, "position": at(0.0, 0.0, 0.5)}
        vase = {"kind": "revolution", "position": at(1.0, 0.0, 0.0)}
        vase["profile"] = [[scale * radius, scale * height] for radius, height in ((0.4, 0.0), (0.2, 0.5), (0.4, 1.0))]
        more = [
            {"name": "ball", "material": "aluminum-cylinder-13b", "shape": ball},
            {"name": "vase", "material": "foam", "shape": vase},
        ]
        seen_from = {"position": at(0.3, -6.0, 2.0), "target": at(0.0, 0.0, 0.5)}
        seen_from |= {key: value * (scale if key == "height" else 1.0) for key, value in camera.items()}
        lights = [{"direction": [-1.0, -0.5, 1.0], "solid_angle_sr": 0.1}, {"direction": [0.3, -1.0, 0.1]}]
        floor = {"kind": "plane", "position": at(0.0, 0.0, 0.0)}
        return gather(scene(floor, camera=seen_from, lights=lights, more=more), 60).points

    for one, other in zip(put(1.0, 0.0), put(scale, offset), strict=True):
        assert (one.name, one.via) == (other.name, other.via)
        assert np.array_equal(one.at, other.at)
        for name in ("wr", "wi", "irradiance", "beyond"):
            assert np.abs(getattr(one, name) - getattr(other, name)).max() < MOVED, name


@pytest.mark.parametrize("solid_angle_sr", [0.0, 0.01, 0.2, 1.0])
def test_a_disc_of_light_is_as_strong_as_a_direction(solid_angle_sr: float) -> None:
    lights = [{"direction": [0.0, 0.0, 1.0], "solid_angle_sr": solid_angle_sr, "samples": 50}]
    points = only(scene({"kind": "plane"}, camera=ABOVE, lights=lights))
    assert np.abs(points.irradiance.sum(axis=0) - np.pi).max() < ROUNDING
    mean = points.wi[:, 0].mean(axis=0)  # samples are even all around
    assert np.hypot(mean[0], mean[1]) <= 0.006 * np.sqrt(solid_angle_sr)  # 0.0025 measured for 0.2 sr


def test_a_mirror_shows_a_light_only_inside_its_disc() -> None:
    lights = [{"direction": [0.0, -1.0, 0.0], "solid_angle_sr": 0.05, "strength": 2.0}]
    points = only(scene(lights=lights, ambient=0.25))
    # on a sphere the mirror direction turns twice as fast as the normal
    turned = 2.0 * np.arccos(points.wr[:, 2]) < np.arccos(1.0 - 0.05 / (2.0 * np.pi))
    assert 0 < np.count_nonzero(turned) < turned.size
    # 2 pi is its radiance times its projected solid angle, pi sin^2 of the radius
    disc = 2.0 * np.pi / (0.05 * (1.0 - 0.05 / (4.0 * np.pi)))
    assert np.abs(points.beyond - np.where(turned, 0.25 + disc, 0.25)).max() < ROUNDING * disc


def test_a_mirror_shows_what_stands_before_it() -> None:
    # looked at from the front, a mirror at 45 degrees shows the floor, which is lit from above, and no ambient light
    mirror = {"kind": "plane", "axis": [0.0, -1.0, -1.0], "size": [2.0, 2.0]}
    floor = {"name": "floor", "material": "foam", "shape": {"kind": "plane", "position": [0.0, 0.0, -3.0]}}
    view = gather(scene(mirror, material="aluminum-cylinder-13b", light=(0.0, -1.0, 4.0), ambient=0.1, more=[floor]), 8)
    seen = {(each.name, each.via): each for each in view.points}
    shown = seen["floor", 0]
    assert view.points[0].name == "thing"
    assert np.array_equal(np.sort(shown.at), np.arange(len(view.points[0].wr)))
    assert np.all(view.points[0].beyond == 0.0)
    assert np.abs(shown.wr - [0.0, 0.0, 1.0]).max() < ROUNDING  # the floor is seen from straight above


def test_a_mirror_in_a_mirror_shows_no_light_through_what_stands_in_the_way() -> None:
    # a periscope: by the lower mirror the camera sees the upper one, which faces the light; a lid covers its left half
    def mirror(z: float, axis: list[float]) -> dict[str, Any]:
        return {"kind": "plane", "position": [0.0, 0.0, z], "axis": axis, "size": [1.0, 1.0]}

    lid = {"kind": "plane", "position": [-0.5, -3.0, 3.0], "axis": [0.0, -1.0, 0.0], "size": [1.0, 4.0]}
    more = [
        {"name": "upper", "material": "aluminum-cylinder-13b", "shape": mirror(3.0, [0.0, -1.0, -1.0])},
        {"name": "lid", "material": "foam", "shape": lid},
    ]
    lights = [{"direction": [0.0, -1.0, 0.0], "solid_angle_sr": 0.2}]
    of = scene(mirror(0.0, [0.0, -1.0, 1.0]), material="aluminum-cylinder-13b", lights=lights, ambient=0.1, more=more)
    points = gather(of, WIDTH).points
    (upper,) = (each for each in points if each.name == "upper" and each.via == 0)
    covered = upper.beyond == 0.0
    # the lid ends in the middle: mirrors keep left and right
    column = points[0].at[upper.at] % WIDTH
    assert np.array_equal(covered, column < WIDTH // 2)
    assert np.all(upper.beyond[~covered] > 10.0)


def test_more_rays_fall_on_the_same_pixels() -> None:
    one, four = (gather(scene(), WIDTH, across=across) for across in (1, 2))
    assert four.samples == 4
    count = np.bincount(four.points[0].at, minlength=WIDTH**2)
    assert count.max() == 4
    assert set(one.points[0].at) <= set(np.flatnonzero(count))


def recorded(path: Path, **fields: Any) -> Scene:
    return scene({"kind": "recorded", "file": str(path)}, **fields)


def normals() -> Array:
    """What a renderer writes for the sphere: normals in the scene, 0 around it."""
    row = ((2.0 * np.arange(WIDTH) + 1.0) / WIDTH - 1.0) * 1.1
    x, z = np.meshgrid(row, -row)
    y = -np.sqrt(np.maximum(1.0 - x * x - z * z, 0.0))
    return np.where((y < 0.0)[..., np.newaxis], np.stack([x, y, z], axis=-1), 0.0)


@pytest.mark.parametrize("suffix", [".npz", ".exr"])
def test_recorded_normals_are_seen_as_the_shape_is(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"sphere{suffix}"
    if suffix == ".npz":
        np.savez(path, normal=normals())
    else:
        write_channels(path, {}, {f"normal.{axis}": normals()[..., i] for i, axis in enumerate("XYZ")})
    light = (1.0, -1.0, 0.5)
    traced, read = only(scene(light=light)), only(recorded(path, light=light), 1)
    assert np.array_equal(traced.at, read.at)
    near = LIMB if suffix == ".npz" else SINGLE
    for name in ("wr", "wi", "irradiance"):
        assert np.abs(getattr(traced, name) - getattr(read, name)).max() < near


@pytest.mark.parametrize(
    ("tangent", "towards"), [(None, (0.0, 0.6, 0.8)), ((0.0, 0.1, 1.0), (0.6, 0.0, 0.8))], ids=["horizontal", "given"]
)
def test_a_recorded_tangent_is_the_x_axis(
    tmp_path: Path, tangent: tuple[float, ...] | None, towards: tuple[float, ...]
) -> None:
    arrays = {"normal": np.tile([0.0, -1.0, 0.0], (2, 2, 1))}
    if tangent is not None:  # one that is not quite square to the normal is made so
        arrays["tangent"] = np.tile(np.array(tangent) / np.linalg.norm(tangent), (2, 2, 1))
    np.savez(tmp_path / "flat.npz", **arrays)
    points = only(recorded(tmp_path / "flat.npz", light=(0.0, -0.8, 0.6)), 1)
    assert np.abs(points.wi[0] - towards).max() < ROUNDING


def test_recorded_directions_are_used_as_they_are(tmp_path: Path) -> None:
    wr = np.tile([0.0, 0.0, 1.0], (2, 3, 1))
    wi = np.tile([0.6, 0.0, 0.8], (1, 2, 3, 1))
    wr[1, 2] = 0.0
    np.savez(tmp_path / "directions.npz", wr=wr, wi=wi)
    view = gather(recorded(tmp_path / "directions.npz"), 1)
    assert (view.width, view.height) == (3, 2)
    assert np.array_equal(view.points[0].at, np.arange(5))
    assert np.abs(view.points[0].irradiance - np.pi * 0.8).max() < ROUNDING


def test_recorded_directions_are_turned_with_the_grain(tmp_path: Path) -> None:
    wr, wi = np.tile([0.0, 0.6, 0.8], (2, 2, 1)), np.tile([0.6, 0.0, 0.8], (1, 2, 2, 1))
    np.savez(tmp_path / "directions.npz", wr=wr, wi=wi)
    points = only(recorded(tmp_path / "directions.npz", grain_deg=90.0), 1)
    assert np.abs(points.wr - [0.6, 0.0, 0.8]).max() < ROUNDING
    assert np.abs(points.wi - [0.0, -0.6, 0.8]).max() < ROUNDING


def test_a_file_without_directions_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "wrong.npz"
    up = np.tile([0.0, 0.0, 1.0], (2, 2, 2, 1))
    refused: list[tuple[dict[str, Any], str]] = [
        ({"albedo": np.ones((2, 2, 3))}, "has neither `normal`"),
        ({"wr": np.ones((2, 2, 3))}, "has neither `normal`"),
        ({"normal": np.ones((2, 2))}, r"normal has the shape \(2, 2\)"),
        ({"normal": np.ones((4, 4, 6))}, r"normal has the shape \(4, 4, 6\)"),
        ({"normal": np.ones((4, 4, 2))}, r"normal has the shape \(4, 4, 2\)"),
        ({"normal": np.ones((2, 2, 3)), "tangent": np.ones((3, 2, 3))}, r"as many pixels as normal has, \(2, 2\)$"),
        ({"wr": np.ones((2, 2, 3)), "wi": np.ones((2, 2, 3))}, r"wi has .* \(lights, height, width, 3\)"),
        ({"normal": np.zeros((2, 2, 3))}, "shows nothing"),
        ({"normal": np.full((2, 2, 3), np.nan)}, "shows nothing"),
        ({"normal": np.array([[None]])}, "is not an .npz file of numbers"),
        ({"normal": np.array([["x"]])}, "the arrays of these names are not numbers"),
        ({"wr": up[0], "wi": up}, "wi has 2 lights, the scene 1"),
    ]
    for arrays, sentence in refused:
        np.savez(path, **arrays)
        with pytest.raises(ParameterError, match=rf"wrong\.npz: .*{sentence}"):
            gather(recorded(path), 1)


def test_a_file_of_another_kind_is_refused(tmp_path: Path) -> None:
    for name, content in (("text", b"no file of numbers"), ("empty", b"")):
        for suffix in ("npz", "exr"):
            (tmp_path / f"{name}.{suffix}").write_bytes(content)
    write_channels(tmp_path / "picture.exr", {}, {name: np.zeros((2, 2)) for name in "RGB"})
    sentences = {
        "text.npz": "is not an .npz file of numbers",
        "empty.npz": "is not an .npz file of numbers",
        "text.exr": "is not an OpenEXR file",
        "empty.exr": "is not an OpenEXR file",
        "no.npz": "there is no such file",
        "picture.exr": "has neither `normal`",
    }
    for name, sentence in sentences.items():
        with pytest.raises(ParameterError, match=f"^{re.escape(f'{tmp_path / name}: {sentence}')}"):
            gather(recorded(tmp_path / name), 1)


def test_a_scene_that_shows_nothing_of_a_part_is_refused() -> None:
    with pytest.raises(ValueError, match=r"lights\.0: lights no visible point"):
        gather(scene({"kind": "plane"}, light=(0.0, 0.0, -1.0), camera=ABOVE), WIDTH)
    behind = {"name": "behind", "material": "foam", "shape": {**SPHERE, "position": [0.0, -9.0, 0.0]}}
    with pytest.raises(ValueError, match="objects: no ray of 40 x 40 pixels meets behind"):
        gather(scene(more=[behind]), WIDTH)
    hidden = {"name": "hidden", "material": "foam", "shape": {**SPHERE, "position": [0.0, 9.0, 0.0]}}
    cylinder = {"kind": "cylinder", "radius": 1.0, "height": 2.0}
    for kind, camera in itertools.product((SPHERE, cylinder), ({"fov_deg": 60.0}, {"height": 0.5})):
        inside = {"position": [0.0, 0.1, 0.5], "target": [0.0, 1.0, 0.5], **camera}
        with pytest.raises(ValueError, match=r"camera\.position: is inside thing, which is black from there"):
            gather(scene(kind, camera=inside, ambient=0.1, more=[hidden]), WIDTH)
    with pytest.raises(ValidationError, match="must be the only object"):
        scene({"kind": "recorded", "file": "x.npz"}, more=[hidden])


def test_a_picture_of_a_wrong_size_is_refused() -> None:
    sizes = {(10_000_000, 1): "width", (8192, 3): "across", (0, 1): "width", (4, 0): "across"}
    for (width, across), parameter in sizes.items():
        with pytest.raises(ParameterError, match=f"^{parameter}: "):
            gather(scene(), width, across=across)


def test_the_back_of_a_plane_may_be_seen() -> None:
    back = {"kind": "plane", "axis": [0.0, 0.0, -1.0]}
    points = only(scene(back, camera=ABOVE, lights=[], ambient=0.1))
    assert np.abs(points.wr - [0.0, 0.0, -1.0]).max() < ROUNDING
