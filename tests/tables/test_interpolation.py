"""Interpolation on one axis and on grids: what it reproduces exactly, at its ends, and against scipy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline, RegularGridInterpolator

from brdfdb._elementary import BLOCK
from brdfdb.tables import _interpolation
from brdfdb.tables._interpolation import Axes, prepared, room, weights_of_nodes
from tests.compiled import compiled

locate, weighted = compiled(_interpolation.locate), compiled(_interpolation.weighted)
trilinear, tricubic = compiled(_interpolation.trilinear), compiled(_interpolation.tricubic)

EXACT = 2e-13  # measured: 4e-14, cubics on unequal steps down to 0.01
UNEQUAL = np.array([0.0, 0.3, 0.35, 1.0, 1.7, 1.71, 2.9, 3.0])
EQUAL = np.linspace(0.0, 3.0, 13)
NODES = pytest.mark.parametrize("nodes", [UNEQUAL, EQUAL], ids=["unequal", "equal"])
OPEN = ("open", "open")


def at(axes: Axes, points: NDArray[np.float64], table: NDArray[np.float32], channels: int = 1) -> NDArray[np.float64]:
    """`weighted` at points of shape (axes, N), block by block."""
    out = np.empty(points.shape[1] * channels)
    for start in range(0, points.shape[1], BLOCK):
        count = min(BLOCK, points.shape[1] - start)
        cell, share = _located(axes, points[:, start : start + count])
        here = out[start * channels : (start + count) * channels]
        weighted(axes, cell, share, count, table.reshape(-1), channels, here)
    return out


def _located(axes: Axes, points: NDArray[np.float64]) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    cell, share = np.empty(points.shape, np.int32), points.copy()
    for axis in range(len(points)):
        locate(axes, axis, share, points.shape[1], cell)
    return cell, share


def along(nodes: NDArray[np.float64], ends: tuple[str, str], values: Any, x: Any, *, cubic: bool) -> Any:
    """Interpolation of values on one axis; the other two are two nodes each, and the values the same on them."""
    axes = prepared([np.array([0.0, 1.0]), np.array([0.0, 1.0]), nodes], [OPEN, OPEN, ends], cubic=cubic)
    table = np.broadcast_to(np.asarray(values), (2, 2, nodes.size)).copy()
    x = np.asarray(x, dtype=np.float64)
    return at(axes, np.stack([np.full_like(x, 0.3), np.full_like(x, 0.6), x]), table)


@NODES
@pytest.mark.parametrize("cubic", [False, True], ids=["linear", "cubic"])
def test_what_it_is_made_for_is_reproduced(nodes: NDArray[np.float64], cubic: bool) -> None:
    x = np.linspace(0.0, 3.0, 500)
    np.testing.assert_allclose(along(nodes, OPEN, 1.0 - 2.0 * nodes, x, cubic=cubic), 1.0 - 2.0 * x, atol=EXACT)
    parabola = along(nodes, OPEN, nodes**2 - nodes, x, cubic=cubic)
    if cubic:
        np.testing.assert_allclose(parabola, x**2 - x, atol=EXACT)
    else:
        assert np.abs(parabola - (x**2 - x)).max() > 0.01


@NODES
@pytest.mark.parametrize(
    ("ends", "function"),
    [
        (("even", "even"), lambda x: np.cos(np.pi * x / 3.0)),
        (("even", "open"), lambda x: np.cosh(x)),
        (("periodic", "periodic"), lambda x: np.sin(2.0 * np.pi * x / 3.0)),
        (OPEN, lambda x: np.exp(-x)),
    ],
)
def test_a_cubic_is_hermites_with_slopes_of_parabolas(nodes: NDArray[np.float64], ends: Any, function: Any) -> None:
    """scipy joins the cubics; the slopes here are numpy's, of the nodes and of their images beyond the ends."""
    before = {"even": -nodes[1], "periodic": nodes[-2] - 3.0}.get(ends[0])
    after = {"even": 6.0 - nodes[-2], "periodic": 3.0 + nodes[1]}.get(ends[1])
    extended = np.concatenate([[] if before is None else [before], nodes, [] if after is None else [after]])
    slopes = np.gradient(function(extended), extended, edge_order=2)
    slopes = slopes[0 if before is None else 1 :][: nodes.size]
    x = np.linspace(0.0, 3.0, 1000)
    found = along(nodes, ends, function(nodes), x, cubic=True)
    np.testing.assert_allclose(found, CubicHermiteSpline(nodes, function(nodes), slopes)(x), atol=EXACT)


@pytest.mark.parametrize("count", [2, 3])
def test_axes_of_few_nodes_are_interpolated_as_well_as_they_allow(count: int) -> None:
    nodes = np.linspace(0.0, 1.0, count)
    x = np.linspace(0.0, 1.0, 50)
    expected = x**2 if count == 3 else x
    np.testing.assert_allclose(along(nodes, OPEN, nodes**2, x, cubic=True), expected, atol=EXACT)


@pytest.mark.parametrize("shared", [1 << 15, 3], ids=["a bucket a node", "buckets shared"])
@pytest.mark.parametrize(
    "nodes",
    [EQUAL, UNEQUAL, np.concatenate([[0.0, 1e-7, 2e-7], np.arange(1, 90) ** 1.5]), np.append(np.arange(90.0), 89.5)],
    ids=["equal", "unequal", "very unequal", "default"],
)
def test_a_point_is_found_in_its_cell(nodes: NDArray[np.float64], shared: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_interpolation, "_MOST_BUCKETS", shared)
    axes = prepared([nodes], [OPEN], cubic=False)
    rng = np.random.default_rng(3)
    x = np.concatenate(
        [rng.uniform(nodes[0], nodes[-1], 5000), nodes, np.nextafter(nodes, -1.0), np.nextafter(nodes, 99)]
    )
    cell, share = _located(axes, x[np.newaxis])
    assert cell.min() >= 0
    assert cell.max() <= nodes.size - 2
    clipped = np.clip(x, nodes[0], nodes[-1])
    found = nodes[cell[0]] + share[0] * (nodes[cell[0] + 1] - nodes[cell[0]])
    np.testing.assert_allclose(found, clipped, rtol=1e-15, atol=1e-15 * nodes[-1])
    assert share.min() >= -1e-12
    assert share.max() <= 1.0 + 1e-12


@NODES
def test_beyond_its_ends_an_axis_gives_the_value_there(nodes: NDArray[np.float64]) -> None:
    for cubic in (False, True):
        found = along(nodes, OPEN, np.exp(nodes), [-1.0, 0.0, 3.0, 4.0, np.inf, -np.inf], cubic=cubic)
        np.testing.assert_allclose(found, np.exp([0.0, 0.0, 3.0, 3.0, 3.0, 0.0]), rtol=EXACT)


@pytest.mark.parametrize("dimensions", [3, 4])
@pytest.mark.parametrize("channels", [1, 5])
def test_linear_interpolation_is_scipys(dimensions: int, channels: int) -> None:
    rng = np.random.default_rng(4)
    axes = [UNEQUAL, EQUAL, UNEQUAL[:5], EQUAL[:3]][:dimensions]
    table = rng.random((*(nodes.size for nodes in axes), channels)).astype(np.float32)
    points = np.stack([rng.uniform(0.0, nodes[-1], 1000) for nodes in axes])
    expected = RegularGridInterpolator(axes, table.astype(np.float64))(points.T)
    ready = prepared(axes, [OPEN] * dimensions, cubic=False)
    np.testing.assert_allclose(at(ready, points, table, channels).reshape(-1, channels), expected, atol=1e-14)
    if dimensions == 3 and channels == 1:
        cell, share = _located(ready, points[:, :BLOCK])
        out = np.empty(BLOCK)
        trilinear(ready, cell, share, BLOCK, table.reshape(-1), out)
        np.testing.assert_allclose(out, expected[:BLOCK, 0], atol=1e-14)


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 7, BLOCK - 1])
def test_points_that_do_not_fill_a_group_are_as_others(count: int) -> None:
    rng = np.random.default_rng(6)
    axes = [UNEQUAL, EQUAL, UNEQUAL[:5]]
    table = rng.random([nodes.size for nodes in axes]).astype(np.float32)
    ready = prepared(axes, [OPEN] * 3, cubic=False)
    points = np.stack([rng.uniform(0.0, nodes[-1], count) for nodes in axes])
    cell, share = np.full((3, room(count)), -1, np.int32), np.full((3, room(count)), np.nan)
    cell[:, :count], share[:, :count] = _located(ready, points)
    out = np.full(room(count) + 1, 7.0)
    trilinear(ready, cell, share, count, table.reshape(-1), out)
    np.testing.assert_allclose(out[:count], at(ready, points, table), rtol=EXACT)
    assert out[-1] == 7.0


@pytest.mark.parametrize("sizes", [(8, 13, 5), (4, 13, 4)])
@pytest.mark.parametrize("end", [("even", "open"), ("open", "even"), ("even", "even"), OPEN])
def test_the_kernel_for_three_cubic_axes_is_the_general_one(sizes: tuple[int, ...], end: tuple[str, str]) -> None:
    rng = np.random.default_rng(5)
    axes = [nodes[:size] for nodes, size in zip((UNEQUAL, EQUAL, UNEQUAL), sizes, strict=True)]
    table = rng.random(sizes).astype(np.float32)
    ready = prepared(axes, [("even", "open"), end, end], cubic=True)
    points = np.stack([rng.uniform(0.0, nodes[-1], BLOCK) for nodes in axes])
    points[:, :4] = [axis[[0, 1, -2, -1]] for axis in axes]
    cell, share = _located(ready, points)
    out = np.empty(BLOCK)
    tricubic(ready, cell, share, BLOCK, table.reshape(-1), out)
    general = prepared(axes, [("even", "open"), end, end], cubic=True)._replace(lines=np.empty((0, 16)))
    np.testing.assert_allclose(out, at(general, points, table), rtol=1e-14, atol=1e-14)
    assert out[0] == table[0, 0, 0]  # exact on a node


@pytest.mark.parametrize(("size", "end"), [(5, ("periodic", "periodic")), (3, OPEN)])
def test_an_axis_without_four_neighbours_takes_the_general_kernel(size: int, end: tuple[str, str]) -> None:
    assert prepared([UNEQUAL, UNEQUAL[:size], UNEQUAL], [OPEN, end, OPEN], cubic=True).lines.size == 0


@NODES
def test_weights_of_nodes_make_scipys_cubic(nodes: NDArray[np.float64]) -> None:
    values = np.random.default_rng(5).normal(size=nodes.size)
    x = np.concatenate([np.linspace(nodes[0], nodes[-1], 200), nodes])
    index, weight = weights_of_nodes(nodes, x)
    slopes = np.gradient(values, nodes, edge_order=2)  # of the parabolas, at the ends, too
    np.testing.assert_allclose(
        np.sum(values[index] * weight, axis=1), CubicHermiteSpline(nodes, values, slopes)(x), rtol=0.0, atol=EXACT
    )
    np.testing.assert_allclose(weight.sum(axis=1), 1.0, rtol=0.0, atol=EXACT)


@pytest.mark.parametrize("count", [1, 2, 3, 8])
@pytest.mark.parametrize("cubic", [True, False])
def test_on_a_node_its_weight_is_exactly_1(count: int, cubic: bool) -> None:
    nodes = UNEQUAL[:count]
    index, weight = weights_of_nodes(nodes, nodes, cubic=cubic)
    assert np.all((weight == 0.0) | (weight == 1.0))
    np.testing.assert_array_equal(np.sum(np.where(weight == 1.0, nodes[index], 0.0), axis=1), nodes)
    if count > 1 and (count < 3 or not cubic):
        index, weight = weights_of_nodes(nodes, nodes[:-1] + 0.25 * np.diff(nodes), cubic=cubic)
        np.testing.assert_allclose(weight, np.tile([0.75, 0.25, 0.0, 0.0], (count - 1, 1)), rtol=0.0, atol=EXACT)


@pytest.mark.parametrize("cubic", [False, True], ids=["linear", "cubic"])
@pytest.mark.parametrize("nodes", [UNEQUAL, EQUAL, UNEQUAL[[0, -1]]], ids=["unequal", "equal", "two"])
def test_the_last_node_of_a_periodic_axis_is_the_first(nodes: NDArray[np.float64], cubic: bool) -> None:
    """The numbers of both are rounded each by itself; without this there would be a step."""
    values = np.sin(2.0 * np.pi * nodes / 3.0) + 2.0
    values[-1] += 1e-3
    first, below, last = along(nodes, ("periodic", "periodic"), values, [0.0, 3.0 - 1e-12, 3.0], cubic=cubic)
    assert first == last == 2.0
    assert below == pytest.approx(2.0, abs=1e-10)
