"""The command `brdfdb gallery`."""

from __future__ import annotations

import argparse

from brdfdb_pipelines.commands._arguments import add_jobs, add_tables, sheet_file

HELP = "Draw a contact sheet with a lit sphere of each material, as PNG or EXR."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the store, the materials and the file."""
    parser.add_argument("names", nargs="*", metavar="NAME", help="materials (default: all of the store)")
    add_tables(parser)
    add_jobs(parser, "number of threads")
    parser.add_argument(
        "--out",
        type=sheet_file,
        default="brdf-gallery.png",
        metavar="FILE",
        help="file to write: PNG, or EXR in linear light (default: %(default)s)",
    )


def run(options: argparse.Namespace) -> int:
    """Write the contact sheet."""
    from brdfdb.errors import import_extra

    for module in ("colour", "matplotlib.image", "scipy.ndimage"):  # before the time is spent
        import_extra(module)
    from brdfdb_pipelines import contact_sheet

    contact_sheet.run(options.store, options.names, options.out, options.jobs)
    return 0
