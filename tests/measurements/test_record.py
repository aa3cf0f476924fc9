"""The record of measured data in words."""

from __future__ import annotations

import pytest

from brdfdb.measurements.record import Measured, Symmetry


@pytest.mark.parametrize(
    ("samples", "noise", "outside"),
    [
        (300, "noise of the samples:", "outside of the samples:"),
        (0, "noise of the file:", "outside of the nodes of the file:"),
    ],
)
def test_values_of_a_grid_are_nodes_and_those_of_a_list_samples(samples: int, noise: str, outside: str) -> None:
    lines = Measured(
        channels=["grey"],
        samples=samples,
        negative=0.0,
        interpolation="as the tools of the file evaluate it",
        reciprocity=Symmetry(assumed=False, asymmetry=None, allowed=None),
        mirror=None,
        hull=[[0.0, 0.0, 1.0, 0.0]],
        extrapolated=0.25,
    ).in_words()
    assert any(line.startswith(noise) for line in lines)
    assert f"25 % of the nodes of the table lie {outside} f_r there is extrapolated" in lines
