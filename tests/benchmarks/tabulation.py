"""How fast one core tabulates the presets on plain grids: ``python tests/benchmarks/tabulation.py``.

Machines are shared and noisy: compare models or commits in one run, not numbers of different days.
"""

from __future__ import annotations

import sys
import time
from collections import defaultdict

from plain import plain_recipe

from brdfdb.tables.tabulation import tabulate


def main(wanted: list[str]) -> None:
    """Time every table on its plain grid, or those of the models that are named."""
    jobs = [job for job in plain_recipe().jobs() if not wanted or job.material.model in wanted]
    for first in {job.material.model: job for job in jobs}.values():  # compile before the clock runs
        tabulate(first.layout())
    totals: dict[str, list[float]] = defaultdict(lambda: [0.0, 0.0])
    for job in jobs:
        start = time.perf_counter()
        tabulate(job.layout())
        seconds = time.perf_counter() - start
        size = job.layout().size
        print(f"{job.material.name:36}{job.material.model:14}{size / seconds / 1e6:8.1f} million values a second")
        totals[job.material.model][0] += size
        totals[job.material.model][1] += seconds
    for model, (size, seconds) in totals.items():
        print(f"{'all of':36}{model:14}{size / seconds / 1e6:8.1f} million values a second, one core")


if __name__ == "__main__":
    main(sys.argv[1:])
