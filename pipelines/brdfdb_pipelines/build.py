"""The build job: tabulate what a recipe asks for, on a pool of workers, and publish each table when it is whole."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from brdfdb.store import Build
from brdfdb.tabulate import tabulate
from brdfdb_pipelines import terminal
from brdfdb_pipelines.recipe import Job, Recipe, load


@dataclass(frozen=True)
class Built:
    """What became of one job."""

    job: Job
    revision: str
    stored_bytes: int


def build(recipe: Recipe, root: Path, executor: Executor, progress: Callable[[int], None]) -> list[Built]:
    """Build every table of a recipe.

    Parameters
    ----------
    recipe : Recipe
        What to build.
    root : Path
        Directory of the store; made if it does not exist.
    executor : Executor
        Where tables are computed and written, one task a table. Kernels hold no lock of the interpreter.
    progress : callable
        Called from the workers with the number of values just computed.

    Returns
    -------
    list of Built
        In the order of the recipe.

    Raises
    ------
    RecipeError
        Before anything is written, if the recipe cannot be built.
    StoreError
        If the store cannot be written. Revisions published so far stay; the others keep their old pointer.
    """
    jobs = recipe.jobs()
    with Build(root, recipe.model_dump(mode="json")) as target:

        def run(job: Job) -> Built:
            dataset = tabulate(job.layout())
            progress(dataset["brdf"].size)
            return Built(job, *target.publish(job.material.name, dataset))

        # the largest first: the last worker then has little left to do
        ordered = sorted(jobs, key=lambda job: job.layout().size, reverse=True)
        futures: dict[Future[Built], Job] = {executor.submit(run, job): job for job in ordered}
        built: dict[str, Built] = {}
        try:
            for future in as_completed(futures):
                done = future.result()
                built[done.job.material.name] = done
        except BaseException:
            for future in futures:
                future.cancel()
            executor.shutdown(wait=True, cancel_futures=True)
            raise
    return [built[job.material.name] for job in jobs]


def run(recipe_path: Path | None, root: Path, workers: int) -> None:
    """Build a recipe file, by default the built-in one, on threads; show progress and what came out."""
    recipe = load(recipe_path)
    start = time.perf_counter()
    total = sum(job.layout().size for job in recipe.jobs())
    with terminal.progress(counted=False) as bar, ThreadPoolExecutor(workers) as executor:
        task = bar.add_task("tabulating", total=total)
        built = build(recipe, root, executor, lambda count: bar.advance(task, count))
    seconds = time.perf_counter() - start
    terminal.print_table(
        f"{len(built)} tables, {total / 1e6:.1f} million values, in {seconds:.1f} s",
        ("material", "model", "grid", "wavelengths", "revision", "stored"),
        [
            (
                b.job.material.name,
                b.job.material.model,
                " x ".join(str(n) for n in b.job.grid.shape),
                "grey" if b.job.wavelength_nm is None else str(b.job.wavelength_nm.size),
                b.revision,
                terminal.size(b.stored_bytes),
            )
            for b in built
        ],
        numbers=("grid", "wavelengths", "stored"),
    )
    print(f"stored {terminal.size(sum(b.stored_bytes for b in built))} in {root}")
