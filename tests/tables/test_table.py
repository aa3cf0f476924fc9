"""Lookups: exact on the nodes, linear between them, seamless around them, and one sentence for what cannot be asked."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline, RegularGridInterpolator

from brdfdb.geometry import unit_vector
from brdfdb.materials import Material
from brdfdb.tables import _kernels
from brdfdb.tables import table as table_module
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Interpolation, Layout
from brdfdb.tables.table import Table, points
from brdfdb.tables.tabulation import tabulate

# Sums of sixteen products against scipy's sums in another order; measured 5e-15 of the largest value
INTERPOLATION_TOLERANCE = 1e-13
# A node of delta_phi passes through the folding, which moves it by an ulp of pi; measured 2e-16 of the largest value
NODE_TOLERANCE = 1e-15
STEP = 1e-9  # [rad] to either side of a seam

AXES = {
    "isotropic": {"theta_i": [0, 11, 45, 80], "theta_r": [0, 20, 60, 70, 85], "delta_phi": [0, 30, 100, 175, 180]},
    "anisotropic": {
        "theta_i": [0, 40, 80],
        "phi_i": [0, 70, 200, 360],
        "theta_r": [0, 20, 60, 85],
        "phi_r": [0, 100, 110, 300, 360],
    },
}
WAVELENGTHS = np.array([400.0, 450.0, 600.0, 2000.0])
KINDS = pytest.mark.parametrize("kind", AXES)


def made_up(kind: str, wavelengths: NDArray[np.float64] | None = None, *, dirac: bool = False) -> Table:
    """A table of random numbers: no symmetry or smoothness of a model can hide a mistake."""
    rng = np.random.default_rng(1991)
    axes = {name: np.array(nodes, dtype=np.float64) for name, nodes in AXES[kind].items()}
    spectral = () if wavelengths is None else wavelengths.shape
    brdf = rng.uniform(0.0, 1.0, (*(nodes.size for nodes in axes.values()), *spectral)).astype(np.float32)
    if kind == "anisotropic":  # azimuths close on themselves
        brdf[:, -1] = brdf[:, 0]
        brdf[:, :, :, -1] = brdf[:, :, :, 0]
    specular = rng.uniform(0.0, 1.0, (axes["theta_i"].size, *spectral)).astype(np.float32) if dirac else None
    return Table("random", "r000001", {}, Grid(axes), wavelengths, brdf, specular)


def directions(table: Table, *nodes: Any) -> tuple[Any, ...]:
    """theta_i, phi_i, theta_r, phi_r of coordinates along the axes of a table, all in radians."""
    if table.anisotropic:
        return nodes
    theta_i, theta_r, delta_phi = nodes
    return theta_i, 0.0, theta_r, delta_phi


def random_directions(count: int, seed: int = 7) -> tuple[Any, ...]:
    """Directions above and, as azimuths go, far around the horizon."""
    rng = np.random.default_rng(seed)
    theta_i, theta_r = rng.uniform(0.0, np.pi / 2, (2, count))
    phi_i, phi_r = rng.uniform(-20.0, 20.0, (2, count))
    return theta_i, phi_i, theta_r, phi_r


@KINDS
@pytest.mark.parametrize("wavelengths", [None, WAVELENGTHS, WAVELENGTHS[:1]], ids=["grey", "spectral", "single"])
def test_the_stored_value_comes_back_on_every_node(kind: str, wavelengths: Any) -> None:
    table = made_up(kind, wavelengths)
    nodes = np.meshgrid(*(np.deg2rad(axis) for axis in table.axes_deg.values()), indexing="ij")
    found = table.lookup(*directions(table, *nodes))
    assert found.dtype == np.float64
    np.testing.assert_allclose(found, table.brdf, rtol=0.0, atol=NODE_TOLERANCE)


def scipys_cubic(values: NDArray[np.float64], wavelengths: Any) -> NDArray[np.float64]:
    """Catmull-Rom over wavelengths by others: slopes of parabolas are second-order differences; nothing below 0."""
    slopes = np.gradient(values, WAVELENGTHS, axis=-1, edge_order=2)
    return np.maximum(CubicHermiteSpline(WAVELENGTHS, values, slopes, axis=-1)(wavelengths), 0.0)


@KINDS
def test_between_nodes_it_is_scipys_interpolators_linear_in_angles_and_cubic_in_wavelengths(kind: str) -> None:
    table = made_up(kind, WAVELENGTHS)
    theta_i, phi_i, theta_r, phi_r = random_directions(500)
    wavelengths = np.random.default_rng(3).uniform(400.0, 2000.0, 9)
    inside_i = np.minimum(theta_i, np.deg2rad(table.axes_deg["theta_i"][-1]))
    inside_r = np.minimum(theta_r, np.deg2rad(table.axes_deg["theta_r"][-1]))
    if kind == "anisotropic":
        points = [inside_i, phi_i % (2 * np.pi), inside_r, phi_r % (2 * np.pi)]
    else:
        points = [inside_i, inside_r, np.arccos(np.cos(phi_r - phi_i))]
    scipys = RegularGridInterpolator(
        [np.deg2rad(axis) for axis in table.axes_deg.values()], table.brdf.astype(np.float64)
    )
    expected = scipys_cubic(scipys(np.stack(np.broadcast_arrays(*points), axis=-1)), wavelengths)
    found = table.lookup(theta_i, phi_i, theta_r, phi_r, wavelengths)
    # arccos(cos) folds the azimuth in another way than the table does: worth 1e-8 rad near 0 and 180 degrees
    tolerance = INTERPOLATION_TOLERANCE if kind == "anisotropic" else 1e-7
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=tolerance)


def test_between_nodes_of_an_isotropic_table_scipy_agrees_to_the_last_digits() -> None:
    table = made_up("isotropic")
    rng = np.random.default_rng(4)
    theta_i, theta_r = np.deg2rad(rng.uniform(0.0, 80.0, (2, 500)))
    delta_phi = rng.uniform(0.0, np.pi, 500)
    scipys = RegularGridInterpolator(
        [np.deg2rad(axis) for axis in table.axes_deg.values()], table.brdf.astype(np.float64)
    )
    found = table.lookup(theta_i, 0.0, theta_r, delta_phi)
    expected = scipys(np.stack([theta_i, theta_r, delta_phi], axis=-1))
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=INTERPOLATION_TOLERANCE)


@KINDS
def test_full_turns_change_nothing(kind: str) -> None:
    table = made_up(kind)
    theta_i, phi_i, theta_r, phi_r = random_directions(200)
    once = table.lookup(theta_i, phi_i, theta_r, phi_r)
    for turns_i, turns_r in ((1, 0), (0, -1), (3, 5)):
        turned = table.lookup(theta_i, phi_i + turns_i * 2 * np.pi, theta_r, phi_r + turns_r * 2 * np.pi)
        np.testing.assert_allclose(turned, once, rtol=0.0, atol=1e-12)  # 20 rad is known to 4e-15
    a, b = np.deg2rad(359.9), np.deg2rad(-0.1)
    np.testing.assert_allclose(table.lookup(0.3, 0.0, 0.4, a), table.lookup(0.3, 0.0, 0.4, b), rtol=1e-12)
    np.testing.assert_allclose(table.lookup(0.3, a, 0.4, 0.0), table.lookup(0.3, b, 0.4, 0.0), rtol=1e-12)


def test_an_isotropic_table_is_even_in_the_difference_of_azimuths_and_blind_to_their_mean() -> None:
    table = made_up("isotropic")
    theta_i, phi_i, theta_r, phi_r = random_directions(200)
    straight = table.lookup(theta_i, phi_i, theta_r, phi_r)
    np.testing.assert_allclose(table.lookup(theta_i, -phi_i, theta_r, -phi_r), straight, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(table.lookup(theta_i, phi_r, theta_r, phi_i), straight, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(table.lookup(theta_i, phi_i + 1, theta_r, phi_r + 1), straight, rtol=0.0, atol=1e-12)


def test_an_anisotropic_table_does_depend_on_each_azimuth() -> None:
    table = made_up("anisotropic")
    assert table.lookup(0.3, 1.0, 0.4, 2.0) != pytest.approx(table.lookup(0.3, 1.5, 0.4, 2.5), rel=1e-3)


@KINDS
@pytest.mark.parametrize("seam", [-2 * np.pi, -np.pi, 0.0, np.pi, 2 * np.pi, 4 * np.pi])
@pytest.mark.parametrize("moved", ["phi_i", "phi_r"])
def test_there_is_no_step_at_a_seam(kind: str, seam: float, moved: str) -> None:
    table = made_up(kind)
    angles = {"theta_i": 0.3, "phi_i": 0.0, "theta_r": 0.4, "phi_r": 0.0}
    before, at, after = (table.lookup(**(angles | {moved: seam + step})) for step in (-STEP, 0.0, STEP))
    steepest = 20 * STEP  # values up to 1 over at least 5 degrees
    assert abs(before - at) < steepest
    assert abs(after - at) < steepest


@KINDS
def test_past_the_last_theta_node_the_value_is_that_of_the_node(kind: str) -> None:
    table = made_up(kind)
    _, phi_i, _, phi_r = random_directions(50)
    last_i, last_r = (np.deg2rad(table.axes_deg[name][-1]) for name in ("theta_i", "theta_r"))
    at_node = table.lookup(last_i, phi_i, last_r, phi_r)
    assert np.ptp(at_node) > 0.1
    for beyond in (np.deg2rad(85.001), np.deg2rad(89.9), np.pi / 2):
        np.testing.assert_array_equal(table.lookup(beyond, phi_i, beyond, phi_r), at_node)
        np.testing.assert_array_equal(table.lookup(last_i, phi_i, beyond, phi_r), at_node)


@KINDS
@pytest.mark.parametrize("below", [np.nextafter(np.pi / 2, 2), 1.6, 3.0, np.pi])
def test_below_the_horizon_it_is_dark(kind: str, below: float) -> None:
    table = made_up(kind, WAVELENGTHS, dirac=True)
    assert table.lookup(0.3, 0.0, 0.4, 0.0).min() > 0.0
    for theta_i, theta_r in ((below, 0.4), (0.3, below), (below, below)):
        np.testing.assert_array_equal(table.lookup(theta_i, 0.0, theta_r, 0.0), np.zeros(4))
    np.testing.assert_array_equal(table.specular_reflectance(below), np.zeros(4))


def test_the_float32_horizon_is_the_horizon() -> None:
    table = made_up("isotropic")
    horizon = np.array([np.pi / 2], dtype=np.float32)
    assert horizon.astype(np.float64) > np.pi / 2
    angle = np.array([0.3], dtype=np.float32)
    found = table.lookup(angle, np.float32(0.0), horizon, np.float32(0.0))
    assert found == pytest.approx(table.lookup(0.3, 0.0, np.deg2rad(85), 0.0), rel=1e-6)
    assert found > 0.0
    assert table.lookup(angle, np.float32(0.0), np.nextafter(horizon, np.float32(2)), np.float32(0.0)) == 0.0


@KINDS
@pytest.mark.parametrize("position", range(4))
def test_nan_in_any_angle_gives_nan_there_and_nowhere_else(kind: str, position: int) -> None:
    table = made_up(kind, WAVELENGTHS)
    angles = [np.array([0.1, 0.2, 2.0]) for _ in range(4)]
    clean = table.lookup(*angles)
    angles[position] = np.array([0.1, np.nan, 2.0])
    found = table.lookup(*angles)
    assert np.all(np.isnan(found[1]))
    np.testing.assert_array_equal(found[[0, 2]], clean[[0, 2]])
    below = [3.0] * 4
    below[position] = np.nan
    assert np.isnan(table.lookup(*below, 500.0))


def test_nan_gives_nan_in_the_dirac_part() -> None:
    found = made_up("isotropic", dirac=True).specular_reflectance(np.array([0.1, np.nan]))
    assert np.isfinite(found).tolist() == [True, False]


@KINDS
@pytest.mark.parametrize(
    ("wavelengths", "asked", "adds"),
    [
        (None, None, ()),
        (None, 123456.0, ()),
        (None, [500.0, 0.1], (2,)),
        (WAVELENGTHS, None, (4,)),
        (WAVELENGTHS, 500.0, ()),
        (WAVELENGTHS, np.float64(500.0), ()),
        (WAVELENGTHS, [500.0], (1,)),
        (WAVELENGTHS, [2000.0, 400.0, 401.0], (3,)),
        (WAVELENGTHS, [], (0,)),
        (WAVELENGTHS[:1], None, (1,)),
        (WAVELENGTHS[:1], 400.0, ()),
        (WAVELENGTHS[:1], [400.0, 400.0], (2,)),
    ],
)
def test_shapes_are_those_of_the_angles_then_of_the_wavelengths(
    kind: str, wavelengths: Any, asked: Any, adds: tuple[int, ...]
) -> None:
    table = made_up(kind, wavelengths, dirac=True)
    assert np.shape(table.lookup(0.1, 0.2, 0.3, 0.4, asked)) == adds
    assert np.shape(table.lookup(np.full((3, 1), 0.1), 0.2, np.full(5, 0.3), 0.4, asked)) == (3, 5, *adds)
    assert np.shape(table.lookup(0.1, np.zeros(2), 0.3, np.zeros((2, 1)), asked)) == (2, 2, *adds)
    assert np.shape(table.lookup([], 0.2, 0.3, 0.4, asked)) == (0, *adds)
    assert np.shape(table.lookup(np.zeros((2, 0)), 0.2, np.zeros((2, 1)), 0.4, asked)) == (2, 0, *adds)
    assert np.shape(table.specular_reflectance(0.1, asked)) == adds
    assert np.shape(table.specular_reflectance(np.full((3, 5), 0.1), asked)) == (3, 5, *adds)
    assert np.shape(table.specular_reflectance([], asked)) == (0, *adds)


def test_broadcasting_is_looking_up_one_by_one() -> None:
    table = made_up("anisotropic", WAVELENGTHS, dirac=True)
    theta_i, phi_i, theta_r, phi_r = np.ix_([0.1, 0.9, 1.7], [0.0, 4.0], [0.3, np.nan], [1.0, 5.0, -3.0])
    asked = [450.0, 777.0]
    found = table.lookup(theta_i, phi_i, theta_r, phi_r, asked)
    assert found.shape == (3, 2, 2, 3, 2)
    points = np.broadcast_arrays(theta_i, phi_i, theta_r, phi_r)
    for index in np.ndindex(3, 2, 2, 3):
        point = [angle[index] for angle in points]
        for m, wavelength in enumerate(asked):
            np.testing.assert_array_equal(found[(*index, m)], table.lookup(*point, wavelength))
    specular = table.specular_reflectance(theta_i, asked)
    assert specular.shape == (3, 1, 1, 1, 2)
    for index, m in np.ndindex(3, 2):
        assert specular[index, 0, 0, 0, m] == table.specular_reflectance(theta_i[index, 0, 0, 0], asked[m])


def test_kernels_see_arguments_of_one_type_whether_lookups_are_of_arrays_or_numbers(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # they are compiled for each type, and what may be written to is another
    seen: dict[str, set[Any]] = {}

    def spy(name: str) -> Any:
        kernel = getattr(_kernels, name)

        def called(*arguments: Any) -> Any:
            types = [
                (each.dtype, each.ndim, each.flags.writeable) for each in arguments if isinstance(each, np.ndarray)
            ]
            seen.setdefault(name, set()).add(tuple(types))
            return kernel(*arguments)

        return called

    spies = {name: spy(name) for name in ("by_angles", "by_vectors", "points_of_vectors")}
    monkeypatch.setattr(table_module, "_kernels", SimpleNamespace(Rule=_kernels.Rule, **spies))
    table, theta = made_up("isotropic"), np.linspace(0.0, 1.5, 4)
    w = unit_vector(theta, 0.0)
    table.lookup(0.5, 0.0, theta, np.pi)
    table.lookup(theta, theta, theta, theta)
    table.lookup(0.5, 0.0, 0.5, np.pi)
    table.lookup_vectors(w[0], w)
    table.lookup_vectors(w, w)
    points(table.grid, w, w)
    assert {name: len(types) for name, types in seen.items()} == dict.fromkeys(spies, 1)
    ((wi, wr, *_),) = seen["points_of_vectors"]
    assert wi == wr == (np.float64, 1, False)  # as `by_vectors` gives them


def test_float32_angles_give_float32_and_all_else_float64() -> None:
    table = made_up("isotropic", WAVELENGTHS, dirac=True)
    single = np.array([0.1, 0.2], dtype=np.float32)
    assert table.lookup(single, 0.0, single, single).dtype == np.float32
    assert table.lookup(single, 0.0, single, single, 500.0).dtype == np.float32
    assert table.specular_reflectance(single).dtype == np.float32
    assert table.lookup(single, 0.0, np.array([0.1, 0.2]), single).dtype == np.float64
    assert table.lookup(0, 0, 0, 0).dtype == np.float64
    assert isinstance(table.lookup(0.1, 0, 0.1, 0, 500.0), float)


def test_every_wavelength_of_the_table_gives_its_stored_values_whatever_is_beside_it() -> None:
    table = made_up("isotropic", WAVELENGTHS)
    table.brdf[...] = np.array([1e30, 1e-30, 1e30, 1e-30], dtype=np.float32)
    for wavelength, stored in zip(WAVELENGTHS, table.brdf[0, 0, 0], strict=True):
        assert table.lookup(0.0, 0.0, 0.0, 0.0, wavelength) == stored
    np.testing.assert_array_equal(table.lookup(0.0, 0.0, 0.0, 0.0, WAVELENGTHS), table.brdf[0, 0, 0])


def test_what_is_stored_is_what_is_interpolated_over_wavelengths() -> None:
    # logarithms of a lobe whose exponent is a parabola in the wavelength: a cubic has it but for float32
    wavelengths = np.array([400.0, 430.0, 500.0, 550.0, 700.0])
    grid = Grid({name: np.array(nodes, dtype=np.float64) for name, nodes in AXES["isotropic"].items()})

    def exponent(at: Any) -> Any:
        return 2.0 - 1e-4 * (at - 520.0) ** 2

    values = np.broadcast_to(exponent(wavelengths), (*grid.shape, 5)).astype(np.float32)
    how = Interpolation("linear", logarithm=True, offset=0.01)
    asked = np.linspace(400.0, 700.0, 31)
    table = Table("lobe", "", {}, grid, wavelengths, values, None, interpolation=how)
    expected = np.maximum(np.exp(exponent(asked)) - 0.01, 0.0)
    np.testing.assert_allclose(table.lookup(0.3, 0.0, 0.4, 1.0, asked), expected, rtol=1e-5, atol=1e-7)
    # the same numbers in parts
    basis = np.linalg.qr(np.random.default_rng(1).normal(size=(5, 5)))[0]
    parts = replace(table, values=(values @ basis.T).astype(np.float32), spectra=basis)
    np.testing.assert_allclose(parts.lookup(0.3, 0.0, 0.4, 1.0, asked), expected, rtol=1e-5, atol=1e-7)


def test_two_wavelengths_are_a_straight_line() -> None:
    table = made_up("isotropic", WAVELENGTHS[1:3], dirac=True)
    low, high = table.lookup(0.3, 0.0, 0.4, 1.0)
    assert table.lookup(0.3, 0.0, 0.4, 1.0, 550.0) == pytest.approx((low + 2.0 * high) / 3.0, rel=1e-12)


def test_a_cubic_over_wavelengths_does_not_fall_below_0() -> None:
    table = made_up("isotropic", WAVELENGTHS, dirac=True)
    table.brdf[...] = np.array([1.0, 0.0, 0.0, 1.0], dtype=np.float32)
    assert table.specular is not None
    table.specular[...] = np.array([1.0, 0.0, 0.0, 1.0], dtype=np.float32)
    at = np.linspace(400.0, 2000.0, 161)
    assert table.lookup(0.3, 0.0, 0.4, 1.0, at).min() == 0.0
    assert table.specular_reflectance(0.3, at).min() == 0.0


def test_a_grey_table_is_the_same_at_any_wavelength() -> None:
    table = made_up("isotropic", dirac=True)
    grey, dirac = table.lookup(0.3, 0.0, 0.4, 1.0), table.specular_reflectance(0.3)
    for wavelength in (1e-3, 550.0, 1e9):
        assert table.lookup(0.3, 0.0, 0.4, 1.0, wavelength) == grey
        assert table.specular_reflectance(0.3, wavelength) == dirac


@pytest.mark.parametrize("look", ["lookup", "specular_reflectance"])
@pytest.mark.parametrize(
    ("wavelengths", "asked", "sentence"),
    [
        (WAVELENGTHS, 399.9, "wavelength_nm: 399.9 is outside [400, 2000] nm of random"),
        (WAVELENGTHS, [500.0, 2001.0], "wavelength_nm: 2001 is outside [400, 2000] nm of random"),
        (WAVELENGTHS, 2000.00001, "wavelength_nm: 2000.00001 is outside [400, 2000] nm of random"),
        (WAVELENGTHS[:1], 401.0, "wavelength_nm: 401 is outside [400, 400] nm of random"),
        (WAVELENGTHS, np.nan, "wavelength_nm: nan is not a positive number of nanometres"),
        (None, [500.0, np.nan], "wavelength_nm: nan is not a positive number of nanometres"),
        (None, np.inf, "wavelength_nm: inf is not a positive number of nanometres"),
        (None, 0.0, "wavelength_nm: 0 is not a positive number of nanometres"),
        (None, -500.0, "wavelength_nm: -500 is not a positive number of nanometres"),
        (WAVELENGTHS, [[500.0]], "wavelength_nm: 2 axes; allowed are a number and a list of numbers"),
        (None, [[500.0]], "wavelength_nm: 2 axes; allowed are a number and a list of numbers"),
    ],
)
def test_a_wavelength_that_the_table_lacks_is_refused_by_name(
    look: str, wavelengths: Any, asked: Any, sentence: str
) -> None:
    table = made_up("isotropic", wavelengths, dirac=True)
    angles = (0.1, 0.0, 0.2, 0.0) if look == "lookup" else (0.1,)
    with pytest.raises(ValueError, match=f"^{re.escape(sentence)}$"):
        getattr(table, look)(*angles, asked)


@KINDS
@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("theta_i", -0.1),
        ("theta_r", -1e-9),
        ("theta_i", 3.2),
        ("theta_r", [0.1, 90.0]),
        ("theta_i", np.inf),
        ("theta_r", -np.inf),
        ("phi_i", np.inf),
        ("phi_r", [0.0, -np.inf]),
        ("theta_i", "north"),
        ("phi_r", None),
        ("phi_i", 1j),
        ("theta_r", True),
    ],
)
def test_a_bad_angle_is_refused_by_name(kind: str, name: str, value: Any) -> None:
    angles: dict[str, Any] = {"theta_i": 0.1, "phi_i": 0.2, "theta_r": 0.3, "phi_r": 0.4, name: value}
    with pytest.raises(ValueError, match=f"^{name}: "):
        made_up(kind).lookup(**angles)


def test_a_bad_angle_of_the_dirac_part_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match=r"^theta_i: -0\.1 rad"):
        made_up("isotropic", dirac=True).specular_reflectance(-0.1)


def test_the_dirac_part_is_interpolated_over_theta_and_wavelength() -> None:
    table = made_up("isotropic", WAVELENGTHS, dirac=True)
    nodes = np.deg2rad(table.axes_deg["theta_i"])
    assert table.specular is not None
    np.testing.assert_array_equal(table.specular_reflectance(nodes), table.specular)
    theta_i, asked = np.linspace(0.0, nodes[-1], 40), np.linspace(400.0, 2000.0, 7)
    scipys = RegularGridInterpolator([nodes], table.specular.astype(np.float64))
    expected = scipys_cubic(scipys(theta_i[:, np.newaxis]), asked)
    np.testing.assert_allclose(
        table.specular_reflectance(theta_i, asked), expected, rtol=0.0, atol=INTERPOLATION_TOLERANCE
    )
    np.testing.assert_array_equal(table.specular_reflectance(np.pi / 2), table.specular[-1])


def test_a_model_without_a_dirac_part_reflects_nothing_there() -> None:
    np.testing.assert_array_equal(made_up("isotropic", WAVELENGTHS).specular_reflectance([0.1, 0.2]), np.zeros((2, 4)))
    assert made_up("anisotropic").specular_reflectance(0.1) == 0.0


def test_the_two_kinds_of_table_of_one_material_agree() -> None:
    turning = np.arange(0.0, 361.0, 20.0)
    theta = {"theta_i": [0, 25, 50, 75], "theta_r": [0, 30, 60, 80]}
    iso = Grid(theta | {"delta_phi": turning[:10]})
    aniso = Grid({"theta_i": theta["theta_i"], "phi_i": turning, "theta_r": theta["theta_r"], "phi_r": turning})
    parameters = {"rho": 0.8, "sigma_deg": 30}
    plaster = Material.from_table(
        "plaster", {"title": "Plaster", "model": "oren_nayar", "source": "no paper", "parameters": parameters}
    )
    tables = []
    for grid in (iso, aniso):
        dataset = tabulate(Layout(plaster, grid))
        tables.append(Table("plaster", "r000001", dataset.attrs, grid, None, dataset["brdf"].values, None))
    assert [table.anisotropic for table in tables] == [False, True]
    theta_i, _, theta_r, phi_r = random_directions(300)
    # with the light on a node the two interpolate between the same values, but for their rounding to float32
    for phi_i in np.deg2rad(turning):
        one, other = (table.lookup(theta_i, phi_i, theta_r, phi_r) for table in tables)
        np.testing.assert_allclose(one, other, rtol=2e-7)
