"""Audits: closed forms for what passes, a doctored table for each thing that must not, and the schema of the report."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb.audit import audit
from brdfdb.audit.energy import Energy
from brdfdb.audit.reciprocity import Reciprocity
from brdfdb.audit.table_energy import table_energy_of
from brdfdb.audit.table_error import TableError
from brdfdb.audit.values import ValueCounts
from brdfdb.models import MODELS
from brdfdb.tables.albedo import directional_albedo
from brdfdb.tables.grids import Grid
from brdfdb.tables.table import Table
from tests.audit.a_table import (
    ANISOTROPIC,
    ISOTROPIC,
    PARAMETERS,
    THETA,
    UNEQUAL,
    WAVELENGTHS,
    lambert,
    material,
    node,
    tabulated,
    verdicts,
    written,
)

pytestmark = [
    pytest.mark.skipif(numba.config.DISABLE_JIT, reason="minutes without compilation"),
    pytest.mark.usefixtures("few_samples", "each_model_once"),
]

# rho / pi rounded to float32, summed in float64; half an ulp is 6e-8
FLOAT32 = 1e-7
# Two sums of the same numbers in another order; measured 4e-15
QUADRATURE_TOLERANCE = 1e-13


# What passes


@pytest.mark.parametrize("grid", [ISOTROPIC, UNEQUAL, ANISOTROPIC], ids=["isotropic", "unequal", "anisotropic"])
@pytest.mark.parametrize("rho", [0.0, 0.1, 0.5, 1.0])
def test_a_lambertian_reflects_rho_at_every_angle(rho: float, grid: Grid) -> None:
    table = lambert(rho, grid)
    shape = (*(table.brdf.shape[:2] if table.anisotropic else (table.brdf.shape[0], 1)), 1)
    albedo = directional_albedo(table).albedo
    assert albedo.shape == shape
    np.testing.assert_allclose(albedo, rho, rtol=FLOAT32)
    found = audit(table)
    assert (found.verdict, verdicts(found)) == ("passes", {})
    energy, values = found.of(Energy).table, found.of(ValueCounts)
    assert energy.albedo == [[pytest.approx(rho, rel=2 * FLOAT32)]] * grid.shape[0]
    assert energy.specular == [[0.0]] * grid.shape[0]
    assert energy.theta_i_deg == grid.axes["theta_i"].tolist()
    assert {energy.wavelength_nm, energy.max_at_wavelength_nm, energy.exceeds_1_from_theta_i_deg} == {None}
    assert (values.count, values.negative, values.not_finite) == (np.prod(grid.shape), 0, 0)
    assert values.smallest == np.float32(rho / np.pi)


def random_table(grid: Grid, wavelengths: NDArray[np.float64] | None) -> Table:
    rng = np.random.default_rng(1992)
    shape = grid.shape if wavelengths is None else (*grid.shape, wavelengths.size)
    brdf = rng.uniform(0.0, 1.0, shape).astype(np.float32)
    if grid.anisotropic:
        brdf[:, -1] = brdf[:, 0]
        brdf[:, :, :, -1] = brdf[:, :, :, 0]
    return Table("random", "r000001", {}, grid, wavelengths, brdf, None)


def gauss_legendre(edges: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points and weights that are exact to rounding for what is smooth between the edges."""
    x, w = np.polynomial.legendre.leggauss(12)
    half = np.diff(edges)[:, np.newaxis] / 2.0
    return (edges[:-1, np.newaxis] + half * (1.0 + x)).ravel(), (half * w).ravel()


@pytest.mark.parametrize("wavelengths", [None, WAVELENGTHS], ids=["grey", "spectral"])
@pytest.mark.parametrize("grid", [ISOTROPIC, UNEQUAL, ANISOTROPIC], ids=["isotropic", "unequal", "anisotropic"])
def test_albedo_is_the_integral_of_what_lookup_returns(grid: Grid, wavelengths: NDArray[np.float64] | None) -> None:
    table = random_table(grid, wavelengths)
    theta_r, theta_weight = gauss_legendre(np.append(np.deg2rad(grid.axes["theta_r"]), np.pi / 2))
    phi_nodes = np.deg2rad(grid.axes["phi_r" if grid.anisotropic else "delta_phi"])
    phi_r, phi_weight = gauss_legendre(phi_nodes if grid.anisotropic else np.append(-phi_nodes[:0:-1], phi_nodes))
    weight = (theta_weight * np.sin(theta_r) * np.cos(theta_r))[:, np.newaxis] * phi_weight
    assert weight.sum() == pytest.approx(np.pi, rel=1e-12)
    phi_i_nodes = np.deg2rad(grid.axes["phi_i"]) if grid.anisotropic else np.zeros(1)
    theta_i, phi_i, theta, phi = np.ix_(np.deg2rad(grid.axes["theta_i"]), phi_i_nodes, theta_r, phi_r)
    values = table.lookup(theta_i, phi_i, theta, phi)
    brute = np.einsum("iptq...,tq->ip...", values, weight)
    albedo = directional_albedo(table).albedo
    assert albedo.std() > 0.01
    np.testing.assert_allclose(albedo.ravel(), brute.ravel(), rtol=QUADRATURE_TOLERANCE)


GRIDS = {"isotropic": ISOTROPIC, "unequal": UNEQUAL, "anisotropic": ANISOTROPIC}
# The kinds of grids differ in code that knows no model: three models try them all, each other model one or two
ON_ALL_GRIDS = ("oren_nayar", "ward", "he_torrance")


def kinds_of_grids(number: int, model: str) -> list[str]:
    if model in ON_ALL_GRIDS:
        return list(GRIDS)
    turned = MODELS[model].lobe_axes is not None or MODELS[model].anisotropic is not None
    return [("isotropic", "unequal")[number % 2], *(["anisotropic"] if turned else [])]


@pytest.mark.usefixtures("coarse_model_energy")
@pytest.mark.parametrize(
    ("model", "grid"),
    [
        pytest.param(model, GRIDS[kind], id=f"{model}-{kind}")
        for number, model in enumerate(MODELS)
        for kind in kinds_of_grids(number, model)
    ],
)
def test_every_model_is_reciprocal_positive_and_finite_and_so_are_its_tables(model: str, grid: Grid) -> None:
    made_up = material(model, PARAMETERS[model])
    if made_up.anisotropic and not grid.anisotropic:
        alpha_x = PARAMETERS[model].get("alpha_x")
        made_up = material(model, PARAMETERS[model] | ({"alpha_y": alpha_x} if alpha_x else {"theta_a_deg": 0}))
    table = tabulated(made_up, grid, WAVELENGTHS if made_up.spectral else None)
    found = audit(table)
    assert set(verdicts(found)) <= {"energy"}  # a grid as coarse as these does not conserve it
    assert found.of(Reciprocity).model_random.pairs > 4000
    assert (found.of(Reciprocity).model_lobe is None) == (made_up.spec.lobe is None)
    shared = np.intersect1d(grid.axes["theta_i"], grid.axes["theta_r"]).size
    azimuths = grid.shape[1] * grid.shape[3] if grid.anisotropic else grid.shape[2]
    assert found.of(Reciprocity).table_nodes.pairs == shared**2 * azimuths
    written([found])


# What must not pass


TABLES = pytest.mark.parametrize(
    "table",
    [
        lambert(0.5),
        lambert(0.5, ANISOTROPIC),
        tabulated(material("he_torrance", PARAMETERS["he_torrance"]), ISOTROPIC, WAVELENGTHS),
    ],
    ids=["isotropic", "anisotropic", "spectral"],
)


@TABLES
def test_one_negative_value_violates(table: Table) -> None:
    found = audit(node(table, -1e-30))
    values = found.of(ValueCounts)
    assert (found.verdict, values.positivity, values.finiteness) == ("violates", "violates", "passes")
    assert values.negative == (1 if table.wavelength_nm is None else 3)
    assert values.smallest == np.float32(-1e-30)
    assert written([found])["violations"] == ["made-up"]


@TABLES
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_one_value_that_is_not_finite_violates_and_its_albedo_is_null_in_the_report(table: Table, value: float) -> None:
    found = audit(node(table, value))
    count = 1 if table.wavelength_nm is None else 3
    assert (found.verdict, found.of(ValueCounts).finiteness) == ("violates", "violates")
    assert (found.of(ValueCounts).not_finite, found.of(ValueCounts).negative) == (count, 0)
    (entry,) = written([found])["materials"]
    if value == -np.inf:  # the albedo is the largest over azimuths of the light
        return
    energy = found.of(Energy).table
    assert (energy.verdict, energy.max_albedo) == ("violates", None)
    at = f"{table.axes_deg['theta_i'][1]:g} degrees"
    at += "" if table.wavelength_nm is None else f" and {table.wavelength_nm[0]:g} nm"
    assert energy.reason == f"reflects no finite share of the incident light at {at}"
    albedo = entry["findings"]["energy"]["table"]["albedo"]
    assert albedo[1] == energy.albedo[1] == [None] * count
    assert None not in albedo[0]


def test_a_table_of_nan_alone_has_no_smallest_value() -> None:
    table = lambert(0.5)
    found = audit(replace(table, values=np.full_like(table.brdf, np.nan)))
    values, reciprocity = found.of(ValueCounts), found.of(Reciprocity)
    assert (values.smallest, values.not_finite) == (None, values.count)
    assert reciprocity.table_nodes.min == reciprocity.table_random.min == 1.0
    assert found.of(TableError).fresh_p99 is None
    assert set(verdicts(found)) == {"energy", "reciprocity", "finiteness", "smoothness"}
    written([found])


@TABLES
@pytest.mark.parametrize("factor", [1.0 + 1e-5, 0.0, np.nan, -1.0])
def test_one_value_that_the_exchange_of_light_and_viewer_changes_violates(table: Table, factor: float) -> None:
    index = (1, 1, 2, 2) if table.anisotropic else (1, 2, 1)
    found = audit(node(table, table.brdf[index] * np.float32(factor)))
    assert (found.verdict, found.of(Reciprocity).verdict) == ("violates", "violates")
    expected = abs(factor - 1.0) / (abs(factor) + 1.0) if np.isfinite(factor) else 1.0
    nodes, model = found.of(Reciprocity).table_nodes, found.of(Reciprocity).model_random
    assert nodes.max == pytest.approx(expected, rel=0.02)
    assert 0.0 == nodes.min < nodes.mean < nodes.max
    assert model.max <= model.tolerance


def test_one_value_among_a_million_is_not_overlooked() -> None:
    theta = np.append(np.arange(0.0, 90.0), 89.5)
    table = lambert(0.5, Grid({"theta_i": theta, "theta_r": theta, "delta_phi": np.arange(0.0, 181.0, 2.0)}))
    assert audit(table).verdict == "passes"
    assert verdicts(audit(node(table, 0.1))) == {"reciprocity": "violates"}


def test_rounding_is_no_violation() -> None:
    table = lambert(0.5)
    up = np.random.default_rng(0).random(table.brdf.shape) < 0.5
    found = audit(replace(table, values=np.where(up, np.nextafter(table.brdf, np.float32(1)), table.brdf)))
    assert 0.0 < found.of(Reciprocity).table_nodes.max < 1e-7
    assert found.verdict == "passes"


@pytest.mark.parametrize("grid", [ISOTROPIC, ANISOTROPIC], ids=["isotropic", "anisotropic"])
def test_more_light_out_than_in_violates(grid: Grid) -> None:
    table = lambert(1.0, grid)
    found = audit(replace(table, values=table.brdf * np.float32(1.01)))
    energy = found.of(Energy).table
    assert verdicts(found) == {"energy": "violates"}
    assert energy.max_albedo == pytest.approx(1.01, rel=1e-6)
    assert energy.exceeds_1_from_theta_i_deg == 0.0
    assert energy.reason == "reflects 1.01 of the incident light at 0 degrees"
    written([found])


@pytest.mark.parametrize(("albedo", "verdict"), [(1.0 + 5e-7, "passes"), (1.0 + 2e-6, "violates")])
def test_an_albedo_of_1_may_be_off_by_what_float32_rounds(albedo: float, verdict: str) -> None:
    table = lambert(0.5)
    mirror = np.full(len(THETA), albedo - 0.5, dtype=np.float32)
    assert audit(replace(table, specular=mirror)).of(Energy).table.verdict == verdict


def test_one_azimuth_of_the_light_is_enough_to_violate() -> None:
    table = lambert(0.9, ANISOTROPIC)
    table.values[1, 2] *= np.float32(1.2)
    found = table_energy_of(table, None)
    assert (found.verdict, found.max_at_theta_i_deg) == ("violates", ANISOTROPIC.axes["theta_i"][1])
    assert found.max_albedo == pytest.approx(1.08, rel=1e-6)


def test_the_dirac_part_counts_as_light_that_leaves() -> None:
    table = lambert(0.7)
    mirror = np.full(len(THETA), 0.2, dtype=np.float32)
    assert audit(replace(table, specular=mirror)).verdict == "passes"
    mirror[3] = 0.4
    found = audit(replace(table, specular=mirror))
    energy = found.of(Energy).table
    assert verdicts(found) == {"energy": "violates"}
    assert energy.max_albedo == pytest.approx(1.1, rel=1e-6)
    assert energy.max_at_theta_i_deg == THETA[3] == 60.0
    # 0.9 at 30 degrees, 1.1 at 60, and linear between them
    assert energy.exceeds_1_from_theta_i_deg == pytest.approx(45.0, abs=0.002)
    assert energy.specular[3] == [pytest.approx(0.4, rel=1e-6)]


def test_the_wavelength_of_the_largest_albedo_is_named() -> None:
    table = lambert(0.5)
    brdf = table.brdf[..., np.newaxis] * np.array([1.0, 1.5, 1.0], dtype=np.float32)
    found = table_energy_of(replace(table, wavelength_nm=WAVELENGTHS, values=brdf), None)
    assert (found.max_at_wavelength_nm, found.wavelength_nm) == (500.0, WAVELENGTHS.tolist())
    assert found.albedo[0] == pytest.approx([0.5, 0.75, 0.5], rel=1e-6)


@pytest.mark.parametrize(("value", "verdict"), [(-0.1, "positivity"), (np.nan, "finiteness")])
def test_the_values_of_the_dirac_part_are_audited(value: float, verdict: str) -> None:
    mirror = np.full(len(THETA), 0.2, dtype=np.float32)
    mirror[2] = value
    found = audit(replace(lambert(0.5), specular=mirror))
    assert verdicts(found)[verdict] == "violates"
    assert found.of(ValueCounts).count == np.prod(ISOTROPIC.shape) + len(THETA)


def test_a_model_that_is_not_reciprocal_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    table = lambert(0.5)

    def lopsided(wi: Any, wr: Any, *, rho: float) -> Any:
        return rho / np.pi * (1.0 + 1e-10 * wi[..., 2]) + 0.0 * wr[..., 2]

    monkeypatch.setitem(MODELS, "lambert", replace(MODELS["lambert"], vectors=lopsided))
    found = audit(table)
    assert verdicts(found) == {"reciprocity": "violates"}
    assert found.of(Reciprocity).model_random.max == pytest.approx(5e-11, rel=0.1)
    assert found.of(Reciprocity).table_nodes.max == 0.0
