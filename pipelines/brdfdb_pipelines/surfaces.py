"""The job of the maps of the errors of models: rays on made surfaces, a task for each, and the file of the maps."""

from __future__ import annotations

import io
import itertools
import json
import shutil
from collections import deque
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from importlib.metadata import version
from pathlib import Path
from typing import Any, get_args

import numpy as np

from brdfdb.errors import BrdfdbError, ParameterError, import_extra
from brdfdb.microgeometry import error_maps
from brdfdb.microgeometry.error_maps import SLOPES, FacetKind, SurfaceEstimate, Task, document, estimated, traced
from brdfdb.store.files import write_file
from brdfdb_pipelines import terminal
from brdfdb_pipelines.workers import Workers

_REQUEST = "request.json"  # the settings of a directory of estimates
_LOOK_S = 2.0  # interval [s] at which workers are counted again


class MapsError(BrdfdbError):
    """Maps of the errors of models that cannot be written."""


def run(out: Path, *, realisations: int, rays: int, at: Workers) -> dict[str, Any]:
    """Trace the surfaces of the maps, write model_errors.json, and return its content.

    Parameters
    ----------
    out : Path
        JSON file to write. Until it is complete the estimates are in the directory of this name with ``.partial``,
        where the same call resumes.
    realisations : int
        Maps drawn of each kind of surface, at least 2.
    rays : int
        Rays for each light in a realisation.
    at : Workers
        Where the tasks run. Each is one realisation of a surface.

    Raises
    ------
    ParameterError
        If there are fewer than two realisations, or the file is a directory.
    MapsError
        If the directory has estimates of other settings.
    """
    if realisations < 2:
        raise ParameterError("--realisations", f"{realisations} gives no standard error; allowed are 2 or more")
    if out.is_dir():
        raise ParameterError("--out", f"{out} is a directory; give the path of a file", str(out))
    import_extra("embreex.rtcore_scene")  # says which package is missing before anything is written
    partial = out.absolute().with_name(f"{out.name}.partial")
    _prepare(partial, {"brdfdb": version("brdfdb"), "rays": rays})
    kinds = list(itertools.product(get_args(FacetKind), SLOPES))
    tasks = [Task(*kind, number) for number in range(realisations) for kind in kinds]
    missing = deque(task for task in tasks if not _file(partial, task).exists())
    with terminal.progress() as bar:
        shown = bar.add_task("surfaces", total=len(tasks), completed=len(tasks) - len(missing))
        for _ in _completed(missing, str(partial), rays, at):
            bar.advance(shown)
    estimates = {
        (facets, slope): estimated([np.load(_file(partial, Task(facets, slope, n))) for n in range(realisations)])
        for facets, slope in kinds
    }
    made = document(estimates, _provenance(estimates, realisations, rays))
    write_file(out, _text(made).encode(), out.absolute().parent)
    shutil.rmtree(partial)
    return made


def _prepare(partial: Path, request: dict[str, Any]) -> None:
    """Make a directory of estimates; MapsError if it exists and its estimates have other settings."""
    partial.mkdir(parents=True, exist_ok=True)
    text = json.dumps(request).encode()
    file = partial / _REQUEST
    if file.exists() and file.read_bytes() != text:
        raise MapsError(f"{partial} has estimates of other settings, {file.read_text()}; repeat these, or remove it")
    write_file(file, text, partial)


def _file(partial: Path, task: Task) -> Path:
    return partial / f"{task.facets}-{task.slope}-{task.number:04d}.npy"


def _completed(tasks: deque[Task], partial: str, rays: int, at: Workers) -> Iterator[None]:
    """Submit tasks while workers are free; yield once for each that is complete."""
    running: set[Future[None]] = set()
    while tasks or running:
        while tasks and len(running) < 2 * max(1, at.slots()):
            running.add(at.executor.submit(trace, partial, tasks.popleft(), rays))
        done, running = wait(running, timeout=_LOOK_S, return_when=FIRST_COMPLETED)
        for future in done:
            future.result()
            yield


def trace(partial: str, task: Task, rays: int) -> None:
    """Trace a task, and write its f_r into a directory of estimates."""
    data = io.BytesIO()
    np.save(data, traced(task, rays))
    write_file(_file(Path(partial), task), data.getvalue(), Path(partial), sync=False)


def _provenance(
    estimates: dict[tuple[FacetKind, float], SurfaceEstimate], realisations: int, rays: int
) -> dict[str, Any]:
    """Return what the numbers are made of, with the largest standard error of rays of each kind of facet."""
    noise = {}
    for facets in get_args(FacetKind):
        of_slopes = [estimates[facets, slope].noise() for slope in SLOPES]
        noise[facets] = float(f"{max(of_slopes):.2g}")
    return {
        "brdfdb": version("brdfdb"),
        "embreex": version("embreex"),
        "surfaces": error_maps.SURFACES,
        "realisations": realisations,
        "seeds": f"0 to {realisations - 1}",
        "rays": rays,
        "viewers": error_maps.VIEWERS,
        "standard_error": noise,
    }


def _text(made: dict[str, Any]) -> str:
    """Return a document as JSON with a line for each row."""
    lines = json.dumps(made, separators=(",", ":"), ensure_ascii=False)
    return lines.replace('{"slope"', '\n{"slope"').replace('"},"rows"', '"},\n"rows"') + "\n"
