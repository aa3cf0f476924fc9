"""Keeping a store in order from the command line: history, rollback, verify, gc, snapshots."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from brdfdb.errors import UnknownMaterialError
from brdfdb.store import revisions, snapshots, verification
from brdfdb.store.paths import snapshot_path
from brdfdb.store.reader import Store
from brdfdb.store.sealed_json import seal_of
from brdfdb.store.snapshot_record import read_snapshot, snapshot_names
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
    if not before:
        print(f"{name}: {revision} is current; its HEAD.json was missing or damaged")
    elif before != revision:
        print(f"{name}: {revision} is current, {before} was")
    else:
        print(f"{name}: {revision} stays current")


def verify(root: Path, names: Sequence[str]) -> int:
    """Verify materials and families, by default all of a store and its snapshots; print and count what is wrong."""
    store = Store(root)
    families = store.families()
    wanted = list(dict.fromkeys(names)) or [*store, *(name for name in families if name not in store)]
    for name in wanted:
        if name not in store and name not in families:
            raise UnknownMaterialError(name, [*store, *families])
    found, total = [], 0
    with terminal.progress() as bar:
        task = bar.add_task("verifying", total=len(wanted))
        for name in wanted:
            size, wrong = (verification.material if name in store else verification.family)(root, name)
            total += size
            found += wrong
            bar.advance(task)
    found += [] if names else verification.snapshots(root)
    for finding in found:
        print(f"brdfdb: {finding}", file=sys.stderr)
    among = sum(name not in store for name in wanted)
    what = f"{len(wanted) - among} materials" + (f" and {among} families" if among else "")
    damaged = len({finding.name for finding in found if not finding.remark})
    print(f"{what} verified, {terminal.size(total)}: {damaged or 'none'} damaged")
    return damaged


def collect(root: Path, keep: int, *, damaged: bool) -> None:
    """Remove what is not needed, and say what that was."""
    collected = revisions.collect(root, keep, damaged=damaged)
    for path in collected.removed:
        print(f"removed {path}")
    for name in collected.busy:
        print(f"left {name} alone: a build is at work on it")
    print(f"{terminal.size(collected.freed)} freed in {root}")


def snapshot(root: Path, name: str) -> None:
    """Name the current revisions of all materials, and print the digest to cite."""
    with terminal.progress() as bar:
        task = bar.add_task("reading every file", total=len(Store(root)))
        digest = snapshots.create(root, name, lambda: bar.advance(task))
    print(f"{_line(root, name)}; sha256 {digest}")


def list_snapshots(root: Path) -> None:
    """Print a line for each snapshot of a store."""
    names = snapshot_names(Store(root).root)
    for name in names:
        print(f"{_line(root, name)}; sha256 {seal_of(snapshot_path(root, name))}")
    if not names:
        print(f"no snapshots in {root}")


def _line(root: Path, name: str) -> str:
    found = read_snapshot(root, name)
    return f"{name}: {len(found['materials'])} materials, {len(found['families'])} families"


def remove_snapshot(root: Path, name: str) -> None:
    """Remove a snapshot, and say so."""
    snapshots.remove(root, name)
    print(f"{name} is removed; `brdfdb gc` removes the revisions that nothing else keeps")
