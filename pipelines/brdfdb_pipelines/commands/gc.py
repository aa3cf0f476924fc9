"""The command `brdfdb gc`."""

from __future__ import annotations

import argparse

from brdfdb_pipelines.commands._arguments import add_store, whole_number

HELP = (
    "Remove old revisions, interrupted builds (they can then not be resumed) and the remains of crashes. Revisions in "
    "a snapshot and materials that are being built are not changed. Readers may be running: a reader of a removed "
    "revision gets an error, and never wrong data."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the store, and which revisions stay."""
    add_store(parser)
    parser.add_argument(
        "--keep",
        type=whole_number(),
        default=2,
        metavar="N",
        help="number of revisions to preserve of each material: the current one and the newest others (default: "
        "%(default)s)",
    )
    parser.add_argument(
        "--damaged",
        action="store_true",
        help="also read the remaining revisions, and remove damaged ones that are neither current nor in a snapshot",
    )


def run(options: argparse.Namespace) -> int:
    """Remove what is not needed, and print it."""
    from brdfdb.store import revisions
    from brdfdb_pipelines import terminal

    collected = revisions.collect(options.store, options.keep, damaged=options.damaged)
    for path in collected.removed:
        print(f"removed {path}")
    for name in collected.busy:
        print(f"{name} was skipped: it is being built")
    print(f"{terminal.size(collected.freed)} freed in {options.store}")
    return 0
