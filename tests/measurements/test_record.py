"""The record of measured data in words."""

from __future__ import annotations

import pytest

from brdfdb.measurements.record import Measured, MeasuredSymmetry


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
