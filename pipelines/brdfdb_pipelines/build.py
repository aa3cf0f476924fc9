"""The builder: it tabulates a recipe block by block on workers, and computes nothing that the store already has."""

from __future__ import annotations

import contextlib
import gc
import os
import threading
import time
import uuid
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from brdfdb._numba import is_cached
from brdfdb.errors import BusyError, ParameterError, StoreError
from brdfdb.materials import FunctionSource, Material
from brdfdb.models import MODELS
from brdfdb.store.estimates import begin_estimates, estimates_path
from brdfdb.store.family import FamilyRecord, Sweep
from brdfdb.store.family_records import recorded, write_family
from brdfdb.store.files import FileEntry, syncing
from brdfdb.store.lock import Lock, NoLocksError
from brdfdb.store.paths import material_path, pointer_path, staging_path
from brdfdb.store.publication import NewRevision, Staged, publish_staged
from brdfdb.store.records import make_store
from brdfdb.store.revisions import standing
from brdfdb.store.staging import Block, prepare, remove_begun, write_block, write_frame
from brdfdb.tables import _kernels
from brdfdb.tables.layout import Layout
from brdfdb.tables.planner import coarsest
from brdfdb.tables.table import Table, points
from brdfdb.tables.tabulation import block
from brdfdb_pipelines import workers
from brdfdb_pipelines.build_group import GROUP_S, GroupResult, build_group, group_size, resumed, survey_group
from brdfdb_pipelines.build_progress import Event, Tally
from brdfdb_pipelines.build_survey import (
    Survey,
    check_disk,
    check_memory,
    cost_of_plan,
    cost_of_table,
    memory_of_plan,
)
from brdfdb_pipelines.measured_job import MeasuredJob, MeasuredResult, build_measured
from brdfdb_pipelines.recipe_file import Job, Recipe
from brdfdb_pipelines.workers import Workers, WorkersError

if TYPE_CHECKING:  # rays and their statistics take a second to load
    from brdfdb_pipelines.simulated_job import SimulatedJob

_LOOK_S = 2.0  # interval [s] at which silent workers are checked
_PUBLISHED = 16  # large tables that are published at once: each waits for the disk several times
_POLL_S = 0.1  # interval [s] at which a lock of another build is tried again

_Item = TypeVar("_Item")


@dataclass(frozen=True)
class Built:
    """The result of one job.

    `state` is "published", "adopted" (an existing revision is current again) or "unchanged". `why` says in a phrase why
    the table is not unchanged. `shape` is empty unless the table was computed; `wavelengths` is 0 if it is grey.
    """

    job: Job | MeasuredJob | SimulatedJob
    state: str
    revision: str
    stored_bytes: int
    why: str = ""
    shape: tuple[int, ...] = ()
    wavelengths: int = 0


@dataclass(eq=False)
class _Table:
    """The progress of one table."""

    job: Job
    survey: Survey
    lock: Lock
    again_at: float = 0.0  # time of a next try [s], after another build had the lock
    staging: Path = Path()
    blocks: deque[int] = field(default_factory=deque)  # not submitted yet
    files: dict[str, FileEntry] = field(default_factory=dict)
    waiting_reported: bool = False  # the event that another build holds the lock was sent

    @property
    def name(self) -> str:
        return self.job.name


def build(
    recipe: Recipe,
    root: Path,
    at: Workers | Executor,
    report: Callable[[Event], None] = lambda _: None,
    *,
    memory: int | None = None,
) -> list[Built]:
    """Build the missing tables of a recipe and measure its families; return the results in the order of the recipe.

    The executor works in threads, processes or machines that see `root` under the same path. `report` takes every
    event; `memory` [byte] is that of all tasks together. Published tables and complete blocks stay after any error: the
    next build of the same recipe resumes from them. An error of one table is raised after the other tables are built.

    Raises
    ------
    RecipeError
        Before anything is written, if the recipe cannot be built.
    ParameterError
        If a single task exceeds `memory`, or the tables do not fit on the disk. A store made for them is removed.
    StoreError
        If the store cannot be written.
    """
    jobs = recipe.jobs()
    measured = recipe.measured_jobs()
    simulated = recipe.simulated_jobs()
    sweeps = recipe.sweeps(jobs)
    root = root.absolute()  # workers may be in another directory
    existed = root.exists()
    made = make_store(root)
    try:
        at = at if isinstance(at, Workers) else Workers(at, lambda: 1)
        return _Builder(jobs, measured, simulated, sweeps, root, at, report, memory).run()
    except (ParameterError, NoLocksError):
        if made:
            remove_begun(root)
            if existed:
                root.mkdir(exist_ok=True)
        raise


_Member = TypeVar("_Member", Job, _Table)


@dataclass(eq=False)
class _Builder:
    """The progress of a build."""

    jobs: list[Job]
    measured: list[MeasuredJob]
    simulated: list[SimulatedJob]
    sweeps: list[Sweep]
    root: Path
    at: Workers
    report: Callable[[Event], None]
    memory: int | None
    task_bytes: int = 1
    running: dict[Future[Any], Callable[[Future[Any]], None]] = field(default_factory=dict)
    publisher: ThreadPoolExecutor = field(default_factory=lambda: ThreadPoolExecutor(_PUBLISHED))
    publishing: set[Future[Any]] = field(default_factory=set)  # the running tasks of this process itself
    waiting: deque[_Table] = field(default_factory=deque)  # of several blocks, not begun
    small: deque[_Table] = field(default_factory=deque)  # of one block, not begun
    busy: deque[_Table] = field(default_factory=deque)  # of one block, which other builds are building
    group_s: float = GROUP_S  # time of a member of the group that ended last [s]
    token: str | None = None  # a locked file in the store, which workers on other machines must see
    open: list[_Table] = field(default_factory=list)
    ready: deque[_Table] = field(default_factory=deque)  # all blocks are there
    built: dict[str, Built] = field(default_factory=dict)
    error: Exception | None = None
    tally: Tally = field(default_factory=lambda: Tally(0))
    idle: bool = False  # the event that there are no workers was sent

    def run(self) -> list[Built]:
        """Survey, tabulate and publish; return the result of each job in the order of the recipe."""
        start = time.perf_counter()
        others: list[MeasuredJob | SimulatedJob] = [*self.measured, *self.simulated]
        names = [job.name for job in self.jobs] + [job.name for job in others]
        self.report({"event": "start", "tables": len(names), "store": str(self.root)})
        presence = Lock(self.root, f".build-{uuid.uuid4().hex[:12]}", wait=False)
        with contextlib.ExitStack() as locked:
            if os.access(staging_path(self.root), os.W_OK):  # else nothing can be built, and maybe nothing is missing
                locked.enter_context(presence)
                self.token = str(presence.path) if self.at.apart else None
            self._run()
        if self.error is not None:
            raise self.error
        built = [self.built[name] for name in names]
        states = [b.state for b in built]
        self.report(
            {
                "event": "done",
                "tables": len(built),
                **{state: states.count(state) for state in ("published", "adopted", "unchanged")},
                "bytes": sum(b.stored_bytes for b in built),
                "seconds": round(time.perf_counter() - start, 3),
            }
        )
        return built

    def _run(self) -> None:
        try:
            self._survey()
            self._tabulate()
            self._build_measured()
            self._simulate()
            self._measure_families()
        except KeyboardInterrupt:
            self.at.stop()
            raise
        finally:  # cancel pending tasks, wait for running ones, and release the locks; staged blocks stay
            for future in self.running:
                future.cancel()
            wait(self.running)
            self.publisher.shutdown()
            for table in self.open:
                table.lock.__exit__(None, None, None)

    def _submit(self, then: Callable[[Future[Any]], None], task: Callable[..., Any], *arguments: Any) -> None:
        if self.token is not None:
            task, arguments = workers.at_store, (self.token, task, *arguments)
        self.running[self.at.executor.submit(task, *arguments)] = then

    @property
    def _room(self) -> bool:
        most = 2 * max(1, self.at.slots())  # each worker has a next task when it finishes
        if self.memory is not None:
            most = min(most, self.memory // self.task_bytes)
        return len(self.running) - len(self.publishing) < max(1, most) and len(self.publishing) < _PUBLISHED

    def _wait(self) -> None:
        done, _ = wait(self.running, timeout=_LOOK_S, return_when=FIRST_COMPLETED)
        if (idle := not done and self.at.slots() == 0) and not self.idle:
            self.report({"event": "idle"})
        self.idle = idle
        for future in done:
            self.publishing.discard(future)
            self.running.pop(future)(future)

    def _each(self, items: Iterable[_Item], begin: Callable[[_Item], None]) -> None:
        """Begin a task for each item as workers become free, and wait for all tasks."""
        pending = deque(items)
        while pending or self.running:
            while pending and self._room:
                begin(pending.popleft())
            if self.running:
                self._wait()

    # Survey

    def _survey(self) -> None:
        for job in self.jobs:
            if job.tolerance is not None:
                wavelengths = 1 if job.wavelength_nm is None else job.wavelength_nm.size
                self._claim(f"planning {job.name}", memory_of_plan(wavelengths, job.tolerance))

        pending = deque(sorted(self.jobs, key=cost_of_plan, reverse=True))
        missing: list[_Table] = []
        while pending or self.running:
            while pending and self._room:
                jobs = [pending.popleft() for _ in range(self._group_size(len(pending)))]
                self._submit(partial(self._surveyed, jobs, missing), survey_group, str(self.root), jobs)
            self._wait()
        self.group_s = GROUP_S
        missing.sort(key=lambda table: cost_of_table(table.job, table.survey), reverse=True)
        self.waiting = deque(table for table in missing if len(table.survey.block_values) > 1)
        self.small = deque(table for table in missing if len(table.survey.block_values) <= 1)
        self.task_bytes = 1
        for table in missing:
            self._claim(f"a block of {table.name}", table.survey.task_bytes)
        check_disk(sum(table.survey.disk_bytes for table in missing), self.root)
        self.tally = Tally(sum(table.survey.size for table in missing))
        self.report({"event": "planned", "tables": len(missing), "values": self.tally.total})

    def _claim(self, what: str, need: int) -> None:
        """Raise the memory [byte] per task to that of this one; ParameterError if it alone exceeds what is allowed."""
        self.task_bytes = max(self.task_bytes, need)
        check_memory(what, need, self.memory)

    def _surveyed(self, jobs: list[Job], missing: list[_Table], future: Future[GroupResult]) -> None:
        for job, result in self._results(jobs, future):
            status = result.standing
            self.report({"event": "surveyed", "material": job.name, "state": status.state, "why": status.why})
            if status.state == "current":
                self._found(job, result)
            else:
                missing.append(_Table(job, result, Lock(self.root, job.name, wait=False)))

    def _found(self, job: Job, survey: Survey) -> None:
        """Note a table that the store has: its revision is the current one, or was made so."""
        status = survey.standing
        state = "adopted" if status.state == "adoptable" else "unchanged"
        why = {"why": status.why} if state == "adopted" else {}
        self.built[job.name] = Built(job, state, status.revision, survey.stored, status.why)
        self.report({"event": state, "material": job.name, "revision": status.revision, **why})

    def _published(self, table: _Table, revision: str, stored: int) -> None:
        survey = table.survey
        why = survey.standing.why
        self.built[table.name] = Built(table.job, "published", revision, stored, why, survey.shape, survey.wavelengths)
        self.report({"event": "published", "material": table.name, "revision": revision, "bytes": stored, "why": why})

    # Tables

    def _tabulate(self) -> None:
        while self.waiting or self.small or self.busy or self.open or self.running:
            while self._room and self._next():
                pass
            if self.running:
                self._wait()
            elif self.waiting or self.busy:
                time.sleep(_POLL_S)  # all remaining tables are being built by others

    def _next(self) -> bool:
        """Submit a task; return False if there is none to submit now."""
        if self.ready:
            table = self.ready.popleft()
            self._submit(
                lambda future: self._framed(table, future), write_frame, str(table.staging), table.survey.layout
            )
            return True
        for table in self.open:
            if table.blocks:
                self._submit_block(table)
                return True
        for _ in range(len(self.waiting)):
            table = self.waiting.popleft()
            if self._begin(table):
                self._submit_block(table)
                return True
        while self.busy and self.busy[0].again_at <= time.monotonic():
            self.small.append(self.busy.popleft())
        if not self.small:
            return False
        group = [self.small.popleft() for _ in range(self._group_size(len(self.small)))]
        members = [(table.job, table.survey) for table in group]
        self._submit(partial(self._grouped, group), build_group, str(self.root), members)
        return True

    def _group_size(self, remaining: int) -> int:
        return group_size(self.group_s, remaining, self.at.slots(), apart=self.at.apart)

    def _grouped(self, group: list[_Table], future: Future[GroupResult]) -> None:
        for table, result in self._results(group, future):
            table.survey = result.survey
            if result.state == "busy":
                self._waits(table)
                table.again_at = time.monotonic() + _POLL_S
                self.busy.append(table)
            elif result.state == "published":
                for number, kept in enumerate(result.kept):
                    self._block(table, number, kept=kept)
                self._published(table, result.revision, result.bytes)
            else:
                self._found(table.job, result.survey)

    def _submit_block(self, table: _Table) -> None:
        number = table.blocks.popleft()

        def then(future: Future[Block]) -> None:
            self._written(table, number, future)

        self._submit(then, write_block, str(table.staging), table.survey.layout, number)

    def _begin(self, table: _Table) -> bool:
        """Lock a material and survey it again; return True if there are blocks to compute."""
        job = table.job
        try:
            table.lock.__enter__()
        except BusyError:
            self._waits(table)
            self.waiting.append(table)
            return False
        self.open.append(table)
        table.survey = resumed(self.root, job, table.survey)
        if table.survey.standing.state == "missing":
            table.staging = prepare(self.root, table.name, job.request, table.survey.layout)
            table.blocks.extend(range(len(table.survey.block_values)))
            return True
        self._found(job, table.survey)
        self._close(table)
        return False

    def _waits(self, table: _Table) -> None:
        if not table.waiting_reported:
            self.report({"event": "waiting", "material": table.name})
            table.waiting_reported = True

    def _close(self, table: _Table) -> None:
        if table in self.open:
            self.open.remove(table)
            table.lock.__exit__(None, None, None)

    def _written(self, table: _Table, number: int, future: Future[Block]) -> None:
        block = self._result(table.name, future)
        if block is None or table not in self.open:  # this block failed, or another one of the table
            self._close(table)
            return
        table.files[block["name"]] = block["entry"]
        self._block(table, number, kept=block["kept"])
        if len(table.files) == len(table.survey.block_values):
            self.ready.append(table)

    def _block(self, table: _Table, number: int, *, kept: bool) -> None:
        kept = kept and not table.survey.tabulated  # from an earlier build
        values = table.survey.block_values
        event = {"event": "block", "material": table.name, "block": number, "blocks": len(values), "kept": kept}
        self.report({**event, **self.tally.add(values[number], kept=kept)})

    def _framed(self, table: _Table, future: Future[dict[str, FileEntry]]) -> None:
        if (files := self._result(table.name, future)) is None:
            self._close(table)
            return

        def publish() -> NewRevision:
            with syncing(self.root) as sync:
                return publish_staged(self.root, [Staged(table.name, table.staging, {**table.files, **files})], sync)[0]

        def published(future: Future[NewRevision]) -> None:
            if (made := self._result(table.name, future)) is not None:
                self._published(table, *made)
            self._close(table)

        publication = self.publisher.submit(publish)
        self.publishing.add(publication)
        self.running[publication] = published

    # Measured tables, each by one task

    def _build_measured(self) -> None:
        def begin(job: MeasuredJob) -> None:
            self.report({"event": "measuring", "material": job.name, "tables": len(self.measured)})
            self._submit(partial(self._of_data, job), build_measured, str(self.root), job)

        self._each(self.measured, begin)

    def _of_data(self, job: MeasuredJob | SimulatedJob, future: Future[MeasuredResult]) -> None:
        """Note the result of a job without a model."""
        if (result := self._result(job.name, future)) is not None:
            self.built[job.name] = Built(job, *result)
            event = {"event": result.state, "material": job.name, "revision": result.revision}
            more = {} if result.state == "unchanged" else {"bytes": result.bytes, "why": result.why}
            self.report({**event, **more})

    # Simulated tables: estimates by tasks, in rounds, and the table by one task

    def _simulate(self) -> None:
        if not self.simulated:
            return
        from brdfdb_pipelines import simulated_job as rays

        for job in self.simulated:
            self._claim(f"an estimate of {job.name}", job.task_bytes)
            self.report({"event": "simulating", "material": job.name, "tables": len(self.simulated)})
            lock = Lock(self.root, job.name, wait=False)
            try:
                lock.__enter__()
            except BusyError:
                self.report({"event": "waiting", "material": job.name})
                lock = Lock(self.root, job.name)
                lock.__enter__()
            try:
                folder = estimates_path(self.root, job.name, job.estimates_request)
                missing = standing(self.root, job.name, job.request).state == "missing"
                count = self._estimates(job, folder) if missing else 0
            finally:
                lock.__exit__(None, None, None)  # the task that publishes takes it
            if count is not None:
                self.report({"event": "interpolating", "material": job.name})
                self._submit(partial(self._of_data, job), rays.build_simulated, str(self.root), str(folder), job, count)
        self._each((), lambda _: None)

    def _estimates(self, job: SimulatedJob, folder: Path) -> int | None:
        """Add estimates until they are enough; return their number, or None if a task failed."""
        from brdfdb_pipelines import simulated_job as rays

        def compute(numbers: range) -> bool:
            failed: list[int] = []

            def begin(number: int) -> None:
                def then(future: Future[bool]) -> None:
                    if (kept := self._result(job.name, future)) is None:
                        failed.append(number)
                    else:
                        event = {"event": "estimate", "material": job.name, "number": number}
                        self.report({**event, "of": numbers.stop, "kept": kept})

                if not failed:
                    self._submit(then, rays.estimate_simulated, str(folder), job, number)

            self._each(numbers, begin)
            return not failed

        begin_estimates(folder, job.name, job.estimates_request)
        return rays.estimates_needed(job, folder, compute, self.report)

    # Families

    def _measure_families(self) -> None:
        """Measure and record the families whose members are all current, unless their record is."""

        def begin(sweep: Sweep) -> None:
            def then(future: Future[FamilyRecord]) -> None:
                if (measured := self._result(sweep.name, future)) is not None:
                    self._family(measured, "published")

            if (record := recorded(self.root, sweep)) is not None:
                self._family(record, "unchanged")
                return
            self.report({"event": "family", "family": sweep.name, "state": "measuring"})
            self._submit(then, write_family, str(self.root), sweep)

        self._each((sweep for sweep in self.sweeps if all(name in self.built for name in sweep.members)), begin)

    def _family(self, record: FamilyRecord, state: str) -> None:
        self.report(
            {
                "event": "family",
                "family": record.name,
                "state": state,
                "members": len(record.members),
                "error_p99": record.error.overall.p99,
            }
        )

    def _result(self, name: str, future: Future[Any]) -> Any:
        """Return the result of a task; None if it failed, which fails its own table only."""
        error: BaseException | None
        try:
            error = future.exception()
        except CancelledError as cancelled:  # the cluster lost the task
            error = cancelled
        if error is None:
            return future.result()
        if isinstance(error, StoreError | OSError | MemoryError) or not isinstance(error, Exception):
            raise error
        if workers.lost(error):
            raise WorkersError("the workers are gone, killed or out of memory; build again to resume") from error
        self._failed(name, error)
        return None

    def _results(self, items: Sequence[_Member], future: Future[GroupResult]) -> Iterator[tuple[_Member, Any]]:
        """Yield the members of a group with their results, without those that failed."""
        group: GroupResult | None = self._result(items[0].name, future)
        if group is None:
            for item in items[1:]:
                self._failed(item.name, future.exception())
            return
        self.group_s = group.seconds
        for item, result in zip(items, group.results, strict=True):
            if isinstance(result, Exception):
                self._failed(item.name, result)
            else:
                yield item, result

    def _failed(self, name: str, error: BaseException | None) -> None:
        assert isinstance(error, Exception)
        self.error = self.error or error
        self.report({"event": "failed", "material": name, "error": str(error)})


_UP = np.array([[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.6, 0.8]])  # three directions: any will do
_AZIMUTHS = np.linspace(0.0, np.pi, 16)  # a row for which He-Torrance sums its table of the series


def compile_kernels(recipe: Recipe, root: Path, jobs: int, report: Callable[[Event], None]) -> None:
    """Compile the kernels of a build into numba's cache, where tables are missing and nothing was compiled yet.

    A build compiles what is missing anyway, one kernel after the other; this takes less time and reports it. This
    process compiles, too: it has imported already what each process imports.
    """
    missing = [job for job in recipe.jobs() if not pointer_path(material_path(root, job.material.name)).exists()]
    if jobs == 1 or not missing or is_cached(_kernels.by_vectors):
        return
    models: dict[str, Callable[[], None]] = {}
    for job in missing:
        models.setdefault(job.material.model, partial(_compile_model, job.material, job.wavelength_nm))
    # the longest first: lookups, and kernels of spectral models
    by_length = sorted(models, key=lambda name: not MODELS[name].spectral)
    tasks = deque([_compile_tables, *(models[name] for name in by_length)])
    others = min(jobs, len(tasks)) - 1
    lock = threading.Lock()
    report({"event": "compiling", "kernels": len(tasks)})

    def work(run: Callable[[Callable[[], None]], None]) -> None:
        with contextlib.suppress(IndexError):  # no task is left
            while True:
                task = tasks.popleft()
                with contextlib.suppress(Exception):  # the build meets the error again, and reports it
                    run(task)
                with lock:
                    report({"event": "compiled"})

    with ThreadPoolExecutor(others) as threads, workers.processes(others) as pool:
        helpers = [
            threads.submit(work, lambda task: pool.executor.submit(_compiled, task).result()) for _ in range(others)
        ]
        try:
            work(_compiled)
            wait(helpers)
        finally:
            tasks.clear()  # no other task begins after Ctrl-C


def _compiled(task: Callable[[], None]) -> None:
    """Run a task without the collector of garbage, which takes a tenth of the time: what numba makes stays in use."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        task()
    finally:
        if enabled:
            gc.enable()


def _compile_tables() -> None:
    """Compile the kernels of lookups."""
    white = FunctionSource(brdf=lambda wi, *_: np.full(len(wi), 0.3), name="white", title="White", provenance="none")
    layout = Layout(white, coarsest(white), None)
    Table.of(layout, np.zeros(layout.shape, np.float32)).lookup_vectors(_UP, _UP[::-1])
    points(layout.grid, _UP, _UP[::-1])


def _compile_model(material: Material, wavelength_nm: NDArray[np.float64] | None) -> None:
    """Compile the kernels of the model of a material."""
    at = None if wavelength_nm is None else wavelength_nm[:2]
    material.lookup_vectors(_UP, _UP[::-1], at)
    block(Layout(material, coarsest(material), at), slice(0, 1))
    material.lookup(0.5, 0.0, 0.5, _AZIMUTHS, at)
    material.specular_reflectance(0.5, at)
