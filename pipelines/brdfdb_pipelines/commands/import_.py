"""The command `brdfdb import`."""

from __future__ import annotations

import argparse

from brdfdb_pipelines.commands import REFUSED, VIOLATED
from brdfdb_pipelines.commands._arguments import add_jobs, place, share_cores
from brdfdb_pipelines.commands._reading import add_reading, reading_keys

HELP = "Import measurements: state their coverage, albedos and metadata, and make audited tables of them."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the files, the meaning of their columns, and the outputs."""
    parser.add_argument(
        "files",
        nargs="+",
        type=place,
        metavar="FILE",
        help="a file of measurements, a folder of such files, or a zarr group",
    )
    add_reading(parser)
    parser.add_argument(
        "--join", action="store_true", help="join all files into one set of samples of the same surface"
    )
    parser.add_argument(
        "--full", action="store_true", help="print the whole statement on each of several files, not a line"
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--out", type=place, metavar="FILE.nc", help="write the samples of a single file as netCDF")
    tables = parser.add_argument_group("tables")
    tables.add_argument(
        "--store", type=place, metavar="DIR", help="build tables of the samples in this store, and audit them"
    )
    tables.add_argument(
        "--recipe",
        type=place,
        metavar="FILE.toml",
        help="write the recipe with which `brdfdb build` makes the same tables",
    )
    tables.add_argument(
        "--tolerance",
        type=float,
        metavar="E",
        help="largest relative error of 95 %% of the values of a table, 0.0001 to 0.5 (default: 0.05)",
    )
    tables.add_argument(
        "--polarised", action="store_true", help="tabulate the Mueller matrices of the file, too (default: f_r alone)"
    )
    tables.add_argument("--reciprocal", action="store_true", help="change the values to the nearest reciprocal ones")
    tables.add_argument(
        "--conserving", action="store_true", help="change the values to the nearest ones without an albedo above 1"
    )
    tables.add_argument(
        "--name",
        metavar="NAME",
        help="name of the material, if it is a single one (default: from the name of the file)",
    )
    tables.add_argument("--title", metavar="TEXT", help="title of the material (default: the name in the file)")
    tables.add_argument(
        "--source", metavar="TEXT", help="who measured it, and where it is published (default: as the file states)"
    )
    add_jobs(parser, "number of processes")


def run(options: argparse.Namespace) -> int:
    """Read the files, print a statement on each, and make tables; return the exit code of the command."""
    share_cores()
    from brdfdb.errors import ParameterError
    from brdfdb_pipelines import import_samples

    keys = reading_keys(options)
    of_table = ("tolerance", "polarised", "reciprocal", "conserving", "name", "title", "source")
    tables = None
    if options.store is not None or options.recipe is not None:
        tables = import_samples.Tables(
            store=options.store,
            recipe=options.recipe,
            name=options.name,
            title=options.title,
            tolerance=import_samples.TOLERANCE if options.tolerance is None else options.tolerance,
            jobs=options.jobs,
        )
    else:
        for name in of_table:
            if getattr(options, name) not in (None, False):
                raise ParameterError(
                    f"--{name}", "is allowed only together with --store or --recipe", getattr(options, name)
                )
    made = {name: True for name in ("polarised", "reciprocal", "conserving") if getattr(options, name)}
    source = {} if options.source is None else {"source": options.source}
    result = import_samples.run(
        options.files,
        {**keys, **made, **source},
        join=options.join,
        json=options.json,
        full=options.full,
        out=options.out,
        tables=tables,
    )
    if result.refused:
        return REFUSED
    return VIOLATED if result.report is not None and result.report.violations else 0
