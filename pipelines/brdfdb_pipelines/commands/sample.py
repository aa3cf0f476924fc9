"""The command `brdfdb sample`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from brdfdb_pipelines.commands._arguments import add_jobs, place, whole_number

HELP = "Write a training set: materials drawn over the ranges of a model, times directions, as one zarr group."
_MATERIALS, _DIRECTIONS = 10_000_000, 1_000_000


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
        help="number of pairs of directions, which all materials share",
    )
    parser.add_argument(
        "--out", type=place, required=True, metavar="SET.zarr", help="the group to write; the same command resumes it"
    )
    parser.add_argument(
        "--range",
        action="append",
        default=[],
        metavar="NAME=LOW:HIGH",
        help="range of a parameter in place of the usual one, as recipes write it; may be repeated",
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="the same seed draws the same set (default: %(default)s)"
    )
    parser.add_argument("--gradients", action="store_true", help="write the derivatives by the parameters, too")
    add_jobs(parser, "threads")


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
        jobs=options.jobs,
    )
    return 0


def _ranges(texts: Sequence[str]) -> dict[str, tuple[float, float]]:
    from brdfdb.errors import ParameterError

    ranges: dict[str, tuple[float, float]] = {}
    for text in texts:
        name, ends = _range(text)
        if name in ranges:
            raise ParameterError(f"--range {name}", "a parameter has one range, and this one has two", text)
        ranges[name] = ends
    return ranges


def _range(text: str) -> tuple[str, tuple[float, float]]:
    from brdfdb.errors import ParameterError

    name, _, ends = text.partition("=")
    low, _, high = ends.partition(":")
    try:
        return name, (float(low), float(high))
    except ValueError:
        raise ParameterError(f"--range {text}", "NAME=LOW:HIGH is a range, such as alpha_x=0.05:0.3", text) from None
