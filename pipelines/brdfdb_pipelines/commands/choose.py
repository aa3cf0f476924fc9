"""The command `brdfdb choose`."""

from __future__ import annotations

import argparse
import sys

from brdfdb_pipelines.commands import INTERRUPTED
from brdfdb_pipelines.commands._arguments import MOST_WIDTH, add_out, add_scene, place, share_cores, whole_number

HELP = "Choose for each material of a scene the cheapest form whose picture looks like that of the exact model."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the scene, the picture, and what is minimised."""
    add_scene(parser)
    add_out(parser, "brdf-choice")
    parser.add_argument(
        "--width",
        type=whole_number(MOST_WIDTH),
        default=128,
        metavar="N",
        help="width of the picture [pixel]; choices are checked at 4 other points per pixel (default: %(default)s)",
    )
    parser.add_argument(
        "--weigh",
        choices=("time", "bytes", "both"),
        default="time",
        help="cost to minimise; both is the product of time and bytes (default: %(default)s)",
    )
    parser.add_argument("--build", type=place, metavar="STORE", help="write the chosen tables to this store")


def run(options: argparse.Namespace) -> int:
    """Choose for the scene."""
    share_cores()
    from brdfdb_pipelines import choose

    try:
        choose.run(options.scene, options.out, width=options.width, weigh=options.weigh, store=options.build)
    except KeyboardInterrupt:
        if options.build is None:
            raise
        print("brdfdb: interrupted; published tables are preserved", file=sys.stderr)
        return INTERRUPTED
    return 0
