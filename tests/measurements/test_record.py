"""The record of measured data in words."""

from __future__ import annotations

import numpy as np
import pytest

from brdfdb.measurements.record import HeldOut, Measured, MeasuredSymmetry, SimulationRecord


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
    ).in_words()
    assert any(line.startswith(noise) for line in lines)
    assert any(line.startswith(f"{share} of all pairs of directions were measured; ") for line in lines)


def held_out_levels() -> HeldOut:
    """Return errors in [0, 0.01] of values above 1000 floors, 0.1 above 100 floors, and 0.3 beyond 70 degrees."""
    f_r = np.repeat([2000.0, 200.0, 2000.0, 0.5], [400, 400, 400, 5])[:, np.newaxis] * 1e-3
    largest = np.repeat([0.01, 0.1, 0.3, 4.0], [400, 400, 400, 5])[:, np.newaxis]
    errors = largest * np.concatenate([np.linspace(0.0, 1.0, count) for count in (400, 400, 400, 5)])[:, np.newaxis]
    lowest = np.cos(np.radians(np.repeat([69.0, 40.0, 71.0, 20.0], [400, 400, 400, 5])))
    percentiles = {"median": 0.0, "p95": 0.0, "p99": 0.0, "max": 0.0}
    record = HeldOut(scheme="folds", rounds=2, samples=1205, outside=0, floor=[1e-3], l1=0.0, **percentiles)
    return record.with_levels(errors, f_r, lowest)


def test_errors_of_bright_values_dim_values_and_low_directions_are_told_apart() -> None:
    levels = held_out_levels().p99_of_levels
    assert levels is not None
    assert levels[4] == pytest.approx([0.0099, 0.297], rel=1e-3)
    # where too few tell, those of all: of the largest 12 of 1205 errors 4 are the outliers, and 8 are near 0.3
    of_all = pytest.approx(0.3 * (1.0 - 7.0 / 399.0), rel=3e-3)
    assert levels[3] == [pytest.approx(0.099, rel=1e-3), of_all]
    assert levels[0] == levels[1] == [of_all, of_all]
    measured = Measured(
        channels=["grey"],
        samples=1205,
        negative=0.0,
        interpolation="",
        reciprocity=MeasuredSymmetry(assumed=True, asymmetry=None, allowed=None),
        mirror=None,
        held_out=held_out_levels(),
    )
    f_r, lowest = np.array([[3.0], [3.0], [1e-5]]), np.array([[0.5], [0.2], [0.5]])
    stated = measured.error_of(f_r, lowest, np.array([1e-9]))
    assert stated[:, 0] == pytest.approx([3.0 * levels[4][0], 3.0 * levels[4][1], 1e-3 * levels[0][0]])
    numbers = {"slopes": [0.1, 0.1], "realisations": 16, "rays": 64, "target": 0.02, "standard_error": 0.02}
    shares = {name: [0.5] for name in ("lights_deg", "one", "two", "further", "in_shadow")}
    words = {"surface": "", "facets": "", "receivers": "", "spectral": False}
    common = {"standard_error_lowest": 0.1, "standard_error_of_map": None, "standard_error_median": 0.01}
    simulation = SimulationRecord.model_validate({**numbers, **shares, **words, **common})
    simulated = measured.model_copy(update={"simulation": simulation}).error_of(f_r, lowest, np.array([1e-9]))
    assert simulated[0, 0] == pytest.approx(3.0 * np.hypot(levels[4][0], 0.026))
