"""The command `brdfdb photograph`."""

from __future__ import annotations

import argparse

from brdfdb_pipelines.commands._arguments import add_out, add_store, place, whole_number

HELP = "Simulate Ward's gonioreflectometer: pictures of a material as EXR, which `brdfdb import` and `fit` read."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the material, the lights, and the instrument."""
    parser.add_argument("name", metavar="NAME", help="a preset, or a material of the recipe or the store")
    add_store(parser)
    parser.add_argument("--recipe", type=place, metavar="FILE", help="a TOML file that defines materials")
    parser.add_argument(
        "--light",
        action="append",
        nargs=2,
        type=float,
        metavar=("THETA", "PHI"),
        help="a direction of the light [degrees]; may be repeated (default: 15 0, 30 45, 45 90 and 60 20)",
    )
    parser.add_argument("--wavelength-nm", type=float, default=550.0, metavar="NM", help="(default: %(default)s)")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="X=VALUE",
        help="a setting of the instrument, such as blur_px=1 or exposures=1,0.1; may be repeated",
    )
    parser.add_argument(
        "--seed", type=whole_number(), default=1, metavar="N", help="of the noise (default: %(default)s)"
    )
    add_out(parser, "pictures")


def run(options: argparse.Namespace) -> int:
    """Write a picture for each light."""
    from brdfdb.errors import import_extra

    for module in ("OpenEXR", "scipy.ndimage"):  # before the time is spent
        import_extra(module)
    from brdfdb_pipelines import photograph

    photograph.run(
        options.name,
        options.light or photograph.LIGHTS,
        options.out,
        store=options.store,
        recipe_path=options.recipe,
        wavelength_nm=options.wavelength_nm,
        settings=options.set,
        seed=options.seed,
    )
    return 0
