"""Keeping a store in order from the command line: history, rollback, verify, gc."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import brdfdb
from brdfdb import family_records, revisions
from brdfdb.store import StoreError, UnknownMaterialError
from brdfdb_pipelines import terminal


def history(root: Path, name: str) -> None:
    """Print a line for each revision of a material, the oldest first."""
    found = revisions.history(root, name)
    terminal.print_table(
        f"{len(found)} revisions of {name} in {root}",
        ("revision", "built", "model", "version", "stored", "request", ""),
        [
            (
                revision.name,
                revision.summary["created"],
                revision.summary["model"],
                str(revision.summary["model_version"]),
                terminal.size(revision.summary["bytes"]),
                revision.summary["request_sha256"][:8] or "-",
                "current" if revision.current else "",
            )
            for revision in found
        ],
        numbers=("version", "stored"),
    )


def rollback(root: Path, name: str, revision: str) -> None:
    """Make a revision current, and say which one was."""
    before = revisions.rollback(root, name, revision)
    print(f"{name}: {revision} is current, {before} was" if before != revision else f"{name}: {revision} stays current")


def verify(root: Path, names: Sequence[str]) -> int:
    """Verify materials and families, by default all of a store; print what is damaged, and return how many are."""
    store = brdfdb.open(root)
    families = store.families()
    wanted = list(dict.fromkeys(names)) or [*store, *(name for name in families if name not in store)]
    for name in wanted:
        if name not in store and name not in families:
            raise UnknownMaterialError(name, [*store, *families])
    damaged, total = [], 0
    with terminal.progress() as bar:
        task = bar.add_task("verifying", total=len(wanted))
        for name in wanted:
            try:
                total += revisions.verify(root, name) if name in store else family_records.verify_family(root, name)
            except StoreError as error:
                damaged.append(str(error))
            bar.advance(task)
    for sentence in damaged:
        print(f"brdfdb: {sentence}", file=sys.stderr)
    among = sum(name not in store for name in wanted)
    what = f"{len(wanted) - among} materials" + (f" and {among} families" if among else "")
    print(f"{what} verified, {terminal.size(total)}: {len(damaged) or 'none'} damaged")
    if damaged:
        print("`brdfdb build` with their recipe repairs them")
    return len(damaged)


def collect(root: Path, keep: int) -> None:
    """Remove what is not needed, and say what that was."""
    collected = revisions.collect(root, keep)
    for path in collected.removed:
        print(f"removed {path}")
    for name in collected.busy:
        print(f"left {name} alone: a build is at work on it")
    print(f"{terminal.size(collected.freed)} freed in {root}")
