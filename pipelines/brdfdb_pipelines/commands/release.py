"""The command `brdfdb release`."""

from __future__ import annotations

import argparse

from brdfdb_pipelines.commands._arguments import place

HELP = (
    "Make a release from a clean clone: wheel and sdist, the default database as an edition, the site, documents that "
    "cite and describe them, and checksums."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the directory."""
    parser.add_argument("out", type=place, metavar="OUT", help="directory to make; it must not exist, or be empty")


def run(options: argparse.Namespace) -> int:
    """Make the release and print what is in it."""
    from brdfdb.distribution import UNSTATED, distribution
    from brdfdb_pipelines import release, terminal

    edition = release.run(options.out)
    size = terminal.size(edition.bytes)
    print(f"{options.out}: {edition.title}; edition of {edition.objects} files, {size}, sha256 {edition.digest}")
    if distribution().authors == (UNSTATED,) or not distribution().licence:
        print(
            f"before publication, state authors and licence in pyproject.toml; files say {UNSTATED!r} in their places"
        )
    return 0
