"""The command `brdfdb topography`."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from typing import TYPE_CHECKING

from brdfdb_pipelines.commands._arguments import place, share_cores

if TYPE_CHECKING:
    from brdfdb.microgeometry.height_map_files import MeasuredHeights
    from brdfdb.microgeometry.levelling import Levelled
    from brdfdb.microgeometry.random_fields import HeightInterval
    from brdfdb.microgeometry.surface_models import ModelStanding, SpatialBand
    from brdfdb.microgeometry.topography import Moments, SurfaceStatistics

HELP = "Read a height map: state heights, slopes and correlation with intervals, and which models its surface suits."

_TITLES = {"he_torrance": "He-Torrance", "oren_nayar": "Oren-Nayar", "ggx": "GGX", "beckmann": "Beckmann"}
_ANSWERS = {"inside": "assumptions met", "at the edge": "at the edge", "outside": "not met", "unknown": "not known"}
_RENAMED = {"hole": "--hole-value"}  # options that are not named as their parameters


def add_reading(parser: argparse.ArgumentParser) -> None:
    """Add the options that say how a height map is read and levelled."""
    reading = parser.add_argument_group("facts that the file does not state")
    reading.add_argument(
        "--pixel-um", type=float, nargs="+", default=[], metavar="UM", help="distance of nodes, or those along x and y"
    )
    reading.add_argument("--height-um", type=float, metavar="UM", help="height of the number 1 in the file")
    reading.add_argument("--unit", metavar="UNIT", help="unit of a file that states sizes without one: m, mm, um, nm")
    reading.add_argument(
        "--hole-value", type=float, metavar="V", help="number that stands for a height that was not measured"
    )
    reading.add_argument(
        "--channel", metavar="NAME", help="name or number of the channel (default: the first of heights)"
    )
    faults = parser.add_argument_group("tilt and faults of the map")
    faults.add_argument(
        "--level",
        choices=("none", "plane", "quadratic"),
        default="plane",
        help="surface to subtract (default: plane)",
    )
    faults.add_argument(
        "--outliers",
        choices=("refuse", "leave-out", "keep"),
        default="refuse",
        help="what to do with heights far from all others (default: refuse the map)",
    )
    faults.add_argument(
        "--steps",
        choices=("refuse", "remove", "keep"),
        default="refuse",
        help="what to do with jumps of rows or columns, as at stitching (default: refuse the map)",
    )
    faults.add_argument(
        "--holes",
        choices=("leave-out", "fill", "refuse"),
        default="leave-out",
        help="what to do with missing heights; fill interpolates between neighbours (default: leave-out)",
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the file, how it is read, and the outputs."""
    parser.add_argument(
        "file",
        type=place,
        metavar="FILE",
        help="a file of a profilometer or microscope, .npy, .csv, .txt, or 16-bit TIFF or PNG; rows of arrays "
        "and pictures run along x, and the first row is the uppermost, at the largest y",
    )
    add_reading(parser)
    parser.add_argument(
        "--noise-um", type=float, metavar="UM", help="rms noise of the instrument (default: estimated from the map)"
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    models = parser.add_argument_group("models")
    models.add_argument(
        "--recipe", type=place, metavar="FILE.toml", help="write materials of this surface for `brdfdb build`"
    )
    models.add_argument("--name", metavar="NAME", help="beginning of the names of materials (default: from the file)")
    models.add_argument(
        "--refractive-index",
        metavar="ENTRY",
        help="n and k of the substance: a symbol such as Cu, shelf/book/page or constant/N/K (default: constant/1.5/0)",
    )
    models.add_argument("--rho", type=float, metavar="RHO", help="albedo of Oren and Nayar's facets (default: 0.5)")


def run(options: argparse.Namespace) -> int:
    """Read, level and judge a map; print the report, and write the recipe."""
    share_cores()
    from brdfdb.errors import ParameterError

    try:
        return _run(options)
    except ParameterError as error:
        name = error.parameter
        option = _RENAMED.get(name, f"--{name.replace('_', '-')}")
        if type(error) is not ParameterError or not hasattr(options, option.removeprefix("--").replace("-", "_")):
            raise
        raise ParameterError(option, error.sentence, error.value, error.allowed) from None


def _run(options: argparse.Namespace) -> int:
    from brdfdb.errors import ParameterError
    from brdfdb.measurements.measured_source import slug
    from brdfdb.microgeometry import surface_models
    from brdfdb.microgeometry.height_map_files import MapOptions, read_heights
    from brdfdb.microgeometry.levelling import LevellingOptions, levelled
    from brdfdb.microgeometry.model_errors import surface_error
    from brdfdb.microgeometry.topography import surface_statistics, uncertain
    from brdfdb.store.files import write_file
    from brdfdb.store.paths import NAME
    from brdfdb_pipelines import terminal

    if options.recipe is not None and options.recipe.suffix != ".toml":
        raise ParameterError("recipe", f"{str(options.recipe)!r} does not end in .toml", str(options.recipe))
    name = options.name or slug(options.file.stem)
    if not NAME.fullmatch(name):
        raise ParameterError("name", f"{name!r} is not made of lower-case letters, digits and single hyphens", name)
    rho = surface_models.RHO if options.rho is None else options.rho
    if not 0.0 <= rho <= 1.0:
        raise ParameterError("rho", f"{rho:g} is not in [0, 1]", rho, (0.0, 1.0))
    given = options.refractive_index
    entry = surface_models.UNKNOWN_INDEX if given is None else surface_models.index_entry(given)
    surface_models.covered_wavelengths(entry)
    facts = MapOptions(tuple(options.pixel_um), options.height_um, options.unit, options.hole_value, options.channel)
    treatment = LevellingOptions(options.level, options.outliers, options.steps, options.holes)
    with terminal.progress(counted=False, transient=True) as bar:
        task = bar.add_task(f"{options.file}: reading", total=None)
        ready = levelled(read_heights(options.file, facts), treatment)
        surface = surface_statistics(
            ready,
            noise_um=options.noise_um,
            stage=lambda words: bar.update(task, description=f"{options.file}: {words}"),
        )
        tables, materials, left_out = surface_models.surface_materials(
            surface, name, entry=entry, rho=rho, source=f"brdfdb topography of {options.file.name}"
        )
        judged = surface_models.standings(surface, materials)
    errors = {model: found for model, material in materials.items() if (found := surface_error(material)) is not None}
    if options.recipe is not None and not tables:
        raise ParameterError("recipe", f"{options.file} exceeds the range of all models; leave the option out")
    if options.recipe is not None:
        write_file(options.recipe, surface_models.recipe_of_surface(tables, name).encode(), options.recipe.parent)
    bands = [surface_models.spatial_band(surface, one) for one in surface_models.WAVELENGTHS_NM]
    warnings = uncertain(ready, surface)
    if options.json:
        document = {
            "file": str(options.file),
            "format": ready.measured.format,
            "axes": ready.measured.axes,
            "levelling": ready.document(),
            "statistics": surface.document(),
            "bands": [band._asdict() for band in bands],
            "models": [
                {**one._asdict(), "worst": one.worst, "limits": [limit._asdict() for limit in one.limits]}
                for one in judged
            ],
            "left_out": left_out,
            "surface_errors": {model: {**asdict(found), "sentence": found.sentence} for model, found in errors.items()},
            "warnings": warnings,
        }
        print(json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False))
        return 0
    lines = [f"{options.file}: {ready.measured.format}", *_map_lines(ready), *_statistics_lines(surface)]
    lines += _band_lines(surface, bands)
    lines += _model_lines(surface, judged)
    lines += [
        f"  left out    {_TITLES[model]}, whose range the surface exceeds: {why}" for model, why in left_out.items()
    ]
    if errors:
        lines.append("  rays        errors of these models against rays")
    lines += [f"    {_TITLES[model]:<12}{found.sentence}" for model, found in errors.items()]
    lines += [f"  warning     {sentence}" for sentence in warnings]
    if options.recipe is not None:
        lines.append(f"  written     {options.recipe}: {len(tables)} materials, {name}-*")
        assumed = ["n = 1.5 and k = 0 (--refractive-index names the substance)"] if given is None else []
        assumed += ["rho = 0.5 (--rho)"] if options.rho is None else []
        if assumed:
            lines.append(f"  assumed     {', '.join(assumed)}")
    print(terminal.plain("\n".join(lines)))
    return 0


def _map_lines(ready: Levelled) -> list[str]:
    """Return lines on the map, what was subtracted, and its faults."""
    measured: MeasuredHeights = ready.measured
    nx, ny = measured.heights_um.shape
    width, length = measured.widths_um
    steps = f"{measured.step_x_um:.4g} um"
    if measured.step_x_um != measured.step_y_um:
        steps = f"{measured.step_x_um:.4g} x {measured.step_y_um:.4g} um, which are not square"
    treatment = {0: "mean subtracted", 1: "plane subtracted", 2: "paraboloid subtracted"}[ready.degree]
    share = 100.0 * ready.holes / measured.heights_um.size
    holes = f"{ready.holes} ({share:.2g} %)" if ready.holes else "none"
    if ready.filled:
        holes += f"; {ready.filled} heights interpolated between neighbours"
    elif ready.holes:
        holes += ", left out"
    outliers = f"{ready.outliers}, {'left out' if ready.left_out else 'kept'}" if ready.outliers else "none"
    jumps = "none"
    if ready.steps:
        done = "removed" if ready.removed else "kept"
        largest = max(abs(step.height_um) for step in ready.steps)
        jumps = f"{len(ready.steps)}, up to {largest:.3g} um, {done}"
    return [
        *(f"  note        {note}" for note in measured.notes),
        f"  map         {nx} x {ny} heights, {width:.4g} x {length:.4g} um, pixels of {steps}",
        f"  axes        {measured.axes}",
        f"  levelled    {treatment}; the tilt was {ready.tilt_deg:.2g} degrees",
        f"  holes       {holes}",
        f"  outliers    {outliers}",
        f"  steps       {jumps}",
    ]


def _statistics_lines(surface: SurfaceStatistics) -> list[str]:
    """Return lines on heights, slopes and correlation."""
    import math

    noise = {
        "given": f"{surface.noise.sigma_um:.3g} um, as given; taken out",
        "estimated": f"{surface.noise.sigma_um:.3g} um, from the flat end of the spectrum; taken out",
        "negligible": f"at most {surface.noise.sigma_um:.2g} um, negligible",
        "not separable": f"at most {surface.noise.sigma_um:.3g} um, not separable from roughness; not taken out",
    }[surface.noise.kind]
    taus = (
        f"{axis} {_interval(tau, ' um')}" if tau is not None else f"{axis} longer than an eighth of the map"
        for axis, tau in (("x", surface.tau_x_um), ("y", surface.tau_y_um))
    )
    slopes = (
        f"{axis} {_interval(slope)}, {math.degrees(math.atan(slope.value)):.2g} degrees"
        for axis, slope in (("x", surface.slope_x), ("y", surface.slope_y))
    )
    coarser = "; ".join(f"{x:.3g} and {y:.3g} over {steps} pixels" for steps, x, y in surface.coarser)
    turned = surface.anisotropy
    direction = f"isotropic within chance; largest over smallest slope {turned.ratio:.2f}"
    if turned.significant:
        azimuth = f"{turned.direction_deg:.0f} degrees from x"
        direction = f"anisotropic: the largest slopes, at {azimuth}, are {turned.ratio:.2f} times the smallest"
    lost = f"{100.0 * surface.lost:.2g} %"
    blocks = "too few lengths of correlation for blocks"
    if surface.scatter:
        one = next(iter(surface.scatter.values()))
        wider = [name for name, found in surface.scatter.items() if found.factor > 1.0]
        blocks = f"{one.blocks} blocks scatter as those of a homogeneous Gaussian surface"
        if wider:
            blocks = (
                f"{one.blocks} blocks scatter more than that explains, and widen the intervals of {', '.join(wider)}"
            )
    return [
        f"  noise       {noise}",
        f"  sigma_0     {_interval(surface.sigma_0_um, ' um')}, with the {lost} of its square that levelling took",
        f"  tau         {'; '.join(taus)}",
        f"  slopes      {'; '.join(slopes)}",
        f"              {coarser}",
        f"  correlation {surface.form}: H {_interval(surface.exponent)} in exp(-(r / tau)^(2 H))",
        f"  heights     {_moments(surface.heights)}",
        f"  slopes x    {_moments(surface.slopes_x)}",
        f"  slopes y    {_moments(surface.slopes_y)}",
        f"  direction   {direction}",
        f"  intervals   95 %, from {surface.areas:.3g} independent areas; {blocks}",
    ]


def _interval(one: HeightInterval, unit: str = "") -> str:
    return f"{one.value:.3g}{unit} ({one.low:.3g} to {one.high:.3g})"


def _moments(one: Moments | None) -> str:
    if one is None:
        return "none: the heights do not vary along this axis"
    found = "Gaussian within chance" if one.gaussian else "not Gaussian"
    return (
        f"skewness {one.skewness:.2f} ± {one.skewness_error:.2g}, kurtosis {one.kurtosis:.2f} ± "
        f"{one.kurtosis_error:.2g}: {found}"
    )


def _band_lines(surface: SurfaceStatistics, bands: list[SpatialBand]) -> list[str]:
    """Return lines on what the map leaves out."""
    finest, longest = 2.0 * max(surface.step_um), min(surface.width_um)
    lines = [f"  band        spatial wavelengths from {finest:.3g} um (two pixels) to {longest:.3g} um (the map)"]
    for band in bands:
        seen = "all directions of light and viewer"
        if not band.everywhere:
            seen = f"theta_r {band.nearest_deg:.2g} to {band.farthest_deg:.2g} degrees, light along the normal"
        lines.append(f"    {f'{band.wavelength_nm:g} nm':<10}is scattered by this roughness into {seen}")
    return lines


def _model_lines(surface: SurfaceStatistics, judged: list[ModelStanding]) -> list[str]:
    """Return lines on the models of the surface: a line for each, and one for each assumption that is not met."""
    from brdfdb.microgeometry.surface_models import WAVELENGTHS_NM, phase_variance

    lines = []
    absent = sorted(set(WAVELENGTHS_NM) - {one.wavelength_nm for one in judged}) if judged else []
    lines += [f"  models      not judged at {one:g} nm, where the entry of n and k has no value" for one in absent]
    for wavelength_nm in dict.fromkeys(one.wavelength_nm for one in judged):
        g = phase_variance(surface, wavelength_nm)
        lines.append(f"  models      at {wavelength_nm:g} nm, where g is {g:.3g} along the normal")
        for one in judged:
            if one.wavelength_nm != wavelength_nm:
                continue
            lines.append(f"    {_TITLES[one.model]:<12}{_ANSWERS[one.worst]}")
            for limit in one.limits:
                if limit.standing in ("outside", "at the edge"):
                    words = _ANSWERS[limit.standing]
                    lines.append(f"      {words:<12}{limit.quantity}: {limit.value} ({limit.valid}); {limit.where}")
    return lines
