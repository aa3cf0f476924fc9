"""Directions of the goniometer: where they lie, and that f_r between them follows from the samples."""

from __future__ import annotations

import numpy as np
import pytest

from brdfdb.geometry import spherical_angles, unit_vector
from brdfdb.measurements import Samples
from brdfdb.measurements.interpolation import fit
from brdfdb.microgeometry.directions import LOWEST_DEG, goniometer_directions
from brdfdb.microgeometry.facets import Facets
from brdfdb.microgeometry.simulation import Simulation
from brdfdb.microgeometry.surfaces import MadeSurface
from brdfdb.models import beckmann
from brdfdb.parameters import Floats


@pytest.mark.parametrize("isotropic", [True, False])
@pytest.mark.parametrize("slopes", [None, (0.05, 0.05), (0.5, 0.2)])
def test_directions_are_unit_vectors_up_to_the_lowest_ring(isotropic: bool, slopes: tuple[float, float] | None) -> None:
    lights, viewers = goniometer_directions(isotropic=isotropic, slopes=slopes)
    for vectors in (lights, viewers):
        assert np.linalg.norm(vectors, axis=-1) == pytest.approx(1.0)
        assert vectors[..., 2].min() >= np.cos(np.radians(LOWEST_DEG)) - 1e-9
    assert viewers.ndim == (2 if slopes is None else 3)
    if isotropic:
        assert np.all(viewers[..., 1] >= -1e-9)


def test_viewers_stand_in_the_lobe_of_narrow_slopes() -> None:
    lights, viewers = goniometer_directions(isotropic=True, slopes=(0.02, 0.02))
    high = lights[:, 2] > 0.3
    half = lights[high, np.newaxis] + viewers[high]
    slope = np.hypot(half[..., 0], half[..., 1]) / half[..., 2]
    inside = np.sort(slope, axis=1)
    assert np.all(inside[:, 0] < 1e-6)
    assert np.all(np.count_nonzero(slope < 0.021, axis=1) >= 10)  # patches of 10 degrees alone have one or two
    assert np.all(np.count_nonzero((slope > 0.021) & (slope < 0.067), axis=1) >= 10)


def test_f_r_of_lambertian_facets_at_other_directions_follows_from_the_samples() -> None:
    lights, viewers = goniometer_directions(isotropic=True)
    rng = np.random.default_rng(3)
    highest = np.cos(np.radians(82.5))
    others = unit_vector(np.arccos(rng.uniform(highest, 1.0, 14)), np.zeros(14))
    seen = unit_vector(np.arccos(rng.uniform(highest, 1.0, 40)), rng.uniform(0.0, np.pi, 40))
    # all directions share their maps and paths, so that the difference is that of the interpolation alone
    simulation = Simulation(
        MadeSurface("gaussian", 0.36, nodes=128),
        Facets(rho=1.0),
        np.concatenate([lights, others]),
        np.concatenate([viewers, seen]),
        rays=512,
        seed=2,
    )
    result = simulation.combined(simulation.estimate(number) for number in range(16))
    samples = result.samples("all")
    rows = np.arange(len(samples)).reshape(result.total.mean.shape[:2])
    f_r = fit(samples.selected(rows[: len(lights), : len(viewers)].reshape(-1))).f_r
    asked = samples.selected(rows[len(lights) :, len(viewers) :].reshape(-1))
    off = np.abs(f_r(asked.w_i, asked.w_r) / asked.values - 1.0)
    assert np.percentile(off, 95) < 0.015  # of which 0.01 is noise of few paths: with 4096 it is 0.004
    assert np.median(off) < 0.002
    coarse = np.isin(np.round(np.degrees(np.arccos(lights[:, 2])), 1), [0.0, 30.0, 60.0])
    few = fit(samples.selected(rows[: len(lights), : len(viewers)][coarse].reshape(-1))).f_r
    assert np.percentile(np.abs(few(asked.w_i, asked.w_r) / asked.values - 1.0), 95) > 0.05  # three lights are too few


def test_f_r_of_a_narrow_lobe_follows_from_the_samples() -> None:
    slope = 0.1
    lights, viewers = goniometer_directions(isotropic=True, slopes=(slope, slope))

    def f_r(wi: Floats, wr: Floats) -> Floats:
        width = np.sqrt(2.0) * slope
        return np.asarray(
            beckmann(*spherical_angles(wi), *spherical_angles(wr), alpha_x=width, alpha_y=width, n=1.5, k=0.0)
        )[:, np.newaxis]

    wi = np.repeat(lights, viewers.shape[1], axis=0)
    wr = viewers.reshape(-1, 3)
    angles = (*spherical_angles(wi), *spherical_angles(wr))
    samples = Samples("lobe", *angles, ("grey",), None, f_r(wi, wr))
    fitted = fit(samples).f_r
    rng = np.random.default_rng(4)
    theta = np.arccos(rng.uniform(np.cos(np.radians(75.0)), 1.0, 500))
    wi = unit_vector(theta, np.zeros(500))
    normals = np.column_stack([slope * rng.standard_normal((500, 2)), np.ones(500)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    wr = 2.0 * np.sum(wi * normals, axis=1, keepdims=True) * normals - wi
    high = wr[:, 2] > np.cos(np.radians(82.5))
    off = np.abs(fitted(wi[high], wr[high]) / f_r(wi[high], wr[high]) - 1.0)
    assert np.median(off) < 0.01
    assert np.percentile(off, 95) < 0.05


def _sorted(vectors: Floats) -> Floats:
    rounded = np.round(vectors, 9) + 0.0
    return np.asarray(rounded[np.lexsort(rounded.T)])


def test_directions_of_a_lobe_along_y_are_those_along_x_with_x_and_y_exchanged() -> None:
    along_x = goniometer_directions(isotropic=False, slopes=(0.3, 0.06))
    along_y = goniometer_directions(isotropic=False, slopes=(0.3, 0.06), azimuth=0.5 * np.pi)
    other = goniometer_directions(isotropic=False, slopes=(0.06, 0.3))
    exchanged = along_x.lights[:, [1, 0, 2]]
    for light, viewers in zip(exchanged, along_x.viewers[..., [1, 0, 2]], strict=True):
        for directions in (along_y, other):
            same = int(np.argmin(np.linalg.norm(directions.lights - light, axis=1)))
            assert directions.lights[same] == pytest.approx(light, abs=1e-9)
            assert _sorted(directions.viewers[same]) == pytest.approx(_sorted(viewers), abs=1e-6)


def test_half_vectors_of_an_oblique_lobe_lie_in_its_ellipse() -> None:
    azimuth = 0.6
    lights, viewers = goniometer_directions(isotropic=False, slopes=(0.2, 0.02), azimuth=azimuth)
    half = lights[0] + viewers[0, -57:]
    slope = half[:, :2] / half[:, 2:]
    along = slope @ [np.cos(azimuth), np.sin(azimuth)] / 0.2
    across = slope @ [-np.sin(azimuth), np.cos(azimuth)] / 0.02
    radius = np.hypot(along, across)
    assert lights[0, 2] == pytest.approx(1.0)
    assert np.sort(radius) == pytest.approx(np.sort([0.0] + [0.35, 0.7, 1.05, 1.5, 2.0, 2.6, 3.3] * 8), abs=1e-9)
    assert np.abs(along).max() == pytest.approx(3.3)
    assert np.abs(across).max() == pytest.approx(3.3)
