"""Ten thousand materials in one store: build, list, open: ``python tests/benchmarks/many_materials.py [COUNT]``.

The store goes to a temporary directory, or to that of ``--dir``.
"""

from __future__ import annotations

import argparse
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import brdfdb
from brdfdb_pipelines.build import build
from brdfdb_pipelines.recipe_file import Recipe
from brdfdb_pipelines.workers import threads

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


def main() -> None:
    """Measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", nargs="?", type=int, default=10_000)
    parser.add_argument("--dir", type=Path)
    options = parser.parse_args()
    made = recipe(options.count)
    with tempfile.TemporaryDirectory(dir=options.dir) as root, threads(2) as at:
        for what in ("build", "build again"):
            start = time.perf_counter()
            build(made, Path(root), at)
            seconds = time.perf_counter() - start
            print(f"{what:12} {seconds:8.1f} s, {1e3 * seconds / options.count:.2f} ms a table, 2 threads")
        command = [sys.executable, "-m", "brdfdb_pipelines.cli", "list", "--store", root]
        for _ in range(3):
            start = time.perf_counter()
            listed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
            print(f"{'list':12} {time.perf_counter() - start:8.2f} s, {len(listed.splitlines())} lines")
        names = random.Random(0).sample(sorted(brdfdb.open(root)), min(200, options.count))
        brdfdb.open(root)[names[0]]  # imports
        times = []
        for name in names:
            store = brdfdb.open(root)
            start = time.perf_counter()
            store[name].lookup(0.1, 0.0, 0.2, 0.0)
            times.append(time.perf_counter() - start)
        times.sort()
        print(f"{'open':12} {1e3 * times[len(times) // 2]:8.2f} ms in the median, {1e3 * times[-1]:.2f} ms at most")


if __name__ == "__main__":
    main()
