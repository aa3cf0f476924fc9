"""Intervals of height maps: ``python tests/benchmarks/height_maps.py``.

Made surfaces with known statistics are measured by an instrument with tilt, noise and holes, each with many seeds. The
script counts how often the 95 % intervals of `surface_statistics` contain the known values, and states their widths. It
also counts how often parts of made surfaces are found to have a direction, where their slopes along x and y are equal,
and where they differ. It exits with 1 if the share of intervals is not between 90 and 99.5 % for each statistic of all
surfaces, or is below 87 % for one of them, or if more than 10 % of isotropic maps of a kind have a direction.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb.microgeometry.height_map import HeightMap
from brdfdb.microgeometry.isotropy import slope_harmonics
from brdfdb.microgeometry.levelling import LevellingOptions, levelled
from brdfdb.microgeometry.random_fields import HeightInterval
from brdfdb.microgeometry.topography import surface_statistics
from tests.benchmarks.recording import Column, Run
from tests.microgeometry.made_maps import MadeMap

MEASURED = (
    "How often 95 % intervals of heights, lengths of correlation and slopes contain the known values of made surfaces, "
    "and how wide they are."
)
SURFACES: dict[str, tuple[MadeMap, float | None]] = {
    "Gaussian": (MadeMap(nodes=(192, 192)), None),
    "Gaussian, noise and holes": (MadeMap(nodes=(192, 192), noise=0.05, holes=0.03, tilt=(0.03, -0.02)), None),
    "Gaussian, a small map": (MadeMap(nodes=(128, 128), noise=0.01, tilt=(0.02, 0.0)), None),
    "Gaussian, 2 : 1, pixels 1 : 2": (MadeMap(nodes=(256, 128), tau_x=8.0, tau_y=4.0, step_y=1.0, noise=0.02), None),
    "band-limited": (MadeMap("band", nodes=(192, 192), tau_x=4.0, tau_y=4.0, noise=0.02, holes=0.02), None),
    "exponential": (MadeMap("exponential", nodes=(192, 192), tau_x=4.0, tau_y=4.0), None),
    "exponential, noise given": (MadeMap("exponential", nodes=(192, 192), tau_x=4.0, tau_y=4.0, noise=0.05), 0.05),
    "Gaussian, a paraboloid subtracted": (MadeMap(nodes=(192, 192), noise=0.02), None),
}
STATISTICS = ("sigma_0_um", "tau_x_um", "tau_y_um", "slope_x", "slope_y")
TEXTURES: dict[str, MadeMap] = {
    f"{correlation}, {nodes} x {nodes}": MadeMap(kind, nodes=(nodes, nodes))
    for correlation, kind in (("Gaussian", "gaussian"), ("exponential", "exponential"), ("band-limited", "band"))
    for nodes in (128, 256)
}
RATIOS = (1.0, 1.3, 2.0)  # of the slopes along x and y
TEXTURE_SEEDS = 200
MOST_ALARMS = 0.1  # three standard errors above 5 % of 200 draws
SEEDS = 150
LEAST, MOST, LEAST_OF_ONE = 0.90, 0.995, 0.87  # three standard errors of 150 draws are 5 %


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw, measure and judge all surfaces."""
    run = Run("height_maps", "accuracy", "Intervals of height maps", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("--first-seed", type=int, default=0, metavar="N", help="first of the seeds (default: 0)")
    parser.add_argument(
        "--seeds", type=int, default=SEEDS, metavar="N", help=f"maps of each surface (default: {SEEDS})"
    )
    options = run.parse(parser, arguments)
    seeds = 3 if options.quick else options.seeds
    names = [Column(name=name.removesuffix("_um"), digits=3) for name in STATISTICS]
    inside: dict[str, np.ndarray] = {}
    widths: dict[str, np.ndarray] = {}
    shares = run.table(
        "Share of maps whose interval contains the known value", Column(name="surface", width=34), *names
    )
    seconds = []
    for title, (made, noise_um) in SURFACES.items():
        treatment = LevellingOptions("quadratic" if "paraboloid" in title else "plane")
        truth = made.truth()
        contained, half = [], []
        for seed in range(options.first_seed, options.first_seed + seeds):
            measured = made.measured(seed)
            began = time.process_time()
            found = surface_statistics(levelled(measured, treatment), noise_um=noise_um)
            seconds.append(time.process_time() - began)
            intervals = [getattr(found, name) or HeightInterval(np.nan, np.nan, np.nan) for name in STATISTICS]
            known = [truth[name] for name in STATISTICS]
            contained.append([one.low <= true <= one.high for one, true in zip(intervals, known, strict=True)])
            half.append([0.5 * (one.high - one.low) / true for one, true in zip(intervals, known, strict=True)])
        inside[title] = np.array(contained)
        widths[title] = np.array(half)
        shares.add(title, *inside[title].mean(axis=0))
    typical = run.table(
        "Half of the width of the interval, in the median",
        Column(name="surface", width=34),
        *(Column(name=one.name, unit="%", digits=2) for one in names),
    )
    for title, half_widths in widths.items():
        typical.add(title, *(100.0 * np.nanmedian(half_widths, axis=0)))
    share = np.concatenate(list(inside.values())).mean(axis=0)
    worst = min(float(one.mean(axis=0).min()) for one in inside.values())
    run.say(
        f"Of {seeds} maps of each surface, {share.min():.1%} to {share.max():.1%} of the intervals of a statistic "
        f"contain its known value; at least {LEAST:.0%} are required. The least share of a surface is {worst:.1%}."
    )
    run.say(f"A map takes {np.median(seconds):.2g} s in the median.")
    alarms = directions(run, range(options.first_seed, options.first_seed + (3 if options.quick else TEXTURE_SEEDS)))
    run.end()
    enough = share.min() >= LEAST and share.max() <= MOST and worst >= LEAST_OF_ONE and alarms <= MOST_ALARMS
    return 0 if enough or options.quick else 1


def directions(run: Run, seeds: range) -> float:
    """Count how often maps are found to have a direction; return the largest share of isotropic maps of a kind."""
    columns = [Column(name=f"slopes 1 : {ratio:g}", digits=3) for ratio in RATIOS]
    table = run.table("Share of maps with a direction", Column(name="surface", width=34), *columns)
    alarms = []
    for title, made in TEXTURES.items():
        shares = []
        for ratio in RATIOS:
            # lengths of 10 nodes in the geometric mean: 13 or 26 of them along a side
            texture = replace(made, tau_x=made.tau_x / ratio**0.5, tau_y=made.tau_y * ratio**0.5)
            maps = (HeightMap(texture.surface(seed), texture.step_x, texture.step_y) for seed in seeds)
            shares.append(float(np.mean([slope_harmonics(surface).preferred > 0 for surface in maps])))
        table.add(title, *shares)
        alarms.append(shares[0])
    run.say(
        f"Of {len(seeds)} isotropic maps of each kind, at most {max(alarms):.1%} were found to have a direction; the "
        "test is made for 5 % of Gaussian surfaces."
    )
    return max(alarms)


if __name__ == "__main__":
    sys.exit(main())
