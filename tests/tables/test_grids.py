"""Grids: which axes there are, and one exact sentence for everything that can be wrong with one."""

from __future__ import annotations

import dataclasses
import re
from typing import Any

import numpy as np
import pytest

from brdfdb.tables.grids import KINDS, Grid, axes_among, check_wavelengths

ISOTROPIC = {"theta_i": [0, 30, 80], "theta_r": [0, 89.5], "delta_phi": [0, 7, 90, 180]}
HALF = {"theta_h": [0, 5, 90], "theta_d": [0, 45, 90], "phi_d": [0, 45, 90]}
TURNED_HALF = {"theta_h": [0, 5, 90], "phi_h": [0, 45, 90], "theta_d": [0, 90], "phi_d": [0, 90, 180]}
ANISOTROPIC = {"theta_i": [0, 80], "phi_i": [0, 120, 240, 360], "theta_r": [0, 10, 80], "phi_r": [0, 180, 360]}


@pytest.mark.parametrize(
    ("name", "nodes", "sentence"),
    [
        ("theta_i", [], "theta_i: needs a list of at least two nodes, got an array of shape (0,)"),
        ("theta_i", [0.0], "theta_i: needs a list of at least two nodes, got an array of shape (1,)"),
        ("theta_r", 30.0, "theta_r: needs a list of at least two nodes, got an array of shape ()"),
        ("theta_r", [[0, 1], [2, 3]], "theta_r: needs a list of at least two nodes, got an array of shape (2, 2)"),
        ("theta_i", [0, 20, 10], "theta_i: the nodes must increase strictly"),
        ("theta_i", [0, 10, 10], "theta_i: the nodes must increase strictly"),
        ("theta_i", [0, np.nan, 10], "theta_i: the nodes must increase strictly"),
        ("theta_i", [np.nan, 10], "theta_i: the nodes must increase strictly"),
        ("phi_r", [360, 0], "phi_r: the nodes must increase strictly"),
        ("theta_i", [1, 10], "theta_i: starts at 1 degrees, must start at 0"),
        ("theta_r", [-10, 10], "theta_r: starts at -10 degrees, must start at 0"),
        ("theta_i", [-np.inf, 10], "theta_i: starts at -inf degrees, must start at 0"),
        ("delta_phi", [-180, 180], "delta_phi: starts at -180 degrees, must start at 0"),
        ("delta_phi", [0, 90], "delta_phi: ends at 90 degrees, must end at 180"),
        ("delta_phi", [0, 360], "delta_phi: ends at 360 degrees, must end at 180"),
        ("phi_i", [0, 120], "phi_i: ends at 120 degrees, must end at 360 or 180 or 90"),
        ("phi_r", [0, 355], "phi_r: ends at 355 degrees, must end at 360"),
        ("theta_i", [0, 90.5], "theta_i: ends at 90.5 degrees, must end at or below 90"),
        ("theta_r", [0, np.nextafter(90, 91)], "theta_r: ends at 90 degrees, must end at or below 90"),
        ("theta_r", [0, np.inf], "theta_r: ends at inf degrees, must end at or below 90"),
        ("theta_h", [1, 90], "theta_h: starts at 1 degrees, must start at 0"),
        ("phi_d", [0, 45], "phi_d: ends at 45 degrees, must end at 90 or 180"),
        ("phi_d", [0, 360], "phi_d: ends at 360 degrees, must end at 90 or 180"),
    ],
)
def test_an_axis_that_cannot_be_is_refused_in_one_sentence(name: str, nodes: Any, sentence: str) -> None:
    axes = next(axes for axes in (ISOTROPIC, ANISOTROPIC, HALF) if name in axes)
    with pytest.raises(ValueError, match=f"^{re.escape(sentence)}$"):
        Grid({**axes, name: nodes})


@pytest.mark.parametrize(
    "names",
    [
        (),
        ("theta_i", "theta_r"),
        ("theta_r", "theta_i", "delta_phi"),
        ("theta_i", "theta_r", "phi_i", "phi_r"),
        (*ISOTROPIC, "wavelength"),
        ("theta_i", "phi_i", "theta_r", "delta_phi"),
    ],
)
def test_other_sets_or_orders_of_axes_are_refused(names: tuple[str, ...]) -> None:
    sentence = f"grid axes: {names} is none of {', '.join(map(str, KINDS))}"
    with pytest.raises(ValueError, match=f"^{re.escape(sentence)}$"):
        Grid({name: [0, 180] for name in names})


def test_a_grid_says_what_it_is() -> None:
    isotropic = Grid(ISOTROPIC)
    anisotropic = Grid(ANISOTROPIC)
    assert (isotropic.anisotropic, anisotropic.anisotropic) == (False, True)
    assert (isotropic.shape, anisotropic.shape) == ((3, 2, 4), (2, 4, 3, 3))
    assert all(nodes.dtype == np.float64 for nodes in isotropic.axes.values())
    assert isotropic.axes["delta_phi"].tolist() == [0.0, 7.0, 90.0, 180.0]


@pytest.mark.parametrize(("last_i", "last_r", "reaches"), [(90, 80, True), (80, 90, True), (89.999999, 80, False)])
def test_a_grid_knows_whether_it_reaches_the_horizon(last_i: float, last_r: float, reaches: bool) -> None:
    grid = Grid({"theta_i": [0, last_i], "theta_r": [0, last_r], "delta_phi": [0, 90, 180]})
    assert grid.reaches_horizon is reaches


def test_a_grid_is_reciprocal_where_light_and_viewer_share_their_nodes() -> None:
    assert not Grid(ISOTROPIC).reciprocal
    assert Grid({**ISOTROPIC, "theta_r": ISOTROPIC["theta_i"]}).reciprocal
    assert not Grid({**ISOTROPIC, "theta_r": [0, 30, 80.5]}).reciprocal
    assert not Grid({**ANISOTROPIC, "theta_r": ANISOTROPIC["theta_i"]}).reciprocal


def test_a_grid_does_not_change_when_the_callers_arrays_or_its_fields_are_assigned_to() -> None:
    nodes = np.array([0.0, 40.0, 80.0])
    grid = Grid({**ISOTROPIC, "theta_i": nodes})
    nodes[1] = -1.0
    assert grid.axes["theta_i"].tolist() == [0.0, 40.0, 80.0]
    with pytest.raises(dataclasses.FrozenInstanceError):
        grid.axes = {}  # type: ignore[misc]  # that is the point


@pytest.mark.parametrize(
    "wavelengths", [[], 500.0, [0.0, 500.0], [-1.0], [550.0, 500.0], [500.0, 500.0], [np.nan], [[400.0, 500.0]]]
)
def test_wavelengths_that_cannot_be_are_refused(wavelengths: Any) -> None:
    with pytest.raises(ValueError, match=r"^wavelengths_nm: must be positive and increase strictly$"):
        check_wavelengths(wavelengths)
    assert check_wavelengths((380.5, 400)).tolist() == [380.5, 400.0]


def test_grids_of_half_and_difference_vectors_say_what_they_are() -> None:
    isotropic, anisotropic = Grid(HALF), Grid(TURNED_HALF)
    assert (isotropic.half_difference, isotropic.anisotropic, isotropic.copies) == (True, False, 1)
    assert (anisotropic.half_difference, anisotropic.anisotropic, anisotropic.copies) == (True, True, 4)
    assert isotropic.reciprocal
    assert not Grid({**HALF, "phi_d": [0, 90, 180]}).reciprocal  # both ways of a pair have nodes
    assert not Grid({**TURNED_HALF, "phi_d": [0, 180, 360]}).reciprocal
    assert isotropic.symmetries[-1] == anisotropic.symmetries[-1] == "brdf(theta_i, theta_r) = brdf(theta_r, theta_i)"
    assert len(anisotropic.symmetries) == 3
    assert not Grid(HALF).reaches_horizon
    assert Grid(TURNED_HALF | {"phi_h": [0, 90, 180]}).copies == 2
    assert Grid(ANISOTROPIC | {"phi_i": [0, 180]}).copies == 2
    assert Grid(ANISOTROPIC).copies == 1


@pytest.mark.parametrize("axes", [ISOTROPIC, ANISOTROPIC, HALF, TURNED_HALF])
def test_the_axes_of_a_grid_are_found_among_other_names(axes: dict[str, list[float]]) -> None:
    assert axes_among([*axes, "wavelength", "part"]) == tuple(axes)
    with pytest.raises(ValueError, match=r"^grid axes: none of .* is among theta_i, wavelength$"):
        axes_among(["wavelength", "theta_i"])


@pytest.mark.parametrize("axes", [ISOTROPIC, ANISOTROPIC, HALF, TURNED_HALF])
def test_directions_of_some_rows_are_those_of_the_whole_grid(axes: dict[str, list[float]]) -> None:
    grid = Grid(axes)
    whole, some = grid.directions(), grid.directions(slice(1, 2))
    for all_rows, row in zip(whole, some, strict=True):
        expected = np.broadcast_to(all_rows, grid.shape)[1:2]
        np.testing.assert_array_equal(np.broadcast_to(row, expected.shape), expected)
    part = Grid.part(grid, slice(1, 2))
    assert part.shape == (1, *grid.shape[1:])
    assert part.ends == grid.ends
