"""The command `brdfdb gc`."""

from __future__ import annotations

import argparse

from brdfdb_pipelines.commands._arguments import add_store, whole_number

HELP = (
    "Remove interrupted builds that could be resumed, revisions that are neither current nor kept, and the remains of "
    "crashes. What a snapshot names stays, and so does everything of a material that is being built. Readers may be "
    "running: tables that they hold stay, and a revision that is removed while it is read is never read as data."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the store and what is kept."""
    add_store(parser)
    parser.add_argument(
        "--keep",
        type=whole_number(),
        default=2,
        metavar="N",
        help="revisions of each material that stay: the current one and the newest others (default: %(default)s)",
    )
    parser.add_argument(
        "--damaged",
        action="store_true",
        help="read all other revisions that stay, and remove those that are damaged and neither current nor in a "
        "snapshot",
    )


def run(options: argparse.Namespace) -> int:
    """Remove what is not needed, and print it."""
    from brdfdb.store import revisions
    from brdfdb_pipelines import terminal

    collected = revisions.collect(options.store, options.keep, damaged=options.damaged)
    for path in collected.removed:
        print(f"removed {path}")
    for name in collected.busy:
        print(f"left {name} alone: a build is at work on it")
    print(f"{terminal.size(collected.freed)} freed in {options.store}")
    return 0
