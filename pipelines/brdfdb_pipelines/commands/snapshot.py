"""The command `brdfdb snapshot`."""

from __future__ import annotations

import argparse
from pathlib import Path

from brdfdb.errors import ParameterError, counted
from brdfdb_pipelines.commands._arguments import add_store

HELP = "Record the current revisions of all materials and families under a name; without a name, list the snapshots."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the name and the store."""
    parser.add_argument("name", nargs="?", metavar="NAME", help="lower-case letters, digits and single hyphens")
    add_store(parser)
    parser.add_argument(
        "--remove", action="store_true", help="remove the snapshot; `brdfdb gc` can then remove its revisions"
    )


def run(options: argparse.Namespace) -> int:
    """Make, remove or list snapshots."""
    from brdfdb.store import snapshots
    from brdfdb.store.reader import Store
    from brdfdb.store.records import snapshot_names
    from brdfdb_pipelines import terminal

    root: Path = options.store
    if options.remove and options.name is None:
        raise ParameterError("snapshot", "--remove requires the NAME of a snapshot")
    if options.remove:
        snapshots.remove(root, options.name)
        print(
            f"{options.name} was removed; `brdfdb gc` removes revisions that are in no other snapshot and not current"
        )
    elif options.name is not None:
        with terminal.progress() as bar:
            task = bar.add_task("reading tables", total=len(Store(root)))
            snapshots.create(root, options.name, lambda: bar.advance(task))
        _print_contents(root, options.name)
    else:
        names = snapshot_names(Store(root).root)
        for name in names:
            _print_contents(root, name)
        if not names:
            print(f"no snapshots in {root}")
    return 0


def _print_contents(root: Path, name: str) -> None:
    """Print the numbers of materials and families of a snapshot, and its digest, which can be cited."""
    from brdfdb.store.files import seal_of
    from brdfdb.store.paths import snapshot_path
    from brdfdb.store.records import read_snapshot

    content = read_snapshot(root, name)
    families = "1 family" if len(content["families"]) == 1 else f"{len(content['families'])} families"
    numbers = f"{counted(len(content['materials']), 'material')}, {families}"
    print(f"{name}: {numbers}; sha256 {seal_of(snapshot_path(root, name))}")
