"""The command `brdfdb history`."""

from __future__ import annotations

import argparse

from brdfdb_pipelines.commands._arguments import add_store

HELP = "List the revisions of a material, the oldest first."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the material and the store."""
    parser.add_argument("name", metavar="NAME")
    add_store(parser)


def run(options: argparse.Namespace) -> int:
    """Print a line for each revision of the material, oldest first."""
    from brdfdb.errors import counted
    from brdfdb.store import revisions
    from brdfdb.store.summary_words import kind
    from brdfdb_pipelines import terminal

    history = revisions.history(options.store, options.name)
    terminal.print_table(
        f"{counted(len(history), 'revision')} of {options.name} in {options.store}",
        ("revision", "built", "model", "version", "stored", "request", ""),
        [
            (
                revision.name,
                revision.summary["created"],
                kind(revision.summary),
                str(revision.summary["model_version"]),
                terminal.size(revision.summary["bytes"]),
                revision.summary["request_sha256"][:8] or "-",
                "current" if revision.current else "",
            )
            for revision in history
        ],
        numbers=("version", "stored"),
    )
    return 0
