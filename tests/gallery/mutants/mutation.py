"""Named wrong models, how one takes the place of the right model, and which statements of the gallery notice it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import wraps
from typing import Any, NamedTuple

import numpy as np

from brdfdb.gallery import GALLERY
from brdfdb.models import MODELS

# What `Statement.threshold_from` begins with, and its meaning
BASES = {
    "the paper's words": "a word of the sentence sets the threshold, as *increases* or *exactly* do",
    "the paper's number": "a number that the paper prints, within the digits that it has",
    "the paper's curve": "a feature of a curve of the paper",
    "our reading": "the sentence has a word like *nearly*, and we say which number we take it for",
    "a limit": "what the equations tend to",
    "a closed form": "equations of the paper by hand, which share no code with the models",
    "conservation": "light that is neither made nor lost",
    "an independent evaluation": "the same quantity by other means: a plain sum, rays, random directions, 50 digits",
}

UNDRAWN = "the figure can be drawn"
_UNTOUCHED = ("brdfdb.reference", "brdfdb.misprints")  # they judge the models, and are no part of them


Function = Callable[..., Any]


@dataclass(frozen=True)
class Mutant:
    """A wrong model: functions of `brdfdb`, each with the wrong one that takes its place."""

    name: str
    changes: str
    because: str
    functions: Mapping[Function, Function]


@contextmanager
def planted(mutant: Mutant) -> Iterator[None]:
    """Put the wrong functions of a mutant wherever `brdfdb`, or its registry of models, names the right ones.

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
        if callable(value) and _hashable(value) and value in mutant.functions
    ]
    missed = set(mutant.functions.values()) - {wrong for _, _, wrong in places}
    if missed:
        raise LookupError(f"{mutant.name}: no module of brdfdb names what {missed} takes the place of")
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


def _hashable(value: object) -> bool:
    return type(value).__hash__ is not None


class Said(NamedTuple):
    """A statement by its figure and its words."""

    figure: str
    says: str


class Matrix(NamedTuple):
    """The statements of a paper that hold, and of each mutant those that do not hold with it."""

    holding: frozenset[Said]
    noticed: dict[str, frozenset[Said]]

    @property
    def blind(self) -> list[Said]:
        """The statements that hold whatever is wrong."""
        return sorted(self.holding - frozenset().union(*self.noticed.values()))

    @property
    def overlooked(self) -> list[str]:
        """The mutants that fewer than two statements notice."""
        return [name for name, failing in self.noticed.items() if len(failing) < 2]

    def __str__(self) -> str:
        lines = [f"{len(self.holding)} statements hold; of them notice"]
        lines += [f"{len(failing):6d}  {name}" for name, failing in self.noticed.items()]
        lines += [f"fails for no mutant: {said.figure}: {said.says}" for said in self.blind]
        return "\n".join(lines)


def verdicts(keys: Sequence[str]) -> dict[Said, bool]:
    """Return which statements of some figures hold; a figure that cannot be drawn is one statement, and does not.

    Raises
    ------
    ValueError
        If two statements of a figure have the same words.
    """
    found: dict[Said, bool] = {}
    for key in keys:
        try:
            statements = GALLERY[key]().statements
        except ArithmeticError:  # a lobe of 0 has no height to be divided by
            found[Said(key, UNDRAWN)] = False
            continue
        for each in statements:
            if Said(key, each.says) in found:
                raise ValueError(f"{key}: two statements have the same words: {each.says}")
            found[Said(key, each.says)] = each.holds
    return found


def calls_of(keys: Sequence[str], functions: Iterable[Function]) -> dict[str, set[Function]]:
    """Return which of some functions each figure calls: no other figure changes with a mutant of them."""
    called: set[Function] = set()

    def recorded(right: Function) -> Function:
        @wraps(right)
        def call(*arguments: Any, **options: Any) -> Any:
            called.add(right)
            return right(*arguments, **options)

        return call

    found: dict[str, set[Function]] = {}
    with planted(Mutant("none", "nothing", "calls are recorded", {right: recorded(right) for right in functions})):
        for key in keys:
            called.clear()
            GALLERY[key]()
            found[key] = set(called)
    return found


def matrix_of(keys: Sequence[str], mutants: Sequence[Mutant]) -> Matrix:
    """Compute some figures by the right models, and those that a mutant touches by each wrong one."""
    holding = frozenset(said for said, holds in verdicts(keys).items() if holds)
    calls = calls_of(keys, {right for mutant in mutants for right in mutant.functions})
    noticed: dict[str, frozenset[Said]] = {}
    for mutant in mutants:
        touched = [key for key in keys if calls[key] & mutant.functions.keys()]
        with planted(mutant), np.errstate(all="ignore"):
            wrong = verdicts(touched)
        undrawn = {said for said in wrong if said.says == UNDRAWN}
        noticed[mutant.name] = frozenset(said for said in holding if not wrong.get(said, True)) | undrawn
    return Matrix(holding, noticed)
