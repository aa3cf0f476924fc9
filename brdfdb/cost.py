"""What a form costs: its time, taken in turns with its rivals; and the front of those that are worth having."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brdfdb.parameters import Floats
from brdfdb.representations import Representation

BATCH = 100_000  # directions at once, of forms that are fast enough
RUN_S = 0.03  # what a run of a slower form may take
ROUNDS = 15
CHEAPER = 1.25  # times as cheap is clearly cheaper, in three of four rounds
ALIKE = 1.1  # times the error is about the same error
_TRIED, _TRIES = 64, 3  # directions that say how many fit into a run, and how often they are asked


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
    forms: Sequence[Representation],
    wi: Floats,
    wr: Floats,
    *,
    most: int = BATCH,
    rounds: int = ROUNDS,
    clock: Callable[[], float] = time.perf_counter,
    tick: Callable[[], None] = lambda: None,
) -> list[Times]:
    """Time forms in turns: what slows the machine down slows all of them down, and ratios within a round keep.

    Parameters
    ----------
    forms : sequence of Representation
        What to time, on one thread.
    wi, wr : arrays of shape (N, 3)
        Unit vectors to evaluate at, repeated or cut off as needed.
    most : int
        Directions at once; fewer where they take longer than `RUN_S`. 1 for single evaluations from Python.
    rounds : int
        How often each form has its turn.
    clock, tick : callables
        Gives seconds; is called after every round.

    Returns
    -------
    list of Times
        In the order of the forms.
    """
    runs = [_run(form, wi, wr, most, clock) for form in forms]
    taken = np.empty((rounds, len(runs)))
    for row in taken:
        for number, (evaluate, light, viewer) in enumerate(runs):
            evaluate(light[:1], viewer[:1])  # its code is in the processor's cache again: that of rivals alike is, too
            start = clock()
            evaluate(light, viewer)
            row[number] = clock() - start
        tick()
    found = []
    for (evaluate, light, viewer), seconds in zip(runs, taken.T, strict=True):
        values = evaluate(light[:1], viewer[:1]).size * len(light)
        found.append(Times(seconds / values, len(light)))
    return found


def _run(
    form: Representation, wi: Floats, wr: Floats, most: int, clock: Callable[[], float]
) -> tuple[Callable[[Floats, Floats], Floats], Floats, Floats]:
    """What a turn of a form is: its function, and as many directions as fit."""

    def directions(count: int) -> tuple[Floats, Floats]:
        return np.resize(wi, (count, 3)).astype(form.dtype), np.resize(wr, (count, 3)).astype(form.dtype)

    count = min(_TRIED, most)
    while count < most:
        light, viewer = directions(count)
        form.evaluate(light, viewer)  # compiled, and its memory at hand
        taken = []
        for _ in range(_TRIES):
            start = clock()
            form.evaluate(light, viewer)
            taken.append(clock() - start)
        room = RUN_S / max(min(taken), 1e-9)
        if room < 2.0:
            break
        count = min(most, int(count * min(room, 16.0)))  # the overhead of a call makes few directions look slow
    light, viewer = directions(count)
    form.evaluate(light, viewer)
    return form.evaluate, light, viewer


def front(errors: Sequence[float], costs: Floats) -> list[int]:
    """The forms worth having, from the most accurate one down, each clearly cheaper than the one before.

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
        if chosen and np.percentile(costs[:, chosen[-1]] / costs[:, one], 25.0) < CHEAPER:
            continue
        if chosen and errors[one] <= ALIKE * errors[chosen[-1]]:
            chosen.pop()
        chosen.append(one)
    return chosen
