"""The command `brdfdb verify`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from brdfdb_pipelines.commands import REFUSED
from brdfdb_pipelines.commands._arguments import add_tables

if TYPE_CHECKING:
    from brdfdb.store.edition.reader import Edition

HELP = (
    "Verify the files of tables, families and snapshots: sizes, sha256, crc32c of each chunk, dimensions, attributes. "
    "For all damage, print the command that repairs it. Of an edition, verify every object."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the materials and the store."""
    parser.add_argument("names", nargs="*", metavar="NAME", help="materials and families (default: all)")
    add_tables(parser)


def run(options: argparse.Namespace) -> int:
    """Verify materials and families, by default all of the store and its snapshots; print each damage."""
    from brdfdb.errors import StoreError, UnknownMaterialError, counted
    from brdfdb.store import open_tables, verification
    from brdfdb.store.reader import Store
    from brdfdb_pipelines import terminal

    root = options.store
    store = open_tables(root)
    if not isinstance(store, Store):
        return _verify_edition(store, options.names)
    families = store.families()
    wanted = list(dict.fromkeys(options.names)) or [*store, *(name for name in families if name not in store)]
    for name in wanted:
        if name not in store and name not in families:
            unknown = UnknownMaterialError(name, [*store, *families])
            if "://" in name or Path(name).exists():
                raise StoreError(f"{unknown}; to verify an edition, give --store {name}")
            raise unknown
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


def _verify_edition(edition: Edition, names: list[str]) -> int:
    """Verify the objects of an edition, by default all; print each damage."""
    from brdfdb.errors import UnknownMaterialError, counted
    from brdfdb.store.edition.verification import damages
    from brdfdb_pipelines import terminal

    for name in names:
        if name not in edition:
            raise UnknownMaterialError(name, edition)
    groups = edition.entries(names)
    with terminal.progress() as bar:
        task = bar.add_task("verifying groups", total=len(groups))
        found = list(damages(edition, names, lambda: bar.advance(task)))
    for sentence in found:
        print(
            f"brdfdb: {sentence}; `brdfdb publish` or `brdfdb build --to`, with --rewrite, writes it again",
            file=sys.stderr,
        )
    materials = sum(entry["materials"] for entry in groups)
    size = sum(entry["bytes"] for entry in groups)
    print(
        f"{counted(materials, 'material')} in {counted(len(groups), 'group')} verified, {terminal.size(size)}: "
        f"{len(found) or 'none'} damaged"
    )
    return REFUSED if found else 0
