"""The command `brdfdb rollback`."""

from __future__ import annotations

import argparse

from brdfdb_pipelines.commands._arguments import add_store

HELP = "Verify another revision of a material and make it current."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the material, the revision and the store."""
    parser.add_argument("name", metavar="NAME")
    parser.add_argument("revision", metavar="REVISION", help="such as r000001; `brdfdb history NAME` lists them")
    add_store(parser)


def run(options: argparse.Namespace) -> int:
    """Make the revision current, and print which one was."""
    from brdfdb.store import revisions

    before = revisions.rollback(options.store, options.name, options.revision)
    if before == options.revision:
        result = "was current already"
    elif before:
        result = f"is current now, instead of {before}"
    else:
        result = "is current now; HEAD.json was missing or damaged"
    print(f"{options.name}: {options.revision} {result}")
    return 0
