"""The command `brdfdb import`."""

from __future__ import annotations

import argparse
from pathlib import Path

HELP = "Import measurements: read files of others, and state what they cover, integrate to and claim."


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
    parser.add_argument("--angles", choices=("deg", "rad"), help="unit of the angles of a text (default: by its names)")
    parser.add_argument("--member", metavar="NAME", help="the file of an archive (.zip) that is read")
    parser.add_argument(
        "--side", choices=("back", "front"), help="side of a Klems matrix, as the file names it (default: back)"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--out", type=Path, metavar="FILE.nc", help="write the samples of one file as netCDF")


def run(options: argparse.Namespace) -> int:
    """Read the files, and print a statement on each."""
    from brdfdb_pipelines import import_samples

    import_samples.run(
        options.files,
        file_format=options.format,
        columns=options.column,
        more={name: getattr(options, name) for name in ("quantity", "angles", "member", "side")},
        json=options.json,
        out=options.out,
    )
    return 0
