"""The cost of first calls in a fresh process, cold and from the cache: ``python tests/benchmarks/first_call.py``.

The clock runs while every model of the default recipe is evaluated once on a tiny grid of angles, specular parts too,
for every way in which the recipe calls it; importing and reading the recipe is timed apart. Cold means that no compiled
code is kept yet.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any

FLOORS = {"cold": 15.0, "warm": 0.5}
WARM_ROUNDS = 3
QUICK_MODEL = "lambert"
MEASURED = "The seconds to the first values of each model in a fresh process, without compiled code and with it."


def evaluate_all(only: Sequence[str]) -> None:
    """Do the work of the fresh process: print the seconds of each stage, of some models or all, as JSON."""
    start = time.perf_counter()
    import numpy as np

    from brdfdb_pipelines.recipe_file import load

    imported = time.perf_counter()
    theta, phi = np.array([0.1, 0.8]), np.array([0.0, 1.0, 3.0])
    calls: dict[tuple[Any, ...], tuple[Any, dict[str, Any]]] = {}
    for job in load().jobs():
        if only and job.material.model not in only:
            continue
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


def fresh_process(cache: str, models: Sequence[str]) -> dict[str, Any]:
    """Run `evaluate_all` in a process of its own, with the compiled code kept in `cache`."""
    done = subprocess.run(
        [sys.executable, __file__, "evaluate", *models],
        env=os.environ | {"NUMBA_CACHE_DIR": cache},
        capture_output=True,
        text=True,
        check=True,
    )
    measured: dict[str, Any] = json.loads(done.stdout)
    return measured


def main(arguments: Sequence[str] | None = None) -> int:
    """Print seconds to first values, cold and warm, against their floors."""
    sys.path.insert(0, str(Path(__file__).parents[2]))
    from tests.benchmarks.recording import Column, Run  # here, since the fresh process times its imports

    run = Run("first_call", "speed", "First calls in a fresh process", MEASURED)
    options = run.parse(run.parser(__doc__), arguments)
    models, rounds = ([QUICK_MODEL], 1) if options.quick else ([], WARM_ROUNDS)
    with tempfile.TemporaryDirectory() as cache:
        runs = {name: [fresh_process(cache, models) for _ in range(n)] for name, n in (("cold", 1), ("warm", rounds))}
    table = run.table(
        "Seconds of each stage",
        Column(name="stage", width=28),
        Column(name="cold", unit="s"),
        Column(name="warm", unit="s"),
    )
    for stage in ("import", "recipe"):
        table.add(stage, *(median(one[stage] for one in each) for each in runs.values()))
    for model in runs["cold"][0]["models"]:
        table.add(model, *(median(one["models"][model] for one in each) for each in runs.values()))
    totals = {name: median(sum(one["models"].values()) for one in each) for name, each in runs.items()}
    table.add("all models", *totals.values())
    for name, total in totals.items():
        word = "within" if total <= FLOORS[name] else "above"
        run.say(f"First values, {name}: {total:.2f} s, {word} the {FLOORS[name]:g} s that are wanted.")
    run.end()
    return 0


if __name__ == "__main__":
    evaluate_all(sys.argv[2:]) if sys.argv[1:2] == ["evaluate"] else sys.exit(main())
