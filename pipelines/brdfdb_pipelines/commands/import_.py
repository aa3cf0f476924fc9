"""The command `brdfdb import`."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from pathlib import Path

from brdfdb_pipelines.commands._arguments import add_jobs
from brdfdb_pipelines.exit_codes import REFUSED, VIOLATED

HELP = "Import measurements: state what files of others cover, integrate to and claim, and make audited tables of them."

_KEYS = ("format", "member", "quantity", "angles", "azimuth", "side")  # options that are keys of a recipe


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the files, what their columns are, and the forms of the answer."""
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE", help="a file of measurements, or a zarr group")
    parser.add_argument(
        "--format", default="", metavar="FORMAT", help="its format (default: recognised by its content)"
    )
    parser.add_argument(
        "--column",
        action="append",
        default=[],
        metavar="NAME=HEADER",
        help="the column of a text that is theta_i, phi_i, theta_r, phi_r, delta_phi, values, uncertainty or "
        "wavelength; may be repeated, for values with several columns, too",
    )
    parser.add_argument(
        "--quantity",
        choices=("f_r", "reflectance_factor", "f_r_cos"),
        help="quantity of the values of a text (default: the one that its names or titles give, else f_r)",
    )
    parser.add_argument(
        "--angles", choices=("deg", "rad"), help="unit of the angles of a text (default: by its names, else degrees)"
    )
    parser.add_argument(
        "--azimuth",
        choices=("light", "forward"),
        help="direction from which the file counts azimuths: the light, or the one into which it travels, so that 0 is "
        "the mirror side (default: light)",
    )
    parser.add_argument(
        "--wavelength-nm", type=float, metavar="NM", help="wavelength of a file of one channel that states none"
    )
    parser.add_argument("--member", metavar="NAME", help="the file of an archive (.zip) that is read (default: all)")
    parser.add_argument(
        "--side", choices=("back", "front"), help="side of a Klems matrix, as the file names it (default: back)"
    )
    parser.add_argument("--join", action="store_true", help="take all files as one set of samples, of one surface")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--out", type=Path, metavar="FILE.nc", help="write the samples of one file as netCDF")
    tables = parser.add_argument_group("tables")
    tables.add_argument(
        "--store", type=Path, metavar="DIR", help="tabulate the samples in this store, and audit the tables"
    )
    tables.add_argument(
        "--recipe",
        type=Path,
        metavar="FILE.toml",
        help="write the recipe with which brdfdb build makes the same tables",
    )
    tables.add_argument(
        "--tolerance",
        type=float,
        metavar="E",
        help="relative error against the data that 95 of 100 values of a table keep to, 0.0001 to 0.5 (default: 0.05)",
    )
    tables.add_argument("--reciprocal", action="store_true", help="tabulate the nearest values that are reciprocal")
    tables.add_argument("--conserving", action="store_true", help="tabulate the nearest values with no albedo above 1")
    tables.add_argument("--name", metavar="NAME", help="name of the one material (default: that of the file, as words)")
    tables.add_argument("--title", metavar="TEXT", help="a line for people (default: the name in the file)")
    tables.add_argument("--source", metavar="TEXT", help="who measured, where it is published (default: the file's)")
    add_jobs(parser, "processes")


def run(options: argparse.Namespace) -> int:
    """Read the files, print a statement on each, and make tables; return the exit code of the command."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # processes fill the cores: threads beside them wait
    from brdfdb.errors import ParameterError
    from brdfdb.formats._stated import check_wavelength
    from brdfdb_pipelines import import_samples
    from brdfdb_pipelines.import_tables import TOLERANCE, Tables

    keys = {name: getattr(options, name) or "" for name in _KEYS}
    if options.wavelength_nm is not None:
        check_wavelength(options.wavelength_nm)
        keys["wavelength_nm"] = options.wavelength_nm
    of_table = ("tolerance", "reciprocal", "conserving", "name", "title", "source")
    tables = None
    if options.store is not None or options.recipe is not None:
        tables = Tables(
            store=options.store,
            recipe=options.recipe,
            name=options.name,
            title=options.title,
            tolerance=TOLERANCE if options.tolerance is None else options.tolerance,
            jobs=options.jobs,
        )
    else:
        for name in of_table:
            if getattr(options, name) not in (None, False):
                raise ParameterError(f"--{name}", "it goes with --store or --recipe", getattr(options, name))
    made = {name: True for name in ("reciprocal", "conserving") if getattr(options, name)}
    source = {} if options.source is None else {"source": options.source}
    result = import_samples.run(
        options.files,
        {**keys, "columns": _columns(options.column), **made, **source},
        join=options.join,
        json=options.json,
        out=options.out,
        tables=tables,
    )
    if result.refused:
        return REFUSED
    return VIOLATED if result.report is not None and result.report.violations else 0


def _columns(texts: Sequence[str]) -> dict[str, list[str]]:
    """Return the headers of each column from texts NAME=HEADER; ParameterError if one is not written so."""
    from brdfdb.errors import ParameterError

    columns: dict[str, list[str]] = {}
    for text in texts:
        name, sign, header = text.partition("=")
        if not (name and sign and header):
            raise ParameterError("--column", f"{text!r} is not NAME=HEADER", text, "NAME=HEADER")
        columns.setdefault(name, []).append(header)
    return columns
