"""The docstrings of the public functions: their examples run, and they state what they take, return and cite."""

import doctest
import inspect
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from brdfdb import models
from brdfdb.models import MODELS, he_torrance_1991
from brdfdb.parameters import ModelSpec, Parameter

HALF_PI = np.pi / 2
ANGLES = ("theta_i", "phi_i", "theta_r", "phi_r")
TWINS = [name for name in models.__all__ if name.endswith("_vectors")]
FUNCTIONS = [getattr(models, name) for name in models.__all__ if name not in ("MODELS", *TWINS)]
# functions of angles of a facet alone have no twin
OF_DIRECTIONS = [function for function in FUNCTIONS if "theta_i" in inspect.signature(function).parameters]


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: f.__name__)
def test_the_examples_of_the_docstring_run(function: Callable[..., Any]) -> None:
    runner = doctest.DocTestRunner()
    found = doctest.DocTestFinder(recurse=False).find(function, globs=dict(vars(inspect.getmodule(function))))
    for example in found:
        runner.run(example)
    assert runner.summarize(verbose=False).failed == 0
    assert runner.tries >= 1


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: f.__name__)
def test_the_docstring_has_its_sections(function: Callable[..., Any]) -> None:
    document = inspect.getdoc(function)
    assert document is not None
    for section in ("Parameters", "Returns", "Raises", "References", "Examples"):
        assert f"\n{section}\n{'-' * len(section)}\n" in document, section
    for name in inspect.signature(function).parameters:
        assert re.search(rf"\b{name}\b", document), name


@pytest.mark.parametrize("function", OF_DIRECTIONS, ids=lambda f: f.__name__)
def test_every_function_has_a_twin_of_unit_vectors(function: Callable[..., Any]) -> None:
    assert f"{function.__name__}_vectors" in TWINS


@pytest.mark.parametrize("name", TWINS)
def test_the_docstring_of_a_twin_names_the_function_that_documents_its_parameters(name: str) -> None:
    original, twin = getattr(models, name.removesuffix("_vectors")), getattr(models, name)
    by_angles, by_vectors = inspect.signature(original).parameters, inspect.signature(twin).parameters
    angles = [each for each in by_angles if each in ANGLES]
    both = angles == [*ANGLES]
    assert both or angles == ["theta_i"]
    arguments = "`wi` (light) and `wr` (viewer)" if both else "`wi` (light)"
    first = rf"Return `{original.__name__}` (\[1(/sr)?\] )?for unit vectors {re.escape(arguments)} of shape \(..., 3\)"
    assert re.match(first, inspect.getdoc(twin) or "")
    vectors = ["wi", "wr"] if both else ["wi"]
    assert [*by_vectors] == [*vectors, *[*by_angles][len(angles) :]]
    assert [*by_vectors.values()][len(vectors) :] == [*by_angles.values()][len(angles) :]
    for each in vectors:
        assert by_vectors[each].kind is inspect.Parameter.POSITIONAL_OR_KEYWORD
        assert by_vectors[each].default is inspect.Parameter.empty


@pytest.mark.parametrize("spec", MODELS.values(), ids=MODELS)
def test_the_docstring_states_the_range_of_every_parameter(spec: ModelSpec) -> None:
    document = inspect.getdoc(spec.evaluate) or ""
    for parameter in spec.parameters:
        if parameter.high in (HALF_PI, np.pi):
            assert ("[0, pi/2]" if parameter.high == HALF_PI else "[0, pi]") in document
        elif not isinstance(parameter.default, bool):
            ends = rf"\[{re.escape(written(parameter.low))}, {re.escape(written(parameter.high))}\]"
            assert re.search(ends, document), parameter.name


def written(end: float) -> str:
    """A bound as the docstrings write it: 1e7, 1e-3."""
    if end and not 0.01 <= abs(end) < 1e4:
        return f"1e{round(np.log10(end))}"
    return f"{end:g}"


@pytest.mark.parametrize("parameter", [he_torrance_1991.WAVELENGTH_NM, he_torrance_1991.N, he_torrance_1991.K])
def test_the_docstring_states_the_ranges_of_what_comes_with_the_light(parameter: Parameter) -> None:
    document = inspect.getdoc(models.he_torrance) or ""
    assert f"[{written(parameter.low)}, {written(parameter.high)}]" in document
