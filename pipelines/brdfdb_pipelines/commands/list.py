"""The command `brdfdb list`."""

from __future__ import annotations

import argparse
import contextlib
import itertools
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from brdfdb.errors import ParameterError, StoreError, counted, sentence_of
from brdfdb.store import open_tables
from brdfdb_pipelines.commands._arguments import add_snapshot, add_tables

if TYPE_CHECKING:
    from collections.abc import Sequence

    from brdfdb.store.edition.reader import Edition
    from brdfdb.store.reader import Store

HELP = "List the materials and families of the store, or the presets."

_FILTERS = {
    "model": "list only materials of this model; measured: materials of measured data",
    "paper": "list only materials with this text in the key of the paper or in the source",
    "words": "list only materials with all of these words in name, title, model or source",
}
_WORDS = 5  # number of words that all sources must share to be printed once


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the store and the choice of presets."""
    add_tables(parser)
    parser.add_argument("--presets", action="store_true", help="list the presets that recipes can name")
    parser.add_argument(
        "--library", metavar="NAME", help="with --presets: library to list, such as metals (default: papers)"
    )
    for flag, words in _FILTERS.items():
        parser.add_argument(f"--{flag}", default="", metavar=flag.upper(), help=words)
    parser.add_argument(
        "--sort",
        default="name",
        help="name, error_p99, created or bytes; the largest first with a minus: --sort=-error_p99",
    )
    add_snapshot(parser)


def run(options: argparse.Namespace) -> int:
    """Print a line for each material and family."""
    given = [flag for flag in _FILTERS if getattr(options, flag)]
    if options.presets:
        if given:
            raise ParameterError(f"--{given[0]}", "cannot be combined with --presets", getattr(options, given[0]))
        _print_presets(options.library)
        return 0
    if options.library is not None:
        raise ParameterError("--library", "is allowed only together with --presets", options.library)
    root: Path | str = options.store
    store = open_tables(root, snapshot=options.snapshot)
    names = _chosen(store, options)
    damaged = _print_materials(store, root, names) + ([] if given else _print_families(store))
    if damaged:
        raise StoreError("; ".join(damaged))
    return 0


def _print_presets(library: str | None) -> None:
    """Print a line for each material of a library, and the names of the other libraries."""
    from brdfdb.materials import PAPERS, libraries, presets
    from brdfdb_pipelines import terminal

    name = PAPERS if library is None else library
    materials = list(presets(name).values())
    shared = _shared([material.source for material in materials])
    rows = []
    for material in materials:
        at = material.wavelengths_nm
        stated = f"{at[0]:g} nm" if at is not None and len(at) == 1 else "spectral"
        colours = stated if material.spectral else "grey"
        source = material.source.removeprefix(shared)
        rows.append((material.name, material.title, material.model, colours, source))
    title = f"{len(rows)} presets" if name == PAPERS else f"{len(rows)} presets of the library {name}"
    terminal.print_table(
        title, ("material", "title", "model", "colours", "source"), rows, less=("title", "model", "source")
    )
    if shared:
        print(f"source: {shared}...")
    if library is not None:
        print(f"{name}: {libraries()[name]}")
    others = [other for other in libraries() if other != name]
    print(f"other libraries: {', '.join(others)}; `brdfdb list --presets --library NAME`")


def _shared(sources: Sequence[str]) -> str:
    """Return the words with which all sources begin; empty if they are few."""
    columns = zip(*(source.split() for source in sources), strict=False)  # sources differ in length
    start = [words[0] for words in itertools.takewhile(lambda words: len(set(words)) == 1, columns)]
    return f"{' '.join(start)} " if len(sources) > 1 and len(start) >= _WORDS else ""


def _chosen(store: Store | Edition, options: argparse.Namespace) -> list[str]:
    """Return the names of the materials that the options let through, in order; a damaged one has no line."""
    if options.sort == "name" and not any(getattr(options, flag) for flag in _FILTERS):
        return sorted(store)
    from pydantic import ValidationError

    from brdfdb.store.catalogue import Choice, line_of

    def line(name: str) -> dict[str, Any]:
        with contextlib.suppress(StoreError):
            return line_of(name, store.summary(name), partial(store.metadata, name))
        return {"name": name}

    try:
        choice = Choice(sort=options.sort, model=options.model, paper=options.paper, q=options.words)
    except ValidationError as error:
        raise ParameterError("--sort", sentence_of(error.errors()[0]), options.sort) from None
    return [name for _, _, name in choice.chosen(list(store), line)]


def _print_materials(store: Store | Edition, root: Path | str, names: Sequence[str]) -> list[str]:
    """Print a line for each material from its pointer and the last audit; return a sentence for each damaged one."""
    from brdfdb.store.summary_words import (
        COLUMNS,
        ERRORS_EXPLAINED,
        NOT_AUDITED,
        SURFACE_EXPLAINED,
        colours,
        energy,
        formula_error,
        kind,
        last_audit,
        surface_error,
    )
    from brdfdb_pipelines import terminal

    rows: list[tuple[str, ...]] = []
    damaged: list[str] = []
    incomplete: list[str] = []
    audits = last_audit(root)
    for name in names:
        try:
            head = store.summary(name)
            if not (head["title"] and head["model"]):  # the pointer of a whole table has both
                gaps = head["incomplete"] if "incomplete" in head else store.metadata(name).gaps
                incomplete += [f"{name} {head['revision']} {gaps}"] if gaps else []  # a function has no model
            surface = surface_error(head, partial(store.attributes, name))
        except StoreError as error:
            damaged.append(str(error))
            continue
        audited = audits.get((name, head["revision"]))
        rows.append(
            (
                *(name, head["title"], kind(head), colours(head)),
                *(terminal.error(head.get("error_p99")), formula_error(head, terminal.error), surface),
                "" if audited is None else audited.samples,
                *(NOT_AUDITED if audited is None else audited.as_published, energy(head, audited)),
                head["revision"],
            )
        )
    errors = ("table error (p99)", "formula error (p99)", "surface error (median)")
    every = ("material", "title", "model", "colours", *errors, "at the samples", *COLUMNS, "revision")
    optional = (errors[2], "at the samples")
    shown = [at for at, name in enumerate(every) if name not in optional or any(row[at] for row in rows)]
    columns = tuple(every[at] for at in shown)
    rows = [tuple(row[at] for at in shown) for row in rows]
    mapped = errors[2] in columns
    terminal.print_table(
        f"{counted(len(rows), 'material')} in {root}",
        columns,
        rows,
        numbers=errors,
        less=("revision", "title", "model", *([errors[2]] if mapped else []), errors[1], "colours", errors[0]),
    )
    if rows:
        print(f"{ERRORS_EXPLAINED}; {SURFACE_EXPLAINED}" if mapped else ERRORS_EXPLAINED)
    for sentence in incomplete:
        print(terminal.plain(sentence))
    return damaged


def _print_families(store: Store | Edition) -> list[str]:
    """Print a line for each family from its record alone; return a sentence for each damaged one."""
    from brdfdb_pipelines import terminal

    rows = []
    damaged: list[str] = []
    for name in store.families():
        try:
            record = store.family_content(name)
        except StoreError as error:
            damaged.append(str(error))
            continue
        axes = ", ".join(f"{x} {v[0]:g} to {v[-1]:g}" for x, v in record.get("axes", {}).items())
        p99 = record.get("error", {}).get("overall", {}).get("p99")
        tables = str(len(record.get("members", ())))
        rows.append((name, record.get("title", ""), record.get("model", ""), tables, axes, terminal.error(p99)))
    if rows:
        columns = ("family", "title", "model", "tables", "over", "error (p99)")
        terminal.print_table(
            f"{len(rows)} {'family' if len(rows) == 1 else 'families'}",
            columns,
            rows,
            numbers=("tables", "error (p99)"),
            less=("title", "tables"),
        )
    return damaged
