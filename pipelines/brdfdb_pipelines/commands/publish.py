"""The command `brdfdb publish`."""

from __future__ import annotations

import argparse

from brdfdb_pipelines.commands._arguments import add_snapshot, add_store, tables

HELP = "Publish a store, or a snapshot of it, as an edition: a directory or a bucket that any web server can serve."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the destination, the store, its snapshot and the form of the arrays."""
    parser.add_argument(
        "destination", type=tables, metavar="DEST", help="a directory, s3://bucket/prefix, gs:// or az://"
    )
    add_store(parser)
    add_snapshot(parser)
    parser.add_argument(
        "--plain",
        action="store_true",
        help="also write f_r itself, as an array brdf, for programs that do not know the formula of the numbers",
    )
    parser.add_argument(
        "--rewrite",
        action="store_true",
        help="also write objects that DEST has already, to repair what `brdfdb verify --store DEST` finds",
    )


def run(options: argparse.Namespace) -> int:
    """Publish the edition, and print its size and its digest."""
    from brdfdb.errors import counted
    from brdfdb.store.edition.publishing import publish_edition
    from brdfdb.store.reader import Store
    from brdfdb_pipelines import terminal

    with terminal.progress() as bar:
        task = bar.add_task("publishing tables", total=len(Store(options.store, snapshot=options.snapshot)))
        edition = publish_edition(
            options.store,
            options.destination,
            options.snapshot,
            plain=options.plain,
            rewrite=options.rewrite,
            advance=lambda: bar.advance(task),
        )
    plain = f", {terminal.size(edition.plain_bytes)} of them f_r itself" if options.plain else ""
    print(
        f"{counted(edition.materials, 'material')} in {counted(edition.objects, 'object')}, "
        f"{terminal.size(edition.bytes)}{plain}, at {options.destination}; sha256 {edition.digest}"
        + (edition.replaced and f"; it replaces {edition.replaced}")
    )
    return 0
