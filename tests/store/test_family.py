"""Families: members come back as they are, what lies between is as far off as stated, and what is refused."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray

from brdfdb import models
from brdfdb.errors import ParameterError, StoreError
from brdfdb.forms.catalogue import of_family, of_table
from brdfdb.geometry import unit_vector
from brdfdb.materials import Material
from brdfdb.store.family import Family, FamilyRecord, Sweep, blended, read_record, stencil
from brdfdb.store.family_records import POINTS, measure, parameter_points
from brdfdb.store.files import sealed
from brdfdb.store.paths import family_path
from brdfdb.tables import error_measurement
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Interpolation, Layout
from brdfdb.tables.table import Table
from brdfdb.tables.tabulation import tabulate
from tests.tables.made_up import read_back

AGREEMENT = 0.2  # promised, between a stated p99 and one measured afresh; measured: 0.03 at most
FLOAT32 = 2e-7  # relative, of tables that are float32; measured: 6e-8
ROUNDING = 2e-12  # of weights that are differences of powers; measured: 3e-13
WAVELENGTHS = np.array([450.0, 550.0, 650.0])
THETA = np.append(np.arange(0.0, 89.0, 5.0), 89.5)
ISOTROPIC = Grid({"theta_i": THETA, "theta_r": THETA, "delta_phi": np.linspace(0.0, 180.0, 37)})
TENS = np.arange(0.0, 91.0, 10.0)
HALF = Grid({"theta_h": np.linspace(0.0, 1.0, 41) ** 2 * 90.0, "theta_d": np.arange(0.0, 91.0, 5.0), "phi_d": TENS})
ELLIPSE = Grid({"theta_h": np.linspace(0.0, 1.0, 33) ** 2 * 90.0, "phi_h": TENS, "theta_d": [0, 90], "phi_d": [0, 180]})
LOGARITHMS = Interpolation("cubic", True, 1e-5, 0.0)


class Made(NamedTuple):
    """A family: its model, the parameters that all members share, its axes, and the grid of its members."""

    model: str
    fixed: dict[str, float]
    axes: dict[str, list[float]]
    grid: Grid = ISOTROPIC
    interpolation: Interpolation = Interpolation()
    wavelength_nm: NDArray[np.float64] | None = None

    def material(self, name: str, varied: dict[str, float]) -> Material:
        """Return the material of a point between the members."""
        fields = {"title": name, "model": self.model, "source": "no paper", "parameters": {**self.fixed, **varied}}
        metal = {"refractive_index": "main/Cu/Johnson"} if self.wavelength_nm is not None else {}
        return Material.from_table(name, {**fields, **metal})

    def drawn(self, rng: np.random.Generator) -> dict[str, float]:
        """Return random parameters in the units of a recipe."""
        return {name: float(rng.uniform(nodes[0], nodes[-1])) for name, nodes in self.axes.items()}


FAMILIES = {
    "clay": Made("oren_nayar", {"rho": 0.8}, {"sigma_deg": [0.0, 10.0, 20.0, 30.0, 40.0]}),
    "brushed": Made(
        "ward",
        {"rho_d": 0.1, "rho_s": 0.2, "alpha_y": 0.2},
        {"alpha_x": [0.1, 0.15, 0.2, 0.3]},
        ELLIPSE,
        Interpolation("cubic", True, 1e-4, 0.5),
    ),
    "copper": Made(
        "he_torrance", {}, {"sigma_0_um": [0.1, 0.13], "tau_um": [1.0, 1.2, 1.5]}, HALF, LOGARITHMS, WAVELENGTHS
    ),
    "grey": Made("lambert", {}, {"rho": [0.0, 0.5, 1.0]}),
    "moon": Made(
        "hapke",
        {"b": 0.24, "c": 0.6, "b_0": 1.0, "theta_bar_deg": 20.0},
        {"w": [0.15, 0.25, 0.35, 0.45], "h": [0.05, 0.1]},
        interpolation=LOGARITHMS,
    ),
}


def made(name: str) -> tuple[Sweep, dict[str, Table]]:
    """The members of a family, in memory."""
    family = FAMILIES[name]
    tables = {}
    for number, values in enumerate(itertools.product(*family.axes.values()), start=1):
        member = f"{name}-{number:03d}"
        material = family.material(member, dict(zip(family.axes, values, strict=True)))
        dataset = tabulate(Layout(material, family.grid, family.wavelength_nm, family.interpolation))
        request = {"material": material.model_dump(mode="json")}
        tables[member] = replace(read_back(dataset, request=request, request_sha256=member), name=member)
    digests = list(tables)
    sweep = Sweep(name=name, title=name, model=family.model, axes=family.axes, members=digests, request_sha256=digests)
    return sweep, tables


Families = dict[str, tuple[Family, dict[str, Table]]]


@pytest.fixture(scope="module")
def families() -> Families:
    """Each family, measured, and its members."""
    members = {name: made(name) for name in FAMILIES}
    return {name: (Family(measure(sweep, tables), tables), tables) for name, (sweep, tables) in members.items()}


def directions(count: int) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(5)
    return tuple(rng.uniform(0.0, high, count) for high in (1.5, 6.0, 1.5, 6.0))


@pytest.mark.parametrize("name", FAMILIES)
def test_members_come_back_as_they_are(name: str, families: Families) -> None:
    family, tables = families[name]
    angles = directions(50)
    for table, point in zip(tables.values(), itertools.product(*family.axes.values()), strict=True):
        at = dict(zip(family.axes, map(float, point), strict=True))
        np.testing.assert_array_equal(family.lookup(*angles, **at), table.lookup(*angles))
        expected = table.specular_reflectance(angles[0])
        np.testing.assert_array_equal(family.specular_reflectance(angles[0], **at), expected)


@pytest.mark.parametrize("name", ["clay", "brushed", "copper"])
def test_the_stated_error_and_one_measured_afresh_agree(name: str, families: Families) -> None:
    # Oren-Nayar over sigma, Ward over alpha_x, He-Torrance over sigma_0 and tau: other parameters, other directions
    family, tables = families[name]
    rng = np.random.default_rng(7)
    base = Material.model_validate(next(iter(tables.values())).attrs["request"]["material"])
    draws, found, truth = [], [], []
    for number in range(120):
        at = {}
        for parameter, nodes in family.axes.items():
            cell = number % (nodes.size - 1)
            at[parameter] = float(rng.uniform(nodes[cell], nodes[cell + 1]))
        material = base.model_copy(update={"parameters": {**base.parameters, **at}})
        drawn = error_measurement.draw(material, family.wavelength_nm, 40, 1000 + number)
        draws.append(drawn)
        truth.append(error_measurement.model_values(material, family.wavelength_nm, drawn.wi, drawn.wr))
        found.append(family.lookup_vectors(drawn.wi, drawn.wr, **at).reshape(truth[-1].shape))
    whole = error_measurement.RandomPairs(*(np.concatenate(parts) for parts in zip(*draws, strict=True)))
    afresh = error_measurement.compare(np.concatenate(found), np.concatenate(truth), whole)
    assert afresh.overall.p99 == pytest.approx(family.error.overall.p99, rel=AGREEMENT)
    assert family.error.overall.p99 > 1e-3
    assert family.record.worst.p99 >= family.error.overall.p99
    assert family.record.points >= POINTS


def test_what_a_family_states_between_wavelengths_holds(families: Families) -> None:
    family, _ = families["copper"]
    assert family.error.between is not None
    rng = np.random.default_rng(8)
    within = []
    for number in range(60):
        at = FAMILIES["copper"].drawn(rng)
        material = FAMILIES["copper"].material("copper", at)
        wavelength = rng.uniform(WAVELENGTHS[0], WAVELENGTHS[-1], 1)
        drawn = error_measurement.draw(material, wavelength, 20, 2000 + number)
        wi, wr = drawn.wi[drawn.above], drawn.wr[drawn.above]
        stated = family.lookup_vectors_with_error(wi, wr, wavelength, **at)
        truth = error_measurement.model_values(material, wavelength, wi, wr)
        within.append(np.abs(stated.brdf - truth) <= stated.error)
    assert np.mean(np.concatenate(within)) >= 0.98  # promised


def test_the_dirac_part_is_as_far_off_as_stated(families: Families) -> None:
    family, _ = families["copper"]
    theta_i = np.linspace(0.0, 1.5, 20)
    worst = 0.0
    base = Material.model_validate(family._member(0).attrs["request"]["material"]).arguments(WAVELENGTHS)
    for sigma_0_um, tau_um in [(0.107, 1.1), (0.115, 1.3), (0.125, 1.45)]:
        found = family.specular_reflectance(theta_i, sigma_0_um=sigma_0_um, tau_um=tau_um)
        arguments = {name: base[name] for name in ("wavelength_nm", "n", "k")}
        truth = models.he_torrance_specular(theta_i[:, np.newaxis], sigma_0_um=sigma_0_um, tau_um=tau_um, **arguments)
        worst = max(worst, float(np.abs(found - truth).max()))
    assert family.record.specular_error is not None
    assert 0.0 < worst < 1.2 * family.record.specular_error


def test_what_is_linear_is_interpolated_exactly(families: Families) -> None:
    family, _ = families["grey"]
    assert family.record.interpolation.offset is None
    assert family.error.overall.p99 < FLOAT32
    assert family.lookup(0.3, 0.0, 0.5, 2.0, rho=0.37) == pytest.approx(0.37 / np.pi, rel=FLOAT32)


def test_the_interpolation_chosen_is_the_one_that_was_measured_best(families: Families) -> None:
    for family, _ in families.values():
        said = family.record.interpolation.reason.split("; ")
        left = [float(way.rpartition(" ")[2]) for way in said]
        assert left == sorted(left)
        assert said[0].startswith(f"{family.record.interpolation.method} in ")
        assert ("logarithms" in said[0]) == (family.record.interpolation.offset is not None)


@pytest.mark.parametrize("power", [-2, -1, 0, 1, 2])
@pytest.mark.parametrize(("cubic", "order"), [(False, 1), (True, 3)])
def test_polynomials_in_a_power_of_the_parameter_come_back(power: int, cubic: bool, order: int) -> None:
    nodes = np.array([0.5, 0.7, 1.1, 1.3, 2.0])

    def polynomial(x: Any) -> Any:
        y = np.log(x) if power == 0 else x ** float(power)
        return sum(c * y**n for n, c in enumerate((1.0, 0.5, -0.3, 0.2)[: order + 1]))

    for value in (0.5, 0.52, 0.9, 1.1, 1.25, 1.9, 2.0):
        first, weights, _ = stencil(nodes, value, power, cubic=cubic)
        near = nodes[first : first + weights.size]
        assert near[0] <= value <= near[-1]
        assert weights @ polynomial(near) == pytest.approx(polynomial(value), rel=ROUNDING)
        if value in nodes:
            assert sorted(weights)[-1] == 1.0
            assert np.count_nonzero(weights) == 1


def test_means_are_not_below_0_and_0_where_all_are() -> None:
    values = [np.array([0.0, 1.0, np.nan]), np.array([0.0, 4.0, 1.0])]
    for offset, mean in ((None, 2.5), (1e-6, 2.0)):
        found = blended(values, [0.5, 0.5], offset)
        assert found == pytest.approx([0.0, mean, np.nan], rel=1e-5, nan_ok=True)
        assert found[0] == 0.0
        assert blended([np.ones(1), np.full(1, 9.0)], [1.5, -0.5], offset)[0] >= 0.0


def test_points_fill_the_cells_evenly() -> None:
    points = parameter_points((3, 4), 1)
    cells = [point.cell for point in points]
    assert [cells.count(cell) for cell in itertools.product(range(2), range(3))] == [43] * 6
    within = np.array([point.within for point in points])
    assert np.all((within >= 0.0) & (within < 1.0))
    assert np.all(np.histogram(within, bins=4, range=(0.0, 1.0))[0] > 120)
    many = [point.cell for point in parameter_points((101, 11), 1)]
    assert len(set(many)) == len(many) == POINTS
    assert many != [point.cell for point in parameter_points((101, 11), 2)]


def test_parameters_that_are_none_of_the_family_are_refused(families: Families) -> None:
    family, _ = families["clay"]
    refused: list[tuple[str, dict[str, Any]]] = [("sigma", {})]
    refused += [("sigma", {"sigma": value}) for value in (0.7, -0.1, np.nan, "much", [0.1, 0.8], [0.1, np.nan])]
    refused += [("rho", {"sigma": 0.1, "rho": 0.5}), ("sigma_deg", {"sigma_deg": 10.0})]
    asks = ((family.lookup, (0.1, 0.0, 0.1, 0.0)), (family.lookup_vectors, ([0, 0, 1], [0, 0, 1])))
    for name, given in refused:
        for ask, angles in (*asks, (family.specular_reflectance, (0.1,))):
            with pytest.raises(ParameterError) as caught:
                ask(*angles, **given)
            assert caught.value.parameter == name


def test_angles_are_radians_and_both_ends_are_within(families: Families) -> None:
    family, tables = families["clay"]
    at = (0.4, 0.0, 0.9, 2.0)
    assert family.lookup(*at, sigma=np.deg2rad(40.0)) == tables["clay-005"].lookup(*at)
    assert family.lookup(*at, sigma=np.deg2rad(40.0) * (1.0 + 1e-15)) == tables["clay-005"].lookup(*at)
    assert family.lookup(*at, sigma=0) == tables["clay-001"].lookup(*at)


def drawn_parameters(family: Family, count: int) -> dict[str, np.ndarray]:
    """Random parameters, the first ones of them those of members."""
    rng = np.random.default_rng(9)
    at = {name: rng.uniform(nodes[0], nodes[-1], count) for name, nodes in family.axes.items()}
    for name, nodes in family.axes.items():
        at[name][: nodes.size] = nodes
    return at


def stating(family: Family, tables: dict[str, Table]) -> tuple[Family, dict[str, Table]]:
    """The family with members that state half of its error."""
    half = family.error.model_copy(update={"p99": (0.5 * np.array(family.error.p99)).tolist()}).model_dump(mode="json")
    stated = {name: replace(table, attrs={**table.attrs, "error": half}) for name, table in tables.items()}
    return Family(family.record, stated), stated


@pytest.mark.parametrize("name", FAMILIES)
def test_arrays_of_parameters_give_what_single_calls_give(name: str, families: Families) -> None:
    family, _ = stating(*families[name])
    angles = directions(40)
    at = drawn_parameters(family, 40)
    found = family.lookup(*angles, **at)
    stated = family.lookup_with_error(*angles, **at)
    specular = family.specular_reflectance(angles[0], **at)
    for row in range(40):
        one = {parameter: float(values[row]) for parameter, values in at.items()}
        pair = [angle[row] for angle in angles]
        np.testing.assert_array_equal(found[row], family.lookup(*pair, **one))
        np.testing.assert_array_equal(specular[row], family.specular_reflectance(pair[0], **one))
        np.testing.assert_array_equal(stated.error[row], family.lookup_with_error(*pair, **one).error)
    np.testing.assert_array_equal(stated.brdf, found)
    wi, wr = unit_vector(*angles[:2]), unit_vector(*angles[2:])
    np.testing.assert_allclose(family.lookup_vectors(wi, wr, **at), found, rtol=1e-6, atol=1e-9)


def test_members_come_back_as_they_are_in_arrays_too(families: Families) -> None:
    family, tables = stating(*families["copper"])
    angles = directions(30)
    points = np.array(list(itertools.product(*family.axes.values())))
    at = {parameter: points[:, [axis]] for axis, parameter in enumerate(family.axes)}
    found = family.lookup_with_error(*angles, 450.0, **at)
    assert found.brdf.shape == (len(tables), 30)
    for row, table in enumerate(tables.values()):
        expected = table.lookup_with_error(*angles, 450.0)
        np.testing.assert_array_equal(found.brdf[row], expected.brdf)
        np.testing.assert_array_equal(found.error[row], expected.error)


def test_parameters_broadcast_like_angles(families: Families) -> None:
    family, _ = families["copper"]
    angles = [angle.astype(np.float32) for angle in directions(5)]
    at = {"sigma_0_um": np.array([0.1, 0.11, 0.12])[:, np.newaxis], "tau_um": 1.1}
    for wavelength, tail in ((None, (3,)), (500.0, ()), ([500.0], (1,))):
        found = family.lookup(*angles, wavelength, **at)
        assert (found.shape, found.dtype) == ((3, 5, *tail), np.float32)
        assert family.gradient(*angles, wavelength, **at).derivatives["tau_um"].shape == (3, 5, *tail)
    assert family.lookup(0.1, 0.0, 0.2, 0.0, 500.0, **at).shape == (3, 1)
    assert family.lookup(*(angle[:0] for angle in angles), sigma_0_um=np.empty(0), tau_um=1.1).shape == (0, 3)
    single = family.lookup(*angles, 500.0, sigma_0_um=np.full(5, 0.13, np.float32), tau_um=np.float32(1.2))
    np.testing.assert_array_equal(single, family.lookup(*angles, 500.0, sigma_0_um=0.13, tau_um=1.2))
    with pytest.raises(ParameterError, match=r"sigma_0_um, tau_um: the shapes \(2,\), \(3,\) do not broadcast"):
        family.lookup(0.1, 0.0, 0.2, 0.0, sigma_0_um=[0.1, 0.12], tau_um=[1.0, 1.1, 1.2])
    with pytest.raises(ParameterError, match=r"the shapes of parameters, \(2,\), and directions, .*, do not broadcast"):
        family.lookup(*angles, sigma_0_um=[0.1, 0.12], tau_um=1.1)
    labelled = xr.DataArray([0.1, 0.11], dims="material", coords={"material": ["a", "b"]})
    by_name = family.lookup(xr.DataArray([0.1, 0.2, 0.3], dims="light"), 0.0, 0.2, 0.0, sigma_0_um=labelled, tau_um=1.1)
    assert set(by_name.dims) == {"light", "material", "wavelength"}
    assert list(by_name["material"].values) == ["a", "b"]


@pytest.mark.parametrize("name", FAMILIES)
def test_derivatives_are_those_of_the_interpolation(name: str, families: Families) -> None:
    family, _ = families[name]
    rng = np.random.default_rng(10)
    angles = directions(60)
    step = 1e-4  # of the width of the cell
    at, width = {}, {}
    for parameter, nodes in family.axes.items():
        cell = rng.integers(0, nodes.size - 1, 60)
        width[parameter] = nodes[cell + 1] - nodes[cell]
        at[parameter] = nodes[cell] + rng.uniform(0.05, 0.95, 60) * width[parameter]
    found = family.gradient(*angles, **at)
    np.testing.assert_array_equal(found.f_r, family.lookup(*angles, **at))
    vectors = family.gradient_vectors(unit_vector(*angles[:2]), unit_vector(*angles[2:]), **at)
    assert list(found.derivatives) == list(family.axes)
    for parameter, values in found.derivatives.items():
        up, down = ({**at, parameter: at[parameter] + sign * step * width[parameter]} for sign in (1.0, -1.0))
        scale = (2.0 * step * width[parameter]).reshape(-1, *(1,) * (values.ndim - 1))
        differences = (family.lookup(*angles, **up) - family.lookup(*angles, **down)) / scale
        offset = family.record.interpolation.offset or 0.0  # digits of smaller values are those of their sum with it
        size = (found.f_r + offset) * 2.0 * step / scale + np.abs(differences)
        assert np.all(np.abs(values - differences) <= 1e-6 * size)  # step squared; measured: 2e-8
        np.testing.assert_allclose(vectors.derivatives[parameter], values, rtol=1e-6, atol=1e-9)
        one = {other: float(column[7]) for other, column in at.items()}
        single = family.gradient(*(angle[7] for angle in angles), **one)
        np.testing.assert_array_equal(single.derivatives[parameter], values[7])


def test_derivatives_at_members_are_those_of_the_cell_above(families: Families) -> None:
    family, tables = families["grey"]  # f_r = rho / pi
    rho = np.array([0.0, 0.3, 0.5, 1.0])
    found = family.gradient(0.3, 0.0, 0.5, 2.0, rho=rho)
    np.testing.assert_allclose(found.derivatives["rho"], 1.0 / np.pi, rtol=FLOAT32)
    assert found.f_r[2] == tables["grey-002"].lookup(0.3, 0.0, 0.5, 2.0)
    below = family.gradient([2.0, np.nan], 0.0, 0.5, 2.0, rho=0.4)
    np.testing.assert_array_equal(below.derivatives["rho"], [0.0, np.nan])
    clay, _ = families["clay"]
    for degree, side in ((10.0, 1.0), (40.0, -1.0)):
        sigma = np.deg2rad(degree)
        value, near = (clay.gradient(0.5, 0.0, 1.2, 0.5, sigma=at) for at in (sigma, sigma + side * 1e-6))
        assert value.derivatives["sigma"] == pytest.approx(near.derivatives["sigma"], rel=1e-4)


def test_each_member_is_read_once_in_a_call(families: Families) -> None:
    family, tables = families["moon"]
    asked = []

    class Counted(dict[str, Table]):
        def __getitem__(self, name: str) -> Table:
            asked.append(name)
            return super().__getitem__(name)

    at = drawn_parameters(family, 10_000)
    angles = directions(10_000)
    found = Family(family.record, Counted(tables)).lookup(*angles, **at)
    assert sorted(asked) == sorted(tables)
    np.testing.assert_array_equal(found, family.lookup(*angles, **at))


def test_notebooks_show_the_record(families: Families) -> None:
    html = families["clay"][0]._repr_html_()
    for text in ("clay", "oren_nayar", "sigma_deg 0 to 40 (5)", families["clay"][0].record.interpolation.method):
        assert f">{text}<" in html


def test_values_are_shaped_as_those_of_a_table(families: Families) -> None:
    family, tables = families["copper"]
    table = tables["copper-001"]
    at = {"sigma_0_um": 0.11, "tau_um": 1.1}
    angles = [angle.astype(np.float32) for angle in directions(6)]
    for wavelength in (None, 500.0, [500.0], [450.0, 600.0]):
        found, member = family.lookup(*angles, wavelength, **at), table.lookup(*angles, wavelength)
        assert (found.shape, found.dtype) == (member.shape, np.float32)
        stated = family.lookup_with_error(*directions(6), wavelength, **at)
        assert stated.error.shape == stated.brdf.shape == member.shape
        specular = family.specular_reflectance(directions(6)[0], wavelength, **at)
        assert specular.shape == member.shape
    assert np.ndim(family.lookup(0.1, 0.0, 0.1, 0.0, 500.0, **at)) == 0
    assert np.all(family.lookup(2.0, 0.0, 0.1, 0.0, **at) == 0.0)
    assert np.all(np.isnan(family.lookup(np.nan, 0.0, 0.1, 0.0, **at)))
    with pytest.raises(ValueError, match=r"^wavelength_nm: 700 is outside "):
        family.lookup(0.1, 0.0, 0.1, 0.0, 700.0, **at)


def test_angles_and_vectors_agree(families: Families) -> None:
    family, _ = families["brushed"]
    wi, wr = np.array([0.6, 0.0, 0.8]), np.array([-0.48, 0.36, 0.8])
    theta, phi = np.arccos(0.8), np.arctan2(0.36, -0.48)
    stated = family.lookup_vectors_with_error(wi, wr, alpha_x=0.12)
    angles = family.lookup_with_error(theta, 0.0, theta, phi, alpha_x=0.12)
    assert stated.brdf == pytest.approx(angles.brdf, rel=1e-6)  # measured: 1e-15
    # between members the error is that of the family, in this band of theta_i
    p99 = family.error.p99[3][0]
    assert stated.error / stated.brdf == pytest.approx(p99 / (1.0 - p99), rel=1e-12)


def test_a_member_that_was_built_anew_is_not_served(families: Families) -> None:
    family, tables = families["grey"]
    record = family.record.model_copy(update={"request_sha256": ["grey-001", "another", "grey-003"]})
    with pytest.raises(StoreError, match=r"^the family grey is out of date: grey-002 was rebuilt since"):
        Family(record, tables).lookup(0.1, 0.0, 0.1, 0.0, rho=0.4)


def test_members_at_other_wavelengths_are_refused(families: Families) -> None:
    family, tables = families["copper"]
    other = replace(tables["copper-002"], wavelength_nm=WAVELENGTHS + 1.0)
    with pytest.raises(StoreError, match=r"copper-002 is at other wavelengths than another member$"):
        Family(family.record, {**tables, "copper-002": other}).lookup(0.1, 0, 0.1, 0, sigma_0_um=0.1, tau_um=1.1)


def test_a_record_comes_back_and_a_damaged_one_is_named(tmp_path: Path, families: Families) -> None:
    record = families["copper"][0].record
    path = family_path(tmp_path, "copper")
    path.parent.mkdir()
    content = json.loads(json.dumps(record.model_dump(mode="json")))
    path.write_bytes(sealed(content))
    assert read_record(path) == record == FamilyRecord.model_validate(content)
    for change, said in (
        ({"version": 1}, r"is of format brdfdb-family version 1, this program reads brdfdb-family version 2$"),
        ({"points": "many"}, r"is damaged: points: "),
        ({"name": "gold"}, r"is damaged: its record is that of gold$"),
    ):
        path.write_bytes(sealed({**content, **change}))
        with pytest.raises(StoreError, match=rf"^the family copper {said}"):
            read_record(path)
    data = bytearray(sealed(content))
    data[data.index(b'"points": 2') + 10] ^= 1  # 256 becomes 356
    path.write_bytes(data)
    with pytest.raises(StoreError, match=r"^the family copper is damaged: the content of copper\.json changed$"):
        read_record(path)


def test_a_lookup_is_made_of_the_members_around_and_a_form_of_the_middle_ones(families: Families) -> None:
    family, tables = families["grey"]  # linear: two members, or the one that is there
    assert family.around(rho=0.7) == [tables["grey-002"], tables["grey-003"]]
    assert family.around(rho=0.5) == [tables["grey-002"]]
    form = of_family(family)
    wi = wr = np.array([[0.0, 0.6, 0.8]])
    np.testing.assert_allclose(form.evaluate(wi, wr), [[0.25 / np.pi]], rtol=FLOAT32)  # between rho of 0 and 0.5
    assert form.bytes == sum(of_table(tables[f"grey-00{number}"], "", "").bytes for number in (1, 2))


@pytest.mark.parametrize("away_deg", [0.0, 1.0, 3.0])
def test_lookups_near_the_light_are_within_what_a_family_states(away_deg: float, families: Families) -> None:
    """A tenth of a degree decides whether a table sees the hot spot; bands alone would state a sixth of the error."""
    family, _ = families["moon"]
    rng = np.random.default_rng(12)
    theta, phi = rng.uniform(0.0, 1.4, 200), rng.uniform(0.0, 6.0, 200)
    wi, aside = unit_vector(theta, phi), unit_vector(np.full(200, np.pi / 2), phi + np.pi / 2)
    away = np.deg2rad(away_deg)
    wr = np.cos(away) * wi + np.sin(away) * aside
    within, bands = [], []
    for _ in range(25):
        at = FAMILIES["moon"].drawn(rng)
        material = FAMILIES["moon"].material("moon", at)
        brdf, error = family.lookup_vectors_with_error(wi, wr, **at)
        off = np.abs(brdf - material.lookup_vectors(wi, wr))
        within.append(off <= error)
        bands.append(off <= np.max(family.error.p99) * brdf)
    assert np.mean(within) >= 0.98
    if away_deg == 0.0:
        assert np.mean(bands) < 0.9
