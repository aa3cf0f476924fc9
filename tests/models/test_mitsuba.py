"""The microfacet models of Walter 2007 against Mitsuba's rough conductor: values, and the density of samples."""

import numpy as np
import pytest

pytest.importorskip("mitsuba")

from tests.benchmarks.mitsuba_microfacet import REQUIRED, difference


@pytest.mark.parametrize("alphas", [(0.05, 0.05), (0.1, 0.25), (0.5, 0.5)], ids=str)
@pytest.mark.parametrize("shape", ["ggx", "beckmann"])
def test_values_and_densities_are_those_of_mitsuba(shape: str, alphas: tuple[float, float]) -> None:
    worst = difference(shape, *alphas, count=10_000)
    assert worst.value <= REQUIRED
    assert worst.density <= REQUIRED
    assert worst.visible <= REQUIRED if shape == "ggx" else np.isnan(worst.visible)
    assert worst.compared > (0.01 if shape == "beckmann" else 0.99)
