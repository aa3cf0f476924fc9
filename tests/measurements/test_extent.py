"""The directions that were measured: holes and gaps are marked, or the stated error is right in them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb.errors import ParameterError
from brdfdb.geometry import degrees, radians, unit_vector
from brdfdb.materials import presets
from brdfdb.materials.source import Evaluate
from brdfdb.measurements import MeasuredSource, Samples
from brdfdb.measurements.coordinates import beyond, places
from brdfdb.measurements.extent import Extent
from brdfdb.measurements.interpolation import fit
from brdfdb.measurements.usable_values import floor_of
from brdfdb.parameters import Floats
from tests.measurements.made_up import scans, scattered

RIGHT, NOISE = 1.3, 0.01
LIGHTS_DEG = np.array([10.0, 25.0, 40.0, 55.0, 70.0])


def _ones(wi: Floats, _: Floats) -> Floats:
    return np.ones((len(wi), 1))


def _outside(extent: Extent, theta_i_deg: float, theta_r_deg: float, delta_phi_deg: float) -> bool:
    """Return whether a pair is extrapolated; a viewer at a negative angle is on the other side of the normal."""
    wi, wr = unit_vector(radians(theta_i_deg), 0.3), unit_vector(radians(theta_r_deg), 0.3 + radians(delta_phi_deg))
    return bool(extent.outside(wi[np.newaxis], wr[np.newaxis])[0])


def _from_mirror_deg(samples: Samples) -> Floats:
    cosine = np.sum(samples.w_i * [-1.0, -1.0, 1.0] * samples.w_r, axis=1)
    return np.asarray(degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def _in_patch(samples: Samples) -> NDArray[np.bool_]:
    """Return which viewers are within a square of 40 degrees next to the mirror directions."""
    delta = samples.phi_r - samples.phi_i
    x, y = (degrees(samples.theta_r) * turn(delta) for turn in (np.cos, np.sin))
    return np.asarray((np.abs(x + 30.0) < 20.0) & (np.abs(y) < 20.0))


HOLES: dict[str, Callable[[Evaluate], Samples]] = {
    "none": lambda f: scans(f, LIGHTS_DEG, NOISE),
    "mirror direction": lambda f: (s := scans(f, LIGHTS_DEG, NOISE)).selected(_from_mirror_deg(s) > 25.0),
    "one light of five": lambda f: scans(f, np.delete(LIGHTS_DEG, 2), NOISE),
    "wide gap": lambda f: scans(f, np.array([10.0, 20.0, 30.0, 60.0, 70.0]), NOISE),
    "patch": lambda f: (s := scans(f, LIGHTS_DEG, NOISE)).selected(~_in_patch(s)),
    "random": lambda f: (s := scans(f, LIGHTS_DEG, NOISE)).selected(np.random.default_rng(1).random(len(s)) > 0.3),
    "scattered, mirror direction": lambda f: (s := scattered(f, 1000, NOISE)).selected(_from_mirror_deg(s) > 25.0),
}


@pytest.mark.parametrize("name", ["clay-vase", "latex-gloss-sprayed-metal"])
@pytest.mark.parametrize("hole", HOLES)
def test_error_is_not_understated_where_it_is_stated(name: str, hole: str) -> None:
    f_r = presets()[name].brdf_at(None)
    samples = HOLES[hole](f_r)
    source = MeasuredSource.of_samples(samples, name="x", title="x", provenance="x")
    rng = np.random.default_rng(3)
    theta = np.arccos(rng.uniform(np.cos(radians(80.0)), 1.0, (2, 4000)))
    wi, wr = (unit_vector(one, rng.uniform(0.0, 2.0 * np.pi, 4000)) for one in theta)
    truth = f_r(wi, wr)
    noisy = truth + NOISE * (truth + 0.01 * truth.mean()) * rng.standard_normal(truth.shape)
    values = source.brdf_at(None)(wi, wr)
    error = (np.abs(values - noisy) / np.maximum(values, floor_of(samples)))[:, 0]
    measured = ~source.extrapolated(wi, wr)
    assert measured.mean() > 0.25
    assert np.percentile(error[measured], 95) < RIGHT * source.measured.held_out.p95
    if name.startswith("latex") and "mirror" in hole:  # nobody saw its lobe
        inside_hull = ~beyond(places(wi, wr, turned=False), places(samples.w_i, samples.w_r, turned=False))
        assert np.percentile(error[inside_hull & ~measured], 95) > 10.0 * source.measured.held_out.p95


def test_between_lights_is_measured_and_beyond_the_last_is_not() -> None:
    extent = Extent.of(scans(_ones, LIGHTS_DEG, 0.0), turned=False)
    assert not any(_outside(extent, light, 30.0, 100.0) for light in np.arange(0.0, 71.0, 2.5))
    assert all(_outside(extent, light, 30.0, 100.0) for light in (72.5, 80.0, 89.0))
    assert all(_outside(extent, 40.0, viewer, 100.0) for viewer in (78.0, 85.0))


@pytest.mark.parametrize("turned", [False, True])
def test_all_samples_are_measured(turned: bool) -> None:
    samples = scattered(_ones, 300, 0.0)
    turns = np.random.default_rng(2).uniform(0.0, 6.0, 300) * turned
    samples = replace(samples, phi_i=turns, phi_r=samples.phi_r + turns)
    assert not Extent.of(samples, turned=turned).outside(samples.w_i, samples.w_r).any()


def test_light_that_is_missing_is_a_gap_and_its_neighbours_are_measured() -> None:
    extent = Extent.of(scans(_ones, np.delete(np.arange(10.0, 71.0, 10.0), 3), 0.0), turned=False)
    lights = np.arange(20.0, 51.0, 5.0).tolist()
    assert [light for light in lights if _outside(extent, light, 25.0, 100.0)] == [35.0, 40.0, 45.0]


@pytest.mark.parametrize("narrow_deg", [1.0, 2.5, 5.0])
def test_mirror_direction_that_is_missing_is_marked_at_all_lights(narrow_deg: float) -> None:
    samples = scans(_ones, LIGHTS_DEG, 0.0, step_deg=narrow_deg)
    extent = Extent.of(samples.selected(_from_mirror_deg(samples) > 25.0), turned=False)
    assert all(_outside(extent, light, light, 180.0) for light in (15.0, 32.0, 50.0, 65.0))
    assert not any(_outside(extent, light, light - 30.0, 180.0) for light in (15.0, 32.0, 50.0, 65.0))


def test_plane_of_incidence_is_measured_and_nothing_beside_it() -> None:
    light, viewer = (radians(a.ravel()) for a in np.meshgrid([10.0, 30.0, 50.0], np.arange(-75.0, 76.0, 5.0)))
    turn = np.where(viewer < 0.0, np.pi, 0.0)
    samples = scattered(_ones, light.size, 0.0)
    samples = replace(samples, theta_i=light, theta_r=np.abs(viewer), phi_r=turn)
    extent = Extent.of(samples, turned=False)
    for light_deg, viewer_deg in ((20.0, 33.0), (44.0, -62.0), (10.0, 7.0), (50.0, -72.0)):
        assert not _outside(extent, light_deg, viewer_deg, 0.0)
        assert not _outside(extent, light_deg, viewer_deg, 0.8)  # half a cell of tolerance
        assert _outside(extent, light_deg, viewer_deg, 30.0)


def test_single_light_is_measured_alone() -> None:
    extent = Extent.of(scans(_ones, np.array([30.0]), 0.0), turned=False)
    assert not any(_outside(extent, 30.5, viewer, 110.0) for viewer in (0.0, 33.0, 61.0))
    assert all(_outside(extent, light, 33.0, 110.0) for light in (20.0, 26.0, 34.0))


def test_samples_of_other_azimuths_of_the_light_tell_of_these_alone() -> None:
    samples = scans(_ones, np.repeat([20.0, 40.0], 4), 0.0, step_deg=15.0)
    turns = radians(np.arange(len(samples)) // (len(samples) // 8) % 4 * 30.0)
    extent = Extent.of(replace(samples, phi_i=turns, phi_r=samples.phi_r + turns), turned=True)
    for azimuth, outside in ((0.0, False), (45.0, False), (90.0, False), (160.0, True), (240.0, True)):
        light, viewer = (
            unit_vector(radians(theta), radians(azimuth + turn)) for theta, turn in ((30.0, 0.0), (20.0, 70.0))
        )
        assert extent.outside(light[np.newaxis], viewer[np.newaxis]).tolist() == [outside], azimuth


def test_extent_of_many_samples_is_small() -> None:
    rng = np.random.default_rng(1)
    samples = scattered(_ones, 200_000, 0.0)
    extent = Extent.of(samples, turned=False)
    assert len(extent.cells) < 10_000
    wi, wr = (unit_vector(rng.uniform(0.0, 1.2, 1000), rng.uniform(0.0, 6.0, 1000)) for _ in range(2))
    assert extent.outside(wi, wr).mean() < 0.02


def test_damaged_cells_are_refused() -> None:
    extent = Extent.of(scans(_ones, LIGHTS_DEG, 0.0), turned=False)
    for cells in ("AAAA", "no base64!", extent.model_copy(update={"turned": True}).cells[:40]):
        with pytest.raises(ParameterError, match="the cells are damaged"):
            extent.model_copy(update={"cells": cells}).outside(np.array([[0.0, 0.0, 1.0]]), np.array([[0.0, 0.0, 1.0]]))


def test_repeats_leave_the_extent_of_scattered_samples_as_it_is() -> None:
    once = scattered(_ones, 150, NOISE)
    both = [Extent.of(some, turned=False).measured for some in (once, once.selected(np.tile(np.arange(150), 10)))]
    assert np.array_equal(*both)


def test_encoder_noise_leaves_extent_and_scheme_of_scans_as_they_are() -> None:
    exact = scans(_ones, np.array([20.0, 40.0, 60.0]), NOISE)
    noise = radians(0.02) * np.random.default_rng(4).standard_normal((2, len(exact)))
    read = replace(exact, theta_i=exact.theta_i + noise[0], theta_r=np.abs(exact.theta_r + noise[1]))
    measured = [Extent.of(some, turned=False).measured for some in (exact, read)]
    assert measured[1].mean() == pytest.approx(measured[0].mean(), rel=0.05)
    assert np.mean(measured[0] != measured[1]) < 0.03
    assert (fit(exact).held_out.scheme, fit(read).held_out.scheme) == ("incidences", "incidences")
