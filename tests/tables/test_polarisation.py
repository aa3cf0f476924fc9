"""Polarised tables: Mueller matrices beside f_r, to a tolerance, while f_r keeps every byte."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import brdfdb
from brdfdb import models
from brdfdb.errors import ParameterError
from brdfdb.geometry import unit_vector
from brdfdb.materials import Material
from brdfdb.materials.polarised import polarised_source
from brdfdb.store.publication import publish_dataset, publish_layout
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Layout
from brdfdb.tables.planner import coarsest, plan
from brdfdb.tables.polarisation import MuellerFacets, planned_theta_d
from brdfdb.tables.table import Table
from brdfdb.tables.tabulation import tabulate
from tests.tables.made_up import material

WAVELENGTHS = np.array([450.0, 500.0, 650.0])
TOLERANCE = 0.02
ROUNDING = 1e-6  # of elements at nodes, which are float32


def rough(refractive_index: str = "main/Cu/Johnson", a: float = 0.1, sigma_0_um: float = 0.3) -> Material:
    parameters = {"sigma_0_um": sigma_0_um, "tau_um": 2.0, "a": a}
    made = material("he_torrance", **parameters)
    return made.model_copy(update={"refractive_index": refractive_index})


def polarised(source: Material, tolerance: float = TOLERANCE) -> Layout:
    layout = plan(source, WAVELENGTHS, tolerance)
    return replace(layout, facet_theta_d_deg=planned_theta_d(source, WAVELENGTHS, tolerance))


@pytest.fixture(scope="module")
def layout() -> Layout:
    return polarised(rough())


@pytest.fixture(scope="module")
def table(layout: Layout, tmp_path_factory: pytest.TempPathFactory) -> Table:
    root = tmp_path_factory.mktemp("polarised") / "store"
    publish_layout(root, "made-up", layout)
    return brdfdb.open(root)["made-up"]


def directions(count: int = 2000) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(12)
    light, viewer = (unit_vector(np.arccos(rng.random(count)), rng.uniform(0.0, 6.28, count)) for _ in range(2))
    return light, viewer


def normalised(mueller: np.ndarray) -> np.ndarray:
    return mueller / mueller[..., :1, :1]


def test_elements_keep_to_the_tolerance_and_to_what_is_stated(table: Table) -> None:
    wi, wr = directions()
    wrong = np.abs(
        normalised(table.mueller_vectors(wi, wr)) - normalised(polarised_source(rough()).mueller(wi, wr, WAVELENGTHS))
    )
    p99 = np.percentile(wrong, 99.0, axis=0).max(axis=0)
    record = table.metadata.polarisation
    assert record is not None
    assert record.error is not None
    assert p99.max() <= TOLERANCE
    assert record.error.worst_p99 <= TOLERANCE
    assert np.all(p99 <= 1.5 * np.array(record.error.p99) + 1e-12)  # at other directions; measured 1.17
    assert record.error.between_max is not None
    assert np.max(record.error.max) >= record.error.worst_p99


def test_elements_of_the_facet_keep_to_half_the_tolerance_between_nodes() -> None:
    for source in (rough(), rough("main/MgO/Stephens-vis"), rough("main/Al/Rakic")):
        nodes = planned_theta_d(source, WAVELENGTHS, 1e-3)
        layout = Layout(source, coarsest(source), WAVELENGTHS, facet_theta_d_deg=nodes)
        table = Table.of(layout, np.zeros(layout.shape, np.float32))
        theta_d = np.linspace(0.0, np.pi / 2.0, 5001)
        truth = polarised_source(source).facet(theta_d, WAVELENGTHS)
        assert np.abs(table.facet_mueller(theta_d) - truth).max() <= 0.5 * 1e-3 + ROUNDING


def test_the_first_element_is_f_r_and_the_matrix_is_0_below_the_horizon_and_nan_with_nan(table: Table) -> None:
    angles = 0.4, 0.3, 0.9, 2.5
    matrix = table.mueller(*angles)
    assert matrix.shape == (3, 4, 4)
    np.testing.assert_array_equal(matrix[:, 0, 0], table.lookup(*angles))
    assert table.mueller(*angles, 500.0).shape == (4, 4)
    np.testing.assert_array_equal(table.mueller(*angles, 500.0), matrix[1])
    assert table.mueller(np.full((2, 1), 0.4), 0.0, np.full(3, 0.5), 1.0, [500.0]).shape == (2, 3, 1, 4, 4)
    assert not table.mueller(0.4, 0.0, 1.7, 1.0).any()
    assert np.isnan(table.mueller(np.nan, 0.0, 0.7, 1.0)).all()
    assert table.mueller(np.float32([0.4]), 0.0, np.float32([0.5]), 1.0).dtype == np.float32


def test_angles_and_vectors_agree_at_the_pole_too(table: Table) -> None:
    theta, phi = np.array([0.0, 0.4, 0.8]), np.array([0.0, 0.3, 4.0])
    by_angles = table.mueller(theta, phi, theta[::-1], phi[::-1])
    by_vectors = table.mueller_vectors(unit_vector(theta, phi), unit_vector(theta[::-1], phi[::-1]))
    np.testing.assert_allclose(by_vectors, by_angles, rtol=1e-9, atol=1e-12)


def test_specular_part_is_that_of_the_model(tmp_path: Path) -> None:
    smooth = rough(a=0.0, sigma_0_um=0.02)
    publish_layout(tmp_path, "made-up", polarised(smooth))
    theta = np.deg2rad([0.0, 10.0, 40.0, 70.0, 85.0])
    table = brdfdb.open(tmp_path)["made-up"]
    arguments = smooth.arguments(500.0)
    truth = models.he_torrance_specular_mueller(theta, **{k: v for k, v in arguments.items() if k != "a"})
    found = table.specular_mueller(theta, 500.0)
    np.testing.assert_array_equal(found[:, 0, 0], table.specular_reflectance(theta, 500.0))
    np.testing.assert_allclose(found, truth, rtol=0.0, atol=TOLERANCE * truth.max())


def test_f_r_of_a_polarised_table_keeps_every_byte(layout: Layout) -> None:
    plain, both = tabulate(replace(layout, facet_theta_d_deg=None)), tabulate(layout)
    assert set(both.variables) - set(plain.variables) == {"mueller", "mueller_theta_d", "depolarised"}
    for name in plain.variables:
        assert plain[name].identical(both[name].drop_vars("mueller_theta_d", errors="ignore"))
    assert {key: value for key, value in both.attrs.items() if key != "polarisation"} == plain.attrs
    assert "facet_theta_d_deg" not in replace(layout, facet_theta_d_deg=None).document()
    assert Layout.from_document(layout.document()).document() == layout.document()


def test_plain_tables_take_the_depolarised_part_out_of_f_r(tmp_path: Path) -> None:
    theta = [*range(0, 80, 2), *np.arange(80.0, 90.1)]
    grid = Grid({"theta_i": theta, "theta_r": theta, "delta_phi": range(0, 181, 2)})
    nodes = planned_theta_d(rough(), WAVELENGTHS[:1], 1e-3)
    publish_layout(tmp_path, "made-up", Layout(rough(), grid, WAVELENGTHS[:1], facet_theta_d_deg=nodes))
    table = brdfdb.open(tmp_path)["made-up"]
    angles = np.deg2rad(20.0), 0.0, np.deg2rad(40.0), np.deg2rad(120.0)  # a node
    truth = models.he_torrance_mueller(*angles, **rough().arguments(450.0))
    np.testing.assert_allclose(table.mueller(*angles, 450.0), truth, rtol=0.0, atol=1e-3 * truth[0, 0])


def test_unpolarised_tables_and_sources_say_so(layout: Layout, tmp_path: Path) -> None:
    plain = replace(layout, facet_theta_d_deg=None)
    assert plain.variable in tabulate(plain)
    publish_dataset(tmp_path, "made-up", tabulate(plain))
    with pytest.raises(ParameterError, match=r"polarised: the table of made-up is unpolarised; build it with polaris"):
        brdfdb.open(tmp_path)["made-up"].mueller(0.1, 0.0, 0.2, 0.0)
    with pytest.raises(ParameterError, match="polarised: its model lambert has no Mueller matrices; he_torrance has"):
        planned_theta_d(material("lambert", rho=0.5), WAVELENGTHS, 0.01)
    with pytest.raises(ParameterError, match="tolerance: 1e-16 takes more than 10000 angles of the facet"):
        planned_theta_d(rough(), WAVELENGTHS, 1e-16)


@pytest.mark.parametrize(
    ("name", "change", "sentence"),
    [
        ("mueller", lambda a: a.isel(element=slice(2)), r"mueller: shape \(\d+, 3, 2\) is not"),
        ("mueller_theta_d", lambda a: a * 0.9, "mueller_theta_d: it does not ascend from 0 to 90"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(layout: Layout, tmp_path: Path, name, change, sentence) -> None:  # type: ignore[no-untyped-def]
    dataset = tabulate(layout)
    changed = change(dataset[name])
    broken = dataset.drop_vars(name).assign({name: (changed.dims, changed.values)})
    with pytest.raises(ParameterError, match=sentence):
        publish_dataset(tmp_path, "made-up", broken)


def test_size_of_the_facets_counts(table: Table) -> None:
    assert isinstance(table.facets, MuellerFacets)
    assert table.nbytes > replace(table, facets=None).nbytes + table.facets.elements.nbytes
