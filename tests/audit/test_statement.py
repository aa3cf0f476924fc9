"""The stated error against itself and against fresh directions: chance in closed form, and what is noticed."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numba
import numpy as np
import pytest
import scipy.stats

from brdfdb.audit import pairs
from brdfdb.audit.pairs import pairs_of
from brdfdb.audit.statement import CHANCE, QUANTILES, Disagreement, contradictions, disagreements, limits
from brdfdb.tables.stated_error import Error
from brdfdb.tables.table import Table
from tests.tables.test_albedo import KINDS, table_of

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="minutes without compilation")

STATISTICS = ("l1", *QUANTILES)
Change = Callable[[dict[str, Any]], None]


def wavelengths(table: Table) -> int:
    return 1 if table.wavelength_nm is None else table.wavelength_nm.size


def found_in(table: Table, change: Change | None = None) -> list[Disagreement]:
    """What fresh directions contradict of the statement of a table, or of another one."""
    stated = copy.deepcopy(table.error.model_dump())
    if change is not None:
        change(stated)
    error = Error.model_validate(stated)
    assert contradictions(error, wavelengths(table)) == []
    return disagreements(error, pairs_of(table, table.source), table.wavelength_nm)


@pytest.mark.parametrize("quantile", QUANTILES.values())
@pytest.mark.parametrize(("stated", "fresh"), [(3600, 2700), (2700, 900), (500, 900), (600, 25_000)])
def test_the_limits_of_a_count_are_beta_binomial(stated: int, fresh: int, quantile: float) -> None:
    least, most = limits(stated, fresh, quantile)
    # the share of a population above an order statistic of a sample is beta distributed
    rank = int(quantile * (stated - 1)) + 1
    counts = np.arange(fresh + 1)
    above = scipy.stats.betabinom.pmf(counts, fresh, stated - rank + 1, rank)
    assert above[most:].sum() <= CHANCE < above[most - 1 :].sum()
    rank = min(rank + 1, stated)
    above = scipy.stats.betabinom.pmf(counts, fresh, stated - rank + 1, rank)
    if quantile == 1.0:
        assert least == -1
    else:
        assert above[: least + 1].sum() <= CHANCE < above[: least + 2].sum()


def test_a_count_hardly_ever_leaves_its_limits_whatever_the_errors_are_distributed_like() -> None:
    """20 000 pairs of samples of one population, with a tail so heavy that it has no mean."""
    rng = np.random.default_rng(15)
    least, most = limits(400, 300, 0.99)
    for _ in range(200):
        samples = rng.pareto(0.7, (100, 700))
        stated = np.percentile(samples[:, :400], 99.0, axis=1)
        counts = np.count_nonzero(samples[:, 400:] > stated[:, np.newaxis], axis=1)
        assert np.all((counts > least) & (counts < most))


@KINDS
def test_no_number_of_a_true_statement_is_contradicted(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for seed in (pairs.SEED, 7, 8):
        monkeypatch.setattr(pairs, "SEED", seed)
        assert found_in(table_of(kind)) == []


def times(factor: float, *names: str) -> Change:
    def change(error: dict[str, Any]) -> None:
        for name in names:
            error[name] = [[factor * each for each in row] for row in error[name]]
            error["overall"][name] *= factor

    return change


@pytest.mark.parametrize("name", STATISTICS)
def test_each_statistic_is_compared(name: str) -> None:
    """A third of all of them keeps their order; each is found by itself, at all bands but few."""
    found = found_in(table_of("polar"), times(1.0 / 3.0, *STATISTICS))
    of_name = [each for each in found if each.statistic == name]
    assert {each.theta_i_deg for each in of_name} >= {(0.0, 10.0), (40.0, 50.0), (0.0, 90.0)} or name == "max"
    assert of_name
    assert all(each.fresh is not None and each.fresh > each.stated for each in of_name)


def test_statistics_that_are_far_too_large_are_contradicted() -> None:
    found = found_in(table_of("polar"), times(10.0, *STATISTICS))
    assert {"median", "p95"} <= {each.statistic for each in found}
    assert all(each.fresh is not None and each.fresh < each.stated for each in found)


def test_one_number_of_one_band_and_wavelength_is_enough() -> None:
    def change(error: dict[str, Any]) -> None:
        error["median"][4][2] /= 2.0

    table = table_of("polar-parts")
    (only,) = found_in(table, change)
    assert (only.statistic, only.theta_i_deg, only.wavelength_nm) == ("median", (40.0, 50.0), table.wavelength_nm[2])
    assert only.times == pytest.approx(2.0, rel=0.2)


@pytest.mark.parametrize("factor", [0.5, 3.0])
def test_a_wrong_floor_is_contradicted(factor: float) -> None:
    def change(error: dict[str, Any]) -> None:
        error["floor"] = [factor * each for each in error["floor"]]

    assert "floor" in {each.statistic for each in found_in(table_of("polar"), change)}


INFINITE = float("inf")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda e: e.update({name: [[1e-6]] * 9 for name in STATISTICS}), "its overall p99 of "),
        (lambda e: e["p99"].pop(), "it is not about 9 bands of theta_i and 1 wavelengths"),
        (lambda e: e["median"].__setitem__(3, [2.0 * e["max"][3][0]]), "a percentile is above a higher one"),
        (lambda e: e["max"].__setitem__(3, [INFINITE]), "not all of its numbers are finite and at least 0"),
        (lambda e: e["overall"].update(max=INFINITE), "not all of its numbers are finite and at least 0"),
        (lambda e: e["theta_i_deg"].__setitem__(1, 5.0), "it is not about 9 bands of theta_i and 1 wavelengths"),
    ],
)
def test_a_statement_that_contradicts_itself_is_named(change: Change, said: str) -> None:
    table = table_of("polar")
    stated = table.error.model_dump()
    assert contradictions(table.error, 1) == []
    change(stated)
    found = contradictions(Error.model_validate(stated), 1)
    assert any(each.startswith(said) for each in found)


def test_what_is_not_finite_is_no_smaller_than_what_is_stated() -> None:
    table = table_of("polar")
    broken = replace(table, values=np.full_like(table.values, np.nan))
    assert len(found_in(broken)) >= 9 * len(STATISTICS)
