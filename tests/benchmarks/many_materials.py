"""Ten thousand materials in one store: build, list, open: ``python tests/benchmarks/many_materials.py [COUNT]``.

The store goes to a temporary directory, or to that of ``--dir``.
"""

from __future__ import annotations

import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import brdfdb
from brdfdb_pipelines.build import build
from brdfdb_pipelines.recipe_file import Recipe
from brdfdb_pipelines.workers import threads
from tests.benchmarks.recording import Column, Run

COUNT, QUICK_COUNT = 10_000, 20
COLUMNS = (Column(name="whole", unit="s"), Column(name="a table", unit="ms"))
MEASURED = "A store of very many small tables: the time to build it, to list it, and to open a table by its name."

SMALL = {"theta_i_deg": [0.0, 45.0, 80.0], "theta_r_deg": [0.0, 45.0, 80.0]}
ISOTROPIC = {**SMALL, "delta_phi_deg": [0.0, 90.0, 180.0]}
GRIDS = {
    "isotropic": ISOTROPIC,
    "spectral": ISOTROPIC,
    "anisotropic": {**SMALL, "phi_i_deg": [0.0, 360.0], "phi_r_deg": [0.0, 360.0]},
}


def recipe(count: int) -> Recipe:
    """Grey materials, each with a reflectance of its own."""
    define = {
        f"grey-{number}": {
            "title": f"Grey {number}",
            "model": "lambert",
            "source": "no paper",
            "parameters": {"rho": number / count},
        }
        for number in range(count)
    }
    return Recipe.model_validate({"materials": ["grey-*"], "wavelengths_nm": [500.0], "grids": GRIDS, "define": define})


def main(arguments: Sequence[str] | None = None) -> int:
    """Build, list and open, and print the times."""
    run = Run("many_materials", "speed", "A store of many materials", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("count", nargs="?", type=int, default=COUNT)
    parser.add_argument("--dir", type=Path)
    options = run.parse(parser, arguments)
    count = QUICK_COUNT if options.quick else options.count
    made = recipe(count)
    table = run.table(f"{count} materials, 2 threads", Column(name="task", width=28), *COLUMNS)
    with tempfile.TemporaryDirectory(dir=options.dir) as root, threads(2) as at:
        for what in ("build", "build again, nothing to do"):
            start = time.perf_counter()
            build(made, Path(root), at)
            seconds = time.perf_counter() - start
            table.add(what, seconds, 1e3 * seconds / count)
        command = [sys.executable, "-m", "brdfdb_pipelines.cli", "list", "--store", root]
        start = time.perf_counter()
        listed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        table.add("brdfdb list", time.perf_counter() - start, None)
        assert len(listed.splitlines()) > count
        names = random.Random(0).sample(sorted(brdfdb.open(root)), min(200, count))
        brdfdb.open(root)[names[0]]  # imports
        times = []
        for name in names:
            store = brdfdb.open(root)
            start = time.perf_counter()
            store[name].lookup(0.1, 0.0, 0.2, 0.0)
            times.append(time.perf_counter() - start)
        times.sort()
        table.add("open and look up, median", None, 1e3 * times[len(times) // 2])
        table.add("open and look up, slowest", None, 1e3 * times[-1])
    run.end()
    return 0


if __name__ == "__main__":
    sys.exit(main())
