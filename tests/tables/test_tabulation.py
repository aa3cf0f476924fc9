"""Tabulation: what is in a table is the model, to the last bit of a float32, and the table says where it is from."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray

from brdfdb import models
from brdfdb.materials import Material
from brdfdb.refractive_indices import refractive_index
from brdfdb.tables import layout as layout_module
from brdfdb.tables import tabulation as module
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Interpolation, Layout
from brdfdb.tables.tabulation import tabulate

ISOTROPIC = Grid({"theta_i": [0, 30, 60, 89.5], "theta_r": [0, 30, 45, 60, 85], "delta_phi": [0, 50, 90, 180]})
THETA = [0, 10, 25, 45, 60, 80, 89.5]
RECIPROCAL = Grid({"theta_i": THETA, "theta_r": THETA, "delta_phi": [0, 50, 90, 180]})
ANISOTROPIC = Grid(
    {"theta_i": [0, 40, 85], "phi_i": [0, 70, 200, 360], "theta_r": [0, 40, 60], "phi_r": [0, 90, 250, 360]}
)
WAVELENGTHS = np.array([450.0, 500.0, 700.0])
COPPER = "main/Cu/Johnson"


def material(model: str, **more: Any) -> Material:
    parameters = {name: more.pop(name) for name in list(more) if name not in Material.model_fields}
    table = {"title": "Made up", "model": model, "source": "no paper", "parameters": parameters, **more}
    return Material.from_table("made-up", table)


def rough_copper(**more: Any) -> Material:
    values = {"sigma_0_um": 0.1, "tau_um": 2.0, "a": 0.1, "refractive_index": COPPER}
    return material("he_torrance", **(values | more))


GREY = [
    material("lambert", rho=0.5),
    material("minnaert", k=0.7),
    material("oren_nayar", rho=0.8, sigma_deg=30),
    material("oren_nayar_qualitative", rho=0.8, sigma_deg=20, offset=0.57),
    material("ward", rho_d=0.1, rho_s=0.3, alpha_x=0.2, alpha_y=0.2),
    material("ward", rho_d=0.1, rho_s=0.3, alpha_x=0.05, alpha_y=0.2),
]


def directions(grid: Grid) -> tuple[Any, ...]:
    """theta_i, phi_i, theta_r, phi_r [rad] of every node, one full array each."""
    nodes = np.meshgrid(*(np.deg2rad(axis) for axis in grid.axes.values()), indexing="ij")
    if grid.anisotropic:
        return tuple(nodes)
    theta_i, theta_r, delta_phi = nodes
    return theta_i, np.zeros_like(theta_i), theta_r, delta_phi


@pytest.mark.parametrize(
    ("made_up", "grid"),
    [
        pytest.param(m, grid, id=f"{m.model}-{'an' if m.anisotropic else ''}isotropic-on-{len(grid.shape)}d{kind}")
        for m in GREY
        for grid, kind in ((ISOTROPIC, ""), (RECIPROCAL, "-reciprocal"), (ANISOTROPIC, ""))
        if grid.anisotropic or not m.anisotropic
    ],
)
def test_every_node_holds_the_model_rounded_once(made_up: Material, grid: Grid) -> None:
    table = tabulate(Layout(made_up, grid))
    expected = getattr(models, made_up.model)(*directions(grid), **made_up.parameters).astype(np.float32)
    assert table["brdf"].dtype == np.float32
    np.testing.assert_array_equal(table["brdf"].values, expected)
    assert table["brdf"].dims == tuple(grid.axes)
    assert list(table.data_vars) == ["brdf"]


@pytest.mark.parametrize("grid", [ISOTROPIC, RECIPROCAL, ANISOTROPIC], ids=["isotropic", "reciprocal", "anisotropic"])
@pytest.mark.parametrize("wavelengths", [WAVELENGTHS, WAVELENGTHS[:1]], ids=["three", "one"])
def test_a_spectral_table_holds_the_model(grid: Grid, wavelengths: NDArray[np.float64]) -> None:
    table = tabulate(Layout(rough_copper(), grid, wavelengths))
    n, k = refractive_index(COPPER, wavelengths)
    expected = models.he_torrance(
        *(angle[..., np.newaxis] for angle in directions(grid)),
        wavelength_nm=wavelengths, sigma_0_um=0.1, tau_um=2.0, a=0.1, n=n, k=k,
    ).astype(np.float32)  # fmt: skip
    assert table["brdf"].dims == (*grid.axes, "wavelength")
    np.testing.assert_array_equal(table["brdf"].values, expected)
    np.testing.assert_array_equal(table["n"].values, n)
    np.testing.assert_array_equal(table["k"].values, k)
    assert table["n"].dims == table["k"].dims == ("wavelength",)


@pytest.mark.parametrize("rows", [1, 2, 3, 100])
@pytest.mark.parametrize(
    ("made_up", "grid", "wavelengths"),
    [
        (GREY[2], ISOTROPIC, None),
        (GREY[2], RECIPROCAL, None),
        (GREY[5], ANISOTROPIC, None),
        (rough_copper(), ISOTROPIC, WAVELENGTHS),
        (rough_copper(), RECIPROCAL, WAVELENGTHS),
        (rough_copper(), ANISOTROPIC, WAVELENGTHS),
    ],
)
def test_a_table_does_not_depend_on_the_pieces_that_it_is_made_in(
    made_up: Material, grid: Grid, wavelengths: Any, rows: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    layout = Layout(made_up, grid, wavelengths)
    whole = tabulate(layout)
    monkeypatch.setattr(module, "_SLAB", rows * int(np.prod(grid.shape[1:])))
    monkeypatch.setattr(layout_module, "_BLOCK_VALUES", 2 * rows * int(np.prod(layout.shape[1:])))
    assert len(layout.blocks) == -(-grid.shape[0] // (2 * rows))
    xr.testing.assert_identical(tabulate(layout), whole)


def test_numbers_with_light_and_viewer_at_the_horizon_go_on_from_those_above_it() -> None:
    glossy = material("ward", rho_d=0.3, rho_s=0.05, alpha_x=0.1, alpha_y=0.1)
    grid = Grid({"theta_h": [0, 90], "theta_d": [0, 90], "phi_d": [0, 90]})
    layout = Layout(glossy, grid, None, Interpolation("cubic", True, 1e-4, 0.5))
    theta_h = np.deg2rad(np.linspace(1.0, 30.0, 200))
    at, above = (
        module.continued(layout, theta_h, np.zeros(()), np.full((), theta_d), np.full((), np.pi / 2))
        for theta_d in (np.pi / 2, np.pi / 2 - 1e-8)
    )
    np.testing.assert_allclose(at, above, atol=1e-6)  # with cosines of rounded angles they were 1e-3 apart


@pytest.mark.parametrize("made_up", [*GREY[:5], rough_copper()], ids=lambda m: m.model)
def test_on_a_reciprocal_grid_a_table_is_its_own_transpose_to_the_last_bit(made_up: Material) -> None:
    brdf = tabulate(Layout(made_up, RECIPROCAL, WAVELENGTHS if made_up.spectral else None))["brdf"].values
    np.testing.assert_array_equal(brdf, np.swapaxes(brdf, 0, 1))


@pytest.mark.parametrize("sigma_0_um", [0.0, 0.02], ids=["smooth", "slightly rough"])
def test_the_dirac_part_is_an_array_of_its_own(sigma_0_um: float) -> None:
    table = tabulate(Layout(rough_copper(sigma_0_um=sigma_0_um, a=0.0), ISOTROPIC, WAVELENGTHS))
    n, k = refractive_index(COPPER, WAVELENGTHS)
    expected = models.he_torrance_specular(
        np.deg2rad(ISOTROPIC.axes["theta_i"])[:, np.newaxis],
        wavelength_nm=WAVELENGTHS, sigma_0_um=sigma_0_um, tau_um=2.0, n=n, k=k,
    )  # fmt: skip
    assert table["specular_reflectance"].dims == ("theta_i", "wavelength")
    np.testing.assert_array_equal(table["specular_reflectance"].values, expected)
    assert expected.max() > 0.3


def test_the_dirac_part_is_never_smeared_into_the_table() -> None:
    mirror = tabulate(Layout(rough_copper(sigma_0_um=0.0, a=0.0), ISOTROPIC, WAVELENGTHS))
    assert mirror["specular_reflectance"].values.min() > 0.3
    np.testing.assert_array_equal(mirror["brdf"].values, 0.0)
    with_diffuse = tabulate(Layout(rough_copper(sigma_0_um=0.0, a=0.5), ISOTROPIC, WAVELENGTHS))
    np.testing.assert_array_equal(with_diffuse["brdf"].values, np.float32(0.5 / np.pi))


def test_coordinates_and_variables_have_units() -> None:
    grey = tabulate(Layout(GREY[5], ANISOTROPIC))
    spectral = tabulate(Layout(rough_copper(), ISOTROPIC, WAVELENGTHS))
    for table, grid in ((grey, ANISOTROPIC), (spectral, ISOTROPIC)):
        for name, nodes in grid.axes.items():
            np.testing.assert_array_equal(table[name].values, nodes)
            assert table[name].attrs["units"] == "degree"
    assert spectral["wavelength"].values.tolist() == WAVELENGTHS.tolist()
    units = {name: spectral[name].attrs["units"] for name in ("wavelength", "brdf", "specular_reflectance", "n", "k")}
    assert units == {"wavelength": "nm", "brdf": "sr-1", "specular_reflectance": "1", "n": "1", "k": "1"}
    assert all(variable.attrs["long_name"] for variable in spectral.variables.values())
    assert spectral["wavelength"].attrs["standard_name"] == "radiation_wavelength"


def test_attributes_say_where_every_number_comes_from() -> None:
    made_up = material(
        "oren_nayar",
        rho=0.8,
        sigma_deg=30,
        sources={"rho": "Fig. 9"},
        note="white",
        assumed={"sigma": {"why": "guess"}},
    )
    attributes = tabulate(Layout(made_up, ISOTROPIC)).attrs
    assert (attributes["title"], attributes["material"], attributes["note"]) == ("Made up", "made-up", "white")
    assert attributes["table_version"] == 6
    assert (attributes["model"], attributes["model_reference"]) == ("oren_nayar", "orennayar1994")
    assert attributes["model_version"] == models.MODELS["oren_nayar"].version
    assert attributes["parameters"] == {"rho": 0.8, "sigma_deg": 30.0, "interreflection": True}
    sources = {"rho": "Fig. 9", "sigma_deg": "no paper", "interreflection": "no paper"}
    assert attributes["parameter_sources"] == sources
    assert attributes["assumed"] == {"sigma_deg": {"why": "guess", "max_albedo": None, "alternatives": []}}
    assert (attributes["refractive_index"], attributes["known_excess"]) == ("", {})
    assert "delta_phi = phi_r - phi_i" in attributes["conventions"]
    excess = {"max_albedo": 1.2, "from_theta_i_deg": 60.0, "citation": "somebody"}
    attributes = tabulate(Layout(rough_copper(known_excess=excess), ISOTROPIC, WAVELENGTHS)).attrs
    assert (attributes["refractive_index"], attributes["known_excess"]) == (COPPER, excess)


HORIZON = {"theta_i": [0, 90], "theta_r": [0, 80], "delta_phi": [0, 90, 180]}
HORIZON_OF_VIEWER = HORIZON | {"theta_i": [0, 80], "theta_r": [0, 90]}


@pytest.mark.parametrize(
    ("made_up", "grid", "wavelengths", "sentence"),
    [
        (rough_copper(), ISOTROPIC, None, "wavelengths_nm: made-up needs them"),
        (GREY[0], ISOTROPIC, WAVELENGTHS, "wavelengths_nm: made-up is grey"),
        (GREY[5], ISOTROPIC, None, "grid: made-up is anisotropic and needs the axes theta_i, phi_i, theta_r, phi_r"),
        *((m, Grid(HORIZON), None, "grid: theta of 90 degrees is a pole of made-up; end the axis") for m in GREY[1:5]),
        (GREY[4], Grid(HORIZON_OF_VIEWER), None, "grid: theta of 90 degrees is a pole of made-up"),
        (rough_copper(), ISOTROPIC, np.array([500.0, 10.0]), "wavelengths_nm: must be positive and increase strictly"),
        (rough_copper(), ISOTROPIC, np.array([10.0, 500.0]), "wavelength_nm: 10 has no refractive index in main/Cu/"),
        (rough_copper(), ISOTROPIC, np.array([]), "wavelengths_nm: must be positive and increase strictly"),
    ],
)
def test_unsuitable_grids_are_refused(made_up: Material, grid: Grid, wavelengths: Any, sentence: str) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(sentence)}"):
        Layout(made_up, grid, wavelengths)


@pytest.mark.parametrize("made_up", [GREY[0], rough_copper()], ids=["lambert", "he_torrance"])
def test_models_without_a_pole_are_tabulated_up_to_the_horizon(made_up: Material) -> None:
    wavelengths = WAVELENGTHS if made_up.spectral else None
    grid = Grid(HORIZON | {"theta_r": [0, 90]})
    assert np.all(np.isfinite(tabulate(Layout(made_up, grid, wavelengths))["brdf"].values))
