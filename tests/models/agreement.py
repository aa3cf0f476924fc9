"""Rows of `paper_values/`, corners of directions, and relative errors against values of 40 digits."""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from brdfdb.reference import mp

PAPER_VALUES = Path(__file__).parents[1] / "paper_values"
HALF_PI = np.pi / 2
TINY = 1e-280  # smaller values carry too few digits of float64, or none
# theta on and next to the corners of [0, pi/2], phi_r - phi_i at exact backscatter and as near to the mirror half plane
# as float64 comes; phi_i = 0, so that the model's difference of azimuths is exact
CORNER_THETAS = (0.0, 1e-9, 0.4, np.pi / 4, 1.2, np.nextafter(HALF_PI, 0.0), HALF_PI)
CORNER_PHIS = (0.0, 1.1, HALF_PI, np.nextafter(HALF_PI, 2.0), 2.9, np.pi, -np.pi)

Row = dict[str, str]


def rows(file: str) -> list[Row]:
    """Read a file of values of a paper, number by number as text."""
    with (PAPER_VALUES / file).open(newline="") as stream:
        return list(csv.DictReader(stream))


def relative_error(value: Any, expected: Any) -> float:
    """abs(value / expected - 1); below `TINY` only that the value is as small counts."""
    expected = mp.mpf(expected)
    value = mp.mpf(float(value))
    if abs(expected) < TINY:
        return 0.0 if abs(value) <= TINY * (1 + 1e-9) else float("inf")
    return float(abs(value / expected - 1))


def check(values: Any, expected: Any, tolerance: float, arguments: object) -> None:
    """Assert that one value, or each of several, agrees with the expected one."""
    error = max(relative_error(value, expected) for value in np.ravel(values))
    assert error <= tolerance, f"off by {error:.3g} from {mp.nstr(mp.mpf(expected), 17)} at {arguments}"


def conditioning(function: Callable[..., Any], arguments: tuple[float, ...]) -> float:
    """Return the largest change of the logarithm of a function for a relative rounding of each argument."""
    h = mp.mpf("1e-25")
    value = function(*arguments)
    moved = [function(*arguments[:i], mp.mpf(x) * (1 + h), *arguments[i + 1 :]) for i, x in enumerate(arguments)]
    return float(sum(abs(each - value) for each in moved) / (h * abs(value)))
