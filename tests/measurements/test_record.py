"""The record of measured data in words."""

from __future__ import annotations

import numpy as np
import pytest

from brdfdb.geometry import radians, unit_vector
from brdfdb.measurements.record import HeldOut, Measured, MeasuredSymmetry, SimulationRecord
from brdfdb.measurements.regions import Regions
from brdfdb.parameters import Floats


@pytest.mark.parametrize(
    ("samples", "noise", "share"),
    [(300, "noise of the samples:", "75 %"), (0, "noise of the file:", "less than 0.1 %")],
)
def test_values_of_a_grid_are_nodes_and_those_of_a_list_samples(samples: int, noise: str, share: str) -> None:
    lines = Measured(
        channels=["grey"],
        samples=samples,
        negative=0.0,
        interpolation="as the tools of the file evaluate it",
        reciprocity=MeasuredSymmetry(assumed=False, asymmetry=None, allowed=None),
        mirror=None,
        extrapolated=0.25 if samples else 1.0,
        doubts=["Azimuths? Lobes turn."],
    ).in_words()
    assert "doubt: Azimuths? Lobes turn." in lines
    assert any(line.startswith(noise) for line in lines)
    assert any(line.startswith(f"{share} of all pairs of directions were measured; ") for line in lines)


def directions(theta_i_deg: float, theta_r_deg: float, delta_deg: float) -> tuple[Floats, Floats]:
    """Return unit vectors (1, 3) of light and viewer."""
    angles = radians(np.array([theta_i_deg, theta_r_deg, delta_deg]))
    return unit_vector(angles[:1], np.zeros(1)), unit_vector(angles[1:2], angles[2:])


@pytest.mark.parametrize(
    ("angles", "number"),
    [
        ((30.0, 30.0, 180.0), 0),  # the mirror direction
        ((30.0, 40.0, 180.0), 0),  # a half vector at 5 degrees: tan 5 < 0.1
        ((30.0, 45.0, 180.0), 1),  # at 7.5 degrees
        ((30.0, 40.0, 0.0), 2),  # 10 degrees from the light
        ((30.0, 75.0, 180.0), 3),
        ((35.0, 35.0, 180.0), 4),  # between lights
        ((35.0, 75.0, 0.0), 7),
        ((30.9, 30.0, 180.0), 0),  # within a degree of a light
    ],
)
def test_regions_are_those_of_the_geometry(angles: tuple[float, float, float], number: int) -> None:
    regions = Regions(lobe=0.1, turned=False, lights_deg=[(10.0, 0.0), (30.0, 0.0), (75.0, 0.0)])
    assert regions.number(*directions(*angles))[0] == number


def test_lights_of_a_turned_surface_are_told_apart_by_azimuth() -> None:
    wi = unit_vector(radians(np.array([30.0, 30.0])), radians(np.array([90.0, 0.0])))
    regions = {turned: Regions(lobe=0.0, turned=turned, lights_deg=[(30.0, 90.0)]) for turned in (False, True)}
    assert regions[True].between(wi).tolist() == [False, True]
    assert regions[False].between(wi).tolist() == [False, False]


def stated_regions() -> Regions:
    """Return errors in (0, 1] off the lobe, in (0, 0.1] in the lobe, and twice as large between lights."""
    number = np.repeat([0, 1, 4, 5], [2000, 2000, 2000, 10])
    errors = np.concatenate([np.arange(1, 2001) / 20000.0, np.arange(1, 2001) / 2000.0, np.arange(1, 2001) / 10000.0])
    few = np.full(10, 0.01)
    regions = Regions(lobe=0.1, turned=False, lights_deg=[(30.0, 0.0)])
    return regions.stated(number, np.concatenate([errors, few])[:, np.newaxis])


def test_percentiles_of_regions_are_upper_limits_and_few_errors_are_those_of_all() -> None:
    lobe, off, near, grazing, lobe_between, off_between = stated_regions().errors[:6]
    # of 2000 evenly spaced errors up to the largest, the share 0.95 + sqrt(0.95 * 0.05 / 2000) stays below
    assert lobe.p95 == pytest.approx(0.1 * (0.95 + 0.00487), abs=2e-4)
    assert off.p95 == pytest.approx(0.95 + 0.00487, abs=2e-3)
    assert lobe.p99 == pytest.approx(0.1 * (0.99 + 0.00222), abs=2e-4)
    assert lobe_between.p95 == pytest.approx(0.2 * (0.95 + 0.00487), abs=4e-4)
    assert off_between.p95 == pytest.approx(lobe_between.p95, rel=0.01)  # of ten errors, those of all between lights
    assert near.samples == grazing.samples == 0
    assert near.p95 == grazing.p95 == pytest.approx(0.9, abs=0.02)  # 95 % of the 4000 at lights


def test_errors_of_values_are_those_of_their_region_and_the_noise_of_all_rays_is_added() -> None:
    percentiles = {"median": 0.0, "p95": 0.0, "p99": 0.0, "max": 0.0}
    regions = stated_regions()
    held_out = HeldOut(
        scheme="folds", rounds=2, samples=6010, outside=0, floor=[1e-3], l1=0.0, regions=regions, **percentiles
    )
    measured = Measured(
        channels=["grey"],
        samples=6010,
        negative=0.0,
        interpolation="",
        reciprocity=MeasuredSymmetry(assumed=True, asymmetry=None, allowed=None),
        mirror=None,
        held_out=held_out,
    )
    pairs = [directions(30.0, 30.0, 180.0), directions(30.0, 50.0, 180.0), directions(30.0, 30.0, 180.0)]
    wi, wr = (np.concatenate(part) for part in zip(*pairs, strict=True))
    f_r = np.array([[3.0], [3.0], [1e-5]])
    stated = measured.error_of(f_r, wi, wr, np.array([1e-9]))
    lobe, off = regions.errors[0].p99, regions.errors[1].p99
    assert stated[:, 0] == pytest.approx([3.0 * lobe, 3.0 * off, 1e-3 * lobe])
    numbers = {"slopes": [0.1, 0.1], "realisations": 16, "rays": 64, "target": 0.02, "standard_error": 0.02}
    shares = {name: [0.5] for name in ("lights_deg", "one", "two", "further", "in_shadow")}
    words = {"surface": "", "facets": "", "receivers": "", "spectral": False}
    common = {"standard_error_lowest": 0.1, "standard_error_of_map": None, "standard_error_median": 0.01}
    simulation = SimulationRecord.model_validate({**numbers, **shares, **words, **common})
    simulated = measured.model_copy(update={"simulation": simulation}).error_of(f_r, wi, wr, np.array([1e-9]))
    assert simulated[0, 0] == pytest.approx(3.0 * np.hypot(lobe, 0.026))
    assert "lobe 9.6 %, off the lobe 96 %; between lights lobe 19 %" in regions.sentence


def test_records_of_older_tables_are_read_without_their_errors_by_levels() -> None:
    fields = {"scheme": "folds", "rounds": 10, "samples": 300, "outside": 2, "floor": [1e-3], "l1": 0.02}
    older = {**fields, "median": 0.01, "p95": 0.03, "p99": 0.05, "max": 0.2, "p99_of_levels": [[0.05, 0.06]] * 5}
    assert HeldOut.model_validate(older).regions is None
    assert HeldOut.model_validate(older).p99 == 0.05
