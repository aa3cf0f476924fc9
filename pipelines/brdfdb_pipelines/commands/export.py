"""The command `brdfdb export FORMAT`."""

from __future__ import annotations

import argparse

from brdfdb.errors import ParameterError
from brdfdb_pipelines.commands._arguments import add_out, add_store

HELP = "Write slices of tables as image files."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the format and its arguments."""
    # a command a format: argparse takes no NAME after an option that follows another positional argument
    formats = parser.add_subparsers(required=True, metavar="FORMAT")
    sentence = "Write slices of tables as OpenEXR files."
    exr = formats.add_parser("exr", help=sentence, description=sentence)
    exr.add_argument("names", nargs="*", metavar="NAME", help="materials")
    add_store(exr)
    exr.add_argument("--all", action="store_true", help="every material of the store")
    add_out(exr, "brdf-exr")
    exr.add_argument("--half", action="store_true", help="16-bit floats, for viewing (default: 32-bit, for data)")


def run(options: argparse.Namespace) -> int:
    """Write the files."""
    from brdfdb_pipelines import export

    if bool(options.names) == options.all:
        raise ParameterError("export", "name materials, or give --all")
    export.run_exr(options.store, options.names, options.out, half=options.half)
    return 0
