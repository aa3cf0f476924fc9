"""The survey of a build: the state of each job in the store, missing layouts, and the memory and disk space."""

from __future__ import annotations

import json
import math
import os
import shutil
from collections.abc import Sequence
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
from brdfdb_pipelines import terminal
from brdfdb_pipelines.measured_job import revision_bytes
from brdfdb_pipelines.recipe_file import Job

_THETA_DEG = (0.0, 30.0, 60.0, 85.0)  # polar angles at which a model is tried before it is planned
_PHI_DEG = (0.0, 90.0, 180.0)  # azimuths of the viewer there

_TASK = 20_000_000  # memory of every task [byte]: the interpreter, and the directions of the error measurement
# Memory of the planner's layouts [byte]. Measured peaks: copper at 41 wavelengths 119 MB for a tolerance of 0.01 and
# 377 MB for 0.001; grey foam 49 MB for 0.0001
_PLAN = 10_000_000  # memory of a plan without wavelengths
_PLAN_WAVELENGTH = 3_000_000  # additional memory per wavelength
_FINE = 0.005  # tolerance below which a plan takes more memory
_FINE_TIMES = 4  # factor of the memory of such a plan
_SLAB = 1 << 17  # directions that a block evaluates at once, or one row of the grid if that is more
_PLAIN = 40  # memory of intermediates per direction of a slab [byte], over light and viewer; measured: 22 to 36
_HALF = 250  # the same over half vectors; measured: 237
_SPECTRUM = 45  # memory per wavelength and direction [byte] of spectra that are evaluated at once; measured: 35 to 44
_VALUE = 16  # memory per value of a block [byte]: float32, the copy of the codec, the encoded bytes and their copy
_ROW = 80  # memory of the error measurement per value of a row [byte], for five rows; measured: 60 to 80
_DRAW = 1_500_000  # memory of the error measurement per wavelength [byte]: the values at the drawn directions


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
    stored: int = 0  # size of the revision that answers the job [byte]

    @property
    def size(self) -> int:
        """Number of values to compute."""
        return sum(self.block_values)


def survey(root: str, job: Job, *, sync: bool = True) -> Survey:
    """Return the survey of a job: a task for a worker, because it plans the layout of a missing table.

    The values that a plan has computed are staged as the blocks of the table, if the disk has room for them. Without
    `sync` the caller syncs them.
    """
    store = Path(root)
    name = job.name
    request = job.request
    head = head_of(store, name)
    status = standing(store, name, request)
    if status.state != "missing":
        return Survey(status, head, stored=revision_bytes(store, name, status.revision))
    text = planned(store, name, request)
    tabulated = False
    if text is None:
        check_values(job)
        layout, values = job.planned()
        text = json.dumps(layout.document())
        try:
            with Lock(store, name, wait=False):
                staging = prepare(store, name, request, text)
                if values is not None and size_on_disk(layout) <= free_bytes(store):
                    for number, rows in enumerate(layout.blocks):
                        write_block(str(staging), text, number, values[rows], sync=sync)
                    tabulated = True
        except BusyError:
            pass  # another build has the lock and most likely builds this table
    layout = Layout.from_document(json.loads(text))
    rest = layout.size // layout.shape[0]
    block_values = tuple((rows.stop - rows.start) * rest for rows in layout.blocks)
    staged = stored_bytes([request_path(store, name, digest(request)) / "table"])
    disk = 0 if tabulated else max(0, size_on_disk(layout) - staged)
    return Survey(
        status,
        head,
        layout=text,
        shape=tuple(layout.shape),
        wavelengths=0 if layout.wavelength_nm is None else layout.wavelength_nm.size,
        block_values=block_values,
        task_bytes=memory_of_task(layout),
        disk_bytes=disk,
        tabulated=tabulated,
    )


def staged_blocks(root: Path, job: Job) -> list[Path]:
    """Return the files of the blocks of a table that is staged."""
    return [path for path in (request_path(root, job.name, digest(job.request)) / "table").rglob("*") if path.is_file()]


def cost_of_plan(job: Job) -> int:
    """Return a number that grows with the time of a plan: that of its wavelengths."""
    return 1 if job.wavelength_nm is None else job.wavelength_nm.size


def cost_of_table(job: Job, survey: Survey) -> float:
    """Return a number that grows with the time of a table: its size, or infinity if it is measured on an integral."""
    return survey.size if job.planned_on is None else math.inf


def check_values(job: Job) -> None:
    """Raise ParameterError if the model gives values at a few directions that no BRDF has: nan, infinite, negative."""
    theta = np.radians(_THETA_DEG)
    theta_i, theta_r, phi_r = (axis.ravel() for axis in np.meshgrid(theta, theta, np.radians(_PHI_DEG)))
    wi = unit_vector(theta_i, np.zeros_like(phi_r))
    wr = unit_vector(theta_r, phi_r)
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


def memory_of_plan(wavelengths: int, tolerance: float) -> int:
    """Return the memory [byte] that the planner takes for a material at a number of wavelengths."""
    return (_PLAN + _PLAN_WAVELENGTH * wavelengths) * (1 if tolerance >= _FINE else _FINE_TIMES)


def memory_of_task(layout: Layout) -> int:
    """Return the memory [byte] that one task of a table takes: a block, or measuring its error."""
    wavelengths = 1 if layout.wavelength_nm is None else layout.wavelength_nm.size
    directions = math.prod(layout.grid.shape[1:])
    slab = max(directions, min(_SLAB, directions * layout.block_rows))
    one_by_one = layout.plain and not layout.grid.half_difference
    spectrum = 0 if one_by_one else _SPECTRUM * wavelengths * slab
    row = math.prod(layout.shape[1:])
    block = slab * (_HALF if layout.grid.half_difference else _PLAIN) + spectrum + _VALUE * row * layout.block_rows
    return _TASK + max(block, _ROW * row + _DRAW * wavelengths)


def size_on_disk(layout: Layout) -> int:
    """Return the largest size [byte] of the values of a table on the disk: rounded bits are zeros and compress."""
    return layout.size * (9 + layout.bits) // 8


def machine_memory() -> int | None:
    """Return the memory [byte] of this machine; None where the system does not tell."""
    if not hasattr(os, "sysconf"):
        return None
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def check_memory(what: str, need: int, memory: int | None) -> None:
    """Raise ParameterError if a task needs more memory [byte] than is allowed; None allows any."""
    if memory is not None and need > memory:
        raise ParameterError(
            "memory", f"{what} takes about {terminal.size(need)}; {terminal.size(memory)} are allowed", memory
        )


def check_disk(need: int, directory: Path) -> None:
    """Raise ParameterError if the file system of a directory has less than `need` [byte] free; it need not exist."""
    free = free_bytes(directory)
    if need > free:
        raise ParameterError(
            "disk", f"the tables take up to {terminal.size(need)}, and {directory} has {terminal.size(free)} free"
        )


def free_bytes(directory: Path) -> int:
    """Return the space [byte] that is free on the file system of a directory, which need not exist."""
    there = next(path for path in (directory, *directory.absolute().parents) if path.exists())
    return shutil.disk_usage(there).free


def stored_bytes(directories: Sequence[Path]) -> int:
    """Return the size [byte] of all files below directories, which need not exist."""
    return sum(
        os.lstat(os.path.join(folder, file)).st_size
        for directory in directories
        for folder, _, files in os.walk(directory)
        for file in files
    )
