"""Tables of parameters that a recipe gives at a few wavelengths: f_r between them is that of the model."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from brdfdb.materials import presets
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import LINEAR, Interpolation, Layout, over_wavelengths
from brdfdb.tables.metadata import TableMetadata
from brdfdb.tables.mixture import refined_wavelengths
from brdfdb.tables.planner import plan
from brdfdb.tables.table import Table
from brdfdb.tables.tabulation import tabulate
from tests.tables.made_up import error_of, material, random_directions, read_back, table_of

# Bands of MODIS, and the weight of its uniform kernel over snow and soil of Roy et al. 2016
BANDS = (469.0, 555.0, 645.0, 858.0, 1640.0, 2130.0)
ISO = (0.0774, 0.1306, 0.1690, 0.3093, 0.3430, 0.2658)
FLOAT32 = 3e-6
GRID = Grid({"theta_i": [0.0, 30.0, 60.0, 85.0], "theta_r": [0.0, 30.0, 60.0, 85.0], "delta_phi": [0.0, 90.0, 180.0]})


def spectrum(values: tuple[float, ...]) -> dict[str, Any]:
    return {"wavelengths_nm": list(BANDS), "values": list(values)}


LAMBERT = material("lambert", rho=spectrum(ISO))
HAPKE = material("hapke", w=spectrum((0.2, 0.3, 0.35, 0.6, 0.8, 0.7)), b=0.3, c=0.4, b_0=1.0, h=0.07, theta_bar_deg=20)
PAINTED = material("ward", rho_d=spectrum(ISO), rho_s=spectrum(ISO[::-1]), alpha_x=0.2, alpha_y=0.2)
AT = np.array(BANDS)


def factored(logarithm: bool) -> Table:
    """Return a table of coefficients whose six spectra are turned, so that no coefficient is a wavelength."""
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(6, 6)))[0]
    how = Interpolation("linear", logarithm, 1e-4 if logarithm else 0.0, 0.0, LINEAR)
    return table_of(Layout(HAPKE, GRID, AT, how, spectra=turn))


TABLES: dict[str, Any] = {
    "f_r": lambda: table_of(Layout(HAPKE, GRID, AT, Interpolation(wavelengths=LINEAR))),
    "logarithms": lambda: table_of(Layout(HAPKE, GRID, AT, Interpolation("cubic", True, 1e-4, 0.5, LINEAR))),
    "factored": lambda: factored(logarithm=False),
    "factored-logarithms": lambda: factored(logarithm=True),
    "mixture": lambda: table_of(plan(PAINTED, AT, 0.05)),
}


def test_no_bump_is_made_up_between_six_bands() -> None:
    """A cubic reaches 0.387 near 1195 nm, above all six bands."""
    table = table_of(Layout(LAMBERT, GRID, AT, Interpolation(wavelengths=over_wavelengths(LAMBERT))))
    for nm in (500.0, 700.0, 1200.0, 2000.0):
        expected = np.interp(nm, BANDS, ISO) / np.pi
        assert float(table.lookup(0.3, 0.0, 0.5, 1.0, nm)) == pytest.approx(expected, rel=FLOAT32)


@pytest.mark.parametrize("kind", TABLES)
def test_f_r_of_every_kind_of_table_is_a_straight_line_between_wavelengths(kind: str) -> None:
    table = TABLES[kind]()
    directions = random_directions(300)
    at_nodes = table.lookup(*directions)
    for cell, share in ((0, 0.25), (3, 0.5), (4, 0.9)):
        nm = (1.0 - share) * BANDS[cell] + share * BANDS[cell + 1]
        expected = (1.0 - share) * at_nodes[:, cell] + share * at_nodes[:, cell + 1]
        np.testing.assert_allclose(table.lookup(*directions, nm), expected, rtol=1e-12, atol=1e-15)


def test_a_stored_table_says_so_and_is_read_so() -> None:
    layout = Layout(HAPKE, GRID, AT, Interpolation("linear", True, 1e-4, 0.0, LINEAR))
    dataset = tabulate(layout)
    assert TableMetadata.read(dataset.attrs).interpolation.wavelengths == "linear"
    assert "over wavelengths brdf is linear" in dataset.attrs["reconstruction"]
    value = read_back(dataset).lookup(0.5, 0.0, 0.4, 1.0, [555.0, 600.0, 645.0])
    assert value[1] == pytest.approx(0.5 * (value[0] + value[2]), rel=1e-9)
    before = {key: value for key, value in dataset.attrs["interpolation"].items() if key != "wavelengths"}
    assert TableMetadata.read(dataset.attrs | {"interpolation": before}).interpolation.wavelengths == "cubic"


def test_n_and_k_of_entries_stay_cubic() -> None:
    copper = presets()["scene-copper-sphere"]
    assert over_wavelengths(copper) == "cubic"
    assert refined_wavelengths(copper, AT, 0.01) is AT


@pytest.mark.parametrize("tolerance", [0.05, 0.01])
def test_wavelengths_are_added_until_lines_between_them_follow_the_model(tolerance: float) -> None:
    found = refined_wavelengths(HAPKE, AT, tolerance)
    assert found is not None
    assert set(BANDS) <= set(found.tolist())
    between = np.linspace(*BANDS[::5], 4001)
    directions = random_directions(40)
    lines = np.stack([np.interp(between, found, row) for row in HAPKE.lookup(*directions, found)])
    model = HAPKE.lookup(*directions, between)
    seen = np.minimum(directions[0], directions[2]) < 1.5
    assert np.abs(lines / model - 1.0)[seen].max() < 0.3 * tolerance
    of_six = np.stack([np.interp(between, BANDS, row) for row in HAPKE.lookup(*directions, AT)])
    assert np.abs(of_six / model - 1.0).max() > 0.01


def test_models_that_are_linear_in_their_spectra_take_the_kinks_alone() -> None:
    np.testing.assert_array_equal(refined_wavelengths(PAINTED, AT, 0.001), AT)
    np.testing.assert_array_equal(refined_wavelengths(PAINTED, AT[[0, 5]], 1e-4), AT)


def test_the_error_between_is_measured_of_straight_lines() -> None:
    theta = np.linspace(0, 89, 60)
    fine = Grid({"theta_i": theta, "theta_r": theta, "delta_phi": [0.0, 90.0, 180.0]})
    layout = Layout(LAMBERT, fine, AT, Interpolation(wavelengths=LINEAR))
    straight = error_of(layout, count=300).between
    cubic = error_of(replace(layout, interpolation=Interpolation()), count=300).between
    assert straight is not None
    assert np.max(straight.bands) < FLOAT32
    assert cubic is not None
    assert np.max(cubic.bands) > 0.05
