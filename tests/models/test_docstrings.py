"""The docstrings of public functions: their examples run. The stub for editors has the signatures of the models."""

import doctest
import inspect
from collections.abc import Callable
from typing import Any

import pytest

from brdfdb import models, roughness
from brdfdb.integrals.sampling import pdf, sample
from brdfdb.integrals.uniform_bound import largest_uniform
from brdfdb.models import stub

OF_MODELS = [getattr(models, name) for name in models.__all__ if name != "MODELS" and not name.endswith("_vectors")]
OF_ROUGHNESS = [
    function
    for function in vars(roughness).values()
    if inspect.isfunction(function) and function.__module__ == roughness.__name__
]


@pytest.mark.parametrize(
    "function", [*OF_MODELS, *OF_ROUGHNESS, sample, pdf, largest_uniform], ids=lambda function: function.__name__
)
def test_the_examples_of_the_docstring_run(function: Callable[..., Any]) -> None:
    runner = doctest.DocTestRunner()
    found = doctest.DocTestFinder(recurse=False).find(function, globs=dict(vars(inspect.getmodule(function))))
    for example in found:
        runner.run(example)
    assert runner.summarize(verbose=False).failed == 0
    assert runner.tries >= 1


def test_the_stub_has_the_signatures_of_the_models() -> None:
    assert stub.PATH.read_text(encoding="utf-8") == stub.stub(), "run python -m brdfdb.models.stub"
