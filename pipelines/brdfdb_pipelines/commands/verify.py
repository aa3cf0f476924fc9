"""The command `brdfdb verify`."""

from __future__ import annotations

import argparse
import sys

from brdfdb_pipelines.commands import REFUSED
from brdfdb_pipelines.commands._arguments import add_store

HELP = (
    "Verify the files of tables, families and snapshots: sizes, sha256, crc32c of each chunk, dimensions, attributes. "
    "For all damage, print the command that repairs it."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the materials and the store."""
    parser.add_argument("names", nargs="*", metavar="NAME", help="materials and families (default: all)")
    add_store(parser)


def run(options: argparse.Namespace) -> int:
    """Verify materials and families, by default all of the store and its snapshots; print each damage."""
    from brdfdb.errors import UnknownMaterialError, counted
    from brdfdb.store import verification
    from brdfdb.store.reader import Store
    from brdfdb_pipelines import terminal

    root = options.store
    store = Store(root)
    families = store.families()
    wanted = list(dict.fromkeys(options.names)) or [*store, *(name for name in families if name not in store)]
    for name in wanted:
        if name not in store and name not in families:
            raise UnknownMaterialError(name, [*store, *families])
    findings = []
    total = 0
    with terminal.progress() as bar:
        task = bar.add_task("verifying tables", total=len(wanted))
        for name in wanted:
            size, wrong = (verification.material if name in store else verification.family)(root, name)
            total += size
            findings += wrong
            bar.advance(task)
    findings += [] if options.names else verification.snapshots(root)
    for finding in findings:
        print(f"brdfdb: {finding}", file=sys.stderr)
    family_count = sum(name not in store for name in wanted)
    what = counted(len(wanted) - family_count, "material")
    what += f" and {family_count} {'family' if family_count == 1 else 'families'}" if family_count else ""
    damaged = len({finding.name for finding in findings if not finding.remark})
    print(f"{what} verified, {terminal.size(total)}: {damaged or 'none'} damaged")
    return REFUSED if damaged else 0
