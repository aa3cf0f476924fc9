"""Builds in this process, changed recipes, and what a store and its staging hold."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

import pytest

import brdfdb
from brdfdb.tables import tabulation
from brdfdb.tables.layout import Layout
from brdfdb_pipelines.build import Built


class OneByOne(Executor):
    """Runs a task when it is submitted, and notes what came."""

    def __init__(self) -> None:
        self.submitted: list[tuple[str, tuple[Any, ...]]] = []

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.submitted.append((fn.__name__, args))
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except BaseException as error:
            future.set_exception(error)
        return future


def failing(monkeypatch: pytest.MonkeyPatch, name: str, error: BaseException) -> None:
    """Let the tabulation of one material fail."""
    block = tabulation.block

    def fail(layout: Layout, rows: slice) -> Any:
        if layout.source.name == name:
            raise error
        return block(layout, rows)

    monkeypatch.setattr(tabulation, "block", fail)


def changed(recipe: Path, to: Path, step: float = 30) -> Path:
    """Write the recipe with another isotropic grid: foam and blue-plastic are new tables, and the others are not."""
    to.write_text(recipe.read_text(encoding="utf-8").replace("step = 15", f"step = {step}"), encoding="utf-8")
    return to


def states(built: list[Built]) -> dict[str, tuple[str, str, str]]:
    return {b.job.material.name: (b.state, b.revision, b.why) for b in built}


def staged(root: Path) -> list[str]:
    return sorted(path.name for path in (root / ".staging").iterdir())


def chunks(root: Path, name: str) -> dict[str, bytes]:
    """Return the chunks of the current table of a material by their paths in its group."""
    group = brdfdb.open(root).path(name)
    return {str(path.relative_to(group)): path.read_bytes() for path in group.rglob("c/**/*") if path.is_file()}
