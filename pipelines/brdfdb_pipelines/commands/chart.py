"""The command `brdfdb chart`."""

from __future__ import annotations

import argparse

from brdfdb_pipelines.commands._arguments import add_out, add_tables, place

HELP = "Chart error against cost for all forms of materials or families; write pictures and JSON."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the materials, the store, the recipe and the tolerances."""
    parser.add_argument(
        "names",
        nargs="+",
        metavar="NAME",
        help="presets, or materials and families of the recipe or the store",
    )
    add_tables(parser)
    add_out(parser, "brdf-chart")
    parser.add_argument(
        "--recipe", type=place, metavar="FILE", help="a TOML file that defines materials, families and wavelengths"
    )
    parser.add_argument(
        "--tolerance",
        type=float,
        action="append",
        metavar="X",
        help="tolerance of a table to compare; may be repeated (default: 0.1, 0.01 and, for grey materials, 0.001)",
    )


def run(options: argparse.Namespace) -> int:
    """Chart the materials and families."""
    from brdfdb_pipelines import chart

    chart.run(options.names, options.out, store=options.store, recipe_path=options.recipe, tolerances=options.tolerance)
    return 0
