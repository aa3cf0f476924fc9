"""The build job: every table of a recipe, published one by one, and what is left when one of them fails."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import brdfdb
from brdfdb.layout import Layout
from brdfdb.store import Store, StoreError
from brdfdb.tabulate import tabulate
from brdfdb_pipelines import build as module
from brdfdb_pipelines import cli
from brdfdb_pipelines.build import build
from brdfdb_pipelines.recipe import Recipe, RecipeError, load


class OneByOne(Executor):
    """Runs a task when it is submitted, and notes what came."""

    def __init__(self) -> None:
        self.submitted: list[str] = []

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.submitted.append(args[0].material.name)
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except BaseException as error:
            future.set_exception(error)
        return future


def chunks(store: Store, name: str) -> dict[str, bytes]:
    group = store.path(name)
    return {str(path.relative_to(group)): path.read_bytes() for path in group.rglob("c/**/*") if path.is_file()}


def failing(monkeypatch: pytest.MonkeyPatch, name: str, error: BaseException) -> None:
    """Let the tabulation of one material fail."""

    def fail(layout: Layout) -> xr.Dataset:
        if layout.material.name == name:
            raise error
        return tabulate(layout)

    monkeypatch.setattr(module, "tabulate", fail)


def test_what_was_built_is_told_in_the_order_of_the_recipe(recipe: Path, tmp_path: Path, names: list[str]) -> None:
    counts: list[int] = []
    plan = load(recipe)
    with ThreadPoolExecutor(3) as executor:
        built = build(plan, tmp_path, executor, counts.append)
    assert [b.job.material.name for b in built] == names
    assert [b.revision for b in built] == ["r000001"] * len(names)
    assert sum(counts) == sum(job.layout().size for job in plan.jobs())
    store = brdfdb.open(tmp_path)
    assert list(store) == sorted(names)
    for b in built:
        files = [path for path in store.path(b.job.material.name).rglob("*") if path.is_file()]
        assert b.stored_bytes == sum(path.stat().st_size for path in files)


def test_tables_are_those_of_tabulate_with_the_recipe_beside_them(recipe: Path, built: Path) -> None:
    store = brdfdb.open(built)
    plan = load(recipe)
    for job in plan.jobs():
        expected = tabulate(job.layout())
        with store.dataset(job.material.name) as found:
            xr.testing.assert_identical(found.load(), expected.assign_attrs(recipe=plan.model_dump(mode="json")))


def test_the_largest_table_comes_first_and_the_number_of_workers_changes_nothing(
    recipe: Path, built: Path, tmp_path: Path, names: list[str]
) -> None:
    executor = OneByOne()
    build(load(recipe), tmp_path, executor, lambda _: None)
    sizes = {job.material.name: job.layout().size for job in load(recipe).jobs()}
    assert sorted(executor.submitted) == sorted(names)
    assert [sizes[name] for name in executor.submitted] == sorted(sizes.values(), reverse=True)
    one, other = brdfdb.open(tmp_path), brdfdb.open(built)
    assert all(chunks(one, name) == chunks(other, name) for name in names)


def test_building_again_makes_new_revisions(recipe: Path, tmp_path: Path, names: list[str]) -> None:
    for revision in ("r000001", "r000002"):
        assert cli.main(["build", str(recipe), "--store", str(tmp_path)]) == 0
        store = brdfdb.open(tmp_path)
        assert {store.head(name) for name in names} == {revision}
    np.testing.assert_array_equal(store["foam"].brdf, tabulated(recipe, "foam"))


def tabulated(recipe: Path, name: str) -> Any:
    (job,) = (job for job in load(recipe).jobs() if job.material.name == name)
    return tabulate(job.layout())["brdf"].values


def test_a_recipe_that_cannot_be_built_is_refused_before_anything_is_written(recipe: Path, tmp_path: Path) -> None:
    content = load(recipe).model_dump()
    content["grids"]["isotropic"]["theta_i_deg"] = [0.0, 90.0]
    with pytest.raises(RecipeError, match=r"^foam on grids\.isotropic: "):
        build(Recipe.model_validate(content), tmp_path / "store", OneByOne(), lambda _: None)
    assert not (tmp_path / "store").exists()


def test_one_table_that_fails_takes_no_other_with_it(
    recipe: Path, tmp_path: Path, names: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    build(load(recipe), tmp_path, OneByOne(), lambda _: None)
    failing(monkeypatch, "foam", ZeroDivisionError("a bug"))
    with pytest.raises(ZeroDivisionError, match="a bug"):
        build(load(recipe), tmp_path, OneByOne(), lambda _: None)
    store = brdfdb.open(tmp_path)
    assert {name: store.head(name) for name in names} == {
        name: "r000001" if name == "foam" else "r000002" for name in names
    }
    for name in names:
        store.verify(name)
    assert [path.name for path in (tmp_path / ".staging").iterdir()] == ["lock"]


@pytest.mark.parametrize(
    ("error", "code", "sentence"),
    [
        (KeyboardInterrupt(), 130, "brdfdb: interrupted; what was published before stays"),
        (MemoryError("Unable to allocate 3.64 TiB"), 2, "brdfdb: Unable to allocate 3.64 TiB"),
        (StoreError("cannot write foam: No space left"), 2, "brdfdb: cannot write foam: No space left"),
    ],
)
def test_a_build_that_is_broken_off_says_so_and_the_old_revision_is_served(
    error: BaseException,
    code: int,
    sentence: str,
    recipe: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    command = ["build", str(recipe), "--store", str(tmp_path), "--jobs", "1"]
    assert cli.main(command) == 0
    capsys.readouterr()
    failing(monkeypatch, "foam", error)
    assert cli.main(command) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines()[-1].startswith(sentence)
    assert "Traceback" not in err
    store = brdfdb.open(tmp_path)
    store.verify("foam")
    assert store["foam"].revision == "r000001"
    assert [path.name for path in (tmp_path / ".staging").iterdir()] == ["lock"]


def test_a_bug_in_the_program_keeps_its_traceback(
    recipe: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    failing(monkeypatch, "foam", ZeroDivisionError("a bug"))
    with pytest.raises(ZeroDivisionError, match="a bug"):
        cli.main(["build", str(recipe), "--store", str(tmp_path), "--jobs", "1"])
    assert [path.name for path in (tmp_path / ".staging").iterdir()] == ["lock"]
