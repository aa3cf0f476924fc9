"""Light from all around: which way it is turned, unbiased estimates of what is reflected, shadows, bad input."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError
from scipy import ndimage

from brdfdb.errors import ParameterError
from brdfdb.geometry import unit_vector
from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.materials import Material, Source, presets
from brdfdb.reference import ward_1992
from brdfdb.scenes.environment import Environment
from brdfdb.scenes.gbuffer import gather
from brdfdb.scenes.image import write_channels
from brdfdb.scenes.renderer import Reflector, render
from brdfdb.scenes.scene import Scene
from brdfdb_pipelines.scene_file import SceneError, load
from tests.scenes import a_scene
from tests.scenes.a_scene import COARSE, SPHERE, TILTED

Array = NDArray[np.float64]

ROUNDING = 1e-15  # 8.9e-16 measured
SINGLE = 6e-8  # half of the last bit of 32 bit floats
STANDARD_ERRORS = 5.0
PRECISE = 0.003  # standard error of 800 estimates of 16 directions, relative: 0.0029 measured, of copper at 75 degrees
FALLS = 0.09  # the error of 64 directions over that of 4: 0.082 measured, of varnish; 0.25 if they were independent
NOISE = 0.008  # of a pixel in uniform light, 64 directions: 0.0076 measured, of copper
QUADRATURE = 1e-6  # absolute, of the albedos that estimates are held against
ALBEDO = 1e-3  # of those that ambient light meets: see test_render.py

WAVELENGTH = np.array([400.0, 550.0, 700.0])
FAR = {**a_scene.FAR, "height": 2.2}
ROOM = np.array([[4.0, 4.0, 4.0, 4.0], [1.0, 2.0, 0.5, 0.25], [0.1, 0.0, 0.2, 0.1]])
# Lambert; rough Oren-Nayar; Ward, anisotropic, and as faint as varnish; He-Torrance
MATERIALS = ("foam", "clay-vase", "rolled-brass", "varnished-plywood", "scene-copper-sphere")


def around(rows: Any = ((1.0,),), **fields: Any) -> Environment:
    return Environment.model_validate({"rows": np.asarray(rows).tolist(), **fields})


def scene(material: str, environment: Any, shape: dict[str, Any] | None = None, **fields: Any) -> Scene:
    lit = {} if environment is None else {"environment": environment}
    return a_scene.scene(material, shape, **{"camera": FAR, **lit, **fields})


def estimates(source: Source, wr: Array, environment: Environment, drawn_by: Source | None = None) -> Array:
    """Return the radiance (N, L) of surfaces that face up, x along the grain, towards viewers (N, 3)."""
    drawn = environment.drawn(drawn_by or source, WAVELENGTH, wr, (0,))
    weight = environment.radiance(drawn.wi) * np.maximum(drawn.wi[..., 2], 0.0) * drawn.solid_angle
    f_r = source.brdf_at(source.evaluated_at(WAVELENGTH))(drawn.wi.reshape(-1, 3), np.tile(wr, (len(drawn.wi), 1)))
    return np.asarray(np.sum(f_r.reshape(*weight.shape, -1) * weight[..., np.newaxis], axis=0))


def reference_radiance(rows: Array, wi: Array) -> Array:
    """Bilinear, as the class says it: azimuth 180 to -180 degrees from left to right, middles of pixels."""
    theta_deg, phi_deg = np.degrees(np.arccos(wi[..., 2])), np.degrees(np.arctan2(wi[..., 1], wi[..., 0]))
    at = theta_deg / 180.0 * rows.shape[0] - 0.5, (180.0 - phi_deg) / 360.0 * rows.shape[1] - 0.5 + 1.0
    return np.asarray(ndimage.map_coordinates(np.pad(rows, ((0, 0), (1, 1)), "wrap"), at, order=1, mode="nearest"))


def test_the_picture_is_what_one_sees_from_inside() -> None:
    rows = np.arange(1.0, 7.0)[:, np.newaxis] * 10.0 + np.arange(8.0)
    for row, column in ((0, 0), (2, 3), (5, 7)):
        theta, phi = np.radians((row + 0.5) * 30.0), np.radians(180.0 - (column + 0.5) * 45.0)
        assert abs(around(rows).radiance(unit_vector(theta, phi)) - rows[row, column]) < ROUNDING


def test_between_pixels_radiance_is_bilinear_and_goes_around() -> None:
    random = np.random.default_rng(1992)
    rows, towards = random.random((5, 7)), random.normal(size=(1000, 3))
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    assert np.abs(around(rows).radiance(towards) - reference_radiance(rows, towards)).max() < ROUNDING
    seam = [unit_vector(1.2, np.pi - 1e-9), unit_vector(1.2, -np.pi + 1e-9)]
    assert abs(np.subtract(*around(rows).radiance(np.array(seam)))) < 1e-8


# Columns are at azimuths of 135, 45, -45 and -135 degrees
@pytest.mark.parametrize(
    ("camera", "seen"),
    [((0.0, -0.6), 1.5), ((-0.6, 0.0), 3.0), ((0.0, 0.6), 6.0), ((0.6, 0.0), 4.5)],
    ids=["from -y", "from -x", "from +y", "from +x"],
)
def test_a_mirror_shows_what_is_across(camera: tuple[float, float], seen: float) -> None:
    rows = [[1.0, 2.0, 4.0, 8.0], [0.0, 0.0, 0.0, 0.0]]
    from_there = {"position": [*camera, 0.8], "height": 1.0, "aspect": 1.0}
    of = scene("mirror", {"rows": rows}, {"kind": "plane"}, camera=from_there)
    white = scene("mirror", None, {"kind": "plane"}, camera=from_there, ambient=1.0)
    ratio = render(of, gather(of, 2)) / render(white, gather(white, 2))
    assert np.abs(ratio - seen).max() < ROUNDING


def test_a_mirror_shows_an_object_in_place_of_what_lies_beyond() -> None:
    # the wall is square to what the mirror shows of it, and has the environment behind the camera in front of it
    wall = {"kind": "plane", "position": [0.0, 3.0, 4.0], "axis": [0.0, -0.6, -0.8]}
    more = [{"name": "wall", "material": "white", "shape": wall}]
    of = scene("mirror", {"rows": [[5.0], [1.0]]}, {"kind": "plane"}, camera=TILTED, more=more, shadows=False)
    mirror, shown = gather(of, 2).points
    assert (shown.name, shown.via) == ("wall", 0)
    assert not mirror.beyond.any()
    assert shown.irradiance.sum(axis=0).min() > 1.0


def test_behind_all_objects_the_picture_is_seen_as_it_is() -> None:
    # from the middle towards +x, where the middle of the picture is: its columns run to the right
    rows = np.array([np.arange(1.0, 17.0)] * 8)
    camera = {"position": [0.0, 0.0, 0.0], "target": [1.0, 0.0, 0.0], "fov_deg": 60.0, "aspect": 1.0}
    of = scene("white", {"rows": rows.tolist()}, {**SPHERE, "radius": 0.01, "position": [1.0, 0.0, 0.0]}, camera=camera)
    image = render(of, gather(of, 64, across=2))[4, :, 0]
    assert np.all(np.diff(image) > 0.0)
    assert abs(image.mean() - 8.5) < 1e-12
    # the same without an object in the way
    assert abs(around(rows).radiance(np.array([1.0, 0.0, 0.0])) - 8.5) < 1e-12


@pytest.mark.parametrize("name", MATERIALS)
@pytest.mark.parametrize(("theta_deg", "phi_deg"), [(0.0, 0.0), (40.0, 30.0), (75.0, 70.0)])
def test_estimates_in_uniform_light_are_unbiased(name: str, theta_deg: float, phi_deg: float) -> None:
    theta, phi, count = np.radians(theta_deg), np.radians(phi_deg), 800
    parameters = presets()[name].arguments(presets()[name].evaluated_at(WAVELENGTH))
    albedo = directional_albedo(presets()[name].spec, theta, phi, tolerance=QUADRATURE, **parameters).albedo
    found = estimates(presets()[name], np.tile(unit_vector(theta, phi), (count, 1)), around(samples=16))
    standard_error = found.std(axis=0, ddof=1) / np.sqrt(count)
    assert np.all(standard_error < PRECISE * albedo)
    assert np.all(np.abs(found.mean(axis=0) - albedo) < STANDARD_ERRORS * standard_error + QUADRATURE)


@pytest.mark.parametrize("name", MATERIALS)
def test_the_error_falls_faster_than_that_of_independent_directions(name: str) -> None:
    wr = np.tile(unit_vector(np.radians(40.0), 0.5), (400, 1))
    few, many = (estimates(presets()[name], wr, around(ROOM, samples=samples)).std(axis=0) for samples in (4, 64))
    assert np.all(many < FALLS * few)


@pytest.mark.parametrize("grain_deg", [0.0, 60.0])
def test_a_room_is_reflected_as_by_a_grid_over_the_hemisphere(grain_deg: float) -> None:
    room = around(ROOM, samples=64).model_dump()
    of = scene("rolled-brass", room, {"kind": "plane"}, camera=TILTED, grain_deg=grain_deg)
    found = render(of, gather(of, 40))[..., 0]
    steps = 500
    cos, phi = (np.arange(steps) + 0.5) / steps, (np.arange(2 * steps) + 0.5) * np.pi / steps
    cos, phi = np.meshgrid(cos, phi, indexing="ij")
    towards = unit_vector(np.arccos(cos), phi)  # in the scene; the grain is turned from x
    brass, grain = presets()["rolled-brass"].parameters, np.radians(grain_deg)
    f_r = ward_like(np.arccos(cos), phi - grain, np.arccos(0.8), -np.pi / 2.0 - grain, brass)
    expected = np.sum(f_r * reference_radiance(ROOM, towards) * cos) * np.pi / steps**2
    standard_error = found.std(ddof=1) / np.sqrt(found.size)
    assert standard_error < 0.001 * expected
    assert abs(found.mean() - expected) < STANDARD_ERRORS * standard_error


def ward_like(theta_i: Array, phi_i: Array, theta_r: float, phi_r: float, p: Any) -> Array:
    """Ward's eq. 5a, written out; `test_ward_like_is_the_reference` holds it to 40 digits."""
    wi, wr = unit_vector(theta_i, phi_i), unit_vector(theta_r, phi_r)
    h = wi + wr
    exponent = ((h[..., 0] / p["alpha_x"]) ** 2 + (h[..., 1] / p["alpha_y"]) ** 2) / h[..., 2] ** 2
    peak = 4.0 * np.pi * p["alpha_x"] * p["alpha_y"] * np.sqrt(np.cos(theta_i) * np.cos(theta_r))
    return np.asarray(p["rho_d"] / np.pi + p["rho_s"] * np.exp(-exponent) / peak)


def test_ward_like_is_the_reference() -> None:
    brass = presets()["rolled-brass"].parameters
    expected = float(ward_1992.elliptical(0.6, 0.3, 0.7, 3.3, *brass.values()))
    assert abs(float(ward_like(np.array(0.6), np.array(0.3), 0.7, 3.3, brass)) / expected - 1.0) < 1e-13


@pytest.mark.parametrize("theta_deg", [0.0, 60.0, 89.9])
@pytest.mark.parametrize("alpha", [1e-6, 0.01, 0.5])
def test_whatever_f_r_is_its_weights_are_bounded_and_a_lobe_has_its_share(theta_deg: float, alpha: float) -> None:
    gloss = {"rho_d": 0.0, "rho_s": 0.3, "alpha_x": alpha, "alpha_y": alpha}
    material = Material(name="gloss", title="gloss", model="ward", source="a test", parameters=gloss)
    wr = np.tile(unit_vector(np.radians(theta_deg), 0.3), (50, 1))
    drawn = around(samples=100).drawn(material, WAVELENGTH, wr, ())
    # a tenth of all directions has a density of cos / pi, and cos / pdf is pi of them alone
    weights = 100.0 * np.maximum(drawn.wi[..., 2], 0.0) * drawn.solid_angle
    assert weights.max() < 10.0 * np.pi * (1.0 + ROUNDING)
    assert np.all(np.isfinite(drawn.solid_angle))
    if alpha < 0.1 and theta_deg < 80.0:
        mirrored = drawn.wi @ unit_vector(np.radians(theta_deg), 0.3 + np.pi) > 0.98
        assert np.abs(mirrored.mean(axis=0) - 0.9).max() < 0.05


def test_a_white_sphere_cannot_be_seen_in_a_uniform_environment() -> None:
    of = scene("white", {"rows": [[0.5]], "samples": 4})
    image = render(of, gather(of, 40))
    assert np.abs(image - 0.5).max() < ROUNDING


@pytest.mark.parametrize("name", MATERIALS)
def test_a_uniform_environment_is_ambient_light(name: str) -> None:
    sampled, exact = (
        render(of, gather(of, 24))
        for of in (scene(name, {"rows": [[1.0]], "samples": 64}), scene(name, None, ambient=1.0))
    )
    off = np.mean(sampled - exact, axis=-1)
    background = np.all(exact == 1.0, axis=-1)
    assert background.any()
    assert np.array_equal(sampled[background], exact[background])
    off = off[~background]
    assert abs(off.mean()) < STANDARD_ERRORS * off.std() / np.sqrt(off.size) + ALBEDO
    assert off.std() < NOISE


def test_the_noise_is_the_same_for_every_function() -> None:
    of = scene("rolled-brass", around(ROOM, samples=4).model_dump())
    view = gather(of, 24)
    model = Reflector(of.materials["rolled-brass"], np.array(COARSE))
    brighter = render(of, view, {"rolled-brass": lambda wi, wr, _wavelength_nm: 1.25 * model.brdf(wi, wr)})
    at = view.points[0].at
    once, again = (image.reshape(-1, len(COARSE))[at] for image in (render(of, view), brighter))
    assert np.abs(again / once - 1.25).max() < ROUNDING


def test_directions_are_those_of_the_seed() -> None:
    first, same, other = (gather(scene("foam", {"rows": [[1.0]], "seed": seed}), 8).points[0].wi for seed in (0, 0, 1))
    assert np.array_equal(first, same)
    assert not np.any(np.all(first == other, axis=-1))


def test_each_object_has_directions_of_its_own() -> None:
    side = {"kind": "plane", "size": [1.0, 2.0]}
    right = {"name": "right", "material": "foam", "shape": {**side, "position": [0.5, 0.0, 0.0]}}
    camera = {"position": [0.0, 0.0, 5.0], "up": [0.0, 1.0, 0.0], "height": 3.0, "aspect": 1.0}
    of = scene("foam", {"rows": [[1.0]]}, {**side, "position": [-0.5, 0.0, 0.0]}, camera=camera, more=[right])
    one, other = gather(of, 24).points
    assert np.array_equal(one.wr, other.wr)
    assert not np.any(np.all(one.wi == other.wi, axis=-1))


def test_lights_come_first_and_then_the_environment() -> None:
    lights = [{"direction": [0.0, -1.0, 0.0], "solid_angle_sr": 0.1, "samples": 5}]
    (both,) = gather(scene("foam", {"rows": [[1.0]], "samples": 7}, lights=lights), 8).points
    (alone,) = gather(scene("foam", None, lights=lights), 8).points
    assert both.wi.shape == (12, len(both.wr), 3)
    assert np.array_equal(both.wi[:5], alone.wi)
    assert np.array_equal(both.irradiance[:5], alone.irradiance)


@pytest.mark.parametrize("shadows", [True, False])
def test_a_wall_takes_the_light_from_behind_it(shadows: bool) -> None:
    wall = {"name": "wall", "material": "foam", "shape": {"kind": "plane", "axis": [0.0, -1.0, 0.0]}}
    floor = {"kind": "plane", "position": [0.0, 0.0, -1.0]}
    camera = {"position": [0.0, -2.0, 1.0], "target": [0.0, -1.0, -0.5], "height": 3.0, "aspect": 1.0}
    of = scene("white", {"rows": [[1.0]]}, floor, more=[wall], camera=camera, shadows=shadows)
    points = gather(of, 16).points[0]
    assert points.name == "thing"
    behind = (points.wi[..., 1] > 0.0) & (points.wi[..., 2] > 1e-6)  # a plane's frame is that of the scene
    assert 0.3 < behind.mean() < 0.7
    assert np.all((points.irradiance[behind] == 0.0) == shadows)
    assert points.irradiance[~behind & (points.wi[..., 2] > 1e-6)].min() > 0.0


def test_recorded_normals_are_lit_from_all_around(tmp_path: Path) -> None:
    normal = np.zeros((4, 4, 3))
    normal[1:, :, 1] = -1.0
    np.savez(tmp_path / "flat.npz", normal=normal)
    of = scene("white", {"rows": [[0.5]]}, {"kind": "recorded", "file": str(tmp_path / "flat.npz")})
    image = render(of, gather(of, 1))
    assert np.abs(image - 0.5).max() < ROUNDING


def test_recorded_directions_have_no_environment(tmp_path: Path) -> None:
    up = np.tile([0.0, 0.0, 1.0], (2, 2, 1))
    np.savez(tmp_path / "directions.npz", wr=up, wi=up[np.newaxis])
    of = scene("white", {"rows": [[0.5]]}, {"kind": "recorded", "file": str(tmp_path / "directions.npz")})
    with pytest.raises(ValueError, match="has wr and wi; an environment needs normals"):
        gather(of, 1)


def written(folder: Path, environment: str) -> str:
    """Write a file of a scene with an environment, and return its path."""
    path = folder / "scene.toml"
    camera = "{ position = [0, -5, 0], height = 2.5 }"
    ball = '{ name = "ball", material = "foam", shape = { kind = "sphere", radius = 1 } }'
    path.write_text(f"environment = {environment}\ncamera = {camera}\nobjects = [{ball}]\n", encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("name", ["room.npy", "room.npz", "grey.exr", "colour.exr"])
def test_a_file_is_read_as_rows_are_and_lies_beside_the_scene(tmp_path: Path, name: str) -> None:
    np.save(tmp_path / "room.npy", ROOM)
    np.savez(tmp_path / "room.npz", radiance=ROOM)
    write_channels(tmp_path / "grey.exr", {}, {"Y": ROOM})
    # a green of 1 / 0.7152 has a luminance of 1
    write_channels(tmp_path / "colour.exr", {}, {"R": 0.0 * ROOM, "G": ROOM / 0.7152, "B": 0.0 * ROOM})
    environment = load(written(tmp_path, f'{{ file = "{name}" }}')).environment
    assert np.abs(environment.picture - ROOM).max() <= (SINGLE * ROOM.max() if name.endswith("exr") else 0.0)


def test_another_picture_is_another_light(tmp_path: Path) -> None:
    up, path = np.array([0.0, 0.0, 1.0]), tmp_path / "room.npy"
    one = around([[1.0]])
    assert one.radiance(up) == 1.0
    assert one.model_copy(update={"rows": [[2.0]]}).radiance(up) == 2.0
    for value, written_ns in ((3.0, 10**18), (4.0, 10**18 + 1)):
        np.save(path, np.array([[value]]))
        os.utime(path, ns=(written_ns, written_ns))
        assert Environment(file=str(path)).radiance(up) == value


def test_a_wrong_environment_is_one_sentence_with_the_field(tmp_path: Path) -> None:
    wrong = {
        "{}": "rows, file: ",
        '{ rows = [[1]], file = "room.npy" }': "rows, file: ",
        "{ rows = [] }": "rows: ",
        "{ rows = [[]] }": "rows: ",
        "{ rows = [[1, 2], [3]] }": "rows: ",
        "{ rows = [[1], [-2]] }": "rows: -2 at row 1, column 0 ",
        "{ rows = [[nan]] }": "rows.0.0: nan ",
        "{ rows = [[0, 0]] }": "rows: ",
        "{ rows = [[1]], samples = 0 }": "samples: 0 ",
        "{ rows = [[1]], colour = 0 }": "colour: unknown key",
    }
    for table, sentence in wrong.items():
        path = written(tmp_path, table)
        with pytest.raises(SceneError) as caught:
            load(path)
        assert str(caught.value).startswith(f"{path}: environment.{sentence}")
        assert "\n" not in str(caught.value)


def test_a_file_without_a_picture_is_one_sentence(tmp_path: Path) -> None:
    for text in ("text.npz", "text.exr"):
        (tmp_path / text).write_text("no picture", encoding="utf-8")
    (tmp_path / "empty.npy").write_bytes(b"")
    np.savez(tmp_path / "other.npz", albedo=ROOM)
    write_channels(tmp_path / "depth.exr", {}, {"Z": ROOM})
    sentences = {
        "none.exr": "there is no such file",
        "text.npz": "is not an .npz or .npy file of numbers",
        "empty.npy": "is not an .npz or .npy file of numbers",
        "text.exr": "is not an OpenEXR file",
        "other.npz": "has no array `radiance`",
        "depth.exr": "it has Z",
    }
    arrays: tuple[tuple[Any, str], ...] = (
        (np.ones((2, 2, 3)), r"shape \(rows, columns\)"),
        (np.array([["x"]]), r"shape \(rows, columns\)"),
        (np.ones((0, 3)), r"shape \(rows, columns\)"),
        (np.array([[1.0, -0.5]]), "-0.5 at row 0, column 1"),
        (np.array([[np.nan]]), "nan at row 0, column 0"),
        (np.zeros((2, 2)), "radiance is 0 everywhere"),
    )
    for number, (array, sentence) in enumerate(arrays):
        np.save(tmp_path / f"{number}.npy", array)
        sentences[f"{number}.npy"] = sentence
    for name, sentence in sentences.items():
        with pytest.raises(ParameterError, match=sentence) as caught:
            gather(scene("foam", {"file": str(tmp_path / name)}), 4)
        assert str(caught.value).startswith(f"environment.file: {tmp_path / name}: ")
        assert "\n" not in str(caught.value)


def test_without_any_light_it_is_said_so() -> None:
    with pytest.raises(ValidationError, match="lights, ambient, environment: there is no light"):
        scene("foam", None)
