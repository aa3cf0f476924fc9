"""The survey of a build: the state of a job in the store, its missing layout, and the resources that it needs."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from brdfdb.errors import BusyError, ParameterError
from brdfdb.geometry import unit_vector
from brdfdb.store.lock import Lock
from brdfdb.store.paths import material_path, pointer_path, request_path
from brdfdb.store.revisions import Standing, standing
from brdfdb.store.staging import planned, prepare, write_block
from brdfdb.tables.layout import Layout, digest
from brdfdb_pipelines import build_resources
from brdfdb_pipelines.recipe_file import Job

_THETA_DEG = (0.0, 30.0, 60.0, 85.0)
_PHI_DEG = (0.0, 90.0, 180.0)


@dataclass(frozen=True)
class Survey:
    """The state of a job in the store, and the layout of a missing table; `tabulated` if its blocks are staged now."""

    standing: Standing
    head: str
    layout: str = ""
    shape: tuple[int, ...] = ()
    wavelengths: int = 0  # 0: the table is grey
    block_values: tuple[int, ...] = ()
    task_bytes: int = 0  # memory of one task
    disk_bytes: int = 0  # disk space still to be written, at most
    tabulated: bool = False

    @property
    def size(self) -> int:
        """Number of values to compute."""
        return sum(self.block_values)


def survey(root: str, job: Job) -> Survey:
    """Return the survey of a job: a task for a worker, because it plans the layout of a missing table.

    The values that a plan has computed are staged as the blocks of the table, if the disk has room for them.
    """
    store, name, request = Path(root), job.material.name, job.request
    head = head_of(store, name)
    status = standing(store, name, request)
    if status.state != "missing":
        return Survey(status, head)
    text, tabulated = planned(store, name, request), False
    if text is None:
        check_values(job)
        layout, values = job.planned()
        text = json.dumps(layout.document())
        try:
            with Lock(store, name, wait=False):
                staging = prepare(store, name, request, text)
                if values is not None and build_resources.table_bytes(layout) <= build_resources.free_bytes(store):
                    for number, rows in enumerate(layout.blocks):
                        write_block(str(staging), text, number, values[rows])
                    tabulated = True
        except BusyError:
            pass  # another build has the lock and most likely builds this table
    layout = Layout.from_document(json.loads(text))
    rest = layout.size // layout.shape[0]
    block_values = tuple((rows.stop - rows.start) * rest for rows in layout.blocks)
    staged = build_resources.stored_bytes([request_path(store, name, digest(request)) / "table"])
    disk = 0 if tabulated else max(0, build_resources.table_bytes(layout) - staged)
    shape, wavelengths = tuple(layout.shape), 0 if layout.wavelength_nm is None else layout.wavelength_nm.size
    task_bytes = build_resources.task_bytes(layout)
    return Survey(status, head, text, shape, wavelengths, block_values, task_bytes, disk, tabulated)


def cost_of_plan(job: Job) -> int:
    """Return a number that grows with the time of a plan: that of its wavelengths."""
    return 1 if job.wavelength_nm is None else job.wavelength_nm.size


def cost_of_table(job: Job, survey: Survey) -> float:
    """Return a number that grows with the time of a table: its size, or infinity if it is measured on an integral."""
    return survey.size if job.planned_on is None else math.inf


def check_values(job: Job) -> None:
    """Raise ParameterError if the model gives values at a few directions that no BRDF has: nan, infinite, negative."""
    theta, phi = np.radians(_THETA_DEG), np.radians(_PHI_DEG)
    theta_i, theta_r, phi_r = (axis.ravel() for axis in np.meshgrid(theta, theta, phi))
    wi, wr = unit_vector(theta_i, np.zeros_like(phi_r)), unit_vector(theta_r, phi_r)
    wavelength_nm = job.wavelength_nm
    f_r = job.material.lookup_vectors(wi, wr, None if wavelength_nm is None else wavelength_nm[:: wavelength_nm.size])
    values = np.reshape(f_r, (len(wi), -1))[:, 0]
    wrong = ~(np.isfinite(values) & (values >= 0.0))
    if wrong.any():
        at = int(np.argmax(wrong))
        where = ", ".join(
            f"{name} {np.degrees(angle[at]):.0f}"
            for name, angle in (("theta_i", theta_i), ("theta_r", theta_r), ("phi_r", phi_r))
        )
        given = ", ".join(f"{name} = {value}" for name, value in job.material.file_parameters().items())
        raise ParameterError(
            job.material.name,
            f"its model {job.material.model} with {given} gives {values[at]:.3g} /sr at {where} degrees; f_r must be "
            "finite and not negative",
            float(values[at]),
        )


def head_of(root: Path, name: str) -> str:
    """Return the text of the pointer of a material; empty where it cannot be read."""
    try:
        return pointer_path(material_path(root, name)).read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
