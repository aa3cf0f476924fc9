"""The functions that kernels are made of, against 40 digits: what their docstrings promise, and their ends."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from brdfdb import _elementary
from brdfdb._elementary import COS_HORIZON
from brdfdb.reference import mp
from tests.compiled import compiled

arcsin, cos, cosine, erfcx = map(compiled, (_elementary.arcsin, _elementary.cos, _elementary.cosine, _elementary.erfcx))
exp, log, sine = map(compiled, (_elementary.exp, _elementary.log, _elementary.sine))
summand_exp, twice_arctan = map(compiled, (_elementary.summand_exp, _elementary.twice_arctan))
RNG = np.random.default_rng(22)


@pytest.mark.parametrize(
    ("function", "exact", "arguments", "promise"),
    [  # the worst measured stands behind
        (exp, mp.exp, RNG.uniform(-708.0, 700.0, 3000), 2e-16),  # 1.4e-16; interpreted: 1.7e-16
        (exp, mp.exp, RNG.uniform(-1.0, 1.0, 3000), 2e-16),  # 1.4e-16; interpreted: 1.7e-16
        (log, mp.log, 10.0 ** RNG.uniform(-307.0, 308.0, 3000), 4e-16),  # 2.3e-16
        (arcsin, mp.asin, RNG.uniform(-np.sqrt(0.5), np.sqrt(0.5), 3000), 3e-16),  # 2.3e-16
        (arcsin, mp.asin, 10.0 ** RNG.uniform(-300.0, -0.2, 3000), 3e-16),  # 1.5e-16
        (
            twice_arctan,
            lambda x: 2 * mp.atan(x),
            RNG.uniform(-np.tan(np.pi / 8), np.tan(np.pi / 8), 3000),
            2e-16,
        ),  # 1.2e-16
        (twice_arctan, lambda x: 2 * mp.atan(x), 10.0 ** RNG.uniform(-300.0, -0.4, 3000), 2e-16),  # 1.1e-16
        (erfcx, lambda x: mp.exp(x * x) * mp.erfc(x), RNG.uniform(0.0, 30.0, 2000), 5e-15),  # 4e-15, at large x
        (erfcx, lambda x: mp.exp(x * x) * mp.erfc(x), 10.0 ** RNG.uniform(-20.0, 0.0, 1000), 2e-15),  # 5e-16
    ],
)
def test_keeps_its_promise(function: Callable[[float], float], exact: Any, arguments: Any, promise: float) -> None:
    for x in map(float, arguments):
        expected = exact(mp.mpf(x))
        assert abs(function(x) - expected) <= promise * abs(expected), x


def test_log_next_to_1_is_good_to_rounding() -> None:
    for x in 1.0 + RNG.uniform(-0.3, 0.4, 2000):
        assert abs(log(x) - mp.log(mp.mpf(x))) <= 4e-16, x
    assert log(1.0) == 0.0


@pytest.mark.parametrize(("function", "exact"), [(sine, mp.sin), (cos, mp.cos)])
def test_sine_and_cosine_keep_their_promise(function: Callable[[float], float], exact: Any) -> None:
    rng = np.random.default_rng(23)
    near = np.concatenate([rng.uniform(-10.0, 10.0, 3000), rng.uniform(-1e5, 1e5, 3000), np.arange(-8, 9) * np.pi / 4])
    for x in map(float, near):  # worst measured: 1.5e-16
        assert abs(function(x) - exact(mp.mpf(x))) <= 2e-16, x
    for x in map(float, 10.0 ** rng.uniform(5.0, 15.0, 300)):
        assert abs(function(x) - exact(mp.mpf(x))) <= 2e-16 * x, x
    assert np.isnan(function(np.nan))
    assert function(np.pi / 2) == (1.0 if function is sine else COS_HORIZON)


def test_exp_is_0_where_the_normal_numbers_end_and_nan_for_nan() -> None:
    assert exp(0.0) == 1.0
    for x in (-708.5, -1e6, -1e300, -np.inf):
        assert exp(x) == 0.0
    assert np.isnan(exp(np.nan))
    assert np.isnan(erfcx(np.nan))
    assert np.isnan(arcsin(np.nan))
    assert np.isnan(twice_arctan(np.nan))


def test_cosine_is_held_at_the_horizon() -> None:
    assert cosine(0.3) == 0.3
    assert cosine(0.0) == cosine(-0.5) == COS_HORIZON == np.cos(np.pi / 2)
    assert np.isnan(cosine(np.nan))


def test_exp_of_a_summand_keeps_its_promise() -> None:
    for x in (*RNG.uniform(-100.0, 100.0, 3000), 0.0):  # worst measured: 2.8e-13
        expected = mp.exp(mp.mpf(float(x)))
        assert abs(summand_exp(float(x)) - expected) <= 3e-13 * expected, x
    for x in (-701.0, -708.5, -1e6, -1e300, -np.inf):
        assert 0.0 <= summand_exp(x) <= 1e-300
