"""Plugins of Mitsuba beside `roughconductor`, and against the models: ``python tests/benchmarks/mitsuba_plugins.py``.

Needs LLVM 19, which $DRJIT_LIBLLVM_PATH names. Values are compared at random pairs of directions, half of the viewers
near the mirror direction. The white furnace is the mean weight of samples for lights from the normal to 85 degrees.
Speeds are millions of f_r a second of processor time, the best of several, all in one run and one thread. Other
programs on the machine matter little to them. Pictures are of one scene with one integrator and as many samples: a
sphere under a lamp and a sky. Exits with 1 if a value is off by more than 2e-5, or of tables one in 1000 by more than
5e-5, if a test of densities rejects, or if a furnace is off by 0.3 %.
"""

from __future__ import annotations

import itertools
import os
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb.geometry import unit_vector
from brdfdb.integrals.quadrature import directional_albedo
from brdfdb.materials import presets
from brdfdb.store.publication import publish
from tests.benchmarks.recording import Column, Run, times_of
from tests.mitsuba.surfaces import SUBJECTS, Subject, directions, evaluated, interaction

LIGHTS_DEG, TURNED = (0.0, 20.0, 45.0, 60.0, 75.0, 85.0), 0.5
REQUIRED, OF_TABLES, FURNACE = 2e-5, 5e-5, 3e-3
TABLE_FLOOR = 5e-3  # [1/sr] smaller values of tables are compared with it
SIGNIFICANCE = 0.01
FULL, QUICK = (100_000, 4_000_000, 1 << 20, 15), (10_000, 10_000, 1 << 18, 1)  # pairs, evaluations, samples, repeats
PASSES = 128  # samples of a pixel
# The last is interpolated linearly, the others by cubics
TABLES = ("white-ceramic-tile", "rolled-brass", "clay-vase", "magnesium-oxide-ceramic", "ivory-computer-plastic")
TOLERANCE = 0.01
TIMED = (*SUBJECTS[::2], SUBJECTS[-2])  # a surface of most forms; He-Torrance is rough, and smooth as the last one
MEASURED = (
    "BSDF plugins of Mitsuba 3 compared with brdfdb.models: values, samplers, and speed relative to roughconductor."
)

Array = NDArray[Any]


def smooth(mitsuba: Any) -> Any:
    """Return the context without the specular part, a Dirac delta that has no density."""
    context = mitsuba.BSDFContext()
    context.type_mask = mitsuba.BSDFFlags.Glossy | mitsuba.BSDFFlags.Diffuse
    return context


def density_accepted(mitsuba: Any, subject: Subject) -> int:
    """Return for how many lights Mitsuba's chi-square test accepts the density of samples."""
    from mitsuba.chi2 import BSDFAdapter, ChiSquareTest, SphericalDomain

    accepted = 0
    for theta_deg in LIGHTS_DEG:
        wi = mitsuba.Vector3f(*unit_vector(np.deg2rad(theta_deg), TURNED).tolist())
        sample, density = BSDFAdapter(subject.plugin, subject.document, wi=wi, ctx=smooth(mitsuba))
        test = ChiSquareTest(SphericalDomain(), sample, density, 3, sample_count=500_000, res=101, ires=32)
        accepted += bool(test.run(SIGNIFICANCE, len(LIGHTS_DEG), quiet=True))
    return accepted


def furnace(mitsuba: Any, subject: Subject, count: int) -> float:
    """Return the largest difference of the mean weight of samples from our albedo, relative."""
    surface, worst = mitsuba.load_dict(subject.document), 0.0
    steps = 1.2207440846057596 ** -np.array([[1.0], [2.0], [3.0]])
    choice, u, v = (np.arange(count) * steps % 1.0).astype(np.float32)
    for theta_deg in LIGHTS_DEG:
        theta = np.deg2rad(theta_deg)
        wi = np.tile(unit_vector(theta, TURNED), (count, 1))
        place, point = interaction(mitsuba, wi), mitsuba.Point2f(u, v)
        _, weight = surface.sample(mitsuba.BSDFContext(), place, mitsuba.Float(choice), point)
        known = {"tolerance": 1e-5, "specular": True}
        expected = directional_albedo(subject.model, theta, TURNED, **known, **subject.arguments).albedo
        worst = max(worst, abs(float(np.mean(np.array(weight)[0], dtype=np.float64)) / float(expected) - 1.0))
    return worst


def speeds(mitsuba: Any, surface: Any, count: int, repeats: int) -> tuple[float, float]:
    """Return millions of values and of samples in a second of one processor."""
    import drjit

    wi, wr = (mitsuba.Vector3f(np.ascontiguousarray(w.T)) for w in directions(count))
    place = drjit.zeros(mitsuba.SurfaceInteraction3f, count)
    place.wi = wi
    choice, point = drjit.abs(wr.x), mitsuba.Point2f(wr.z, drjit.abs(wr.y))
    drjit.eval(wi, wr, choice, point)
    context = mitsuba.BSDFContext()

    def best(work: Callable[[], Any]) -> float:
        def evaluated_now() -> None:
            drjit.eval(drjit.sum(work(), axis=None))
            drjit.sync_thread()

        return count / min(times_of(evaluated_now, repeats)) / 1e6

    return (
        best(lambda: surface.eval(context, place, wr)),
        best(lambda: surface.sample(context, place, choice, point)[1]),
    )


def picture_seconds(mitsuba: Any, bsdf: dict[str, Any], samples: int, repeats: int) -> float:
    """Return the processor time [s] of a picture of a sphere."""
    import drjit

    camera = mitsuba.ScalarTransform4f().look_at(origin=[0, -5, 0], target=[0, 0, 0], up=[0, 0, 1])
    film = {"type": "hdrfilm", "width": 128, "height": 128, "pixel_format": "luminance", "rfilter": {"type": "box"}}
    scene = mitsuba.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 3},
            "sensor": {"type": "perspective", "fov": 25, "to_world": camera, "film": film},
            "sky": {"type": "constant", "radiance": 0.3},
            "lamp": {
                "type": "sphere",
                "center": [3, -4, 3],
                "radius": 0.7,
                "emitter": {"type": "area", "radiance": 20.0},
            },
            "sphere": {"type": "sphere", "bsdf": bsdf},
        }
    )
    seeds = itertools.count()

    def render() -> None:
        drjit.eval(mitsuba.render(scene, spp=samples, seed=next(seeds)))
        drjit.sync_thread()

    return min(times_of(render, repeats))


def compare(run: Run, mitsuba: Any, pairs: int, samples: int) -> bool:
    """Compare all plugins of models with their models; return True if all are as near as is required."""
    columns = ("value", "lights whose density is accepted", "furnace")
    table = run.table("Plugins of models", Column(name="surface", width=44), *columns)
    wi, wr = directions(pairs)
    good = True
    for subject in SUBJECTS:
        value, _ = evaluated(mitsuba, mitsuba.load_dict(subject.document), wi, wr)
        expected = subject.f_r(wi, wr)
        difference = float(np.max(np.abs(value / wr[:, 2] - expected) / np.maximum(expected, subject.floor)))
        accepted, off = density_accepted(mitsuba, subject), furnace(mitsuba, subject, samples)
        table.add(str(subject), difference, accepted, off)
        good &= difference <= REQUIRED and accepted == len(LIGHTS_DEG) and off <= FURNACE
    return good


def compare_tables(run: Run, mitsuba: Any, root: str, names: Sequence[str], pairs: int) -> bool:
    """Compare the plugin of tables with `Table.lookup_vectors` and `Table.pdf`."""
    import brdfdb

    columns = ("value", "value, 999 of 1000", "density, 99 of 100")
    table = run.table("The plugin of tables", Column(name="material", width=24), *columns)
    wi, wr = directions(pairs)
    exact = wi.astype(np.float64), wr.astype(np.float64)
    good = True
    for name in names:
        stored = brdfdb.open(root)[name]
        surface = mitsuba.load_dict({"type": "brdfdb_table", "material": name, "store": root})
        place, viewers = interaction(mitsuba, wi), mitsuba.Vector3f(np.ascontiguousarray(wr.T))
        value, density = (np.array(part) for part in surface.eval_pdf(smooth(mitsuba), place, viewers))
        at = None if stored.wavelength_nm is None else float(np.clip(549.1, *stored.wavelength_nm[[0, -1]]))
        expected = stored.lookup_vectors(*exact, at)
        difference = np.abs(value[0] / wr[:, 2] - expected) / np.maximum(expected, TABLE_FLOOR)
        most = float(np.quantile(difference, 0.999))
        of_density = float(np.quantile(np.abs(density / stored.pdf(*exact) - 1.0), 0.99))
        table.add(name, float(np.max(difference)), most, of_density)
        good &= most <= OF_TABLES
    return good


def time_all(run: Run, mitsuba: Any, root: str, names: Sequence[str], count: int, repeats: int) -> None:
    """Print speeds of plugins beside that of roughconductor."""
    import drjit

    import brdfdb

    drjit.set_thread_count(1)
    speed = [Column(name=name, unit="million/s") for name in ("values", "samples")]
    shares = [Column(name=f"{name}, share of roughconductor") for name in ("values", "samples", "pictures")]
    table = run.table("Speed of one processor, LLVM, mono", Column(name="plugin", width=44), *speed, *shares)
    passes = 4 if repeats == 1 else PASSES
    conductor = {"type": "roughconductor", "alpha": 0.1, "eta": 1.13, "k": 2.56}
    documents = {"roughconductor": conductor, **{str(subject): subject.document for subject in TIMED}}
    for name in names:
        method = brdfdb.open(root)[name].metadata.interpolation.method
        documents[f"table of {name}, {method}"] = {"type": "brdfdb_table", "material": name, "store": root}
    for name, document in documents.items():
        beside = speeds(mitsuba, mitsuba.load_dict(conductor), count, repeats)
        values, samples = speeds(mitsuba, mitsuba.load_dict(document), count, repeats)
        picture, other = (picture_seconds(mitsuba, bsdf, passes, min(repeats, 5)) for bsdf in (conductor, document))
        table.add(name, values, samples, values / beside[0], samples / beside[1], picture / other)


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare and time all plugins."""
    run = Run("mitsuba_plugins", "speed", "Plugins of Mitsuba", MEASURED)
    options = run.parse(run.parser(__doc__), arguments)
    if "DRJIT_LIBLLVM_PATH" not in os.environ:
        raise SystemExit("DRJIT_LIBLLVM_PATH names no LLVM 19 for mitsuba's llvm variants")
    import mitsuba

    import brdfdb.mitsuba

    assert brdfdb.mitsuba.PLUGINS
    mitsuba.set_variant("llvm_ad_mono")
    pairs, count, samples, repeats = QUICK if options.quick else FULL
    names = TABLES[:1] if options.quick else TABLES
    with tempfile.TemporaryDirectory() as root:
        for name in names:
            publish(root, presets()[name], tolerance=0.1 if options.quick else TOLERANCE)
        good = compare(run, mitsuba, pairs, samples)
        good &= compare_tables(run, mitsuba, root, names, pairs)
        time_all(run, mitsuba, root, names, count, repeats)
    run.say(f"All are {'within' if good else 'NOT within'} what is required.")
    run.end()
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
