"""A training set beside its kernel and its codec: ``python tests/benchmarks/training_set.py``, one thread.

The set goes to a temporary directory, or to that of ``--dir``.
"""

from __future__ import annotations

import contextlib
import io
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb.materials.hypercube import axes_of, materials, pairs
from brdfdb.models import MODELS
from brdfdb.store.codec import chunk_bytes
from brdfdb_pipelines import sample
from tests.benchmarks.recording import Column, Run

COUNT, QUICK_COUNT = 100_000, 200
DIRECTIONS, QUICK_DIRECTIONS = 1_000, 50
REPEATS = 3
MEASURED = (
    "Values of ward per second from `brdfdb sample`, and from its kernel alone and its codec alone for the same chunks."
)


def once(count: int, directions: int, folder: Path | None) -> dict[str, tuple[float, float]]:
    """Return wall and processor time [s] of kernel, codec and command, each for the whole set."""
    spec = MODELS["ward"]
    axes = axes_of(spec, {})
    made = sample.TrainingSet(spec, axes, materials(spec, axes, count, 0), pairs(directions, 0), gradients=False)
    spent = {"kernel": np.zeros(2), "codec": np.zeros(2), "brdfdb sample": np.zeros(2)}

    def clock() -> np.ndarray:
        return np.array([time.perf_counter(), time.process_time()])

    for chunk in range(made.chunks):
        begin = clock()
        (values,) = made.values(chunk)
        computed = clock()
        chunk_bytes(values, made.rows)
        spent["kernel"] += computed - begin
        spent["codec"] += clock() - computed
    with tempfile.TemporaryDirectory(dir=folder) as root, contextlib.redirect_stdout(io.StringIO()):
        begin = clock()
        sample.run("ward", Path(root) / "set.zarr", count=count, directions=directions)
        spent["brdfdb sample"] += clock() - begin
    return {name: (float(both[0]), float(both[1])) for name, both in spent.items()}


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print and record."""
    run = Run("training_set", "speed", "A training set, its kernel and its codec", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("--dir", type=Path)
    options = run.parse(parser, arguments)
    count, directions = (QUICK_COUNT, QUICK_DIRECTIONS) if options.quick else (COUNT, DIRECTIONS)
    once(QUICK_COUNT, QUICK_DIRECTIONS, options.dir)  # compiles
    runs = [once(count, directions, options.dir) for _ in range(1 if options.quick else REPEATS)]
    best = {name: np.min([one[name] for one in runs], axis=0) for name in runs[0]}
    parts = best["kernel"] + best["codec"]
    columns = [Column(name="wall time", unit="s"), Column(name="processor time", unit="s")]
    rates = [Column(name="values a second", unit="M"), Column(name="processor time over kernel and codec")]
    table = run.table(
        f"{count} materials times {directions} directions", Column(name="task", width=16), *columns, *rates
    )
    for name, (wall, processor) in best.items():
        table.add(name, wall, processor, 1e-6 * count * directions / wall, processor / parts[1])
    run.say(f"Wall time of the command over kernel and codec: {best['brdfdb sample'][0] / parts[0]:.2f}.")
    run.end()
    return 0


if __name__ == "__main__":
    sys.exit(main())
