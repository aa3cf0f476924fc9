"""The command `brdfdb topography`."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from typing import TYPE_CHECKING

from brdfdb_pipelines.commands._arguments import numbers, place, share_cores

if TYPE_CHECKING:
    from brdfdb.microgeometry.height_map_files import MeasuredHeights
    from brdfdb.microgeometry.levelling import Levelled
    from brdfdb.microgeometry.random_fields import HeightInterval
    from brdfdb.microgeometry.surface_models import ModelStanding, SpatialBand
    from brdfdb.microgeometry.topography import Moments, SurfaceStatistics

HELP = "Read a height map: state heights, slopes and correlation with intervals, and which models its surface suits."

_ANSWERS = {"inside": "assumptions met", "at the edge": "at the edge", "outside": "not met", "unknown": "not known"}
_OF_FILE = ("heights_um", "tau_um")  # parameters that are in the file, and no options


def add_reading(parser: argparse.ArgumentParser, *, holes: tuple[str, ...] = ("leave-out", "fill", "refuse")) -> None:
    """Add the options that say how a height map is read and levelled; the first of `holes` is the default."""
    reading = parser.add_argument_group("facts that the file does not state")
    reading.add_argument(
        "--pixel-um",
        type=numbers,
        default=[],
        metavar="UM",
        help="distance of nodes, or those along x and y with a comma between them, such as 0.5,0.8",
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
        choices=holes,
        default=holes[0],
        help="what to do with missing heights; fill interpolates between neighbours (default: %(default)s)",
    )
    faults.add_argument(
        "--noise-um", type=float, metavar="UM", help="rms noise of the instrument (default: estimated from the map)"
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
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    models = parser.add_argument_group("models")
    models.add_argument(
        "--recipe", type=place, metavar="FILE.toml", help="write materials of this surface for `brdfdb build`"
    )
    models.add_argument("--name", metavar="NAME", help="beginning of the names of materials (default: from the file)")
    models.add_argument(
        "--refractive-index",
        metavar="ENTRY",
        help="n and k: a substance such as Cu, SHELF/BOOK/PAGE of refractiveindex.info, or constant/N/K "
        "(default: constant/1.5/0)",
    )
    models.add_argument("--rho", type=float, metavar="RHO", help="albedo of Oren and Nayar's facets (default: 0.5)")


def run(options: argparse.Namespace) -> int:
    """Read, level and judge a map; print the report, and write the recipe."""
    share_cores()
    from brdfdb.errors import ParameterError

    try:
        return _run(options)
    except ParameterError as error:
        from brdfdb_pipelines.simulated_table import in_options, option_of

        name = "refractive_index" if error.parameter == "wavelength_nm" else error.parameter
        option = str(options.file) if name in _OF_FILE else option_of(name)
        if type(error) is not ParameterError or not (name in _OF_FILE or name == "hole" or hasattr(options, name)):
            raise
        raise ParameterError(option, in_options(error.sentence), error.value, error.allowed) from None


def _run(options: argparse.Namespace) -> int:
    from brdfdb.errors import ParameterError
    from brdfdb.measurements.measured_source import slug
    from brdfdb.microgeometry import surface_models
    from brdfdb.microgeometry.height_map_files import MapOptions, read_heights
    from brdfdb.microgeometry.levelling import LevellingOptions, levelled
    from brdfdb.microgeometry.model_errors import surface_error
    from brdfdb.microgeometry.topography import surface_statistics, uncertain
    from brdfdb.models import MODELS
    from brdfdb.store.files import write_file
    from brdfdb.store.paths import NAME
    from brdfdb_pipelines import terminal
    from brdfdb_pipelines.simulated_table import in_options

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
        judged = surface_models.standings(surface, materials, entry)
    errors = {model: error for model, material in materials.items() if (error := surface_error(material)) is not None}
    if options.recipe is not None and not tables:
        raise ParameterError("recipe", f"{options.file} exceeds the range of all models; leave the option out")
    if options.recipe is not None:
        write_file(options.recipe, surface_models.recipe_of_surface(tables, name).encode(), options.recipe.parent)
    bands = [surface_models.spatial_band(surface, at) for at in surface_models.WAVELENGTHS_NM]
    warnings = [in_options(sentence) for sentence in uncertain(ready, surface)]
    assumed = ["n = 1.5 and k = 0 (--refractive-index names the substance)"] if given is None else []
    assumed += [f"rho = {rho:g} (--rho)"] if options.rho is None else []
    if options.json:
        document = {
            "file": str(options.file),
            "format": ready.measured.format,
            "axes": ready.measured.axes,
            "levelling": ready.document(),
            "statistics": surface.document(),
            "bands": [band._asdict() for band in bands],
            "models": [
                {**model._asdict(), "worst": model.worst, "limits": [limit._asdict() for limit in model.limits]}
                for model in judged
            ],
            "assumed": assumed,
            "left_out": left_out,
            "surface_errors": {model: {**asdict(error), "sentence": error.sentence} for model, error in errors.items()},
            "warnings": warnings,
        }
        print(json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False))
        return 0
    lines = [f"{options.file}: {ready.measured.format}", *_map_lines(ready), *_statistics_lines(surface)]
    lines += _band_lines(surface, bands)
    lines += _model_lines(surface, judged)
    lines += [f"  assumed     {', '.join(assumed)}"] if assumed else []
    lines += [f"  left out    {MODELS[model].short_title}: {why}" for model, why in left_out.items()]
    if errors:
        lines.append("  rays        errors of these models against rays")
    lines += [f"    {MODELS[model].short_title:<12}{error.sentence}" for model, error in errors.items()]
    lines += [f"  warning     {sentence}" for sentence in warnings]
    if options.recipe is not None:
        lines.append(f"  written     {options.recipe}: {len(tables)} materials, {name}-*")
    print(terminal.plain("\n".join(lines)))
    return 0


def _map_lines(ready: Levelled) -> list[str]:
    """Return lines on the map, what was subtracted, and its faults."""
    from brdfdb_pipelines.simulated_table import in_options

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
        *(f"  note        {in_options(note)}" for note in measured.notes),
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

    taken = {"given": "; taken out", "estimated": "; taken out", "not separable": "; not taken out"}
    noise = f"{surface.noise.in_words}{taken.get(surface.noise.kind, '')}"
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
    blocks = "the map has too few lengths of correlation for blocks"
    if surface.scatter:
        count = next(iter(surface.scatter.values())).blocks
        wider = [name for name, scatter in surface.scatter.items() if scatter.factor > 1.0]
        blocks = f"{count} blocks of the map scatter as those of a homogeneous Gaussian surface"
        if wider:
            blocks = f"{count} blocks of the map scatter more, which widens the intervals of {', '.join(wider)}"
    return [
        f"  noise       {noise}",
        f"  sigma_0     {_interval(surface.sigma_0_um, ' um')}; levelling took {lost} of its square, which is added",
        f"  tau         {'; '.join(taus)}",
        f"  slopes      rms, over a pixel: {'; '.join(slopes)}",
        f"              {coarser} along x and y",
        f"  correlation {surface.form}: H {_interval(surface.exponent)} in exp(-(r / tau)^(2 H))",
        f"  heights     {_moments(surface.heights)}",
        f"  slopes x    {_moments(surface.slopes_x)}",
        f"  slopes y    {_moments(surface.slopes_y)}",
        f"  direction   {direction}",
        f"  intervals   in brackets 95 %, from {surface.areas:.3g} independent areas; after ± the standard error",
        f"              {blocks}",
    ]


def _interval(interval: HeightInterval, unit: str = "") -> str:
    return f"{interval.value:.3g}{unit} ({interval.low:.3g} to {interval.high:.3g})"


def _moments(moments: Moments | None) -> str:
    if moments is None:
        return "none: the heights do not vary along this axis"
    return (
        f"skewness {moments.skewness:.2f} ± {moments.skewness_error:.2g}, kurtosis {moments.kurtosis:.2f} ± "
        f"{moments.kurtosis_error:.2g}: {'Gaussian within chance' if moments.gaussian else 'not Gaussian'}"
    )


def _band_lines(surface: SurfaceStatistics, bands: list[SpatialBand]) -> list[str]:
    """Return lines on what the map leaves out."""
    finest, longest = 2.0 * max(surface.step_um), min(surface.width_um)
    lines = [f"  band        spatial wavelengths from {finest:.3g} um (two pixels) to {longest:.3g} um (the map)"]
    for band in bands:
        seen = "in all directions of light and viewer"
        if not band.everywhere:
            angles = f"{band.nearest_deg:.2g} to {band.farthest_deg:.2g} degrees"
            seen = f"at theta_r of {angles}, for light along the normal"
        lines.append(f"    {f'{band.wavelength_nm:g} nm':<10}roughness of this band shows {seen}")
    return lines


def _model_lines(surface: SurfaceStatistics, judged: list[ModelStanding]) -> list[str]:
    """Return lines on the models of the surface: a line for each, and one for each assumption that is not met."""
    from brdfdb.microgeometry.surface_models import WAVELENGTHS_NM, phase_variance
    from brdfdb.models import MODELS

    lines = []
    absent = sorted(set(WAVELENGTHS_NM) - {one.wavelength_nm for one in judged}) if judged else []
    lines += [f"  models      not judged at {one:g} nm, where the entry of n and k has no value" for one in absent]
    for wavelength_nm in dict.fromkeys(one.wavelength_nm for one in judged):
        g = phase_variance(surface, wavelength_nm)
        lines.append(f"  models      at {wavelength_nm:g} nm, where g = (4 pi sigma_0 / wavelength)^2 is {g:.3g}")
        for one in judged:
            if one.wavelength_nm != wavelength_nm:
                continue
            known = ", as far as is known" if any(limit.standing == "unknown" for limit in one.limits) else ""
            lines.append(f"    {MODELS[one.model].short_title:<12}{_ANSWERS[one.worst]}{known}")
            for limit in one.limits:
                if limit.standing != "inside":
                    words = _ANSWERS[limit.standing]
                    lines.append(f"      {words:<12}{limit.quantity}: {limit.value} ({limit.valid}); {limit.where}")
    return lines
