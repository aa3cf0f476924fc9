"""The command `brdfdb convert`."""

from __future__ import annotations

import argparse

from brdfdb_pipelines.commands._arguments import add_tables, picture_file, place, share_cores

HELP = "Convert a material to another model: find the closest parameters, and state the remaining error."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the material, the model, fixed parameters, and the outputs."""
    parser.add_argument("name", metavar="NAME", help="a preset, or a material of the recipe or the store")
    parser.add_argument("--to", required=True, metavar="MODEL", help="the model to convert to")
    add_tables(parser)
    parser.add_argument(
        "--recipe", type=place, metavar="FILE", help="a TOML file that defines materials and their wavelengths"
    )
    parser.add_argument(
        "--wavelength-nm", type=float, nargs="+", metavar="NM", help="wavelengths (default: those of the material)"
    )
    parser.add_argument(
        "--fix",
        action="append",
        default=[],
        metavar="X=VALUE",
        help="set a parameter instead of searching for it, with the name and unit of recipes; may be repeated",
    )
    parser.add_argument(
        "--refractive-index",
        metavar="ENTRY",
        help="refractive index for models with n and k: shelf/book/page, or fit to search for n and k (default: that "
        "of the material, else fit)",
    )
    parser.add_argument(
        "--weigh",
        choices=("light", "lightness"),
        help="error to minimise: light is the l1 error, lightness a difference of cube roots (default: light, unless "
        "it loses the highlight)",
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--picture", type=picture_file, metavar="FILE", help="draw both models, FILE.svg or FILE.png")


def run(options: argparse.Namespace) -> int:
    """Search, and print the parameters with the remaining error."""
    share_cores()
    from brdfdb.errors import import_extra
    from brdfdb_pipelines import convert

    if options.picture is not None:
        import_extra("matplotlib")  # before the time is spent
    request = convert.ConversionRequest(
        model=options.to,
        wavelength_nm=options.wavelength_nm,
        fixed=options.fix,
        refractive_index=options.refractive_index,
        weigh=options.weigh,
    )
    convert.run(
        options.name,
        request,
        store=options.store,
        recipe_path=options.recipe,
        json=options.json,
        picture=options.picture,
    )
    return 0
