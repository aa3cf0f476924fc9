"""Noise of pictures in environments: ``python tests/benchmarks/environments.py``.

Points of a sphere, each turned at random, are lit by four environments with 32 directions a point. Directions follow
the cosine, the lobe that the source of a table states, and the table's own sampler. Exits with 1 if the means of two
samplers differ by more than their noise explains.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parents[2]))

import brdfdb
from brdfdb.geometry import radians, unit_vector
from brdfdb.materials import Material, Source, presets
from brdfdb.measurements import MeasuredSource
from brdfdb.parameters import Floats
from brdfdb.scenes.environment import Environment
from brdfdb.scenes.lit_sphere import studio
from brdfdb.store.publication import publish
from brdfdb.tables.sampler import Sampler
from brdfdb.tables.table import Table, TableSource
from tests.benchmarks.formats import tables
from tests.benchmarks.recording import Column, Run

Array = NDArray[np.float64]

MEASURED = (
    "Noise of a point of a picture with 32 directions of an environment, over the mean radiance, and processor time "
    "of a direction, drawn and looked up at 41 wavelengths: by the cosine, by the lobe that the source states, and by "
    "the sampler of the table. Ratios are those to the lobe, or to the cosine where none is stated."
)
# Matte; anisotropic, glossy and faint lobes of Ward; He-Torrance, rough and as smooth as a mirror
MATERIALS = (
    "clay-vase", "foam", "varnished-plywood", "latex-gloss-rolled-wood", "rolled-brass", "rolled-aluminum",
    "sandpaper-220-grit", "scene-copper-sphere", "aluminum-cylinder-12a",
)  # fmt: skip
QUICK = ("rolled-brass",)
COSINE = "aluminum-cylinder-13c"  # a material without a lobe, by which directions follow the cosine
SAMPLES, POINTS, REPEATS = 32, 150, 12
QUICK_REPEATS = 6
WAVELENGTHS_NM = np.arange(380.0, 781.0, 10.0)
SEED, ROWS = 1994, 128  # rows of the pictures of environments
STANDARD_ERRORS = 6.0
EXACT = 1e-9  # noise that is rounding
_LAMP, _LAMP_WIDTH = np.array([0.6, 0.4, 0.69]), 0.02  # about 10 degrees wide


def _back(wi: Floats, wr: Floats) -> Floats:
    return np.asarray(0.02 + 3.0 * np.exp(100.0 * (np.sum(wi * wr, axis=1, keepdims=True) - 1.0)))


def _black(wi: Floats, wr: Floats) -> Floats:
    """Return f_r of a black coating: hardly any light near the normal, and a peak at grazing light."""
    h = wi + wr
    t2 = (h[:, :1] ** 2 + h[:, 1:2] ** 2) / (0.15 * h[:, 2:]) ** 2
    grazing = (1.0 - 0.5 * np.linalg.norm(h, axis=1, keepdims=True)) ** 3
    return np.asarray(0.01 + (0.3 + 30.0 * grazing) / (1.0 + t2) ** 2)


def _white(wi: Floats, _wr: Floats) -> Floats:
    return np.full((len(wi), 1), 0.9 / np.pi)


MADE_UP = {"measured: back to the light": _back, "measured: black coating": _black, "measured: white": _white}


class Cells(TableSource):
    """A table that draws by its own sampler even if f_r hardly varies."""

    def __init__(self, table: Table) -> None:
        super().__init__(table)

    @property
    def sampler(self) -> Sampler:
        return self._table.sampler


class Estimates(NamedTuple):
    """Radiance (environments, repeats, points) of points, and the time [ns] of a direction."""

    radiance: Array
    ns: float

    @property
    def mean(self) -> Array:
        """Mean radiance in each environment."""
        return np.asarray(self.radiance.mean(axis=(1, 2)))

    @property
    def noise(self) -> Array:
        """Standard deviation of a point, root mean square over points, over the mean radiance."""
        return np.asarray(np.sqrt(self.radiance.var(axis=1, ddof=1).mean(axis=1)) / self.mean)

    @property
    def error(self) -> Array:
        """Standard error of the mean radiance in each environment."""
        return np.asarray(np.sqrt(self.radiance.var(axis=1, ddof=1).mean(axis=1) / self.radiance[0].size))


def environments() -> dict[str, Environment]:
    """Return environments by name, from an even one to a lamp."""
    theta = radians((np.arange(ROWS) + 0.5) * 180.0 / ROWS)[:, np.newaxis]
    towards = unit_vector(theta, radians(180.0 - (np.arange(2 * ROWS) + 0.5) * 180.0 / ROWS))
    lamp = 0.1 + 20.0 * np.exp((towards @ (_LAMP / np.linalg.norm(_LAMP)) - 1.0) / _LAMP_WIDTH)
    room = np.array([[4.0, 4.0, 4.0, 4.0], [1.0, 2.0, 0.5, 0.25], [0.1, 0.0, 0.2, 0.1]])
    pictures = {"even": np.ones((1, 1)), "room": room, "studio": studio(towards), "lamp": lamp}
    return {name: Environment(rows=rows.tolist(), samples=SAMPLES, seed=SEED) for name, rows in pictures.items()}


def estimates(source: TableSource, by: Source, repeats: int) -> Estimates:
    """Estimate the radiance of points that a source of f_r reflects, with the directions that another one draws."""
    rng = np.random.default_rng(SEED)
    wr = unit_vector(np.arccos(np.sqrt(1.0 - rng.random(POINTS))), 2.0 * np.pi * rng.random(POINTS))
    turned = Rotation.random(POINTS, random_state=SEED).as_matrix()
    lights = environments()
    first = next(iter(lights.values()))
    brdf = source.brdf_at(source.evaluated_at(WAVELENGTHS_NM))
    radiance, times = np.empty((len(lights), repeats, POINTS)), []
    for repeat in range(-1, repeats):  # the first one compiles
        began = time.process_time()
        drawn = first.drawn(by, WAVELENGTHS_NM, wr, (repeat + 1,))
        above = drawn.wi[..., 2] > 0.0
        f_r = np.zeros(above.shape)
        f_r[above] = brdf(drawn.wi[above], np.broadcast_to(wr, drawn.wi.shape)[above]).mean(axis=1)
        if repeat < 0:
            continue
        times.append((time.process_time() - began) / above.size)
        weight = f_r * np.maximum(drawn.wi[..., 2], 0.0) * drawn.solid_angle
        towards = np.einsum("snj,njk->snk", drawn.wi, turned)
        radiance[:, repeat] = [np.sum(weight * light.radiance(towards), axis=0) for light in lights.values()]
    return Estimates(radiance, 1e9 * min(times))


def given(quick: bool) -> Iterator[tuple[str, Table, Source]]:
    """Give tables with their sources: presets, and made-up measurements."""
    for table, _ in tables(QUICK if quick else MATERIALS):
        yield table.name, table, presets()[table.name]
    with tempfile.TemporaryDirectory() as folder:
        for title, f_r in list(MADE_UP.items())[: 1 if quick else None]:
            name = title.removeprefix("measured: ").replace(" ", "-")
            source = MeasuredSource.of_function(f_r, ("grey",), None, name=name, title=title, provenance="made up")
            publish(folder, source, tolerance=0.05)
            yield title, brdfdb.open(Path(folder))[name], source


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw by all samplers in all environments, and print a row for each material and environment."""
    run = Run("environments", "accuracy", "Noise in environments", MEASURED)
    options = run.parse(run.parser(__doc__), arguments)
    repeats = QUICK_REPEATS if options.quick else REPEATS
    noises = run.table(
        "Noise of a point with 32 directions",
        Column(name="material", width=27),
        Column(name="pictures use", width=8),
        Column(name="environment", width=11),
        *(Column(name=name, unit="%") for name in ("cosine", "lobe", "table")),
        "ratio",
        Column(name="ratio in the same time", recorded=False),
    )
    times, far = [], []
    for title, table, source in given(options.quick):
        own = TableSource(table)
        by = {"cosine": presets()[COSINE], "lobe": source, "table": Cells(table)}
        known = {name: estimates(own, drawn_by, repeats) for name, drawn_by in by.items()}
        _, lobe, cells = known.values()
        of_table = not isinstance(source, Material) and own.sampler is not None
        chosen = "table" if of_table else "lobe" if source.has_lobe else "cosine"
        slower = float(np.sqrt(cells.ns / lobe.ns))
        for row, name in enumerate(environments()):
            ratio = cells.noise[row] / lobe.noise[row] if lobe.noise[row] > EXACT else np.nan
            percents = [100.0 * one.noise[row] for one in known.values()]
            if not source.has_lobe:
                percents[1] = np.nan
            noises.add(title, chosen, name, *percents, ratio, ratio * slower)
            off = abs(cells.mean[row] - lobe.mean[row])
            far += [f"{title} in {name}"] * bool(off > STANDARD_ERRORS * np.hypot(cells.error[row], lobe.error[row]))
        times.append((title, *(one.ns for one in known.values())))
    rows = run.table(
        "Processor time of a direction",
        Column(name="material", width=27),
        *(Column(name=name, unit="ns") for name in by),
    )
    for line in times:
        rows.add(*line)
    run.say(f"Means that differ by more than their noise: {', '.join(far) or 'none'}.")
    run.end()
    return int(bool(far))


if __name__ == "__main__":
    sys.exit(main())
