"""The command `brdfdb plot`."""

from __future__ import annotations

import argparse

from brdfdb_pipelines.commands._arguments import add_out, add_store

HELP = "Plot materials: lobe, cuts, albedo and slices, as PNG or SVG."

KINDS = ("lobe", "cuts", "albedo", "slices")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the materials, the kind of plot and the format."""
    parser.add_argument("names", nargs="+", metavar="NAME", help="materials")
    add_store(parser)
    parser.add_argument("--kind", choices=KINDS, metavar="KIND", help=f"{', '.join(KINDS)} (default: all of them)")
    parser.add_argument("--format", choices=("png", "svg"), default="png", help="format of the files (default: png)")
    parser.add_argument("--wavelength", type=float, metavar="NM", help="wavelength in nanometres (default: 550)")
    add_out(parser, "brdf-plots")


def run(options: argparse.Namespace) -> int:
    """Write NAME-KIND.FORMAT for each material and kind."""
    from brdfdb.errors import import_extra

    import_extra("matplotlib")  # before the store is read
    from brdfdb_pipelines import table_plots

    kinds = KINDS if options.kind is None else (options.kind,)
    table_plots.run(options.store, options.names, kinds, options.format, options.wavelength, options.out)
    return 0
