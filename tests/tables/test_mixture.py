"""Mixtures: tables of coloured materials that hold a few wavelengths and make the others of them."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import brdfdb
from brdfdb.audit.nodes import nodes_of
from brdfdb.audit.pairs import pairs_of
from brdfdb.audit.statement import NAMES as STATISTICS
from brdfdb.audit.statement import contradictions, disagreements
from brdfdb.materials import Material, presets
from brdfdb.materials.spectrum import Spectrum
from brdfdb.store.publication import publish
from brdfdb.tables import error_measurement
from brdfdb.tables.mixture import mixture_of
from brdfdb.tables.planner import plan
from brdfdb.tables.table import Table

NM = np.linspace(400.0, 700.0, 41)
RED = Spectrum(wavelengths_nm=(380.0, 550.0, 600.0, 780.0), values=(0.05, 0.1, 0.5, 0.55), origin="a test")
BLUE = Spectrum(wavelengths_nm=(380.0, 500.0, 780.0), values=(0.4, 0.2, 0.1), origin="a test")
BRASS, CLAY = presets()["rolled-brass"], presets()["clay-vase"]


def changed(material: Material, **parameters: Spectrum | float) -> Material:
    return material.model_copy(update={"parameters": material.parameters | parameters})


def built(root: Path, material: Material, wavelengths_nm: Any, tolerance: float) -> Table:
    """A table as a store holds it."""
    publish(root / "store", material, wavelengths_nm=wavelengths_nm, tolerance=tolerance)
    return brdfdb.open(root / "store")[material.name]


PAINTED = changed(BRASS, rho_d=BLUE, rho_s=RED)
OCHRE = Material(
    name="ochre", title="Ochre", model="oren_nayar", parameters={"rho": RED, "sigma": 0.5}, source="a test"
)


@pytest.mark.parametrize(
    ("material", "parts"),
    [(PAINTED, 1), (changed(BRASS, rho_d=BLUE), 1), (OCHRE, 2), (presets()["scene-copper-sphere"], None)],
    ids=["lobe-and-diffuse", "diffuse-only", "direct-and-bounce", "refractive-index"],
)
def test_a_mixture_takes_as_many_parts_as_the_model_has(material: Material, parts: int | None) -> None:
    mixture = mixture_of(material, NM)
    if parts is None:
        assert mixture is None
        return
    assert mixture is not None
    assert mixture.spectra.shape == (parts, NM.size)
    at = np.searchsorted(NM, mixture.part_nm)
    np.testing.assert_array_equal(mixture.spectra[:, at], np.eye(parts))


def test_lookups_of_a_coloured_table_keep_the_stated_error(tmp_path: Path) -> None:
    table = built(tmp_path, PAINTED, NM, 0.02)
    assert table.part_nm is not None
    assert table.error is not None
    assert table.error.overall.p99 < 0.02
    drawn = error_measurement.draw(PAINTED, NM, 300, 7)
    above = drawn.above
    wi, wr = drawn.wi[above], drawn.wr[above]
    between = np.array([411.0, 549.0, 604.0])
    for wavelengths, kept in ((NM[::8], 0.985), (between, 0.97)):
        values, error = table.lookup_vectors_with_error(wi, wr, wavelengths)
        truth = PAINTED.lookup_vectors(wi, wr, wavelengths)
        assert np.all(np.mean(np.abs(values - truth) <= error, axis=0) > kept)
    assert nodes_of(table, PAINTED).verdict == "passes"
    grey = plan(BRASS, None, 0.02)
    assert table.nbytes < 2 * 4 * grey.size  # the grey table holds float32 alone


def test_the_one_column_that_a_mixture_states_is_judged_on_both_sides(tmp_path: Path) -> None:
    table = built(tmp_path, PAINTED, NM[::4], 0.05)
    error = table.error
    assert error is not None
    assert (error.columns, len(error.floor), error.limits.shape[1]) == (1, 11, 21)
    assert contradictions(error, 11) == []
    pairs = pairs_of(table, PAINTED)
    assert disagreements(error, pairs, table.wavelength_nm) == []
    for factor, contradicted in ((0.25, {"l1", "p95", "p99", "max"}), (10.0, {"median", "p95"})):
        wrong = {name: [[factor * row[0]] for row in getattr(error, name)] for name in STATISTICS}
        said = {one.statistic for one in disagreements(error.model_copy(update=wrong), pairs, table.wavelength_nm)}
        assert said >= contradicted


EDGE = Spectrum(wavelengths_nm=(380.0, 560.0, 580.0, 780.0), values=(0.02, 0.02, 0.8, 0.8), origin="a test")
COARSE = np.linspace(400.0, 700.0, 16)


def test_beside_a_steep_edge_nothing_is_negative_and_other_intervals_are_not_charged(tmp_path: Path) -> None:
    steep = changed(BRASS, rho_d=EDGE, rho_s=0.05)
    table = built(tmp_path, steep, COARSE, 0.03)
    nm = np.linspace(400.0, 700.0, 301)
    drawn = error_measurement.draw(steep, COARSE, 30, 7)
    wi, wr = drawn.wi[drawn.above], drawn.wr[drawn.above]
    values, error = table.lookup_vectors_with_error(wi, wr, nm)
    assert np.all(values >= 0.0)
    truth = steep.lookup_vectors(wi, wr, nm)
    assert np.all(np.mean(np.abs(values - truth) <= error, axis=0) > 0.96)
    # far from the edge the spectrum is a straight line, and the error is that of the wavelengths beside
    far = np.searchsorted(nm, [450.0, 650.0])
    near = np.searchsorted(nm, [440.0, 640.0])
    assert np.median(error[:, far] / error[:, near]) < 4.0


@pytest.mark.parametrize("values", [(0.0, 0.5, 0.5), (0.5, 0.5, 0.0)])
@pytest.mark.parametrize(("model", "others"), [("lambert", {}), ("oren_nayar", {"sigma": 0.5})])
def test_a_surface_that_is_black_at_a_wavelength_has_a_table(
    model: str, others: dict[str, Any], values: tuple[float, ...], tmp_path: Path
) -> None:
    black = Spectrum(wavelengths_nm=(400.0, 500.0, 700.0), values=values, origin="a test")
    parameters = {"rho": black, **others}
    material = Material(name="black", title="Black", model=model, parameters=parameters, source="a test")
    table = built(tmp_path, material, [400.0, 500.0, 600.0, 700.0], 0.05)
    dark = 400.0 if values[0] == 0.0 else 700.0
    assert table.lookup(0.3, 0.0, 0.5, 1.0, wavelength_nm=dark) == 0.0
    expected = material.lookup(0.3, 0.0, 0.5, 1.0, wavelength_nm=500.0)
    np.testing.assert_allclose(table.lookup(0.3, 0.0, 0.5, 1.0, wavelength_nm=500.0), expected, rtol=0.1)


def test_nodes_hold_the_f_r_of_lookups(tmp_path: Path) -> None:
    table = built(tmp_path, OCHRE, NM[::4], 0.1)
    dataset = brdfdb.open(tmp_path / "store").dataset("ochre")
    theta = np.deg2rad(table.axes_deg["theta_i"][1:4])
    light, viewer = theta[:, np.newaxis], theta[np.newaxis, :]
    expected = table.lookup(light, 0.0, viewer, 0.0)
    np.testing.assert_allclose(table.brdf[1:4, 1:4, 0], expected, rtol=1e-6)
    lazy = dataset["brdf"].isel(theta_i=slice(1, 4), theta_r=slice(1, 4), delta_phi=0, wavelength=[2, 5]).values
    np.testing.assert_allclose(lazy, expected[..., [2, 5]], rtol=1e-6)


def test_a_uniform_spectrum_lies_beside_a_factored_table() -> None:
    copper = presets()["scene-copper-sphere"]
    painted = changed(copper, a=RED)
    layout = plan(painted, NM[::8], 0.1)
    assert layout.uniform is not None
    np.testing.assert_allclose(layout.uniform * np.pi, RED.at("a", NM[::8]))


def test_a_damaged_uniform_spectrum_is_found(tmp_path: Path) -> None:
    table = built(tmp_path, PAINTED, NM[::8], 0.1)
    assert table.uniform is not None
    wrong = table.uniform.copy()
    wrong[3] *= 1.01
    found = nodes_of(replace(table, uniform=wrong), PAINTED)
    assert found.verdict == "violates"
    assert "uniform part" in " ".join(found.beside)
