"""Stores of a thousand to a hundred thousand small materials: ``python tests/benchmarks/scale.py [COUNT...]``.

Each task runs in a process of its own, whose processor time, wall time and largest memory are printed for one material.
The exponent is that of the growth of processor time from one number of materials to the next: 1 is linear. The
stores go to a temporary directory, or to that of ``--dir``.
"""

from __future__ import annotations

import asyncio
import contextlib
import io
import itertools
import math
import os
import random
import resource
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import AbstractContextManager
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).parents[2]))

import httpx

import brdfdb
from brdfdb.store.files import sha256_of
from brdfdb_api.http.app import create_app
from brdfdb_api.settings import Settings
from brdfdb_pipelines import cli, workers
from brdfdb_pipelines.build import build
from brdfdb_pipelines.recipe_file import Recipe
from tests.benchmarks.recording import Column, Run

COUNTS, QUICK_COUNTS = (1000, 10_000), (4, 8)
OPENED = 200  # materials that are opened one by one
ON_DASK, QUICK_ON_DASK = 300, 4
JOBS = 2
# Modules that tasks use: they are imported once
PRELOADED = ["httpx", "brdfdb_api.http.app", "brdfdb_pipelines.build", "brdfdb_pipelines.recipe_file"]
MEASURED = "The cost of building, listing, opening, verifying and serving stores of up to 100 000 small materials."

THETA = [0.0, 45.0, 80.0]
GRIDS = {"isotropic": {"theta_i_deg": THETA, "theta_r_deg": THETA, "delta_phi_deg": [0.0, 90.0, 180.0]}}


class Cost(NamedTuple):
    """The cost of a task: processor time and wall time [s], largest memory of its process [byte], and its result."""

    cpu: float
    wall: float
    memory: int
    result: Any = None


def recipe(count: int) -> Recipe:
    """Return a recipe of grey materials, each with a reflectance of its own, on a grid of 27 nodes."""
    define = {
        f"grey-{number}": {
            "title": f"Grey {number}",
            "model": "lambert",
            "source": "no paper",
            "parameters": {"rho": number / count},
        }
        for number in range(count)
    }
    return Recipe.model_validate({"materials": ["grey-*"], "grids": GRIDS, "define": define})


def check_recipe(_: Path, count: int) -> None:
    """Make the jobs of a recipe."""
    assert len(recipe(count).jobs()) == count


def on_threads(root: Path, count: int, state: str = "published") -> None:
    """Build all materials on two threads."""
    _build(root, count, workers.threads(JOBS), state)


def on_dask(root: Path, count: int) -> None:
    """Build all materials on a dask cluster of two processes of this machine."""
    from distributed import LocalCluster

    with LocalCluster(  # type: ignore[no-untyped-call]
        n_workers=JOBS, threads_per_worker=1, processes=True, dashboard_address=None, local_directory=str(root.parent)
    ) as cluster:
        _build(root, count, workers.cluster(cluster.scheduler_address), "published")


def _build(root: Path, count: int, where: AbstractContextManager[workers.Workers], state: str) -> None:
    with where as at:
        assert {one.state for one in build(recipe(count), root, at)} == {state}


def names_of(root: Path, count: int) -> None:
    """Open a store, and read the names of its materials."""
    assert len(list(brdfdb.open(root))) == count


def lookups(root: Path, count: int) -> list[float]:
    """Look up one value of several materials by name, each in a store that was just opened; return the times [s]."""
    brdfdb.open(root)["grey-0"].lookup(0.1, 0.0, 0.2, 0.0)  # imports and kernels
    times = []
    for number in random.Random(0).sample(range(count), min(OPENED, count)):
        start = time.process_time()
        value = brdfdb.open(root)[f"grey-{number}"].lookup(0.1, 0.0, 0.2, 0.0)
        times.append(time.process_time() - start)
        assert math.isclose(value, number / count / math.pi, rel_tol=1e-6)
    return sorted(times)


def unknown_name(root: Path, _: int) -> None:
    """Ask for a material that the store does not have."""
    with contextlib.suppress(KeyError):
        raise AssertionError(brdfdb.open(root)["gray-17"])


def page(root: Path, count: int) -> None:
    """Ask the service for the first page of its list."""

    async def ask() -> Any:
        app = create_app(Settings(store=root, log_level="error"))
        async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://localhost") as client:
            return (await client.get("/v1/materials")).json()

    first = asyncio.run(ask())
    assert (first["total"], first["materials"][0]["name"]) == (count, "grey-0")


def command(root: Path, _: int, word: str) -> None:
    """Run a command of brdfdb, and throw away what it prints."""
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        assert cli.main([word, "--store", str(root)]) == 0


TASKS: tuple[tuple[str, Callable[[Path, int], Any]], ...] = (
    ("make the jobs of a recipe", check_recipe),
    ("build, 2 threads", on_threads),
    ("build again, nothing to do", partial(on_threads, state="unchanged")),
    ("brdfdb.open and all names", names_of),
    *((f"brdfdb {word}", partial(command, word=word)) for word in ("list", "verify", "gc")),
    ("first page of the service", page),
    ("open by a wrong name", unknown_name),
    ("open and look up, 200 times", lookups),
)


def run_alone(task: Callable[[Path, int], Any], root: Path, count: int) -> Cost:
    """Run a task in a new process, and return its cost; processor time includes that of its own processes."""
    context = get_context("forkserver")  # it imports once: a task begins in tens of milliseconds, and without threads
    context.set_forkserver_preload(PRELOADED)
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        return pool.submit(_timed, task, root, count).result()


def _timed(task: Callable[[Path, int], Any], root: Path, count: int) -> Cost:
    start, began = time.perf_counter(), _processor_time()
    result = task(root, count)
    cpu, wall = _processor_time() - began, time.perf_counter() - start
    kilobytes = max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return Cost(cpu, wall, 1024 * kilobytes, result)


def _processor_time() -> float:
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


class Space(NamedTuple):
    """The space of a store: numbers of files and directories, their bytes, and the bytes that the disk gives them."""

    files: int
    directories: int
    bytes: int
    disk_bytes: int


def space_of(root: Path) -> Space:
    """Return the space that the materials of a store take."""
    files = directories = size = blocks = 0
    for folder, _, names in os.walk(root / "materials"):
        directories += 1
        blocks += os.lstat(folder).st_blocks
        for name in names:
            at = os.lstat(os.path.join(folder, name))
            files, size, blocks = files + 1, size + at.st_size, blocks + at.st_blocks
    return Space(files, directories, size, 512 * blocks)


def values_of(root: Path) -> dict[str, str]:
    """Return the sha256 of every chunk of a store, by its path."""
    chunks = (path for path in sorted((root / "materials").glob("*/*/*/c/**/*")) if path.is_file())
    return {str(path.relative_to(root)): sha256_of(path) for path in chunks}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run all tasks at each number of materials, then the builds on threads and on dask."""
    run = Run("scale", "speed", "Stores of many materials", MEASURED)
    parser = run.parser(__doc__)
    parser.add_argument("counts", nargs="*", type=int, metavar="COUNT", help=f"by default {COUNTS}")
    parser.add_argument("--dir", type=Path)
    options = run.parse(parser, arguments)
    counts = sorted(options.counts or (QUICK_COUNTS if options.quick else COUNTS))
    with tempfile.TemporaryDirectory(dir=options.dir) as folder:
        _dask(run, Path(folder), QUICK_ON_DASK if options.quick else ON_DASK)
    tables = []
    for count in counts:
        with tempfile.TemporaryDirectory(dir=options.dir) as folder:
            tables.append(_all_tasks(run, Path(folder) / "store", count))
        run.end()  # the next number may take hours, and be cut
    _growth(run, counts, tables)
    run.end()
    return 0


def _all_tasks(run: Run, root: Path, count: int) -> dict[str, float]:
    """Run all tasks with a number of materials; return the processor time of each [s]."""
    table = run.table(
        f"{count} materials",
        *(Column(name="task", width=28), Column(name="processor", unit="s"), Column(name="wall", unit="s")),
        *(Column(name="processor, a material", unit="ms"), Column(name="largest memory", unit="MB")),
    )
    times = {}
    for name, task in TASKS:
        cost = run_alone(task, root, count)
        times[name] = cost.cpu
        table.add(name, cost.cpu, cost.wall, 1e3 * cost.cpu / count, cost.memory / 1e6)
        if cost.result is not None:
            median, slowest = (1e3 * cost.result[at] for at in (len(cost.result) // 2, -1))
            run.say(f"{count} materials: open and look up one value {median:.2f} ms, at most {slowest:.2f} ms.")
    space = space_of(root)
    columns = ("files", "directories", Column(name="contents", unit="kB"), Column(name="on the disk", unit="kB"))
    of_one = run.table(f"Space of one of {count} materials", *columns)
    numbers = space.files, space.directories, space.bytes / 1e3, space.disk_bytes / 1e3
    of_one.add(*(number / count for number in numbers))
    return times


def _growth(run: Run, counts: Sequence[int], tables: Sequence[dict[str, float]]) -> None:
    """Add the exponents of growth from each number of materials to the next."""
    pairs = list(itertools.pairwise(range(len(counts))))
    if not pairs:
        return
    headings = [Column(name=f"{counts[a]} to {counts[b]} materials", digits=2) for a, b in pairs]
    table = run.table("Exponent of the growth of processor time", Column(name="task", width=28), *headings)
    for name, _ in TASKS:
        ratios = [(tables[b][name] / tables[a][name], counts[b] / counts[a]) for a, b in pairs]
        table.add(name, *(max(0.0, math.log(of_time) / math.log(of_count)) for of_time, of_count in ratios))


def _dask(run: Run, folder: Path, count: int) -> None:
    """Build the same materials on threads and on two dask workers, and compare every chunk."""
    table = run.table(
        f"{count} materials on 2 threads and on 2 dask workers",
        *(Column(name="workers", width=28), Column(name="wall", unit="s"), Column(name="processor", unit="s")),
        Column(name="materials", unit="1/s"),
    )
    for name, task in (("2 threads", on_threads), ("2 dask workers", on_dask)):
        cost = run_alone(task, folder / task.__name__, count)
        table.add(name, cost.wall, cost.cpu, count / cost.wall)
    one, other = (values_of(folder / task.__name__) for task in (on_threads, on_dask))
    assert one == other
    run.say(f"The {len(one)} chunks of both builds have the same digests.")


if __name__ == "__main__":
    sys.exit(main())
