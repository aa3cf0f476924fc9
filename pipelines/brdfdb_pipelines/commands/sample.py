"""The command `brdfdb sample`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from brdfdb_pipelines.commands._arguments import add_jobs, place, whole_number

HELP = "Write a training set: f_r of random materials of a model at random directions, as one zarr group."
_MATERIALS = 10_000_000
_DIRECTIONS = 1_000_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the model, the numbers of materials and directions, the ranges and the file."""
    parser.add_argument("model", metavar="MODEL", help="the model whose materials are drawn")
    parser.add_argument(
        "--count", type=whole_number(_MATERIALS), required=True, metavar="N", help="number of materials"
    )
    parser.add_argument(
        "--directions",
        type=whole_number(_DIRECTIONS),
        required=True,
        metavar="N",
        help="number of pairs of directions; all materials have the same pairs",
    )
    parser.add_argument(
        "--out",
        type=place,
        required=True,
        metavar="SET.zarr",
        help="zarr group to write; repeat the command to resume after an interruption",
    )
    parser.add_argument(
        "--range",
        action="append",
        default=[],
        metavar="NAME=LOW:HIGH",
        help="range of a parameter instead of the usual one, with the name and unit of recipes; may be repeated",
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="the same seed draws the same set (default: %(default)s)"
    )
    parser.add_argument(
        "--gradients", action="store_true", help="also write the derivatives with respect to the parameters"
    )
    parser.add_argument(
        "--chunk",
        type=whole_number(_MATERIALS),
        metavar="N",
        help="materials of a chunk, the least part that is read and decoded (default: 1 MB)",
    )
    parser.add_argument(
        "--shard",
        type=whole_number(),
        metavar="N",
        help="materials of a shard, the part of an array in a file: a multiple of --chunk (default: 32 MB)",
    )
    parser.add_argument(
        "--test",
        type=float,
        default=0.0,
        metavar="SHARE",
        help="share of the materials for tests, such as 0.1: the last ones; no material is on both sides",
    )
    add_jobs(parser, "number of threads")


def run(options: argparse.Namespace) -> int:
    """Draw, evaluate and write."""
    from brdfdb_pipelines import sample

    sample.run(
        options.model,
        options.out,
        count=options.count,
        directions=options.directions,
        ranges=_ranges(options.range),
        seed=options.seed,
        gradients=options.gradients,
        chunk=options.chunk,
        shard=options.shard,
        test=options.test,
        jobs=options.jobs,
    )
    return 0


def _ranges(texts: Sequence[str]) -> dict[str, tuple[float, float]]:
    from brdfdb.errors import ParameterError

    ranges: dict[str, tuple[float, float]] = {}
    for text in texts:
        name, _, ends = text.partition("=")
        low, _, high = ends.partition(":")
        if name in ranges:
            raise ParameterError(f"--range {name}", "is given twice; a parameter has one range", text)
        try:
            ranges[name] = (float(low), float(high))
        except ValueError:
            raise ParameterError(f"--range {text}", "is not NAME=LOW:HIGH, such as alpha_x=0.05:0.3", text) from None
    return ranges
