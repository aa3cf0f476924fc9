"""Cost of forms: their times, taken in turns, warm or with many materials in turn; and the front worth having."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.forms.catalogue import Form
from brdfdb.parameters import Floats

BATCH = 100_000  # directions at once, of forms that are fast enough
RUN_S = 0.125  # longest turn of a form [s]; slower forms get fewer directions
ROUNDS = 7
MIXED_ROUNDS = 5
CHEAPER = 1.25  # times as cheap is clearly cheaper, in three of four rounds
ALIKE = 1.1  # times the error is about the same error
# Directions at once: steps so wide that a form, however busy the machine, is timed at the same one every time
_STEPS = (256, 2048, 16384, BATCH)
_VALUES = 1_000_000  # at once, at most
_TRIES = 5  # how often a form is asked what one direction more costs
_LEAST_S = 3e-4  # of a turn of few directions, which are repeated: the clock of the processor takes a microsecond
MATERIALS = 64  # that take turns, of as many tables as `_COPIES_BYTES` hold
FEW = 32  # directions of a material at once, where materials take turns
_COPIES_BYTES = 128_000_000
_SEED = 1992
_CACHE_BYTES = 48_000_000  # written between rounds: more than the last cache of one processor holds


class Times(NamedTuple):
    """How long an evaluation takes: seconds a value of f_r, shape (rounds,), and at how many directions at once."""

    seconds: NDArray[np.float64]
    directions: int

    @property
    def quartiles_ns(self) -> tuple[float, float, float]:
        """Lower quartile, median and upper quartile [ns a value]."""
        low, middle, high = np.percentile(1e9 * self.seconds, [25.0, 50.0, 75.0]).tolist()
        return low, middle, high


def times(
    forms: Sequence[Form],
    wi: Floats,
    wr: Floats,
    *,
    most: int = BATCH,
    rounds: int = ROUNDS,
    clock: Callable[[], float] = time.process_time,
    tick: Callable[[], None] = lambda: None,
) -> list[Times]:
    """Time forms in turns: what slows the machine down slows all of them down, and ratios within a round keep.

    Times are those of the processor, which other programs on the machine do not lengthen. Few directions are evaluated
    again and again, so that a turn lasts long enough for the clock.

    Parameters
    ----------
    forms : sequence of Form
        What to time, on one thread.
    wi, wr : arrays of shape (N, 3)
        Unit vectors to evaluate at, repeated or cut off as needed.
    most : int
        Directions at once; fewer where they take longer than `RUN_S` or are a million values. 1 for single evaluations
        from Python.
    rounds : int
        How often each form has its turn.
    clock, tick : callables
        Gives seconds; is called after every round.

    Returns
    -------
    list of Times
        In the order of the forms.
    """
    runs = []
    for form, count in zip(forms, _counts(forms, wi, wr, most, clock), strict=True):
        light, viewer = _directions(form, wi, wr, count)
        values = form.evaluate(light, viewer).size  # compiled, and its memory at hand
        start = clock()
        form.evaluate(light, viewer)
        repeats = int(min(max(_LEAST_S / max(clock() - start, 1e-9), 1.0), 100.0))
        runs.append((form.evaluate, light, viewer, repeats, values))
    taken = np.empty((rounds, len(runs)))
    for row in taken:
        for number, (evaluate, light, viewer, repeats, values) in enumerate(runs):
            evaluate(light[:1], viewer[:1])  # warm the instruction cache, as for the other forms
            start = clock()
            for _ in range(repeats):
                evaluate(light, viewer)
            row[number] = (clock() - start) / (repeats * values)
        tick()
    return [Times(seconds, len(run[1])) for run, seconds in zip(runs, taken.T, strict=True)]


def mixed_times(
    forms: Sequence[Form],
    wi: Floats,
    wr: Floats,
    *,
    rounds: int = MIXED_ROUNDS,
    clock: Callable[[], float] = time.process_time,
) -> list[Times]:
    """Time forms as a renderer with many materials uses them: few directions of one, then of another, nothing cached.

    Parameters
    ----------
    forms : sequence of Form
        To time, on one thread.
    wi, wr : arrays of shape (N, 3)
        Unit vectors to evaluate at, repeated or cut off as needed.
    rounds : int
        Number of turns of each form.
    clock : callable
        Gives seconds.

    Returns
    -------
    list of Times
        In the order of the forms, of `FEW` directions a call.

    Notes
    -----
    In a turn, `MATERIALS` materials of the form are evaluated once each, in an order that is drawn anew. Tables are
    copies with memory of their own, of large ones fewer than `MATERIALS`. Before a turn, more memory is written than
    the caches hold, so that each table is read from memory.
    """
    rng = np.random.default_rng(_SEED)
    evict = np.zeros(_CACHE_BYTES // 8)
    count = FEW * MATERIALS
    taken = np.empty((rounds, len(forms)))
    for number, form in enumerate(forms):
        light, viewer = _directions(form, wi, wr, count)
        copies = 1 if form.copied is None else int(min(max(_COPIES_BYTES // form.bytes, 2), MATERIALS))
        evaluates = [form.evaluate] if form.copied is None else [form.copied() for _ in range(copies)]
        values = sum(evaluate(light[:FEW], viewer[:FEW]).size for evaluate in evaluates) // len(evaluates)
        for row in range(rounds):
            evict += 1.0
            order = rng.permutation(max(len(evaluates), MATERIALS)) % len(evaluates)
            evaluates[order[-1]](light[:1], viewer[:1])  # warm the instruction cache
            start = clock()
            for turn, which in enumerate(order[:MATERIALS].tolist()):
                rows = slice(turn * FEW, (turn + 1) * FEW)
                evaluates[which](light[rows], viewer[rows])
            taken[row, number] = (clock() - start) / (MATERIALS * values)
    return [Times(seconds, FEW) for seconds in taken.T]


def _directions(form: Form, wi: Floats, wr: Floats, count: int) -> tuple[Floats, Floats]:
    return np.resize(wi, (count, 3)).astype(form.dtype), np.resize(wr, (count, 3)).astype(form.dtype)


def _counts(forms: Sequence[Form], wi: Floats, wr: Floats, most: int, clock: Callable[[], float]) -> list[int]:
    """Return the number of directions at which each form is timed: the largest step that fits."""
    if most <= _STEPS[0]:
        return [most] * len(forms)
    few, more = _STEPS[0], 4 * _STEPS[0]
    wavelengths = [0] * len(forms)
    shortest = np.full((len(forms), 2), np.inf)
    for _ in range(_TRIES):  # in turns, too: one busy moment makes no form slow
        for number, form in enumerate(forms):
            for which, count in enumerate((few, more)):
                light, viewer = _directions(form, wi, wr, count)
                start = clock()
                wavelengths[number] = form.evaluate(light, viewer).size // count
                shortest[number, which] = min(shortest[number, which], clock() - start)
    another = (shortest[:, 1] - shortest[:, 0]) / (more - few)  # of few, most may be the call
    return [
        min(most, max((s for s in _STEPS if s * seconds <= RUN_S and s * values <= _VALUES), default=few))
        for seconds, values in zip(another.tolist(), wavelengths, strict=True)
    ]


def clearly_cheaper(costs: Floats, one: int, other: int) -> bool:
    """Return whether one form is `CHEAPER` times as cheap as another in three of four rounds.

    `costs` has the shape (rounds, forms).
    """
    return bool(np.percentile(costs[:, other] / costs[:, one], 25.0) >= CHEAPER)


def front(errors: Sequence[float], costs: Floats) -> list[int]:
    """Return the forms worth having, from the most accurate one down, each clearly cheaper than the one before.

    Parameters
    ----------
    errors : sequence of float
        Of each form.
    costs : array of shape (rounds, forms)
        Of each form in each round; one round of costs that do not scatter.

    Returns
    -------
    list of int
        Indices. What is less accurate has to be `CHEAPER` times as cheap in three of four rounds. Of two neighbours
        whose errors are within `ALIKE` of each other, the cheaper one stays. So neither the noise of a clock nor a
        hair's breadth of error decides who is on the front; of equals it is the one given first.
    """
    chosen: list[int] = []
    for one in sorted(range(len(errors)), key=lambda index: errors[index]):
        if chosen and not clearly_cheaper(costs, one, chosen[-1]):
            continue
        if chosen and errors[one] <= ALIKE * errors[chosen[-1]]:
            chosen.pop()
        chosen.append(one)
    return chosen
