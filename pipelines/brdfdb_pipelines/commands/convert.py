"""The command `brdfdb convert`."""

from __future__ import annotations

import argparse

from brdfdb_pipelines.commands._arguments import add_store, picture_file, place, share_cores

HELP = "Convert a material to another model: its closest parameters, and the error that is left."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the material, the model, what is kept, and the forms of the answer."""
    parser.add_argument("name", metavar="NAME", help="a preset, or a material of the recipe or the store")
    parser.add_argument("--to", required=True, metavar="MODEL", help="the model to convert to")
    add_store(parser)
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
        help="a parameter that is not searched, as recipes write it; may be repeated",
    )
    parser.add_argument(
        "--refractive-index",
        metavar="ENTRY",
        help="shelf/book/page of a model with n and k, or fit (default: that of the material; without one, fit)",
    )
    parser.add_argument(
        "--weigh",
        choices=("light", "lightness"),
        help="what is made least: l1, or a difference of cube roots (default: light, unless it loses the highlight)",
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument(
        "--picture", type=picture_file, metavar="FILE", help="write a picture of both, FILE.svg or FILE.png"
    )


def run(options: argparse.Namespace) -> int:
    """Search, and print the parameters with what is left."""
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
