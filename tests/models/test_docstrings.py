"""The docstrings of the public functions: their examples run, and they state what they take, return and cite."""

import doctest
import inspect
import re
from collections.abc import Callable
from typing import Any

import pytest

from brdfdb import models
from brdfdb.models import stub

ANGLES = ("theta_i", "phi_i", "theta_r", "phi_r")
TWINS = [name for name in models.__all__ if name.endswith("_vectors")]
FUNCTIONS = [getattr(models, name) for name in models.__all__ if name not in ("MODELS", *TWINS)]


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: f.__name__)
def test_the_examples_of_the_docstring_run(function: Callable[..., Any]) -> None:
    runner = doctest.DocTestRunner()
    found = doctest.DocTestFinder(recurse=False).find(function, globs=dict(vars(inspect.getmodule(function))))
    for example in found:
        runner.run(example)
    assert runner.summarize(verbose=False).failed == 0
    assert runner.tries >= 1


def test_docstrings_have_their_sections_and_name_every_argument() -> None:
    for function in FUNCTIONS:
        document = inspect.getdoc(function)
        assert document is not None
        for section in ("Parameters", "Returns", "Raises", "References", "Examples"):
            assert f"\n{section}\n{'-' * len(section)}\n" in document, (function, section)
        for name in inspect.signature(function).parameters:
            assert re.search(rf"\b{name}\b", document), (function, name)
        keys = document.split("References\n----------\n")[1].partition("\n\n")[0]
        assert re.match(r"[a-z]+\d{4}\b", keys), function


def test_every_function_of_directions_has_a_twin_with_the_same_parameters() -> None:
    for function in FUNCTIONS:
        by_angles = inspect.signature(function).parameters
        if "theta_i" not in by_angles:
            continue  # of a facet alone
        twin = getattr(models, f"{function.__name__}_vectors")
        by_vectors = inspect.signature(twin).parameters
        angles = [name for name in by_angles if name in ANGLES]
        assert angles in ([*ANGLES], ["theta_i"])
        vectors = ["wi", "wr"] if angles == [*ANGLES] else ["wi"]
        assert [*by_vectors] == [*vectors, *[*by_angles][len(angles) :]]
        assert [*by_vectors.values()][len(vectors) :] == [*by_angles.values()][len(angles) :]
        arguments = "`wi` (light) and `wr` (viewer)" if len(vectors) == 2 else "`wi` (light)"
        first = rf"Return `{function.__name__}` \[1(/sr)?\] for unit vectors {re.escape(arguments)} of shape"
        assert re.match(first, inspect.getdoc(twin) or ""), twin


def test_the_stub_has_the_signatures_of_the_models() -> None:
    assert stub.PATH.read_text(encoding="utf-8") == stub.stub(), "run python -m brdfdb.models.stub"
