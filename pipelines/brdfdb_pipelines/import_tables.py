"""Tables of imported measurements: the recipe that builds them, the build and the audit."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from brdfdb.errors import BrdfdbError, ParameterError, StoreError
from brdfdb.materials import presets
from brdfdb.materials.recipe_text import toml_of
from brdfdb.measurements.joining import common_name
from brdfdb.measurements.measured_source import slug
from brdfdb.store.files import write_file
from brdfdb.store.paths import NAME
from brdfdb.store.summary_words import REPORT_OF_SOME
from brdfdb.tables.planner import check_tolerance
from brdfdb_pipelines import build_resources, workers
from brdfdb_pipelines.build import build
from brdfdb_pipelines.build_progress import Bars, Event
from brdfdb_pipelines.measured_job import MeasuredTable, measured_table
from brdfdb_pipelines.recipe_file import Recipe
from brdfdb_pipelines.workers import Workers, WorkersError

if TYPE_CHECKING:
    from brdfdb.audit import AuditReport

TOLERANCE = 0.05  # of tables, by default


@dataclass(frozen=True)
class Target:
    """One material to import: its files, the keys of a recipe that say how to read them, and its name in the store."""

    files: tuple[Path, ...]
    keys: dict[str, Any]
    name: str = ""

    @property
    def label(self) -> str:
        """Return the paths of the files."""
        return ", ".join(map(str, self.files))

    @property
    def shown(self) -> str:
        """Return the paths of the files, and the member of an archive."""
        member = self.keys.get("member", "")
        return f"{self.label} ({member})" if member else self.label

    @cached_property
    def table(self) -> MeasuredTable:
        """Return the keys, checked."""
        return measured_table(self.name or "material", {**self.keys, "samples": list(map(str, self.files))})

    def define(self, folder: Path) -> dict[str, Any]:
        """Return the keys of the material in a recipe in a folder."""
        paths = [_relative(file, folder) for file in self.files]
        given = {key: value for key, value in self.keys.items() if value}
        return {"samples": paths[0] if len(paths) == 1 else paths, **given}


@dataclass(frozen=True)
class Tables:
    """Request for tables of imported samples.

    Attributes
    ----------
    store : Path or None
        Directory of the store in which tables are built; None: none is built.
    recipe : Path or None
        File of the recipe that builds the same tables.
    name, title : str or None
        Of the one material; by default those of the file.
    tolerance : float
        Of the tables, in [1e-4, 0.5].
    jobs : int
        Number of processes.
    """

    store: Path | None
    recipe: Path | None = None
    name: str | None = None
    title: str | None = None
    tolerance: float = TOLERANCE
    jobs: int = 1

    def __post_init__(self) -> None:
        check_tolerance(self.tolerance)
        if self.recipe is not None and self.recipe.suffix != ".toml":
            raise ParameterError("--recipe", f"{str(self.recipe)!r} does not end in .toml", str(self.recipe))


@dataclass
class Made:
    """The tables that were made: sentences on those that failed, and the audit of the others."""

    refused: list[str] = field(default_factory=list)
    report: AuditReport | None = None


def named(targets: Sequence[Target], tables: Tables, count: int) -> tuple[list[Target], list[str]]:
    """Return materials with their names, and a sentence on each name that several would have: none of these is made.

    A name is that of the command line, that of the file or the member, as words, or the words that the names of joined
    files begin with.

    Raises
    ------
    ParameterError
        If a name is given to several materials, is that of a preset, is not made of words, or joined files have no word
        in common.
    """
    for option, text in (("--name", tables.name), ("--title", tables.title)):
        if text is not None and count != 1:
            raise ParameterError(option, f"it is for one material, and there are {count}", text)
    materials: dict[str, list[Target]] = {}
    for target in targets:
        first, stems = target.files[0], [file.stem for file in target.files]
        of_files = common_name(stems) or ("" if len(stems) > 1 else first.stem)
        if not (tables.name or of_files):
            raise ParameterError("--name", f"{target.label} have no word in common that names them; give one", None)
        name = tables.name or slug(target.keys.get("member", "").removesuffix(".h5") or of_files)
        if not NAME.fullmatch(name):
            raise ParameterError(
                "--name", f"{name!r} is not made of lower-case letters, digits and single hyphens, 128 at most", name
            )
        if name in presets():
            raise ParameterError("--name", f"{name!r} is the name of a preset; give {first} another", name)
        title = {} if tables.title is None else {"title": tables.title}
        one = replace(target, name=name, keys={**target.keys, **title})
        assert one.table  # checked before anything is read
        materials.setdefault(name, []).append(one)
    refused = [
        f"{' and '.join(one.shown for one in same)} would {'both' if len(same) == 2 else 'all'} be {name!r}; "
        "import one alone, with --name"
        for name, same in materials.items()
        if len(same) > 1
    ]
    return [same[0] for same in materials.values() if len(same) == 1], refused


def make(targets: Sequence[Target], tables: Tables) -> Made:
    """Write the recipe of materials, build its tables, and audit them, where that is asked for.

    Raises
    ------
    RecipeError
        If a file has changed, or a name is none of a material.
    StoreError, WorkersError, OSError
        If the store or the recipe cannot be written. A table that fails is recorded, and the others are built.
    """
    recipe = Recipe.model_validate(_content(targets, tables.tolerance, Path()))
    recipe.jobs()
    if tables.recipe is not None:
        folder = tables.recipe.parent
        content = _content(targets, tables.tolerance, folder)
        names = ", ".join(f'"{name}"' for name in content["materials"])
        parts = [f"materials = [{names}]\ntolerance = {tables.tolerance:g}\n"]
        parts += [toml_of(name, keys) for name, keys in content["define"].items()]
        write_file(tables.recipe, "\n".join(parts).encode(), folder)
    made = Made()
    if tables.store is None:
        return made
    kept = _build(recipe, tables.store, min(tables.jobs, len(targets)), made)
    if kept:
        from brdfdb_pipelines import audit

        made.report = audit.run(
            tables.store,
            kept,
            tables.store / REPORT_OF_SOME,
            jobs=min(tables.jobs, len(kept)),
            figures=False,
            shown=False,
        )
    return made


def _content(targets: Sequence[Target], tolerance: float, folder: Path) -> dict[str, Any]:
    """Return the recipe of materials, in a folder."""
    define = {target.name: target.define(folder) for target in targets}
    return {"materials": list(define), "tolerance": tolerance, "define": define}


def _build(recipe: Recipe, store: Path, jobs: int, made: Made) -> list[str]:
    """Build tables; return the names of those that the store has."""
    kept: list[str] = []
    at: AbstractContextManager[Workers] = workers.processes(jobs) if jobs > 1 else workers.threads(1)
    with at as opened, Bars() as bars:

        def report(event: Event) -> None:
            if event["event"] == "failed":
                made.refused.append(event["error"])
            elif event["event"] in ("published", "adopted", "unchanged"):
                kept.append(event["material"])
            bars(event)

        try:
            build(recipe, store, opened, report, memory=build_resources.machine_memory())
        except (StoreError, WorkersError):
            raise
        except BrdfdbError:
            if not made.refused:
                raise
    names = [job.name for job in recipe.measured_jobs()]
    return sorted(kept, key=names.index)


def _relative(file: Path, folder: Path) -> str:
    """Return the path of a file from a folder, with slashes; the absolute one from another drive."""
    try:
        return Path(os.path.relpath(file.absolute(), folder.absolute())).as_posix()
    except ValueError:
        return file.absolute().as_posix()
