"""The table at the samples' own directions, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from brdfdb.geometry import radians, unit_vector
from brdfdb.measurements import MeasuredSource, Samples
from brdfdb.measurements.acceptance import at_samples, viewer_weights
from brdfdb.tables.measured_layout import tabulated
from tests.measurements.made_up import scans


def test_weights_of_a_plane_and_of_a_hemisphere_integrate_the_cosine() -> None:
    theta = radians(np.linspace(-90.0, 90.0, 181))
    plane = np.column_stack([np.sin(theta), np.zeros(181), np.cos(theta)])
    # the integral of cos(theta) d(theta) is 2; the trapezoid rule of steps h gives h cot(h / 2)
    weight = viewer_weights(plane)
    assert weight is not None
    assert weight.sum() == pytest.approx(radians(1.0) / np.tan(radians(0.5)), rel=1e-9)
    polar, azimuth = np.meshgrid(radians(np.arange(0.0, 91.0, 5.0)), radians(np.arange(0.0, 360.0, 5.0)))
    half = viewer_weights(unit_vector(polar.ravel(), azimuth.ravel()))
    assert half is not None
    assert half.sum() == pytest.approx(36.0 * np.sin(radians(5.0)), rel=1e-9)  # area of the polygon of 72 corners
    repeated = viewer_weights(np.concatenate([plane, plane]))
    assert repeated is not None
    assert repeated[:181] == pytest.approx(0.5 * weight)
    assert viewer_weights(plane[:4]) is None


def test_the_worst_sample_and_the_energy_of_its_incidence_are_found() -> None:
    samples = scans(lambda wi, _: np.full((len(wi), 1), 0.3), np.array([20.0, 50.0]), 0.0)
    looked_up = samples.values * 1.01
    row = int(np.flatnonzero((samples.incidence == 1) & (samples.theta_r > 0.5))[7])
    looked_up[row] = 0.6
    seen = at_samples(samples, samples.values, looked_up, np.array([1e-3]), samples.channels)
    assert seen is not None
    assert (seen.worst.theta_i_deg, seen.worst.sample, seen.worst.table) == (50.0, 0.3, 0.6)
    assert seen.worst.theta_r_deg == pytest.approx(np.degrees(samples.theta_r[row]))
    assert seen.worst.error == pytest.approx(1.0)
    assert seen.p95 == pytest.approx(0.01)
    assert seen.energies[0].error == pytest.approx(0.01, rel=1e-2)
    assert seen.worst_energy is seen.energies[1]
    weight = viewer_weights(samples.w_r[samples.incidence == 1])
    assert weight is not None
    share = weight[np.flatnonzero(samples.incidence == 1) == row] / weight.sum()
    assert seen.energies[1].error == pytest.approx(0.01 + 0.99 * share[0], rel=1e-2)


def test_holes_and_exchanged_wavelengths_are_compared_channel_by_channel() -> None:
    grey = scans(lambda wi, _: 0.2 + 0.1 * wi[:, 2:], np.arange(10.0, 71.0, 20.0), 0.0)
    values = grey.values * [1.0, 2.0]
    values[5, 0] = np.nan
    both = Samples(
        "two", grey.theta_i, grey.phi_i, grey.theta_r, grey.phi_r, ("700nm", "500nm"), np.array([700.0, 500.0]), values
    )
    made = tabulated(MeasuredSource.of_samples(both), np.array([500.0, 700.0]), 0.02).layout.source
    assert isinstance(made, MeasuredSource)
    assert made.samples is both
    seen = made.measured.at_samples
    assert seen is not None
    assert seen.worst.error < 0.1  # channels that are exchanged differ by half
    assert len(seen.energies) == 4
