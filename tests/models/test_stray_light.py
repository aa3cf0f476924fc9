"""Harvey-Shack and ABg: scattered light in closed form, one model as the other, and a function of sines alone."""

import numpy as np
import pytest

from brdfdb.geometry import unit_vector
from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.models import abg, harvey_shack, harvey_shack_vectors

TOLERANCE = 1e-6


def scattered(b_0: float, knee: float, slope: float) -> float:
    """The integral of b_0 (1 + (x / L)^2)^(s / 2) over the disk of radius 1, 2 pi x dx."""
    power = 1.0 + slope / 2.0
    if power == 0.0:
        return np.pi * b_0 * knee**2 * np.log1p(knee**-2)
    return np.pi * b_0 * knee**2 * ((1.0 + knee**-2) ** power - 1.0) / power


@pytest.mark.parametrize("slope", [-6.0, -4.0, -2.5, -2.0, -1.5, -0.5, 0.0])
@pytest.mark.parametrize("knee", [1e-5, 1e-3, 0.05, 1.0])
def test_light_scattered_at_normal_incidence_is_the_integral_over_a_disk(knee: float, slope: float) -> None:
    b_0 = min(0.1 / scattered(1.0, knee, slope), 1e9)
    albedo, error = directional_albedo("harvey_shack", 0.0, tolerance=TOLERANCE, b_0=b_0, knee=knee, slope=slope)
    assert error <= TOLERANCE
    assert albedo == pytest.approx(scattered(b_0, knee, slope), abs=TOLERANCE)


@pytest.mark.parametrize("b", [1e-6, 1e-3, 1.0])
def test_abg_has_its_closed_forms(b: float) -> None:
    squares, _ = directional_albedo("abg", 0.0, tolerance=TOLERANCE, a=0.01, b=b, g=2.0)
    assert squares == pytest.approx(0.01 * np.pi * np.log1p(1.0 / b), abs=TOLERANCE)
    single, _ = directional_albedo("abg", 0.0, tolerance=TOLERANCE, a=0.01, b=b, g=1.0)
    assert single == pytest.approx(0.02 * np.pi * (1.0 - b * np.log1p(1.0 / b)), abs=TOLERANCE)


def test_a_slope_of_2_is_abg() -> None:
    rng = np.random.default_rng(3)
    angles = rng.uniform(0.0, 1.5, 200), rng.uniform(-3, 3, 200), rng.uniform(0.0, 1.5, 200), rng.uniform(-3, 3, 200)
    knee, b_0 = 0.02, 3.0
    one = harvey_shack(*angles, b_0=b_0, knee=knee, slope=-2.0)
    np.testing.assert_allclose(abg(*angles, a=b_0 * knee**2, b=knee**2, g=2.0), one, rtol=1e-13)


def test_the_peak_is_in_the_mirror_direction_and_distances_are_of_sines() -> None:
    surface = {"b_0": 2.0, "knee": 0.01, "slope": -1.5}
    for sine_i in (0.0, 0.3, 0.9):
        wi = unit_vector(np.arcsin(sine_i), 0.4)
        mirror = wi * [-1.0, -1.0, 1.0]
        assert harvey_shack_vectors(wi, mirror, **surface) == pytest.approx(2.0, rel=1e-12)
        beside = mirror[:2] + 0.05 * np.array([np.cos(1.0), np.sin(1.0)])
        wr = np.append(beside, np.sqrt(1.0 - beside @ beside))
        # 2 (1 + 25)^-0.75
        assert harvey_shack_vectors(wi, wr, **surface) == pytest.approx(2.0 * 26.0**-0.75, rel=1e-12)
    assert abg(0.7, 0.4, 0.7, 0.4 + np.pi, a=0.0025, b=0.001, g=1.8) == pytest.approx(2.5, rel=1e-12)
