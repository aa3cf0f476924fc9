"""The search of minima, on functions whose minimum is known."""

import numpy as np
import pytest
from numpy.typing import NDArray

from brdfdb.conversion.search import downhill
from brdfdb.fitting.variables import best_apart, spread

Floats = NDArray[np.float64]

SIZE = np.full(2, 0.1)


def test_points_spread_over_the_cube_evenly() -> None:
    points = spread(4096, 3)
    assert np.all((points > 0.0) & (points < 1.0))
    assert points.mean(axis=0) == pytest.approx(0.5, abs=1e-3)
    assert (points**2).mean(axis=0) == pytest.approx(1.0 / 3.0, abs=1e-3)
    assert spread(2, 2) == pytest.approx(np.array([[1 / 2, 1 / 3], [1 / 4, 2 / 3]]))  # Halton 1960


def test_a_curved_valley_is_followed_to_its_end() -> None:
    # Rosenbrock's function with its minimum at (0.6, 0.36)
    at, value = downhill(
        lambda p: float((0.6 - p[0]) ** 2 + 100.0 * (p[1] - p[0] ** 2) ** 2),
        np.array([0.1, 0.9]),
        SIZE,
        tolerance=1e-14,
    )
    assert at == pytest.approx([0.6, 0.36], abs=1e-4)
    assert value < 1e-8


def test_a_minimum_outside_is_found_on_the_surface() -> None:
    at, _ = downhill(lambda p: float(abs(p[0] - 1.5) + abs(p[1] - 0.3)), np.array([0.5, 0.5]), SIZE)
    assert at == pytest.approx([1.0, 0.3], abs=1e-4)


def test_beginnings_are_apart() -> None:
    points = np.array([[0.5, 0.5], [0.51, 0.5], [0.1, 0.1], [0.9, 0.9]])
    chosen = best_apart(points, np.array([1.0, 0.5, 3.0, 2.0]), 2)
    assert chosen.tolist() == [[0.51, 0.5], [0.9, 0.9]]
