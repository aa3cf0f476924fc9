"""Tables of measured data: as little reciprocal as the data, with a record and their uncertainty."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import brdfdb
from brdfdb.errors import ParameterError
from brdfdb.geometry import radians, unit_vector
from brdfdb.materials import FunctionSource, presets
from brdfdb.measurements import MeasuredSource, Samples
from brdfdb.parameters import Floats
from brdfdb.store.publication import publish
from brdfdb.tables.error_measurement import measure
from brdfdb.tables.grids import Grid
from brdfdb.tables.layout import Interpolation, Layout
from brdfdb.tables.measured_layout import tabulated
from brdfdb.tables.table import Table
from brdfdb.tables.tabulation import block, metadata_of
from tests.measurements.made_up import scans, scattered
from tests.tables.made_up import table_of

RNG = np.random.default_rng(8)
WI, WR = (unit_vector(RNG.uniform(0.0, 1.2, 500), RNG.uniform(0.0, 6.0, 500)) for _ in range(2))


def grey(f_r: Any, **keywords: Any) -> MeasuredSource:
    """Measured data that are a function, of one channel."""
    return MeasuredSource.of_function(f_r, ("grey",), None, name="x", title="x", provenance="x", **keywords)


def _lopsided(wi: Floats, wr: Floats) -> Floats:
    """Return f_r with a lobe that depends on light and viewer in different ways."""
    half = (wi + wr) / np.linalg.norm(wi + wr, axis=1, keepdims=True)
    return np.asarray(((0.1 + 2.0 * np.exp((half[:, 2] ** 2 - 1.0) * 30.0)) * (1.0 + wi[:, 2]))[:, np.newaxis])


def _brushed(wi: Floats, wr: Floats) -> Floats:
    half = (wi + wr) / np.linalg.norm(wi + wr, axis=1, keepdims=True)
    return np.asarray(_lopsided(wi, wr) * (1.0 + 0.5 * half[:, :1] ** 2))


@pytest.mark.parametrize("anisotropic", [False, True])
def test_half_difference_grid_holds_both_ways_of_a_pair(anisotropic: bool) -> None:
    f_r = _brushed if anisotropic else _lopsided
    source = FunctionSource(
        brdf=lambda wi, wr, _: f_r(wi, wr), name="lopsided", title="Lopsided", provenance="this test",
        anisotropic=anisotropic, elliptical=anisotropic, reciprocal=False, alpha=0.2,
    )  # fmt: skip
    axes = {"theta_h": np.linspace(0.0, 90.0, 31)}
    axes |= {"phi_h": np.linspace(0.0, 90.0, 7)} if anisotropic else {}
    axes |= {"theta_d": np.linspace(0.0, 90.0, 19), "phi_d": np.linspace(0.0, 360.0 if anisotropic else 180.0, 19)}
    layout = Layout(source, Grid(axes), interpolation=Interpolation("cubic", True, 1e-4))
    table = table_of(layout)
    for wi, wr in ((WI, WR), (WR, WI)):
        off = np.abs(table.lookup_vectors(wi, wr) / f_r(wi, wr)[:, 0] - 1.0)
        assert np.percentile(off, 95) < 0.02  # measured 0.005; the exchanged pair differs by 0.2
    assert not any("theta_r, theta_i" in symmetry for symmetry in metadata_of(layout).symmetries)


def _chiral(wi: Floats, wr: Floats) -> Floats:
    """Return f_r with a lobe of width 0.004 that no turn of the surface changes, and its mirror image does."""
    half = (wi + wr) / np.linalg.norm(wi + wr, axis=1, keepdims=True)
    tan2 = np.maximum(1.0 / half[:, 2] ** 2 - 1.0, 0.0)
    side = np.cross(wi, wr)[:, 2]
    return np.asarray((0.02 + 800.0 * np.exp(-tan2 / 0.004**2) + 0.05 * (1.0 + side))[:, np.newaxis])


def test_black_data_are_refused() -> None:
    def black(wi: Floats, _: Floats) -> Floats:
        return 0.0 * wi[:, 2:]

    source = grey(black)
    with pytest.raises(ParameterError, match="values: no value is above 0"):
        tabulated(source, None, 0.05)


def test_a_narrow_lobe_that_is_not_its_own_mirror_image_is_sampled_as_densely_as_one_that_is() -> None:
    source = grey(_chiral)
    assert source.measured.chiral
    assert source.lobe(np.ones(1), None).alpha_x[0] == pytest.approx(0.004, rel=0.1)  # type: ignore[union-attr]
    layout, values = tabulated(source, None, 0.05)
    assert layout.grid.axes["phi_h"].tolist() == [0.0, 360.0]
    table = Table.of(layout, values)
    theta = np.append(0.0, np.geomspace(1e-4, 0.5 * np.pi, 4000))  # of viewers of light along the normal
    viewers = unit_vector(theta, 1.0)
    light = np.broadcast_to(unit_vector(0.0, 0.0), viewers.shape)
    weight = 2.0 * np.pi * np.sin(theta) * np.cos(theta)
    albedo, of_table = (
        np.trapezoid(weight * f_r, theta)
        for f_r in (_chiral(light, viewers)[:, 0], table.lookup_vectors(light, viewers))
    )
    assert of_table == pytest.approx(albedo, rel=0.01)  # measured 0.002; 7 times as much on nodes 7 degrees apart


def test_a_slope_at_the_horizon_makes_no_value_far_above_those_of_the_data() -> None:
    def f_r(wi: Floats, wr: Floats) -> Floats:
        half = (wi + wr) / np.linalg.norm(wi + wr, axis=1, keepdims=True)
        lowest = np.minimum(wi[:, 2], wr[:, 2])
        steep = 1e-3 * np.exp(9.0 * np.exp(-lowest / 0.01))
        return np.asarray((steep + 5.0 * np.exp((half[:, 2] ** 2 - 1.0) * 100.0))[:, np.newaxis])

    source = grey(f_r)
    table = Table.of(*tabulated(source, None, 0.05))
    theta, turn = np.meshgrid(radians(np.linspace(60.0, 89.9, 150)), np.linspace(0.0, np.pi, 91), indexing="ij")
    for light in (85.0, 87.5):
        viewers = unit_vector(theta.ravel(), turn.ravel())
        wi = np.broadcast_to(unit_vector(radians(light), 0.0), viewers.shape)
        # measured 1.9; 28 and 10 where the slope goes on without an end
        assert table.lookup_vectors(wi, viewers).max() < 3.0 * f_r(wi, viewers).max()


def test_half_of_phi_d_is_refused_for_a_source_that_is_not_reciprocal() -> None:
    source = grey(_lopsided)
    grid = Grid({"theta_h": [0.0, 90.0], "theta_d": [0.0, 90.0], "phi_d": [0.0, 90.0]})
    with pytest.raises(ParameterError, match="not reciprocal; phi_d must end at 180"):
        Layout(source, grid)


def test_same_nodes_of_light_and_viewer_do_not_make_data_reciprocal() -> None:
    source = grey(lambda wi, _: wi[:, 2:])
    theta = np.linspace(0.0, 90.0, 10)
    layout = Layout(source, Grid({"theta_i": theta, "theta_r": theta, "delta_phi": [0.0, 90.0, 180.0]}))
    values = block(layout, slice(0, 10))
    assert values[3, 7] == pytest.approx(np.cos(np.deg2rad(30.0)))
    assert values[7, 3] == pytest.approx(np.cos(np.deg2rad(70.0)))


def test_finest_grid_is_taken_and_says_so_where_steps_keep_no_tolerance() -> None:
    def steps(wi: Floats, wr: Floats) -> Floats:
        return np.asarray(1.0 + (np.floor(17.0 * (wi[:, 2:] + wr[:, 2:])) % 2.0))

    source = grey(steps)
    assert "does not keep to a tolerance of 0.001" in tabulated(source, None, 0.001)[0].reason


def test_published_table_has_the_record_and_its_errors_the_uncertainty(tmp_path: Path) -> None:
    source = MeasuredSource.of_samples(scattered(presets()["clay-vase"].brdf_at(None), 300, 0.05), name="clay")
    publish(tmp_path, source, tolerance=0.05)
    table = brdfdb.open(tmp_path)["clay"]
    measured = table.metadata.measured
    assert measured is not None
    assert measured.held_out is not None
    assert measured.by == "a made-up goniophotometer"
    assert 0.05 < (measured.extrapolated or 0.0) < 0.9
    assert not table.metadata.missing
    both = table.lookup_vectors_with_error(WI, WR)
    outside = source.extrapolated(WI, WR)
    assert 0 < np.count_nonzero(outside) < len(outside)
    np.testing.assert_array_equal(np.isnan(both.error), outside)  # nothing is known there
    regions = measured.held_out.regions
    assert regions is not None
    assert np.all(both.error[~outside] >= (regions.p99(WI, WR) * both.brdf)[~outside])
    fresh = scattered(presets()["clay-vase"].brdf_at(None), 400, 0.05, seed=11)  # noise is included in the errors
    looked_up = table.lookup_vectors_with_error(fresh.w_i, fresh.w_r)
    inside = ~source.extrapolated(fresh.w_i, fresh.w_r)
    assert np.mean((np.abs(looked_up.brdf - fresh.values[:, 0]) <= looked_up.error)[inside]) > 0.97


def test_colours_take_three_parts(tmp_path: Path) -> None:
    def red(wi: Floats, wr: Floats) -> Floats:
        return np.asarray([0.3, 0.1, 0.05] + [0.1, 0.2, 0.3] * wi[:, 2:] * wr[:, 2:] + [0.0, 0.0, 0.1] * wr[:, 2:] ** 2)

    source = MeasuredSource.of_function(red, ("R", "G", "B"), None, name="red", title="Red", provenance="x")
    publish(tmp_path, source, tolerance=0.02)
    table = brdfdb.open(tmp_path)["red"]
    assert table.values.shape[-1] == 3
    spectrum = table.lookup_vectors(WI[:5], WR[:5])
    assert brdfdb.spectra.linear_srgb(table.wavelength_nm, spectrum) == pytest.approx(red(WI[:5], WR[:5]), rel=0.02)


def test_directions_that_were_not_measured_count_neither_for_the_grid_nor_for_the_error() -> None:
    def torn(wi: Floats, wr: Floats) -> Floats:
        steps = np.floor(40.0 * (wi[:, 2:] + wr[:, 2:])) % 2.0
        return np.where(wi[:, 2:] < np.cos(radians(65.0)), 0.1 + steps, 0.2)

    stated = {}
    for nodes in (None, scans(lambda wi, _: wi[:, 2:], np.arange(10.0, 61.0, 10.0), 0.0)):
        source = grey(torn, nodes=nodes)
        layout, values = tabulated(source, None, 0.05)
        stated[nodes is None] = measure(layout, lambda rows, values=values: values[rows])
        assert ("does not keep" in layout.reason) == (nodes is None)
    assert stated[True].overall.p95 > 0.5
    assert stated[False].overall.p95 < 0.05
    assert stated[False].directions < stated[True].directions
    assert stated[False].p95[-1] == [stated[False].overall.p95]  # nothing was measured in the last band


def test_table_of_samples_in_one_plane_is_measured_there(tmp_path: Path) -> None:
    light, viewer = (radians(a.ravel()) for a in np.meshgrid([10.0, 30.0, 50.0], np.arange(-70.0, 71.0, 5.0)))
    turn = np.where(viewer < 0.0, np.pi, 0.0)
    samples = Samples(
        "plane", light, 0.0 * light, np.abs(viewer), turn, ("400nm", "700nm"), np.array([400.0, 700.0]),
        np.stack([0.1 + 0.1 * np.cos(light), 0.2 + 0.1 * np.cos(viewer)], axis=1),
    )  # fmt: skip
    source = MeasuredSource.of_samples(samples, name="plane")
    publish(tmp_path, source, tolerance=0.05)
    table = brdfdb.open(tmp_path)["plane"]
    at = radians(np.array([[20.0, 0.0, 33.0, 0.0], [20.0, 0.0, 33.0, 180.0], [20.0, 0.0, 33.0, 90.0]])).T
    assert table.extrapolated(*at).tolist() == [False, False, True]
    stated = table.lookup_with_error(*at)
    assert np.isnan(stated.error).all(axis=1).tolist() == [False, False, True]
    assert stated.brdf[0] == pytest.approx([0.1 + 0.1 * np.cos(at[0, 0]), 0.2 + 0.1 * np.cos(at[2, 0])], rel=0.03)


def _scans_of(f_r: Any, *, turned: bool) -> Samples:
    """Return samples of scans that are 10 degrees apart in every angle."""
    azimuths = (0.0, 90.0) if turned else (0.0,)
    viewers = [(0.0, 0.0), *((a, b) for a in np.arange(10.0, 81.0, 10.0) for b in np.arange(0.0, 360.0, 20.0))]
    rows = [(a, b, *viewer) for a in (10.0, 30.0, 50.0, 70.0) for b in azimuths for viewer in viewers]
    angles = radians(np.array(rows)).T
    values = f_r(unit_vector(angles[0], angles[1]), unit_vector(angles[2], angles[3]))
    return Samples("scans", *angles, ("grey",), None, values)


@pytest.mark.parametrize("turned", [False, True])
def test_a_table_of_scans_has_nodes_at_their_angles_and_keeps_each_sample(turned: bool) -> None:
    def f_r(wi: Floats, wr: Floats) -> Floats:
        stripes = np.cos(9.0 * wi[:, 2]) * np.cos(9.0 * wr[:, 2])
        return np.asarray((0.2 + 0.1 * stripes + (0.05 * (wi + wr)[:, 0] ** 2 if turned else 0.0))[:, np.newaxis])

    samples = _scans_of(f_r, turned=turned)
    layout, values = tabulated(MeasuredSource.of_samples(samples), None, 0.2)
    names = ("theta_i", "phi_i", "theta_r", "phi_r") if turned else ("theta_i", "theta_r", "delta_phi")
    assert layout.grid.names == names
    assert {10.0, 30.0, 50.0, 70.0} <= set(layout.grid.axes["theta_i"])
    looked_up = Table.of(layout, values).lookup_vectors(samples.w_i, samples.w_r)
    assert np.max(np.abs(looked_up / samples.values[:, 0] - 1.0)) < 0.05


def test_a_narrow_anisotropic_lobe_has_its_widths_along_both_axes() -> None:
    def f_r(wi: Floats, wr: Floats) -> Floats:
        half = (wi + wr) / (wi + wr)[:, 2:]
        return np.asarray((0.1 + 20.0 * np.exp(-((half[:, 0] / 0.05) ** 2) - (half[:, 1] / 0.2) ** 2))[:, np.newaxis])

    alpha = grey(f_r).alpha
    assert alpha == pytest.approx((0.05, 0.2), rel=0.1)


def test_exchanged_pairs_that_contradict_each_other_deny_reciprocity() -> None:
    samples = _scans_of(lambda wi, _: 0.1 + 0.2 * wi[:, 2:], turned=False)
    assert not MeasuredSource.of_samples(samples).reciprocal
    assert MeasuredSource.of_samples(
        _scans_of(lambda wi, wr: 0.1 + 0.2 * wi[:, 2:] * wr[:, 2:], turned=False)
    ).reciprocal
