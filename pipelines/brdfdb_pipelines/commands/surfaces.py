"""The command `brdfdb surfaces`."""

from __future__ import annotations

import argparse
import shlex
import sys

from brdfdb_pipelines.commands import INTERRUPTED
from brdfdb_pipelines.commands._arguments import add_workers, picture_file, place, share_cores, whole_number

HELP = "Show the error of models against rays on Gaussian surfaces, draw its maps, or compute them again."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the models, the files, and the number of rays and workers."""
    parser.add_argument("models", nargs="*", metavar="MODEL", help="models to show (default: all that have a map)")
    parser.add_argument(
        "--picture", type=picture_file, metavar="FILE", help="SVG or PNG to draw, of the maps of these models"
    )
    parser.add_argument(
        "--out",
        type=place,
        metavar="FILE",
        help="trace all surfaces again, and write this JSON file; repeat the command to resume after an interruption",
    )
    parser.add_argument(
        "--realisations",
        type=whole_number(10_000),
        default=32,
        metavar="N",
        help="maps drawn of each surface, with --out (default: %(default)s)",
    )
    parser.add_argument(
        "--rays",
        type=whole_number(1 << 24),
        default=1 << 14,
        metavar="N",
        help="light paths of each of them, with --out (default: %(default)s)",
    )
    add_workers(parser, "FILE")


def run(options: argparse.Namespace) -> int:
    """Compute the maps, or read those of the program; print them, and draw them."""
    share_cores()
    try:
        _run(options)
    except KeyboardInterrupt:
        if options.out is None:
            raise
        resume = shlex.join(["brdfdb", *options.arguments])
        print(f"brdfdb: interrupted; finished surfaces are preserved; to resume: {resume}", file=sys.stderr)
        return INTERRUPTED
    return 0


def _run(options: argparse.Namespace) -> None:
    from brdfdb_pipelines import surface_maps

    if options.out is None:
        document = surface_maps.shipped()
    else:
        from brdfdb_pipelines import surfaces, workers

        if options.scheduler:
            at = workers.cluster(options.scheduler)
        else:
            at = (workers.processes if options.processes else workers.threads)(options.jobs)
        with at as opened:
            document = surfaces.run(options.out, realisations=options.realisations, rays=options.rays, at=opened)
    names = surface_maps.chosen(document, options.models)
    surface_maps.print_maps(document, names)
    if options.picture is not None:
        from brdfdb_pipelines import surface_picture

        surface_picture.draw(document, names, options.picture)
