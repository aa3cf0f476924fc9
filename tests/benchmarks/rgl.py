"""RGL's tensor files in Mitsuba: ``python tests/benchmarks/rgl.py``.

Each table is written for spectral variants, loaded by Mitsuba's `measured`, and compared with the table: f_r at random
pairs of directions, and the mean weight of Mitsuba's samples with the directional albedo. Where $DRJIT_LIBLLVM_PATH
names LLVM 19, Mitsuba's chi-square test judges the density of its samples. Spheres that Mitsuba renders from files for
RGB are compared with `brdfdb render`. Exits with 1 if Mitsuba sees more than the stated error, a test rejects, or a
furnace or a sphere is off by more than 0.5 %.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[2]))

import brdfdb
from brdfdb.formats import rgl
from brdfdb.formats._stated_error import FLOOR
from brdfdb.formats.rgl._tensors import read_tensors
from brdfdb.geometry import radians, unit_vector
from brdfdb.scenes.gbuffer import gather
from brdfdb.scenes.renderer import render
from brdfdb.scenes.scene import Scene
from brdfdb.spectra import linear_srgb
from brdfdb.tables import tabulation
from brdfdb.tables.albedo import directional_albedo
from brdfdb.tables.planner import plan
from brdfdb.tables.table import Table
from brdfdb_pipelines.recipe_file import load
from tests.benchmarks.recording import Column, Run, model_of

QUICK, SPHERES = ("white-ceramic-tile",), ("rolled-brass", "scene-copper-sphere", "clay-vase")
LIGHTS_DEG = np.array([0.0, 30.0, 60.0, 80.0])
OFF_PLANE = 0.3  # azimuth of these lights [rad]
REQUIRED = 0.005  # of furnaces and spheres
CHI2_DEG = np.array([45.0, 75.0, 10.0])  # lights of chi-square tests
# Level at which all tests together reject one file by chance; number of the tests
SIGNIFICANCE, FAMILY = 0.01, 59 * CHI2_DEG.size
MEASURED = "What Mitsuba makes of RGL's tensor files of our tables: f_r, the albedo by its samples, and spheres."

Array = NDArray[np.float64]


def tables(root: str | None, names: Sequence[str] | None) -> Iterator[Table]:
    """Tables of a store, or made here by the planner: those that are named, or all."""
    if root is not None:
        store = brdfdb.open(root)
        yield from (store[name] for name in names or store)
        return
    for job in load().jobs():
        if names is not None and job.material.name not in names:
            continue
        layout = plan(job.material, job.wavelength_nm, 0.01)
        values = np.concatenate([tabulation.block(layout, rows) for rows in layout.blocks])
        yield Table.of(layout, values)


def difference(surface: Any, table: Table, count: int) -> float:
    """Return p99 of f_r by Mitsuba against the table at random pairs, lights and viewers cosine-weighted."""
    import mitsuba

    u, v = np.random.default_rng(1).random((2, 2, count))
    wi, wr = unit_vector(np.arcsin(np.sqrt(u)), 2.0 * np.pi * v)
    at = table.wavelength_nm
    chosen = None if at is None else at[np.linspace(0, at.size - 1, 4).astype(np.int64)]
    truth = np.asarray(table.lookup_vectors(wi, wr, chosen)).reshape(count, -1)
    context, interaction = mitsuba.BSDFContext(), mitsuba.SurfaceInteraction3f()
    interaction.wavelengths = [550.0] * 4 if chosen is None else chosen.tolist()
    values = np.empty((count, 4))
    for j, (light, viewer) in enumerate(zip(wi.tolist(), wr.tolist(), strict=True)):
        interaction.wi = mitsuba.Vector3f(*light)
        values[j] = np.array(surface.eval(context, interaction, mitsuba.Vector3f(*viewer))) / viewer[2]
    scale = np.maximum(truth, FLOOR * np.abs(truth).mean(axis=0)) + 1e-30
    return float(np.percentile(np.abs(values[:, : truth.shape[1]] - truth) / scale, 99.0, axis=0).max())


def furnace(surface: Any, table: Table, count: int) -> tuple[float, float]:
    """Return the largest relative difference of the mean weight of samples from the albedo, and their deviation."""
    import mitsuba

    at = table.wavelength_nm
    middle = 0 if at is None else at.size // 2
    albedo = directional_albedo(table, LIGHTS_DEG).albedo[:, 0, middle]
    context, interaction = mitsuba.BSDFContext(), mitsuba.SurfaceInteraction3f()
    interaction.wavelengths = [550.0 if at is None else float(at[middle])] * 4
    lights = unit_vector(radians(LIGHTS_DEG), np.full(LIGHTS_DEG.size, 0.0 if table.anisotropic else OFF_PLANE))
    centres = ((np.arange(count) + 0.5) / count).tolist()
    worst, noise = 0.0, 0.0
    for light, expected in zip(lights.tolist(), albedo.tolist(), strict=True):
        interaction.wi = mitsuba.Vector3f(*light)
        points = [mitsuba.Point2f(u, v) for u in centres for v in centres]
        weights = np.array([np.array(surface.sample(context, interaction, 0.5, point)[1])[0] for point in points])
        if expected > 0.0:
            worst = max(worst, abs(float(weights.mean()) / expected - 1.0))
            noise = max(noise, float(weights.std() / weights.mean()))
    return worst, noise


def rejected(path: Path, lights: int, samples: int) -> int | None:
    """Return how many lights Mitsuba's chi-square test rejects; None without the LLVM that its arrays need.

    The density is integrated over cells of 3.5 degrees with 32 points along each side: with Mitsuba's default of 4 the
    lobe of brass falls between the points.
    """
    if "DRJIT_LIBLLVM_PATH" not in os.environ:
        return None
    import mitsuba

    mitsuba.set_variant("llvm_ad_spectral")
    from mitsuba.chi2 import BSDFAdapter, ChiSquareTest, SphericalDomain

    surface, wrong = {"type": "measured", "filename": str(path)}, 0
    for light in unit_vector(radians(CHI2_DEG[:lights]), np.full(lights, OFF_PLANE)).tolist():
        sample, density = BSDFAdapter("measured", surface, wi=mitsuba.Vector3f(*light))
        test = ChiSquareTest(SphericalDomain(), sample, density, 3, sample_count=samples, res=51, ires=32)
        wrong += not test.run(SIGNIFICANCE, FAMILY, quiet=True)
    return wrong


def sphere(table: Table, path: Path, width: int) -> float:
    """Return the median difference [1] of the pixels of a sphere by Mitsuba from our renderer's, in luminance.

    Ours shows the model that the table was tabulated from; without one, the table.
    """
    import mitsuba

    towards = np.array([0.5, -1.0, 0.6])
    scene = Scene.model_validate(
        {
            "objects": [{"name": "sphere", "material": table.name, "shape": {"kind": "sphere", "radius": 1}}],
            "lights": [{"direction": towards.tolist()}],
            "camera": {"position": [0, -5, 0], "height": 2.4, "aspect": 1},
        }
    )
    surface = table if table.source is None else table.source
    radiance = render(scene, gather(scene, width, across=4), {table.name: surface})
    ours = np.asarray(linear_srgb(scene.wavelengths_nm, radiance))
    mitsuba.set_variant("scalar_rgb")
    transform = mitsuba.ScalarTransform4f
    film = {"type": "hdrfilm", "width": width, "height": width, "rfilter": {"type": "box"}, "pixel_format": "rgb"}
    view = transform().look_at(origin=[0, -5, 0], target=[0, 0, 0], up=[0, 0, 1]) @ transform().scale([1.2, 1.2, 1])
    light = {"type": "rgb", "value": np.pi}
    world = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 2},
        "sensor": {"type": "orthographic", "to_world": view, "film": film | {"component_format": "float32"}},
        "sphere": {"type": "sphere", "bsdf": {"type": "measured", "filename": str(path)}},
        "sun": {"type": "directional", "direction": (-towards).tolist(), "irradiance": light},
    }
    world["sensor"]["sampler"] = {"type": "stratified", "sample_count": 64}
    theirs = np.array(mitsuba.render(mitsuba.load_dict(world)))[..., :3]
    luminance = np.array([0.2126, 0.7152, 0.0722])
    a, b = theirs @ luminance, ours @ luminance
    lit = b > 0.01 * b.max()
    return float(np.median(np.abs(a - b)[lit] / b[lit]))


def main(arguments: Sequence[str] | None = None) -> int:
    """Write, load and compare all files, and print a row for each."""
    run = Run("rgl", "accuracy", "RGL's tensor files in Mitsuba", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("--store", metavar="DIR", help="tables of this store; by default they are made here")
    options = run.parse(parser, arguments)
    count, grid = (500, 32) if options.quick else (10_000, 40)
    columns = [Column(name="kB", digits=4), Column(name="seconds"), *(Column(name=n, unit="%") for n in _SHARES)]
    rows = run.table("Files for spectral renderers", Column(name="material", width=36), "nodes", *columns, _LIGHTS)
    bad = []
    with tempfile.TemporaryDirectory() as folder:
        bad += [
            name
            for table in tables(options.store, QUICK if options.quick else None)
            for name in _row(rows, table, folder, count, grid, options.quick)
        ]
        median = run.table("Spheres", Column(name="material", width=36), Column(name="median", unit="%"))
        for name in QUICK if options.quick else SPHERES:
            path = Path(folder) / f"{name}.bsdf"
            table = next(tables(options.store, [name]))
            rgl.write(table, path, kind="rgb")
            median.add(name, 100.0 * (off := sphere(table, path, 24 if options.quick else 128)))
            bad += [name] * (off > REQUIRED)
    run.say(f"Beyond what was stated or required: {', '.join(bad) or 'none'}.")
    run.say("For each model, the page shows the material with the largest difference from Mitsuba.")
    rows.keep_worst("p99 by Mitsuba", model_of)
    run.end()
    return int(bool(bad))


_LIGHTS = "lights rejected by chi2"
_SHARES = ("stated p99", "p99 over the hemisphere", "l1", "p99 by Mitsuba", "furnace", "noise of a sample")


def _row(rows: Any, table: Table, folder: str, count: int, grid: int, quick: bool) -> list[str]:
    """Add the row of a table; return its name if something is beyond what was stated or required."""
    import mitsuba

    path, began = Path(folder) / f"{table.name}.bsdf", time.perf_counter()
    files = rgl.write(table, path)
    seconds = time.perf_counter() - began
    mitsuba.set_variant("scalar_spectral")
    surface = mitsuba.load_dict({"type": "measured", "filename": str(path)})
    seen, (off, noise) = difference(surface, table, count), furnace(surface, table, grid)
    black = not np.any(table.brdf)  # all light is in the specular part: there is no density to judge
    wrong = None if black else rejected(path, *((1, 20_000) if quick else (CHI2_DEG.size, 200_000)))
    error = files.error
    assert error is not None
    nodes = " x ".join(str(n) for n in read_tensors(path)["spectra"].shape)
    shares = (error.p99, error.p99_hemisphere, error.l1, seen, off, noise)
    rows.add(table.name, nodes, files.nbytes / 1e3, seconds, *(100.0 * share for share in shares), wrong)
    return [table.name] * (seen > error.p99 or off > REQUIRED or bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
