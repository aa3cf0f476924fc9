"""Options that say how a file of measurements is read."""

from __future__ import annotations

import argparse
from typing import Any

_KEYS = ("format", "member", "quantity", "angles", "azimuth", "side")  # keys of recipes, too
OPTIONS = (*_KEYS, "column", "wavelength_nm")


def add_reading(parser: argparse.ArgumentParser) -> None:
    """Add the format of a file, the columns of a text, their units, and what a file may leave open."""
    parser.add_argument(
        "--format", default="", metavar="FORMAT", help="format of the file (default: recognised by its content)"
    )
    parser.add_argument(
        "--column",
        action="append",
        default=[],
        metavar="NAME=HEADER",
        help="header of the column of a text file for NAME: theta_i, phi_i, theta_r, phi_r, delta_phi, values, "
        "uncertainty or wavelength; may be repeated, also for several columns of values",
    )
    parser.add_argument(
        "--quantity",
        choices=("f_r", "reflectance_factor", "f_r_cos", "f_r_cos_i"),
        help="quantity of the values of a text file; f_r_cos is f_r times the cosine of theta_r, f_r_cos_i that of "
        "theta_i (default: as headers or titles state, else f_r)",
    )
    parser.add_argument(
        "--angles",
        choices=("deg", "rad"),
        help="unit of the angles of a text file (default: as headers state, else degrees)",
    )
    parser.add_argument(
        "--azimuth",
        choices=("light", "forward"),
        help="zero of azimuths in the file: the direction of the light, or the forward direction on the mirror side "
        "(default: light)",
    )
    parser.add_argument(
        "--wavelength-nm", type=float, metavar="NM", help="wavelength of a file with one channel that does not state it"
    )
    parser.add_argument("--member", metavar="NAME", help="file to read from an archive (.zip) (default: all)")
    parser.add_argument(
        "--side", choices=("back", "front"), help="side of a Klems matrix, as named in the file (default: back)"
    )


def reading_keys(options: argparse.Namespace) -> dict[str, Any]:
    """Return the options as keys of `MeasuredTable`; ParameterError for a wavelength out of range or a wrong column."""
    from brdfdb.errors import ParameterError
    from brdfdb.formats._readings import check_wavelength

    keys: dict[str, Any] = {name: getattr(options, name) or "" for name in _KEYS}
    if options.wavelength_nm is not None:
        check_wavelength(options.wavelength_nm)
        keys["wavelength_nm"] = options.wavelength_nm
    columns: dict[str, list[str]] = {}
    for text in options.column:
        name, sign, header = text.partition("=")
        if not (name and sign and header):
            raise ParameterError("--column", f"{text!r} is not NAME=HEADER", text, "NAME=HEADER")
        columns.setdefault(name, []).append(header)
    return keys | {"columns": columns}
