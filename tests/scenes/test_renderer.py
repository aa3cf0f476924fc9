"""Radiance: the papers' shading against closed forms and the slow reference, energy, and what the papers see."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from brdfdb.errors import ParameterError
from brdfdb.geometry import unit_vector
from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.materials import FunctionSource, presets
from brdfdb.reference import he_torrance_1991, oren_nayar_1994, ward_1992
from brdfdb.refractive_indices import refractive_index
from brdfdb.scenes.gbuffer import gather
from brdfdb.scenes.renderer import Reflector, reflectors, render
from brdfdb.scenes.scene import Scene
from brdfdb.scenes.shapes import Array
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from brdfdb.tables.table import Table
from tests.scenes.a_scene import ABOVE, COARSE, SPHERE, TILTED, scene

ROUNDING = 2e-15  # 1.6e-15 measured
LIMB = 1e-13  # of the radiance of a sphere, next to the limb: 4.9e-14 measured
KERNEL = 1e-14  # models against the reference: 7e-15 measured
ALBEDO = 1e-3  # between the angles at which they are known: 8.4e-4 measured, of copper

CYLINDER = {"kind": "cylinder", "radius": 1.0, "height": 2.0, "position": [0.0, 0.0, -1.0]}
WIDTH = 50
# Of a picture of these, where its columns are: a cylinder from limb to limb
X = (2.0 * np.arange(WIDTH) + 1.0) / WIDTH - 1.0


def rendered(of: Scene, width: int = WIDTH, **how: Any) -> Array:
    return render(of, gather(of, width), **how)


def across(shape: dict[str, Any], material: str, light: tuple[float, ...] = (0.0, -1.0, 0.0)) -> Array:
    """Radiance along the middle row of a picture."""
    return rendered(scene(material, shape, lights=[{"direction": list(light)}]))[WIDTH // 2, :, 0]


def test_a_lambertian_sphere_is_as_bright_as_the_cosine() -> None:
    image = rendered(scene("white", SPHERE, lights=[{"direction": [0.0, -1.0, 1.0], "strength": 2.0}]))
    x, z = np.meshgrid(X, -X)
    inside = x * x + z * z < 1.0
    y = np.sqrt(1.0 - np.where(inside, x * x + z * z, 1.0))
    expected = np.where(inside, 2.0 * np.maximum(y + z, 0.0) / np.sqrt(2.0), 0.0)
    assert np.abs(image - expected[..., np.newaxis]).max() < LIMB


@pytest.mark.parametrize("aside_deg", [0.0, 20.0])
def test_the_vase_is_shaded_as_the_reference_says(aside_deg: float) -> None:
    aside = np.radians(aside_deg)
    found = across(CYLINDER, "clay-vase", (np.sin(aside), -np.cos(aside), 0.0))
    for column in (0, 3, 10, 25, 38, 49):
        theta_r = np.arcsin(X[column])
        theta_i = theta_r - aside
        delta_phi = 0.0 if theta_i * theta_r > 0.0 else np.pi
        parts = oren_nayar_1994.functional(abs(theta_i), abs(theta_r), delta_phi, 0.7, np.radians(40.0))
        expected = np.pi * float(sum(parts)) * np.cos(theta_i) if abs(theta_i) < np.pi / 2.0 else 0.0
        assert abs(found[column] - expected) < KERNEL


def test_a_surface_along_the_grain_is_shaded_as_the_reference_says() -> None:
    brass = presets()["rolled-brass"].parameters
    plane = {"kind": "plane", "turn_deg": 30.0}
    light = {"direction": [0.28, 0.0, 0.96], "strength": 1.5}
    for grain_deg in (0.0, 60.0):
        found = rendered(scene("rolled-brass", plane, camera=ABOVE, grain_deg=grain_deg, lights=[light]), 2)
        phi_i = -np.radians(30.0 + grain_deg)
        expected = ward_1992.elliptical(np.arccos(0.96), phi_i, 0.0, 0.0, *brass.values())
        assert np.abs(found / (1.5 * np.pi * 0.96 * float(expected)) - 1.0).max() < KERNEL


def test_a_white_sphere_cannot_be_seen_in_uniform_light() -> None:
    image = rendered(scene("white", ambient=0.5))
    assert np.abs(image - 0.5).max() < ROUNDING


@pytest.mark.parametrize("name", ["clay-vase", "rolled-brass", "scene-copper-sphere"])
def test_uniform_light_is_reflected_by_the_directional_albedo_of_the_viewer(name: str) -> None:
    wavelength = np.array([450.0, 650.0])
    reflector = Reflector(presets()[name], wavelength)
    parameters = presets()[name].arguments(wavelength if presets()[name].spectral else None)
    degrees = ((0.0, 0.0), (24.0, 0.0), (45.0, 45.0), (65.0, 100.0), (80.0, 200.0), (88.0, 330.0))
    for theta, phi in np.radians(degrees):
        expected = directional_albedo(presets()[name].spec, theta, phi, tolerance=1e-5, **parameters).albedo
        found = reflector.albedo(unit_vector(theta, phi)[np.newaxis])[0]
        assert np.abs(found - expected).max() < ALBEDO
    assert reflector.albedo(np.array([[0.6, 0.0, -0.8]])).max() == 0.0  # below the horizon


def smooth_copper(theta: float, wavelength_nm: float) -> float:
    n, k = refractive_index("main/Cu/Johnson", wavelength_nm)
    return float(he_torrance_1991.fresnel_unpolarised(np.cos(theta), float(n), float(k)))


THETA = np.arccos(0.8)


@pytest.mark.parametrize(
    ("fields", "seen"),
    [
        ({"ambient": 0.5}, 0.5),
        (
            {"lights": [{"direction": [0.0, 0.6, 0.8], "strength": 0.1, "solid_angle_sr": 0.01}]},
            np.pi * 0.1 / (0.01 * (1.0 - 0.01 / (4.0 * np.pi))),  # over the projected solid angle
        ),
        ({"lights": [{"direction": [0.0, 0.6, 0.8]}]}, 0.0),  # a direction is no disc: mirrors miss it
        ({"lights": [{"direction": [0.0, -0.6, 0.8], "solid_angle_sr": 0.01}]}, 0.0),
    ],
)
def test_a_mirror_reflects_what_stands_in_its_direction(fields: dict[str, Any], seen: float) -> None:
    image = rendered(scene("mirror", {"kind": "plane"}, camera=TILTED, **fields), 2)
    for number in (0, 8, 15):
        expected = smooth_copper(THETA, COARSE[number]) * seen
        assert np.abs(image[..., number] - expected).max() <= KERNEL * max(1.0, seen)


def test_a_mirror_shows_other_objects_once() -> None:
    # a white wall behind the mirror, square to what the mirror shows of it
    wall = {"kind": "plane", "position": [0.0, 3.0, 4.0], "axis": [0.0, -0.6, -0.8]}
    more = [{"name": "wall", "material": "white", "shape": wall}]
    lights = [{"direction": [0.0, -1.0, 0.0], "strength": 0.5}]
    of = scene("mirror", {"kind": "plane"}, camera=TILTED, more=more, lights=lights, ambient=0.25)
    for number in (0, 15):
        expected = smooth_copper(THETA, COARSE[number]) * (0.5 * 0.6 + 0.25)
        assert np.abs(rendered(of, 2)[..., number] - expected).max() < ROUNDING


def test_any_function_can_stand_in_for_a_model() -> None:
    of = scene("clay-vase", SPHERE, lights=[{"direction": [0.0, -1.0, 0.0]}])

    def brdf(wi: Array, wr: Array, wavelength_nm: Array) -> Array:
        assert wi.shape == wr.shape
        return np.tile(wavelength_nm / 700.0 / np.pi, (len(wi), 1))

    image = rendered(of, brdfs={"clay-vase": brdf})
    lambert = rendered(scene("white", SPHERE, lights=[{"direction": [0.0, -1.0, 0.0]}]))
    assert np.abs(image - lambert * np.array(COARSE) / 700.0).max() < ROUNDING


def test_a_source_or_a_table_can_stand_in_for_a_model() -> None:
    of = scene("white", SPHERE, lights=[{"direction": [0.0, -1.0, 0.0]}])
    third = FunctionSource(brdf=lambda wi, _wr, _: np.full(len(wi), 1.0 / 3.0), name="third", title="x", provenance="x")
    angles = [0.0, 45.0, 90.0]
    layout = Layout(third, Grid({"theta_i": angles, "theta_r": angles, "delta_phi": [0.0, 90.0, 180.0]}))
    table = Table.of(layout, np.full((3, 3, 3), 1.0 / 3.0, np.float32))
    expected = rendered(of, brdfs={"white": lambda wi, _wr, _wavelength_nm: np.full((len(wi), 1), 1.0 / 3.0)})
    for given in (third, table):
        np.testing.assert_allclose(rendered(of, brdfs={"white": given}), expected, rtol=1e-6)
    with pytest.raises(ParameterError, match=r"^brdfs: white: 0\.3 is not a function, a source or a table$"):
        rendered(of, 2, brdfs={"white": 0.3})


def test_what_has_no_picture_is_refused() -> None:
    lights = [{"direction": [0.0, -1.0, 0.0]}]
    vase = scene("clay-vase", SPHERE, lights=lights)
    with pytest.raises(ValueError, match=r"brdfs: 'thing' is not one of the scene's materials: clay-vase$"):
        rendered(vase, 4, brdfs={"thing": lambda wi, _wr, _wavelength_nm: np.ones((len(wi), 1))})
    view = gather(scene("white", SPHERE, lights=lights), WIDTH)
    with pytest.raises(ParameterError, match=r"^view: it shows white, which is not a material of the scene; gather"):
        render(scene("clay-vase", SPHERE, lights=lights), view)
    plane = scene("white", {"kind": "plane"}, camera=ABOVE, lights=[{"direction": [0.0, 0.0, 1.0]}])
    shapes = r"f_r of white: 4 pairs .* gave the shape \(4,.*; must be \(4, 16\) or \(4, 1\)"
    for columns in ((), (2,), (16, 1)):
        with pytest.raises(ValueError, match=shapes):
            rendered(plane, 2, brdfs={"white": lambda wi, _wr, _nm, columns=columns: np.ones((len(wi), *columns))})
    with pytest.raises(ValueError, match="stated for 2000 nm, outside the visible, 380 to 780 nm"):
        rendered(scene("roughened-aluminum-2000nm", SPHERE, lights=lights), 4)


def test_the_back_of_a_plane_is_black_whatever_the_function() -> None:
    back = {"kind": "plane", "axis": [0.0, 0.0, -1.0]}
    of = scene("white", back, camera=ABOVE, lights=[{"direction": [0.0, 0.0, -1.0]}], shadows=False)
    assert rendered(of, 2, brdfs={"white": lambda wi, _wr, _wavelength_nm: np.ones((len(wi), 1))}).max() == 0.0


@pytest.mark.parametrize("batch", [1, 7, 100_000])
def test_batches_do_not_change_the_picture(monkeypatch: pytest.MonkeyPatch, batch: int) -> None:
    lights = [{"direction": [1.0, -1.0, 1.0], "solid_angle_sr": 0.1}, {"direction": [-1.0, -1.0, 0.0]}]
    of = scene("clay-vase", SPHERE, lights=lights)
    whole = rendered(of, 12)
    monkeypatch.setattr("brdfdb.scenes.renderer._BATCH", batch)
    assert np.abs(rendered(of, 12) - whole).max() < ROUNDING


def test_a_material_stated_at_one_wavelength_is_grey() -> None:
    of = scene("scene-plastic-table", SPHERE, lights=[{"direction": [0.0, -1.0, 0.0]}])
    image = rendered(of, 8)
    assert np.ptp(image, axis=-1).max() == 0.0
    assert image.max() > 0.2


def test_progress_is_told_of_each_list_of_points() -> None:
    of = scene("white", SPHERE, ambient=1.0)
    view = gather(of, 4)
    told: list[int] = []
    render(of, view, materials=reflectors(of), progress=lambda: told.append(1))
    assert len(told) == len(view.points)
