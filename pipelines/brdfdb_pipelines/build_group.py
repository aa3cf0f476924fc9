"""Tasks of a build for groups of tables: for a small table, tasks and syncs of its own take longer than its values."""

from __future__ import annotations

import pickle
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Literal, NamedTuple

from brdfdb.errors import BusyError, StoreError
from brdfdb.store.files import syncing
from brdfdb.store.lock import Lock, writing
from brdfdb.store.paths import material_path
from brdfdb.store.publication import Staged, publish_staged
from brdfdb.store.records import point_to
from brdfdb.store.staging import discard, prepare, write_block, write_frame
from brdfdb_pipelines.build_survey import Survey, head_of, staged_blocks, survey
from brdfdb_pipelines.recipe_file import Job

GROUP_S = 1.0  # time that the task of a group is to take [s]
_MOST = 32  # tables of a group: each has an open lock


class GroupResult(NamedTuple):
    """The result of each member of a group, or its error; and the time of a member [s]."""

    results: list[Any]
    seconds: float


class GroupTable(NamedTuple):
    """The result for a table of a group: its survey, revision and size [byte], and the blocks that existed already.

    A table is "busy" while another build has its lock.
    """

    state: Literal["published", "adopted", "current", "busy"]
    survey: Survey
    revision: str = ""
    bytes: int = 0
    kept: tuple[bool, ...] = ()


def group_size(seconds: float, remaining: int, slots: int, *, apart: bool) -> int:
    """Return how many tables the next group has, if a table takes some seconds, so that workers end at the same time.

    Locks are open files, of which a process may have a thousand: workers that are not `apart` may be its threads.
    """
    most = _MOST if apart else max(1, min(_MOST, 512 // max(1, slots)))
    return max(1, min(most, int(GROUP_S / max(seconds, 1e-6)), remaining // max(1, slots)))


def survey_group(root: str, jobs: Sequence[Job]) -> GroupResult:
    """Return the surveys of jobs; blocks that plans have staged are synced together."""
    start = time.perf_counter()
    results: list[Survey | Exception] = []
    with syncing(Path(root)) as sync:
        for job in jobs:
            with _caught(results):
                results.append(survey(root, job, sync=False))
        paths = [
            path
            for job, result in zip(jobs, results, strict=True)
            if isinstance(result, Survey) and result.tabulated
            for path in staged_blocks(Path(root), job)
        ]
        if paths:
            with writing(Path(root), jobs[0].name):
                sync(paths)
    return GroupResult(results, (time.perf_counter() - start) / len(jobs))


def build_group(root: str, members: Sequence[tuple[Job, Survey]]) -> GroupResult:
    """Tabulate and measure small tables one after the other, and publish them together, behind their locks."""
    start = time.perf_counter()
    store = Path(root)
    results: list[Any] = []
    staged: dict[int, Staged] = {}
    with syncing(store) as sync, ExitStack() as locks:
        for number, (job, known) in enumerate(members):
            try:
                locks.enter_context(Lock(store, job.name, wait=False))
            except BusyError:
                results.append(GroupTable("busy", known))
                continue
            with _caught(results):
                now = resumed(store, job, known)
                status = now.standing
                if status.state != "missing":
                    state: Any = "adopted" if status.state == "adoptable" else "current"
                    results.append(GroupTable(state, now, status.revision, now.stored))
                    continue
                directory = prepare(store, job.name, job.request, now.layout)
                where = str(directory), now.layout
                blocks = [write_block(*where, block, sync=False) for block in range(len(now.block_values))]
                files = {block["name"]: block["entry"] for block in blocks} | write_frame(*where, sync=False)
                results.append(GroupTable("published", now, kept=tuple(block["kept"] for block in blocks)))
                staged[number] = Staged(job.name, directory, files)
        if staged:
            made = publish_staged(store, list(staged.values()), sync)
            for number, (revision, size) in zip(staged, made, strict=True):
                results[number] = results[number]._replace(revision=revision, bytes=size)
    return GroupResult(results, (time.perf_counter() - start) / len(members))


def resumed(root: Path, job: Job, known: Survey) -> Survey:
    """Return the survey of a job whose lock the caller holds, made again if another build has published a revision.

    A revision that answers the job is made the current one.
    """
    if head_of(root, job.name) != known.head:
        known = survey(str(root), job)
    if known.standing.state == "adoptable":
        with writing(root, job.name):
            point_to(material_path(root, job.name), known.standing.revision)
        discard(root, job.name, job.request)  # the build that made this revision may have been killed
    return known


@contextmanager
def _caught(results: list[Any]) -> Iterator[None]:
    """Note an error as the result of a member, in a form that other processes can read, unless it ends every build."""
    try:
        yield
    except (StoreError, OSError, MemoryError):
        raise
    except Exception as error:
        try:
            results.append(pickle.loads(pickle.dumps(error)))
        except Exception:
            results.append(RuntimeError(f"{type(error).__name__}: {error}"))
