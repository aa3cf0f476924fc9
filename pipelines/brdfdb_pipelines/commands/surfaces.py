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
        metavar="N",
        help="realisations of each surface, with --out (default: as many as the maps of the program have)",
    )
    parser.add_argument(
        "--rays",
        type=whole_number(1 << 24),
        metavar="N",
        help="rays for each light in a realisation, with --out (default: as many as the maps of the program have)",
    )
    add_workers(parser, "FILE", threads=False)


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
    from brdfdb.errors import ParameterError
    from brdfdb_pipelines import surface_maps

    document = surface_maps.shipped()
    if options.out is None:
        for name in ("realisations", "rays"):
            if getattr(options, name) is not None:
                raise ParameterError(f"--{name}", "is allowed only with --out", getattr(options, name))
    else:
        from brdfdb_pipelines import surfaces, workers

        address = options.scheduler
        made = document["provenance"]
        realisations, rays = options.realisations or made["realisations"], options.rays or made["rays"]
        with workers.cluster(address) if address else workers.interruptible(options.jobs) as opened:
            document = surfaces.run(options.out, realisations=realisations, rays=rays, at=opened)
    names = surface_maps.chosen(document, options.models)
    surface_maps.print_maps(document, names)
    if options.picture is not None:
        from brdfdb_pipelines import surface_picture

        surface_picture.draw(document, names, options.picture)
