"""The command `brdfdb build`."""

from __future__ import annotations

import argparse
import math
import shlex
import sys
import time
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from brdfdb_pipelines.commands import INTERRUPTED
from brdfdb_pipelines.commands._arguments import add_store, add_workers, byte_count, place, share_cores, tables

if TYPE_CHECKING:
    from brdfdb_pipelines.build import Built
    from brdfdb_pipelines.workers import Workers

HELP = "Build the tables of a recipe that the store does not contain yet."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the recipe, the store, and where the work is done."""
    parser.add_argument(
        "recipe", type=place, nargs="?", help="a TOML file (default: the materials of the three papers)"
    )
    parser.add_argument(
        "--library", metavar="NAME", help="build a library of presets, such as metals, instead of a recipe file"
    )
    where = parser.add_mutually_exclusive_group()
    add_store(where)
    where.add_argument(
        "--to",
        type=tables,
        metavar="DEST",
        help="build an edition of the recipe, without a store, in a directory or s3://bucket/prefix, gs:// or az://; "
        "workers share nothing but DEST",
    )
    parser.add_argument(
        "--rewrite",
        action="store_true",
        help="with --to, also write tables that DEST has already, to repair what `brdfdb verify --store DEST` finds",
    )
    add_workers(parser, "DIR, or the directory DEST,")
    parser.add_argument(
        "--memory",
        type=byte_count,
        metavar="SIZE",
        help="memory that all tasks may use together, such as 500MB (default: all memory of the machine)",
    )
    parser.add_argument("--json", action="store_true", help="print progress as JSON, one object per line")


def run(options: argparse.Namespace) -> int:
    """Build the recipe, show progress, and print what was built."""
    share_cores()
    try:
        _build(options)
    except KeyboardInterrupt:
        kept = "complete shards" if options.to else "published tables, complete blocks and realisations"
        print(
            f"brdfdb: interrupted; {kept} are preserved; to resume: {shlex.join(['brdfdb', *options.arguments])}",
            file=sys.stderr,
        )
        return INTERRUPTED
    return 0


def _build(options: argparse.Namespace) -> None:
    from brdfdb._numba import when_compiling
    from brdfdb.errors import ParameterError, counted
    from brdfdb.materials import PAPERS
    from brdfdb_pipelines import recipe_file, terminal, workers
    from brdfdb_pipelines.build import build, compile_kernels
    from brdfdb_pipelines.build_progress import Bars, print_json
    from brdfdb_pipelines.build_survey import machine_memory
    from brdfdb_pipelines.edition_build import build_edition

    if options.recipe is not None and options.library is not None:
        raise ParameterError(
            "--library", f"cannot be combined with a recipe file, and {options.recipe} is given", options.library
        )
    if options.rewrite and not options.to:
        raise ParameterError("--rewrite", "is for editions, and --to is missing; a store repairs itself")
    if options.to and options.memory is not None:
        raise ParameterError("--memory", "cannot be combined with --to: a shard takes little memory", options.memory)
    recipe = recipe_file.load(options.recipe, options.library or PAPERS)
    start = time.perf_counter()
    memory: int | None = options.memory
    at: AbstractContextManager[Workers]
    if options.scheduler:
        at = workers.cluster(options.scheduler)
    else:
        memory = machine_memory() if memory is None else memory
        if recipe.simulated_jobs():
            at = workers.interruptible(options.jobs)
        else:
            at = (workers.processes if options.processes else workers.threads)(options.jobs)
    with at as opened, nullcontext(print_json) if options.json else Bars() as report:
        if options.to:
            edition = build_edition(recipe, options.to, opened, report, rewrite=options.rewrite)
            if not options.json:
                print(
                    f"{counted(edition.materials, 'table')} in {counted(edition.objects, 'object')}, "
                    f"{terminal.size(edition.bytes)}, at {options.to}, in {time.perf_counter() - start:.1f} s; sha256 "
                    f"{edition.digest}" + (edition.replaced and f"; it replaces {edition.replaced}")
                )
            return
        if not options.scheduler:
            compile_kernels(recipe, options.store, options.jobs, report)
        with when_compiling(lambda: report({"event": "compiling", "kernels": 0})):
            built = build(recipe, options.store, opened, report, memory=memory)
    if not options.json:
        _print(built, options.store, time.perf_counter() - start)


def _print(built: list[Built], root: Path, seconds: float) -> None:
    """Print a line for each table that changed."""
    from brdfdb.errors import counted
    from brdfdb.store import summary_words
    from brdfdb.store.reader import Store
    from brdfdb_pipelines import terminal

    store = Store(root)
    changed = [table for table in built if table.state != "unchanged"]
    if changed:
        values = sum(math.prod(table.shape) for table in changed if table.shape)
        amount = f"{values / 1e6:.1f} million values" if values >= 1e5 else counted(values, "value")
        terminal.print_table(
            f"{counted(len(changed), 'table')}, {amount}, in {seconds:.1f} s",
            ("material", "model", "shape", "revision", "stored", "why"),
            [
                (
                    table.job.name,
                    table.job.model,
                    shape_in_words(table.shape, table.wavelengths),
                    table.revision,
                    terminal.size(table.stored_bytes),
                    f"{table.why}; {table.revision} is current again" if table.state == "adopted" else table.why,
                )
                for table in changed
            ],
            numbers=("shape", "stored"),
        )
    if len(changed) < len(built):
        print(f"{counted(len(built) - len(changed), 'table')} unchanged")
    print(f"{terminal.size(sum(table.stored_bytes for table in built))} in {root}")
    for name in (table.job.name for table in changed):
        excess = summary_words.excess(store.summary(name))
        if excess and store.metadata(name).known_excess is None:
            print(f"{name} reflects more light than it receives: {excess}")


def shape_in_words(shape: tuple[int, ...], wavelengths: int) -> str:
    """Return the numbers of nodes of a table, and how many values serve all its wavelengths, if they are fewer."""
    if not wavelengths or shape[-1] == wavelengths:
        return " x ".join(map(str, shape))
    return f"{' x '.join(map(str, shape[:-1]))}, {shape[-1]} for {wavelengths} wavelengths"
