"""Fresnel's reflectance against the reference at 40 digits, closed forms, and its bounds."""

from typing import Any

import numpy as np
import pytest

from brdfdb import fresnel
from brdfdb.reference import he_torrance_1991, mp

HALF_PI = np.pi / 2
RELATIVE = 1e-14  # worst of 12000 draws: 6.6e-15, since n - 1 is that of the decimal and n elsewhere the float64
TINY = 1e-60  # where n = 1 and k = 0 the reference itself rounds, to 1e-70 at worst


def expected_at(cos_theta: float, n: float, k: float) -> Any:
    """The reference with 80 digits; near vacuum at the decimal that n stands for, taken to 15 places."""
    with mp.workdps(80):
        index = mp.mpf(f"{n:.15f}") if 0.5 < n < 2.0 else mp.mpf(n)
        return he_torrance_1991.fresnel_unpolarised(cos_theta, index, k)


@pytest.mark.parametrize("n", [1e-3, 0.2, 0.999, 1.0, 1.5, 100.0])
@pytest.mark.parametrize("k", [0.0, 1e-12, 0.3, 5.0, 1e4])
def test_against_the_reference_at_the_corners(n: float, k: float) -> None:
    for cos_theta in (1.0, np.nextafter(1.0, 0.0), np.sqrt(0.5), 0.4, 1e-5, np.cos(HALF_PI)):
        expected = expected_at(cos_theta, n, k)
        assert abs(fresnel.unpolarised(cos_theta, n, k) - expected) <= RELATIVE * expected + TINY, cos_theta


def test_against_the_reference_anywhere() -> None:
    rng = np.random.default_rng(75)
    for case in range(1500):
        cos_theta = float(np.cos(rng.uniform(0.0, HALF_PI)) if case % 2 else 10.0 ** rng.uniform(-16.0, 0.0))
        n, k = 10.0 ** rng.uniform(-3.0, 2.0), float(rng.choice([0.0, 10.0 ** rng.uniform(-6.0, 4.0)]))
        if case % 5 == 0:  # next to vacuum
            n = 1.0 + float(rng.choice([-1.0, 1.0])) * 10.0 ** rng.uniform(-15.0, -1.0)
        expected = expected_at(cos_theta, n, k)
        error = abs(fresnel.unpolarised(cos_theta, n, k) - expected)
        assert error <= RELATIVE * expected + TINY, (cos_theta, n, k)


def test_stays_in_the_unit_interval() -> None:
    rng = np.random.default_rng(1)
    cos_theta = np.concatenate([rng.uniform(size=100_000), 10.0 ** rng.uniform(-16.0, 0.0, 100_000), np.ones(100_000)])
    n = 10.0 ** rng.uniform(-3.0, 2.0, 300_000)
    for k in (0.0, 10.0 ** rng.uniform(-9.0, 4.0, 300_000)):
        values = fresnel.unpolarised(cos_theta, n, k)
        assert values.min() >= 0.0
        assert values.max() <= 1.0


def test_normal_incidence_has_its_closed_form() -> None:
    for n, k in ((1.5, 0.0), (0.2, 3.9), (0.769, 6.08), (1.0, 1e-3)):
        expected = ((n - 1.0) ** 2 + k**2) / ((n + 1.0) ** 2 + k**2)
        assert fresnel.unpolarised(1.0, n, k) == pytest.approx(expected, rel=1e-15)


def test_at_brewsters_angle_only_s_is_reflected() -> None:
    n = 1.5
    s_only = 0.5 * ((1.0 - n**2) / (1.0 + n**2)) ** 2
    assert fresnel.unpolarised(1.0 / np.sqrt(1.0 + n**2), n, 0.0) == pytest.approx(s_only, rel=1e-14)


def test_reflects_everything_past_the_critical_angle() -> None:
    for n in (1e-3, 0.1, 0.5, 0.9):
        cos_theta = np.linspace(0.0, np.sqrt(1.0 - n**2), 1000)[1:-1]
        assert fresnel.unpolarised(cos_theta, n, 0.0) == pytest.approx(np.ones(998), rel=1e-15), n


def test_tends_to_one_at_grazing_and_without_bound_of_k() -> None:
    for n, k in ((1.5, 0.0), (0.2, 3.9), (1.0, 1e-9), (1.000001, 0.0)):
        assert fresnel.unpolarised(np.cos(HALF_PI), n, k) == pytest.approx(1.0, rel=1e-6)
    assert fresnel.unpolarised(0.6, 1.0, 1e4) == pytest.approx(1.0, abs=1e-7)


def test_without_an_interface_nothing_is_reflected() -> None:
    assert (fresnel.unpolarised(np.cos(np.linspace(0.0, HALF_PI, 91)), 1.0, 0.0) == 0.0).all()


def test_next_to_vacuum_it_goes_as_the_square_of_the_step() -> None:
    for step in (1e-6, 1e-10, 1e-14):
        # the float64 nearest to 1.000001 is off by 8e-11 of n - 1: an index is the decimal that was typed
        assert fresnel.unpolarised(1.0, 1.0 + step, 0.0) == pytest.approx(step**2 / (2.0 + step) ** 2, rel=1e-15)


def test_broadcasts_and_lets_nan_through() -> None:
    values = fresnel.unpolarised(np.array([[1.0], [np.nan]]), np.array([1.5, 2.0, np.nan]), 0.0)
    np.testing.assert_array_equal(np.isnan(values), [[False, False, True], [True, True, True]])
