"""Cost of forms: times of one material or of many in turn, and the front of forms worth having."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.forms.catalogue import Form
from brdfdb.parameters import Floats

BATCH = 100_000  # directions per call, for forms that are fast enough
RUN_S = 0.125  # longest turn of a form [s]; slower forms get fewer directions
ROUNDS = 7
MIXED_ROUNDS = 5
CHEAPER = 1.25  # ratio of costs, in three of four rounds, from which on a form is clearly cheaper
ALIKE = 1.1  # ratio of errors up to which two errors are about the same
# Choices of directions per call. The steps are so wide that a form gets the same number even on a busy machine
_STEPS = (256, 2048, 16384, BATCH)
_VALUES = 1_000_000  # largest number of values per call
_TRIES = 5  # measurements of the time per direction; the shortest one counts
_LEAST_S = 3e-4  # shortest turn [s]; calls with few directions are repeated, because the clock takes a microsecond
MATERIALS = 64  # materials that take turns, or as many tables as `_COPIES_BYTES` hold
FEW = 32  # directions per call where materials take turns
_COPIES_BYTES = 128_000_000  # most memory of the copies of a table
_SEED = 1992
_CACHE_BYTES = 48_000_000  # memory written between rounds: more than the last cache of one processor holds


class Quartiles(NamedTuple):
    """Lower quartile, median and upper quartile."""

    low: float
    middle: float
    high: float


def quartiles(values: NDArray[np.float64]) -> Quartiles:
    """Return the quartiles of values."""
    return Quartiles(*np.percentile(values, [25.0, 50.0, 75.0]).tolist())


class Times(NamedTuple):
    """Time of an evaluation: seconds per value of f_r, shape (rounds,), and the number of directions per call."""

    seconds: NDArray[np.float64]
    directions: int

    @property
    def quartiles_ns(self) -> Quartiles:
        """Lower quartile, median and upper quartile [ns per value]."""
        return quartiles(1e9 * self.seconds)


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
    """Measure the times of forms in turns, so that a busy machine slows all of them and ratios in a round stay right.

    Times are processor times on one thread, which other programs on the machine do not lengthen. A call with few
    directions is repeated, so that a turn lasts long enough for the clock. Unit vectors (N, 3) are repeated or cut off
    as needed, to `most` directions per call, or fewer where a call takes longer than `RUN_S` or gives more than a
    million values. 1 times single evaluations from Python. `clock()` gives the time in seconds. `tick` is called after
    every round.
    """
    runs = []
    for form, count in zip(forms, _counts(forms, wi, wr, most, clock), strict=True):
        light, viewer = _directions(form, wi, wr, count)
        values = form.evaluate(light, viewer).size  # the first call compiles kernels and allocates memory
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
    """Measure the times of forms with many materials in turn, `FEW` directions of each, with nothing cached.

    A renderer with many materials uses forms in this way. In a turn, `MATERIALS` materials of the form are evaluated
    once each, in a random order. Tables are copies with memory of their own. Large tables have fewer copies than
    `MATERIALS`. Before a turn, more memory is written than the caches hold, so that each table is read from memory.
    Arguments are those of `times`.
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
    for _ in range(_TRIES):  # forms take turns, so that a busy moment of the machine slows no single form
        for number, form in enumerate(forms):
            for which, count in enumerate((few, more)):
                light, viewer = _directions(form, wi, wr, count)
                start = clock()
                wavelengths[number] = form.evaluate(light, viewer).size // count
                shortest[number, which] = min(shortest[number, which], clock() - start)
    another = (shortest[:, 1] - shortest[:, 0]) / (more - few)  # a difference, since the call itself takes time
    return [
        min(most, max((s for s in _STEPS if s * seconds <= RUN_S and s * values <= _VALUES), default=few))
        for seconds, values in zip(another.tolist(), wavelengths, strict=True)
    ]


def clearly_cheaper(costs: Floats, one: int, other: int) -> bool:
    """Return True if one form is `CHEAPER` times as cheap as another in three of four rounds.

    `costs` has the shape (rounds, forms).
    """
    return bool(np.percentile(costs[:, other] / costs[:, one], 25.0) >= CHEAPER)


def front(errors: Sequence[float], costs: Floats) -> list[int]:
    """Return the forms worth having, from the most accurate one down, each clearly cheaper than the one before.

    `costs` (rounds, forms) may have one round if they do not scatter. A less accurate form must be `CHEAPER` times as
    cheap in three of four rounds. If the errors of two neighbours are within `ALIKE` of each other, the cheaper one
    stays. So neither the noise of a clock nor a tiny difference of errors decides. Of equal forms the first one is on
    the front.
    """
    chosen: list[int] = []
    for one in sorted(range(len(errors)), key=lambda index: errors[index]):
        if chosen and not clearly_cheaper(costs, one, chosen[-1]):
            continue
        if chosen and errors[one] <= ALIKE * errors[chosen[-1]]:
            chosen.pop()
        chosen.append(one)
    return chosen
