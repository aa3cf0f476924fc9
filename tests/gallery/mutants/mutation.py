"""Named wrong models, their planting in place of the right ones, and the statements that notice them."""

from __future__ import annotations

import sys
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache, wraps
from types import ModuleType
from typing import Any, ClassVar, NamedTuple

import numpy as np

from brdfdb.gallery import GALLERY
from brdfdb.models import MODELS

# First words of `Statement.threshold_from`, and their meanings
BASES = {
    "the paper's words": "a word of the sentence sets the threshold, such as *increases* or *exactly*",
    "the paper's number": "a number that the paper prints, within its digits",
    "the paper's curve": "a feature of a curve of the paper",
    "our reading": "the sentence has a word such as *nearly*, and we state the number that we take it for",
    "a limit": "the limit of the equations",
    "a closed form": "equations of the paper by hand, which share no code with the models",
    "conservation": "light that is neither made nor lost",
    "an independent evaluation": "the same quantity by other means: a plain sum, rays, random directions, 50 digits",
}

UNDRAWN = "the figure can be drawn"
_UNTOUCHED = ("brdfdb.reference", "brdfdb.misprints")  # These modules judge the models and are no part of them


Function = Callable[..., Any]


@dataclass(frozen=True)
class Mutant:
    """A wrong model: functions of `brdfdb` with the wrong functions that take their places."""

    name: str
    changes: str
    because: str
    functions: Mapping[Function, Function]


@contextmanager
def planted(mutant: Mutant) -> Iterator[None]:
    """Put the wrong functions of a mutant wherever `brdfdb` or its registry of models names the right ones.

    Raises
    ------
    LookupError
        If no module names a function that the mutant replaces.
    """
    places = [
        (vars(module), name, mutant.functions[value])
        for title, module in list(sys.modules.items())
        if title.split(".")[0] == "brdfdb" and not title.startswith(_UNTOUCHED)
        for name, value in list(vars(module).items())
        if callable(value) and isinstance(value, Hashable) and value in mutant.functions
    ]
    missed = set(mutant.functions.values()) - {wrong for _, _, wrong in places}
    if missed:
        raise LookupError(f"{mutant.name}: no module of brdfdb names the functions that {missed} replaces")
    for right, wrong in mutant.functions.items():
        if hasattr(right, "vectors") and not hasattr(wrong, "vectors"):
            wrong.vectors = mutant.functions.get(right.vectors, right.vectors)
    before = [(space, name, space[name]) for space, name, _ in places]
    specs = dict(MODELS)
    try:
        for space, name, wrong in places:
            space[name] = wrong
        for key, spec in specs.items():
            fields = {name: getattr(spec, name) for name in ("evaluate", "vectors", "specular")}
            wrong_fields = {name: mutant.functions[f] for name, f in fields.items() if f in mutant.functions}
            MODELS[key] = replace(spec, **wrong_fields)
        yield
    finally:
        for space, name, right in before:
            space[name] = right
        MODELS.update(specs)


class Sentence(NamedTuple):
    """A statement by its figure and its words."""

    figure: str
    says: str


class Matrix(NamedTuple):
    """The statements of a paper that hold, and by mutant those that do not hold with it."""

    holding: frozenset[Sentence]
    noticed: dict[str, frozenset[Sentence]]

    @property
    def blind(self) -> list[Sentence]:
        """The statements that hold with every mutant."""
        return sorted(self.holding - frozenset().union(*self.noticed.values()))

    @property
    def overlooked(self) -> list[str]:
        """The mutants that fewer than two statements notice."""
        return [name for name, failing in self.noticed.items() if len(failing) < 2]

    def __str__(self) -> str:
        lines = [f"{len(self.holding)} statements hold. Statements that notice a mutant:"]
        lines += [f"{len(failing):6d}  {name}" for name, failing in self.noticed.items()]
        lines += [f"fails for no mutant: {sentence.figure}: {sentence.says}" for sentence in self.blind]
        return "\n".join(lines)


def verdicts(keys: Sequence[str]) -> dict[Sentence, bool]:
    """Return whether the statements of figures hold; a figure that cannot be drawn is one statement that does not.

    Raises
    ------
    ValueError
        If two statements of a figure have the same words.
    """
    verdict: dict[Sentence, bool] = {}
    for key in keys:
        try:
            statements = GALLERY[key]().statements
        except ArithmeticError:  # A lobe of 0 has no height to divide by
            verdict[Sentence(key, UNDRAWN)] = False
            continue
        for statement in statements:
            if Sentence(key, statement.says) in verdict:
                raise ValueError(f"{key}: two statements have the same words: {statement.says}")
            verdict[Sentence(key, statement.says)] = statement.holds
    return verdict


class Baseline(NamedTuple):
    """The figures of the right models: the statements that hold, and the functions that each figure calls."""

    holding: frozenset[Sentence]
    calls: dict[str, set[Function]]


def baseline_of(keys: Sequence[str], mutants: Iterable[Mutant]) -> Baseline:
    """Draw figures with the right models, and record which functions that mutants replace each figure calls."""
    called: set[Function] = set()

    def recorded(right: Function) -> Function:
        @wraps(right)
        def call(*arguments: Any, **options: Any) -> Any:
            called.add(right)
            return right(*arguments, **options)

        return call

    functions = {right: recorded(right) for mutant in mutants for right in mutant.functions}
    holding: set[Sentence] = set()
    calls: dict[str, set[Function]] = {}
    with planted(Mutant("none", "nothing", "calls are recorded", functions)):
        for key in keys:
            called.clear()
            holding.update(sentence for sentence, holds in verdicts([key]).items() if holds)
            calls[key] = set(called)
    return Baseline(frozenset(holding), calls)


def noticing(baseline: Baseline, mutant: Mutant, keys: Iterable[str] | None = None) -> frozenset[Sentence]:
    """Draw the figures that a mutant touches, and return the statements that hold with the right models alone.

    All figures are drawn, or those of `keys`.
    """
    among = baseline.calls if keys is None else keys
    touched = [key for key in among if baseline.calls[key] & mutant.functions.keys()]
    if not touched:
        return frozenset()
    with planted(mutant), np.errstate(all="ignore"):
        wrong = verdicts(touched)
    undrawn = {sentence for sentence in wrong if sentence.says == UNDRAWN}
    return frozenset(sentence for sentence in baseline.holding if not wrong.get(sentence, True)) | undrawn


class Unseen(NamedTuple):
    """The statements that hold with every mutant, and the mutants that fewer than two statements notice."""

    blind: set[Sentence]
    overlooked: list[str]


def unseen_of(baseline: Baseline, mutants: Sequence[Mutant]) -> Unseen:
    """Return what `Matrix` calls blind and overlooked, without the figures that can change neither.

    A figure is drawn with a mutant if one of its statements holds with every mutant so far, or while fewer than two
    statements notice the mutant. The order changes the time and not the result: the last mutants of the lists touch
    few figures, decide most of them, and take the least time.
    """
    blind, overlooked = set(baseline.holding), []
    for mutant in reversed(mutants):
        undecided = {sentence.figure for sentence in blind}
        failing: set[Sentence] = set()
        for key in sorted(baseline.calls, key=lambda key: key not in undecided):
            if key in undecided or len(failing) < 2:
                failing |= noticing(baseline, mutant, [key])
        blind -= failing
        if len(failing) < 2:
            overlooked.append(mutant.name)
    return Unseen(blind, overlooked)


def matrix_of(keys: Sequence[str], mutants: Sequence[Mutant]) -> Matrix:
    """Compute figures by the right models, and the figures that a mutant touches by every wrong model."""
    baseline = baseline_of(keys, mutants)
    return Matrix(baseline.holding, {mutant.name: noticing(baseline, mutant) for mutant in mutants})


class MutantTests:
    """The tests of the mutants of a paper; a subclass names the module with these mutants and their right twins."""

    paper: ClassVar[ModuleType]

    @classmethod
    @cache
    def baseline(cls) -> Baseline:
        """Return the statements that hold, and what each figure calls."""
        keys = [key for key in GALLERY if key.startswith(cls.paper.PREFIX)]
        return baseline_of(keys, [*cls.paper.MUTANTS, *cls.paper.UNCHANGED])

    @classmethod
    @cache
    def unseen(cls) -> Unseen:
        """Return the statements that never fail, and the mutants that nothing notices."""
        return unseen_of(cls.baseline(), cls.paper.MUTANTS)

    @classmethod
    @cache
    def matrix(cls) -> Matrix:
        """Return the statements that notice each mutant: the whole list, for a test that failed."""
        noticed = {mutant.name: noticing(cls.baseline(), mutant) for mutant in cls.paper.MUTANTS}
        return Matrix(cls.baseline().holding, noticed)

    def test_the_twins_that_mutants_change_are_the_models(self) -> None:
        for twin in self.paper.UNCHANGED:
            assert any(called & twin.functions.keys() for called in self.baseline().calls.values())
            assert not noticing(self.baseline(), twin)

    def test_every_statement_fails_for_a_wrong_model(self) -> None:
        assert not self.unseen().blind, str(self.matrix())

    def test_every_wrong_model_is_noticed_by_two_statements(self) -> None:
        assert not self.unseen().overlooked, str(self.matrix())
