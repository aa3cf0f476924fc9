"""A build end to end, against its kernels alone and its codec alone: ``python tests/benchmarks/build_throughput.py``.

All three in one run, on the same threads, of the same tables: every preset on plain grids, or those of the models that
are named. Prints values a second, and the share of the slower of the two that the build reaches. By default it writes
to memory (/dev/shm), so that the disk, which every block is synced to, has no part in it; ``--dir`` names a directory
on a disk.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb.store.codec import chunk_bytes
from brdfdb.tables.layout import Layout
from brdfdb.tables.tabulation import block
from brdfdb_pipelines.build import build
from brdfdb_pipelines.workers import Workers
from tests.benchmarks.plain import plain_recipe
from tests.benchmarks.recording import Column, Run

MEASURED = "Values per second of a build, and of its kernels and its codec alone, for the same tables."


def main(arguments: Sequence[str] | None = None) -> int:
    """Time kernels, codec and build."""
    run = Run("build_throughput", "speed", "A build, its kernels and its codec", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("models", nargs="*", metavar="MODEL")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--dir", type=Path, default=Path("/dev/shm") if Path("/dev/shm").is_dir() else None)
    parser.add_argument("--repeat", type=int, default=2)
    options = run.parse(parser, arguments)
    recipe = plain_recipe(options.models, coarse=options.quick)
    tasks = [(job.layout(), number) for job in recipe.jobs() for number in range(len(job.layout().blocks))]
    tasks.sort(key=lambda task: task[0].size, reverse=True)
    total = sum(job.layout().size for job in recipe.jobs())
    for layout in {layout.source.model: layout for layout, _ in tasks}.values():  # compile before the clock runs
        chunk_bytes(block(layout, layout.blocks[0]), layout.block_rows)
    best: dict[str, float] = {}
    with ThreadPoolExecutor(options.jobs) as pool:
        at = Workers(pool, lambda: options.jobs)

        def compute(task: tuple[Layout, int]) -> NDArray[np.float32]:
            layout, number = task
            return block(layout, layout.blocks[number])

        def encode(task: tuple[Layout, int], values: NDArray[np.float32]) -> int:
            return len(chunk_bytes(values, task[0].block_rows))

        for _ in range(1 if options.quick else options.repeat):  # in turn, so that a noisy machine is unfair to none
            start = time.perf_counter()
            values = list(pool.map(compute, tasks))
            computed = time.perf_counter()
            list(pool.map(encode, tasks, values))
            coded = time.perf_counter()
            del values
            with tempfile.TemporaryDirectory(dir=options.dir) as root:
                began = time.perf_counter()
                build(recipe, Path(root), at)
                built = time.perf_counter()
            for what, seconds in (("kernels", computed - start), ("codec", coded - computed), ("build", built - began)):
                best[what] = min(best.get(what, float("inf")), seconds)
    slower = max(best["kernels"], best["codec"])
    table = run.table(
        f"{len(recipe.jobs())} tables, {total / 1e6:.3g} million values, {options.jobs} threads",
        Column(name="stage", width=20),
        Column(name="values", unit="1e6/s"),
        Column(name="share of the slower of kernels and codec", unit="%", digits=2),
    )
    for what, seconds in best.items():
        table.add(what, total / seconds / 1e6, 100.0 * slower / seconds)
    run.end()
    return 0


if __name__ == "__main__":
    sys.exit(main())
