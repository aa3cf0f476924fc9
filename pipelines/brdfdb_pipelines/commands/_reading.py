"""Options that say how a file of measurements is read."""

from __future__ import annotations

import argparse
from typing import Any

# keys of recipes, too
_KEYS = ("format", "member", "quantity", "angles", "azimuth", "wavelength_unit", "side", "mueller_frame")
# words of brdfdb.measurements.conventions, which takes half a second to load
QUANTITIES = (
    *("f_r", "reflectance_factor", "percent", "reflectance_factor_percent", "log10", "ln", "decibel"),
    *("f_r_cos", "f_r_cos_i"),
)
ANGLE_WORDS = ("deg", "rad", "mrad", "elevation", "elevation_i", "elevation_r", "exchanged")
AZIMUTHS = ("light", "forward", "mirror", "absolute")
OPTIONS = (*_KEYS, "column", "where", "missing", "wavelength_nm", "coverage_factor")


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
        help="header of the column of a text file for NAME: theta_i, phi_i, theta_r, phi_r, delta_phi, from_specular "
        "(theta_r minus theta_i), rotation (of the sample), values, uncertainty or wavelength; may be repeated, also "
        "for several columns of values",
    )
    parser.add_argument(
        "--where",
        action="append",
        default=[],
        metavar="HEADER=VALUE",
        help="read only the rows of a text file that have this value in a column; may be repeated, also with other "
        "values of the column",
    )
    parser.add_argument(
        "--missing",
        type=float,
        metavar="NUMBER",
        help="number that marks values that were not measured, such as 1e-6 (default: -99, -999 and other usual ones)",
    )
    parser.add_argument(
        "--quantity",
        choices=QUANTITIES,
        metavar="QUANTITY",
        help=f"what the values of the file are: {', '.join(QUANTITIES)}; f_r_cos is f_r times the cosine of theta_r, "
        "f_r_cos_i that of theta_i (default: what the format, headers or titles state, else f_r)",
    )
    parser.add_argument(
        "--angles",
        metavar="WORDS",
        help=f"what the angles of the file are: {', '.join(ANGLE_WORDS)}, or several with commas; elevation counts "
        "from the surface, exchanged is theta for phi (default: as the format or headers state, else degrees)",
    )
    parser.add_argument(
        "--azimuth",
        choices=AZIMUTHS,
        help="from where azimuths count: those of viewers from the light, the mirror direction, or absolute ones from "
        "a direction of the surface; forward: those of lights are those into which it travels, on the mirror side "
        "(default: as the format or headers state)",
    )
    parser.add_argument(
        "--wavelength-unit",
        choices=("nm", "um", "m"),
        help="unit of the wavelengths in the file (default: as the format or headers state)",
    )
    parser.add_argument(
        "--coverage-factor",
        type=float,
        metavar="K",
        help="factor k of expanded uncertainties, which are divided by it (default: as headers state, else 1)",
    )
    parser.add_argument(
        "--wavelength-nm", type=float, metavar="NM", help="wavelength of a file with one channel that does not state it"
    )
    parser.add_argument("--member", metavar="NAME", help="file to read from an archive (.zip) (default: all)")
    parser.add_argument(
        "--mueller-frame",
        choices=("s", "p"),
        help="polarisation that Q > 0 means in the Mueller matrices of the file; ellipsometers mostly write p, with "
        "V > 0 clockwise (default: s)",
    )
    parser.add_argument(
        "--side", choices=("back", "front"), help="side of a Klems matrix, as named in the file (default: back)"
    )


def reading_keys(options: argparse.Namespace) -> dict[str, Any]:
    """Return the options as keys of `MeasuredTable`; ParameterError for a wavelength out of range or a wrong column."""
    from brdfdb.errors import ParameterError
    from brdfdb.formats._readings import check_wavelength
    from brdfdb.measurements.conventions import CONVENTION_KEYS, Convention

    for name in ("angles", "member"):
        if getattr(options, name) == "":
            raise ParameterError(f"--{name}", "it is empty; leave the option out, or state a word", "")
    keys: dict[str, Any] = {name: getattr(options, name) or "" for name in _KEYS}
    if options.wavelength_nm is not None:
        check_wavelength(options.wavelength_nm)
        keys["wavelength_nm"] = options.wavelength_nm
    if options.coverage_factor is not None:
        keys["coverage_factor"] = options.coverage_factor
    Convention(**{name: keys[name] for name in CONVENTION_KEYS if name in keys})
    if options.missing is not None:
        keys["missing"] = options.missing
    for key, option, form in (("columns", "column", "NAME=HEADER"), ("where", "where", "HEADER=VALUE")):
        pairs: dict[str, list[str]] = {}
        for text in getattr(options, option):
            name, sign, value = text.partition("=")
            if not (name and sign and value):
                raise ParameterError(f"--{option}", f"{text!r} is not {form}", text, form)
            pairs.setdefault(name.strip(), []).append(value.strip())
        keys[key] = pairs
    return keys
