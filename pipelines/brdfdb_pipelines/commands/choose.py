"""The command `brdfdb choose`."""

from __future__ import annotations

import argparse
import sys

from brdfdb_pipelines.commands import INTERRUPTED
from brdfdb_pipelines.commands._arguments import MOST_WIDTH, add_out, add_scene, place, share_cores, whole_number

HELP = "Choose the cheapest form of each material that a scene cannot tell from the model."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the scene, the picture, and what is minimised."""
    add_scene(parser)
    add_out(parser, "brdf-choice")
    parser.add_argument(
        "--width",
        type=whole_number(MOST_WIDTH),
        default=128,
        metavar="N",
        help="pixels across the picture; choices are checked at four times as many other places (default: %(default)s)",
    )
    parser.add_argument(
        "--weigh",
        choices=("time", "bytes", "both"),
        default="time",
        help="cost to minimise; both is the product of time and bytes (default: %(default)s)",
    )
    parser.add_argument("--build", type=place, metavar="STORE", help="publish the chosen tables in this store")


def run(options: argparse.Namespace) -> int:
    """Choose for the scene."""
    share_cores()
    from brdfdb_pipelines import choose

    try:
        choose.run(options.scene, options.out, width=options.width, weigh=options.weigh, store=options.build)
    except KeyboardInterrupt:
        if options.build is None:
            raise
        print("brdfdb: interrupted; published tables stay", file=sys.stderr)
        return INTERRUPTED
    return 0
