"""Places that users name: one reading of text everywhere; other schemes are a sentence, and nothing is created."""

from __future__ import annotations

import argparse
import importlib
import inspect
import pkgutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import brdfdb
from brdfdb import formats
from brdfdb.errors import BrdfdbError, ParameterError
from brdfdb.materials import presets
from brdfdb.place import is_bucket, is_service, path_of
from brdfdb.store.publication import publish_dataset
from brdfdb.tables.table import Table
from brdfdb_api.settings import Settings
from brdfdb_pipelines import cli, sample, scene_file
from brdfdb_pipelines.commands._arguments import tables
from brdfdb_pipelines.recipe_file import load
from tests.measurements.made_up import scattered
from tests.pipelines.command import Captured
from tests.store.a_store import lambert, layout

FOREIGN = (
    "s3://bucket/db",
    "gs://bucket/db",
    "memory://a",
    "S3A://b/c",
    "simplecache::s3://b/c",
    "ftp:/x/y",
    "az://c/d",
)
ROOT = Path(brdfdb.__file__).parents[1]


def test_paths_and_addresses_of_files_are_paths() -> None:
    paths = {
        "a/b": "a/b",
        "/a b/c": "/a b/c",
        "C:/data": "C:/data",
        "a:b": "a:b",
        "file:///a/b%20c/d%3Fe": "/a/b c/d?e",
        "FILE://localhost/a": "/a",
        "file:/a": "/a",
        "./s3:/a": f"{Path.cwd()}/s3:/a",
        "~/store": f"{Path.home()}/store",
        "./~/store": "~/store",
    }
    for text, expected in paths.items():
        assert path_of(text) == Path(expected)
        assert path_of(path_of(text)) == Path(expected) or text == "./~/store"


def test_other_text_is_refused_in_one_sentence() -> None:
    damaged = ("", "a\0b", "file://host/a", "file:///a?b", "file:///a#b", "file:///a%00b", Path("file:///a"))
    for place in (*FOREIGN, *map(Path, FOREIGN), *damaged):
        with pytest.raises(ParameterError) as raised:
            path_of(place, "root")
        assert raised.value.parameter == "root"
        assert "\n" not in str(raised.value)
        assert repr(str(place)) in str(raised.value)
        assert not is_service(place)


def test_an_address_of_a_service_is_no_path() -> None:
    assert is_service("HTTPS://example.org/db")
    assert not is_service("http.toml")
    with pytest.raises(ParameterError, match=r"'http://a:1' is the address of a service"):
        path_of("http://a:1")


# The command line: each option that takes a value is a place, a number, a choice, or text that is no place

TEXTS = {
    *("name", "names", "model", "library", "snapshot", "member", "column", "title", "source", "channel", "set"),
    *("revision", "to", "fix", "refractive_index", "stokes", "words", "paper", "sort", "allow", "scheduler", "host"),
    *("kind", "scene", "format", "range", "unit", "models", "where", "nuisance", "angles"),
}
PLACES = {"place", "picture_file", "sheet_file", "tables"}


def _actions(parser: argparse.ArgumentParser, names: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, command in action.choices.items():
                yield from _actions(command, (*names, name))
        elif action.nargs != 0:
            yield names, action


def _is_place(action: argparse.Action) -> bool:
    return getattr(action.type, "__name__", "") in PLACES


def _flag(action: argparse.Action) -> str:
    return action.option_strings[-1] if action.option_strings else ""


ACTIONS = [*_actions(cli._parser(None))]


def test_each_option_is_known_as_a_place_or_as_something_else() -> None:
    for names, action in ACTIONS:
        known = _is_place(action) or action.type is not None or action.choices or action.dest.startswith("option_")
        assert known or action.dest in TEXTS, f"{names} {action.dest}: is it a place? Then it has type=place"
        assert action.type is not Path
        assert not isinstance(action.default, Path)


def test_each_place_of_the_command_line_refuses_other_schemes_and_creates_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.chdir(tmp_path)
    for names, action in ACTIONS:
        if not _is_place(action) or (names[:1] == ("export",) and names[1:] not in ((), ("csv",), ("zarr",))):
            continue
        flag = [_flag(action)] if _flag(action) else []
        for text in (*FOREIGN, "http://127.0.0.1:9/a", ""):
            if action.type is tables and (is_service(text) or is_bucket(text)):
                continue
            with pytest.raises(SystemExit) as ended:
                cli.main([*names, *flag, text])
            assert ended.value.code == 2
            last = capsys.readouterr().err.splitlines()[-1]
            assert last.startswith(" ".join(("brdfdb", *names)))
            assert repr(text) in last
    assert [*tmp_path.iterdir()] == []


def test_a_store_of_the_environment_is_read_alike(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("BRDFDB_STORE", "ftp://bucket/db")
    for command in ("list", "build", "serve"):
        with pytest.raises(SystemExit) as ended:
            cli.main([command])
        assert ended.value.code == 2
        assert "'ftp://bucket/db' is neither a path nor" in capsys.readouterr().err
    for read in (brdfdb.open, Settings.from_environment):
        with pytest.raises(ParameterError, match=r"^BRDFDB_STORE: 'ftp://bucket/db' is neither"):
            read()
    monkeypatch.setenv("BRDFDB_STORE", f"file://{tmp_path}/a%20b")
    assert Settings.from_environment().store == tmp_path / "a b"
    assert [*tmp_path.iterdir()] == []


def test_addresses_of_files_work_from_build_to_export(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    (tmp_path / "recipe.toml").write_text('materials = ["clay-vase"]\ntolerance = 0.2\n')
    place = f"file://{tmp_path}/a%20store"
    monkeypatch.chdir(tmp_path)
    assert cli.main(["build", f"file://{tmp_path}/recipe.toml", "--store", place]) == 0
    assert cli.main(["export", "csv", "clay-vase", "--store", place, "--out", f"file://{tmp_path}/out"]) == 0
    table = brdfdb.open(place)["clay-vase"]
    (file,) = (tmp_path / "out").iterdir()
    read = formats.read(f"file://{file}")
    assert read.lookup(0.5, 0.0, 0.3, 2.0) == pytest.approx(table.lookup(0.5, 0.0, 0.3, 2.0), rel=0.05)
    with xr.open_dataset(place, engine="brdfdb", material="clay-vase") as dataset:
        assert dataset["brdf"].size
    with xr.open_dataset(f"{place}/materials/clay-vase/r000001", engine="brdfdb") as dataset:
        assert dataset["brdf"].size
    written = formats.write(table, f"file://{tmp_path}/b.npz", "numpy")
    assert written.paths == (tmp_path / "b.npz",)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a store", "b.npz", "out", "recipe.toml"]
    capsys.readouterr()


# Python: each public function that takes a path

SAMPLES = scattered(presets()["clay-vase"].brdf_at(None), 10, 0.03)


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Table:
    root = tmp_path_factory.mktemp("store")
    publish_dataset(root, "white", lambert(0.5))
    return brdfdb.open(root)["white"]


def _functions() -> Iterator[tuple[Callable[..., Any], str]]:
    """Yield the public functions of the library with a parameter that is a path, and its name."""
    for module in pkgutil.walk_packages(brdfdb.__path__, "brdfdb."):
        if "._" in module.name or module.name.startswith(("brdfdb.mitsuba", "brdfdb.reference")):
            continue
        for name, function in vars(importlib.import_module(module.name)).items():
            if inspect.isfunction(function) and function.__module__ == module.name and not name.startswith("_"):
                for parameter, kind in function.__annotations__.items():
                    if "PathLike" in str(kind) and function is not path_of:
                        yield function, parameter


def test_each_function_that_takes_a_path_refuses_other_schemes(
    table: Table, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    given: dict[str, Any] = {
        "table": table,
        "samples": SAMPLES,
        "file_format": "csv",
        "source": presets()["clay-vase"],
        "tolerance": 0.2,
        "name": "white",
        "layout": layout(0.5),
        "dataset": lambert(0.5),
        "scene": scene_file.load("clay-vase"),
        "radiance": np.ones((2, 2, 41)),
        "header": {},
        "channels": {"Y": np.ones((2, 2))},
        "picture": None,
        "image": None,
    }
    functions = [*_functions()]
    assert len(functions) > 50
    for function, parameter in functions:
        required = {
            name: given[name]
            for name, one in inspect.signature(function).parameters.items()
            if one.default is one.empty and one.kind is not one.VAR_KEYWORD and name != parameter
        }
        for place in ("ftp://bucket/x.csv", Path("memory://x")):
            with pytest.raises(BrdfdbError) as raised:
                function(**required, **{parameter: place})
            holds = "holds" in str(raised.value) or type(raised.value).__name__ == "CannotHoldError"
            assert holds or repr(str(place)) in str(raised.value), function
    for file_format in formats.EXPORTERS:
        with pytest.raises(ParameterError, match=r"^path: 's3://bucket/x' is neither a path"):
            formats.write(table, "s3://bucket/x", file_format)
    assert [*tmp_path.iterdir()] == []


def test_stores_are_made_nowhere_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for make in (
        lambda: sample.run("lambert", Path("s3://b/c"), count=1, directions=1),
        lambda: xr.open_dataset("ftp://b/c", engine="brdfdb"),
        lambda: xr.open_dataset("ftp://b/c", engine="brdfdb", material="white"),
        lambda: brdfdb.models.MODELS.add_files(["s3://b/models.py"]),
    ):
        with pytest.raises(ParameterError, match=r"'(s3|ftp):/"):
            make()
    assert [*tmp_path.iterdir()] == []


def test_paths_in_recipes_and_scenes_are_read_alike(tmp_path: Path) -> None:
    begin = 'materials = ["x"]\ntolerance = 0.2\n'
    spectrum = 'wavelengths_nm = [500.0]\n[define.x]\nmodel = "lambert"\ntitle = "x"\nsource = "x"\n'
    samples = f'{begin}[define.x]\nsamples = "s3://bucket/x.csv"\n'
    csv = f'{begin}{spectrum}[define.x.parameters]\nrho = {{ csv = "s3://bucket/x.csv" }}\n'
    path = tmp_path / "recipe.toml"
    for recipe in (samples, csv):
        path.write_text(recipe)
        with pytest.raises(BrdfdbError, match=r"'s3://bucket/x.csv' is neither a path"):
            load(path, "papers").jobs()
    (tmp_path / "x.csv").write_text("400 0.2\n700 0.3\n")
    path.write_text(csv.replace("s3://bucket", f"file://{tmp_path}"))
    assert load(path, "papers").jobs()
    scene = (ROOT / "pipelines/brdfdb_pipelines/scenes/clay-vase.toml").read_text()
    (tmp_path / "a.toml").write_text(f'store = "s3://bucket/db"\n{scene}')
    for place, start in (("s3://bucket/a.toml", ""), (f"file://{tmp_path}/a.toml", r"a\.toml: store: ")):
        with pytest.raises(BrdfdbError, match=rf"{start}'s3://bucket/[a-z.]*' is neither a path"):
            scene_file.load(place)
