"""The command `brdfdb simulate`."""

from __future__ import annotations

import argparse
import shlex
import sys
from typing import Any

from brdfdb_pipelines.commands import INTERRUPTED, VIOLATED
from brdfdb_pipelines.commands._arguments import add_jobs, numbers, place, share_cores, whole_number
from brdfdb_pipelines.commands.topography import add_reading

HELP = (
    "Simulate the BRDF of a rough surface by rays, and make an audited table of it. The surface is made, or a height "
    "map in a file."
)
_KINDS = ("gaussian", "exponential", "band", "grooves", "gaussian-grooves")  # those of MadeSurface


def _add_surface(parser: argparse.ArgumentParser) -> None:
    """Add the made surface, or the height map, how it is read, and its filter."""
    surface = parser.add_argument_group("surface")
    surface.add_argument("--surface", choices=_KINDS, help="kind of a made surface")
    surface.add_argument(
        "--slope-deg",
        type=float,
        metavar="DEG",
        help="angle whose tangent is the standard deviation of the slopes along x; of grooves the angle of their walls",
    )
    surface.add_argument("--slope-y-deg", type=float, metavar="DEG", help="the same along y (default: as along x)")
    surface.add_argument("--all-azimuths", action="store_true", help="grooves run in all directions")
    surface.add_argument(
        "--nodes", type=whole_number(), metavar="N", help="nodes of a made map along each axis (default: 512)"
    )
    surface.add_argument("--height-map", type=place, metavar="FILE", help="a file of heights, in place of --surface")
    turned = surface.add_mutually_exclusive_group()
    turned.add_argument(
        "--isotropic",
        action="store_const",
        const=True,
        help="the map stands for a surface without a direction (default: decided by its slopes)",
    )
    turned.add_argument(
        "--anisotropic", action="store_const", const=False, dest="isotropic", help="the surface has a direction"
    )
    add_reading(parser, holes=("refuse", "fill"))
    surface.add_argument(
        "--s-filter-um",
        type=float,
        metavar="UM",
        help="cutoff of a Gaussian filter, which takes shorter waves and noise out of the height map; 0 is no filter "
        "(default: no filter, and a noisy map is refused)",
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the surface, its facets, when to stop, and the outputs."""
    _add_surface(parser)
    facets = parser.add_argument_group("facets")
    facets.add_argument("--facets", choices=("lambert", "mirror", "mixture"), help="reflection (default: lambert)")
    facets.add_argument(
        "--rho", type=numbers, metavar="RHO", help="albedo of Lambertian facets, or one for each wavelength"
    )
    facets.add_argument("--mirror", type=float, metavar="WEIGHT", help="weight of the mirror-like part of a mixture")
    facets.add_argument(
        "--n", type=numbers, metavar="N", help="refractive index of mirrors (default: they reflect all)"
    )
    facets.add_argument("--k", type=numbers, metavar="K", help="extinction coefficient of mirrors (default: 0)")
    facets.add_argument(
        "--refractive-index",
        metavar="ENTRY",
        help="in place of N and K: a substance such as Cu, SHELF/BOOK/PAGE of refractiveindex.info, or constant/N/K",
    )
    facets.add_argument("--wavelengths-nm", type=numbers, metavar="NM,NM,...", help="wavelengths of spectra")
    effort = parser.add_argument_group("effort")
    effort.add_argument(
        "--standard-error",
        type=float,
        metavar="E",
        help="relative standard error at which to stop, where f_r exceeds a hundredth of its peak (default: 0.02)",
    )
    effort.add_argument(
        "--realisations",
        type=whole_number(),
        metavar="N",
        help="most realisations: maps of a made surface, or repetitions of a part of a height map (default: 256)",
    )
    effort.add_argument(
        "--rays", type=whole_number(), metavar="N", help="rays for each light in a realisation (default: 4096)"
    )
    effort.add_argument("--seed", type=int, metavar="N", help="seed (default: 0)")
    add_jobs(parser, "number of processes")
    effort.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="use the dask cluster of this scheduler, such as tcp://10.0.0.1:8786; its workers must see DIR under the "
        "same path",
    )
    outputs = parser.add_argument_group("outputs")
    outputs.add_argument("--store", type=place, metavar="DIR", help="build a table in this store, and audit it")
    outputs.add_argument("--out", type=place, metavar="FILE.nc", help="write samples as netCDF in place of a table")
    outputs.add_argument("--recipe", type=place, metavar="FILE.toml", help="write the recipe of the same table")
    outputs.add_argument(
        "--tolerance",
        type=float,
        metavar="E",
        help="largest relative error of 95 %% of the values of the table, 0.0001 to 0.5 (default: 0.05)",
    )
    outputs.add_argument(
        "--not-conserving",
        action="store_const",
        const=False,
        dest="conserving",
        help="leave albedos above 1, which noise makes (default: change the values to the nearest ones without)",
    )
    outputs.add_argument("--name", metavar="NAME", help="name of the material (default: from surface and facets)")
    outputs.add_argument("--title", metavar="TEXT", help="title of the material")
    outputs.add_argument("--source", metavar="TEXT", help="origin of the surface")
    outputs.add_argument("--json", action="store_true", help="print one JSON object")


def run(options: argparse.Namespace) -> int:
    """Simulate, print a summary, and return the exit code of the command."""
    share_cores()
    from brdfdb.errors import ParameterError
    from brdfdb.measurements.measured_source import slug
    from brdfdb_pipelines import simulate

    keys = _keys(options)
    if options.name is not None:
        name = options.name
    elif options.height_map is not None:
        name = slug(f"{options.height_map.stem} {options.facets or 'lambert'}")
    else:
        if options.surface is None:
            raise ParameterError("--surface, --height-map", "neither is given; give one of them")
        angle = "" if options.slope_deg is None else f"{options.slope_deg:g}"
        name = slug(f"{options.surface} {angle} {options.facets or 'lambert'}")
    try:
        passes = simulate.run(
            keys,
            simulate.SimulationOutputs(
                name=name,
                store=options.store,
                out=options.out,
                recipe=options.recipe,
                jobs=options.jobs,
                scheduler=options.scheduler,
                **({} if options.tolerance is None else {"tolerance": options.tolerance}),
            ),
            json=options.json,
        )
    except KeyboardInterrupt:
        kept = "finished realisations are preserved; " if options.store is not None else ""
        again = shlex.join(["brdfdb", *options.arguments])
        print(f"brdfdb: interrupted; {kept}to resume: {again}", file=sys.stderr)
        return INTERRUPTED
    return 0 if passes else VIOLATED


def _keys(options: argparse.Namespace) -> dict[str, Any]:
    """Return the keys of a recipe that the options stand for, without those of the default value."""
    from brdfdb_pipelines.simulated_table import SimulatedTable

    values = {**vars(options), "hole": options.hole_value, "height_map": options.height_map and str(options.height_map)}
    fields = SimulatedTable.model_fields.items()
    keys = {name: values[name] for name, field in fields if values.get(name) not in (None, [], field.default)}
    for name in ("rho", "n", "k", "pixel_um"):
        if len(keys.get(name, [])) == 1:
            (keys[name],) = keys[name]
    return keys
