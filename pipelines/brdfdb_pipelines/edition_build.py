"""Builds of an edition: workers tabulate shards of a recipe and write them to the place, and share nothing else."""

from __future__ import annotations

import io
import itertools
import json
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, wait
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypedDict

from brdfdb.errors import StoreError, import_extra
from brdfdb.store.edition.catalogue import encoded_rows, merged, rows_of
from brdfdb.store.edition.groups import grouped
from brdfdb.store.edition.objects import MissingObjectError, Objects, checked, objects_at
from brdfdb.store.edition.publishing import (
    FEW_NAMES,
    PublishedEdition,
    destination_at,
    finish_edition,
    replaced,
    write_group,
)
from brdfdb.store.edition.reader import Edition
from brdfdb.store.edition.records import FORMAT_VERSION, GroupEntry, RevisionFiles, family_key, records_key, sha256
from brdfdb.store.family import Sweep
from brdfdb.store.family_records import measure
from brdfdb.store.files import sealed, unsealed
from brdfdb.store.paths import EDITION
from brdfdb.store.records import summary_of
from brdfdb.tables import tabulation
from brdfdb.tables.sweeps import MemberPlan, MemberTable, plans_of_members, stated_members
from brdfdb_pipelines import workers
from brdfdb_pipelines.build_progress import Event
from brdfdb_pipelines.build_survey import check_values
from brdfdb_pipelines.recipe_file import Job, MemberPoint, Members, Recipe
from brdfdb_pipelines.recipe_grids import RecipeError
from brdfdb_pipelines.workers import Workers, WorkersError

MOST_MEMBERS = 1000  # of a shard
_FEWEST_MEMBERS = 100  # of a shard, if the sweep has as many
_SHARDS = 8  # of a sweep that is too small for shards of MOST_MEMBERS, so that several workers share it
_REVISION = "r000001"  # of every table: an edition has one revision of each
_LOOK_S = 2.0  # interval [s] at which the number of workers is asked for again


class Part(TypedDict):
    """A shard that is done: its groups; the rows of its catalogue lie beside it."""

    version: int
    created: str
    groups: list[GroupEntry]


class Shard(NamedTuple):
    """A part of a build, as text: what the requests of its tables follow from, and the sha256 of it, its name."""

    requests: str
    digest: str
    tables: int

    @classmethod
    def of(cls, order: Job | Members, points: Sequence[MemberPoint] = ()) -> Shard:
        """Return the shard of a table, or of some members of a family."""
        document: dict[str, Any] = {"version": FORMAT_VERSION}
        if isinstance(order, Job):
            document["bases"] = [order.request]
        else:
            document["bases"] = [base.request for base in order.bases]
            document["family"] = {"name": order.name, "title": order.title, "width": order.width}
            document |= {"swept": [*order.axes], "points": points}
        text = json.dumps(document)
        return cls(text, sha256(text.encode()), len(points) or 1)

    def jobs(self) -> list[Job]:
        """Return the jobs; StoreError if another version of this program wrote the text."""
        document = json.loads(self.requests)
        bases = [Job.from_request(request) for request in document["bases"]]
        members = None
        if "family" in document:
            members = Members(**document["family"], axes={x: [] for x in document["swept"]}, bases=bases, numbers=())
        points = [(number, tuple(values)) for number, values in document.get("points", ())]
        if Shard.of(members or bases[0], points) != self:
            raise StoreError("a shard was made by another version of this program; install the same on all machines")
        return [*members.jobs(points)] if members else bases


def shards_of(order: Job | Members) -> Iterator[Shard]:
    """Yield the shards of a table, which is alone, or of members of a family, in the order of their names."""
    if isinstance(order, Job):
        yield Shard.of(order)
        return
    most = min(max(-(-len(order.numbers) // _SHARDS), _FEWEST_MEMBERS), MOST_MEMBERS)
    points = order.points()
    while some := [*itertools.islice(points, most)]:
        yield Shard.of(order, some)


def build_edition(
    recipe: Recipe,
    destination: str | Path,
    at: Workers | Executor,
    report: Callable[[Event], None] = lambda _: None,
    *,
    rewrite: bool = False,
    storage_options: Mapping[str, Any] | None = None,
) -> PublishedEdition:
    """Build the tables of a recipe as an edition, which has these tables alone.

    Each shard of a thousand members of a sweep is one task, a short text: memory grows with the number of members only
    by their rows in the catalogue and by the records of families. A task plans, tabulates and measures, and writes its
    tables to the destination; last it writes ``parts/SHA256.json``, named by its requests. A shard whose part exists is
    done, so that a build that was killed goes on, and tasks that run twice do no harm. Last come the catalogue, made of
    the parts, and the root. Families are measured by tables of the edition; then the root is written with them.

    Parameters
    ----------
    recipe : Recipe
        Materials with models; measured and simulated ones need a store.
    destination : path or address
        A directory, or ``s3://bucket/prefix``, ``gs://``, ``az://``.
    at : Workers or Executor
        Threads, processes or machines; they see nothing in common but the destination.
    report : callable
        Takes every event.
    rewrite : bool
        If True, also compute and write what the destination has already: objects may be lost or damaged.
    storage_options : mapping, optional
        Options of obstore, which workers get, too.

    Raises
    ------
    RecipeError, ParameterError
        If the recipe has tables without a model, or the destination is a store, lies in one or is only read.
    StoreError
        If the destination cannot be written, or another edition was published there meanwhile.
    """
    import_extra("pyarrow")  # before anything is written
    for name in [job.name for job in recipe.measured_jobs()] + [job.name for job in recipe.simulated_jobs()]:
        raise RecipeError("materials", f"{name} has no model; build it in a store, and publish the store")
    objects = destination_at(destination, storage_options)
    before = objects.versioned(EDITION)
    orders = sorted(map(_sharing_plans, recipe.orders()), key=lambda one: one.name)
    tables = sum(len(one.numbers) if isinstance(one, Members) else 1 for one in orders)
    work = _Work(objects, storage_options or {}, at if isinstance(at, Workers) else Workers(at, lambda: 1), report)
    digests: dict[str, list[str]] = {one.name: [] for one in orders}

    def missing() -> Iterator[Shard]:
        for one in orders:
            for shard in shards_of(one):
                digests[one.name].append(shard.digest)
                if not rewrite and _is_done(objects, shard.digest):
                    report({"event": "shard", "tables": shard.tables, "kept": True})
                else:
                    yield shard

    report({"event": "shards", "tables": tables, "edition": objects.name})
    for shard in work.done(build_shard, missing(), rewrite):
        report({"event": "shard", "tables": shard.tables, "kept": False})
    parts = [*itertools.chain(*digests.values())]
    entries = [*_groups(objects, parts, named=tables <= FEW_NAMES)]
    catalogue = merged(objects.get(_rows(digest)) for digest in parts)
    complete = [one for one in orders if isinstance(one, Members) and len(one.numbers) == one.size]
    sweeps = {family.name: _request(family, digests[family.name]) for family in complete}
    families = {} if rewrite else _recorded(objects, sweeps)
    edition = finish_edition(objects, before, entries, catalogue, families, {})
    if unmeasured := [name for name in sweeps if name not in families]:
        for name in unmeasured:
            report({"event": "family", "family": name, "state": "measuring"})
        list(work.done(measure_family, (sweeps[name] for name in unmeasured)))
        families = _recorded(objects, sweeps)
        edition = finish_edition(objects, objects.versioned(EDITION), entries, catalogue, families, {})
    for name in families:
        event = {"event": "family", "family": name, "state": "published", "members": sweeps[name].tables}
        report({**event, "error_p99": _measured(objects, sweeps[name])["error_p99"]})
    report({"event": "done", "tables": edition.materials, "bytes": edition.bytes})
    return edition._replace(replaced=replaced(objects, before, edition))


def _sharing_plans(order: Job | Members) -> Job | Members:
    if isinstance(order, Job):
        return order
    return order._replace(bases=[replace(base, shared_plan=base.tolerance is not None) for base in order.bases])


class _Work(NamedTuple):
    """Tasks on workers: each gets plain text, and writes to the destination itself."""

    objects: Objects
    storage_options: Mapping[str, Any]
    at: Workers
    report: Callable[[Event], None]

    def done(self, task: Callable[..., None], shards: Iterable[Shard], rewrite: bool = False) -> Iterator[Shard]:
        """Run a task for each shard, few at a time, and yield the shard when it is done."""
        created = datetime.now(UTC).isoformat(timespec="seconds")  # the same wherever a task runs twice
        running: dict[Future[None], Shard] = {}
        waiting = iter(shards)
        place = self.objects.name
        run = partial(task, place, json.dumps(dict(self.storage_options)))
        token = None
        if self.at.apart:
            if Path(place).is_absolute():
                token = Path(place, f".build-{uuid.uuid4().hex[:12]}")
                self.objects.put({token.name: b""})
            run = partial(workers.at_place, token, run)
        idle = False  # the event that there are no workers was sent
        try:
            while True:
                room = 2 * max(1, self.at.slots()) - len(running)  # each worker has a next task when it finishes
                for shard in itertools.islice(waiting, max(room, 0)):
                    running[self.at.executor.submit(run, *shard, created, rewrite)] = shard
                if not running:
                    return
                finished, _ = wait(running, timeout=_LOOK_S, return_when=FIRST_COMPLETED)
                if (now := not finished and self.at.slots() == 0) and not idle:
                    self.report({"event": "idle"})
                idle = now
                for future in finished:
                    _raise_error(future)
                    yield running.pop(future)
        except KeyboardInterrupt:
            self.at.stop()
            raise
        finally:
            for future in running:
                future.cancel()
            wait(running)
            if token:
                token.unlink(missing_ok=True)


def _raise_error(future: Future[None]) -> None:
    try:
        future.result()
    except (Exception, CancelledError) as error:
        if workers.lost(error):
            raise WorkersError("the workers are gone, killed or out of memory; build again to resume") from error
        raise


def _groups(objects: Objects, parts: Iterable[str], *, named: bool) -> Iterator[GroupEntry]:
    """Yield the groups of parts, with the names of their tables if the index of the edition will have them."""
    for digest in parts:
        for entry in read_part(objects, digest)["groups"]:
            if not named:
                entry.pop("names")
            yield entry


def _part(digest: str) -> str:
    return f"parts/{digest}.json"


def _rows(digest: str) -> str:
    return f"parts/{digest}.parquet"


def read_part(objects: Objects, digest: str) -> Part:
    """Return a part of a build; StoreError if it is missing or damaged."""
    part: Any = unsealed(objects.get(_part(digest)), objects.name, _part(digest))
    return {"version": part["version"], "created": part.get("created", ""), "groups": part["groups"]}


def _is_done(objects: Objects, digest: str) -> bool:
    """Return True if there are the part of a shard, the rows of its catalogue and its groups."""
    with suppress(StoreError):
        groups = read_part(objects, digest)["groups"]
        return all(map(objects.has, [_rows(digest), *(records_key(entry["digest"]) for entry in groups)]))
    return False


def build_shard(
    destination: str,
    storage_options: str,
    requests: str,
    digest: str,
    tables: int,
    created: str,
    rewrite: bool = False,
) -> None:
    """Tabulate a shard and write it to the destination, its part last: the task that a build gives to its workers."""
    objects = objects_at(destination, json.loads(storage_options))
    with suppress(StoreError):  # what is written again has the digests that it had
        created = read_part(objects, digest)["created"] or created
    entries = []
    rows = []
    members = stated_members(_plans(Shard(requests, digest, tables).jobs()))
    for group in grouped(_files(member, created) for member in members):
        write_group(objects, group, rewrite=rewrite)
        entries.append(group.entry)
        rows += rows_of(group)
    rows.sort(key=lambda row: str(row["name"]))
    objects.put({_rows(digest): encoded_rows(rows)})
    objects.put({_part(digest): sealed(Part(version=FORMAT_VERSION, created=created, groups=entries))})


def _plans(jobs: Sequence[Job]) -> Iterator[MemberPlan]:
    """Yield the plans of jobs: members of a sweep that are built to a tolerance share them."""
    first = jobs[0]
    for job in jobs:
        check_values(job)
    if first.shared_plan and first.tolerance is not None and not first.polarised:
        materials = [job.material for job in jobs]
        plans = plans_of_members(materials, first.wavelength_nm, first.tolerance, first.hot_spot_tolerance)
        for job, (layout, values) in zip(jobs, plans, strict=True):
            yield MemberPlan(layout, values, job.request)
    else:
        for job in jobs:
            yield MemberPlan(*job.planned(), job.request)


def _files(member: MemberTable, created: str) -> RevisionFiles:
    """Return the files of a table, as a store has them."""
    from brdfdb.store.codec import chunk_bytes, chunk_name, frame_files

    layout, values, metadata = member
    frame = tabulation.frame(layout)
    files = frame_files(layout, frame._replace(attrs={**frame.attrs, **metadata.attributes()}))
    for number, rows in enumerate(layout.blocks):
        files[chunk_name(layout, number)] = chunk_bytes(values[rows], layout.block_rows)
    summary = summary_of(metadata, sum(map(len, files.values())), created)
    return RevisionFiles.of(layout.source.name, _REVISION, summary, files)


# Families


def _request(family: Members, parts: Sequence[str]) -> Shard:
    """Return the task of measuring a family whose members are in some parts."""
    line = {"name": family.name, "title": family.title, "model": family.bases[0].model, "axes": family.axes}
    text = json.dumps({**line, "parts": parts})
    return Shard(text, sha256(text.encode()), family.size)


def _measured(objects: Objects, request: Shard) -> dict[str, Any]:
    """Return what a task wrote about the family that it measured: the sha256 of its record, and its error."""
    return unsealed(objects.get(_part(request.digest)), objects.name, _part(request.digest))


def _recorded(objects: Objects, families: Mapping[str, Shard]) -> dict[str, bytes]:
    """Return the records of the families that were measured, by name."""
    records = {}
    for name, request in families.items():
        with suppress(MissingObjectError):
            digest = _measured(objects, request)["record"]
            records[name] = checked(objects, family_key(digest), digest)
    return records


def measure_family(destination: str, storage_options: str, family: str, digest: str, *_: Any) -> None:
    """Measure a family by the tables of the edition, and write its record: a task for a worker."""
    edition = Edition(destination, storage_options=json.loads(storage_options))
    parquet: Any = import_extra("pyarrow.parquet")
    line = json.loads(family)
    requests: dict[str, str] = {}  # sha256 by name
    for part in line.pop("parts"):
        rows = parquet.read_table(io.BytesIO(edition.objects.get(_rows(part))), columns=["name", "request_sha256"])
        requests |= zip(*(column.to_pylist() for column in rows.columns), strict=True)
    sweep = Sweep(**line, members=[*requests], request_sha256=[*requests.values()])
    record = measure(sweep, edition)
    content = json.dumps(record.model_dump(mode="json")).encode()
    edition.objects.put({family_key(sha256(content)): content})
    part = {"version": FORMAT_VERSION, "record": sha256(content), "error_p99": record.error.overall.p99}
    edition.objects.put({_part(digest): sealed(part)})
