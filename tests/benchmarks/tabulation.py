"""The speed at which one core tabulates the presets on plain grids: ``python tests/benchmarks/tabulation.py``.

Machines are shared and noisy: compare models or commits in one run, not numbers of different days.
"""

from __future__ import annotations

import sys
import time
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from brdfdb.tables.tabulation import tabulate
from tests.benchmarks.plain import plain_recipe
from tests.benchmarks.recording import Column, Run

MEASURED = "The values of f_r that one core computes in a second when it fills tables on plain grids."


def main(arguments: Sequence[str] | None = None) -> int:
    """Time every table on its plain grid, or those of the models that are named."""
    run = Run("tabulation", "speed", "Tabulation on one core", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("models", metavar="MODEL", nargs="*", help="by default all")
    options = run.parse(parser, arguments)
    jobs = plain_recipe(options.models, coarse=options.quick).jobs()
    for first in {job.material.model: job for job in jobs}.values():  # compile before the clock runs
        tabulate(first.layout())
    totals: dict[str, list[float]] = defaultdict(lambda: [0.0, 0.0, 0.0])
    table = run.table(
        "Tables", Column(name="material", width=32), Column(name="model", width=12), "values", rate("values")
    )
    for job in jobs:
        start = time.perf_counter()
        tabulate(job.layout())
        seconds = time.perf_counter() - start
        size = job.layout().size
        table.add(job.material.name, job.material.model, size, size / seconds / 1e6)
        totals[job.material.model] = [
            a + b for a, b in zip(totals[job.material.model], (1, size, seconds), strict=True)
        ]
    models = run.table("All tables of a model", Column(name="model", width=32), "tables", rate("values"))
    for model, (count, size, seconds) in totals.items():
        models.add(model, int(count), size / seconds / 1e6)
    run.end()
    return 0


def rate(name: str) -> Column:
    """Return a column of millions a second."""
    return Column(name=name, unit="1e6/s")


if __name__ == "__main__":
    sys.exit(main())
