"""The command `brdfdb photograph`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from brdfdb_pipelines.commands._arguments import add_out, add_tables, place, whole_number

if TYPE_CHECKING:
    from brdfdb.measurements.gonioreflectometer import Gonioreflectometer

HELP = "Simulate Ward's gonioreflectometer: write pictures of a material as EXR for `brdfdb import` and `brdfdb fit`."

# Lights (theta_i, phi_i) [degree]: along the grain of an anisotropic surface, across it and between
LIGHTS = ((15.0, 0.0), (30.0, 45.0), (45.0, 90.0), (60.0, 20.0))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the material, the lights, and the instrument."""
    parser.add_argument("name", metavar="NAME", help="a preset, or a material of the recipe or the store")
    add_tables(parser)
    parser.add_argument("--recipe", type=place, metavar="FILE", help="a TOML file that defines materials")
    parser.add_argument(
        "--light",
        action="append",
        nargs=2,
        type=float,
        metavar=("THETA", "PHI"),
        help="direction of the light [degree]; may be repeated (default: 15 0, 30 45, 45 90 and 60 20)",
    )
    parser.add_argument(
        "--wavelength-nm", type=float, default=550.0, metavar="NM", help="wavelength (default: %(default)s)"
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="X=VALUE",
        help="setting of the instrument, such as blur_px=1 or exposures=1,0.1; may be repeated",
    )
    parser.add_argument(
        "--seed", type=whole_number(), default=1, metavar="N", help="seed of the noise (default: %(default)s)"
    )
    add_out(parser, "pictures")


def run(options: argparse.Namespace) -> int:
    """Write a picture for each direction of the light, and print the paths."""
    from brdfdb.errors import ParameterError, WriteError, import_extra

    for module in ("OpenEXR", "scipy.ndimage"):  # before the time is spent
        import_extra(module)

    from brdfdb.formats.gonioreflectometer import write_picture
    from brdfdb.geometry import check_azimuth_deg, radians
    from brdfdb.measurements.gonioreflectometer import photograph
    from brdfdb.parameters import check_nanometres
    from brdfdb_pipelines import terminal
    from brdfdb_pipelines.named_source import named_source

    name = options.name
    source = named_source(name, options.store, options.recipe).source
    terminal.say_without_glints("the pictures", source)
    instrument = instrument_of(options.set)
    wavelength_nm = check_nanometres("--wavelength-nm", [options.wavelength_nm])
    brdf = source.brdf_at(wavelength_nm if source.spectral else None)
    lights = options.light or LIGHTS
    for theta, phi in lights:
        check_azimuth_deg("--light", phi)
        if not 0.0 <= theta < 90.0:
            raise ParameterError("--light", f"{theta:g} degrees is not in [0, 90)", theta, (0.0, 90.0))
    try:
        options.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise WriteError(f"cannot write to {options.out}: {error.strerror or error}") from error
    paths = []
    with terminal.progress(counted=True, transient=True) as bar:
        task = bar.add_task(name, total=len(lights))
        for number, (theta, phi) in enumerate(lights):
            seed = options.seed + number
            picture = photograph(brdf, instrument, float(radians(theta)), float(radians(phi)), seed, name)
            paths.append(options.out / f"{name}_{theta:g}_{phi:g}.exr")
            write_picture(picture, paths[-1])
            bar.advance(task)
    for path in paths:
        print(path)
    return 0


def instrument_of(settings: Sequence[str]) -> Gonioreflectometer:
    """Return the instrument with settings ``name=value``; ParameterError for a setting that is not allowed."""
    from brdfdb.errors import ParameterError
    from brdfdb.measurements.gonioreflectometer import Gonioreflectometer

    known = {field.name: getattr(Gonioreflectometer(), field.name) for field in fields(Gonioreflectometer)}
    values: dict[str, Any] = {}
    for setting in settings:
        name, _, text = setting.partition("=")
        if name not in known:
            raise ParameterError(f"--set {setting}", f"the settings are {', '.join(known)}", name, tuple(known))
        kind = type(known[name])
        try:
            values[name] = tuple(map(float, text.split(","))) if kind is tuple else kind(text)
        except ValueError:
            raise ParameterError(
                f"--set {setting}", f"{text!r} is no {'list of numbers' if kind is tuple else 'number'}", text
            ) from None
    return Gonioreflectometer(**values)
