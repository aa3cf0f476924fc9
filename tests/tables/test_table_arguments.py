"""Lookups: shapes and types, wavelengths, and one sentence for what cannot be asked."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from brdfdb.errors import ParameterError
from brdfdb.geometry import unit_vector
from brdfdb.tables import _coordinates, _kernels
from brdfdb.tables import table as table_module
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Interpolation
from brdfdb.tables.table import Table, points
from tests.tables.made_up import AXES, INTERPOLATION_TOLERANCE, KINDS, WAVELENGTHS, made_up, scipys_cubic


@KINDS
@pytest.mark.parametrize(
    ("wavelengths", "asked", "adds"),
    [
        (None, None, ()),
        (None, 123456.0, ()),
        (None, [500.0, 1.0], (2,)),
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
def test_shapes_of_angles_and_wavelengths(kind: str, wavelengths: Any, asked: Any, adds: tuple[int, ...]) -> None:
    table = made_up(kind, wavelengths, dirac=True)
    assert np.shape(table.lookup(0.1, 0.2, 0.3, 0.4, asked)) == adds
    assert np.shape(table.lookup(np.full((3, 1), 0.1), 0.2, np.full(5, 0.3), 0.4, asked)) == (3, 5, *adds)
    assert np.shape(table.lookup(0.1, np.zeros(2), 0.3, np.zeros((2, 1)), asked)) == (2, 2, *adds)
    assert np.shape(table.lookup(np.zeros((2, 0)), 0.2, np.zeros((2, 1)), 0.4, asked)) == (2, 0, *adds)
    assert np.shape(table.lookup_vectors(np.empty((0, 3)), [0.0, 0.0, 1.0], asked)) == (0, *adds)
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


def test_kernels_are_compiled_for_one_type_of_arguments(monkeypatch: pytest.MonkeyPatch) -> None:
    # they are compiled for each type, and what may be written to is another
    seen: dict[str, set[Any]] = {}

    def spy(module: Any, name: str) -> Any:
        kernel = getattr(module, name)

        def called(*arguments: Any) -> Any:
            types = [
                (each.dtype, each.ndim, each.flags.writeable) for each in arguments if isinstance(each, np.ndarray)
            ]
            seen.setdefault(name, set()).add(tuple(types))
            return kernel(*arguments)

        return called

    lookups = {name: spy(_kernels, name) for name in ("by_angles", "by_vectors")}
    monkeypatch.setattr(table_module, "_kernels", SimpleNamespace(**lookups))
    coordinates = {"Rule": _coordinates.Rule, "points_of_vectors": spy(_coordinates, "points_of_vectors")}
    monkeypatch.setattr(table_module, "_coordinates", SimpleNamespace(**coordinates))
    table, theta = made_up("isotropic"), np.linspace(0.0, 1.5, 4)
    w = unit_vector(theta, 0.0)
    table.lookup(0.5, 0.0, theta, np.pi)
    table.lookup(theta, theta, theta, theta)
    table.lookup(0.5, 0.0, 0.5, np.pi)
    table.lookup_vectors(w[0], w)
    table.lookup_vectors(w, w)
    points(table.grid, w, w)
    assert {name: len(types) for name, types in seen.items()} == dict.fromkeys((*lookups, "points_of_vectors"), 1)
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
    for wavelength in (1.0, 550.0, 1e9):
        assert table.lookup(0.3, 0.0, 0.4, 1.0, wavelength) == grey
        assert table.specular_reflectance(0.3, wavelength) == dirac


@pytest.mark.parametrize(
    ("wavelengths", "asked", "sentence"),
    [
        (WAVELENGTHS, 399.9, "wavelength_nm: 399.9 is outside [400, 2000] nm of random"),
        (WAVELENGTHS, [500.0, 2001.0], "wavelength_nm: 2001 is outside [400, 2000] nm of random"),
        (WAVELENGTHS, 2000.00001, "wavelength_nm: 2000.00001 is outside [400, 2000] nm of random"),
        (WAVELENGTHS[:1], 401.0, "wavelength_nm: 401 is not 400 nm, the one wavelength of random"),
        (WAVELENGTHS, np.nan, "wavelength_nm: nan is not a positive number of nanometres"),
        (None, [500.0, np.nan], "wavelength_nm: nan is not a positive number of nanometres"),
        (None, np.inf, "wavelength_nm: inf is not a positive number of nanometres"),
        (None, 0.0, "wavelength_nm: 0 is not a positive number of nanometres"),
        (None, -500.0, "wavelength_nm: -500 is not a positive number of nanometres"),
        (WAVELENGTHS, [[500.0]], "wavelength_nm: 2 axes; allowed are a number and a list of numbers"),
        (None, [[500.0]], "wavelength_nm: 2 axes; allowed are a number and a list of numbers"),
    ],
)
def test_a_wavelength_that_the_table_lacks_is_refused_by_name(wavelengths: Any, asked: Any, sentence: str) -> None:
    table = made_up("isotropic", wavelengths, dirac=True)
    for look, angles in ((table.lookup, (0.1, 0.0, 0.2, 0.0)), (table.specular_reflectance, (0.1,))):
        with pytest.raises(ParameterError, match=f"^{re.escape(sentence)}$"):
            look(*angles, asked)


@KINDS
def test_a_bad_angle_is_refused_by_name(kind: str) -> None:
    table = made_up(kind, dirac=True)
    polar = (-0.1, -1e-9, 3.2, [0.1, 90.0], np.inf, -np.inf, "north", True)
    azimuths = (np.inf, [0.0, -np.inf], None, 1j)
    bad = {"theta_i": polar, "theta_r": polar, "phi_i": azimuths, "phi_r": azimuths}
    for name, value in ((name, value) for name, values in bad.items() for value in values):
        angles: dict[str, Any] = {"theta_i": 0.1, "phi_i": 0.2, "theta_r": 0.3, "phi_r": 0.4, name: value}
        with pytest.raises(ParameterError, match=f"^{name}: "):
            table.lookup(**angles)
    with pytest.raises(ParameterError, match=r"^theta_i: -0\.1 rad"):
        table.specular_reflectance(-0.1)


def test_shapes_that_do_not_broadcast_are_refused_by_name() -> None:
    table = made_up("isotropic")
    with pytest.raises(ParameterError, match=r"the shapes \(2,\), \(\), \(3,\), \(\) do not broadcast$"):
        table.lookup([0.1, 0.2], 0.0, [0.1, 0.2, 0.3], 1.0)
    up = np.array([0.0, 0.0, 1.0])
    with pytest.raises(ParameterError, match=r"^wi, wr: the shapes \(2, 3\), \(4, 3\) do not broadcast$"):
        table.lookup_vectors(np.tile(up, (2, 1)), np.tile(up, (4, 1)))


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
