"""The survey of a build: what the store has for a job, the layout that is missing, and what it takes to make it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from brdfdb.errors import BusyError
from brdfdb.store.lock import Lock
from brdfdb.store.paths import material_path, pointer_path, request_path
from brdfdb.store.revisions import Standing, standing
from brdfdb.store.staging import planned, prepare
from brdfdb.tables.layout import Layout, digest
from brdfdb_pipelines import build_resources
from brdfdb_pipelines.recipe_file import Job


@dataclass(frozen=True)
class Survey:
    """What a look at the store, and the planner, say about a job: how it stands, and the layout that is missing."""

    standing: Standing
    head: str
    layout: str = ""
    shape: tuple[int, ...] = ()
    block_values: tuple[int, ...] = ()
    task_bytes: int = 0  # memory that a task takes
    disk_bytes: int = 0  # that are still to be written, at most

    @property
    def size(self) -> int:
        """Values to compute."""
        return sum(self.block_values)


def survey(root: str, job: Job) -> Survey:
    """Look at what the store has for a job, and lay out what is missing: a task for a worker."""
    store, name, request = Path(root), job.material.name, job.request
    head = head_of(store, name)
    found = standing(store, name, request)
    if found.state != "missing":
        return Survey(found, head)
    text = planned(store, name, request)
    if text is None:
        text = json.dumps(job.layout().document())
        try:
            with Lock(store, name, wait=False):
                prepare(store, name, request, text)
        except BusyError:
            pass  # another build is at it, and most likely does all there is to do
    layout = Layout.from_document(json.loads(text))
    rest = layout.size // layout.shape[0]
    values = tuple((rows.stop - rows.start) * rest for rows in layout.blocks)
    staged = build_resources.stored_bytes([request_path(store, name, digest(request)) / "table"])
    disk = max(0, build_resources.table_bytes(layout) - staged)
    return Survey(found, head, text, tuple(layout.shape), values, build_resources.task_bytes(layout), disk)


def head_of(root: Path, name: str) -> str:
    """Return the text of the pointer of a material; empty where it cannot be read."""
    try:
        return pointer_path(material_path(root, name)).read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
