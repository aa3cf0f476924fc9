"""Tables with glints: lookups, errors, albedo and sampler have them, and say so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import brdfdb
from brdfdb.errors import ParameterError
from brdfdb.geometry import unit_vector
from brdfdb.measurements import Noise
from brdfdb.store.publication import publish
from brdfdb.tables.albedo import directional_albedo, reflected
from brdfdb.tables.table import Table, TableSource, table_from
from tests.tables.glinting import GROUND, NM, PEAK, POWER, source, stored

LIGHT, VIEWER = np.deg2rad(60.0), np.deg2rad(60.5)


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Table:
    """A grey table with glints, from a store."""
    return stored(tmp_path_factory.mktemp("glints"))


def test_a_lookup_at_the_sample_has_its_value_and_says_that_it_is_a_glint(table: Table) -> None:
    assert table.lookup(LIGHT, 0.0, VIEWER, np.pi) == pytest.approx(PEAK + GROUND, rel=1e-6)
    wi, wr = unit_vector(LIGHT, 0.4), unit_vector(VIEWER, np.pi + 0.4)
    assert table.lookup_vectors(wi, wr) == pytest.approx(PEAK + GROUND, rel=1e-6)
    assert table.lookup_vectors(wi.astype(np.float32), wr.astype(np.float32)) == pytest.approx(PEAK, rel=1e-3)
    out = np.empty(2)
    table.lookup(LIGHT, 0.0, np.array([VIEWER, 0.2]), np.pi, out=out)
    np.testing.assert_allclose(out, [PEAK + GROUND, GROUND], rtol=1e-3)
    assert table.in_glint(LIGHT, 0.0, np.array([VIEWER, 0.2]), np.pi).tolist() == [True, False]
    assert table.without_glints().lookup(LIGHT, 0.0, VIEWER, np.pi) == pytest.approx(GROUND, rel=1e-3)
    assert table.lookup(LIGHT, 0.0, np.pi - VIEWER, np.pi) == 0.0  # below the horizon
    assert table.brdf.max() < 1.0  # the numbers of the grid hold none


def test_the_stated_error_in_a_glint_is_its_own(table: Table) -> None:
    error = table.lookup_with_error(LIGHT, 0.0, np.array([VIEWER, 0.2]), np.pi).error
    assert error[0] == pytest.approx(0.02 * PEAK, rel=1e-3)  # of the glint; that of the ground is below 0.01
    assert error[1] < 0.01
    between = np.deg2rad(45.0)
    assert table.in_glint(between, 0.0, between, np.pi)
    assert table.extrapolated(between, 0.0, between, np.pi)
    assert np.isnan(table.lookup_with_error(between, 0.0, between, np.pi).error)
    assert not table.extrapolated(between, 0.0, 0.2, np.pi)


def test_the_error_of_a_peak_is_the_noise_of_its_sample_at_least(tmp_path: Path) -> None:
    publish(tmp_path, source().recorded(noise=Noise(median=0.05, p95=0.1)), tolerance=0.05)
    noisy = brdfdb.open(tmp_path)["glinting"]
    error = noisy.lookup_with_error(LIGHT, 0.0, np.array([VIEWER, 0.2]), np.pi).error
    assert error[1] == pytest.approx(2.6 * 0.1 * GROUND, rel=1e-2)  # 99 of 100 of normal noise are within 2.6
    assert error[0] == pytest.approx(2.6 * 0.05 * PEAK, rel=1e-3)


def test_between_samples_the_error_of_a_peak_of_one_sample_covers_all_up_to_it(table: Table) -> None:
    between = np.deg2rad([60.3, 60.7, 61.5])
    stated = table.lookup_with_error(LIGHT, 0.0, between, np.pi)
    assert np.all(stated.brdf - stated.error <= GROUND)
    assert np.all(stated.brdf + stated.error >= 0.99 * PEAK)
    assert table.in_glint(LIGHT, 0.0, between, np.pi).all()


def test_the_albedo_has_the_power_of_glints(table: Table) -> None:
    albedo = directional_albedo(table, np.array([0.0, 30.0]))
    np.testing.assert_allclose(albedo.albedo[:, 0, 0], np.pi * GROUND + POWER, atol=2e-3)
    shares = reflected(table)
    assert shares.glints is not None
    at_60 = np.argmin(np.abs(shares.theta_i_deg - 60.0))
    # PEAK cos(60.5) 2 pi s^2, s = 0.4 degrees
    assert shares.glints[at_60, 0] == pytest.approx(
        PEAK * np.cos(VIEWER) * 2.0 * np.pi * np.deg2rad(0.4) ** 2, rel=1e-3
    )
    assert shares.error == pytest.approx(shares.glints[at_60, 0], rel=1e-3)  # it may reflect less, by any amount
    assert shares.albedo[at_60, 0] == pytest.approx(np.pi * GROUND + shares.glints[at_60, 0], abs=2e-3)
    assert table.metadata.largest_albedo is not None
    assert table.metadata.largest_albedo.albedo == pytest.approx(np.pi * GROUND + shares.glints[at_60, 0], abs=3e-3)


def test_samples_of_the_table_have_the_albedo_as_their_mean_and_little_noise(table: Table) -> None:
    u = np.random.default_rng(2911).random((2, 4000))
    for light_deg, turn in ((30.0, 0.0), (60.0, 2.0)):
        wi = unit_vector(np.deg2rad(light_deg), turn)
        drawn = table.sample(*u, wi)
        np.testing.assert_allclose(table.pdf(wi, drawn.wr), drawn.pdf)
        exact = directional_albedo(table, np.array([light_deg])).albedo[0, 0, 0]
        error = drawn.weight.std() / np.sqrt(u.shape[1])
        assert abs(drawn.weight.mean() - exact) < 4.0 * error + 1e-3
        assert error < 0.02 * exact  # without directions from the glint it is larger than the albedo
        phi = np.arctan2(drawn.wr[:, 1], drawn.wr[:, 0])
        assert np.mean(np.abs((phi - turn) % (2 * np.pi) - np.pi) < 0.2) > 0.1


def test_wavelengths_of_glints_are_those_of_the_table(tmp_path: Path) -> None:
    table = stored(tmp_path, 3)
    peak = PEAK * np.array([1.0, 0.5, 0.25]) + GROUND
    np.testing.assert_allclose(table.lookup(LIGHT, 0.0, VIEWER, np.pi), peak, rtol=1e-5)
    assert table.lookup(LIGHT, 0.0, VIEWER, np.pi, 550.0) == pytest.approx(peak[1], rel=1e-5)
    assert table.lookup(LIGHT, 0.0, VIEWER, np.pi, [NM[2], NM[0]]).tolist() == pytest.approx(peak[[2, 0]], rel=1e-5)
    assert table.lookup(LIGHT, 0.0, VIEWER, np.pi, 500.0) < peak[0]
    error = table.lookup_with_error(LIGHT, 0.0, VIEWER, np.pi, [450.0]).error
    assert error[0] == pytest.approx(0.02 * PEAK, rel=1e-3)
    one = table.attrs["measured"]["glints"]["glints"][0]
    attrs = {"measured": {**table.attrs["measured"], "glints": {"glints": [{**one, "power": [0.1]}]}}}
    arrays = dict(table.axes_deg)
    arrays |= {"brdf": np.zeros((*table.grid.shape, 3), np.float32)}
    with pytest.raises(ParameterError, match="glints: they have 1 wavelengths, and the table others"):
        table_from("x", "r000001", {**arrays, "wavelength": NM}, attrs)


def test_a_table_without_glints_keeps_its_values_and_methods(tmp_path: Path) -> None:
    table = stored(tmp_path, lit=False)
    assert table.glints is None
    assert table.without_glints() is table
    assert not table.in_glint(LIGHT, 0.0, VIEWER, np.pi)
    assert reflected(table).glints is None
    assert table.lookup(LIGHT, 0.0, VIEWER, np.pi) == pytest.approx(GROUND, rel=1e-3)


def test_a_table_as_a_source_leaves_its_glints_out_and_names_them(table: Table) -> None:
    smooth = TableSource(table)
    assert smooth.lookup(LIGHT, 0.0, VIEWER, np.pi) == pytest.approx(GROUND, rel=1e-3)
    assert smooth.glints is not None
    assert smooth.glints.left_out("the picture") == (
        "not in the picture: the glints of the table, up to 75.4 % of the light of a direction"
    )
