"""Peaks of samples: glints where no smooth f_r can hold them, and nothing where noise alone is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from brdfdb.geometry import radians, unit_vector
from brdfdb.measurements import MeasuredSource, Samples
from brdfdb.measurements.glints import offsets_deg
from brdfdb.measurements.interpolation import fit
from brdfdb.measurements.peaks import direction_at
from brdfdb.parameters import Floats
from brdfdb.tables.measured_layout import tabulated
from tests.benchmarks.measured_tables import glint_case
from tests.measurements.made_up import scans, scattered

LIGHTS_DEG = (10.0, 30.0, 50.0, 70.0)


def in_plane(value: Floats | float, noise: float = 0.0) -> Samples:
    """Return samples in the plane of incidence at steps of a degree."""
    viewer = np.arange(-85.0, 85.5)
    theta_i = radians(np.repeat(LIGHTS_DEG, viewer.size))
    signed = np.tile(viewer, len(LIGHTS_DEG))
    values = np.broadcast_to(value, signed.shape) * (1.0 + noise * np.random.default_rng(2).normal(size=signed.size))
    phi_r = np.where(signed > 0.0, np.pi, 0.0)
    theta_r = radians(np.abs(signed))
    return Samples(
        "made up", theta_i, np.zeros_like(theta_i), theta_r, phi_r, ("grey",), None, values[:, np.newaxis]
    )  # fmt: skip


def test_a_glint_of_one_sample_is_kept_beside_the_table() -> None:
    samples = in_plane(0.1)
    values = samples.values.copy()
    row = int(
        np.flatnonzero((samples.theta_i > 1.2) & np.isclose(samples.theta_r, radians(70.0)) & (samples.phi_r > 1))[0]
    )
    values[row] = 53341.0
    source = MeasuredSource.of_samples(replace(samples, values=values))
    assert source.glints is not None
    lit = [glint for glint in source.glints.glints if glint.power[0] > 0.0]
    assert [(glint.theta_i_deg, glint.resolved) for glint in lit] == [(pytest.approx(70.0), False)]
    assert source.brdf_at(None)(samples.w_i, samples.w_r) == pytest.approx(0.1, rel=1e-3)
    made = tabulated(source, None, 0.1).layout.source
    assert isinstance(made, MeasuredSource)
    at = made.measured.at_samples
    assert at is not None
    assert at.worst.error < 0.01
    assert at.worst_energy is not None
    # the sum over steps of a degree is dominated by the glint: 53341 cos(70) pi / 180
    assert max(one.table for one in at.energies) == pytest.approx(
        53341.0 * np.cos(radians(70.0)) * radians(1.0), rel=0.01
    )


def test_the_place_and_the_width_of_a_glint_are_those_of_its_samples() -> None:
    samples = in_plane(0.2)
    centre = np.array([direction_at(w, -2.3, 0.0) for w in samples.w_i])
    width = radians(0.8)
    peak = 40.0 * np.exp(-0.5 * np.sum((samples.w_r - centre) ** 2, axis=1) / width**2)
    fitted = fit(replace(samples, values=samples.values + peak[:, np.newaxis]))
    assert fitted.glints is not None
    assert len(fitted.glints.glints) == len(LIGHTS_DEG)
    for glint in fitted.glints.glints:
        assert glint.resolved
        assert glint.in_plane_deg == pytest.approx(-2.3, abs=0.1)
        assert glint.width_deg == pytest.approx(0.8, rel=0.05)
    smooth = fitted.f_r(samples.w_i, samples.w_r)[:, 0]
    whole = smooth + fitted.glints.f_r(samples.w_i, samples.w_r)[:, 0]
    assert np.max(np.abs(whole / (0.2 + peak) - 1.0)) < 0.1
    assert np.max(smooth) < 0.5


def test_noise_makes_neither_glints_nor_outliers_and_is_recorded() -> None:
    fitted = fit(in_plane(0.2, noise=0.03))
    assert fitted.glints is None
    assert fitted.outliers == []
    assert fitted.noise is not None
    assert fitted.noise.origin == "neighbours"
    assert fitted.noise.median == pytest.approx(0.03, rel=0.1)  # 684 samples: a standard error of 2.7 %


def test_noise_of_repeats_is_theirs() -> None:
    samples = in_plane(0.2, noise=0.03)
    rows = np.arange(0, len(samples), 5)
    other = 0.2 * (1.0 + 0.03 * np.random.default_rng(9).normal(size=(rows.size, 1)))
    both = Samples(
        "twice",
        *(
            np.append(getattr(samples, name), getattr(samples, name)[rows])
            for name in ("theta_i", "phi_i", "theta_r", "phi_r")
        ),
        ("grey",),
        None,
        np.concatenate([samples.values, other]),
    )
    noise = fit(both).noise
    assert noise is not None
    assert noise.origin == "repeats"
    assert noise.median == pytest.approx(0.03, rel=0.25)  # of the median of 137 differences: 10 %


def test_a_wrong_sample_is_named_and_left_out() -> None:
    samples = scattered(lambda wi, wr: 0.2 + 0.1 * wi[:, 2:] * wr[:, 2:], 400, 0.0)
    values = samples.values.copy()
    values[17] *= 0.4
    fitted = fit(replace(samples, values=values, uncertainty=None))
    assert len(fitted.outliers) == 1
    assert f"{values[17, 0]:.4g} /sr" in fitted.outliers[0]
    assert fitted.f_r(samples.w_i[[17]], samples.w_r[[17]])[0, 0] == pytest.approx(samples.values[17, 0], rel=0.01)


def test_directions_at_offsets_are_the_inverse_of_offsets() -> None:
    wi = unit_vector(radians(np.array([20.0, 60.0])), radians(np.array([0.0, 130.0])))
    for light in wi:
        found = offsets_deg(light[np.newaxis], direction_at(light, 3.0, -2.0)[np.newaxis])
        assert np.array(found).ravel() == pytest.approx([3.0, -2.0])


def test_both_samples_of_a_glint_beside_the_plane_of_incidence_are_kept() -> None:
    samples, _ = glint_case(8, 21)
    fitted = fit(samples)
    assert fitted.glints is not None
    rows = np.flatnonzero((samples.values[:, 0] > 1.0) | np.isclose(samples.phi_r, radians(165.0)))
    whole = fitted.f_r(samples.w_i, samples.w_r) + fitted.glints.f_r(samples.w_i, samples.w_r)
    assert np.count_nonzero(samples.values > 1.0) == 2
    assert whole[rows] == pytest.approx(samples.values[rows], rel=0.06)  # noise of 2 %


@pytest.mark.parametrize("cut_off", [False, True])
def test_noise_around_zero_makes_no_glints_and_leaves_the_lobe(cut_off: bool) -> None:
    def f_r(wi: Floats, wr: Floats) -> Floats:
        half = (wi + wr) / np.linalg.norm(wi + wr, axis=1, keepdims=True)
        return np.exp(-(1.0 / half[:, 2:] ** 2 - 1.0) / 0.15**2)

    samples = scans(f_r, np.arange(5.0, 76.0, 10.0), 0.0)
    values = samples.values + 0.005 * np.random.default_rng(4).normal(size=samples.values.shape)
    fitted = fit(replace(samples, values=np.maximum(values, 0.0) if cut_off else values, uncertainty=None))
    assert fitted.glints is None
    bright = samples.values[:, 0] > 0.3
    found = fitted.f_r(samples.w_i[bright], samples.w_r[bright])
    off = np.abs(found / samples.values[bright] - 1.0)
    assert np.median(off) < 0.02
    assert np.max(off) < 0.2  # at grazing light, where others do not surround the lobe


def test_zeros_that_fill_directions_beyond_the_instrument_are_holes() -> None:
    samples = scans(lambda wi, wr: 0.2 + 0.1 * wi[:, 2:] * wr[:, 2:], np.array(LIGHTS_DEG), 0.0)
    samples = replace(samples, uncertainty=None)
    filled = samples.theta_r > radians(73.0)
    source = MeasuredSource.of_samples(replace(samples, values=np.where(filled[:, np.newaxis], 0.0, samples.values)))
    assert source.measured.holes == np.count_nonzero(filled)
    assert "left out as holes" in source.measured.outliers[0]
    near = ~filled
    assert source.brdf_at(None)(samples.w_i[near], samples.w_r[near]) == pytest.approx(samples.values[near], rel=0.01)
