"""What first calls cost in a fresh process, cold and from the cache: ``python tests/benchmarks/first_call.py``.

The clock runs while every model of the default recipe is evaluated once on a tiny grid of angles, Dirac parts too, for
every way in which the recipe calls it; importing and reading the recipe is timed apart.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from statistics import median
from typing import Any

FLOORS = {"cold": 15.0, "warm": 0.5}
WARM_ROUNDS = 3


def evaluate_all() -> None:
    """The work of the fresh process: print the seconds of each stage as JSON."""
    start = time.perf_counter()
    import numpy as np

    from brdfdb_pipelines.recipe_file import load

    imported = time.perf_counter()
    theta, phi = np.array([0.1, 0.8]), np.array([0.0, 1.0, 3.0])
    calls: dict[tuple[Any, ...], tuple[Any, dict[str, Any]]] = {}
    for job in load().jobs():
        # float arrays of other parameters run the same machine code; a mirror has less to compute than a rough surface
        rough = job.material.parameters.get("sigma_0_um") != 0.0
        wavelength_nm = None if job.wavelength_nm is None else job.wavelength_nm[0]
        arguments = job.material.arguments(wavelength_nm)
        calls.setdefault((job.material.model, job.material.anisotropic, rough), (job.material.spec, arguments))
    read = time.perf_counter()
    seconds: dict[str, float] = {}
    for (model, anisotropic, _), (spec, arguments) in calls.items():
        before = time.perf_counter()
        phi_i = phi[:, None, None] if anisotropic else 0.0
        spec.evaluate(
            theta[:, None, None, None] if anisotropic else theta[:, None, None], phi_i, theta[:, None], phi, **arguments
        )
        if spec.specular is not None:
            spec.specular(theta, **{name: arguments[name] for name in spec.specular_parameters})
        seconds[model] = seconds.get(model, 0.0) + time.perf_counter() - before
    print(json.dumps({"import": imported - start, "recipe": read - imported, "models": seconds}))


def fresh_process(cache: str) -> dict[str, Any]:
    """Run `evaluate_all` in a process of its own, with the compiled code kept in `cache`."""
    done = subprocess.run(
        [sys.executable, __file__, "evaluate"],
        env=os.environ | {"NUMBA_CACHE_DIR": cache},
        capture_output=True,
        text=True,
        check=True,
    )
    measured: dict[str, Any] = json.loads(done.stdout)
    return measured


def main() -> None:
    """Print seconds to first values, cold and warm, against their floors."""
    with tempfile.TemporaryDirectory() as cache:
        runs = {"cold": [fresh_process(cache)], "warm": [fresh_process(cache) for _ in range(WARM_ROUNDS)]}
    print(f"{'seconds':28}{'cold':>8}{'warm':>8}")
    for stage in ("import", "recipe"):
        print(f"{stage:28}" + "".join(f"{median(run[stage] for run in each):8.2f}" for each in runs.values()))
    for model in runs["cold"][0]["models"]:
        print(f"{model:28}" + "".join(f"{median(run['models'][model] for run in each):8.2f}" for each in runs.values()))
    for name, each in runs.items():
        total = median(sum(run["models"].values()) for run in each)
        verdict = "ok" if total <= FLOORS[name] else "over"
        print(f"first values, {name}: {total:.2f} s, floor {FLOORS[name]:g} s, {verdict}")


if __name__ == "__main__":
    evaluate_all() if sys.argv[1:] == ["evaluate"] else main()
