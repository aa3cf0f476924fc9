"""What forms cost: turns, medians and the front, with made-up clocks and timings."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from brdfdb.forms import catalogue, timing
from brdfdb.forms.catalogue import Form
from brdfdb.forms.timing import CHEAPER, front, times
from brdfdb.materials import presets

WI = np.tile([0.6, 0.0, 0.8], (10, 1))


class Machine:
    """A clock that moves only when something is evaluated, and slows down from call to call as it is told."""

    def __init__(self) -> None:
        self.now = 0.0
        self.calls: list[tuple[str, int]] = []
        self.slow: Iterator[float] = itertools.repeat(1.0)
        self.copies = 0

    def form(self, key: str, ns: float, wavelengths: int = 1, dtype: Any = np.float64) -> Form:
        def evaluate(wi: Any, wr: Any) -> Any:
            assert wi.dtype == wr.dtype == dtype
            self.calls.append((key, len(wi)))
            self.now += 1e-9 * ns * len(wi) * wavelengths * next(self.slow)
            return np.zeros((len(wi), wavelengths), dtype)

        return Form(key, key, "approximation", key, evaluate, 8, dtype)

    def copied(self) -> Any:
        self.copies += 1
        return self.form(f"copy {self.copies}", 10.0).evaluate

    def times(self, *forms: Form, **how: Any) -> list[timing.Times]:
        return times(forms, WI, WI, clock=lambda: self.now, **how)

    def mixed_times(self, *forms: Form, rounds: int) -> list[timing.Times]:
        return timing.mixed_times(forms, WI, WI, rounds=rounds, clock=lambda: self.now)


@pytest.fixture
def machine() -> Machine:
    return Machine()


def test_times_are_those_of_a_value_of_many_wavelengths_too(machine: Machine) -> None:
    grey, spectral = machine.times(machine.form("a", 20.0), machine.form("b", 5.0, 41, np.float32), rounds=4)
    assert grey.seconds.shape == (4,)
    np.testing.assert_allclose(grey.quartiles_ns, 20.0)
    np.testing.assert_allclose(spectral.quartiles_ns, 5.0)
    (spectral,) = machine.times(machine.form("a", 1.0, 41), rounds=1)
    assert 1e5 < spectral.directions * 41 <= 1e6


def test_fast_forms_are_timed_at_many_directions_and_slow_ones_at_as_many_as_fit(machine: Machine) -> None:
    forms = [machine.form(key, ns) for key, ns in (("a", 1.0), ("b", 3e4), ("c", 6e4), ("d", 1e9))]
    fast, slow, as_slow, slowest = machine.times(*forms)
    assert fast.directions == timing.BATCH
    assert 0.1 * timing.RUN_S < slow.directions * 30e-6 < timing.RUN_S
    assert as_slow.directions == slow.directions  # the same form on a busy machine
    assert slowest.directions < slow.directions


def test_busy_moments_do_not_make_a_form_slow(machine: Machine) -> None:
    machine.slow = itertools.chain([100.0] * 6, itertools.repeat(1.0))  # and the first call compiles
    first, second = machine.times(machine.form("a", 3e4), machine.form("b", 3e4), rounds=1)
    assert first.directions == second.directions == 2048


def test_what_a_call_costs_apart_from_its_directions_does_not_make_them_few(machine: Machine) -> None:
    plain, called = machine.form("a", 1000.0), machine.form("b", 1000.0)

    def with_overhead(wi: Any, wr: Any) -> Any:
        machine.now += 1e-3
        return plain.evaluate(wi, wr)

    alike, other = machine.times(called, replace(plain, evaluate=with_overhead), rounds=1)
    assert other.directions == alike.directions


def test_short_calls_of_one_direction_are_repeated_until_the_clock_can_tell(machine: Machine) -> None:
    (short,) = machine.times(machine.form("a", 1e4), most=1, rounds=1)  # 10 us
    assert short.directions == 1
    assert {count for _, count in machine.calls} == {1}
    assert len(machine.calls) > 20
    np.testing.assert_allclose(short.quartiles_ns, 1e4)


def test_materials_in_turn_read_memory_of_their_own(machine: Machine) -> None:
    table = replace(machine.form("a", 1.0), copied=machine.copied)
    found, plain = machine.mixed_times(table, machine.form("b", 20.0), rounds=3)
    np.testing.assert_allclose(found.quartiles_ns, 10.0)
    np.testing.assert_allclose(plain.quartiles_ns, 20.0)
    assert found.directions == timing.FEW
    assert machine.copies == timing.MATERIALS
    turns = [key for key, count in machine.calls if key.startswith("copy") and count == timing.FEW][timing.MATERIALS :]
    first, second = turns[: timing.MATERIALS], turns[timing.MATERIALS : 2 * timing.MATERIALS]
    assert sorted(first) == sorted(second) == sorted(f"copy {number + 1}" for number in range(machine.copies))
    assert first != second  # the order is drawn anew


def test_large_tables_are_copied_as_often_as_memory_allows(machine: Machine) -> None:
    machine.mixed_times(
        replace(machine.form("a", 1.0), bytes=timing._COPIES_BYTES // 4, copied=machine.copied), rounds=1
    )
    assert machine.copies == 4


def test_a_copy_of_a_table_has_the_same_values_in_other_memory() -> None:
    forms = {form.key: form for form in catalogue.forms(presets()["rolled-brass"], None, (0.1,))}
    table = forms["table-10"]
    assert table.copied is not None
    np.testing.assert_array_equal(table.copied()(WI, WI), table.evaluate(WI, WI))
    assert table.copied() is not table.copied()
    assert all((form.copied is None) == (form.kind != "table") for form in forms.values())


def test_forms_take_turns(machine: Machine) -> None:
    ticks: list[float] = []
    machine.times(machine.form("a", 1e6), machine.form("b", 2e6), rounds=3, tick=lambda: ticks.append(machine.now))
    turns = [key for key, count in machine.calls if count > 1][-6:]
    assert turns == ["a", "b"] * 3
    assert len(ticks) == 3


def test_quartiles_show_the_spread() -> None:
    times_of = timing.Times(1e-9 * np.array([1.0, 2.0, 3.0, 4.0, 50.0]), 7)
    np.testing.assert_allclose(times_of.quartiles_ns, [2.0, 3.0, 4.0])


def costs(*medians: float) -> Any:
    """Four rounds in which everything is slower by turns, each form alike."""
    return np.array([1.0, 3.0, 1.5, 1.2])[:, np.newaxis] * np.array(medians)


def test_a_step_down_the_front_is_clearly_cheaper() -> None:
    # Errors and costs of forms, and the expected front
    cases: list[tuple[list[float], tuple[float, ...], list[int]]] = [
        ([0.0, 0.1, 0.01], (100.0, 50.0, 20.0), [0, 2]),  # the second is worse and dearer
        ([0.3, 0.1, 0.0], (1.0, 10.0, 100.0), [2, 1, 0]),
        ([0.0, 0.1], (1.01 * CHEAPER, 1.0), [0, 1]),
        ([0.0, 0.1], (0.99 * CHEAPER, 1.0), [0]),
        ([0.0, 0.1], (0.5, 1.0), [0]),
        # Of two that are as accurate the clearly cheaper one
        ([0.0, 0.100, 0.105], (100.0, 50.0, 5.0), [0, 2]),
        ([0.0, 0.100, 0.115], (100.0, 50.0, 5.0), [0, 1, 2]),
        # Of equals the first, whatever the clock says
        ([0.0, 0.1, 0.1], (9.0, 1.0, 0.95), [0, 1]),
        ([0.0, 0.1, 0.1], (9.0, 0.95, 1.0), [0, 1]),
        # The third is hardly cheaper than the second, but clearly so than the first
        ([0.0, 0.1, 0.2], (1.3, 1.1, 1.0), [0, 2]),
    ]
    for errors, medians, expected in cases:
        assert front(errors, costs(*medians)) == expected, (errors, medians)
    assert front([0.0, 0.1, 0.2], np.array([[100.0, 1000.0, 10.0]])) == [0, 2]  # one round is enough without scatter


def test_what_scatters_more_than_it_saves_is_not_on_the_front() -> None:
    steady, scattered = np.full(8, 2.0), np.array([1.0, 1.0, 1.0, 1.0, 1.0, 4.0, 4.0, 4.0])
    assert np.median(steady / scattered) > CHEAPER
    assert front([0.0, 0.1], np.stack([steady, scattered], axis=1)) == [0]


def test_a_slow_round_slows_all_and_changes_nothing() -> None:
    medians = [100.0, 70.0, 20.0, 19.0]
    quiet = np.tile(medians, (8, 1))
    noisy = quiet * np.array([1.0, 9.0, 1.0, 2.0, 5.0, 1.0, 3.0, 7.0])[:, np.newaxis]
    errors = [0.0, 0.01, 0.1, 0.2]
    assert front(errors, noisy) == front(errors, quiet) == [0, 1, 2]
