"""Pictures of materials: closed forms of a Lambertian sphere and of a mirror, albedos, stretched lobes, exposure."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.geometry import unit_vector
from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.materials import FunctionSource, Material
from brdfdb.scenes.lit_sphere import DRAFT, WHITE, lit_sphere, sphere_radiance
from brdfdb.tables.grids import Grid
from brdfdb.tables.table import Table
from tests.scenes.a_scene import MIRROR

Array = NDArray[np.float64]

RHO = 0.6
MATTE = Material(name="matte", title="Matte", model="lambert", parameters={"rho": RHO}, source="a test")
BRASS = {"rho_d": 0.1, "rho_s": 0.33, "alpha_x": 0.05, "alpha_y": 0.16}
BRUSHED = Material(name="brushed", title="Brushed", model="ward", parameters=BRASS, source="a test")
SLOPE = np.array([0.3, -0.4, 0.2])

THETA = np.radians([0.0, 10.0, 33.0, 60.0, 80.0])[:, np.newaxis]
PHI = np.radians([0.0, 45.0, 90.0, 170.0, 271.0])
THETA_ALL, PHI_ALL = np.broadcast_arrays(THETA, PHI)
# 256 or 768 directions for each normal; measured 2.9e-3 with Lambert's law and 4.3e-3 with the lobe of brass
SAMPLED = 6e-3


def slanted(towards: Array) -> Array:
    """Light that is linear in the direction."""
    return np.asarray(1.0 + towards @ SLOPE)


def even(towards: Array) -> Array:
    return np.ones(towards.shape[:-1])


def spot(towards: Array) -> Array:
    """Light from a few degrees around the viewer."""
    return np.asarray(np.exp((towards[..., 2] - 1.0) / 0.002))


def mirror_table(reflectance: float) -> Table:
    grid = Grid({"theta_i": [0.0, 90.0], "theta_r": [0.0, 90.0], "delta_phi": [0.0, 180.0]})
    specular = np.full(2, reflectance, np.float32)
    return Table("mirror", "r000001", {}, grid, None, np.zeros((2, 2, 2), np.float32), specular)


def test_lambertian_sphere_in_linear_light_is_the_closed_form() -> None:
    radiance = sphere_radiance(MATTE, THETA_ALL, PHI_ALL, slanted)
    expected = RHO * (1.0 + 2.0 / 3.0 * unit_vector(THETA_ALL, PHI_ALL) @ SLOPE)
    np.testing.assert_allclose(radiance, np.repeat(expected[..., np.newaxis], 3, axis=-1), rtol=SAMPLED)


def test_mirror_shows_the_light_of_its_mirror_direction() -> None:
    radiance = sphere_radiance(mirror_table(0.75), THETA_ALL, PHI_ALL, slanted)
    expected = 0.75 * slanted(unit_vector(2.0 * THETA_ALL, PHI_ALL))
    # the light is read from a table with a step of half a degree
    np.testing.assert_allclose(radiance[..., 1], expected, atol=1e-5)


def test_sphere_in_even_light_shows_the_albedo() -> None:
    theta = THETA[:4]
    radiance = sphere_radiance(BRUSHED, *np.broadcast_arrays(theta, np.array([0.0])), even)[:, 0, 0]
    # at azimuth 0 of the picture the viewer stands in the plane of the grain
    expected = [directional_albedo("ward", float(t), 0.0, **BRASS).albedo for t in theta[:, 0]]
    np.testing.assert_allclose(radiance, np.ravel(expected), rtol=SAMPLED)


def test_highlight_of_a_brushed_sphere_is_stretched_across_its_grain() -> None:
    off = np.radians(np.linspace(0.0, 30.0, 61))
    along, across = (sphere_radiance(BRUSHED, off, np.full(61, phi), spot)[:, 0] for phi in (0.0, np.pi / 2.0))
    width = [float(off[np.argmax(values < values[0] / 2.0)]) for values in (along, across)]
    assert width[1] > 2.0 * width[0]


def test_quarters_of_an_ellipse_give_what_the_whole_turn_gives() -> None:
    whole = FunctionSource(
        brdf=lambda wi, wr, _: BRUSHED.lookup_vectors(wi, wr),
        name="whole",
        title="Whole",
        provenance="a test",
        anisotropic=True,
        alpha=(BRASS["alpha_x"], BRASS["alpha_y"]),
    )
    theta, phi = np.broadcast_arrays(np.radians([25.0, 55.0])[:, np.newaxis], np.radians([40.0, 130.0, 220.0, 310.0]))
    quarters, turn = (sphere_radiance(source, theta, phi, slanted) for source in (BRUSHED, whole))
    np.testing.assert_allclose(quarters, turn, rtol=2.0 * SAMPLED)


def test_picture_is_exposed_for_white_and_covers_a_disc() -> None:
    white = MATTE.model_copy(update={"parameters": {"rho": 1.0}})
    picture = lit_sphere(white, 48)
    assert picture.shape == (48, 48, 4)
    assert np.all((picture >= 0.0) & (picture <= 1.0))
    assert picture[0, 0, 3] == 0.0
    assert picture[24, 24, 3] == 1.0
    assert picture[..., 3].mean() == pytest.approx(np.pi / 4.0, abs=2e-3)
    encoded = 1.055 * WHITE ** (1.0 / 2.4) - 0.055
    assert picture[..., 0].max() == pytest.approx(encoded, abs=0.01)
    upper_left, lower_right = picture[12, 12, 0], picture[36, 36, 0]
    assert upper_left > 1.5 * lower_right


def test_mirror_is_no_black_disc() -> None:
    picture = lit_sphere(mirror_table(1.0), 48)
    inside = picture[picture[..., 3] == 1.0][:, 0]
    assert inside.max() == pytest.approx(1.0, abs=1e-12)
    assert inside.min() > 0.05


def test_copper_is_red() -> None:
    red, green, blue, _ = np.moveaxis(lit_sphere(Material(name="copper", **MIRROR), 24), -1, 0)
    shown = red < 1.0
    assert np.all((red >= green)[shown])
    assert np.all((green >= blue)[shown])


@pytest.mark.parametrize("size", [0, 3000])
def test_size_out_of_range_is_refused(size: int) -> None:
    with pytest.raises(ParameterError, match=f"size: {size} is not a number of pixels from 1 to 2048"):
        lit_sphere(MATTE, size)


@pytest.mark.parametrize("source", [MATTE, BRUSHED], ids=["matte", "brushed"])
def test_a_draft_is_the_same_picture_with_less_detail(source: Material) -> None:
    fine, draft = lit_sphere(source, 64), lit_sphere(source, 64, detail=DRAFT)
    inside = fine[..., 3] == 1.0
    assert np.abs(draft - fine)[inside].mean() < 0.03
    assert 0.0 < np.abs(draft - fine)[inside].max() < 0.2
    assert draft[..., 3].mean() == pytest.approx(np.pi / 4.0, abs=2e-3)  # a disc in a square
