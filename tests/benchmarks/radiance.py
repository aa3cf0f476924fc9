"""Files for Radiance and WINDOW, judged by both: ``python tests/benchmarks/radiance.py``.

Each preset, or each material of the store DIR with ``--store DIR``, is written as a tensor tree and as Klems matrices.
The total of checkBSDF is compared with the albedo of the table, averaged as checkBSDF averages; f_r at random pairs, as
Radiance evaluates the file, with the table and with what the file states. pyWinCalc reads every matrix. Exits with 1 if
a total is more than 0.5 % off, beyond the digit that checkBSDF prints, or f_r is not within the stated error. Needs
pyradiance and pywincalc.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

import brdfdb
from brdfdb.formats import klems, radiance
from brdfdb.formats._channels import channels_of
from brdfdb.formats._stated_error import Comparison
from brdfdb.formats._written import Written
from brdfdb.formats.klems import BASES
from brdfdb.geometry import unit_vector
from brdfdb.tables.table import Table
from tests.benchmarks.formats import tables
from tests.benchmarks.recording import Column, Run, model_of
from tests.formats.bsdf_judges import check_bsdf, in_window, klems_total, made, queried, traced, tree_total

REQUIRED = 5e-3  # of totals, relative
PRINTED = 5e-4  # half of the last digit of checkBSDF
BLACK = 1e-3  # total up to which Radiance takes a surface as black
PAIRS = 2000
QUICK = ("glossy-grey-paper",)
QUICK_KINDS = ("half", "quarter")  # WINDOW takes half a minute for a full matrix
MEASURED = "Totals and f_r as Radiance and pyWinCalc see the files, against the tables, and the size and time of each."
# The lobe that Radiance's own plastic2 evaluates; wide, because cells blur narrow ones
BOUNDED = {"rho_d": 0.2, "rho_s": 0.3, "alpha_x": 0.3, "alpha_y": 0.45}
SUN = (0.4, 0.2, 0.9)  # direction of the sun in the picture
VIEW = (0.3, 0.4, 0.9)  # from the camera; from above, all viewers would lie on a border of cells of a tree
WIDTH = 64  # pixels along the picture
# Columns of the pictures: sums of all pixels and the median pixel
OF_PICTURE = tuple(
    f"{pair}, {part}"
    for pair in ("file to plastic2", "file to table", "plastic2 to table")
    for part in ("sum", "median")
)


def off(total: float, expected: float) -> float:
    """Return the relative difference of a total from what it should be, less what printing may have rounded off."""
    if expected < BLACK:
        return 0.0
    beyond = max(0.0, abs(total - expected) - PRINTED)
    return float(np.copysign(beyond / expected, total - expected))


def at_random(table: Table, path: Path) -> float:
    """Return the p99 of f_r as Radiance evaluates a file against the table, for light and viewer cosine-weighted."""
    rng = np.random.default_rng(7)
    theta, phi = np.arcsin(np.sqrt(rng.random((2, PAIRS)))), rng.uniform(0.0, 2.0 * np.pi, (2, PAIRS))
    wi, wr = unit_vector(theta[0], phi[0]), unit_vector(theta[1], phi[1])
    channels = channels_of(table, "auto")
    truth = channels.values(table, wi, wr)
    values = queried(path, wi, wr)
    values = values if truth.shape[1] > 1 else values[:, 1:2]
    wrong = np.abs(values - truth)
    scale = np.maximum(truth, np.maximum(Comparison(table, channels).floor, 1e-30))
    return float(np.quantile(wrong / scale, 0.99, axis=0).max())


class Picture(NamedTuple):
    """Relative differences of pictures of a lit ball: of the sum of all pixels, and of the median pixel."""

    whole: float  # file against plastic2
    median: float
    file_whole: float  # file against table
    file_median: float
    plastic_whole: float  # plastic2 against table
    plastic_median: float


def differences(seen: np.ndarray, expected: np.ndarray) -> tuple[float, float]:
    """Return the relative differences of two pictures in the sum of all pixels and in the median pixel."""
    return float(seen.sum() / expected.sum() - 1.0), float(np.median(np.abs(seen / expected - 1.0)))


def picture(folder: Path, table: Table) -> Picture:
    """Return how pictures of a lit ball differ: the file against Radiance's own Ward, and both against the table."""
    radiance.write(table, folder / "ball.xml")
    grid = (np.arange(WIDTH) + 0.5) / WIDTH * 2.0 - 1.0
    x, y = (axis.reshape(-1) for axis in np.meshgrid(grid, grid))
    normal = np.stack([x, y, np.sqrt(np.maximum(0.0, 1.0 - x * x - y * y))], axis=-1)
    sun, view = np.array(SUN) / np.linalg.norm(SUN), np.array(VIEW) / np.linalg.norm(VIEW)
    across = np.cross([0.0, 1.0, 0.0], view) / np.linalg.norm(np.cross([0.0, 1.0, 0.0], view))
    camera = np.stack([across, np.cross(view, across), view])
    seen = (normal[:, 2] > 0.1) & (normal @ camera @ sun > 0.1)
    origin, normal = (normal[seen] * [1, 1, 0] + [0, 0, 5]) @ camera, normal[seen] @ camera
    rays = np.concatenate([origin, np.tile(-view, (len(normal), 1))], axis=1)
    text = (folder / "ball.rad").read_text(encoding="utf-8")
    light = f"void light sun\n0\n0\n3 1e5 1e5 1e5\nsun source disk\n0\n0\n4 {sun[0]} {sun[1]} {sun[2]} 0.5\n"
    pictures = [
        traced(f"{light}{text}\n{name} sphere ball\n0\n0\n4 0 0 0 1\n", rays, folder, *options)
        for name, options in ((table.name, ("-ss", "64")), (f"{table.name}_plastic", ()))
    ]
    # The frame of the table at each point: its y axis is the up vector, less what is along the normal. As the file
    # states, the up vector is +y where the surface is less steep than 45 degrees, and +z elsewhere
    up = np.where(normal[:, 2:] ** 2 > 0.5, [0.0, 1.0, 0.0], [0.0, 0.0, 1.0])
    y_axis = up - np.sum(up * normal, axis=1, keepdims=True) * normal
    y_axis /= np.linalg.norm(y_axis, axis=1, keepdims=True)
    frame = np.stack([np.cross(y_axis, normal), y_axis, normal], axis=1)
    solid_angle = 2.0 * np.pi * (1.0 - np.cos(np.radians(0.25)))
    wi, wr = frame @ sun, frame @ view
    expected = np.asarray(table.lookup_vectors(wi, wr)) * wi[:, 2] * 1e5 * solid_angle
    of_file, plastic = pictures
    return Picture(*differences(of_file, plastic), *differences(of_file, expected), *differences(plastic, expected))


def timed(write: object, *arguments: object, **options: object) -> tuple[Written, float]:
    """Return what was written and the time [s] of the processor."""
    began = time.process_time()
    written: Written = write(*arguments, **options)  # type: ignore[operator]
    return written, time.process_time() - began


def given(store: Path | None, names: Sequence[str]) -> Iterator[Table]:
    """Give the tables of a store, or of presets that are tabulated; of some names, if any are given."""
    if store is None:
        yield from (table for table, _ in tables(names))
    else:
        opened = brdfdb.open(store)
        yield from (opened[name] for name in names or opened)


def main(arguments: Sequence[str] | None = None) -> int:
    """Write, judge and print all materials."""
    run = Run("radiance", "accuracy", "Files for Radiance and WINDOW", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("--store", type=Path, help="store with the tables (default: the presets are tabulated)")
    options = run.parse(parser, arguments)
    numbers = ("MB", "time s", "p99 stated", "p99 hemisphere", "p99 of Radiance", "l1", "total", "difference")
    trees = run.table("Tensor trees", Column(name="material", width=34), *numbers)
    matrices = run.table(
        "Klems matrices", Column(name="material", width=34), "kind", *numbers[:3], *numbers[5:], "WINDOW off"
    )
    balls = run.table("Pictures of a lit ball", Column(name="material", width=34), *OF_PICTURE)
    worst, beyond = 0.0, []
    with tempfile.TemporaryDirectory() as home:
        folder = Path(home)
        for table in given(options.store, QUICK if options.quick else ()):
            name, path = table.name, folder / f"{table.name}.xml"
            written, seconds = timed(radiance.write, table, path)
            error = written.error
            assert error is not None
            seen = at_random(table, path)
            _, total = check_bsdf(path)
            albedo = tree_total(table)
            wrong = off(total, albedo)
            worst = max(worst, abs(wrong))
            if albedo > BLACK and seen > 1.1 * error.p99_hemisphere + 1e-3:
                beyond.append(name)
            trees.add(
                name, written.nbytes / 1e6, seconds, error.p99, error.p99_hemisphere, seen, error.l1, total, wrong
            )
            for kind in QUICK_KINDS if options.quick else klems.kinds:
                written, seconds = timed(klems.write, table, path, kind=kind)
                error = written.error
                assert error is not None
                largest, normal = klems_total(table, BASES[kind])
                _, total = check_bsdf(path)
                wrong = off(total, largest)
                shares = in_window(path, kind, "PHOTOPIC", "SOLAR")
                window = max(
                    (abs(share - normal) / max(normal, 1e-9) for share in shares if normal > 0.0), default=None
                )
                worst = max(worst, abs(wrong), window or 0.0)
                matrices.add(name, kind, written.nbytes / 1e6, seconds, error.p99, error.l1, total, wrong, window)
            if table.metadata.model == "ward":
                balls.add(name, *np.abs(picture(folder, table)))
        bounded = picture(folder, made("ward_bounded", BOUNDED))
        balls.add("bounded Ward", *np.abs(bounded))
    for title, rows in (("trees", trees.rows), ("matrices", matrices.rows)):
        column = 2 if title == "trees" else 3
        run.say(
            f"All {len(rows)} {title} took {sum(float(row[column] or 0.0) for row in rows):.0f} s of one processor."
        )
    run.say(f"Totals are off by {worst:.2%} at most, beyond rounding; at most {REQUIRED:.1%} is required.")
    count = len(trees.rows)
    run.say(f"f_r is within the stated error for {count - len(beyond)} of {count} trees. {' '.join(beyond)}".strip())
    far = max(abs(float(row[2] or 0.0)) for row in balls.rows)
    run.say(f"{len(balls.rows)} pictures of a file differ from plastic2 by {far:.2%} at most in the median pixel.")
    run.say(f"Where both have one formula, bounded Ward, all light together differs by {bounded.whole:.2%}.")
    run.say("For each model, the page shows the material with the largest error.")
    trees.keep_worst("p99 of Radiance", model_of)
    matrices.keep_worst("difference", lambda row: (model_of(row), row[1]))
    balls.keep_worst("file to plastic2, median", model_of)
    run.end()
    return 0 if worst <= REQUIRED and not beyond and max(far, abs(bounded.whole)) <= 0.01 else 1


if __name__ == "__main__":
    sys.exit(main())
