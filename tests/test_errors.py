"""Errors: one base class, fields that callers read, and what is left of them after another process raised them."""

from __future__ import annotations

import ast
import difflib
import importlib.metadata
import math
import pickle
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Literal
from unittest.mock import Mock

import pytest
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from brdfdb.errors import (
    BusyError,
    CannotHoldError,
    FileFormatError,
    MaterialError,
    MissingExtraError,
    ParameterError,
    StoreError,
    UnknownFamilyError,
    UnknownMaterialError,
    UnknownRevisionError,
    WriteError,
    counted,
    import_extra,
    install_command,
    sentence_of,
)
from brdfdb.parameters import Parameter
from brdfdb.scenes.choice import InfeasibleError
from brdfdb_pipelines.recipe_grids import RecipeError
from brdfdb_pipelines.scene_file import SceneError

RECIPE_ERROR = RecipeError("grids.isotropic.theta_i_deg", "must start at 0")
RECIPE_ERROR.file = "a.toml"
ERRORS = [
    ParameterError("tolerance", "2 is outside [0, 1]", 2.0, (0.0, 1.0)),
    MaterialError("foam", "rho", "2 is outside [0, 1]", 2.0, (0.0, 1.0)),
    InfeasibleError("tolerance", "1e-09 is finer than the truth is known", 1e-9),
    SceneError("spheres", "lights", "there is no light"),
    RECIPE_ERROR,
    StoreError("no store at a"),
    UnknownMaterialError("fome", ["foam", "brass"]),
    UnknownFamilyError("fome", ["foam"]),
    UnknownRevisionError("foam has no revision r000009"),
    WriteError("cannot write a.exr"),
    CannotHoldError("foam: the format is isotropic"),
    FileFormatError("a.bsdf: no format recognises it"),
    BusyError("another build is at work on foam"),
    MissingExtraError("uvicorn is not installed"),
]


def test_an_error_is_the_same_after_pickling() -> None:
    for error in ERRORS:
        copy = pickle.loads(pickle.dumps(error))
        assert type(copy) is type(error)
        assert str(copy) == str(error)
        assert vars(copy) == vars(error)


def test_an_error_of_another_process_keeps_its_fields() -> None:
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as executor:
        error = executor.submit(Parameter("rho", "rho", "1", 0.0, 1.0, "albedo").check, 2.0).exception()
    assert isinstance(error, ParameterError)
    assert str(error) == "rho: 2 is outside [0, 1]"
    assert (error.parameter, error.value, error.allowed) == ("rho", 2.0, (0.0, 1.0))


def test_every_error_of_the_packages_has_the_base_class() -> None:
    root = Path(__file__).parents[1]
    files = [path for folder in ("brdfdb", "pipelines", "api") for path in (root / folder).rglob("*.py")]
    classes = [
        node
        for path in files
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ClassDef)
    ]
    bases = {node.name: {ast.unparse(base).rpartition(".")[2] for base in node.bases} for node in classes}

    def derived(name: str) -> bool:
        return name == "BrdfdbError" or any(map(derived, bases.get(name, ())))

    errors = [name for name, names in bases.items() if any(base.endswith(("Error", "Exception")) for base in names)]
    assert len(errors) > 15
    assert [name for name in errors if not derived(name)] == []


def test_sentences_name_what_is_wrong() -> None:
    assert str(ERRORS[0]) == "tolerance: 2 is outside [0, 1]"
    assert str(ERRORS[1]) == "foam: rho: 2 is outside [0, 1]"
    assert str(RECIPE_ERROR) == "a.toml: grids.isotropic.theta_i_deg: must start at 0"
    assert str(SceneError("spheres", "", "is recorded")) == "spheres: is recorded"
    assert str(UnknownMaterialError("fome", ["foam", "brass"])) == "no material 'fome' in the store; closest: foam"
    assert [counted(number, "table") for number in (0, 1, 2)] == ["0 tables", "1 table", "2 tables"]
    assert issubclass(ParameterError, ValueError)
    assert issubclass(UnknownMaterialError, KeyError)
    assert issubclass(UnknownRevisionError, KeyError)


def test_a_module_of_an_extra_is_imported_or_named(monkeypatch: pytest.MonkeyPatch) -> None:
    assert import_extra("jinja2").__name__ == "jinja2"
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingExtraError, match=r"^distributed is not installed; .*\[dask\]'$"):
        import_extra("distributed")
    with pytest.raises(ModuleNotFoundError):
        import_extra("brdfdb.nowhere")


@pytest.mark.parametrize(
    ("origin", "command"),
    [
        ('{"url": "file:///my%20clone", "dir_info": {"editable": true}}', "pip install -e '/my clone[report]'"),
        ('{"url": "file:///a/brdfdb-1-py3-none-any.whl"}', "pip install '/a/brdfdb-1-py3-none-any.whl[report]'"),
        ('{"url": "https://a.org/b.whl", "archive_info": {}}', "pip install 'brdfdb[report] @ https://a.org/b.whl'"),
        (
            '{"url": "https://a.org/b", "vcs_info": {"vcs": "git"}}',
            "pip install 'brdfdb[report] @ git+https://a.org/b'",
        ),
        (None, "pip install 'brdfdb[report]'"),
        (importlib.metadata.PackageNotFoundError(), "pip install -e '.[report]' in a clone"),
    ],
)
def test_an_extra_is_installed_from_where_the_program_came(
    origin: str | Exception | None, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    distribution = Mock()
    distribution.return_value.read_text.return_value = origin
    distribution.side_effect = origin if isinstance(origin, Exception) else None
    monkeypatch.setattr(importlib.metadata, "distribution", distribution)
    assert install_command("report") == command


class Fields(BaseModel):
    """One field of each kind that recipes, scenes and requests have."""

    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)

    title: str = Field(default="x", min_length=1, max_length=9)
    flag: bool = True
    width: float = Field(default=1.0, gt=0.0, le=0.5)
    count: int = Field(default=1, ge=1, lt=10)
    rows: list[float] = Field(default=[1.0], min_length=1, max_length=2)
    table: dict[str, float] = {}
    method: Literal["linear", "cubic"] = "linear"
    name: str = Field(default="a", pattern=r"^[a-z0-9]+(-[a-z0-9]+)*$")


def test_a_finding_of_pydantic_is_said_in_our_words() -> None:
    findings: list[tuple[str, object, str]] = [
        ("title", 5, "5 is not a text, in quotes"),
        ("title", "", "must not be empty"),
        ("title", "long titles", "has more than the 9 characters that are allowed"),
        ("flag", 1, "1 is not true or false"),
        ("width", "1", "'1' is not a number"),
        ("width", math.nan, "nan is not a finite number"),
        ("width", 0, "0 must be greater than 0"),
        ("width", 5, "5 must be at most 0.5"),
        ("count", 1.5, "1.5 is not a whole number"),
        ("count", 0, "0 must be at least 1"),
        ("count", 10, "10 must be less than 10"),
        ("rows", 5, "5 is not a list, in square brackets"),
        ("rows", [], "has 0 values, needs at least 1"),
        ("rows", [1.0, 2.0, 3.0], "has more than the 2 values that are allowed"),
        ("table", 5, "5 is not a table of fields"),
        ("method", "quintic", "'quintic' is not one of 'linear', 'cubic'"),
        ("name", "My name", "'My name' is not lower-case letters, digits and single hyphens"),
        ("colour", "red", "unknown key"),
        ("table", "x" * 100, f"'{'x' * 59}... is not a table of fields"),
    ]
    for field, value, sentence in findings:
        with pytest.raises(ValidationError) as caught:
            Fields.model_validate({field: value})
        assert sentence_of(caught.value.errors()[0]) == sentence


def test_a_wrong_name_is_compared_with_those_next_to_it_among_very_many(monkeypatch: pytest.MonkeyPatch) -> None:
    names = [f"grey-{number:05d}" for number in range(50_000)]
    compared, close = [], difflib.get_close_matches

    def counted(name: str, others: list[str], n: int, cutoff: float) -> list[str]:
        compared.append(len(others))
        return close(name, others, n, cutoff)

    monkeypatch.setattr(difflib, "get_close_matches", counted)
    assert UnknownMaterialError("grey-314159", names).closest[0] == "grey-31459"
    assert UnknownMaterialError("zinc", names).closest == []
    assert compared == [2000, 1000]
